//! The unit of length of a STEP file.

use super::records::{Records, flat, named, number, records, references};
use monstertruck::step::load::step_p21::ast::{EntityInstance, Parameter};
use std::collections::BTreeSet;

/// Millimeters per unit of length; of a file that states none, one.
///
/// # Errors
/// If its contexts state different units, or one that is not known.
pub fn millimeters(entities: &[EntityInstance]) -> Result<f64, String> {
    let records = records(entities);
    let mut used: Vec<u64> = Vec::new();
    for records in records.values() {
        let context = records.iter().find(|record| record.name == "GLOBAL_UNIT_ASSIGNED_CONTEXT");
        used.extend(context.iter().flat_map(|record| references(&record.parameter)));
    }
    // Files without a context name their unit all the same.
    let of_contexts = used.iter().filter(|id| is_length(&records, **id));
    let mut ids: BTreeSet<u64> = of_contexts.copied().collect();
    if ids.is_empty() {
        ids = records.keys().filter(|id| is_length(&records, **id)).copied().collect();
    }
    let mut sizes: Vec<f64> = Vec::new();
    for id in ids {
        let size = size(&records, id, 0)?;
        if !sizes.iter().any(|other| (other - size).abs() <= 1e-9 * size) {
            sizes.push(size);
        }
    }
    match sizes[..] {
        [] => Ok(1.0),
        [size] => Ok(size),
        _ => {
            sizes.sort_by(f64::total_cmp);
            let words: Vec<String> = sizes.iter().map(|size| format!("{size} mm")).collect();
            Err(format!("units of length of {}: one is read", words.join(" and ")))
        }
    }
}

fn is_length(records: &Records, id: u64) -> bool {
    records.get(&id).is_some_and(|records| named(records, "LENGTH_UNIT").is_some())
}

/// Millimeters of the unit `id`, which is an SI unit or a multiple of another.
fn size(records: &Records, id: u64, depth: usize) -> Result<f64, String> {
    let unknown = || format!("the unit of length #{id} is not known");
    let unit = records.get(&id).filter(|_| depth < 8).ok_or_else(unknown)?;
    if let Some(si) = named(unit, "SI_UNIT") {
        let words: Vec<&str> = flat(&si.parameter).filter_map(word).collect();
        let (prefix, name) = match words[..] {
            [prefix, name] => (prefix, name),
            [name] => ("", name),
            _ => return Err(unknown()),
        };
        let power = match prefix {
            "" => 3,
            "KILO" => 6,
            "HECTO" => 5,
            "DECA" => 4,
            "DECI" => 2,
            "CENTI" => 1,
            "MILLI" => 0,
            "MICRO" => -3,
            "NANO" => -6,
            _ => return Err(unknown()),
        };
        return if name == "METRE" { Ok(10f64.powi(power)) } else { Err(unknown()) };
    }
    let of = named(unit, "CONVERSION_BASED_UNIT").ok_or_else(unknown)?;
    let measure = references(&of.parameter).last().copied().ok_or_else(unknown)?;
    let measure = records.get(&measure).ok_or_else(unknown)?;
    let parameters = || measure.iter().flat_map(|record| flat(&record.parameter));
    let factor = parameters().find_map(number).ok_or_else(unknown)?;
    let other = measure.iter().flat_map(|record| references(&record.parameter)).next();
    let size = factor * size(records, other.ok_or_else(unknown)?, depth + 1)?;
    if size.is_finite() && size > 0.0 { Ok(size) } else { Err(unknown()) }
}

fn word(parameter: &Parameter) -> Option<&str> {
    match parameter {
        Parameter::Enumeration(word) => Some(word),
        _ => None,
    }
}
