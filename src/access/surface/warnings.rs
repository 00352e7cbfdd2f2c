//! Warnings about inputs that make exact answers misleading: a wrong unit, too few sites, a coarse tessellation.

use super::faces::faces;
use super::labels::SurfaceLabels;
use super::obstacles::TriangleObstacles;
use super::tolerance::{ContactTolerance, LEAST_MM};
use super::tool::Outline;
use crate::Result;
use crate::cutter::Cutter;
use crate::geom::{Mesh, Sites};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What may make an answer misleading, with its numbers. Its text says what to do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "warning", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Warning {
    /// No edge of the part's box is as long as the cutter is wide.
    SmallerThanTool {
        /// Longest edge of the box, mm.
        longest_mm: f64,
        /// Diameter of the cutter's lower end, mm.
        diameter_mm: f64,
    },
    /// No edge of the part's box is 10 mm long: perhaps the file is in inches.
    Tiny {
        /// Longest edge of the box, mm.
        longest_mm: f64,
    },
    /// Faces (smooth regions) without a site: nothing is said of them.
    FacesWithoutSites {
        /// Number of faces.
        n_faces: usize,
        /// Those without a site.
        n_without: usize,
        /// Their share of the surface.
        area_share: f64,
        /// Square root of the area that a site stands for, mm.
        spacing_mm: f64,
    },
    /// Facets that reach deeper into a tool that only touches than the tolerance grants: false collisions.
    CoarseTessellation {
        /// Share of the sites.
        share: f64,
        /// Greatest tolerance that the facets imply, mm.
        implied_mm: f64,
        /// Greatest tolerance that is granted where they do, mm.
        granted_mm: f64,
    },
    /// Facets so coarse that a tolerance far above the usual one was granted: shallow collisions pass unnoticed.
    WideTolerance {
        /// Share of the sites with more than [`WIDE_MM`].
        share: f64,
        /// Greatest tolerance, mm.
        greatest_mm: f64,
    },
    /// Sites whose answer rests on roundings: see [`SurfaceStats::knife_edge`](super::SurfaceStats::knife_edge).
    KnifeEdge {
        /// Share of the sites.
        share: f64,
    },
}

/// Boxes without an edge this long may be in inches, mm.
const TINY_MM: f64 = 10.0;
/// Tolerances above this are warned about, mm.
pub const WIDE_MM: f64 = 5.0 * LEAST_MM;
/// Share of the sites on the knife edge above which they are warned about.
const KNIFE_EDGE_SHARE: f64 = 0.001;
/// Millimeters to the inch.
const INCH_MM: f64 = 25.4;

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Warning::SmallerThanTool { longest_mm, diameter_mm } => write!(
                f,
                "the part is {longest_mm:.3} mm long at most, the cutter {diameter_mm} mm wide: check --unit and --cutter"
            ),
            Warning::Tiny { longest_mm } => write!(
                f,
                "the part is {longest_mm:.3} mm long at most; if the file is in inches, --unit in makes it {:.1} mm",
                longest_mm * INCH_MM
            ),
            Warning::FacesWithoutSites { n_faces, n_without, area_share, spacing_mm } => write!(
                f,
                "{n_without} of {n_faces} faces ({:.2} % of the surface) hold no site, with one site per \
                 {spacing_mm:.2} mm × {spacing_mm:.2} mm: nothing is said of them; raise --sites",
                100.0 * area_share
            ),
            Warning::CoarseTessellation { share, implied_mm, granted_mm } => write!(
                f,
                "the facets are coarser than the tolerance at {:.1} % of the sites: they imply up to {implied_mm:.3} mm, \
                 {granted_mm:.3} mm is granted; leave out --tolerance or export a finer mesh",
                100.0 * share
            ),
            Warning::WideTolerance { share, greatest_mm } => write!(
                f,
                "coarse facets make the tolerance more than {WIDE_MM} mm at {:.1} % of the sites, up to {greatest_mm:.3} mm: \
                 export a finer mesh to notice shallower collisions",
                100.0 * share
            ),
            Warning::KnifeEdge { share } => write!(
                f,
                "the answers of up to {:.2} % of the sites rest on roundings: the tool touches exactly; change --tolerance a little",
                100.0 * share
            ),
        }
    }
}

