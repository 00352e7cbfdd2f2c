//! Nearest upsampling: every child gets its parent's row.
//!
//! For trilinear upsampling see [`super::interp::Interpolation::between_depths`].

use crate::octree::Level;
use crate::par;
use crate::scalar::Scalar;

/// Nodes per task.
const BLOCK: usize = 1024;

/// `y[8·children[n] + k] = x[n]`; rows of empty nodes are not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearestUpsample {
    channels: usize,
}

impl NearestUpsample {
    /// Upsampling of rows of `channels` numbers.
    pub fn new(channels: usize) -> Self {
        NearestUpsample { channels }
    }

    /// `x: [n_nodes, channels]` of `coarse` to `y: [8·n_nonempty, channels]`, all nodes one depth finer.
    ///
    /// # Panics
    /// If `x` has not one row per node.
    pub fn forward<T: Scalar>(&self, coarse: &Level, x: &[T], y: &mut Vec<T>) {
        let c = self.channels;
        assert_eq!(x.len(), coarse.n_nodes() * c, "rows of the input and of the octree differ");
        y.resize(8 * coarse.n_nonempty() * c, T::ZERO);
        par::for_each_block(y, 8 * BLOCK * c, |block, rows| {
            for (i, row) in rows.chunks_exact_mut(c).enumerate() {
                let node = coarse.nonempty[block * BLOCK + i / 8] as usize;
                row.copy_from_slice(&x[node * c..][..c]);
            }
        });
    }

    /// `dx[n] = Σ_k dy[8·children[n] + k]`; zero for empty nodes.
    ///
    /// # Panics
    /// If `dy` has not one row per finer node.
    pub fn backward<T: Scalar>(&self, coarse: &Level, dy: &[T], dx: &mut Vec<T>) {
        let c = self.channels;
        assert_eq!(
            dy.len(),
            8 * coarse.n_nonempty() * c,
            "rows of the gradient and children differ"
        );
        dx.resize(coarse.n_nodes() * c, T::ZERO);
        par::for_each_block(dx, BLOCK * c, |block, rows| {
            rows.fill(T::ZERO);
            for (i, row) in rows.chunks_exact_mut(c).enumerate() {
                let Ok(group) = usize::try_from(coarse.children[block * BLOCK + i]) else {
                    continue;
                };
                for child in dy[8 * group * c..][..8 * c].chunks_exact(c) {
                    row.iter_mut().zip(child).for_each(|(d, &dy)| *d += dy);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::octrees;
    use super::*;
    use crate::gradcheck::{adjoint, probe};

    #[test]
    fn children_get_their_parents_row_and_backward_is_the_adjoint() {
        let layer = NearestUpsample::new(3);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let forward = |x: &[f64]| {
                    let mut y = vec![f64::NAN; 3];
                    layer.forward(coarse, x, &mut y);
                    y
                };
                let backward = |dy: &[f64]| {
                    let mut dx = vec![f64::NAN; 3];
                    layer.backward(coarse, dy, &mut dx);
                    dx
                };
                let (n_in, n_out) = (3 * coarse.n_nodes(), 24 * coarse.n_nonempty());
                let x = probe(n_in, 1);
                for (row, y) in forward(&x).chunks_exact(3).enumerate() {
                    let parent = coarse.children.iter().position(|&c| c == row as i32 / 8).unwrap();
                    assert_eq!(y, &x[3 * parent..][..3]);
                }
                assert!(adjoint(n_in, n_out, forward, backward) < 1e-14);
            }
        }
    }
}
