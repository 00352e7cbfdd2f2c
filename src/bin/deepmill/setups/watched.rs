//! Setups of a part that is watched.

use super::Args;
use crate::args::share;
use crate::baseline::today;
use crate::output::{Output, limits_broken};
use crate::watch::{Answer, Look, Watched, writer};
use deepmill::Result;
use deepmill::analysis::Observer;
use deepmill::findings::baseline::Baseline;
use std::path::PathBuf;

impl Watched for Args {
    fn files(&self) -> Vec<PathBuf> {
        let beside = self.tools.files().chain(self.machine.files()).chain(self.baseline.files());
        let part = std::iter::once(&self.part);
        let named = self.holding.files().chain(self.region.files());
        part.chain(beside).cloned().chain(named).collect()
    }

    fn answer(
        &self,
        before: Option<&Baseline>,
        observer: &mut dyn Observer,
        _: &mut Look,
        output: &Output,
    ) -> Result<Answer> {
        self.baseline.refuse_to_write()?;
        let limits = self.limits()?;
        let request = self.request(share(&self.share)?)?;
        let (tools, files) = (self.tools(output)?, self.forms(output)?);
        let baseline = self.baseline.open()?;
        self.out.check()?;
        let mesh = self.read.read_bodies(&self.part, self.force, output)?;
        let mut outcome = self.plan(mesh, tools, (request, &files), observer, output)?;
        let held = baseline.check(|known| outcome.hold_against(known));
        let (surface, sites) = outcome.placed().shown();
        let answers = outcome.answers();
        let named = [("setups", &answers)].into_iter();
        let of_setups = baseline.is_held().then(|| ("setups", outcome.findings()));
        let mut broken = limits_broken(&limits, (sites, surface), named, of_setups)?;
        broken.extend(held.and_then(|check| baseline.broken(&check)));
        let check = before.map(|before| outcome.name_findings(before));
        let (page, findings) = (outcome.live_page(output.unit())?, outcome.baseline(&today())?);
        let write = writer(self.out.given(), move |folder, observer| {
            outcome.write(folder, &files, observer).map(|_| ())
        });
        Ok(Answer { page, check, findings, broken, write })
    }
}
