//! Instruction-set levels: what this processor has, and proof of it.
//!
//! A kernel is written once as a [`Kernel`] whose `run` is `#[inline(always)]`; [`Level::run`] compiles
//! it once per level behind a shell that enables the level's features. A level carries a zero-size
//! token that only a successful check can build, so holding one is the proof that its shell may be
//! entered.

#[cfg(target_arch = "aarch64")]
use super::token::Neon;
use super::token::Portable;
#[cfg(target_arch = "x86_64")]
use super::token::{Avx2, Avx512};
use super::vector::Simd;
use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// The environment variable that forces a level by its name.
pub const VARIABLE: &str = "DEEPMILL_SIMD";

/// Work that is compiled once per level.
///
/// `run` must be `#[inline(always)]`, and so must all that it calls on its hot path; code that is not
/// inlined into the shell is compiled for the baseline: right, but slow.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// The body; `simd` is the level's token.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// An instruction-set level that this processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Whatever the target guarantees.
    Portable(Portable),
    /// x86-64 with AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// x86-64 with AVX-512 F, BW, DQ, VL.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// 64-bit ARM with NEON.
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
}

/// A level that was asked for by name and that this processor or this build does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unavailable {
    /// The name asked for.
    pub name: String,
}

impl fmt::Display for Unavailable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = Level::available().iter().map(|level| level.name()).collect();
        write!(
            f,
            "level {:?} is not among those of this processor: {}",
            self.name,
            names.join(", ")
        )
    }
}

impl std::error::Error for Unavailable {}

/// Index in [`Level::available`] of the level in force, plus one; 0 before the first use.
static ACTIVE: AtomicU8 = AtomicU8::new(0);

impl Level {
    /// Every level of this processor, slowest first; found once.
    pub fn available() -> &'static [Level] {
        static AVAILABLE: OnceLock<Vec<Level>> = OnceLock::new();
        AVAILABLE.get_or_init(|| {
            let levels = [
                Portable::new().map(Level::Portable),
                #[cfg(target_arch = "aarch64")]
                Neon::new().map(Level::Neon),
                #[cfg(target_arch = "x86_64")]
                Avx2::new().map(Level::Avx2),
                #[cfg(target_arch = "x86_64")]
                Avx512::new().map(Level::Avx512),
            ];
            levels.into_iter().flatten().collect()
        })
    }

    /// `portable`, `avx2`, `avx512` or `neon`.
    pub fn name(self) -> &'static str {
        match self {
            Level::Portable(_) => "portable",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Level::Neon(_) => "neon",
        }
    }

    /// The level of that name.
    ///
    /// # Errors
    /// If there is none, or this processor lacks it.
    pub fn named(name: &str) -> Result<Level, Unavailable> {
        let found = Level::available().iter().find(|level| level.name() == name);
        found.copied().ok_or_else(|| Unavailable { name: name.into() })
    }

    /// The level that [`VARIABLE`] names, or the fastest if it is unset or empty.
    ///
    /// # Errors
    /// If it names a level that is not available.
    pub fn requested() -> Result<Level, Unavailable> {
        match std::env::var_os(VARIABLE).filter(|name| !name.is_empty()) {
            Some(name) => Level::named(&name.to_string_lossy()),
            None => Ok(Level::fastest()),
        }
    }

    /// The last level of [`Level::available`].
    pub fn fastest() -> Level {
        *Level::available().last().expect("the portable level is always there")
    }

    /// The level in force: the one [`Level::activate`]d, else the one requested, else the fastest.
    ///
    /// A request that cannot be met counts as none here; programs call [`Level::requested`] first.
    pub fn active() -> Level {
        match ACTIVE.load(Ordering::Relaxed) {
            0 => {
                let level = Level::requested().unwrap_or_else(|_| Level::fastest());
                level.activate();
                level
            }
            i => Level::available()[usize::from(i) - 1],
        }
    }

    /// Puts this level in force for the whole process. Results do not depend on it: for tests and benches.
    pub fn activate(self) {
        let index = Level::available().iter().position(|&level| level == self);
        ACTIVE.store(index.map_or(0, |i| i as u8 + 1), Ordering::Relaxed);
    }

    /// Runs `kernel` as compiled for this level.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Level::Portable(token) => kernel.run(token),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the token proves that the processor has the features of the shell.
            Level::Avx2(token) => unsafe { run_avx2(kernel, token) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Level::Avx512(token) => unsafe { run_avx512(kernel, token) },
            #[cfg(target_arch = "aarch64")]
            // SAFETY: as above.
            Level::Neon(token) => unsafe { run_neon(kernel, token) },
        }
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
    fn every_available_level_runs_under_its_own_name() {
        assert_eq!(Level::available()[0].name(), "portable");
        for &level in Level::available() {
            assert_eq!(Level::named(level.name()), Ok(level));
            assert!(level.run(Lanes) >= 4);
        }
    }

    #[test]
    fn an_unknown_level_is_an_error_that_lists_the_known_ones() {
        let error = Level::named("mmx").unwrap_err().to_string();
        assert!(error.contains("\"mmx\"") && error.contains("portable"), "{error}");
    }

    /// Fails, rather than tests something else, when a level was forced that this processor lacks.
    #[test]
    fn the_requested_level_is_available() {
        Level::requested().unwrap();
    }
}
