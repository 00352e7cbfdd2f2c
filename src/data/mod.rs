//! Samples, files on disk, augmentation and generated parts.
