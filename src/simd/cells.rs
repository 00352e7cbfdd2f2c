//! Points of a direction's frame, sorted into square cells.

use super::collide::{Coordinates, eights};
use super::level::Simd;

/// Most cells along the longer side, give or take the border.
pub const MOST_CELLS: f64 = 1000.0;

/// Strips have so many rows that a run of columns as long as twice the radius holds about so many points.
const POINTS_PER_RUN: f64 = 10.0;

/// From this radius on, in cells, looking at cells before points pays.
const WIDE: f64 = 6.0;

/// Points in cells; what lies outside counts for the nearest cell of the border.
#[derive(Debug, Default)]
pub struct Cells {
    /// The points by cell. Eight can be read from any place of a point on; there is padding at height −∞.
    pub sorted: Coordinates,
    /// First point of each column of each strip, strip by strip; the end of the last one, and one more.
    starts: Vec<u32>,
    /// Greatest mark of each cell, 0 for none, and room.
    top: Vec<u16>,
    marks: Marks,
    /// Columns and rows.
    pub n: [usize; 2],
    /// Cells from row to row, a multiple of [`TOPS`].
    pub stride: usize,
    /// Cells a millimetre.
    pub per_mm: f32,
    /// A strip is `2^strip` rows; points are sorted by strip and column.
    pub strip: u32,
    /// The radius is many cells; a strip is one row.
    pub wide: bool,
    origin: [f32; 2],
    /// The points as they come, and the cell of each.
    kept: Coordinates,
    cell: Vec<u32>,
}

/// Cells of a row come in so many at a time.
pub const TOPS: usize = 16;

/// Heights as whole numbers, 1 at the floor and about 65,000 at the greatest; they never descend when the
/// height ascends.
#[derive(Debug, Default, Clone, Copy)]
struct Marks {
    floor: f32,
    per_mm: f32,
}

impl Marks {
    #[inline(always)]
    fn of<S: Simd>(self, s: S, z: S::Eight) -> [u32; 8] {
        let mark = s.mul(s.sub(z, s.splat(self.floor)), s.splat(self.per_mm));
        let mark = s.min(s.max(mark, s.splat(0.0)), s.splat(1e6));
        s.truncate(s.add(mark, s.splat(1.0)))
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
    /// Of least and greatest coordinates in eight lanes.
    #[inline(always)]
    pub fn of<S: Simd>(s: S, least: [S::Eight; 3], greatest: [S::Eight; 3]) -> Self {
        let ([x0, y0, z0], [x1, y1, z1]) = (least, greatest);
        let mut to = [[0.0; 8]; 2];
        s.store(s.least_of_each([x0, y0, z0, z0, z0, z0, z0, z0]), &mut to[0]);
        s.store(s.greatest_of_each([x1, y1, z1, z1, z1, z1, z1, z1]), &mut to[1]);
        let [[x0, y0, z0, ..], [x1, y1, z1, ..]] = to;
        Extent { least: [x0, y0, z0], greatest: [x1, y1, z1] }
    }

    /// Of points, at least one; padding repeats the place of one of them.
    #[inline(always)]
    fn around<S: Simd>(s: S, points: &Coordinates) -> Self {
        let mut least = [s.splat(f32::INFINITY); 3];
        let mut greatest = [s.splat(f32::NEG_INFINITY); 3];
        let n_eights = points.n.div_ceil(8);
        for (axis, values) in [&points.x, &points.y, &points.z].into_iter().enumerate() {
            for values in &eights(values)[..n_eights] {
                least[axis] = s.min(least[axis], s.load(values));
                greatest[axis] = s.max(greatest[axis], s.load(values));
            }
        }
        Extent::of(s, least, greatest)
    }
}

/// Columns and rows of eight places.
pub struct Places {
    columns: [u32; 8],
    rows: [u32; 8],
    stride: u32,
}

impl Places {
    /// Column and row of one of the places.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> [usize; 2] {
        [self.columns[lane] as usize, self.rows[lane] as usize]
    }

    /// Their cells.
    #[inline(always)]
    pub fn indices(&self) -> [u32; 8] {
        let mut cells = self.columns;
        for (cell, row) in cells.iter_mut().zip(self.rows) {
            *cell += row * self.stride;
        }
        cells
    }
}

