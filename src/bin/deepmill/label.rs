//! `deepmill label`: computes exactly which sites of a part a cutter cannot reach.

mod shares;

use crate::args::{DirectionArgs, GateArgs, SiteArgs, ToolArgs, millimeters, name_of};
use crate::clock::Clock;
use crate::mesh_args::{Accept, MeshArgs};
use crate::output::Output;
use crate::part_itself::{self, SurfaceArgs};
use crate::premise::{premise, premise_of_points};
use crate::published_args::PublishedArgs;
use crate::region::{RegionArgs, Scope};
use crate::{density, findings, progress, volume};
use deepmill::access::surface::explain::Remedies;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles, Warning};
use deepmill::access::{self, LabelOptions, Labels, Obstacles};
use deepmill::answers::SiteAnswers;
use deepmill::cutter::Cutter;
use deepmill::data::files::label_query::joined;
use deepmill::data::files::settings::{Blocking, SurfaceSettings, ToolSettings};
use deepmill::data::files::tools::Tool;
use deepmill::data::files::{AnalysisSettings, LabelFile, Provenance};
use deepmill::directions::Directions;
use deepmill::geom::formats::MeshOrCloud;
use deepmill::geom::sites::{self, SiteOptions};
use deepmill::geom::spacing::Spacing;
use deepmill::geom::units::Unit;
use deepmill::geom::{Mesh, Sites};
use deepmill::report::PartView;
use deepmill::report::coverage::{Coverage, Shares};
use deepmill::report::export::Extra;
use deepmill::report::findings::{Findings, for_all_tools};
use deepmill::report::folder::{self, Show};
use deepmill::report::gate::{Limit, SiteAreas};
use deepmill::report::page::{Page, View};
use deepmill::report::tables::{Cell, Facts};
use deepmill::{Result, atomic_file};
use serde_json::{Value, json};
use shares::{add_bottom, add_clearance, add_shares};
use std::path::PathBuf;

/// Compute exactly which sites of a part a cutter cannot reach, and which sites are in its way.
///
/// Writes to DIR: labels.npz (numbers), labels.ply (colored points), labels.png (picture), findings.json and
/// findings.csv (regions out of reach) and part.stl (the surface as used, in mm). With several cutters, or a table,
/// each has the first five in a folder DIR/NAME of its own, and DIR holds tools.csv (the table of all), tools.ply and
/// tools.png (the first tool that reaches each site), and the findings that no tool reaches.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill label part.stl --cutter 1.5,6,40,5 --out labels\n\
A tool table: deepmill label part.stl --tools tools.csv --out labels")]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF) or cloud of points with normals (PLY, NPZ).
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
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Draw no picture.
    #[arg(long)]
    pub no_picture: bool,
    /// Also write these: `glb` (binary glTF in the colors of the answers), `csv` (a row per site); several with commas.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',')]
    also: Vec<String>,
    /// Also write report.html, a page to send: 3-D view with sections, findings, settings, warnings.
    #[arg(long, conflicts_with = "volume")]
    report: bool,
    /// Label a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
}

impl Args {
    /// A tool of a table or library is what there is: only its stick-out is changed.
    fn remedies(&self) -> Remedies {
        let mut remedies = Remedies::default();
        remedies.only_this_tool = self.tools.are_of_files();
        remedies
    }

    fn share_of_occlusion(&self) -> f64 {
        self.occlusion_share.unwrap_or(LabelOptions::default().share)
    }

    /// Whether occlusion points of a mesh are asked for, by the switch or by something that is about them.
    fn wants_occlusion(&self, limits: &[Limit]) -> bool {
        let is_limited = limits.iter().any(|limit| limit.quantity() == "occlusion");
        self.occlusion || self.occlusion_share.is_some() || is_limited
    }
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let tools = args.surface.tolerances.with_allowance(args.tools.tools(output)?)?;
    args.surface.tolerances.options()?;
    let limits = args.gate.limits(&[])?;
    let given_directions = args.directions.given()?;
    let engine = args.engine.parse()?;
    let also = args.also.iter().map(|name| name.parse()).collect::<Result<Vec<Extra>>>()?;

