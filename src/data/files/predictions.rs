//! Files of a network's answers, some of which may be computed.

use super::{Provenance, add_answers, few, open, same_length, start};
use crate::access::surface::Verified;
use crate::answers::{SiteAnswers, SpotCheck, of_sites};
use crate::data::npz::NpzReader;
use crate::geom::Sites;
use crate::model::Prediction;
use crate::model::config::N_COARSE;
use crate::{Error, Result};
use serde::Deserialize;
use serde_json::{Value, json};
use std::ops::RangeInclusive;
use std::path::Path;

/// A network's answers for one part and cutter.
///
/// What is read is what was written, with the logits of each site:
///
#[cfg_attr(feature = "generate", doc = "```")]
#[cfg_attr(not(feature = "generate"), doc = "```ignore")]
/// use deepmill::analysis::{Analysis, PredictRequest};
/// use deepmill::answers::SiteAnswer;
/// use deepmill::data::files::{PredictionFile, tools::Tool};
/// use deepmill::model::{Model, Predictor, UNetConfig};
/// use deepmill::{geom::solids, glam::DVec3};
///
/// # let temporary = tempfile::tempdir().unwrap();
/// # let path = temporary.path().join("predictions.npz");
/// let block = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
/// let tool = Tool::new("3,20,20,20".parse()?, None, 0.0)?;
/// let network = Predictor::new(Model::new(&UNetConfig::tiny(), 1)?); // not trained
/// let placed = Analysis::new("block", block, vec![tool]).n_sites(100).place(&mut ())?;
/// let outcome = placed.predict(&PredictRequest::new(network, "tiny"), &mut ())?;
/// let file = &outcome.predictions()[0].file;
/// file.write(&path)?;
/// let read = PredictionFile::read(&path)?;
/// assert_eq!((&read.prediction, read.provenance.part.as_str()), (&file.prediction, "block"));
/// let [no, yes] = read.prediction.logits_inaccessible[0];
/// assert_eq!(read.answers().of(0) == SiteAnswer::Inaccessible, yes > no);
/// # Ok::<(), deepmill::Error>(())
///
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PredictionFile {
    /// Part, cutter and settings.
    pub provenance: Provenance,
    /// The query sites, mm.
    pub sites: Sites,
    /// One row of logits per site and head.
    pub prediction: Prediction<f32>,
    /// Share of the sites that are marked as occlusion points, those of greatest logits; `None`: every site is decided
    /// by itself.
    #[doc(hidden)] // of the program
    pub occlusion_share: Option<f64>,
    /// What was computed of it.
    pub verified: Option<Verified>,
}

impl PredictionFile {
    /// Of these; occlusion points decided one by one, nothing verified.
    pub fn new(provenance: Provenance, sites: Sites, prediction: Prediction<f32>) -> Self {
        PredictionFile { provenance, sites, prediction, occlusion_share: None, verified: None }
    }

    const FORMAT: &str = "deepmill predictions";

    /// The answers: those of the network, or what verifying made of them.
    ///
    /// # Panics
    /// If the share of occlusion points is not in [0, 1].
    pub fn answers(&self) -> SiteAnswers {
        let verified = self.verified.as_ref().map(|verified| verified.answers.clone());
        verified.unwrap_or_else(|| predicted(&self.prediction, self.occlusion_share))
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If there are not two scores per site and head, the share is not in (0, 1], what was verified has no β, or the
    /// system refuses the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let n = self.sites.len();
        let Prediction { logits_inaccessible, logits_occlusion, accessible_share, coarse_answers } =
            &self.prediction;
        let mut npz = start(&self.sites, &self.provenance);
        for (name, logits) in
            [("inaccessible", logits_inaccessible), ("occlusion", logits_occlusion)]
        {
            if logits.len() != n {
                let found = format!("{} rows for {n} sites", logits.len());
                return Err(Error::file(path, name, found, "give two logits per site"));
            }
            npz.array(&format!("logits_{name}"), &[n, 2], logits.as_flattened());
        }
        self.occlusion_share.map_or(Ok(()), |share| check_share(path, share))?;
        add_answers(path, &mut npz, &self.answers(), n)?;
        let mut meaning = prediction_meaning();
        if !accessible_share.is_empty() {
            if accessible_share.len() != n {
                return Err(few(path, SHARE, accessible_share.len(), n));
            }
            npz.array(SHARE, &[n], accessible_share);
            meaning[SHARE] =
                "share of the directions in which the cutter has a free pose there".into();
        }
        if !coarse_answers.is_empty() {
            if coarse_answers.len() != n {
                return Err(few(path, COARSE, coarse_answers.len(), n));
            }
            npz.array(COARSE, &[n, N_COARSE], coarse_answers.as_flattened());
            meaning[COARSE] = COARSE_MEANING.into();
        }
        if self.occlusion_share.is_some() {
            meaning["occlusion"] = BY_RANK.into();
        }
        if let Some(Verified { verified, beta, counted, .. }) = &self.verified {
            check_lengths(path, n, [verified.len(), beta.len(), counted.len()])?;
            npz.array("verified", &[n], verified).array("beta", &[n], beta);
            npz.array(COUNTED, &[n], counted);
            for (name, words) in VERIFIED_MEANING {
                meaning[name] = words.into();
            }
        }
        let mut metadata = self.provenance.metadata(Self::FORMAT, meaning);
        metadata["occlusion_share"] = json!(self.occlusion_share);
        if let Some(check) = self.verified.as_ref().and_then(|verified| verified.spot_check) {
            metadata[SPOT_CHECK] = json!(check);
        }
        npz.metadata(&metadata);
        npz.write(path)
    }

