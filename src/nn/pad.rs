//! Between rows of the non-empty nodes alone and rows of all nodes.
//!
//! [`Pad`] and [`Depad`] are adjoint: the backward pass of each is the forward pass of the other.

use crate::octree::Level;
use crate::par;
use crate::scalar::Scalar;

/// Rows per task.
const BLOCK: usize = 1024;

/// From the non-empty nodes to all nodes, with zero rows for the empty ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pad {
    channels: usize,
}

impl Pad {
    /// Padding of rows of `channels` numbers.
    pub fn new(channels: usize) -> Self {
        Pad { channels }
    }

    /// `x: [n_nonempty, channels]` to `y: [n_nodes, channels]`.
    ///
    /// # Panics
    /// If `x` has not one row per non-empty node.
    pub fn forward<T: Scalar>(&self, level: &Level, x: &[T], y: &mut Vec<T>) {
        let c = self.channels;
        assert_eq!(x.len(), level.n_nonempty() * c, "rows of the input and non-empty nodes differ");
        y.resize(level.n_nodes() * c, T::ZERO);
        par::for_each_block(y, BLOCK * c, |block, rows| {
            for (i, row) in rows.chunks_exact_mut(c).enumerate() {
                match usize::try_from(level.children[block * BLOCK + i]) {
                    Ok(from) => row.copy_from_slice(&x[from * c..][..c]),
                    Err(_) => row.fill(T::ZERO),
                }
            }
        });
    }

    /// `dy: [n_nodes, channels]` to `dx: [n_nonempty, channels]`.
    ///
    /// # Panics
    /// If `dy` has not one row per node.
    pub fn backward<T: Scalar>(&self, level: &Level, dy: &[T], dx: &mut Vec<T>) {
        Depad::new(self.channels).forward(level, dy, dx);
    }
}

/// From all nodes to the non-empty ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Depad {
    channels: usize,
}

impl Depad {
    /// Depadding of rows of `channels` numbers.
    pub fn new(channels: usize) -> Self {
        Depad { channels }
    }

    /// `x: [n_nodes, channels]` to `y: [n_nonempty, channels]`.
    ///
    /// # Panics
    /// If `x` has not one row per node.
    pub fn forward<T: Scalar>(&self, level: &Level, x: &[T], y: &mut Vec<T>) {
        let c = self.channels;
        assert_eq!(x.len(), level.n_nodes() * c, "rows of the input and of the octree differ");
        y.resize(level.n_nonempty() * c, T::ZERO);
        par::for_each_block(y, BLOCK * c, |block, rows| {
            for (i, row) in rows.chunks_exact_mut(c).enumerate() {
                let from = level.nonempty[block * BLOCK + i] as usize;
                row.copy_from_slice(&x[from * c..][..c]);
            }
        });
    }

    /// `dy: [n_nonempty, channels]` to `dx: [n_nodes, channels]`, zero for empty nodes.
    ///
    /// # Panics
    /// If `dy` has not one row per non-empty node.
    pub fn backward<T: Scalar>(&self, level: &Level, dy: &[T], dx: &mut Vec<T>) {
        Pad::new(self.channels).forward(level, dy, dx);
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::octrees;
    use super::*;
    use crate::gradcheck::{adjoint, probe};

    #[test]
    fn padding_keeps_rows_fills_zeros_and_is_undone_and_adjoint() {
        let (pad, depad) = (Pad::new(2), Depad::new(2));
        for octree in octrees() {
            for level in &octree.levels {
                let (n_in, n_out) = (2 * level.n_nonempty(), 2 * level.n_nodes());
                let forward = |x: &[f64]| {
                    let mut y = vec![f64::NAN; 3];
                    pad.forward(level, x, &mut y);
                    y
                };
                let backward = |dy: &[f64]| {
                    let mut dx = vec![f64::NAN; 3];
                    pad.backward(level, dy, &mut dx);
                    dx
                };
                let x = probe(n_in, 1);
                let y = forward(&x);
                assert_eq!(y.iter().filter(|&&y| y != 0.0).count(), n_in);
                let mut back = vec![];
                depad.forward(level, &y, &mut back);
                assert_eq!(back, x);
                assert!(adjoint(n_in, n_out, forward, backward) < 1e-14);
                let depad_backward = |dy: &[f64]| {
                    let mut dx = vec![];
                    depad.backward(level, dy, &mut dx);
                    dx
                };
                assert!(adjoint(n_out, n_in, backward, depad_backward) < 1e-14);
            }
        }
    }
}
