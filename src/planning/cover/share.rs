//! The fewest sets that cover a share of what can be covered.
//!
//! # Pseudo-code
//!
//! ```text
//! greedy: of the sets whose gain is within 1 % of the greatest, the first, until the share is covered; then leave out what is needless
//! lower bound, before each choice, with weight f covered: any k sets add at most the k greatest gains together;
//!     so no cover has fewer than the least k with f + k greatest gains ≥ share
//! lower bound by prices: give every element a price p such that the prices in no set sum to more than 1, and none is above λ times its weight;
//!     a cover's sets pay for all it covers, so no cover has fewer than  Σ p − λ·(weight that the share leaves out)  sets;
//!     prices start as the weights and rise, again and again, where all sets that hold the element are far below the dearest
//! exact, for every k from the bound up to one below what greedy found:
//!     depth first, greatest gain first; leave a branch whose weight and greatest gains left are below the share
//!     no cover: the bound is k + 1; too much work: the bound stays
//! preference, of the covers with that many sets, with the sets in their order, best first:
//!     the fewest first sets of the order among which there is such a cover (bisected): the last of them is taken
//!     again with one set less, among those before it
//! ```
//!
//! The weight that sets cover is submodular: a gain only ever shrinks when more is covered (Minoux 1978). The prices
//! are a solution of the dual of the linear program.

use super::Cover;

/// Of the greatest gain, for those taken as equal to it.
const NEARLY: f64 = 0.99;
/// Gains that the exact search computes at most.
const MOST_GAINS: usize = 400_000;
/// Times that prices are changed, and how fast.
const N_PRICINGS: usize = 200;
const RISE: f64 = 0.3;
/// Roundings of sums, as a share of all weight.
const ROUNDING: f64 = 1e-9;

/// A small cover of at least `share` of the weight that `n_sets` sets hold together, the smallest if that is found in
/// time; `holds(set, element)`. Sets with a lower number are preferred where gains are nearly equal.
///
/// ```
/// use deepmill::planning::cover::cover_share;
/// // One set holds nine of ten elements, another the last.
/// let cover = cover_share(2, &[1.0; 10], |set, element| (element == 9) == (set == 1), 0.9);
/// assert_eq!((cover.chosen.clone(), cover.is_smallest()), (vec![0], true));
/// assert_eq!(cover_share(2, &[1.0; 10], |set, e| (e == 9) == (set == 1), 1.0).chosen, [0, 1]);
/// ```
///
/// # Panics
/// If a weight is negative or not finite, or the share is not from 0 to 1.
pub fn cover_share(
    n_sets: usize,
    weights: &[f64],
    holds: impl Fn(usize, usize) -> bool,
    share: f64,
) -> Cover {
    let mut problem = Problem::new(n_sets, weights, holds, share);
    let (mut chosen, mut at_least) = problem.greedy();
    problem.leave_out_needless(&mut chosen);
    if at_least < chosen.len() {
        at_least = at_least.max(problem.priced());
    }
    while at_least < chosen.len() {
        let all: Vec<usize> = (0..n_sets).collect();
        let mut taken = Vec::new();
        let nothing = vec![0; problem.n_words()];
        match problem.search(at_least, 0.0, &nothing, &all, &mut taken) {
            Outcome::Found => chosen = taken,
            Outcome::None => at_least += 1,
            Outcome::TooMuchWork => break,
        }
    }
    let (chosen, adds) = problem.in_order(&chosen);
    Cover { chosen, adds, at_least }
}