impl Cells {
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
        let per_mm = (65_000.0 / (kept.greatest[2] - floor)).min(f32::MAX);
        self.marks = Marks { floor, per_mm };
        self.lay_out(&kept, places, radius, size);
        self.sort(s);
        true
    }

    /// Keeps the points above the floor, and copies of the last one up to a multiple of eight.
    #[inline(always)]
    fn keep<S: Simd>(&mut self, s: S, points: &Coordinates, floor: f32) {
        let kept = &mut self.kept;
        kept.resize(points.n + 8);
        let floor = s.splat(floor);
        let mut n = 0;
        let from = eights(&points.x).iter().zip(eights(&points.y)).zip(eights(&points.z));
        for (block, ((x, y), z)) in from.enumerate().take(points.n.div_ceil(8)) {
            let valid = !0u32 >> (24 + (8 * block + 8).saturating_sub(points.n));
            let above = s.greater(s.load(z), floor) & valid;
            if above != 0 {
                for (from, to) in [(x, &mut kept.x), (y, &mut kept.y), (z, &mut kept.z)] {
                    if let Some(to) = to[n..].first_chunk_mut() {
                        s.store(s.compress(s.load(from), above), to);
                    }
                }
                n += above.count_ones() as usize;
            }
        }
        kept.n = n;
        if n > 0 {
            for axis in [&mut kept.x, &mut kept.y, &mut kept.z] {
                let last = axis[n - 1];
                axis[n..n.next_multiple_of(8)].fill(last);
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
        self.stride = self.n[0].next_multiple_of(TOPS);
        let area = (covered[0] * covered[1]).max(size * size);
        let per_row = self.kept.n as f64 / area * size * (2.0 * radius + size);
        self.strip = if radius < WIDE * size {
            (POINTS_PER_RUN / per_row).log2().clamp(0.0, 3.0) as u32
        } else {
            0
        };
        self.wide = radius >= WIDE * size;
    }

    #[inline(always)]
    fn sort<S: Simd>(&mut self, s: S) {
        let n_cells = self.stride * self.n[1];
        let n_strips = ((self.n[1] - 1) >> self.strip) + 1;
        let mut starts = std::mem::take(&mut self.starts);
        starts.clear();
        starts.resize(self.stride * n_strips + 2, 0);
        let mut top = std::mem::take(&mut self.top);
        top.clear();
        top.resize(n_cells + TOPS, 0);
        let mut cell = std::mem::take(&mut self.cell);
        let kept = &self.kept;
        cell.resize(kept.n.next_multiple_of(8), 0);
        let [x, y, z] = [&kept.x, &kept.y, &kept.z].map(|axis| eights(axis));
        for (((x, y), z), to) in x.iter().zip(y).zip(z).zip(cell.as_chunks_mut::<8>().0) {
            let mut places = self.places(s, s.load(x), s.load(y));
            let cells = places.indices();
            places.rows.iter_mut().for_each(|row| *row >>= self.strip);
            *to = places.indices();
            for (&cell, mark) in cells.iter().zip(self.marks.of(s, s.load(z))) {
                let top = &mut top[cell as usize];
                *top = (*top).max(mark as u16);
            }
            for &strip in &*to {
                starts[strip as usize + 2] += 1;
            }
        }
        for padding in cell.drain(kept.n..) {
            starts[padding as usize + 2] -= 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        self.sorted.resize(kept.n + 8);
        let Coordinates { x, y, z, .. } = &mut self.sorted;
        let from = kept.x.iter().zip(&kept.y).zip(&kept.z);
        for (&cell, ((&from_x, &from_y), &from_z)) in cell.iter().zip(from) {
            let next = &mut starts[cell as usize + 1];
            let place = *next as usize;
            *next += 1;
            (x[place], y[place], z[place]) = (from_x, from_y, from_z);
        }
        z[kept.n..].fill(f32::NEG_INFINITY);
        (self.starts, self.top, self.cell) = (starts, top, cell);
    }

    /// Greatest mark of each cell, 0 for none.
    pub fn tops(&self) -> &[u16] {
        &self.top[..self.stride * self.n[1]]
    }

    /// Columns and rows of eight places. Neither descends when its coordinate ascends.
    #[inline(always)]
    pub fn places<S: Simd>(&self, s: S, x: S::Eight, y: S::Eight) -> Places {
        let [columns, rows] = [self.index(s, x, 0), self.index(s, y, 1)];
        Places { columns, rows, stride: self.stride as u32 }
    }

    /// Marks of eight heights, to be compared with those of cells.
    #[inline(always)]
    pub fn marks<S: Simd>(&self, s: S, z: S::Eight) -> [u32; 8] {
        self.marks.of(s, z)
    }

    #[inline(always)]
    fn index<S: Simd>(&self, s: S, along: S::Eight, axis: usize) -> [u32; 8] {
        let cells = s.mul(s.sub(along, s.splat(self.origin[axis])), s.splat(self.per_mm));
        s.truncate(s.min(s.max(cells, s.splat(0.0)), s.splat((self.n[axis] - 1) as f32)))
    }

    /// Places in the order of the points of `strip` from column `first` to `last`.
    #[inline(always)]
    pub fn run(&self, strip: usize, first: usize, last: usize) -> [usize; 2] {
        let before = strip * self.stride;
        [self.starts[before + first] as usize, self.starts[before + last + 1] as usize]
    }

    /// Whether a cell of `row` from column `first` to `last`, or a little beyond, has this mark or a greater one.
    #[inline(always)]
    pub fn reaches(&self, row: usize, first: usize, last: usize, mark: u32) -> bool {
        let mark = mark.min(u32::from(u16::MAX)) as u16;
        let mut reached = false;
        for column in (first..=last).step_by(TOPS) {
            let Some(tops) = self.top[row * self.stride + column..].first_chunk::<TOPS>() else {
                break;
            };
            let mut any = 0;
            for top in tops {
                any |= u16::from(*top >= mark);
            }
            reached |= any != 0;
        }
        reached
    }

    /// x, y and z of eight points from a place on.
    #[inline(always)]
    pub fn eight(&self, place: usize) -> [&[f32; 8]; 3] {
        let Coordinates { x, y, z, .. } = &self.sorted;
        [eight(x, place), eight(y, place), eight(z, place)]
    }
}

#[inline(always)]
fn eight(axis: &[f32], place: usize) -> &[f32; 8] {
    axis[place..].first_chunk().expect("eight can be read from any place of a point on")
}
