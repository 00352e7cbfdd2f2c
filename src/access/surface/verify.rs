//! Predict, then verify: sites are computed until a spot check of the others shows how few are wrong.

use super::labels::SurfaceOptions;
use super::obstacles::{TriangleObstacles, count_beta};
use super::tool::Outline;
use crate::Result;
use crate::access::Counted;
use crate::answers::{SiteAnswer, SiteAnswers, SpotCheck, SpotChecked, mark_top_share, of_sites};
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;
use serde::{Deserialize, Serialize};

/// Answers of which some are computed and the others predicted.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Verified {
    /// Inaccessible, as computed where [`Verified::verified`] says so and as predicted elsewhere; occlusion points,
    /// by β where [`Verified::counted`] says so and as predicted elsewhere; that the tip does not fit, `false` where
    /// it was not computed; the probabilities predicted.
    pub answers: SiteAnswers,
    /// Per site, whether its answer is computed.
    pub verified: Vec<bool>,
    /// Per site: pairs (inaccessible site, direction tested) in which it is in the steps of the shrunk tool, for the
    /// answers' inaccessible sites; 0 where it was not counted; empty if occlusion points are not wanted.
    #[doc(hidden)] // of the program
    pub beta: Vec<u64>,
    /// Per site, whether its β is counted; empty if occlusion points are not wanted.
    #[doc(hidden)] // of the program
    pub counted: Vec<bool>,
    /// What is known of the answers *inaccessible* that are not computed; `None` if all are, without any check.
    pub spot_check: Option<SpotCheck>,
}

impl Verified {
    /// Number of sites that were computed.
    pub fn n_verified(&self) -> usize {
        self.verified.iter().filter(|verified| **verified).count()
    }

    /// Share of the sites that were computed; 0 if there are no sites.
    pub fn share_verified(&self) -> f64 {
        self.n_verified() as f64 / self.verified.len().max(1) as f64
    }

    /// Share of the sites whose β is counted; 0 if there are no sites.
    pub fn share_counted(&self) -> f64 {
        let n_counted = self.counted.iter().filter(|counted| **counted).count();
        n_counted as f64 / self.counted.len().max(1) as f64
    }

    /// The predicted ones that were not counted, then those of greatest β.
    fn occlusion_points(&self, share: f64) -> Vec<bool> {
        let probabilities = self.answers.probability_occlusion();
        let rank = |i: usize| {
            let predicted = !self.counted[i] && probabilities[i] > 0.5;
            (predicted, self.beta[i])
        };
        let ranks: Vec<(bool, u64)> = (0..self.beta.len()).map(rank).collect();
        let mut marks = mark_top_share(&ranks, share, Ord::cmp);
        marks.iter_mut().zip(ranks).for_each(|(mark, rank)| *mark &= rank != (false, 0));
        marks
    }
}

