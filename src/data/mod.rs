//! Training data: samples, data sets on disk, augmentation, generated parts.

pub mod augment;
#[cfg(all(feature = "formats", feature = "generate"))]
pub mod dataset;
#[cfg(feature = "formats")]
pub mod files;
#[cfg(feature = "generate")]
pub mod generated;
pub(crate) mod loader;
#[doc(hidden)] // of the program
pub mod normalized;
#[cfg(feature = "formats")]
#[doc(hidden)] // of the program
pub mod npz;
#[doc(hidden)] // of the program
pub mod online;
pub mod sample;
#[doc(hidden)] // of the program
pub mod volume;

pub use augment::Augment;
#[doc(hidden)] // of the program
pub use online::Online;
pub use sample::{Sample, SampleSource};
