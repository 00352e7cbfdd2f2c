//! Labels a part with three tools, says how far it is, can be stopped, and writes a folder with a report:
//! `cargo run --release --example analyze -- part.stl results` (without a file: a block).
#![allow(clippy::print_stdout, clippy::print_stderr)]

use deepmill::analysis::{Analysis, Files, Progress};
use deepmill::data::files::tools::Tool;
use deepmill::geom::{formats::read_part, solids};
use std::sync::atomic::{AtomicBool, Ordering};
use std::{env, ops::ControlFlow, path::PathBuf};

fn main() -> deepmill::Result<()> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let part = match arguments.next() {
        Some(path) => read_part(&path, &Default::default())?,
        None => solids::cuboid([60.0, 40.0, 20.0].into()).into(),
    };
    let folder = arguments.next().unwrap_or_else(|| env::temp_dir().join("deepmill-analyze"));
    let flat = |lengths: &str| Tool::new(lengths.parse()?, Some(0.0), 0.0);
    let tools = vec![flat("6,40,20,60")?, flat("3,25,20,60")?, flat("1.5,12,20,60")?];
    let stop = AtomicBool::new(false); // set from elsewhere, it ends the work
    let mut watch = |at: Progress| {
        eprintln!("{:?}: {} of {}", at.stage, at.done, at.of);
        let stops = stop.load(Ordering::Relaxed);
        if stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let outcome = Analysis::new("part", part, tools).run(&mut watch)?;
    println!("{}", outcome.findings().table().text());
    outcome.write(&folder, &Files::shown(true), &mut watch).map(drop)
}
