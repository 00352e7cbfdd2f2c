//! Points of a lattice about the part: which are in it, and how far above what tools leave the others are.

use super::heights::Heights;
use super::swept::Swept;
use crate::Result;
use crate::exec::par;
use crate::geom::Mesh;
use crate::geom::inside::{Lattice, columns_inside};
use crate::simd::extremes::{TILE_HEIGHT, TILE_WIDTH};
use glam::DVec3;
use std::sync::atomic::{AtomicU64, Ordering};

/// Nodes of a block's side.
const SIDE: usize = 16;
/// Nodes of a block.
const NODES: usize = SIDE * SIDE * SIDE;
/// Words of a bit per node.
const WORDS: usize = NODES / 64;
/// Blocks per task.
const TASK: usize = 16;
/// Blocks with at most so many open nodes name the tiles of each.
const FEW: u32 = 256;

/// What is known of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// In the part.
    Part,
    /// Outside of the stock, or more than [`Grid::done`] above what is left.
    Removed,
    /// Of the stock, this far above what is left, mm, about; negative: left.
    Above(f32),
}

/// A lattice in blocks.
#[derive(Debug, Clone)]
pub struct Grid {
    pub lattice: Lattice,
    /// Least and greatest corner of the stock's box, mm.
    stock_box: [DVec3; 2],
    n_blocks: [usize; 3],
    blocks: Vec<Block>,
}

#[derive(Debug, Clone)]
struct Block {
    part: Box<[u64; WORDS]>,
    /// Of the stock and not removed for certain.
    open: Box<[u64; WORDS]>,
    n_open: u32,
    /// How far above what is left every node is; none if no node is open.
    above: Vec<f32>,
}

impl Grid {
    /// Bytes of so many nodes at worst.
    pub fn bytes(n_nodes: f64) -> f64 {
        n_nodes * (4.0 + 2.0 / 8.0)
    }

    /// The nodes of a lattice, of which the outermost are outside of the stock's box, in a closed part and in a closed
    /// stock; without the latter, in its box.
    ///
    /// # Errors
    /// If a mesh has no inside.
    pub fn new(
        lattice: Lattice,
        stock_box: [DVec3; 2],
        [part, stock]: [Option<&Mesh>; 2],
    ) -> Result<Self> {
        let n_blocks = lattice.counts.map(|n| n.div_ceil(SIDE));
        let n_words = n_blocks.iter().product::<usize>() * WORDS;
        let bits = |mesh: &Mesh| -> Result<Vec<AtomicU64>> {
            let words: Vec<AtomicU64> = (0..n_words).map(|_| AtomicU64::new(0)).collect();
            columns_inside(mesh, &lattice, |column, inside| {
                let [i, j] = [column % lattice.counts[0], column / lattice.counts[0]];
                for (k, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
                    let (block, node) = place(n_blocks, [i, j, k]);
                    words[block * WORDS + node / 64].fetch_or(1 << (node % 64), Ordering::Relaxed);
                }
            })?;
            Ok(words)
        };
        let in_part = part.map(bits).transpose()?;
        let in_stock = stock.map(bits).transpose()?;
        let word = |words: &[AtomicU64], block: usize| {
            Box::new(std::array::from_fn(|w| words[block * WORDS + w].load(Ordering::Relaxed)))
        };
        let n = n_blocks.iter().product();
        let blocks = par::map(n, |block| {
            let of = |bits: &Vec<AtomicU64>| -> Box<[u64; WORDS]> { word(bits, block) };
            let part = in_part.as_ref().map_or_else(|| Box::new([0; WORDS]), of);
            let stock = in_stock.as_ref().map(of);
            let first = corner(n_blocks, block);
            let mut open = Box::new([0u64; WORDS]);
            for node in 0..NODES {
                let at = add(first, within(node));
                let is_inner = (0..3).all(|k| at[k] > 0 && at[k] + 1 < lattice.counts[k]);
                let bit = |words: &[u64; WORDS]| words[node / 64] >> (node % 64) & 1 == 1;
                if is_inner && !bit(&part) && stock.as_ref().is_none_or(|stock| bit(stock)) {
                    open[node / 64] |= 1 << (node % 64);
                }
            }
            let n_open: u32 = open.iter().map(|word| word.count_ones()).sum();
            let above = if n_open > 0 { vec![f32::NEG_INFINITY; NODES] } else { Vec::new() };
            Block { part, open, n_open, above }
        });
        Ok(Grid { lattice, stock_box, n_blocks, blocks })
    }

    /// How far a point is within the box of the stock, mm; negative: beyond.
    pub fn within_stock(&self, p: DVec3) -> f64 {
        let [low, high] = self.stock_box;
        (p - low).min(high - p).min_element()
    }