impl TriangleObstacles {
    /// Computes sites, as [`TriangleObstacles::label`] does, until a random sample of the others, drawn with `seed`,
    /// shows with a confidence of 0.95 that at most a share of `bound` of them has a wrong answer
    /// *inaccessible* ([`SiteAnswers::verify_by_spot_checks`]); all with a `bound` of 0. Then the β that may decide
    /// which are occlusion points, as [`TriangleObstacles::label`] does, from these answers and the predicted
    /// ones of the other sites. Counts of directions and clearances are not computed.
    ///
    /// ```text
    /// q_i = probability of occlusion
    /// v_i = min(q_i, 1 − q_i)      share of wrong answers to expect, if probabilities are frequencies
    /// count β of the sites of greatest v, as few as leave others of mean v ≤ bound · share,
    ///     over the sites now known or predicted to be inaccessible
    /// occlusion points = share · n: the others with q > ½, then of the counted ones those of greatest β
    /// ```
    ///
    /// Of occlusion points nothing is shown: which β are counted rests on the probabilities alone. β is counted of
    /// all sites where there are no probabilities `q`, or the options' share is not the tenth that they are about.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`] and [`SiteAnswers::verify_by_spot_checks`]; if there are not as many
    /// predictions as sites.
    pub fn verify(
        &self,
        sites: &Sites,
        (cutter, directions): (&Cutter, &Directions),
        options: &SurfaceOptions,
        predicted: &SiteAnswers,
        (bound, seed): (f64, u64),
    ) -> Result<Verified> {
        let _floats = par::DefaultFloats::set();
        options.check()?;
        predicted.check_sites(sites)?;
        let mut tip_does_not_fit = vec![false; sites.len()];
        let checked = predicted.verify_by_spot_checks((bound, seed), |of| {
            let exact = self.surface_labels(
                &sites.subset(of),
                cutter,
                directions,
                &options.for_few(of.len()),
            )?;
            for (&i, answer) in of.iter().zip(&exact.answers) {
                tip_does_not_fit[i] = *answer == SiteAnswer::TipDoesNotFit;
            }
            Ok(exact.inaccessible())
        })?;
        let SpotChecked { inaccessible, verified, spot_check } = checked;
        let mut result = Verified {
            answers: SiteAnswers {
                of_sites: of_sites(&inaccessible, &tip_does_not_fit),
                tests_tip: true,
                accessible_directions: Vec::new(),
                ..predicted.clone()
            },
            verified,
            spot_check,
            ..Verified::default()
        };
        result.answers.occlusion.clear();
        if options.occlusion {
            let outline = Outline::new(cutter, options.finish_mm);
            let tolerance = options.tolerance.of_triangles(&outline, &self.chords, &self.bvh)?.most;
            let counted = sites_to_count(predicted, bound, options.share)?;
            let marked = &result.answers.inaccessible()[..];
            let chosen = (sites, Counted::Chosen(&counted));
            let beta = count_beta(chosen, (cutter, tolerance), directions, marked)?;
            (result.beta, result.counted) = (vec![0; sites.len()], vec![false; sites.len()]);
            for (i, beta) in counted.into_iter().zip(beta) {
                (result.beta[i], result.counted[i]) = (beta, true);
            }
            result.answers.occlusion = result.occlusion_points(options.share);
        }
        Ok(result)
    }
}

