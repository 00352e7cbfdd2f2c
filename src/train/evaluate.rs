//! How good predictions are: per sample and pooled, both heads, positive class named.

use super::HeadScore;
use crate::Result;
use crate::data::Sample;
use crate::metrics::Confusion;
use crate::model::Model;
use std::time::Instant;

/// Scores of one way to predict, over a list of samples. The positive classes are *inaccessible* and
/// *occlusion point*.
#[derive(Debug, Clone, Default)]
pub struct Evaluation {
    /// Confusion counts of both heads for each sample.
    pub samples: Vec<[Confusion; 2]>,
    /// Wall-clock seconds of all predictions.
    pub seconds: f64,
}

/// Scores of one head.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HeadScores {
    /// Mean over the samples.
    pub mean: HeadScore,
    /// All sites of all samples in one table.
    pub pooled: HeadScore,
    /// Mean over the samples of the F1 that takes class 1 as positive, as the reference code does.
    pub reference_f1: f64,
}

impl Evaluation {
    /// Adds a sample's prediction.
    pub fn add(&mut self, sample: &Sample, inaccessible: &[bool], occlusion: &[bool]) {
        self.samples.push([
            Confusion::of_labels(inaccessible, &sample.inaccessible),
            Confusion::of_labels(occlusion, &sample.occlusion),
        ]);
    }

    /// Scores of a head: 0 = accessibility, 1 = occlusion.
    pub fn head(&self, head: usize) -> HeadScores {
        let n = self.samples.len().max(1) as f64;
        let mean = |score: &dyn Fn(&Confusion) -> f64| {
            self.samples.iter().map(|s| score(&s[head])).sum::<f64>() / n
        };
        let mut pooled = Confusion::default();
        self.samples.iter().for_each(|s| pooled += s[head]);
        // Class 1 of head 1 is "accessible", of head 2 "occlusion".
        let reference = |c: &Confusion| if head == 0 { c.swapped().f1() } else { c.f1() };
        HeadScores {
            mean: HeadScore { accuracy: mean(&Confusion::accuracy), f1: mean(&Confusion::f1) },
            pooled: HeadScore { accuracy: pooled.accuracy(), f1: pooled.f1() },
            reference_f1: mean(&reference),
        }
    }

    /// Per-sample averages of both heads.
    pub fn mean(&self) -> [HeadScore; 2] {
        [self.head(0).mean, self.head(1).mean]
    }
}

/// Predicts every sample by itself and scores it.
///
/// # Errors
/// If a sample is inconsistent.
pub fn evaluate(model: &Model<f32>, samples: &[Sample]) -> Result<Evaluation> {
    let mut evaluation = Evaluation::default();
    for sample in samples {
        sample.check()?;
        let start = Instant::now();
        let sites = &sample.sites;
        let cutter = sample.cutter.to_array();
        let prediction = model.predict(&sites.points, &sites.normals, cutter)?;
        evaluation.seconds += start.elapsed().as_secs_f64();
        evaluation.add(sample, &prediction.inaccessible(), &prediction.occlusion());
    }
    Ok(evaluation)
}
