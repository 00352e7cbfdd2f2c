//! A uniform grid over points: nearest neighbor, and all within a radius.
//!
//! Points are sorted by cell, so a cell's points are one slice. Cells hold about two points; distances
//! are compared in f64, which holds the squares of f32 differences exactly enough that ties are
//! real ties, and those go to the lower index. Build O(n), a query O(points met).

use super::counting_sort::CountingSort;
use glam::{UVec3, Vec3};

/// Points per cell aimed at.
const CROWD: f64 = 2.0;
/// Most cells per axis.
const MAX_CELLS: f64 = 1024.0;

/// A uniform grid over points that stay where they are.
#[derive(Debug, Clone)]
pub struct PointGrid {
    low: Vec3,
    /// Edge length of a cell, mm.
    cell_mm: f32,
    n_cells: UVec3,
    /// Where each cell's points begin in `index`.
    cells: CountingSort,
    /// Point indices, cell by cell, ascending within a cell.
    index: Vec<u32>,
    /// The points in that order.
    points: Vec<Vec3>,
}

impl PointGrid {
    /// The grid over `points`, mm.
    ///
    /// # Panics
    /// If a point is not finite, or there are 2³² or more.
    pub fn new(points: &[Vec3]) -> Self {
        assert!(points.iter().all(|p| p.is_finite()), "points of a grid are finite");
        assert!(u32::try_from(points.len()).is_ok(), "fewer than 2^32 points in a grid");
        let first = points.first().copied().unwrap_or_default();
        let (low, high) =
            points.iter().fold((first, first), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        let cell_mm = cell_size(low, high, points.len());
        let n_cells = ((high - low) / cell_mm).floor().as_uvec3() + UVec3::ONE;
        let mut grid = PointGrid {
            low,
            cell_mm,
            n_cells,
            cells: CountingSort::default(),
            index: vec![0; points.len()],
            points: vec![Vec3::ZERO; points.len()],
        };
        grid.fill(points);
        grid
    }

    fn fill(&mut self, points: &[Vec3]) {
        let cells: Vec<usize> = points.iter().map(|p| self.number(self.cell(*p))).collect();
        self.cells.clear(self.n_cells.element_product() as usize);
        cells.iter().for_each(|&cell| self.cells.count(cell));
        self.cells.finish_counting();
        for (i, cell) in cells.into_iter().enumerate() {
            let slot = self.cells.place(cell);
            self.index[slot] = i as u32;
            self.points[slot] = points[i];
        }
    }

    /// Index of the point nearest to `from` and its distance in mm; `None` if there are no points.
    #[cfg(any(test, feature = "formats"))]
    pub fn nearest(&self, from: Vec3) -> Option<(u32, f32)> {
        self.nearest_where(from, |_| true)
    }

    /// As [`PointGrid::nearest`], among the points whose index passes `admit`.
    #[cfg(any(test, feature = "formats"))]
    pub fn nearest_where(&self, from: Vec3, admit: impl Fn(u32) -> bool) -> Option<(u32, f32)> {
        let home = self.cell(from);
        let last = home.max(self.n_cells - UVec3::ONE - home).max_element();
        let mut best: Option<(f64, u32)> = None;
        for ring in 0..=last {
            // Points in this ring are at least this far away, wherever in its cell `from` lies; a
            // little less, against rounding of the cell.
            let gap = 0.999 * f64::from(self.cell_mm) * f64::from(ring.saturating_sub(1));
            if best.is_some_and(|(square, _)| square < gap * gap) {
                break;
            }
            self.for_each_in_ring(home, ring, |i, point| {
                let candidate = (square_distance(point, from), i);
                if best.is_none_or(|best| candidate < best) && admit(i) {
                    best = Some(candidate);
                }
            });
        }
        best.map(|(square, i)| (i, square.sqrt() as f32))
    }

    /// Calls `found(index, squared distance in mm²)` for every point at most `radius_mm` from `from`;
    /// the order is the same in every run.
    pub fn for_each_within(&self, from: Vec3, radius_mm: f32, mut found: impl FnMut(u32, f64)) {
        let limit = f64::from(radius_mm) * f64::from(radius_mm);
        // One part in a million wider than the sphere, against rounding of the corners.
        let reach = Vec3::splat(radius_mm * 1.000_001 + self.cell_mm * 1e-6);
        let (low, high) = (self.cell(from - reach), self.cell(from + reach));
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                // Cells of one row are neighbors in memory.
                let row = self.number(UVec3::new(low.x, y, z));
                let end = self.number(UVec3::new(high.x, y, z));
                for slot in self.cells.range(row, end) {
                    let square = square_distance(self.points[slot], from);
                    if square <= limit {
                        found(self.index[slot], square);
                    }
                }
            }
        }
    }

    #[cfg(any(test, feature = "formats"))]
    fn for_each_in_ring(&self, home: UVec3, ring: u32, mut visit: impl FnMut(u32, Vec3)) {
        let low = home.saturating_sub(UVec3::splat(ring));
        let high = (home + UVec3::splat(ring)).min(self.n_cells - UVec3::ONE);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let on_shell = home.z.abs_diff(z) == ring || home.y.abs_diff(y) == ring;
                let step = if on_shell || ring == 0 { 1 } else { 2 * ring as usize };
                let begin =
                    if on_shell { low.x as i64 } else { i64::from(home.x) - i64::from(ring) };
                for x in (begin..=i64::from(high.x)).step_by(step) {
                    if x < 0 {
                        continue;
                    }
                    let cell = self.number(UVec3::new(x as u32, y, z));
                    for slot in self.cells.range(cell, cell) {
                        visit(self.index[slot], self.points[slot]);
                    }
                }
            }
        }
    }

    /// The cell that holds `point`, or the nearest one if it lies outside.
    fn cell(&self, point: Vec3) -> UVec3 {
        // A float-to-integer cast saturates, so far points land in border cells.
        ((point - self.low) / self.cell_mm).floor().as_uvec3().min(self.n_cells - UVec3::ONE)
    }

    fn number(&self, cell: UVec3) -> usize {
        ((cell.z * self.n_cells.y + cell.y) * self.n_cells.x + cell.x) as usize
    }
}

