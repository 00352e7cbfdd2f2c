//! The folder of a training run: weights, history, settings and checkpoints.

use super::{Checkpoint, EpochRow, Observer, Run, Settings, StepReport, history, settings_file};
use crate::data::{Sample, SampleSource};
use crate::exec::processes::{Processes, SingleProcess, agree};
use crate::model::weights::{self, Storage};
use crate::storage::folder_lock::FolderLock;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

const MODEL: &str = "model.safetensors";
const BEST: &str = "best.safetensors";
const CHECKPOINT: &str = "checkpoint.safetensors";
const PREVIOUS: &str = "checkpoint.previous.safetensors";
const SETTINGS: &str = "settings.toml";
const HISTORY: &str = "history.csv";

/// The files of one training run. At every moment after the first epoch there is a whole checkpoint.
///
/// | file | holds |
/// |---|---|
/// | `settings.toml` | the settings it began with |
/// | `model.safetensors` | the network after the last stored step |
/// | `best.safetensors` | the network with the best sum of both F1 on the validation set; the latest, as long as none was measured |
/// | `history.csv` | a row for each epoch |
/// | `checkpoint.safetensors` | everything [`RunFolder::resume`] needs |
/// | `checkpoint.previous.safetensors` | the same, one store earlier |
///
/// A resumed run ends with the bits of one that was never stopped. What writes into the folder locks it, until this
/// value and its clones are dropped. Start, stop and resume:
///
/// ```
/// # use deepmill::{answers::SiteAnswers, cutter::*, data::Sample, geom::Sites, train::*};
/// use std::ops::ControlFlow;
/// # use deepmill::glam::Vec3;
/// # let points: Vec<Vec3> =
/// #     (0..40).map(|i| Vec3::new((i % 7) as f32, (i / 7) as f32, (i % 3) as f32)).collect();
/// # let sites = Sites { normals: vec![Vec3::Z; 40], points, faces: vec![] };
/// # let answers = SiteAnswers::new(vec![false; 40], vec![true; 40]);
/// # let samples = [Sample::new("part", sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers)];
/// # let temporary = tempfile::tempdir().unwrap();
/// # let path = temporary.path().join("run");
/// struct StopAfterOneStep;
/// impl Observer for StopAfterOneStep {
///     fn step(&mut self, _: &StepReport) -> ControlFlow<()> {
///         ControlFlow::Break(())
///     }
/// }
/// let folder = RunFolder::new(path);
/// let mut run = folder.start(Settings::tiny().with_n_epochs(2))?;
/// assert!(folder.train(&mut run, &samples[..], &[], &mut StopAfterOneStep)?.is_break());
///
/// let mut run = folder.resume()?;
/// assert!(folder.train(&mut run, &samples[..], &[], &mut ())?.is_continue());
/// assert!(run.is_finished() && folder.best().is_file());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
    lock: Arc<Mutex<Option<FolderLock>>>,
}

impl RunFolder {
    /// The folder `path`, which need not exist yet.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        RunFolder { path: path.into(), lock: Arc::default() }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the latest network.
    pub fn model(&self) -> PathBuf {
        self.path.join(MODEL)
    }

    /// Path of the best network.
    pub fn best(&self) -> PathBuf {
        self.path.join(BEST)
    }

    /// Path of the checkpoint.
    pub fn checkpoint(&self) -> PathBuf {
        self.path.join(CHECKPOINT)
    }

    /// Locks the folder, as everything that writes into it does.
    ///
    /// # Errors
    /// As [`FolderLock::whole`].
    pub fn lock(&self) -> Result<()> {
        let mut lock = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        if lock.is_none() {
            *lock = Some(FolderLock::whole(&self.path)?);
        }
        Ok(())
    }

    /// A run at its beginning; writes its settings.
    ///
    /// # Errors
    /// If the folder holds a run already, another program writes into it or it cannot be written, or a setting is
    /// outside its domain.
    pub fn start(&self, settings: Settings) -> Result<Run> {
        settings.check()?;
        self.lock()?;
        if self.checkpoint().exists() {
            let remedy = "resume it, or choose another folder";
            let found = "the folder holds a run already";
            return Err(Error::file(self.checkpoint(), "run", found, remedy));
        }
        let run = Run::new(settings)?;
        settings_file::write(&self.path.join(SETTINGS), &run.settings)?;
        Ok(run)
    }

    /// The run that was stored here, as it was.
    ///
    /// # Errors
    /// If there is none, its checkpoint is damaged, another program writes into the folder, or it cannot be written.
    pub fn resume(&self) -> Result<Run> {
        if self.checkpoint().exists() {
            self.lock()?;
        }
        let run = Run::resume(Checkpoint::read(&self.checkpoint())?)?;
        // What a kill between the checkpoint and these files left out, and what it left behind.
        self.show(&run)?;
        atomic_file::remove_temporary_files(&self.path)?;
        Ok(run)
    }

