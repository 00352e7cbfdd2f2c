//! Files of labels and of predictions: NPZ archives with metadata that state the meaning of every array.
//!
//! `docs/formats.md` lists every array. One row per site, in the order of the sites.

pub(in crate::data) mod hash;
#[doc(hidden)] // of the program
pub mod label_query;
#[doc(hidden)] // of the program
pub mod machines;
#[doc(hidden)] // of the program
pub mod matrix;
mod meaning;
pub(crate) mod poses;
mod predictions;
#[doc(hidden)] // of the program
pub mod published;
#[doc(hidden)] // of the program
pub mod safety;
#[doc(hidden)] // of the program
pub mod settings;
pub mod tools;
pub(crate) mod vertices;
#[doc(hidden)] // of the program
pub mod volume;

#[doc(hidden)] // of the program
pub use meaning::ball_end_words;
pub use predictions::PredictionFile;
#[doc(hidden)] // of the program
pub use settings::AnalysisSettings;
pub use settings::Blocking;

use super::npz::{NpzReader, NpzWriter};
use crate::access::Labels;
use crate::access::surface::SurfaceEvidence;
use crate::answers::{SiteAnswers, of_sites};
use crate::geom::Sites;
use crate::geom::file_vertices::SiteVertices;
use crate::tool::cutter::{CutterParams, ToolPart};
use crate::{Error, Result};
use meaning::{RETREAT_UNPROVEN, label_meaning};
use poses::{REST, WITNESS, read_directions, read_poses};
use serde_json::{Value, json};
use std::path::Path;

/// Version of both formats; a reader refuses newer ones.
const VERSION: u64 = 1;

/// What the answers of a file are about.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Provenance {
    /// Name of the part.
    pub part: String,
    /// The cutter's lengths, mm.
    pub cutter: CutterParams,
    /// The cutter in words, with what the four lengths do not say.
    pub tool: String,
    /// Everything else that decided the answers.
    #[doc(hidden)] // of the program
    pub settings: AnalysisSettings,
}

impl Provenance {
    /// Name and version of this program, as files state it.
    #[doc(hidden)] // of the program
    pub const PROGRAM: &str = concat!("deepmill ", env!("CARGO_PKG_VERSION"));

    /// Of a ball-end cutter; `tool` is in words what `cutter` is in numbers.
    #[doc(hidden)] // of the program
    pub fn ball_end(
        part: impl Into<String>,
        cutter: CutterParams,
        settings: AnalysisSettings,
    ) -> Self {
        Provenance { part: part.into(), cutter, tool: ball_end_words(cutter), settings }
    }

    fn metadata(&self, format: &str, meaning: Value) -> Value {
        json!({
            "format": format,
            "version": VERSION,
            "program": Self::PROGRAM,
            "unit": "mm",
            "part": self.part,
            "cutter": { "order": "CR, CH, FR, FH", "words": self.tool },
            "meaning": meaning,
            "settings": self.settings.json(),
        })
    }

    /// Reads what [`Provenance::metadata`] and the array `cutter` hold, and checks the format.
    fn read(path: &Path, npz: &mut NpzReader, format: &str) -> Result<Self> {
        let metadata = npz.metadata()?;
        let bad = |found: String| {
            let remedy = "name a file that this version of deepmill has written";
            Error::file(path, "metadata.json", found, remedy)
        };
        if metadata["format"] != format {
            return Err(bad(format!("the format is {}, expected {format}", metadata["format"])));
        }
        if metadata["version"].as_u64().is_none_or(|v| v > VERSION) {
            return Err(bad(format!("the version is {}", metadata["version"])));
        }
        let lengths = npz.f64s("cutter", 1)?;
        let lengths = <[f64; 4]>::try_from(lengths).map_err(|l| {
            let found = format!("{} numbers", l.len());
            Error::file(path, "cutter", found, "store CR, CH, FR, FH in mm")
        })?;
        let word = |v: &Value| v.as_str().unwrap_or_default().to_string();
        Ok(Provenance {
            part: word(&metadata["part"]),
            cutter: CutterParams::from_array(lengths),
            tool: word(&metadata["cutter"]["words"]),
            settings: AnalysisSettings::read(path, &metadata["settings"])?,
        })
    }
}

