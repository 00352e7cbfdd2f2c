//! Findings of one tool or several, and which change of a tool would help.

use crate::Result;
use crate::access::Labels;
use crate::access::surface::PartChange;
use crate::access::surface::explain::RegionAdvice;
use crate::cutter::Assembly;
use crate::geom::{Mesh, Sites};
use crate::report::findings::{Findings, PartAdvice, ToolChange, add_blocking_parts, add_proofs};

/// Findings that are shown in words, and for which a change of the tool is looked for.
pub const N_SHOWN: usize = 6;

/// A change of the tool that reaches less of a region is no help.
const LEAST_SHARE: f64 = 0.25;

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
