//! Findings of one tool or several, and how they are said.

use crate::output::Output;
use deepmill::Result;
use deepmill::answers::SiteAnswers;
use deepmill::geom::{Mesh, Sites};
use deepmill::report::findings::{Findings, add_proofs};

/// Findings that are printed.
const N_SAID: usize = 6;

/// The findings of every tool; the others are asked whether they help. `open` gives the open directions of a tool's labels.
pub fn of_tools<'a>(
    sites: &Sites,
    mesh: Option<&Mesh>,
    names: &[&str],
    answers: &[&SiteAnswers],
    open: impl Fn(usize) -> Option<&'a [f32]>,
) -> Result<Vec<Findings>> {
    let accessible: Vec<Vec<bool>> = answers.iter().map(|answers| answers.accessible()).collect();
    let of = |k: usize| {
        let others = (0..names.len()).filter(|other| *other != k);
        let others: Vec<_> = others.map(|o| (names[o], &accessible[o][..])).collect();
        let mut found = Findings::of(sites, mesh, answers[k], &others)?;
        if let Some(open) = open(k) {
            add_proofs(&mut found, open);
        }
        Ok(found)
    };
    (0..names.len()).map(of).collect()
}

/// The largest findings as a table.
pub fn say(findings: &Findings, output: &Output) {
    if findings.largest_mm2 == 0.0 {
        return;
    }
    let n = findings.list.len();
    let (s, first) = (if n == 1 { "" } else { "s" }, if n > N_SAID { ", the largest" } else { "" });
    output.say(format!("{n} finding{s} out of reach{first}:"));
    output.say(findings.first_rows(N_SAID).text());
}