    /// [`Run::train`]; stores the run after every epoch, before `observer` hears of it, and where
    /// `observer` stops it.
    ///
    /// # Errors
    /// As [`Run::train`], or if another program writes into the folder or a file cannot be written.
    pub fn train(
        &self,
        run: &mut Run,
        source: &(impl SampleSource + ?Sized),
        validation: &[Sample],
        observer: &mut impl Observer,
    ) -> Result<ControlFlow<()>> {
        self.train_together(run, source, validation, observer, &SingleProcess)
    }

    /// [`Run::train_together`]; process 0 stores the run as [`RunFolder::train`] does, the others write nothing.
    ///
    /// # Errors
    /// As [`Run::train_together`], or if a file cannot be written.
    pub fn train_together(
        &self,
        run: &mut Run,
        source: &(impl SampleSource + ?Sized),
        validation: &[Sample],
        observer: &mut impl Observer,
        processes: &dyn Processes,
    ) -> Result<ControlFlow<()>> {
        let folder = (processes.rank() == 0).then_some(self);
        agree(processes, folder.map_or(Ok(()), RunFolder::lock))?;
        let storing = &mut Storing { folder, observer };
        let flow = run.train_together(source, validation, storing, processes)?;
        if flow.is_break() {
            agree(processes, folder.map_or(Ok(()), |folder| folder.store(run)))?;
        }
        Ok(flow)
    }

    /// Writes everything but the settings. The checkpoint that was there becomes the previous one.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn store(&self, run: &Run) -> Result<()> {
        self.lock()?;
        let checkpoint = self.checkpoint();
        if checkpoint.exists() {
            let bytes = input_file::read(&checkpoint, input_file::DATA)?;
            let previous = self.path.join(PREVIOUS);
            atomic_file::write_atomic(&previous, |file| std::io::Write::write_all(file, &bytes))?;
        }
        run.checkpoint().write(&checkpoint)?;
        self.show(run)
    }

    /// Networks and history, as the run's state says.
    fn show(&self, run: &Run) -> Result<()> {
        let progress = &run.progress;
        let rows = &progress.history;
        let notes = rows.last().map_or_else(String::new, EpochRow::to_string);
        weights::write(&self.model(), &run.model, Storage::Exact, &notes)?;
        let is_best = progress.best.is_none_or(|(_, epoch)| epoch == rows.len() as u64);
        if is_best && progress.steps_done == 0 {
            weights::write(&self.best(), &run.model, Storage::Exact, &notes)?;
        }
        history::write_csv(&self.path.join(HISTORY), rows)
    }
}

/// Stores a run where there is a folder, then lets another observer look on.
struct Storing<'a, O> {
    folder: Option<&'a RunFolder>,
    observer: &'a mut O,
}

