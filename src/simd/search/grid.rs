//! The obstacles of a direction that are high enough for a step to matter, sorted into cells.

use super::Extent;
use super::disc::{HalfWidths, Rows, SHARE, greatest_over_disc, may_reach, must_reach};
use crate::simd::collide::{Coordinates, StepSquared, eights, squared_distance};
use crate::simd::level::Simd;

/// Most cells along the longer side, give or take the border.
pub const MOST_CELLS: f64 = 1000.0;
/// Least cells along the longer side.
const LEAST_CELLS: f64 = 8.0;
/// Rows of cells to look at for each open query and each obstacle (chosen by `benches/labeler.rs`).
const WORK_PER_POINT: f64 = 4.0;

/// Obstacles in cells, and two rasters of heights.
#[derive(Debug, Default)]
pub struct Grid {
    /// Obstacles as they come.
    kept: Coordinates,
    /// Cell of each of them.
    cell: Vec<u32>,
    /// Obstacles by cell, with [`SLACK`].
    sorted: Coordinates,
    /// First obstacle of each cell, the end of the last one, and one more.
    starts: Vec<u32>,
    /// Greatest height of each cell, and over the disc that may and that must be within the radius of it.
    top: Vec<f32>,
    upper: Vec<f32>,
    lower: Vec<f32>,
    may: HalfWidths,
    must: HalfWidths,
    rows: Rows,
    /// A little more than the radius, mm: by all that the predicate's roundings can add up to.
    pub reach: f32,
    origin: [f32; 2],
    per_mm: f32,
    n_columns: usize,
    n_rows: usize,
    /// Cells from row to row, a multiple of eight.
    stride: usize,
}

/// Obstacles that must be readable past the last one.
const SLACK: usize = 8;

/// Columns and rows of eight places.
pub struct Cells {
    columns: [u32; 8],
    rows: [u32; 8],
    stride: u32,
}

impl Cells {
    /// Column and row of one of the places.
    #[inline(always)]
    pub fn place(&self, lane: usize) -> [usize; 2] {
        [self.columns[lane] as usize, self.rows[lane] as usize]
    }

    #[inline(always)]
    fn indices(&self) -> [u32; 8] {
        std::array::from_fn(|lane| self.rows[lane] * self.stride + self.columns[lane])
    }
}

impl Grid {
    /// Fills the grid with the obstacles above `floor`, for queries within `queries`. False if there are none.
    #[inline(always)]
    pub fn fill<S: Simd>(
        &mut self,
        s: S,
        obstacles: &Coordinates,
        floor: f32,
        step: &StepSquared,
        queries: &Extent,
        n_queries: u64,
    ) -> bool {
        self.keep(s, obstacles, floor);
        let n = self.kept.n;
        if n == 0 {
            return false;
        }
        let radius = f64::from(step.radius_squared).sqrt();
        let kept = self.extent(s);
        self.lay_out(&kept, queries, radius, n as f64 + n_queries as f64);
        self.sort(s);
        self.reach = ((1.0 + SHARE) * radius) as f32;
        let radius = radius * f64::from(self.per_mm);
        let sides = [self.n_columns, self.n_rows];
        may_reach(radius, &mut self.may, sides);
        must_reach(radius, &mut self.must, sides);
        let Grid { top, stride, may, must, upper, lower, rows, .. } = self;
        greatest_over_disc(s, (top, *stride), may, rows, upper);
        greatest_over_disc(s, (top, *stride), must, rows, lower);
        true
    }

