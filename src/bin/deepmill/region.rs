//! `--only` and `--except`: the region of interest.

use crate::args::{SiteArgs, called};
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use crate::progress::Bars;
use deepmill::analysis::{Analysis, Placed, selector};
use deepmill::data::files::settings::RegionSettings;
use deepmill::geom::selection::{Selection, Selector};
use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The region of interest.
#[derive(Clone, clap::Args)]
pub struct RegionArgs {
    /// Answer for these faces only; all of the part blocks as before. Areas and shares are of this region.
    /// box:X,Y,Z,X,Y,Z (two corners, mm), normal:X,Y,Z or normal:X,Y,Z:DEGREES (outward normals within 10 degrees of a
    /// direction), faces:FILE (a mesh of the selected faces, such as a PLY), findings:DIR or findings:DIR:1,3 (what
    /// `deepmill label` has found out of reach). Give it again for further ones: what any of them holds.
    #[arg(long, value_name = "FACES", allow_hyphen_values = true)]
    only: Vec<String>,
    /// Leave these faces out; as --only.
    #[arg(long, value_name = "FACES", allow_hyphen_values = true)]
    except: Vec<String>,
}

impl RegionArgs {
    /// Whether there is a region.
    pub fn is_given(&self) -> bool {
        !self.only.is_empty() || !self.except.is_empty()
    }

    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let file = |text: &String| match text.split_once(':') {
            Some(("faces", file)) => Some(file.into()),
            _ => None,
        };
        self.only.iter().chain(&self.except).filter_map(file)
    }

    /// For what a region cannot be of.
    pub fn refuse(&self, found: &'static str, remedy: &'static str) -> Result<()> {
        match self.is_given() {
            false => Ok(()),
            true => Err(Error::argument("--only, --except", found, "triangles that block", remedy)),
        }
    }

    /// Places the sites of an analysis, on the region if there is one; says what is wrong with fixtures and table.
    pub fn place(
        &self,
        analysis: Analysis,
        sites: &SiteArgs,
        read: &MeshArgs,
        output: &Output,
    ) -> Result<Placed> {
        let mut analysis = sites.add_to(analysis)?;
        if self.is_given() {
            let selection = self.selection(read, output)?;
            analysis = analysis.region(selection, self.only.clone(), self.except.clone());
        }
        let placed = analysis.place(&mut Bars::default()).map_err(|error| match error {
            Error::Argument { name: "region", .. } => called(error, "--only, --except"),
            Error::Argument { name: "table", .. } => called(error, "--table"),
            other => other,
        })?;
        placed.warnings().iter().for_each(|warning| output.warn(warning));
        Ok(placed)
    }

    /// The faces that are named.
    fn selection(&self, read: &MeshArgs, output: &Output) -> Result<Selection> {
        let all = |texts: &[String], option: &'static str| {
            let file = |path: &Path| read.read_selected(path, output);
            let named = |text: &String| selector(text, option, read.origin(), &file);
            texts.iter().map(named).collect::<Result<Vec<Selector>>>()
        };
        Ok(Selection::default()
            .with_only(all(&self.only, "--only")?)
            .with_except(all(&self.except, "--except")?))
    }
}

/// Says a region; adds it to the result.
pub fn say(region: Option<RegionSettings>, result: &mut Value, output: &Output) {
    let Some(region) = region else { return };
    let words = |name: &str, texts: &[String]| match texts {
        [] => String::new(),
        texts => format!("{name} {}, ", texts.join(" and ")),
    };
    output.say(format!(
        "region: {}{}{:.1} of {:.1} mm² ({:.2} %); areas and shares are of it",
        words("only", &region.only),
        words("except", &region.except),
        region.area_mm2,
        region.part_area_mm2,
        100.0 * region.area_mm2 / region.part_area_mm2
    ));
    result["region"] = json!(region);
}
