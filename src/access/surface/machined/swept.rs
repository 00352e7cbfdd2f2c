//! The surface that a tool leaves along a direction: dropped everywhere, it stops; what it cuts there is gone.

use super::footprint::Footprint;
use super::heights::{BLOCK, Buffers, Coarse, EMPTY, Heights};
use crate::par;
use crate::simd::Isa;
use crate::simd::extremes::{Extreme, TILE, TILE_HEIGHT, TILE_WIDTH, Term, extremes};

/// Height that is above everything.
const FULL: f32 = 1e30;

/// Where a tool stops, and what it leaves, on the tiles that were wanted.
#[derive(Debug)]
pub struct Swept {
    /// Height of the reference point.
    pub stops: Vec<f32>,
    /// Height below which material is left.
    pub left: Vec<f32>,
    /// The least of the heights where the tool stops.
    pub lowest: f32,
    width: usize,
}

/// A tool in the pixels of a view, with terms for its rows.
#[derive(Debug)]
struct Tool<'a> {
    footprint: &'a Footprint,
    /// Of every group, the heights negated.
    raised: Vec<Vec<Term>>,
    /// Of every group.
    cut: Vec<Vec<Term>>,
    isa: Isa,
    buffers: &'a Buffers,
}

impl Swept {
    /// On the tiles that are `wanted`, row by row.
    ///
    /// What does not cut stops on `upper`, which is no lower than `heights` and of the same view.
    pub fn new(
        [heights, upper]: [&Heights; 2],
        footprint: &Footprint,
        wanted: &[bool],
        buffers: &Buffers,
    ) -> Self {
        let view = &heights.view;
        let width = view.width;
        let terms = |sign: f32| {
            let of = |([x, y], height): &([isize; 2], f32)| (y * width as isize + x, sign * height);
            let groups = footprint.groups.iter();
            groups.map(|group| group.pixels.iter().map(of).collect()).collect()
        };
        let isa = Isa::active();
        let tool = Tool { footprint, raised: terms(-1.0), cut: terms(1.0), isa, buffers };
        let needed = grown(wanted, view.n_tiles(), footprint.reach);
        let stops = tool.on_tiles(view.n_tiles(), (&needed, FULL), |tile, at| {
            tool.stop([heights, upper], at, tile);
        });
        // Beside the tiles that are needed nothing is read.
        let coarse = Coarse::new(&stops, width, Extreme::Least);
        let lowest = coarse.blocks.iter().fold(FULL, |a, b| a.min(*b));
        let left = tool.on_tiles(view.n_tiles(), (wanted, EMPTY), |tile, at| {
            tool.leave((&stops, width), &coarse, at, tile);
        });
        Swept { stops, left, lowest, width }
    }

    /// Gives the memory back.
    pub fn recycle(self, buffers: &Buffers) {
        buffers.give(self.stops);
        buffers.give(self.left);
    }

    /// Height below which material is left between four pixels, and its slope, mm per pixel.
    #[inline]
    pub fn at(&self, x: f64, y: f64) -> (f64, [f64; 2]) {
        let (column, row) = (x.floor(), y.floor());
        let first = row as usize * self.width + column as usize;
        let [a, b] = [f64::from(self.left[first]), f64::from(self.left[first + 1])];
        let [c, d] =
            [self.left[first + self.width], self.left[first + self.width + 1]].map(f64::from);
        let (s, t) = (x - column, y - row);
        let (low, high) = (a + s * (b - a), c + s * (d - c));
        (low + t * (high - low), [(b - a) + t * ((d - c) - (b - a)), high - low])
    }
}

impl Swept {
    /// The least of the heights below which material is left at the four pixels about a place, and that pixel.
    pub fn least(&self, x: f64, y: f64) -> (f64, [usize; 2]) {
        let (x, y) = (x as usize, y as usize);
        let of = |[x, y]: [usize; 2]| (f64::from(self.left[y * self.width + x]), [x, y]);
        let others = [[x + 1, y], [x, y + 1], [x + 1, y + 1]].map(of);
        others.into_iter().fold(of([x, y]), |a, b| if b.0 < a.0 { b } else { a })
    }

