//! `--vise`, `--table` and `--fixture` of `deepmill setups`: what holds the part.

use crate::args::{self, millimeters, name_of};
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::analysis::{Analysis, Fixture, SetupRequest, Vise};
use deepmill::{Error, Result};
use std::path::{Path, PathBuf};

/// What holds the part.
#[derive(Clone, clap::Args)]
pub struct HoldingArgs {
    /// A vise that grips two opposite flat faces, no farther apart than OPENING, by jaws that reach HEIGHT above what
    /// the part lies on: the bed, or PARALLELS that high (docs/setups.md#what-holds-the-part).
    #[arg(long, value_name = "JAW_WIDTH,OPENING,HEIGHT[,PARALLELS]", value_parser = vise)]
    vise: Option<Vise>,
    /// A square table in every setup, so far below the lowest place of the part (0: the part lies on it), and its
    /// width: twice the diagonal of the part's box without one.
    #[arg(long, value_name = "BELOW[,WIDTH]", allow_hyphen_values = true, value_parser = table)]
    table: Option<(f64, Option<f64>)>,
    /// A mesh that is in the way, in the part's coordinates: in every setup, or by a number before it in the first,
    /// second … that --setup gives, as 2:clamp.stl. May be given again.
    #[arg(long, value_name = "[SETUP:]FILE")]
    fixture: Vec<String>,
}

impl HoldingArgs {
    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.fixture.iter().map(|text| of_setup(text).1.into())
    }

    /// The analysis with the fixtures of all setups, the request with all else.
    pub fn add_to(
        &self,
        mut analysis: Analysis,
        mut request: SetupRequest,
        read: &MeshArgs,
        output: &Output,
    ) -> Result<(Analysis, SetupRequest)> {
        for text in &self.fixture {
            let (setup, path) = of_setup(text);
            let path = Path::new(path);
            let fixture = Fixture::new(name_of(path), read.read_fixture(path, output)?);
            match setup {
                Some(setup) => request = request.fixture_of(setup, fixture),
                None => analysis = analysis.fixture(fixture),
            }
        }
        let request = self.vise.into_iter().fold(request, SetupRequest::vise);
        let table =
            |request: SetupRequest, (below_mm, width_mm)| request.table_below(below_mm, width_mm);
        let request = self.table.into_iter().fold(request, table);
        Ok((analysis, request))
    }
}

/// The error, by the name of the option.
pub fn called(error: Error) -> Error {
    match error {
        Error::Argument { name: "vise", .. } => args::called(error, "--vise"),
        Error::Argument { name: "table", .. } => args::called(error, "--table"),
        Error::Argument { name: "fixture", .. } => args::called(error, "--fixture"),
        other => other,
    }
}

/// `2:clamp.stl` is of the second setup.
fn of_setup(text: &str) -> (Option<usize>, &str) {
    let numbered = text.split_once(':').and_then(|(setup, path)| Some((setup.parse().ok()?, path)));
    numbered.map_or((None, text), |(setup, path)| (Some(setup), path))
}

fn lengths(text: &str) -> std::result::Result<Vec<f64>, String> {
    text.split(',').map(millimeters).collect()
}

fn table(text: &str) -> std::result::Result<(f64, Option<f64>), String> {
    match lengths(text)?[..] {
        [below] => Ok((below, None)),
        [below, width] => Ok((below, Some(width))),
        ref all => Err(format!(
            "{} lengths, expected how far below, and perhaps a width: 20 or 20,400",
            all.len()
        )),
    }
}

fn vise(text: &str) -> std::result::Result<Vise, String> {
    let (lengths, parallels_mm) = match lengths(text)?[..] {
        [jaw, opening, height] => ([jaw, opening, height], 0.0),
        [jaw, opening, height, parallels] => ([jaw, opening, height], parallels),
        ref all => {
            return Err(format!(
                "{} lengths, expected jaw width, opening, height and perhaps parallels: write for example 100,60,15",
                all.len()
            ));
        }
    };
    Vise::new(lengths, parallels_mm).map_err(|error| error.to_string())
}
