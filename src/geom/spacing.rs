//! How evenly sites are spread, and whether they are dense enough for a cutter.
//!
//! `docs/sites.md` derives the advice.

use super::check::topology::Topology;
use super::sites::same_sheet;
use super::{Mesh, Sites};
use crate::exec::par;
use crate::spatial::KdTree;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Greatest distance of a point of the surface from the nearest site, in mean spacings, for sites of
/// [`sample`](super::sites::sample): 0.58 in a hexagonal lattice, at most 0.97 on the parts measured in
/// docs/sites.md.
pub(crate) const COVERING: f64 = 1.0;
/// Sites advised over those that are needed if the spacing goes with 1/√n: with few sites, many of them
/// near edges, it falls more slowly. With this share, those who follow the advice are not warned again.
const MARGIN: f64 = 1.05;
/// Sites per parallel task.
const BLOCK: usize = 1024;

/// Distances from each site to the nearest other one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
#[doc(hidden)] // of the program and benches
pub struct Spacing {
    /// Number of sites that have a neighbor.
    pub n_sites: usize,
    /// Mean, mm.
    pub mean_mm: f64,
    /// Coefficient of variation: standard deviation over mean. 0.52 for random points on a plane,
    /// 0 for a lattice.
    pub cv: f64,
    /// Least, mm.
    pub min_mm: f64,
    /// Greatest, mm.
    pub max_mm: f64,
}

impl Spacing {
    /// Straight distances, whatever lies between; `None` for fewer than two sites.
    pub fn measure(sites: &Sites) -> Option<Self> {
        Self::among(sites, |_, _| true)
    }

    /// Straight distances to the nearest site on the same sheet (see [`same_sheet`]), so that
    /// the far side of a thin wall does not count; `None` if no site has one.
    ///
    /// # Panics
    /// If a site has no normal ([`Sites::check`]).
    pub fn measure_on_sheet(sites: &Sites) -> Option<Self> {
        let at = |i: usize| (sites.points[i].as_dvec3(), sites.normals[i].as_dvec3());
        Self::among(sites, |i, j| {
            let ((p, m), (q, n)) = (at(i), at(j));
            same_sheet(p - q, m, n)
        })
    }

    fn among(sites: &Sites, count: impl Fn(usize, usize) -> bool + Sync) -> Option<Self> {
        let points: Vec<DVec3> = sites.points.iter().map(|p| p.as_dvec3()).collect();
        let tree = KdTree::build(&points);
        let nearest = |i: usize| {
            let counts = |j: u32| j as usize != i && count(i, j as usize);
            tree.nearest(points[i], f64::INFINITY, counts).map(|(_, square)| square.sqrt())
        };
        let blocks = par::map_blocks(points.len(), BLOCK, |range| {
            range.filter_map(nearest).collect::<Vec<_>>()
        });
        let distances = blocks.concat();
        if distances.is_empty() {
            return None;
        }
        let (mean_mm, cv) = mean_and_cv(&distances);
        let min_mm = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let max_mm = distances.iter().copied().fold(0.0, f64::max);
        Some(Spacing { n_sites: distances.len(), mean_mm, cv, min_mm, max_mm })
    }

    /// Compares the spacing with a cutter of ball radius `cr_mm`.
    pub fn advice(&self, cr_mm: f64) -> Advice {
        let covering_mm = COVERING * self.mean_mm;
        let enough = |radius_mm: f64| {
            let ratio = covering_mm / radius_mm;
            round_up(MARGIN * self.n_sites as f64 * ratio * ratio)
        };
        let left = cr_mm * cr_mm - covering_mm * covering_mm;
        Advice {
            cr_mm,
            mean_mm: self.mean_mm,
            n_sites: self.n_sites,
            hidden_mm: (left >= 0.0).then(|| cr_mm - left.sqrt()),
            n_sites_enough: enough(cr_mm),
            n_sites_fine: enough(cr_mm * FINE_DISC),
        }
    }
}

/// The next number with no more than two digits that are not zero.
fn round_up(count: f64) -> usize {
    let mut unit = 1.0;
    while count > 100.0 * unit {
        unit *= 10.0;
    }
    ((count / unit).ceil() * unit) as usize
}

/// Radius, in ball radii, of the disc that a ball cuts out of a plane it enters by a tenth of its
/// radius: √(2·0.1 − 0.1²).
const FINE_DISC: f64 = 0.435_889_894_354_067_4;

