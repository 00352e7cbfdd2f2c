//! The predictor: a network behind the interface of the exact labeler.
//!
//! The number of sites need not be that of the training. Sites fewer than the least number are filled up on the part's
//! mesh ([`Predictor::answer_on`]); many are predicted as they are, up to `MANY` times the greatest number, and beyond
//! in groups that each cover the whole part. What that does to the answers is measured in `docs/benchmarks.md`.

use super::domain::Domain;
use super::predict::AnyModel;
use super::prediction::Prediction;
use super::site_network::AnyNetwork;
use crate::answers::{Definition, OutsideDomain, SiteAnswers};
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::{Mesh, Sites};
use crate::spatial::order;
use crate::tool::cutter::{Cutter, CutterParams};
use crate::{Error, Result};

/// Answers as a network predicts; takes and returns what [`Labeler`](crate::access::Labeler) does.
///
#[cfg_attr(feature = "weights", doc = "```")]
#[cfg_attr(not(feature = "weights"), doc = "```ignore")]
/// use deepmill::answers::Definition;
/// use deepmill::geom::{sites, solids};
/// use deepmill::glam::DVec3;
/// use deepmill::model::{Model, Predictor};
///
/// let predictor = Predictor::new(Model::shipped()?);
/// assert_eq!(predictor.definition(), Some(Definition::Part)); // compare with `Labeler::of_part`
/// let part = solids::cuboid(DVec3::new(80.0, 60.0, 40.0));
/// let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(500))?;
/// let cutter = "1.5,6,40,5".parse()?;
/// let answers = predictor.answer_on(&part, &sites, &cutter)?; // 6,500 sites more are placed for the network alone
/// assert_eq!(answers.len(), 500);
/// let message = predictor.answer(&sites, &cutter).unwrap_err().to_string(); // without the part
/// assert!(message.starts_with("number of sites is 500, trained with 7000"));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Predictor {
    model: AnyModel<f32>,
    occlusion_share: Option<f64>,
    far: bool,
    few: bool,
}

/// A network on an octree, whose nodes take means over their sites, predicts up to so many times the sites of its
/// training at once.
const MANY: usize = 4;
/// Seed of the sites that are added: another than that of most callers, whose sites they would repeat.
const SEED: u64 = 0x66_69_6c_6c;

impl Predictor {
    /// Decides each site by itself.
    pub fn new(model: impl Into<AnyModel<f32>>) -> Self {
        Predictor { model: model.into(), occlusion_share: None, far: false, few: false }
    }

    /// Marks the `share` of sites that look most like occlusion points instead of deciding each by itself.
    ///
    /// # Errors
    /// If `share` is not above 0 and at most 1.
    pub fn with_occlusion_share(self, share: f64) -> Result<Self> {
        if !(share > 0.0 && share <= 1.0) {
            let expected = "above 0, at most 1";
            return Err(Error::argument("occlusion share", share, expected, "the paper uses 0.1"));
        }
        Ok(Predictor { occlusion_share: Some(share), ..self })
    }

    /// Answers even far outside of what the network was trained for.
    #[must_use]
    pub fn allow_out_of_domain(self) -> Self {
        Predictor { far: true, ..self }
    }

    /// Answers for fewer than half of the sites that the network was trained with, without a part to add others on. The
    /// cutter and the part are still checked.
    #[must_use]
    pub fn allow_few_sites(self) -> Self {
        Predictor { few: true, ..self }
    }

    /// The network.
    pub fn model(&self) -> &AnyModel<f32> {
        &self.model
    }

    /// What the network learned: the definition of the labels that its answers are to be compared with; `None` if that
    /// is not known. [`Definition::Part`] are labels of [`Labeler::of_part`](crate::access::Labeler::of_part),
    /// [`Definition::Sites`] those of [`Labeler::of_sites`](crate::access::Labeler::of_sites).
    pub fn definition(&self) -> Option<Definition> {
        self.model.definition
    }