/// The sites whose β may decide which are occlusion points.
pub(crate) fn sites_to_count(
    predicted: &SiteAnswers,
    bound: f64,
    share: f64,
) -> Result<Vec<usize>> {
    if predicted.probability_occlusion().is_empty() || share != SurfaceOptions::default().share {
        return Ok((0..predicted.len()).collect());
    }
    predicted.least_certain_occlusion(bound * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::NetworkEvidence;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use glam::DVec3;

    #[test]
    fn verifying_all_is_labeling_and_who_is_wrong_and_sure_is_found_out() {
        let part = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
        let sites = sample(&part, &SiteOptions { n_sites: 1200, ..Default::default() }).unwrap();
        let cutter: Cutter = "1.5,20,20,5".parse().unwrap();
        let directions: Directions = "60".parse().unwrap();
        let options = SurfaceOptions::default();
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        let exact = obstacles.label(&sites, &cutter, &directions, &options).unwrap();
        // Wrong everywhere, and sure of it at the first half of the sites.
        let wrong = |i: usize| {
            let sure = if i < 600 { 0.995 } else { 0.6 };
            if exact.answers.is_inaccessible(i) { 1.0 - sure } else { sure }
        };
        let probability_inaccessible: Vec<f32> = (0..1200).map(wrong).collect();
        let inaccessible = probability_inaccessible.iter().map(|p| *p > 0.5).collect();
        let evidence = NetworkEvidence::new(probability_inaccessible, Vec::new());
        let predicted = SiteAnswers::new(inaccessible, vec![false; 1200]).with_network(evidence);
        let verify = |bound: f64| {
            let with = (&cutter, &directions);
            obstacles.verify(&sites, with, &options, &predicted, (bound, 0)).unwrap()
        };
        let all = verify(0.0);
        assert_eq!((all.n_verified(), all.spot_check), (1200, None));
        assert_eq!(all.answers.inaccessible(), exact.answers.inaccessible());
        assert_eq!(all.answers.tip_does_not_fit(), exact.answers.tip_does_not_fit());
        assert_eq!(all.answers.occlusion, exact.answers.occlusion);
        assert_eq!(all.beta, exact.beta);
        // Half of it is sure at 0.5 % expected, and all of that is wrong.
        let found_out = verify(0.05);
        let check = found_out.spot_check.unwrap();
        assert!(check.n_wrong == check.n_checked && check.n_checked > 0, "{check:?}");
        let others = (0..1200).filter(|&i| !found_out.verified[i]);
        let wrong =
            others.filter(|&i| predicted.is_inaccessible(i) != exact.answers.is_inaccessible(i));
        assert!(wrong.count() as f64 <= 0.05 * (1200 - found_out.n_verified()) as f64);
        for i in (0..1200).filter(|&i| found_out.verified[i]) {
            assert_eq!(found_out.answers.of(i), exact.answers.of(i), "{i}");
        }
        for n_threads in [1, 3] {
            let again = par::with_threads(n_threads, || verify(0.05)).unwrap();
            assert_eq!(again, found_out, "{n_threads} threads");
        }
        assert_eq!(verify(1.0).answers.inaccessible(), predicted.inaccessible());
        assert_eq!(all.share_counted(), 1.0, "there are no probabilities of occlusion");
        let few = SiteAnswers::new(vec![true], vec![]);
        let with = (&cutter, &directions);
        assert!(obstacles.verify(&sites, with, &options, &few, (0.1, 0)).is_err());
    }

    #[test]
    fn beta_is_counted_where_occlusion_is_in_doubt_and_is_that_of_the_labels() {
        let part = solids::torus(20.0, 6.0, 40, 20);
        let sites = sample(&part, &SiteOptions { n_sites: 400, ..Default::default() }).unwrap();
        let cutter: Cutter = "1.5,4,30,5".parse().unwrap();
        let directions: Directions = "60".parse().unwrap();
        let options = SurfaceOptions::default();
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        let exact = obstacles.label(&sites, &cutter, &directions, &options).unwrap();
        // Right about accessibility. In doubt, and wrong, about occlusion at every third site, else right and sure.
        let occlusion = |i: usize| match (i % 3, exact.answers.occlusion[i]) {
            (0, marked) => 0.5 - 0.1 * (f32::from(u8::from(marked)) - 0.5),
            (_, marked) => f32::from(u8::from(marked)),
        };
        let inaccessible = exact.answers.inaccessible();
        let evidence = NetworkEvidence::new(
            inaccessible.iter().map(|&m| f32::from(u8::from(m))).collect(),
            (0..400).map(occlusion).collect(),
        );
        let predicted = SiteAnswers::new(inaccessible, vec![false; 400]).with_network(evidence);
        let verify = |options: &SurfaceOptions, bound: f64| {
            let with = (&cutter, &directions);
            obstacles.verify(&sites, with, options, &predicted, (bound, 0)).unwrap()
        };
        let some = verify(&options, 1e-3);
        assert_eq!(some.answers.occlusion, exact.answers.occlusion);
        for i in 0..400 {
            assert_eq!(some.counted[i], i % 3 == 0, "{i}");
            assert_eq!(some.beta[i], if i % 3 == 0 { exact.beta[i] } else { 0 }, "{i}");
        }
        assert!(exact.answers.occlusion.iter().step_by(3).any(|marked| *marked));
        let all = verify(&options, 0.0);
        assert_eq!((&all.beta, all.answers.occlusion), (&exact.beta, exact.answers.occlusion));
        let other_share = SurfaceOptions { share: 0.2, ..options };
        assert_eq!(verify(&other_share, 1e-3).beta, exact.beta);
        let none = SurfaceOptions { occlusion: false, ..options };
        assert!(verify(&none, 1e-3).counted.is_empty());
    }
}
