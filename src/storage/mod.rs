//! How files are read and written, and folders locked.

pub mod atomic_file;
pub mod folder_lock;
pub(crate) mod input_file;
