//! The processor's state for floating point: rounding and what becomes of subnormal numbers.
//!
//! Code that is compiled for the default state gives other results where a caller has set flush-to-zero,
//! denormals-are-zero or another rounding, and new threads take over the state of the thread that makes them.
//! [`DefaultFloats`] sets the default, and the caller's state again when it is dropped.

/// While this lives, floating point is in its default state: rounding to nearest, subnormal numbers kept, exceptions
/// masked.
///
/// On processors other than x86-64 it does nothing.
pub(crate) struct DefaultFloats {
    #[cfg(target_arch = "x86_64")]
    callers: Option<u32>,
}

impl DefaultFloats {
    /// Costs reading a register where the state is the default already.
    #[inline]
    pub fn set() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            let state = mxcsr::get();
            let callers = (state & mxcsr::CONTROL != mxcsr::DEFAULT).then_some(state);
            if callers.is_some() {
                mxcsr::set(mxcsr::DEFAULT);
            }
            DefaultFloats { callers }
        }
        #[cfg(not(target_arch = "x86_64"))]
        DefaultFloats {}
    }
}

impl Drop for DefaultFloats {
    #[inline]
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if let Some(state) = self.callers {
            mxcsr::set(state);
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod mxcsr {
    use std::arch::asm;

    /// All exceptions masked, nothing else.
    pub const DEFAULT: u32 = 0x1F80;
    /// All but the flags of what happened.
    pub const CONTROL: u32 = 0xFFC0;
    /// Flush-to-zero and denormals-are-zero.
    #[cfg(test)]
    pub const FLUSH: u32 = 0x8040;

    pub fn get() -> u32 {
        let mut state = 0u32;
        // SAFETY: every 64-bit x86 processor has SSE; the address is that of four bytes that may be written, and
        // nothing else changes.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut state, options(nostack, preserves_flags)) };
        state
    }

    /// `state` is [`DEFAULT`] or what [`get`] has returned (in tests, with [`FLUSH`]): it has no reserved bit, which
    /// would fault.
    pub fn set(state: u32) {
        // SAFETY: every 64-bit x86 processor has SSE; the address is that of four bytes that are read. Compiled code
        // assumes the default state: another one is only ever set again where the caller had it before.
        unsafe {
            asm!("ldmxcsr [{}]", in(reg) &raw const state, options(nostack, preserves_flags, readonly))
        };
    }
}

/// Runs `work` as a caller whose subnormal numbers are zeros.
#[cfg(all(test, target_arch = "x86_64"))]
pub(crate) fn flushing<R>(work: impl FnOnce() -> R) -> R {
    let before = mxcsr::get();
    mxcsr::set(before | mxcsr::FLUSH);
    let result = work();
    mxcsr::set(before);
    result
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::hint::black_box;

    fn half(x: f32) -> f32 {
        black_box(black_box(x) * black_box(0.5))
    }

    #[test]
    fn the_default_state_is_set_and_the_callers_comes_back() {
        flushing(|| {
            assert_eq!(half(f32::MIN_POSITIVE), 0.0);
            {
                let _floats = DefaultFloats::set();
                assert!(half(f32::MIN_POSITIVE) > 0.0);
            }
            assert_eq!(half(f32::MIN_POSITIVE), 0.0);
        });
        assert!(half(f32::MIN_POSITIVE) > 0.0);
    }
}
