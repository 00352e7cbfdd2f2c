//! The obstacles of a direction that are high enough for a step to matter, in cells, and two rasters of
//! heights.

use super::disc::{HalfWidths, Margins, SHARE, greatest_over_disc, may_reach, must_reach};
use crate::simd::cells::{Cells, Extent, Places};
use crate::simd::collide::{Coordinates, StepSquared, squared_distance};
use crate::simd::level::Simd;

/// Least cells along the longer side.
const LEAST_CELLS: f64 = 8.0;
/// Rows of cells to look at for each open query and each obstacle (chosen by `benches/labeler.rs`).
const WORK_PER_POINT: f64 = 8.0;

/// Obstacles in cells, and what the cells say about the greatest height around them.
#[derive(Debug, Default)]
pub struct Grid {
    /// The obstacles.
    pub cells: Cells,
    /// A little more than the radius, mm: by all that the predicate's roundings can add up to.
    pub reach: f32,
    /// Greatest mark over the disc that may and that must be within the radius of each cell.
    upper: Vec<u16>,
    lower: Vec<u16>,
    /// Rows of the disc that must be within the radius.
    must: HalfWidths,
    /// Columns of a disc.
    columns: HalfWidths,
    margins: Margins,
    /// Obstacles near some queries.
    near: Coordinates,
}

impl Grid {
    /// Fills the grid with the obstacles above `floor`, for queries within `queries`. False if there are none.
    #[inline(always)]
    pub fn fill<S: Simd>(
        &mut self,
        s: S,
        obstacles: (&Coordinates, f32),
        step: &StepSquared,
        queries: &Extent,
        n_queries: u64,
    ) -> bool {
        let radius = f64::from(step.radius_squared).sqrt();
        let size = |covered, n: usize| size(covered, radius, n as f64 + n_queries as f64);
        let Grid { cells, upper, lower, must, columns, margins, .. } = self;
        if !cells.fill(s, obstacles, (queries, radius), size) {
            return false;
        }
        self.reach = ((1.0 + SHARE) * radius) as f32;
        let radius = radius * f64::from(cells.per_mm);
        let [n_columns, n_rows] = cells.n;
        let tops = (cells.tops(), cells.stride);
        may_reach(radius, columns, [n_rows, n_columns]);
        greatest_over_disc(tops, columns, margins, upper);
        must_reach(radius, columns, [n_rows, n_columns]);
        greatest_over_disc(tops, columns, margins, lower);
        must_reach(radius, must, cells.n);
        true
    }

    /// What the rasters say about cylinders with their axes at these places and their lower ends at these heights.
    #[inline(always)]
    pub fn bounds<S: Simd>(&self, s: S, places: &Places, heights: S::Eight) -> Bounds {
        let cells = places.indices();
        let marks = self.cells.marks(s, heights);
        let mut bounds = Bounds::default();
        let mut upper = [0; 8];
        for (upper, &cell) in upper.iter_mut().zip(&cells) {
            *upper = u32::from(self.upper[cell as usize]);
        }
        for lane in 0..8 {
            bounds.may |= u32::from(upper[lane] >= marks[lane]) << lane;
        }
        if bounds.may != 0 && !self.must.is_empty() {
            let mut lower = [0; 8];
            for (lower, &cell) in lower.iter_mut().zip(&cells) {
                *lower = u32::from(self.lower[cell as usize]);
            }
            for lane in 0..8 {
                bounds.hit |= u32::from(lower[lane] > marks[lane]) << lane;
                bounds.clear |= u32::from(lower[lane] < marks[lane]) << lane;
            }
        }
        bounds
    }

    /// Is there an obstacle in the cylinder (x, y, lower end, squared radius), which lies within the cells from
    /// `first` to `last` (column, row)? And how many obstacles were tested.
    #[inline(always)]
    pub fn strikes<S: Simd>(
        &self,
        s: S,
        [x, y, above, radius_squared]: [f32; 4],
        [first, last]: [[usize; 2]; 2],
    ) -> (bool, u64) {
        let cylinder = Cylinder {
            x: s.splat(x),
            y: s.splat(y),
            above: s.splat(above),
            within: s.splat(radius_squared),
        };
        let (mut hits, mut n_tested) = (0, 0);
        for strip in first[1] >> self.cells.strip..=last[1] >> self.cells.strip {
            let [start, end] = self.cells.run(strip, first[0], last[0]);
            hits |= self.hits(s, &cylinder, start, end);
            n_tested += end - start;
        }
        (hits != 0, n_tested as u64)
    }

