//! Arguments that choose the network of a command.

use crate::args::name_of;
use deepmill::Result;
use deepmill::model::{AnyModel, weights};
use std::path::PathBuf;

/// Name of the network that is taken where none is named.
pub const SHIPPED: &str = "the network that comes with deepmill";

/// Which network.
#[derive(clap::Args)]
pub struct ModelArgs {
    /// Network: a safetensors file that `deepmill train` has written, or a checkpoint of the reference.
    /// Without it: the network that comes with deepmill.
    #[arg(long, value_name = "FILE", required = cfg!(not(feature = "weights")))]
    model: Option<PathBuf>,
}

impl ModelArgs {
    /// The network and its name.
    pub fn read(&self) -> Result<(AnyModel<f32>, String)> {
        match &self.model {
            Some(path) => Ok((weights::read(path)?, name_of(path))),
            None => shipped(),
        }
    }
}

#[cfg(feature = "weights")]
fn shipped() -> Result<(AnyModel<f32>, String)> {
    Ok((deepmill::model::Model::shipped()?.into(), SHIPPED.into()))
}

#[cfg(not(feature = "weights"))]
fn shipped() -> Result<(AnyModel<f32>, String)> {
    let remedy = "name one, or build deepmill with the feature `weights`";
    Err(deepmill::Error::argument("--model", "missing", "a safetensors file", remedy))
}
