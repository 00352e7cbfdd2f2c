//! The gouge tolerance: how deep a tool may seem to cut where it only touches.
//!
//! # Definition
//!
//! Facets of a concave curve stand off the curve that they replace by their *chord error*, and a tool that touches the
//! curve seems to cut them by as much. So the tolerance belongs to the facet that is met, wherever the tool touches:
//!
//! ```text
//! τ(facet) = 0.01 mm + 1.1 · e · min(1, R·κ)          R = radius of the tool's lower end
//! ```
//!
//! `κ` is the facet's concave curvature and `e` the greatest distance between the facet and a surface of that curvature
//! through its corners. A tool of radius `R < 1/κ` that touches two facets leaves only `R·κ` of `e` between them. Both
//! come from the facet's width and its turns against the three neighbors (Grinspun, Gingold, Reisman and Zorin 2006,
//! Computing discrete shape operators on general meshes):
//!
//! ```text
//! Λ = Σ over its edges of  w(ratio) · θ/h · t tᵀ      θ: concave turn; h: height of the facet on the edge; t: across the edge
//! e = max over the facet of ½ Σ λᵢλⱼ (pᵢ − pⱼ)ᵀ Λ (pᵢ − pⱼ)                λ: barycentric coordinates
//! κ = greatest eigenvalue of Λ
//! ```
//!
//! For a strip of width `b` that turns by θ this is `b·θ/8`. `ratio` is the neighbor's height over the facet's own:
//! facets of one curve have similar widths, a plane beside a fillet does not belong to it. Turns above 36° (ten facets
//! to the turn) count less and less, from 45° on they are corners. A turn counts if the curve goes on: if one of the
//! two facets turns again across from it, as strongly. Two planes that meet in a blunt edge are no curve.
//!
//! A face that meets a facet of a curve in a corner, as the top of a bore does, is granted what that is: their edge is
//! a chord.
//!
//! More than two triangles that hang together in one plane are one facet of a curve if it goes on at two of their
//! sides: their area and sides are those of a strip that another bore crosses, or of a facet that was subdivided. What
//! lies in one plane beside such a facet is granted how far it reaches in between the chord and a parabola over it.

use super::bvh::Bvh;
use super::chords::Chords;
use super::tool::Outline;
use crate::Result;
use crate::exec::par;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// By how much, in mm, the tool is shrunk all around before it is tested.
///
/// ```
/// use deepmill::access::surface::{ContactTolerance, SurfaceOptions};
///
/// let strict = SurfaceOptions::default().with_tolerance(ContactTolerance::AtMost(0.02)); // coarse facets grant no more
/// assert!(matches!(SurfaceOptions::default().tolerance, ContactTolerance::Tessellation));
/// assert!(matches!(strict.tolerance, ContactTolerance::AtMost(0.02)));
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ContactTolerance {
    /// [`LEAST_MM`], and more against facets of concave curves: their chord error.
    #[default]
    Tessellation,
    /// As `Tessellation`, but no more than this, mm.
    AtMost(f64),
    /// This much against every facet.
    #[serde(rename = "millimetres", alias = "millimeters")]
    Millimeters(f64),
}

/// The tolerance where facets imply no more, mm.
pub const LEAST_MM: f64 = 0.01;

/// Sites per task.
const BLOCK: usize = 256;
/// A site is on the facets within this share of the part's size.
const ON_FACET: f64 = 1e-6;

/// The tolerance against every triangle of a search tree, for one tool, mm.
#[derive(Debug, Clone)]
pub(super) struct Tolerances {
    /// The least.
    pub least: f64,
    /// The greatest.
    pub most: f64,
    /// By place in the tree; empty if all are the least.
    by_place: Vec<f64>,
}

impl Chords {
    /// The chord errors, as if they were tolerances.
    pub fn as_tolerances(&self, bvh: &Bvh) -> Tolerances {
        let error = |place: u32| self.at(bvh.face(place)).error;
        let by_place: Vec<f64> = (0..bvh.n_triangles() as u32).map(error).collect();
        let most = by_place.iter().fold(0.0, |a: f64, b| a.max(*b));
        Tolerances { least: 0.0, most, by_place }
    }
}

impl Tolerances {
    /// For the triangle at a place of the tree.
    #[inline(always)]
    pub fn at(&self, place: u32) -> f64 {
        self.by_place.get(place as usize).copied().unwrap_or(self.least)
    }
}

impl ContactTolerance {
    /// The tolerance against every triangle; `chords` are of the faces that come first in `bvh`.
    ///
    /// # Errors
    /// If a given tolerance is not positive or not below the cutter's radius, or the cutter's radius not above
    /// [`LEAST_MM`].
    pub(super) fn of_triangles(
        self,
        outline: &Outline,
        chords: &Chords,
        bvh: &Bvh,
    ) -> Result<Tolerances> {
        let uniform = |mm: f64| Tolerances { least: mm, most: mm, by_place: Vec::new() };
        let cap = match self {
            ContactTolerance::Millimeters(given) => {
                return outline.check_tolerance(given).map(uniform);
            }
            ContactTolerance::AtMost(cap) => outline.check_tolerance(cap)?,
            ContactTolerance::Tessellation => f64::INFINITY,
        };
        let least = outline.check_tolerance(LEAST_MM)?.min(cap);
        let radius = outline.radius();
        let granted = |face: u32| {
            (least + chords.at(face).granted(radius))
                .min(cap)
                .min(GREATEST_SHARE * radius)
                .max(least)
        };
        let n = bvh.n_triangles();
        let most = (0..n as u32).map(|place| granted(bvh.face(place))).fold(least, f64::max);
        if most == least {
            return Ok(uniform(least));
        }
        let by_place = (0..n as u32).map(|place| granted(bvh.face(place))).collect();
        Ok(Tolerances { least, most, by_place })
    }
}

/// A tool that shrinks by more than this share of its radius is another tool: turns of 36° on a sphere imply less.
const GREATEST_SHARE: f64 = 0.5;

impl Tolerances {
    /// The greatest tolerance against the triangles that every site lies on, mm.
    pub fn at_sites(&self, bvh: &Bvh, sites: &[DVec3]) -> Vec<f64> {
        if self.by_place.is_empty() {
            return vec![self.least; sites.len()];
        }
        let near = ON_FACET * bvh.radius();
        let at = |i: usize| {
            let mut tolerance = self.least;
            bvh.near(sites[i], near, |place| {
                if self.at(place) > tolerance && is_on(bvh.triangle(place), sites[i], near) {
                    tolerance = self.at(place);
                }
                false
            });
            tolerance
        };
        let blocks = par::map_blocks(sites.len(), BLOCK, |range| range.map(at).collect::<Vec<_>>());
        blocks.into_iter().flatten().collect()
    }
}

/// Whether a point is within `near` of a triangle.
fn is_on(corners: &[DVec3; 3], p: DVec3, near: f64) -> bool {
    super::penetrate::ball(&corners.map(|corner| corner - p), near)
}
