//! What one site and one direction come to.

use super::drop;
use super::tool::{Outline, Stand, axes};
use crate::geom::Mesh;
use crate::geom::mesh::WITHIN_1_KM;
use crate::tool::cutter::{Cutter, require_steps};
use crate::{Error, Result};
use glam::{DVec3, Vec3};

/// Whether a tool may stand somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verdict {
    /// No part of the tool penetrates the surface.
    Free,
    /// Only the tip does: it does not fit there.
    TipGouges,
    /// A step (shank, holder, spindle) does.
    Collides,
}

/// How far a tool must be raised along its axis until it is clear of the surface, mm: its drop height above
/// where it stands. Negative if it could be lowered, −∞ if it would never meet the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Raise {
    /// For the steps.
    pub steps: f64,
    /// For the tip.
    pub tip: f64,
}

/// How far `cutter`, shrunk by `tolerance_mm` and with its reference point at `reference`, mm, must be raised along
/// `direction` until it is clear of all triangles of `mesh` that have an area ([`Mesh::has_area`]). Plain loops over
/// closed formulas in `f64`.
///
/// # Errors
/// If the direction has no length, the tolerance is not positive or not below the cutter's radius, a face names a
/// missing vertex, or a vertex or the reference point is not finite or beyond 1 km.
pub fn raise(
    mesh: &Mesh,
    cutter: &Cutter,
    tolerance_mm: f64,
    reference: DVec3,
    direction: Vec3,
) -> Result<Raise> {
    require_steps(cutter.profile(), "label it, or give the tool by lengths")?;
    let outline = Outline::new(cutter, 0.0);
    outline.check_tolerance(tolerance_mm)?;
    if !direction.is_normalized() {
        let remedy = "normalize it";
        return Err(Error::argument("direction", direction, "a unit vector", remedy));
    }
    mesh.check_within(&WITHIN_1_KM)?;
    if !(reference.is_finite() && reference.abs().max_element() <= WITHIN_1_KM.mm) {
        let expected = "finite coordinates within 1 km";
        return Err(Error::argument("reference", reference, expected, "give it in mm"));
    }
    let stand = Stand { reference, axes: axes(direction) };
    let faces = (0..mesh.triangles.len()).filter(|&f| mesh.has_area(f));
    let triangles = faces.map(|f| (mesh.corners(f), tolerance_mm));
    Ok(raise_over(triangles, &outline, 0.0, &stand))
}

/// As [`raise`], over triangles with a tolerance each; the tool is shrunk by `more`.
pub(super) fn raise_over(
    triangles: impl Iterator<Item = ([DVec3; 3], f64)>,
    outline: &Outline,
    more: f64,
    stand: &Stand,
) -> Raise {
    let mut raise = Raise { steps: f64::NEG_INFINITY, tip: f64::NEG_INFINITY };
    for (corners, tolerance) in triangles {
        let corners = stand.triangle(&corners);
        for [height, radius] in outline.steps(tolerance) {
            if radius >= more {
                raise.steps = raise.steps.max(drop::disc(&corners, radius - more) - height - more);
            }
        }
        if tolerance + more < outline.radius() {
            raise.tip = raise.tip.max(drop::tip(&corners, outline.tip(tolerance + more)));
        }
    }
    raise
}
