//! Samples, files on disk, augmentation and generated parts.

#[cfg(feature = "formats")]
pub mod files;
#[cfg(feature = "generate")]
pub mod generated;
#[cfg(feature = "formats")]
pub mod npz;
