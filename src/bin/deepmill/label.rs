//! `deepmill label`: computes exactly which sites of a part a cutter cannot reach.

mod parts;
mod said;
mod shares;
mod watched;

use crate::args::{
    DirectionArgs, GateArgs, OutArgs, SiteArgs, ToolArgs, called, millimeters, name_of,
};
use crate::baseline::BaselineArgs;
use crate::clock::Clock;
use crate::mesh_args::{Accept, MeshArgs, warn_wide_tools};
use crate::output::Output;
use crate::part_itself::{self, SurfaceArgs};
use crate::progress::Bars;
use crate::published_args::PublishedArgs;
use crate::region::RegionArgs;
use crate::volume;
use deepmill::access::LabelOptions;
use deepmill::analysis::{Analysis, Files, PerDirection, Placed};
use deepmill::data::files::settings::Blocking;
use deepmill::data::files::tools::Tool;
use deepmill::findings::gate::Limit;
use deepmill::geom::file_vertices::FileVertices;
use deepmill::geom::formats::{KeepVertices, MeshOrCloud};
use deepmill::{Error, Result};
use std::path::PathBuf;

/// Compute exactly which sites of a part a cutter cannot reach, and which sites are in its way.
///
/// Writes to DIR: labels.npz (numbers), labels.ply (colored points), labels.png (picture), findings.json and
/// findings.csv (regions out of reach) and part.stl (the surface as used, in mm). With several cutters, or a table,
/// each has the first five in a folder DIR/NAME of its own, and DIR holds tools.csv (the table of all), tools.ply and
/// tools.png (the first tool that reaches each site), and the findings that no tool reaches.
#[derive(Clone, clap::Args)]
#[command(after_help = "Example: deepmill label part.stl --cutter 1.5,6,40,5 --out labels\n\
A tool table: deepmill label part.stl --tools tools.csv --out labels")]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF) or cloud of points with normals (PLY, NPZ). Of several each has a folder in DIR, by
    /// the name of its file; one that cannot be labeled does not keep the others from it.
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// The part at work.
    #[arg(skip)]
    pub part: PathBuf,
    #[command(flatten)]
    pub read: MeshArgs,
    #[command(flatten)]
    tools: ToolArgs,
    #[command(flatten)]
    sites: SiteArgs,
    #[command(flatten)]
    pub region: RegionArgs,
    #[command(flatten)]
    pub directions: DirectionArgs,
    #[command(flatten)]
    pub surface: SurfaceArgs,
    #[command(flatten)]
    gate: GateArgs,
    #[command(flatten)]
    baseline: BaselineArgs,
    /// What blocks: `part` (its triangles, the mesh definition; the default for a mesh), `published` (the sites, by
    /// the published definition; also `sites`), `centroids` (those of the triangles, by the published definition), or
    /// COUNT: the sites and so many further points of the surface.
    #[arg(long, value_name = "WHAT")]
    obstacles: Option<String>,
    #[command(flatten)]
    published: PublishedArgs,
    /// How to compute with points as obstacles; all engines give the same labels.
    #[arg(long, value_name = "NAME", default_value_t = LabelOptions::default().engine.name().into())]
    engine: String,
    /// By the mesh definition too, mark the sites that are most often in the way (occlusion points) and name the faces
    /// that are: a layer upon the
    /// answers, which takes more time. With points as obstacles it is always there.
    #[arg(long)]
    occlusion: bool,
    /// Share of the sites that are occlusion points (0.1); of a mesh it asks for --occlusion.
    #[arg(long, allow_negative_numbers = true, value_name = "SHARE")]
    occlusion_share: Option<f64>,
    /// Instead of sites, label the points of a lattice of this step in the part's box (roughing): with the tip at the
    /// point. Writes volume.npz and volume.png, a section.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "obstacles", value_parser = millimeters)]
    pub volume: Option<f64>,
    /// Also compute how far the margin about what does not cut may grow at each site, or all steps of the tool must
    /// shrink, up to this either way (`clearance` in labels.npz).
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "volume", value_parser = millimeters)]
    clearance_limit: Option<f64>,
    /// Also compute how much the tool leaves where it does not reach: the distance to the surface of what it leaves
    /// (`rest` in labels.npz; rest.png, rest.ply), by the mesh definition.
    #[arg(long, conflicts_with = "volume")]
    rest: bool,
    #[command(flatten)]
    pub out: OutArgs,
    /// Draw no picture.
    #[arg(long)]
    pub no_picture: bool,
    /// Also write these: `glb` (binary glTF in the colors of the answers), `csv` (a row per site); several with commas.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',')]
    also: Vec<String>,
    /// Also write, for every direction and site, whether the tool has a free pose there: `npz` (matrix.npz) and `txt`
    /// (visibility_matrix.txt, as DeepMill++ has it: a line per direction, a column per vertex of the file); both with
    /// a comma.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', conflicts_with = "volume")]
    matrix: Vec<String>,
    /// Also write safety_status.txt, as DeepMill++ has it: a line per vertex of the file (with --sites vertices; else
    /// per site), 1 where the tool reaches it; 0 also where the tip does not fit.
    #[arg(long, conflicts_with = "volume")]
    safety_status: bool,
    /// Also write report.html, an HTML report: 3-D view with sections, findings, settings, warnings.
    #[arg(long, conflicts_with = "volume")]
    report: bool,
    /// Label a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
}

