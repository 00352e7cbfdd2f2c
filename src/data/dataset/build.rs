//! Building a data set: for each part, read, scale, sample, draw cutters, label and write.

use super::manifest::{Content, FORMAT, MANIFEST, read_json, write_json};
use super::{
    CutterRecord, DatasetSettings, LabeledPart, Manifest, PartRecord, Split, content_hash,
};
use crate::access::surface::{SurfaceOptions, TriangleObstacles};
use crate::access::{self, Extent, LabelOptions, Labeler, Obstacles};
use crate::answers::SiteAnswers;
use crate::data::generated;
use crate::data::volume::{Volume, VolumeObstacles};
use crate::geom::sites::SiteOptions;
use crate::geom::{self, Mesh, Sites, check, formats, origin, sites};
use crate::numeric::rng::{Purpose, Stream};
use crate::storage::folder_lock::FolderLock;
use crate::tool::cutter::{Cutter, CutterParams};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where a part comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum PartSource {
    /// A mesh file in millimeters.
    File(PathBuf),
    /// Part `index` of the crate's own generator; the families take turns.
    Generated {
        /// Seed of the generator.
        seed: u64,
        /// Number of the part.
        index: u64,
    },
}

impl PartSource {
    /// Name of the part.
    pub fn name(&self) -> String {
        match self {
            PartSource::File(path) => {
                path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
            }
            PartSource::Generated { seed, index } => {
                format!("{}-{seed}-{index}", generated::family_of(*index).name())
            }
        }
    }

    /// The part's mesh, mm; of a file [as the commands take it](crate::geom::prepare).
    ///
    /// # Errors
    /// If the file cannot be read as a mesh, or does not bound solids.
    pub fn mesh(&self) -> Result<Mesh> {
        match self {
            PartSource::File(path) => {
                let mut mesh = formats::read_mesh(path, &formats::ReadOptions::default())?;
                if let Some(at) = origin::local_origin(&mesh) {
                    origin::make_relative(&mut mesh, at);
                }
                geom::prepare(&mut mesh)?;
                Ok(mesh)
            }
            PartSource::Generated { seed, index } => Ok(generated::mixed_part(*seed, *index)),
        }
    }
}

/// A data set in the making. Its folder is locked until this value and its clones are dropped.
#[derive(Debug, Clone)]
pub struct Builder {
    folder: PathBuf,
    settings: DatasetSettings,
    sources: Vec<PartSource>,
    directions: Directions,
    share: (usize, usize),
    _lock: Arc<FolderLock>,
}

impl Builder {
    /// Prepares `folder`; an interrupted build there goes on if its settings are the same.
    ///
    /// # Errors
    /// If settings are out of range, the labels of a part would not fit into the memory, there are no parts, the folder
    /// holds another data set, or another program writes into it.
    pub fn new(folder: &Path, settings: DatasetSettings, sources: Vec<PartSource>) -> Result<Self> {
        Builder::share(folder, settings, sources, (0, 1))
    }

    /// For the parts `index`, `index + n`, `index + 2n` … of a data set that `n` programs build in one folder, given as
    /// `(index, n)`.
    ///
    /// # Errors
    /// As [`Builder::new`]; programs with other shares may write into the folder.
    pub fn share(
        folder: &Path,
        settings: DatasetSettings,
        sources: Vec<PartSource>,
        (index, n): (usize, usize),
    ) -> Result<Self> {
        if sources.is_empty() {
            let remedy = "name mesh files or folders, or ask for generated parts";
            return Err(Error::argument("the list of parts", "empty", "at least one part", remedy));
        }
        settings.check()?;
        let directions = Directions::new(settings.directions.clone())?;
        Extent {
            n_queries: settings.n_sites,
            n_obstacles: settings.n_sites.saturating_add(settings.n_obstacles.unwrap_or(0)),
            n_cutters: if settings.part_itself { 1 } else { settings.n_cutters },
            n_directions: directions.len(),
            occlusion: true,
        }
        .require_memory()?;
        let lock = match n {
            1 => FolderLock::whole(folder)?,
            _ => FolderLock::share(folder, index, n)?,
        };
        let plan = folder.join("settings.json");
        match plan.exists() {
            true if read_json::<DatasetSettings>(&plan, "choose another folder")? != settings => {
                return Err(Error::file(
                    &plan,
                    "settings",
                    "the folder holds a data set made with other settings",
                    "choose another folder, or repeat the settings to go on with it",
                ));
            }
            true => {}
            false => write_json(&plan, &settings)?,
        }
        let (folder, share, _lock) = (folder.into(), (index, n), Arc::new(lock));
        Ok(Builder { folder, settings, sources, directions, share, _lock })
    }

