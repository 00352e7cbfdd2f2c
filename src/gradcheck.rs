//! Finite differences and adjoint tests, in f64.
