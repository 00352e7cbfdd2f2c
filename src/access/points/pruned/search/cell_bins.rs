//! Points of a direction's plane, binned into square cells.

use crate::access::points::kernels::GROUP;
use crate::simd::{Float32, Mask, Simd, Unsigned, Unsigned16, Unsigned32, Vector};
use crate::spatial::{Coordinates, CountingSort};

/// Most cells along the longer side, give or take the border.
pub const MOST_CELLS: f64 = 1000.0;

/// Strips have so many rows that a run of columns as long as twice the radius holds about so many points.
const POINTS_PER_RUN: f64 = 10.0;

/// From this radius on, in cells, looking at cells before points pays.
const WIDE: f64 = 6.0;

/// Points in cells; what lies outside counts for the nearest cell of the border.
///
/// Two things are kept of a cell: its greatest height, in 16 bits, and its points. Points are sorted by strip of
/// one to eight rows and by column, so the points of some columns of a strip are one run.
#[derive(Debug, Default)]
pub struct CellBins {
    /// The points by strip and column. A group can be read from any place of a point on; there is padding at height −∞.
    pub sorted: Coordinates,
    /// Places of the points of each column of each strip, strip by strip.
    bins: CountingSort,
    /// Greatest height of each cell, quantized, 0 for none, and room for a vector.
    top: Vec<u16>,
    heights: QuantizedHeights,
    /// Columns and rows.
    pub n: [usize; 2],
    /// Cells from row to row, a multiple of the `u16` lanes of the instruction set.
    pub stride: usize,
    /// Cells a millimeter.
    pub per_mm: f32,
    /// A strip is `2^strip` rows.
    pub strip: u32,
    /// The radius is many cells; a strip is one row.
    pub wide: bool,
    origin: [f32; 2],
    /// The points as they come, and the bin of each.
    kept: Coordinates,
    bin: Vec<u32>,
}

/// Heights as whole numbers in 16 bits, 1 at the floor and about 65,000 at the greatest; they never descend when
/// the height ascends, so of two heights with different numbers the greater is known.
#[derive(Debug, Default, Clone, Copy)]
struct QuantizedHeights {
    floor: f32,
    per_mm: f32,
}

/// Number of the greatest height, less one.
const STEPS: f32 = 65_000.0;

impl QuantizedHeights {
    /// The numbers of some heights; above the greatest one at most 65,535, more than any cell has.
    #[inline(always)]
    fn of<S: Simd>(self, s: S, z: S::F32) -> S::U32 {
        let above = (z - S::F32::splat(s, self.floor)) * S::F32::splat(s, self.per_mm);
        let above = above.max(S::F32::splat(s, 0.0)).min(S::F32::splat(s, 65_534.0));
        (above + S::F32::splat(s, 1.0)).truncate()
    }

    /// The number of one height.
    #[inline(always)]
    fn of_one(self, z: f32) -> u16 {
        (((z - self.floor) * self.per_mm).clamp(0.0, 65_534.0) + 1.0) as u16
    }
}

/// What some points span, mm.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Least x, y, z.
    pub least: [f32; 3],
    /// Greatest x, y, z.
    pub greatest: [f32; 3],
}

impl Extent {
    /// Of least and greatest coordinates, lane by lane.
    #[inline(always)]
    pub fn of<V: Float32>([x0, y0, z0]: [V; 3], [x1, y1, z1]: [V; 3]) -> Self {
        Extent {
            least: [x0.reduce_min(), y0.reduce_min(), z0.reduce_min()],
            greatest: [x1.reduce_max(), y1.reduce_max(), z1.reduce_max()],
        }
    }

    /// Of points, at least one; padding up to a whole group repeats the place of one of them.
    #[inline(always)]
    fn around<S: Simd>(s: S, points: &Coordinates) -> Self {
        let mut least = [S::F32::splat(s, f32::INFINITY); 3];
        let mut greatest = [S::F32::splat(s, f32::NEG_INFINITY); 3];
        let len = points.n.next_multiple_of(S::LANES);
        for (axis, values) in [&points.x, &points.y, &points.z].into_iter().enumerate() {
            for values in values[..len].chunks_exact(S::LANES) {
                let values = S::F32::load(s, values);
                (least[axis], greatest[axis]) =
                    (least[axis].min(values), greatest[axis].max(values));
            }
        }
        Extent::of(least, greatest)
    }
}