/// As [`cover_share`], and of all covers with as few sets one whose worst set is the best that it can be, of these one
/// whose second worst is, and
/// so on; `order` has every set once, best first. How few sets do is not touched: the number and its proof are those of
/// [`cover_share`], unless the
/// search finds fewer on the way.
///
/// ```
/// use deepmill::planning::cover::cover_share_preferring;
/// // Every set holds all: the number alone says nothing.
/// let cover = cover_share_preferring(3, &[1.0; 10], |_, _| true, 1.0, &[2, 0, 1]);
/// assert_eq!((cover.chosen.clone(), cover.is_smallest()), (vec![2], true));
/// ```
///
/// # Panics
/// If `order` does not have every set once, or as [`cover_share`].
pub fn cover_share_preferring(
    n_sets: usize,
    weights: &[f64],
    holds: impl Fn(usize, usize) -> bool,
    share: f64,
    order: &[usize],
) -> Cover {
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    assert!(sorted.iter().copied().eq(0..n_sets), "every set once");
    let found = cover_share(n_sets, weights, &holds, share);
    let mut problem = Problem::new(n_sets, weights, &holds, share);
    let chosen = problem.preferred(found.chosen, order);
    let (chosen, adds) = problem.in_order(&chosen);
    Cover { chosen, adds, at_least: found.at_least }
}

/// As [`cover_share`], without the exact search: for many sets, or where the number is all that is of interest.
pub fn greedy_share(
    n_sets: usize,
    weights: &[f64],
    holds: impl Fn(usize, usize) -> bool,
    share: f64,
) -> Cover {
    let problem = Problem::new(n_sets, weights, holds, share);
    let (mut chosen, at_least) = problem.greedy();
    problem.leave_out_needless(&mut chosen);
    let (chosen, adds) = problem.in_order(&chosen);
    Cover { chosen, adds, at_least }
}

enum Outcome {
    Found,
    None,
    TooMuchWork,
}

struct Problem {
    /// A bit per element.
    sets: Vec<Vec<u64>>,
    weights: Vec<f64>,
    target: f64,
    n_gains: usize,
}

/// Calls `then` with every element of a set, ascending.
fn each(set: &[u64], then: impl FnMut(usize)) {
    each_of(set.iter().copied(), then);
}

fn each_of(words: impl Iterator<Item = u64>, mut then: impl FnMut(usize)) {
    for (w, mut word) in words.enumerate() {
        while word != 0 {
            then(64 * w + word.trailing_zeros() as usize);
            word &= word - 1;
        }
    }
}

fn sum(set: &[u64], of: &[f64]) -> f64 {
    let mut sum = 0.0;
    each(set, |e| sum += of[e]);
    sum
}

fn unite(into: &mut [u64], with: &[u64]) {
    into.iter_mut().zip(with).for_each(|(a, b)| *a |= b);
}

/// The first of those nearly as great as the greatest; none if all are zero.
fn first_of_greatest(gains: &[f64]) -> Option<usize> {
    let greatest = gains.iter().fold(0.0, |a: f64, b| a.max(*b));
    gains.iter().position(|gain| *gain > 0.0 && *gain >= NEARLY * greatest)
}

impl Problem {
    fn new(
        n_sets: usize,
        weights: &[f64],
        holds: impl Fn(usize, usize) -> bool,
        share: f64,
    ) -> Self {
        super::assert_weights(weights);
        assert!((0.0..=1.0).contains(&share), "the share is {share}, expected 0 to 1");
        let set = |set: usize| {
            let mut words = vec![0u64; weights.len().div_ceil(64)];
            (0..weights.len())
                .filter(|&e| holds(set, e))
                .for_each(|e| words[e / 64] |= 1 << (e % 64));
            words
        };
        let sets: Vec<Vec<u64>> = (0..n_sets).map(set).collect();
        let is_held = |e: &usize| sets.iter().any(|set| set[e / 64] >> (e % 64) & 1 == 1);
        let total: f64 = (0..weights.len()).filter(is_held).map(|e| weights[e]).sum();
        let target = (share - ROUNDING) * total;
        Problem { sets, weights: weights.to_vec(), target, n_gains: 0 }
    }

    fn n_words(&self) -> usize {
        self.weights.len().div_ceil(64)
    }

