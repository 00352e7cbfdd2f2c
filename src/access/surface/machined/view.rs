//! Images of the part along a direction.

use super::super::tool::Axes;
use crate::simd::extremes::{TILE_HEIGHT, TILE_WIDTH};
use glam::DVec3;

/// Square pixels across a direction. Pixel (0, 0) has its middle at (0, 0); rows and columns are whole tiles.
#[derive(Debug, Clone)]
pub struct View {
    axes: Axes,
    /// Of the pixel (0, 0), at height 0.
    origin: DVec3,
    pitch: f64,
    pub width: usize,
    pub height: usize,
}

impl View {
    /// Pixels `pitch` mm apart that hold all of a box, with `margin` pixels beside it. Heights are above the box's
    /// middle.
    pub fn new(axes: Axes, [low, high]: [DVec3; 2], pitch: f64, margin: usize) -> Self {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let [u, v, _] = axes;
        let n_half = |axis: DVec3| (axis.abs().dot(half) / pitch).ceil() as usize + margin + 1;
        let [x, y] = [n_half(u), n_half(v)];
        View {
            axes,
            origin: middle - (u * x as f64 + v * y as f64) * pitch,
            pitch,
            width: (2 * x + 1).next_multiple_of(TILE_WIDTH),
            height: (2 * y + 1).next_multiple_of(TILE_HEIGHT),
        }
    }

    pub fn pitch(&self) -> f64 {
        self.pitch
    }

    pub fn n_pixels(&self) -> usize {
        self.width * self.height
    }

    /// Tiles of a row, and rows of tiles.
    pub fn n_tiles(&self) -> [usize; 2] {
        [self.width / TILE_WIDTH, self.height / TILE_HEIGHT]
    }

    /// Column and row of a point, in pixels, and its height, mm.
    #[inline(always)]
    pub fn project(&self, p: DVec3) -> [f64; 3] {
        let ([u, v, d], offset) = (self.axes, p - self.origin);
        let per_pixel = 1.0 / self.pitch;
        [offset.dot(u) * per_pixel, offset.dot(v) * per_pixel, offset.dot(d)]
    }

    /// Column and row by which a step of 1 mm moves, in pixels, and by which height, mm.
    pub fn turn(&self, way: DVec3) -> [f64; 3] {
        let ([u, v, d], per_pixel) = (self.axes, 1.0 / self.pitch);
        [way.dot(u) * per_pixel, way.dot(v) * per_pixel, way.dot(d)]
    }
}
