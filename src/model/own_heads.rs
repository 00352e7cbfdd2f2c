//! The octree U-Net with heads of one's own: any number of them, each of any number of classes.

use super::UNetConfig;
use super::batch::Batch;
use super::network::Network;
use super::policy::MemoryPolicy;
use super::training::{SavedUNet, TrainingPass};
use super::unet::UNet;
use crate::nn::arena::Buffer;
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Inference, Training};
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use std::fmt::Debug;

/// More classes than labels of points have; beyond, products of sizes might overflow.
const MOST_CLASSES: usize = 1 << 20;

/// A U-Net that answers other questions than those about a cutter: whatever needs these, it does not have.
#[derive(Debug, Clone)]
struct OwnHeads(UNet);

impl UNet {
    /// The octree U-Net for labels of one's own: one head for each entry of `n_classes`, with logits `[n_points,
    /// n_classes]`, in place of those about the cutter. Without them there is no
    /// [`Model::predict`](super::Model::predict); a [`Trainer`](crate::train::Trainer) trains it,
    /// [`Model::logits`](super::Model::logits) answers.
    ///
    /// The cutter's lengths in a [`Batch`] are read where `config.cutter.placement` says so; with
    /// [`CutterPlacement::None`](super::config::CutterPlacement::None) they only have to make a cutter.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain, there is no head, or one without classes.
    pub fn with_heads(
        config: &UNetConfig,
        n_classes: &[usize],
    ) -> Result<impl Network<f32, Batch = Batch<f32>> + Debug + Clone + use<>> {
        OwnHeads::new(config, n_classes)
    }
}

impl OwnHeads {
    fn new(config: &UNetConfig, n_classes: &[usize]) -> Result<Self> {
        if n_classes.is_empty() || n_classes.iter().any(|n| !(1..=MOST_CLASSES).contains(n)) {
            let expected = format!("1 to {MOST_CLASSES} classes for each head");
            let found = format!("{n_classes:?}");
            let remedy = "give one number of classes for each label of a point";
            return Err(Error::argument("n_classes", found, expected, remedy));
        }
        UNet::build(config, &MemoryPolicy::default(), n_classes).map(OwnHeads)
    }
}

impl<T: Scalar> Network<T> for OwnHeads {
    type Batch = Batch<T>;
    type Saved = SavedUNet<T>;

    fn layout(&self) -> &Layout {
        self.0.layout()
    }

    fn n_shapes(&self, batch: &Batch<T>) -> usize {
        batch.n_shapes()
    }

    fn logits(&self, pass: &Inference<T>, batch: &Batch<T>) -> Vec<Buffer<T>> {
        self.0.forward(pass, batch).logits
    }

    fn forward_train(&self, pass: &mut Training<T>, batch: &Batch<T>) -> TrainingPass<T> {
        self.0.forward_train(pass, batch)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        forward: TrainingPass<T>,
        dlogits: &[&[T]],
    ) {
        self.0.backward(pass, batch, forward, dlogits);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::gradcheck::{self, GradcheckSettings};
    use crate::learn::loss::CrossEntropy;
    use crate::model::config::{CutterConfig, InputConfig};
    use crate::model::{Model, Shape};
    use crate::nn::arena::Arena;
    use crate::octree::tests::sheet;

    fn config() -> UNetConfig {
        UNetConfig {
            input: InputConfig { depth: 3, ..UNetConfig::tiny().input },
            stem_width: 3,
            encoder_widths: vec![4],
            encoder_blocks: vec![1],
            decoder_widths: vec![4],
            decoder_blocks: vec![1],
            head_width: 3,
            cutter: CutterConfig { width: 2, hidden_width: 3, ..CutterConfig::small_batches() },
            ..UNetConfig::tiny()
        }
    }

    /// By all parameters, of the losses of heads with 5, 2 and 3 classes.
    #[test]
    fn gradients_of_several_heads_of_different_classes_are_right() {
        let heads = [5, 2, 3];
        let net = OwnHeads::new(&config(), &heads).unwrap();
        let (points, normals) = sheet(30, 1);
        let shape = Shape::new(&points, &normals, [1.5, 6.0, 40.0, 5.0]);
        let batch = Batch::new(&[shape], &net.0.config().input).unwrap();
        let model = Model::<f64, _>::with_network(net, 1);
        let run = |params: &[f64]| {
            let (mut model, arena) = (model.clone(), Arena::default());
            model.params.copy_from_slice(params);
            let (pass, mut dlogits, mut sum) =
                (model.forward_train(&batch, None, &arena), vec![], 0.0);
            for (n_classes, logits) in heads.iter().zip(&pass.logits) {
                let classes: Vec<usize> = (0..batch.n_points()).map(|i| i % n_classes).collect();
                let (criterion, mut d) = (CrossEntropy::equal(*n_classes), Vec::new());
                sum += criterion.try_loss(logits, &classes, 1.0, &mut d).unwrap();
                dlogits.push(d);
            }
            let (mut grads, d) = (vec![0.0; params.len()], dlogits.iter().map(|d| &d[..]));
            model.backward(&batch, pass, &d.collect::<Vec<_>>(), &mut grads, &arena);
            (sum, grads)
        };
        let settings = GradcheckSettings { max_elements: 150, ..GradcheckSettings::default() };
        let forward = |v: &[Vec<f64>]| vec![run(&v[0]).0];
        let backward = |v: &[Vec<f64>], dy: &[f64]| {
            vec![run(&v[0]).1.into_iter().map(|g| g * dy[0]).collect()]
        };
        let inputs = [("params", &model.params[..])];
        gradcheck::function(&inputs, forward, backward, &settings).unwrap().require(1e-6).unwrap();
    }

    #[test]
    fn two_heads_of_two_classes_are_the_network_of_the_configuration() {
        let (own, plain) =
            (OwnHeads::new(&config(), &[2, 2]).unwrap(), UNet::new(&config()).unwrap());
        assert_eq!(own.0.layout(), plain.layout());
        for heads in [&[][..], &[5, 0]] {
            let error = UNet::with_heads(&config(), heads).err().unwrap().to_string();
            assert!(error.starts_with("n_classes is ["), "{error}");
        }
    }
}
