//! Directions that a part suggests: across its flat faces and along its round ones.
//!
//! A cutter of a slot, a drill in a bore fit in one direction, to fractions of a degree: no even set has it.
//!
//! ```text
//! round faces: the edges at which two triangles turn by 0.1° to 40°, by the area of the two
//! flat faces: the normals of all other triangles, by their area
//! within 0.05° of each other: one, the first by area
//! the 24 of the greatest area, both ways
//! ```

use crate::access::surface::bvh::Bvh;
use glam::DVec3;
use std::f64::consts::PI;

/// Turns of facets of one round face, radians.
const TURNS: [f64; 2] = [0.1 * PI / 180.0, 40.0 * PI / 180.0];
/// Axes nearer than this, as the sine of the angle, are one.
const SAME: f64 = 1e-3;
const MOST_AXES: usize = 24;
/// No more groups are made.
const MOST_GROUPS: usize = 256;
/// Least share of all area.
const LEAST_SHARE: f64 = 1e-3;

/// The axes, unit vectors, one of both ways each; the one of the greatest area first.
pub(super) fn axes_of(bvh: &Bvh) -> Vec<DVec3> {
    let places = 0..bvh.n_triangles() as u32;
    let of = |place: u32| {
        let [a, b, c] = *bvh.triangle(place);
        (b - a).cross(c - a)
    };
    let doubled: Vec<DVec3> = places.clone().map(of).collect();
    let total: f64 = doubled.iter().map(|normal| normal.length()).sum();
    let mut found: Vec<(f64, DVec3)> = Vec::new();
    let mut is_round = vec![false; doubled.len()];
    for ([from, to], places) in shared_edges(bvh) {
        let [m, n] = places.map(|place| doubled[place as usize]);
        let turn = libm::atan2(m.cross(n).length(), m.dot(n));
        if (TURNS[0]..TURNS[1]).contains(&turn) {
            found.push((0.5 * (m.length() + n.length()), to - from));
            places.iter().for_each(|place| is_round[*place as usize] = true);
        }
    }
    let flat = doubled.iter().zip(&is_round).filter(|(_, is_round)| !**is_round);
    found.extend(flat.map(|(normal, _)| (normal.length(), *normal)));
    // The heaviest first; equal ones in the order of the tree.
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut groups: Vec<(f64, DVec3)> = Vec::new();
    for (area, along) in found {
        let Some(axis) = along.try_normalize() else { continue };
        let same = |group: &(f64, DVec3)| group.1.cross(axis).length() < SAME;
        match groups.iter().position(same) {
            Some(k) => groups[k].0 += area,
            None if groups.len() < MOST_GROUPS => groups.push((area, axis)),
            None => {}
        }
    }
    groups.sort_by(|a, b| b.0.total_cmp(&a.0));
    let wide = groups.iter().take(MOST_AXES).filter(|group| group.0 >= LEAST_SHARE * total);
    wide.map(|group| group.1).collect()
}

/// Edges that two triangles share, and the places of these.
fn shared_edges(bvh: &Bvh) -> Vec<([DVec3; 2], [u32; 2])> {
    let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut edges: Vec<([[u64; 3]; 2], [DVec3; 2], u32)> = Vec::new();
    for place in 0..bvh.n_triangles() as u32 {
        let corners = bvh.triangle(place);
        for k in 0..3 {
            let ends = [corners[k], corners[(k + 1) % 3]];
            let mut keys = ends.map(key);
            keys.sort_unstable();
            edges.push((keys, ends, place));
        }
    }
    edges.sort_unstable_by_key(|(keys, _, place)| (*keys, *place));
    let pairs = edges.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 2);
    pairs.map(|pair| (pair[0].1, [pair[0].2, pair[1].2])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Mesh, solids};

    fn tree(mesh: &Mesh) -> Bvh {
        let corners: Vec<_> = (0..mesh.triangles.len()).map(|f| mesh.corners(f)).collect();
        Bvh::new(&corners)
    }

    #[test]
    fn a_block_has_three_axes_and_a_prism_that_of_its_walls() {
        let axes = axes_of(&tree(&solids::cuboid(DVec3::new(3.0, 4.0, 5.0))));
        assert_eq!(axes.len(), 3);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            assert_eq!(axes.iter().filter(|a| a.dot(axis).abs() > 1.0 - 1e-12).count(), 1);
        }
        // Turned: the axis of a round wall in no direction of any set.
        let n = 48u32;
        let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
        let mut mesh = Mesh::default();
        for k in 0..n {
            let angle = 2.0 * PI * f64::from(k) / f64::from(n);
            for z in [0.0, 30.0] {
                mesh.vertices.push(turn * DVec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), z));
            }
            let (a, b) = (2 * k, 2 * ((k + 1) % n));
            mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
        let axes = axes_of(&tree(&mesh));
        assert!(axes[0].dot(turn * DVec3::Z).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn nothing_suggests_nothing() {
        assert_eq!(axes_of(&Bvh::new(&[])), []);
    }
}
