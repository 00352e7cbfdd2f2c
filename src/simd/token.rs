//! Tokens: values that only a successful check of the processor creates, as proof of its instructions.

macro_rules! token {
    ($(#[$doc:meta])* $name:ident, $has:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct $name(());

        impl $name {
            /// The token, if this processor has the instruction set.
            pub fn new() -> Option<Self> {
                $has.then_some($name(()))
            }
        }
    };
}

token!(
    /// The target's baseline, with fused multiply-add by arithmetic where the baseline has none.
    Portable, true
);
#[cfg(target_arch = "x86_64")]
token!(
    /// AVX2 and FMA, with the bit counting that comes with them.
    Avx2,
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
);
#[cfg(target_arch = "x86_64")]
token!(
    /// AVX-512 F, BW, DQ and VL, with AVX2 and FMA.
    Avx512,
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && Avx2::new().is_some()
);
#[cfg(target_arch = "aarch64")]
token!(
    /// NEON.
    Neon, std::arch::is_aarch64_feature_detected!("neon")
);
