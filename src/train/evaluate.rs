//! Evaluation: scores of both heads over samples, pooled and by area.

use super::HeadScore;
use super::reliability::{Bin, Reliability};
use crate::access::surface::{SurfaceOptions, sites_to_count};
use crate::access::{LabelOptions, Labeler};
use crate::answers::SiteAnswers;
use crate::data::Sample;
use crate::exec::processes::{Processes, SingleProcess, share, share_numbers};
use crate::exec::stopwatch::Stopwatch;
use crate::geom::spacing;
use crate::learn::metrics::Confusion;
use crate::model::{Model, Prediction, SiteNetwork};
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;
use crate::{Error, Result};

/// Scores of one way to predict, over a list of samples. The positive classes are *inaccessible* and
/// *occlusion point*.
#[derive(Debug, Clone, Default)]
pub struct Evaluation {
    /// Confusion counts of both heads for each sample.
    #[doc(hidden)] // of the program
    pub samples: Vec<[Confusion; 2]>,
    /// The same for each sample, every site counted by its share of the surface in thousandths of a
    /// mean site's. Points of space all count the same.
    pub(crate) by_area: Vec<[Confusion; 2]>,
    /// Probabilities of both heads against the truth, where there are probabilities.
    #[doc(hidden)] // of the program
    pub reliability: [Reliability; 2],
    /// Sum of the errors of the shares of accessible directions, and number of sites, where both sides tell shares.
    pub(crate) share_errors: (f64, u64),
    /// Wall-clock seconds of all predictions.
    pub seconds: f64,
}

/// Scores of one head.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct HeadScores {
    /// Mean over the samples.
    pub mean: HeadScore,
    /// All sites of all samples in one table.
    pub pooled: HeadScore,
    /// Mean over the samples, sites weighted by the area they stand for.
    pub by_area: HeadScore,
    /// Mean over the samples of the F1 that takes class 1 as positive, as the reference code does.
    pub reference_f1: f64,
    /// [Expected calibration error](Reliability::expected_error) over all sites of all samples.
    pub calibration_error: Option<f64>,
}

impl Evaluation {
    /// Adds the answers for a sample's sites.
    ///
    /// # Errors
    /// If the sample is inconsistent.
    ///
    /// # Panics
    /// If there are not as many answers as sites.
    pub fn add(&mut self, sample: &Sample, answers: &SiteAnswers) -> Result<()> {
        sample.check()?;
        let areas = match sample.is_volume() {
            true => vec![1.0; sample.sites.len()],
            false => spacing::relative_areas(&sample.sites)?,
        };
        let weights: Vec<u64> = areas.iter().map(|a| (1000.0 * a) as u64).collect();
        let truth = &sample.answers;
        let inaccessible = [answers, truth].map(SiteAnswers::inaccessible);
        let heads = [(&inaccessible[0], &inaccessible[1]), (&answers.occlusion, &truth.occlusion)];
        self.samples.push(heads.map(|(found, truth)| Confusion::of_labels(found, truth)));
        self.by_area.push(heads.map(|(found, truth)| Confusion::weighted(found, truth, &weights)));
        let probabilities = [answers.probability_inaccessible(), answers.probability_occlusion()];
        for head in (0..2).filter(|&head| !probabilities[head].is_empty()) {
            self.reliability[head] += Reliability::of(probabilities[head], heads[head].1);
        }
        let (found, counted) = (&answers.accessible_share, &truth.accessible_share);
        if found.len() == counted.len() {
            let error = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).abs();
            self.share_errors.0 += found.iter().zip(counted).map(error).sum::<f64>();
            self.share_errors.1 += found.len() as u64;
        }
        Ok(())
    }

    /// Adds all samples of `other`.
    pub fn append(&mut self, other: &Evaluation) {
        self.samples.extend_from_slice(&other.samples);
        self.by_area.extend_from_slice(&other.by_area);
        for (own, other) in self.reliability.iter_mut().zip(other.reliability) {
            *own += other;
        }
        self.share_errors.0 += other.share_errors.0;
        self.share_errors.1 += other.share_errors.1;
        self.seconds += other.seconds;
    }

    /// Mean absolute error of the share of accessible directions over all sites; `None` if no sample has such shares.
    pub fn share_error(&self) -> Option<f64> {
        let (sum, n) = self.share_errors;
        (n > 0).then(|| sum / n as f64)
    }

    /// Scores of a head: 0 = accessibility, 1 = occlusion; 0 if there are no samples.
    ///
    /// # Panics
    /// If `head` is neither.
    pub fn head(&self, head: usize) -> HeadScores {
        assert!(head < 2, "head {head} is neither 0 (accessibility) nor 1 (occlusion)");
        if self.samples.is_empty() {
            return HeadScores::default();
        }
        let mut pooled = Confusion::default();
        self.samples.iter().for_each(|s| pooled += s[head]);
        // Class 1 of head 1 is "accessible", of head 2 "occlusion".
        let reference = |c: &Confusion| if head == 0 { c.swapped().f1() } else { c.f1() };
        HeadScores {
            mean: mean_scores(&self.samples, head),
            pooled: HeadScore { accuracy: pooled.accuracy(), f1: pooled.f1() },
            by_area: mean_scores(&self.by_area, head),
            reference_f1: mean(&self.samples, head, reference),
            calibration_error: self.reliability[head].expected_error(),
        }
    }

    /// Per-sample averages of both heads.
    pub fn mean(&self) -> [HeadScore; 2] {
        [0, 1].map(|head| mean_scores(&self.samples, head))
    }
}

