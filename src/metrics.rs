//! Accuracy, F1 and IoU.