/// Surfaces fill few cells of a volume grid, so the edge is that of squares sharing the largest face
/// of the bounding box, kept above what the cell limits allow.
fn cell_size(low: Vec3, high: Vec3, n_points: usize) -> f32 {
    let size = (high - low).as_dvec3();
    let [x, y, z] = size.to_array();
    let face = (x * y).max(y * z).max(z * x);
    let by_area = (face * CROWD / n_points.max(1) as f64).sqrt();
    let by_length = size.max_element() * CROWD / n_points.max(1) as f64;
    // At most eight cells per point, so that thin fog in a large box stays affordable.
    let by_volume = libm::cbrt(x * y * z / (8.0 * n_points.max(1) as f64));
    let by_count = size.max_element() / MAX_CELLS;
    let cell = by_area.max(by_length).max(by_volume).max(by_count);
    if cell > f64::from(f32::MIN_POSITIVE) { cell as f32 } else { 1.0 }
}

fn square_distance(a: Vec3, b: Vec3) -> f64 {
    a.as_dvec3().distance_squared(b.as_dvec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    fn clouds() -> Vec<Vec<Vec3>> {
        let mut stream = Stream::new(3, 0, 0, Purpose::Probe);
        let mut point = |size: [f64; 3]| Vec3::from_array(size.map(|s| stream.range(-s, s) as f32));
        let mut clouds: Vec<Vec<Vec3>> = [[5.0, 7.0, 3.0], [9.0, 9.0, 0.0], [0.0, 40.0, 0.0]]
            .iter()
            .map(|size| (0..700).map(|_| point(*size)).collect())
            .collect();
        // Equal distances everywhere, and one point very far from the others.
        let lattice = |i: u32| Vec3::new((i % 9) as f32, (i / 9 % 9) as f32, (i / 81) as f32);
        clouds.push((0..729).map(lattice).collect());
        clouds.push((0..50).map(lattice).chain([Vec3::splat(1e6)]).collect());
        clouds.push(vec![Vec3::ONE; 9]);
        clouds
    }

    /// Indices of the points at most `radius_mm` from `from`, ascending.
    fn within(grid: &PointGrid, from: Vec3, radius_mm: f32) -> Vec<u32> {
        let mut found = Vec::new();
        grid.for_each_within(from, radius_mm, |i, _| found.push(i));
        found.sort_unstable();
        found
    }

    #[test]
    fn nearest_and_within_equal_a_plain_search() {
        let mut stream = Stream::new(4, 0, 0, Purpose::Probe);
        for points in clouds() {
            let grid = PointGrid::new(&points);
            for round in 0..60 {
                let wide = if round < 40 { 8.0 } else { 100.0 };
                let mut from = Vec3::from_array([0; 3].map(|_| stream.range(-wide, wide) as f32));
                if round % 3 == 0 {
                    from = points[stream.below(points.len())];
                }
                let plain = (0..points.len() as u32)
                    .map(|i| (square_distance(points[i as usize], from), i))
                    .reduce(|a, b| if b < a { b } else { a })
                    .unwrap();
                let nearest = grid.nearest(from).unwrap();
                assert_eq!((nearest.0, nearest.1), (plain.1, plain.0.sqrt() as f32));
                let other = grid.nearest_where(from, |i| i != plain.1).unwrap();
                assert_ne!(other.0, plain.1);
                let radius = stream.range(0.0, 6.0).floor() as f32;
                let plain: Vec<u32> = (0..points.len() as u32)
                    .filter(|i| {
                        let square = square_distance(points[*i as usize], from);
                        square <= f64::from(radius) * f64::from(radius)
                    })
                    .collect();
                assert_eq!(within(&grid, from, radius), plain);
            }
        }
    }

    #[test]
    fn a_grid_without_points_finds_none() {
        let grid = PointGrid::new(&[]);
        assert!(grid.nearest(Vec3::ONE).is_none());
        assert!(within(&grid, Vec3::ZERO, 10.0).is_empty());
    }

    #[test]
    fn points_that_are_nowhere_are_refused() {
        for bad in [f32::NAN, f32::INFINITY] {
            let points = [Vec3::ZERO, Vec3::splat(bad)];
            assert!(std::panic::catch_unwind(|| PointGrid::new(&points)).is_err());
        }
        let far = PointGrid::new(&[Vec3::splat(-1e6), Vec3::splat(1e6), Vec3::ZERO]);
        assert_eq!(far.nearest(Vec3::ONE), Some((2, Vec3::ONE.length())));
    }
}
