//! Building a data set from samples that other programs labeled.

use super::build::store;
use super::manifest::{FORMAT, MANIFEST, write_json};
use super::{DatasetSettings, LabeledPart, Manifest, PartRecord, Split};
use crate::answers::SiteAnswers;
use crate::data::Sample;
use crate::storage::folder_lock::FolderLock;
use crate::{Error, Result};
use std::path::Path;

/// A sample of another program, in mm.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ImportedSample {
    /// What it is used for.
    pub split: Split,
    /// Points, cutter and labels.
    pub sample: Sample,
    /// Factor that made its points millimeters; 1 if they were.
    pub mm_per_unit: f64,
}

impl ImportedSample {
    /// Of these.
    pub fn new(split: Split, sample: Sample, mm_per_unit: f64) -> Self {
        ImportedSample { split, sample, mm_per_unit }
    }
}

/// Writes `samples` as a data set into the empty or new `folder`. `settings` say how they were labeled;
/// that cannot be checked. Of the accessible directions only "none" (0) and "some" (1) are known.
///
/// # Errors
/// If there are no samples, one is inconsistent, the folder holds a data set, another program writes into it, or a file
/// cannot be written.
pub fn import(
    folder: &Path,
    settings: DatasetSettings,
    samples: &[ImportedSample],
) -> Result<Manifest> {
    if samples.is_empty() {
        let remedy = "name a folder with samples of the published format";
        return Err(Error::argument("the list of samples", "empty", "one or more", remedy));
    }
    let _lock = FolderLock::whole(folder)?;
    let path = folder.join(MANIFEST);
    if path.exists() {
        return Err(Error::file(&path, "folder", "it holds a data set", "choose another folder"));
    }
    let mut parts = Vec::with_capacity(samples.len());
    for (index, ImportedSample { split, sample, mm_per_unit }) in samples.iter().enumerate() {
        sample.check()?;
        let some = sample.answers.accessible().into_iter().map(u32::from);
        let accessible_directions = some.collect();
        let part = LabeledPart {
            sites: (*sample.sites).clone(),
            surface: None,
            cutters: vec![sample.cutter],
            answers: vec![SiteAnswers { accessible_directions, ..sample.answers.clone() }],
        };
        let points = &part.sites.points;
        let low = points.iter().copied().reduce(|a, b| a.min(b)).unwrap_or_default();
        let high = points.iter().copied().reduce(|a, b| a.max(b)).unwrap_or_default();
        let box_mm = (high - low).as_dvec3().to_array();
        let content = Some(store(folder, index, &sample.name, &part, *mm_per_unit, box_mm)?);
        let name = sample.name.clone();
        parts.push(PartRecord { index, name, split: *split, content, skipped: None });
    }
    let manifest = Manifest { format: FORMAT.into(), settings, parts, imported: true };
    write_json(&path, &manifest)?;
    Ok(manifest)
}
