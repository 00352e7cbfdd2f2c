//! Multi-head self-attention between all nodes of a shape (Vaswani et al. 2017), around which the input takes a
//! shortcut.

use super::arena::{Arena, Buffer};
use super::column_norm::Epilogue;
use super::conv_plan::OperatorShape;
use super::conv_plan::dense;
use super::layer::Layer;
use super::linear::Linear;
use super::linear_operator::LinearOperator;
use super::operand::{Operand, OperandGradient};
use super::params::Layout;
use super::pass::{Backward, Context, Inference, Training};
use super::pass_memory::PassMemory;
use super::rows;
use crate::exec::memory::product;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// `y = x + [O₁ | … | O_h] W_outᵀ` with `[Q | K | V] = x W_qkvᵀ` and, for head `k` of `d = c/h` columns and the rows of
/// one shape,
///
/// ```text
/// P_k = softmax(Q_k K_kᵀ / √d)     row by row
/// O_k = P_k V_k
/// ```
///
/// Every node meets every other of its shape, whatever their distance: time and memory grow with the square of their
/// number. Products run in vectors, the exponentials of a row one by one. `W_out` starts at 0, so that the layer starts
/// as the identity.
///
/// Where queries are 0, all nodes of the shape count the same: each gets the mean of their values.
///
/// ```
/// use deepmill::nn::{arena::Arena, attention::Attention, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// let mut layout = Layout::default();
/// let attention = Attention::new(&mut layout, "attention", 1, 1);
/// let (arena, x, shapes) = (Arena::default(), [1.0, 3.0, 10.0], [0..2, 2..3]);
/// let output = |params: &[f64]| {
///     attention.forward(&Inference::new(params, &[], &arena), &shapes, Operand::new(&x, 1)).to_vec()
/// };
/// assert_eq!(output(&layout.init_params(7)), x); // it starts as the identity
/// assert_eq!(output(&[0.0, 0.0, 1.0, 1.0]), [3.0, 5.0, 20.0]); // Q = K = 0, V = x, W_out = 1
/// ```
#[derive(Debug, Clone)]
pub struct Attention {
    n_heads: usize,
    qkv: Linear,
    out: Linear,
}

impl Attention {
    /// Appends `{name}.qkv.weight: [3c, c]` and `{name}.out.weight: [c, c]`.
    ///
    /// # Panics
    /// If `n_heads` does not divide `c`, either is 0 or a name is taken.
    pub fn new(layout: &mut Layout, name: &str, c: usize, n_heads: usize) -> Self {
        assert!(n_heads > 0 && c.is_multiple_of(n_heads), "{n_heads} heads of {c} columns");
        let qkv = Linear::new(layout, &format!("{name}.qkv"), c, 3 * c, false);
        let out = Linear::zeros(layout, &format!("{name}.out"), c, c);
        Attention { n_heads, qkv, out }
    }

    /// Columns of input and output.
    pub fn c(&self) -> usize {
        self.out.c_out()
    }

    fn tasks(&self, shapes: &[Range<usize>]) -> Vec<Task> {
        let width = self.c() / self.n_heads;
        let of_shape = |rows: &Range<usize>| {
            let rows = rows.clone();
            (0..self.n_heads).map(move |head| Task {
                rows: rows.clone(),
                first: head * width,
                width,
            })
        };
        shapes.iter().filter(|rows| !rows.is_empty()).flat_map(of_shape).collect()
    }

    /// `[Q | K | V]`, and `[O₁ | … | O_h]`.
    fn attend<T: Scalar>(
        &self,
        context: Context<T>,
        shapes: &[Range<usize>],
        x: Operand<T>,
    ) -> (Buffer<T>, Buffer<T>) {
        let (c, arena) = (self.c(), context.arena);
        let rows = shapes.last().map_or(0, |shape| shape.end);
        assert_eq!(x.n_rows(), rows, "rows of the input and of the shapes differ");
        let qkv = self.qkv.apply(context, &(), x, Epilogue::Identity);
        let (tasks, mut o) = (self.tasks(shapes), arena.get(rows * c));
        let outputs = par::map(tasks.len(), |i| {
            let head = tasks[i].head(arena, &qkv, c);
            let mut o = arena.zeroed(head.v.len());
            dense::add_product_here(&head.p, &head.v, head.n, tasks[i].width, &mut o);
            o
        });
        for (task, output) in tasks.iter().zip(&outputs) {
            task.scatter(output, task.first, c, &mut o);
        }
        (qkv, o)
    }
}

