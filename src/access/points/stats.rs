//! Counts of how an engine decided its queries.

use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// Counts of the work done. They depend on the engine, not on threads or instruction set.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Stats {
    /// Answers to "does the cutter collide here?": queries × directions.
    pub queries: u64,
    /// Of these, decided by the greatest height of all obstacles alone (the shaft test).
    pub by_height: u64,
    /// Of these, decided by the answers for other cutters of the same ball or corner in the same call.
    pub by_cutter: u64,
    /// Of these, decided by the rasters of the direction's grid, without testing any obstacle.
    pub by_grid: u64,
    /// Obstacles tested one by one for the rest.
    pub pairs_tested: u64,
    /// Pairs (center of an inaccessible site, obstacle) whose share in β was counted by height alone.
    pub beta_by_rank: u64,
    /// Pairs whose share in β was counted for runs of obstacles as a whole.
    pub beta_by_run: u64,
    /// Pairs tested one by one for β.
    pub beta_pairs_tested: u64,
}

impl AddAssign for Stats {
    fn add_assign(&mut self, other: Stats) {
        self.queries += other.queries;
        self.by_height += other.by_height;
        self.by_cutter += other.by_cutter;
        self.by_grid += other.by_grid;
        self.pairs_tested += other.pairs_tested;
        self.beta_by_rank += other.beta_by_rank;
        self.beta_by_run += other.beta_by_run;
        self.beta_pairs_tested += other.beta_pairs_tested;
    }
}
