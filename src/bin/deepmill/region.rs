//! `--only` and `--except`: the region of interest.

use crate::args::{SiteArgs, called, millimeters};
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use crate::progress::Bars;
use deepmill::analysis::{Analysis, Placed};
use deepmill::answers::SiteAnswers;
use deepmill::data::files::LabelFile;
use deepmill::data::files::label_query::SURFACE;
use deepmill::data::files::settings::RegionSettings;
use deepmill::geom::Sites;
use deepmill::geom::formats;
use deepmill::geom::selection::{Selection, Selector};
use deepmill::report::coverage;
use deepmill::report::findings::{FINDINGS, Findings, for_all_tools};
use deepmill::report::folder::REGION;
use deepmill::{Error, Result};
use glam::DVec3;
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

/// Degrees of `normal:` if none are given.
const NEAR_DEGREES: f64 = 10.0;

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
            let read = |text: &String| selector(text, option, read, output);
            texts.iter().map(read).collect::<Result<Vec<Selector>>>()
        };
        Ok(Selection { only: all(&self.only, "--only")?, except: all(&self.except, "--except")? })
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

fn selector(
    text: &str,
    option: &'static str,
    read: &MeshArgs,
    output: &Output,
) -> Result<Selector> {
    let refused = |remedy: &str| {
        let expected = "box:X,Y,Z,X,Y,Z, normal:X,Y,Z:DEGREES, faces:FILE or findings:DIR:NUMBERS";
        Error::argument(option, format!("`{text}`"), expected, remedy)
    };
    let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
    match kind {
        "box" => {
            let corners = numbers::<6>(rest, |text| millimeters(text).ok());
            let [a, b, c, d, e, f] =
                corners.ok_or_else(|| refused("write for example box:0,0,10,40,30,20"))?;
            let (a, b) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let origin = read.origin().unwrap_or_default();
            Ok(Selector::Box { low: a.min(b) - origin, high: a.max(b) - origin })
        }
        "normal" => {
            let (direction, degrees) = rest.split_once(':').unwrap_or((rest, ""));
            let near = if degrees.is_empty() { Some(NEAR_DEGREES) } else { degrees.parse().ok() };
            let direction = numbers::<3>(direction, |text| text.trim().parse().ok());
            let near = near.filter(|near: &f64| (0.0..=180.0).contains(near));
            let (Some(direction), Some(near)) = (direction, near) else {
                return Err(refused("write for example normal:0,0,1:10"));
            };
            let direction = DVec3::from_array(direction);
            Ok(Selector::Normal { direction, within_rad: near.to_radians() })
        }
        "faces" if !rest.is_empty() => {
            read.read_selected(Path::new(rest), output).map(Selector::Faces)
        }
        "findings" if !rest.is_empty() => {
            of_findings(rest, option).map_err(|error| called(error, option))
        }
        _ => Err(refused("write for example box:0,0,10,40,30,20")),
    }
}

fn numbers<const N: usize>(text: &str, read: impl Fn(&str) -> Option<f64>) -> Option<[f64; N]> {
    let all: Vec<f64> = text.split(',').map(read).collect::<Option<_>>()?;
    all.try_into().ok().filter(|all: &[f64; N]| all.iter().all(|x| x.is_finite()))
}

/// `DIR` or `DIR:1,3`.
fn of_findings(text: &str, option: &'static str) -> Result<Selector> {
    let ids = |text: &str| text.split(',').map(|id| id.trim().parse().ok()).collect();
    let with_ids = text.rsplit_once(':').and_then(|(dir, last)| {
        let ids: Option<Vec<u32>> = ids(last);
        ids.map(|ids| (dir, Some(ids)))
    });
    let (folder, ids) = with_ids.unwrap_or((text, None));
    let folder = Path::new(folder);
    let (sites, answers, of_region) = answers(folder)?;
    let path = folder.join(if of_region { REGION } else { SURFACE });
    let mesh = path.is_file().then(|| formats::read_mesh(&path, &Default::default()));
    let mesh = mesh.transpose()?;
    let found = Findings::of(&sites, mesh.as_ref(), &answers, &[])?;
    let stated = stated(&folder.join(FINDINGS[0]))?;
    let wanted = match ids {
        None => stated.clone(),
        Some(ids) => {
            let known = |id: &u32| stated.iter().find(|(number, _)| number == id).copied();
            let missing = ids.iter().find(|id| known(id).is_none());
            if let Some(id) = missing {
                let (found, n) = (format!("finding {id}"), stated.len());
                let remedy = format!("{} has {n} findings", folder.display());
                return Err(Error::argument(option, found, "the number of a finding", remedy));
            }
            ids.iter().filter_map(known).collect()
        }
    };
    let of = |site: u32| found.of_site.get(site as usize).copied().filter(|number| *number > 0);
    let numbers: Vec<u32> = wanted.iter().filter_map(|(_, site)| of(*site)).collect();
    let chosen = found.of_site.iter().map(|number| numbers.contains(number)).collect();
    let spacing_mm = (found.surface_mm2 / sites.len().max(1) as f64).sqrt();
    Ok(Selector::Sites { sites, chosen, spacing_mm })
}

/// The numbers of the findings of a file, and a site of each.
fn stated(path: &Path) -> Result<Vec<(u32, u32)>> {
    let remedy = "name a folder that `deepmill label` has written";
    let bad = |place: &str, found: String| Error::file(path, place, found, remedy);
    let bytes = std::fs::read(path).map_err(|e| bad("file", e.to_string()))?;
    let value: Value = serde_json::from_slice(&bytes).map_err(|e| bad("text", e.to_string()))?;
    let list = value["findings"].as_array().cloned().unwrap_or_default();
    let number = |value: &Value| value.as_u64().and_then(|n| u32::try_from(n).ok());
    let pairs = list.iter().map(|one| Some((number(&one["finding"])?, number(&one["site"])?)));
    let pairs: Option<Vec<_>> = pairs.collect();
    pairs.ok_or_else(|| bad("findings", "one has no number or site".into()))
}

/// Sites and answers of a folder of `deepmill label`; of several tools, what none of them reaches.
fn answers(folder: &Path) -> Result<(Sites, SiteAnswers, bool)> {
    const LABELS: &str = "labels.npz";
    let alone = folder.join(LABELS);
    if alone.is_file() || !folder.join("tools.csv").is_file() {
        let mut file = LabelFile::read(&alone)?;
        let of_region = take_region(&mut file);
        return Ok((file.sites, file.labels.answers, of_region));
    }
    let folders = coverage::tool_folders(folder)?;
    let read = |(_, name): &(String, String)| LabelFile::read(&folder.join(name).join(LABELS));
    let mut files = folders.iter().map(read).collect::<Result<Vec<_>>>()?;
    let all = for_all_tools(files.iter().map(|file| &file.labels.answers));
    let of_region = take_region(&mut files[0]);
    Ok((files.swap_remove(0).sites, all, of_region))
}

/// Whether the labels are of a region, of which the surface is beside them; the sites' faces, which are those of the
/// part, are left out then.
pub fn take_region(file: &mut LabelFile) -> bool {
    let of_region = file.provenance.settings.region.is_some();
    if of_region {
        file.sites.faces.clear();
    }
    of_region
}
