//! Neural networks: their configuration, parameters and predictions.
//!
//! A [`Model`] is a description ([`UNet`], or [`GraphSage`]: any [`Network`]) with two flat vectors of numbers. Inference takes `&self` and
//! may run from many threads at once; training and inference
//! take their memory from an [`Arena`](crate::nn::arena::Arena) of the caller.

mod batch;
mod coarse;
pub mod config;
pub mod cutter_modules;
mod domain;
pub mod graph;
pub mod graph_sage;
pub mod heads;
mod network;
mod network_config;
mod pass_memory;
pub mod policy;
mod predict;
mod prediction;
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
pub use network::{AnyBatch, AnyNetwork, AnySaved, Network};
pub use network_config::NetworkConfig;
pub use predict::{AnyModel, Model};
pub use prediction::{Calibration, Prediction};
pub use predictor::Predictor;
pub use training::{InputGradients, SavedUNet, TrainingPass};
pub use unet::{Activations, UNet};