/// One head of one shape.
struct Task {
    rows: Range<usize>,
    /// First of its columns among those of all heads.
    first: usize,
    width: usize,
}

/// Matrices of one head of one shape with `n` rows and `d` columns.
struct Head<T> {
    n: usize,
    /// `Q / √d`, `[n, d]`.
    q: Buffer<T>,
    /// `Kᵀ`, `[d, n]`.
    k: Buffer<T>,
    /// `[n, d]`.
    v: Buffer<T>,
    /// `[n, n]`.
    p: Buffer<T>,
}

impl Task {
    fn head<T: Scalar>(&self, arena: &Arena<T>, qkv: &[T], c: usize) -> Head<T> {
        let (n, d) = (self.rows.len(), self.width);
        let [mut q, k, v] = [0, 1, 2].map(|i| self.gather(arena, qkv, i * c + self.first, 3 * c));
        let scale = self.scale();
        q.iter_mut().for_each(|q| *q *= scale);
        let mut transposed = arena.get(k.len());
        dense::transpose(&k, n, d, &mut transposed);
        let mut p = arena.zeroed(n * n);
        dense::add_product_here(&q, &transposed, d, n, &mut p);
        p.chunks_exact_mut(n).for_each(softmax);
        Head { n, q, k: transposed, v, p }
    }

    fn scale<T: Scalar>(&self) -> T {
        T::from_f64(1.0 / (self.width as f64).sqrt())
    }

    /// Its rows and `width` columns from `first` on of a matrix of `c` columns.
    fn gather<T: Scalar>(&self, arena: &Arena<T>, x: &[T], first: usize, c: usize) -> Buffer<T> {
        let mut part = arena.get(self.rows.len() * self.width);
        for (part, row) in part.chunks_exact_mut(self.width).zip(self.rows.clone()) {
            part.copy_from_slice(&x[row * c + first..][..self.width]);
        }
        part
    }

    /// The reverse of [`Task::gather`].
    fn scatter<T: Scalar>(&self, part: &[T], first: usize, c: usize, x: &mut [T]) {
        for (part, row) in part.chunks_exact(self.width).zip(self.rows.clone()) {
            x[row * c + first..][..self.width].copy_from_slice(part);
        }
    }

    /// Gradients by `Q`, `K` and `V` from that by `O`, `[n, d]` each:
    ///
    /// ```text
    /// dV = Pᵀ dO     dP = dO Vᵀ     dS = P ∘ (dP − (P ∘ dP) 1)     dQ = dS K / √d     dK = dSᵀ Q / √d
    /// ```
    fn gradients<T: Scalar>(&self, arena: &Arena<T>, head: &Head<T>, d_o: &[T]) -> [Buffer<T>; 3] {
        let (Head { n, q, k, v, p }, d) = (head, self.width);
        let n = *n;
        let transposed = |x: &[T], rows: usize, columns: usize| {
            let mut y = arena.get(x.len());
            dense::transpose(x, rows, columns, &mut y);
            y
        };
        let mut dv = arena.zeroed(n * d);
        dense::add_product_here(&transposed(p, n, n), d_o, n, d, &mut dv);
        let mut ds = arena.zeroed(n * n);
        dense::add_product_here(d_o, &transposed(v, n, d), d, n, &mut ds);
        for (ds, p) in ds.chunks_exact_mut(n).zip(p.chunks_exact(n)) {
            let weighted = ds.iter().zip(p).fold(0.0, |sum, (dp, p)| sum + (*dp * *p).to_f64());
            let weighted = T::from_f64(weighted);
            ds.iter_mut().zip(p).for_each(|(ds, p)| *ds = *p * (*ds - weighted));
        }
        let mut dq = arena.zeroed(n * d);
        dense::add_product_here(&ds, &transposed(k, d, n), n, d, &mut dq);
        let scale = self.scale();
        dq.iter_mut().for_each(|dq| *dq *= scale);
        let mut dk = arena.zeroed(n * d);
        dense::add_product_here(&transposed(&ds, n, n), q, n, d, &mut dk);
        [dq, dk, dv]
    }
}

