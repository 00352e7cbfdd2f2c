//! Labels of all sites, or of points about a part, in the directions of a set.

use super::frame::Frame;
use super::label::{ProfileTool, SiteResult};
use crate::access::evidence::{SurfaceEvidence, SurfaceStats};
use crate::access::surface::cells::Domain;
use crate::access::surface::labels::SurfaceLabels;
use crate::access::surface::tool::Contact;
use crate::exec::par;
use crate::tool::directions::Directions;
use glam::DVec3;

/// Sites per task.
const BLOCK: usize = 32;

/// Labels of sites or of points about a part, with the directions that the part suggests where a set stands for a
/// domain: see the [module](super).
pub(in crate::access::surface) fn label(
    tool: &ProfileTool,
    contacts: &[Contact],
    (directions, domain): (&Directions, Option<Domain>),
    (part, own_tolerances): (&[[DVec3; 3]], Vec<f64>),
) -> SurfaceLabels {
    let frames = Frame::tested((directions, domain), tool.bvh());
    let found = match contacts.first() {
        Some(Contact { normal: None, .. }) => tool.in_space(contacts, part, &frames),
        _ => sites(tool, contacts, &frames),
    };
    let mut answers = Vec::new();
    let mut evidence = SurfaceEvidence {
        tolerance_mm: own_tolerances,
        finish_mm: tool.finish(),
        n_directions: directions.len(),
        ..SurfaceEvidence::default()
    };
    for found in found {
        let without_retreat = found.witness.is_none() && found.is_free;
        answers.push(found.answer());
        evidence.witness.push(found.witness);
        evidence.open_directions.push(if found.witness.is_some() { 0.0 } else { 1.0 });
        evidence.retreat_unproven.push(without_retreat);
        evidence.stats += SurfaceStats {
            pairs: frames.len() as u64,
            tools_tested: found.n_tested,
            ..SurfaceStats::default()
        };
    }
    SurfaceLabels { answers, evidence, ..SurfaceLabels::default() }
}

/// The results for all sites.
fn sites(tool: &ProfileTool, contacts: &[Contact], frames: &[Frame]) -> Vec<SiteResult> {
    if tool.drill.is_some() {
        return tool.drilled(contacts, frames);
    }
    let found = par::map_blocks(contacts.len(), BLOCK, |range| {
        range.map(|i| tool.milled(&contacts[i], frames)).collect::<Vec<_>>()
    });
    found.into_iter().flatten().collect()
}

/// In which of the directions every site is accessible, and whether the tip alone hinders it.
pub(in crate::access::surface) fn accessible(
    tool: &ProfileTool,
    contacts: &[Contact],
    directions: &Directions,
) -> Vec<(Vec<bool>, bool)> {
    let mut found = vec![(Vec::with_capacity(directions.len()), false); contacts.len()];
    for frame in Frame::all(directions).chunks(1) {
        for (site, (accessible, only_tip)) in sites(tool, contacts, frame).iter().zip(&mut found) {
            accessible.push(site.witness.is_some());
            *only_tip |= site.only_tip && !site.is_free;
        }
    }
    for (accessible, only_tip) in &mut found {
        *only_tip &= !accessible.contains(&true);
    }
    found
}
