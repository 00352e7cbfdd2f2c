//! Data sets on disk: one NPZ file and one record per part, one manifest for all.
//!
//! Building is restartable and shardable: a part is finished when its record exists, its content
//! depends only on the settings and its place in the list, and the manifest is the records in order.
//! Every part belongs wholly to training or wholly to validation, so no cutter of a part leaks.

mod build;
mod import;
mod manifest;

#[doc(hidden)] // of the program
pub use build::{Builder, PartSource};
#[doc(hidden)] // of the program
pub use import::{ImportedSample, import};
pub use manifest::Split;
#[doc(hidden)] // of the program and fuzz targets
pub use manifest::{CutterRecord, DatasetSettings, Manifest, PartRecord};

use crate::answers::SiteAnswers;
use crate::data::Sample;
use crate::data::files::hash;
use crate::data::npz::{NpzReader, NpzWriter};
use crate::exec::memory;
use crate::geom::Sites;
use crate::geom::sites::check_points;
use crate::storage::input_file;
use crate::tool::cutter::CutterParams;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A finished data set.
///
/// ```
/// # use deepmill::data::dataset::{DatasetSettings, ImportedSample, import};
/// use deepmill::data::dataset::{Dataset, Split};
/// # use deepmill::{answers::SiteAnswers, data::Sample, geom::Sites, glam::Vec3};
///
/// # let temporary = tempfile::tempdir().unwrap();
/// # let sample = |name: &str, split| {
/// #     let sites = Sites { points: vec![Vec3::ZERO, Vec3::X], normals: vec![Vec3::Z; 2], faces: vec![] };
/// #     let answers = SiteAnswers::new(vec![false, true], vec![true, false]);
/// #     ImportedSample::new(split, Sample::new(name, sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers), 1.0)
/// # };
/// # let samples = [sample("block", Split::Train), sample("plate", Split::Validation)];
/// # import(temporary.path(), DatasetSettings::default(), &samples)?;
/// # let folder = temporary.path();
/// let data = Dataset::open(folder)?; // of `deepmill dataset build` or `dataset import`
/// let [training, validation] = [Split::Train, Split::Validation].map(|split| data.samples(Some(split)));
/// assert_eq!((training?[0].name.as_str(), validation?[0].name.as_str()), ("block", "plate"));
/// assert_eq!(data.samples(None)?.len(), 2); // one part is never in both
/// let error = Dataset::open(&folder.join("other")).unwrap_err().to_string();
/// assert!(error.contains("manifest.json"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Dataset {
    /// Its folder.
    #[doc(hidden)] // of the program
    pub folder: PathBuf,
    /// What it holds.
    #[doc(hidden)] // of the program
    pub manifest: Manifest,
}

impl Dataset {
    /// Opens the data set in `folder`.
    ///
    /// # Errors
    /// If there is no manifest, or it cannot be understood.
    pub fn open(folder: &Path) -> Result<Self> {
        let manifest = Manifest::read(&folder.join(manifest::MANIFEST))?;
        Ok(Dataset { folder: folder.into(), manifest })
    }

    /// All samples of `split` (`None`: of both), in the order of parts and cutters.
    ///
    /// # Errors
    /// If a part's file is missing, damaged (its hash differs) or inconsistent; if they do not fit into the memory, as
    /// far as the manifest says.
    pub fn samples(&self, split: Option<Split>) -> Result<Vec<Sample>> {
        let parts = self.manifest.parts.iter().filter(|p| p.content.is_some());
        let wanted: Vec<&PartRecord> =
            parts.filter(|p| split.is_none_or(|s| s == p.split)).collect();
        let n_surface = match self.manifest.settings.volume {
            true => self.manifest.settings.n_surface_sites(),
            false => 0,
        };
        let bytes = wanted.iter().map(|part| bytes_of(part, n_surface));
        let needed = bytes.fold(0, u64::saturating_add);
        let remedy = "take fewer data sets or parts at once, or fewer sites";
        memory::require("the samples of the data set", needed, remedy)?;
        let read = crate::exec::par::map(wanted.len(), |i| self.part_samples(wanted[i]));
        let mut samples = Vec::new();
        for part in read {
            samples.extend(part?);
        }
        Ok(samples)
    }

    /// The samples of one part, one per cutter.
    fn part_samples(&self, record: &PartRecord) -> Result<Vec<Sample>> {
        let Some(content) = &record.content else { return Ok(Vec::new()) };
        let path = self.folder.join(&content.file);
        let found = content_hash(&path)?;
        if found != content.sha256 {
            return Err(Error::file(
                &path,
                "content hash",
                format!("{found}, the manifest says {}", content.sha256),
                "build this part again: delete its .json record and run `dataset build` once more",
            ));
        }
        let part = LabeledPart::read(&path)?;
        let n_directions = self.manifest.settings.n_directions()?;
        let (sites, surface) = (Arc::new(part.sites), part.surface.map(Arc::new));
        let samples = part.cutters.into_iter().zip(part.answers).map(|(cutter, answers)| Sample {
            name: record.name.clone(),
            sites: Arc::clone(&sites),
            surface: surface.clone(),
            cutter,
            // Imported labels know "none" (0) and "some" (1): these are no counts.
            answers: match self.manifest.imported {
                true => answers,
                false => answers.with_shares_of(n_directions),
            },
        });
        Ok(samples.collect())
    }
}

