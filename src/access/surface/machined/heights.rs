//! How high the part reaches along a direction, at the middle of every pixel.

use super::view::View;
use crate::exec::par;
use crate::simd::Isa;
use crate::simd::extremes::{Extreme, TILE_HEIGHT, extreme_of_pairs, raise_line};
use glam::DVec3;
use std::mem;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Height where nothing is: below everything, with room for sums.
pub const EMPTY: f32 = -1e30;

/// Pixels of a block's side.
pub const BLOCK: usize = 8;
/// Rows of an image per task.
const BAND: usize = 4 * TILE_HEIGHT;

/// Greatest heights of triangles along a direction.
#[derive(Debug)]
pub struct Heights {
    pub view: View,
    pub image: Vec<f32>,
    pub coarse: Coarse,
    /// The greatest of all.
    pub highest: f32,
    windows: OnceLock<Vec<Vec<f32>>>,
}

impl Heights {
    /// Of triangles, mm. What lies beyond the view is cut off.
    pub fn new(view: View, triangles: &[[DVec3; 3]], buffers: &Buffers) -> Self {
        let (bands, isa) = (Bands::new(&view, triangles), Isa::active());
        let mut image = buffers.take(view.n_pixels(), EMPTY);
        par::for_each_block(&mut image, BAND * view.width, |band, rows| {
            let first = band * BAND;
            for &f in bands.of(band) {
                fill(isa, &bands.corners[f as usize], (rows, view.width), first);
            }
        });
        Heights::of(view, image)
    }

    /// As high as these and as points, mm, in the view.
    pub fn raised_to(&self, points: &[DVec3], buffers: &Buffers) -> Self {
        let mut image = buffers.take(0, 0.0);
        image.extend_from_slice(&self.image);
        for point in points {
            let [x, y, height] = self.view.project(*point);
            let pixel = &mut image[y.round() as usize * self.view.width + x.round() as usize];
            *pixel = pixel.max(height as f32);
        }
        Heights::of(self.view.clone(), image)
    }

    fn of(view: View, image: Vec<f32>) -> Self {
        let coarse = Coarse::new(&image, view.width, Extreme::Greatest);
        let highest = coarse.blocks.iter().fold(EMPTY, |a, b| a.max(*b));
        Heights { view, image, coarse, highest, windows: OnceLock::new() }
    }

    /// Image k has the greatest height of 2·2ᵏ pixels from each on along the row, up to `most` pixels.
    pub fn windows(&self, most: usize, buffers: &Buffers) -> &[Vec<f32>] {
        self.windows.get_or_init(|| {
            let (width, isa) = (self.view.width, Isa::active());
            let mut levels: Vec<Vec<f32>> = Vec::new();
            while 2 << levels.len() <= most {
                let half = (1 << levels.len()).min(width);
                let below: &[f32] = levels.last().unwrap_or(&self.image);
                let mut next = buffers.take(below.len(), 0.0);
                par::for_each_block(&mut next, BAND * width, |band, rows| {
                    for (k, row) in rows.chunks_exact_mut(width).enumerate() {
                        let below = &below[(band * BAND + k) * width..][..width];
                        let (row, last) = row.split_at_mut(width - half);
                        last.copy_from_slice(&below[width - half..]);
                        let pairs = [&below[..width - half], &below[half..]];
                        extreme_of_pairs(isa, Extreme::Greatest, row, pairs);
                    }
                });
                levels.push(next);
            }
            levels
        })
    }

    /// Gives the memory back.
    pub fn recycle(self, buffers: &Buffers) {
        buffers.give(self.image);
        self.windows.into_inner().into_iter().flatten().for_each(|level| buffers.give(level));
    }
}

/// Memory of images that goes from one direction to the next: new pages would cost more than what is done with them.
#[derive(Debug, Default)]
pub struct Buffers(Mutex<Vec<Vec<f32>>>);

impl Buffers {
    /// An image of so many pixels, all of them `value`.
    pub fn take(&self, n_pixels: usize, value: f32) -> Vec<f32> {
        let mut image =
            self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        image.clear();
        image.resize(n_pixels, value);
        image
    }

    pub fn give(&self, image: Vec<f32>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(image);
    }
}

/// Triangles by the bands of rows that they reach into.
struct Bands {
    /// Columns and rows, in pixels, and heights.
    corners: Vec<[DVec3; 3]>,
    starts: Vec<u32>,
    faces: Vec<u32>,
}

/// Triangles projected per task.
const PROJECTED: usize = 4096;

impl Bands {
    fn new(view: &View, triangles: &[[DVec3; 3]]) -> Self {
        let project = |p: DVec3| DVec3::from_array(view.project(p));
        let mut corners = vec![[DVec3::ZERO; 3]; triangles.len()];
        par::for_each_block(&mut corners, PROJECTED, |block, out| {
            for (out, corners) in out.iter_mut().zip(&triangles[block * PROJECTED..]) {
                *out = corners.map(project);
            }
        });
        let n_bands = view.height.div_ceil(BAND);
        let reach = |[a, b, c]: &[DVec3; 3]| {
            let (low, high) = (a.y.min(b.y).min(c.y).ceil(), a.y.max(b.y).max(c.y).floor());
            let (low, high) = (low.max(0.0), high.min(view.height as f64 - 1.0));
            match low <= high {
                true => low as usize / BAND..high as usize / BAND + 1,
                false => 0..0,
            }
        };
        let mut starts = vec![0u32; n_bands + 1];
        for triangle in &corners {
            reach(triangle).for_each(|band| starts[band + 1] += 1);
        }
        for band in 0..n_bands {
            starts[band + 1] += starts[band];
        }
        let mut faces = vec![0; starts[n_bands] as usize];
        let mut next = starts.clone();
        for (f, triangle) in corners.iter().enumerate() {
            for band in reach(triangle) {
                faces[next[band] as usize] = f as u32;
                next[band] += 1;
            }
        }
        Bands { corners, starts, faces }
    }

