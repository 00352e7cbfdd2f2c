//! Dilation of a raster by a disc: the greatest value of all cells that may be, or that must be, within a radius.

use crate::simd::{Simd, Unsigned};

/// Cells by which discs keep their distance from borderline cases. Finding the columns of two places takes two
/// roundings each, together off by 2.4e-7 of the greater one, and no grid has more than
/// [`MOST_CELLS`](super::cell_bins::MOST_CELLS) of them: this is four times as much.
const MARGIN: f64 = 1e-3;
/// Likewise the share of the radius: each of the four roundings of a squared distance is at most 6e-8 of it.
pub const SHARE: f64 = 1e-5;

/// Half-widths of a disc's rows, or half-heights of its columns, by their distance from the middle one, in
/// cells; they never grow.
pub type HalfWidths = Vec<usize>;

/// Half-widths of the disc of cells of which some place can be within `radius`, in cells, of some place of
/// the middle cell.
pub fn outer_disc(radius: f64, halves: &mut HalfWidths, [n_columns, n_rows]: [usize; 2]) {
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
pub fn inner_disc(radius: f64, halves: &mut HalfWidths, [n_columns, n_rows]: [usize; 2]) {
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

/// Scratch of [`dilate_disc`]: rasters with a margin all around.
#[derive(Debug, Default)]
pub struct DilationScratch {
    /// Greatest of runs of `2^k` cells of a column, from each cell down; those for the next `k`.
    runs: [Vec<u16>; 2],
    /// Greatest over the window of a column around each cell.
    windows: Vec<u16>,
    /// Where the columns of the disc that have the same height begin.
    starts: Vec<usize>,
}

/// Every cell of `to` becomes the greatest cell of `from` over a disc around it (gray dilation). Rows are `stride`
/// cells, a multiple of the `u16` lanes.
///
/// ```text
/// for the columns of the disc, from the lowest to the highest, those of one height together:
///     windows = greatest over so many cells of a column        two runs of 2^k cells that overlap
///     to = max(to, windows moved by each of these columns)
/// ```
#[inline(always)]
pub fn dilate_disc<S: Simd>(
    s: S,
    (from, stride): (&[u16], usize),
    halves: &HalfWidths,
    scratch: &mut DilationScratch,
    to: &mut Vec<u16>,
) {
    let Some(reach) = halves.len().checked_sub(1) else { return };
    let DilationScratch { runs: [runs, next], windows, starts } = scratch;
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
            greater_of_each(s, runs, &runs[run * padded..], next);
            std::mem::swap(runs, next);
            run *= 2;
        }
        let [upper, lower] = [above - half, above + half + 1 - run].map(|row| row * padded);
        greater_of_each(s, &runs[upper..], &runs[lower..], windows);
        for (row, to) in to.chunks_exact_mut(stride).enumerate() {
            for (t, to) in to.chunks_exact_mut(S::U16::LANES).enumerate() {
                let windows = &windows[row * padded + S::U16::LANES * t..];
                let mut greatest = S::U16::load(s, to);
                for &start in &*starts {
                    let window = &windows[start..start + S::U16::LANES];
                    greatest = greatest.max(S::U16::load(s, window));
                }
                greatest.store(to);
            }
        }
    }
}

/// The greater of each pair, as many as all have.
#[inline(always)]
fn greater_of_each<S: Simd>(s: S, a: &[u16], b: &[u16], to: &mut [u16]) {
    let n = a.len().min(b.len()).min(to.len());
    let lanes = S::U16::LANES;
    let (a, b, to) = (a[..n].chunks_exact(lanes), b[..n].chunks_exact(lanes), &mut to[..n]);
    let rest = a.remainder().iter().zip(b.remainder());
    let mut chunks = to.chunks_exact_mut(lanes);
    for ((a, b), to) in a.zip(b).zip(&mut chunks) {
        S::U16::load(s, a).max(S::U16::load(s, b)).store(to);
    }
    for ((&a, &b), to) in rest.zip(chunks.into_remainder()) {
        *to = a.max(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};
    use crate::simd::{Isa, Kernel};

    struct Greatest<'a>(&'a [u16], usize, &'a HalfWidths);

    impl Kernel for Greatest<'_> {
        type Output = Vec<u16>;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Vec<u16> {
            let mut to = vec![];
            dilate_disc(s, (self.0, self.1), self.2, &mut DilationScratch::default(), &mut to);
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
            for reach in [outer_disc, inner_disc] {
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
                for &isa in Isa::available() {
                    assert_eq!(isa.run(Greatest(&from, stride, &halves)), expected, "{radius}");
                }
            }
        }
    }

    #[test]
    fn discs_hold_what_can_and_what_must_be_within_the_radius() {
        let (mut may, mut must) = (vec![], vec![]);
        for radius in [0.2, 0.99, 1.0, 1.5, 3.0, 4.98, 17.3] {
            outer_disc(radius, &mut may, [99, 99]);
            inner_disc(radius, &mut must, [99, 99]);
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
