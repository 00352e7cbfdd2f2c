//! Arguments that several commands share: the cutter, the sites, the directions.

use crate::out_folder::check_out;
use crate::output::Output;
use deepmill::analysis::Analysis;
use deepmill::cutter::CutterParams;
use deepmill::data::files::settings::SiteSettings;
use deepmill::data::files::tools::{self, MissingParameters, Tool, ToolTable};
use deepmill::directions::Directions;
use deepmill::findings::gate::Limit;
use deepmill::geom::formats::MeshOrCloud;
use deepmill::geom::sites::{self, Normals, SiteOptions, VertexNormals};
use deepmill::geom::units::{Length, Unit};
use deepmill::geom::{Mesh, Sites};
use deepmill::{Error, Result};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Which cutters.
#[derive(Clone, clap::Args)]
pub struct ToolArgs {
    /// Lengths in mm, or each with its unit (0.0625in): ball radius CR, height CH of the cylinder above the ball,
    /// holder radius FR, holder height FH. Give it again for further cutters.
    #[arg(
        long,
        value_name = "CR,CH,FR,FH",
        required_unless_present = "tools",
        allow_hyphen_values = true
    )]
    cutter: Vec<String>,
    /// Tools of a file: a Fusion 360 library (JSON, .tools), a FreeCAD tool bit (.fctb), a folder of them or a library
    /// (.fctl), a CAMotics table (JSON), a LinuxCNC table (.tbl), or CSV with the columns CR, CH, FR, FH (mm) and, if
    /// you like, name, T, corner and clearance, or in the words of a shop (diameter, corner, stick_out, shank); the
    /// options --corner and --clearance are not about its tools. Give it again for further files.
    #[arg(long, value_name = "FILE")]
    tools: Vec<PathBuf>,
    #[command(flatten)]
    tip: TipArgs,
    #[command(flatten)]
    defaults: UnsaidArgs,
}

/// What files of tools may leave defaults.
#[derive(Clone, clap::Args)]
pub struct UnsaidArgs {
    /// For tools whose file does not say it: height of the holder's nose above the tip. Of this and the next lengths, a
    /// number without a unit is in --tool-unit if that is given, else in mm.
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, value_parser = length)]
    stick_out: Option<Length>,
    /// For tools whose file does not say it: the holder, a Fusion 360 library with one, a FreeCAD holder (.fcholder),
    /// or a table height,lower,upper (mm, diameters; from the nose upward).
    #[arg(long, value_name = "FILE")]
    holder: Option<PathBuf>,
    /// For tools whose file does not say it: diameter of the shank.
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, value_parser = length)]
    shank: Option<Length>,
    /// For tools whose file does not say it: length of the flutes.
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, value_parser = length)]
    flute_length: Option<Length>,
    /// For files of tools that do not say it: unit of their numbers, mm, cm, m or in.
    #[arg(long, value_name = "UNIT")]
    tool_unit: Option<Unit>,
    /// Refuse files of which a tool would be left out.
    #[arg(long)]
    strict: bool,
}

impl ToolArgs {
    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.tools.iter().chain(self.defaults.files())
    }
}