/// Whether sites are dense enough to notice what a cutter penetrates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of the program and benches
pub struct Advice {
    /// Ball radius of the cutter, mm.
    pub cr_mm: f64,
    /// Mean spacing of the sites, mm.
    pub mean_mm: f64,
    /// Number of sites.
    pub n_sites: usize,
    /// Depth up to which the cutter can enter a surface between the sites, mm; `None` if it can
    /// pass right through.
    pub hidden_mm: Option<f64>,
    /// Sites with which nothing that stands right across the cutter can slip between them, a few more
    /// than needed.
    pub n_sites_enough: usize,
    /// Sites with which the cutter cannot enter a surface by more than a tenth of its radius unnoticed,
    /// likewise.
    pub n_sites_fine: usize,
}

impl Advice {
    /// Whether nothing that stands right across the cutter can slip between the sites.
    pub fn is_enough(&self) -> bool {
        self.hidden_mm.is_some()
    }

    /// One line for the user if the sites are too few.
    pub fn warning(&self) -> Option<String> {
        let Advice { cr_mm, mean_mm, n_sites, n_sites_enough, .. } = self;
        (!self.is_enough()).then(|| {
            format!(
                "{n_sites} sites are {mean_mm:.2} mm apart, too far to notice all that a cutter of \
                 radius {cr_mm} mm runs into; {n_sites_enough} sites would be enough"
            )
        })
    }
}

/// Mean, and standard deviation over mean, of values summed in order.
pub(super) fn mean_and_cv(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
    (mean, if mean == 0.0 { 0.0 } else { variance.sqrt() / mean })
}

/// The area each site stands for, in units of the mean: proportional to the mean squared distance of the
/// (up to) six nearest sites on its sheet, which six hexagonal neighbors make exact. 1 where a site has
/// none within four mean spacings, and for all sites if all that have a neighbor coincide with it.
///
/// # Errors
/// If the sites fail [`Sites::check`].
pub(crate) fn relative_areas(sites: &Sites) -> Result<Vec<f64>> {
    let squares = neighbor_squares(sites)?;
    let known: Vec<f64> = squares.iter().flatten().copied().collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let area =
        |square: Option<f64>| square.map_or(1.0, |s| if mean > 0.0 { s / mean } else { 1.0 });
    Ok(squares.into_iter().map(area).collect())
}

/// The area each site stands for, mm²: proportional to the squared distances of its nearest sites, scaled to
/// `surface_mm2`, the area of the surface, or if that is not known to √3/2 of the squared distances, as in a hexagonal
/// lattice.
///
/// # Errors
/// If the sites fail [`Sites::check`], or the surface's area is negative or not finite.
pub fn areas_mm2(sites: &Sites, surface_mm2: Option<f64>) -> Result<Vec<f64>> {
    if let Some(area) = surface_mm2.filter(|area| !(*area >= 0.0 && area.is_finite())) {
        let expected = "an area of 0 mm² or more";
        return Err(Error::argument("surface_mm2", area, expected, "take the area of the mesh"));
    }
    let areas = relative_areas(sites)?;
    let total: f64 = areas.iter().sum();
    let unit = match surface_mm2 {
        Some(surface) => surface / total,
        None => {
            let squares: Vec<f64> = neighbor_squares(sites)?.into_iter().flatten().collect();
            let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
            0.75f64.sqrt() * mean
        }
    };
    Ok(areas.into_iter().map(|area| area * unit).collect())
}

/// Whether sites on a mesh stand for the same area all alike: if it is open, as a region of a part is, since sites at
/// its border lack neighbors on one side.
pub(crate) fn are_even_on(mesh: Option<&Mesh>) -> bool {
    mesh.is_some_and(|mesh| Topology::of(mesh).unbalanced().next().is_some())
}

/// The area each site stands for, mm², of sites on `mesh` if there is one: as [`areas_mm2`]; but if the mesh is open,
/// as a region of a part is, all alike, since sites at its border lack neighbors on one side.
///
/// # Errors
/// If the sites fail [`Sites::check`].
#[doc(hidden)] // of `report`
pub fn areas_on(sites: &Sites, mesh: Option<&Mesh>) -> Result<Vec<f64>> {
    match mesh {
        Some(mesh) if are_even_on(Some(mesh)) => {
            sites.check()?;
            Ok(vec![mesh.area() / sites.len().max(1) as f64; sites.len()])
        }
        _ => areas_mm2(sites, mesh.map(Mesh::area)),
    }
}