    fn of(&self, band: usize) -> &[u32] {
        &self.faces[self.starts[band] as usize..self.starts[band + 1] as usize]
    }
}

/// Pixels this near to a triangle's rim are on it: of two triangles with an edge in common, one has the pixel.
const RIM: f64 = 1e-7;

/// Raises the pixels whose middles are over a triangle to its height there.
fn fill(isa: Isa, [a, b, c]: &[DVec3; 3], (rows, width): (&mut [f32], usize), first: usize) {
    let n = (b - a).cross(c - a);
    // A triangle seen from its side is the rim of others.
    if n.z == 0.0 {
        return;
    }
    let slope = -n.truncate() / n.z;
    let (low, high) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
    let of = |least: f64, most: f64| {
        (
            least.ceil().max(first as f64),
            most.floor().min((first + rows.len() / width) as f64 - 1.0),
        )
    };
    let (from, to) = of(a.y.min(b.y).min(c.y) - RIM, a.y.max(b.y).max(c.y) + RIM);
    if from > to {
        return;
    }
    for row in from as usize..=to as usize {
        let y = row as f64;
        let mut span = [f64::INFINITY, f64::NEG_INFINITY];
        for [p, q] in [[a, b], [b, c], [c, a]] {
            let [p, q] = if p.y <= q.y { [p, q] } else { [q, p] };
            if y < p.y - RIM || y > q.y + RIM {
                continue;
            }
            let run = q.y - p.y;
            let ends = match run > RIM {
                true => [p.x + (q.x - p.x) * ((y - p.y) / run).clamp(0.0, 1.0); 2],
                false => [p.x, q.x],
            };
            span = [span[0].min(ends[0]).min(ends[1]), span[1].max(ends[0]).max(ends[1])];
        }
        let from = (span[0] - RIM).ceil().max(0.0);
        let to = (span[1] + RIM).floor().min(width as f64 - 1.0);
        if from > to {
            continue;
        }
        let begin = a.z + slope.y * (y - a.y) + slope.x * (from - a.x);
        let line = &mut rows[(row - first) * width..][from as usize..=to as usize];
        raise_line(isa, line, [begin as f32, slope.x as f32], [low as f32, high as f32]);
    }
}

/// Extreme heights of what a group of terms reads for a tile.
#[derive(Debug, Clone)]
pub struct Coarse {
    /// Of every block.
    pub blocks: Vec<f32>,
    /// Of the blocks from each on that a tile's pixels reach with [`BLOCK`] × [`BLOCK`] offsets.
    spans: Vec<f32>,
    pub width: usize,
}

impl Coarse {
    pub fn new(image: &[f32], stride: usize, extreme: Extreme) -> Self {
        let (width, height, isa) = (stride / BLOCK, image.len() / stride / BLOCK, Isa::active());
        let rows_of = |rows: &[f32], length: usize| {
            let (mut columns, mut next) = (rows[..length].to_vec(), vec![0.0; length]);
            for line in rows.chunks_exact(length).skip(1) {
                extreme_of_pairs(isa, extreme, &mut next, [&columns, line]);
                mem::swap(&mut columns, &mut next);
            }
            (columns, next)
        };
        // Each number becomes the extreme of `by + 1` windows, from it and from `by` numbers behind it on.
        let widen = |row: &mut Vec<f32>, next: &mut Vec<f32>, by: usize| {
            let n = row.len().saturating_sub(by);
            extreme_of_pairs(isa, extreme, &mut next[..n], [&row[..n], &row[row.len() - n..]]);
            next[n..].copy_from_slice(&row[n..]);
            mem::swap(row, next);
        };
        let mut blocks = vec![0.0; width * height];
        par::for_each_block(&mut blocks, width, |row, out| {
            let rows = &image[row * BLOCK * stride..][..BLOCK * stride];
            let (mut columns, mut next) = rows_of(rows, stride);
            [1, 2, 4].into_iter().for_each(|by| widen(&mut columns, &mut next, by));
            out.iter_mut()
                .zip(columns.iter().step_by(BLOCK))
                .for_each(|(out, column)| *out = *column);
        });
        // A tile reads a block more than it has, across and along.
        let mut spans = vec![0.0; width * height];
        par::for_each_block(&mut spans, width, |row, out| {
            let along = (row + TILE_HEIGHT / BLOCK + 1).min(height);
            let (mut columns, mut next) = rows_of(&blocks[row * width..along * width], width);
            [1, 2, 4, 1].into_iter().for_each(|by| widen(&mut columns, &mut next, by));
            out.copy_from_slice(&columns);
        });
        Coarse { blocks, spans, width }
    }

    /// The extreme of all that a tile, by its first block, reads with the offsets of a block.
    pub fn span(&self, x: usize, y: usize) -> f32 {
        self.spans[y * self.width + x]
    }
}
