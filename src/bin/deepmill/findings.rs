//! Findings, and how they are said.

use crate::output::Output;
use deepmill::analysis::N_SHOWN as N_SAID;
use deepmill::findings::{Findings, openings_words};

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
        for advice in &finding.advice {
            output.say(format!("finding {number}: of the part, {}", advice.words));
        }
        if !finding.opens.is_empty() {
            output.say(format!("finding {number}: {}", openings_words(&finding.opens)));
        }
        if let Some(words) = &finding.stopped {
            output.say(format!("finding {number}: would help, but is not proposed: {words}"));
        }
    }
}
