//! `deepmill bench`: times the network on this machine.

mod input;
mod layers;
mod network;

use crate::output::Output;
use clap::Subcommand;
use deepmill::Result;

/// Measure how fast this machine runs the network.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Layers(layers::Args),
    Network(network::Args),
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    match &args.what {
        What::Layers(args) => layers::run(args, output),
        What::Network(args) => network::run(args, output),
    }
}