    /// Reads a file that [`PredictionFile::write`] has written.
    ///
    /// # Errors
    /// If it is no such file, or an array is missing or of the wrong length.
    pub fn read(path: &Path) -> Result<Self> {
        let (mut npz, provenance, sites) = open(path, Self::FORMAT)?;
        let [logits_inaccessible, logits_occlusion] = ["inaccessible", "occlusion"].map(|name| {
            let name = format!("logits_{name}");
            let logits = npz.f32s(&name, 2)?;
            same_length(path, &sites, &name, logits.len() / 2)?;
            Ok(logits.as_chunks().0.to_vec())
        });
        let (logits_inaccessible, logits_occlusion) = (logits_inaccessible?, logits_occlusion?);
        let mut accessible_share = Vec::new();
        if npz.has(SHARE) {
            accessible_share = npz.f32s(SHARE, 1)?;
            same_length(path, &sites, SHARE, accessible_share.len())?;
            check_range(path, SHARE, &accessible_share, 0.0..=1.0)?;
        }
        let mut coarse_answers = Vec::new();
        if npz.has(COARSE) {
            let rows = npz.f32s(COARSE, N_COARSE)?;
            same_length(path, &sites, COARSE, rows.len() / N_COARSE)?;
            check_range(path, COARSE, &rows, -1.0..=1.0)?;
            coarse_answers = rows.as_chunks().0.to_vec();
        }
        let prediction =
            Prediction { logits_inaccessible, logits_occlusion, accessible_share, coarse_answers };
        let occlusion_share = npz.metadata()?["occlusion_share"].as_f64();
        occlusion_share.map_or(Ok(()), |share| check_share(path, share))?;
        let verified = npz.has("verified").then(|| read_verified(path, &mut npz, &prediction));
        let verified = verified.transpose()?;
        Ok(PredictionFile { provenance, sites, prediction, occlusion_share, verified })
    }
}

fn predicted(prediction: &Prediction<f32>, occlusion_share: Option<f64>) -> SiteAnswers {
    match occlusion_share {
        Some(share) => prediction.answers_ranked(share),
        None => prediction.answers(),
    }
}

fn check_range(path: &Path, name: &str, values: &[f32], range: RangeInclusive<f32>) -> Result<()> {
    let Some(found) = values.iter().find(|x| !range.contains(*x)) else { return Ok(()) };
    let found = format!("{found} is not between {} and {}", range.start(), range.end());
    Err(Error::file(path, name, found, "run predict again"))
}

fn check_share(path: &Path, share: f64) -> Result<()> {
    if share > 0.0 && share <= 1.0 {
        return Ok(());
    }
    let found = format!("{share}");
    Err(Error::file(path, "occlusion_share", found, "give a share above 0, at most 1, or none"))
}

/// Array of the head that tells shares.
const SHARE: &str = "accessible_share";

/// Array of what the network read of each site.
const COARSE: &str = "coarse_answers";

