//! Arguments of `deepmill label` for the mesh definition: tolerance, fixtures, table.

use crate::args::{called, millimeters, name_of};
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::access::Labels;
use deepmill::access::surface::{
    ContactTolerance, FINISH_MM, LEAST_MM, RefinementOptions, SurfaceOptions, WIDE_MM, Warning,
    blocking_faces,
};
use deepmill::analysis::{Analysis, Fixture, ToolOutcome};
use deepmill::answers::SiteAnswer;
use deepmill::data::files::settings::{Blocking, StatedWarning};
use deepmill::data::files::tools::Tool;
use deepmill::findings::gate::SiteAreas;
use deepmill::geom::{Mesh, Sites, check};
use deepmill::tables::{Cell, Facts};
use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Which obstacles an option names; by default the part, if there are triangles.
pub fn blocking(text: Option<&str>, has_mesh: bool, output: &Output) -> Result<Blocking> {
    let found = match text {
        None if has_mesh => return Ok(Blocking::Part),
        None | Some("published" | "sites") => return Ok(Blocking::Points(None)),
        Some(text) => text,
    };
    if !has_mesh {
        output.warn("--obstacles needs a mesh; a cloud collides with its own points only");
        return Ok(Blocking::Points(None));
    }
    Blocking::try_from(found.to_string()).map_err(|_| {
        let expected = "part, published, centroids or a number";
        let remedy = "part is the mesh definition, published has sites as obstacles";
        Error::argument("--obstacles", format!("`{found}`"), expected, remedy)
    })
}

/// How closely the tool keeps to the part.
#[derive(Clone, clap::Args)]
pub struct ToleranceArgs {
    /// How deep the tool may seem to cut where it only touches; by default 0.01, and more beside coarsely tessellated
    /// curves.
    #[arg(long, value_name = "MM", value_parser = millimeters)]
    tolerance: Option<f64>,
    /// How much may remain at a site that counts as reached.
    #[arg(long, value_name = "MM", default_value_t = FINISH_MM, value_parser = millimeters)]
    finish: f64,
    /// Stock to leave: what cuts stays this far off the surface.
    #[arg(
        long, value_name = "MM", default_value_t = 0.0, allow_hyphen_values = true,
        value_parser = millimeters
    )]
    allowance: f64,
}

impl ToleranceArgs {
    /// Options with these tolerances.
    pub fn options(&self) -> Result<SurfaceOptions> {
        let tolerance =
            self.tolerance.map_or(ContactTolerance::Tessellation, ContactTolerance::Millimeters);
        let finish_mm = self.finish;
        // Only labels may have occlusion points.
        let options = SurfaceOptions::default().with_occlusion(false);
        let options = options.with_tolerance(tolerance).with_finish_mm(finish_mm);
        options.check().map(|()| options).map_err(|error| called(error, "--finish"))
    }

    /// The tools, leaving the stock that is asked for.
    pub fn with_allowance(&self, tools: Vec<Tool>) -> Result<Vec<Tool>> {
        let rough = |tool: Tool| tool.with_allowance(self.allowance);
        let rough: Result<Vec<Tool>> = tools.into_iter().map(rough).collect();
        rough.map_err(|error| called(error, "--allowance"))
    }

    /// How much may remain, mm.
    pub fn finish_mm(&self) -> f64 {
        self.finish
    }
}

/// Options of the mesh definition.
#[derive(Clone, clap::Args)]
pub struct SurfaceArgs {
    #[command(flatten)]
    pub tolerances: ToleranceArgs,
    /// A mesh that blocks too, in the part's coordinates (clamps, vise); may be given again.
    #[arg(long, value_name = "FILE")]
    fixture: Vec<PathBuf>,
    /// Height of a table that blocks too.
    #[arg(long, value_name = "Z", allow_hyphen_values = true, value_parser = millimeters)]
    table: Option<f64>,
    /// How wide to search between the directions for sites that none of them reaches: most cells of directions that are
    /// cut in four at every level; 0: no search.
    #[arg(long, value_name = "COUNT", default_value_t = RefinementOptions::default().n_kept)]
    search: usize,
    /// Search far longer, for proofs that no direction at all reaches the sites that are left.
    #[arg(long)]
    prove: bool,
}

impl SurfaceArgs {
    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.fixture.iter()
    }

    /// Warns if an option is given that only the mesh definition has.
    pub fn warn_unused(&self, output: &Output) {
        if self.tolerances.tolerance.is_some() || self.table.is_some() || !self.fixture.is_empty() {
            output.warn("--tolerance, --fixture and --table are not about points as obstacles");
        }
    }

    /// An analysis with the fixtures and the table.
    pub fn add_to(&self, analysis: Analysis, read: &MeshArgs, output: &Output) -> Result<Analysis> {
        let fixtures = self.fixtures(read, output)?;
        let analysis = fixtures.into_iter().fold(analysis, Analysis::fixture);
        Ok(match self.table(read) {
            Some(z_mm) => analysis.table(z_mm),
            None => analysis,
        })
    }

    /// What blocks beside the part and the table.
    fn fixtures(&self, read: &MeshArgs, output: &Output) -> Result<Vec<Fixture>> {
        let of_file =
            |path: &PathBuf| Ok(Fixture::new(name_of(path), read.read_fixture(path, output)?));
        self.fixture.iter().map(of_file).collect()
    }

    /// Height of the table in the coordinates of the part that was read.
    fn table(&self, read: &MeshArgs) -> Option<f64> {
        self.table.map(|z| z - read.origin().map_or(0.0, |at| at.z))
    }

    /// Whether proofs are searched for.
    pub fn proves(&self) -> bool {
        self.prove
    }

    /// The options that these arguments make.
    pub fn options(&self) -> Result<SurfaceOptions> {
        let search = match self.prove {
            true => RefinementOptions::proving(),
            false => RefinementOptions::default().with_n_kept(self.search),
        };
        Ok(self.tolerances.options()?.with_refinement((self.search > 0).then_some(search)))
    }

    /// Whether the directions between those tested are searched.
    pub fn searches(&self) -> bool {
        self.prove || self.search > 0
    }

    /// Height of the table, and the number of fixtures.
    pub fn held_by(&self) -> (Option<f64>, usize) {
        (self.table, self.fixture.len())
    }
}