impl UnsaidArgs {
    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.holder.iter()
    }

    fn defaults(&self, output: &Output) -> Result<MissingParameters> {
        let defaults = MissingParameters::default()
            .with_stick_out_mm(self.length("--stick-out", self.stick_out, output)?)
            .with_shank_mm(self.length("--shank", self.shank, output)?)
            .with_flutes_mm(self.length("--flute-length", self.flute_length, output)?)
            .with_unit_mm(self.tool_unit.map(Unit::millimeters));
        let holder = self.holder.as_ref().map(|path| tools::read_holder(path, &defaults));
        Ok(defaults.with_holder(holder.transpose()?))
    }

    /// In mm; a number without a unit is in that of the files of tools.
    fn length(
        &self,
        name: &'static str,
        length: Option<Length>,
        output: &Output,
    ) -> Result<Option<f64>> {
        let Some(length) = length else { return Ok(None) };
        let bare = self.tool_unit.unwrap_or_default();
        let mm = length.mm(bare);
        if !(1e-4..=1e4).contains(&mm) {
            let remedy = "give it in mm, or with its unit (1.1in)";
            return Err(Error::argument(name, length, "0.0001 mm to 10 m", remedy));
        }
        if !length.has_unit() && bare != Unit::Millimeter {
            output.say(format!("{name} {length} {bare}: {mm} mm, in the unit of --tool-unit"));
        }
        Ok(Some(mm))
    }

    /// The tools of all files, those of libraries with names of their own; says what was refused and changed.
    pub fn read(&self, paths: &[PathBuf], output: &Output) -> Result<Vec<Tool>> {
        let defaults = self.defaults(output)?;
        let mut all = Vec::new();
        for (path, table) in paths.iter().zip(tools::read_several(paths, &defaults)?) {
            self.check_whole(path, &table)?;
            if !table.unused.is_empty() {
                let columns = table.unused.join(", ");
                output.warn(format!("{}: columns not used: {columns}", path.display()));
            }
            table.refused.iter().for_each(|refused| output.warn(refused));
            table.notices.iter().for_each(|notice| output.warn(notice));
            if !table.refused.is_empty() {
                let (n, left_out) = (table.tools.len(), table.refused.len());
                let path = path.display();
                output.warn(format!("{path}: {left_out} of {} tools left out", n + left_out));
            }
            all.extend(table.tools);
        }
        Ok(all)
    }

    /// With `--strict`, no tool may be left out.
    fn check_whole(&self, path: &Path, table: &ToolTable) -> Result<()> {
        match table.refused.first().filter(|_| self.strict) {
            None => Ok(()),
            Some(first) => {
                let n = table.refused.len();
                let found = format!("{n} of its tools would be left out: {first}");
                Err(Error::file(path, "tools", found, "correct them, or leave out --strict"))
            }
        }
    }
}

/// Names of tools are told apart, or refused if someone gave them twice.
pub fn with_names(mut tools: Vec<Tool>) -> Result<Vec<Tool>> {
    tools::number_repeated(&mut tools);
    let mut keys = HashSet::new();
    match tools.iter().find(|tool| !keys.insert(tool.name_key())) {
        None => Ok(tools),
        Some(tool) => {
            let found = format!("`{}` twice", tool.name);
            let remedy = "leave one out, or give tools of a table names";
            Err(Error::argument("tool", found, "a name for one tool only", remedy))
        }
    }
}

/// What the four lengths of every `--cutter` do not say.
#[derive(Clone, clap::Args)]
struct TipArgs {
    /// Radius of the tip's corner: 0 is a flat end, CR (the default) a ball end.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = millimeters)]
    corner: Option<f64>,
    /// Safety margin about what does not cut: holder and spindle of the four lengths.
    #[arg(
        long, value_name = "MM", default_value_t = 0.0, allow_hyphen_values = true,
        value_parser = millimeters
    )]
    clearance: f64,
}

impl TipArgs {
    fn tool(&self, lengths: &str) -> Result<Tool> {
        Tool::new(cutter_params(lengths)?, self.corner, self.clearance)
    }
}

impl ToolArgs {
    /// Every `--cutter`, then the tools of the files; no two have the same name.
    pub fn tools(&self, output: &Output) -> Result<Vec<Tool>> {
        self.check_tip()?;
        let lengths = self.cutter.iter();
        let mut tools: Vec<Tool> = lengths.map(|l| self.tip.tool(l)).collect::<Result<_>>()?;
        tools.extend(self.defaults.read(&self.tools, output)?);
        with_names(tools)
    }