impl Args {
    fn share_of_occlusion(&self) -> f64 {
        self.occlusion_share.unwrap_or(LabelOptions::default().share)
    }

    /// Whether occlusion points of a mesh are asked for, by the switch or by something that is about them.
    fn wants_occlusion(&self, limits: &[Limit]) -> bool {
        let is_limited = limits.iter().any(|limit| limit.quantity() == "occlusion");
        self.occlusion || self.occlusion_share.is_some() || is_limited
    }

    /// Forms beside the labels that name directions or vertices.
    fn per_direction(&self) -> Result<Vec<PerDirection>> {
        let matrix = self.matrix.iter().map(|name| name.parse());
        let mut forms: Vec<PerDirection> =
            matrix.collect::<Result<_>>().map_err(|error| called(error, "--matrix"))?;
        forms.extend(self.safety_status.then_some(PerDirection::Safety));
        Ok(forms)
    }

    /// What is requested of the part.
    fn analysis(
        &self,
        part: MeshOrCloud,
        tools: Vec<Tool>,
        limits: &[Limit],
        output: &Output,
    ) -> Result<Analysis> {
        let is_mesh = matches!(part, MeshOrCloud::Mesh(_));
        let blocking = part_itself::blocking(self.obstacles.as_deref(), is_mesh, output)?;
        let options = self
            .surface
            .options()?
            .with_share(self.share_of_occlusion())
            .with_clearance_limit_mm(self.clearance_limit)
            .with_occlusion(self.wants_occlusion(limits));
        let published = self
            .published
            .options(blocking != Blocking::Part)?
            .with_engine(self.engine.parse()?)
            .with_share(self.share_of_occlusion())
            .with_clearance_limit_mm(self.clearance_limit);
        let mut analysis = Analysis::new(name_of(&self.part), part, tools)
            .library(self.tools.are_of_files())
            .folders(self.tools.are_several())
            .origin(self.read.origin())
            .options(options)
            .proving(self.surface.proves())
            .rest(self.rest || limits.iter().any(Limit::is_about_rest))
            .published(published);
        if self.obstacles.is_some() {
            analysis = analysis.obstacles(blocking);
        }
        if let Some(directions) = self.directions.given()? {
            analysis = analysis.directions(directions);
        }
        if blocking == Blocking::Part {
            analysis = self.surface.add_to(analysis, &self.read, output)?;
        } else {
            self.surface.warn_unused(output);
        }
        Ok(analysis)
    }
}

/// Labels every part.
pub fn run(args: &Args, output: &Output) -> Result<()> {
    match &args.parts[..] {
        [part] => run_one(&Args { part: part.clone(), ..args.clone() }, output),
        parts => parts::run(args, parts, output),
    }
}