    /// Nodes this far above what is left are removed for certain, mm.
    pub fn done(&self) -> f32 {
        2.0 * self.lattice.step_mm as f32
    }

    /// What is known of a node.
    pub fn node(&self, at: [usize; 3]) -> Node {
        let (block, node) = place(self.n_blocks, at);
        let block = &self.blocks[block];
        let bit = |words: &[u64; WORDS]| words[node / 64] >> (node % 64) & 1 == 1;
        match () {
            () if bit(&block.part) => Node::Part,
            () if bit(&block.open) => Node::Above(block.above[node]),
            () => Node::Removed,
        }
    }

    /// Nodes that are left, in order of blocks.
    pub fn left(&self) -> Vec<[usize; 3]> {
        let of = par::map_blocks(self.blocks.len(), TASK, |range| {
            let mut left = Vec::new();
            for b in range {
                let block = &self.blocks[b];
                let first = corner(self.n_blocks, b);
                let is_left = |node: &usize| block.above[*node] < 0.0;
                left.extend(
                    nodes(&block.open).filter(is_left).map(|node| add(first, within(node))),
                );
            }
            left
        });
        of.into_iter().flatten().collect()
    }

    /// What one of two tool sets removes is removed.
    pub fn merge(&mut self, other: &Grid) {
        let done = self.done();
        par::for_each_block(&mut self.blocks, TASK, |task, blocks| {
            for (block, other) in blocks.iter_mut().zip(&other.blocks[task * TASK..]) {
                for w in 0..WORDS {
                    block.open[w] &= other.open[w];
                }
                for node in nodes(&block.open.clone()) {
                    block.above[node] = block.above[node].max(other.above[node]);
                }
                block.settle(done);
            }
        });
    }

    /// The tiles of a view that open nodes need.
    pub fn wanted(&self, heights: &Heights) -> Vec<bool> {
        let [n_across, n_along] = heights.view.n_tiles();
        let lists = par::map_blocks(self.blocks.len(), TASK, |range| {
            let mut tiles = Vec::new();
            for b in range.filter(|b| self.blocks[*b].n_open > 0) {
                let (block, frame) = (&self.blocks[b], self.frame(b, heights));
                let tile = |x: f64, y: f64| {
                    (y as usize / TILE_HEIGHT * n_across + x as usize / TILE_WIDTH) as u32
                };
                if block.n_open <= FEW {
                    let mut last = u32::MAX;
                    for node in nodes(&block.open) {
                        let at = frame.at(node);
                        if is_covered(heights, at) {
                            continue;
                        }
                        let [x, y, _] = at;
                        let first = tile(x, y);
                        if first != last || first != tile(x + 1.0, y + 1.0) {
                            tiles.extend([
                                first,
                                tile(x + 1.0, y),
                                tile(x, y + 1.0),
                                tile(x + 1.0, y + 1.0),
                            ]);
                        }
                        last = first;
                    }
                    continue;
                }
                let ends = [0, 1, 2, 3, 4, 5, 6, 7].map(|k: usize| {
                    let end = |axis: usize| if k >> axis & 1 == 1 { SIDE - 1 } else { 0 };
                    frame.at((end(2) * SIDE + end(1)) * SIDE + end(0))
                });
                let least =
                    |axis: usize| ends.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
                let most = |axis: usize| ends.iter().map(|p| p[axis]).fold(0.0, f64::max);
                let tiles_of = |low: f64, high: f64, size: usize| {
                    low as usize / size..=(high as usize + 1) / size
                };
                for row in tiles_of(least(1), most(1), TILE_HEIGHT) {
                    let across = tiles_of(least(0), most(0), TILE_WIDTH);
                    tiles.extend(across.map(|k| (row * n_across + k) as u32));
                }
            }
            tiles
        });
        let mut wanted = vec![false; n_across * n_along];
        lists.into_iter().flatten().for_each(|tile| wanted[tile as usize] = true);
        wanted
    }

    /// Raises the nodes to how far they are above what a tool leaves along a direction.
    pub fn raise(&mut self, heights: &Heights, swept: &Swept) {
        let (done, pitch) = (self.done(), heights.view.pitch());
        let mut blocks = std::mem::take(&mut self.blocks);
        par::for_each_block(&mut blocks, TASK, |task, blocks| {
            for (k, block) in blocks.iter_mut().enumerate().filter(|(_, block)| block.n_open > 0) {
                let frame = self.frame(task * TASK + k, heights);
                for w in 0..WORDS {
                    let mut bits = block.open[w];
                    while bits != 0 {
                        let node = w * 64 + bits.trailing_zeros() as usize;
                        bits &= bits - 1;
                        let at = frame.at(node);
                        if is_covered(heights, at) {
                            continue;
                        }
                        let (left, [across, along]) = swept.at(at[0], at[1]);
                        let steep = across * across + along * along;
                        let above = (at[2] - left) / (1.0 + steep / (pitch * pitch)).sqrt();
                        block.above[node] = block.above[node].max((above as f32).min(done));
                    }
                }
                block.settle(done);
            }
        });
        self.blocks = blocks;
    }

