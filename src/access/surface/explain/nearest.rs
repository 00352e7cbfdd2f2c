//! The pose that is nearest to being free.
//!
//! ```text
//! own poses:  the direction in which all steps have to shrink least                       (clearances of the directions)
//! all poses:  the least tolerance with which some pose of some direction tested is free   (bisection, labels)
//! the one for which the tool has to shrink less
//! ```

use super::DirectionState;
use super::case::{Barrier, Case};
use crate::Result;
use crate::access::Queries;
use crate::access::evidence::WitnessPose;
use crate::access::surface::labels::SurfaceOptions;
use crate::access::surface::tolerance::ContactTolerance;
use crate::tool::cutter::{Assembly, ToolPart};
use serde::{Deserialize, Serialize};

/// A pose in which a tool touches a site and is not free.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NearestPose {
    /// Where the tool is.
    pub pose: WitnessPose,
    /// By how much it would have to be smaller all around to be free there, mm.
    pub shrink_mm: f64,
}

/// To this the tolerance is found, mm.
const STEP_MM: f64 = 1e-3;
/// No tool is shrunk by more than this share of its radius.
const MOST: f64 = 0.9;

impl Case<'_> {
    /// The pose nearest to being free, of a site that is not accessible; none among points.
    pub(super) fn nearest_pose(
        &self,
        tool: &Assembly,
        tolerance: f64,
        nearest: Option<&DirectionState>,
    ) -> Result<Option<NearestPose>> {
        let Barrier::Triangles(triangles) = &self.barrier else { return Ok(None) };
        let (sites, cutter) = (self.site(), self.cutter(tool)?);
        let given = self.query.options;
        let free_at = |mm: f64| {
            let options = SurfaceOptions {
                tolerance: ContactTolerance::Millimeters(mm),
                refinement: None,
                ..given.for_few(1)
            };
            let labels = triangles.surface_labels(&sites, &cutter, &self.tested, &options)?;
            Ok::<_, crate::Error>(labels.evidence.witness[0])
        };
        let radius = cutter.corner_mm() + cutter.side_mm();
        let (mut low, mut high) = (tolerance, MOST * radius);
        let mut found = if high > low { free_at(high)? } else { None };
        while found.is_some() && high - low > STEP_MM {
            let middle = 0.5 * (low + high);
            match free_at(middle)? {
                Some(pose) => (high, found) = (middle, Some(pose)),
                None => low = middle,
            }
        }
        let of_all = found.map(|pose| NearestPose { pose, shrink_mm: high - tolerance });
        let problem = triangles.problem(Queries::Sites(&sites), &cutter, given)?;
        let own = nearest.map(|state| {
            let reference = problem.own_stand(0, state.direction).reference;
            let pose = WitnessPose::new(&problem.outline, reference, state.direction);
            let is_tip = |part: ToolPart| part == ToolPart::Tip;
            let by_tip = state.blocked.filter(|blocked| is_tip(blocked.part));
            let shrink_mm = by_tip.map_or(-state.clearance_mm, |blocked| blocked.penetration_mm);
            NearestPose { pose, shrink_mm }
        });
        let less = |a: NearestPose, b: NearestPose| if b.shrink_mm < a.shrink_mm { b } else { a };
        Ok(of_all.into_iter().chain(own).reduce(less))
    }
}