impl TriangleObstacles {
    /// Warnings about the answers `labels` for `sites` of `part`, which these obstacles were made of.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    ///
    /// # Panics
    /// If the labels are of other sites.
    pub fn warnings(
        &self,
        part: &Mesh,
        sites: &Sites,
        cutter: &Cutter,
        labels: &SurfaceLabels,
    ) -> Result<Vec<Warning>> {
        let outline = Outline::new(cutter, labels.finish_mm);
        let mut warnings = Vec::new();
        let (low, high) = part.bounds().unwrap_or_default();
        let longest_mm = (high - low).max_element();
        let diameter_mm = 2.0 * outline.radius();
        if longest_mm < diameter_mm {
            warnings.push(Warning::SmallerThanTool { longest_mm, diameter_mm });
        }
        if longest_mm < TINY_MM {
            warnings.push(Warning::Tiny { longest_mm });
        }
        warnings.extend(without_sites(part, sites));
        let n = sites.len().max(1) as f64;
        let share = |count: usize| count as f64 / n;
        let granted = &labels.tolerance_mm;
        assert_eq!(granted.len(), sites.len(), "labels of these sites");
        let implied = ContactTolerance::Tessellation;
        let implied = implied.of_triangles(&outline, &self.chords, &self.bvh)?;
        let points: Vec<_> = sites.points.iter().map(|p| p.as_dvec3()).collect();
        let implied = implied.at_sites(&self.bvh, &points);
        let coarse = || (0..sites.len()).filter(|&i| implied[i] > granted[i].max(LEAST_MM));
        if coarse().next().is_some() {
            warnings.push(Warning::CoarseTessellation {
                share: share(coarse().count()),
                implied_mm: coarse().map(|i| implied[i]).fold(0.0, f64::max),
                granted_mm: coarse().map(|i| granted[i]).fold(0.0, f64::max),
            });
        }
        let raised =
            || (0..sites.len()).filter(|&i| granted[i] > WIDE_MM && implied[i] >= granted[i]);
        if raised().next().is_some() {
            warnings.push(Warning::WideTolerance {
                share: share(raised().count()),
                greatest_mm: raised().map(|i| granted[i]).fold(0.0, f64::max),
            });
        }
        let on_edge = labels.stats.knife_edge as f64 / n;
        if on_edge > KNIFE_EDGE_SHARE {
            warnings.push(Warning::KnifeEdge { share: on_edge });
        }
        Ok(warnings)
    }
}

