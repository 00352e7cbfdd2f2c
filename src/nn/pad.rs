//! Scatter and gather between rows of the non-empty nodes alone and rows of all nodes.
//!
//! [`Pad`] and [`Depad`] are adjoint: the backward pass of each is the forward pass of the other.

use super::arena::Buffer;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::ops::Range;

/// Rows per task.
const BLOCK: usize = 1024;

/// From the non-empty nodes to all nodes, with zero rows for the empty ones: `[n_nonempty, c]` to
/// `[n_nodes, c]`, for any `c`.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, pad::Pad};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::splat(0.5)], &[])], &options)?; // a root with eight children
/// let arena = Arena::default();
/// let pass = Inference::<f64>::new(&[], &[], &arena);
/// let y = Pad.forward(&pass, octree.finest(), Operand::new(&[2.0], 1)); // of the node that holds the point
/// assert_eq!(y[..], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pad;

/// From all nodes to the non-empty ones: `[n_nodes, c]` to `[n_nonempty, c]`, for any `c`.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, pad::Depad};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::splat(0.5)], &[])], &options)?; // a root with eight children
/// let arena = Arena::default();
/// let pass = Inference::<f64>::new(&[], &[], &arena);
/// let x: Vec<f64> = (0..8).map(f64::from).collect(); // of all nodes
/// assert_eq!(Depad.forward(&pass, octree.finest(), Operand::new(&x, 1))[..], [7.0]); // the node that holds the point
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Depad;

/// `x: [n_nonempty, c]` to `y: [n_nodes, c]`.
pub(super) fn scatter<T: Scalar>(level: &OctreeLevel, c: usize, x: &[T], y: &mut [T]) {
    assert_eq!(x.len(), level.n_nonempty() * c, "rows of the input and non-empty nodes differ");
    par::for_each_block(y, BLOCK * c, |block, rows| {
        for (i, row) in rows.chunks_exact_mut(c).enumerate() {
            match usize::try_from(level.children[block * BLOCK + i]) {
                Ok(from) => row.copy_from_slice(&x[from * c..][..c]),
                Err(_) => row.fill(T::ZERO),
            }
        }
    });
}

/// `x: [n_nodes, c]` to `y: [n_nonempty, c]`.
pub(super) fn gather<T: Scalar>(level: &OctreeLevel, c: usize, x: &[T], y: &mut [T]) {
    assert_eq!(x.len(), level.n_nodes() * c, "rows of the input and of the octree differ");
    par::for_each_block(y, BLOCK * c, |block, rows| {
        for (i, row) in rows.chunks_exact_mut(c).enumerate() {
            let from = level.nonempty[block * BLOCK + i] as usize;
            row.copy_from_slice(&x[from * c..][..c]);
        }
    });
}

impl<T: Scalar> Layer<T> for Pad {
    type Geometry = OctreeLevel;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, level: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let c = x.width();
        let mut y = pass.arena.get(level.n_nodes() * c);
        scatter(level, c, &x.to_matrix(pass.arena), &mut y);
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        level: &OctreeLevel,
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), level, x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        level: &OctreeLevel,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let c = x.width();
        let mut dx = pass.arena.get(level.n_nonempty() * c);
        gather(level, c, &dy, &mut dx);
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

impl<T: Scalar> Layer<T> for Depad {
    type Geometry = OctreeLevel;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, level: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let c = x.width();
        let mut y = pass.arena.get(level.n_nonempty() * c);
        gather(level, c, &x.to_matrix(pass.arena), &mut y);
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        level: &OctreeLevel,
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), level, x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        level: &OctreeLevel,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let c = x.width();
        let mut dx = pass.arena.get(level.n_nodes() * c);
        scatter(level, c, &dy, &mut dx);
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{
        forward, large_octree, octrees, require_adjoint, require_concatenation, require_gradients,
    };
    use super::*;
    use crate::conformance::gradcheck::probe;
    use crate::nn::params::Layout;

    #[test]
    fn padding_keeps_rows_fills_zeros_and_is_undone() {
        for octree in octrees() {
            for level in &octree.levels {
                let x = probe(2 * level.n_nonempty(), 1);
                let y = forward(&Pad, &[], level, Operand::new(&x, 2));
                assert_eq!(y.len(), 2 * level.n_nodes());
                assert_eq!(y.iter().filter(|&&y| y != 0.0).count(), x.len());
                assert_eq!(forward(&Depad, &[], level, Operand::new(&y, 2)), x);
            }
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        let none = (&Layout::default(), &[][..]);
        for octree in octrees() {
            for level in octree.levels.iter().filter(|level| level.n_nonempty() > 0) {
                let (packed, all) = (2 * level.n_nonempty(), 2 * level.n_nodes());
                require_gradients(&Pad, none, level, Operand::new(&probe(packed, 1), 2));
                require_gradients(&Depad, none, level, Operand::new(&probe(all, 2), 2));
                require_adjoint(&Pad, &[], level, (packed, 2), all);
                require_adjoint(&Depad, &[], level, (all, 2), packed);
                require_concatenation(&Depad, none, level, &level.ranges, [1, 2, 1]);
            }
        }
        let level = large_octree().levels.swap_remove(5);
        require_adjoint(&Pad, &[], &level, (3 * level.n_nonempty(), 3), 3 * level.n_nodes());
    }
}
