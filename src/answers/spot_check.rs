//! When enough answers are computed: a spot check of the others bounds the share of them that is wrong.

use super::share_limit::{greatest_mean, sample_size, upper_limit};
use super::{SiteAnswer, SiteAnswers, check_bound, check_probabilities};
use crate::Result;
use crate::numeric::rng::{Purpose, Stream};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Probability with which a [`SpotCheck`]'s limit holds, for every part and predictor.
pub const CONFIDENCE: f64 = 0.95;

/// The last of the random samples of the predicted answers that were computed to compare.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SpotCheck {
    /// Number of samples drawn, each of what was left by the ones before.
    pub n_rounds: usize,
    /// Number of sites in the last sample.
    pub n_checked: usize,
    /// Number of wrong predictions among them.
    pub n_wrong: usize,
    /// Upper confidence limit, with a confidence of 0.95, of the share of wrong answers among the sites that are not
    /// computed; 0 if all are.
    pub limit: f64,
}

/// As `6 of 420 wrong, at most 1.0 % of the others at 95 %`.
impl fmt::Display for SpotCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SpotCheck { n_checked, n_wrong, limit, .. } = self;
        let (limit, confidence) = (100.0 * limit, 100.0 * CONFIDENCE);
        write!(f, "{n_wrong} of {n_checked} wrong, ")?;
        write!(f, "at most {limit:.2} % of the others at {confidence} %")
    }
}

/// Answers *inaccessible* of which some are computed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SpotChecked {
    /// Computed where [`SpotChecked::verified`] says so, predicted elsewhere.
    pub inaccessible: Vec<bool>,
    /// Per site, whether its answer is computed.
    pub verified: Vec<bool>,
    /// `None` if there was none: all answers are computed.
    pub spot_check: Option<SpotCheck>,
}

impl SiteAnswers {
    /// Computes answers *inaccessible* by `exact`, given indices of sites in ascending order, until a random sample
    /// of those left shows that at most a share of `bound` of the rest is wrong. All of them for a `bound` of 0.
    ///
    /// ```text
    /// u_i = min(p_i, 1 − p_i)                                 p = probability of inaccessible
    /// U = all sites
    /// for round k = 1, 2, …:
    ///     compute the sites of greatest u in U, and take them out   (how many: the cheapest plan, see below)
    ///     compute a random sample S of U: |S| = m, w of them wrong; take it out
    ///     U⁺ = max { x / (|U| − m) : P(at most w wrong in S | w + x wrong in U) > 0.05 / 2^k }
    ///     stop if U⁺ ≤ bound
    /// ```
    ///
    /// The probability over the draws that more than `bound` of what is left is wrong at the end is at most Σ 0.05 /
    /// 2^k ≤ 5 %: whatever the rounds before have shown, `S` is a fresh sample of a set chosen before it was drawn.
    /// Whether probabilities are right does not matter for that, only for the number of answers computed.
    ///
    /// The plan: a share `r` of wrong ones is expected among the surest sites, from their `u` and from the samples so
    /// far; so few of the least certain and so large a sample that it passes with a probability of 80 %, at the least
    /// cost. All are computed if nothing saves a tenth of those left.
    ///
    /// # Errors
    /// If `bound` is not in [0, 1], there is not one probability in [0, 1] per site, or `exact` fails.
    ///
    /// # Panics
    /// If `exact` gives another number of answers than it is asked for.
    #[doc(hidden)] // of evaluation
    pub fn verify_by_spot_checks(
        &self,
        (bound, seed): (f64, u64),
        mut exact: impl FnMut(&[usize]) -> Result<Vec<bool>>,
    ) -> Result<SpotChecked> {
        let n = self.len();
        check_bound(bound)?;
        let probabilities = self.probability_inaccessible();
        check_probabilities(probabilities, n)?;
        let uncertainty = |i: usize| {
            let p = probabilities[i];
            f64::from(p.min(1.0 - p))
        };
        let mut result = SpotChecked {
            inaccessible: self.inaccessible(),
            verified: vec![false; n],
            spot_check: None,
        };
        let mut left: Vec<usize> = (0..n).collect();
        left.sort_by(|&a, &b| uncertainty(a).total_cmp(&uncertainty(b)).then(b.cmp(&a)));
        let mut seen: Vec<(f64, bool)> = Vec::new();
        let mut risk = 1.0 - CONFIDENCE;
        for round in 1.. {
            risk *= 0.5;
            let of_left: Vec<f64> = left.iter().map(|&i| uncertainty(i)).collect();
            let plan = Some(bound).filter(|bound| *bound > 0.0);
            let plan = plan.and_then(|bound| Plan::new(&of_left, &mut seen, bound, risk));
            let plan = plan.unwrap_or(Plan { n_kept: 0, n_checked: 0 });
            let mut compute = left.split_off(plan.n_kept);
            Stream::new(seed, round as u64, 0, Purpose::SpotCheck).shuffle(&mut left);
            let sample: Vec<usize> = left.drain(..plan.n_checked).collect();
            compute.extend(&sample);
            compute.sort_unstable();
            if !compute.is_empty() {
                let answers = exact(&compute)?;
                assert_eq!(answers.len(), compute.len(), "one answer for each site asked for");
                for (&i, answer) in compute.iter().zip(answers) {
                    (result.inaccessible[i], result.verified[i]) = (answer, true);
                }
            }
            if plan.n_kept == 0 {
                result.spot_check.iter_mut().for_each(|check| check.limit = 0.0);
                break;
            }
            let predicted = |i: usize| self.of(i) == SiteAnswer::Inaccessible;
            let wrong = |i: &usize| result.inaccessible[*i] != predicted(*i);
            let n_wrong = sample.iter().filter(|i| wrong(i)).count();
            seen.extend(sample.iter().map(|i| (uncertainty(*i), wrong(i))));
            let limit = upper_limit(plan.n_kept, sample.len(), n_wrong, risk);
            let n_checked = sample.len();
            result.spot_check = Some(SpotCheck { n_rounds: round, n_checked, n_wrong, limit });
            if limit <= bound {
                break;
            }
            left.sort_by(|&a, &b| uncertainty(a).total_cmp(&uncertainty(b)).then(b.cmp(&a)));
        }
        Ok(result)
    }
}

