//! The fewest sets that cover all that can be covered: tools for a part, setups, fixtures.
//!
//! # Pseudo-code
//!
//! ```text
//! signature of an element = the sets that hold it; elements of one signature are one, those whose signature contains another's follow from it
//! greedy: while something is left, take the set that holds most of the weight that is left
//! lower bound: signatures without a common set need a set each (a greedy packing)
//! exact, by branch and bound: take the signature with the fewest sets; one of these must be taken: try each;
//!     leave a branch whose sets and lower bound together are no fewer than the best so far
//! ```
//!
//! Greedy covers with at most `H(m)` times the fewest sets, `H(m) = 1 + 1/2 + … + 1/m` for sets of at most `m`
//! signatures (Chvátal 1979), if it counts signatures; here it weighs them, so what is stated is the lower bound.

mod share;

pub(crate) use share::greedy_share;
#[doc(hidden)] // of the plans of setups and of the program
pub use share::{cover_share, cover_share_preferring};

use serde::{Deserialize, Serialize};
use std::cmp::Reverse;

/// Sets that cover all that can be covered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Cover {
    /// The sets, in the order of what each adds to those before it, most first.
    pub chosen: Vec<usize>,
    /// Weight that each adds.
    pub adds: Vec<f64>,
    /// No cover has fewer sets.
    pub at_least: usize,
}

impl Cover {
    /// Whether it is proven that no cover has fewer sets.
    pub fn is_smallest(&self) -> bool {
        self.chosen.len() <= self.at_least
    }
}

/// Branches that are tried before the best cover so far is taken.
const MOST_BRANCHES: usize = 200_000;

/// A set of sets, a bit for each.
type Bits = Vec<u64>;

fn is_subset(a: &Bits, b: &Bits) -> bool {
    a.iter().zip(b).all(|(a, b)| a & !b == 0)
}

fn is_disjoint(a: &Bits, b: &Bits) -> bool {
    a.iter().zip(b).all(|(a, b)| a & b == 0)
}

fn members(bits: &Bits) -> impl Iterator<Item = usize> + '_ {
    (0..64 * bits.len()).filter(|k| bits[k / 64] >> (k % 64) & 1 == 1)
}

/// What counts as a weight.
pub(crate) fn is_weight(weight: f64) -> bool {
    weight >= 0.0 && weight.is_finite()
}

fn assert_weights(weights: &[f64]) {
    if let Some(i) = weights.iter().position(|weight| !is_weight(*weight)) {
        panic!("weight {i} is {}, expected 0 or more", weights[i]);
    }
}

/// A small cover of the elements by `n_sets` sets, the smallest if that is found in time; `holds(set, element)`. Ties
/// go to the lower number.
///
/// # Panics
/// If a weight is negative or not finite.
#[doc(hidden)] // of the program
pub fn cover(n_sets: usize, weights: &[f64], holds: impl Fn(usize, usize) -> bool) -> Cover {
    assert_weights(weights);
    let signature = |element: usize| {
        let mut bits = vec![0u64; n_sets.div_ceil(64)];
        (0..n_sets).filter(|&set| holds(set, element)).for_each(|k| bits[k / 64] |= 1 << (k % 64));
        bits
    };
    let mut signatures: Vec<(Bits, f64)> =
        weights.iter().enumerate().map(|(i, w)| (signature(i), *w)).collect();
    signatures.retain(|(bits, _)| bits.iter().any(|word| *word != 0));
    signatures.sort_by(|a, b| a.0.cmp(&b.0));
    signatures.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        kept.1 += if same { next.1 } else { 0.0 };
        same
    });
    let greedy = greedy(n_sets, &signatures);
    let search = Search::new(&signatures, greedy.clone());
    let (best, at_least) = search.run();
    let (chosen, adds) = ordered(&best, &signatures);
    Cover { chosen, adds, at_least }
}

/// The sets in the order in which a greedy choice takes them.
fn greedy(n_sets: usize, signatures: &[(Bits, f64)]) -> Vec<usize> {
    ordered(&(0..n_sets).collect::<Vec<_>>(), signatures).0
}

/// Of `sets`, one after the other the one that adds most; those that add nothing are left out. With what each adds.
fn ordered(sets: &[usize], signatures: &[(Bits, f64)]) -> (Vec<usize>, Vec<f64>) {
    let mut left: Vec<&(Bits, f64)> = signatures.iter().collect();
    let (mut chosen, mut adds) = (Vec::new(), Vec::new());
    while !left.is_empty() {
        let holds = |set: usize, bits: &Bits| bits[set / 64] >> (set % 64) & 1 == 1;
        let gain = |set: usize| -> f64 {
            left.iter().filter(|(bits, _)| holds(set, bits)).map(|(_, weight)| weight).sum()
        };
        // Something is left only as long as a set holds it.
        let hits = |set: &usize| left.iter().any(|(bits, _)| holds(*set, bits));
        let best = sets.iter().copied().filter(hits).map(|set| (gain(set), Reverse(set)));
        let best = best.max_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let Some((gain, Reverse(set))) = best else { break };
        left.retain(|(bits, _)| !holds(set, bits));
        chosen.push(set);
        adds.push(gain);
    }
    (chosen, adds)
}

