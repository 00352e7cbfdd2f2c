//! Tools of any profile among others: each is labeled as it is held, and without its holder.
//!
//! Of their least stick-outs no more is known than whether their own does: a retreat moves the holder across its axis.

use super::ToolReach;
use crate::Result;
use crate::access::surface::{SiteAnswer, SurfaceOptions, TriangleObstacles};
use crate::cutter::Assembly;
use crate::directions::Directions;
use crate::geom::Sites;

impl TriangleObstacles {
    pub(super) fn reach_of_profile(
        &self,
        sites: &Sites,
        tool: &Assembly,
        (directions, options): (&Directions, &SurfaceOptions),
    ) -> Result<ToolReach> {
        let held = self.label(sites, &tool.cutter()?, directions, options)?;
        let body = self.label(sites, &tool.body_cutter()?, directions, options)?;
        let reaches = |answer: &SiteAnswer| *answer == SiteAnswer::Accessible;
        let least = |answer: &SiteAnswer| match reaches(answer) {
            true => tool.stick_out_mm(),
            false => f64::INFINITY,
        };
        // The search may find a pose of the whole tool and none of its body.
        let both = held.answers.iter().zip(&body.answers);
        Ok(ToolReach {
            body_reaches: both.map(|(held, body)| reaches(held) || reaches(body)).collect(),
            least_stick_out_mm: held.answers.iter().map(least).collect(),
            answers: held.answers,
            witness: held.witness,
        })
    }
}