    atomic_file::check_writable_folder(&args.out)?;
    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, Accept::bodies_or(args.force), output)?;
    clock.lap("read_s", "reading");
    if let Some(step_mm) = args.volume {
        args.region.refuse("--volume", "leave out --volume, or the region")?;
        return volume::run(args, step_mm, (part, tools), clock, output);
    }
    let is_mesh = matches!(part, MeshOrCloud::Mesh(_));
    let blocking = part_itself::blocking(args.obstacles.as_deref(), is_mesh, output)?;
    if blocking != Blocking::Part {
        let remedy = "the sites block: leave out --obstacles, and give the mesh for a cloud";
        args.region.refuse("points as obstacles", remedy)?;
    }
    let (mesh, (scope, sites)) = match part {
        MeshOrCloud::Mesh(mesh) => {
            let placed = args.region.place(&args.sites, &mesh, &args.read, output)?;
            (Some(mesh), (Some(placed.0), placed.1))
        }
        MeshOrCloud::Cloud(sites) => (None, (None, sites)),
    };
    Show::pictures_unless(args.no_picture).require_memory(mesh.as_ref(), &sites)?;
    let options = LabelOptions {
        engine,
        share: args.share_of_occlusion(),
        clearance_limit_mm: args.clearance_limit,
        ..args.published.options(blocking != Blocking::Part)?
    };
    let directions = match (given_directions, blocking) {
        (Some(given), _) => given,
        (None, Blocking::Part) => args.directions.directions()?,
        (None, _) => Directions::published(),
    };
    let more = further_obstacles(args, blocking, mesh.as_ref())?;
    let centroids = mesh.as_ref().filter(|_| blocking == Blocking::Centroids);
    let centroids = centroids.map(Mesh::centroids);
    clock.lap("sites_s", "sites");
    let options_of_part = SurfaceOptions {
        clearance_limit_mm: args.clearance_limit,
        occlusion: args.wants_occlusion(&limits),
        ..args.surface.options(args.share_of_occlusion())?
    };
    let part_itself = mesh.as_ref().filter(|_| blocking == Blocking::Part);
    let fixtures = part_itself.map(|mesh| args.surface.fixtures(mesh, &args.read, output));
    let fixtures = fixtures.transpose()?.unwrap_or_default();
    let triangles = part_itself.map(|mesh| TriangleObstacles::new(mesh, &fixtures)).transpose()?;
    triangles.iter().for_each(|triangles| part_itself::say_without_area(triangles, output));
    let points = match (&more, &centroids) {
        (Some(sites), _) => Obstacles::QueriesAnd(&sites.points),
        (None, Some(centroids)) => Obstacles::Centroids(centroids),
        (None, None) => Obstacles::Queries,
    };
    let (mut labels, mut warnings) = match (&triangles, &mesh) {
        (Some(triangles), Some(mesh)) => {
            let of = (mesh, triangles);
            SurfaceArgs::label(of, &sites, &tools, &directions, &options_of_part)?
        }
        _ => {
            args.surface.warn_unused(output);
            let cutters: Vec<Cutter> = tools.iter().map(|tool| tool.cutter.clone()).collect();
            let labels = access::label_many(&sites, points, &cutters, &directions, &options)?;
            (labels, vec![Vec::new(); cutters.len()])
        }
    };
    if args.region.is_given() {
        // Sites are on the region alone.
        let is_kept = |warning: &Warning| !matches!(warning, Warning::FacesWithoutSites { .. });
        warnings.iter_mut().for_each(|of_tool| of_tool.retain(is_kept));
    }
    let around = (&sites, points, triangles.as_ref());
    for (tool, labels) in tools.iter().zip(&mut labels) {
        part_itself::add_blocking_parts(labels, tool, around, &directions, &options_of_part)?;
    }
    clock.lap("labels_s", "labels");

    let kept = mesh.as_ref().filter(|_| !fixtures.is_empty()).map(|mesh| {
        let by = (&directions, &options_of_part);
        args.surface.kept((mesh, &fixtures), (&sites, &labels), &tools, by)
    });
    let kept = kept.transpose()?;
    let of_mesh = blocking == Blocking::Part;
    let fixtures = joined(&fixtures);
    let surface = AnalysisSettings::surface_of(mesh.as_ref(), fixtures.as_ref())?;
    let (tools, directions) = (&tools[..], &directions);
    let has_occlusion = !of_mesh || options_of_part.occlusion;
    let answers = Answers {
        args,
        also,
        blocking,
        options,
        has_occlusion,
        finish_mm: options_of_part.finish_mm,
        tools,
        directions,
        mesh,
        fixtures,
        surface,
        sites,
        scope,
    };
    let (shown, of_shown) = answers.shown();
    let areas = SiteAreas::by_definition(of_shown, shown, of_mesh)?;
    let cover = || Coverage::of(tools, &labels, directions.len(), &areas);
    let coverage = args.tools.are_several().then(cover);
    let mut facts = answers.facts(&labels, coverage.as_ref(), &areas);
    let named = tools.iter().zip(&labels).map(|(tool, labels)| (&*tool.name, &labels.answers));
    let broken = output.check_limits(&limits, (of_shown, shown), named)?;
    let single = coverage.is_none().then(|| labels[0].clone());
    let mut findings = Regions::find(&answers, &labels)?;
    kept.iter().for_each(|kept| kept.add_to(&mut findings.of_tools));
    if let (Some(triangles), [found], [tool]) = (&triangles, &mut findings.of_tools[..], tools) {
        let held = (&tool.assembly, tool.clearance_mm);
        let remedies = args.remedies();
        findings::advise(found, held.0, |members| {
            let of = (&answers.sites, members);
            triangles.change_for(of, held, directions, &options_of_part, &remedies)
        })?;
    }
    clock.lap("findings_s", "findings");
    let paths = answers.write(labels, &warnings, coverage.as_ref(), &findings, output.unit())?;
    clock.lap("write_s", "writing and drawing");

    let warning = match blocking {
        Blocking::Part => None,
        Blocking::Points(_) | Blocking::Centroids => answers.add_density(&mut facts, more),
    };
    clock.add_to(&mut facts);
    let premise = match blocking {
        Blocking::Part => premise(directions, &args.surface),
        _ => premise_of_points(directions, answers.options.bottom_mm),
    };
    output.say(&premise);
    let mut result = facts.json();
    answers.scope.iter().for_each(|scope| scope.say(&mut result, output));
    output.say(facts.text_in(output.unit()));
    result["premise"] = json!(premise);
    result["limits_broken"] = broken;
    args.read.add_origin(&mut result);
    if let (Blocking::Part, Some(labels), Some(mesh)) = (blocking, &single, &answers.mesh) {
        result["faces"] = part_itself::say_blocking(mesh, &answers.sites, labels, output);
        let about = (&answers.sites, &areas);
        result["bodies"] = part_itself::say_bodies(mesh, about, labels, output)?;
    }
    result["fixtures"] = kept.map_or(Value::Null, |kept| kept.say(tools, &areas, output));
    let named = |tool: &'_ Tool| coverage.as_ref().map(|_| tool.name.clone());
    let warnings = tools.iter().zip(&warnings).map(|(tool, warnings)| {
        part_itself::say_warnings(warnings, named(tool).as_deref(), output)
    });
    result["warnings"] = warnings.collect();
    let regions = findings.overall();
    findings::say(regions, output);
    result["findings"] = regions.json();
    if let Some(warning) = warning {
        output.warn(format!("{warning}: raise --sites, or add --obstacles"));
    }
    output.files(&paths);
    if let Some(coverage) = &coverage {
        let table = coverage.table();
        output.say(table.text_in(output.unit()));
        result["tools"] = table.json();
    }
    output.result_with_files(result, &paths);
    Ok(())
}

