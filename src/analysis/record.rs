//! The record of an outcome: with it a folder is read back whole.
//!
//! ```text
//! labels.npz    of each tool: sites, answers, settings
//! outcome.npz   the rest: request, directions, meshes in f64; of each tool warnings, findings and counts
//! predicted.npz of `predict`: likewise, beside predictions.npz of each tool
//! tools.npz     of `tools`: all of it
//! setups.npz    of `setups`: all of it
//! ```
//!
//! Texts are JSON in arrays of bytes. Times are left out: the same request gives the same files.

mod placed;
mod predictions;
mod setups;
mod tools;

use super::fixtures::KeptOut;
use super::outcome::{Outcome, ToolOutcome};
use super::request::Request;
use crate::access::surface::{SurfaceStats, Warning};
use crate::access::{Labels, Stats};
use crate::data::files::{LabelFile, Provenance};
use crate::data::npz::{NpzReader, NpzWriter};
use crate::findings::Findings;
use crate::geom::Sites;
use crate::geom::file_vertices::SiteVertices;
use crate::report::folder::{LABELS, OUTCOME};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use placed::OfPlaced;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

const FORMAT: &str = "deepmill outcome";
const VERSION: u64 = 1;
const REMEDY: &str = "run the command again that wrote the folder";

/// What is not about one tool.
#[derive(Serialize, Deserialize)]
struct OfAll<'a> {
    #[serde(flatten)]
    placed: OfPlaced<'a>,
    notices: Cow<'a, [String]>,
    kept_out: Cow<'a, Option<KeptOut>>,
    findings: Cow<'a, Option<Findings>>,
}

/// What is about one tool and not in its file.
#[derive(Serialize, Deserialize)]
struct OfTool<'a> {
    warnings: Cow<'a, [Warning]>,
    findings: Cow<'a, Findings>,
    stats: Stats,
    surface: Option<OfSurface>,
}

/// What the file lacks of the mesh definition.
#[derive(Serialize, Deserialize)]
struct OfSurface {
    n_directions: usize,
    finish_mm: f64,
    stats: SurfaceStats,
}

impl PartialEq for Outcome {
    fn eq(&self, other: &Self) -> bool {
        let Outcome { placed, answers, of_all, kept_out, notices, seconds: _ } = self;
        (placed, answers, of_all, kept_out, notices)
            == (&other.placed, &other.answers, &other.of_all, &other.kept_out, &other.notices)
    }
}

