//! What training and scoring take beside a network.

pub mod loss;
pub mod metrics;
pub mod optim;
