//! Candidates with something that holds them: of an orientation there may be several clampings.

use super::candidates::{Candidate, Candidates};
use crate::Result;
use crate::exec::memory;
use crate::geom::Sites;
use crate::tool::directions::Directions;

impl Candidates {
    /// A candidate for each of these numbers of candidates, in their order, to be tested by itself: each has its own
    /// range of the directions, since different things are in its way. Numbers of one candidate follow each other.
    ///
    /// # Errors
    /// If the answers for so many sites and tools would not fit into the memory.
    pub(crate) fn clamped(
        &self,
        numbers: &[usize],
        sites: &Sites,
        n_tools: usize,
    ) -> Result<Candidates> {
        let of = |&number: &usize| &self.list()[number];
        let n_directions: usize = numbers.iter().map(|number| of(number).axes.len()).sum();
        let row = sites.len().div_ceil(64).saturating_mul(8).saturating_add(64);
        let n_clampings = numbers.len();
        let remedy = format!(
            "{n_clampings} clampings, {n_directions} tool axes in all, {} sites, {n_tools} tools: take fewer",
            sites.len()
        );
        let bytes = memory::product([n_directions, row, n_tools]);
        memory::require("the answers for every clamping", bytes, remedy)?;
        let mut next = 0;
        let list = numbers.iter().map(|number| {
            let first = next;
            next += of(number).axes.len() as u32;
            Candidate { axes: (first..next).collect(), ..of(number).clone() }
        });
        let list = list.collect();
        let axes = numbers.iter().flat_map(|number| of(number).axes.iter().copied());
        let directions = self.directions().numbered(axes);
        let mut clamped = self.clone();
        (clamped.directions, clamped.list) = (directions, list);
        Ok(clamped)
    }

    /// The tool axes of a candidate.
    pub(crate) fn axes_of(&self, number: usize) -> Directions {
        self.directions().numbered(self.list()[number].axes.iter().copied())
    }
}