/// The exact answers for one part and cutter.
///
#[cfg_attr(feature = "generate", doc = "```")]
#[cfg_attr(not(feature = "generate"), doc = "```ignore")]
/// use deepmill::analysis::Analysis;
/// use deepmill::data::files::{LabelFile, PredictionFile, tools::Tool};
/// use deepmill::{geom::solids, glam::DVec3};
///
/// # let temporary = tempfile::tempdir().unwrap();
/// # let path = temporary.path().join("labels.npz");
/// let block = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
/// let tool = Tool::new("3,20,20,20".parse()?, None, 0.0)?;
/// let outcome = Analysis::new("block", block, vec![tool]).n_sites(100).run(&mut ())?;
/// outcome.file(0)?.write(&path)?;
/// let file = LabelFile::read(&path)?;
/// assert_eq!(file.sites, *outcome.sites());
/// assert_eq!(file.labels.answers.inaccessible(), outcome.answers()[0].labels.answers.inaccessible());
/// let error = PredictionFile::read(&path).unwrap_err().to_string();
/// assert!(error.contains("expected deepmill predictions"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LabelFile {
    /// Part, cutter and settings.
    pub provenance: Provenance,
    /// The query sites, mm.
    pub sites: Sites,
    /// One entry per site; β of further obstacles, the matrix and the engine's counts are not kept.
    pub labels: Labels,
    /// The vertices of the part's file that the sites are at, if they are known.
    #[doc(hidden)] // of the program
    pub vertices: Option<SiteVertices>,
}

impl LabelFile {
    /// Without vertices.
    pub fn new(provenance: Provenance, sites: Sites, labels: Labels) -> Self {
        LabelFile { provenance, sites, labels, vertices: None }
    }

    const FORMAT: &str = "deepmill labels";

    /// Writes the file.
    ///
    /// # Errors
    /// If a list has fewer entries than there are sites, or the system refuses the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let Labels { answers, witness, beta, .. } = &self.labels;
        let n = self.sites.len();
        let beta = if answers.occlusion.is_empty() { &[][..] } else { &beta[..] };
        let is_counted = self.labels.surface.as_ref().is_none_or(|s| s.retreat_unproven.is_empty());
        let missing = answers.accessible_directions.is_empty() && n > 0 && is_counted;
        if missing || (!answers.occlusion.is_empty() && beta.len() < n) {
            let name = if missing { "accessible_directions" } else { "beta" };
            return Err(few(path, name, beta.len().min(n), n));
        }
        let witness: Vec<i64> = match self.labels.surface {
            Some(_) => vec![-1; n],
            None => witness.iter().map(|w| w.map_or(-1, i64::from)).collect(),
        };
        let mut npz = start(&self.sites, &self.provenance);
        add_answers(path, &mut npz, answers, n)?;
        npz.array("witness", &[witness.len()], &witness);
        if !beta.is_empty() {
            npz.array("beta", &[n], &beta[..n]);
        }
        if let Some(surface) = &self.labels.surface {
            add_surface(&mut npz, surface, answers.len());
        }
        let blocked_by = &self.labels.blocked_by;
        if !blocked_by.is_empty() {
            if blocked_by.len() < n {
                return Err(few(path, "blocked_by", blocked_by.len(), n));
            }
            let code = |part: &Option<ToolPart>| part.map_or(0, |part| part as u8 + 1);
            npz.array("blocked_by", &[n], &blocked_by[..n].iter().map(code).collect::<Vec<u8>>());
        }
        let mut meaning = label_meaning(self.labels.surface.is_some());
        if !is_counted {
            meaning["retreat_unproven"] = json!(RETREAT_UNPROVEN);
        }
        vertices::add(path, &mut npz, self.vertices.as_ref(), (n, &mut meaning))?;
        npz.metadata(&self.provenance.metadata(Self::FORMAT, meaning));
        npz.write(path)
    }

    /// Reads a file that [`LabelFile::write`] has written.
    ///
    /// # Errors
    /// If it is no such file, or an array is missing, of the wrong length or out of range.
    pub fn read(path: &Path) -> Result<Self> {
        let (mut npz, provenance, sites) = open(path, Self::FORMAT)?;
        let inaccessible = npz.bools("inaccessible")?;
        let answers = SiteAnswers {
            accessible_directions: match npz.has("retreat_unproven") {
                // Tools of any profile: directions are not counted.
                true => Vec::new(),
                false => npz.counts("accessible_directions")?,
            },
            ..SiteAnswers::new(inaccessible, Vec::new())
        };
        let mut labels = Labels { answers, ..Labels::default() };
        let witness = npz.counts::<i64>("witness")?;
        same_length(path, &sites, "witness", witness.len())?;
        labels.witness = witness.into_iter().map(|w| u32::try_from(w).ok()).collect();
        if npz.has("occlusion") {
            labels.answers.occlusion = npz.bools("occlusion")?;
            labels.beta = npz.counts("beta")?;
            same_length(path, &sites, "occlusion", labels.answers.occlusion.len())?;
            same_length(path, &sites, "beta", labels.beta.len())?;
        }
        if npz.has("clearance") {
            labels.answers.clearance_mm = npz.f32s("clearance", 1)?;
            same_length(path, &sites, "clearance", labels.answers.clearance_mm.len())?;
        }
        if npz.has("rest") {
            labels.answers.rest_mm = npz.f32s("rest", 1)?;
            same_length(path, &sites, "rest", labels.answers.rest_mm.len())?;
        }
        if npz.has("rest_volume") {
            labels.answers.rest_volume_mm3 = npz.f32s("rest_volume", 1)?;
            same_length(path, &sites, "rest_volume", labels.answers.rest_volume_mm3.len())?;
        }
        if npz.has("tip_does_not_fit") {
            let tip = npz.bools("tip_does_not_fit")?;
            same_length(path, &sites, "tip_does_not_fit", tip.len())?;
            let surface = read_surface(path, &mut npz, &sites)?;
            labels.answers.of_sites = of_sites(&labels.answers.inaccessible(), &tip);
            labels.answers.tests_tip = !tip.is_empty();
            // Directions of the set alone have an index.
            labels.witness.clear();
            labels.answers.witness = read_directions(path, &mut npz, &sites, WITNESS[0])?;
            labels.surface = Some(surface);
        }
        if npz.has("blocked_by") {
            labels.blocked_by = read_blocked_by(path, &mut npz)?;
            same_length(path, &sites, "blocked_by", labels.blocked_by.len())?;
        }
        same_length(path, &sites, "inaccessible", labels.answers.len())?;
        if !npz.has("retreat_unproven") {
            let n_directions = labels.answers.accessible_directions.len();
            same_length(path, &sites, "accessible_directions", n_directions)?;
        }
        let vertices = vertices::read(path, &mut npz, &sites)?;
        Ok(LabelFile { provenance, sites, labels, vertices })
    }
}