    #[inline(always)]
    fn keep<S: Simd>(&mut self, s: S, obstacles: &Coordinates, floor: f32) {
        let kept = &mut self.kept;
        kept.resize(obstacles.n + SLACK);
        let floor = s.splat(floor);
        let mut n = 0;
        let from = eights(&obstacles.x).iter().zip(eights(&obstacles.y)).zip(eights(&obstacles.z));
        for ((x, y), z) in from {
            let above = s.greater(s.load(z), floor);
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

    #[inline(always)]
    fn extent<S: Simd>(&self, s: S) -> Extent {
        let mut least = [s.splat(f32::INFINITY); 3];
        let mut greatest = [s.splat(f32::NEG_INFINITY); 3];
        let n_eights = self.kept.n.div_ceil(8);
        for (axis, values) in [&self.kept.x, &self.kept.y].into_iter().enumerate() {
            for values in &eights(values)[..n_eights] {
                least[axis] = s.min(least[axis], s.load(values));
                greatest[axis] = s.max(greatest[axis], s.load(values));
            }
        }
        Extent::of(s, least, greatest)
    }

    /// Chooses origin and size of the cells. The grid covers the obstacles and the queries near them; a query
    /// beyond counts for a cell of the border, which then lies farther than the radius from all obstacles.
    fn lay_out(&mut self, kept: &Extent, queries: &Extent, radius: f64, n_points: f64) {
        let (mut least, mut greatest, mut beyond) = ([0.0; 2], [0.0; 2], [[false; 2]; 2]);
        for axis in 0..2 {
            let [lo, hi] = [kept.least[axis], kept.greatest[axis]].map(f64::from);
            let before = lo - f64::from(queries.least[axis]);
            let after = f64::from(queries.greatest[axis]) - hi;
            least[axis] = lo - before.clamp(0.0, radius);
            greatest[axis] = hi + after.clamp(0.0, radius);
            beyond[axis] = [before > radius, after > radius];
        }
        let [width, depth] = [greatest[0] - least[0], greatest[1] - least[1]];
        let longest = width.max(depth);
        // A raster of cells of this size costs `width·depth/size²·(2·radius/size + 3)`.
        let area = width * depth / (WORK_PER_POINT * n_points);
        let size = (3.0 * area).sqrt().max((2.0 * area * radius).cbrt());
        let size = size.min(longest / LEAST_CELLS).max(longest / MOST_CELLS);
        // A whole number of cells a radius, and a little more: no cell is reached for rounding alone.
        let per_radius = (radius / size).floor();
        let size = if per_radius >= 1.0 { 1.004 * radius / per_radius } else { size };
        let farthest = least.into_iter().chain(greatest).fold(0.0, |a: f64, b| a.max(b.abs()));
        let size = size.max(1e-5 * farthest).max(1e-9);
        self.per_mm = (1.0 / size) as f32;
        for axis in 0..2 {
            let [before, after] = beyond[axis].map(|beyond| if beyond { 3.0 * size } else { 0.0 });
            self.origin[axis] = (least[axis] - before) as f32;
            let last = (greatest[axis] + after) as f32;
            let n = ((last - self.origin[axis]) * self.per_mm) as usize + 1;
            *[&mut self.n_columns, &mut self.n_rows][axis] = n;
        }
        self.stride = self.n_columns.next_multiple_of(8);
    }

    #[inline(always)]
    fn sort<S: Simd>(&mut self, s: S) {
        let n = self.kept.n;
        let n_cells = self.stride * self.n_rows;
        let mut starts = std::mem::take(&mut self.starts);
        starts.clear();
        starts.resize(n_cells + 2, 0);
        let mut top = std::mem::take(&mut self.top);
        top.clear();
        top.resize(n_cells, f32::NEG_INFINITY);
        let mut cell = std::mem::take(&mut self.cell);
        cell.clear();
        cell.resize(n.next_multiple_of(8), 0);
        let kept = &self.kept;
        let [x, y, z] = [&kept.x, &kept.y, &kept.z].map(|axis| eights(axis));
        for (((x, y), z), to) in x.iter().zip(y).zip(z).zip(cell.as_chunks_mut::<8>().0) {
            *to = self.cells(s, s.load(x), s.load(y)).indices();
            for (&cell, &z) in to.iter().zip(z) {
                starts[cell as usize + 2] += 1;
                let top = &mut top[cell as usize];
                *top = if z > *top { z } else { *top };
            }
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        self.sorted.resize(n.next_multiple_of(8) + SLACK);
        let Coordinates { x, y, z, .. } = &mut self.sorted;
        let from = kept.x.iter().zip(&kept.y).zip(&kept.z);
        for (&cell, ((&from_x, &from_y), &from_z)) in cell.iter().zip(from) {
            let next = &mut starts[cell as usize + 1];
            let place = *next as usize;
            *next += 1;
            (x[place], y[place], z[place]) = (from_x, from_y, from_z);
        }
        z[cell.len()..].fill(f32::NEG_INFINITY);
        (self.starts, self.top, self.cell) = (starts, top, cell);
    }

    /// Columns and rows of eight places; of the nearest cell for those outside.
    #[inline(always)]
    pub fn cells<S: Simd>(&self, s: S, x: S::Eight, y: S::Eight) -> Cells {
        let index = |v, origin: f32, n: usize| {
            let cells = s.mul(s.sub(v, s.splat(origin)), s.splat(self.per_mm));
            s.truncate(s.min(s.max(cells, s.splat(0.0)), s.splat((n - 1) as f32)))
        };
        Cells {
            columns: index(x, self.origin[0], self.n_columns),
            rows: index(y, self.origin[1], self.n_rows),
            stride: self.stride as u32,
        }
    }

    /// Within the radius of every place of these cells is an obstacle so high, and none is higher than that.
    #[inline(always)]
    pub fn bounds<S: Simd>(&self, s: S, cells: &Cells) -> [S::Eight; 2] {
        let cells = cells.indices();
        let (lower, upper) = (&self.lower[..], &self.upper[..]);
        let mut bounds = [[f32::NEG_INFINITY; 8]; 2];
        for (&cell, bound) in cells.iter().zip(&mut bounds[1]) {
            *bound = upper[cell as usize];
        }
        if !self.must.is_empty() {
            for (&cell, bound) in cells.iter().zip(&mut bounds[0]) {
                *bound = lower[cell as usize];
            }
        }
        [s.load(&bounds[0]), s.load(&bounds[1])]
    }

    /// Is there an obstacle in the cylinder (x, y, lower end, squared radius), which lies within the cells from
    /// `first` to `last` (column, row)? And how many were tested.
    #[inline(always)]
    pub fn strikes<S: Simd>(
        &self,
        s: S,
        [x, y, above, radius_squared]: [f32; 4],
        first: [usize; 2],
        last: [usize; 2],
    ) -> (bool, u64) {
        let Coordinates { x: xs, y: ys, z: zs, .. } = &self.sorted;
        let (x, y) = (s.splat(x), s.splat(y));
        let (above, within) = (s.splat(above), s.splat(radius_squared));
        let few = last[1] - first[1] < FEW_ROWS;
        let (mut hits, mut n_tested) = (0, 0);
        for row in first[1]..=last[1] {
            let starts = &self.starts[row * self.stride..];
            let (start, end) = (starts[first[0]] as usize, starts[last[0] + 1] as usize);
            let mut place = start;
            loop {
                let squared = squared_distance(s, x, y, eight(xs, place), eight(ys, place));
                hits |= s.greater_and_at_most(s.load(eight(zs, place)), above, squared, within);
                place += 8;
                if place >= end {
                    break;
                }
            }
            n_tested += (place - start) as u64;
            if !few && hits != 0 {
                break;
            }
        }
        (hits != 0, n_tested)
    }
}

/// Up to so many rows are looked through without asking in between whether it is still necessary.
const FEW_ROWS: usize = 4;

#[inline(always)]
fn eight(axis: &[f32], start: usize) -> &[f32; 8] {
    axis[start..].first_chunk().expect("there is room past the last obstacle")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::simd::{Kernel, Level};

    /// Per query: the bounds, and whether the cells around hold a collision.
    struct Ask<'a>(&'a Coordinates, f32, StepSquared, &'a Coordinates);

    impl Kernel for Ask<'_> {
        type Output = Vec<(f32, f32, bool)>;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let Ask(obstacles, floor, step, queries) = self;
            let (mut least, mut greatest) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for query in (0..queries.n).map(|i| queries.get(i)) {
                for axis in 0..3 {
                    least[axis] = least[axis].min(query[axis]);
                    greatest[axis] = greatest[axis].max(query[axis]);
                }
            }
            let mut grid = Grid::default();
            let extent = Extent { least, greatest };
            if !grid.fill(s, obstacles, floor, &step, &extent, queries.n as u64) {
                return vec![(f32::NEG_INFINITY, f32::NEG_INFINITY, false); queries.n];
            }
            let ask = |i| {
                let [x, y, z] = queries.get(i);
                let (lane_x, lane_y, reach) = (s.splat(x), s.splat(y), s.splat(grid.reach));
                let mut bounds = [[0.0; 8]; 2];
                let cells = grid.cells(s, lane_x, lane_y);
                for (lanes, to) in grid.bounds(s, &cells).into_iter().zip(&mut bounds) {
                    s.store(lanes, to);
                }
                let first = grid.cells(s, s.sub(lane_x, reach), s.sub(lane_y, reach)).place(3);
                let last = grid.cells(s, s.add(lane_x, reach), s.add(lane_y, reach)).place(3);
                let cylinder = [x, y, z + step.height, step.radius_squared];
                (bounds[0][3], bounds[1][3], grid.strikes(s, cylinder, first, last).0)
            };
            (0..queries.n).map(ask).collect()
        }
    }

    /// Points on a lattice, so that many lie on the edges of cells and of the disc.
    fn lattice(n: usize, [x, y, z]: [f64; 3], at: f32, stream: &mut Stream) -> Coordinates {
        let mut points = Coordinates::zeros(n);
        for i in 0..n {
            let mut along =
                |length: f64| at + 0.25 * (stream.range(-length, length) * 4.0).round() as f32;
            points.set(i, [along(x), along(y), along(z)]);
        }
        points.pad_z(f32::NEG_INFINITY);
        points
    }

    #[test]
    fn rasters_bound_the_greatest_height_and_cells_hold_every_obstacle_within_reach() {
        let mut stream = Stream::new(11, 0, 0, Purpose::Probe);
        let spans = [[30.0, 20.0, 5.0], [40.0, 0.0, 5.0], [0.0, 0.0, 0.0], [2.0, 50.0, 0.0]];
        for (case, radius) in [1.0f32, 5.0, 0.25, 40.0, 1e-4, 1e4].into_iter().enumerate() {
            for (span, offset) in spans.into_iter().zip([0.0, 900.0, 1e6, -3.0]) {
                let obstacles = lattice(300, span, offset, &mut stream);
                let around = span.map(|length| length * 3.0 + 2.0 * f64::from(radius).min(50.0));
                let queries = lattice(200, around, offset, &mut stream);
                let step = StepSquared { height: -(case as f32), radius_squared: radius * radius };
                let floor =
                    (0..200).map(|i| queries.z[i]).fold(f32::INFINITY, f32::min) + step.height;
                for &level in Level::available() {
                    let answers = level.run(Ask(&obstacles, floor, step, &queries));
                    for (i, (lower, upper, struck)) in answers.into_iter().enumerate() {
                        let [x, y, z] = queries.get(i);
                        let within = |p: &[f32; 3]| {
                            let (dx, dy) = (p[0] - x, p[1] - y);
                            dx * dx + dy * dy <= radius * radius && p[2] > floor
                        };
                        let near = (0..300).map(|j| obstacles.get(j)).filter(within);
                        let top = near.map(|p| p[2]).fold(f32::NEG_INFINITY, f32::max);
                        assert!(
                            lower <= top && top <= upper,
                            "{radius} {span:?}: {lower} {top} {upper}"
                        );
                        assert_eq!(struck, top > z + step.height, "{radius} {span:?}");
                    }
                }
            }
        }
    }
}
