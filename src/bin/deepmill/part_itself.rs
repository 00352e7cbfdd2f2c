//! Arguments of `deepmill label` for the part itself: tolerance, fixtures, table.

use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::access::Labels;
use deepmill::access::surface::{
    ContactTolerance, LEAST_MM, RefinementOptions, SiteAnswer, SurfaceOptions, TriangleObstacles,
    blocking_faces,
};
use deepmill::cutter::Cutter;
use deepmill::directions::Directions;
use deepmill::geom::{Mesh, Sites};
use deepmill::report::tables::{Cell, Facts};
use deepmill::{Error, Result};
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::path::PathBuf;

/// What blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blocking {
    /// The triangles of the part.
    Part,
    /// Its sites, and this many further points of it.
    Points(Option<usize>),
}

impl Blocking {
    /// `part`, `sites` or a number of further points; by default the part, if there are triangles.
    pub fn read(text: Option<&str>, has_mesh: bool, output: &Output) -> Result<Self> {
        let found = match text {
            None if has_mesh => return Ok(Blocking::Part),
            None | Some("sites") => return Ok(Blocking::Points(None)),
            Some(text) => text,
        };
        if !has_mesh {
            output.warn("--obstacles needs a mesh; a cloud collides with its own points only");
            return Ok(Blocking::Points(None));
        }
        match found.parse() {
            _ if found == "part" => Ok(Blocking::Part),
            Ok(n) => Ok(Blocking::Points(Some(n))),
            Err(_) => {
                let expected = "part, sites or a number";
                let remedy = "part tests triangles, sites is the published definition";
                Err(Error::argument("--obstacles", format!("`{found}`"), expected, remedy))
            }
        }
    }

    /// The definition in words, for files and reports.
    pub fn words(self) -> &'static str {
        match self {
            Blocking::Part => "the part itself",
            Blocking::Points(_) => "published definition, points as obstacles",
        }
    }
}

/// Options for the part itself.
#[derive(clap::Args)]
pub struct SurfaceArgs {
    /// How deep the tool may seem to cut where it only touches; by default 0.01, and more beside coarsely tessellated
    /// curves.
    #[arg(long, value_name = "MM")]
    tolerance: Option<f64>,
    /// A mesh that blocks too, in the part's coordinates (clamps, vise); may be given again.
    #[arg(long, value_name = "FILE")]
    fixture: Vec<PathBuf>,
    /// Height of a table that blocks too.
    #[arg(long, value_name = "Z", allow_hyphen_values = true)]
    table: Option<f64>,
    /// Most cells of directions to search for a site that no direction of the set reaches; 0: none.
    #[arg(long, value_name = "COUNT", default_value_t = RefinementOptions::default().n_tests)]
    search: usize,
}

impl SurfaceArgs {
    /// Warns if an option is given that only the part itself has.
    pub fn warn_unused(&self, output: &Output) {
        if self.tolerance.is_some() || self.table.is_some() || !self.fixture.is_empty() {
            output.warn("--tolerance, --fixture and --table are not about points as obstacles");
        }
    }

    pub fn label(
        &self,
        part: (&Mesh, &MeshArgs, &Output),
        sites: &Sites,
        cutters: &[Cutter],
        directions: &Directions,
        share: f64,
    ) -> Result<Vec<Labels>> {
        let (mesh, read, output) = part;
        let mut fixtures = Vec::new();
        for path in &self.fixture {
            fixtures.push(read.read_mesh(path, output)?.0);
        }
        fixtures.extend(self.table.map(|z| table(mesh, z)));
        let obstacles = TriangleObstacles::new(mesh, &fixtures)?;
        let search = RefinementOptions { n_tests: self.search, ..RefinementOptions::default() };
        let options = SurfaceOptions {
            tolerance: self
                .tolerance
                .map_or(ContactTolerance::Tessellation, ContactTolerance::Millimeters),
            share,
            refinement: (self.search > 0).then_some(search),
            ..SurfaceOptions::default()
        };
        let label = |cutter| obstacles.label_sites(sites, cutter, directions, &options);
        cutters.iter().map(label).collect()
    }

    /// What a label file says of these options.
    pub fn settings(&self) -> Value {
        let fixtures: Vec<String> = self.fixture.iter().map(|p| p.display().to_string()).collect();
        json!({
            "tolerance_mm": self.tolerance,
            "fixtures": fixtures,
            "table_z_mm": self.table,
            "search": self.search,
        })
    }
}

/// A square at a height, far wider than the part.
fn table(part: &Mesh, z: f64) -> Mesh {
    let (low, high) = part.bounds().unwrap_or_default();
    let half = 2.0 * (high - low).length() + 500.0;
    let middle = 0.5 * (low + high);
    let corner = |x: f64, y: f64| DVec3::new(middle.x, middle.y, z) + dvec3(x, y, 0.0) * half;
    let vertices = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
}

/// Adds what only the part itself answers.
pub fn add_facts(facts: &mut Facts, labels: &Labels) {
    let Some(surface) = &labels.surface else { return };
    let tip = surface.share(SiteAnswer::TipDoesNotFit);
    facts.add("tip_does_not_fit", "tip does not fit", Cell::Share(tip));
    facts.add("accessible", "accessible", Cell::Share(surface.share(SiteAnswer::Accessible)));
    let n = surface.answers.len().max(1) as f64;
    let share = |count: usize| Cell::Share(count as f64 / n);
    let others = surface.answers.iter().zip(&surface.open_directions);
    let others = others.filter(|(answer, _)| **answer != SiteAnswer::Accessible);
    let proven = others.filter(|(_, open)| **open == 0.0).count();
    facts.add("proven", "of all sites, proven out of reach for every direction", share(proven));
    let between = surface.stats.found_between as usize;
    facts.add("found_between", "reached only between the directions", share(between));
    let greatest = surface.tolerance_mm.iter().fold(0.0, |a: f64, b| a.max(*b));
    facts.add("tolerance_mm", "contact tolerance, at most, mm", Cell::Given(greatest));
    let raised = surface.tolerance_mm.iter().filter(|t| **t > LEAST_MM).count();
    facts.add("tolerance_raised", "tolerance above 0.01 mm", share(raised));
}

/// Says which faces are most in the way; as JSON for the result.
pub fn say_blocking(mesh: &Mesh, sites: &Sites, labels: &Labels, output: &Output) -> Value {
    let faces = blocking_faces(mesh, sites, &labels.beta, N_FACES);
    if faces.is_empty() {
        return json!([]);
    }
    output
        .say("faces most in the way (share of all collisions, place of its middle, normal, area)");
    for face in &faces {
        let ([x, y, z], [nx, ny, nz]) = (face.middle.to_array(), face.normal.to_array());
        output.say(format!(
            "  {:>5.1} %  at {x:.1}, {y:.1}, {z:.1}  normal {nx:.2}, {ny:.2}, {nz:.2}  {:.0} mm²",
            100.0 * face.share,
            face.area_mm2
        ));
    }
    faces
        .iter()
        .map(|face| {
            json!({
                "share": face.share,
                "middle_mm": face.middle.to_array(),
                "normal": face.normal.to_array(),
                "area_mm2": face.area_mm2,
                "triangle": face.triangle,
            })
        })
        .collect()
}

/// Faces that are named.
const N_FACES: usize = 5;
