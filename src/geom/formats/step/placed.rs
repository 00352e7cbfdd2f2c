//! The solids of a STEP file and where they are.

use super::parts::{Body, Placed};
use super::records::Records;
use super::{guarded, mapped};
use glam::{DMat4, DVec4};
use monstertruck::assembly::assy::{EdgeEntity, NodeEntity};
use monstertruck::meshing::prelude::Matrix4;
use monstertruck::step::load::Table;
use monstertruck::step::load::convert::{AssembleEntity, ProductEntity};
use std::collections::BTreeSet;

/// Places of parts in an assembly: few levels that each place the next twice make any number.
const MOST_PLACES: usize = 100_000;

/// All bodies, in the order of their numbers.
///
/// # Errors
/// If there is none, or the place of one is not known: where, and what was found.
pub fn placed(table: &Table, records: &Records) -> Result<Vec<Placed>, (String, String)> {
    let refused = |found: String| ("assembly".to_string(), found);
    let bodies: BTreeSet<Body> = match table.manifold_solid_brep.is_empty() {
        false => table.manifold_solid_brep.keys().map(|id| Body::Solid(*id)).collect(),
        true => table.shell_based_surface_model.keys().map(|id| Body::Shells(*id)).collect(),
    };
    if bodies.is_empty() {
        return Err(("text".into(), "there is no solid in it".into()));
    }
    let mapped = mapped::placed(records, &bodies).map_err(refused)?;
    let mut placed = match (mapped, table.next_assembly_usage_occurrence.is_empty()) {
        (None, true) => {
            let place = DMat4::IDENTITY;
            return Ok(bodies.into_iter().map(|body| Placed { body, place }).collect());
        }
        (None, false) => guarded(|| in_assembly(table, &bodies)).flatten().map_err(refused)?,
        (Some(placed), true) => placed,
        (Some(_), false) => {
            let found = "parts are placed by MAPPED_ITEM and by NEXT_ASSEMBLY_USAGE_OCCURRENCE, \
                         of which one is read";
            return Err(refused(found.into()));
        }
    };
    // Tables are hashed: their order is another in every run.
    placed.sort_by(|a, b| {
        let places = |placed: &Placed| placed.place.to_cols_array();
        let order = places(a).into_iter().zip(places(b)).map(|(x, y)| x.total_cmp(&y));
        a.body.cmp(&b.body).then_with(|| {
            order.into_iter().find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    let missing = bodies.iter().find(|body| !placed.iter().any(|placed| placed.body == **body));
    match missing {
        None => Ok(placed),
        Some(body) => Err((body.name(), "its place in the assembly is not known".into())),
    }
}

fn in_assembly(table: &Table, bodies: &BTreeSet<Body>) -> Result<Vec<Placed>, String> {
    let assembly = table.step_assy().map_err(super::one_line)?;
    let node = |node: &ProductEntity| NodeEntity { shape: of_node(table, node, bodies), attrs: () };
    let edge = |edge: &AssembleEntity| EdgeEntity {
        matrix: Matrix4::try_from(&edge.matrix).ok().unwrap_or(Matrix4::from_scale(f64::NAN)),
        attrs: (),
    };
    let assembly = assembly.map(node, edge);
    let (mut placed, mut n_paths) = (Vec::new(), 0);
    for top in assembly.top_nodes() {
        for path in assembly.paths_iter(top.index()) {
            n_paths += 1;
            if n_paths > MOST_PLACES {
                return Err(format!("more than {MOST_PLACES} places of parts"));
            }
            let m = path.matrix();
            let columns = [m.x, m.y, m.z, m.w].map(|c| DVec4::new(c.x, c.y, c.z, c.w));
            let [x, y, z, w] = columns;
            let place = DMat4::from_cols(x, y, z, w);
            let bodies = path.terminal_node().shape().clone();
            if !bodies.is_empty() && !place.is_finite() {
                return Err("a placement cannot be read".into());
            }
            placed.extend(bodies.into_iter().map(|body| Placed { body, place }));
        }
    }
    Ok(placed)
}

/// The bodies of a part of an assembly: of its representation, and of one that this one is related to.
fn of_node(table: &Table, node: &ProductEntity, bodies: &BTreeSet<Body>) -> Vec<Body> {
    let related = table.shape_representation_of_node(node);
    let related = related.map(|id| table.solids_via_shape_relationship(id).0).unwrap_or_default();
    let mut found: Vec<Body> = Vec::new();
    for id in node.shape.iter().copied().chain(related) {
        for body in [Body::Solid(id), Body::Shells(id)] {
            if bodies.contains(&body) && !found.contains(&body) {
                found.push(body);
            }
        }
    }
    found
}

/// What is left out beside solids, in words.
pub fn left_out(table: &Table) -> Option<String> {
    let n = table.shell_based_surface_model.len();
    let is_left_out = n > 0 && !table.manifold_solid_brep.is_empty();
    is_left_out.then(|| format!("{n} bodies of surfaces beside the solids are left out"))
}