/// Faces without a site, for sites that know their triangles.
fn without_sites(part: &Mesh, sites: &Sites) -> Option<Warning> {
    let n = part.triangles.len();
    if sites.is_empty() || sites.faces.iter().any(|&face| face as usize >= n) {
        return None;
    }
    if sites.faces.len() != sites.len() {
        return None;
    }
    let first = faces(part);
    let mut areas = vec![0.0; n];
    for (f, &face) in first.iter().enumerate() {
        areas[face as usize] += 0.5 * part.area_vector(f).length();
    }
    let mut held = vec![false; n];
    sites.faces.iter().for_each(|&f| held[first[f as usize] as usize] = true);
    let all = || (0..n).filter(|&f| first[f] as usize == f && areas[f] > 0.0);
    let without = || all().filter(|&f| !held[f]);
    let total: f64 = areas.iter().sum();
    (without().next().is_some()).then(|| Warning::FacesWithoutSites {
        n_faces: all().count(),
        n_without: without().count(),
        area_share: without().map(|f| areas[f]).sum::<f64>() / total,
        spacing_mm: (total / sites.len() as f64).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::{SurfaceOptions, SurfaceStats};
    use super::*;
    use crate::directions::Directions;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use glam::{DVec3, dvec3};

    fn warnings(mesh: &Mesh, n_sites: usize, cr: f64, tolerance: ContactTolerance) -> Vec<Warning> {
        let sites = sample(mesh, &SiteOptions { n_sites, ..SiteOptions::default() }).unwrap();
        let cutter = Cutter::ball_end([cr, 20.0, 20.0, 5.0].into()).unwrap();
        let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
        let options = SurfaceOptions { tolerance, occlusion: false, ..SurfaceOptions::default() };
        let labels = obstacles.label(&sites, &cutter, &Directions::up(), &options).unwrap();
        obstacles.warnings(mesh, &sites, &cutter, &labels).unwrap()
    }

    #[test]
    fn a_plain_block_raises_no_warning_and_a_tiny_one_may_be_in_inches() {
        let usual = ContactTolerance::default();
        assert_eq!(warnings(&solids::cuboid(dvec3(40.0, 30.0, 20.0)), 300, 1.5, usual), []);
        let tiny = warnings(&solids::cuboid(dvec3(2.0, 3.0, 2.0)), 300, 2.0, usual);
        let expected = [
            Warning::SmallerThanTool { longest_mm: 3.0, diameter_mm: 4.0 },
            Warning::Tiny { longest_mm: 3.0 },
        ];
        assert_eq!(tiny, expected);
        assert!(tiny[1].to_string().contains("--unit in makes it 76.2 mm"), "{}", tiny[1]);
    }

    #[test]
    fn faces_that_no_site_is_on_are_counted_with_their_area() {
        let found = warnings(
            &solids::cuboid(dvec3(100.0, 100.0, 0.2)),
            20,
            1.5,
            ContactTolerance::default(),
        );
        let [Warning::FacesWithoutSites { n_faces: 6, n_without, area_share, spacing_mm }] =
            found[..]
        else {
            panic!("{found:?}")
        };
        let side = 20.0 / (20_000.0 + 80.0);
        assert!((area_share - n_without as f64 * side).abs() < 1e-9 && n_without > 0);
        assert!((spacing_mm - (20_080.0f64 / 20.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn facets_coarser_than_the_tolerance_are_named() {
        // Inward curved: the inside of a ring.
        let mesh = solids::torus(20.0, 5.0, 14, 16);
        let given = warnings(&mesh, 400, 2.0, ContactTolerance::Millimeters(0.01));
        let [Warning::CoarseTessellation { share, implied_mm, granted_mm: 0.01 }] = given[..]
        else {
            panic!("{given:?}")
        };
        assert!(share > 0.1 && share < 0.9 && implied_mm > WIDE_MM, "{share} {implied_mm}");
        let implied = warnings(&mesh, 400, 2.0, ContactTolerance::Tessellation);
        let [Warning::WideTolerance { greatest_mm, .. }] = implied[..] else {
            panic!("{implied:?}")
        };
        assert_eq!(greatest_mm, implied_mm);
    }

    #[test]
    fn sites_on_the_knife_edge_are_counted() {
        // The tool's flank is as far from the second wall as the tolerance makes it narrower.
        let mut walls = solids::cuboid(DVec3::splat(20.0));
        let mut other = solids::cuboid(DVec3::splat(20.0));
        other.vertices.iter_mut().for_each(|p| *p += dvec3(22.0, 0.0, 0.0));
        let n = walls.vertices.len() as u32;
        walls.vertices.extend(other.vertices);
        walls.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + n)));
        let sites = Sites::new(vec![glam::vec3(20.0, 10.0, 10.0)], vec![glam::Vec3::X]).unwrap();
        let obstacles = TriangleObstacles::new(&walls, &[]).unwrap();
        let options = SurfaceOptions {
            tolerance: ContactTolerance::Millimeters(0.25),
            occlusion: false,
            ..SurfaceOptions::default()
        };
        for (cr, expected) in [(1.125, 1), (1.12, 0), (1.13, 0)] {
            let cutter = Cutter::ball_end([cr, 30.0, 1.0 + cr, 5.0].into()).unwrap();
            let labels = obstacles.label(&sites, &cutter, &Directions::up(), &options).unwrap();
            assert_eq!(labels.stats.knife_edge, expected, "{cr} {:?}", labels.answers);
            let found = obstacles.warnings(&walls, &sites, &cutter, &labels).unwrap();
            assert_eq!(found.contains(&Warning::KnifeEdge { share: 1.0 }), expected == 1);
        }
        assert_eq!(SurfaceStats::default().knife_edge, 0);
    }
}
