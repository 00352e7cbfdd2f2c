//! Outcomes against a baseline.

use super::outcome::Outcome;
use super::placed::Placed;
use super::setups::{ALL_SETUPS, SetupsOutcome};
use super::tools::ToolsOutcome;
use crate::Result;
use crate::findings::baseline::{Baseline, BaselineCheck, FindingsAbout};
use crate::findings::{ALL_TOOLS, Findings};

impl Outcome {
    /// Holds [`Outcome::findings`] against what is known: each is known, new or grown from then on, and has the name of
    /// the baseline. Of several tools it is about what no tool reaches.
    pub fn hold_against(&mut self, baseline: &Baseline) -> BaselineCheck {
        let Outcome { placed, answers, of_all, .. } = self;
        let about = about(placed, tool(placed));
        baseline.hold(of_all.as_mut().unwrap_or(&mut answers[0].findings), about)
    }

    /// [`Outcome::findings`] as a baseline of this date (year-month-day). Those that were held against a baseline keep
    /// their names, reasons and dates.
    ///
    /// # Errors
    /// If the date is none.
    pub fn baseline(&self, date: &str) -> Result<Baseline> {
        Baseline::of(self.findings(), about(&self.placed, tool(&self.placed)), date)
    }

    /// Gives [`Outcome::findings`] the names that they have in a baseline, and nothing else of it.
    #[doc(hidden)] // of the program
    pub fn name_findings(&mut self, before: &Baseline) -> BaselineCheck {
        let Outcome { placed, answers, of_all, .. } = self;
        let findings = of_all.as_mut().unwrap_or(&mut answers[0].findings);
        name(findings, before, about(placed, tool(placed)))
    }

    /// The tools that [`Outcome::findings`] are of, by name.
    #[doc(hidden)] // of the program
    pub fn tool_of_findings(&self) -> &str {
        tool(&self.placed)
    }
}

impl SetupsOutcome {
    /// As [`Outcome::hold_against`], of what the setups leave.
    pub fn hold_against(&mut self, baseline: &Baseline) -> BaselineCheck {
        baseline.hold(&mut self.findings, about(&self.placed, ALL_SETUPS))
    }

    /// As [`Outcome::baseline`].
    ///
    /// # Errors
    /// If the date is none.
    pub fn baseline(&self, date: &str) -> Result<Baseline> {
        Baseline::of(&self.findings, about(&self.placed, ALL_SETUPS), date)
    }
}

impl SetupsOutcome {
    /// As [`Outcome::name_findings`].
    #[doc(hidden)] // of the program
    pub fn name_findings(&mut self, before: &Baseline) -> BaselineCheck {
        name(&mut self.findings, before, about(&self.placed, ALL_SETUPS))
    }
}

impl ToolsOutcome {
    /// As [`Outcome::name_findings`], of [`ToolsOutcome::findings`].
    #[doc(hidden)] // of the program
    pub fn name_findings(&self, findings: &mut Findings, before: &Baseline) -> BaselineCheck {
        let placed = self.placed();
        name(findings, before, about(placed, tool(placed)))
    }

    /// As [`Outcome::baseline`], of [`ToolsOutcome::findings`].
    ///
    /// # Errors
    /// If the date is none.
    #[doc(hidden)] // of the program
    pub fn baseline(&self, findings: &Findings, date: &str) -> Result<Baseline> {
        let placed = self.placed();
        Baseline::of(findings, about(placed, tool(placed)), date)
    }
}

fn name(findings: &mut Findings, before: &Baseline, about: FindingsAbout) -> BaselineCheck {
    let mut held = findings.clone();
    let check = before.hold(&mut held, about);
    for (finding, held) in findings.list.iter_mut().zip(held.list) {
        finding.id = held.id;
    }
    check
}

/// What findings are of.
fn tool(placed: &Placed) -> &str {
    match &placed.request.tools[..] {
        [tool] => &tool.name,
        _ => ALL_TOOLS,
    }
}

fn about<'a>(placed: &'a Placed, tool: &'a str) -> FindingsAbout<'a> {
    let (part, bounds) = (placed.part(), placed.bounds());
    FindingsAbout { part, tool, bounds, sites: placed.shown().1 }
}
