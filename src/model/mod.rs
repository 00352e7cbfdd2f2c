//! Neural networks: their configuration, parameters and predictions.
//!
//! A [`Model`] is a description ([`UNet`], [`GraphSage`], or one's own: any [`Network`]) with two flat vectors of
//! numbers. Inference takes `&self` and may run from many threads at once; training and inference take their memory
//! from an [`Arena`](crate::nn::arena::Arena) of the caller.

#[cfg(feature = "approx")]
mod approximate;
mod batch;
mod coarse;
pub mod config;
#[doc(hidden)] // parts of the networks here
pub mod cutter_modules;
mod domain;
#[doc(hidden)] // parts of the networks here
pub mod graph;
#[doc(hidden)] // the paper's other network, of the program
pub mod graph_sage;
#[doc(hidden)] // parts of the networks here
pub mod heads;
mod network;
mod network_config;
mod own_heads;
#[doc(hidden)] // checked by tests
pub mod policy;
mod predict;
mod prediction;
mod predictor;
#[cfg(feature = "weights")]
mod shipped;
mod site_network;
mod training;
#[doc(hidden)] // parts of the networks here
pub mod unet;
#[cfg(feature = "formats")]
pub mod weights;

pub use batch::{Batch, Shape};
pub use config::UNetConfig;
pub use domain::Domain;
#[doc(hidden)] // the paper's other network, of the program
pub use graph_sage::GraphSage;
pub use network::Network;
pub use network_config::NetworkConfig;
pub use predict::{AnyModel, Model};
#[doc(hidden)] // of the program
pub use prediction::Calibration;
pub use prediction::Prediction;
pub use predictor::Predictor;
pub use site_network::AnyNetwork;
#[doc(hidden)] // what `AnyNetwork` takes and leaves, and what the networks here are to runs
pub use site_network::{AnyBatch, AnySaved, SiteNetwork};
pub use training::TrainingPass;
#[doc(hidden)] // what a pass of `UNet` leaves, checked by tests
pub use training::{InputGradients, SavedUNet};
#[doc(hidden)] // checked by tests
pub use unet::Activations;
pub use unet::UNet;
