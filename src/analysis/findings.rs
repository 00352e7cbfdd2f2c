//! Findings of one tool or several, and which change of a tool would help.

use crate::Result;
use crate::access::Labels;
use crate::access::surface::explain::RegionAdvice;
use crate::access::surface::{PartChange, SiteAnswer, SurfaceOptions, TriangleObstacles};
use crate::cutter::Assembly;
use crate::data::files::tools::Tool;
use crate::directions::{DirectionSet, Directions};
use crate::geom::{Mesh, Sites};
use crate::report::findings::{
    Findings, Opening, PartAdvice, ToolChange, add_blocking_parts, add_proofs,
};
use glam::Vec3;

/// Findings that are shown in words, and for which a change of the tool is looked for.
pub const N_SHOWN: usize = 6;

/// A change of the tool that reaches less of a region is no help.
const LEAST_SHARE: f64 = 0.25;

/// Box axes along which regions are looked at from.
const AXES: [(&str, Vec3); 6] = [
    ("+x", Vec3::X),
    ("-x", Vec3::NEG_X),
    ("+y", Vec3::Y),
    ("-y", Vec3::NEG_Y),
    ("+z", Vec3::Z),
    ("-z", Vec3::NEG_Z),
];
/// Cosine of 8°, about half of the angle between neighbors of the default set: an axis that is nearer to a direction
/// was tested.
const TESTED: f32 = 0.990_27;
/// Sites of a region that are looked at.
const N_OPENED: usize = 192;
/// Openings that are named.
const N_OPENINGS: usize = 2;

/// The findings of every tool, and which other tools help; `names` and `labels` are of the same tools.
///
/// # Errors
/// As [`Findings::of`].
pub fn findings_of_tools(
    sites: &Sites,
    mesh: Option<&Mesh>,
    names: &[&str],
    labels: &[&Labels],
) -> Result<Vec<Findings>> {
    let accessible: Vec<Vec<bool>> = labels.iter().map(|l| l.answers.accessible()).collect();
    let of = |k: usize| {
        let others = (0..names.len()).filter(|other| *other != k);
        let others: Vec<_> = others.map(|o| (names[o], &accessible[o][..])).collect();
        let mut found = Findings::of(sites, mesh, &labels[k].answers, &others)?;
        if let Some(surface) = &labels[k].surface {
            add_proofs(&mut found, &surface.open_directions);
        }
        add_blocking_parts(&mut found, &labels[k].blocked_by);
        Ok(found)
    };
    (0..names.len()).map(of).collect()
}

/// Adds to the largest findings the box axes that were not tested and along which one of the tools reaches them.
///
/// # Errors
/// As [`TriangleObstacles::label`].
pub(super) fn add_openings(
    findings: &mut Findings,
    sites: &Sites,
    tools: &[Tool],
    obstacles: &TriangleObstacles,
    (directions, options): (&Directions, &SurfaceOptions),
) -> Result<()> {
    let is_tested = |axis: Vec3| directions.vectors().iter().any(|d| d.dot(axis) > TESTED);
    let axes = AXES.into_iter().filter(|(_, axis)| !is_tested(*axis));
    let alone = |(name, axis): (&'static str, Vec3)| {
        let set = DirectionSet::List { vectors: vec![axis.as_dvec3().to_array()] };
        Directions::new(set).map(|directions| (name, directions))
    };
    let axes = axes.map(alone).collect::<Result<Vec<(&'static str, Directions)>>>()?;
    if axes.is_empty() {
        return Ok(());
    }
    let quick = SurfaceOptions {
        counts: false,
        occlusion: false,
        refinement: None,
        clearance_limit_mm: None,
        ..*options
    };
    for number in 1..=findings.list.len().min(N_SHOWN) {
        let all = (0..findings.of_site.len()).filter(|i| findings.of_site[*i] as usize == number);
        let all: Vec<usize> = all.collect();
        let step = all.len().div_ceil(N_OPENED).max(1);
        let some = || all.iter().step_by(step);
        let points = some().map(|i| sites.points[*i]).collect();
        let of_region = Sites::new(points, some().map(|i| sites.normals[*i]).collect())?;
        let mut opens = Vec::new();
        for (name, axis) in &axes {
            let mut is_reached = vec![false; of_region.len()];
            for tool in tools {
                let found = obstacles.label(&of_region, &tool.cutter, axis, &quick)?;
                for (reached, answer) in is_reached.iter_mut().zip(found.answers) {
                    *reached |= answer == SiteAnswer::Accessible;
                }
            }
            let n_reached = is_reached.iter().filter(|reached| **reached).count();
            let share = n_reached as f64 / is_reached.len().max(1) as f64;
            if share >= LEAST_SHARE {
                opens.push(Opening::new(name, share));
            }
        }
        // Stable: among equals, in the order of the axes.
        opens.sort_by(|a: &Opening, b| b.share.total_cmp(&a.share));
        opens.truncate(N_OPENINGS);
        findings.list[number - 1].opens = opens;
    }
    Ok(())
}

/// Adds to the largest findings a change of the tool that helps most of the region, and changes of the part, if
/// `change_for` its sites finds any.
///
/// # Errors
/// Those of `change_for`.
pub fn advise(
    findings: &mut Findings,
    tool: &Assembly,
    change_for: impl Fn(&[u32]) -> Result<(RegionAdvice, Vec<PartChange>)>,
) -> Result<()> {
    let of_site = &findings.of_site;
    for (number, finding) in (1..).zip(findings.list.iter_mut().take(N_SHOWN)) {
        let all = 0..of_site.len() as u32;
        let members: Vec<u32> = all.filter(|&i| of_site[i as usize] == number).collect();
        let (advice, of_part) = change_for(&members)?;
        let found = advice.change.filter(|found| found.share >= LEAST_SHARE);
        let stopped = advice.stopped.filter(|s| s.by_overall_length || found.is_none());
        let of_area = |change: &PartChange| PartAdvice::new(change, finding.area_mm2);
        finding.advice = of_part.iter().map(of_area).collect();
        finding.stopped = stopped.map(|stopped| stopped.words());
        finding.change = found.map(|found| ToolChange::new(found.change.words(tool), found.share));
    }
    Ok(())
}
