//! Findings: the regions of a part that a cutter cannot reach, the largest first.
//!
//! Sites with the same answer, *inaccessible* or *tip does not fit*, that are connected along the surface
//! ([`geom::regions`](crate::geom::regions)) are a region. A region of at least [`MIN_SITES`] sites is a [`Finding`];
//! the smaller ones are summed as [`Scattered`], so that all areas together are the area that is not accessible.

mod advice;
pub mod baseline;
mod checked;
mod columns;
mod fixtures;
pub mod gate;
mod ids;
mod together;

use crate::answers::{SiteAnswer, SiteAnswers};
use crate::data::files::Provenance;
use crate::exec::memory::{product, require};
use crate::geom::units::Unit;
use crate::geom::{Mesh, Sites, regions, spacing};
use crate::storage::atomic_file;
use crate::tool::cutter::ToolPart;
use crate::{Error, Result};
pub use advice::ToolChange;
#[doc(hidden)] // of the page and the program
pub use advice::{Opening, PartAdvice, openings_words, part_change_words};
pub use fixtures::InTheWay;
#[doc(hidden)] // of `analysis`
pub use fixtures::add_fixtures;
use glam::DVec3;
pub(super) use ids::untaken;
#[doc(hidden)] // of `analysis` and the program
pub use ids::{ALL_TOOLS, Bounds, FindingStatus, bounds_of};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
#[doc(hidden)] // of `analysis` and the program
pub use together::for_all_tools;

/// Regions of fewer sites are not listed one by one.
#[doc(hidden)] // of `analysis` and the program
pub const MIN_SITES: usize = 4;
/// Names of the files beside the answers.
#[doc(hidden)] // of `analysis` and the program
pub const FINDINGS: [&str; 2] = ["findings.json", "findings.csv"];
/// Version of the JSON file.
const VERSION: u64 = 1;

/// A region that is not accessible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Finding {
    /// A name that other sites, another order and small changes of the part do not change: see `docs/pipeline.md`.
    pub id: String,
    /// What a baseline makes of it, if it was held against one.
    pub status: Option<FindingStatus>,
    /// Why it is known, of the baseline; empty if nobody has given a reason.
    #[doc(hidden)] // of the table
    pub reason: Option<String>,
    /// Since when it is known: the date of the baseline.
    #[doc(hidden)] // of the table
    pub since: Option<String>,
    /// The answer of all its sites.
    pub cause: SiteAnswer,
    /// Estimated area, mm²: the sum of those that its sites stand for.
    pub area_mm2: f64,
    /// That area as a share of the surface.
    pub area_share: f64,
    /// Number of sites.
    pub n_sites: usize,
    /// The site nearest to the mean place of the region.
    pub site: u32,
    /// Where that site is, mm.
    pub at_mm: DVec3,
    /// Mean outward normal; zero if the normals cancel.
    pub normal: DVec3,
    /// Least corner of the box about its sites, mm.
    pub low_mm: DVec3,
    /// Greatest corner of that box, mm.
    pub high_mm: DVec3,
    /// Least clearance of its sites, mm, if clearances were computed.
    pub worst_clearance_mm: Option<f32>,
    /// Greatest rest of its sites, mm, if rests were computed.
    pub greatest_rest_mm: Option<f32>,
    /// Volume of what is left about its sites, mm³, if rests were computed.
    pub left_mm3: Option<f64>,
    /// Share of its sites that are proven out of reach for every direction, if that was tested.
    #[doc(hidden)] // of the table
    pub proven: Option<f64>,
    /// The tool that reaches most of its area, if several were labeled and one reaches any.
    pub helps: Option<Help>,
    /// The part of the tool that blocks most of its sites, in the direction which gets furthest, if that was computed
    /// ([`surface::explain`](crate::access::surface::explain)).
    pub blocked_by: Option<ToolPart>,
    /// Share of its sites that this part blocks.
    #[doc(hidden)] // of the table
    pub blocked_share: Option<f64>,
    /// The fixture without which the tool reaches most of its sites, if one keeps the tool off.
    pub fixture: Option<InTheWay>,
    /// A change of the tool that helps, if one was looked for.
    pub change: Option<ToolChange>,
    /// What would help and is not proposed, in words: a stick-out beyond the overall length, or, if no change is
    /// proposed, one that is too slender.
    #[doc(hidden)] // of the table
    pub stopped: Option<String>,
    /// Changes of the part that help, the one that frees most first, if they were looked for.
    #[doc(hidden)] // of the page and the program
    pub advice: Vec<PartAdvice>,
    /// Box axes that were not tested and along which it is reached, the one that reaches most first, if they were
    /// looked for.
    #[doc(hidden)] // of the page and the program
    pub opens: Vec<Opening>,
    /// Mean place of its sites, mm.
    middle_mm: DVec3,
}

