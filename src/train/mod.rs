//! Training: the loop, settings, checkpoints, history and evaluation.
//!
//! A [`Run`] is settings, a network, the optimizer's velocity and how far it has come. Every random
//! decision is keyed by (seed, epoch, sample), so a run that was interrupted and read back from its
//! checkpoint ends with the same bits as one that was not. `RunFolder` (feature `formats`) keeps a run on disk.
//! A [`Trainer`] does the same for a network, samples and a loss of one's own.

mod buckets;
#[doc(hidden)] // of the program
pub mod calibration;
#[cfg(feature = "formats")]
#[doc(hidden)] // checked by tests; for programs there is `RunFolder`
pub mod checkpoint;
#[doc(hidden)] // shown below
pub mod evaluate;
mod groups;
#[doc(hidden)] // shown below
pub mod history;
#[doc(hidden)] // of the program
pub mod reliability;
mod run;
#[cfg(feature = "formats")]
mod run_folder;
mod settings;
#[cfg(feature = "formats")]
#[doc(hidden)] // of the program and fuzz targets
pub mod settings_file;
mod step;
mod trainer;
#[cfg(feature = "formats")]
mod trainer_file;

#[cfg(feature = "formats")]
#[doc(hidden)] // checked by tests; for programs there is `RunFolder`
pub use checkpoint::Checkpoint;
pub use evaluate::{Evaluation, HeadScores, evaluate};
#[doc(hidden)] // of the program
pub use evaluate::{VerifiedScore, evaluate_exact, evaluate_ranked, evaluate_verified};
pub use history::{EpochRow, HeadScore};
#[doc(hidden)] // how far a `Run` has come
pub use run::Progress;
pub use run::{Observer, Run, StepReport};
#[cfg(feature = "formats")]
pub use run_folder::RunFolder;
pub use settings::{LossSettings, Reduction, Settings};
pub use trainer::Trainer;
