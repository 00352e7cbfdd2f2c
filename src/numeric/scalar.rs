//! The trait of real numbers that layers are generic over: `f32` for work, `f64` for gradient checks.

use crate::simd::{Isa, Real, isa};
use crate::{Error, Result};
use std::fmt::{Debug, Display};
use std::iter::Sum;
use std::ops::{AddAssign, Div, DivAssign, Mul, MulAssign, Neg, SubAssign};

/// A real number that layers can be written in; implemented by `f32` and `f64` alone.
///
/// No function here calls the system's mathematical library, so results are the same everywhere.
pub trait Scalar:
    Real
    + Debug
    + Display
    + PartialEq
    + PartialOrd
    + Send
    + Sync
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;

    /// Nearest value to `x`.
    fn from_f64(x: f64) -> Self;
    /// Exact value.
    fn to_f64(self) -> f64;
    /// `self * b + c` with one rounding.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// e to the power `self`.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// The greater of two numbers that are not NaN.
    fn max(self, other: Self) -> Self;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
}

/// The instruction set that the kernels run at; call it first, so that a forced instruction set that this
/// processor lacks is noticed. Results do not depend on the instruction set.
///
/// # Errors
/// If the environment variable `DEEPMILL_SIMD` names an instruction set that is not available.
#[doc(hidden)] // of the program
pub fn simd_isa() -> Result<Isa> {
    Isa::requested().map_err(|error| {
        let names: Vec<_> = Isa::available().iter().map(|isa| isa.name()).collect();
        let expected = format!("one of {}", names.join(", "));
        Error::argument(isa::VARIABLE, error.name, expected, "unset it to use the fastest")
    })
}

macro_rules! scalar {
    ($t:ident, $exp:path, $ln:path) => {
        impl Scalar for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;

            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                $t::mul_add(self, b, c)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $t::sqrt(self)
            }
            fn exp(self) -> Self {
                $exp(self)
            }
            fn ln(self) -> Self {
                $ln(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $t::abs(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if other > self { other } else { self }
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $t::is_finite(self)
            }
        }
    };
}

scalar!(f32, libm::expf, libm::logf);
scalar!(f64, libm::exp, libm::log);
