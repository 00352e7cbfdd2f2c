//! Cutter modules: small fully connected networks from the four lengths of a cutter to features of the decoder.

use super::config::CutterConfig;
use crate::Result;
use crate::exec::memory::product;
use crate::nn::OperatorShape;
use crate::nn::arena::Buffer;
use crate::nn::batch_norm::{BatchNorm, Statistics};
use crate::nn::dropout::Dropout;
use crate::nn::layer::Layer;
use crate::nn::linear::Linear;
use crate::nn::operand::{Operand, OperandGradient};
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Inference, Training};
use crate::nn::pass_memory::PassMemory;
use crate::nn::relu::Relu;
use crate::numeric::scalar::Scalar;
use std::ops::Range;

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

/// What a training pass leaves for backward.
#[derive(Debug)]
pub struct SavedCutterModule<T> {
    first: SavedHalf<T>,
    middle: Buffer<T>,
    second: SavedHalf<T>,
}

#[derive(Debug)]
struct SavedHalf<T> {
    /// After the ReLU.
    rectified: Buffer<T>,
    statistics: Option<Statistics>,
    mask: Option<Buffer<T>>,
}

impl Half {
    fn new(
        layout: &mut Layout,
        names: [String; 2],
        c: [usize; 2],
        config: &CutterConfig,
    ) -> Result<Self> {
        Ok(Half {
            linear: Linear::new(layout, &names[0], c[0], c[1], true),
            norm: config.batch_norm.then(|| BatchNorm::new(layout, &names[1], c[1])),
            dropout: Dropout::new(config.dropout)?,
        })
    }
}

impl<T: Scalar> Layer<T> for Half {
    type Geometry = ();
    type Saved = SavedHalf<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        let norm = self.norm.as_ref().map(Layer::<T>::param_ranges);
        Layer::<T>::param_ranges(&self.linear)
            .into_iter()
            .chain(norm.into_iter().flatten())
            .collect()
    }

    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        let c = self.linear.c_out();
        let mapped = self.linear.forward(pass, &(), x);
        let rectified = Relu.forward(pass, &(), Operand::new(&mapped, c));
        match &self.norm {
            Some(norm) => norm.forward(pass, &(), Operand::new(&rectified, c)),
            None => rectified,
        }
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        (): &(),
        x: Operand<T>,
    ) -> (Buffer<T>, SavedHalf<T>) {
        let c = self.linear.c_out();
        let mapped = self.linear.forward(&pass.inference(), &(), x);
        let rectified = Relu.forward(&pass.inference(), &(), Operand::new(&mapped, c));
        let x = Operand::new(&rectified, c);
        let (normalized, statistics) =
            self.norm.as_ref().map(|norm| norm.forward_train(pass, &(), x)).unzip();
        let x = normalized.as_deref().map_or(x, |normalized| Operand::new(normalized, c));
        let (y, mask) = self.dropout.forward_train(pass, &(), x);
        (y, SavedHalf { rectified, statistics, mask })
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        saved: SavedHalf<T>,
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let SavedHalf { rectified, statistics, mask } = saved;
        let inner = Operand::new(&rectified, self.linear.c_out());
        let mut d = self.dropout.backward(pass, &(), inner, mask, dy).into_first();
        if let (Some(norm), Some(statistics)) = (&self.norm, statistics) {
            d = norm.backward(pass, &(), inner, statistics, d).into_first();
        }
        let d = Relu.backward(pass, &(), inner, (), d).into_first();
        self.linear.backward(pass, &(), x, (), d)
    }
}

impl CutterModule {
    /// Appends `{name}.0`, `{name}.2`, `{name}.4` and `{name}.6`.
    ///
    /// # Errors
    /// If the dropout is not in `[0, 1)`.
    ///
    /// # Panics
    /// If a width is 0 or a name is taken.
    pub fn new(layout: &mut Layout, name: &str, config: &CutterConfig) -> Result<Self> {
        let names = |a, b| [format!("{name}.{a}"), format!("{name}.{b}")];
        let CutterConfig { hidden_width: hidden, width, .. } = *config;
        Ok(CutterModule {
            first: Half::new(layout, names(0, 2), [N_LENGTHS, hidden], config)?,
            second: Half::new(layout, names(4, 6), [hidden, width], config)?,
        })
    }
}

impl<T: Scalar> Layer<T> for CutterModule {
    type Geometry = ();
    type Saved = SavedCutterModule<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        [&self.first, &self.second].into_iter().flat_map(Layer::<T>::param_ranges).collect()
    }

    /// No dropout.
    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        let middle = self.first.forward(pass, &(), x);
        self.second.forward(pass, &(), Operand::new(&middle, self.first.linear.c_out()))
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        (): &(),
        x: Operand<T>,
    ) -> (Buffer<T>, Self::Saved) {
        let (middle, first) = self.first.forward_train(pass, &(), x);
        let inner = Operand::new(&middle, self.first.linear.c_out());
        let (y, second) = self.second.forward_train(pass, &(), inner);
        (y, SavedCutterModule { first, middle, second })
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        saved: Self::Saved,
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let SavedCutterModule { first, middle, second } = saved;
        let inner = Operand::new(&middle, self.first.linear.c_out());
        let dmiddle = self.second.backward(pass, &(), inner, second, dy).into_first();
        self.first.backward(pass, &(), x, first, dmiddle)
    }
}

/// Memory of cutter modules of these widths.
pub(crate) fn memory(pass: &mut PassMemory, n_modules: usize, [hidden_width, width]: [usize; 2]) {
    for _ in 0..n_modules {
        for (c_in, c) in [(N_LENGTHS, hidden_width), (hidden_width, width)] {
            pass.layer(OperatorShape::linear(pass.n_shapes, c_in, c));
            // Rectified, dropped out, their gradients.
            pass.save(product([pass.n_shapes, c, 4]));
        }
    }
}