impl<O: Observer> Observer for Storing<'_, O> {
    fn step(&mut self, report: &StepReport) -> ControlFlow<()> {
        self.observer.step(report)
    }

    fn epoch(&mut self, run: &Run, row: &EpochRow) -> Result<ControlFlow<()>> {
        self.folder.map_or(Ok(()), |folder| folder.store(run))?;
        self.observer.epoch(run, row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::{Definition, SiteAnswers};
    use crate::geom::Sites;
    use crate::model::graph_sage::GraphSageConfig;
    use glam::Vec3;

    fn samples() -> Vec<Sample> {
        let points: Vec<Vec3> =
            (0..60).map(|i| Vec3::new((i % 7) as f32, (i / 7) as f32, (i % 3) as f32)).collect();
        let labels: Vec<bool> = points.iter().map(|p| p.x > 3.0).collect();
        let sites = Sites { normals: vec![Vec3::Z; 60], points, faces: vec![] };
        vec![Sample {
            surface: None,
            name: "part".into(),
            sites: sites.into(),
            cutter: [1.5, 6.0, 40.0, 5.0].into(),
            answers: SiteAnswers::new(labels.clone(), labels),
        }]
    }

    fn settings() -> Settings {
        Settings { n_epochs: 3, ..Settings::tiny() }
    }

    struct StopAt(u64);

    impl Observer for StopAt {
        fn epoch(&mut self, _: &Run, row: &EpochRow) -> Result<ControlFlow<()>> {
            Ok(if row.epoch == self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        }
    }

    #[test]
    fn a_run_stopped_and_resumed_ends_with_the_same_files() {
        let mut graph = GraphSageConfig { widths: vec![6; 2], ..GraphSageConfig::default() };
        graph.cutter.dropout = 0.3;
        for settings in [settings(), Settings { network: graph.into(), ..settings() }] {
            require_the_same_files(&settings);
        }
    }

    fn require_the_same_files(settings: &Settings) {
        let definition = Definition::Part;
        let temporary = tempfile::tempdir().unwrap();
        let [whole, broken] = ["whole", "broken"].map(|n| RunFolder::new(temporary.path().join(n)));
        let samples = samples();
        let mut run = whole.start(settings.clone()).unwrap();
        run.learns(definition);
        assert!(whole.train(&mut run, &samples[..], &samples, &mut ()).unwrap().is_continue());
        let mut run = broken.start(settings.clone()).unwrap();
        run.learns(definition);
        for epoch in [1, 2] {
            let flow = broken.train(&mut run, &samples[..], &samples, &mut StopAt(epoch)).unwrap();
            assert_eq!(flow, ControlFlow::Break(()));
            run = broken.resume().unwrap();
        }
        assert!(broken.train(&mut run, &samples[..], &samples, &mut ()).unwrap().is_continue());
        for file in [RunFolder::model, RunFolder::best] {
            assert_eq!(std::fs::read(file(&whole)).unwrap(), std::fs::read(file(&broken)).unwrap());
        }
        assert!(broken.path().join(PREVIOUS).is_file());
    }

    #[test]
    fn a_store_that_is_refused_at_any_step_leaves_the_old_run_or_the_new_one() {
        let temporary = tempfile::tempdir().unwrap();
        let samples = samples();
        let [path, one, two] = ["broken", "one", "two"].map(|n| temporary.path().join(n));
        let stopped = |n_epochs, path: &Path| {
            let folder = RunFolder::new(path);
            let mut run = folder.start(settings()).unwrap();
            let flow = folder.train(&mut run, &samples[..], &samples, &mut StopAt(n_epochs));
            assert!(flow.unwrap().is_break());
            run
        };
        let (old, new) = (stopped(1, &one), stopped(2, &two));
        let copy = |from: &Path| {
            let _ = std::fs::remove_dir_all(&path);
            std::fs::create_dir(&path).unwrap();
            for entry in std::fs::read_dir(from).unwrap() {
                let entry = entry.unwrap();
                std::fs::copy(entry.path(), path.join(entry.file_name())).unwrap();
            }
        };
        copy(&one);
        let mut found = [0; 2];
        let work = || RunFolder::new(&path).store(&new);
        let n_steps = atomic_file::faults::at_every_step(work, |_| {
            let folder = RunFolder::new(&path);
            let run = folder.resume().unwrap();
            let is_new = run.checkpoint() == new.checkpoint();
            assert!(is_new || run.checkpoint() == old.checkpoint());
            found[usize::from(is_new)] += 1;
            let shown: crate::model::AnyModel<f32> = weights::read(&folder.model()).unwrap();
            assert!(shown.params == run.model.params);
            drop(folder);
            copy(&one);
        });
        assert!(found.iter().all(|n| *n > 6) && n_steps > 18, "{found:?} of {n_steps}");
    }

    #[test]
    fn two_programs_do_not_write_one_run() {
        let temporary = tempfile::tempdir().unwrap();
        let first = RunFolder::new(temporary.path());
        let mut run = first.start(settings()).unwrap();
        let second = RunFolder::new(temporary.path());
        let samples = samples();
        for refused in [
            second.start(settings()).map(drop),
            second.store(&run),
            second.train(&mut run, &samples[..], &[], &mut ()).map(drop),
        ] {
            assert!(refused.unwrap_err().to_string().contains("is writing into it"));
        }
        first.store(&run).unwrap();
        assert!(second.resume().unwrap_err().to_string().contains("is writing into it"));
        drop(first);
        second.resume().unwrap();
    }

    #[test]
    fn there_is_a_best_network_without_a_validation_set() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(temporary.path());
        let samples = samples();
        let mut run = folder.start(settings()).unwrap();
        assert!(folder.train(&mut run, &samples[..], &[], &mut ()).unwrap().is_continue());
        assert_eq!(std::fs::read(folder.best()).unwrap(), std::fs::read(folder.model()).unwrap());
    }

    #[test]
    fn a_folder_holds_one_run() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(temporary.path());
        assert!(folder.resume().unwrap_err().to_string().contains(CHECKPOINT));
        let run = folder.start(settings()).unwrap();
        folder.store(&run).unwrap();
        let message = folder.start(settings()).unwrap_err().to_string();
        assert!(message.contains("holds a run already; resume it"), "{message}");
    }
}