impl Outcome {
    /// Reads what [`Outcome::write`] has written, of whatever [`Files`](super::Files): an equal outcome, but for
    /// [`Outcome::seconds`], which no file has. Written again, it gives the same bytes.
    ///
    /// ```
    /// use deepmill::analysis::{Analysis, Files, Outcome};
    /// use deepmill::data::files::tools::Tool;
    /// use deepmill::{geom::solids, glam::DVec3};
    ///
    /// # let temporary = tempfile::tempdir().unwrap();
    /// # let folder = temporary.path();
    /// let tool = Tool::new("3,20,20,30".parse()?, None, 0.0)?; // a ball end
    /// let block = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
    /// let analysis = Analysis::new("block", block, vec![tool]).n_sites(200).directions("up".parse()?);
    /// let outcome = analysis.run(&mut ())?;
    /// outcome.write(folder, &Files::default(), &mut ())?;
    /// let read = Outcome::read(folder)?;
    /// assert_eq!(read, outcome);
    /// let underside = &read.findings().list[0]; // nothing comes from below
    /// assert!(underside.normal.z < -0.9 && (underside.area_mm2 - 1200.0).abs() < 100.0); // of few sites
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the folder has no `outcome.npz`, as those that an earlier version wrote, a file is damaged, or the answers
    /// of a tool are those of another run.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = &folder.join(OUTCOME);
        let mut npz =
            open(path, FORMAT, "label the part again; its `labels.npz` can be read without")?;
        let all: OfAll = read_text(path, &mut npz, "outcome")?;
        let OfPlaced { request, directions, .. } = &all.placed;
        let Read { answers, sites, vertices, stated } =
            read_answers((path, &mut npz), folder, request, directions)?;
        let placed = all.placed.read((path, &mut npz), (sites, vertices))?;
        let Some(placed) = placed else { return Err(of_another_run(&stated[0].0, "faces")) };
        let sites = &placed.sites;
        let (findings, kept_out) = (all.findings.into_owned(), all.kept_out.into_owned());
        let of_others = findings.iter().any(|findings| !is_about(findings, sites))
            || kept_out.iter().any(|kept| !keeps_out_of(kept, (answers.len(), sites.len())));
        if of_others {
            return Err(Error::file(path, "outcome", "findings of other sites", REMEDY));
        }
        let outcome = Outcome {
            placed,
            answers,
            of_all: findings,
            kept_out,
            notices: all.notices.into_owned(),
            seconds: [0.0; 3],
        };
        for (k, (labels, stated)) in stated.iter().enumerate() {
            if outcome.provenance(k)? != *stated {
                return Err(of_another_run(labels, "metadata.json"));
            }
        }
        Ok(outcome)
    }

    /// Writes `outcome.npz`; returns its path.
    pub(super) fn write_record(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(OUTCOME);
        let mut npz = NpzWriter::new();
        let all = OfAll {
            placed: OfPlaced::of(&self.placed),
            notices: Cow::Borrowed(&self.notices),
            kept_out: Cow::Borrowed(&self.kept_out),
            findings: Cow::Borrowed(&self.of_all),
        };
        add_text(&path, &mut npz, "outcome", &all)?;
        for (k, answer) in self.answers.iter().enumerate() {
            add_text(&path, &mut npz, &format!("tool_{k}"), &OfTool::of(answer))?;
            let beta = &answer.labels.beta;
            if let Some(further) = beta.get(self.placed.sites.len()..).filter(|b| !b.is_empty()) {
                npz.array(&format!("tool_{k}_further_beta"), &[further.len()], further);
            }
        }
        placed::add(&mut npz, &self.placed);
        let meaning = "what labels.npz of each tool does not hold; texts are JSON";
        npz.metadata(&metadata(FORMAT, self.part(), meaning));
        npz.write(&path)?;
        Ok(path)
    }
}

impl<'a> OfTool<'a> {
    fn of(answer: &'a ToolOutcome) -> Self {
        let ToolOutcome { labels, warnings, findings } = answer;
        let surface = labels.surface.as_ref().map(|surface| OfSurface {
            n_directions: surface.n_directions,
            finish_mm: surface.finish_mm,
            stats: surface.stats,
        });
        OfTool {
            warnings: Cow::Borrowed(warnings),
            findings: Cow::Borrowed(findings),
            stats: labels.stats,
            surface,
        }
    }

    /// With the answers of its file.
    fn complete(
        self,
        (path, npz): (&Path, &mut NpzReader),
        (k, directions): (usize, &Directions),
        mut labels: Labels,
    ) -> Result<ToolOutcome> {
        let further = format!("tool_{k}_further_beta");
        if npz.has(&further) {
            labels.beta.extend(npz.counts::<u64>(&further)?);
        }
        labels.stats = self.stats;
        match (&mut labels.surface, self.surface) {
            (Some(surface), Some(of)) => {
                (surface.n_directions, surface.finish_mm) = (of.n_directions, of.finish_mm);
                surface.stats = of.stats;
                labels.answers = labels.answers.with_shares_of(of.n_directions);
            }
            (None, None) => {
                labels.answers = labels.answers.with_shares_of(directions.len());
                let vectors = directions.vectors();
                let of = |k: &Option<u32>| {
                    k.map_or(Some(None), |k| Some(Some(*vectors.get(k as usize)?)))
                };
                let witness: Option<Vec<_>> = labels.witness.iter().map(of).collect();
                let none =
                    || Error::file(path, "outcome", "fewer directions than witnesses name", REMEDY);
                labels.answers.witness = witness.ok_or_else(none)?;
            }
            _ => {
                let found = "another definition than that of labels.npz";
                return Err(Error::file(path, format!("tool_{k}"), found, REMEDY));
            }
        }
        let (warnings, findings) = (self.warnings.into_owned(), self.findings.into_owned());
        Ok(ToolOutcome { labels, warnings, findings })
    }
}

