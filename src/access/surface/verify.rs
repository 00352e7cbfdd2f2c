//! Predict, then verify: the sites that a prediction is least certain of are computed.

use super::labels::SurfaceOptions;
use super::obstacles::{TriangleObstacles, count_beta};
use super::tool::Outline;
use crate::access::occlusion_points;
use crate::answers::SiteAnswers;
use crate::cutter::Cutter;
use crate::directions::Directions;
use crate::geom::Sites;
use crate::{Result, par};

/// Answers of which some are computed and the others predicted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Verified {
    /// Inaccessible, as computed where [`Verified::verified`] says so and as predicted elsewhere; occlusion points, by β; that the
    /// tip does not fit, `false` where it was not computed; the probabilities predicted.
    pub answers: SiteAnswers,
    /// Per site, whether its answer is computed.
    pub verified: Vec<bool>,
    /// Per site: pairs (inaccessible site, direction tested) in which it is in the steps of the shrunk tool, for the answers' inaccessible
    /// sites; empty if occlusion points are not wanted.
    pub beta: Vec<u64>,
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

    /// Share of wrong answers among the others that their probabilities let expect; 0 if there are none.
    pub fn expected_error(&self) -> f64 {
        let of_others = self.answers.probability_inaccessible.iter().zip(&self.verified);
        let of_others = of_others.filter(|(_, verified)| !**verified).map(|(p, _)| p.min(1.0 - p));
        let (n, sum) = of_others.fold((0u32, 0.0), |(n, sum), p| (n + 1, sum + f64::from(p)));
        sum / f64::from(n.max(1))
    }
}

impl TriangleObstacles {
    /// Computes the sites that are [least certain](SiteAnswers::least_certain), as [`TriangleObstacles::label`] does, and β and
    /// occlusion points, as [`TriangleObstacles::label_sites`] does, from these answers and the predicted ones of the other sites. With a
    /// `bound` of 0 all sites are computed. Counts of directions and clearances are not.
    ///
    /// ```text
    /// u_i = min(p_i, 1 − p_i)                      share of wrong answers to expect, if probabilities are frequencies
    /// compute the sites of greatest u, as few as leave others of mean u ≤ bound
    /// β over the sites now known or predicted to be inaccessible; mark the greatest
    /// ```
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`] and [`SiteAnswers::least_certain`]; if there are not as many predictions as sites.
    pub fn verify(
        &self,
        sites: &Sites,
        (cutter, directions): (&Cutter, &Directions),
        options: &SurfaceOptions,
        predicted: &SiteAnswers,
        bound: f64,
    ) -> Result<Verified> {
        let _floats = par::DefaultFloats::set();
        options.check()?;
        predicted.check_sites(sites)?;
        let chosen = predicted.least_certain(bound)?;
        let subset = sites.subset(&chosen);
        let exact = self.label(&subset, cutter, directions, &options.for_few(chosen.len()))?;
        let mut result = Verified {
            answers: SiteAnswers {
                tip_does_not_fit: vec![false; sites.len()],
                accessible_directions: Vec::new(),
                ..predicted.clone()
            },
            verified: vec![false; sites.len()],
            beta: Vec::new(),
        };
        let (inaccessible, tip) = (exact.inaccessible(), exact.tip_does_not_fit());
        for (k, &i) in chosen.iter().enumerate() {
            result.verified[i] = true;
            result.answers.inaccessible[i] = inaccessible[k];
            result.answers.tip_does_not_fit[i] = tip[k];
        }
        result.answers.occlusion.clear();
        if options.occlusion {
            let outline = Outline::new(cutter);
            let tolerances = options.tolerance.at_sites(&outline, &self.bends, &self.bvh, sites)?;
            let marked = &result.answers.inaccessible;
            result.beta = count_beta(sites, (cutter, &tolerances), directions, marked)?;
            result.answers.occlusion = occlusion_points(&result.beta, options.share);
        }
        Ok(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use glam::DVec3;

    #[test]
    fn verifying_all_is_labeling_and_a_bound_is_kept() {
        let part = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
        let sites = sample(&part, &SiteOptions { n_sites: 400, ..Default::default() }).unwrap();
        let cutter: Cutter = "1.5,20,20,5".parse().unwrap();
        let directions: Directions = "60".parse().unwrap();
        let options = SurfaceOptions::default();
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        let exact = obstacles.label_sites(&sites, &cutter, &directions, &options).unwrap();
        // Wrong everywhere, and sure of it at the first half of the sites.
        let wrong = |i: usize| {
            let sure = if i < 200 { 0.995 } else { 0.6 };
            if exact.answers.inaccessible[i] { 1.0 - sure } else { sure }
        };
        let probability_inaccessible: Vec<f32> = (0..400).map(wrong).collect();
        let inaccessible = probability_inaccessible.iter().map(|p| *p > 0.5).collect();
        let predicted = SiteAnswers {
            probability_inaccessible,
            ..SiteAnswers::new(inaccessible, vec![false; 400])
        };
        let verify = |bound: f64| {
            let with = (&cutter, &directions);
            obstacles.verify(&sites, with, &options, &predicted, bound).unwrap()
        };
        let all = verify(0.0);
        assert_eq!((all.n_verified(), all.expected_error()), (400, 0.0));
        assert_eq!(all.answers.inaccessible, exact.answers.inaccessible);
        assert_eq!(all.answers.tip_does_not_fit, exact.answers.tip_does_not_fit);
        assert_eq!(all.answers.occlusion, exact.answers.occlusion);
        assert_eq!(all.beta, exact.beta);
        let half = verify(0.006);
        assert_eq!(half.n_verified(), 200);
        assert!(half.expected_error() <= 0.006);
        for i in 0..400 {
            let right = half.answers.inaccessible[i] == exact.answers.inaccessible[i];
            assert_eq!(right, half.verified[i], "{i}");
        }
        assert_eq!(verify(1.0).answers.inaccessible, predicted.inaccessible);
        let few = SiteAnswers::new(vec![true], vec![]);
        let with = (&cutter, &directions);
        assert!(obstacles.verify(&sites, with, &options, &few, 0.1).is_err());
    }
}
