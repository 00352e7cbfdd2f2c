//! Drop heights by the closed formulas of `access::surface`, as CSV on standard output, for comparison with
//! other programs.
//!
//! ```text
//! drop_heights PART.stl N_POINTS N_DIRECTIONS CR,CH,FR,FH CORNER
//! ```
//!
//! Without arguments: three points of the demo part in two directions.
//!
//! Rows: direction (3), reference point of the tool (3), and how far the tool must be raised along the direction until
//! its tip and until its steps are clear (see `access::surface::raise`), mm.

use deepmill::access::surface::raise;
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::data::generated::demo_part;
use deepmill::directions::Directions;
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::sites::{SiteOptions, sample};
use std::io::Write;
use std::path::Path;

/// The tools are shrunk by this, or every tangent wall would be a borderline case.
const TOLERANCE_MM: f64 = 0.01;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let options = ReadOptions::default();
    let (mesh, [n_points, n_directions, lengths, corner]) = match &args[..] {
        [] => (demo_part(), ["3", "2", "1.5,6,40,5", "1.5"]),
        [part, rest @ ..] if rest.len() == 4 => {
            (read_mesh(Path::new(part), &options)?, [0, 1, 2, 3].map(|i| rest[i].as_str()))
        }
        _ => return Err("PART.stl N_POINTS N_DIRECTIONS CR,CH,FR,FH CORNER".into()),
    };
    let lengths: Vec<f64> = lengths.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let lengths = <[f64; 4]>::try_from(lengths).map_err(|_| "four lengths")?;
    let cutter = Cutter::bull_nose(CutterParams::from_array(lengths), corner.parse()?)?;
    let sites = sample(&mesh, &SiteOptions::default().with_n_sites(n_points.parse()?))?;
    let mut out = std::io::stdout().lock();
    for &d in Directions::fibonacci_hemisphere(n_directions.parse()?)?.vectors() {
        for (site, normal) in sites.points.iter().zip(&sites.normals) {
            let at = site.as_dvec3() + normal.as_dvec3() * lengths[0];
            let raise = raise(&mesh, &cutter, TOLERANCE_MM, at, d)?;
            let numbers: Vec<f64> =
                d.as_dvec3().to_array().into_iter().chain(at.to_array()).collect();
            let text: Vec<String> = numbers.iter().map(f64::to_string).collect();
            writeln!(out, "{},{},{}", text.join(","), raise.tip, raise.steps)?;
        }
    }
    Ok(())
}
