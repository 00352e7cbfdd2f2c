//! Discs of cells: which cells can, and which must, lie within a radius of another, and the greatest value
//! over such a disc for every cell of a raster.

use crate::simd::collide::{eights, eights_mut};
use crate::simd::level::Simd;

/// Cells by which discs keep their distance from the knife edge. Finding the columns of two places takes two
/// roundings each, together off by 2.4e-7 of the greater one, and no grid has more than
/// [`MOST_CELLS`](crate::simd::cells::MOST_CELLS) of them: this is four times as much.
const MARGIN: f64 = 1e-3;
/// Likewise the share of the radius: each of the four roundings of a squared distance is at most 6e-8 of it.
pub const SHARE: f64 = 1e-5;

/// Half-widths of a disc's rows by their distance from its middle row, in cells; they never grow.
pub type HalfWidths = Vec<usize>;

/// Half-widths of the disc of cells of which some place can be within `radius`, in cells, of some place of
/// the middle cell.
pub fn may_reach(radius: f64, halves: &mut HalfWidths, [n_columns, n_rows]: [usize; 2]) {
    let radius = radius * (1.0 + SHARE);
    halves.clear();
    for row in 0..n_rows {
        let near = (row as f64 - 1.0 - MARGIN).max(0.0);
        if near > radius {
            break;
        }
        let half = (radius * radius - near * near).sqrt() + 1.0 + MARGIN;
        halves.push((half as usize).min(n_columns - 1));
    }
}

/// Half-widths of the disc of cells of which every place is within `radius`, in cells, of every place of the
/// middle cell; there may be none.
pub fn must_reach(radius: f64, halves: &mut HalfWidths, [n_columns, n_rows]: [usize; 2]) {
    let radius = radius * (1.0 - SHARE);
    halves.clear();
    for row in 0..n_rows {
        let far = row as f64 + 1.0 + MARGIN;
        let half = (radius * radius - far * far).max(0.0).sqrt() - 1.0 - MARGIN;
        if half < 0.0 {
            break;
        }
        halves.push((half as usize).min(n_columns - 1));
    }
}

/// Memory of [`greatest_over_disc`].
#[derive(Debug, Default)]
pub struct Rows {
    /// Greatest of runs of `2^k` cells of a row, from each cell on, and room for the next `k`.
    runs: [Vec<f32>; 2],
    /// For the last rows, and each width of the disc, the greatest over the window around each cell.
    windows: Vec<f32>,
    /// Where the windows of a row's disc begin.
    starts: Vec<usize>,
}

/// Every cell of `to` becomes the greatest cell of `from` over a disc around it. Rows are `stride` cells, a
/// multiple of eight.
#[inline(always)]
pub fn greatest_over_disc<S: Simd>(
    s: S,
    (from, stride): (&[f32], usize),
    halves: &HalfWidths,
    rows: &mut Rows,
    to: &mut Vec<f32>,
) {
    let Some(reach) = halves.len().checked_sub(1) else { return };
    to.resize(from.len(), 0.0);
    let n_rows = from.len() / stride;
    let (height, n_slots) = (halves.len() * stride, 2 * reach + 1);
    rows.windows.clear();
    rows.windows.resize(n_slots * height, f32::NEG_INFINITY);
    for row in 0..n_rows + reach {
        let slot = row % n_slots * height;
        let windows = &mut rows.windows[slot..][..height];
        match row < n_rows {
            true => widen(s, &from[row * stride..][..stride], halves, &mut rows.runs, windows),
            false => windows.fill(f32::NEG_INFINITY),
        }
        let Some(middle) = row.checked_sub(reach) else { continue };
        rows.starts.clear();
        for other in middle.saturating_sub(reach)..=row {
            let distance = other.abs_diff(middle);
            rows.starts.push(other % n_slots * height + distance * stride);
        }
        for (e, to) in eights_mut(&mut to[middle * stride..][..stride]).iter_mut().enumerate() {
            let mut greatest = s.splat(f32::NEG_INFINITY);
            for &start in &rows.starts {
                let window = rows.windows[start + 8 * e..].first_chunk();
                greatest = window.map_or(greatest, |window| s.max(greatest, s.load(window)));
            }
            s.store(greatest, to);
        }
    }
}

