//! Whether tools given by their profile are free in poses, for comparison with other programs.
//!
//! ```text
//! free_poses PART.stl TOOLS.csv TOLERANCE < POSES
//! ```
//!
//! A line of POSES is the number of a tool in the table, from 0, the direction from the tip to the holder (3) and the
//! tip (3), with blanks between. For each, a line is 1 if the tool penetrates nothing deeper than the tolerance, mm,
//! else 0. The table has the columns `profile`, `holder` and `stick_out` as `deepmill tools --export csv` writes them.
//!
//! Without arguments: a lollipop above a block, and in it.

use deepmill::access::surface::{ContactTolerance, SurfaceOptions, TriangleObstacles};
use deepmill::cutter::{Assembly, Cutter, Profile, Section};
use deepmill::data::files::tools::{self, MissingParameters};
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::{Mesh, solids};
use deepmill::glam::{DVec3, Vec3};
use std::error::Error;
use std::io::Write;
use std::path::Path;

/// Direction and place of the tip.
type Pose = (Vec3, DVec3);

struct Input {
    mesh: Mesh,
    cutters: Vec<Cutter>,
    tolerance_mm: f64,
    /// A line each.
    poses: String,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Input { mesh, cutters, tolerance_mm, poses } = match &args[..] {
        [] => shown()?,
        [part, table, tolerance] => Input {
            mesh: read_mesh(Path::new(part), &ReadOptions::default())?,
            cutters: cutters(Path::new(table))?,
            tolerance_mm: tolerance.parse()?,
            poses: std::io::read_to_string(std::io::stdin())?,
        },
        _ => return Err("PART.stl TOOLS.csv TOLERANCE < POSES".into()),
    };
    let poses: Vec<(usize, Pose)> = poses.lines().map(pose).collect::<Result<_, _>>()?;
    if let Some((k, _)) = poses.iter().find(|(k, _)| *k >= cutters.len()) {
        return Err(format!("tool {k} of {}: they are numbered from 0", cutters.len()).into());
    }
    let obstacles = TriangleObstacles::new(&mesh, &[])?;
    let tolerance = ContactTolerance::Millimeters(tolerance_mm);
    let options = SurfaceOptions::default().with_tolerance(tolerance);
    let mut free = vec![false; poses.len()];
    for (k, cutter) in cutters.iter().enumerate() {
        let of: Vec<usize> = (0..poses.len()).filter(|i| poses[*i].0 == k).collect();
        let its: Vec<Pose> = of.iter().map(|i| poses[*i].1).collect();
        let found = obstacles.are_free(cutter, &its, &options)?;
        of.iter().zip(found).for_each(|(i, found)| free[*i] = found);
    }
    let mut out = std::io::stdout().lock();
    for free in free {
        writeln!(out, "{}", u8::from(free))?;
    }
    Ok(())
}

fn cutters(table: &Path) -> Result<Vec<Cutter>, Box<dyn Error>> {
    let table = tools::read(table, &MissingParameters::default())?;
    Ok(table.tools.into_iter().map(|tool| tool.cutter).collect())
}

fn pose(line: &str) -> Result<(usize, Pose), Box<dyn Error>> {
    let mut words = line.split_whitespace();
    let tool = words.next().ok_or("an empty line")?.parse()?;
    let numbers: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>()?;
    let [dx, dy, dz, x, y, z] = numbers[..] else { return Err(format!("no pose: {line}").into()) };
    let direction = Vec3::new(dx as f32, dy as f32, dz as f32).normalize();
    Ok((tool, (direction, DVec3::new(x, y, z))))
}

fn shown() -> Result<Input, Box<dyn Error>> {
    let ball = Profile::lollipop(3.0, 1.5)?;
    let tool = Assembly::from_profile(ball, &[Section::cylinder(30.0, 10.0)], 40.0)?;
    Ok(Input {
        mesh: solids::cuboid(DVec3::new(20.0, 20.0, 20.0)),
        cutters: vec![tool.cutter()?],
        tolerance_mm: 0.05,
        poses: "0 0 0 1 10 10 20\n0 0 0 1 10 10 19\n".into(),
    })
}