/// Says the warnings, of one of several tools not again what was said of all before the work; as JSON for the result.
pub fn say_warnings(warnings: &[Warning], tool: Option<&str>, output: &Output) -> Value {
    let of = tool.map_or(String::new(), |tool| format!("{tool}: "));
    let is_said = |warning: &&Warning| {
        tool.is_some() && matches!(warning, Warning::Tiny { .. } | Warning::SmallerThanTool { .. })
    };
    let others = warnings.iter().filter(|warning| !is_said(warning));
    others.for_each(|warning| output.warn(format!("{of}{warning}")));
    json!(warnings.iter().map(StatedWarning::from).collect::<Vec<_>>())
}

/// If the part consists of several bodies: what is answered about each, said and as JSON.
pub fn say_bodies(
    mesh: &Mesh,
    (sites, areas): (&Sites, &SiteAreas),
    labels: &Labels,
    output: &Output,
) -> Result<Value> {
    let bodies = check::bodies(mesh)?;
    let n_bodies = bodies.iter().max().map_or(0, |last| *last as usize + 1);
    if labels.surface.is_none() || n_bodies <= 1 {
        return Ok(Value::Null);
    }
    output.say(format!("{n_bodies} bodies, each labeled against all"));
    let of = |k: usize| {
        let is_of = |i: usize| bodies[sites.faces[i] as usize] as usize == k;
        let n = (0..sites.len()).filter(|&i| is_of(i)).count();
        let whole = areas.share(is_of);
        let share = |answer: SiteAnswer| match whole > 0.0 {
            true => areas.share(|i| is_of(i) && labels.answers.of(i) == answer) / whole,
            false => 0.0,
        };
        let answers = [SiteAnswer::Accessible, SiteAnswer::Inaccessible, SiteAnswer::TipDoesNotFit];
        let [accessible, inaccessible, tip] = answers.map(share);
        output.say(format!(
            "  body {}: {n} sites, {:.1} % accessible, {:.1} % inaccessible, tip does not fit at {:.1} %",
            k + 1,
            100.0 * accessible,
            100.0 * inaccessible,
            100.0 * tip
        ));
        json!({
            "n_sites": n,
            "accessible": accessible,
            "inaccessible": inaccessible,
            "tip_does_not_fit": tip,
        })
    };
    Ok((0..n_bodies).map(of).collect())
}

/// Adds both tolerances, and how many answers rest on a wide one: of several tools the most.
pub fn add_tolerances(facts: &mut Facts, answers: &[ToolOutcome], finish_mm: f64) {
    let surfaces = || answers.iter().filter_map(|answer| answer.labels.surface.as_ref());
    if surfaces().next().is_none() {
        return;
    }
    let rests = surfaces().map(|s| s.rests_on_tolerance.iter().filter(|rests| **rests).count());
    add_rests(facts, rests.max().unwrap_or(0));
    facts.add("finish_mm", "finish tolerance, mm", Cell::Given(finish_mm));
    let tolerances = || surfaces().flat_map(|surface| surface.tolerance_mm.iter().copied());
    let rounded = |mm: f64| Cell::Given((mm * 1e4).round() / 1e4);
    let least = tolerances().fold(f64::INFINITY, f64::min);
    facts.add("tolerance_least_mm", "gouge tolerance, at least, mm", rounded(least));
    let greatest = tolerances().fold(0.0, f64::max);
    facts.add("tolerance_mm", "gouge tolerance, at most, mm", rounded(greatest));
}

/// Adds how many sites are accessible by a wide tolerance alone.
pub fn add_rests(facts: &mut Facts, n_sites: usize) {
    let words = format!("sites accessible by a gouge tolerance above {WIDE_MM} mm alone");
    facts.add("rests_on_tolerance", words, Cell::count(n_sites));
}

/// Adds what only the mesh definition answers.
pub fn add_facts(facts: &mut Facts, labels: &Labels) {
    let Some(surface) = &labels.surface else { return };
    let n = labels.answers.len().max(1) as f64;
    let share = |count: usize| Cell::Share(count as f64 / n);
    let others = labels.answers.of_sites().iter().zip(&surface.open_directions);
    let others = others.filter(|(answer, _)| **answer != SiteAnswer::Accessible);
    let proven = others.filter(|(_, open)| **open == 0.0).count();
    facts.add("proven", "of all sites, proven out of reach for every direction", share(proven));
    let between = surface.stats.found_between as usize;
    facts.add("found_between", "reached only between the directions", share(between));
    let raised = surface.tolerance_mm.iter().filter(|t| **t > LEAST_MM).count();
    facts.add("tolerance_raised", "tolerance above 0.01 mm", share(raised));
    let on_edge = Cell::Share(surface.stats.borderline as f64 / n);
    facts.add("borderline", "answers that rest on roundings, at most", on_edge);
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
