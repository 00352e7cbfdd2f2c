//! The change of a tool that helps most of a region.
//!
//! ```text
//! explain some sites of the region, even over its list, by the directions of the set alone
//! kind = the one that helps most of these sites; among equals the one with the least amount
//! amount = the greatest that one of them needs
//! label sites of the region with the tool so changed: the share that it reaches
//! ```

use super::case::{Barrier, Between, Case};
use super::profile::ProfileCase;
use super::remedies::diameter;
use super::{Blocked, Change, ChangeKind, Query, Remedies, Stopped};
use crate::Result;
use crate::access::surface::labels::SurfaceOptions;
use crate::access::surface::obstacles::{TriangleObstacles, tested};
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, ToolPart};
use crate::tool::directions::Directions;
use glam::Vec3;

/// A change of the tool, and what of a region it reaches.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RegionChange {
    /// The change.
    pub change: Change,
    /// Share of the region's sites that the changed tool reaches by the directions of the set; of 256 of
    /// them, if there are more.
    pub share: f64,
}

/// What was found for a region.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct RegionAdvice {
    /// The change that helps most of it, if one is proposed.
    pub change: Option<RegionChange>,
    /// A stick-out that would help at some of its sites and is not proposed: the least of them.
    pub stopped: Option<Stopped>,
}

/// Amounts are rounded up to this, mm.
const ROUND_MM: f64 = 0.01;
/// Sites of a region that are explained.
const N_EXPLAINED: usize = 4;
/// Most sites of a region that are labeled with the changed tool.
pub const N_LABELED: usize = 256;

impl TriangleObstacles {
    /// The change of the tool that helps most of the sites `members`, which it does not reach, if one is found that
    /// keeps `remedies`.
    ///
    /// # Errors
    /// As [`TriangleObstacles::explain`].
    ///
    /// # Panics
    /// If a member is no site.
    #[doc(hidden)] // for findings, of the program
    pub fn change_for(
        &self,
        (sites, members): (&Sites, &[u32]),
        (tool, clearance_mm): (&Assembly, f64),
        directions: &Directions,
        options: &SurfaceOptions,
        remedies: &Remedies,
    ) -> Result<RegionAdvice> {
        let options = SurfaceOptions { refinement: None, ..*options };
        let explained: Vec<usize> = spread(members, N_EXPLAINED).collect();
        let explain = |i: usize| {
            let query = Query {
                site: sites.points[i],
                normal: sites.normals[i],
                tool,
                clearance_mm,
                directions,
                options: &options,
                witness: None,
                remedies: *remedies,
            };
            if tool.profile().is_some() {
                let case = ProfileCase::new(self, &query)?;
                let is_reached = case.reached_from(tool)?.is_some();
                return if is_reached { Ok((Vec::new(), None)) } else { case.changes() };
            }
            let tested = tested(directions)?;
            let (barrier, query) = (Barrier::Triangles(self), &query);
            let case = Case { barrier, query, tested, proves: false };
            let alone = case.label(tool, directions, Between::None)?;
            match alone.answer {
                SiteAnswer::Accessible => Ok((Vec::new(), None)),
                _ => case.changes(alone.tolerance),
            }
        };
        let (mut found, mut advice): (Vec<Change>, _) = (Vec::new(), RegionAdvice::default());
        for of_site in par::map(explained.len(), |k| explain(explained[k])) {
            let (changes, stopped) = of_site?;
            found.extend(changes);
            let both = advice.stopped.into_iter().chain(stopped);
            advice.stopped =
                both.reduce(|a, b| if b.stick_out_mm < a.stick_out_mm { b } else { a });
        }
        let Some(change) = common(&found, tool) else { return Ok(advice) };
        let few: Vec<usize> = spread(members, N_LABELED).collect();
        let few = sites.subset(&few);
        let cutter = change.tool.with_clearance(clearance_mm)?.cutter()?;
        let labels = self.surface_labels(&few, &cutter, directions, &options.for_few(few.len()))?;
        let change = RegionChange { share: labels.share(SiteAnswer::Accessible), change };
        Ok(RegionAdvice { change: Some(change), ..advice })
    }
}