    /// Places of its parts in the list.
    pub fn own_parts(&self) -> impl ExactSizeIterator<Item = usize> + use<> {
        let (index, n) = self.share;
        (index..self.n_parts()).step_by(n)
    }

    /// Number of parts.
    pub fn n_parts(&self) -> usize {
        self.sources.len()
    }

    /// Makes part `index`, or returns the record of an earlier run. A part that cannot be labeled is
    /// a record with the reason, not an error.
    ///
    /// # Errors
    /// If the part's files cannot be written.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn part(&self, index: usize) -> Result<PartRecord> {
        let path = self.record_path(index);
        if path.exists() {
            return read_json(&path, "delete this file and build again");
        }
        let name = self.sources[index].name();
        let (content, skipped) = match self.label(index) {
            Ok((part, scale, box_mm)) => {
                let content = store(&self.folder, index, &name, &part, scale, box_mm)?;
                (Some(content), None)
            }
            Err(reason) => (None, Some(reason.to_string())),
        };
        let record = PartRecord { index, split: self.split(&name), name, content, skipped };
        write_json(&path, &record)?;
        Ok(record)
    }

    /// Writes the manifest if every part is finished; `None` while other shards are still at work.
    ///
    /// # Errors
    /// If a record cannot be read or the manifest not written.
    pub fn finish(&self) -> Result<Option<Manifest>> {
        if !self.missing().is_empty() {
            return Ok(None);
        }
        let record = |i| read_json(&self.record_path(i), "delete this file and build again");
        let parts = (0..self.n_parts()).map(record).collect::<Result<Vec<_>>>()?;
        let settings = self.settings.clone();
        let manifest = Manifest { format: FORMAT.into(), settings, parts, imported: false };
        write_json(&self.folder.join(MANIFEST), &manifest)?;
        Ok(Some(manifest))
    }

    /// Numbers of the parts that are neither finished nor skipped.
    pub fn missing(&self) -> Vec<usize> {
        (0..self.n_parts()).filter(|index| !self.record_path(*index).exists()).collect()
    }

    /// What tells its list of parts from another: number, and names in order.
    pub fn names(&self) -> Vec<String> {
        self.sources.iter().map(PartSource::name).collect()
    }

    fn record_path(&self, index: usize) -> PathBuf {
        self.folder.join(format!("{}.json", stem(index, &self.sources[index].name())))
    }

    /// By name, so that a part stays in its split when others come or go.
    fn split(&self, name: &str) -> Split {
        let key = name.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
        });
        let u = Stream::new(self.settings.seed, 0, key, Purpose::Shuffle).unit();
        if u < self.settings.validation_share { Split::Validation } else { Split::Train }
    }

    fn label(&self, index: usize) -> Result<(LabeledPart, f64, [f64; 3])> {
        let mut mesh = self.sources[index].mesh()?;
        check::check(&mesh).require_bodies()?;
        let scale = match self.settings.size_mm {
            None => scale_to_min_edge(&mut mesh, self.settings.min_edge_mm),
            Some([low, high]) => {
                let index = index as u64;
                let mut stream = Stream::new(self.settings.seed, 0, index, Purpose::Orientation);
                scale_to_size(&mut mesh, stream.log_range(low, high))
            }
        };
        let box_mm = mesh.bounds().map_or([0.0; 3], |(lo, hi)| (hi - lo).to_array());
        let (sites, surface) = match self.settings.volume {
            true => {
                let surface = self.sites(&mesh, self.settings.n_surface_sites(), index)?;
                (Volume::new(&mesh, self.settings.n_sites)?.points(), Some(surface))
            }
            false => (self.sites(&mesh, self.settings.n_sites, index)?, None),
        };
        let mut stream = Stream::new(self.settings.seed, 0, index as u64, Purpose::Cutter);
        let drawn =
            (0..self.settings.n_cutters).map(|_| self.settings.cutter_set.draw(&mut stream));
        let params: Vec<CutterParams> = drawn.collect();
        let cutters = params.iter().map(|p| Cutter::ball_end(*p)).collect::<Result<Vec<_>>>()?;
        let answers = match (self.settings.part_itself, &surface) {
            (true, None) => self.label_part(&mesh, &sites, &cutters)?,
            (false, None) => self.label_sites(&mesh, &sites, &cutters, index)?,
            (true, Some(_)) => {
                let part = TriangleObstacles::new(&mesh, &[])?;
                self.label_volume(&VolumeObstacles::Part(Box::new(part)), &sites, &cutters)?
            }
            (false, Some(surface)) => {
                let obstacles = VolumeObstacles::Points(surface.points.clone());
                self.label_volume(&obstacles, &sites, &cutters)?
            }
        };
        let part = LabeledPart { sites, surface, cutters: params, answers };
        Ok((part, scale, box_mm))
    }

    /// Points as obstacles.
    fn label_sites(
        &self,
        mesh: &Mesh,
        sites: &Sites,
        cutters: &[Cutter],
        index: usize,
    ) -> Result<Vec<SiteAnswers>> {
        let dense = match self.settings.n_obstacles {
            Some(n) => self.sites(mesh, n, index)?.points,
            None => Vec::new(),
        };
        let obstacles = match dense.as_slice() {
            [] => Obstacles::Queries,
            points => Obstacles::QueriesAnd(points),
        };
        let options = LabelOptions { beta: false, ..self.settings.label_options() };
        let labels = access::label_many(sites, obstacles, cutters, &self.directions, &options)?;
        Ok(labels.into_iter().map(|labels| labels.answers).collect())
    }

    /// Triangles as obstacles.
    fn label_part(
        &self,
        mesh: &Mesh,
        sites: &Sites,
        cutters: &[Cutter],
    ) -> Result<Vec<SiteAnswers>> {
        let share = self.settings.occlusion_share;
        let options = SurfaceOptions { share, ..SurfaceOptions::default() };
        let labeler = Labeler::of_part(mesh, &[], self.directions.clone(), options)?;
        cutters.iter().map(|cutter| labeler.answer(sites, cutter)).collect()
    }

    /// Points of space.
    fn label_volume(
        &self,
        obstacles: &VolumeObstacles,
        points: &Sites,
        cutters: &[Cutter],
    ) -> Result<Vec<SiteAnswers>> {
        let label = |cutter| obstacles.answers(&points.points, cutter, &self.directions);
        cutters.iter().map(label).collect()
    }

    fn sites(&self, mesh: &Mesh, n_sites: usize, index: usize) -> Result<Sites> {
        let seed =
            Stream::new(self.settings.seed, n_sites as u64, index as u64, Purpose::Sites).bits();
        sites::sample(mesh, &SiteOptions { n_sites, seed, ..SiteOptions::default() })
    }
}

