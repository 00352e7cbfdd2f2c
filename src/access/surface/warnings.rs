//! Warnings about inputs that make exact answers misleading: a wrong unit, too few sites, a coarse tessellation.

use super::faces::faces;
use super::obstacles::TriangleObstacles;
use super::tolerance::{ContactTolerance, LEAST_MM};
use super::tool::Outline;
use crate::Result;
use crate::access::evidence::SurfaceEvidence;
use crate::geom::{Mesh, Sites};
use crate::tool::cutter::{Cutter, Profile};
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
    /// Sites that are accessible by a tolerance above [`WIDE_MM`] alone: see [`SurfaceEvidence::rests_on_tolerance`].
    RestsOnTolerance {
        /// Their number.
        n_sites: usize,
        /// Their share of the sites.
        share: f64,
        /// Greatest tolerance of a facet under a site, mm.
        greatest_mm: f64,
    },
    /// Facets that stand farther off their curve than what may remain: what is said to remain there is the mesh's own.
    FinishBelowChord {
        /// Share of the sites.
        share: f64,
        /// The finish tolerance, mm.
        finish_mm: f64,
        /// Greatest chord error under a site, mm.
        chord_mm: f64,
    },
    /// A clearance of what does not cut that puts much of the part out of reach.
    ClearanceCloses {
        /// The clearance, mm.
        clearance_mm: f64,
        /// Share of the sites that are accessible without it, and not with it.
        share: f64,
        /// Whether nothing is left.
        closes_all: bool,
    },
    /// A tool given by its profile: of the directions between those of the set only those that the part suggests are
    /// tested, and directions are not counted.
    Profile {
        /// Share of the sites with a free pose and no proven retreat, which count as inaccessible.
        unproven_share: f64,
    },
    /// A drill or a reamer: what is accessible is reached by drilling, in bores of its own diameter.
    Drill,
    /// Sites whose answer rests on roundings: see [`SurfaceStats::borderline`](super::SurfaceStats::borderline).
    Borderline {
        /// Share of the sites.
        share: f64,
    },
}

/// Boxes without an edge this long may be in inches, mm.
const TINY_MM: f64 = 10.0;
/// Tolerances above this are warned about, mm.
pub const WIDE_MM: f64 = 5.0 * LEAST_MM;
/// Share of borderline sites above which they are warned about.
const BORDERLINE_SHARE: f64 = 0.001;
/// Millimeters to the inch.
const INCH_MM: f64 = 25.4;

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Warning::SmallerThanTool { longest_mm, diameter_mm } => write!(
                f,
                "the part is {longest_mm:.3} mm long at most, the cutter {diameter_mm} mm wide: check the unit and the cutter"
            ),
            Warning::Tiny { longest_mm } => write!(
                f,
                "the part is {longest_mm:.3} mm long at most; read in inches it has {:.1} mm",
                longest_mm * INCH_MM
            ),
            Warning::FacesWithoutSites { n_faces, n_without, area_share, spacing_mm } => write!(
                f,
                "{n_without} of {n_faces} faces ({:.2} % of the surface) hold no site, with one site per \
                 {spacing_mm:.2} mm × {spacing_mm:.2} mm: nothing is said of them; take more sites",
                100.0 * area_share
            ),
            Warning::CoarseTessellation { share, implied_mm, granted_mm } => write!(
                f,
                "the facets are coarser than the tolerance at {} of the sites: they imply up to {implied_mm:.3} mm, \
                 {granted_mm:.3} mm is granted; leave out the tolerance or export a finer mesh",
                percent(share)
            ),
            Warning::WideTolerance { share, greatest_mm } => write!(
                f,
                "coarse facets make the tolerance more than {WIDE_MM} mm at {} of the sites, up to {greatest_mm:.3} mm: \
                 export a finer mesh to notice shallower collisions",
                percent(share)
            ),
            Warning::RestsOnTolerance { n_sites, share, greatest_mm } => write!(
                f,
                "{n_sites} sites ({}) are accessible only because the tool may seem to cut more than {WIDE_MM} mm there, up to \
                 {greatest_mm:.3} mm: export a finer mesh, or give a tolerance",
                percent(share)
            ),
            Warning::FinishBelowChord { share, finish_mm, chord_mm } => write!(
                f,
                "the finish tolerance of {finish_mm} mm is below the chord error of the mesh at {} of the sites, up to {chord_mm:.3} mm: \
                 export a finer mesh, or raise the finish tolerance",
                percent(share)
            ),
            Warning::ClearanceCloses { clearance_mm, share, closes_all: true } => write!(
                f,
                "the clearance of {clearance_mm} mm closes every pose at every site; without it {} of the sites are accessible: \
                 take a lesser one, or a longer tool",
                percent(share)
            ),
            Warning::ClearanceCloses { clearance_mm, share, closes_all: false } => write!(
                f,
                "the clearance of {clearance_mm} mm alone puts {} of the sites out of reach: take a lesser one, or a longer tool",
                percent(share)
            ),
            Warning::Profile { unproven_share } => write!(
                f,
                "the tool is given by its profile: of the directions between those of the set only those that flat and round \
                 faces suggest are tested; {}",
                retreats(unproven_share, "sites")
            ),
            Warning::Drill => f.write_str(
                "the tool is a drill or a reamer: what it reaches is reached by drilling, in bores of its own diameter",
            ),
            Warning::Borderline { share } => write!(
                f,
                "the answers of up to {:.2} % of the sites rest on roundings: the tool touches exactly; change the tolerance a little",
                100.0 * share
            ),
        }
    }
}

