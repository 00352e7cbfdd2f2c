//! Bodies that `MAPPED_ITEM` places: a shape within another, once or many times.
//!
//! ```text
//! a shape = representations that are related without a transformation, with all their items
//! roots = shapes of products that no map names
//! walk(shape, place): a body among its items is at the place
//!                     for every mapped item: walk(mapped shape, place · target · origin⁻¹)
//! ```
//!
//! Mapped items of drawings place nothing.

use super::parts::{Body, Placed};
use super::records::{Records, named, number, references, values};
use glam::{DMat4, DVec3};
use monstertruck::step::load::step_p21::ast::Record;
use std::collections::{BTreeMap, BTreeSet};

/// Shapes within shapes; places of bodies, and steps to them.
const MOST_NESTED: usize = 64;
const MOST_STEPS: usize = 100_000;

/// All places of the bodies; none if no shape has a mapped item.
///
/// # Errors
/// If a place cannot be read, or there are too many.
pub fn placed(records: &Records, bodies: &BTreeSet<Body>) -> Result<Option<Vec<Placed>>, String> {
    let shapes = Shapes::of(records);
    if !shapes.items.values().flatten().any(|item| is(records, *item, "MAPPED_ITEM")) {
        return Ok(None);
    }
    let mut walk = Walk { records, shapes: &shapes, bodies, placed: Vec::new(), n_steps: 0 };
    for shape in shapes.roots(records) {
        walk.walk(shape, DMat4::IDENTITY, 0)?;
    }
    Ok(Some(walk.placed))
}

fn is(records: &Records, id: u64, name: &str) -> bool {
    records.get(&id).is_some_and(|records| named(records, name).is_some())
}

/// The references of each value of an entity of a kind.
fn all<'a>(records: &'a Records, name: &'a str) -> impl Iterator<Item = (u64, Vec<Vec<u64>>)> + 'a {
    let of = move |(id, of): (&u64, &&'a [Record])| {
        let record = named(of, name)?;
        Some((*id, values(record).iter().map(references).collect()))
    };
    records.iter().filter_map(of)
}

/// Items by shape; a shape has the least number of its representations.
struct Shapes {
    items: BTreeMap<u64, Vec<u64>>,
    of: BTreeMap<u64, u64>,
}

impl Shapes {
    fn of(records: &Records) -> Self {
        let is_shape = |of: &[Record]| of.iter().any(|r| r.name.ends_with("SHAPE_REPRESENTATION"));
        let representations = records.iter().filter(|(_, of)| is_shape(of));
        let mut of: BTreeMap<u64, u64> = representations.map(|(id, _)| (*id, *id)).collect();
        let related: Vec<[u64; 2]> = all(records, "SHAPE_REPRESENTATION_RELATIONSHIP")
            .filter(|(id, _)| !is(records, *id, "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION"))
            .filter_map(|(_, values)| match &values[..] {
                [_, _, one, other] => Some([*one.first()?, *other.first()?]),
                _ => None,
            })
            .filter(|pair| pair.iter().all(|id| of.contains_key(id)))
            .collect();
        for [one, other] in related {
            let (one, other) = (of[&one], of[&other]);
            of.values_mut().filter(|shape| **shape == one.max(other)).for_each(|shape| {
                *shape = one.min(other);
            });
        }
        let mut items: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
        for (id, shape) in &of {
            let list = records[id].iter().find_map(|r| values(r).get(1)).map(references);
            items.entry(*shape).or_default().extend(list.unwrap_or_default());
        }
        Shapes { items, of }
    }

    fn roots(&self, records: &Records) -> BTreeSet<u64> {
        let second = |values: Vec<Vec<u64>>| {
            values.get(1).and_then(|ids| ids.first()).and_then(|id| self.of.get(id)).copied()
        };
        let named = |name| all(records, name).filter_map(|(_, values)| second(values)).collect();
        let of_maps: BTreeSet<u64> = named("REPRESENTATION_MAP");
        let mut of_products: BTreeSet<u64> = named("SHAPE_DEFINITION_REPRESENTATION");
        if of_products.is_empty() {
            of_products.extend(self.items.keys());
        }
        of_products.difference(&of_maps).copied().collect()
    }
}

struct Walk<'a> {
    records: &'a Records<'a>,
    shapes: &'a Shapes,
    bodies: &'a BTreeSet<Body>,
    placed: Vec<Placed>,
    n_steps: usize,
}

impl Walk<'_> {
    fn walk(&mut self, shape: u64, place: DMat4, depth: usize) -> Result<(), String> {
        if depth > MOST_NESTED {
            return Err(format!("shapes within shapes, more than {MOST_NESTED} deep"));
        }
        let items: BTreeSet<u64> = self.shapes.items[&shape].iter().copied().collect();
        for item in items {
            self.n_steps += 1;
            if self.n_steps > MOST_STEPS {
                return Err(format!("more than {MOST_STEPS} places of parts"));
            }
            let body = [Body::Solid(item), Body::Shells(item)];
            let body = body.into_iter().find(|body| self.bodies.contains(body));
            self.placed.extend(body.map(|body| Placed { body, place }));
            if is(self.records, item, "MAPPED_ITEM") {
                let (shape, within) = self.mapped(item)?;
                self.walk(shape, place * within, depth + 1)?;
            }
        }
        Ok(())
    }

    /// The shape that an item places, and where.
    fn mapped(&self, item: u64) -> Result<(u64, DMat4), String> {
        let unknown = || format!("the place of MAPPED_ITEM #{item} cannot be read");
        let [source, target] = self.pair(item, "MAPPED_ITEM", 1).ok_or_else(unknown)?;
        let [origin, shape] = self.pair(source, "REPRESENTATION_MAP", 0).ok_or_else(unknown)?;
        let shape = self.shapes.of.get(&shape).copied().ok_or_else(unknown)?;
        let [origin, target] = [origin, target].map(|id| self.frame(id));
        Ok((shape, target.ok_or_else(unknown)? * origin.ok_or_else(unknown)?.inverse()))
    }

    /// Two references of an entity, from a value on.
    fn pair(&self, id: u64, name: &str, first: usize) -> Option<[u64; 2]> {
        let values = values(named(self.records.get(&id)?, name)?);
        let reference = |k: usize| references(values.get(k)?).first().copied();
        Some([reference(first)?, reference(first + 1)?])
    }

    /// A frame: location, z, and about where x is.
    fn frame(&self, id: u64) -> Option<DMat4> {
        let values = values(named(self.records.get(&id)?, "AXIS2_PLACEMENT_3D")?);
        let vector = |k: usize, name: &str| {
            let id = references(values.get(k)?).first().copied()?;
            self.vector(id, name)
        };
        let location = vector(1, "CARTESIAN_POINT")?;
        let z = vector(2, "DIRECTION").unwrap_or(DVec3::Z).try_normalize()?;
        let toward = vector(3, "DIRECTION").unwrap_or(DVec3::X);
        let x = (toward - z * toward.dot(z)).try_normalize();
        let x = x.unwrap_or_else(|| z.any_orthonormal_vector());
        let frame = DMat4::from_cols(
            x.extend(0.0),
            z.cross(x).extend(0.0),
            z.extend(0.0),
            location.extend(1.0),
        );
        frame.is_finite().then_some(frame)
    }

    fn vector(&self, id: u64, name: &str) -> Option<DVec3> {
        let values = values(named(self.records.get(&id)?, name)?);
        let numbers: Vec<f64> = super::records::flat(values.get(1)?).filter_map(number).collect();
        <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array)
    }
}