    /// The answers for `sites` and `cutter`: decisions, probabilities, and what of both the network was not trained
    /// for.
    ///
    /// # Errors
    /// If the network learned about points of space, and `sites` have normals; if the cutter is no
    /// [ball end](Cutter::as_ball_end); if a number is far outside of the network's [`Domain`](super::Domain), unless
    /// [`Predictor::allow_out_of_domain`]; if sites are fewer than half of those in training, unless that or
    /// [`Predictor::allow_few_sites`]; or as [`Model::predict`](super::Model::predict).
    pub fn answer(&self, sites: &Sites, cutter: &Cutter) -> Result<SiteAnswers> {
        Ok(self.decide(self.predict(sites, cutter)?))
    }

    /// As [`Predictor::answer`] for sites on `part`. Fewer than the network was trained with are as good as so many:
    /// others are placed on the part, seen by the network and not answered.
    ///
    /// # Errors
    /// As [`Predictor::answer`], but for few sites; and as [`sample`].
    pub fn answer_on(&self, part: &Mesh, sites: &Sites, cutter: &Cutter) -> Result<SiteAnswers> {
        Ok(self.decide(self.predict_on(part, sites, cutter)?))
    }

    fn decide(&self, (prediction, outside_domain): Predicted) -> SiteAnswers {
        let mut answers = match self.occlusion_share {
            None => prediction.answers(),
            Some(share) => prediction.answers_ranked(share),
        };
        answers.network.get_or_insert_default().outside_domain = outside_domain;
        answers
    }

    /// As [`Predictor::answer`], as logits.
    ///
    /// # Errors
    /// As [`Predictor::answer`].
    pub fn predict(&self, sites: &Sites, cutter: &Cutter) -> Result<Predicted> {
        let lengths = self.lengths(sites, cutter)?;
        let outside = self.outside(sites, lengths)?;
        Ok((self.in_groups(sites, lengths)?, outside))
    }

    /// As [`Predictor::answer_on`], as logits.
    ///
    /// # Errors
    /// As [`Predictor::answer_on`].
    pub fn predict_on(&self, part: &Mesh, sites: &Sites, cutter: &Cutter) -> Result<Predicted> {
        let least = self.model.domain.map_or(0, |domain| domain.least_n_sites());
        let in_space = self.definition().is_some_and(|definition| definition.is_in_space());
        if sites.is_empty() || sites.len() >= least || in_space {
            return self.predict(sites, cutter);
        }
        let lengths = self.lengths(sites, cutter)?;
        let n_sites = least - sites.len();
        let added = sample(part, &SiteOptions { n_sites, seed: SEED, ..SiteOptions::default() })?;
        let all = sites.followed_by(&added);
        let outside = self.outside(&all, lengths)?;
        let mut prediction = self.in_groups(&all, lengths)?;
        prediction.truncate(sites.len());
        Ok((prediction, outside))
    }

    /// The cutter as the network reads it.
    fn lengths(&self, sites: &Sites, cutter: &Cutter) -> Result<CutterParams> {
        if let Some(definition) =
            self.definition().filter(|d| d.is_in_space() && !sites.normals.is_empty())
        {
            let found = format!("one that learned the {definition}");
            let remedy = "name a network that was trained on sites";
            return Err(Error::argument("network", found, "one for sites of a surface", remedy));
        }
        cutter.as_ball_end().ok_or_else(|| {
            let expected = "a ball end with one holder below the spindle";
            let remedy = "the network knows no other; ask the exact labeler";
            Error::argument("cutter", cutter, expected, remedy)
        })
    }

    /// What is outside of the network's domain; an error if it is far outside, and that is not allowed.
    fn outside(&self, sites: &Sites, lengths: CutterParams) -> Result<Vec<OutsideDomain>> {
        let outside = |domain: &Domain| domain.outside(&sites.points, lengths);
        let outside = self.model.domain.as_ref().map(outside).unwrap_or_default();
        let is_refused =
            |o: &&OutsideDomain| o.is_far() && !self.far && !(o.is_count() && self.few);
        let Some(far) = outside.iter().find(is_refused) else { return Ok(outside) };
        let words = far.to_string();
        let found = words.trim_start_matches(far.quantity).trim_start_matches(" is ");
        let (expected, remedy) = match far.is_count() {
            true => (
                "at least half as many",
                "take more, give the part too (`Predictor::answer_on`; a mesh at the command line), label it exactly, or \
                 accept a guess (`allow_few_sites`; `--few-sites` at the command line)",
            ),
            false => (
                "a part and a cutter like those that the network was trained on",
                "label it exactly, or accept a guess (`allow_out_of_domain`; `--far` at the command line)",
            ),
        };
        Err(Error::argument(far.quantity, found, expected, remedy))
    }

