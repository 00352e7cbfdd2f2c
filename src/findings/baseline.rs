//! Baselines: the findings of a part that are known, in a file that people read and edit.
//!
//! [`Baseline::read`] reads one. What is found later is held against it: findings and known ones of the same tool that
//! overlap are a group, and each finding of it is *known*, or *grown*; any other is *new*, or *small*; what is known
//! and not found is *gone*. `docs/pipeline.md` has the rules.

mod cells;
mod file;
mod matching;

use super::{Bounds, Finding, FindingStatus, Findings, cause_words, untaken};
use crate::answers::SiteAnswer;
use crate::geom::Sites;
use crate::{Error, Result};
use cells::Cover;
use glam::DVec3;
use matching::Matches;
use std::collections::{HashMap, HashSet};

/// A group has grown if it is larger by this share and by so many standard deviations of its number of sites, were they
/// drawn one by one.
const GROWN_SHARE: f64 = 0.1;
const GROWN_DEVIATIONS: f64 = 2.0;
/// A patch that is not known and has less than the area of so many sites is small.
const SMALL_SITES: f64 = 8.0;
/// No cell is smaller, mm.
const LEAST_MM: f64 = 1e-3;
/// A box that has less than this share in common with another is that of another part.
const SAME_PART: f64 = 0.5;
/// Boxes whose sizes differ by no more than this share of the longest edge are those of one part that was moved.
const SAME_SIZE: f64 = 1e-3;

/// The findings of a part that are known.
///
#[cfg_attr(feature = "generate", doc = "```")]
#[cfg_attr(not(feature = "generate"), doc = "```ignore")]
/// use deepmill::analysis::Analysis;
/// use deepmill::data::files::tools::Tool;
/// use deepmill::findings::baseline::Baseline;
/// use deepmill::{geom::solids, glam::DVec3};
///
/// # let temporary = tempfile::tempdir().unwrap();
/// # let path = temporary.path().join("known.toml");
/// let block = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
/// let analysis = |lengths: &str| {
///     let tool = Tool::new(lengths.parse()?, None, 0.0)?.named("finisher");
///     Analysis::new("block", block.clone(), vec![tool]).n_sites(300).directions("up".parse()?).run(&mut ())
/// };
/// let first = analysis("3,20,20,20")?;
/// first.baseline("2026-01-31")?.write(&path)?; // the underside is known
/// let baseline = Baseline::read(&path)?;
/// let mut same = analysis("3,20,20,20")?;
/// assert!(!same.hold_against(&baseline).is_broken());
/// let mut shorter = analysis("3,4,20,20")?; // its holder hits the block beside the lower half of the sides
/// assert!(shorter.hold_against(&baseline).is_broken());
/// assert!(first.baseline("31.1.2026").unwrap_err().to_string().contains("write for example 2026-01-31"));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    part: String,
    bounds: Bounds,
    /// Area about a site, mm².
    site_mm2: f64,
    /// Edge of the cells, mm.
    cell_mm: Option<f64>,
    known: Vec<KnownFinding>,
    scattered: Vec<ScatteredCells>,
}

/// Where the sites are that are out of reach and in no finding.
#[derive(Debug, Clone, PartialEq)]
struct ScatteredCells {
    /// The tool's name.
    tool: String,
    /// As those of a finding.
    cells: Vec<[i32; 5]>,
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
    /// Where it is: cells of a grid in the part's box, in runs of facing, z, y, first and last x. If there are none, it
    /// fills its box.
    pub cells: Vec<[i32; 5]>,
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
    /// Of those that are known and larger than they were.
    pub grown: Vec<(usize, Grown)>,
    /// Of those that are not known and have the area of a few sites: they come and go with the sites.
    pub small: Vec<usize>,
    /// What is known and was not found.
    pub gone: Vec<KnownFinding>,
    /// Why the baseline may be that of something else, a sentence each.
    pub warnings: Vec<String>,
}

