//! `deepmill check`: reports the faults of a mesh, where they are, and whether they block labeling.

use crate::args::{called, millimeters};
use crate::mesh_args::{MeshArgs, join_bodies};
use crate::output::Output;
use crate::progress;
use deepmill::analysis::ThinWalls;
use deepmill::geom::check::{self, Finding, MeshReport, Place};
use deepmill::geom::sites::SiteOptions;
use deepmill::geom::{Mesh, formats, intersect, origin};
use deepmill::{Error, Result, atomic_file};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Examine a mesh: closed, manifold, oriented, one component, triangle shapes, self-intersections.
///
/// Exit code 1 if it cannot be labeled.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill check part.stl --unit in --repair --out mended.stl")]
pub struct Args {
    /// Mesh file: STL, OBJ, PLY or 3MF.
    mesh: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    /// Do not look for triangles that pierce each other.
    #[arg(long)]
    skip_intersections: bool,
    /// Also measure how thick walls are, and list what is thinner than this: at 7,000 sites, from a site to the face
    /// that looks the other way.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = millimeters)]
    thin_wall: Option<f64>,
    /// Number of sites for --thin-wall.
    #[arg(long, value_name = "N", default_value_t = SiteOptions::default().n_sites, requires = "thin_wall")]
    sites: usize,
    /// Exit with code 3 if a wall is thinner than --thin-wall.
    #[arg(long, requires = "thin_wall")]
    fail_if_thin: bool,
    /// Write the mesh, as repaired, in mm, to this STL file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    args.out.iter().try_for_each(|path| atomic_file::check_writable_file(path))?;
    let (mut mesh, mut changes) = args.read.read_mesh(&args.mesh, output)?;
    let refused =
        join_bodies(&mut mesh, &args.mesh, output).map(|joined| changes.extend(joined)).err();
    let working = progress::working("examining the mesh");
    let mut report = check::check(&mesh);
    if !args.skip_intersections {
        report.findings.extend(intersect::finding(&mesh));
    }
    drop(working);
    say(&report, args, output);
    let is_usable = refused.is_none() && report.blocking_bodies().is_none();
    if is_usable {
        say_usable(&report, args, output);
    }
    let thin = args.thin_wall.filter(|_| is_usable);
    let thin = thin.map(|limit_mm| thin_walls(&mesh, limit_mm, args, output)).transpose()?;
    if let Some(path) = &args.out {
        write_near(path, mesh, output)?;
        output.say(format!("written {}", path.display()));
    }
    let changes: Vec<String> = changes.iter().map(ToString::to_string).collect();
    let findings: Vec<Value> = report.findings.iter().map(|f| json_of(f, args)).collect();
    output.result(&json!({
        "file": args.mesh,
        "labelable": is_usable,
        "closed": report.is_closed(),
        "n_vertices": report.n_vertices,
        "n_triangles": report.n_triangles,
        "n_components": report.n_components,
        "euler": report.euler,
        "bounds_mm": report.bounds.map(|(low, high)| [low.to_array(), high.to_array()]),
        "area_mm2": report.area_mm2,
        "volume_mm3": report.volume_mm3,
        "changes": changes,
        "findings": findings,
        "thin_walls": thin,
    }));
    match refused {
        Some(error) => Err(error),
        None => args.read.require_labelable(&report, &args.mesh),
    }
}

/// Says which walls are thinner than a limit, the greatest first.
fn thin_walls(mesh: &Mesh, limit_mm: f64, args: &Args, output: &Output) -> Result<ThinWalls> {
    let working = progress::working("measuring walls");
    let found = ThinWalls::of(mesh, limit_mm, args.sites).map_err(|error| match error {
        Error::Argument { name: "thin wall", .. } => called(error, "--thin-wall"),
        Error::Argument { name: "sites", .. } => called(error, "--sites"),
        other => other,
    })?;
    drop(working);
    let least = found.least_mm.map_or("no walls are found".into(), |least| {
        format!("the thinnest wall is {} mm thick", digits(thousandth(least)))
    });
    output.say(match found.walls.len() {
        0 => format!("nothing is thinner than {limit_mm} mm at {} sites; {least}", found.n_sites),
        n => format!(
            "thinner than {limit_mm} mm: {n} region{}, {} mm² ({:.1} % of the surface); {least}",
            if n == 1 { "" } else { "s" },
            digits(thousandth(found.area_mm2)),
            100.0 * found.area_share,
        ),
    });
    for wall in found.walls.iter().take(N_WALLS) {
        let [x, y, z] = wall.at_mm.to_array().map(|mm| digits(thousandth(mm)));
        let (area, least) = (digits(thousandth(wall.area_mm2)), digits(thousandth(wall.least_mm)));
        output.say(format!("    {least} mm at {x}, {y}, {z}, {area} mm²"));
    }
    if let Some(more) = found.walls.len().checked_sub(N_WALLS).filter(|more| *more > 0) {
        output.say(format!("    and {more} more"));
    }
    if args.fail_if_thin && !found.walls.is_empty() {
        output.break_limit(format!("walls thinner than {limit_mm} mm; {least}"));
    }
    Ok(found)
}

