//! The names of selectors in texts, as `--only` and `--except` have them.

use crate::answers::SiteAnswers;
use crate::data::files::LabelFile;
use crate::data::files::label_query::require_surface;
use crate::findings::{FINDINGS, Findings, for_all_tools};
use crate::geom::Mesh;
use crate::geom::formats;
use crate::geom::selection::Selector;
use crate::geom::units::{Length, Unit};
use crate::report::coverage;
use crate::report::folder::{REGION, SURFACE};
use crate::storage::input_file;
use crate::{Error, Result};
use glam::DVec3;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Degrees of `normal:` if none are given.
const NEAR_DEGREES: f64 = 10.0;

/// The selector that a text names, of an argument by its name: `box:X,Y,Z,X,Y,Z`, `normal:X,Y,Z:DEGREES`, `faces:FILE`
/// or `findings:DIR:NUMBERS`. Corners are about the origin of the part's coordinates; `read` reads the mesh of a file
/// in the part's.
///
/// # Errors
/// If the text is none of these, or a file cannot be read.
pub fn selector(
    text: &str,
    argument: &'static str,
    origin: Option<DVec3>,
    read: &dyn Fn(&Path) -> Result<Mesh>,
) -> Result<Selector> {
    let refused = |remedy: &str| {
        let expected = "box:X,Y,Z,X,Y,Z, normal:X,Y,Z:DEGREES, faces:FILE or findings:DIR:NUMBERS";
        Error::argument(argument, format!("`{text}`"), expected, remedy)
    };
    let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
    match kind {
        "box" => {
            let corners = numbers::<6>(rest, millimeters);
            let [a, b, c, d, e, f] =
                corners.ok_or_else(|| refused("write for example box:0,0,10,40,30,20"))?;
            let (a, b) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let origin = origin.unwrap_or_default();
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
        "faces" if !rest.is_empty() => read(Path::new(rest)).map(Selector::Faces),
        "findings" if !rest.is_empty() => {
            of_findings(rest, argument).map_err(|error| match error {
                Error::Argument { found, expected, remedy, .. } => {
                    Error::Argument { name: argument, found, expected, remedy }
                }
                other => other,
            })
        }
        _ => Err(refused("write for example box:0,0,10,40,30,20")),
    }
}

fn millimeters(text: &str) -> Option<f64> {
    let bare = text.trim().parse().ok();
    bare.or_else(|| Length::read(text).map(|length| length.mm(Unit::Millimeter)))
}

fn numbers<const N: usize>(text: &str, read: impl Fn(&str) -> Option<f64>) -> Option<[f64; N]> {
    let all: Vec<f64> = text.split(',').map(read).collect::<Option<_>>()?;
    all.try_into().ok().filter(|all: &[f64; N]| all.iter().all(|x| x.is_finite()))
}

/// `DIR` or `DIR:1,3`.
fn of_findings(text: &str, argument: &'static str) -> Result<Selector> {
    let ids = |text: &str| text.split(',').map(|id| id.trim().parse().ok()).collect();
    let with_ids = text.rsplit_once(':').and_then(|(dir, last)| {
        let ids: Option<Vec<u32>> = ids(last);
        ids.map(|ids| (dir, Some(ids)))
    });
    let (folder, ids) = with_ids.unwrap_or((text, None));
    let folder = Path::new(folder);
    let (LabelFile { sites, provenance, .. }, answers, of_region) = answers(folder)?;
    let path = folder.join(if of_region { REGION } else { SURFACE });
    let mesh = path.is_file().then(|| formats::read_mesh(&path, &Default::default()));
    let mesh = mesh.transpose()?;
    if let Some(mesh) = mesh.as_ref().filter(|_| !of_region) {
        require_surface((mesh, &path, true), (&sites, &provenance.settings, folder))?;
    }
    let found = Findings::of(&sites, mesh.as_ref(), &answers, &[])?;
    let path = folder.join(FINDINGS[0]);
    let stated = stated(&path)?;
    require_same(&stated, (&found, of_region), &path)?;
    let wanted = match ids {
        None => stated.clone(),
        Some(ids) => {
            let known = |id: &u32| stated.iter().find(|stated| stated.number == *id).copied();
            let missing = ids.iter().find(|id| known(id).is_none());
            if let Some(id) = missing {
                let (found, n) = (format!("finding {id}"), stated.len());
                let remedy = format!("{} has {n} findings", folder.display());
                return Err(Error::argument(argument, found, "the number of a finding", remedy));
            }
            ids.iter().filter_map(known).collect()
        }
    };
    let of = |site: u32| found.of_site.get(site as usize).copied().filter(|number| *number > 0);
    let numbers: Vec<u32> = wanted.iter().filter_map(|stated| of(stated.site)).collect();
    let chosen = found.of_site.iter().map(|number| numbers.contains(number)).collect();
    let spacing_mm = (found.surface_mm2 / sites.len().max(1) as f64).sqrt();
    Ok(Selector::Sites { sites, chosen, spacing_mm })
}

/// A finding of a file: its number, a site of it, and how many it has.
#[derive(Debug, Clone, Copy)]
struct Stated {
    number: u32,
    site: u32,
    n_sites: u32,
}

/// Refuses findings that are not those of the labels beside them: `setups` and `predict` write findings, too.
fn require_same(
    stated: &[Stated],
    (found, of_region): (&Findings, bool),
    path: &Path,
) -> Result<()> {
    let mut n_sites = BTreeMap::<u32, u32>::new();
    found.of_site.iter().for_each(|number| *n_sites.entry(*number).or_default() += 1);
    let is_found = |stated: &&Stated| {
        let number = found.of_site.get(stated.site as usize).filter(|number| **number > 0);
        // The surface of a region is read without the triangles of its sites: they may be joined otherwise.
        let is_as_large = |number: &u32| of_region || n_sites.get(number) == Some(&stated.n_sites);
        number.is_some_and(is_as_large)
    };
    let Some(other) = stated.iter().find(|stated| !is_found(stated)) else { return Ok(()) };
    let found = format!("finding {} is none of the labels beside it", other.number);
    let remedy = "label the part again: another command has written into the folder after `label`";
    Err(Error::file(path, "findings", found, remedy))
}

/// The findings of a file.
fn stated(path: &Path) -> Result<Vec<Stated>> {
    let remedy = "name a folder that `deepmill label` has written";
    let bad = |place: &str, found: String| Error::file(path, place, found, remedy);
    let bytes = input_file::read(path, input_file::TEXT).map_err(|e| bad("file", e.to_string()))?;
    let value: Value = serde_json::from_slice(&bytes).map_err(|e| bad("text", e.to_string()))?;
    let list = value["findings"].as_array().cloned().unwrap_or_default();
    let number = |value: &Value| value.as_u64().and_then(|n| u32::try_from(n).ok());
    let stated = list.iter().map(|one| {
        let of = |key: &str| number(&one[key]);
        Some(Stated { number: of("finding")?, site: of("site")?, n_sites: of("n_sites")? })
    });
    let stated: Option<Vec<_>> = stated.collect();
    stated.ok_or_else(|| bad("findings", "one has no number, site or n_sites".into()))
}

/// Labels of a folder of `deepmill label`, the answers, and whether they are of a region; of several tools, the first
/// one's, and what none of them reaches.
fn answers(folder: &Path) -> Result<(LabelFile, SiteAnswers, bool)> {
    const LABELS: &str = "labels.npz";
    let Some(folders) = coverage::labeled_tools(folder)? else {
        let mut file = LabelFile::read(&folder.join(LABELS))?;
        let of_region = take_region(&mut file);
        let answers = std::mem::take(&mut file.labels.answers);
        return Ok((file, answers, of_region));
    };
    let read = |(_, name): &(String, String)| LabelFile::read(&folder.join(name).join(LABELS));
    let mut files = folders.iter().map(read).collect::<Result<Vec<_>>>()?;
    let all = for_all_tools(files.iter().map(|file| &file.labels.answers));
    let of_region = take_region(&mut files[0]);
    Ok((files.swap_remove(0), all, of_region))
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