/// Per site, the mean squared distance, mm², of the (up to) six nearest sites on its sheet.
fn neighbor_squares(sites: &Sites) -> Result<Vec<Option<f64>>> {
    sites.check()?;
    let n = sites.len();
    let Some(spacing) = Spacing::measure_on_sheet(sites) else { return Ok(vec![None; n]) };
    let points: Vec<DVec3> = sites.points.iter().map(|p| p.as_dvec3()).collect();
    let tree = KdTree::build(&points);
    let square = |i: usize| {
        let normal = |i: usize| sites.normals[i].as_dvec3();
        let is_on_sheet = |j: u32| {
            let j = j as usize;
            j != i && same_sheet(points[j] - points[i], normal(i), normal(j))
        };
        let near = tree.k_nearest_within(points[i], 6, REACH * spacing.mean_mm, is_on_sheet);
        (!near.is_empty())
            .then(|| near.iter().map(|(square, _)| square).sum::<f64>() / near.len() as f64)
    };
    let blocks = par::map_blocks(n, BLOCK, |range| range.map(square).collect::<Vec<_>>());
    Ok(blocks.concat())
}

/// How far [`relative_areas`] looks for neighbors, in mean spacings.
const REACH: f64 = 4.0;

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn lattice(n: usize, pitch: f32) -> Sites {
        let points = (0..n * n).map(|i| Vec3::new((i % n) as f32, (i / n) as f32, 0.0) * pitch);
        Sites { points: points.collect(), normals: vec![Vec3::Z; n * n], faces: Vec::new() }
    }

    #[test]
    fn a_lattice_has_no_variation() {
        let spacing = Spacing::measure(&lattice(10, 0.5)).unwrap();
        let expected = Spacing { n_sites: 100, mean_mm: 0.5, cv: 0.0, min_mm: 0.5, max_mm: 0.5 };
        assert_eq!(spacing, expected);
        assert_eq!(Spacing::measure(&lattice(1, 1.0)), None);
        assert_eq!(Spacing::measure(&Sites::default()), None);
    }

    #[test]
    fn coincident_sites_have_areas_that_are_numbers() {
        let mut sites = lattice(10, 1.0);
        sites.points[1] = sites.points[0];
        let areas = relative_areas(&sites).unwrap();
        assert!(areas.iter().all(|a| *a >= 0.0 && a.is_finite()), "{areas:?}");
        let one = Sites { points: vec![Vec3::ONE; 9], normals: vec![Vec3::Z; 9], faces: vec![] };
        assert_eq!(relative_areas(&one).unwrap(), [1.0; 9]);
        assert_eq!(Spacing::measure(&one).unwrap().cv, 0.0);
        let bare = Sites { normals: vec![], ..one };
        assert!(relative_areas(&bare).unwrap_err().to_string().contains("0 normals for 9 sites"));
    }

    #[test]
    fn the_far_side_of_a_wall_counts_only_in_the_straight_measure() {
        let mut sites = lattice(10, 2.0);
        let back = lattice(10, 2.0);
        sites.points.extend(back.points.iter().map(|p| *p - Vec3::Z * 0.25));
        sites.normals.extend(vec![-Vec3::Z; 100]);
        assert_eq!(Spacing::measure(&sites).unwrap().mean_mm, 0.25);
        assert_eq!(Spacing::measure_on_sheet(&sites).unwrap().mean_mm, 2.0);
    }

    #[test]
    fn the_advised_number_is_round_removes_the_warning_and_is_not_far_too_many() {
        let with = |n: usize| {
            let mean_mm = 4.0 * (1000.0 / n as f64).sqrt();
            Spacing { n_sites: n, mean_mm, cv: 0.0, min_mm: mean_mm, max_mm: mean_mm }
        };
        for cr_mm in [0.5, 1.0, 1.5, 3.0, 3.99] {
            let advice = with(1000).advice(cr_mm);
            assert!(advice.warning().unwrap().ends_with("sites would be enough"));
            assert!(with(advice.n_sites_enough).advice(cr_mm).warning().is_none());
            assert!(with(advice.n_sites_enough * 6 / 7).advice(cr_mm).warning().is_some());
            let hidden = with(advice.n_sites_fine).advice(cr_mm).hidden_mm.unwrap();
            assert!(hidden <= 0.1 * cr_mm && hidden > 0.085 * cr_mm, "{hidden}");
        }
        assert!(with(1000).advice(4.01).is_enough());
        assert_eq!([7.2, 99.5, 100.0, 101.0, 4431.0].map(round_up), [8, 100, 100, 110, 4500]);
    }
}
