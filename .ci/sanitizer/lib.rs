//! The module with all unsafe code, and nothing else of the crate: it imports nothing.
#![allow(dead_code, unused_imports)] // The callers of most of it are the rest of the crate.

#[path = "../../src/simd/mod.rs"]
mod simd;
