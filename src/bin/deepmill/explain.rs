//! `deepmill explain`: why a site of a result can or cannot be reached, and what would help.

use crate::args::{UnsaidArgs, called, millimeters};
use crate::mesh_args::{MeshArgs, warn_if_in_inches};
use crate::output::Output;
use crate::progress;
use deepmill::access::surface::explain::Remedies;
use deepmill::answers::SiteAnswer;
use deepmill::data::files::label_query::LabelQuery;
use deepmill::data::files::tools::{Tool, thick_and_short_first};
use deepmill::geom::Sites;
use deepmill::geom::spacing::Spacing;
use deepmill::report::coverage::labeled_tools;
use deepmill::report::explanation::{About, part_advice, picture};
use deepmill::report::folder::LABELS;
use deepmill::tables::Cell;
use deepmill::{Error, Result, atomic_file};
use glam::DVec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Say why a site can or cannot be reached: a direction in which the tool has a free pose there, or what blocks by
/// direction, by how much, and the least change of the tool that helps.
///
/// RESULT states the query: part, obstacles, tool, directions, tolerance. Writes a section through tool and part to
/// RESULT/site-N.png.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill explain labels --at 12.5,30,4\n\
The row of a finding's site: deepmill explain labels --site 512 --json")]
pub struct Args {
    /// Folder that `label` has written (of several tools, the folder of one), or its labels.npz.
    result: PathBuf,
    /// Row of the site, from 0 on.
    #[arg(long, value_name = "N", required_unless_present = "at", conflicts_with = "at")]
    site: Option<usize>,
    /// The site nearest to this place, mm, in the coordinates of the result (relative to its origin_mm, if it has one).
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    at: Option<String>,
    /// Take the nearest site however far it is from the place.
    #[arg(long, requires = "at")]
    nearest: bool,
    /// The part's mesh, if the folder holds no part.stl.
    #[arg(long, value_name = "FILE")]
    part: Option<PathBuf>,
    #[command(flatten)]
    read: MeshArgs,
    /// Propose tools of these files only, and a longer stick-out of the tool that the labels are about: Fusion 360
    /// libraries (JSON), FreeCAD tool bits
    /// (.fctb) or folders of them, LinuxCNC tables (.tbl), CSV tables.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    library: Vec<PathBuf>,
    /// Propose any change of a tool of a file (`label --tools`), not a longer stick-out alone.
    #[arg(long, conflicts_with = "library")]
    any_tool: bool,
    #[command(flatten)]
    defaults: UnsaidArgs,
    /// How much may remain at a site that counts as reached; by default as for the labels.
    #[arg(long, value_name = "MM", value_parser = millimeters)]
    finish: Option<f64>,
    /// Stock to leave: what cuts stays this far off the surface; by default as for the labels.
    #[arg(long, value_name = "MM", allow_hyphen_values = true, value_parser = millimeters)]
    allowance: Option<f64>,
    /// Propose no thinner cutter.
    #[arg(long, value_name = "MM", default_value_t = Remedies::default().least_diameter_mm)]
    least_diameter: f64,
    /// Propose no tool of which the length is more than so many times its diameter.
    #[arg(long, value_name = "RATIO", default_value_t = Remedies::default().most_slender)]
    most_slender: f64,
    /// File of the picture; without it site-N.png beside the labels.
    #[arg(long, value_name = "FILE", conflicts_with = "no_picture")]
    picture: Option<PathBuf>,
    /// Draw no picture.
    #[arg(long)]
    no_picture: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let at = args.at.as_deref().map(place).transpose()?;
    let labels = labels_file(&args.result)?;
    if let Some(path) = &args.picture {
        atomic_file::check_writable_file(path)?;
    }
    let mesh = args.part.as_ref().map(|path| args.read.read_near(path, output));
    let library = args.defaults.read(&args.library, output)?;
    let mut query = LabelQuery::read(&labels, mesh.transpose()?)?;
    query.mesh.iter().for_each(|mesh| warn_if_in_inches(mesh, output));
    query.remedies = args.remedies(query.remedies)?;
    args.set_tolerances(&mut query)?;
    let allowance = query.tool.assembly.allowance_mm();
    let library = library.into_iter().map(|tool| tool.with_allowance(allowance));
    let library = library.collect::<Result<Vec<Tool>>>()?;
    let (site, distance) = match at {
        Some(at) => {
            let found = query.nearest_site(at).map_err(|e| called(e, "--at"))?;
            args.require_near(at, found, &query.file.sites)?;
            found
        }
        None => (args.site.unwrap_or_default(), 0.0),
    };
    let working = progress::working("explaining");
    let why = query.explain(site).map_err(|e| match e {
        Error::Argument { name: "site", .. } => called(e, "--site"),
        other => other,
    })?;
    drop(working);
    let about = About { query: &query, site, why: &why };
    let mut facts = about.facts();
    let mut result = about.json();
    if at.is_some() {
        facts.add("distance_mm", "from the place given", Cell::Millimeters(distance));
        result["distance_mm"] = json!(distance);
    }
    output.say(facts.text_in(output.unit()));
    output.say(about.table().text_in(output.unit()));
    about.sentences().iter().for_each(|line| output.say(line));
    let (lines, advice) = part_advice(&about)?;
    lines.iter().for_each(|line| output.say(line));
    result["advice"] = advice;
    if why.answer != SiteAnswer::Accessible && !library.is_empty() {
        result["library"] = say_library(&query, site, &library, output)?;
    }
    let mut paths = Vec::new();
    if !args.no_picture {
        let beside = labels.parent().unwrap_or(Path::new("")).join(format!("site-{site}.png"));
        let path = args.picture.clone().unwrap_or(beside);
        picture(&about).write_png(&path)?;
        paths.push(path);
    }
    output.files(&paths);
    output.result_with_files(result, &paths);
    Ok(())
}

