//! The module with all unsafe code, and nothing else of the crate: it imports nothing.
#![allow(dead_code, unused_imports)]

#[path = "../../src/simd/mod.rs"]
mod simd;