/// `p_j = exp(s_j − max s) / Σ exp(s − max s)`, in place; the sum in f64, in order.
fn softmax<T: Scalar>(row: &mut [T]) {
    let greatest = row.iter().copied().reduce(T::max).unwrap_or(T::ZERO);
    let mut sum = 0.0;
    for s in row.iter_mut() {
        *s = (*s - greatest).exp();
        sum += s.to_f64();
    }
    let share = T::from_f64(1.0 / sum);
    row.iter_mut().for_each(|p| *p *= share);
}

impl<T: Scalar> Layer<T> for Attention {
    /// Rows of each shape, one after the other.
    type Geometry = [Range<usize>];
    /// All is computed again: the probabilities would be the largest matrix of the network.
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        [self.qkv.tensor_ranges(), self.out.tensor_ranges()].concat()
    }

    fn forward(&self, pass: &Inference<T>, shapes: &[Range<usize>], x: Operand<T>) -> Buffer<T> {
        let (context, c) = (pass.context(), self.c());
        let (_, o) = self.attend(context, shapes, x);
        let o = Operand::new(&o, c);
        let mut y = self.out.apply(context, &(), o, Epilogue::Identity);
        rows::add_all(&mut y, &x.to_matrix(pass.arena));
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        shapes: &[Range<usize>],
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), shapes, x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        shapes: &[Range<usize>],
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let (c, arena) = (self.c(), pass.arena);
        let (qkv, o) = self.attend(pass.context(), shapes, x);
        let o = Operand::new(&o, c);
        self.out.weight_gradient(pass, &(), o, &dy);
        let d_o = self.out.input_gradient(pass.context(), &(), o, &dy).into_first();
        let tasks = self.tasks(shapes);
        let gradients = par::map(tasks.len(), |i| {
            let head = tasks[i].head(arena, &qkv, c);
            let d_o = tasks[i].gather(arena, &d_o, tasks[i].first, c);
            tasks[i].gradients(arena, &head, &d_o)
        });
        let mut dqkv = qkv;
        for (task, parts) in tasks.iter().zip(&gradients) {
            for (i, part) in parts.iter().enumerate() {
                task.scatter(part, i * c + task.first, 3 * c, &mut dqkv);
            }
        }
        self.qkv.weight_gradient(pass, &(), x, &dqkv);
        let mut dx = self.qkv.input_gradient(pass.context(), &(), x, &dqkv);
        dx.add(&OperandGradient::of_matrix(arena, x, dy));
        dx
    }
}

/// Memory of attention between the nodes of each shape, `n` in all, at most `max_nodes` in one.
pub(crate) fn memory(pass: &mut PassMemory, [n, max_nodes]: [usize; 2], c: usize, n_heads: usize) {
    let at_once = par::threads().min(n_heads.saturating_mul(pass.n_shapes));
    let squares = if pass.training { 5 } else { 1 };
    let of_heads = product([at_once, max_nodes, squares * max_nodes + 8 * (c / n_heads)]);
    let rows = product([n, if pass.training { 12 } else { 6 }, c]);
    pass.use_workspace(of_heads.saturating_add(rows));
    pass.layer(OperatorShape::linear(n, c, 3 * c));
    pass.layer(OperatorShape::linear(n, c, c));
}

#[cfg(test)]
mod tests {
    use super::super::testing::{forward, require_gradients};
    use super::*;
    use crate::conformance::gradcheck::probe;

    /// The rows of a single shape.
    fn one(n: usize) -> [Range<usize>; 1] {
        std::array::from_fn(|_| 0..n)
    }

    fn attention(c: usize, n_heads: usize) -> (Attention, Layout, Vec<f64>) {
        let mut layout = Layout::default();
        let attention = Attention::new(&mut layout, "a", c, n_heads);
        let params = probe(layout.n_params(), 1);
        (attention, layout, params)
    }

