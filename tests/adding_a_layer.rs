//! A new layer, written as `docs/adding-a-layer.md` says: the page shows this file's code and nothing else.

use deepmill::gradcheck::{self, Case, GradcheckSettings};
use deepmill::nn::arena::{Arena, Buffer};
use deepmill::nn::layer::{self, Layer};
use deepmill::nn::operand::{Operand, OperandGradient};
use deepmill::nn::params::{Init, Layout};
use deepmill::nn::pass::{Backward, Inference, Training};
use deepmill::par;
use deepmill::scalar::Scalar;
use std::ops::Range;

/// `y[n, j] = scale[j] · x[n, j]`: one learned factor per column.
#[derive(Debug, Clone)]
pub struct ChannelScale {
    c: usize,
    scale: Range<usize>,
}

impl ChannelScale {
    /// Appends `{name}.scale: [c]`, which starts at 1.
    ///
    /// # Panics
    /// If `c` is 0 or the name is taken.
    pub fn new(layout: &mut Layout, name: &str, c: usize) -> Self {
        let scale = layout.param(format!("{name}.scale"), &[c], Init::Constant(1.0));
        ChannelScale { c, scale }
    }
}

/// Rows of one task: a constant, so that results do not depend on the number of threads.
const BLOCK_ROWS: usize = 1024;

/// Multiplies each row by `factors`.
fn scale_rows<T: Scalar>(factors: &[T], y: &mut [T]) {
    par::for_each_block(y, BLOCK_ROWS * factors.len(), |_, block| {
        for row in block.chunks_exact_mut(factors.len()) {
            row.iter_mut().zip(factors).for_each(|(y, &factor)| *y *= factor);
        }
    });
}

/// `Σ_n x[n, j] · dy[n, j]` per column, in f64, in the order of rows.
fn sums_of_products<T: Scalar>(x: &[T], dy: &[T], c: usize) -> Vec<f64> {
    let mut sums = vec![0.0; c];
    for (x, dy) in x.chunks_exact(c).zip(dy.chunks_exact(c)) {
        for ((sum, x), dy) in sums.iter_mut().zip(x).zip(dy) {
            *sum += x.to_f64() * dy.to_f64();
        }
    }
    sums
}

impl<T: Scalar> Layer<T> for ChannelScale {
    /// Every row stays alone.
    type Geometry = ();
    /// The input is all that backward needs, and it gets that anyway.
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        vec![self.scale.clone()]
    }

    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        assert_eq!(x.width(), self.c, "columns of the input and of the layer differ");
        let mut y = x.copied(pass.arena);
        scale_rows(&pass.params[self.scale.clone()], &mut y);
        y
    }

    fn forward_train(&self, pass: &mut Training<T>, (): &(), x: Operand<T>) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), &(), x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        (): (),
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let sums = sums_of_products(&x.to_matrix(pass.arena), &dy, self.c);
        let grads = pass.grads(&self.scale).iter_mut();
        grads.zip(sums).for_each(|(d, sum)| *d += T::from_f64(sum));
        scale_rows(&pass.params[self.scale.clone()], &mut dy);
        OperandGradient::of_matrix(pass.arena, x, dy)
    }
}

#[test]
fn gradients_are_right_for_one_matrix_and_for_several_side_by_side() {
    let mut layout = Layout::default();
    let scale = ChannelScale::new(&mut layout, "scale", 3);
    let params = gradcheck::probe(layout.n_params(), 1);
    let (nodes, shapes) = (gradcheck::probe(10, 2), [0..2, 2..5]);
    let cutters = gradcheck::probe(2, 3);
    let parts = [Operand::new(&nodes, 2), Operand::PerShape { x: &cutters, c: 1, shapes: &shapes }];
    for x in [Operand::new(&nodes[..9], 3), Operand::Concat(&parts)] {
        let case = Case::new(&layout, &params, &(), x);
        let report = gradcheck::layer(&scale, &case, &GradcheckSettings::default()).unwrap();
        report.require(1e-7).unwrap();
    }
}

/// Recorded with
/// `x = torch.tensor([[1., 2.], [3., 4.]], requires_grad=True)`,
/// `s = torch.tensor([2., -1.], requires_grad=True)`,
/// `y = x * s`, `y.backward(torch.tensor([[1., 0.5], [0., 2.]]))`.
#[test]
fn numbers_are_those_of_pytorch() {
    let mut layout = Layout::default();
    let scale = ChannelScale::new(&mut layout, "scale", 2);
    let (params, arena) = ([2.0f32, -1.0], &Arena::default());
    let (x, mut grads) = (Operand::new(&[1.0, 2.0, 3.0, 4.0], 2), [0.0; 2]);
    let mut pass = Training::new(&params, &mut [], arena);
    let (y, saved) = scale.forward_train(&mut pass, &(), x);
    let mut pass = Backward::new(&params, &mut grads, arena);
    let dy = arena.copy_of(&[1.0, 0.5, 0.0, 2.0]);
    let dx = scale.backward(&mut pass, &(), x, saved, dy).into_first();
    assert_eq!(y[..], [2.0, -2.0, 6.0, -4.0]);
    assert_eq!(dx[..], [2.0, -0.5, 0.0, -2.0]);
    assert_eq!(grads, [1.0, 9.0]);
    assert_eq!(layer::describe::<f32>(&scale, &layout), "scale.scale [2] 2\n2 parameters");
}

/// Code blocks of the page, without `use` lines.
fn blocks(page: &str) -> Vec<&str> {
    page.split("```rust\n").skip(1).filter_map(|rest| rest.split("```").next()).collect()
}

#[test]
fn the_page_shows_what_is_tested_here() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| std::fs::read_to_string(folder.join(path)).unwrap();
    let (page, code) = (read("docs/adding-a-layer.md"), read("tests/adding_a_layer.rs"));
    let blocks = blocks(&page);
    assert!(blocks.len() >= 4, "{} blocks", blocks.len());
    for block in blocks {
        assert!(code.contains(block), "not in tests/adding_a_layer.rs:\n{block}");
    }
}
