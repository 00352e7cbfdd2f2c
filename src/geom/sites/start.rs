//! Start of the relaxation: points of equal area along a space-filling order of the faces.

use super::surface::{Place, Surface};
use crate::exec::par;
use crate::numeric::rng::{Purpose, Stream};
use crate::spatial::morton;
use glam::DVec3;

/// Fractional part of the golden ratio: the most even one-dimensional sequence.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// `n` places, systematic by area: the faces, laid one after another in Z-order, are cut into `n`
/// pieces of equal area with one point each, so every region gets its share of points.
///
/// Inside a face the points form a golden-ratio lattice, mapped to the triangle without changing areas.
pub(super) fn place(surface: &Surface, n: usize, seed: u64) -> Vec<Place> {
    let mut stream = Stream::new(seed, 0, 0, Purpose::Sites);
    let (offset, shift) = (stream.unit(), stream.unit());
    let order = z_order(surface);
    let mut ends = Vec::with_capacity(order.len());
    let mut total = 0.0;
    for &face in &order {
        total += surface.areas[face as usize];
        ends.push(total);
    }
    let mut at = 0;
    (0..n)
        .map(|i| {
            let target = (i as f64 + offset) / n as f64 * total;
            while at + 1 < ends.len() && ends[at] <= target {
                at += 1;
            }
            let face = order[at];
            let area = surface.areas[face as usize];
            let u = ((target - (ends[at] - area)) / area).clamp(0.0, 1.0);
            let v = (shift + GOLDEN * i as f64).fract();
            Place { point: in_triangle(surface.mesh.corners(face as usize), u, v), face }
        })
        .collect()
}

/// The unit square mapped to a triangle, equal areas to equal areas; `u` runs from the corner
/// opposite the shortest edge to that edge.
fn in_triangle(corners: [DVec3; 3], u: f64, v: f64) -> DVec3 {
    let length = |k: usize| (corners[(k + 2) % 3] - corners[(k + 1) % 3]).length_squared();
    let tip = (0..3).fold(0, |best, k| if length(k) < length(best) { k } else { best });
    let [a, b, c] = [corners[tip], corners[(tip + 1) % 3], corners[(tip + 2) % 3]];
    a + (b - a + (c - b) * v) * u.sqrt()
}

/// Faces with area, by the Z-order of their centroids (ties: index).
fn z_order(surface: &Surface) -> Vec<u32> {
    let mesh = surface.mesh;
    let (low, high) = mesh.bounds().unwrap_or_default();
    let cells = f64::from((1u32 << morton::BITS) - 1);
    let scale = cells / (high - low).max_element().max(f64::MIN_POSITIVE);
    let key = |face: u32| {
        let [a, b, c] = mesh.corners(face as usize);
        let cell = ((a + b + c) / 3.0 - low) * scale;
        morton::encode(cell.to_array().map(|x| x.clamp(0.0, cells) as u32))
    };
    let faces = (0..mesh.triangles.len() as u32).filter(|&f| surface.areas[f as usize] > 0.0);
    let mut keyed: Vec<(u64, u32)> = faces.map(|f| (key(f), f)).collect();
    par::sort_by_key(&mut keyed, |&k| k);
    keyed.into_iter().map(|(_, face)| face).collect()
}