    /// The prediction for all sites at once, or for groups of them that are spread over the part alike.
    fn in_groups(&self, sites: &Sites, lengths: CutterParams) -> Result<Prediction<f32>> {
        let n = self.n_groups(sites.len());
        let predict =
            |sites: &Sites| self.model.predict(&sites.points, &sites.normals, lengths.to_array());
        if n == 1 {
            return predict(sites);
        }
        let along = order::z_order(&sites.points);
        let mut all = Prediction::default();
        for first in 0..n {
            let rows: Vec<usize> =
                along.iter().skip(first).step_by(n).map(|&i| i as usize).collect();
            all.place(predict(&sites.subset(&rows))?, &rows, sites.len());
        }
        Ok(all)
    }

    /// A graph network's neighbors are nearer where sites are denser: it gets nearly the number of its training.
    fn n_groups(&self, n: usize) -> usize {
        let Some(domain) = self.model.domain else { return 1 };
        let most = domain.most_n_sites().max(1);
        let groups = match self.model.net {
            AnyNetwork::Octree(_) => n.div_ceil(most.saturating_mul(MANY)),
            AnyNetwork::GraphSage(_) => (n + most / 2) / most,
        };
        groups.max(1)
    }
}

/// Logits and shares, and what the network was not trained for.
type Predicted = (Prediction<f32>, Vec<OutsideDomain>);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids;
    use crate::model::{Model, UNetConfig};
    use crate::tool::cutter::CutterParams;
    use glam::{DVec3, Vec3};

    #[test]
    fn answers_are_those_of_the_model_and_other_tools_are_refused() {
        let points = (0..50).map(|i| Vec3::new(i as f32, (i % 7) as f32, 0.0)).collect();
        let sites = Sites::new(points, vec![Vec3::Z; 50]).unwrap();
        let params = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
        let model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
        let prediction = model.predict(&sites.points, &sites.normals, params.to_array()).unwrap();
        let predictor = Predictor::new(model);
        let cutter = Cutter::ball_end(params).unwrap();
        assert_eq!(predictor.answer(&sites, &cutter).unwrap(), prediction.answers());
        for other in [Cutter::flat_end(params).unwrap(), cutter.grown(0.5).unwrap()] {
            let message = predictor.answer(&sites, &other).unwrap_err().to_string();
            assert!(message.contains("a ball end with one holder"), "{message}");
        }
        let ranked = predictor.clone().with_occlusion_share(0.1).unwrap();
        assert_eq!(ranked.answer(&sites, &cutter).unwrap().n_occlusion(), 5);
        assert!(predictor.with_occlusion_share(f64::NAN).is_err());
    }

    #[test]
    fn answers_outside_of_the_domain_say_so_and_far_ones_are_refused() {
        let points = (0..50).map(|i| Vec3::new(i as f32, (i % 7) as f32, 0.0)).collect();
        let sites = Sites::new(points, vec![Vec3::Z; 50]).unwrap();
        let cutter = |cr| Cutter::ball_end([cr, 6.0, 40.0, 5.0].into()).unwrap();
        let mut model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
        model.domain = Some(Domain::of(&sites.points, [1.5, 6.0, 40.0, 5.0].into()));
        let predictor = Predictor::new(model);
        assert!(
            predictor
                .answer(&sites, &cutter(1.5))
                .unwrap()
                .network
                .unwrap()
                .outside_domain
                .is_empty()
        );
        let outside =
            predictor.answer(&sites, &cutter(2.0)).unwrap().network.unwrap().outside_domain;
        assert_eq!((outside.len(), outside[0].quantity), (1, "CR"));
        let message = predictor.answer(&sites, &cutter(4.0)).unwrap_err().to_string();
        assert!(message.starts_with("CR is 0.0816 of the largest edge, trained from"), "{message}");
        let few = sites.points.iter().copied().step_by(6).collect();
        let few = Sites::new(few, vec![Vec3::Z; 9]).unwrap();
        let message = predictor.answer(&few, &cutter(1.5)).unwrap_err().to_string();
        let said = "number of sites is 9, trained with 50, expected at least half as many; take more, give the part";
        assert!(message.starts_with(said), "{message}");
        let few_allowed = predictor.clone().allow_few_sites();
        let outside =
            few_allowed.answer(&few, &cutter(1.5)).unwrap().network.unwrap().outside_domain;
        assert_eq!(outside.last().map(|o| o.quantity), Some("number of sites"));
        let message = few_allowed.answer(&few, &cutter(4.0)).unwrap_err().to_string();
        assert!(message.starts_with("CR is"), "few sites are allowed, a tool is not: {message}");
        let accepted = predictor.allow_out_of_domain().answer(&sites, &cutter(4.0)).unwrap();
        assert!(accepted.network.unwrap().outside_domain[0].is_far());
    }

    fn on_a_cube(n_sites: usize, seed: u64) -> Sites {
        let part = solids::cuboid(DVec3::splat(30.0));
        sample(&part, &SiteOptions { n_sites, seed, ..SiteOptions::default() }).unwrap()
    }

    fn trained_with(n_sites: usize) -> Model<f32> {
        let mut model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
        let sites = on_a_cube(n_sites, 5);
        model.domain = Some(Domain::of(&sites.points, [1.5, 6.0, 40.0, 5.0].into()));
        model
    }

    /// The added sites are seen: the answers are those of all of them together.
    #[test]
    fn few_sites_on_a_part_are_filled_up_to_the_number_of_the_training() {
        let (part, few) = (solids::cuboid(DVec3::splat(30.0)), on_a_cube(40, 0));
        let (model, cutter) = (trained_with(200), "1.5,6,40,5".parse().unwrap());
        let added = on_a_cube(160, SEED);
        let all = few.followed_by(&added);
        let together = model.predict(&all.points, &all.normals, [1.5, 6.0, 40.0, 5.0]).unwrap();
        let predictor = Predictor::new(model);
        assert!(predictor.predict(&few, &cutter).is_err());
        let (prediction, outside) = predictor.predict_on(&part, &few, &cutter).unwrap();
        assert!(outside.is_empty());
        assert_eq!(prediction.logits_inaccessible, together.logits_inaccessible[..40]);
        assert_eq!(prediction.logits_occlusion, together.logits_occlusion[..40]);
        assert_eq!(predictor.answer_on(&part, &few, &cutter).unwrap().len(), 40);
        let many = on_a_cube(300, 0);
        let answers = predictor.answer(&many, &cutter).unwrap();
        assert_eq!(predictor.answer_on(&part, &many, &cutter).unwrap(), answers);
    }

    #[test]
    fn very_many_sites_are_predicted_in_even_groups_and_answered_in_their_order() {
        let (model, cutter) = (trained_with(100), "1.5,6,40,5".parse().unwrap());
        let predict = |sites: &Sites| {
            model.predict(&sites.points, &sites.normals, [1.5, 6.0, 40.0, 5.0]).unwrap()
        };
        let predictor = Predictor::new(model.clone());
        let four_times = on_a_cube(400, 0);
        let (prediction, outside) = predictor.predict(&four_times, &cutter).unwrap();
        assert_eq!((prediction, outside.len()), (predict(&four_times), 0));
        let more = on_a_cube(401, 0);
        let (prediction, outside) = predictor.predict(&more, &cutter).unwrap();
        assert_eq!((prediction.logits_inaccessible.len(), outside.len()), (401, 0));
        let along = order::z_order(&more.points);
        for first in [0, 1] {
            let rows: Vec<usize> =
                along.iter().skip(first).step_by(2).map(|&i| i as usize).collect();
            let group = more.subset(&rows);
            // Every face of the cube has its share of each group.
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                for sign in [1.0, -1.0] {
                    let face = (axis * sign).as_vec3();
                    let of = |sites: &Sites| sites.normals.iter().filter(|n| **n == face).count();
                    assert!(2 * of(&group) + 10 > of(&more) && 2 * of(&group) < of(&more) + 10);
                }
            }
            let alone = predict(&group);
            for (k, &row) in rows.iter().enumerate() {
                assert_eq!(prediction.logits_inaccessible[row], alone.logits_inaccessible[k]);
                assert_eq!(prediction.logits_occlusion[row], alone.logits_occlusion[k]);
            }
        }
    }
}