    #[test]
    fn gradients_are_right_for_one_shape_and_for_several() {
        for (c, n_heads, shapes) in
            [(4, 1, one(5).to_vec()), (6, 3, vec![0..1, 1..1, 1..8]), (4, 2, vec![0..3, 3..7])]
        {
            let (layer, layout, params) = attention(c, n_heads);
            let n = shapes.last().unwrap().end;
            let x = probe(n * c, 2);
            let x = Operand::new(&x, c);
            require_gradients(&layer, (&layout, &params), &shapes[..], x);
        }
    }

    #[test]
    fn shapes_do_not_influence_each_other_and_order_does_not_matter() {
        let (layer, _, params) = attention(4, 2);
        let x = probe(7 * 4, 2);
        let both = forward(&layer, &params, &[0..3, 3..7][..], Operand::new(&x, 4));
        let second = forward(&layer, &params, &one(4), Operand::new(&x[12..], 4));
        assert_eq!(both[12..], second);
        let reversed: Vec<f64> = x.chunks_exact(4).rev().flatten().copied().collect();
        let straight = forward(&layer, &params, &one(7), Operand::new(&x, 4));
        let other = forward(&layer, &params, &one(7), Operand::new(&reversed, 4));
        for (a, b) in straight.chunks_exact(4).zip(other.chunks_exact(4).rev()) {
            a.iter().zip(b).for_each(|(a, b)| assert!((a - b).abs() < 1e-14));
        }
    }

    #[test]
    fn it_starts_as_the_identity() {
        let mut layout = Layout::default();
        let layer = Attention::new(&mut layout, "a", 6, 2);
        let x = probe(5 * 6, 3);
        let y = forward(&layer, &layout.init_params(1), &one(5), Operand::new(&x, 6));
        assert_eq!(y, x);
    }

    /// Recorded with `torch.nn.functional.scaled_dot_product_attention` of PyTorch 2.15 in f64: two heads of one
    /// column, three rows, `q, k, v = (x @ w.T).chunk(3, dim=1)`, `y = x + a @ o.T`.
    #[test]
    fn numbers_are_those_of_pytorch() {
        let (layer, layout, _) = attention(2, 2);
        let w = [0.5, -1.0, 1.0, 0.25, -0.5, 1.0, 0.75, 0.5, 1.0, 0.0, -0.25, 2.0];
        let params = [&w[..], &[1.0, 0.5, -2.0, 0.25]].concat();
        let (x, dy) = ([1.0, 2.0, 3.0, -1.0, 0.5, 0.25], [1.0, 0.5, -1.0, 2.0, 0.0, 0.25]);
        let (arena, x) = (&Arena::default(), Operand::new(&x, 2));
        let y = forward(&layer, &params, &one(3), x);
        let mut grads = vec![0.0; layout.n_params()];
        let mut pass = Backward::new(&params, &mut grads, arena);
        let dx = layer.backward(&mut pass, &one(3), x, (), arena.copy_of(&dy)).into_first();
        let torch = [
            (
                &y[..],
                &[
                    4.183412415773,
                    -3.752952450512,
                    4.237611894488,
                    -2.852695388271,
                    2.237599479592,
                    -2.631200260204,
                ][..],
            ),
            (
                &dx,
                &[
                    -2.955598978672,
                    1.725472049142,
                    -2.378744883003,
                    1.983630372819,
                    0.0042751643,
                    -0.24968664282,
                ],
            ),
            (
                &grads,
                &[
                    0.127762124041,
                    0.26991262532,
                    0.007236040762,
                    0.013307219739,
                    -0.072394487917,
                    -0.242228807258,
                    -2.908799126457,
                    4.384324381079,
                    -5.69300267103,
                    -10.006624942369,
                    1.289633505593,
                    0.329522250932,
                    1.949262929153,
                    -0.006924815737,
                    3.821132800091,
                    1.360394133337,
                ],
            ),
        ];
        for (ours, theirs) in torch {
            assert_eq!(ours.len(), theirs.len());
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() < 2e-12, "{a} {b}");
            }
        }
    }
    #[test]
    #[should_panic(expected = "3 heads of 4 columns")]
    fn heads_that_do_not_divide_the_columns_are_refused() {
        attention(4, 3);
    }
}
