//! Baselines: the findings of a part that are known, in a file that people read and edit.
//!
//! [`Baseline::read`] reads one. What is found later is held against it: a finding that overlaps a known one of the same
//! tool and cause is that finding, has its name, and is *known*, or *grown*; any other is *new*; what is known and not
//! found is *gone*. `docs/pipeline.md` has the rules.

mod file;
mod matching;

use super::findings::{Bounds, Finding, FindingStatus, Findings, cause_words, untaken};
use crate::access::surface::SiteAnswer;
use crate::geom::Sites;
use crate::{Error, Result};
use glam::DVec3;
use std::collections::HashSet;

/// Places kept of a finding.
const N_POINTS: usize = 12;
/// Grown is what is larger by this share, and by the area of so many sites.
const GROWN_SHARE: f64 = 0.1;
const GROWN_SITES: f64 = 4.0;
/// A box that has less than this share in common with another is that of another part.
const SAME_PART: f64 = 0.5;
/// Boxes whose sizes differ by no more than this share of the longest edge are those of one part that was moved.
const SAME_SIZE: f64 = 1e-3;

/// The findings of a part that are known.
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    part: String,
    bounds: Bounds,
    /// Area that a site stands for, mm².
    site_mm2: f64,
    known: Vec<KnownFinding>,
}

/// A finding that is known.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of the program
pub struct KnownFinding {
    /// Its name.
    pub id: String,
    /// The tool's name.
    pub tool: String,
    /// The answer of its sites.
    pub cause: SiteAnswer,
    /// Area, mm².
    pub area_mm2: f64,
    /// A place of it, mm.
    pub at_mm: DVec3,
    /// Least and greatest corner of the box about it, mm.
    pub bounds: Bounds,
    /// Why it may stay.
    pub reason: String,
    /// Since when it is known, as year-month-day; empty if that is not stated.
    pub date: String,
    /// Mean outward normal; zero if that is not stated.
    pub normal: DVec3,
    /// How far around its points it goes, mm.
    pub reach_mm: Option<f64>,
    /// Some of its places, mm; if there are none, it fills its box.
    pub points: Vec<DVec3>,
}

impl KnownFinding {
    /// The cause in words.
    pub fn words(&self) -> &'static str {
        cause_words(self.cause)
    }
}

/// What findings are about.
#[derive(Debug, Clone, Copy)]
#[doc(hidden)] // of `analysis`
pub struct FindingsAbout<'a> {
    /// Name of the part.
    pub part: &'a str,
    /// The tool's name.
    pub tool: &'a str,
    /// The box of the part, mm.
    pub bounds: Bounds,
    /// The sites.
    pub sites: &'a Sites,
}

/// What was found, held against a baseline.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of the program
pub struct BaselineCheck {
    /// Numbers of the findings that are known, from 0 on.
    pub known: Vec<usize>,
    /// Of those that are not.
    pub new: Vec<usize>,
    /// Of those that are known and larger than they were, with the area they had, mm².
    pub grown: Vec<(usize, f64)>,
    /// What is known and was not found.
    pub gone: Vec<KnownFinding>,
    /// Why the baseline may be that of something else, a sentence each.
    pub warnings: Vec<String>,
}

impl BaselineCheck {
    /// Whether something is new or grown.
    pub fn is_broken(&self) -> bool {
        !self.new.is_empty() || !self.grown.is_empty()
    }
}

impl Baseline {
    /// The findings that are known.
    #[doc(hidden)] // of the program
    pub fn known(&self) -> &[KnownFinding] {
        &self.known
    }

    /// All findings of a list, as known since a date (year-month-day). Those that were held against a baseline keep
    /// their reasons and dates.
    ///
    /// # Errors
    /// If the date is none.
    #[doc(hidden)] // of `analysis`
    pub fn of(findings: &Findings, about: FindingsAbout, date: &str) -> Result<Self> {
        if !is_date(date) {
            let remedy = "write for example 2026-01-31";
            return Err(Error::argument("date", format!("`{date}`"), "YEAR-MONTH-DAY", remedy));
        }
        let FindingsAbout { part, tool, bounds, sites } = about;
        let members = members(findings);
        let known = findings.list.iter().zip(&members).map(|(finding, members)| {
            let place = |i: u32| sites.points[i as usize].as_dvec3();
            let (points, reach_mm) = matching::thinned(members, place, N_POINTS);
            let spacing_mm = (finding.area_mm2 / finding.n_sites.max(1) as f64).sqrt();
            KnownFinding {
                id: finding.id.clone(),
                tool: tool.to_owned(),
                cause: finding.cause,
                area_mm2: rounded(finding.area_mm2),
                at_mm: rounded3(finding.at_mm),
                bounds: [finding.low_mm, finding.high_mm].map(rounded3),
                reason: finding.reason.clone().unwrap_or_default(),
                date: finding.since.clone().unwrap_or_else(|| date.to_owned()),
                normal: rounded3(finding.normal),
                reach_mm: Some(rounded(reach_mm + spacing_mm)),
                points: points.into_iter().map(rounded3).collect(),
            }
        });
        Ok(Baseline {
            part: part.to_owned(),
            bounds: bounds.map(rounded3),
            site_mm2: rounded(site_mm2(findings)),
            known: known.collect(),
        })
    }