impl CellBins {
    /// Sorts the points above `floor`. The cells cover them and the `places` nearer than `radius`, mm; their
    /// size follows from what they cover, (width, depth), and the number of points. False if no
    /// point is above the floor.
    #[inline(always)]
    pub fn fill<S: Simd>(
        &mut self,
        s: S,
        (points, floor): (&Coordinates, f32),
        (places, radius): (&Extent, f64),
        size: impl FnOnce([f64; 2], usize) -> f64,
    ) -> bool {
        self.keep(s, points, floor);
        if self.kept.n == 0 {
            return false;
        }
        let kept = Extent::around(s, &self.kept);
        let per_mm = (STEPS / (kept.greatest[2] - floor)).min(f32::MAX);
        self.heights = QuantizedHeights { floor, per_mm };
        self.lay_out(&kept, places, radius, size);
        self.stride = self.n[0].next_multiple_of(S::U16::LANES);
        self.sort(s);
        true
    }

    /// Keeps the points above the floor, and copies of the last one up to a whole group.
    #[inline(always)]
    fn keep<S: Simd>(&mut self, s: S, points: &Coordinates, floor: f32) {
        let kept = &mut self.kept;
        kept.resize(points.n + GROUP);
        let floor = S::F32::splat(s, floor);
        let mut n = 0;
        let lanes = S::LANES;
        let from = points.x.chunks_exact(lanes).zip(points.y.chunks_exact(lanes));
        for ((x, y), z) in from.zip(points.z.chunks_exact(lanes)) {
            let z = S::F32::load(s, z);
            let above = z.gt(floor).bits();
            if above != 0 {
                S::F32::load(s, x).compress(above).store(&mut kept.x[n..]);
                S::F32::load(s, y).compress(above).store(&mut kept.y[n..]);
                z.compress(above).store(&mut kept.z[n..]);
                n += above.count_ones() as usize;
            }
        }
        kept.n = n;
        if n > 0 {
            for axis in [&mut kept.x, &mut kept.y, &mut kept.z] {
                let last = axis[n - 1];
                axis[n..n.next_multiple_of(GROUP)].fill(last);
            }
        }
    }

    /// Places beyond count for the border, which then lies farther than the radius from all points.
    fn lay_out(
        &mut self,
        kept: &Extent,
        places: &Extent,
        radius: f64,
        size: impl FnOnce([f64; 2], usize) -> f64,
    ) {
        let (mut least, mut greatest, mut beyond) = ([0.0; 2], [0.0; 2], [[false; 2]; 2]);
        for axis in 0..2 {
            let [lo, hi] = [kept.least[axis], kept.greatest[axis]].map(f64::from);
            let before = lo - f64::from(places.least[axis]);
            let after = f64::from(places.greatest[axis]) - hi;
            least[axis] = lo - before.clamp(0.0, radius);
            greatest[axis] = hi + after.clamp(0.0, radius);
            beyond[axis] = [before > radius, after > radius];
        }
        let covered = [greatest[0] - least[0], greatest[1] - least[1]];
        let farthest = least.into_iter().chain(greatest).fold(0.0, |a: f64, b| a.max(b.abs()));
        let least_size = (covered[0].max(covered[1]) / MOST_CELLS).max(1e-5 * farthest).max(1e-9);
        let size = size(covered, self.kept.n).max(least_size);
        self.per_mm = (1.0 / size) as f32;
        for axis in 0..2 {
            let [before, after] = beyond[axis].map(|beyond| if beyond { 3.0 * size } else { 0.0 });
            self.origin[axis] = (least[axis] - before) as f32;
            let last = (greatest[axis] + after) as f32;
            self.n[axis] = ((last - self.origin[axis]) * self.per_mm) as usize + 1;
        }
        let area = (covered[0] * covered[1]).max(size * size);
        let per_row = self.kept.n as f64 / area * size * (2.0 * radius + size);
        self.wide = radius >= WIDE * size;
        let strip = (POINTS_PER_RUN / per_row).log2().clamp(0.0, 3.0) as u32;
        self.strip = if self.wide { 0 } else { strip };
    }

    #[inline(always)]
    fn sort<S: Simd>(&mut self, s: S) {
        self.find_cells(s);
        let n_strips = ((self.n[1] - 1) >> self.strip) + 1;
        let CellBins { bins, bin, kept, sorted, .. } = self;
        let bin = &bin[..kept.n];
        bins.clear(self.stride * n_strips);
        bin.iter().for_each(|&bin| bins.count(bin as usize));
        bins.finish_counting();
        sorted.resize(kept.n + GROUP);
        let Coordinates { x, y, z, .. } = sorted;
        let from = kept.x.iter().zip(&kept.y).zip(&kept.z);
        for (&bin, ((&from_x, &from_y), &from_z)) in bin.iter().zip(from) {
            let place = bins.place(bin as usize);
            (x[place], y[place], z[place]) = (from_x, from_y, from_z);
        }
        z[kept.n..].fill(f32::NEG_INFINITY);
    }

