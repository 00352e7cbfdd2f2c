//! The collision matrix: one bit per direction and query, set where the cutter collides.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// One bit per direction and query, `[n_dirs, n_queries]` row-major: set where the cutter collides.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct CollisionMatrix {
    n_queries: usize,
    rows: Vec<Vec<u64>>,
}

/// As it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    n_queries: usize,
    rows: Vec<Vec<u64>>,
}

impl TryFrom<Unchecked> for CollisionMatrix {
    type Error = Error;

    fn try_from(Unchecked { n_queries, rows }: Unchecked) -> Result<Self> {
        let n_words = n_queries.div_ceil(64);
        let past_the_end = |words: &[u64]| match (words.last(), n_queries % 64) {
            (Some(last), n @ 1..) => last >> n != 0,
            _ => false,
        };
        match rows.iter().position(|row| row.len() != n_words || past_the_end(row)) {
            None => Ok(CollisionMatrix::new(n_queries, rows)),
            Some(i) => {
                let expected = format!("{n_words} words for {n_queries} queries, 0 past the end");
                let remedy = "label again, with the collision matrix";
                Err(Error::argument(
                    "rows of a collision matrix",
                    format!("row {i}"),
                    expected,
                    remedy,
                ))
            }
        }
    }
}

impl CollisionMatrix {
    pub(super) fn new(n_queries: usize, rows: Vec<Vec<u64>>) -> Self {
        CollisionMatrix { n_queries, rows }
    }

    /// Number of directions.
    pub fn n_dirs(&self) -> usize {
        self.rows.len()
    }

    /// Number of queries.
    pub fn n_queries(&self) -> usize {
        self.n_queries
    }

    /// Whether the cutter collides at `query` in `direction`.
    ///
    /// # Panics
    /// If either is out of range.
    pub fn collides(&self, direction: usize, query: usize) -> bool {
        assert!(query < self.n_queries);
        self.rows[direction][query / 64] >> (query % 64) & 1 == 1
    }

    /// Bits of one direction: query `i` is bit `i % 64` of word `i / 64`, bits past the end are 0.
    ///
    /// # Panics
    /// If the direction is out of range.
    pub fn words(&self, direction: usize) -> &[u64] {
        &self.rows[direction]
    }

    /// Former query `p` becomes query `order[p]`.
    pub(super) fn reordered(self, order: &[u32]) -> CollisionMatrix {
        let rows = self.rows.iter().map(|row| {
            let mut moved = vec![0; row.len()];
            for (p, &i) in order.iter().enumerate() {
                moved[i as usize / 64] |= (row[p / 64] >> (p % 64) & 1) << (i % 64);
            }
            moved
        });
        CollisionMatrix { rows: rows.collect(), ..self }
    }

    /// Per query, whether it collides in every direction, in how many it does not, and the first of
    /// those.
    pub(super) fn summary(&self) -> (Vec<bool>, Vec<u32>, Vec<Option<u32>>) {
        let n_words = self.n_queries.div_ceil(64);
        let blocks = crate::exec::par::map_blocks(n_words, SUMMARY_BLOCK, |words| {
            words.map(|word| self.word_summary(word)).collect::<Vec<_>>()
        });
        let summaries = blocks.into_iter().flatten();
        let mut counts = Vec::with_capacity(64 * n_words);
        let mut witness = Vec::with_capacity(64 * n_words);
        for (accessible, first) in summaries {
            counts.extend(accessible);
            witness.extend(first.map(|k| (k != u32::MAX).then_some(k)));
        }
        counts.truncate(self.n_queries);
        witness.truncate(self.n_queries);
        (counts.iter().map(|&n| n == 0).collect(), counts, witness)
    }

    /// Number of accessible directions and the first of them for the 64 queries of a word.
    ///
    /// Counts are kept bit-sliced: bit `l` of `planes[b]` is bit `b` of the count of query `l`.
    fn word_summary(&self, word: usize) -> ([u32; 64], [u32; 64]) {
        let mut planes = [0u64; 32];
        let mut first = [u32::MAX; 64];
        let mut unseen = !0u64;
        for (k, row) in self.rows.iter().enumerate() {
            let accessible = !row[word];
            let mut new = accessible & unseen;
            unseen &= !accessible;
            while new != 0 {
                first[new.trailing_zeros() as usize] = k as u32;
                new &= new - 1;
            }
            let mut carry = accessible;
            for plane in &mut planes {
                if carry == 0 {
                    break;
                }
                (*plane, carry) = (*plane ^ carry, *plane & carry);
            }
        }
        let n_planes = (usize::BITS - self.rows.len().leading_zeros()) as usize;
        let mut counts = [0; 64];
        for (plane, b) in planes[..n_planes.min(32)].iter().zip(0..) {
            for (l, count) in counts.iter_mut().enumerate() {
                *count |= ((plane >> l & 1) as u32) << b;
            }
        }
        (counts, first)
    }
}

/// Words of 64 queries per task of the summary.
const SUMMARY_BLOCK: usize = 16;