    /// Which of the cylinders named by `lanes`, at least one, hold an obstacle? None of the obstacles that must
    /// be within the radius does. And how many obstacles were tested.
    #[inline(always)]
    pub fn ring_strikes<S: Simd>(
        &mut self,
        s: S,
        cylinders: &Cylinder<S>,
        lanes: u32,
    ) -> (u32, u64) {
        let Grid { cells, must, near, reach, .. } = self;
        let around = Around::new(s, cylinders, lanes);
        let [[x0, y0], [x1, y1]] = [around.least, around.greatest];
        let corners_x = s.load(&[x0 - *reach, x1 + *reach, x0, x1, x0, x0, x0, x0]);
        let corners_y = s.load(&[y0 - *reach, y1 + *reach, y0, y1, y0, y0, y0, y0]);
        let corners = cells.places(s, corners_x, corners_y);
        let [first, last, least, greatest] = [0, 1, 2, 3].map(|corner| corners.get(corner));
        let (x0, x1, y0, y1) = (s.splat(x0), s.splat(x1), s.splat(y0), s.splat(y1));
        let (floor, reach_squared) = (s.splat(around.floor), s.splat(*reach * *reach));
        let mark = cells.marks(s, floor)[0];
        let mut n = 0;
        for row in first[1]..=last[1] {
            let farthest = row.abs_diff(least[1]).max(row.abs_diff(greatest[1]));
            let (gap, resume) = match must.get(farthest) {
                Some(&half) if least[0] + half > greatest[0].saturating_sub(half) => {
                    (greatest[0].saturating_sub(half), least[0] + half)
                }
                _ => (last[0], last[0] + 1),
            };
            for [from, to] in [[first[0], gap], [resume, last[0]]] {
                if from > to || !cells.reaches(row, from, to, mark) {
                    continue;
                }
                let [start, end] = cells.run(row, from, to);
                // Obstacles of the next cells do no harm.
                for place in (start..end).step_by(8) {
                    let [x, y, z] = cells.eight(place);
                    let [x, y, z] = [s.load(x), s.load(y), s.load(z)];
                    let dx = s.max(s.max(s.sub(x0, x), s.sub(x, x1)), s.splat(0.0));
                    let dy = s.max(s.max(s.sub(y0, y), s.sub(y, y1)), s.splat(0.0));
                    let squared = s.add(s.mul(dx, dx), s.mul(dy, dy));
                    let mask = s.greater_and_at_most(z, floor, squared, reach_squared);
                    if mask == 0 {
                        continue;
                    }
                    if n + 8 > near.x.len() {
                        near.resize(2 * n + 64);
                    }
                    for (lanes, to) in [(x, &mut near.x), (y, &mut near.y), (z, &mut near.z)] {
                        if let Some(to) = to[n..].first_chunk_mut() {
                            s.store(s.compress(lanes, mask), to);
                        }
                    }
                    n += mask.count_ones() as usize;
                }
            }
        }
        let mut hits = 0;
        for ((&x, &y), &z) in near.x[..n].iter().zip(&near.y[..n]).zip(&near.z[..n]) {
            let (dx, dy) = (s.sub(s.splat(x), cylinders.x), s.sub(s.splat(y), cylinders.y));
            let squared = s.add(s.mul(dx, dx), s.mul(dy, dy));
            hits |= s.greater_and_at_most(s.splat(z), cylinders.above, squared, cylinders.within);
        }
        (hits & lanes, n as u64 * u64::from(lanes.count_ones()))
    }

    /// Whether some obstacle from one place to another is in the cylinder; those next to them do no harm.
    #[inline(always)]
    fn hits<S: Simd>(&self, s: S, cylinder: &Cylinder<S>, start: usize, end: usize) -> u32 {
        let mut hits = 0;
        for place in (start..end).step_by(8) {
            let [x, y, z] = self.cells.eight(place);
            let squared = squared_distance(s, cylinder.x, cylinder.y, x, y);
            hits |= s.greater_and_at_most(s.load(z), cylinder.above, squared, cylinder.within);
        }
        hits
    }
}

/// What rasters say about eight cylinders, a bit each.
#[derive(Debug, Default, Clone, Copy)]
pub struct Bounds {
    /// Some obstacle is in it.
    pub hit: u32,
    /// Perhaps one is.
    pub may: u32,
    /// None of the obstacles that must be within its radius is so high.
    pub clear: u32,
}

/// Eight cylinders, open above.
pub struct Cylinder<S: Simd> {
    pub x: S::Eight,
    pub y: S::Eight,
    /// Lower end.
    pub above: S::Eight,
    /// Squared radius.
    pub within: S::Eight,
}

/// Box around the axes of some cylinders.
struct Around {
    least: [f32; 2],
    greatest: [f32; 2],
    /// The lowest end.
    floor: f32,
}