    /// Where the axis of the tool is that leaves least below a pixel, by column and row.
    pub fn axis_at(&self, [x, y]: [usize; 2], footprint: &Footprint) -> [f64; 2] {
        let at = y * self.width + x;
        let mut best = (f32::INFINITY, [0, 0]);
        for ([dx, dy], height) in footprint.groups.iter().flat_map(|group| &group.pixels) {
            let there = at.checked_add_signed(dy * self.width as isize + dx);
            let sum = there.and_then(|there| self.stops.get(there)).map(|stop| stop + height);
            if let Some(sum) = sum.filter(|sum| *sum < best.0) {
                best = (sum, [*dx, *dy]);
            }
        }
        [x as f64 + best.1[0] as f64, y as f64 + best.1[1] as f64]
    }
}

/// Of tiles, those within `reach` pixels of others.
fn grown(tiles: &[bool], [width, height]: [usize; 2], reach: usize) -> Vec<bool> {
    let [x, y] = [reach.div_ceil(TILE_WIDTH), reach.div_ceil(TILE_HEIGHT)];
    let mut rows = vec![false; tiles.len()];
    for (row, out) in tiles.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for k in (0..width).filter(|k| row[*k]) {
            out[k.saturating_sub(x)..(k + x + 1).min(width)].fill(true);
        }
    }
    let mut grown = vec![false; tiles.len()];
    for row in 0..height {
        for below in row.saturating_sub(y)..(row + y + 1).min(height) {
            for k in 0..width {
                grown[row * width + k] |= rows[below * width + k];
            }
        }
    }
    grown
}