fn mean_scores(samples: &[[Confusion; 2]], head: usize) -> HeadScore {
    HeadScore {
        accuracy: mean(samples, head, Confusion::accuracy),
        f1: mean(samples, head, Confusion::f1),
    }
}

fn mean(samples: &[[Confusion; 2]], head: usize, score: impl Fn(&Confusion) -> f64) -> f64 {
    samples.iter().map(|s| score(&s[head])).sum::<f64>() / samples.len().max(1) as f64
}

/// Predicts every sample by itself and scores it.
///
/// # Errors
/// If there are no samples, or one is inconsistent.
pub fn evaluate<N: SiteNetwork<f32>>(
    model: &Model<f32, N>,
    samples: &[Sample],
) -> Result<Evaluation> {
    evaluate_together(model, samples, &SingleProcess)
}

/// [`evaluate`] on several processes, which share out the samples. All call it with the same arguments, and have the
/// result.
///
/// # Errors
/// As [`evaluate`], or if another process fails.
pub fn evaluate_together<N: SiteNetwork<f32>>(
    model: &Model<f32, N>,
    samples: &[Sample],
    processes: &dyn Processes,
) -> Result<Evaluation> {
    let answers = |sample: &Sample| Ok([predict(model, sample)?.answers()]);
    let [evaluation] = score(samples, processes, answers)?;
    Ok(evaluation)
}

/// As [`evaluate`], and a second time with the sites that look most like occlusion points, as many as the labels of
/// these options have, in place of those with the greater logit; on several processes as [`evaluate_together`].
///
/// # Errors
/// As [`evaluate_together`].
pub fn evaluate_ranked<N: SiteNetwork<f32>>(
    model: &Model<f32, N>,
    samples: &[Sample],
    options: &LabelOptions,
    processes: &dyn Processes,
) -> Result<[Evaluation; 2]> {
    score(samples, processes, |sample| {
        let prediction = predict(model, sample)?;
        let points = &sample.sites.points;
        let share = options.n_occlusion(points) as f64 / points.len().max(1) as f64;
        Ok([prediction.answers(), prediction.answers_ranked(share)])
    })
}