impl Around {
    #[inline(always)]
    fn new<S: Simd>(s: S, cylinders: &Cylinder<S>, lanes: u32) -> Self {
        let (zero, all) = (s.splat(0.0), s.splat(f32::INFINITY));
        let x = s.only(cylinders.x, lanes, all);
        let y = s.only(cylinders.y, lanes, all);
        let z = s.only(cylinders.above, lanes, all);
        let minus_x = s.only(s.sub(zero, cylinders.x), lanes, all);
        let minus_y = s.only(s.sub(zero, cylinders.y), lanes, all);
        let mut least = [0.0; 8];
        s.store(s.least_of_each([x, y, z, minus_x, minus_y, z, z, z]), &mut least);
        let [x, y, floor, minus_x, minus_y, ..] = least;
        Around { least: [x, y], greatest: [-minus_x, -minus_y], floor }
    }
}

/// Size of the cells, mm. Rasters of cells of this size cost `width·depth/size²·(2·radius/size + 3)`.
fn size([width, depth]: [f64; 2], radius: f64, n_points: f64) -> f64 {
    let area = width * depth / (WORK_PER_POINT * n_points);
    let size = (3.0 * area).sqrt().max((2.0 * area * radius).cbrt());
    let size = size.min(width.max(depth) / LEAST_CELLS);
    // A whole number of cells a radius, and a little more: no cell is reached for rounding alone.
    let per_radius = (radius / size).floor();
    if (1.0..f64::INFINITY).contains(&per_radius) { 1.004 * radius / per_radius } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::simd::{Kernel, Level};

    /// Per query: whether the rasters call it hit, and free, and whether the cells around hold a collision, asked
    /// alone and together with its neighbours.
    struct Ask<'a>(&'a Coordinates, f32, StepSquared, &'a Coordinates);

    impl Kernel for Ask<'_> {
        type Output = Vec<(bool, bool, [bool; 2])>;

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
            if !grid.fill(s, (obstacles, floor), &step, &extent, queries.n as u64) {
                return vec![(false, true, [false; 2]); queries.n];
            }
            let mut answers = vec![];
            for first in (0..queries.n).step_by(8) {
                let axis = |axis: &[f32]| s.load(axis[first..].first_chunk().unwrap());
                let (x, y, z) = (axis(&queries.x), axis(&queries.y), axis(&queries.z));
                let (above, reach) = (s.add(z, s.splat(step.height)), s.splat(grid.reach));
                let bounds = grid.bounds(s, &grid.cells.places(s, x, y), above);
                let low = grid.cells.places(s, s.sub(x, reach), s.sub(y, reach));
                let high = grid.cells.places(s, s.add(x, reach), s.add(y, reach));
                let within = s.splat(step.radius_squared);
                let ring = if grid.cells.wide { bounds.clear } else { 0 };
                let cylinders = Cylinder { x, y, above, within };
                let together = if ring == 0 { 0 } else { grid.ring_strikes(s, &cylinders, ring).0 };
                for lane in 0..8.min(queries.n - first) {
                    let [x, y, z] = queries.get(first + lane);
                    let cylinder = [x, y, z + step.height, step.radius_squared];
                    let alone = grid.strikes(s, cylinder, [low.get(lane), high.get(lane)]).0;
                    let bit = |bits: u32| bits >> lane & 1 == 1;
                    let together = if bit(ring) { bit(together) } else { alone };
                    answers.push((bit(bounds.hit), !bit(bounds.may), [alone, together]));
                }
            }
            answers
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
        for (case, radius) in [1.0f32, 5.0, 0.25, 40.0, 100.0, 1e-4, 1e4].into_iter().enumerate() {
            for (span, offset) in spans.into_iter().zip([0.0, 900.0, 1e6, -3.0]) {
                let obstacles = lattice(300, span, offset, &mut stream);
                let around = span.map(|length| length * 3.0 + 2.0 * f64::from(radius).min(100.0));
                let queries = lattice(200, around, offset, &mut stream);
                let step = StepSquared { height: -(case as f32), radius_squared: radius * radius };
                let floor =
                    (0..200).map(|i| queries.z[i]).fold(f32::INFINITY, f32::min) + step.height;
                for &level in Level::available() {
                    let answers = level.run(Ask(&obstacles, floor, step, &queries));
                    for (i, (hit, free, struck)) in answers.into_iter().enumerate() {
                        let [x, y, z] = queries.get(i);
                        let within = |p: &[f32; 3]| {
                            let (dx, dy) = (p[0] - x, p[1] - y);
                            dx * dx + dy * dy <= radius * radius && p[2] > floor
                        };
                        let near = (0..300).map(|j| obstacles.get(j)).filter(within);
                        let top = near.map(|p| p[2]).fold(f32::NEG_INFINITY, f32::max);
                        let collides = top > z + step.height;
                        assert!(!(hit && !collides || free && collides), "{radius} {span:?}");
                        assert_eq!(struck, [collides; 2], "{radius} {span:?}");
                    }
                }
            }
        }
    }
}
