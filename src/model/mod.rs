//! The octree U-Net with cutter modules, its weights, and prediction.
