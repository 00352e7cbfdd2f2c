//! The search for labels: which queries does some obstacle collide with, in one direction?
//!
//! The greatest height of all obstacles decides most queries. Each step of finite radius, the widest first,
//! puts what is still open to a grid of the obstacles high enough to matter:
//!
//! ```text
//! open = queries that the greatest height of all obstacles leaves undecided
//! for each step of finite radius, the widest first:
//!     queries = open, without those that the answer cache calls collision-free
//!     grid = obstacles above the lowest threshold of the queries, in cells
//!     upper, lower = heights of the cells dilated by the outer, the inner disc of the step's radius
//!     for each query:
//!         threshold above upper:   no obstacle is in the step
//!         threshold below lower:   the query collides
//!         between:                 test the obstacles of the cells around by the predicate
//! ```
//!
//! For a wide step only the obstacles of the annulus between the two discs are tested, together for a group of
//! neighbors; for a narrow one all, query by query.

mod answer_cache;
mod cell_bins;
mod disc;
mod obstacle_grid;

use super::super::kernels::{GROUP, groups, set_bits};
use super::super::predicate::StepSquared;
use crate::simd::{Float32, Kernel, Mask, Simd, Vector};
use crate::spatial::{Coordinates, PADDING};
pub use answer_cache::AnswerCache;
use cell_bins::Extent;
use obstacle_grid::{Cylinders, ObstacleGrid};

/// Queries of a word of bits; padded coordinates fill whole words.
const WORD: usize = 64;
const _: () = assert!(PADDING.is_multiple_of(WORD) && WORD.is_multiple_of(GROUP));

/// Sets the bit of every query at which some obstacle collides.
pub struct Search<'a> {
    /// Reference points in the direction's frame.
    pub centers: &'a Coordinates,
    /// The cutter: heights ascend, radii never shrink.
    pub steps: &'a [StepSquared],
    /// Obstacles in the direction's frame, padding at height −∞.
    pub obstacles: &'a Coordinates,
    /// Height of the obstacle that is the query itself, −∞ for none; as long as the centers.
    pub own_z: &'a [f32],
    /// Bits of the queries, zeroed.
    pub row: &'a mut [u64],
    /// Receives the queries whose own obstacle is high enough to matter; their bits stay 0.
    pub undecided: &'a mut Vec<u32>,
    /// Answers of searches with the same centers in this direction; those of this one are recorded.
    pub cache: Option<&'a mut AnswerCache>,
    /// Reused from search to search.
    pub scratch: &'a mut SearchScratch,
}

/// Memory of a search: a bit per query.
#[derive(Debug, Default)]
pub struct SearchScratch {
    /// Not decided yet.
    open: Vec<u64>,
    /// The step at hand may decide it.
    queried: Vec<u64>,
    /// Some step might have decided it.
    ever_queried: Vec<u64>,
    /// Obstacles were tested for it.
    tested: Vec<u64>,
    grid: ObstacleGrid,
}

/// How queries were decided.
#[derive(Debug, Clone, Copy, Default)]
pub struct Searched {
    /// By the greatest height alone.
    pub by_height: u64,
    /// By the answers for other cutters.
    pub by_cache: u64,
    /// By the rasters alone.
    pub by_grid: u64,
    /// Obstacles tested for the others.
    pub tested: u64,
}

impl Kernel for Search<'_> {
    type Output = Searched;

    #[inline(always)]
    fn run<S: Simd>(mut self, s: S) -> Searched {
        let infinite = |step: &StepSquared| step.radius_squared == f32::INFINITY;
        let n_finite = self.steps.iter().position(infinite).unwrap_or(self.steps.len());
        let mut done = self.by_height(s, self.steps.get(n_finite));
        let n_open = count(&self.scratch.open);
        let steps = &self.steps[..n_finite];
        self.recall(steps);
        for step in steps.iter().rev() {
            let n_queries = self.choose(step);
            if n_queries == 0 {
                continue;
            }
            let extent = self.extent(s);
            let floor = extent.least[2] + step.height;
            if self.scratch.grid.fill(s, (self.obstacles, floor), step, &extent, n_queries) {
                done.tested += self.query(s, step);
            }
            if let Some(cache) = &mut self.cache {
                cache.record(step, &self.scratch.queried, &self.scratch.open);
            }
        }
        let n_queried = self.cache.map_or(n_open, |_| count(&self.scratch.ever_queried));
        done.by_cache = n_open - n_queried;
        done.by_grid = n_queried - count(&self.scratch.tested);
        done
    }
}