    /// Raises the nodes to their depths in what is removed. `about` is given the middle of a block and the distance of
    /// its corners from there, mm. What it returns computes the depth of a point: less than the first of two numbers,
    /// or more than the second, it need not be exact.
    pub fn raise_about<F: Fn(DVec3, [f64; 2]) -> f64>(
        &mut self,
        about: impl Fn(DVec3, f64) -> F + Sync,
    ) {
        let (done, lattice, n_blocks) = (self.done(), &self.lattice, self.n_blocks);
        let half = 0.5 * (SIDE - 1) as f64 * lattice.step_mm;
        par::for_each_block(&mut self.blocks, TASK, |task, blocks| {
            for (k, block) in blocks.iter_mut().enumerate().filter(|(_, block)| block.n_open > 0) {
                let first = corner(n_blocks, task * TASK + k);
                let depth = about(lattice.at(first) + half, half * 3f64.sqrt());
                for node in nodes(&block.open.clone()) {
                    let at = lattice.at(add(first, within(node)));
                    let above = depth(at, [block.above[node], done].map(f64::from)) as f32;
                    block.above[node] = block.above[node].max(above.min(done));
                }
                block.settle(done);
            }
        });
    }

    fn frame(&self, block: usize, heights: &Heights) -> Frame {
        let (view, step) = (&heights.view, self.lattice.step_mm);
        let first = corner(self.n_blocks, block);
        Frame {
            first: view.project(self.lattice.at(first)),
            steps: [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| view.turn(axis * step)),
        }
    }
}

impl Block {
    /// Closes the nodes that are removed for certain.
    fn settle(&mut self, done: f32) {
        for w in 0..WORDS {
            let mut bits = self.open[w];
            while bits != 0 {
                let node = w * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                if self.above[node] >= done {
                    self.open[w] &= !(1 << (node % 64));
                }
            }
        }
        self.n_open = self.open.iter().map(|word| word.count_ones()).sum();
        if self.n_open == 0 {
            self.above = Vec::new();
        }
    }
}

/// Columns, rows and heights of a block's nodes.
struct Frame {
    first: [f64; 3],
    steps: [[f64; 3]; 3],
}

impl Frame {
    #[inline(always)]
    fn at(&self, node: usize) -> [f64; 3] {
        let [i, j, k] = within(node).map(|n| n as f64);
        let [x, y, z] = &self.steps;
        let of = |a: usize| self.first[a] + i * x[a] + j * y[a] + k * z[a];
        [of(0), of(1), of(2)]
    }
}

/// Whether the part is above a place.
#[inline(always)]
fn is_covered(heights: &Heights, [x, y, height]: [f64; 3]) -> bool {
    let width = heights.view.width;
    let first = y as usize * width + x as usize;
    let image = &heights.image;
    let least =
        image[first].min(image[first + 1]).min(image[first + width]).min(image[first + width + 1]);
    f64::from(least) > height
}

fn nodes(words: &[u64; WORDS]) -> impl Iterator<Item = usize> {
    let with_bits = words.iter().enumerate().filter(|(_, word)| **word != 0);
    with_bits
        .flat_map(|(w, &word)| (0..64).filter(move |b| word >> b & 1 == 1).map(move |b| w * 64 + b))
}

/// Block and node of a place.
fn place([nx, ny, _]: [usize; 3], [i, j, k]: [usize; 3]) -> (usize, usize) {
    let block = ((k / SIDE) * ny + j / SIDE) * nx + i / SIDE;
    (block, ((k % SIDE) * SIDE + j % SIDE) * SIDE + i % SIDE)
}

/// Where a block begins.
fn corner([nx, ny, _]: [usize; 3], block: usize) -> [usize; 3] {
    [block % nx * SIDE, block / nx % ny * SIDE, block / nx / ny * SIDE]
}

/// Where a node is in its block.
#[inline(always)]
fn within(node: usize) -> [usize; 3] {
    [node % SIDE, node / SIDE % SIDE, node / SIDE / SIDE]
}

fn add(a: [usize; 3], b: [usize; 3]) -> [usize; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
