//! The interface of an engine: collisions and β of one cutter in one direction.

use super::predicate::Frame;
use super::problem::PlacedCutter;
use super::stats::Stats;

/// One way of answering; directions are independent of each other.
pub(super) trait Method: Sync {
    /// What a worker reuses from one direction to the next.
    type Scratch: Send;

    /// A new worker's scratch.
    fn scratch(&self) -> Self::Scratch;
    /// Turns to another direction.
    fn enter(&self, scratch: &mut Self::Scratch, frame: &Frame);
    /// Sets the bit of every query at which `cutter` collides; `row` comes zeroed.
    fn collide(&self, scratch: &mut Self::Scratch, cutter: &PlacedCutter, row: &mut [u64])
    -> Stats;
    /// Adds to each obstacle's `beta` the number of the cutter's queries it collides at.
    fn count(&self, scratch: &mut Self::Scratch, cutter: &PlacedCutter, beta: &mut [u64]) -> Stats;
}
