//! Mean over the neighbors of every node of a graph: GraphSAGE's aggregator (Hamilton et al. 2017).

use super::arena::Buffer;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use super::rows::BLOCK_ROWS;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::simd::Isa;
use crate::simd::elementwise::{SparseRows, sparse_rows};
use std::ops::Range;

/// `y[v] = Σ_u x[u] / deg(v)` over the neighbors `u` of `v`, `[n_nodes, c]` for any `c`; 0 without neighbors.
///
/// ```
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference};
/// use deepmill::nn::neighbor_mean::{NeighborMean, Neighbors};
///
/// let path = Neighbors::new([&[1][..], &[0, 2], &[1]]); // 0 – 1 – 2
/// let arena = Arena::default();
/// let y = NeighborMean.forward(&Inference::new(&[], &[], &arena), &path, Operand::new(&[1.0, 2.0, 5.0], 1));
/// assert_eq!(y[..], [2.0, 3.0, 2.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NeighborMean;

/// The neighbors of every node, in lists that follow each other.
///
/// A path of three nodes, and one that reads the first and is read by none:
///
/// ```
/// use deepmill::nn::neighbor_mean::{NeighborMean, Neighbors};
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference};
///
/// let lists: [&[u32]; 4] = [&[1], &[0, 2], &[1], &[0]]; // of each node
/// let graph = Neighbors::new(lists);
/// let (arena, x) = (Arena::default(), [1.0, 10.0, 4.0, 7.0]);
/// let y = NeighborMean.forward(&Inference::new(&[], &[], &arena), &graph, Operand::new(&x, 1));
/// assert_eq!((graph.n_nodes(), &y[..]), (4, &[10.0, 2.5, 10.0, 1.0][..]));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighbors {
    /// Node `v` reads `sources[starts[v]..starts[v + 1]]`.
    starts: Vec<usize>,
    sources: Vec<u32>,
    /// The same pairs by source: node `u` is read by `readers[reader_starts[u]..]`, ascending.
    reader_starts: Vec<usize>,
    readers: Vec<u32>,
}

impl Neighbors {
    /// From the neighbors of each node.
    ///
    /// # Panics
    /// If a neighbor is not a node.
    pub fn new<'a>(neighbors: impl IntoIterator<Item = &'a [u32]>) -> Self {
        let (mut starts, mut sources) = (vec![0], Vec::new());
        for list in neighbors {
            sources.extend_from_slice(list);
            starts.push(sources.len());
        }
        let n = starts.len() - 1;
        let mut reader_starts = vec![0; n + 1];
        sources.iter().for_each(|&u| reader_starts[u as usize + 1] += 1);
        (0..n).for_each(|u| reader_starts[u + 1] += reader_starts[u]);
        let (mut next, mut readers) = (reader_starts.clone(), vec![0; sources.len()]);
        for v in 0..n {
            for &u in &sources[starts[v]..starts[v + 1]] {
                readers[next[u as usize]] = v as u32;
                next[u as usize] += 1;
            }
        }
        Neighbors { starts, sources, reader_starts, readers }
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbors of node `v` are `nodes[starts[v]..starts[v + 1]]`: both lists.
    pub(crate) fn lists(&self) -> (&[usize], &[u32]) {
        (&self.starts, &self.sources)
    }

    fn mean<T: Scalar>(&self, c: usize, x: &[T], y: &mut [T]) {
        let weights: Vec<T> = (0..self.n_nodes())
            .flat_map(|v| (self.starts[v]..self.starts[v + 1]).map(move |_| v))
            .map(|v| self.share(v))
            .collect();
        sum_rows((&self.starts, &self.sources), &weights, (x, c), y);
    }

    /// `dx[u] = Σ_v dy[v] / deg(v)` over the nodes `v` that read `u`.
    fn transposed<T: Scalar>(&self, c: usize, dy: &[T], dx: &mut [T]) {
        let weights: Vec<T> = self.readers.iter().map(|&v| self.share(v as usize)).collect();
        sum_rows((&self.reader_starts, &self.readers), &weights, (dy, c), dx);
    }

    fn share<T: Scalar>(&self, v: usize) -> T {
        T::from_f64(1.0 / ((self.starts[v + 1] - self.starts[v]).max(1) as f64))
    }
}

/// Overwrites `y` with weighted sums of rows of `x`, see [`SparseRows`].
fn sum_rows<T: Scalar>(
    (starts, sources): (&[usize], &[u32]),
    weights: &[T],
    (x, c): (&[T], usize),
    y: &mut [T],
) {
    par::for_each_block(y, BLOCK_ROWS * c, |block, y| {
        let first = block * BLOCK_ROWS;
        let starts = &starts[first..=first + y.len() / c];
        sparse_rows(Isa::active(), SparseRows { starts, sources, weights, x, c, y });
    });
}

impl<T: Scalar> Layer<T> for NeighborMean {
    type Geometry = Neighbors;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, neighbors: &Neighbors, x: Operand<T>) -> Buffer<T> {
        let (c, x) = (x.width(), x.to_matrix(pass.arena));
        assert_eq!(x.len(), neighbors.n_nodes() * c, "rows of the input and nodes differ");
        let mut y = pass.arena.get(x.len());
        neighbors.mean(c, &x, &mut y);
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        neighbors: &Neighbors,
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), neighbors, x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        neighbors: &Neighbors,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let c = x.width();
        assert_eq!(dy.len(), neighbors.n_nodes() * c, "rows of the gradient and nodes differ");
        let mut dx = pass.arena.get(dy.len());
        neighbors.transposed(c, &dy, &mut dx);
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{forward, require_adjoint, require_gradients};
    use super::*;
    use crate::conformance::gradcheck::probe;
    use crate::nn::params::Layout;

    #[test]
    fn takes_means_and_its_gradients_are_right() {
        let lists: [&[u32]; 4] = [&[1, 2], &[0], &[], &[0, 1, 3]];
        let neighbors = Neighbors::new(lists);
        let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        let y = forward(&NeighborMean, &[], &neighbors, Operand::new(&x, 2));
        assert_eq!(y[..6], [4.0, 5.0, 1.0, 2.0, 0.0, 0.0]);
        let none = (&Layout::default(), &[][..]);
        require_gradients(&NeighborMean, none, &neighbors, Operand::new(&probe(12, 1), 3));
        require_adjoint(&NeighborMean, &[], &neighbors, (8, 2), 8);
    }
}