const COARSE_MEANING: &str = "labels of the published definition, as numbers: fourth roots of the shares of the coarse directions in which the tool, the tool without its holder, and the tool half a finest cell wider collide with no other site; how far the site's beta is above (1 to 0) or below (0 to -1) the bound of occlusion points";

/// What the last random sample of the predicted answers has shown; older files lack it.
const SPOT_CHECK: &str = "spot_check";

/// Array that tells whose β was counted; older files lack it, and have all.
const COUNTED: &str = "beta_counted";

const BY_RANK: &str =
    "true: among the share of sites (occlusion_share) with the greatest probability";

const VERIFIED_MEANING: [(&str, &str); 6] = [
    ("verified", "true: the answer is computed by the mesh definition, false: it is predicted"),
    ("inaccessible", "true: computed where verified, predicted elsewhere"),
    ("tip_does_not_fit", "true: computed where verified; false elsewhere"),
    (
        "occlusion",
        "true: predicted where beta_counted is false; else among the sites of greatest beta",
    ),
    (
        "beta",
        "pairs (inaccessible site, direction tested) in which this site is in the shrunk tool's steps; 0 where not counted",
    ),
    (COUNTED, "true: beta is counted; false: its probability decided"),
];

fn read_verified(
    path: &Path,
    npz: &mut NpzReader,
    prediction: &Prediction<f32>,
) -> Result<Verified> {
    let n = prediction.logits_inaccessible.len();
    let mut answers = prediction.answers();
    let (mut inaccessible, mut tip_does_not_fit) = (Vec::new(), Vec::new());
    for (name, list) in [
        ("inaccessible", &mut inaccessible),
        ("occlusion", &mut answers.occlusion),
        ("tip_does_not_fit", &mut tip_does_not_fit),
    ] {
        *list = npz.bools(name)?;
        if list.len() != n {
            return Err(few(path, name, list.len(), n));
        }
    }
    answers.of_sites = of_sites(&inaccessible, &tip_does_not_fit);
    answers.tests_tip = !tip_does_not_fit.is_empty();
    let (verified, beta) = (npz.bools("verified")?, npz.counts("beta")?);
    let counted = if npz.has(COUNTED) { npz.bools(COUNTED)? } else { vec![true; n] };
    check_lengths(path, n, [verified.len(), beta.len(), counted.len()])?;
    let spot_check = match npz.metadata()?.get(SPOT_CHECK) {
        None => None,
        Some(found) => Some(SpotCheck::deserialize(found).map_err(|error| {
            Error::file(path, SPOT_CHECK, error.to_string(), "run predict again")
        })?),
    };
    Ok(Verified { answers, verified, beta, counted, spot_check })
}

fn check_lengths(path: &Path, n: usize, lengths: [usize; 3]) -> Result<()> {
    match ["verified", "beta", COUNTED].iter().zip(lengths).find(|(_, len)| *len != n) {
        Some((name, len)) => Err(few(path, name, len, n)),
        None => Ok(()),
    }
}

fn prediction_meaning() -> Value {
    json!({
        "logits_inaccessible": "columns: accessible, inaccessible (positive class)",
        "logits_occlusion": "columns: no, occlusion (positive class)",
        "probability_inaccessible": "softmax of the logits, of the positive class",
        "probability_occlusion": "softmax of the logits, of the positive class",
        "inaccessible": "true: predicted, the logit of the positive class is the greater one",
        "occlusion": "true: predicted, the logit of the positive class is the greater one",
    })
}

#[cfg(test)]
mod tests {
    use super::super::LabelFile;
    use super::super::tests::{provenance, sites};
    use super::*;
    use crate::answers::SiteAnswer;

    #[test]
    fn predictions_come_back_exactly_and_are_not_taken_for_labels() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("predictions.npz");
        let mut file = PredictionFile {
            provenance: provenance(),
            sites: sites(),
            prediction: Prediction {
                logits_inaccessible: vec![[0.0, 2.0], [1.0, 1.0]],
                logits_occlusion: vec![[3.5, -1.0], [0.25, 0.5]],
                ..Prediction::default()
            },
            occlusion_share: None,
            verified: None,
        };
        file.write(&path).unwrap();
        assert_eq!(PredictionFile::read(&path).unwrap(), file);
        let answers = file.prediction.answers();
        assert_eq!(
            (answers.inaccessible(), &answers.occlusion[..]),
            (vec![true, false], &[false, true][..])
        );
        let p = answers.probability_inaccessible();
        assert!((p[0] - 0.880_797).abs() < 1e-6 && p[1] == 0.5);
        let message = LabelFile::read(&path).unwrap_err().to_string();
        assert!(message.contains("the format is \"deepmill predictions\""), "{message}");

