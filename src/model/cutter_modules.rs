//! Cutter modules: four lengths of a cutter become features of the decoder.

use super::config::CutterConfig;
use crate::nn::batch_norm::{self, BatchNorm};
use crate::nn::dropout::Dropout;
use crate::nn::linear::Linear;
use crate::nn::params::Layout;
use crate::nn::relu;
use crate::rng::Stream;
use crate::scalar::Scalar;

/// Lengths of a cutter: CR, CH, FR, FH.
pub const N_LENGTHS: usize = 4;

/// Twice: linear, ReLU, batch norm (an option), dropout; `[n_shapes, 4] → [n_shapes, width]`.
///
/// Batch norm here runs over the shapes of a batch. With a single shape, training uses the running
/// statistics instead (see [`BatchNorm`]); the reference refuses such a batch.
#[derive(Debug, Clone)]
pub struct CutterModule {
    first: Half,
    second: Half,
}

#[derive(Debug, Clone)]
struct Half {
    linear: Linear,
    norm: Option<BatchNorm>,
    dropout: Dropout,
}

/// What [`CutterModule::forward_train`] keeps for backward.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    first: HalfCache<T>,
    middle: Vec<T>,
    second: HalfCache<T>,
}

#[derive(Debug, Clone, Default)]
struct HalfCache<T> {
    rectified: Vec<T>,
    norm: batch_norm::Cache,
    mask: Vec<T>,
}

impl Half {
    fn new(layout: &mut Layout, names: [String; 2], c: [usize; 2], config: &CutterConfig) -> Self {
        Half {
            linear: Linear::new(layout, &names[0], c[0], c[1], true),
            norm: config.batch_norm.then(|| BatchNorm::new(layout, &names[1], c[1])),
            dropout: Dropout { p: config.dropout },
        }
    }

    fn forward<T: Scalar>(&self, params: &[T], buffers: &[T], x: &[T], y: &mut Vec<T>) {
        self.linear.forward(params, x, y);
        relu::forward(y);
        if let Some(norm) = &self.norm {
            norm.forward(params, buffers, y);
        }
    }

    fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        dropout: Option<&mut [Stream]>,
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut HalfCache<T>,
    ) {
        self.linear.forward(params, x, &mut cache.rectified);
        relu::forward(&mut cache.rectified);
        match &self.norm {
            Some(norm) => {
                norm.forward_train(params, buffers, &cache.rectified, y, &mut cache.norm);
            }
            None => y.clone_from(&cache.rectified),
        }
        self.dropout.forward_train(dropout, y, &mut cache.mask);
    }

    fn backward<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &HalfCache<T>,
        d: &mut [T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        self.dropout.backward(&cache.mask, d);
        if let Some(norm) = &self.norm {
            norm.backward(params, &cache.rectified, &cache.norm, d, grads);
        }
        relu::backward(&cache.rectified, d);
        self.linear.backward(params, x, d, dx, grads);
    }
}

impl CutterModule {
    /// Appends `{name}.0`, `{name}.2`, `{name}.4` and `{name}.6`.
    pub fn new(layout: &mut Layout, name: &str, config: &CutterConfig) -> Self {
        let names = |a, b| [format!("{name}.{a}"), format!("{name}.{b}")];
        let CutterConfig { hidden_width: hidden, width, .. } = *config;
        CutterModule {
            first: Half::new(layout, names(0, 2), [N_LENGTHS, hidden], config),
            second: Half::new(layout, names(4, 6), [hidden, width], config),
        }
    }

    /// Inference, no dropout.
    pub fn forward<T: Scalar>(&self, params: &[T], buffers: &[T], x: &[T], y: &mut Vec<T>) {
        let mut middle = Vec::new();
        self.first.forward(params, buffers, x, &mut middle);
        self.second.forward(params, buffers, &middle, y);
    }

    /// Training; `dropout` holds one stream per shape, `None` turns dropout off.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        mut dropout: Option<&mut [Stream]>,
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
    ) {
        let Cache { first, middle, second } = cache;
        self.first.forward_train(params, buffers, dropout.as_deref_mut(), x, middle, first);
        self.second.forward_train(params, buffers, dropout, middle, y, second);
    }

    /// `d` holds the gradient of `y` and is used up.
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &Cache<T>,
        d: &mut [T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        let mut middle = Vec::new();
        self.second.backward(params, &cache.middle, &cache.second, d, Some(&mut middle), grads);
        self.first.backward(params, x, &cache.first, &mut middle, dx, grads);
    }
}
