//! Pooling: the children of a node to the node, and all nodes of a shape to the shape.

use crate::octree::Level;
use crate::par;
use crate::scalar::Scalar;

/// Rows per task.
const BLOCK: usize = 1024;

/// Greatest value among the eight children of every non-empty node; empty nodes get zeros.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MaxPool {
    channels: usize,
}

impl MaxPool {
    /// Pooling of rows of `channels` numbers.
    pub fn new(channels: usize) -> Self {
        MaxPool { channels }
    }

    /// `x: [8·n_nonempty, channels]` (all nodes one depth finer than `coarse`) to `y: [n_nodes, channels]`.
    ///
    /// # Panics
    /// If `x` has not one row per finer node.
    pub fn forward<T: Scalar>(&self, coarse: &Level, x: &[T], y: &mut Vec<T>) {
        from_children(coarse, self.channels, x, y, |children, c| {
            children[greatest(children, self.channels, c) * self.channels + c]
        });
    }

    /// As [`MaxPool::forward`]; `cache: [n_nodes, channels]` gets the number of the child that was taken,
    /// the first of several.
    ///
    /// # Panics
    /// If `x` has not one row per finer node.
    pub fn forward_train<T: Scalar>(
        &self,
        coarse: &Level,
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut Vec<u8>,
    ) {
        self.forward(coarse, x, y);
        from_children(coarse, self.channels, x, cache, |children, c| {
            greatest(children, self.channels, c) as u8
        });
    }

    /// `dx[child] = dy[node]` for the child that was taken, 0 for the others.
    ///
    /// # Panics
    /// If `dy` has not one row per node of `coarse`.
    pub fn backward<T: Scalar>(&self, coarse: &Level, cache: &[u8], dy: &[T], dx: &mut Vec<T>) {
        let c = self.channels;
        to_children(coarse, c, dy, dx, |node, octant, rows| {
            let taken = &cache[node * c..][..c];
            for ((d, &dy), &taken) in rows.iter_mut().zip(&dy[node * c..]).zip(taken) {
                *d = if usize::from(taken) == octant { dy } else { T::ZERO };
            }
        });
    }
}

/// Mean of the eight children of every non-empty node; empty nodes get zeros.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeanPool {
    channels: usize,
}

impl MeanPool {
    /// Pooling of rows of `channels` numbers.
    pub fn new(channels: usize) -> Self {
        MeanPool { channels }
    }

    /// `x: [8·n_nonempty, channels]` (all nodes one depth finer than `coarse`) to `y: [n_nodes, channels]`.
    ///
    /// # Panics
    /// If `x` has not one row per finer node.
    pub fn forward<T: Scalar>(&self, coarse: &Level, x: &[T], y: &mut Vec<T>) {
        let eighth = T::from_f64(0.125);
        from_children(coarse, self.channels, x, y, |children, c| {
            children.iter().skip(c).step_by(self.channels).copied().sum::<T>() * eighth
        });
    }

    /// `dx[child] = dy[node] / 8`.
    ///
    /// # Panics
    /// If `dy` has not one row per node of `coarse`.
    pub fn backward<T: Scalar>(&self, coarse: &Level, dy: &[T], dx: &mut Vec<T>) {
        let eighth = T::from_f64(0.125);
        to_children(coarse, self.channels, dy, dx, |node, _, rows| {
            let dy = &dy[node * self.channels..];
            rows.iter_mut().zip(dy).for_each(|(d, &dy)| *d = dy * eighth);
        });
    }
}

/// Mean over all nodes of each shape, empty ones included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GlobalMeanPool {
    channels: usize,
}

impl GlobalMeanPool {
    /// Pooling of rows of `channels` numbers.
    pub fn new(channels: usize) -> Self {
        GlobalMeanPool { channels }
    }

    /// `x: [n_nodes, channels]` of `level` to `y: [n_shapes, channels]`.
    ///
    /// # Panics
    /// If `x` has not one row per node.
    pub fn forward<T: Scalar>(&self, level: &Level, x: &[T], y: &mut Vec<T>) {
        let c = self.channels;
        assert_eq!(x.len(), level.n_nodes() * c, "rows of the input and of the octree differ");
        y.resize(level.ranges.len() * c, T::ZERO);
        par::for_each_block(y, c, |shape, y| {
            y.fill(T::ZERO);
            let rows = level.ranges[shape].clone();
            for x in x[rows.start * c..rows.end * c].chunks_exact(c) {
                y.iter_mut().zip(x).for_each(|(y, &x)| *y += x);
            }
            let share = T::ONE / T::from_f64(rows.len() as f64);
            y.iter_mut().for_each(|y| *y *= share);
        });
    }

