//! Discs of cells: which cells can, and which must, lie within a radius of another, and the greatest value
//! over such a disc for every cell of a raster.

use crate::simd::cells::TOPS;

/// Cells by which discs keep their distance from the knife edge. Finding the columns of two places takes two
/// roundings each, together off by 2.4e-7 of the greater one, and no grid has more than
/// [`MOST_CELLS`](crate::simd::cells::MOST_CELLS) of them: this is four times as much.
const MARGIN: f64 = 1e-3;
/// Likewise the share of the radius: each of the four roundings of a squared distance is at most 6e-8 of it.
pub const SHARE: f64 = 1e-5;

/// Half-widths of a disc's rows, or half-heights of its columns, by their distance from the middle one, in
/// cells; they never grow.
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

/// Memory of [`greatest_over_disc`]: rasters with a margin all around.
#[derive(Debug, Default)]
pub struct Margins {
    /// Greatest of runs of `2^k` cells of a column, from each cell down, and room for the next `k`.
    runs: [Vec<u16>; 2],
    /// Greatest over the window of a column around each cell.
    windows: Vec<u16>,
    /// Where the columns of the disc that have the same height begin.
    starts: Vec<usize>,
}

/// Every cell of `to` becomes the greatest cell of `from` over a disc around it. Rows are `stride` cells, a
/// multiple of [`TOPS`].
#[inline(always)]
pub fn greatest_over_disc(
    (from, stride): (&[u16], usize),
    halves: &HalfWidths,
    margins: &mut Margins,
    to: &mut Vec<u16>,
) {
    let Some(reach) = halves.len().checked_sub(1) else { return };
    let Margins { runs: [runs, next], windows, starts } = margins;
    let (above, padded, n_rows) = (halves[0], stride + reach, from.len() / stride);
    runs.clear();
    runs.resize((n_rows + 2 * above) * padded + reach, 0);
    next.resize(runs.len(), 0);
    let inner = &mut runs[above * padded + reach..];
    for (from, to) in from.chunks_exact(stride).zip(inner.chunks_mut(padded)) {
        to[..stride].copy_from_slice(from);
    }
    windows.resize(n_rows * padded + reach, 0);
    to.clear();
    to.resize(from.len(), 0);
    let (mut run, mut column) = (1, halves.len());
    while column > 0 {
        let half = halves[column - 1];
        starts.clear();
        while column > 0 && halves[column - 1] == half {
            column -= 1;
            starts.extend((column > 0).then_some(reach - column));
            starts.push(reach + column);
        }
        while 2 * run <= 2 * half + 1 {
            greatest_of_pairs(runs, &runs[run * padded..], next);
            std::mem::swap(runs, next);
            run *= 2;
        }
        let [upper, lower] = [above - half, above + half + 1 - run].map(|row| row * padded);
        greatest_of_pairs(&runs[upper..], &runs[lower..], windows);
        for (row, to) in to.chunks_exact_mut(stride).enumerate() {
            for (t, to) in to.as_chunks_mut().0.iter_mut().enumerate() {
                *to = greatest_of_windows(*to, &windows[row * padded + TOPS * t..], starts);
            }
        }
    }
}

/// The greatest of `tops` and of the windows that begin at each of `starts`.
#[inline(always)]
fn greatest_of_windows(mut tops: [u16; TOPS], windows: &[u16], starts: &[usize]) -> [u16; TOPS] {
    for &start in starts {
        let Some(window) = windows[start..].first_chunk::<TOPS>() else { return tops };
        for lane in 0..TOPS {
            tops[lane] = tops[lane].max(window[lane]);
        }
    }
    tops
}

/// The greater of each pair, as many as all have.
#[inline(always)]
fn greatest_of_pairs(a: &[u16], b: &[u16], to: &mut [u16]) {
    for ((&a, &b), to) in a.iter().zip(b).zip(to) {
        *to = a.max(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::simd::{Kernel, Level, Simd};

    struct Greatest<'a>(&'a [u16], usize, &'a HalfWidths);

    impl Kernel for Greatest<'_> {
        type Output = Vec<u16>;

        #[inline(always)]
        fn run<S: Simd>(self, _: S) -> Vec<u16> {
            let mut to = vec![];
            greatest_over_disc((self.0, self.1), self.2, &mut Margins::default(), &mut to);
            to
        }
    }

    #[test]
    fn rasters_over_discs_are_those_of_plain_loops() {
        let mut stream = Stream::new(12, 0, 0, Purpose::Probe);
        for (stride, n_rows, radius) in [
            (32, 1, 0.3),
            (32, 20, 1.0),
            (64, 9, 2.5),
            (96, 33, 7.0),
            (32, 5, 100.0),
            (64, 70, 16.2),
        ] {
            let mut top =
                || if stream.unit() < 0.2 { stream.range(1.0, 65_536.0) as u16 } else { 0 };
            let from: Vec<u16> = (0..stride * n_rows).map(|_| top()).collect();
            let mut halves = vec![];
            for reach in [may_reach, must_reach] {
                reach(radius, &mut halves, [n_rows, stride]);
                if halves.is_empty() {
                    continue;
                }
                let over_disc = |cell: usize| {
                    let (row, column) = (cell / stride, cell % stride);
                    let inside = |&(_, other): &(&u16, usize)| {
                        let half = halves.get((other % stride).abs_diff(column));
                        half.is_some_and(|&half| (other / stride).abs_diff(row) <= half)
                    };
                    from.iter().zip(0..).filter(inside).map(|(&value, _)| value).max().unwrap()
                };
                let expected: Vec<u16> = (0..from.len()).map(over_disc).collect();
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
