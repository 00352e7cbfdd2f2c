//! What the tools of a library reach on a part that is watched.

use super::Args;
use crate::args::share;
use crate::baseline::today;
use crate::output::{Output, limits_broken};
use crate::watch::{Answer, Look, Watched, writer};
use deepmill::analysis::Observer;
use deepmill::findings::baseline::Baseline;
use deepmill::{Error, Result};
use std::path::PathBuf;

impl Watched for Args {
    fn files(&self) -> Vec<PathBuf> {
        let beside = self.library.iter().chain(self.defaults.files()).chain(self.surface.files());
        self.part.iter().chain(beside).cloned().chain(self.region.files()).collect()
    }

    fn answer(
        &self,
        before: Option<&Baseline>,
        observer: &mut dyn Observer,
        _: &mut Look,
        output: &Output,
    ) -> Result<Answer> {
        let Some(part) = &self.part else {
            let remedy = "name the file of a part; --export and --show are of the command itself";
            return Err(Error::argument("PART", "none", "a part to watch", remedy));
        };
        let (limits, share) = (self.limits()?, share(&self.share)?);
        let tools = self.tools(output)?;
        let files = output.forms(!self.no_picture, false, &[])?;
        self.out.check()?;
        let mesh = self.read.read_bodies(part, self.force, output)?;
        let outcome = self.reach((part, mesh), (tools, share), observer, output)?;
        let (surface, sites) = outcome.placed().shown();
        let named = outcome.named();
        let named = named.iter().map(|(name, answers)| (*name, answers));
        let broken = limits_broken(&limits, (sites, surface), named, None)?;
        let mut found = outcome.findings()?;
        let check = before.map(|before| outcome.name_findings(&mut found, before));
        let findings = outcome.baseline(&found, &today())?;
        let page = outcome.live_page(output.unit(), found)?;
        let write = writer(self.out.given(), move |folder, observer| {
            outcome.write(folder, &files, observer).map(|_| ())
        });
        Ok(Answer { page, check, findings, broken, write })
    }
}
