//! `deepmill sample`: near-uniform sites on a part.

use crate::args::{SiteArgs, name_of};
use crate::clock::Clock;
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::data::npz::NpzWriter;
use deepmill::geom::Sites;
use deepmill::geom::spacing::Spacing;
use deepmill::report::tables::{Cell, Facts};
use deepmill::report::{Colouring, Part, points};
use deepmill::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Spread sites evenly over a part and write them with their normals.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill sample part.stl --sites 20000 --out sites.ply")]
pub struct Args {
    /// Mesh file: STL, OBJ or PLY.
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    #[command(flatten)]
    sites: SiteArgs,
    /// File of the sites, .ply or .npz, in mm.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Sample a mesh that does not bound one solid.
    #[arg(long)]
    force: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let ending = args.out.extension().map(|e| e.to_string_lossy().to_lowercase());
    let write = match ending.as_deref() {
        Some("ply") => write_ply,
        Some("npz") => write_npz,
        _ => {
            let found = "its ending names no format that can be written";
            return Err(Error::file(&args.out, "file name", found, "use .ply or .npz"));
        }
    };
    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, args.force, output)?;
    clock.lap("read_s", "reading");
    let (mesh, sites) = args.sites.place(part)?;
    clock.lap("sites_s", "sites");
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(name_of(&args.part)));
    facts.add("n_sites", "sites", Cell::count(sites.len()));
    if let Some(mesh) = &mesh {
        facts.add("area_mm2", "area in mm²", Cell::Number(mesh.area()));
    }
    if let Some(spacing) = Spacing::measure_on_sheet(&sites) {
        facts.add("spacing_mm", "mean spacing", Cell::Millimetres(spacing.mean_mm));
        facts.add("spacing_min_mm", "least spacing", Cell::Millimetres(spacing.min_mm));
        facts.add("spacing_max_mm", "greatest spacing", Cell::Millimetres(spacing.max_mm));
        facts.add("spacing_cv", "variation of spacing", Cell::Number(spacing.cv));
    }
    clock.lap("measure_s", "measuring");
    write(&args.out, &sites, args)?;
    clock.add_to(&mut facts);
    output.say(facts.text());
    let paths = [args.out.clone()];
    output.files(&paths);
    output.result_with_files(facts.json(), &paths);
    Ok(())
}

fn write_ply(path: &Path, sites: &Sites, args: &Args) -> Result<()> {
    let part = Part { name: &name_of(&args.part), mesh: None, sites, cutter: "none" };
    points::write(path, &part, &Colouring::Plain(sites.len()), &[], &[])
}

fn write_npz(path: &Path, sites: &Sites, args: &Args) -> Result<()> {
    let mut npz = NpzWriter::new();
    npz.vectors("points", &sites.points).vectors("normals", &sites.normals);
    if !sites.faces.is_empty() {
        npz.array("faces", &[sites.faces.len()], &sites.faces);
    }
    npz.metadata(&json!({
        "format": "deepmill sites",
        "version": 1,
        "program": concat!("deepmill ", env!("CARGO_PKG_VERSION")),
        "unit": "mm",
        "part": name_of(&args.part),
        "settings": args.sites.settings(!sites.faces.is_empty()),
    }));
    npz.write(path)
}