    /// Whether results go to a folder for each tool: a table's do, however short it is.
    pub fn are_several(&self) -> bool {
        !self.tools.is_empty() || self.cutter.len() > 1
    }

    /// Whether files name all tools.
    pub fn are_of_files(&self) -> bool {
        self.cutter.is_empty()
    }

    /// For a command that takes one `--cutter` only.
    pub fn check_one_cutter(&self) -> Result<()> {
        match self.cutter.len() {
            0 | 1 => Ok(()),
            n => {
                let remedy = "name several as a table with --tools";
                Err(Error::argument("--cutter", format!("given {n} times"), "once", remedy))
            }
        }
    }

    fn check_tip(&self) -> Result<()> {
        let TipArgs { corner, clearance } = self.tip;
        if self.cutter.is_empty() && (corner.is_some() || clearance != 0.0) {
            let expected = "left out: they belong to --cutter";
            let remedy = "give the table a column corner or clearance";
            return Err(Error::argument("--corner or --clearance", "given", expected, remedy));
        }
        Ok(())
    }
}

/// Reads `CR,CH,FR,FH` in mm or with units; whether the lengths make a cutter is checked by [`Cutter`].
fn cutter_params(text: &str) -> Result<CutterParams> {
    let in_mm = |part: &str| match millimeters(part) {
        Ok(mm) if Length::read(part).is_some_and(Length::has_unit) => mm.to_string(),
        _ => part.to_string(),
    };
    let lengths: Vec<String> = text.split(',').map(in_mm).collect();
    lengths.join(",").parse().map_err(|_| {
        // The message is about what was typed.
        let typed = text.parse::<CutterParams>().err();
        let other = || Error::argument("--cutter", text, "four lengths", "write 1.5,6,40,5");
        called(typed.unwrap_or_else(other), "--cutter")
    })
}

/// A length of the command line, with or without a unit.
pub fn length(text: &str) -> std::result::Result<Length, String> {
    Length::read(text)
        .ok_or_else(|| "not a length; write for example 30, 1.1in, '1/4 in', 30mm".into())
}

/// A length of the command line, in mm if it has no unit.
pub fn millimeters(text: &str) -> std::result::Result<f64, String> {
    match text.trim().parse() {
        Ok(mm) => Ok(mm),
        Err(_) => length(text).map(|length| length.mm(Unit::Millimeter)),
    }
}

/// The error, of an argument by the name it has at the command line.
pub fn called(error: Error, option: &'static str) -> Error {
    match error {
        Error::Argument { found, expected, remedy, .. } => {
            Error::Argument { name: option, found, expected, remedy }
        }
        other => other,
    }
}

/// The error, of a limit by its option.
pub fn limit(error: Error) -> Error {
    called(error, "--fail-if")
}

/// Limits that results must keep.
#[derive(Clone, clap::Args)]
pub struct GateArgs {
    /// Exit with code 3, after everything is written, if an answer breaks this limit: 'inaccessible>5%' (of the
    /// surface, of any tool), 'tip_does_not_fit>20mm2', 'unreachable>…' (either), 'no-tool-reaches>1%' (out of
    /// reach of all tools together), 'occlusion>…', 'finding>50mm2' (the largest connected region that is out of
    /// reach), of `label` also 'rest>0.5mm' (the most that all tools leave) and 'finding>2mm3' (the most that is left
    /// about a region); < in place of > for a minimum. Of the region, if --only or --except give one. May be given
    /// again.
    #[arg(long, value_name = "LIMIT")]
    fail_if: Vec<String>,
}

impl GateArgs {
    /// The limits, of a command that does not answer some quantities.
    pub fn limits(&self, unanswered: &[&str]) -> Result<Vec<Limit>> {
        let limits: Vec<Limit> =
            self.fail_if.iter().map(|text| text.parse().map_err(limit)).collect::<Result<_>>()?;
        let is_unanswered = |limit: &&Limit| {
            unanswered.contains(&limit.quantity())
                || limit.is_about_rest() && unanswered.contains(&"rest")
        };
        match limits.iter().find(is_unanswered) {
            Some(limit) => Err(self::limit(limit.not_answered())),
            None => Ok(limits),
        }
    }
}