struct Search {
    /// Those that no other is a subset of, fewest sets first.
    signatures: Vec<Bits>,
    best: Vec<usize>,
    n_branches: usize,
}

impl Search {
    fn new(signatures: &[(Bits, f64)], best: Vec<usize>) -> Self {
        let mut all: Vec<Bits> = signatures.iter().map(|(bits, _)| bits.clone()).collect();
        let size = |bits: &Bits| bits.iter().map(|word| word.count_ones()).sum::<u32>();
        all.sort_by_key(|bits| (size(bits), bits.clone()));
        let mut kept: Vec<Bits> = Vec::new();
        for bits in all {
            if !kept.iter().any(|smaller| is_subset(smaller, &bits)) {
                kept.push(bits);
            }
        }
        Search { signatures: kept, best, n_branches: 0 }
    }

    /// The best cover, and a number of sets that none goes below.
    fn run(mut self) -> (Vec<usize>, usize) {
        let open: Vec<usize> = (0..self.signatures.len()).collect();
        let bound = self.lower_bound(&open);
        let is_complete = self.branch(&mut Vec::new(), &open);
        let mut best = self.best;
        best.sort_unstable();
        let at_least = if is_complete { best.len() } else { bound };
        (best, at_least)
    }

    /// Signatures without a common set need a set each.
    fn lower_bound(&self, open: &[usize]) -> usize {
        let mut packed: Vec<&Bits> = Vec::new();
        for &k in open {
            let bits = &self.signatures[k];
            if packed.iter().all(|other| is_disjoint(other, bits)) {
                packed.push(bits);
            }
        }
        packed.len()
    }

    /// Whether everything was tried.
    fn branch(&mut self, taken: &mut Vec<usize>, open: &[usize]) -> bool {
        if open.is_empty() {
            if taken.len() < self.best.len() {
                self.best = taken.clone();
            }
            return true;
        }
        if taken.len() + self.lower_bound(open) >= self.best.len() {
            return true;
        }
        self.n_branches += 1;
        if self.n_branches > MOST_BRANCHES {
            return false;
        }
        let sets: Vec<usize> = members(&self.signatures[open[0]]).collect();
        for set in sets {
            let holds = |k: &usize| self.signatures[*k][set / 64] >> (set % 64) & 1 == 1;
            let left: Vec<usize> = open.iter().copied().filter(|k| !holds(k)).collect();
            taken.push(set);
            let is_complete = self.branch(taken, &left);
            taken.pop();
            if !is_complete {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn the_smallest_cover_is_found_where_greedy_takes_one_too_many() {
        // Two rows of seven; greedy takes the columns' blocks of 8, 4 and 2 first.
        let sets: [&[usize]; 5] = [
            &[0, 1, 2, 3, 4, 5, 6],
            &[7, 8, 9, 10, 11, 12, 13],
            &[3, 4, 5, 6, 10, 11, 12, 13],
            &[1, 2, 8, 9],
            &[0, 7],
        ];
        let cover = cover(5, &[1.0; 15], |set, element| sets[set].contains(&element));
        assert_eq!((cover.chosen.clone(), cover.adds.clone()), (vec![0, 1], vec![7.0, 7.0]));
        assert!(cover.is_smallest());
    }

    #[test]
    fn covers_are_as_small_as_by_trying_all() {
        let mut stream = Stream::new(3, 0, 0, Purpose::Probe);
        for _ in 0..200 {
            let n_sets = 1 + (stream.range(0.0, 9.0)) as usize;
            let density = stream.range(0.05, 0.6);
            let held: Vec<Vec<bool>> = (0..n_sets)
                .map(|_| (0..30).map(|_| stream.range(0.0, 1.0) < density).collect())
                .collect();
            let weights: Vec<f64> = (0..30).map(|_| stream.range(0.1, 2.0)).collect();
            let found = cover(n_sets, &weights, |set, element| held[set][element]);
            let covered =
                |sets: &[usize]| (0..30).filter(|&e| sets.iter().any(|&s| held[s][e])).count();
            let all: Vec<usize> = (0..n_sets).collect();
            assert_eq!(covered(&found.chosen), covered(&all));
            let fewest = (0..1u32 << n_sets)
                .filter(|mask| {
                    let sets: Vec<usize> =
                        all.iter().copied().filter(|s| mask >> s & 1 == 1).collect();
                    covered(&sets) == covered(&all)
                })
                .map(u32::count_ones)
                .min();
            assert_eq!((found.chosen.len() as u32, found.is_smallest()), (fewest.unwrap(), true));
            let weight: f64 =
                (0..30).filter(|&e| held.iter().any(|set| set[e])).map(|e| weights[e]).sum();
            assert!((found.adds.iter().sum::<f64>() - weight).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_to_cover_needs_nothing() {
        let none = Cover { chosen: vec![], adds: vec![], at_least: 0 };
        assert_eq!(cover(0, &[1.0], |_, _| true), none);
        assert_eq!(cover(3, &[], |_, _| true), none);
        assert_eq!(cover(3, &[1.0], |_, _| false), none);
        assert_eq!(cover(70, &[1.0; 70], |set, element| set == element).chosen.len(), 70);
    }
}
