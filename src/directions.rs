//! Ordered sets of unit vectors from the tip to the spindle.
