//! A grid of the obstacles that are high enough for a step to matter, with an upper and a lower raster of their
//! heights.

use super::cell_bins::{CellBins, Extent};
use super::disc::{DilationScratch, HalfWidths, SHARE, dilate_disc, inner_disc, outer_disc};
use crate::access::points::kernels::{GROUP, set_bits, squared_distance};
use crate::access::predicate::StepSquared;
use crate::simd::{Float32, Mask, Simd, Unsigned, Unsigned32, Vector};
use crate::spatial::Coordinates;

/// Least cells along the longer side.
const LEAST_CELLS: f64 = 8.0;
/// Rows of cells to look at for each open query and each obstacle (chosen by `benches/labeler.rs`).
const WORK_PER_POINT: f64 = 8.0;

/// Obstacles in cells, and what the cells say about the greatest height around them.
#[derive(Debug, Default)]
pub struct ObstacleGrid {
    /// The obstacles.
    bins: CellBins,
    /// A little more than the radius, mm: by all that the predicate's roundings can add up to.
    reach: f32,
    /// Greatest quantized height over the outer and over the inner disc around each cell.
    upper: Vec<u16>,
    lower: Vec<u16>,
    /// Rows of the inner disc.
    inner: HalfWidths,
    /// Columns of a disc.
    columns: HalfWidths,
    dilation: DilationScratch,
    /// Obstacles near some queries.
    near: Coordinates,
}

/// Cylinders of one radius, open above, around as many axes.
#[derive(Debug, Clone, Copy)]
pub struct Cylinders<'a> {
    /// Places of the axes.
    pub x: &'a [f32; GROUP],
    /// Places of the axes.
    pub y: &'a [f32; GROUP],
    /// Lower ends.
    pub above: &'a [f32; GROUP],
    /// Squared radius.
    pub within: f32,
}

/// Answers for a group of cylinders, a bit each.
#[derive(Debug, Default, Clone, Copy)]
pub struct Answers {
    /// Some obstacle is in it.
    pub hit: u32,
    /// Obstacles were tested for it.
    pub tested: u32,
    /// How many, for all of them.
    pub n_tested: u64,
}

/// What rasters say about a group of cylinders, a bit each.
#[derive(Debug, Default, Clone, Copy)]
struct Bounds {
    /// Some obstacle is in it.
    hit: u32,
    /// Perhaps one is.
    may: u32,
    /// None of the obstacles in the inner disc is so high.
    clear: u32,
}