    /// Finds the bin of each point kept, and the greatest height of each cell.
    #[inline(always)]
    fn find_cells<S: Simd>(&mut self, s: S) {
        let n_cells = self.stride * self.n[1];
        let mut top = std::mem::take(&mut self.top);
        top.clear();
        top.resize(n_cells + S::U16::LANES, 0);
        let mut bin = std::mem::take(&mut self.bin);
        let len = self.kept.n.next_multiple_of(S::LANES);
        bin.resize(len, 0);
        let stride = S::U32::splat(s, self.stride as u32);
        let lanes = S::LANES;
        let (x, y) =
            (self.kept.x[..len].chunks_exact(lanes), self.kept.y[..len].chunks_exact(lanes));
        let points = x.zip(y).zip(self.kept.z[..len].chunks_exact(lanes));
        for (((x, y), z), bin) in points.zip(bin.chunks_exact_mut(lanes)) {
            let columns = self.columns(s, S::F32::load(s, x));
            let rows = self.rows(s, S::F32::load(s, y));
            columns.add(rows.shr(self.strip).mul(stride)).store(bin);
            let (mut cells, mut heights) = ([0; GROUP], [0; GROUP]);
            columns.add(rows.mul(stride)).store(&mut cells);
            self.heights.of(s, S::F32::load(s, z)).store(&mut heights);
            for (&cell, &height) in cells.iter().zip(&heights).take(lanes) {
                let top = &mut top[cell as usize];
                *top = (*top).max(height as u16);
            }
        }
        (self.top, self.bin) = (top, bin);
    }

    /// Greatest quantized height of each cell, 0 for none.
    pub fn tops(&self) -> &[u16] {
        &self.top[..self.stride * self.n[1]]
    }

    /// Columns of some x. They never descend when x ascends.
    #[inline(always)]
    pub fn columns<S: Simd>(&self, s: S, x: S::F32) -> S::U32 {
        self.index(s, x, 0)
    }

    /// Rows of some y. They never descend when y ascends.
    #[inline(always)]
    pub fn rows<S: Simd>(&self, s: S, y: S::F32) -> S::U32 {
        self.index(s, y, 1)
    }

    #[inline(always)]
    fn index<S: Simd>(&self, s: S, along: S::F32, axis: usize) -> S::U32 {
        let cells = (along - S::F32::splat(s, self.origin[axis])) * S::F32::splat(s, self.per_mm);
        let last = S::F32::splat(s, (self.n[axis] - 1) as f32);
        cells.max(S::F32::splat(s, 0.0)).min(last).truncate()
    }

    /// Column and row of one place, the same as that of a lane.
    #[inline(always)]
    pub fn cell(&self, place: [f32; 2]) -> [usize; 2] {
        let index = |axis: usize| {
            let cells = (place[axis] - self.origin[axis]) * self.per_mm;
            cells.max(0.0).min((self.n[axis] - 1) as f32) as usize
        };
        [index(0), index(1)]
    }

    /// Numbers of cells, by column and row.
    #[inline(always)]
    pub fn cells<S: Simd>(&self, s: S, columns: S::U32, rows: S::U32) -> S::U32 {
        columns.add(rows.mul(S::U32::splat(s, self.stride as u32)))
    }

    /// Some heights, quantized, to be compared with those of cells.
    #[inline(always)]
    pub fn quantize<S: Simd>(&self, s: S, z: S::F32) -> S::U32 {
        self.heights.of(s, z)
    }

    /// One height, quantized.
    #[inline(always)]
    pub fn quantize_one(&self, z: f32) -> u16 {
        self.heights.of_one(z)
    }

    /// Places in the order of the points of `strip` from column `first` to `last`.
    #[inline(always)]
    pub fn run(&self, strip: usize, first: usize, last: usize) -> std::ops::Range<usize> {
        let before = strip * self.stride;
        self.bins.range(before + first, before + last)
    }

    /// Whether a cell of `row` from column `first` to `last`, or a little beyond, has this quantized height or a
    /// greater one.
    #[inline(always)]
    pub fn reaches<S: Simd>(
        &self,
        s: S,
        row: usize,
        [first, last]: [usize; 2],
        height: u16,
    ) -> bool {
        let height = S::U16::splat(s, height);
        let before = row * self.stride;
        let cells = &self.top[before + first..=before + last + S::U16::LANES - 1];
        for tops in cells.chunks_exact(S::U16::LANES) {
            if S::U16::load(s, tops).any_ge(height) {
                return true;
            }
        }
        false
    }

    /// x, y and z of the points from a place on, as many as there are lanes.
    #[inline(always)]
    pub fn points<S: Simd>(&self, s: S, place: usize) -> [S::F32; 3] {
        let Coordinates { x, y, z, .. } = &self.sorted;
        let lanes = place..place + S::LANES;
        [
            S::F32::load(s, &x[lanes.clone()]),
            S::F32::load(s, &y[lanes.clone()]),
            S::F32::load(s, &z[lanes]),
        ]
    }
}
