//! A network with its numbers, and its answer for one part and one cutter.

use super::batch::{Batch, Shape};
use super::cutter_modules::N_LENGTHS;
use super::training::Workspace;
use super::unet::{Activations, N_HEADS, UNet};
use super::{UNetConfig, heads::N_CLASSES};
use crate::Result;
use crate::rng::Stream;
use crate::scalar::Scalar;
use glam::Vec3;

/// Class of head 1 that means "inaccessible"; class 1 means "accessible".
pub const INACCESSIBLE_CLASS: usize = 0;
/// Class of head 2 that means "occlusion point"; class 0 means "none".
pub const OCCLUSION_CLASS: usize = 1;

/// A network and its numbers.
#[derive(Debug, Clone)]
pub struct Model<T> {
    /// The description.
    pub net: UNet,
    /// Learned numbers, laid out as `net.layout().params` says.
    pub params: Vec<T>,
    /// Running statistics, laid out as `net.layout().buffers` says.
    pub buffers: Vec<T>,
}

/// What a network says about the sites of one part and one cutter.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Prediction<T> {
    /// Two logits per site of head 1: inaccessible, accessible.
    pub logits_inaccessible: Vec<[T; N_CLASSES]>,
    /// Two logits per site of head 2: no occlusion point, occlusion point.
    pub logits_occlusion: Vec<[T; N_CLASSES]>,
}

impl<T: Scalar> Prediction<T> {
    /// Probability of each site to be inaccessible.
    pub fn probability_inaccessible(&self) -> Vec<T> {
        probabilities(&self.logits_inaccessible, INACCESSIBLE_CLASS)
    }

    /// Probability of each site to be an occlusion point.
    pub fn probability_occlusion(&self) -> Vec<T> {
        probabilities(&self.logits_occlusion, OCCLUSION_CLASS)
    }

    /// Sites whose greater logit says "inaccessible"; of equal logits the first class counts.
    pub fn inaccessible(&self) -> Vec<bool> {
        self.logits_inaccessible.iter().map(|[inaccessible, other]| inaccessible >= other).collect()
    }

    /// Sites whose greater logit says "occlusion point".
    pub fn occlusion(&self) -> Vec<bool> {
        self.logits_occlusion.iter().map(|[other, occlusion]| occlusion > other).collect()
    }
}

fn probabilities<T: Scalar>(logits: &[[T; N_CLASSES]], class: usize) -> Vec<T> {
    let softmax =
        |logits: &[T; N_CLASSES]| T::ONE / (T::ONE + (logits[1 - class] - logits[class]).exp());
    logits.iter().map(softmax).collect()
}

impl<T: Scalar> Model<T> {
    /// A network with random starting weights.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain.
    pub fn new(config: &UNetConfig, seed: u64) -> Result<Self> {
        let net = UNet::new(config)?;
        let (params, buffers) = (net.layout().init_params(seed), net.layout().init_buffers());
        Ok(Model { net, params, buffers })
    }

    /// Both answers for every site of one part, in the order of `points_mm`.
    ///
    /// # Errors
    /// If there are no points, a normal is missing, or a number is not finite.
    ///
    /// ```
    /// use deepmill::model::{Model, UNetConfig};
    /// use glam::Vec3;
    /// let model = Model::<f32>::new(&UNetConfig::tiny(), 1)?;
    /// let (points, normals) = ([Vec3::ZERO, Vec3::X], [Vec3::Z, Vec3::Z]);
    /// let prediction = model.predict(&points, &normals, [1.5, 6.0, 40.0, 5.0])?;
    /// assert_eq!(prediction.inaccessible().len(), 2);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn predict(
        &self,
        points_mm: &[Vec3],
        normals: &[Vec3],
        cutter_mm: [f64; N_LENGTHS],
    ) -> Result<Prediction<T>> {
        let shape = Shape { points: points_mm, normals, cutter_mm };
        let batch = Batch::new(&[shape], &self.net.config().input)?;
        let mut activations = Activations::default();
        self.forward(&batch, &mut activations);
        let [first, second] = activations.logits;
        let rows = |logits: Vec<T>| logits.as_chunks().0.to_vec();
        Ok(Prediction { logits_inaccessible: rows(first), logits_occlusion: rows(second) })
    }

    /// Inference on a batch, with every intermediate result.
    pub fn forward(&self, batch: &Batch<T>, to: &mut Activations<T>) {
        self.net.forward(&self.params, &self.buffers, batch, to);
    }

    /// Training pass, see [`UNet::forward_train`]; moves the running statistics.
    pub fn forward_train(
        &mut self,
        batch: &Batch<T>,
        dropout: Option<&mut [Stream]>,
        work: &mut Workspace<T>,
    ) {
        self.net.forward_train(&self.params, &mut self.buffers, batch, dropout, work);
    }

    /// Adds the gradient of a loss to `grads`, see [`UNet::backward`].
    pub fn backward(
        &self,
        batch: &Batch<T>,
        dlogits: [&[T]; N_HEADS],
        work: &mut Workspace<T>,
        grads: &mut [T],
    ) {
        self.net.backward(&self.params, batch, dlogits, work, grads);
    }
}