/// Path of a part's files in the data set, without ending.
fn stem(index: usize, name: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    format!("parts/{index:06}-{}", name.chars().map(safe).collect::<String>())
}

/// Writes a part's arrays; returns what its record says of them.
pub(super) fn store(
    folder: &Path,
    index: usize,
    name: &str,
    part: &LabeledPart,
    scale: f64,
    box_mm: [f64; 3],
) -> Result<Content> {
    let file = format!("{}.npz", stem(index, name));
    let path = folder.join(&file);
    part.write(&path)?;
    let share =
        |labels: &[bool]| labels.iter().filter(|l| **l).count() as f64 / labels.len().max(1) as f64;
    let record = |(&cutter, answers): (&CutterParams, &SiteAnswers)| CutterRecord {
        cutter,
        inaccessible: share(&answers.inaccessible()),
        occlusion: share(&answers.occlusion),
    };
    let cutters = part.cutters.iter().zip(&part.answers).map(record).collect();
    let sha256 = content_hash(&path)?;
    Ok(Content { file, sha256, scale, box_mm, n_sites: part.sites.len(), cutters })
}

/// Scales `mesh` so that its largest box edge is `size_mm`; returns the factor.
fn scale_to_size(mesh: &mut Mesh, size_mm: f64) -> f64 {
    let edge = mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).max_element());
    let scale = if edge > 0.0 { size_mm / edge } else { 1.0 };
    mesh.vertices.iter_mut().for_each(|v| *v *= scale);
    scale
}

