//! Mean over the neighbours of every node of a graph: GraphSAGE's aggregator (Hamilton et al. 2017).

use super::rows;
use crate::scalar::Scalar;

/// The neighbours of every node, in lists that follow each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NeighbourMean {
    /// Node `v` reads `sources[starts[v]..starts[v + 1]]`.
    starts: Vec<u32>,
    sources: Vec<u32>,
    /// The same pairs by source: node `u` is read by `readers[reader_starts[u]..]`, ascending.
    reader_starts: Vec<u32>,
    readers: Vec<u32>,
}

impl NeighbourMean {
    /// From the neighbours of each node.
    ///
    /// # Panics
    /// If a neighbour is not a node.
    pub fn new<'a>(neighbours: impl IntoIterator<Item = &'a [u32]>) -> Self {
        let (mut starts, mut sources) = (vec![0], Vec::new());
        for list in neighbours {
            sources.extend_from_slice(list);
            starts.push(sources.len() as u32);
        }
        let n = starts.len() - 1;
        let mut reader_starts = vec![0; n + 1];
        sources.iter().for_each(|&u| reader_starts[u as usize + 1] += 1);
        (0..n).for_each(|u| reader_starts[u + 1] += reader_starts[u]);
        let (mut next, mut readers) = (reader_starts.clone(), vec![0; sources.len()]);
        for v in 0..n {
            for &u in &sources[starts[v] as usize..starts[v + 1] as usize] {
                readers[next[u as usize] as usize] = v as u32;
                next[u as usize] += 1;
            }
        }
        NeighbourMean { starts, sources, reader_starts, readers }
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// `y[v] = Σ_u x[u] / deg(v)` over the neighbours `u` of `v`, `[n_nodes, c]`; 0 without neighbours.
    pub fn forward<T: Scalar>(&self, c: usize, x: &[T], y: &mut Vec<T>) {
        y.clear();
        y.resize(self.n_nodes() * c, T::ZERO);
        rows::for_each_row(
            y,
            c,
            #[inline(always)]
            |v, y| {
                let share = self.share(v);
                for &u in &self.sources[self.starts[v] as usize..self.starts[v + 1] as usize] {
                    add_scaled(y, share, &x[u as usize * c..][..c]);
                }
            },
        );
    }

    /// `dx[u] = Σ_v dy[v] / deg(v)` over the nodes `v` that read `u`; overwrites `dx`.
    pub fn backward<T: Scalar>(&self, c: usize, dy: &[T], dx: &mut Vec<T>) {
        dx.clear();
        dx.resize(self.n_nodes() * c, T::ZERO);
        rows::for_each_row(
            dx,
            c,
            #[inline(always)]
            |u, dx| {
                let readers = self.reader_starts[u] as usize..self.reader_starts[u + 1] as usize;
                for &v in &self.readers[readers] {
                    add_scaled(dx, self.share(v as usize), &dy[v as usize * c..][..c]);
                }
            },
        );
    }

    fn share<T: Scalar>(&self, v: usize) -> T {
        T::from_f64(1.0 / f64::from((self.starts[v + 1] - self.starts[v]).max(1)))
    }
}

fn add_scaled<T: Scalar>(y: &mut [T], factor: T, x: &[T]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y = factor.mul_add(x, *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradcheck;

    #[test]
    fn takes_means_and_its_backward_is_the_adjoint() {
        let lists: [&[u32]; 4] = [&[1, 2], &[0], &[], &[0, 1, 3]];
        let mean = NeighbourMean::new(lists);
        let apply = |x: &[f64]| {
            let mut y = Vec::new();
            mean.forward(2, x, &mut y);
            y
        };
        let back = |dy: &[f64]| {
            let mut dx = Vec::new();
            mean.backward(2, dy, &mut dx);
            dx
        };
        let y = apply(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!(y[..6], [4.0, 5.0, 1.0, 2.0, 0.0, 0.0]);
        assert!(gradcheck::adjoint(8, 8, apply, back) < 1e-14);
    }
}