/// What is left of a network's errors once sites are computed until spot checks pass.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct VerifiedScore {
    /// Share of the sites that are computed, all samples pooled.
    pub computed: f64,
    /// Share of wrong answers *inaccessible* among the others.
    pub wrong: f64,
    /// Share of the samples in which more than the bound of the others are wrong: at most 5 % are to be expected.
    pub above_bound: f64,
    /// Share of the sites whose β is counted.
    pub counted: f64,
    /// Wrong answers *occlusion* among the others, over the number of occlusion points.
    pub wrong_occlusion: f64,
}

/// As [`TriangleObstacles::verify`](crate::access::surface::TriangleObstacles::verify) with this `bound` and the seed
/// 0 would leave every sample.
///
/// On several processes as [`evaluate_together`].
///
/// # Errors
/// As [`evaluate_together`] and [`SiteAnswers::verify_by_spot_checks`].
pub fn evaluate_verified<N: SiteNetwork<f32>>(
    model: &Model<f32, N>,
    samples: &[Sample],
    bound: f64,
    processes: &dyn Processes,
) -> Result<VerifiedScore> {
    let one = |sample: &Sample| -> Result<[usize; 7]> {
        sample.check()?;
        let (answers, truth) = (predict(model, sample)?.answers(), &sample.answers);
        let exact = |of: &[usize]| Ok(of.iter().map(|&i| truth.is_inaccessible(i)).collect());
        let checked = answers.verify_by_spot_checks((bound, 0), exact)?;
        let (n, n_computed) = (truth.len(), checked.verified.iter().filter(|v| **v).count());
        let both = checked.inaccessible.iter().zip(truth.inaccessible());
        let n_wrong = both.filter(|(answer, truth)| *answer != truth).count();
        let counted = sites_to_count(&answers, bound, SurfaceOptions::default().share)?;
        Ok([
            n,
            n_computed,
            n_wrong,
            counted.len(),
            n_wrong_beside(&counted, &answers.occlusion, &truth.occlusion),
            truth.n_occlusion(),
            usize::from(n_wrong as f64 > bound * (n - n_computed) as f64),
        ])
    };
    let own = share(samples.len(), processes.rank(), processes.size());
    let own: Result<Vec<[usize; 7]>> = samples[own].iter().map(one).collect();
    let to_numbers = |own: &Vec<[usize; 7]>| own.iter().flatten().map(|n| *n as f64).collect();
    let (_, counts) = share_numbers(processes, own, to_numbers)?;
    let total = |k: usize| counts.iter().skip(k).step_by(7).sum::<f64>();
    let share = |count: f64, of: f64| count / of.max(1.0);
    Ok(VerifiedScore {
        computed: share(total(1), total(0)),
        wrong: share(total(2), total(0) - total(1)),
        counted: share(total(3), total(0)),
        wrong_occlusion: share(total(4), total(5)),
        above_bound: share(total(6), samples.len() as f64),
    })
}

/// Number of wrong answers at sites that are not among `computed`.
fn n_wrong_beside(computed: &[usize], answers: &[bool], truth: &[bool]) -> usize {
    let wrong = |i: &usize| answers[*i] != truth[*i];
    let n_wrong = (0..truth.len()).filter(wrong).count();
    n_wrong - computed.iter().filter(|i| wrong(i)).count()
}

pub(super) fn predict<N: SiteNetwork<f32>>(
    model: &Model<f32, N>,
    sample: &Sample,
) -> Result<Prediction<f32>> {
    model.predict_shape(&sample.shape())
}

/// Labels every sample with the exact labeler, as the network predicts them: for its time, and for its labels where
/// those of the samples were made with denser obstacles or other directions, or by another program. `options` have
/// share, rounding and bottom rule. On several processes as [`evaluate_together`].
///
/// # Errors
/// If there are no samples, one is inconsistent or its cutter impossible, or another process fails.
pub fn evaluate_exact(
    samples: &[Sample],
    directions: &Directions,
    options: &LabelOptions,
    processes: &dyn Processes,
) -> Result<Evaluation> {
    let labeler = Labeler::of_sites(directions.clone(), *options);
    let [evaluation] = score(samples, processes, |sample| {
        Ok([labeler.answer(&sample.sites, &Cutter::ball_end(sample.cutter)?)?])
    })?;
    Ok(evaluation)
}