/// Adds every list of answers that is there, for the first `n` of what it is about: the one place where files get
/// theirs.
fn add_answers(path: &Path, npz: &mut NpzWriter, answers: &SiteAnswers, n: usize) -> Result<()> {
    let complete = |name: &str, len: usize| match len {
        0 if n > 0 && name != "inaccessible" => Ok(false),
        len if len < n => Err(few(path, name, len, n)),
        _ => Ok(true),
    };
    for (name, list) in [
        ("inaccessible", &answers.inaccessible()),
        ("occlusion", &answers.occlusion),
        ("tip_does_not_fit", &answers.tip_does_not_fit()),
    ] {
        if complete(name, list.len())? {
            npz.array(name, &[n], &list[..n]);
        }
    }
    if complete("accessible_directions", answers.accessible_directions.len())? {
        npz.array("accessible_directions", &[n], &answers.accessible_directions[..n]);
    }
    for (name, list) in [
        ("clearance", &answers.clearance_mm[..]),
        ("rest", &answers.rest_mm),
        ("rest_volume", &answers.rest_volume_mm3),
        ("probability_inaccessible", answers.probability_inaccessible()),
        ("probability_occlusion", answers.probability_occlusion()),
    ] {
        if complete(name, list.len())? {
            npz.array(name, &[n], &list[..n]);
        }
    }
    Ok(())
}

fn few(path: &Path, name: &str, len: usize, n: usize) -> Error {
    let found = format!("{len} entries for {n} sites");
    Error::file(path, name, found, "write answers together with the sites that they are about")
}

