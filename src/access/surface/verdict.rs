//! What one site and one direction come to.

use super::drop;
use super::tool::{Contact, Outline, Stand, axes};
use crate::cutter::Cutter;
use crate::geom::Mesh;
use crate::{Error, Result};
use glam::{DVec3, Vec3};

/// Whether a tool may stand somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// No part of the tool penetrates the surface.
    Free,
    /// Only the tip does: it does not fit there.
    TipGouges,
    /// A step (shank, holder, spindle) does.
    Collides,
}

impl Verdict {
    /// From how far the tool would have to be raised, mm, until the steps and until the tip are clear.
    pub(super) fn of(raise: Raise) -> Self {
        match raise {
            Raise { steps, .. } if steps > 0.0 => Verdict::Collides,
            Raise { tip, .. } if tip > 0.0 => Verdict::TipGouges,
            _ => Verdict::Free,
        }
    }
}

/// How far a tool must be raised along its axis until it is clear of the surface, mm: its drop height above
/// where it stands. Negative if it could be lowered, −∞ if it would never meet the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raise {
    /// For the steps.
    pub steps: f64,
    /// For the tip.
    pub tip: f64,
}

/// How far `cutter`, shrunk by `tolerance_mm` and with its reference point at `reference`, mm, must be raised along
/// `direction` until it is clear of all triangles of `mesh`. Plain loops over closed formulas in `f64`.
///
/// # Errors
/// If the direction has no length, or the tolerance is not positive or not below the cutter's radius.
pub fn raise(
    mesh: &Mesh,
    cutter: &Cutter,
    tolerance_mm: f64,
    reference: DVec3,
    direction: Vec3,
) -> Result<Raise> {
    let outline = Outline::new(cutter);
    outline.check_tolerance(tolerance_mm)?;
    if !direction.is_normalized() {
        let remedy = "normalize it";
        return Err(Error::argument("direction", direction, "a unit vector", remedy));
    }
    let stand = Stand { reference, axes: axes(direction) };
    let triangles = (0..mesh.triangles.len()).map(|f| mesh.corners(f));
    Ok(raise_over(triangles, &outline, tolerance_mm, &stand))
}

/// As [`raise`], for a tool that touches a site.
pub(super) fn raise_at(
    triangles: &[[DVec3; 3]],
    outline: &Outline,
    tolerance: f64,
    contact: &Contact,
    direction: Vec3,
) -> Raise {
    let axes = axes(direction);
    let reference = contact.reference_point(outline, axes[2]);
    raise_over(triangles.iter().copied(), outline, tolerance, &Stand { reference, axes })
}

fn raise_over(
    triangles: impl Iterator<Item = [DVec3; 3]>,
    outline: &Outline,
    tolerance: f64,
    stand: &Stand,
) -> Raise {
    let mut raise = Raise { steps: f64::NEG_INFINITY, tip: f64::NEG_INFINITY };
    for corners in triangles {
        let corners = stand.triangle(&corners);
        for [height, radius] in outline.steps(tolerance) {
            raise.steps = raise.steps.max(drop::disc(&corners, radius) - height);
        }
        raise.tip = raise.tip.max(drop::tip(&corners, outline.tip(tolerance)));
    }
    raise
}
