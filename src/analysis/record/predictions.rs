//! The record of predictions: what the files of the tools do not hold.

use super::placed::{self, OfPlaced, add_vertices};
use super::{REMEDY, add_text, metadata, of_another_run, open, read_text};
use crate::analysis::{PredictionsOutcome, ToolPrediction};
use crate::data::files::{PredictionFile, vertices};
use crate::data::npz::NpzWriter;
use crate::report::folder::PREDICTIONS;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

const PREDICTED: &str = "predicted.npz";
const FORMAT: &str = "deepmill predicted";

/// What is no array.
#[derive(Serialize, Deserialize)]
struct OfPredictions<'a> {
    #[serde(flatten)]
    placed: OfPlaced<'a>,
    /// Numbers of the tools that the network knows, ascending.
    known: Vec<usize>,
    of_tools: Cow<'a, [String]>,
}

/// Whatever time it took.
impl PartialEq for PredictionsOutcome {
    fn eq(&self, other: &Self) -> bool {
        let PredictionsOutcome { placed, predictions, warnings, seconds: _ } = self;
        (placed, predictions, warnings) == (&other.placed, &other.predictions, &other.warnings)
    }
}

impl PredictionsOutcome {
    /// Reads what [`PredictionsOutcome::write`] has written: an equal outcome, but for
    /// [`PredictionsOutcome::seconds`], which no file has.
    ///
    /// # Errors
    /// If the folder has no `predicted.npz`, as those that an earlier version wrote, a file is damaged, or the
    /// predictions of a tool are about other sites.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = &folder.join(PREDICTED);
        let mut npz =
            open(path, FORMAT, "predict again, or read `predictions.npz`, with `PredictionFile`")?;
        let all: OfPredictions = read_text(path, &mut npz, "predicted")?;
        let bad = |at: &str, found: &str| Error::file(path, at, found, REMEDY);
        let tools = &all.placed.request.tools;
        let mut predictions: Vec<ToolPrediction> = Vec::new();
        for (k, number) in all.known.iter().enumerate() {
            let is_next = k == 0 || all.known[k - 1] < *number;
            let tool = tools.get(*number).filter(|_| is_next);
            let tool = tool.ok_or_else(|| bad("predicted", "a tool that is not there"))?.clone();
            let file = match all.placed.request.has_folders {
                true => folder.join(tool.folder()).join(PREDICTIONS),
                false => folder.join(PREDICTIONS),
            };
            let read = PredictionFile::read(&file)?;
            let is_other = predictions.first().is_some_and(|first| first.file.sites != read.sites);
            if is_other || read.provenance.cutter != tool.params {
                return Err(of_another_run(&file, "points"));
            }
            predictions.push(ToolPrediction { tool, file: read });
        }
        let first = predictions.first().ok_or_else(|| bad("predicted", "no tool"))?;
        let sites = first.file.sites.clone();
        let vertices = vertices::read(path, &mut npz, &sites)?;
        let placed = all.placed.read((path, &mut npz), (sites, vertices))?;
        let placed = placed.ok_or_else(|| bad("triangles", "other triangles than sites are on"))?;
        Ok(PredictionsOutcome {
            placed,
            predictions,
            warnings: all.of_tools.into_owned(),
            seconds: [0.0; 3],
        })
    }

    /// Writes `predicted.npz`; returns its path.
    pub(in crate::analysis) fn write_record(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(PREDICTED);
        let mut npz = NpzWriter::new();
        let tools = &self.placed.request.tools;
        // In the order of the tools.
        let mut left = self.predictions.iter().map(|of| &of.tool).peekable();
        let is_known = |k: &usize| left.next_if(|tool| **tool == tools[*k]).is_some();
        let all = OfPredictions {
            known: (0..tools.len()).filter(is_known).collect(),
            placed: OfPlaced::of(&self.placed),
            of_tools: Cow::Borrowed(&self.warnings),
        };
        add_text(&path, &mut npz, "predicted", &all)?;
        placed::add(&mut npz, &self.placed);
        add_vertices(&path, &mut npz, &self.placed)?;
        let meaning = "what predictions.npz of each tool does not hold; texts are JSON";
        npz.metadata(&metadata(FORMAT, self.placed.part(), meaning));
        npz.write(&path)?;
        Ok(path)
    }
}