/// Labels of one part for several cutters, as one NPZ file holds them.
#[derive(Debug, Clone, Default, PartialEq)]
#[doc(hidden)] // checked by fuzz targets
pub struct LabeledPart {
    /// Sites, mm; points of the space around the part have no normals.
    pub sites: Sites,
    /// Cutters, mm.
    pub cutters: Vec<CutterParams>,
    /// Sites of the surface beside points of space.
    pub surface: Option<Sites>,
    /// One for each cutter: `inaccessible`, `occlusion` and `accessible_directions`.
    pub answers: Vec<SiteAnswers>,
}

impl LabeledPart {
    /// Writes `points`, `normals` `[n, 3]`, `cutters` `[k, 4]` (CR, CH, FR, FH) and, with a row per site and a column
    /// per cutter, `inaccessible`, `occlusion` (bool) and `accessible_directions` (u32); beside points of space
    /// `surface_points` and `surface_normals` `[m, 3]`.
    ///
    /// # Errors
    /// If there is not an answer for every site and cutter, the sites fail [`Sites::check`] and are no points of space,
    /// or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (n, k) = (self.sites.len(), self.cutters.len());
        match self.sites.normals.is_empty() {
            true => check_points("point", &self.sites.points)?,
            false => self.sites.check()?,
        }
        self.surface.as_ref().map_or(Ok(()), Sites::check)?;
        self.check_lengths(path)?;
        let cutters: Vec<f64> = self.cutters.iter().flat_map(|c| c.to_array()).collect();
        let mut npz = NpzWriter::new();
        npz.vectors("points", &self.sites.points);
        npz.vectors("normals", &self.sites.normals);
        npz.array("cutters", &[k, 4], &cutters);
        let answers = &self.answers;
        npz.array("inaccessible", &[n, k], &by_site(n, answers, SiteAnswers::is_inaccessible));
        npz.array("occlusion", &[n, k], &by_site(n, answers, |a, i| a.occlusion[i]));
        let counts = by_site(n, answers, |a, i| a.accessible_directions[i]);
        npz.array("accessible_directions", &[n, k], &counts);
        if let Some(surface) = &self.surface {
            npz.vectors("surface_points", &surface.points);
            npz.vectors("surface_normals", &surface.normals);
        }
        npz.write(path)
    }

    fn check_lengths(&self, path: &Path) -> Result<()> {
        let (n, k) = (self.sites.len(), self.cutters.len());
        let lengths = |len: fn(&SiteAnswers) -> usize| self.answers.iter().map(len).collect();
        let lengths: [(&str, Vec<usize>); 3] = [
            ("inaccessible", lengths(SiteAnswers::len)),
            ("occlusion", lengths(|a| a.occlusion.len())),
            ("accessible_directions", lengths(|a| a.accessible_directions.len())),
        ];
        for (name, lengths) in lengths {
            if lengths != vec![n; k] {
                let found = format!("lists of {lengths:?} for {n} sites and {k} cutters");
                let remedy = "label every site with every cutter";
                return Err(Error::file(path, name, found, remedy));
            }
        }
        Ok(())
    }

    /// Reads what [`LabeledPart::write`] wrote; the faces of the sites are not stored.
    ///
    /// # Errors
    /// If an array is missing, of another shape, or holds other values.
    pub fn read(path: &Path) -> Result<Self> {
        let mut npz = NpzReader::open(path)?;
        let points = npz.vectors("points")?;
        let normals = npz.vectors("normals")?;
        let cutters = npz.f64s("cutters", 4)?;
        let cutters: Vec<_> = cutters
            .chunks_exact(4)
            .map(|c| CutterParams::from_array(std::array::from_fn(|i| c[i])))
            .collect();
        let (n, k) = (points.len(), cutters.len());
        if !normals.is_empty() && normals.len() != n {
            let found = format!("{} rows for {n} points", normals.len());
            return Err(Error::file(path, "normals", found, "build this part again"));
        }
        let surface = match npz.has("surface_points") {
            true => {
                let (points, normals) =
                    (npz.vectors("surface_points")?, npz.vectors("surface_normals")?);
                let surface = Sites::new(points, normals).map_err(|error| {
                    let found = error.to_string();
                    Error::file(path, "surface", found, "build this part again")
                })?;
                Some(surface)
            }
            false => None,
        };
        let mut column = |name: &str| -> Result<Vec<Vec<f32>>> {
            let values = npz.f32s(name, k)?;
            if values.len() != n * k {
                let found = format!("{} rows for {n} points", values.len() / k.max(1));
                return Err(Error::file(path, name, found, "build this part again"));
            }
            Ok((0..k).map(|c| values.iter().skip(c).step_by(k).copied().collect()).collect())
        };
        let truth = |column: Vec<f32>| column.into_iter().map(|v| v != 0.0).collect();
        let (inaccessible, occlusion) = (column("inaccessible")?, column("occlusion")?);
        let counts = column("accessible_directions")?;
        let columns = inaccessible.into_iter().zip(occlusion).zip(counts);
        let answers = columns.map(|((inaccessible, occlusion), counts)| SiteAnswers {
            accessible_directions: counts.into_iter().map(|v| v as u32).collect(),
            ..SiteAnswers::new(truth(inaccessible), truth(occlusion))
        });
        let answers = answers.collect();
        let sites = Sites { points, normals, faces: Vec::new() };
        Ok(LabeledPart { sites, surface, cutters, answers })
    }
}