impl ObstacleGrid {
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
        let ObstacleGrid { bins, upper, lower, inner, columns, dilation, .. } = self;
        if !bins.fill(s, obstacles, (queries, radius), size) {
            return false;
        }
        self.reach = ((1.0 + SHARE) * radius) as f32;
        let radius = radius * f64::from(bins.per_mm);
        let [n_columns, n_rows] = bins.n;
        let tops = (bins.tops(), bins.stride);
        outer_disc(radius, columns, [n_rows, n_columns]);
        dilate_disc(s, tops, columns, dilation, upper);
        inner_disc(radius, columns, [n_rows, n_columns]);
        dilate_disc(s, tops, columns, dilation, lower);
        inner_disc(radius, inner, bins.n);
        true
    }

    /// Answers for those of the cylinders whose bit is set in `wanted`.
    #[inline(always)]
    pub fn answer<S: Simd>(&mut self, s: S, cylinders: &Cylinders, wanted: u32) -> Answers {
        let bounds = self.bounds(s, cylinders, wanted);
        let mut answers = Answers { hit: bounds.hit & wanted, ..Answers::default() };
        answers.tested = bounds.may & wanted & !answers.hit;
        let in_annulus = if self.bins.wide { answers.tested & bounds.clear } else { 0 };
        if in_annulus != 0 {
            self.test_annulus(s, cylinders, in_annulus, &mut answers);
        }
        if answers.tested != in_annulus {
            self.test_each(s, cylinders, answers.tested & !in_annulus, &mut answers);
        }
        answers
    }

    /// What the rasters say about the cylinders of all vectors of which some are wanted.
    #[inline(always)]
    fn bounds<S: Simd>(&self, s: S, cylinders: &Cylinders, wanted: u32) -> Bounds {
        let mut bounds = Bounds::default();
        for at in (0..GROUP).step_by(S::LANES) {
            if (wanted >> at) << (32 - S::LANES) == 0 {
                continue;
            }
            let columns = self.bins.columns(s, S::F32::load(s, &cylinders.x[at..]));
            let rows = self.bins.rows(s, S::F32::load(s, &cylinders.y[at..]));
            let heights = self.bins.quantize(s, S::F32::load(s, &cylinders.above[at..]));
            let mut cells = [0; GROUP];
            self.bins.cells(s, columns, rows).store(&mut cells);
            let upper = look_up(s, &self.upper, &cells);
            let may = upper.ge(heights).bits();
            bounds.may |= may << at;
            if may != 0 && !self.inner.is_empty() {
                let lower = look_up(s, &self.lower, &cells);
                let lanes = !0 >> (32 - S::LANES);
                bounds.hit |= (!heights.ge(lower).bits() & lanes) << at;
                bounds.clear |= (!lower.ge(heights).bits() & lanes) << at;
            }
        }
        bounds
    }

    /// Tests the cylinders of `lanes` one by one, each with all obstacles of the cells around its axis.
    #[inline(always)]
    fn test_each<S: Simd>(&self, s: S, cylinders: &Cylinders, lanes: u32, answers: &mut Answers) {
        let reach = S::F32::splat(s, self.reach);
        let [mut x0, mut x1, mut y0, mut y1] = [[0; GROUP]; 4];
        for at in (0..GROUP).step_by(S::LANES) {
            if (lanes >> at) << (32 - S::LANES) != 0 {
                let x = S::F32::load(s, &cylinders.x[at..]);
                let y = S::F32::load(s, &cylinders.y[at..]);
                self.bins.columns(s, x - reach).store(&mut x0[at..]);
                self.bins.columns(s, x + reach).store(&mut x1[at..]);
                self.bins.rows(s, y - reach).store(&mut y0[at..]);
                self.bins.rows(s, y + reach).store(&mut y1[at..]);
            }
        }
        for lane in set_bits(lanes) {
            let [first, last] = [x0[lane] as usize, x1[lane] as usize];
            let axis = [S::F32::splat(s, cylinders.x[lane]), S::F32::splat(s, cylinders.y[lane])];
            let above = S::F32::splat(s, cylinders.above[lane]);
            let within = S::F32::splat(s, cylinders.within);
            let mut hits = S::F32::mask_from_bits(s, 0);
            for strip in y0[lane] as usize >> self.bins.strip..=y1[lane] as usize >> self.bins.strip
            {
                let run = self.bins.run(strip, first, last);
                answers.n_tested += run.len() as u64;
                // Obstacles next to those of the run do no harm.
                for place in run.step_by(S::LANES) {
                    let [x, y, z] = self.bins.points(s, place);
                    let squared = squared_distance(axis, [x, y]);
                    hits = hits.or(z.gt(above).and(squared.le(within)));
                }
            }
            answers.hit |= u32::from(hits.bits() != 0) << lane;
        }
    }

    /// Tests the cylinders of `lanes`, at least one, together. None of the obstacles in their inner discs is so high.
    #[inline(always)]
    fn test_annulus<S: Simd>(
        &mut self,
        s: S,
        cylinders: &Cylinders,
        lanes: u32,
        answers: &mut Answers,
    ) {
        let n = self.collect(s, &AxisBox::new(s, cylinders, lanes));
        let Coordinates { x, y, z, .. } = &self.near;
        let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
        let within = S::F32::splat(s, cylinders.within);
        for at in (0..GROUP).step_by(S::LANES) {
            if (lanes >> at) << (32 - S::LANES) == 0 {
                continue;
            }
            let axes = [S::F32::load(s, &cylinders.x[at..]), S::F32::load(s, &cylinders.y[at..])];
            let above = S::F32::load(s, &cylinders.above[at..]);
            let mut hits = S::F32::mask_from_bits(s, 0);
            for ((&x, &y), &z) in x.iter().zip(y).zip(z) {
                let place = [S::F32::splat(s, x), S::F32::splat(s, y)];
                let squared = squared_distance(place, axes);
                hits = hits.or(S::F32::splat(s, z).gt(above).and(squared.le(within)));
            }
            answers.hit |= (hits.bits() << at) & lanes;
        }
        answers.n_tested += n as u64 * u64::from(lanes.count_ones());
    }

    /// Collects the obstacles that may be in a cylinder whose axis is in the box, but those of the inner discs of all
    /// such axes. How many they are.
    #[inline(always)]
    fn collect<S: Simd>(&mut self, s: S, axes: &AxisBox) -> usize {
        let ObstacleGrid { bins, inner, near, reach, .. } = self;
        let [[x0, y0], [x1, y1]] = [axes.least, axes.greatest];
        let first = bins.cell([x0 - *reach, y0 - *reach]);
        let last = bins.cell([x1 + *reach, y1 + *reach]);
        let (least, greatest) = (bins.cell([x0, y0]), bins.cell([x1, y1]));
        let bounds = Bounded {
            x: [S::F32::splat(s, x0), S::F32::splat(s, x1)],
            y: [S::F32::splat(s, y0), S::F32::splat(s, y1)],
            zero: S::F32::splat(s, 0.0),
        };
        let floor = S::F32::splat(s, axes.floor);
        let reach_squared = S::F32::splat(s, *reach * *reach);
        let height = bins.quantize_one(axes.floor);
        let mut n = 0;
        for row in first[1]..=last[1] {
            let farthest = row.abs_diff(least[1]).max(row.abs_diff(greatest[1]));
            let (gap, resume) = match inner.get(farthest) {
                Some(&half) if least[0] + half > greatest[0].saturating_sub(half) => {
                    (greatest[0].saturating_sub(half), least[0] + half)
                }
                _ => (last[0], last[0] + 1),
            };
            for [from, to] in [[first[0], gap], [resume, last[0]]] {
                if from > to || !bins.reaches(s, row, [from, to], height) {
                    continue;
                }
                let run = bins.run(row, from, to);
                for place in run.clone().step_by(S::LANES) {
                    let [x, y, z] = bins.points(s, place);
                    let near_enough = bounds.squared_distance([x, y]).le(reach_squared);
                    let in_run = !0 >> (32 - (run.end - place).min(S::LANES));
                    let kept = z.gt(floor).and(near_enough).bits() & in_run;
                    if kept == 0 {
                        continue;
                    }
                    if n + GROUP > near.x.len() {
                        near.resize(2 * n + 64);
                    }
                    x.compress(kept).store(&mut near.x[n..]);
                    y.compress(kept).store(&mut near.y[n..]);
                    z.compress(kept).store(&mut near.z[n..]);
                    n += kept.count_ones() as usize;
                }
            }
        }
        n
    }
}