/// The answers of all tools, about the same sites.
struct Read {
    answers: Vec<ToolOutcome>,
    sites: Sites,
    vertices: Option<SiteVertices>,
    /// Per tool its file, and what that states.
    stated: Vec<(PathBuf, Provenance)>,
}

fn read_answers(
    (path, npz): (&Path, &mut NpzReader),
    folder: &Path,
    request: &Request,
    directions: &Directions,
) -> Result<Read> {
    let (mut answers, mut stated, mut placed) = (Vec::new(), Vec::new(), None);
    for (k, tool) in request.tools.iter().enumerate() {
        let labels = match request.has_folders {
            false => folder.join(LABELS),
            true => folder.join(tool.folder()).join(LABELS),
        };
        let file = LabelFile::read(&labels)?;
        let of: OfTool = read_text(path, npz, &format!("tool_{k}"))?;
        let answer = of.complete((path, npz), (k, directions), file.labels)?;
        let (sites, _) = placed.get_or_insert((file.sites.clone(), file.vertices));
        if *sites != file.sites || !is_about(&answer.findings, sites) {
            return Err(of_another_run(&labels, "points"));
        }
        answers.push(answer);
        stated.push((labels, file.provenance));
    }
    let Some((sites, vertices)) = placed else {
        return Err(Error::file(path, "outcome", "no tool", REMEDY));
    };
    sites.check()?;
    Ok(Read { answers, sites, vertices, stated })
}

/// Whether it is about so many tools and sites, and names what there is.
fn keeps_out_of(kept: &KeptOut, (n_tools, n_sites): (usize, usize)) -> bool {
    kept.by_tool.len() == n_tools
        && kept.by_tool.iter().all(|of| of.len() == n_sites)
        && kept.by_tool.iter().flatten().flatten().all(|k| *k < kept.names.len())
}

/// Whether the findings name sites of these.
fn is_about(findings: &Findings, sites: &Sites) -> bool {
    let Findings { list, largest, most_left, of_site, .. } = findings;
    let mut all = list.iter().chain(largest).chain(most_left);
    of_site.len() == sites.len() && all.all(|finding| (finding.site as usize) < sites.len())
}

/// The metadata of a record.
fn metadata(format: &str, part: &str, meaning: &str) -> Value {
    json!({
        "format": format,
        "version": VERSION,
        "program": Provenance::PROGRAM,
        "unit": "mm",
        "part": part,
        "meaning": meaning,
    })
}

/// Opens a record of a format, of this version or an earlier one; `remedy` is what to do without it.
fn open(path: &Path, format: &str, remedy: &str) -> Result<NpzReader> {
    if !path.exists() {
        let found = "there is none: nothing was written here, or by an earlier version";
        return Err(Error::file(path, "file", found, remedy));
    }
    let mut npz = NpzReader::open(path)?;
    let metadata = npz.metadata()?;
    let bad = |found: String| Error::file(path, "metadata.json", found, REMEDY);
    if metadata["format"] != format {
        return Err(bad(format!("the format is {}, expected {format}", metadata["format"])));
    }
    if metadata["version"].as_u64().is_none_or(|version| version > VERSION) {
        return Err(bad(format!("the version is {}", metadata["version"])));
    }
    Ok(npz)
}

fn of_another_run(path: &Path, at: &str) -> Error {
    let found = format!("it is of another run than {OUTCOME}");
    Error::file(path, at, found, REMEDY)
}

fn add_text(path: &Path, npz: &mut NpzWriter, name: &str, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_vec(value).map_err(|e| Error::write(path, e.into()))?;
    npz.array(name, &[text.len()], &text);
    Ok(())
}

fn read_text<T: DeserializeOwned>(path: &Path, npz: &mut NpzReader, name: &str) -> Result<T> {
    let text = npz.counts::<u8>(name)?;
    serde_json::from_slice(&text).map_err(|e| Error::file(path, name, e.to_string(), REMEDY))
}
