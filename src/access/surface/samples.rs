//! Points of the triangles: obstacles that are tested first, since a tool that holds one certainly penetrates.

use super::tool::Contact;
use crate::geom::mesh::has_area;
use glam::DVec3;

/// `n` points, even by area, and every corner if there are no more than `n` of them; relative to `origin`. None is of a
/// triangle without area.
///
/// Places on the triangles follow Roberts's R2 sequence (2018, The unreasonable effectiveness of quasirandom
/// sequences).
pub(super) fn points(triangles: &[[DVec3; 3]], n: usize, origin: DVec3) -> Vec<DVec3> {
    if n == 0 {
        return Vec::new();
    }
    let mut points = Vec::with_capacity(2 * n);
    each(triangles, n, |_, point| points.push(point - origin));
    points.extend(corners(triangles, n).into_iter().map(|p| p - origin));
    points
}

/// `n` sites of the triangles, even by area, with the normals of these.
pub(super) fn sites(triangles: &[[DVec3; 3]], n: usize) -> Vec<Contact> {
    let mut sites = Vec::with_capacity(n);
    each(triangles, n, |[a, b, c], point| {
        sites.push(Contact { point, normal: (b - a).cross(c - a).try_normalize() });
    });
    sites.retain(|site| site.normal.is_some());
    sites
}

/// Calls `then` with `n` points, even by area, and their triangles.
fn each(triangles: &[[DVec3; 3]], n: usize, mut then: impl FnMut([DVec3; 3], DVec3)) {
    let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let total: f64 = triangles.iter().map(area).sum();
    let (mut before, mut k) = (0.0, 0.0);
    for corners in triangles {
        let after = before + area(corners);
        while k < n as f64 && (k + 0.5) * total < after * n as f64 {
            k += 1.0;
            then(*corners, at(corners, k));
        }
        before = after;
    }
}

/// The different corners if they are at most `n`, else none.
fn corners(triangles: &[[DVec3; 3]], n: usize) -> Vec<DVec3> {
    // A closed mesh has half as many corners as triangles.
    if triangles.len() > 2 * n + 1000 {
        return Vec::new();
    }
    let mut all: Vec<DVec3> = triangles.iter().filter(|t| has_area(t)).flatten().copied().collect();
    let key = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    all.sort_unstable_by_key(key);
    all.dedup_by_key(|p| key(p));
    all
}

/// Term `k` of the sequence, folded into the triangle.
fn at([a, b, c]: &[DVec3; 3], k: f64) -> DVec3 {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let [u, v] = [1.0 / PLASTIC, 1.0 / (PLASTIC * PLASTIC)].map(|step| (0.5 + k * step).fract());
    let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
    *a + (*b - *a) * u + (*c - *a) * v
}