/// Adds what only the mesh definition answers.
fn add_surface(npz: &mut NpzWriter, surface: &SurfaceEvidence, n: usize) {
    if surface.retreat_unproven.is_empty() {
        npz.array("collision_free_directions", &[n], &surface.collision_free_directions);
    } else {
        npz.array("retreat_unproven", &[n], &surface.retreat_unproven);
    }
    npz.array("open_directions", &[n], &surface.open_directions);
    npz.array("tolerance", &[n], &surface.tolerance_mm);
    if !surface.rests_on_tolerance.is_empty() {
        npz.array("rests_on_tolerance", &[n], &surface.rests_on_tolerance);
    }
    for (names, list) in [(WITNESS, &surface.witness), (REST, &surface.rest_pose)] {
        if list.len() == n {
            poses::add(npz, names, list);
        }
    }
}

fn read_blocked_by(path: &Path, npz: &mut NpzReader) -> Result<Vec<Option<ToolPart>>> {
    let part = |code: u32| match code {
        0 => Ok(None),
        code => ToolPart::ALL.get(code as usize - 1).copied().map(Some).ok_or_else(|| {
            let remedy = "0 is accessible, 1 tip, 2 cutter, 3 shank, 4 holder, 5 spindle";
            Error::file(path, "blocked_by", format!("{code} is no part of a tool"), remedy)
        }),
    };
    npz.counts::<u32>("blocked_by")?.into_iter().map(part).collect()
}

fn read_surface(path: &Path, npz: &mut NpzReader, sites: &Sites) -> Result<SurfaceEvidence> {
    let retreat_unproven = match npz.has("retreat_unproven") {
        true => npz.bools("retreat_unproven")?,
        false => Vec::new(),
    };
    let is_counted = retreat_unproven.is_empty();
    if !is_counted {
        same_length(path, sites, "retreat_unproven", retreat_unproven.len())?;
    }
    let surface = SurfaceEvidence {
        collision_free_directions: match is_counted {
            true => npz.counts("collision_free_directions")?,
            false => Vec::new(),
        },
        retreat_unproven,
        witness: read_poses(path, npz, sites, WITNESS)?,
        rest_pose: match npz.has(REST[0]) {
            true => read_poses(path, npz, sites, REST)?,
            false => Vec::new(),
        },
        open_directions: npz.f32s("open_directions", 1)?,
        tolerance_mm: npz.f64s("tolerance", 1)?,
        rests_on_tolerance: match npz.has("rests_on_tolerance") {
            true => npz.bools("rests_on_tolerance")?,
            false => Vec::new(),
        },
        ..SurfaceEvidence::default()
    };
    if !surface.rests_on_tolerance.is_empty() {
        same_length(path, sites, "rests_on_tolerance", surface.rests_on_tolerance.len())?;
    }
    if is_counted {
        let counts = surface.collision_free_directions.len();
        same_length(path, sites, "collision_free_directions", counts)?;
    }
    same_length(path, sites, "open_directions", surface.open_directions.len())?;
    same_length(path, sites, "tolerance", surface.tolerance_mm.len())?;
    Ok(surface)
}

fn start(sites: &Sites, provenance: &Provenance) -> NpzWriter {
    let mut npz = NpzWriter::new();
    npz.vectors("points", &sites.points).vectors("normals", &sites.normals);
    if !sites.faces.is_empty() {
        npz.array("faces", &[sites.faces.len()], &sites.faces);
    }
    npz.array("cutter", &[4], &provenance.cutter.to_array());
    npz
}

/// Opens a file about sites.
///
/// # Errors
/// If it is not of this format, or its sites are not sound.
fn open(path: &Path, format: &'static str) -> Result<(NpzReader, Provenance, Sites)> {
    let mut npz = NpzReader::open(path)?;
    let provenance = Provenance::read(path, &mut npz, format)?;
    let sites = read_sites(path, &mut npz)?;
    Ok((npz, provenance, sites))
}

fn read_sites(path: &Path, npz: &mut NpzReader) -> Result<Sites> {
    let sites = Sites {
        points: npz.vectors("points")?,
        normals: npz.vectors("normals")?,
        faces: if npz.has("faces") { npz.counts("faces")? } else { Vec::new() },
    };
    same_length(path, &sites, "normals", sites.normals.len())?;
    if !sites.faces.is_empty() {
        same_length(path, &sites, "faces", sites.faces.len())?;
    }
    Ok(sites)
}

fn same_length(path: &Path, sites: &Sites, name: &str, len: usize) -> Result<()> {
    let n = sites.len();
    if len == n {
        return Ok(());
    }
    Err(Error::file(path, name, format!("{len} rows for {n} points"), "store one row per site"))
}

#[cfg(test)]
mod tests;
