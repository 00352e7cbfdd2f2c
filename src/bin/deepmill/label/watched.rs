//! Labels of a part that is watched.

use super::Args;
use crate::baseline::today;
use crate::output::{Output, limits_broken};
use crate::watch::{Answer, Look, Watched, writer};
use deepmill::analysis::{Observer, Outcome};
use deepmill::findings::baseline::Baseline;
use deepmill::{Error, Result};
use std::path::PathBuf;

impl Watched for Args {
    fn files(&self) -> Vec<PathBuf> {
        let beside = self.tools.files().chain(self.surface.files()).chain(self.baseline.files());
        self.parts.iter().chain(beside).cloned().chain(self.region.files()).collect()
    }

    fn answer(
        &self,
        before: Option<&Baseline>,
        observer: &mut dyn Observer,
        look: &mut Look,
        output: &Output,
    ) -> Result<Answer> {
        let refused = |name, found: String, expected: &str, remedy| {
            Err(Error::argument(name, found, expected, remedy))
        };
        let [part] = &self.parts[..] else {
            let found = format!("{} parts", self.parts.len());
            return refused("PART", found, "one part to watch", "watch each by itself");
        };
        if self.volume.is_some() {
            return refused("--volume", "given".into(), "sites to watch", "leave --volume out");
        }
        self.baseline.refuse_to_write()?;
        let args = Args { part: part.clone(), ..self.clone() };
        let request = args.request(output)?;
        let baseline = args.baseline.open()?;
        args.out.check()?;
        let placed = args.place(args.read_part(output)?, &request, output)?;
        let mut outcome = placed.label_with_first_look(observer, &mut |outcome| {
            look(answer(outcome, before, output)?)
        })?;
        outcome.notices().iter().for_each(|notice| output.say(notice));
        let held = baseline.check(|known| outcome.hold_against(known));
        let (mesh, sites) = outcome.shown();
        let of_tool = baseline.is_held().then(|| (outcome.tool_of_findings(), outcome.findings()));
        let limits = &request.limits;
        let mut broken = limits_broken(limits, (sites, mesh), outcome.named(), of_tool)?;
        broken.extend(held.and_then(|check| baseline.broken(&check)));
        let answer = answer(&mut outcome, before, output)?;
        let write = writer(args.out.given(), move |folder, observer| {
            outcome.write(folder, &request.files, observer)?;
            outcome.write_per_direction(folder, &request.forms).map(|_| ())
        });
        Ok(Answer { broken, write, ..answer })
    }
}

/// What is shown of an outcome; without files and limits.
fn answer(outcome: &mut Outcome, before: Option<&Baseline>, output: &Output) -> Result<Answer> {
    let check = before.map(|before| outcome.name_findings(before));
    let (page, findings) = (outcome.live_page(output.unit())?, outcome.baseline(&today())?);
    Ok(Answer { page, check, findings, broken: Vec::new(), write: None })
}
