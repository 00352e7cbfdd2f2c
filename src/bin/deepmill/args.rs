//! Arguments that several commands share: the cutter, the sites, the directions.

use crate::output::Output;
use deepmill::cutter::CutterParams;
use deepmill::data::files::tools::{self, Tool};
use deepmill::directions::Directions;
use deepmill::geom::formats::MeshOrCloud;
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
    #[arg(long, value_name = "CR,CH,FR,FH", allow_hyphen_values = true)]
    cutter: String,
    #[command(flatten)]
    tip: TipArgs,
}

/// Which cutters.
#[derive(clap::Args)]
pub struct ToolArgs {
    /// Lengths in mm: ball radius CR, height CH of the cylinder above the ball, holder radius FR,
    /// holder height FH. Give it again for further cutters.
    #[arg(
        long,
        value_name = "CR,CH,FR,FH",
        required_unless_present = "tools",
        allow_hyphen_values = true
    )]
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
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
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

/// Reads `CR,CH,FR,FH` in mm; whether the lengths make a cutter is checked by [`Cutter`].
fn cutter_params(text: &str) -> Result<CutterParams> {
    text.parse().map_err(|e| called(e, "--cutter"))
}

/// The error, of an argument by the name it has at the command line.
fn called(error: Error, option: &'static str) -> Error {
    match error {
        Error::Argument { found, expected, remedy, .. } => {
            Error::Argument { name: option, found, expected, remedy }
        }
        other => other,
    }
}

/// A file's name without its folder.
pub fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(|| "part".into(), |name| name.to_string_lossy().into_owned())
}

/// Which sites.
#[derive(clap::Args)]
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
}

impl SiteArgs {
    /// The sites of a part: spread over a mesh; a cloud is taken as it is.
    pub fn place(&self, part: MeshOrCloud) -> Result<(Option<Mesh>, Sites)> {
        let mesh = match part {
            MeshOrCloud::Mesh(mesh) => mesh,
            MeshOrCloud::Cloud(sites) => return Ok((None, sites)),
        };
        let sites = match self.sites.as_str() {
            "vertices" => sites::from_vertices(&mesh)?,
            count => {
                let n_sites = site_count(count)?;
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

/// A number of sites that can say something about each other.
fn site_count(text: &str) -> Result<usize> {
    text.parse().ok().filter(|n| *n >= 2).ok_or_else(|| {
        let expected = "2 or more, or `vertices`";
        Error::argument("--sites", format!("`{text}`"), expected, "the paper uses 7000")
    })
}

/// Which directions the tool may come from.
#[derive(clap::Args)]
pub struct DirectionArgs {
    /// COUNT or hemisphere:COUNT (upper half), sphere:COUNT, latlong:RINGSxCOUNT, cone:DEGREES:COUNT
    /// (around +z), circle:X,Y,Z:COUNT (across an axis), list:X,Y,Z;X,Y,Z;…, or up (+z alone)
    #[arg(long, value_name = "SET", default_value = "150", allow_negative_numbers = true)]
    directions: String,
}

impl DirectionArgs {
    pub fn directions(&self) -> Result<Directions> {
        self.directions.parse().map_err(|e| called(e, "--directions"))
    }
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
}