/// Memory of a part's samples: sites, those of the surface about points of space, and for each cutter two answers, a
/// count and its share.
fn bytes_of(part: &PartRecord, n_surface: usize) -> u64 {
    const OF_SITE: usize = 24;
    const OF_ANSWER: usize = 10;
    const OF_SAMPLE: usize = 512;
    part.content.as_ref().map_or(0, |content| {
        let (n, k) = (content.n_sites, content.cutters.len());
        let of_site = OF_SITE + OF_ANSWER * k;
        let parts = [[n, of_site], [n_surface, OF_SITE], [k, OF_SAMPLE]];
        parts.map(memory::product).into_iter().fold(0, u64::saturating_add)
    })
}

/// A list of each cutter's answers, rearranged to rows per site.
fn by_site<T>(n: usize, answers: &[SiteAnswers], of: fn(&SiteAnswers, usize) -> T) -> Vec<T> {
    (0..n).flat_map(|i| answers.iter().map(move |a| of(a, i))).collect()
}

/// SHA-256 of a file's bytes, hexadecimal.
fn content_hash(path: &Path) -> Result<String> {
    let bytes = input_file::read(path, input_file::DATA)?;
    Ok(hash::hex(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn parts_with_answers_left_out_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.npz");
        let good = LabeledPart {
            sites: Sites::new(vec![Vec3::X, Vec3::Y], vec![Vec3::Z; 2]).unwrap(),
            surface: None,
            cutters: vec![[1.5, 6.0, 40.0, 5.0].into()],
            answers: vec![SiteAnswers {
                accessible_directions: vec![0, 3],
                ..SiteAnswers::new(vec![true, false], vec![false, true])
            }],
        };
        let with = |change: fn(&mut SiteAnswers)| {
            let mut part = good.clone();
            part.answers.iter_mut().for_each(change);
            part
        };
        good.write(&path).unwrap();
        let refused = |part: LabeledPart| part.write(&path).unwrap_err().to_string();
        let short = with(|answers| answers.occlusion = vec![true]);
        assert!(refused(short).contains("part.npz: occlusion: lists of [1] for 2 sites"));
        let missing = with(|answers| answers.accessible_directions = vec![]);
        assert!(refused(missing).contains("accessible_directions: lists of [0]"));
        let few = LabeledPart { answers: vec![], ..good.clone() };
        assert!(refused(few).contains("inaccessible: lists of []"));
        let bare = Sites { normals: vec![Vec3::Z], ..good.sites.clone() };
        assert!(refused(LabeledPart { sites: bare, ..good }).contains("1 normals for 2 sites"));
    }

    #[test]
    fn points_of_space_survive_a_file_without_normals() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("space.npz");
        let answers = SiteAnswers::new(vec![true, false], vec![false; 2]);
        let part = LabeledPart {
            sites: Sites { points: vec![Vec3::X, Vec3::Y], ..Sites::default() },
            surface: Some(Sites::new(vec![Vec3::ZERO], vec![Vec3::Z]).unwrap()),
            cutters: vec![[1.5, 6.0, 40.0, 5.0].into()],
            answers: vec![SiteAnswers { accessible_directions: vec![0, 3], ..answers }],
        };
        part.write(&path).unwrap();
        assert_eq!(LabeledPart::read(&path).unwrap(), part);
    }

    #[test]
    fn a_surface_that_is_none_is_refused_by_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("space.npz");
        let refused = |points: &[Vec3], normals: Option<&[Vec3]>| {
            let mut npz = NpzWriter::new();
            npz.vectors("points", &[Vec3::X]);
            npz.vectors("normals", &[]);
            npz.array("cutters", &[1, 4], &[1.5, 6.0, 40.0, 5.0]);
            for name in ["inaccessible", "occlusion", "accessible_directions"] {
                npz.array(name, &[1, 1], &[0_u32]);
            }
            npz.vectors("surface_points", points);
            if let Some(normals) = normals {
                npz.vectors("surface_normals", normals);
            }
            npz.write(&path).unwrap();
            let message = LabeledPart::read(&path).unwrap_err().to_string();
            assert!(message.contains("space.npz") && message.lines().count() == 1, "{message}");
            message
        };
        assert!(refused(&[Vec3::X], None).contains("surface_normals"));
        assert!(refused(&[Vec3::X], Some(&[])).contains("0 normals for 1 sites"));
        assert!(refused(&[Vec3::X], Some(&[Vec3::ZERO])).contains("site 0: normal"));
        assert!(refused(&[Vec3::NAN], Some(&[Vec3::Z])).contains("surface_points"));
    }
}