/// What a direction that something above the cutter blocks is looked for.
pub(crate) struct BlockedQuery<'a> {
    pub sites: &'a Sites,
    /// The tool, and the safety margin about it, mm.
    pub held: (&'a Assembly, f64),
    pub directions: &'a Directions,
    pub options: &'a SurfaceOptions,
}

impl TriangleObstacles {
    /// Of the directions of the set in which tip and cutter are free and something above blocks, the one in which that
    /// penetrates least, and what blocks there; none for a tool given by its profile.
    pub(crate) fn least_blocked(
        &self,
        wanted: &BlockedQuery,
        site: u32,
    ) -> Result<Option<(Vec3, Blocked)>> {
        let (tool, clearance_mm) = wanted.held;
        if tool.profile().is_some() {
            return Ok(None);
        }
        let query = Query {
            site: wanted.sites.points[site as usize],
            normal: wanted.sites.normals[site as usize],
            tool,
            clearance_mm,
            directions: wanted.directions,
            options: wanted.options,
            witness: None,
            remedies: Remedies::default(),
        };
        let tested = tested(wanted.directions)?;
        let barrier = Barrier::Triangles(self);
        let case = Case { barrier, query: &query, tested, proves: false };
        if case.ball_gouges(tool)? {
            return Ok(None);
        }
        let (parted, meetings) = case.meetings(tool, case.tested.vectors())?;
        let blocked = case.tested.vectors().iter().zip(&meetings).filter_map(|(d, meeting)| {
            let (part, met) = meeting.lowest(&parted)?;
            let blocked =
                Blocked { part, penetration_mm: met.raise, face: met.face, at_mm: met.at };
            (part > ToolPart::Cutter).then_some((*d, blocked))
        });
        let is_less = |a: &Blocked, b: &Blocked| a.penetration_mm < b.penetration_mm;
        Ok(blocked.reduce(|a, b| if is_less(&b.1, &a.1) { b } else { a }))
    }
}

/// At most `n` of the members, even over their list.
fn spread(members: &[u32], n: usize) -> impl Iterator<Item = usize> + '_ {
    let n = n.min(members.len());
    (0..n).map(move |k| members[(2 * k + 1) * members.len() / (2 * n)] as usize)
}

/// The kind that most of the changes have, by the greatest amount.
fn common(found: &[Change], tool: &Assembly) -> Option<Change> {
    let mut kinds: Vec<ChangeKind> = Vec::new();
    for change in found {
        if !kinds.contains(&change.kind) {
            kinds.push(change.kind);
        }
    }
    let of = |kind: ChangeKind| found.iter().filter(move |change| change.kind == kind);
    let greatest = |kind: ChangeKind| of(kind).map(|change| change.by_mm).fold(0.0, f64::max);
    let best = kinds.into_iter().min_by(|&a, &b| {
        let by_count = of(b).count().cmp(&of(a).count());
        by_count.then(greatest(a).total_cmp(&greatest(b)))
    })?;
    if best == ChangeKind::Diameter {
        return smallest(of(best));
    }
    let first = of(best).next()?;
    let by_mm = (greatest(best) / ROUND_MM).ceil() * ROUND_MM;
    let changed = match best {
        ChangeKind::Raise(part) => tool.raised(part, by_mm.min(most_raise(tool, part))),
        ChangeKind::Narrow(part) => tool.narrowed(part, by_mm),
        ChangeKind::Diameter => return None,
    };
    Some(Change { by_mm, longer_mm: 0.0, is_least: false, tool: changed.ok()?, ..first.clone() })
}

/// The smallest of the cutters, with the longest stick-out that one of that size needs.
fn smallest<'a>(found: impl Iterator<Item = &'a Change> + Clone) -> Option<Change> {
    let least = found.clone().map(|change| diameter(&change.tool)).fold(f64::INFINITY, f64::min);
    let of_size = found.filter(|change| diameter(&change.tool) <= least);
    let longest = of_size.reduce(|a, b| if b.longer_mm > a.longer_mm { b } else { a })?;
    Some(Change { is_least: false, ..longest.clone() })
}

/// Rounding up does not make a tool stick out further than it is long.
fn most_raise(tool: &Assembly, part: ToolPart) -> f64 {
    match part {
        ToolPart::Spindle => f64::INFINITY,
        _ => tool.most_stick_out_mm() - tool.stick_out_mm(),
    }
}
