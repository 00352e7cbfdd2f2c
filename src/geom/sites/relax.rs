//! Relaxation: sites repel their neighbours along the surface until the spacing is even.

use super::surface::{Place, Surface};
use crate::geom::tree::Tree;
use crate::par;
use glam::DVec3;

/// Sites per parallel task.
const BLOCK: usize = 256;
/// Moves of every site.
const N_ROUNDS: usize = 60;
/// Rounds that one list of neighbours serves.
const ROUNDS_PER_LIST: usize = 5;
/// Reach of the repulsion in the first and the second half of the rounds, in hexagonal spacings.
const REACH: [f64; 2] = [2.0, 1.5];
/// How much farther than the reach neighbours are listed, in hexagonal spacings.
const SKIN: f64 = 0.2;
/// Share of the step that would balance a site against resting neighbours.
const STEP: f64 = 1.4;
/// Longest step, in hexagonal spacings.
const LONGEST: f64 = 0.25;
/// Cosine between the normals of two sites below which they are on different sheets of a wall.
const SHEET: f64 = -0.5;

/// Moves `places` apart; also sorts them so that neighbours in the list are near each other.
pub(super) fn relax(surface: &Surface, places: &mut Vec<Place>) {
    let hexagonal = (2.0 / 3f64.sqrt() * surface.area / places.len() as f64).sqrt();
    let order = Tree::build(&points(places)).into_order();
    *places = order.into_iter().map(|i| places[i as usize]).collect();
    for round in (0..N_ROUNDS).step_by(ROUNDS_PER_LIST) {
        let reach = REACH[2 * round / N_ROUNDS] * hexagonal;
        let lists = neighbours(surface, places, reach + SKIN * hexagonal);
        for _ in 0..ROUNDS_PER_LIST {
            let at = points(places);
            par::for_each_block(places, BLOCK, |block, places| {
                for (place, list) in places.iter_mut().zip(&lists[block]) {
                    let normal = surface.normals[place.face as usize];
                    let step = repulsion(place.point, list, &at, reach);
                    let along =
                        (step - normal * normal.dot(step)).clamp_length_max(LONGEST * hexagonal);
                    *place = surface.walk(*place, along);
                }
            });
        }
    }
}

fn points(places: &[Place]) -> Vec<DVec3> {
    places.iter().map(|p| p.point).collect()
}

/// For each block and each site in it, the other sites within `radius` on the same sheet.
fn neighbours(surface: &Surface, places: &[Place], radius: f64) -> Vec<Vec<Vec<u32>>> {
    let at = points(places);
    let tree = Tree::build(&at);
    let normal = |i: usize| surface.normals[places[i].face as usize];
    let list = |i: usize| {
        let mut list = Vec::new();
        tree.within(at[i], radius, |j, _| {
            if j as usize != i && normal(i).dot(normal(j as usize)) > SHEET {
                list.push(j);
            }
        });
        list
    };
    par::map_blocks(places.len(), BLOCK, |range| range.map(list).collect())
}

/// Newton step of a site against linear springs that push until `reach`, neighbours held fast.
fn repulsion(point: DVec3, list: &[u32], at: &[DVec3], reach: f64) -> DVec3 {
    let (mut force, mut n_near) = (DVec3::ZERO, 0.0);
    for &j in list {
        let away = point - at[j as usize];
        let distance = away.length();
        if distance < reach && distance > 0.0 {
            force += away * ((reach - distance) / distance);
            n_near += 1.0;
        }
    }
    if n_near > 0.0 { force * (STEP / n_near) } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use crate::geom::Mesh;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::spacing::Spacing;
    use crate::par;
    use glam::DVec3;

    fn cuboid(size: DVec3) -> Mesh {
        let corner =
            |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * size;
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh { vertices: (0..8).map(corner).collect(), triangles }
    }

    #[test]
    fn sites_are_even_on_a_cuboid_and_the_same_for_any_thread_count() {
        let mesh = cuboid(DVec3::new(30.0, 20.0, 10.0));
        assert!((mesh.volume() - 6000.0).abs() < 1e-9);
        let options = SiteOptions { n_sites: 2000, ..SiteOptions::default() };
        let one = par::with_threads(1, || sample(&mesh, &options).unwrap()).unwrap();
        let three = par::with_threads(3, || sample(&mesh, &options).unwrap()).unwrap();
        assert_eq!(one, three);
        assert_eq!(one.len(), 2000);
        let spacing = Spacing::measure(&one).unwrap();
        assert!(spacing.cv < 0.12, "{spacing:?}");
    }
}