/// Values of a raster at some cells.
#[inline(always)]
fn look_up<S: Simd>(s: S, raster: &[u16], cells: &[u32; GROUP]) -> S::U32 {
    let mut values = [0; GROUP];
    for (value, &cell) in values.iter_mut().zip(cells).take(S::LANES) {
        *value = u32::from(raster[cell as usize]);
    }
    S::U32::load(s, &values)
}

/// Box around the axes of some cylinders.
struct AxisBox {
    least: [f32; 2],
    greatest: [f32; 2],
    /// The lowest end.
    floor: f32,
}

impl AxisBox {
    #[inline(always)]
    fn new<S: Simd>(s: S, cylinders: &Cylinders, lanes: u32) -> Self {
        let (inf, minus_inf) =
            (S::F32::splat(s, f32::INFINITY), S::F32::splat(s, f32::NEG_INFINITY));
        let ([mut x0, mut y0, mut floor], [mut x1, mut y1]) = ([inf; 3], [minus_inf; 2]);
        for at in (0..GROUP).step_by(S::LANES) {
            let mask = S::F32::mask_from_bits(s, lanes >> at);
            let x = S::F32::load(s, &cylinders.x[at..]);
            let y = S::F32::load(s, &cylinders.y[at..]);
            let z = S::F32::load(s, &cylinders.above[at..]);
            (x0, x1) = (x0.min(x.select(mask, inf)), x1.max(x.select(mask, minus_inf)));
            (y0, y1) = (y0.min(y.select(mask, inf)), y1.max(y.select(mask, minus_inf)));
            floor = floor.min(z.select(mask, inf));
        }
        AxisBox {
            least: [x0.reduce_min(), y0.reduce_min()],
            greatest: [x1.reduce_max(), y1.reduce_max()],
            floor: floor.reduce_min(),
        }
    }
}

