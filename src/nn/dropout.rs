//! Dropout (Srivastava et al. 2014): in training each element is zero with probability `p`, the others
//! are divided by `1 - p`, so that inference needs no change.

use super::arena::{Arena, Buffer};
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use crate::numeric::rng::Stream;
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use std::ops::Range;

/// Dropout with a probability per element, over `[n_shapes, c]` for any `c`.
///
/// Row `i` draws from stream `i` of the pass, so a shape's mask does not depend on its batch. Without streams it
/// is the identity, as with `p = 0`.
///
/// ```
/// use deepmill::nn::{arena::Arena, dropout::Dropout, layer::Layer, operand::Operand, pass::Training};
/// use deepmill::rng::{Purpose, Stream};
///
/// let (dropout, arena, x) = (Dropout::new(0.5)?, Arena::default(), Operand::new(&[3.0; 100], 100));
/// let mut streams = [Stream::new(1, 0, 0, Purpose::Dropout)]; // one row
/// let mut pass = Training::new(&[], &mut [], &arena).with_dropout(&mut streams);
/// let (y, _) = dropout.forward_train(&mut pass, &(), x);
/// assert!(y.iter().all(|&y| y == 0.0 || y == 6.0)); // dropped, or 3 / (1 - p)
/// assert!((30..70).contains(&y.iter().filter(|y| **y == 0.0).count()));
/// let y = dropout.forward(&pass.inference(), &(), x);
/// assert_eq!(y[..], [3.0; 100]); // inference drops nothing
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dropout {
    p: f64,
}

impl Dropout {
    /// Each element becomes zero with probability `p`.
    ///
    /// # Errors
    /// If `p` is not in `[0, 1)`.
    pub fn new(p: f64) -> Result<Self> {
        if (0.0..1.0).contains(&p) {
            return Ok(Dropout { p });
        }
        Err(Error::argument("dropout", p, "at least 0 and below 1", "choose another probability"))
    }

    /// Factors of the elements of `x: [streams.len(), c]`.
    fn mask<T: Scalar>(&self, arena: &Arena<T>, len: usize, streams: &mut [Stream]) -> Buffer<T> {
        let keep = T::from_f64(1.0 / (1.0 - self.p));
        let mut mask = arena.get(len);
        assert!(len.is_multiple_of(streams.len()), "one stream for each row");
        for (row, stream) in mask.chunks_exact_mut(len / streams.len()).zip(streams) {
            row.fill_with(|| if stream.chance(self.p) { T::ZERO } else { keep });
        }
        mask
    }
}

/// `d *= mask`, element by element.
fn apply<T: Scalar>(mask: &[T], d: &mut [T]) {
    d.iter_mut().zip(mask).for_each(|(d, &m)| *d *= m);
}

impl<T: Scalar> Layer<T> for Dropout {
    type Geometry = ();
    /// The factors; none where nothing was dropped.
    type Saved = Option<Buffer<T>>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        x.copied(pass.arena)
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        (): &(),
        x: Operand<T>,
    ) -> (Buffer<T>, Option<Buffer<T>>) {
        let mut y = x.copied(pass.arena);
        let streams = pass.dropout.as_deref_mut().filter(|s| self.p > 0.0 && !s.is_empty());
        let mask = streams.map(|streams| self.mask(pass.arena, y.len(), streams));
        if let Some(mask) = &mask {
            apply(mask, &mut y);
        }
        (y, mask)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        mask: Option<Buffer<T>>,
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        if let Some(mask) = &mask {
            apply(mask, &mut dy);
        }
        OperandGradient::of_matrix(pass.arena, x, dy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::gradcheck::{self, Case, GradcheckSettings};
    use crate::nn::params::Layout;
    use crate::numeric::rng::Purpose;

    fn streams(n: u64) -> Vec<Stream> {
        (0..n).map(|i| Stream::new(3, 0, i, Purpose::Dropout)).collect()
    }

    /// Ones that went through a dropout of `p`.
    fn dropped(p: f64, n: usize, streams: &mut [Stream]) -> Vec<f64> {
        let (x, arena) = (vec![1.0; n], &Arena::default());
        let mut pass = Training { params: &[], buffers: &mut [], dropout: Some(streams), arena };
        let x = Operand::new(&x, n);
        Dropout::new(p).unwrap().forward_train(&mut pass, &(), x).0.to_vec()
    }

    #[test]
    fn keeps_the_mean_and_drops_the_stated_share() {
        let x = dropped(0.3, 20_000, &mut streams(2));
        let zero = x.iter().filter(|x| **x == 0.0).count() as f64 / 20_000.0;
        let mean = x.iter().sum::<f64>() / 20_000.0;
        assert!((zero - 0.3).abs() < 0.01 && (mean - 1.0).abs() < 0.02, "{zero} {mean}");
    }

    #[test]
    fn mask_of_a_row_is_its_own() {
        let both = dropped(0.5, 64, &mut streams(2));
        assert_eq!(both[32..], dropped(0.5, 32, &mut streams(2)[1..]));
        assert_ne!(both[..32], both[32..]);
    }

    #[test]
    fn gradient_is_right_with_the_mask_held() {
        let (dropout, streams, layout) =
            (Dropout::new(0.4).unwrap(), streams(4), Layout::default());
        let values = gradcheck::probe(40, 1);
        let (x, dropout_streams) = (Operand::new(&values, 10), Some(&streams[..]));
        let case =
            Case { layout: &layout, params: &[], geometry: &(), x, dropout: dropout_streams };
        let report = gradcheck::layer(&dropout, &case, &GradcheckSettings::default()).unwrap();
        report.require(1e-7).unwrap();
    }

    #[test]
    fn probabilities_outside_their_domain_are_refused() {
        for p in [-0.1, 1.0, 1.5, f64::NAN] {
            let message = Dropout::new(p).unwrap_err().to_string();
            assert!(message.starts_with("dropout is"), "{message}");
        }
    }
}
