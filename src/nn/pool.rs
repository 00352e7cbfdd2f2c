//! Pooling: the children of a node to the node, and all nodes of a shape to the shape. For any number of columns.

use super::arena::Buffer;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use super::rows;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::ops::Range;

/// Rows per task.
const BLOCK: usize = 1024;

/// Greatest value among the eight children of every non-empty node, NaN if one is; empty nodes get zeros. From
/// `[8·n_nonempty, c]`, all nodes one depth finer than the geometry, to its `[n_nodes, c]`.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, pool::MaxPool};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::splat(0.5)], &[])], &options)?; // a root with eight children
/// let arena = Arena::default();
/// let pass = Inference::<f64>::new(&[], &[], &arena);
/// let x: Vec<f64> = (0..8).map(f64::from).collect(); // of the children
/// assert_eq!(MaxPool.forward(&pass, &octree.levels[0], Operand::new(&x, 1))[..], [7.0]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MaxPool;

/// Number of the child that was taken, the first of several, `[n_nodes, c]`.
#[derive(Debug, Clone)]
pub struct TakenChildren(Vec<u8>);

/// Mean of the eight children of every non-empty node; empty nodes get zeros. Rows as of [`MaxPool`].
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, pool::MeanPool};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::splat(0.5)], &[])], &options)?; // a root with eight children
/// let arena = Arena::default();
/// let pass = Inference::<f64>::new(&[], &[], &arena);
/// let x: Vec<f64> = (0..8).map(f64::from).collect(); // of the children
/// assert_eq!(MeanPool.forward(&pass, &octree.levels[0], Operand::new(&x, 1))[..], [3.5]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeanPool;

/// Mean over all nodes of each shape, empty ones included: from `[n_nodes, c]` to `[n_shapes, c]`.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, pool::GlobalMeanPool};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::splat(0.5)], &[])], &options)?; // a root with eight children
/// let arena = Arena::default();
/// let pass = Inference::<f64>::new(&[], &[], &arena);
/// let x: Vec<f64> = (0..8).map(f64::from).collect(); // of all nodes of the one shape
/// assert_eq!(GlobalMeanPool.forward(&pass, octree.finest(), Operand::new(&x, 1))[..], [3.5]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GlobalMeanPool;