/// How a known finding has grown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of the program
pub struct Grown {
    /// Area of the known ones of its group, mm².
    pub was_mm2: f64,
    /// Area of the findings of its group, less that of sites that were scattered, mm².
    pub is_mm2: f64,
    /// Area and place of the largest patch that is not known, if that makes it grown; mm², mm.
    pub patch: Option<(f64, DVec3)>,
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
        let site_mm2 = site_mm2(findings);
        let cell_mm = rounded(cells::cell_mm(site_mm2.sqrt(), bounds)).max(LEAST_MM);
        let low = rounded3(bounds[0]);
        let scattered = cells::of_sites(&findings.scattered_sites, sites, low, cell_mm);
        let known =
            findings.list.iter().zip(members(findings)).map(|(finding, members)| KnownFinding {
                id: finding.id.clone(),
                tool: tool.to_owned(),
                cause: finding.cause,
                area_mm2: rounded(finding.area_mm2),
                at_mm: rounded3(finding.at_mm),
                bounds: [finding.low_mm, finding.high_mm].map(rounded3),
                reason: finding.reason.clone().unwrap_or_default(),
                date: finding.since.clone().unwrap_or_else(|| date.to_owned()),
                normal: rounded3(finding.normal),
                cells: cells::of_sites(&members, sites, low, cell_mm),
            });
        Ok(Baseline {
            part: part.to_owned(),
            bounds: bounds.map(rounded3),
            site_mm2: rounded(site_mm2),
            cell_mm: Some(cell_mm),
            known: known.collect(),
            scattered: (!scattered.is_empty())
                .then(|| ScatteredCells { tool: tool.to_owned(), cells: scattered })
                .into_iter()
                .collect(),
        })
    }

    /// Gives every finding that is known its name, reason and date, and each its status.
    #[doc(hidden)] // of `analysis`
    pub fn hold(&self, findings: &mut Findings, about: FindingsAbout) -> BaselineCheck {
        let FindingsAbout { tool, bounds, sites, .. } = about;
        let members = members(findings);
        let (covers, scattered) = self.covers(tool, self.moved_by(bounds), site_mm2(findings));
        let known = (&self.known[..], &covers[..]);
        let matches = matching::matches(findings, (&members, sites), known, &scattered);
        let site_mm2 = self.site_mm2.max(site_mm2(findings));
        let mut check = BaselineCheck {
            known: Vec::new(),
            new: Vec::new(),
            grown: Vec::new(),
            small: Vec::new(),
            gone: Vec::new(),
            warnings: self.warnings(tool, bounds, findings.list.is_empty()),
        };
        let is_found = |j: usize| matches.group.contains(&matches.group_of_known[j]);
        let gone = self.known.iter().enumerate().filter(|(j, _)| !is_found(*j));
        check.gone = gone.map(|(_, known)| known.clone()).collect();
        let grown = self.grown(findings, &matches, site_mm2);
        // A new finding has no name that the baseline has.
        let mut taken: HashSet<String> = self.known.iter().map(|known| known.id.clone()).collect();
        for (k, finding) in findings.list.iter_mut().enumerate() {
            let own = matches.pairs[k].map(|j| &self.known[j]);
            let others = matches.others[k].iter().map(|j| &self.known[*j]);
            let of: Vec<&KnownFinding> = own.into_iter().chain(others).collect();
            let is_small = !matches.patches[k].is_large(finding, site_mm2);
            let (status, numbers) = match grown[k] {
                Some(grown) => {
                    check.grown.push((k, grown));
                    (FindingStatus::Grown, None)
                }
                None if !of.is_empty() => (FindingStatus::Known, Some(&mut check.known)),
                None if is_small => (FindingStatus::Small, Some(&mut check.small)),
                None => (FindingStatus::New, Some(&mut check.new)),
            };
            numbers.into_iter().for_each(|numbers| numbers.push(k));
            set(finding, status, &of);
            finding.id = match own {
                Some(known) => known.id.clone(),
                None => untaken(std::mem::take(&mut finding.id), &mut taken),
            };
        }
        findings.are_held = true;
        check
    }

    /// What the known findings of a tool cover, none for those of other tools, and what its scattered sites cover. The
    /// part was `moved`, and now has `site_mm2` to a site.
    fn covers(&self, tool: &str, moved: DVec3, mm2: f64) -> (Vec<Option<Cover>>, Vec<Cover>) {
        let around_mm = self.site_mm2.max(mm2).sqrt();
        let grid = (self.bounds[0] + moved, self.cell_mm.unwrap_or(LEAST_MM));
        let cover = |cells: &[[i32; 5]], bounds: Bounds, normal: DVec3| {
            Cover::new(cells, grid, (bounds.map(|corner| corner + moved), normal), around_mm)
        };
        let of_known = |known: &KnownFinding| {
            (known.tool == tool).then(|| cover(&known.cells, known.bounds, known.normal))
        };
        // Scattered sites are where their cells are.
        let scattered = self.scattered.iter().filter(|of| of.tool == tool && !of.cells.is_empty());
        (
            self.known.iter().map(of_known).collect(),
            scattered.map(|of| cover(&of.cells, self.bounds, DVec3::ZERO)).collect(),
        )
    }

    /// Per finding, how it has grown: if it has a patch that is not known, or, of the largest finding of a group, if
    /// the group is larger than it was.
    fn grown(&self, findings: &Findings, matches: &Matches, site_mm2: f64) -> Vec<Option<Grown>> {
        let mut areas: HashMap<usize, (f64, f64)> = HashMap::new();
        for (known, group) in self.known.iter().zip(&matches.group_of_known) {
            areas.entry(*group).or_default().0 += known.area_mm2;
        }
        let less_scattered = findings.list.iter().zip(&matches.scattered_mm2);
        for ((finding, scattered_mm2), group) in less_scattered.zip(&matches.group) {
            areas.entry(*group).or_default().1 += finding.area_mm2 - scattered_mm2;
        }
        let mut seen = HashSet::new();
        let of = findings.list.iter().zip(&matches.patches).zip(&matches.group);
        of.map(|((finding, patch), group)| {
            let (was_mm2, is_mm2) = areas[group];
            // A group of nothing that is known.
            if was_mm2 == 0.0 && !matches.group_of_known.contains(group) {
                return None;
            }
            let n_sites = (was_mm2 + is_mm2) / site_mm2;
            let more_mm2 = is_mm2 - was_mm2;
            let is_larger = more_mm2 > GROWN_SHARE * was_mm2
                && more_mm2 > GROWN_DEVIATIONS * n_sites.sqrt() * site_mm2;
            let place = (patch.area_mm2(finding), patch.at_mm);
            let patch = patch.is_large(finding, site_mm2).then_some(place);
            let is_first = seen.insert(*group);
            (patch.is_some() || (is_first && is_larger)).then_some(Grown { was_mm2, is_mm2, patch })
        })
        .collect()
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

/// Of a finding and the known ones that it is of: all reasons, and the date of the first.
fn set(finding: &mut Finding, status: FindingStatus, of: &[&KnownFinding]) {
    finding.status = Some(status);
    let mut reasons: Vec<&str> = Vec::new();
    for known in of {
        if !known.reason.is_empty() && !reasons.contains(&&*known.reason) {
            reasons.push(&known.reason);
        }
    }
    finding.reason = (!of.is_empty()).then(|| reasons.join("; "));
    finding.since = of.first().map(|known| known.date.clone()).filter(|date| !date.is_empty());
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

/// Area about a site, mm².
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
