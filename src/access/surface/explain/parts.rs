//! Which part of the tool keeps it from every site: the tool without its upper parts, one after the other.
//!
//! ```text
//! tip, where no step blocks some direction
//! cutter at all others
//! for the parts from the shank up: what is below it, labeled at the sites left:
//!     where that is free, this part instead; where not, done
//! ```
//!
//! A site that stays blocked, for which every direction must be tested, is labeled once. Among points, where labels of
//! several tools share their work, all are labeled.
//!
//! Of a tool given by its profile, sites that are inaccessible without spindle and holder are blocked by the shank:
//! neck, shank or what else does not cut. In no pose does only what cuts penetrate there, or they were no such sites.
//! Of the others, those that are so without the spindle are blocked by the holder. Where a pose is free and no way out
//! is proven, no part blocks.

use crate::access::surface::labels::{SurfaceLabels, SurfaceOptions};
use crate::access::surface::obstacles::TriangleObstacles;
use crate::access::{LabelOptions, Obstacles, Queries, label_many};
use crate::answers::SiteAnswer;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, Cutter, ToolPart};
use crate::tool::directions::Directions;
use crate::{Error, Result};

/// Parts whose absence is tried, from above.
const FROM_ABOVE: [ToolPart; 3] = [ToolPart::Spindle, ToolPart::Holder, ToolPart::Shank];

impl TriangleObstacles {
    /// Per site, the part of the tool that blocks in the direction which gets furthest, over the directions tested;
    /// `None` where `answers` say that the site is accessible. As
    /// [`Explanation::blocked_by`](super::Explanation::blocked_by), for all sites; of a tool given by its profile the
    /// part without which some pose is free, and `None` also where one is and no way out of it is proven.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`], or if there are not as many answers as sites.
    pub fn blocking_parts(
        &self,
        sites: &Sites,
        (tool, clearance_mm): (&Assembly, f64),
        directions: &Directions,
        (options, answers): (&SurfaceOptions, &[SiteAnswer]),
    ) -> Result<Vec<Option<ToolPart>>> {
        check_count(sites, answers.len())?;
        let mut is_free = Vec::new();
        if tool.profile().is_some() {
            let among = inaccessible(answers);
            let cutter = tool.with_clearance(clearance_mm)?.cutter()?;
            let options = options.for_few(among.len());
            let labels =
                self.surface_labels(&sites.subset(&among), &cutter, directions, &options)?;
            is_free = vec![false; answers.len()];
            among
                .iter()
                .zip(labels.evidence.retreat_unproven)
                .for_each(|(&i, free)| is_free[i] = free);
        }
        let held = (tool, clearance_mm);
        self.blocking_parts_of(sites, held, directions, (options, answers, &is_free))
    }

    /// The same, of a tool given by its profile with where a pose is free and no way out is proven.
    pub(crate) fn blocking_parts_of(
        &self,
        sites: &Sites,
        (tool, clearance_mm): (&Assembly, f64),
        directions: &Directions,
        (options, answers, is_free): (&SurfaceOptions, &[SiteAnswer], &[bool]),
    ) -> Result<Vec<Option<ToolPart>>> {
        check_count(sites, answers.len())?;
        let mut parts: Vec<Option<ToolPart>> =
            answers.iter().map(|answer| at_least(*answer)).collect();
        let mut left = inaccessible(answers);
        let mut options = *options;
        match tool.profile() {
            Some(_) => {
                left.iter().for_each(|&i| parts[i] = Some(ToolPart::Shank));
                (0..is_free.len()).filter(|&i| is_free[i]).for_each(|i| parts[i] = None);
                left.retain(|&i| parts[i].is_some());
            }
            None => options.refinement = None,
        }
        // From below: a site that stays blocked keeps what is named so far and is not labeled again.
        for (part, cutter) in truncated(tool, clearance_mm)?.into_iter().rev() {
            let labels = self.of_left((sites, &left), &cutter, directions, &options)?;
            let is_blocked = |k: usize| {
                labels.answers[k] == SiteAnswer::Inaccessible
                    && !labels.evidence.retreat_unproven.get(k).is_some_and(|is_free| *is_free)
            };
            left = (0..left.len()).filter(|&k| !is_blocked(k)).map(|k| left[k]).collect();
            left.iter().for_each(|&i| parts[i] = Some(part));
        }
        Ok(parts)
    }