    /// `dx[node] = dy[shape] / n_nodes(shape)`.
    ///
    /// # Panics
    /// If `dy` has not one row per shape.
    pub fn backward<T: Scalar>(&self, level: &Level, dy: &[T], dx: &mut Vec<T>) {
        let c = self.channels;
        assert_eq!(dy.len(), level.ranges.len() * c, "rows of the gradient and shapes differ");
        dx.resize(level.n_nodes() * c, T::ZERO);
        par::for_each_block(dx, BLOCK * c, |block, rows| {
            for (i, row) in rows.chunks_exact_mut(c).enumerate() {
                let shape = level.shape_of(block * BLOCK + i);
                let share = T::ONE / T::from_f64(level.ranges[shape].len() as f64);
                row.iter_mut().zip(&dy[shape * c..]).for_each(|(d, &dy)| *d = dy * share);
            }
        });
    }
}

fn greatest<T: Scalar>(children: &[T], channels: usize, c: usize) -> usize {
    let value = |octant: usize| children[octant * channels + c];
    (1..8).fold(0, |best, octant| if value(octant) > value(best) { octant } else { best })
}

/// `y[node, c] = pool(rows of the node's children, c)`, zero for empty nodes.
fn from_children<T: Scalar, R: Default + Copy + Send>(
    coarse: &Level,
    channels: usize,
    x: &[T],
    y: &mut Vec<R>,
    pool: impl Fn(&[T], usize) -> R + Sync,
) {
    assert_eq!(
        x.len(),
        8 * coarse.n_nonempty() * channels,
        "rows of the input and children differ"
    );
    y.resize(coarse.n_nodes() * channels, R::default());
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
    coarse: &Level,
    channels: usize,
    dy: &[T],
    dx: &mut Vec<T>,
    fill: impl Fn(usize, usize, &mut [T]) + Sync,
) {
    assert_eq!(
        dy.len(),
        coarse.n_nodes() * channels,
        "rows of the gradient and of the octree differ"
    );
    dx.resize(8 * coarse.n_nonempty() * channels, T::ZERO);
    par::for_each_block(dx, 8 * BLOCK * channels, |block, rows| {
        for (i, row) in rows.chunks_exact_mut(channels).enumerate() {
            fill(coarse.nonempty[block * BLOCK + i / 8] as usize, i % 8, row);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::{octrees, require_gradients};
    use super::*;
    use crate::gradcheck::probe;

    #[test]
    fn pooled_values_are_as_defined() {
        for octree in octrees() {
            let coarse = &octree.levels[3];
            let x = probe(8 * coarse.n_nonempty() * 2, 1);
            let (mut max, mut mean) = (vec![], vec![]);
            MaxPool::new(2).forward(coarse, &x, &mut max);
            MeanPool::new(2).forward(coarse, &x, &mut mean);
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
        let (max, mean) = (MaxPool::new(2), MeanPool::new(2));
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(8 * coarse.n_nonempty() * 2, 2);
                let forward = |v: &[Vec<f64>]| {
                    let mut y = vec![];
                    max.forward(coarse, &v[0], &mut y);
                    y
                };
                let backward = |v: &[Vec<f64>], dy: &[f64]| {
                    let (mut y, mut cache, mut dx) = (vec![], vec![], vec![f64::NAN; 3]);
                    max.forward_train(coarse, &v[0], &mut y, &mut cache);
                    max.backward(coarse, &cache, dy, &mut dx);
                    vec![dx]
                };
                require_gradients(&[("x", &x)], forward, backward);
                let forward = |v: &[Vec<f64>]| {
                    let mut y = vec![];
                    mean.forward(coarse, &v[0], &mut y);
                    y
                };
                let backward = |_: &[Vec<f64>], dy: &[f64]| {
                    let mut dx = vec![f64::NAN; 3];
                    mean.backward(coarse, dy, &mut dx);
                    vec![dx]
                };
                require_gradients(&[("x", &x)], forward, backward);
            }
        }
    }

    #[test]
    fn means_of_shapes_have_right_values_and_gradients() {
        let pool = GlobalMeanPool::new(3);
        for octree in octrees() {
            let level = octree.finest();
            let x = probe(level.n_nodes() * 3, 2);
            let forward = |v: &[Vec<f64>]| {
                let mut y = vec![];
                pool.forward(level, &v[0], &mut y);
                y
            };
            for (shape, rows) in level.ranges.iter().enumerate() {
                let column = x[3 * rows.start..3 * rows.end].iter().skip(1).step_by(3);
                let mean = column.sum::<f64>() / rows.len() as f64;
                assert!((forward(std::slice::from_ref(&x))[3 * shape + 1] - mean).abs() < 1e-14);
            }
            let backward = |_: &[Vec<f64>], dy: &[f64]| {
                let mut dx = vec![f64::NAN; 3];
                pool.backward(level, dy, &mut dx);
                vec![dx]
            };
            require_gradients(&[("x", &x)], forward, backward);
        }
    }
}
