//! The predictor: a network behind the interface of the exact labeler.

use super::domain::Domain;
use super::predict::AnyModel;
use super::prediction::Prediction;
use crate::answers::{OutsideDomain, SiteAnswers};
use crate::cutter::Cutter;
use crate::geom::Sites;
use crate::{Error, Result};

/// Answers as a network predicts; takes and returns what [`Labeler`](crate::access::Labeler) does.
#[derive(Debug, Clone)]
pub struct Predictor {
    model: AnyModel<f32>,
    occlusion_share: Option<f64>,
    far: bool,
}

impl Predictor {
    /// Decides each site by itself.
    pub fn new(model: impl Into<AnyModel<f32>>) -> Self {
        Predictor { model: model.into(), occlusion_share: None, far: false }
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
    pub fn allow_out_of_domain(self) -> Self {
        Predictor { far: true, ..self }
    }

    /// The network.
    pub fn model(&self) -> &AnyModel<f32> {
        &self.model
    }

    /// The answers for `sites` and `cutter`: decisions, probabilities, and what of both the network was not trained
    /// for.
    ///
    /// # Errors
    /// If the network learned about points of space, and `sites` have normals; if the cutter is no
    /// [ball end](Cutter::as_ball_end); if a number is far outside of the network's [`Domain`](super::Domain), unless
    /// [`Predictor::allow_out_of_domain`]; or as [`Model::predict`](super::Model::predict).
    pub fn answer(&self, sites: &Sites, cutter: &Cutter) -> Result<SiteAnswers> {
        let (prediction, outside_domain) = self.predict(sites, cutter)?;
        let answers = match self.occlusion_share {
            None => prediction.answers(),
            Some(share) => prediction.answers_ranked(share),
        };
        Ok(SiteAnswers { outside_domain, ..answers })
    }

    /// As [`Predictor::answer`], as logits.
    ///
    /// # Errors
    /// As [`Predictor::answer`].
    pub fn predict(
        &self,
        sites: &Sites,
        cutter: &Cutter,
    ) -> Result<(Prediction<f32>, Vec<OutsideDomain>)> {
        if let Some(definition) =
            self.model.definition.filter(|d| d.is_in_space() && !sites.normals.is_empty())
        {
            let found = format!("one that learned the {definition}");
            let remedy = "name a network that was trained on sites";
            return Err(Error::argument("network", found, "one for sites of a surface", remedy));
        }
        let lengths = cutter.as_ball_end().ok_or_else(|| {
            let expected = "a ball end with one holder below the spindle";
            let remedy = "the network knows no other; ask the exact labeler";
            Error::argument("cutter", cutter, expected, remedy)
        })?;
        let outside = |domain: &Domain| domain.outside(&sites.points, lengths);
        let outside = self.model.domain.as_ref().map(outside).unwrap_or_default();
        if let Some(far) = outside.iter().find(|o| o.is_far() && !self.far) {
            let words = far.to_string();
            let found = words.trim_start_matches(far.quantity).trim_start_matches(" is ");
            let (expected, also) = match far.is_count() {
                true => ("as many as the network was trained with", "take as many, "),
                false => ("a part and a cutter like those that the network was trained on", ""),
            };
            let remedy = format!(
                "{also}label it exactly, or accept a guess (`allow_out_of_domain`; `--far` at the command line)"
            );
            return Err(Error::argument(far.quantity, found, expected, remedy));
        }
        let prediction = self.model.predict(&sites.points, &sites.normals, lengths.to_array())?;
        Ok((prediction, outside))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutter::CutterParams;
    use crate::model::{Model, UNetConfig};
    use glam::Vec3;

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
        assert!(predictor.answer(&sites, &cutter(1.5)).unwrap().outside_domain.is_empty());
        let outside = predictor.answer(&sites, &cutter(2.0)).unwrap().outside_domain;
        assert_eq!((outside.len(), outside[0].quantity), (1, "CR"));
        let message = predictor.answer(&sites, &cutter(4.0)).unwrap_err().to_string();
        assert!(message.starts_with("CR is 0.0816 of the largest edge, trained from"), "{message}");
        let few = sites.points.iter().copied().step_by(6).collect();
        let few = Sites::new(few, vec![Vec3::Z; 9]).unwrap();
        let message = predictor.answer(&few, &cutter(1.5)).unwrap_err().to_string();
        let said = "number of sites is 9, trained with 50, expected as many as the network was trained with; take as";
        assert!(message.starts_with(said), "{message}");
        let accepted = predictor.allow_out_of_domain().answer(&sites, &cutter(4.0)).unwrap();
        assert!(accepted.outside_domain[0].is_far());
    }
}