    /// Gives every finding that is known its name, reason and date, and each its status.
    #[doc(hidden)] // of `analysis`
    pub fn hold(&self, findings: &mut Findings, about: FindingsAbout) -> BaselineCheck {
        let FindingsAbout { tool, bounds, sites, .. } = about;
        let moved = self.moved_by(bounds);
        let members = members(findings);
        let pairs = matching::pairs(findings, (&members, sites), (&self.known, tool), moved);
        let least_mm2 = GROWN_SITES * self.site_mm2.max(site_mm2(findings));
        let mut check = BaselineCheck {
            known: Vec::new(),
            new: Vec::new(),
            grown: Vec::new(),
            gone: Vec::new(),
            warnings: self.warnings(tool, bounds, findings.list.is_empty()),
        };
        // A new finding has no name that the baseline has.
        let mut taken: HashSet<String> = self.known.iter().map(|known| known.id.clone()).collect();
        for (k, (finding, pair)) in findings.list.iter_mut().zip(&pairs).enumerate() {
            let Some(known) = pair.map(|j| &self.known[j]) else {
                finding.id = untaken(std::mem::take(&mut finding.id), &mut taken);
                set(finding, FindingStatus::New, None);
                check.new.push(k);
                continue;
            };
            let more_mm2 = finding.area_mm2 - known.area_mm2;
            if more_mm2 > GROWN_SHARE * known.area_mm2 && more_mm2 > least_mm2 {
                set(finding, FindingStatus::Grown, Some(known));
                check.grown.push((k, known.area_mm2));
            } else {
                set(finding, FindingStatus::Known, Some(known));
                check.known.push(k);
            }
        }
        findings.are_held = true;
        let is_found = |j: usize| pairs.contains(&Some(j));
        let gone = self.known.iter().enumerate().filter(|(j, _)| !is_found(*j));
        check.gone = gone.map(|(_, known)| known.clone()).collect();
        check
    }

    /// Where the part is now, less where it was; zero if it is no part of that size.
    fn moved_by(&self, [low, high]: Bounds) -> DVec3 {
        let size = self.bounds[1] - self.bounds[0];
        let difference = ((high - low) - size).abs().max_element();
        match difference <= SAME_SIZE * size.max_element() {
            true => low - self.bounds[0],
            false => DVec3::ZERO,
        }
    }

    fn warnings(&self, tool: &str, bounds: Bounds, nothing_found: bool) -> Vec<String> {
        let mut warnings = Vec::new();
        let words = |[low, high]: Bounds| {
            let [x, y, z] = (high - low).to_array().map(|mm| (10.0 * mm).round() / 10.0);
            format!("{x} x {y} x {z} mm")
        };
        let moved = self.moved_by(bounds);
        if common(self.bounds.map(|corner| corner + moved), bounds) < SAME_PART {
            let (was, is) = (words(self.bounds), words(bounds));
            warnings.push(format!(
                "the baseline is of {}, whose box of {was} has less than half in common with this part's of {is}: \
                 it may be another part, in another unit or place",
                self.part
            ));
        }
        let mut tools: Vec<&str> = self.known.iter().map(|known| &*known.tool).collect();
        tools.dedup();
        if !tools.is_empty() && !tools.contains(&tool) && !nothing_found {
            let (some, more) = (&tools[..tools.len().min(3)], tools.len().saturating_sub(3));
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            warnings.push(format!(
                "the baseline has findings of {}{more}, none of {tool}: a tool is known by its name",
                some.join(", ")
            ));
        }
        warnings
    }
}

/// Of a finding and what is known of it.
fn set(finding: &mut Finding, status: FindingStatus, known: Option<&KnownFinding>) {
    finding.status = Some(status);
    finding.reason = known.map(|known| known.reason.clone());
    finding.since = known.map(|known| known.date.clone()).filter(|date| !date.is_empty());
    if let Some(known) = known {
        finding.id.clone_from(&known.id);
    }
}

/// The sites of every finding, ascending.
fn members(findings: &Findings) -> Vec<Vec<u32>> {
    let mut members = vec![Vec::new(); findings.list.len()];
    for (i, number) in (0..).zip(&findings.of_site) {
        if let Some(members) = (*number as usize).checked_sub(1).and_then(|k| members.get_mut(k)) {
            members.push(i);
        }
    }
    members
}

/// Area that a site stands for, mm².
fn site_mm2(findings: &Findings) -> f64 {
    findings.surface_mm2 / findings.of_site.len().max(1) as f64
}

/// The share of the larger of two boxes that they have in common.
fn common(a: Bounds, b: Bounds) -> f64 {
    let shared = a[1].min(b[1]) - a[0].max(b[0]);
    let larger = (a[1] - a[0]).max(b[1] - b[0]);
    let share = |axis: usize| match larger[axis] > 0.0 {
        true => (shared[axis] / larger[axis]).max(0.0),
        false => 1.0,
    };
    share(0) * share(1) * share(2)
}

/// To a thousandth, as files have it.
fn rounded(x: f64) -> f64 {
    (1e3 * x).round() / 1e3 + 0.0
}

fn rounded3(v: DVec3) -> DVec3 {
    DVec3::from_array(v.to_array().map(rounded))
}

/// Whether it is a day, as year-month-day.
fn is_date(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let [year, month, day] = parts[..] else { return false };
    let number = |part: &str, digits: usize| {
        let is_number = part.len() == digits && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse::<u32>().ok().filter(|_| is_number)
    };
    let in_year = number(month, 2).is_some_and(|month| (1..=12).contains(&month));
    let in_month = number(day, 2).is_some_and(|day| (1..=31).contains(&day));
    number(year, 4).is_some() && in_year && in_month
}

#[cfg(test)]
mod tests;
