//! Settings of a training run: every number that decides its outcome, apart from the data.

use crate::data::Augment;
use crate::data::augment::{Elastic, Turn};
use crate::data::online::OnlineSettings;
use crate::learn::optim::Schedule;
use crate::model::{NetworkConfig, UNetConfig};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// How the losses of the two heads become one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Reduction {
    /// Their sum, as in the paper.
    #[default]
    Sum,
    /// Their mean, as in the reference code.
    Mean,
}

/// The loss.
///
/// ```
/// use deepmill::train::{LossSettings, Reduction};
/// let loss = LossSettings::default().with_reduction(Reduction::Mean).with_label_smoothing(0.1);
/// assert_eq!(loss.positive_weights, None);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct LossSettings {
    /// Sum or mean of the heads.
    pub reduction: Reduction,
    /// Share of each target that is spread evenly over both classes, in `[0, 1)`.
    pub label_smoothing: f64,
    /// Weight of the positive class of each head (inaccessible, occlusion) against 1 for the other.
    pub positive_weights: Option<[f64; 2]>,
    /// Factor of the loss of the head that tells the share of accessible directions, where there is one; 1 if not
    /// given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share_weight: Option<f64>,
}

setters!(LossSettings {
    with_reduction(reduction: Reduction),
    with_label_smoothing(label_smoothing: f64),
    with_positive_weights(positive_weights: Option<[f64; 2]>),
    with_share_weight(share_weight: Option<f64>),
});

/// How a network is trained.
///
/// ```
/// use deepmill::train::Settings;
/// let settings = Settings::tiny().with_n_epochs(4).with_seed(7);
/// assert_eq!(settings.batch_size, Settings::tiny().batch_size);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Settings {
    /// Seed of every random decision.
    pub seed: u64,
    /// Passes over the data.
    pub n_epochs: u64,
    /// Samples per epoch, if not every sample once: epochs then follow each other through fresh shuffles.
    #[serde(default)]
    pub samples_per_epoch: Option<usize>,
    /// Samples per step.
    pub batch_size: usize,
    /// Parts of a step's samples that go through the network by themselves, in memory for one of them: batch norm takes
    /// its statistics from each, their gradients are summed along a tree, and the running statistics move to the mean
    /// of theirs. As many processes can share a step. A group of one sample has no statistics of its cutter.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub n_groups: usize,
    /// Learning rate that the schedule scales.
    pub lr: f64,
    /// Momentum of SGD.
    pub momentum: f64,
    /// Weight decay, added to the gradient of every parameter.
    pub weight_decay: f64,
    /// Learning rate over the epochs.
    pub schedule: Schedule,
    /// Greatest Euclidean norm of the gradient; longer ones are shortened to it.
    pub clip_norm: Option<f64>,
    /// Evaluate on the validation set after every so many epochs, and after the last.
    pub evaluate_every: u64,
    /// The loss.
    #[serde(default)]
    pub loss: LossSettings,
    /// Random changes of the samples.
    #[serde(default)]
    pub augment: Augment,
    /// Fresh cutters and orientations, labeled while training; `None`: the data set's own labels.
    #[serde(default)]
    #[doc(hidden)] // of the program
    pub online: Option<OnlineSettings>,
    /// The network.
    pub network: NetworkConfig,
}

setters!(Settings {
    with_seed(seed: u64),
    with_n_epochs(n_epochs: u64),
    with_samples_per_epoch(samples_per_epoch: Option<usize>),
    with_batch_size(batch_size: usize),
    with_n_groups(n_groups: usize),
    with_lr(lr: f64),
    with_momentum(momentum: f64),
    with_weight_decay(weight_decay: f64),
    with_schedule(schedule: Schedule),
    with_clip_norm(clip_norm: Option<f64>),
    with_evaluate_every(evaluate_every: u64),
    with_loss(loss: LossSettings),
    with_augment(augment: Augment),
    #[doc(hidden)]
    with_online(online: Option<OnlineSettings>),
    with_network(network: NetworkConfig),
});