impl Tool<'_> {
    /// An image whose `tiles` are given by `work`, of a tile's column and row in pixels.
    fn on_tiles(
        &self,
        [n_across, n_along]: [usize; 2],
        (tiles, outside): (&[bool], f32),
        work: impl Fn(&mut [f32; TILE], [usize; 2]) + Sync,
    ) -> Vec<f32> {
        let width = n_across * TILE_WIDTH;
        let mut image = self.buffers.take(width * n_along * TILE_HEIGHT, outside);
        par::for_each_block(&mut image, width * TILE_HEIGHT, |row, out| {
            let mut tile = [0.0; TILE];
            for k in (0..n_across).filter(|k| tiles[row * n_across + k]) {
                work(&mut tile, [k * TILE_WIDTH, row * TILE_HEIGHT]);
                for (line, pixels) in out.chunks_exact_mut(width).zip(tile.chunks_exact(TILE_WIDTH))
                {
                    line[k * TILE_WIDTH..][..TILE_WIDTH].copy_from_slice(pixels);
                }
            }
        });
        image
    }

    /// Where the tool stops over the pixels of a tile.
    fn stop(&self, [heights, upper]: [&Heights; 2], [x, y]: [usize; 2], tile: &mut [f32; TILE]) {
        let width = heights.view.width;
        let spindle = self.footprint.spindle.map_or(EMPTY, |height| upper.highest - height);
        tile.fill(spindle.max(EMPTY));
        let image = (&heights.image[..], width);
        for (group, terms) in self.footprint.groups.iter().zip(&self.raised) {
            let [bx, by] = block_of([x, y], group.block);
            if heights.coarse.span(bx, by) - group.least > least(tile) {
                extremes(self.isa, Extreme::Greatest, tile, image, y * width + x, terms);
            }
        }
        for disc in 0..self.footprint.discs.len() {
            self.rest_on_disc(upper, disc, [x, y], tile);
        }
    }

    /// Raises a tile to where a disc touches.
    fn rest_on_disc(
        &self,
        heights: &Heights,
        disc: usize,
        [x, y]: [usize; 2],
        tile: &mut [f32; TILE],
    ) {
        let disc = self.footprint.discs[disc];
        let (width, height) = (heights.view.width, heights.view.height);
        let (coarse, n) = (&heights.coarse, disc.radius.floor() as usize);
        let floor = least(tile) + disc.height;
        let blocks =
            |from: usize, to: usize, end: usize| from / BLOCK..(to.min(end - 1) / BLOCK) + 1;
        let across = blocks(x.saturating_sub(n), x + TILE_WIDTH - 1 + n, width);
        // Rows of blocks that reach above where the disc is.
        let is_high = |row: &usize| {
            let row = &coarse.blocks[row * coarse.width..][across.clone()];
            row.iter().any(|height| *height > floor)
        };
        let along = blocks(y.saturating_sub(n), y + TILE_HEIGHT - 1 + n, height);
        let high: Vec<bool> = along.clone().map(|row| is_high(&row)).collect();
        if !high.contains(&true) {
            return;
        }
        let windows = heights.windows(2 * n + 1, self.buffers);
        // Beyond the image is nothing, and nothing is in its margin.
        let (before, behind) = (y.min(n), (height - y - TILE_HEIGHT).min(n));
        let mut terms: Vec<Vec<Term>> = vec![Vec::new(); windows.len() + 1];
        for row in 0..=before + behind {
            let there = y + row - before;
            let touched = blocks(there, there + TILE_HEIGHT - 1, height);
            if !touched.into_iter().any(|row| high[row - along.start]) {
                continue;
            }
            let dy = row as f64 - before as f64;
            let half = (disc.radius * disc.radius - dy * dy).max(0.0).sqrt().floor() as usize;
            let [left, right] = [half.min(x), half.min(width - x - TILE_WIDTH)];
            let length = left + right + 1;
            let level = (length.ilog2() as usize).min(windows.len());
            let from = dy as isize * width as isize - left as isize;
            terms[level].push((from, -disc.height));
            terms[level].push((from + (length - (1 << level)) as isize, -disc.height));
        }
        for (image, terms) in std::iter::once(&heights.image).chain(windows).zip(&terms) {
            let at = y * width + x;
            extremes(self.isa, Extreme::Greatest, tile, (image, width), at, terms);
        }
    }

    /// What is left below the pixels of a tile.
    fn leave(
        &self,
        (stops, width): (&[f32], usize),
        coarse: &Coarse,
        [x, y]: [usize; 2],
        tile: &mut [f32; TILE],
    ) {
        tile.fill(FULL);
        for (group, terms) in self.footprint.groups.iter().zip(&self.cut) {
            let [bx, by] = block_of([x, y], group.block);
            if coarse.span(bx, by) + group.least < greatest(tile) {
                extremes(self.isa, Extreme::Least, tile, (stops, width), y * width + x, terms);
            }
        }
    }
}

/// The first block that the pixels of a tile reach with a group's offsets.
fn block_of([x, y]: [usize; 2], [bx, by]: [isize; 2]) -> [usize; 2] {
    let of = |pixel: usize, block: isize| {
        (pixel / BLOCK).checked_add_signed(block).expect("the margin holds the tool")
    };
    [of(x, bx), of(y, by)]
}

fn least(tile: &[f32; TILE]) -> f32 {
    fold(tile, f32::min)
}

fn greatest(tile: &[f32; TILE]) -> f32 {
    fold(tile, f32::max)
}

/// In sixteen lanes.
fn fold(tile: &[f32; TILE], of: impl Fn(f32, f32) -> f32) -> f32 {
    let mut lanes = [tile[0]; 16];
    for chunk in tile.chunks_exact(16) {
        lanes.iter_mut().zip(chunk).for_each(|(a, b)| *a = of(*a, *b));
    }
    lanes.into_iter().reduce(of).unwrap_or(EMPTY)
}
