//! Findings of one tool or several, and how they are said.

use crate::output::Output;
use deepmill::Result;
use deepmill::access::Labels;
use deepmill::access::surface::explain::RegionAdvice;
use deepmill::cutter::Assembly;
use deepmill::geom::{Mesh, Sites};
use deepmill::report::findings::{Findings, ToolChange, add_blocking_parts, add_proofs};

/// Findings that are printed, and for which a change of the tool is looked for.
const N_SAID: usize = 6;

/// A change of the tool that reaches less of a region is no help.
const LEAST_SHARE: f64 = 0.25;

/// The findings of every tool, and which other tools help.
pub fn of_tools(
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

/// Adds to the largest findings a change of the tool that helps most of the region, if one is found.
pub fn advise(
    findings: &mut Findings,
    tool: &Assembly,
    change_for: impl Fn(&[u32]) -> Result<RegionAdvice>,
) -> Result<()> {
    let of_site = &findings.of_site;
    for (number, finding) in (1..).zip(findings.list.iter_mut().take(N_SAID)) {
        let all = 0..of_site.len() as u32;
        let members: Vec<u32> = all.filter(|&i| of_site[i as usize] == number).collect();
        let advice = change_for(&members)?;
        let found = advice.change.filter(|found| found.share >= LEAST_SHARE);
        let stopped = advice.stopped.filter(|s| s.by_overall_length || found.is_none());
        finding.stopped = stopped.map(|stopped| stopped.words());
        finding.change = found.map(|found| ToolChange::new(found.change.words(tool), found.share));
    }
    Ok(())
}

/// The largest findings as a table.
pub fn say(findings: &Findings, output: &Output) {
    if findings.largest_mm2 == 0.0 {
        return;
    }
    let n = findings.list.len();
    let (s, first) = (if n == 1 { "" } else { "s" }, if n > N_SAID { ", the largest" } else { "" });
    output.say(format!("{n} finding{s} out of reach{first}:"));
    output.say(findings.first_rows(N_SAID).text_in(output.unit()));
    for (number, finding) in (1..).zip(findings.list.iter().take(N_SAID)) {
        if let Some(words) = &finding.stopped {
            output.say(format!("finding {number}: would help, but is not proposed: {words}"));
        }
    }
}