/// Sides of a box in all lanes.
struct Bounded<V> {
    x: [V; 2],
    y: [V; 2],
    zero: V,
}

impl<V: Vector> Bounded<V> {
    /// Squared distances of places from the box.
    #[inline(always)]
    fn squared_distance(&self, [x, y]: [V; 2]) -> V {
        let dx = (self.x[0] - x).max(x - self.x[1]).max(self.zero);
        let dy = (self.y[0] - y).max(y - self.y[1]).max(self.zero);
        dx * dx + dy * dy
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
    use crate::numeric::rng::{Purpose, Stream};
    use crate::simd::{Isa, Kernel};

    /// Per query: whether the rasters call it hit, and collision-free, and whether the cells around hold a collision,
    /// tested alone and together with its neighbors.
    struct Answer<'a>(&'a Coordinates, f32, StepSquared, &'a Coordinates);

    impl Kernel for Answer<'_> {
        type Output = Vec<(bool, bool, [bool; 2])>;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let Answer(obstacles, floor, step, queries) = self;
            let (mut least, mut greatest) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for query in (0..queries.n).map(|i| queries.get(i)) {
                for axis in 0..3 {
                    least[axis] = least[axis].min(query[axis]);
                    greatest[axis] = greatest[axis].max(query[axis]);
                }
            }
            let mut grid = ObstacleGrid::default();
            let extent = Extent { least, greatest };
            if !grid.fill(s, (obstacles, floor), &step, &extent, queries.n as u64) {
                return vec![(false, true, [false; 2]); queries.n];
            }
            let mut found = vec![];
            for first in (0..queries.n).step_by(GROUP) {
                let [x, y, z] = [&queries.x, &queries.y, &queries.z]
                    .map(|axis| axis[first..].first_chunk::<GROUP>().unwrap());
                let above = &z.map(|z| z + step.height);
                let cylinders = Cylinders { x, y, above, within: step.radius_squared };
                let n = GROUP.min(queries.n - first);
                let all = !0 >> (32 - n);
                let bounds = grid.bounds(s, &cylinders, all);
                let mut alone = Answers::default();
                grid.test_each(s, &cylinders, all, &mut alone);
                let annulus = if grid.bins.wide { bounds.clear & all } else { 0 };
                let mut together = Answers { hit: alone.hit & !annulus, ..alone };
                if annulus != 0 {
                    grid.test_annulus(s, &cylinders, annulus, &mut together);
                }
                for lane in 0..n {
                    let bit = |bits: u32| bits >> lane & 1 == 1;
                    let tested = [bit(alone.hit), bit(together.hit)];
                    found.push((bit(bounds.hit), !bit(bounds.may), tested));
                }
                let all_in_one = grid.answer(s, &cylinders, all);
                assert_eq!(all_in_one.hit, alone.hit);
            }
            found
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
                for &isa in Isa::available() {
                    let found = isa.run(Answer(&obstacles, floor, step, &queries));
                    for (i, (hit, collision_free, struck)) in found.into_iter().enumerate() {
                        let [x, y, z] = queries.get(i);
                        let within = |p: &[f32; 3]| {
                            let (dx, dy) = (p[0] - x, p[1] - y);
                            dx * dx + dy * dy <= radius * radius && p[2] > floor
                        };
                        let near = (0..300).map(|j| obstacles.get(j)).filter(within);
                        let top = near.map(|p| p[2]).fold(f32::NEG_INFINITY, f32::max);
                        let collides = top > z + step.height;
                        assert!(
                            !(hit && !collides || collision_free && collides),
                            "{radius} {span:?}"
                        );
                        assert_eq!(struck, [collides; 2], "{radius} {span:?}");
                    }
                }
            }
        }
    }
}