/// A share in words: none that is there is said to be 0.
/// What is known of the retreats of a tool that is given by its profile.
pub(crate) fn retreats(unproven_share: f64, of: &str) -> String {
    match unproven_share {
        0.0 => "a retreat is proven wherever a pose is free".to_string(),
        share => format!(
            "no retreat is proven from the free poses at {} of the {of}, which count as inaccessible",
            percent(share)
        ),
    }
}

fn percent(share: f64) -> String {
    match share > 0.0 && share < 0.0005 {
        true => "less than 0.1 %".into(),
        false => format!("{:.1} %", 100.0 * share),
    }
}

impl TriangleObstacles {
    /// Warnings about the answers for `sites` of `part`, of which these obstacles were made, from their evidence.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    ///
    /// # Panics
    /// If the evidence is about other sites.
    pub fn warnings(
        &self,
        part: &Mesh,
        sites: &Sites,
        cutter: &Cutter,
        evidence: &SurfaceEvidence,
    ) -> Result<Vec<Warning>> {
        let outline = Outline::new(cutter, evidence.finish_mm);
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
        let granted = &evidence.tolerance_mm;
        assert_eq!(granted.len(), sites.len(), "evidence about these sites");
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
        if cutter.profile().is_some_and(Profile::is_drill) {
            warnings.push(Warning::Drill);
        } else if cutter.profile().is_some() {
            let unproven = evidence.retreat_unproven.iter().filter(|unproven| **unproven).count();
            warnings.push(Warning::Profile { unproven_share: share(unproven) });
        }
        let rests = evidence.rests_on_tolerance.iter().filter(|rests| **rests).count();
        if rests > 0 {
            warnings.push(Warning::RestsOnTolerance {
                n_sites: rests,
                share: share(rests),
                greatest_mm: granted.iter().fold(0.0, |a: f64, b| a.max(*b)),
            });
        }
        let chords = self.chords.as_tolerances(&self.bvh).at_sites(&self.bvh, &points);
        let coarser = || chords.iter().filter(|chord| **chord > evidence.finish_mm);
        if coarser().next().is_some() {
            warnings.push(Warning::FinishBelowChord {
                share: share(coarser().count()),
                finish_mm: evidence.finish_mm,
                chord_mm: coarser().fold(0.0, |a: f64, b| a.max(*b)),
            });
        }
        let on_edge = evidence.stats.borderline as f64 / n;
        if on_edge > BORDERLINE_SHARE {
            warnings.push(Warning::Borderline { share: on_edge });
        }
        Ok(warnings)
    }
}

