//! Groups: a step's samples in parts that pass through the network by themselves, and the tree that joins what they
//! give.
//!
//! # Definition
//!
//! The `n` samples of a step are split into `G` groups, in order and evenly. Each group is normalized by itself and has
//! a gradient vector `g₀ … g_{G−1}` of its own. Their sum is that of a binary tree over group numbers:
//!
//! ```text
//! sum(a..b) = g_a                          if b = a + 1
//!           = sum(a..a+h) + sum(a+h..b)    h = the greatest power of two below b − a
//! ```
//!
//! The tree depends on `G` alone. `N` processes have the groups in order and evenly; each sums the subtrees that lie
//! wholly in its share ([`cover`]), and [`join`] forms the rest.
//!
//! ```text
//! join, on each process:
//!     cut the vectors into N segments
//!     send segment r of own subtrees to process r                exchange: P (N−1)/N numbers, if N and G/N are powers of two
//!     sum the subtrees of all processes along the tree, in own segment
//!     send own segment to all                                    complete: P (N−1)/N numbers
//! ```

use crate::exec::processes::{Processes, share};
use crate::simd::Isa;
use crate::simd::elementwise::{self, Combination};
use std::ops::Range;

/// A step's samples, groups and processes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Groups {
    n_samples: usize,
    n: usize,
    rank: usize,
    size: usize,
}

impl Groups {
    /// At most `n_groups` groups, none of them empty.
    pub(super) fn new(n_samples: usize, n_groups: usize, processes: &dyn Processes) -> Self {
        let n = n_groups.min(n_samples).max(1);
        Groups { n_samples, n, rank: processes.rank(), size: processes.size() }
    }

    /// Number of groups.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// Numbers of this process's groups.
    pub(super) fn own(&self) -> Range<usize> {
        share(self.n, self.rank, self.size)
    }

    /// Places of a group's samples in the step.
    pub(super) fn samples(&self, group: usize) -> Range<usize> {
        share(self.n_samples, group, self.n)
    }

    /// Places of the samples of all of this process's groups.
    pub(super) fn own_samples(&self) -> Range<usize> {
        let own = self.own();
        share(self.n_samples, own.start, self.n).start..share(self.n_samples, own.end, self.n).start
    }

    /// The subtrees in this process's share.
    fn own_cover(&self) -> Vec<Range<usize>> {
        cover(self.n, &self.own())
    }
}

/// Sums of subtrees, in order; those of siblings become one.
#[derive(Debug, Default)]
pub(super) struct PartialSums {
    n_groups: usize,
    sums: Vec<(Range<usize>, Vec<f32>)>,
    /// Vectors that are no longer needed.
    free: Vec<Vec<f32>>,
}

impl PartialSums {
    /// No sums yet, of a tree over `n_groups`.
    pub(super) fn clear(&mut self, n_groups: usize) {
        self.n_groups = n_groups;
        self.free.extend(self.sums.drain(..).map(|(_, sum)| sum));
    }

    /// A vector of `len` zeros.
    pub(super) fn zeros(&mut self, len: usize) -> Vec<f32> {
        let mut zeros = self.free.pop().unwrap_or_default();
        zeros.clear();
        zeros.resize(len, 0.0);
        zeros
    }

    /// Adds the sum of the subtree over `node`, which begins where the last one ended.
    pub(super) fn push(&mut self, mut node: Range<usize>, mut sum: Vec<f32>) {
        while let Some((left, mut values)) =
            self.sums.pop_if(|(left, _)| are_siblings(self.n_groups, left, &node))
        {
            add(&mut values, &sum);
            self.free.push(std::mem::replace(&mut sum, values));
            node = left.start..node.end;
        }
        self.sums.push((node, sum));
    }

    /// The sum of the whole tree, once all is pushed.
    ///
    /// # Panics
    /// If something is missing.
    pub(super) fn take_root(&mut self) -> Vec<f32> {
        let (node, root) = self.sums.pop().expect("a sum");
        assert_eq!(node, 0..self.n_groups, "the sum of all groups");
        root
    }

    /// Keeps the memory of `vector`.
    pub(super) fn recycle(&mut self, vector: Vec<f32>) {
        self.free.push(vector);
    }

    /// What `push` of the last group of `groups` would make of the numbers of `ranges`: those of each of the subtrees
    /// in this process's share, the ranges one after another.
    pub(super) fn with_last(
        &self,
        groups: &Groups,
        last: &[f32],
        ranges: &[Range<usize>],
    ) -> Vec<Vec<f32>> {
        let whole = groups.own_cover().len() - 1;
        let of = |values: &[f32]| -> Vec<f32> {
            ranges.iter().flat_map(|range| &values[range.clone()]).copied().collect()
        };
        let mut nodes: Vec<_> = self.sums[..whole].iter().map(|(_, sum)| of(sum)).collect();
        let mut joined = of(last);
        for (_, left) in self.sums[whole..].iter().rev() {
            let mut left = of(left);
            add(&mut left, &joined);
            joined = left;
        }
        nodes.push(joined);
        nodes
    }
}

