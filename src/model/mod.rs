//! Neural networks: their configuration, parameters and predictions.
//!
//! A [`Model`] is a description ([`UNet`]) with two flat vectors of numbers. Inference takes `&self` and
//! may run from many threads at once; training and inference
//! take their memory from an [`Arena`](crate::nn::arena::Arena) of the caller.

mod batch;
pub mod config;
pub mod cutter_modules;
mod domain;
pub mod graph;
pub mod graph_sage;
pub mod heads;
pub mod policy;
mod predict;
mod predictor;
#[cfg(feature = "weights")]
mod shipped;
mod training;
pub mod unet;
#[cfg(feature = "formats")]
pub mod weights;

pub use batch::{Batch, Shape};
pub use config::UNetConfig;
pub use domain::Domain;
pub use graph_sage::GraphSage;
pub use predict::{Calibration, Model, Prediction};
pub use predictor::Predictor;
pub use training::{InputGradients, TrainingPass};
pub use unet::{Activations, UNet};