    /// Labels of some of the sites; none if none is left.
    fn of_left(
        &self,
        (sites, left): (&Sites, &[usize]),
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<SurfaceLabels> {
        if left.is_empty() {
            return Ok(SurfaceLabels::default());
        }
        self.surface_labels(&sites.subset(left), cutter, directions, &options.for_few(left.len()))
    }
}

fn inaccessible(answers: &[SiteAnswer]) -> Vec<usize> {
    (0..answers.len()).filter(|&i| answers[i] == SiteAnswer::Inaccessible).collect()
}

/// As [`TriangleObstacles::blocking_parts`], by the published definition; `inaccessible` are its labels of the
/// `queries`.
///
/// # Errors
/// As [`label_many`], or if there are not as many labels as queries.
pub fn blocking_parts_among_points(
    sites: &Sites,
    obstacles: Obstacles,
    (tool, clearance_mm): (&Assembly, f64),
    directions: &Directions,
    inaccessible: &[bool],
) -> Result<Vec<Option<ToolPart>>> {
    check_count(sites, inaccessible.len())?;
    let of = |blocked: &bool| blocked.then_some(ToolPart::Cutter);
    let mut parts: Vec<Option<ToolPart>> = inaccessible.iter().map(of).collect();
    let mut left: Vec<usize> = (0..sites.len()).filter(|&i| inaccessible[i]).collect();
    let truncated = truncated(tool, clearance_mm)?;
    let (of, cutters): (Vec<ToolPart>, Vec<Cutter>) = truncated.into_iter().unzip();
    let options = LabelOptions { occlusion: false, ..LabelOptions::default() };
    let labels = label_many(Queries::Sites(sites), obstacles, &cutters, directions, &options)?;
    for (part, labels) in of.into_iter().zip(&labels) {
        let blocked: Vec<bool> = left.iter().map(|&i| labels.answers.is_inaccessible(i)).collect();
        assign(part, &mut parts, &mut left, blocked.into_iter());
    }
    Ok(parts)
}

fn check_count(sites: &Sites, n_answers: usize) -> Result<()> {
    if sites.len() == n_answers {
        return Ok(());
    }
    let expected = format!("{}, as many as sites", sites.len());
    let remedy = "give the sites that the answers are about";
    Err(Error::argument("number of answers", n_answers, expected, remedy))
}

/// What blocks at the least; an inaccessible site that stays blocked without all that is above the cutter is blocked by
/// the cutter.
fn at_least(answer: SiteAnswer) -> Option<ToolPart> {
    match answer {
        SiteAnswer::Accessible => None,
        SiteAnswer::TipDoesNotFit => Some(ToolPart::Tip),
        SiteAnswer::Inaccessible => Some(ToolPart::Cutter),
    }
}

/// The tool below each of its parts, from above.
fn truncated(tool: &Assembly, clearance_mm: f64) -> Result<Vec<(ToolPart, Cutter)>> {
    let mut found = Vec::new();
    for part in FROM_ABOVE.into_iter().filter(|part| tool.has(*part)) {
        found.extend(tool.below(part, clearance_mm)?.map(|cutter| (part, cutter)));
    }
    Ok(found)
}

/// Sites that are free without a part are blocked by it; the others are left.
fn assign(
    part: ToolPart,
    parts: &mut [Option<ToolPart>],
    left: &mut Vec<usize>,
    blocked: impl Iterator<Item = bool>,
) {
    let of: Vec<(usize, bool)> = left.iter().copied().zip(blocked).collect();
    of.iter().filter(|(_, blocked)| !blocked).for_each(|&(i, _)| parts[i] = Some(part));
    *left = of.into_iter().filter(|(_, blocked)| *blocked).map(|(i, _)| i).collect();
}