impl<T: Scalar> Layer<T> for MaxPool {
    type Geometry = OctreeLevel;
    type Saved = TakenChildren;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, coarse: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let c = x.width();
        let mut y = pass.arena.get(coarse.n_nodes() * c);
        from_children(coarse, c, &x.to_matrix(pass.arena), &mut y, |children, j| {
            children[argmax(children, c, j) * c + j]
        });
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
    ) -> (Buffer<T>, TakenChildren) {
        let (c, y) = (x.width(), self.forward(&pass.inference(), coarse, x));
        let mut taken = vec![0; y.len()];
        from_children(coarse, c, &x.to_matrix(pass.arena), &mut taken, |children, j| {
            argmax(children, c, j) as u8
        });
        (y, TakenChildren(taken))
    }

    /// `dx[child] = dy[node]` for the child that was taken, 0 for the others.
    fn backward(
        &self,
        pass: &mut Backward<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        taken: TakenChildren,
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let c = x.width();
        let mut dx = pass.arena.get(8 * coarse.n_nonempty() * c);
        to_children(coarse, c, &dy, &mut dx, |node, octant, rows| {
            let taken = &taken.0[node * c..][..c];
            for ((d, &dy), &taken) in rows.iter_mut().zip(&dy[node * c..]).zip(taken) {
                *d = if usize::from(taken) == octant { dy } else { T::ZERO };
            }
        });
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

impl<T: Scalar> Layer<T> for MeanPool {
    type Geometry = OctreeLevel;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, coarse: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let (c, eighth) = (x.width(), T::from_f64(0.125));
        let mut y = pass.arena.get(coarse.n_nodes() * c);
        from_children(coarse, c, &x.to_matrix(pass.arena), &mut y, |children, j| {
            children.iter().skip(j).step_by(c).copied().sum::<T>() * eighth
        });
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

    /// `dx[child] = dy[node] / 8`.
    fn backward(
        &self,
        pass: &mut Backward<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let (c, eighth) = (x.width(), T::from_f64(0.125));
        let mut dx = pass.arena.get(8 * coarse.n_nonempty() * c);
        to_children(coarse, c, &dy, &mut dx, |node, _, rows| {
            let dy = &dy[node * c..];
            rows.iter_mut().zip(dy).for_each(|(d, &dy)| *d = dy * eighth);
        });
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

impl<T: Scalar> Layer<T> for GlobalMeanPool {
    type Geometry = OctreeLevel;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, level: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let (c, x) = (x.width(), x.to_matrix(pass.arena));
        assert_eq!(x.len(), level.n_nodes() * c, "rows of the input and of the octree differ");
        let mut y = pass.arena.zeroed(level.ranges.len() * c);
        par::for_each_block(&mut y, c, |shape, y| {
            let rows = level.ranges[shape].clone();
            for x in x[rows.start * c..rows.end * c].chunks_exact(c) {
                rows::add(y, x);
            }
            let share = T::ONE / T::from_f64(rows.len() as f64);
            y.iter_mut().for_each(|y| *y *= share);
        });
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

    /// `dx[node] = dy[shape] / n_nodes(shape)`.
    fn backward(
        &self,
        pass: &mut Backward<T>,
        level: &OctreeLevel,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let c = x.width();
        assert_eq!(dy.len(), level.ranges.len() * c, "rows of the gradient and shapes differ");
        let mut dx = pass.arena.get(level.n_nodes() * c);
        par::for_each_block(&mut dx, BLOCK * c, |block, rows| {
            for (i, row) in rows.chunks_exact_mut(c).enumerate() {
                let shape = level.shape_of(block * BLOCK + i);
                let share = T::ONE / T::from_f64(level.ranges[shape].len() as f64);
                row.iter_mut().zip(&dy[shape * c..]).for_each(|(d, &dy)| *d = dy * share);
            }
        });
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

fn argmax<T: Scalar>(children: &[T], channels: usize, c: usize) -> usize {
    let value = |octant: usize| children[octant * channels + c];
    let is_nan = |octant: usize| value(octant).partial_cmp(&T::ZERO).is_none();
    let wins = |octant: usize, best| value(octant) > value(best) || is_nan(octant) && !is_nan(best);
    (1..8).fold(0, |best, octant| if wins(octant, best) { octant } else { best })
}

/// `y[node, c] = pool(rows of the node's children, c)`, zero for empty nodes.
fn from_children<T: Scalar, R: Default + Copy + Send>(
    coarse: &OctreeLevel,
    channels: usize,
    x: &[T],
    y: &mut [R],
    pool: impl Fn(&[T], usize) -> R + Sync,
) {
    assert_eq!(
        x.len(),
        8 * coarse.n_nonempty() * channels,
        "rows of the input and children differ"
    );
    par::for_each_block(y, BLOCK * channels, |block, rows| {
        for (i, row) in rows.chunks_exact_mut(channels).enumerate() {
            match usize::try_from(coarse.children[block * BLOCK + i]) {
                Err(_) => row.fill(R::default()),
                Ok(group) => {
                    let children = &x[8 * group * channels..][..8 * channels];
                    row.iter_mut().enumerate().for_each(|(c, y)| *y = pool(children, c));
                }
            }
        }
    });
}

/// Calls `fill(node, octant, row)` for the row of every child of every non-empty node.
fn to_children<T: Scalar>(
    coarse: &OctreeLevel,
    channels: usize,
    dy: &[T],
    dx: &mut [T],
    fill: impl Fn(usize, usize, &mut [T]) + Sync,
) {
    assert_eq!(
        dy.len(),
        coarse.n_nodes() * channels,
        "rows of the gradient and of the octree differ"
    );
    par::for_each_block(dx, 8 * BLOCK * channels, |block, rows| {
        for (i, row) in rows.chunks_exact_mut(channels).enumerate() {
            fill(coarse.nonempty[block * BLOCK + i / 8] as usize, i % 8, row);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::testing::{forward, octrees, require_gradients};
    use super::*;
    use crate::conformance::gradcheck::probe;
    use crate::nn::params::Layout;

    #[test]
    fn pooled_values_are_as_defined() {
        for octree in octrees() {
            let coarse = &octree.levels[3];
            let x = probe(8 * coarse.n_nonempty() * 2, 1);
            let max = forward(&MaxPool, &[], coarse, Operand::new(&x, 2));
            let mean = forward(&MeanPool, &[], coarse, Operand::new(&x, 2));
            for n in 0..2 * coarse.n_nodes() {
                let children = usize::try_from(coarse.children[n / 2]).map_or(vec![], |group| {
                    (0..8).map(|k| x[(8 * group + k) * 2 + n % 2]).collect::<Vec<_>>()
                });
                let greatest = children.iter().copied().reduce(f64::max).unwrap_or(0.0);
                assert_eq!(max[n], greatest);
                assert!((mean[n] - children.iter().sum::<f64>() / 8.0).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        let none = (&Layout::default(), &[][..]);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(8 * coarse.n_nonempty() * 2, 2);
                require_gradients(&MaxPool, none, coarse, Operand::new(&x, 2));
                require_gradients(&MeanPool, none, coarse, Operand::new(&x, 2));
            }
        }
    }

    #[test]
    fn means_of_shapes_have_right_values_and_gradients() {
        for octree in octrees() {
            let level = octree.finest();
            let x = probe(level.n_nodes() * 3, 2);
            let y = forward(&GlobalMeanPool, &[], level, Operand::new(&x, 3));
            for (shape, rows) in level.ranges.iter().enumerate() {
                let column = x[3 * rows.start..3 * rows.end].iter().skip(1).step_by(3);
                let mean = column.sum::<f64>() / rows.len() as f64;
                assert!((y[3 * shape + 1] - mean).abs() < 1e-14);
            }
            let none = (&Layout::default(), &[][..]);
            require_gradients(&GlobalMeanPool, none, level, Operand::new(&x, 3));
        }
    }
}
