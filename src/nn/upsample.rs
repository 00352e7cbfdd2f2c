//! Nearest upsampling: every child gets its parent's row.
//!
//! For trilinear upsampling see [`super::interp::Interpolation::between_depths`].

use super::arena::Buffer;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use super::rows;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::ops::Range;

/// Nodes per task.
const BLOCK: usize = 1024;

/// `y[8·children[n] + k] = x[n]`, from `[n_nodes, c]` of the coarse level to `[8·n_nonempty, c]`, all nodes one
/// depth finer, for any `c`; rows of empty nodes are not read.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, upsample::NearestUpsample};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::splat(0.5)], &[])], &options)?; // a root with eight children
/// let arena = Arena::default();
/// let pass = Inference::<f64>::new(&[], &[], &arena);
/// let y = NearestUpsample.forward(&pass, &octree.levels[0], Operand::new(&[3.0, 5.0], 2));
/// assert_eq!((y.len(), &y[14..]), (8 * 2, &[3.0, 5.0][..])); // each child has its parent's row
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearestUpsample;

fn from_parents<T: Scalar>(coarse: &OctreeLevel, c: usize, x: &[T], y: &mut [T]) {
    assert_eq!(x.len(), coarse.n_nodes() * c, "rows of the input and of the octree differ");
    par::for_each_block(y, 8 * BLOCK * c, |block, rows| {
        for (i, row) in rows.chunks_exact_mut(c).enumerate() {
            let node = coarse.nonempty[block * BLOCK + i / 8] as usize;
            row.copy_from_slice(&x[node * c..][..c]);
        }
    });
}

/// `dx[n] = Σ_k dy[8·children[n] + k]`; zero for empty nodes.
fn sum_of_children<T: Scalar>(coarse: &OctreeLevel, c: usize, dy: &[T], dx: &mut [T]) {
    let n = 8 * coarse.n_nonempty() * c;
    assert_eq!(dy.len(), n, "rows of the gradient and children differ");
    par::for_each_block(dx, BLOCK * c, |block, rows| {
        rows.fill(T::ZERO);
        for (i, row) in rows.chunks_exact_mut(c).enumerate() {
            let Ok(group) = usize::try_from(coarse.children[block * BLOCK + i]) else {
                continue;
            };
            for child in dy[8 * group * c..][..8 * c].chunks_exact(c) {
                rows::add(row, child);
            }
        }
    });
}

impl<T: Scalar> Layer<T> for NearestUpsample {
    type Geometry = OctreeLevel;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, coarse: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let c = x.width();
        let mut y = pass.arena.get(8 * coarse.n_nonempty() * c);
        from_parents(coarse, c, &x.to_matrix(pass.arena), &mut y);
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), coarse, x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let c = x.width();
        let mut dx = pass.arena.get(coarse.n_nodes() * c);
        sum_of_children(coarse, c, &dy, &mut dx);
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{forward, octrees, require_adjoint, require_gradients};
    use super::*;
    use crate::conformance::gradcheck::probe;
    use crate::nn::params::Layout;

    #[test]
    fn children_get_their_parents_row_and_gradients_are_right() {
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let (n_in, n_out) = (3 * coarse.n_nodes(), 24 * coarse.n_nonempty());
                let x = probe(n_in, 1);
                let y = forward(&NearestUpsample, &[], coarse, Operand::new(&x, 3));
                for (row, y) in y.chunks_exact(3).enumerate() {
                    let parent = coarse.children.iter().position(|&c| c == row as i32 / 8).unwrap();
                    assert_eq!(y, &x[3 * parent..][..3]);
                }
                let none = (&Layout::default(), &[][..]);
                require_gradients(&NearestUpsample, none, coarse, Operand::new(&x, 3));
                require_adjoint(&NearestUpsample, &[], coarse, (n_in, 3), n_out);
            }
        }
    }
}