/// Each process answers for its share of the samples, and hears of the others'.
fn score<const N: usize>(
    samples: &[Sample],
    processes: &dyn Processes,
    answers: impl Fn(&Sample) -> Result<[SiteAnswers; N]>,
) -> Result<[Evaluation; N]> {
    if samples.is_empty() {
        let remedy = "choose another split, or build a data set with a validation part";
        return Err(Error::argument("the list of samples", "empty", "one sample or more", remedy));
    }
    let one = |sample: &Sample| -> Result<Vec<f64>> {
        let start = Stopwatch::start();
        let answers = answers(sample)?;
        let seconds = start.seconds();
        let mut numbers = Vec::new();
        for answers in &answers {
            let mut evaluation = Evaluation { seconds, ..Evaluation::default() };
            evaluation.add(sample, answers)?;
            numbers.extend(evaluation.sample_to_numbers());
        }
        Ok(numbers)
    };
    let own = share(samples.len(), processes.rank(), processes.size());
    let own: Result<Vec<Vec<f64>>> = samples[own].iter().map(one).collect();
    let (_, all) = share_numbers(processes, own, |own| own.concat())?;
    let mut evaluations: [Evaluation; N] = std::array::from_fn(|_| Evaluation::default());
    for (i, numbers) in all.chunks_exact(all.len() / samples.len() / N).enumerate() {
        evaluations[i % N].append(&Evaluation::sample_from_numbers(numbers));
    }
    Ok(evaluations)
}

impl Evaluation {
    /// The evaluation of a single sample, for other processes.
    fn sample_to_numbers(&self) -> Vec<f64> {
        let counts = [&self.samples[0], &self.by_area[0]];
        let counts = counts.into_iter().flatten().flat_map(|counts| counts.to_array());
        let bins = self.reliability.iter().flat_map(|head| &head.bins);
        let bins = bins.flat_map(|b| [b.n as f64, b.n_positive as f64, b.probability_sum]);
        let first = [self.seconds, self.share_errors.0, self.share_errors.1 as f64];
        first.into_iter().chain(counts.map(|n| n as f64)).chain(bins).collect()
    }