/// Scales `mesh` so that its smallest box edge is at least `min_edge_mm`; returns the factor.
pub fn scale_to_min_edge(mesh: &mut Mesh, min_edge_mm: Option<f64>) -> f64 {
    let edge = mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).min_element());
    match min_edge_mm {
        Some(wanted) if edge > 0.0 && edge < wanted => {
            let scale = wanted / edge;
            mesh.vertices.iter_mut().for_each(|v| *v *= scale);
            scale
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::dataset::Dataset;
    use crate::geom::solids::cuboid;
    use crate::storage::atomic_file::faults;
    use glam::DVec3;

    fn settings() -> DatasetSettings {
        let directions = crate::tool::directions::DirectionSet::FibonacciHemisphere { n_dirs: 5 };
        DatasetSettings { n_sites: 30, directions, ..DatasetSettings::default() }
    }

    /// Two boxes.
    fn sources(folder: &Path) -> Vec<PartSource> {
        let box_of = |height: f64| {
            let path = folder.join(format!("box-{height}.stl"));
            formats::write_stl(&path, &cuboid(DVec3::new(90.0, 80.0, height))).unwrap();
            PartSource::File(path)
        };
        [80.0, 100.0].map(box_of).into()
    }

    fn build(folder: &Path, sources: &[PartSource]) -> Result<Option<Manifest>> {
        let builder = Builder::new(folder, settings(), sources.to_vec())?;
        builder.own_parts().try_for_each(|index| builder.part(index).map(drop))?;
        builder.finish()
    }

    #[test]
    fn samples_tell_shares_of_directions_where_labels_counted_them() {
        let temporary = tempfile::tempdir().unwrap();
        let [built, part, imported] = ["a", "b", "c"].map(|n| temporary.path().join(n));
        let sources = sources(temporary.path());
        build(&built, &sources).unwrap();
        let samples = Dataset::open(&built).unwrap().samples(None).unwrap();
        let settings_of_part = DatasetSettings { part_itself: true, ..settings() };
        let builder = Builder::new(&part, settings_of_part, sources).unwrap();
        builder.own_parts().try_for_each(|i| builder.part(i).map(drop)).unwrap();
        builder.finish().unwrap();
        let about_part = Dataset::open(&part).unwrap().samples(None).unwrap();
        // By the mesh definition +z is tested, too.
        for (samples, n) in [(&samples, 5.0), (&about_part, 6.0)] {
            for answers in samples.iter().map(|sample| &sample.answers) {
                let counts = answers.accessible_directions.iter();
                let shares: Vec<f32> = counts.map(|&count| count as f32 / n).collect();
                assert_eq!(answers.accessible_share, shares);
            }
        }
        let imported_sample = |sample| {
            let (split, mm_per_unit) = (Split::Train, 1.0);
            crate::data::dataset::ImportedSample { split, sample, mm_per_unit }
        };
        let samples: Vec<_> = samples.into_iter().map(imported_sample).collect();
        crate::data::dataset::import(&imported, settings(), &samples).unwrap();
        let samples = Dataset::open(&imported).unwrap().samples(None).unwrap();
        assert!(samples.iter().all(|sample| sample.answers.accessible_share.is_empty()));
    }

    /// Names and bytes of all that is not hidden.
    fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let mut found = Vec::new();
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = PathBuf::from(path.file_name().unwrap());
            match path.is_dir() {
                true => found.extend(files(&path).into_iter().map(|(p, b)| (name.join(p), b))),
                false if name.to_str().unwrap().starts_with('.') => {}
                false => found.push((name, std::fs::read(&path).unwrap())),
            }
        }
        found.sort();
        found
    }

    #[test]
    fn a_build_that_is_refused_at_any_step_goes_on_to_the_same_data_set() {
        let temporary = tempfile::tempdir().unwrap();
        let sources = sources(temporary.path());
        let [whole, broken] = ["whole", "broken"].map(|name| temporary.path().join(name));
        build(&whole, &sources).unwrap().unwrap();
        let whole = files(&whole);
        // The settings, two files for each part, the manifest; six steps or more for each.
        let n = faults::at_every_step(
            || build(&broken, &sources),
            |refused| {
                let samples = Dataset::open(&broken).and_then(|set| set.samples(None));
                match samples {
                    // Refused after the manifest had its name: the folder could not be synced.
                    Ok(samples) => assert!(samples.len() == 2 && files(&broken) == whole),
                    Err(error) => assert!(refused, "{error}"),
                }
                build(&broken, &sources).unwrap().unwrap();
                assert!(files(&broken) == whole);
                std::fs::remove_dir_all(&broken).unwrap();
            },
        );
        assert!(n >= 36, "{n} steps");
        // Gone over again, it stays as it is.
        build(&broken, &sources).unwrap().unwrap();
        let n = faults::at_every_step(
            || build(&broken, &sources),
            |_| assert!(files(&broken) == whole),
        );
        assert!(n >= 6, "{n} steps");
    }

    #[test]
    fn shares_are_built_beside_each_other_and_two_of_one_are_not() {
        let temporary = tempfile::tempdir().unwrap();
        let (sources, folder) = (sources(temporary.path()), temporary.path().join("data"));
        let share = |index| Builder::share(&folder, settings(), sources.clone(), (index, 2));
        let refused = |builder: Result<Builder>| {
            let message = builder.unwrap_err().to_string();
            assert!(message.contains("is writing into it; wait"), "{message}");
        };
        let [one, two] = [share(0).unwrap(), share(1).unwrap()];
        refused(share(1));
        refused(Builder::new(&folder, settings(), sources.clone()));
        assert!(one.own_parts().eq([0]) && two.own_parts().eq([1]));
        one.part(0).unwrap();
        assert!(one.finish().unwrap().is_none());
        two.part(1).unwrap();
        assert_eq!(two.finish().unwrap().unwrap().n_samples(), 2);
    }
}
