//! The `deepmill` program: parse, call the library, print.

mod args;
mod baseline;
mod bench;
mod check;
mod clock;
mod dataset;
mod demo;
mod density;
mod eval;
mod explain;
mod findings;
mod fixtures;
mod generate;
mod gradcheck;
mod groups;
mod holding;
mod import;
mod label;
mod machine;
mod machined;
mod mesh_args;
mod model_args;
mod out_folder;
mod output;
mod parity;
mod part_itself;
mod predict;
mod premise;
mod processes;
mod progress;
mod published_args;
mod region;
mod report;
mod reproduce;
mod sample;
mod setups;
mod status;
mod tools;
mod train;
mod usage;
mod volume;
mod watch;
mod weights;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use deepmill::Error;
use deepmill::geom::units::Unit;
use output::Output;
use std::process::ExitCode;

/// Which parts of a surface a milling cutter cannot reach, and what is in its way.
///
/// Without a command it runs the demo. Lengths are millimeters.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Number of threads (0: one per processor). Results do not depend on it.
    #[arg(long, global = true, default_value_t = 0)]
    threads: usize,
    /// Print one JSON object on standard output; everything else goes to standard error.
    #[arg(long, global = true)]
    json: bool,
    /// Unit of lengths and areas in tables, CSV files and the page: mm, in, cm or m. Files and JSON for programs stay
    /// in mm.
    #[arg(long, global = true, value_name = "UNIT", default_value_t, value_parser = output_unit)]
    output_unit: Unit,
}

#[derive(Subcommand)]
enum Command {
    Bench(bench::Args),
    Check(check::Args),
    Demo(demo::Args),
    Generate(generate::Args),
    Gradcheck(gradcheck::Args),
    Parity(parity::Args),
    Sample(sample::Args),
    Label(label::Args),
    Tools(tools::Args),
    Setups(setups::Args),
    Machined(machined::Args),
    Watch(watch::Args),
    Dataset(dataset::Args),
    Train(train::Args),
    Eval(eval::Args),
    Predict(predict::Args),
    Report(report::Args),
    Explain(explain::Args),
    Reproduce(reproduce::Args),
    Weights(weights::Args),
}

fn main() -> ExitCode {
    let parsed = groups::grouped(program()).try_get_matches();
    let cli = match parsed.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => return usage::refuse(&error),
        Err(shown) => shown.exit(),
    };
    let output = Output::new(cli.json, cli.output_unit);
    let run = || {
        deepmill::scalar::simd_isa()?;
        match &cli.command {
            None => demo::run(&demo::Args::default(), &output),
            Some(Command::Bench(args)) => bench::run(args, &output),
            Some(Command::Check(args)) => check::run(args, &output),
            Some(Command::Demo(args)) => demo::run(args, &output),
            Some(Command::Generate(args)) => generate::run(args, &output),
            Some(Command::Gradcheck(args)) => gradcheck::run(args, &output),
            Some(Command::Parity(args)) => parity::run(args, &output),
            Some(Command::Sample(args)) => sample::run(args, &output),
            Some(Command::Label(args)) => label::run(args, &output),
            Some(Command::Tools(args)) => tools::run(args, &output),
            Some(Command::Setups(args)) => setups::run(args, &output),
            Some(Command::Machined(args)) => machined::run(args, &output),
            Some(Command::Watch(args)) => watch::run(args, &output),
            Some(Command::Dataset(args)) => dataset::run(args, &output),
            Some(Command::Train(args)) => train::run(args, &output),
            Some(Command::Eval(args)) => eval::run(args, &output),
            Some(Command::Predict(args)) => predict::run(args, &output),
            Some(Command::Report(args)) => report::run(args, &output),
            Some(Command::Explain(args)) => explain::run(args, &output),
            Some(Command::Reproduce(args)) => reproduce::run(args, &output),
            Some(Command::Weights(args)) => weights::run(args, &output),
        }
    };
    match deepmill::par::with_threads(n_threads(cli.threads, &output), run)
        .and_then(|result: deepmill::Result<()>| result)
        .and_then(|()| output.lost().map_or(Ok(()), Err))
    {
        Ok(()) if output.tell_broken_limits() => ExitCode::from(LIMIT_BROKEN),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            output.error(&error);
            ExitCode::from(exit_code(&error))
        }
    }
}

/// The program; of a part that is watched, no folder is required.
fn program() -> clap::Command {
    let optional = |command: clap::Command| command.mut_arg("out", |out| out.required(false));
    Cli::command().mut_subcommand("watch", |watch| {
        let others = ["label", "tools", "setups"];
        others
            .into_iter()
            .fold(optional(watch), |watch, other| watch.mut_subcommand(other, optional))
    })
}

fn output_unit(text: &str) -> Result<Unit, String> {
    text.parse().map_err(|_| "expected mm, cm, m or in".into())
}

/// An impossible argument is a usage error, also if the library finds it.
fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Argument { .. } => 2,
        Error::Process { source, .. } => exit_code(source),
        _ => 1,
    }
}

/// All was done, and a result breaks a limit (`--fail-if`).
const LIMIT_BROKEN: u8 = 3;

/// More threads than processors only help to show that results do not depend on their number.
const MOST_THREADS_PER_PROCESSOR: usize = 8;

/// The number of threads wanted, or as many as are of any use.
fn n_threads(wanted: usize, output: &Output) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let most = MOST_THREADS_PER_PROCESSOR * processors;
    if wanted > most {
        output.warn(format!("--threads {wanted}: {most} are used on {processors} processors"));
    }
    wanted.min(most)
}
