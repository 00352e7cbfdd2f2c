//! The record of what the tools of a library reach.

use super::placed::{OfPlaced, add_on_part, read_on_part};
use super::{REMEDY, add_text, metadata, open, read_text};
use crate::access::surface::ToolReach;
use crate::analysis::ToolsOutcome;
use crate::answers::SiteAnswer;
use crate::data::files::poses;
use crate::data::npz::{NpzReader, NpzWriter};
use crate::findings::gate::SiteAreas;
use crate::geom::Sites;
use crate::report::library::Library;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

const TOOLS: &str = "tools.npz";
const FORMAT: &str = "deepmill tools";

/// What is no array.
#[derive(Serialize, Deserialize)]
struct OfTools<'a> {
    #[serde(flatten)]
    placed: OfPlaced<'a>,
    share: f64,
    rests: Cow<'a, [usize]>,
    of_tools: Cow<'a, [String]>,
    notices: Cow<'a, [String]>,
}

/// Whatever time it took.
impl PartialEq for ToolsOutcome {
    fn eq(&self, other: &Self) -> bool {
        let ToolsOutcome { placed, library, rests, warnings, notices, seconds: _ } = self;
        (placed, library, rests, warnings, notices)
            == (&other.placed, &other.library, &other.rests, &other.warnings, &other.notices)
    }
}

impl ToolsOutcome {
    /// Reads what [`ToolsOutcome::write`] has written: an equal outcome, but for [`ToolsOutcome::seconds`], which no
    /// file has.
    ///
    /// # Errors
    /// If the folder has no `tools.npz`, as those that an earlier version wrote, or it is damaged.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = &folder.join(TOOLS);
        let mut npz = open(path, FORMAT, "run `deepmill tools` again")?;
        let all: OfTools = read_text(path, &mut npz, "tools")?;
        let placed = read_on_part(all.placed, path, &mut npz)?;
        let bad = |at: &str, found: String| Error::file(path, at, found, REMEDY);
        let tools = placed.request.tools.clone();
        let reach = (0..tools.len()).map(|k| read_reach((path, &mut npz), k, &placed.sites));
        let reach = reach.collect::<Result<Vec<ToolReach>>>()?;
        if all.rests.len() != tools.len() {
            let found = format!("rests of {} tools, expected {}", all.rests.len(), tools.len());
            return Err(bad("tools", found));
        }
        let (shown, of_shown) = placed.shown();
        let library = Library::new(tools, reach, SiteAreas::of(of_shown, shown)?, all.share)
            .map_err(|e| bad("tools", e.to_string()))?;
        Ok(ToolsOutcome {
            library,
            rests: all.rests.into_owned(),
            warnings: all.of_tools.into_owned(),
            notices: all.notices.into_owned(),
            seconds: [0.0; 4],
            placed,
        })
    }

    /// Writes `tools.npz`; returns its path.
    pub(in crate::analysis) fn write_record(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(TOOLS);
        let mut npz = NpzWriter::new();
        let all = OfTools {
            placed: OfPlaced::of(&self.placed),
            share: self.library.share(),
            rests: Cow::Borrowed(&self.rests),
            of_tools: Cow::Borrowed(&self.warnings),
            notices: Cow::Borrowed(&self.notices),
        };
        add_text(&path, &mut npz, "tools", &all)?;
        add_on_part(&path, &mut npz, &self.placed)?;
        for (k, reach) in self.library.reach().iter().enumerate() {
            add_reach(&mut npz, k, reach);
        }
        let meaning = "what every tool reaches; texts are JSON";
        npz.metadata(&metadata(FORMAT, self.placed.part(), meaning));
        npz.write(&path)?;
        Ok(path)
    }
}

/// Names of the arrays of a tool.
fn names(k: usize) -> [String; 5] {
    ["answers", "direction", "tip", "body_reaches", "least_stick_out_mm"]
        .map(|name| format!("tool_{k}_{name}"))
}

/// In the order of their numbers.
const ANSWERS: [SiteAnswer; 3] =
    [SiteAnswer::Accessible, SiteAnswer::Inaccessible, SiteAnswer::TipDoesNotFit];

fn add_reach(npz: &mut NpzWriter, k: usize, reach: &ToolReach) {
    let ToolReach { answers, witness, body_reaches, least_stick_out_mm } = reach;
    let [of_answers, direction, tip, of_body, stick_out] = names(k);
    let number = |answer: &SiteAnswer| ANSWERS.iter().position(|a| a == answer).unwrap_or(0) as u8;
    let numbers: Vec<u8> = answers.iter().map(number).collect();
    npz.array(&of_answers, &[numbers.len()], &numbers);
    poses::add(npz, [&direction, &tip], witness);
    npz.array(&of_body, &[body_reaches.len()], body_reaches);
    npz.array(&stick_out, &[least_stick_out_mm.len()], least_stick_out_mm);
}

fn read_reach((path, npz): (&Path, &mut NpzReader), k: usize, sites: &Sites) -> Result<ToolReach> {
    let [of_answers, direction, tip, of_body, stick_out] = names(k);
    let bad = |at: &str, found: &str| Error::file(path, at, found, REMEDY);
    let answer = |number: u8| ANSWERS.get(usize::from(number)).copied();
    let answers: Option<Vec<SiteAnswer>> =
        npz.counts::<u8>(&of_answers)?.into_iter().map(answer).collect();
    let answers = answers.ok_or_else(|| bad(&of_answers, "a number above 2"))?;
    if !npz.has(&tip) {
        return Err(bad(&tip, "there is no such array"));
    }
    let witness = poses::read_poses(path, npz, sites, [&direction, &tip])?;
    let (body_reaches, least_stick_out_mm) = (npz.bools(&of_body)?, npz.f64s(&stick_out, 1)?);
    if least_stick_out_mm.iter().any(|mm| mm.is_nan()) {
        return Err(bad(&stick_out, "a number that is NaN"));
    }
    let of = [(&of_answers, answers.len()), (&of_body, body_reaches.len())];
    for (name, n) in of.into_iter().chain([(&stick_out, least_stick_out_mm.len())]) {
        if n != sites.len() {
            return Err(bad(name, &format!("{n} rows for {} sites", sites.len())));
        }
    }
    Ok(ToolReach { answers, witness, body_reaches, least_stick_out_mm })
}
