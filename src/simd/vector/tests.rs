use super::*;
use crate::simd::{Isa, Kernel};

fn numbers(n: usize, seed: usize) -> Vec<f32> {
    (0..n).map(|i| (((i + seed) * 7919 + 13) % 97) as f32 * 0.37 - 17.0).collect()
}

/// Every operation, `LANES` numbers at a time, over two lists; the results one after another.
struct Operations<'a>(&'a [f32], &'a [f32]);

impl Kernel for Operations<'_> {
    type Output = Vec<Vec<f32>>;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let lanes = S::F32::LANES;
        let mut out = vec![vec![0.0; self.0.len()]; 9];
        for (i, (a, b)) in self.0.chunks(lanes).zip(self.1.chunks(lanes)).enumerate() {
            let (a, b) = (S::F32::load_partial(s, a), S::F32::load_partial(s, b));
            let all = [
                a + b,
                a - b,
                a * b,
                a.mul_add(b, S::F32::splat(s, 0.1)),
                a.min(b),
                a.max(b),
                a.select(a.gt(b), S::F32::splat(s, 7.0)),
                a,
                S::F32::splat(s, 3.25),
            ];
            for (v, out) in all.into_iter().zip(&mut out) {
                let end = out.len().min((i + 1) * lanes);
                v.store_partial(&mut out[i * lanes..end]);
            }
        }
        out
    }
}

#[test]
fn every_isa_gives_the_same_lanes() {
    for n in 0..=67 {
        let (a, b) = (numbers(n, 1), numbers(n, 40));
        let expected = Isa::available()[0].run(Operations(&a, &b));
        let fused = a.iter().zip(&b).map(|(a, b)| a.mul_add(*b, 0.1));
        assert!(expected[3].iter().copied().eq(fused), "fused multiply-add of {n}");
        for isa in Isa::available() {
            assert_eq!(isa.run(Operations(&a, &b)), expected, "{} of {n}", isa.name());
        }
    }
}

struct Transpose<'a>(&'a [f32]);

impl Kernel for Transpose<'_> {
    /// Lanes and the transposed square.
    type Output = (usize, Vec<f32>);

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let lanes = S::F32::LANES;
        let mut rows = [S::F32::splat(s, 0.0); MAX_LANES];
        for (row, from) in rows.iter_mut().zip(self.0.chunks_exact(lanes)).take(lanes) {
            *row = S::F32::load(s, from);
        }
        S::F32::transpose(&mut rows[..lanes]);
        let mut out = vec![0.0; lanes * lanes];
        for (row, to) in rows.iter().zip(out.chunks_exact_mut(lanes)) {
            row.store(to);
        }
        (lanes, out)
    }
}

#[test]
fn rows_become_columns() {
    let square = numbers(256, 5);
    for isa in Isa::available() {
        let (n, columns) = isa.run(Transpose(&square));
        let expected = (0..n * n).map(|i| square[i % n * n + i / n]);
        assert!(columns.iter().copied().eq(expected), "{}", isa.name());
    }
}

struct Widen<'a>(&'a [f32]);

impl Kernel for Widen<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Vec<f64> {
        let mut out = vec![0.0; self.0.len()];
        let lanes = S::F32::LANES;
        for (from, to) in self.0.chunks_exact(lanes).zip(out.chunks_exact_mut(lanes)) {
            let [low, high] = S::F32::load(s, from).widen();
            low.store(to);
            high.store(&mut to[lanes / 2..]);
        }
        out
    }
}

#[test]
fn widening_is_exact() {
    let x = numbers(64, 3);
    for isa in Isa::available() {
        assert!(isa.run(Widen(&x)).into_iter().eq(x.iter().map(|&x| f64::from(x))));
    }
}

/// Every operation on masks and whole numbers, over two lists; the results one after another.
struct MasksAndWholes<'a>(&'a [f32], &'a [f32]);

impl Kernel for MasksAndWholes<'_> {
    /// Bits of masks, whole numbers lane by lane, and reductions of each vector (numbers, wholes).
    type Output = (Vec<Vec<bool>>, Vec<Vec<u32>>, [Vec<f32>; 2], [Vec<u32>; 3]);

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let lanes = S::LANES;
        let (mut masks, mut wholes) = (vec![vec![]; 6], vec![vec![]; 9]);
        let (mut numbers, mut reduced) = ([vec![], vec![]], [vec![], vec![], vec![]]);
        for (a, b) in self.0.chunks_exact(lanes).zip(self.1.chunks_exact(lanes)) {
            let (a, b) = (S::F32::load(s, a), S::F32::load(s, b));
            let hundred = S::F32::splat(s, 100.5);
            let (m, n) = ((a + hundred).truncate(), (b + hundred).truncate());
            let (gt, le) = (a.gt(b), a.le(S::F32::splat(s, 0.0)));
            let odd = S::F32::mask_from_bits(s, 0xaaaa_aaaa);
            for (to, mask) in masks.iter_mut().zip([gt, le, gt.and(le), gt.or(le), m.ge(n), odd]) {
                assert_eq!(u64::from(mask.bits()) >> lanes, 0, "bits beyond the lanes");
                to.extend((0..lanes).map(|l| mask.bits() >> l & 1 == 1));
            }
            let big = S::U32::splat(s, 0x9000_0001);
            let all = [
                m.add(big),
                m.sub(n),
                m.mul(big),
                m.mul(big).shr(7),
                m.and(n),
                m.mul(big).min(n.mul(big)),
                m.mul(big).max(n.mul(big)),
                m.select(gt, n),
                m.count(gt),
            ];
            for (to, whole) in wholes.iter_mut().zip(all) {
                let mut stored = [0; MAX_LANES];
                whole.store(&mut stored);
                to.extend(&stored[..lanes]);
                assert_eq!(whole.reduce_add(), stored.iter().copied().fold(0, u32::wrapping_add));
            }
            let same = S::U32::load(s, &[7; MAX_LANES]);
            reduced[0].push(same.reduce_add() / lanes as u32);
            reduced[1].push(m.mul(big).reduce_min());
            reduced[2].push(m.mul(big).reduce_max());
            numbers[0].push(a.reduce_min());
            numbers[1].push(a.reduce_max());
        }
        (masks, wholes, numbers, reduced)
    }
}

