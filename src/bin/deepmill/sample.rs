//! `deepmill sample`: spreads near-uniform sites over a part, or writes the points of a lattice inside and outside it.

use crate::args::{SiteArgs, millimeters, name_of};
use crate::clock::Clock;
use crate::density;
use crate::mesh_args::{Accept, MeshArgs};
use crate::output::Output;
use crate::progress;
use deepmill::data::npz::NpzWriter;
use deepmill::geom::cells::VoronoiCells;
use deepmill::geom::formats::MeshOrCloud;
use deepmill::geom::inside::{Lattice, lattice_inside};
use deepmill::geom::{Mesh, Sites};
use deepmill::report::{Coloring, PartView, points};
use deepmill::tables::{Cell, Facts};
use deepmill::{Error, Result, atomic_file};
use glam::Vec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Random points with which the cells are measured: per site, within the limits of all.
const PROBES_PER_SITE: usize = 32;
const MOST_PROBES: usize = 400_000;

/// Spread sites evenly over a part and write them with their normals.
#[derive(clap::Args)]
#[command(
    after_help = "Example: deepmill sample part.stl --sites 20000 --out sites.ply\n         \
    deepmill sample part.stl --volume 100000 --out stock.npz"
)]
pub struct Args {
    /// Mesh file: STL, OBJ, PLY or 3MF.
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    #[command(flatten)]
    sites: SiteArgs,
    /// Ball radius of a cutter: say how many sites it needs.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = millimeters)]
    cr: Option<f64>,
    /// Instead of sites, about this many points of a regular lattice in the bounding box, each
    /// said to be inside or outside (.npz).
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["sites", "smooth", "cr", "seed"])]
    volume: Option<usize>,
    /// File of the sites, .ply or .npz, in mm.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Sample a mesh that does not bound one solid.
    #[arg(long)]
    force: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let npz = is_npz(args)?;
    atomic_file::check_writable_file(&args.out)?;
    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, Accept::bodies_or(args.force), output)?;
    clock.lap("read_s", "reading");
    let working = progress::working("placing points");
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(name_of(&args.part)));
    let warning = match args.volume {
        Some(n_points) => {
            volume(args, part, n_points, &mut facts)?;
            clock.lap("volume_s", "inside and outside");
            None
        }
        None => {
            let (mesh, sites) = args.sites.place(part)?;
            clock.lap("sites_s", "sites");
            let warning = measure(args, mesh.as_ref(), &sites, &mut facts)?;
            clock.lap("measure_s", "measuring");
            let write = if npz { write_npz } else { write_ply };
            write(&args.out, &sites, args)?;
            warning
        }
    };
    clock.add_to(&mut facts);
    drop(working);
    output.say(facts.text_in(output.unit()));
    warning.iter().for_each(|warning| output.warn(warning));
    let paths = [args.out.clone()];
    output.files(&paths);
    output.result_with_files(facts.json(), &paths);
    Ok(())
}

/// Whether the output is an NPZ; it can be a PLY otherwise.
fn is_npz(args: &Args) -> Result<bool> {
    let ending = args.out.extension().map(|e| e.to_string_lossy().to_lowercase());
    match (ending.as_deref(), args.volume) {
        (Some("npz"), _) => Ok(true),
        (Some("ply"), None) => Ok(false),
        (_, volume) => {
            let found = "its ending names no format that can be written";
            let remedy = if volume.is_some() { "use .npz" } else { "use .ply or .npz" };
            Err(Error::file(&args.out, "file name", found, remedy))
        }
    }
}