    /// Weight that a set adds to what is covered.
    fn gain(&self, set: usize, covered: &[u64]) -> f64 {
        let new = self.sets[set].iter().zip(covered).map(|(word, covered)| word & !covered);
        let mut sum = 0.0;
        each_of(new, |e| sum += self.weights[e]);
        sum
    }

    fn union(&self, set: usize, covered: &[u64]) -> Vec<u64> {
        self.sets[set].iter().zip(covered).map(|(a, b)| a | b).collect()
    }

    /// The greedy choice, and a number of sets that no cover goes below.
    fn greedy(&self) -> (Vec<usize>, usize) {
        let (mut covered, mut weight) = (vec![0; self.n_words()], 0.0);
        let (mut chosen, mut at_least) = (Vec::new(), 0);
        while weight < self.target {
            let gains: Vec<f64> =
                (0..self.sets.len()).map(|set| self.gain(set, &covered)).collect();
            // Only weights of zero are left.
            let Some(set) = first_of_greatest(&gains) else { break };
            at_least = at_least.max(self.fewest(weight, gains.clone()));
            covered = self.union(set, &covered);
            weight += gains[set];
            chosen.push(set);
        }
        (chosen, at_least)
    }

    /// A number of sets that no cover goes below, from prices of the elements: see the module.
    fn priced(&self) -> usize {
        let n = self.weights.len();
        let mut held = vec![0; self.n_words()];
        self.sets.iter().for_each(|set| unite(&mut held, set));
        let mut prices = vec![0.0; n];
        each(&held, |e| prices[e] = self.weights[e]);
        let mut best: f64 = 0.0;
        for _ in 0..N_PRICINGS {
            let loads: Vec<f64> = self.sets.iter().map(|set| sum(set, &prices)).collect();
            let greatest = loads.iter().fold(0.0, |a: f64, b| a.max(*b));
            if greatest == 0.0 {
                return 0;
            }
            prices.iter_mut().for_each(|price| *price /= greatest);
            best = best.max(self.value(&prices));
            // What only lightly loaded sets hold may cost more.
            let mut load = vec![0.0f64; n];
            for (set, of_set) in self.sets.iter().zip(&loads) {
                each(set, |e| load[e] = load[e].max(of_set / greatest));
            }
            prices
                .iter_mut()
                .zip(load)
                .for_each(|(price, load)| *price *= 1.0 + RISE * (1.0 - load));
        }
        (best - ROUNDING.sqrt()).ceil() as usize
    }

    /// The bound that prices prove, capped as is best.
    fn value(&self, prices: &[f64]) -> f64 {
        let mut rates: Vec<(f64, f64)> = (prices.iter().zip(&self.weights))
            .filter(|(price, _)| **price > 0.0)
            .map(|(price, weight)| (price / weight, *weight))
            .collect();
        rates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = rates.iter().map(|(_, weight)| weight).sum();
        let left_out = (total - self.target).max(0.0);
        // With the cap at a rate: what is cheaper at its price, the rest at the cap, less what is left out at the cap.
        let (mut cheaper, mut above, mut best) = (0.0, total, 0.0f64);
        for (rate, weight) in rates {
            best = best.max(cheaper + rate * (above - left_out));
            cheaper += rate * weight;
            above -= weight;
        }
        best
    }

    /// The least number of gains whose sum is enough.
    fn fewest(&self, mut weight: f64, mut gains: Vec<f64>) -> usize {
        gains.sort_by(|a, b| b.total_cmp(a));
        let mut n = 0;
        while weight < self.target && n < gains.len() {
            weight += gains[n];
            n += 1;
        }
        n
    }

    /// Leaves out sets, the last first, whose rest is enough.
    fn leave_out_needless(&self, chosen: &mut Vec<usize>) {
        for k in (0..chosen.len()).rev() {
            let rest: Vec<usize> = chosen.iter().copied().filter(|set| *set != chosen[k]).collect();
            if self.in_order(&rest).1.iter().sum::<f64>() >= self.target {
                *chosen = rest;
            }
        }
    }