impl Search<'_> {
    /// Decides what the greatest height of all obstacles decides; the rest is open. `shaft` is the first
    /// infinitely wide step.
    #[inline(always)]
    fn by_height<S: Simd>(&mut self, s: S, shaft: Option<&StepSquared>) -> Searched {
        let highest = highest(s, &self.obstacles.z);
        let first = S::F32::splat(s, self.steps[0].height);
        // Nothing is higher than infinity.
        let shaft = S::F32::splat(s, shaft.map_or(f32::INFINITY, |step| step.height));
        let n = self.centers.n;
        let mut by_height = 0;
        let SearchScratch { open, tested, ever_queried, .. } = &mut *self.scratch;
        for bits in [&mut *open, tested, ever_queried] {
            bits.clear();
            bits.resize(n.div_ceil(WORD), 0);
        }
        let queries = words(&self.centers.z).iter().zip(words(self.own_z));
        for (word, (to, (z, own_z))) in open.iter_mut().zip(queries).enumerate() {
            let (mut own, mut reached, mut hit) = (0, 0, 0);
            for at in (0..WORD).step_by(S::LANES) {
                let z = S::F32::load(s, &z[at..]);
                let contact = z + first;
                own |= u64::from(S::F32::load(s, &own_z[at..]).gt(contact).bits()) << at;
                reached |= u64::from(highest.gt(contact).bits()) << at;
                hit |= u64::from(highest.gt(z + shaft).bits()) << at;
            }
            let valid = !0 >> (WORD * (word + 1)).saturating_sub(n);
            own &= valid;
            hit &= valid & !own;
            *to = reached & valid & !hit & !own;
            by_height += u64::from((valid & !own & !*to).count_ones());
            self.row[word] |= hit;
            for half in 0..2 {
                for place in set_bits((own >> (32 * half)) as u32) {
                    self.undecided.push((WORD * word + 32 * half + place) as u32);
                }
            }
        }
        Searched { by_height, ..Searched::default() }
    }

    /// Decides the open queries at which some obstacle is known to be in one of the steps.
    #[inline(always)]
    fn recall(&mut self, steps: &[StepSquared]) {
        let SearchScratch { open, queried: hits, .. } = &mut *self.scratch;
        let Some(cache) = &self.cache else { return };
        hits.clear();
        hits.resize(open.len(), 0);
        cache.hits(steps, hits);
        for ((open, hits), row) in open.iter_mut().zip(hits).zip(&mut *self.row) {
            *row |= *hits & *open;
            *open &= !*hits;
        }
    }

    /// Chooses the open queries that this step may decide, and counts them.
    #[inline(always)]
    fn choose(&mut self, step: &StepSquared) -> u64 {
        let SearchScratch { open, queried, ever_queried, .. } = &mut *self.scratch;
        queried.clone_from(open);
        if let Some(cache) = &self.cache {
            cache.keep_open(step, queried);
            ever_queried.iter_mut().zip(&*queried).for_each(|(ever, queried)| *ever |= queried);
        }
        count(queried)
    }

    /// What the chosen queries span.
    #[inline(always)]
    fn extent<S: Simd>(&self, s: S) -> Extent {
        let (inf, minus_inf) =
            (S::F32::splat(s, f32::INFINITY), S::F32::splat(s, f32::NEG_INFINITY));
        let (mut least, mut greatest) = ([inf; 3], [minus_inf; 3]);
        let axes = [words(&self.centers.x), words(&self.centers.y), words(&self.centers.z)];
        for (word, &bits) in self.scratch.queried.iter().enumerate().filter(|(_, bits)| **bits != 0)
        {
            for at in (0..WORD).step_by(S::LANES) {
                let chosen = S::F32::mask_from_bits(s, (bits >> at) as u32);
                for axis in 0..3 {
                    let lanes = S::F32::load(s, &axes[axis][word][at..]);
                    least[axis] = least[axis].min(lanes.select(chosen, inf));
                    greatest[axis] = greatest[axis].max(lanes.select(chosen, minus_inf));
                }
            }
        }
        Extent::of(least, greatest)
    }

    /// Puts the chosen queries to the grid, group by group; the obstacles tested.
    #[inline(always)]
    fn query<S: Simd>(&mut self, s: S, step: &StepSquared) -> u64 {
        let SearchScratch { open, queried, tested, grid, .. } = &mut *self.scratch;
        let [x, y, z] = [groups(&self.centers.x), groups(&self.centers.y), groups(&self.centers.z)];
        let height = S::F32::splat(s, step.height);
        let mut n_tested = 0;
        for (word, &bits) in queried.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            for at in (0..WORD).step_by(GROUP) {
                let wanted = (bits >> at) as u32 & GROUP_BITS;
                if wanted == 0 {
                    continue;
                }
                let group = (WORD * word + at) / GROUP;
                let mut above = [0.0; GROUP];
                for lane in (0..GROUP).step_by(S::LANES) {
                    (S::F32::load(s, &z[group][lane..]) + height).store(&mut above[lane..]);
                }
                let (x, y) = (&x[group], &y[group]);
                let cylinders = Cylinders { x, y, above: &above, within: step.radius_squared };
                let answers = grid.answer(s, &cylinders, wanted);
                open[word] &= !(u64::from(answers.hit) << at);
                self.row[word] |= u64::from(answers.hit) << at;
                tested[word] |= u64::from(answers.tested) << at;
                n_tested += answers.n_tested;
            }
        }
        n_tested
    }
}

/// Bits of a whole group.
const GROUP_BITS: u32 = (1 << GROUP) - 1;

#[inline(always)]
fn words(axis: &[f32]) -> &[[f32; WORD]] {
    axis.as_chunks().0
}

/// The greatest of these heights, in all lanes.
#[inline(always)]
fn highest<S: Simd>(s: S, z: &[f32]) -> S::F32 {
    let mut highest = S::F32::splat(s, f32::NEG_INFINITY);
    for z in z.chunks_exact(S::LANES) {
        highest = highest.max(S::F32::load(s, z));
    }
    S::F32::splat(s, highest.reduce_max())
}

fn count(bits: &[u64]) -> u64 {
    bits.iter().map(|word| u64::from(word.count_ones())).sum()
}
