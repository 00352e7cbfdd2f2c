//! What to compute and what comes out.

use super::Stats;
use crate::simd::Level;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// How labels are computed. All engines give the same labels and counts, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Engine {
    /// Plain loops in plain order: the law.
    Reference,
    /// The same tests, eight at a time.
    Batched,
    /// Boxes around obstacles decide most questions, the same tests the rest.
    Pruned,
}

impl Engine {
    /// Every engine, slowest first.
    pub const ALL: [Engine; 3] = [Engine::Reference, Engine::Batched, Engine::Pruned];

    /// `reference`, `batched` or `pruned`.
    pub fn name(self) -> &'static str {
        match self {
            Engine::Reference => "reference",
            Engine::Batched => "batched",
            Engine::Pruned => "pruned",
        }
    }

    /// The engine called `name`.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(name: &str) -> Result<Self> {
        Engine::ALL.into_iter().find(|engine| engine.name() == name).ok_or_else(|| {
            let expected = Engine::ALL.map(Engine::name).join(" or ");
            Error::argument("engine", name, expected, "all engines give the same labels")
        })
    }
}

/// What to compute.
#[derive(Debug, Clone, Copy)]
pub struct LabelOptions {
    /// The engine; pruned by default.
    pub engine: Engine,
    /// Also count β and mark occlusion points (default). Costs several times the labels alone.
    pub occlusion: bool,
    /// Share of the ranked obstacles that are occlusion points, in (0, 1]; the paper's is 0.1.
    pub share: f64,
    /// Also keep the answer for every direction and query, one bit each.
    pub matrix: bool,
    /// SIMD level of the kernels; results do not depend on it.
    pub level: Level,
}

impl Default for LabelOptions {
    fn default() -> Self {
        LabelOptions {
            engine: Engine::Pruned,
            occlusion: true,
            share: 0.1,
            matrix: false,
            level: Level::active(),
        }
    }
}

impl LabelOptions {
    pub(super) fn check(&self) -> Result<()> {
        if self.share > 0.0 && self.share <= 1.0 {
            return Ok(());
        }
        let expected = "above 0, at most 1";
        Err(Error::argument("occlusion share", self.share, expected, "the paper uses 0.1"))
    }
}

/// Exact labels of a set of queries. Arrays follow the order of queries or obstacles as given.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Labels {
    /// Per query: the cutter collides in every direction (class 1 of head 1 in this crate).
    pub inaccessible: Vec<bool>,
    /// Per query: number of directions without collision.
    pub accessible_directions: Vec<u32>,
    /// Per query: the first direction without collision.
    pub witness: Vec<Option<u32>>,
    /// Per obstacle: pairs (inaccessible query, direction) it collides in; empty if not asked for.
    pub beta: Vec<u64>,
    /// Per ranked obstacle (see [`Obstacles`](super::Obstacles)): is an occlusion point; empty if not
    /// asked for.
    pub occlusion: Vec<bool>,
    /// The answer per direction and query, if asked for.
    pub reach: Option<Reach>,
    /// What the engine did.
    pub stats: Stats,
}

impl Labels {
    /// Number of inaccessible queries.
    pub fn n_inaccessible(&self) -> usize {
        self.inaccessible.iter().filter(|&&l| l).count()
    }

    /// Number of occlusion points.
    pub fn n_occlusion(&self) -> usize {
        self.occlusion.iter().filter(|&&l| l).count()
    }
}

/// One bit per direction and query, `[n_dirs, n_queries]` row-major: set where the cutter collides.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reach {
    n_queries: usize,
    rows: Vec<Vec<u64>>,
}

impl Reach {
    pub(super) fn new(n_queries: usize, rows: Vec<Vec<u64>>) -> Self {
        Reach { n_queries, rows }
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
    pub(super) fn reordered(self, order: &[u32]) -> Reach {
        let rows = self.rows.iter().map(|row| {
            let mut moved = vec![0; row.len()];
            for (p, &i) in order.iter().enumerate() {
                moved[i as usize / 64] |= (row[p / 64] >> (p % 64) & 1) << (i % 64);
            }
            moved
        });
        Reach { rows: rows.collect(), ..self }
    }

    /// Per query, whether it collides in every direction, in how many it does not, and the first of
    /// those.
    pub(super) fn summary(&self) -> (Vec<bool>, Vec<u32>, Vec<Option<u32>>) {
        let blocks = crate::par::map_blocks(self.n_queries, SUMMARY_BLOCK, |range| {
            let mut counts = vec![0u32; range.len()];
            let mut first = vec![u32::MAX; range.len()];
            for (k, row) in self.rows.iter().enumerate() {
                let words = row[range.start / 64..].iter();
                for ((counts, first), word) in
                    counts.chunks_mut(64).zip(first.chunks_mut(64)).zip(words)
                {
                    for (l, (count, first)) in counts.iter_mut().zip(first).enumerate() {
                        let free = !(word >> l) as u32 & 1;
                        *count += free;
                        let here = if free == 1 { k as u32 } else { u32::MAX };
                        *first = (*first).min(here);
                    }
                }
            }
            (counts, first)
        });
        let counts: Vec<u32> = blocks.iter().flat_map(|(counts, _)| counts).copied().collect();
        let witness = blocks.iter().flat_map(|(_, first)| first);
        let witness = witness.map(|&k| (k != u32::MAX).then_some(k)).collect();
        (counts.iter().map(|&n| n == 0).collect(), counts, witness)
    }
}

/// Queries per task of the summary; a multiple of 64.
const SUMMARY_BLOCK: usize = 4096;
