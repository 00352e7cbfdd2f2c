//! What several commands ask for: the cutter, the sites, the directions.

use crate::output::Output;
use deepmill::cutter::CutterParams;
use deepmill::data::files::tools::{self, Tool};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::formats::Part;
use deepmill::geom::sites::{self, Normals, SiteOptions};
use deepmill::geom::{Mesh, Sites};
use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Which cutter.
#[derive(clap::Args)]
pub struct CutterArgs {
    /// Lengths in mm: ball radius CR, height CH of the cylinder above the ball, holder radius FR,
    /// holder height FH.
    #[arg(long, value_name = "CR,CH,FR,FH")]
    cutter: String,
    #[command(flatten)]
    tip: TipArgs,
}

/// Which cutters.
#[derive(clap::Args)]
pub struct ToolArgs {
    /// Lengths in mm: ball radius CR, height CH of the cylinder above the ball, holder radius FR,
    /// holder height FH. Give it again for further cutters.
    #[arg(long, value_name = "CR,CH,FR,FH", required_unless_present = "tools")]
    cutter: Vec<String>,
    /// Tool table: CSV with the columns CR, CH, FR, FH (mm) and, if you like, name, corner and
    /// clearance; the options --corner and --clearance are not about its tools.
    #[arg(long, value_name = "FILE")]
    tools: Option<PathBuf>,
    #[command(flatten)]
    tip: TipArgs,
}

/// What the four lengths of every `--cutter` do not say.
#[derive(clap::Args)]
struct TipArgs {
    /// Radius of the tip's corner: 0 is a flat end, CR (the default) a ball end.
    #[arg(long, value_name = "MM")]
    corner: Option<f64>,
    /// Safety margin all around the tool.
    #[arg(long, value_name = "MM", default_value_t = 0.0, allow_hyphen_values = true)]
    clearance: f64,
}

impl CutterArgs {
    pub fn tool(&self) -> Result<Tool> {
        self.tip.tool(&self.cutter)
    }
}

impl TipArgs {
    fn tool(&self, lengths: &str) -> Result<Tool> {
        Tool::new(cutter_params(lengths)?, self.corner, self.clearance)
    }
}

impl ToolArgs {
    /// Every `--cutter`, then the tools of the table; no two have the same name.
    pub fn tools(&self, output: &Output) -> Result<Vec<Tool>> {
        self.check_tip()?;
        let lengths = self.cutter.iter();
        let mut tools: Vec<Tool> = lengths.map(|l| self.tip.tool(l)).collect::<Result<_>>()?;
        if let Some(path) = &self.tools {
            let table = tools::read(path)?;
            if !table.unused.is_empty() {
                let columns = table.unused.join(", ");
                output.warn(format!("{}: columns not used: {columns}", path.display()));
            }
            tools.extend(table.tools);
        }
        let mut keys = HashSet::new();
        match tools.iter().find(|tool| !keys.insert(tool.folder_key())) {
            None => Ok(tools),
            Some(tool) => {
                let found = format!("`{}` twice", tool.name);
                let remedy = "leave one out, or give tools of a table names";
                Err(Error::argument("tool", found, "a name for one tool only", remedy))
            }
        }
    }

    /// Whether results go to a folder for each tool: a table's do, however short it is.
    pub fn are_several(&self) -> bool {
        self.tools.is_some() || self.cutter.len() > 1
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

/// Reads `CR,CH,FR,FH` in mm; whether the lengths make a cutter is asked by [`Cutter`].
pub fn cutter_params(text: &str) -> Result<CutterParams> {
    let lengths: Option<Vec<f64>> =
        text.split(',').map(|length| length.trim().parse().ok()).collect();
    let four = lengths.and_then(|lengths| <[f64; 4]>::try_from(lengths).ok());
    four.map(CutterParams::from_array).ok_or_else(|| {
        let expected = "four lengths in mm: CR,CH,FR,FH";
        Error::argument("--cutter", format!("`{text}`"), expected, "write for example 1.5,6,40,5")
    })
}

/// A file's name without its folder.
pub fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(|| "part".into(), |name| name.to_string_lossy().into_owned())
}

/// Which sites.
#[derive(clap::Args)]
pub struct SiteArgs {
    /// Number of sites spread over the mesh, or `vertices` to take the mesh's own corners.
    #[arg(long, value_name = "COUNT", default_value = "7000")]
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
}

impl SiteArgs {
    /// The sites of a part: spread over a mesh; a cloud is taken as it is.
    pub fn place(&self, part: Part) -> Result<(Option<Mesh>, Sites)> {
        let mesh = match part {
            Part::Mesh(mesh) => mesh,
            Part::Cloud(sites) => return Ok((None, sites)),
        };
        let sites = match self.sites.as_str() {
            "vertices" => sites::from_vertices(&mesh)?,
            count => {
                let n_sites = count.parse().map_err(|_| {
                    let expected = "a number, or `vertices`";
                    let found = format!("`{count}`");
                    Error::argument("--sites", found, expected, "the paper uses 7000")
                })?;
                let normals = self.normals()?;
                sites::sample(&mesh, &SiteOptions { n_sites, seed: self.seed, normals })?
            }
        };
        Ok((Some(mesh), sites))
    }

