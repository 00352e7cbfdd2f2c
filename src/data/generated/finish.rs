//! From a solid to a finished part: one body, placed, corners rounded to f32, checked.

use super::solid::Solid;
use crate::geom::check::{self, Fault};
use crate::geom::{Mesh, intersect, weld};
use crate::numeric::rng::Stream;
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;

/// Details smaller than this are removed, mm: a tenth of what any process holds.
const DETAIL_MM: f64 = 1e-3;
/// Share of the volume that may fall off when cuts meet.
const MAX_LOOSE: f64 = 0.02;
/// Longest box edges of a part as drawn, mm.
const LONGEST_MM: std::ops::Range<f64> = 40.0..250.0;

/// The finished part, or `None` if what was drawn is not one sound body of a fitting size.
pub(super) fn finish(solid: &Solid, turn: &DMat3) -> Option<Mesh> {
    let (low, high) = solid.to_mesh().bounds()?;
    if !LONGEST_MM.contains(&(high - low).max_element()) {
        return None;
    }
    let mesh = placed(largest_piece(solid)?.simplified(DETAIL_MM).to_mesh(), turn)?;
    let mesh = rounded(&mesh);
    is_sound(&mesh).then_some(mesh)
}

/// How a part lies: six in ten as drawn, a quarter on another side, the rest rotated at random.
pub(super) fn orientation(random: &mut Stream) -> DMat3 {
    let choice = random.unit();
    if choice < 0.6 {
        return DMat3::IDENTITY;
    }
    if choice < 0.85 {
        const X: DVec3 = DVec3::X;
        const Y: DVec3 = DVec3::Y;
        const Z: DVec3 = DVec3::Z;
        let sides = [[X, -Y, -Z], [X, Z, -Y], [X, -Z, Y], [-Z, Y, X], [Z, Y, -X]];
        let [x, y, z] = sides[random.below(sides.len())];
        return DMat3::from_cols(x, y, z);
    }
    let mut normal = || random.normal();
    let turn = DQuat::from_xyzw(normal(), normal(), normal(), normal());
    DMat3::from_quat(turn.normalize())
}

/// The largest connected piece, if hardly anything else is there.
fn largest_piece(solid: &Solid) -> Option<Solid> {
    let total = solid.volume();
    let pieces = solid.pieces();
    let largest = pieces.into_iter().max_by(|a, b| a.volume().total_cmp(&b.volume()))?;
    let loose = (total - largest.volume()).abs();
    (total > 0.0 && loose <= MAX_LOOSE * total).then_some(largest)
}

/// Turned, then centered in x and y, standing on z = 0.
fn placed(mut mesh: Mesh, turn: &DMat3) -> Option<Mesh> {
    mesh.vertices.iter_mut().for_each(|v| *v = *turn * *v);
    let (low, high) = mesh.bounds()?;
    let origin = (0.5 * (low + high)).with_z(low.z);
    mesh.vertices.iter_mut().for_each(|v| *v -= origin);
    Some(mesh)
}

/// Corners rounded to f32, so that a binary STL holds the part exactly; corners that then
/// coincide are joined and triangles that vanish are dropped.
fn rounded(mesh: &Mesh) -> Mesh {
    let mut index = HashMap::with_capacity(mesh.vertices.len());
    let mut vertices = Vec::with_capacity(mesh.vertices.len());
    let mut join = |v: u32| {
        let corner = mesh.vertices[v as usize].as_vec3() + glam::Vec3::ZERO;
        *index.entry(corner.to_array().map(f32::to_bits)).or_insert_with(|| {
            vertices.push(corner.as_dvec3());
            vertices.len() as u32 - 1
        })
    };
    let triangles = mesh.triangles.iter().map(|t| t.map(&mut join));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    Mesh { vertices, triangles }
}

/// One closed body that faces outward, every triangle with an area, none through another, and no
/// two corners that a reader would join.
fn is_sound(mesh: &Mesh) -> bool {
    let report = check::check(mesh);
    let joined = || weld::weld(mesh, weld::DEFAULT_TOLERANCE).map_or(0, |m| m.vertices.len());
    report.blocking().is_none()
        && report.count(Fault::Degenerate) == 0
        && joined() == mesh.vertices.len()
        && intersect::pairs(mesh).is_empty()
}