/// What is requested of a part, checked before it is read.
struct Request {
    tools: Vec<Tool>,
    limits: Vec<Limit>,
    files: Files,
    forms: Vec<PerDirection>,
}

impl Args {
    /// # Errors
    /// If something is wrong with the arguments, or a file of tools cannot be read.
    fn request(&self, output: &Output) -> Result<Request> {
        let request = Request {
            tools: self.surface.tolerances.with_allowance(self.tools.tools(output)?)?,
            limits: self.gate.limits(&[])?,
            files: output.forms(!self.no_picture, self.report, &self.also)?,
            forms: self.per_direction()?,
        };
        self.surface.tolerances.options()?;
        self.directions.given()?;
        Ok(request)
    }

    fn read_part(&self, output: &Output) -> Result<(MeshOrCloud, Option<FileVertices>)> {
        let keep = if self.sites.are_vertices() { KeepVertices::Yes } else { KeepVertices::No };
        self.read.read_file(&self.part, (Accept::bodies_or(self.force), keep), output)
    }

    /// Places the sites of a part that was read, and checks all that is not about tools.
    fn place(
        &self,
        (part, vertices): (MeshOrCloud, Option<FileVertices>),
        request: &Request,
        output: &Output,
    ) -> Result<Placed> {
        let analysis = self.analysis(part, request.tools.clone(), &request.limits, output)?;
        let analysis = analysis.file_vertices(vertices);
        let placed = self.region.place(analysis, &self.sites, &self.read, output);
        let placed = placed.map_err(|error| match error {
            Error::Argument { name: "rest", .. } => called(error, "--rest"),
            other => other,
        })?;
        placed.mesh().iter().for_each(|mesh| warn_wide_tools(mesh, &request.tools, output));
        let (mesh, sites) = placed.shown();
        request.files.show().require_memory(mesh, sites)?;
        if !self.matrix.is_empty() {
            placed.require_matrix()?;
        }
        Ok(placed)
    }
}

fn run_one(args: &Args, output: &Output) -> Result<()> {
    let request = args.request(output)?;
    if args.volume.is_some() {
        args.baseline.refuse("--volume", "a lattice has no findings: leave out one of both")?;
    }
    let baseline = args.baseline.open()?;
    args.out.check()?;
    let mut clock = Clock::start();
    let part = args.read_part(output)?;
    clock.lap("read_s", "reading");
    if let Some(step_mm) = args.volume {
        args.region.refuse("--volume", "leave out --volume, or the region")?;
        return volume::run(args, step_mm, (part.0, request.tools), clock, output);
    }
    let mut bars = Bars::default();
    let mut outcome = args.place(part, &request, output)?.label(&mut bars)?;
    outcome.notices().iter().for_each(|notice| output.say(notice));
    clock.stages(STAGES, outcome.seconds());
    let Request { limits, files, forms, .. } = &request;
    let check = baseline.check(|known| outcome.hold_against(known));
    let (mesh, sites) = outcome.shown();
    let held = baseline.is_held().then(|| (outcome.tool_of_findings(), outcome.findings()));
    let broken = output.check_limits(limits, (sites, mesh), outcome.named(), held)?;
    let mut paths = outcome.write(args.out.folder(), files, &mut bars)?;
    paths.extend(baseline.write(|date| outcome.baseline(date))?);
    clock.lap("write_s", "writing and drawing");
    let (written, matrices) = outcome.write_per_direction(args.out.folder(), forms)?;
    if !matrices.is_empty() {
        clock.lap("matrix_s", "matrix");
    }
    paths.extend(written);
    let mut result = said::say(&outcome, args, &clock, output)?;
    result["limits_broken"] = broken;
    said::say_matrices(&outcome, &matrices, &mut result, output);
    result["baseline"] = baseline.say(check, outcome.findings(), output);
    output.files(&paths);
    said::say_table(&outcome, &mut result, output)?;
    output.result_with_files(result, &paths);
    Ok(())
}

/// Keys and names of what [`Outcome::seconds`](deepmill::analysis::Outcome::seconds) has.
const STAGES: [[&str; 2]; 3] =
    [["sites_s", "sites"], ["labels_s", "labels"], ["findings_s", "findings"]];
