//! Relaxation: sites repel their neighbors along the surface until the spacing is even.
//!
//! All sites move at once, each by a damped Newton step down its own energy with its neighbors
//! held fast, so the result depends on neither thread count nor order. The force `(R/r − 1)³` falls
//! to zero at the reach `R` and grows without bound for near pairs: it evens out what is measured,
//! the distance to the nearest neighbor. A long reach comes first to even out the density, a short
//! one then settles the pattern. Cost: 7 to 14 pairs per site and move.

use super::sheet::same_sheet;
use super::surface::{Place, Surface};
use crate::exec::par;
use crate::spatial::KdTree;
use glam::DVec3;

// Tuned on the parts of docs/sites.md. Lengths are in hexagonal spacings: the distance between
// neighbors if the area were a plane in hexagonal packing.

/// Reach of the repulsion, lists of neighbors made, and moves of every site that each list serves.
/// The last moves have fresh lists because sites that step onto the rim of a thin wall only then meet
/// those of its other side.
const PHASES: [(f64, usize, usize); 3] = [(2.0, 6, 5), (1.5, 5, 5), (1.5, 5, 1)];
/// How much farther than the reach neighbors are listed.
const SKIN: f64 = 0.2;
/// Share of the Newton step.
const STEP: f64 = 0.7;
/// Longest step.
const LONGEST: f64 = 0.25;
/// Sites per parallel task.
const BLOCK: usize = 256;

/// Moves `places` apart; also sorts them so that neighbors in the list are near each other.
pub(super) fn relax(surface: &Surface, places: &mut Vec<Place>) {
    let spacing = (2.0 / 3f64.sqrt() * surface.area / places.len() as f64).sqrt();
    let order = KdTree::build(&points(places)).into_order();
    *places = order.into_iter().map(|i| places[i as usize]).collect();
    for (reach, n_lists, n_moves) in PHASES {
        for _ in 0..n_lists {
            let near = neighbors(surface, places, (reach + SKIN) * spacing);
            for _ in 0..n_moves {
                step_all(surface, places, &near, reach * spacing, LONGEST * spacing);
            }
        }
    }
}

fn step_all(surface: &Surface, places: &mut [Place], near: &[Near], reach: f64, longest: f64) {
    let at = points(places);
    par::for_each_block(places, BLOCK, |block, places| {
        for (i, place) in places.iter_mut().enumerate() {
            let normal = surface.normals[place.face as usize];
            let near = &near[block];
            let step = newton_step(BLOCK * block + i, normal, near.of(i), &at, reach);
            let tangent = step - normal * normal.dot(step);
            *place =
                surface.walk(*place, (tangent * STEP).clamp_length_max(longest), near.sheets[i]);
        }
    });
}

/// Force on site `i` over the mean stiffness of its pairs. Two sites at one point part sideways.
fn newton_step(i: usize, normal: DVec3, near: &[u32], at: &[DVec3], reach: f64) -> DVec3 {
    let (mut force, mut stiffness) = (DVec3::ZERO, 0.0);
    for &j in near {
        let mut away = at[i] - at[j as usize];
        let mut square = away.length_squared();
        if square == 0.0 {
            let side = if i < j as usize { 1e-3 } else { -1e-3 };
            away = normal.any_orthonormal_vector() * (side * reach);
            square = away.length_squared();
        }
        if square < reach * reach {
            let distance = square.sqrt();
            let gap = reach / distance - 1.0;
            force += away * (gap * gap * gap / distance);
            stiffness += 1.5 * gap * gap * reach / square;
        }
    }
    if stiffness > 0.0 { force / stiffness } else { DVec3::ZERO }
}

fn points(places: &[Place]) -> Vec<DVec3> {
    places.iter().map(|p| p.point).collect()
}

/// The neighbors of one block of sites, one after another, and the normals for which they hold.
struct Near {
    sheets: Vec<DVec3>,
    ends: Vec<u32>,
    sites: Vec<u32>,
}

impl Near {
    /// Neighbors of the `i`-th site of the block.
    fn of(&self, i: usize) -> &[u32] {
        let begin = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.sites[begin as usize..self.ends[i] as usize]
    }
}

/// For each site the others on its sheet within `radius`.
fn neighbors(surface: &Surface, places: &[Place], radius: f64) -> Vec<Near> {
    let at = points(places);
    let tree = KdTree::build(&at);
    let normal = |i: usize| surface.normals[places[i].face as usize];
    par::map_blocks(places.len(), BLOCK, |range| {
        let sheets = range.clone().map(normal).collect();
        let mut near = Near { sheets, ends: Vec::with_capacity(range.len()), sites: Vec::new() };
        for i in range {
            tree.within(at[i], radius, |j, _| {
                let j = j as usize;
                if j != i && same_sheet(at[j] - at[i], normal(i), normal(j)) {
                    near.sites.push(j as u32);
                }
            });
            near.ends.push(near.sites.len() as u32);
        }
        near
    })
}
