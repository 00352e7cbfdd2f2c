//! Cutters: solids of revolution about their axis that only grow upward.