fn one() -> usize {
    1
}

fn is_one(n: &usize) -> bool {
    *n == 1
}

impl Settings {
    /// As the paper says: SGD 0.9 / 5e-4, cosine annealing from 1.0, batch 128, 1500 epochs, mirroring
    /// and elastic deformation, the sum of the losses, the reference network.
    pub fn paper() -> Self {
        Settings {
            n_epochs: 1500,
            batch_size: 128,
            n_groups: 1,
            lr: 1.0,
            schedule: Schedule::Cosine { min_lr: 0.0 },
            clip_norm: None,
            evaluate_every: 50,
            augment: Augment {
                mirror: true,
                turn: Turn::None,
                elastic: Some(Elastic { spacing: 0.2, magnitude: 0.01 }),
            },
            network: UNetConfig::reference().into(),
            ..Settings::small()
        }
    }

    /// As the reference code does: rate 0.1 divided by ten after epochs 375 and 750, batch 8, 1500
    /// epochs, no augmentation, the mean of the losses.
    pub fn reference() -> Self {
        Settings {
            batch_size: 8,
            n_groups: 1,
            lr: 0.1,
            schedule: Schedule::Step { milestones: vec![375, 750], factor: 0.1 },
            loss: LossSettings { reduction: Reduction::Mean, ..LossSettings::default() },
            augment: Augment::default(),
            ..Settings::paper()
        }
    }

    /// For hours on a few processors: the small network, batch 8, cosine annealing from 0.1 with a
    /// warm-up epoch, gradients clipped. Nothing is turned or mirrored, because that makes 7 to 9 % of the
    /// labels wrong (docs/benchmarks.md); [`Settings::online`] does it with labels made anew.
    pub fn small() -> Self {
        Settings {
            seed: 0,
            n_epochs: 100,
            samples_per_epoch: None,
            batch_size: 8,
            n_groups: 1,
            lr: 0.1,
            momentum: 0.9,
            weight_decay: 5e-4,
            schedule: Schedule::CosineWarmup { warmup_epochs: 1, start: 0.1, min_ratio: 0.001 },
            clip_norm: Some(5.0),
            evaluate_every: 5,
            loss: LossSettings::default(),
            augment: Augment::default(),
            online: None,
            network: UNetConfig::small().into(),
        }
    }

    /// For a minute: the tiny network, batch 4.
    pub fn tiny() -> Self {
        Settings {
            n_epochs: 20,
            batch_size: 4,
            evaluate_every: 1_000_000,
            network: UNetConfig::tiny().into(),
            ..Settings::small()
        }
    }

    /// The preset of that name: `paper`, `reference`, `small` or `tiny`.
    ///
    /// # Errors
    /// If there is none.
    pub fn preset(name: &str) -> Result<Self> {
        match name {
            "paper" => Ok(Self::paper()),
            "reference" => Ok(Self::reference()),
            "small" => Ok(Self::small()),
            "tiny" => Ok(Self::tiny()),
            _ => Err(Error::argument(
                "preset",
                name,
                "paper, reference, small or tiny",
                "choose one of them or give a configuration file",
            )),
        }
    }