#[test]
fn masks_and_whole_numbers_are_those_of_plain_loops() {
    let (a, b) = (numbers(64, 2), numbers(64, 30));
    let (m, n): (Vec<u32>, Vec<u32>) =
        a.iter().zip(&b).map(|(a, b)| ((a + 100.5) as u32, (b + 100.5) as u32)).unzip();
    let big = 0x9000_0001u32;
    for isa in Isa::available() {
        let (masks, wholes, floats, reduced) = isa.run(MasksAndWholes(&a, &b));
        for i in 0..64 {
            let (gt, le) = (a[i] > b[i], a[i] <= 0.0);
            let found: Vec<bool> = masks.iter().map(|mask| mask[i]).collect();
            assert_eq!(found, [gt, le, gt && le, gt || le, m[i] >= n[i], i % 2 == 1]);
            let (up, other) = (m[i].wrapping_mul(big), n[i].wrapping_mul(big));
            let expected = [
                m[i].wrapping_add(big),
                m[i].wrapping_sub(n[i]),
                up,
                up >> 7,
                m[i] & n[i],
                up.min(other),
                up.max(other),
                if gt { m[i] } else { n[i] },
                m[i] + u32::from(gt),
            ];
            let found: Vec<u32> = wholes.iter().map(|whole| whole[i]).collect();
            assert_eq!(found, expected, "{}", isa.name());
        }
        let lanes = 64 / floats[0].len();
        for (v, lanes_of_a) in a.chunks(lanes).enumerate() {
            assert_eq!(floats[0][v], lanes_of_a.iter().copied().fold(f32::MAX, f32::min));
            assert_eq!(floats[1][v], lanes_of_a.iter().copied().fold(f32::MIN, f32::max));
            let ups = wholes[2][v * lanes..][..lanes].iter().copied();
            assert_eq!(reduced[0][v], 7);
            assert_eq!(Some(reduced[1][v]), ups.clone().min());
            assert_eq!(Some(reduced[2][v]), ups.max());
        }
    }
}

struct Compress<'a>(&'a [f32; MAX_LANES], u32);

impl Kernel for Compress<'_> {
    /// Lanes, and what was kept of them.
    type Output = (usize, Vec<f32>);

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let mut out = [0.0; MAX_LANES];
        S::F32::load(s, self.0).compress(self.1).store(&mut out);
        (S::LANES, out.to_vec())
    }
}

#[test]
fn compress_brings_the_named_lanes_to_the_front() {
    let lanes: [f32; MAX_LANES] = std::array::from_fn(|l| l as f32 + 1.0);
    for isa in Isa::available() {
        for bits in (0..1 << MAX_LANES).step_by(if cfg!(miri) { 997 } else { 1 }) {
            let (n, out) = isa.run(Compress(&lanes, bits));
            let named = (0..n).filter(|l| bits >> l & 1 == 1).map(|l| lanes[l]);
            let count = named.clone().count();
            assert!(out[..count].iter().copied().eq(named), "{} {bits:b}", isa.name());
        }
    }
}

struct Rasters<'a>(&'a [u16], &'a [u16]);

impl Kernel for Rasters<'_> {
    /// The greater of each pair, and per vector whether one of the first is not below that of the second.
    type Output = (Vec<u16>, Vec<bool>);

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let lanes = S::U16::LANES;
        assert_eq!(lanes, 2 * S::LANES);
        let (mut greater, mut any) = (vec![0; self.0.len()], vec![]);
        let pairs = self.0.chunks_exact(lanes).zip(self.1.chunks_exact(lanes));
        for ((a, b), to) in pairs.zip(greater.chunks_exact_mut(lanes)) {
            let (a, b) = (S::U16::load(s, a), S::U16::load(s, b));
            a.max(b).store(to);
            any.push(a.any_ge(b));
            assert!(S::U16::splat(s, 9).any_ge(S::U16::splat(s, 9)));
        }
        (greater, any)
    }
}

#[test]
fn rasters_are_compared_as_unsigned_numbers() {
    let a: Vec<u16> = (0..6400u32).map(|i| ((i * 40_503) >> 3) as u16 / 2).collect();
    let b: Vec<u16> = (0..6400u32).map(|i| 60_000 - (i % 64 * 700) as u16).collect();
    for isa in Isa::available() {
        let (greater, any) = isa.run(Rasters(&a, &b));
        assert!(greater.iter().copied().eq(a.iter().zip(&b).map(|(a, b)| *a.max(b))));
        let lanes = a.len() / any.len();
        let pairs = a.chunks(lanes).zip(b.chunks(lanes));
        let expected: Vec<bool> =
            pairs.map(|(a, b)| a.iter().zip(b).any(|(a, b)| a >= b)).collect();
        assert_eq!(any, expected, "{}", isa.name());
        assert!(any.contains(&true) && any.contains(&false));
    }
}