/// Another tool that reaches a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Help {
    /// The tool's name.
    pub tool: String,
    /// Share of the region's area that it reaches.
    pub share: f64,
}

/// The regions of fewer than [`MIN_SITES`] sites, together.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
#[doc(hidden)] // of the table
pub struct Scattered {
    /// Number of regions.
    pub n_regions: usize,
    /// Their sites.
    pub n_sites: usize,
    /// Their area, mm².
    pub area_mm2: f64,
}

/// What of a part is not accessible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")] // checked when they are read
#[non_exhaustive]
pub struct Findings {
    /// The regions, largest area first; among equals, the one with the lowest site first.
    pub list: Vec<Finding>,
    /// The small regions.
    #[doc(hidden)] // of `analysis` and the program, as its type
    pub scattered: Scattered,
    /// Area of the surface, mm²: the mesh's, or an estimate from the sites.
    pub surface_mm2: f64,
    /// Area of the largest region of all, listed or scattered, mm²; 0 if everything is accessible.
    #[doc(hidden)] // of the program
    pub largest_mm2: f64,
    /// The largest region of all.
    #[doc(hidden)] // of the program
    pub largest: Option<Finding>,
    /// The region of all about which most is left, if rests were computed.
    #[doc(hidden)] // of the program
    pub most_left: Option<Finding>,
    /// Per site: the number of its finding from 1 on, 0 if it has none.
    pub of_site: Vec<u32>,
    /// The sites of the small regions, ascending.
    #[doc(hidden)] // of baselines
    pub scattered_sites: Vec<u32>,
    /// Whether they were held against a baseline.
    #[doc(hidden)] // of gates
    pub are_held: bool,
}

/// A tool that was labeled too: its name, and per site whether it is accessible.
#[doc(hidden)] // of `analysis` and the program
pub type Other<'a> = (&'a str, &'a [bool]);

impl Findings {
    /// The findings of `answers` about `sites`, which lie on `mesh` if there is one; `others` are tools that may help.
    ///
    /// # Errors
    /// If the sites fail [`Sites::check`], the answers are not as many, or they do not fit into the memory.
    #[doc(hidden)] // of `analysis`
    pub fn of(
        sites: &Sites,
        mesh: Option<&Mesh>,
        answers: &SiteAnswers,
        others: &[Other],
    ) -> Result<Self> {
        let n = sites.len();
        if answers.len() != n || others.iter().any(|(_, reached)| reached.len() != n) {
            let (found, remedy) = (answers.len(), "give the sites of the answers");
            return Err(Error::argument("number of answers", found, format!("{n}"), remedy));
        }
        require_for_regions(mesh, sites)?;
        let areas = spacing::areas_on(sites, mesh)?;
        let marks: Vec<Option<u8>> = (0..n).map(|i| cause(answers, i).map(|c| c as u8)).collect();
        let region = regions::regions(sites, mesh, &areas, &marks)?;
        let mut members: Vec<(u32, u32)> =
            (0..n as u32).filter_map(|i| region[i as usize].map(|r| (r, i))).collect();
        members.sort_unstable();
        require_for_findings(members.chunk_by(|a, b| a.0 == b.0).count())?;
        let surface_mm2 = areas.iter().sum();
        let about = About { sites, answers, others, areas: &areas, surface_mm2 };
        let mut all: Vec<(Finding, Vec<u32>)> = members
            .chunk_by(|a, b| a.0 == b.0)
            .map(|chunk| chunk.iter().map(|(_, i)| *i).collect::<Vec<u32>>())
            .map(|members| (about.finding(&members), members))
            .collect();
        // A stable sort: equal areas stay in the order of their first sites.
        all.sort_by(|a, b| b.0.area_mm2.total_cmp(&a.0.area_mm2));
        let largest = all.first().map(|(finding, _)| finding.clone());
        let largest_mm2 = largest.as_ref().map_or(0.0, |finding| finding.area_mm2);
        let left = all.iter().map(|(finding, _)| finding).filter(|f| f.left_mm3.is_some());
        let more = |a: &Finding, b: &Finding| a.left_mm3 > b.left_mm3;
        let most_left = left.reduce(|most, f| if more(f, most) { f } else { most }).cloned();
        let (list, small): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|(finding, _)| finding.n_sites >= MIN_SITES);
        let mut of_site = vec![0; n];
        for (number, (_, members)) in (1..).zip(&list) {
            members.iter().for_each(|&i| of_site[i as usize] = number);
        }
        let scattered = Scattered {
            n_regions: small.len(),
            n_sites: small.iter().map(|(finding, _)| finding.n_sites).sum(),
            area_mm2: small.iter().map(|(finding, _)| finding.area_mm2).sum(),
        };
        let mut scattered_sites: Vec<u32> =
            small.iter().flat_map(|(_, members)| members).copied().collect();
        scattered_sites.sort_unstable();
        let list = list.into_iter().map(|(finding, _)| finding).collect();
        let mut found = Findings {
            list,
            scattered,
            surface_mm2,
            largest_mm2,
            largest,
            most_left,
            of_site,
            scattered_sites,
            are_held: false,
        };
        found.identify("", bounds_of(mesh, sites));
        Ok(found)
    }

    /// Everything, as `findings.json` holds it.
    #[doc(hidden)] // a type of `serde_json`
    pub fn json(&self) -> Value {
        let list = (1..).zip(&self.list).map(|(number, finding): (u32, _)| {
            let mut value = json!(finding);
            value["finding"] = json!(number);
            value
        });
        json!({
            "surface_mm2": self.surface_mm2,
            "largest_mm2": self.largest_mm2,
            "most_left_mm3": self.most_left.as_ref().and_then(|finding| finding.left_mm3),
            "findings": list.collect::<Vec<_>>(),
            "scattered": { "fewer_sites_than": MIN_SITES, "regions": self.scattered },
        })
    }

    /// Writes `findings.json` and `findings.csv`; returns their paths.
    ///
    /// # Errors
    /// If they do not fit into the memory, or the system refuses a file.
    pub fn write(
        &self,
        folder: &Path,
        (part, tool): (&str, &str),
        unit: Unit,
    ) -> Result<Vec<PathBuf>> {
        require_for_findings_files(self.list.len())?;
        let mut value = json!({
            "format": "deepmill findings",
            "version": VERSION,
            "program": Provenance::PROGRAM,
            "unit": "mm",
            "part": part,
            "cutter": tool,
        });
        if let (Value::Object(file), Value::Object(own)) = (&mut value, self.json()) {
            file.extend(own);
        }
        let text = format!("{value:#}\n").into_bytes();
        let paths = FINDINGS.map(|name| folder.join(name));
        for (path, bytes) in paths.iter().zip([text, self.table().csv_in(unit)]) {
            atomic_file::write_atomic(path, |file| file.write_all(&bytes))?;
        }
        Ok(paths.into())
    }
}

