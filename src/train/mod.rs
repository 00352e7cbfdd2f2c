//! Training loop, checkpoints, logs and evaluation.