/// Adds how even the sites and their cells are; returns the warning if they are too few.
fn measure(
    args: &Args,
    mesh: Option<&Mesh>,
    sites: &Sites,
    facts: &mut Facts,
) -> Result<Option<String>> {
    if let Some(cr_mm) = args.cr.filter(|cr_mm| !(*cr_mm > 0.0 && cr_mm.is_finite())) {
        return Err(Error::argument(
            "--cr",
            cr_mm,
            "a positive length in mm",
            "write for example 1.5",
        ));
    }
    facts.add("n_sites", "sites", Cell::count(sites.len()));
    let spacing = density::add_spacing(facts, sites);
    if let (Some(mesh), Some(_)) = (mesh, &spacing) {
        let per_site = (MOST_PROBES / sites.len()).clamp(1, PROBES_PER_SITE);
        let spread = VoronoiCells::build(sites)?.spread(mesh, per_site, args.sites.seed);
        facts.add("area_mm2", "area in mm²", Cell::Number(mesh.area()));
        facts.add("cell_area_cv", "variation of cell area", Cell::Number(spread.area_cv));
        facts.add("unowned", "surface in no cell", Cell::Share(spread.unowned));
        facts.add("covering_mm", "farthest from its site", Cell::Millimeters(spread.covering_mm));
    }
    let advise =
        |cr_mm: f64| spacing.and_then(|s| density::add_advice(facts, &s, "this cutter", cr_mm));
    Ok(args.cr.and_then(advise))
}

fn write_ply(path: &Path, sites: &Sites, args: &Args) -> Result<()> {
    let part =
        PartView { name: &name_of(&args.part), mesh: None, sites, cutter: "none", outlines: &[] };
    points::write(path, &part, &Coloring::Plain(sites.len()), &[], &[])
}

fn write_npz(path: &Path, sites: &Sites, args: &Args) -> Result<()> {
    let mut npz = NpzWriter::new();
    npz.vectors("points", &sites.points).vectors("normals", &sites.normals);
    if !sites.faces.is_empty() {
        npz.array("faces", &[sites.faces.len()], &sites.faces);
    }
    let settings = args.sites.settings(!sites.faces.is_empty());
    npz.metadata(&metadata(args, "deepmill sites", json!(settings)));
    npz.write(path)
}

/// Classifies the points of a lattice and writes them.
fn volume(args: &Args, part: MeshOrCloud, n_points: usize, facts: &mut Facts) -> Result<()> {
    let MeshOrCloud::Mesh(mesh) = part else {
        let found = "a cloud has no inside";
        return Err(Error::file(&args.part, "file", found, "give a mesh"));
    };
    let (low, high) = mesh.bounds().unwrap_or_default();
    let lattice = Lattice::with_about(low, high, n_points)?;
    let inside = lattice_inside(&mesh, &lattice)?;
    let points: Vec<Vec3> = (0..lattice.len()).map(|n| lattice.point(n).as_vec3()).collect();
    let share = inside.iter().filter(|i| **i).count() as f64 / inside.len() as f64;
    facts.add("n_points", "points", Cell::count(points.len()));
    facts.add("step_mm", "step", Cell::Millimeters(lattice.step_mm));
    facts.add("inside", "inside", Cell::Share(share));
    let box_mm3 = lattice.step_mm.powi(3) * points.len() as f64;
    facts.add("volume_mm3", "volume by counting, mm³", Cell::Number(share * box_mm3));
    facts.add("mesh_volume_mm3", "volume of the mesh, mm³", Cell::Number(mesh.volume()));
    let mut npz = NpzWriter::new();
    npz.vectors("points", &points).array("inside", &[inside.len()], &inside);
    let settings = json!({
        "origin_mm": lattice.origin.to_array(),
        "step_mm": lattice.step_mm,
        "counts": lattice.counts,
    });
    npz.metadata(&metadata(args, "deepmill volume", settings));
    npz.write(&args.out)
}

fn metadata(args: &Args, format: &str, mut settings: Value) -> Value {
    args.read.add_origin(&mut settings);
    json!({
        "format": format,
        "version": 1,
        "program": concat!("deepmill ", env!("CARGO_PKG_VERSION")),
        "unit": "mm",
        "part": name_of(&args.part),
        "settings": settings,
    })
}