/// A site while regions are found: trees and lists.
const REGION_SITE_BYTES: usize = 256;
/// A triangle: its neighbors and the edges that they are found by.
const REGION_TRIANGLE_BYTES: usize = 64;
/// A finding as JSON.
pub(crate) const FINDING_JSON_BYTES: usize = 4096;
/// A finding, while all are listed, sorted and parted.
const FINDING_BYTES: usize = 4 * size_of::<Finding>();

/// Regions of sites, before their number is known.
fn require_for_regions(mesh: Option<&Mesh>, sites: &Sites) -> Result<()> {
    let of_sites = product([sites.len(), REGION_SITE_BYTES]);
    let n_triangles = mesh.map_or(0, |mesh| mesh.triangles.len());
    let needed = of_sites.saturating_add(product([n_triangles, REGION_TRIANGLE_BYTES]));
    require("finding the regions", needed, "take fewer sites")
}

/// The findings of so many regions.
fn require_for_findings(n_regions: usize) -> Result<()> {
    require("the findings", product([n_regions, FINDING_BYTES]), "take fewer sites")
}

/// The files of so many findings.
fn require_for_findings_files(n_findings: usize) -> Result<()> {
    let needed = product([n_findings, FINDING_JSON_BYTES]);
    require("writing the findings", needed, "take fewer sites")
}

/// Why a site is not accessible; `None` if it is.
fn cause(answers: &SiteAnswers, i: usize) -> Option<SiteAnswer> {
    Some(answers.of(i)).filter(|answer| *answer != SiteAnswer::Accessible)
}

impl Finding {
    /// The cause in words.
    pub fn words(&self) -> &'static str {
        cause_words(self.cause)
    }
}

/// A cause in words.
pub(super) fn cause_words(cause: SiteAnswer) -> &'static str {
    match cause {
        SiteAnswer::TipDoesNotFit => "tip does not fit",
        _ => "inaccessible",
    }
}

/// What a finding is made from.
struct About<'a> {
    sites: &'a Sites,
    answers: &'a SiteAnswers,
    others: &'a [Other<'a>],
    areas: &'a [f64],
    surface_mm2: f64,
}