    fn normals(&self) -> Result<Normals> {
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

    pub fn settings(&self, has_mesh: bool) -> Value {
        match has_mesh {
            true => json!({ "sites": self.sites, "seed": self.seed, "smooth_deg": self.smooth }),
            false => json!({ "sites": "as given" }),
        }
    }
}

/// Which directions the tool may come from.
#[derive(clap::Args)]
pub struct DirectionArgs {
    /// COUNT or hemisphere:COUNT (upper half), sphere:COUNT, latlong:RINGSxCOUNT, cone:DEGREES:COUNT
    /// (around +z), circle:X,Y,Z:COUNT (across an axis), list:X,Y,Z;X,Y,Z;…, or up (+z alone)
    #[arg(long, value_name = "SET", default_value = "150")]
    directions: String,
}

impl DirectionArgs {
    pub fn directions(&self) -> Result<Directions> {
        let set = direction_set(&self.directions).ok_or_else(|| {
            let expected = "one of the forms that --help lists";
            let found = format!("`{}`", self.directions);
            Error::argument("--directions", found, expected, "write for example sphere:150")
        })?;
        Directions::new(set)
    }
}

fn direction_set(text: &str) -> Option<DirectionSet> {
    if text == "up" {
        return Some(Directions::up().set().clone());
    }
    let (kind, rest) = text.split_once(':').unwrap_or(("hemisphere", text));
    Some(match kind {
        "hemisphere" => DirectionSet::FibonacciHemisphere { n_dirs: rest.parse().ok()? },
        "sphere" => DirectionSet::FibonacciSphere { n_dirs: rest.parse().ok()? },
        "latlong" => {
            let (rings, around) = rest.split_once('x')?;
            let (n_polar, n_azimuth) = (rings.parse().ok()?, around.parse().ok()?);
            DirectionSet::LatLong { n_polar, n_azimuth }
        }
        "cone" => {
            let (angle, count) = rest.split_once(':')?;
            let half_angle_rad = angle.parse::<f64>().ok()?.to_radians();
            let n_dirs = count.parse().ok()?;
            DirectionSet::Cone { axis: [0.0, 0.0, 1.0], half_angle_rad, n_dirs }
        }
        "circle" => {
            let (axis, count) = rest.split_once(':')?;
            DirectionSet::Circle { axis: vector(axis)?, n_dirs: count.parse().ok()? }
        }
        "list" => {
            let vectors = rest.split(';').map(vector).collect::<Option<_>>()?;
            DirectionSet::List { vectors }
        }
        _ => return None,
    })
}

fn vector(text: &str) -> Option<[f64; 3]> {
    let parts: Option<Vec<f64>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    parts?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cutters_are_four_numbers() {
        assert_eq!(cutter_params("1.5, 6,40,5").unwrap().to_array(), [1.5, 6.0, 40.0, 5.0]);
        for text in ["", "1,2,3", "1,2,3,4,5", "1,2,3,x", "1;2;3;4"] {
            let message = cutter_params(text).unwrap_err().to_string();
            assert!(message.starts_with("--cutter is `") && message.contains("1.5,6,40,5"));
        }
    }

    #[test]
    fn every_form_of_directions_is_read() {
        for (text, n) in [
            ("150", 150),
            ("up", 1),
            ("hemisphere:7", 7),
            ("sphere:20", 20),
            ("latlong:3x8", 24),
            ("cone:30:12", 12),
            ("circle:1,0,0:36", 36),
            ("list:0,0,1;0,1,0", 2),
        ] {
            let args = DirectionArgs { directions: text.into() };
            assert_eq!(args.directions().unwrap().len(), n, "{text}");
        }
        for text in
            ["", "x", "sphere", "sphere:-1", "cone:30", "list:", "list:0,0", "circle:3", "0"]
        {
            assert!(DirectionArgs { directions: text.into() }.directions().is_err(), "{text}");
        }
    }
}