/// What to compute in a round.
struct Plan {
    /// Number of the surest sites that are not computed, or only in the sample.
    n_kept: usize,
    /// Size of the sample of these.
    n_checked: usize,
}

impl Plan {
    /// The probability with which a plan should pass.
    const POWER: f64 = 0.8;
    /// The predictor's own probabilities count as much as this many answers seen.
    const PRIOR: f64 = 100.0;
    /// All are computed if a plan would save less than one in so many.
    const LEAST_SAVED: usize = 10;
    /// Samples that may hold more wrong answers than this are not considered.
    const MOST_WRONG: usize = 40;

    /// `uncertainty` of the sites left, ascending; `seen` are the ones sampled in earlier rounds, uncertain and wrong.
    /// `None` if all are to be computed.
    fn new(uncertainty: &[f64], seen: &mut [(f64, bool)], bound: f64, risk: f64) -> Option<Self> {
        let n = uncertainty.len();
        let expected = Plan::expected_shares(uncertainty, seen);
        let (mut best, mut cost) = (None, n - n / Plan::LEAST_SAVED);
        for n_wrong in 0..=Plan::MOST_WRONG {
            let n_checked = sample_size(n, n_wrong, bound, risk);
            if n_checked >= cost {
                break;
            }
            let most = greatest_mean(n_wrong, Plan::POWER);
            let passes = |share: &f64| share * n_checked as f64 <= most;
            let Some(n_kept) = expected.iter().rposition(passes).map(|i| i + 1) else { continue };
            let n_checked = sample_size(n_kept, n_wrong, bound, risk);
            if n - n_kept + n_checked < cost {
                cost = n - n_kept + n_checked;
                best = Some(Plan { n_kept, n_checked });
            }
        }
        best
    }