impl Args {
    /// A place off the part is refused: farther from its nearest site than these are from each other, and a little more
    /// for a place that was rounded.
    fn require_near(&self, at: DVec3, (site, mm): (usize, f64), sites: &Sites) -> Result<()> {
        let spacing = Spacing::measure_on_sheet(sites).map_or(f64::INFINITY, |s| s.mean_mm);
        let most = 1.5 * spacing + 0.1;
        if self.nearest || mm <= most {
            return Ok(());
        }
        let words = |p: DVec3| {
            let [x, y, z] = p.to_array().map(|x| (1e3 * x).round() / 1e3 + 0.0);
            format!("{x}, {y}, {z}")
        };
        let place = words(sites.points[site].as_dvec3());
        let found = format!(
            "{}, {mm:.2} mm from the nearest site, {site} at {place}, of sites {spacing:.2} mm apart",
            words(at)
        );
        let remedy = "give a place on the surface in mm, or --nearest to take that site";
        Err(Error::argument("--at", found, format!("at most {most:.2} mm"), remedy))
    }

    /// Those that are given, in place of those of the labels.
    fn set_tolerances(&self, query: &mut LabelQuery) -> Result<()> {
        query.options.finish_mm = self.finish.unwrap_or(query.options.finish_mm);
        query.options.check().map_err(|error| called(error, "--finish"))?;
        if let Some(allowance) = self.allowance {
            let rough = query.tool.clone().with_allowance(allowance);
            query.tool = rough.map_err(|error| called(error, "--allowance"))?;
        }
        Ok(())
    }

    fn remedies(&self, of_labels: Remedies) -> Result<Remedies> {
        for (name, value) in
            [("--least-diameter", self.least_diameter), ("--most-slender", self.most_slender)]
        {
            if !(1e-4..=1e4).contains(&value) {
                let remedy = "leave it out for the default";
                return Err(Error::argument(name, value, "a number from 0.0001 to 10000", remedy));
            }
        }
        let mut remedies = of_labels;
        remedies.least_diameter_mm = self.least_diameter;
        remedies.most_slender = self.most_slender;
        remedies.only_this_tool &= !self.any_tool;
        remedies.only_this_tool |= !self.library.is_empty();
        Ok(remedies)
    }
}

/// Which tools of the library reach the site, the thick and short ones first; said and as JSON.
fn say_library(
    query: &LabelQuery,
    site: usize,
    library: &[Tool],
    output: &Output,
) -> Result<Value> {
    let mut reaching = Vec::new();
    for k in thick_and_short_first(library) {
        if query.is_reached_by(site, &library[k])? {
            reaching.push(&library[k]);
        }
    }
    let named = |tool: &&Tool| format!("{} ({})", tool.name, tool.words());
    let first: Vec<String> = reaching.iter().take(N_SAID).map(named).collect();
    let more = reaching.len().saturating_sub(N_SAID);
    output.say(match (first.is_empty(), more) {
        (true, _) => "No tool of the library reaches it from the directions given.".to_string(),
        (false, 0) => format!("Of the library reach it: {}.", first.join("; ")),
        (false, more) => format!("Of the library reach it: {}; and {more} more.", first.join("; ")),
    });
    let row = |tool: &&Tool| json!({ "name": tool.name, "words": tool.words() });
    Ok(reaching.iter().map(row).collect())
}

/// Tools of a library that are printed.
const N_SAID: usize = 6;

/// The file of labels that is meant.
fn labels_file(result: &Path) -> Result<PathBuf> {
    if !result.is_dir() {
        return Ok(result.into());
    }
    let file = result.join(LABELS);
    if file.is_file() {
        return Ok(file);
    }
    let (found, remedy) = match labeled_tools(result)? {
        Some(tools) => {
            let folders: Vec<String> = tools.into_iter().map(|(_, folder)| folder).collect();
            let folders = folders.join(", ");
            let remedy = format!("name the folder of one of its tools: {folders}");
            ("it is the folder of several tools".to_string(), remedy)
        }
        None => {
            let remedy = "name a folder that `deepmill label` has written".to_string();
            (format!("it holds no {LABELS}"), remedy)
        }
    };
    Err(Error::file(result, "folder", found, remedy))
}

fn place(text: &str) -> Result<DVec3> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|x| millimeters(x).ok()).collect();
    let three = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    three.map(DVec3::from_array).filter(|p| p.is_finite()).ok_or_else(|| {
        let remedy = "write for example 12.5,30,4";
        Error::argument("--at", format!("`{text}`"), "three coordinates in mm: X,Y,Z", remedy)
    })
}
