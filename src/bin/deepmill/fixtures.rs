//! Fixtures and the table: what is wrong with them, and what they keep out of reach.

use crate::args::name_of;
use crate::output::Output;
use deepmill::Result;
use deepmill::access::Labels;
use deepmill::access::surface::{SiteAnswer, SurfaceOptions, TriangleObstacles};
use deepmill::data::files::tools::Tool;
use deepmill::directions::Directions;
use deepmill::geom::check::{self, Fault};
use deepmill::geom::{Mesh, Sites, bodies};
use deepmill::report::findings::{Findings, add_fixtures};
use deepmill::report::gate::SiteAreas;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A fixture may share this of the part's volume: roundings of faces that lie on each other.
const ROUNDING: f64 = 1e-6;

/// Warns of a fixture that is open, overlaps the part, or encloses it.
pub fn warn(path: &Path, part: &Mesh, fixture: &Mesh, output: &Output) -> Result<()> {
    let name = name_of(path);
    let n_open = check::check(fixture).count(Fault::OpenEdge);
    if n_open > 0 {
        output.warn(format!(
            "{name} is open ({n_open} edges with one triangle): it blocks where its triangles are, its inside does not, \
             and whether it overlaps the part is not known"
        ));
        return Ok(());
    }
    let Some(overlap) = bodies::overlap(part, fixture)? else { return Ok(()) };
    let (common, share) = (overlap.common_mm3, overlap.share_of_part);
    if overlap.encloses {
        output.warn(format!(
            "{name} encloses the part: no tool reaches it; check its place and unit"
        ));
    }
    if share > ROUNDING {
        output.warn(format!(
            "{name} overlaps the part by {common:.2} mm³ ({:.3} % of it): what is inside the fixture counts as out of \
             reach; check its place and unit",
            100.0 * share
        ));
    }
    Ok(())
}

/// What fixtures keep each tool from.
pub struct Kept {
    names: Vec<String>,
    /// Per tool and site: the number of the name of what keeps the tool off, if the part alone does not.
    by_tool: Vec<Vec<Option<usize>>>,
}

impl Kept {
    /// Labels what is not accessible again without each of the fixtures, and without all.
    pub fn find(
        paths: &[PathBuf],
        (mesh, fixtures): (&Mesh, &[Mesh]),
        (sites, labels): (&Sites, &[Labels]),
        tools: &[Tool],
        (directions, options): (&Directions, &SurfaceOptions),
    ) -> Result<Self> {
        let mut names: Vec<String> = paths.iter().map(|path| name_of(path)).collect();
        names.extend((fixtures.len() > paths.len()).then(|| "table".to_string()));
        let options = SurfaceOptions { occlusion: false, clearance_limit_mm: None, ..*options };
        let mut without: Vec<TriangleObstacles> = Vec::new();
        if fixtures.len() > 1 {
            for k in 0..fixtures.len() {
                let others: Vec<Mesh> = [&fixtures[..k], &fixtures[k + 1..]].concat();
                without.push(TriangleObstacles::new(mesh, &others)?);
            }
            names.push("several fixtures".into());
        }
        if !fixtures.is_empty() {
            without.push(TriangleObstacles::new(mesh, &[])?);
        }
        let of_tool = |(tool, labels): (&Tool, &Labels)| {
            let mut kept_by = vec![None; sites.len()];
            for (k, obstacles) in without.iter().enumerate() {
                let accessible = labels.answers.accessible();
                let rows = (0..sites.len()).filter(|&i| !accessible[i] && kept_by[i].is_none());
                let rows: Vec<usize> = rows.collect();
                if rows.is_empty() {
                    break;
                }
                let points = rows.iter().map(|&i| sites.points[i]).collect();
                let left = Sites::new(points, rows.iter().map(|&i| sites.normals[i]).collect())?;
                let again = obstacles.label(&left, &tool.cutter, directions, &options)?;
                for (row, answer) in rows.into_iter().zip(again.answers) {
                    if answer == SiteAnswer::Accessible {
                        kept_by[row] = Some(k);
                    }
                }
            }
            Ok(kept_by)
        };
        let by_tool = tools.iter().zip(labels).map(of_tool).collect::<Result<_>>()?;
        Ok(Kept { names, by_tool })
    }

    /// Names the fixtures in the findings of each tool.
    pub fn add_to(&self, findings: &mut [Findings]) {
        for (found, kept_by) in findings.iter_mut().zip(&self.by_tool) {
            add_fixtures(found, &self.names, kept_by);
        }
    }

    /// Says what each fixture keeps out of reach; as JSON for the result.
    pub fn say(&self, tools: &[Tool], areas: &SiteAreas, output: &Output) -> Value {
        let mut rows = Vec::new();
        for (tool, kept_by) in tools.iter().zip(&self.by_tool) {
            let of = if tools.len() > 1 { format!("{}: ", tool.name) } else { String::new() };
            for (k, name) in self.names.iter().enumerate() {
                let share = areas.share(|i| kept_by[i] == Some(k));
                if share > 0.0 {
                    output.say(format!(
                        "{of}{name} keeps {:.2} % of the surface out of reach",
                        100.0 * share
                    ));
                }
                rows.push(json!({ "tool": tool.name, "fixture": name, "keeps_out": share }));
            }
        }
        json!(rows)
    }
}