impl About<'_> {
    /// Of the sites `members`, ascending and not none.
    fn finding(&self, members: &[u32]) -> Finding {
        let About { sites, answers, areas, .. } = self;
        let place = |i: u32| sites.points[i as usize].as_dvec3();
        let (mut area_mm2, mut middle, mut normal) = (0.0, DVec3::ZERO, DVec3::ZERO);
        let (mut low_mm, mut high_mm) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &i in members {
            let (p, area) = (place(i), areas[i as usize]);
            area_mm2 += area;
            middle += p / members.len() as f64;
            normal += sites.normals[i as usize].as_dvec3() / members.len() as f64;
            (low_mm, high_mm) = (low_mm.min(p), high_mm.max(p));
        }
        let distance = |i: &u32| place(*i).distance_squared(middle);
        let nearest = members.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let site = nearest.copied().unwrap_or_default();
        let clearance = |i: &u32| answers.clearance_mm.get(*i as usize).copied();
        let rest = |i: &u32| answers.rest_mm.get(*i as usize).copied();
        let volume = |i: &u32| answers.rest_volume_mm3.get(*i as usize).copied().map(f64::from);
        let cancels = normal.length() < 1e-3;
        Finding {
            id: String::new(),
            status: None,
            reason: None,
            since: None,
            middle_mm: middle,
            cause: cause(answers, members[0] as usize).unwrap_or(SiteAnswer::Inaccessible),
            area_mm2,
            area_share: if self.surface_mm2 > 0.0 { area_mm2 / self.surface_mm2 } else { 0.0 },
            n_sites: members.len(),
            site,
            at_mm: place(site),
            normal: if cancels { DVec3::ZERO } else { normal.normalize() },
            low_mm,
            high_mm,
            worst_clearance_mm: members.iter().filter_map(clearance).reduce(f32::min),
            greatest_rest_mm: members.iter().filter_map(rest).reduce(f32::max),
            left_mm3: members.iter().filter_map(volume).reduce(|a, b| a + b),
            proven: None,
            helps: self.help(members, area_mm2),
            blocked_by: None,
            blocked_share: None,
            fixture: None,
            change: None,
            stopped: None,
            advice: Vec::new(),
            opens: Vec::new(),
        }
    }

    fn help(&self, members: &[u32], area_mm2: f64) -> Option<Help> {
        let reached = |(_, accessible): &Other| -> f64 {
            let reached = members.iter().filter(|&&i| accessible[i as usize]);
            reached.map(|&i| self.areas[i as usize]).sum()
        };
        let mut best: Option<(f64, &str)> = None;
        for other in self.others {
            let area = reached(other);
            if area > best.map_or(0.0, |(most, _)| most) {
                best = Some((area, other.0));
            }
        }
        best.map(|(area, tool)| Help { tool: tool.into(), share: (area / area_mm2).min(1.0) })
    }
}

/// Adds to every finding which share of its sites is proven out of reach for every direction: those of which no
/// direction is open.
///
/// # Panics
/// If `open_directions` has not one entry per site.
#[doc(hidden)] // of `analysis` and the program
pub fn add_proofs(findings: &mut Findings, open_directions: &[f32]) {
    assert_eq!(open_directions.len(), findings.of_site.len(), "one entry per site");
    let mut proven = vec![0usize; findings.list.len()];
    for (number, open) in findings.of_site.iter().zip(open_directions) {
        if *number > 0 && *open == 0.0 {
            proven[*number as usize - 1] += 1;
        }
    }
    for (finding, proven) in findings.list.iter_mut().zip(proven) {
        finding.proven = Some(proven as f64 / finding.n_sites as f64);
    }
}

/// Adds to every finding the part of the tool that blocks most of its sites; the lowest among equals. Nothing if that
/// was not computed.
///
/// # Panics
/// If `blocked_by` is not empty and has not one entry per site.
#[doc(hidden)] // of `analysis` and the program
pub fn add_blocking_parts(findings: &mut Findings, blocked_by: &[Option<ToolPart>]) {
    if blocked_by.is_empty() {
        return;
    }
    assert_eq!(blocked_by.len(), findings.of_site.len(), "one entry per site");
    let mut counts = vec![[0usize; ToolPart::ALL.len()]; findings.list.len()];
    for (number, part) in findings.of_site.iter().zip(blocked_by) {
        if let (1.., Some(part)) = (*number, part) {
            counts[*number as usize - 1][*part as usize] += 1;
        }
    }
    for (finding, counts) in findings.list.iter_mut().zip(counts) {
        let most = counts.iter().copied().max().unwrap_or(0);
        let part = ToolPart::ALL.into_iter().find(|part| counts[*part as usize] == most);
        finding.blocked_by = part.filter(|_| most > 0);
        finding.blocked_share = finding.blocked_by.map(|_| most as f64 / finding.n_sites as f64);
    }
}

#[cfg(test)]
mod tests;