    /// Checks that every number is in its domain; the network checks its own.
    ///
    /// # Errors
    /// Names the first number that is not.
    pub fn check(&self) -> Result<()> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let share = |x: f64| (0.0..1.0).contains(&x);
        let share_or_one = |x: f64| (0.0..=1.0).contains(&x);
        let online = self.online.unwrap_or_default();
        let draws = self.samples_per_epoch.unwrap_or(1);
        let groups = (1..=self.batch_size).contains(&self.n_groups);
        let rules: [(&'static str, f64, bool, &str); 13] = [
            ("n_epochs", self.n_epochs as f64, self.n_epochs > 0, "1 or more"),
            ("samples_per_epoch", draws as f64, draws > 0, "1 or more"),
            ("online.sides", online.sides, share_or_one(online.sides), "0 to 1"),
            ("online.extreme", online.extreme, share_or_one(online.extreme), "0 to 1"),
            ("online.tilt", online.tilt, share_or_one(online.tilt), "0 to 1"),
            ("batch_size", self.batch_size as f64, self.batch_size > 0, "1 or more"),
            ("n_groups", self.n_groups as f64, groups, "1 to batch_size"),
            ("lr", self.lr, positive(self.lr), "above 0"),
            ("momentum", self.momentum, share(self.momentum), "0 to below 1"),
            ("weight_decay", self.weight_decay, share(self.weight_decay), "0 to below 1"),
            ("evaluate_every", self.evaluate_every as f64, self.evaluate_every > 0, "1 or more"),
            (
                "clip_norm",
                self.clip_norm.unwrap_or(1.0),
                self.clip_norm.is_none_or(positive),
                "above 0",
            ),
            (
                "loss.label_smoothing",
                self.loss.label_smoothing,
                share(self.loss.label_smoothing),
                "0 to below 1",
            ),
        ];
        if let Some((name, found, _, expected)) = rules.into_iter().find(|(.., good, _)| !good) {
            return Err(Error::argument(name, found, expected, "change the training settings"));
        }
        if !online.has_sound_sizes() {
            let found = format!("{:?}", online.size_mm.unwrap_or_default());
            let expected = "two sizes above 0 mm, at most 10 m, the lesser first";
            let remedy = "change the training settings";
            return Err(Error::argument("online.size_mm", found, expected, remedy));
        }
        if !self.schedule.is_sound() {
            let found = format!("{:?}", self.schedule);
            let expected = "finite numbers, rates and factors not negative, shares at most 1";
            return Err(Error::argument(
                "schedule",
                found,
                expected,
                "change the training settings",
            ));
        }
        let fields =
            [("augment.elastic", self.augment.elastic), ("online.elastic", online.elastic)];
        for (name, elastic) in fields {
            if let Some(elastic) = elastic.filter(|elastic| !elastic.is_sound()) {
                let found = format!("{elastic:?}");
                let expected = "a spacing above 0 and at most 1, a magnitude from 0 to 1";
                let remedy = "change the training settings";
                return Err(Error::argument(name, found, expected, remedy));
            }
        }
        if let Some(weights) =
            self.loss.positive_weights.filter(|w| !w.iter().all(|w| positive(*w)))
        {
            let found = format!("{weights:?}");
            let remedy = "change the training settings";
            return Err(Error::argument("loss.positive_weights", found, "above 0", remedy));
        }
        if let Some(found) = self.loss.share_weight.filter(|weight| !positive(*weight)) {
            let remedy = "change the training settings";
            return Err(Error::argument("loss.share_weight", found, "above 0", remedy));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_in_their_domain_and_others_are_refused_by_name() {
        for name in ["paper", "reference", "small", "tiny"] {
            Settings::preset(name).unwrap().check().unwrap();
        }
        assert!(Settings::preset("huge").is_err());
        let broken = |change: fn(&mut Settings)| {
            let mut settings = Settings::tiny();
            change(&mut settings);
            settings.check().unwrap_err().to_string()
        };
        assert!(broken(|s| s.lr = f64::NAN).starts_with("lr is NaN"));
        assert!(broken(|s| s.clip_norm = Some(0.0)).starts_with("clip_norm is 0"));
        assert!(
            broken(|s| s.schedule = Schedule::Cosine { min_lr: f64::NAN }).contains("schedule")
        );
        let elastic = |s: &mut Settings| {
            s.augment.elastic = Some(Elastic { spacing: 0.2, magnitude: f64::INFINITY });
        };
        assert!(broken(elastic).starts_with("augment.elastic is"));
        assert!(broken(|s| s.batch_size = 0).starts_with("batch_size is 0"));
        assert!(broken(|s| s.n_groups = 5).starts_with("n_groups is 5, expected 1 to batch_size"));
        assert!(
            broken(|s| s.loss.positive_weights = Some([1.0, -1.0])).contains("positive_weights")
                && broken(|s| s.loss.share_weight = Some(-1.0)).contains("share_weight")
        );
    }
}