/// The sum over the whole tree of what the processes have of it: `nodes` are the sums of the subtrees in this process's
/// share.
pub(super) fn join(processes: &dyn Processes, groups: &Groups, nodes: &[Vec<f32>]) -> Vec<f32> {
    let (len, size) = (nodes[0].len(), processes.size());
    let segments: Vec<Range<usize>> = (0..size).map(|rank| share(len, rank, size)).collect();
    let own = segments[processes.rank()].clone();
    let covers: Vec<_> =
        (0..size).map(|rank| cover(groups.n, &share(groups.n, rank, size))).collect();
    let n_rounds = covers.iter().map(Vec::len).max().unwrap_or(0);
    let rounds = (0..n_rounds).map(|round| {
        let lengths: Vec<_> =
            covers.iter().map(|cover| if round < cover.len() { own.len() } else { 0 }).collect();
        let nothing = vec![0..0; size];
        match nodes.get(round) {
            Some(node) => processes.exchange(node, &segments, &lengths),
            None => processes.exchange(&[], &nothing, &lengths),
        }
    });
    let mut rounds: Vec<std::vec::IntoIter<f32>> = rounds.map(Vec::into_iter).collect();
    let mut sums = PartialSums { n_groups: groups.n, ..PartialSums::default() };
    for cover in covers {
        for (node, received) in cover.into_iter().zip(&mut rounds) {
            sums.push(node, received.by_ref().take(own.len()).collect());
        }
    }
    let mut all = vec![0.0; len];
    all[own].copy_from_slice(&sums.take_root());
    processes.complete(&mut all, &segments);
    all
}

/// On the calling thread: that of the exchange is in no pool of threads.
fn add(to: &mut [f32], values: &[f32]) {
    elementwise::combine(Isa::active(), Combination::Add, to, values);
}

/// Length of the left child of a node of `len` groups.
fn left_len(len: usize) -> usize {
    len.next_power_of_two() / 2
}

/// The greatest subtrees of the tree over `n_groups` that lie wholly in `own`, in order.
fn cover(n_groups: usize, own: &Range<usize>) -> Vec<Range<usize>> {
    fn visit(node: Range<usize>, own: &Range<usize>, found: &mut Vec<Range<usize>>) {
        if own.start <= node.start && node.end <= own.end {
            found.push(node);
        } else if node.start < own.end && own.start < node.end {
            let middle = node.start + left_len(node.len());
            visit(node.start..middle, own, found);
            visit(middle..node.end, own, found);
        }
    }
    let mut found = Vec::new();
    visit(0..n_groups, own, &mut found);
    found
}

/// Whether `left` and `right`, one after another, are the children of one node.
fn are_siblings(n_groups: usize, left: &Range<usize>, right: &Range<usize>) -> bool {
    let parent = left.start..right.end;
    left.len() == left_len(parent.len()) && cover(n_groups, &parent) == [parent]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::processes::SingleProcess;
    use crate::exec::processes::tests::Threads;
    use crate::numeric::rng::{Purpose, Stream};

    /// The vector of a group: numbers whose sum depends on the order.
    fn vector(group: usize) -> Vec<f32> {
        let mut stream = Stream::new(1, 0, group as u64, Purpose::Probe);
        (0..37).map(|_| (stream.normal() * libm::exp(6.0 * stream.normal())) as f32).collect()
    }

    /// The definition.
    fn sum(node: Range<usize>) -> Vec<f32> {
        if node.len() == 1 {
            return vector(node.start);
        }
        let middle = node.start + left_len(node.len());
        let (left, right) = (sum(node.start..middle), sum(middle..node.end));
        left.iter().zip(right).map(|(a, b)| a + b).collect()
    }

    fn on(processes: &dyn Processes, n_groups: usize) -> Vec<f32> {
        let groups = Groups::new(n_groups, n_groups, processes);
        let (own, mut sums) = (groups.own(), PartialSums::default());
        sums.clear(n_groups);
        for group in own.start..own.end - 1 {
            sums.push(group..group + 1, vector(group));
        }
        // In two pieces, as layers come.
        let last = vector(own.end - 1);
        let piece = |range: Range<usize>| sums.with_last(&groups, &last, &[range]);
        [piece(0..30), piece(30..37)].map(|nodes| join(processes, &groups, &nodes)).concat()
    }

    #[test]
    fn any_number_of_processes_sums_along_the_same_tree() {
        for n_groups in 1..=11 {
            let expected = sum(0..n_groups);
            let mut sums = PartialSums::default();
            sums.clear(n_groups);
            (0..n_groups).for_each(|group| sums.push(group..group + 1, vector(group)));
            assert_eq!(sums.take_root(), expected);
            assert_eq!(on(&SingleProcess, n_groups), expected);
            for size in 2..=n_groups {
                let found = Threads::run(size, |processes| on(processes, n_groups));
                assert!(found.iter().all(|found| *found == expected), "{size} of {n_groups}");
            }
        }
        let in_order = (1..8).map(vector).fold(vector(0), |mut sum, next| {
            add(&mut sum, &next);
            sum
        });
        assert_ne!(sum(0..8), in_order, "the order of the sum shows in its bits");
    }

    #[test]
    fn groups_share_samples_and_processes_share_groups_in_order() {
        for (n_samples, n_groups) in [(8, 4), (8, 3), (2, 4), (7, 7), (1, 1)] {
            let all = Threads::run(3, |processes| {
                let groups = Groups::new(n_samples, n_groups, processes);
                let samples: Vec<_> =
                    groups.own().flat_map(|group| groups.samples(group)).collect();
                assert!(samples.iter().copied().eq(groups.own_samples()));
                samples
            });
            assert!(all.concat().into_iter().eq(0..n_samples), "{all:?}");
        }
    }
}