    /// Per number of surest sites, less 1, the share of wrong ones to expect among them. Those seen that are as sure
    /// are a random sample of them.
    fn expected_shares(uncertainty: &[f64], seen: &mut [(f64, bool)]) -> Vec<f64> {
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut as_sure = seen.iter().peekable();
        let (mut sum, mut n_seen, mut n_wrong) = (0.0, 0.0, 0.0);
        let mut shares = Vec::with_capacity(uncertainty.len());
        for (i, u) in uncertainty.iter().enumerate() {
            sum += u;
            while let Some((_, wrong)) = as_sure.next_if(|(of_seen, _)| of_seen <= u) {
                n_seen += 1.0;
                n_wrong += f64::from(u8::from(*wrong));
            }
            let by_itself = sum / (i + 1) as f64;
            shares.push((n_wrong + Plan::PRIOR * by_itself) / (n_seen + Plan::PRIOR));
        }
        shares
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::NetworkEvidence;
    use crate::exec::par;

    /// Predictions that say "no" with the uncertainties of a part, and the truth.
    fn part(n: usize, mut of: impl FnMut(usize) -> (f64, bool)) -> (SiteAnswers, Vec<bool>) {
        let (uncertain, wrong): (Vec<f64>, Vec<bool>) = (0..n).map(&mut of).unzip();
        let probabilities = uncertain.iter().map(|u| *u as f32).collect();
        let evidence = NetworkEvidence::new(probabilities, vec![]);
        (SiteAnswers::new(vec![false; n], vec![]).with_network(evidence), wrong)
    }

    /// What is found, and the share of wrong answers that are left.
    fn check(
        (predicted, truth): &(SiteAnswers, Vec<bool>),
        bound: (f64, u64),
    ) -> (SpotChecked, f64) {
        let exact = |of: &[usize]| Ok(of.iter().map(|&i| truth[i]).collect());
        let found = predicted.verify_by_spot_checks(bound, exact).unwrap();
        let n_wrong = found.inaccessible.iter().zip(truth).filter(|(a, b)| a != b).count();
        (found.clone(), n_wrong as f64 / (truth.len() - n_verified(&found)).max(1) as f64)
    }

    fn n_verified(found: &SpotChecked) -> usize {
        found.verified.iter().filter(|verified| **verified).count()
    }

    const KINDS: usize = 10;

    /// Predictors that are right about themselves, too sure, sure and wrong, or wrong by just so much that chance may
    /// pass them.
    fn simulated(kind: usize, n: usize, bound: f64, seed: u64) -> (SiteAnswers, Vec<bool>) {
        let mut stream = Stream::new(seed, kind as u64, 0, Purpose::Probe);
        part(n, |i| {
            let skewed = 0.5 * stream.unit().powi(8);
            let (uncertain, wrong) = match kind {
                0 => (skewed, skewed),
                1 => (skewed, 5.0 * skewed),
                2 => (skewed, 0.2 * skewed),
                3 => (skewed, bound * 1.05),
                4 => (1e-6, bound * 1.1),
                5 => (1e-6, bound * 1.3),
                6 => (skewed, if skewed < 1e-4 { 3.0 * bound } else { 0.0 }),
                7 => (skewed, 1.0),
                8 => (1e-6, if i < n / 20 { 0.4 } else { 0.5 * bound }),
                _ => (0.5 - skewed, 0.0),
            };
            (uncertain, stream.chance(wrong))
        })
    }

    #[test]
    fn at_most_one_of_twenty_parts_has_more_wrong_than_the_bound_whatever_the_predictor() {
        for kind in 0..KINDS {
            let (n, bound) = if kind % 2 == 0 { (1500, 0.02) } else { (800, 0.05) };
            let above = |seed: usize| {
                let part = simulated(kind, n, bound, seed as u64);
                check(&part, (bound, seed as u64)).1 > bound
            };
            let above = par::map(1000, above).into_iter().filter(|above| *above).count();
            assert!(above <= 50, "kind {kind}: {above} of 1000");
        }
    }

    #[test]
    fn a_predictor_that_is_right_about_itself_passes_at_once_and_a_sure_one_that_is_wrong_never() {
        let right = |seed: usize| {
            let mut stream = Stream::new(seed as u64, 0, 0, Purpose::Probe);
            let part = part(7000, |_| {
                let uncertain = 0.5 * stream.unit().powi(40);
                (uncertain, stream.chance(uncertain))
            });
            let found = check(&part, (0.01, 0)).0;
            let SpotCheck { n_rounds, limit, .. } = found.spot_check.unwrap();
            assert!(limit <= 0.01 && n_verified(&found) < 3500, "{}", n_verified(&found));
            n_rounds == 1
        };
        let at_once = par::map(40, right).into_iter().filter(|at_once| *at_once).count();
        assert!(at_once >= 26, "{at_once} of 40, where 32 are to be expected");
        let (found, _) = check(&part(7000, |_| (1e-6, true)), (0.01, 0));
        let SpotCheck { n_wrong, n_checked, limit, .. } = found.spot_check.unwrap();
        assert_eq!((n_wrong, limit, n_verified(&found)), (n_checked, 0.0, 7000));
    }

    #[test]
    fn nothing_is_computed_for_a_bound_of_one_and_all_for_none() {
        let part = simulated(1, 500, 0.1, 3);
        let (found, _) = check(&part, (1.0, 0));
        assert_eq!((n_verified(&found), &found.inaccessible), (0, &part.0.inaccessible()));
        for bound in [0.0, 1e-3] {
            let (found, _) = check(&part, (bound, 0));
            assert_eq!((n_verified(&found), &found.inaccessible), (500, &part.1));
            assert_eq!(found.spot_check, None, "no sample of 500 shows less than one in 1,000");
        }
        let (found, _) = check(&(SiteAnswers::default(), vec![]), (0.1, 0));
        assert_eq!(found, SpotChecked::default());
        assert!(part.0.verify_by_spot_checks((1.5, 0), |_| Ok(vec![])).is_err());
        let without = SiteAnswers::new(vec![true], vec![]);
        assert!(without.verify_by_spot_checks((0.1, 0), |_| Ok(vec![])).is_err());
    }

    #[test]
    fn samples_follow_from_the_seed_are_fresh_and_are_asked_for_once() {
        let part = simulated(1, 3000, 0.02, 5);
        let (first, second) = (check(&part, (0.02, 1)).0, check(&part, (0.02, 2)).0);
        assert_eq!(first, check(&part, (0.02, 1)).0);
        assert_ne!(first.verified, second.verified);
        let mut asked = vec![0; 3000];
        let mut exact = |of: &[usize]| {
            assert!(of.is_sorted());
            of.iter().for_each(|&i| asked[i] += 1);
            Ok(of.iter().map(|&i| part.1[i]).collect())
        };
        let found = part.0.verify_by_spot_checks((0.02, 1), &mut exact).unwrap();
        let computed: Vec<bool> = asked.iter().map(|n| *n == 1).collect();
        assert_eq!(computed, found.verified);
        assert!(found.spot_check.unwrap().n_rounds > 1);
    }

    /// All are as sure: what is computed is the sample. Over many seeds each site is in it as often.
    #[test]
    fn every_site_is_as_likely_to_be_checked() {
        let part = part(200, |_| (0.0, false));
        let mut times = vec![0u32; 200];
        for seed in 0..2000 {
            let found = check(&part, (0.1, seed)).0;
            times.iter_mut().zip(&found.verified).for_each(|(n, v)| *n += u32::from(*v));
        }
        let p = f64::from(times.iter().sum::<u32>()) / 400_000.0;
        let variance = 2000.0 * p * (1.0 - p);
        let squares = times.iter().map(|n| (f64::from(*n) - 2000.0 * p).powi(2) / variance);
        // Chi-squared with 199 degrees of freedom: mean 199, standard deviation 20; four of them.
        let sum: f64 = squares.sum();
        assert!((119.0..279.0).contains(&sum), "{sum} of share {p}");
    }

    #[test]
    fn words_tell_what_was_found() {
        let check = SpotCheck { n_rounds: 1, n_checked: 420, n_wrong: 6, limit: 0.0099 };
        let words = "6 of 420 wrong, at most 0.99 % of the others at 95 %";
        assert_eq!(check.to_string(), words);
    }
}
