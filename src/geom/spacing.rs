//! How evenly sites are spread, measured.

use super::tree::Tree;
use super::{Mesh, Sites};
use crate::par;
use crate::rng::{Purpose, Stream};
use glam::DVec3;

/// Nearest-neighbour distances of a set of sites.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// Mean distance, mm.
    pub mean_mm: f64,
    /// Standard deviation over mean.
    pub cv: f64,
    /// Least, mm.
    pub min_mm: f64,
    /// Greatest, mm.
    pub max_mm: f64,
}

impl Spacing {
    /// Straight distances to the nearest other site; `None` for fewer than two sites.
    pub fn measure(sites: &Sites) -> Option<Self> {
        Self::of(sites, |_, _| true)
    }

    /// As [`Spacing::measure`], but only sites whose normals are less than 120° apart count.
    pub fn measure_on_sheet(sites: &Sites) -> Option<Self> {
        Self::of(sites, |i, j| sites.normals[i].dot(sites.normals[j]) > -0.5)
    }

    fn of(sites: &Sites, neighbours: impl Fn(usize, usize) -> bool + Sync) -> Option<Self> {
        let points: Vec<DVec3> = sites.points.iter().map(|p| p.as_dvec3()).collect();
        let tree = Tree::build(&points);
        let blocks = par::map_blocks(points.len(), 512, |range| {
            let nearest = |i: usize| {
                tree.nearest(points[i], |j| j as usize != i && neighbours(i, j as usize))
            };
            range.filter_map(nearest).map(|(_, d2)| d2.sqrt()).collect::<Vec<_>>()
        });
        let all = blocks.concat();
        if all.is_empty() {
            return None;
        }
        let (mean_mm, cv) = mean_and_cv(&all);
        let min_mm = all.iter().copied().fold(f64::INFINITY, f64::min);
        let max_mm = all.iter().copied().fold(0.0, f64::max);
        Some(Spacing { mean_mm, cv, min_mm, max_mm })
    }
}

fn mean_and_cv(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
    (mean, variance.sqrt() / mean)
}

/// Coefficient of variation of the cells' areas.
pub fn cell_area_cv(mesh: &Mesh, sites: &Sites, per_site: usize, seed: u64) -> f64 {
    let mut ends = Vec::new();
    let mut total = 0.0;
    for f in 0..mesh.triangles.len() {
        total += mesh.area_vector(f).length();
        ends.push(total);
    }
    let points: Vec<DVec3> = sites.points.iter().map(|p| p.as_dvec3()).collect();
    let tree = Tree::build(&points);
    let n = sites.len();
    let blocks = par::map_blocks(n * per_site, 4096, |range| {
        let mut stream = Stream::new(seed, range.start as u64, 0, Purpose::Sites);
        range
            .filter_map(|_| {
                let target = stream.unit() * total;
                let f = ends.partition_point(|&e| e <= target).min(ends.len() - 1);
                let [a, b, c] = mesh.corners(f);
                let (u, v) = (stream.unit().sqrt(), stream.unit());
                let q = a + (b - a + (c - b) * v) * u;
                let m = mesh.area_vector(f).normalize().as_vec3();
                tree.nearest(q, |j| sites.normals[j as usize].dot(m) > -0.5).map(|(j, _)| j)
            })
            .collect::<Vec<_>>()
    });
    let mut counts = vec![0.0; n];
    for j in blocks.concat() {
        counts[j as usize] += 1.0;
    }
    let (mean, cv) = mean_and_cv(&counts);
    (cv * cv - 1.0 / mean).max(0.0).sqrt()
}