/// `95%` or `95`, as a share.
pub fn share(text: &str) -> Result<f64> {
    let percent = text.trim().trim_end_matches('%').trim_end().parse::<f64>();
    let percent = percent.ok().filter(|p| *p > 0.0 && *p <= 100.0);
    percent.map(|p| p / 100.0).ok_or_else(|| {
        let remedy = "write for example 95%";
        Error::argument("--share", format!("`{text}`"), "above 0, at most 100 %", remedy)
    })
}

/// A file's name without its folder.
pub fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(|| "part".into(), |name| name.to_string_lossy().into_owned())
}

/// Which sites.
#[derive(Clone, clap::Args)]
pub struct SiteArgs {
    /// Number of sites spread over the mesh, or `vertices` to take the mesh's own corners.
    #[arg(long, value_name = "COUNT", default_value = "7000", allow_negative_numbers = true)]
    sites: String,
    /// Seed of the sites.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// For smooth parts: interpolate normals across edges folded by less than this angle (30 if
    /// none is given). Without it a site has the normal of its face.
    #[arg(
        long, value_name = "DEGREES", num_args = 0..=1, require_equals = true,
        default_missing_value = "30"
    )]
    smooth: Option<f64>,
    /// Of --sites vertices: whether faces weigh in the normal of a vertex by their `angle` there (without it) or by
    /// their `area`, as many programs have it.
    #[arg(long, value_name = "WEIGHTS")]
    normals: Option<String>,
}

impl SiteArgs {
    /// Whether the sites are the vertices of the mesh.
    pub fn are_vertices(&self) -> bool {
        self.sites == "vertices"
    }

    /// How faces weigh in normals at vertices.
    fn vertex_normals(&self) -> Result<VertexNormals> {
        let Some(name) = &self.normals else { return Ok(VertexNormals::default()) };
        let normals = name.parse().map_err(|error| called(error, "--normals"))?;
        if self.are_vertices() {
            return Ok(normals);
        }
        let found = format!("`{name}` with --sites {}", self.sites);
        let remedy =
            "leave it out, or take --sites vertices; --smooth is for sites that are spread";
        Err(Error::argument("--normals", found, "sites at vertices", remedy))
    }

    /// An analysis with these sites.
    pub fn add_to(&self, analysis: Analysis) -> Result<Analysis> {
        Ok(match self.spread()? {
            Some(options) => analysis.spread(options),
            None => analysis.at_vertices(self.seed).vertex_normals(self.vertex_normals()?),
        })
    }

    /// The sites of a part: spread over a mesh; a cloud is taken as it is.
    pub fn place(&self, part: MeshOrCloud) -> Result<(Option<Mesh>, Sites)> {
        let mesh = match part {
            MeshOrCloud::Mesh(mesh) => mesh,
            MeshOrCloud::Cloud(sites) => return Ok((None, sites)),
        };
        let sites = self.on(&mesh)?;
        Ok((Some(mesh), sites))
    }

    /// The sites on a mesh.
    pub fn on(&self, mesh: &Mesh) -> Result<Sites> {
        match self.sites.as_str() {
            "vertices" => Ok(sites::at_vertices(mesh, self.vertex_normals()?)?.0),
            count => sites::sample(mesh, &self.options(count)?),
        }
    }

    /// How sites are spread; none if the mesh's corners are the sites.
    pub fn spread(&self) -> Result<Option<SiteOptions>> {
        let count = Some(&*self.sites).filter(|count| *count != "vertices");
        count.map(|count| self.options(count)).transpose()
    }

