//! `deepmill check`: what is wrong with a mesh, where, and whether it blocks labelling.

use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::Result;
use deepmill::geom::check::{self, Finding, Report};
use deepmill::geom::{formats, intersect};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Examine a mesh: closed, manifold, oriented, one component, triangle shapes, self-intersections.
///
/// Exit code 1 if it cannot be labelled.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill check part.stl --unit in --repair --out mended.stl")]
pub struct Args {
    /// Mesh file: STL, OBJ or PLY.
    mesh: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    /// Do not look for triangles that pierce each other.
    #[arg(long)]
    skip_intersections: bool,
    /// Write the mesh, as repaired, in mm, to this STL file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let (mesh, changes) = args.read.read_mesh(&args.mesh, output)?;
    let mut report = check::check(&mesh);
    if !args.skip_intersections {
        report.findings.extend(intersect::finding(&mesh));
    }
    say(&report, output);
    if let Some(path) = &args.out {
        formats::write_stl(path, &mesh)?;
        output.say(format!("written to {}", path.display()));
    }
    let changes: Vec<String> = changes.iter().map(ToString::to_string).collect();
    output.result(&json!({
        "file": args.mesh,
        "labelable": report.blocking().is_none(),
        "closed": report.is_closed(),
        "n_vertices": report.n_vertices,
        "n_triangles": report.n_triangles,
        "n_components": report.n_components,
        "euler": report.euler,
        "bounds_mm": report.bounds.map(|(low, high)| [low.to_array(), high.to_array()]),
        "area_mm2": report.area_mm2,
        "volume_mm3": report.volume_mm3,
        "changes": changes,
        "findings": report.findings.iter().map(json_of).collect::<Vec<_>>(),
    }));
    report.require_labelable()
}

fn say(report: &Report, output: &Output) {
    let closed = if report.is_closed() { "closed" } else { "open" };
    output.say(format!(
        "{} triangles, {} vertices, {} component(s), {closed}, Euler characteristic {}",
        report.n_triangles, report.n_vertices, report.n_components, report.euler
    ));
    let (area, volume) = (report.area_mm2, report.volume_mm3);
    output.say(format!("area {area:.6} mm², volume {volume:.6} mm³"));
    for finding in &report.findings {
        let weight = if finding.fault.blocks_labelling() { "BLOCKS LABELLING" } else { "note" };
        output.say(format!("{weight}: {finding}"));
        finding.places.iter().for_each(|place| output.say(format!("    {place}")));
        let more = finding.count - finding.places.len();
        if more > 0 {
            output.say(format!("    and {more} more"));
        }
        output.say(format!("    {}", finding.fault.remedy()));
    }
    if report.blocking().is_none() {
        output.say("can be labelled");
    }
}

fn json_of(finding: &Finding) -> Value {
    json!({
        "fault": finding.fault.name(),
        "blocks_labelling": finding.fault.blocks_labelling(),
        "count": finding.count,
        "places": finding.places.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "remedy": finding.fault.remedy(),
    })
}