/// For each half-width, the greatest of `row` over the window around each cell, one after the other.
#[inline(always)]
fn widen<S: Simd>(
    s: S,
    row: &[f32],
    halves: &HalfWidths,
    [runs, next]: &mut [Vec<f32>; 2],
    windows: &mut [f32],
) {
    let stride = row.len();
    let left = halves[0].next_multiple_of(8);
    for buffer in [&mut *runs, &mut *next] {
        buffer.clear();
        buffer.resize(stride + 3 * left + 8, f32::NEG_INFINITY);
    }
    runs[left..left + stride].copy_from_slice(row);
    let mut run = 1;
    for (distance, &half) in halves.iter().enumerate().rev() {
        let (window, narrower) = windows[distance * stride..].split_at_mut(stride);
        if halves.get(distance + 1) == Some(&half) {
            window.copy_from_slice(&narrower[..stride]);
            continue;
        }
        while 2 * run <= 2 * half + 1 {
            greatest_of_pairs(s, runs, &runs[run..], next);
            std::mem::swap(runs, next);
            run *= 2;
        }
        greatest_of_pairs(s, &runs[left - half..], &runs[left + half + 1 - run..], window);
    }
}

/// The greater of each pair, as many whole eights as all have.
#[inline(always)]
fn greatest_of_pairs<S: Simd>(s: S, a: &[f32], b: &[f32], to: &mut [f32]) {
    for ((a, b), to) in eights(a).iter().zip(eights(b)).zip(eights_mut(to)) {
        s.store(s.max(s.load(a), s.load(b)), to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::simd::{Kernel, Level};

    struct Greatest<'a>(&'a [f32], usize, &'a HalfWidths);

    impl Kernel for Greatest<'_> {
        type Output = Vec<f32>;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Vec<f32> {
            let mut to = vec![];
            greatest_over_disc(s, (self.0, self.1), self.2, &mut Rows::default(), &mut to);
            to
        }
    }

    #[test]
    fn rasters_over_discs_are_those_of_plain_loops() {
        let mut stream = Stream::new(12, 0, 0, Purpose::Probe);
        for (stride, n_rows, radius) in
            [(8, 1, 0.3), (8, 20, 1.0), (24, 9, 2.5), (40, 33, 7.0), (16, 5, 100.0), (64, 70, 16.2)]
        {
            let from: Vec<f32> = (0..stride * n_rows)
                .map(|_| if stream.unit() < 0.2 { stream.unit() as f32 } else { f32::NEG_INFINITY })
                .collect();
            let mut halves = vec![];
            for reach in [may_reach, must_reach] {
                reach(radius, &mut halves, [stride, n_rows]);
                if halves.is_empty() {
                    continue;
                }
                let over_disc = |cell: usize| {
                    let (row, column) = (cell / stride, cell % stride);
                    let inside = |&(_, other): &(&f32, usize)| {
                        let half = halves.get((other / stride).abs_diff(row));
                        half.is_some_and(|&half| (other % stride).abs_diff(column) <= half)
                    };
                    let values = from.iter().zip(0..).filter(inside).map(|(&value, _)| value);
                    values.fold(f32::NEG_INFINITY, f32::max)
                };
                let expected: Vec<f32> = (0..from.len()).map(over_disc).collect();
                for &level in Level::available() {
                    assert_eq!(level.run(Greatest(&from, stride, &halves)), expected, "{radius}");
                }
            }
        }
    }

    #[test]
    fn discs_hold_what_can_and_what_must_be_within_the_radius() {
        let (mut may, mut must) = (vec![], vec![]);
        for radius in [0.2, 0.99, 1.0, 1.5, 3.0, 4.98, 17.3] {
            may_reach(radius, &mut may, [99, 99]);
            must_reach(radius, &mut must, [99, 99]);
            for (row, column) in (0..30).flat_map(|row| (0..30).map(move |column| (row, column))) {
                let near = f64::hypot((row as f64 - 1.0).max(0.0), (column as f64 - 1.0).max(0.0));
                let far = f64::hypot(row as f64 + 1.0, column as f64 + 1.0);
                let among =
                    |halves: &HalfWidths| halves.get(row).is_some_and(|&half| column <= half);
                assert!(among(&may) || near > radius, "{radius} {row} {column}");
                assert!(!among(&must) || far < radius, "{radius} {row} {column}");
                assert!(!among(&may) || near < 1.001 * radius + 0.002, "{radius} {row} {column}");
            }
        }
    }
}