/// Points of the surface beside the sites, from another stream of the same seed.
fn further_obstacles(
    args: &Args,
    blocking: Blocking,
    mesh: Option<&Mesh>,
) -> Result<Option<Sites>> {
    let (Blocking::Points(Some(n_sites)), Some(mesh)) = (blocking, mesh) else { return Ok(None) };
    let seed = args.sites.seed.wrapping_add(1);
    let options = SiteOptions { n_sites, seed, ..SiteOptions::default() };
    sites::sample(mesh, &options).map(Some)
}

/// What the labels are about; coverage is there if every tool has a folder of its own.
struct Answers<'a> {
    args: &'a Args,
    also: Vec<Extra>,
    blocking: Blocking,
    options: LabelOptions,
    has_occlusion: bool,
    finish_mm: f64,
    tools: &'a [Tool],
    directions: &'a Directions,
    mesh: Option<Mesh>,
    /// Fixtures and table.
    fixtures: Option<Mesh>,
    /// What the files say of both.
    surface: SurfaceSettings,
    sites: Sites,
    /// Of a mesh, which part of it the sites are on.
    scope: Option<Scope>,
}

impl Answers<'_> {
    /// The surface that areas, findings and pictures are about, and the sites on it.
    fn shown(&self) -> (Option<&Mesh>, &Sites) {
        match (&self.scope, &self.mesh) {
            (Some(scope), Some(mesh)) => {
                let (mesh, sites) = scope.shown(mesh, &self.sites);
                (Some(mesh), sites)
            }
            (_, mesh) => (mesh.as_ref(), &self.sites),
        }
    }

    fn facts(&self, labels: &[Labels], coverage: Option<&Coverage>, areas: &SiteAreas) -> Facts {
        let mut facts = Facts::new();
        facts.add("part", "part", Cell::text(name_of(&self.args.part)));
        facts.add("definition", "definition", Cell::text(self.blocking.definition().to_string()));
        add_bottom(&mut facts, &self.options, &self.sites);
        if coverage.is_none() {
            facts.add("cutter", "cutter", Cell::text(self.tools[0].words()));
        }
        part_itself::add_tolerances(&mut facts, labels, self.finish_mm);
        facts.add("n_sites", "sites", Cell::count(self.sites.len()));
        let n_directions =
            labels[0].surface.as_ref().map_or(self.directions.len(), |s| s.n_directions);
        facts.add("n_directions", "directions", Cell::count(n_directions));
        match coverage {
            None => {
                add_shares(&mut facts, Shares::of(&labels[0], self.directions.len(), areas));
                part_itself::add_facts(&mut facts, &labels[0]);
                add_clearance(&mut facts, &labels[0]);
            }
            Some(coverage) => {
                let none = Cell::Share(coverage.share_of_first(None));
                facts.add("inaccessible_to_all", "out of reach of every tool", none);
            }
        }
        facts
    }

    /// Adds how dense the sites are for the smallest tool; returns the warning if that is too little.
    fn add_density(&self, facts: &mut Facts, more: Option<Sites>) -> Option<String> {
        let mut spacing = density::add_spacing(facts, &self.sites);
        if let Some(denser) = more.filter(|more| more.len() > self.sites.len()) {
            spacing = Spacing::measure_on_sheet(&denser);
        }
        let which = if self.tools.len() > 1 { "the smallest cutter" } else { "this cutter" };
        let smallest =
            self.tools.iter().map(|tool| tool.params.cr_mm).fold(f64::INFINITY, f64::min);
        spacing.and_then(|spacing| density::add_advice(facts, &spacing, which, smallest))
    }

    fn write(
        &self,
        labels: Vec<Labels>,
        warnings: &[Vec<Warning>],
        coverage: Option<&Coverage>,
        findings: &Regions,
        unit: Unit,
    ) -> Result<Vec<PathBuf>> {
        let Answers { args, tools, mesh, .. } = self;
        let (shown, sites) = self.shown();
        let show = Show::pictures_unless(args.no_picture);
        let (mut paths, mut views) = (Vec::new(), Vec::new());
        let progress = progress::bar(tools.len() as u64, "tools");
        for (k, (tool, labels)) in tools.iter().zip(labels).enumerate() {
            let folder = match coverage {
                None => args.out.clone(),
                Some(_) => args.out.join(tool.folder()),
            };
            let file = self.file((tool, &warnings[k]), labels);
            paths.extend(folder::write_labels(&folder, &file, shown, show)?);
            let export = |extra| folder::export_labels(&folder, &file, shown, extra);
            paths.extend(self.also.iter().map(|extra| export(*extra)).collect::<Result<Vec<_>>>()?);
            let found = &findings.of_tools[k];
            paths.extend(found.write(
                &folder,
                (&file.provenance.part, &file.provenance.tool),
                unit,
            )?);
            if args.report {
                let name = coverage.map_or("exact", |_| &*tool.name);
                views.push(View::of_labels(name, &file, found.clone()));
            }
            progress.inc(1);
        }
        progress.finish_and_clear();
        if let Some(coverage) = coverage {
            let part = name_of(&args.part);
            let cutter = &format!("{} tools", tools.len());
            let part = PartView { name: &part, mesh: shown, sites, cutter };
            paths.extend(coverage.write(&args.out, part, show, unit)?);
            paths.extend(findings.overall().write(&args.out, (part.name, cutter), unit)?);
            views.insert(0, coverage.view(findings.overall().clone()));
        }
        if args.report {
            let page = Page { part: &name_of(&args.part), mesh: shown, sites, views: &views, unit };
            paths.push(page.write(&args.out)?);
        }
        if let Some(mesh) = mesh {
            paths.push(folder::write_surface(&args.out, mesh)?);
        }
        let region = self.scope.as_ref().map(|scope| scope.write(&args.out));
        paths.extend(region.transpose()?.flatten());
        if let Some(fixtures) = &self.fixtures {
            paths.push(folder::write_fixtures(&args.out, fixtures)?);
        }
        Ok(paths)
    }

    fn file(&self, (tool, warnings): (&Tool, &[Warning]), labels: Labels) -> LabelFile {
        let provenance = self.provenance(tool, warnings);
        LabelFile { provenance, sites: self.sites.clone(), labels }
    }

    fn provenance(&self, tool: &Tool, warnings: &[Warning]) -> Provenance {
        let Answers { args, directions, .. } = self;
        let mut of_tool = ToolSettings::of(tool);
        of_tool.of_library = Some(args.tools.are_of_files());
        let mut settings = AnalysisSettings::default();
        settings.sites = Some(args.sites.settings(self.mesh.is_some()));
        settings.region = self.scope.as_ref().and_then(Scope::settings);
        settings.surface = Some(self.surface.clone());
        settings.tool = Some(of_tool);
        settings.directions = Some(directions.set().clone());
        settings.n_directions = Some(directions.len());
        settings.definition = Some(self.blocking.definition());
        settings.obstacles = args.obstacles.as_ref().map(|_| self.blocking);
        settings.part_itself = (self.blocking == Blocking::Part).then(|| args.surface.settings());
        settings.warnings = Some(part_itself::stated(warnings));
        settings.occlusion = Some(self.has_occlusion);
        settings.occlusion_share = self.has_occlusion.then(|| args.share_of_occlusion());
        settings.occlusion_rounding = Some(self.options.rounding);
        settings.bottom_mm = self.options.bottom_mm;
        settings.clearance_limit_mm = args.clearance_limit;
        settings.engine = Some(args.engine.clone());
        settings.origin_mm = args.read.origin_mm();
        Provenance { part: name_of(&args.part), cutter: tool.params, tool: tool.words(), settings }
    }
}

/// The findings of every tool, and of all together if there are several.
struct Regions {
    of_tools: Vec<Findings>,
    of_all: Option<Findings>,
}

impl Regions {
    fn find(about: &Answers, labels: &[Labels]) -> Result<Self> {
        let answers: Vec<&SiteAnswers> = labels.iter().map(|labels| &labels.answers).collect();
        let names: Vec<&str> = about.tools.iter().map(|tool| &*tool.name).collect();
        let all: Vec<&Labels> = labels.iter().collect();
        let (mesh, sites) = about.shown();
        let of_tools = findings::of_tools(sites, mesh, &names, &all)?;
        let all = |answers| Findings::of(sites, mesh, &answers, &[]);
        let of_all = (labels.len() > 1).then(|| all(for_all_tools(answers.into_iter())));
        Ok(Regions { of_tools, of_all: of_all.transpose()? })
    }

    /// Where no tool reaches.
    fn overall(&self) -> &Findings {
        self.of_all.as_ref().unwrap_or(&self.of_tools[0])
    }
}
