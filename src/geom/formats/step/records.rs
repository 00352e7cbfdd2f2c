//! The records of a STEP file, by their numbers.

use monstertruck::step::load::step_p21::ast::{EntityInstance, Name, Parameter, Record};
use std::collections::HashMap;

/// The records of every entity: one, or several where it is of several kinds.
pub type Records<'a> = HashMap<u64, &'a [Record]>;

pub fn records(entities: &[EntityInstance]) -> Records<'_> {
    entities.iter().map(of_entity).collect()
}

fn of_entity(entity: &EntityInstance) -> (u64, &[Record]) {
    match entity {
        EntityInstance::Simple { id, record } => (*id, std::slice::from_ref(record)),
        EntityInstance::Complex { id, subsuper } => (*id, &subsuper.0[..]),
    }
}

pub fn named<'a>(records: &'a [Record], name: &str) -> Option<&'a Record> {
    records.iter().find(|record| record.name == name)
}

/// The values of a record, in order.
pub fn values(record: &Record) -> &[Parameter] {
    match &record.parameter {
        Parameter::List(list) => list,
        _ => &[],
    }
}

/// A parameter and all in it.
pub fn flat(parameter: &Parameter) -> Box<dyn Iterator<Item = &Parameter> + '_> {
    match parameter {
        Parameter::List(list) => Box::new(list.iter().flat_map(flat)),
        Parameter::Typed { parameter, .. } => flat(parameter),
        other => Box::new(std::iter::once(other)),
    }
}

pub fn references(parameter: &Parameter) -> Vec<u64> {
    let id = |parameter: &Parameter| match parameter {
        Parameter::Ref(Name::Entity(id)) => Some(*id),
        _ => None,
    };
    flat(parameter).filter_map(id).collect()
}

pub fn number(parameter: &Parameter) -> Option<f64> {
    match parameter {
        Parameter::Real(x) => Some(*x),
        Parameter::Integer(n) => Some(*n as f64),
        _ => None,
    }
}