    /// Whether `n` more of `of` are enough; those are left in `taken`.
    fn search(
        &mut self,
        n: usize,
        weight: f64,
        covered: &[u64],
        of: &[usize],
        taken: &mut Vec<usize>,
    ) -> Outcome {
        if weight >= self.target {
            return Outcome::Found;
        }
        if n == 0 {
            return Outcome::None;
        }
        self.n_gains += of.len();
        if self.n_gains > MOST_GAINS {
            return Outcome::TooMuchWork;
        }
        let mut gains: Vec<(f64, usize)> =
            of.iter().map(|&set| (self.gain(set, covered), set)).collect();
        gains.retain(|(gain, _)| *gain > 0.0);
        gains.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for k in 0..gains.len() {
            let most: f64 = gains[k..].iter().take(n).map(|(gain, _)| gain).sum();
            if weight + most < self.target {
                break;
            }
            let (gain, set) = gains[k];
            taken.push(set);
            let rest: Vec<usize> = gains[k + 1..].iter().map(|(_, set)| *set).collect();
            let covered = self.union(set, covered);
            match self.search(n - 1, weight + gain, &covered, &rest, taken) {
                Outcome::None => taken.pop(),
                other => return other,
            };
        }
        Outcome::None
    }

    /// A cover with no more sets than `chosen`, as good as can be in `order`: see the module. What is too much work is
    /// left as it is.
    fn preferred(&mut self, mut chosen: Vec<usize>, order: &[usize]) -> Vec<usize> {
        self.n_gains = 0;
        let place = |set: &usize| order.iter().position(|other| other == set);
        let mut settled: Vec<usize> = Vec::new();
        let mut n_allowed = order.len();
        while settled.len() < chosen.len() {
            let n = chosen.len() - settled.len();
            // `chosen` itself is a cover among the sets up to its worst that is not settled.
            let open = chosen.iter().filter(|set| !settled.contains(set));
            let worst = open.filter_map(place).max().expect("a set that is not settled") + 1;
            let (mut fails, mut does) = (n - 1, worst.min(n_allowed));
            while does - fails > 1 {
                let middle = fails + (does - fails) / 2;
                match self.with_settled(&settled, n, &order[..middle]) {
                    Some(found) => {
                        chosen = found;
                        let open = chosen.iter().filter(|set| !settled.contains(set));
                        does = open.filter_map(place).max().map_or(middle, |place| place + 1);
                    }
                    None => fails = middle,
                }
            }
            if chosen.len() > settled.len() {
                settled.push(order[does - 1]);
                n_allowed = does - 1;
            }
        }
        chosen
    }

    /// A cover of the settled sets and at most `n` of these.
    fn with_settled(&mut self, settled: &[usize], n: usize, of: &[usize]) -> Option<Vec<usize>> {
        let mut covered = vec![0; self.n_words()];
        settled.iter().for_each(|&set| unite(&mut covered, &self.sets[set]));
        let (weight, mut taken) = (sum(&covered, &self.weights), settled.to_vec());
        let outcome = self.search(n, weight, &covered, of, &mut taken);
        matches!(outcome, Outcome::Found).then_some(taken)
    }

    /// The sets, one after the other the one that adds most, or the first of nearly equal ones, with what each adds;
    /// those that add nothing are left out.
    fn in_order(&self, sets: &[usize]) -> (Vec<usize>, Vec<f64>) {
        let mut left = sets.to_vec();
        left.sort_unstable();
        let (mut covered, mut chosen, mut adds) = (vec![0; self.n_words()], Vec::new(), Vec::new());
        loop {
            let gains: Vec<f64> = left.iter().map(|&set| self.gain(set, &covered)).collect();
            let Some(k) = first_of_greatest(&gains) else { return (chosen, adds) };
            let (set, gain) = (left[k], gains[k]);
            covered = self.union(set, &covered);
            left.retain(|other| *other != set);
            chosen.push(set);
            adds.push(gain);
        }
    }
}

#[cfg(test)]
mod tests;