/// Regions that are listed.
const N_WALLS: usize = 6;

/// To a thousandth, never minus zero.
fn thousandth(x: f64) -> f64 {
    (1e3 * x).round() / 1e3 + 0.0
}

/// Writes an STL, whose numbers are single precision: of a part far from the origin, about a local one.
fn write_near(path: &Path, mut mesh: Mesh, output: &Output) -> Result<()> {
    if let Some(at) = origin::local_origin(&mesh) {
        origin::make_relative(&mut mesh, at);
        let ([x, y, z], path) = (at.to_array(), path.display());
        output.warn(format!("{path}: coordinates are relative to ({x}, {y}, {z}) mm"));
    }
    formats::write_stl(path, &mesh)
}

fn say(report: &MeshReport, args: &Args, output: &Output) {
    let counted = |n: usize, noun: &str| format!("{n} {noun}{}", if n == 1 { "" } else { "s" });
    output.say(format!(
        "{}, {} vertices, {}, {}, Euler characteristic {}",
        counted(report.n_triangles, "triangle"),
        report.n_vertices,
        counted(report.n_components, "component"),
        if report.is_closed() { "closed" } else { "open" },
        report.euler,
    ));
    let (area, volume) = (digits(report.area_mm2), digits(report.volume_mm3));
    output.say(format!("area {area} mm², volume {volume} mm³"));
    for finding in &report.findings {
        let weight = if finding.fault.blocks_bodies() { "BLOCKS LABELING" } else { "note" };
        output.say(format!("{weight}: {finding}"));
        finding.places.iter().for_each(|place| output.say(format!("    {place}")));
        let more = finding.count - finding.places.len();
        if more > 0 {
            output.say(format!("    and {more} more"));
        }
        output.say(format!("    {}", args.read.remedy(finding.fault)));
    }
}

fn say_usable(report: &MeshReport, args: &Args, output: &Output) {
    let skipped = ", piercing triangles not looked for";
    let skipped = if args.skip_intersections { skipped } else { "" };
    let one = if report.n_components == 1 { "one component, " } else { "" };
    output.say(format!("can be labeled: closed, manifold, {one}facing outward{skipped}"));
}

/// Six decimals, but none that are zero.
fn digits(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

fn json_of(finding: &Finding, args: &Args) -> Value {
    json!({
        "fault": finding.fault.name(),
        "blocks_labeling": finding.fault.blocks_bodies(),
        "count": finding.count,
        "places": finding.places.iter().map(place).collect::<Vec<_>>(),
        "remedy": args.read.remedy(finding.fault),
    })
}

fn place(place: &Place) -> Value {
    match place {
        Place::Vertex(v, at) => json!({ "vertex": v, "at_mm": [at.to_array()] }),
        Place::Edge(ends, at) => json!({ "edge": ends, "at_mm": at.map(|p| p.to_array()) }),
        Place::Triangle(t, at) => json!({ "triangle": t, "at_mm": [at.to_array()] }),
        Place::Triangles(pair, at) => json!({ "triangles": pair, "at_mm": [at.to_array()] }),
        Place::Component(n, at) => json!({ "n_triangles": n, "at_mm": [at.to_array()] }),
        Place::Corner(t, v) => json!({ "triangle": t, "vertex": v, "at_mm": [] }),
        _ => json!({ "at_mm": [] }),
    }
}
