//! The rule of the published labels as plain loops in `f64`, written from its text alone.
#![allow(dead_code)] // Each test file uses some of it.

use glam::{DVec3, Vec3};

/// Labels by the rule.
pub struct PlainLabels {
    pub inaccessible: Vec<bool>,
    pub occlusion: Vec<bool>,
    pub n_bottom: usize,
}

/// +z, then the upper half of 300 points of a golden-angle sphere about y.
pub fn directions() -> Vec<DVec3> {
    let mut all = vec![DVec3::Z];
    for i in 0..300 {
        let y = 2.0 * f64::from(i) / 300.0 - 1.0 + 1.0 / 300.0;
        let r = (1.0 - y * y).sqrt();
        #[allow(clippy::approx_constant)]
        let angle = f64::from(i) * 3.1415926 * (3.0 - 5f64.sqrt());
        if angle.sin() >= 0.0 {
            all.push(DVec3::new(r * angle.cos(), y, r * angle.sin()));
        }
    }
    all
}

/// Whether a point collides with the tool (CR, CH, FR, FH) whose ball has its center at `center`.
fn collides(point: DVec3, center: DVec3, d: DVec3, [cr, ch, fr, fh]: [f64; 4]) -> bool {
    let h = (point - center).dot(d);
    let r = (point - center - d * h).length();
    h > cr + ch + fh || (h > cr + ch && r <= fr) || (h > cr && r <= cr)
}

/// Labels of sites; the sites themselves block where `centroids` is `None`. Lengths in mm.
pub fn label(
    points: &[Vec3],
    normals: &[Vec3],
    cutter: [f64; 4],
    bottom_mm: f64,
    centroids: Option<&[Vec3]>,
) -> PlainLabels {
    let wide = |points: &[Vec3]| points.iter().map(|p| p.as_dvec3()).collect::<Vec<DVec3>>();
    let (sites, directions) = (wide(points), directions());
    let lowest = sites.iter().map(|s| s.z).fold(f64::INFINITY, f64::min);
    let at_bottom: Vec<bool> = sites.iter().map(|s| s.z < lowest + bottom_mm).collect();
    let center = |i: usize| sites[i] + normals[i].as_dvec3() * cutter[0];
    let blocked = |i: usize, d: DVec3| match centroids {
        Some(centroids) => wide(centroids).iter().any(|p| collides(*p, center(i), d, cutter)),
        None => (0..sites.len()).any(|j| j != i && collides(sites[j], center(i), d, cutter)),
    };
    let is_inaccessible = |i: usize| !at_bottom[i] && directions.iter().all(|d| blocked(i, *d));
    let inaccessible: Vec<bool> = (0..sites.len()).map(is_inaccessible).collect();
    let mut beta = vec![0u64; sites.len()];
    for i in (0..sites.len()).filter(|i| inaccessible[*i]) {
        for d in &directions {
            for j in (0..sites.len()).filter(|j| *j != i) {
                beta[j] += u64::from(collides(sites[j], center(i), *d, cutter));
            }
        }
    }
    let mut ranked: Vec<usize> = (0..sites.len()).filter(|i| !at_bottom[*i]).collect();
    let n_occlusion = ranked.len() / 10;
    ranked.sort_by_key(|j| (u64::MAX - beta[*j], *j));
    let mut occlusion = vec![false; sites.len()];
    ranked[..n_occlusion].iter().for_each(|&j| occlusion[j] = beta[j] > 0);
    let n_bottom = at_bottom.iter().filter(|b| **b).count();
    PlainLabels { inaccessible, occlusion, n_bottom }
}
