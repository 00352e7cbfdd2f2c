//! A uniform grid of bounding boxes: which triangles may be near a point, or near each other.
//!
//! A box is listed in every cell it touches. The cells are made as fine as the number of boxes
//! warrants, then coarser again until the lists are only a few times longer than the boxes are many.

use super::counting_sort::CountingSort;
use glam::DVec3;

/// Most list entries per box.
const MAX_ENTRIES: u64 = 12;
/// Most cells per axis.
const MAX_CELLS: f64 = 1024.0;

/// Lists of boxes by cell.
pub(crate) struct AabbGrid {
    low: DVec3,
    high: DVec3,
    cell_mm: f64,
    n_cells: [usize; 3],
    cells: CountingSort,
    entries: Vec<u32>,
}

impl AabbGrid {
    /// The grid over `boxes`, each its least and greatest corner, finite. An axis in which all boxes
    /// are flat has one cell.
    pub(crate) fn new(boxes: &[(DVec3, DVec3)]) -> Self {
        let first = boxes.first().copied().unwrap_or_default();
        let (low, high) = boxes.iter().fold(first, |(l, h), b| (l.min(b.0), h.max(b.1)));
        let mut grid = AabbGrid {
            low,
            high,
            cell_mm: finest_cell(high - low, boxes.len()),
            n_cells: [1; 3],
            cells: CountingSort::default(),
            entries: Vec::new(),
        };
        loop {
            grid.n_cells = grid.cell(high).map(|c| c + 1);
            let n_entries: u64 = boxes.iter().map(|b| grid.n_touched(b)).sum();
            if n_entries <= MAX_ENTRIES * boxes.len() as u64 || grid.n_cells == [1; 3] {
                break;
            }
            grid.cell_mm *= 1.5;
        }
        grid.fill(boxes);
        grid
    }

    fn fill(&mut self, boxes: &[(DVec3, DVec3)]) {
        let mut cells = CountingSort::default();
        cells.clear(self.n_cells.iter().product());
        for b in boxes {
            self.for_each_touched(b, |cell| cells.count(cell));
        }
        cells.finish_counting();
        let n_entries = boxes.iter().map(|b| self.n_touched(b)).sum::<u64>();
        let mut entries = vec![0; n_entries as usize];
        for (i, b) in boxes.iter().enumerate() {
            self.for_each_touched(b, |cell| entries[cells.place(cell)] = i as u32);
        }
        (self.cells, self.entries) = (cells, entries);
    }

    fn n_touched(&self, b: &(DVec3, DVec3)) -> u64 {
        let (low, high) = (self.cell(b.0), self.cell(b.1));
        (0..3).map(|k| (high[k] - low[k] + 1) as u64).product()
    }

    fn for_each_touched(&self, b: &(DVec3, DVec3), mut visit: impl FnMut(usize)) {
        let (low, high) = (self.cell(b.0), self.cell(b.1));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                (low[0]..=high[0]).for_each(|x| visit(self.number([x, y, z])));
            }
        }
    }

    /// Cell of a point, or the nearest one. Monotone in each coordinate, so that a box's cells
    /// enclose those of all its points whatever rounding does.
    fn cell(&self, point: DVec3) -> [usize; 3] {
        let scaled = ((point.max(self.low).min(self.high)) - self.low) / self.cell_mm;
        scaled.to_array().map(|c| c as usize)
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.n_cells[1] + y) * self.n_cells[0] + x
    }

    /// Number of cells.
    pub(crate) fn n_cells(&self) -> usize {
        self.cells.n_buckets()
    }

    /// Number of the cell that holds `point`, or of the nearest one.
    pub(crate) fn cell_of(&self, point: DVec3) -> usize {
        self.number(self.cell(point))
    }

    /// A bit for each axis along which the cell of `point` is that of cell number `cell`.
    pub(crate) fn same_axes(&self, point: DVec3, cell: usize) -> u8 {
        let [nx, ny, _] = self.n_cells;
        let (own, other) = (self.cell(point), [cell % nx, cell / nx % ny, cell / nx / ny]);
        (0..3).map(|k| u8::from(own[k] == other[k]) << k).sum()
    }

    /// The boxes that touch cell number `cell`, ascending.
    pub(crate) fn in_cell(&self, cell: usize) -> &[u32] {
        &self.entries[self.cells.range(cell, cell)]
    }
}

/// About one box per cell if they filled the axes that have any length.
fn finest_cell(size: DVec3, n: usize) -> f64 {
    let lengths: Vec<f64> = size.to_array().into_iter().filter(|s| *s > 0.0).collect();
    let content = lengths.iter().product::<f64>() / n.max(1) as f64;
    let edge = match lengths.len() {
        3 => libm::cbrt(content),
        2 => content.sqrt(),
        _ => content,
    };
    let edge = edge.max(size.max_element() / MAX_CELLS);
    if edge > f64::MIN_POSITIVE && edge.is_finite() { edge } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn every_pair_that_overlaps_meets_in_the_cell_of_its_common_corner() {
        let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
        for flat in [1.0, 0.0] {
            let mut point = |s: f64| {
                DVec3::new(stream.range(-s, s), stream.range(-s, s), flat * stream.range(-s, s))
            };
            let boxes: Vec<_> = (0..400)
                .map(|_| (point(10.0), point(1.5)))
                .map(|(c, e)| (c - e.abs(), c + e.abs()))
                .collect();
            let grid = AabbGrid::new(&boxes);
            assert!(grid.n_cells() > 10);
            for (i, a) in boxes.iter().enumerate() {
                for (j, b) in boxes.iter().enumerate().skip(i + 1) {
                    let common = a.0.max(b.0);
                    if common.cmple(a.1.min(b.1)).all() {
                        let met = grid.in_cell(grid.cell_of(common));
                        assert!(met.contains(&(i as u32)) && met.contains(&(j as u32)));
                    }
                }
            }
        }
    }

    #[test]
    fn boxes_without_extent_share_one_cell() {
        assert_eq!(AabbGrid::new(&[]).n_cells(), 1);
        let grid = AabbGrid::new(&[(DVec3::ONE, DVec3::ONE); 3]);
        assert_eq!((grid.n_cells(), grid.in_cell(0)), (1, &[0, 1, 2][..]));
    }
}
