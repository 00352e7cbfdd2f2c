//! Instruction sets of this processor, found at run time, and the compilation of kernels for each.
//!
//! A kernel is written once as a [`Kernel`] whose `run` is `#[inline(always)]`; [`Isa::run`] compiles
//! it once per instruction set behind a shell that enables its features. An instruction set carries a zero-size
//! token that only a successful check can build, so holding one is the proof that its shell may be
//! entered.

#[cfg(target_arch = "aarch64")]
use super::token::Neon;
use super::token::Portable;
#[cfg(target_arch = "x86_64")]
use super::token::{Avx2, Avx512};
use super::vector::Simd;
use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// The environment variable that forces an instruction set by its name.
pub const VARIABLE: &str = "DEEPMILL_SIMD";

/// Work that is compiled once per instruction set.
///
/// `run` must be `#[inline(always)]`, and so must all that it calls on its hot path; code that is not
/// inlined into the shell is compiled for the baseline: right, but slow.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// The body; `simd` is the instruction set's token.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// An instruction set that this processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Isa {
    /// Whatever the target guarantees.
    #[doc(hidden)] // its token cannot be named
    Portable(Portable),
    /// x86-64 with AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    Avx2(Avx2),
    /// x86-64 with AVX-512 F, BW, DQ, VL.
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    Avx512(Avx512),
    /// 64-bit ARM with NEON.
    #[cfg(target_arch = "aarch64")]
    #[doc(hidden)]
    Neon(Neon),
}

/// An instruction set that was named and that this processor or this build does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unavailable {
    /// The name.
    pub name: String,
}

impl fmt::Display for Unavailable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = Isa::available().iter().map(|isa| isa.name()).collect();
        write!(
            f,
            "instruction set {:?} is not among those of this processor: {}",
            self.name,
            names.join(", ")
        )
    }
}

impl std::error::Error for Unavailable {}

/// Index in [`Isa::available`] of the instruction set in force, plus one; 0 before the first use.
static ACTIVE: AtomicU8 = AtomicU8::new(0);

impl Isa {
    /// Every instruction set of this processor, slowest first; found once.
    pub fn available() -> &'static [Isa] {
        static AVAILABLE: OnceLock<Vec<Isa>> = OnceLock::new();
        AVAILABLE.get_or_init(|| {
            let isas = [
                Portable::new().map(Isa::Portable),
                #[cfg(target_arch = "aarch64")]
                Neon::new().map(Isa::Neon),
                #[cfg(target_arch = "x86_64")]
                Avx2::new().map(Isa::Avx2),
                #[cfg(target_arch = "x86_64")]
                Avx512::new().map(Isa::Avx512),
            ];
            isas.into_iter().flatten().collect()
        })
    }

    /// `portable`, `avx2`, `avx512` or `neon`.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Portable(_) => "portable",
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Isa::Neon(_) => "neon",
        }
    }

    /// The instruction set that the environment variable `DEEPMILL_SIMD` names, or the fastest if it is unset or empty.
    ///
    /// # Errors
    /// If it names an instruction set that is not available.
    pub fn requested() -> Result<Isa, Unavailable> {
        match std::env::var_os(VARIABLE).filter(|name| !name.is_empty()) {
            Some(name) => name.to_string_lossy().parse(),
            None => Ok(Isa::fastest()),
        }
    }

    /// The last instruction set of [`Isa::available`].
    pub fn fastest() -> Isa {
        *Isa::available().last().expect("the portable one is always there")
    }

    /// The instruction set in force: the one [`Isa::activate`]d, else the one requested, else the fastest.
    ///
    /// A request that cannot be met counts as none here; programs call [`Isa::requested`] first.
    pub fn active() -> Isa {
        match ACTIVE.load(Ordering::Relaxed) {
            0 => {
                let isa = Isa::requested().unwrap_or_else(|_| Isa::fastest());
                isa.activate();
                isa
            }
            i => Isa::available()[usize::from(i) - 1],
        }
    }

    /// Puts this instruction set in force for the whole process. Results do not depend on it: for tests and benches.
    pub fn activate(self) {
        let index = Isa::available().iter().position(|&isa| isa == self);
        ACTIVE.store(index.map_or(0, |i| i as u8 + 1), Ordering::Relaxed);
    }

    /// Runs `kernel` as compiled for this instruction set.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Isa::Portable(token) => kernel.run(token),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the token proves that the processor has the features of the shell.
            Isa::Avx2(token) => unsafe { run_avx2(kernel, token) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the token proves that the processor has the features of the shell.
            Isa::Avx512(token) => unsafe { run_avx512(kernel, token) },
            #[cfg(target_arch = "aarch64")]
            // SAFETY: the token proves that the processor has the features of the shell.
            Isa::Neon(token) => unsafe { run_neon(kernel, token) },
        }
    }
}

impl fmt::Display for Isa {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Isa {
    type Err = Unavailable;

    /// Reads [`Isa::name`]. An error if there is none of that name, or this processor lacks it.
    fn from_str(name: &str) -> Result<Isa, Unavailable> {
        let found = Isa::available().iter().find(|isa| isa.name() == name);
        found.copied().ok_or_else(|| Unavailable { name: name.into() })
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2")]
fn run_avx2<K: Kernel>(kernel: K, token: Avx2) -> K::Output {
    kernel.run(token)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,popcnt,bmi1,bmi2")]
fn run_avx512<K: Kernel>(kernel: K, token: Avx512) -> K::Output {
    kernel.run(token)
}

#[cfg(target_arch = "aarch64")]
#[target_feature(enable = "neon")]
fn run_neon<K: Kernel>(kernel: K, token: Neon) -> K::Output {
    kernel.run(token)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Lanes;

    impl Kernel for Lanes {
        type Output = usize;

        #[inline(always)]
        fn run<S: Simd>(self, _: S) -> usize {
            S::LANES
        }
    }

    #[test]
    fn every_available_isa_runs_under_its_own_name() {
        assert_eq!(Isa::available()[0].name(), "portable");
        for &isa in Isa::available() {
            assert_eq!(isa.to_string().parse(), Ok(isa));
            assert!(isa.run(Lanes) >= 4);
        }
    }

    #[test]
    fn an_unknown_isa_is_an_error_that_lists_the_known_ones() {
        let error = "mmx".parse::<Isa>().unwrap_err().to_string();
        assert!(error.contains("\"mmx\"") && error.contains("portable"), "{error}");
    }

    /// Fails, rather than tests something else, when an instruction set was forced that this processor lacks.
    #[test]
    fn the_requested_isa_is_available() {
        Isa::requested().unwrap();
    }
}