/// A clearance is warned about if it closes at least this share of the sites.
const CLOSED_SHARE: f64 = 0.05;

impl Warning {
    /// About a clearance that closes this share of the sites, if that is much; of which `is_reached` says whether
    /// something is left.
    pub fn of_clearance(clearance_mm: f64, share: f64, is_reached: bool) -> Option<Self> {
        let closes_all = !is_reached && share > 0.0;
        let is_much = closes_all || share >= CLOSED_SHARE;
        is_much.then_some(Warning::ClearanceCloses { clearance_mm, share, closes_all })
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
    use super::super::{FINISH_MM, SurfaceOptions, SurfaceStats};
    use super::*;
    use crate::answers::SiteAnswer;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use crate::tool::directions::Directions;
    use glam::{DVec3, dvec3};

    fn warnings(mesh: &Mesh, n_sites: usize, cr: f64, tolerance: ContactTolerance) -> Vec<Warning> {
        let sites = sample(mesh, &SiteOptions { n_sites, ..SiteOptions::default() }).unwrap();
        let cutter = Cutter::ball_end([cr, 20.0, 20.0, 5.0].into()).unwrap();
        let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
        let options = SurfaceOptions { tolerance, occlusion: false, ..SurfaceOptions::default() };
        let up = Directions::up();
        let labels = obstacles.surface_labels(&sites, &cutter, &up, &options).unwrap();
        obstacles.warnings(mesh, &sites, &cutter, &labels.evidence).unwrap()
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
        assert!(tiny[1].to_string().contains("read in inches it has 76.2 mm"), "{}", tiny[1]);
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
        let [
            Warning::CoarseTessellation { share, implied_mm, granted_mm: 0.01 },
            Warning::FinishBelowChord { finish_mm: FINISH_MM, chord_mm, .. },
        ] = given[..]
        else {
            panic!("{given:?}")
        };
        assert!(share > 0.1 && share < 0.9 && implied_mm > WIDE_MM, "{share} {implied_mm}");
        let implied = warnings(&mesh, 400, 2.0, ContactTolerance::Tessellation);
        let [Warning::WideTolerance { greatest_mm, .. }, Warning::FinishBelowChord { .. }] =
            implied[..]
        else {
            panic!("{implied:?}")
        };
        assert_eq!(greatest_mm, implied_mm);
        // A tool much narrower than the curve leaves only a part of the chord error.
        assert!(chord_mm > implied_mm, "{chord_mm}");
    }

    #[test]
    fn answers_that_rest_on_a_wide_tolerance_are_counted() {
        // A bore in facets that stand 0.1 mm off its circle, and outside where none does.
        let (radius, n) = (10.0, 22);
        let chord = radius * (1.0 - (std::f64::consts::PI / f64::from(n)).cos());
        assert!(chord > 0.1, "{chord}");
        let outline = |radius: f64| {
            (0..n).map(move |k| {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(n);
                (radius * angle.cos(), radius * angle.sin())
            })
        };
        let mut mesh = Mesh::default();
        for (radius, z) in [(20.0, 0.0), (20.0, 30.0), (radius, 30.0), (radius, 0.0)] {
            mesh.vertices.extend(outline(radius).map(|(x, y)| dvec3(x, y, z)));
        }
        let n = n as u32;
        for ring in 0..4u32 {
            for k in 0..n {
                let (next, k1) = ((ring + 1) % 4, (k + 1) % n);
                let [a, b, c, d] = [ring * n + k, ring * n + k1, next * n + k1, next * n + k];
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let sites = sample(&mesh, &SiteOptions { n_sites: 600, ..SiteOptions::default() }).unwrap();
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let options = SurfaceOptions { occlusion: false, ..SurfaceOptions::default() };
        let rests = |cr: f64, options: &SurfaceOptions| {
            let cutter = Cutter::flat_end([cr, 60.0, cr + 5.0, 5.0].into()).unwrap();
            let up = Directions::up();
            let labels = obstacles.surface_labels(&sites, &cutter, &up, options).unwrap();
            let of: Vec<bool> =
                labels.answers.iter().map(|a| *a == SiteAnswer::Accessible).collect();
            let found = (&of[..], &labels.evidence.witness[..]);
            let rests =
                obstacles.rest_on_wide_tolerance(&sites, &cutter, &up, options, found).unwrap();
            let none = obstacles
                .rest_on_wide_tolerance(&sites, &cutter, &up, options, (&of[..], &[]))
                .unwrap();
            assert_eq!(rests, none, "witnesses only save time");
            (of, rests)
        };
        let (of, found) = rests(9.94, &options);
        let capped = SurfaceOptions { tolerance: ContactTolerance::AtMost(WIDE_MM), ..options };
        let (of_capped, none) = rests(9.94, &capped);
        assert!(none.iter().all(|rests| !rests));
        for (i, (p, normal)) in sites.points.iter().zip(&sites.normals).enumerate() {
            assert_eq!(found[i], of[i] && !of_capped[i], "{p}");
            let in_bore = normal.z.abs() < 0.5 && p.truncate().length() < 11.0;
            assert!(in_bore || !found[i], "{p}");
        }
        assert!(found.iter().filter(|rests| **rests).count() > 20);
        assert!(rests(5.0, &options).1.iter().all(|rests| !rests), "far narrower");
    }

    #[test]
    fn a_clearance_that_closes_every_pose_is_said() {
        let words = |share, is_reached| Warning::of_clearance(30.0, share, is_reached);
        let all = words(0.72, false).unwrap().to_string();
        assert!(all.contains("30 mm closes every pose") && all.contains("72.0 %"), "{all}");
        let much = words(0.3, true).unwrap().to_string();
        assert!(much.contains("30 mm alone puts 30.0 %"), "{much}");
        assert_eq!((words(0.01, true), words(0.0, false)), (None, None));
        // A holder with a margin of more than the tool sticks out.
        let mesh = solids::cuboid(DVec3::splat(20.0));
        let sites = sample(&mesh, &SiteOptions { n_sites: 200, ..SiteOptions::default() }).unwrap();
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let options = SurfaceOptions { occlusion: false, ..SurfaceOptions::default() };
        let cutter = Cutter::ball_end([3.0, 20.0, 25.0, 40.0].into()).unwrap();
        let with = cutter.with_clearance(30.0).unwrap();
        let labels = obstacles.surface_labels(&sites, &with, &Directions::up(), &options).unwrap();
        let answered = (&options, &labels.answers[..]);
        let up = Directions::up();
        let share = obstacles.share_closed_by_clearance(&sites, &cutter, &up, answered).unwrap();
        assert!((share - 5.0 / 6.0).abs() < 0.01, "{share}");
        assert_eq!(labels.share(SiteAnswer::Accessible), 0.0);
    }

    #[test]
    fn borderline_sites_are_counted() {
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
            let up = Directions::up();
            let labels = obstacles.surface_labels(&sites, &cutter, &up, &options).unwrap();
            assert_eq!(labels.evidence.stats.borderline, expected, "{cr} {:?}", labels.answers);
            let found = obstacles.warnings(&walls, &sites, &cutter, &labels.evidence).unwrap();
            assert_eq!(found.contains(&Warning::Borderline { share: 1.0 }), expected == 1);
        }
        assert_eq!(SurfaceStats::default().borderline, 0);
    }
}
