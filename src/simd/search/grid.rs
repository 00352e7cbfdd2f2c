//! The obstacles of a direction that are high enough for a step to matter, in cells, and two rasters of
//! heights.

use super::disc::{HalfWidths, Rows, SHARE, greatest_over_disc, may_reach, must_reach};
use crate::simd::cells::{Cells, Extent, Places};
use crate::simd::collide::{Coordinates, StepSquared, squared_distance};
use crate::simd::level::Simd;

/// Least cells along the longer side.
const LEAST_CELLS: f64 = 8.0;
/// Rows of cells to look at for each open query and each obstacle (chosen by `benches/labeler.rs`).
const WORK_PER_POINT: f64 = 4.0;

/// Obstacles in cells, and what the cells say about the greatest height around them.
#[derive(Debug, Default)]
pub struct Grid {
    /// The obstacles.
    pub cells: Cells,
    /// A little more than the radius, mm: by all that the predicate's roundings can add up to.
    pub reach: f32,
    /// Greatest height over the disc that may and that must be within the radius of each cell.
    upper: Vec<f32>,
    lower: Vec<f32>,
    may: HalfWidths,
    must: HalfWidths,
    rows: Rows,
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
        let Grid { cells, upper, lower, may, must, rows, .. } = self;
        if !cells.fill(s, obstacles, (queries, radius), size) {
            return false;
        }
        self.reach = ((1.0 + SHARE) * radius) as f32;
        let radius = radius * f64::from(cells.per_mm);
        may_reach(radius, may, cells.n);
        must_reach(radius, must, cells.n);
        greatest_over_disc(s, (&cells.top, cells.stride), may, rows, upper);
        greatest_over_disc(s, (&cells.top, cells.stride), must, rows, lower);
        true
    }

    /// Within the radius of every one of these places is an obstacle so high, and none is higher than that.
    #[inline(always)]
    pub fn bounds<S: Simd>(&self, s: S, places: &Places) -> [S::Eight; 2] {
        let cells = places.indices();
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
    /// `first` to `last` (column, row)? Its axis is in cell `middle`, and the lower bound there does not
    /// reach its lower end. And how many obstacles were tested.
    #[inline(always)]
    pub fn strikes<S: Simd>(
        &self,
        s: S,
        [x, y, above, radius_squared]: [f32; 4],
        [first, middle, last]: [[usize; 2]; 3],
    ) -> (bool, u64) {
        let (x, y) = (s.splat(x), s.splat(y));
        let (above, within) = (s.splat(above), s.splat(radius_squared));
        let few = last[1] - first[1] < FEW_ROWS;
        let (mut hits, mut n_tested) = (0, 0);
        for row in first[1]..=last[1] {
            let [start, end] = self.cells.run(row, first[0], last[0]);
            // What must be within the radius is not high enough, as the lower bound says.
            let [gap, resume] = match self.must.get(row.abs_diff(middle[1])) {
                Some(&half) => self.cells.run(
                    row,
                    middle[0].saturating_sub(half),
                    (middle[0] + half).min(self.cells.n[0] - 1),
                ),
                None => [end, end],
            };
            for [start, end] in [[start, gap], [resume, end]] {
                // Obstacles of the next cells do no harm.
                for place in (start..end).step_by(8) {
                    let [px, py, pz] = self.cells.eight(place);
                    let squared = squared_distance(s, x, y, px, py);
                    hits |= s.greater_and_at_most(s.load(pz), above, squared, within);
                    n_tested += 8;
                }
            }
            if !few && hits != 0 {
                break;
            }
        }
        (hits != 0, n_tested)
    }
}

/// Up to so many rows are looked through without asking in between whether it is still necessary.
const FEW_ROWS: usize = 4;

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
            if !grid.fill(s, (obstacles, floor), &step, &extent, queries.n as u64) {
                return vec![(f32::NEG_INFINITY, f32::NEG_INFINITY, false); queries.n];
            }
            let ask = |i| {
                let [x, y, z] = queries.get(i);
                let (lane_x, lane_y, reach) = (s.splat(x), s.splat(y), s.splat(grid.reach));
                let mut bounds = [[0.0; 8]; 2];
                let places = grid.cells.places(s, lane_x, lane_y);
                for (lanes, to) in grid.bounds(s, &places).into_iter().zip(&mut bounds) {
                    s.store(lanes, to);
                }
                let first = grid.cells.places(s, s.sub(lane_x, reach), s.sub(lane_y, reach)).get(3);
                let last = grid.cells.places(s, s.add(lane_x, reach), s.add(lane_y, reach)).get(3);
                let cylinder = [x, y, z + step.height, step.radius_squared];
                let struck = grid.strikes(s, cylinder, [first, places.get(3), last]).0;
                (bounds[0][3], bounds[1][3], struck || bounds[0][3] > cylinder[2])
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