    /// From [`Evaluation::sample_to_numbers`].
    fn sample_from_numbers(numbers: &[f64]) -> Self {
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next().unwrap_or_default();
        let seconds = next();
        let share_errors = (next(), next() as u64);
        let mut counts =
            || [(); 2].map(|()| Confusion::from_array([(); 4].map(|()| next() as u64)));
        let (samples, by_area) = (vec![counts()], vec![counts()]);
        let mut reliability = [Reliability::default(); 2];
        for bin in reliability.iter_mut().flat_map(|head| &mut head.bins) {
            *bin = Bin { n: next() as u64, n_positive: next() as u64, probability_sum: next() };
        }
        Evaluation { samples, by_area, reliability, share_errors, seconds }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::processes::tests::Threads;
    use crate::geom::Sites;
    use crate::tool::cutter::CutterParams;
    use glam::Vec3;
    use std::sync::Arc;

    /// A fine grid on a square and a coarse one beside it, four times as far apart.
    fn two_grids() -> Sample {
        let grid = |n: i32, step: f32, x: f32| {
            (0..n * n)
                .map(move |i| Vec3::new(x + (i % n) as f32 * step, (i / n) as f32 * step, 0.0))
        };
        let points: Vec<Vec3> = grid(20, 1.0, 0.0).chain(grid(20, 4.0, 200.0)).collect();
        let n = points.len();
        let sites = Sites { normals: vec![Vec3::Z; n], points, faces: vec![] };
        Sample {
            surface: None,
            name: "grids".into(),
            sites: Arc::new(sites),
            cutter: CutterParams::from_array([1.0, 1.0, 5.0, 1.0]),
            answers: SiteAnswers::new((0..n).map(|i| i < 400).collect(), vec![false; n]),
        }
    }

    #[test]
    fn sites_that_stand_for_more_surface_count_more() {
        let sample = two_grids();
        let mut evaluation = Evaluation::default();
        evaluation.add(&sample, &SiteAnswers::new(vec![true; 800], vec![false; 800])).unwrap();
        let [first, second] = [0, 1].map(|head| evaluation.head(head));
        assert_eq!(first.mean.accuracy, 0.5);
        assert_eq!(first.mean, first.pooled);
        // The fine grid is 1 of 17 parts of the area; sites at the rims see fewer neighbors.
        assert!((first.by_area.accuracy - 1.0 / 17.0).abs() < 0.01, "{first:?}");
        assert_eq!((second.by_area.accuracy, second.mean.f1), (1.0, 1.0));
    }

    #[test]
    fn sets_join_to_the_scores_of_all_their_samples() {
        let sample = two_grids();
        let (mut all, mut one) = (Evaluation::default(), Evaluation::default());
        one.add(&sample, &SiteAnswers::new(vec![true; 800], vec![false; 800])).unwrap();
        all.add(&sample, &sample.answers).unwrap();
        all.append(&one);
        assert_eq!(all.samples.len(), 2);
        assert_eq!(all.head(0).mean.accuracy, 0.75);
        assert_eq!(all.head(0).reference_f1, 0.5);
    }

    #[test]
    fn all_sites_computed_leave_none_that_is_wrong_and_none_computed_leave_the_errors() {
        let sample = two_grids();
        let model = Model::new(&crate::model::UNetConfig::tiny(), 1).unwrap();
        let verified =
            |bound| evaluate_verified(&model, std::slice::from_ref(&sample), bound, &SingleProcess);
        let all = VerifiedScore { computed: 1.0, counted: 1.0, ..VerifiedScore::default() };
        assert_eq!(verified(0.0).unwrap(), all);
        let right = evaluate(&model, std::slice::from_ref(&sample)).unwrap().head(0).mean.accuracy;
        let none = verified(1.0).unwrap();
        assert!(none.computed == 0.0 && (none.wrong - (1.0 - right)).abs() < 1e-12, "{none:?}");
        assert!(verified(-0.1).is_err());
    }

    #[test]
    fn processes_share_the_samples_and_find_the_same_scores() {
        let sample = two_grids();
        let other =
            Sample { cutter: CutterParams::from_array([2.0, 9.0, 9.0, 1.0]), ..sample.clone() };
        let samples = [other.clone(), sample.clone(), other, sample.clone(), sample];
        let model = Model::new(&crate::model::UNetConfig::tiny(), 1).unwrap();
        let expected = evaluate(&model, &samples).unwrap();
        let probabilities: u64 = expected.reliability[0].bins.iter().map(|bin| bin.n).sum();
        assert_eq!((expected.samples.len(), probabilities), (5, 4000));
        for found in Threads::run(3, |p| evaluate_together(&model, &samples, p).unwrap()) {
            let expected = Evaluation { seconds: found.seconds, ..expected.clone() };
            assert_eq!(format!("{found:?}"), format!("{expected:?}"));
        }
    }

    #[test]
    fn nothing_has_no_score() {
        let model = Model::new(&crate::model::UNetConfig::tiny(), 1).unwrap();
        let message = evaluate(&model, &[]).unwrap_err().to_string();
        assert!(message.contains("list of samples is empty"), "{message}");
        assert_eq!(Evaluation::default().head(0), HeadScores::default());
        assert!(std::panic::catch_unwind(|| Evaluation::default().head(7)).is_err());
    }
}
