//! The surface that a tool leaves along a direction: dropped everywhere, it stops; what it cuts there is gone.

use super::footprint::{Disc, Footprint};
use super::heights::{BLOCK, Buffers, Coarse, EMPTY, Heights};
use crate::exec::par;
use crate::simd::Isa;
use crate::simd::extremes::{
    Extreme, TILE, TILE_HEIGHT, TILE_WIDTH, Term, extreme_of_tile, extremes,
};
use std::iter;
use std::ops::Range;

/// Height that is above everything.
const FULL: f32 = 1e30;

/// Where a tool stops, and what it leaves, on the tiles that were wanted.
#[derive(Debug)]
pub struct Swept {
    /// Height of the reference point.
    pub stops: Vec<f32>,
    /// Height below which material is left.
    pub left: Vec<f32>,
    /// Of every block of pixels, the least of the heights where the tool stops.
    pub lowest: Vec<f32>,
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
        let (view, tool) = (&heights.view, Tool::new(footprint, heights.view.width));
        let (width, n_tiles) = (view.width, view.n_tiles());
        let needed = grown(wanted, n_tiles, footprint.reach);
        let stops = tool.stops([heights, upper], &needed, buffers);
        // Beside the tiles that are needed nothing is read.
        let coarse = Coarse::new(&stops, width, Extreme::Least);
        let mut left = buffers.take(view.n_pixels(), EMPTY);
        tool.for_tiles(&mut left, (n_tiles, wanted), |tile, at| {
            tool.leave((&stops, width), &coarse, at, tile);
        });
        Swept { stops, left, lowest: coarse.blocks, width }
    }

    /// Gives the memory of images back.
    pub fn recycle(self, buffers: &Buffers) -> Vec<f32> {
        buffers.give(self.stops);
        buffers.give(self.left);
        self.lowest
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

impl<'a> Tool<'a> {
    /// In rows of this length.
    fn new(footprint: &'a Footprint, width: usize) -> Self {
        let terms = |sign: f32| {
            let of = |([x, y], height): &([isize; 2], f32)| (y * width as isize + x, sign * height);
            let groups = footprint.groups.iter();
            groups.map(|group| group.pixels.iter().map(of).collect()).collect()
        };
        Tool { footprint, raised: terms(-1.0), cut: terms(1.0), isa: Isa::active() }
    }

    fn stops(
        &self,
        [heights, upper]: [&Heights; 2],
        needed: &[bool],
        buffers: &Buffers,
    ) -> Vec<f32> {
        let (view, n_tiles) = (&heights.view, heights.view.n_tiles());
        let mut stops = buffers.take(view.n_pixels(), FULL);
        self.for_tiles(&mut stops, (n_tiles, needed), |tile, at| {
            self.stop([heights, upper], at, tile);
        });
        for disc in &self.footprint.discs {
            let lowest = Coarse::new(&stops, view.width, Extreme::Least).blocks;
            let met = self.tiles_met(upper, disc, &lowest, needed);
            if met.contains(&true) {
                // Not within the loop over tiles: a thread that waits there could take another tile, and wait for
                // itself.
                let windows = upper.windows(2 * self.footprint.widest() + 1, buffers);
                self.for_tiles(&mut stops, (n_tiles, &met), |tile, at| {
                    self.stop_on_disc((upper, windows), disc, at, tile);
                });
            }
        }
        stops
    }

    /// Calls `work` with every one of some tiles of an image, and its column and row in pixels.
    fn for_tiles(
        &self,
        image: &mut [f32],
        ([n_across, _], tiles): ([usize; 2], &[bool]),
        work: impl Fn(&mut [f32; TILE], [usize; 2]) + Sync,
    ) {
        let width = n_across * TILE_WIDTH;
        par::for_each_block(image, width * TILE_HEIGHT, |row, out| {
            let mut tile = [0.0; TILE];
            for k in (0..n_across).filter(|k| tiles[row * n_across + k]) {
                let columns = k * TILE_WIDTH..(k + 1) * TILE_WIDTH;
                for (line, pixels) in out.chunks_exact(width).zip(tile.chunks_exact_mut(TILE_WIDTH))
                {
                    pixels.copy_from_slice(&line[columns.clone()]);
                }
                work(&mut tile, [k * TILE_WIDTH, row * TILE_HEIGHT]);
                for (line, pixels) in out.chunks_exact_mut(width).zip(tile.chunks_exact(TILE_WIDTH))
                {
                    line[columns.clone()].copy_from_slice(pixels);
                }
            }
        });
    }

    /// Of the needed tiles, those that a disc may raise; `lowest` is of every block of pixels where the tool stops.
    fn tiles_met(
        &self,
        upper: &Heights,
        disc: &Disc,
        lowest: &[f32],
        needed: &[bool],
    ) -> Vec<bool> {
        let [n_across, n_along] = upper.view.n_tiles();
        let of = |tile: usize| {
            let at = [tile % n_across * TILE_WIDTH, tile / n_across * TILE_HEIGHT];
            let blocks = &lowest[tile * (TILE / BLOCK / BLOCK)..][..TILE / BLOCK / BLOCK];
            let lowest = blocks.iter().fold(FULL, |a, b| a.min(*b));
            upper.highest - disc.height > lowest && Reach::new(upper, disc, at, lowest).is_met()
        };
        let rows = par::map_blocks(n_across * n_along, n_across, |tiles| {
            tiles.map(|tile| needed[tile] && of(tile)).collect::<Vec<bool>>()
        });
        rows.into_iter().flatten().collect()
    }

    /// Where the tool stops over the pixels of a tile.
    fn stop(&self, [heights, upper]: [&Heights; 2], [x, y]: [usize; 2], tile: &mut [f32; TILE]) {
        let width = heights.view.width;
        let spindle = self.footprint.spindle.map_or(EMPTY, |height| upper.highest - height);
        tile.fill(spindle.max(EMPTY));
        let image = (&heights.image[..], width);
        for (group, terms) in self.footprint.groups.iter().zip(&self.raised) {
            let [bx, by] = block_of([x, y], group.block);
            if heights.coarse.span(bx, by) - group.least
                > extreme_of_tile(self.isa, Extreme::Least, tile)
            {
                extremes(self.isa, Extreme::Greatest, tile, image, y * width + x, terms);
            }
        }
    }

    /// Raises a tile to where a disc touches.
    fn stop_on_disc(
        &self,
        (upper, windows): (&Heights, &[Vec<f32>]),
        disc: &Disc,
        [x, y]: [usize; 2],
        tile: &mut [f32; TILE],
    ) {
        let (width, height) = (upper.view.width, upper.view.height);
        let lowest = extreme_of_tile(self.isa, Extreme::Least, tile);
        let reach = Reach::new(upper, disc, [x, y], lowest);
        let n = reach.n;
        // Beyond the image is nothing, and nothing is in its margin.
        let (before, behind) = (y.min(n), (height - y - TILE_HEIGHT).min(n));
        let mut terms: Vec<Vec<Term>> = vec![Vec::new(); windows.len() + 1];
        for row in 0..=before + behind {
            let there = y + row - before;
            if !reach.is_high_at(there) {
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
        for (image, terms) in iter::once(&upper.image).chain(windows).zip(&terms) {
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
            if coarse.span(bx, by) + group.least
                < extreme_of_tile(self.isa, Extreme::Greatest, tile)
            {
                extremes(self.isa, Extreme::Least, tile, (stops, width), y * width + x, terms);
            }
        }
    }
}

/// What a disc can touch over a tile, by blocks.
struct Reach {
    /// Pixels of the radius.
    n: usize,
    /// The first row of blocks, and whether each reaches above the disc where it is lowest.
    along: usize,
    high: Vec<bool>,
    height: usize,
}

impl Reach {
    fn new(upper: &Heights, disc: &Disc, [x, y]: [usize; 2], lowest: f32) -> Self {
        let (n, floor) = (disc.radius.floor() as usize, lowest + disc.height);
        let (coarse, height) = (&upper.coarse, upper.view.height);
        let across = blocks(x.saturating_sub(n), x + TILE_WIDTH - 1 + n, upper.view.width);
        let along = blocks(y.saturating_sub(n), y + TILE_HEIGHT - 1 + n, height);
        let is_high = |row: usize| {
            let row = &coarse.blocks[row * coarse.width..][across.clone()];
            row.iter().any(|height| *height > floor)
        };
        Reach { n, along: along.start, high: along.map(is_high).collect(), height }
    }

    fn is_met(&self) -> bool {
        self.high.contains(&true)
    }

    /// Whether something is high in the rows of a tile that begins at a row.
    fn is_high_at(&self, row: usize) -> bool {
        let mut touched = blocks(row, row + TILE_HEIGHT - 1, self.height);
        touched.any(|row| self.high[row - self.along])
    }
}

/// The blocks of pixels, of which there are `end`.
fn blocks(from: usize, to: usize, end: usize) -> Range<usize> {
    from / BLOCK..(to.min(end - 1) / BLOCK) + 1
}

/// The first block that the pixels of a tile reach with a group's offsets.
fn block_of([x, y]: [usize; 2], [bx, by]: [isize; 2]) -> [usize; 2] {
    let of = |pixel: usize, block: isize| {
        (pixel / BLOCK).checked_add_signed(block).expect("the margin holds the tool")
    };
    [of(x, bx), of(y, by)]
}