    fn options(&self, count: &str) -> Result<SiteOptions> {
        self.vertex_normals()?;
        let (n_sites, normals) = (site_count(count)?, self.smooth_normals()?);
        let options = SiteOptions::default().with_n_sites(n_sites);
        Ok(options.with_seed(self.seed).with_normals(normals))
    }

    fn smooth_normals(&self) -> Result<Normals> {
        match self.smooth {
            None => Ok(Normals::Face),
            Some(degrees) if (0.0..=180.0).contains(&degrees) => {
                Ok(Normals::Smooth { crease_rad: degrees.to_radians() })
            }
            Some(degrees) => {
                let expected = "an angle from 0 to 180 degrees";
                Err(Error::argument("--smooth", degrees, expected, "30 suits most parts"))
            }
        }
    }

    pub fn settings(&self, has_mesh: bool) -> SiteSettings {
        match has_mesh {
            true => {
                let mut settings = SiteSettings::spread(self.sites.clone(), self.seed, self.smooth);
                settings.vertex_normals = self.normals.clone().filter(|name| name == "area");
                settings
            }
            false => SiteSettings::as_given(),
        }
    }
}

/// A number of sites that can say something about each other.
fn site_count(text: &str) -> Result<usize> {
    text.parse().ok().filter(|n| *n >= 2).ok_or_else(|| {
        let expected = "2 or more, or `vertices`";
        Error::argument("--sites", format!("`{text}`"), expected, "the paper uses 7000")
    })
}

/// Which directions the tool may come from.
#[derive(Clone, clap::Args)]
pub struct DirectionArgs {
    /// COUNT or hemisphere:COUNT (upper half), sphere:COUNT, latlong:RINGSxCOUNT, cone:DEGREES:COUNT (around +z),
    /// circle:X,Y,Z:COUNT (across an axis), 4-axis:x:LOW,HIGH (about a rotary axis within these degrees from +z),
    /// list:X,Y,Z;X,Y,Z;…, up (+z alone), published (the 152 of the published data), or deepmill++ (the 102 of
    /// DeepMill++). By default 150, of the published definition published.
    #[arg(long, value_name = "SET", allow_negative_numbers = true)]
    directions: Option<String>,
}

impl DirectionArgs {
    /// Those given, or those of the mesh definition.
    pub fn directions(&self) -> Result<Directions> {
        self.given()?.map_or_else(|| "150".parse(), Ok)
    }

    /// Those given.
    pub fn given(&self) -> Result<Option<Directions>> {
        let read = |set: &String| set.parse().map_err(|e| called(e, "--directions"));
        self.directions.as_ref().map(read).transpose()
    }
}

/// Where the results go.
#[derive(Clone, clap::Args)]
pub struct OutArgs {
    /// Folder of the results.
    // Not required where a part is watched.
    #[arg(long, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
}

impl OutArgs {
    /// This folder.
    pub fn of(folder: PathBuf) -> Self {
        OutArgs { out: Some(folder) }
    }

    /// The folder, if there is one.
    pub fn given(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    /// Passes if there is none, or if it can be written.
    pub fn check(&self) -> Result<()> {
        self.given().map_or(Ok(()), check_out)
    }

    /// The folder of a command that requires one.
    pub fn folder(&self) -> &Path {
        self.given().unwrap_or(Path::new("."))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cutters_are_four_numbers() {
        assert_eq!(cutter_params("1.5, 6,40,5").unwrap().to_array(), [1.5, 6.0, 40.0, 5.0]);
        assert_eq!(
            cutter_params("1/16in,0.25 in,40,5mm").unwrap().to_array(),
            [1.5875, 6.35, 40.0, 5.0]
        );
        for text in ["", "1,2,3", "1,2,3,4,5", "1,2,3,x", "1;2;3;4"] {
            let message = cutter_params(text).unwrap_err().to_string();
            assert!(message.starts_with("--cutter is `") && message.contains("1.5,6,40,5"));
        }
    }
}