        file.prediction.accessible_share = vec![0.25, 1.0];
        file.write(&path).unwrap();
        let read = PredictionFile::read(&path).unwrap();
        assert_eq!((read.answers().accessible_share, &read), (vec![0.25, 1.0], &file));
        file.prediction.accessible_share[1] = 1.5;
        file.write(&path).unwrap();
        let message = PredictionFile::read(&path).unwrap_err().to_string();
        assert!(message.contains("1.5 is not between 0 and 1"), "{message}");
        file.prediction.accessible_share.pop();
        assert!(file.write(&path).unwrap_err().to_string().contains("1 entries for 2 sites"));
        file.prediction.accessible_share.clear();

        file.prediction.coarse_answers = vec![[0.0, 0.5, 1.0, -1.0], [0.25; 4]];
        file.write(&path).unwrap();
        assert_eq!(PredictionFile::read(&path).unwrap(), file);
        file.prediction.coarse_answers[1][2] = f32::NAN;
        file.write(&path).unwrap();
        let message = PredictionFile::read(&path).unwrap_err().to_string();
        assert!(message.contains("NaN is not between -1 and 1"), "{message}");
        file.prediction.coarse_answers.pop();
        assert!(file.write(&path).unwrap_err().to_string().contains("1 entries for 2 sites"));
        file.prediction.coarse_answers.clear();

        file.occlusion_share = Some(0.5);
        file.write(&path).unwrap();
        let read = PredictionFile::read(&path).unwrap();
        assert_eq!((read.answers().occlusion, &read), (vec![false, true], &file));
        file.occlusion_share = Some(f64::NAN);
        assert!(file.write(&path).unwrap_err().to_string().contains("a share above 0"));

        file.occlusion_share = Some(0.5);
        let answers = SiteAnswers {
            of_sites: vec![SiteAnswer::TipDoesNotFit, SiteAnswer::Accessible],
            tests_tip: true,
            ..file.prediction.answers()
        };
        file.verified = Some(Verified {
            answers,
            verified: vec![true, false],
            beta: vec![7, 0],
            counted: vec![true, false],
            spot_check: Some(SpotCheck { n_rounds: 2, n_checked: 1, n_wrong: 0, limit: 0.5 }),
        });
        file.write(&path).unwrap();
        let read = PredictionFile::read(&path).unwrap();
        assert_eq!((read.answers().n_inaccessible(), &read), (0, &file));
        file.verified.as_mut().unwrap().beta.pop();
        assert!(file.write(&path).unwrap_err().to_string().contains("1 entries for 2 sites"));
    }

    /// As version 0.1.0 wrote them: decisions under the names `predicted_…`.
    #[test]
    fn older_predictions_are_still_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("predictions.npz");
        let logits = || {
            let mut npz = start(&sites(), &provenance());
            for name in ["inaccessible", "occlusion"] {
                npz.array(&format!("logits_{name}"), &[2, 2], &[0.0f32, 2.0, 1.0, 1.0]);
                npz.array(&format!("probability_{name}"), &[2], &[0.880_797f32, 0.5]);
            }
            npz.metadata(&provenance().metadata(PredictionFile::FORMAT, prediction_meaning()));
            npz
        };
        let mut npz = logits();
        for name in ["inaccessible", "occlusion"] {
            npz.array(&format!("predicted_{name}"), &[2], &[true, false]);
        }
        npz.write(&path).unwrap();
        let answers = PredictionFile::read(&path).unwrap().prediction.answers();
        assert_eq!((answers.inaccessible(), answers.occlusion.len()), (vec![true, false], 2));
        // Before β was left out where it does not decide.
        let mut npz = logits();
        for name in ["inaccessible", "occlusion", "tip_does_not_fit", "verified"] {
            npz.array(name, &[2], &[false, true]);
        }
        npz.array("beta", &[2], &[3u64, 0]);
        npz.write(&path).unwrap();
        let verified = PredictionFile::read(&path).unwrap().verified.unwrap();
        assert_eq!((verified.share_counted(), verified.share_verified()), (1.0, 0.5));
        assert_eq!(verified.spot_check, None);
    }
}
