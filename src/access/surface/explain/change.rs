//! The least changes of a tool with which it has a free pose at a site.

use super::Stopped;
use super::case::{Between, Case};
use super::meet::{Meeting, ShrunkTool};
use super::remedies::diameter;
use crate::tool::cutter::{Assembly, ToolPart};
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// One length of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ChangeKind {
    /// The part and everything above it is higher: a longer stick-out (holder), a longer holder (spindle), a longer
    /// neck and stick-out (shank).
    Raise(ToolPart),
    /// All radii of the part, holder or shank, are less; of a tool given by its profile those of the neck below its
    /// shank.
    Narrow(ToolPart),
    /// Tip and cutter have a smaller diameter; shank, holder and stick-out stay. Of a tool given by its profile all
    /// that cuts is smaller, in height as well; a drill may be wider instead.
    Diameter,
}

/// A change of the tool that helps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Change {
    /// What is changed.
    pub kind: ChangeKind,
    /// By how much, mm; of the diameter for [`ChangeKind::Diameter`], of the radius for [`ChangeKind::Narrow`].
    pub by_mm: f64,
    /// By how much the stick-out is longer besides, mm; negative where a smaller cutter would be too slender at the
    /// same one.
    pub longer_mm: f64,
    /// Whether less by 2τ (for points by 0.001 mm, for a diameter the next larger one that is sold) was labeled and
    /// does not do.
    pub is_least: bool,
    /// The changed tool, without a margin.
    pub tool: Assembly,
    /// A direction with a free pose of the changed tool, by the reference engine.
    pub direction: Vec3,
}

/// Amounts are rounded up to this, mm.
const ROUND_MM: f64 = 1e-4;
/// More than the roundings of greatest heights, mm.
const BEYOND_MM: f64 = 1e-6;
/// Directions between those tested that are followed for one change.
const ROUNDS: usize = 8;
/// No raise is longer, mm.
const MOST_MM: f64 = 1e3;
/// What makes a difference among points, mm.
const FINE_POINTS_MM: f64 = 1e-3;

impl Change {
    /// The change in words, of the tool `from`.
    pub fn words(&self, from: &Assembly) -> String {
        let by = short(self.by_mm);
        let widest = |tool: &Assembly| {
            let finite = tool.holder().iter().map(|step| step.radius_mm).filter(|r| r.is_finite());
            2.0 * finite.fold(0.0, f64::max)
        };
        let sticks = |tool: &Assembly| {
            format!("{} instead of {} mm", short(tool.stick_out_mm()), short(from.stick_out_mm()))
        };
        match self.kind {
            ChangeKind::Raise(ToolPart::Spindle) => format!("holder longer by {by} mm"),
            ChangeKind::Raise(ToolPart::Shank) => {
                format!("neck and stick-out longer by {by} mm ({})", sticks(&self.tool))
            }
            ChangeKind::Raise(_) => {
                format!("stick-out longer by {by} mm ({})", sticks(&self.tool))
            }
            ChangeKind::Narrow(ToolPart::Shank) => {
                let neck = if from.profile().is_some() { "neck" } else { "shank" };
                format!("{neck} thinner by {by} mm in radius")
            }
            ChangeKind::Narrow(_) => format!(
                "holder thinner by {by} mm in radius (diameter {} or less instead of {} mm)",
                short(widest(&self.tool)),
                short(widest(from))
            ),
            ChangeKind::Diameter => {
                let more = match self.longer_mm {
                    longer if longer > 0.0 => {
                        format!(", and stick-out longer by {} mm", short(longer))
                    }
                    longer if longer < 0.0 => format!(", and stick-out {}", sticks(&self.tool)),
                    _ => String::new(),
                };
                format!(
                    "cutter of diameter {} instead of {} mm{more}",
                    short(diameter(&self.tool)),
                    short(diameter(from))
                )
            }
        }
    }
}

/// A length to four decimals, without trailing zeros, never minus zero.
pub(crate) fn short(x: f64) -> String {
    format!("{}", (1e4 * x).round() / 1e4 + 0.0)
}

impl Case<'_> {
    /// Every kind of change that helps and that someone would make, the least first; and the stick-out that would help
    /// beyond that.
    pub(super) fn changes(&self, tolerance: f64) -> Result<(Vec<Change>, Option<Stopped>)> {
        let tool = self.query.tool;
        let (mut changes, stopped) = match self.ball_gouges(tool)? {
            true => (Vec::new(), None),
            false => self.changes_above_tip(tool, tolerance)?,
        };
        if changes.is_empty() && !self.query.remedies.only_this_tool {
            changes.extend(self.smaller_diameter(tool)?);
        }
        changes.sort_by(|a, b| a.by_mm.total_cmp(&b.by_mm));
        Ok((changes, stopped))
    }

    /// Those that leave the tip as it is.
    fn changes_above_tip(
        &self,
        tool: &Assembly,
        tolerance: f64,
    ) -> Result<(Vec<Change>, Option<Stopped>)> {
        let kinds = [
            ChangeKind::Raise(ToolPart::Holder),
            ChangeKind::Narrow(ToolPart::Holder),
            ChangeKind::Raise(ToolPart::Shank),
            ChangeKind::Narrow(ToolPart::Shank),
            ChangeKind::Raise(ToolPart::Spindle),
        ];
        let (parted, meetings) = self.meetings(tool, self.tested.vectors())?;
        let (mut changes, mut stopped) = (Vec::new(), None);
        let n_kinds = if self.query.remedies.only_this_tool { 1 } else { kinds.len() };
        for &kind in &kinds[..n_kinds] {
            let (ChangeKind::Raise(part) | ChangeKind::Narrow(part)) = kind else { continue };
            if !tool.has(part) {
                continue;
            }
            match self.least_change(kind, tool, (&parted, &meetings), tolerance)? {
                Ok(change) => changes.push(change),
                Err(beyond) => stopped = stopped.or(beyond),
            }
        }
        Ok((changes, stopped))
    }

    /// The least change of one kind, proved; or the stick-out that would help and is not proposed.
    fn least_change(
        &self,
        kind: ChangeKind,
        tool: &Assembly,
        (parted, meetings): (&ShrunkTool, &[Meeting]),
        tolerance: f64,
    ) -> Result<std::result::Result<Change, Option<Stopped>>> {
        let most = self.most(kind, tool);
        let fine = if tolerance > 0.0 { 2.0 * tolerance } else { FINE_POINTS_MM };
        let over = self.tested.vectors().iter().zip(meetings);
        let over = over.filter_map(|(d, meeting)| Some((amount(kind, parted, meeting)?, *d)));
        let mut best = over.reduce(|a, b| if b.0 < a.0 { b } else { a });
        let mut is_least = false;
        for _ in 0..ROUNDS {
            let less = best.map_or(most, |(by, _)| most.min(by - fine));
            if less <= 0.0 {
                is_least = true;
                break;
            }
            // A tool beyond all bounds helps no one.
            let Ok(changed) = changed(kind, tool, less) else { break };
            let found = self.label(&changed, self.query.directions, Between::Quick)?;
            let Some(direction) = found.witness else {
                is_least = best.is_some();
                break;
            };
            let (_, between) = self.meetings(tool, &[direction])?;
            match amount(kind, parted, &between[0]) {
                Some(by) if best.is_none_or(|(least, _)| by < least) => {
                    best = Some((by, direction));
                }
                _ => break,
            }
        }
        let Some((by, direction)) = best else { return Ok(Err(None)) };
        let by_mm = ((by + BEYOND_MM) / ROUND_MM).ceil() * ROUND_MM;
        if by_mm > most {
            return Ok(Err(self.stopped(kind, tool, by_mm)));
        }
        let Ok(changed) = changed(kind, tool, by_mm) else { return Ok(Err(None)) };
        let direction = self.proved(&changed, direction)?;
        let of = |direction| Change {
            kind,
            by_mm,
            longer_mm: 0.0,
            is_least,
            tool: changed.clone(),
            direction,
        };
        Ok(direction.map(of).ok_or(None))
    }

    /// A change that no greater one of its kind is proposed beyond, mm.
    fn most(&self, kind: ChangeKind, tool: &Assembly) -> f64 {
        let remedies = &self.query.remedies;
        let most = match kind {
            ChangeKind::Raise(ToolPart::Holder) => {
                remedies.longest_of_own(tool).0 - tool.stick_out_mm()
            }
            ChangeKind::Raise(ToolPart::Shank) => remedies.most_neck(tool),
            kind => most(kind, tool),
        };
        most.min(MOST_MM)
    }

    /// A stick-out that is beyond what is proposed.
    fn stopped(&self, kind: ChangeKind, tool: &Assembly, by_mm: f64) -> Option<Stopped> {
        let (most_mm, by_overall_length) = self.query.remedies.longest_of_own(tool);
        let stick_out_mm = tool.stick_out_mm() + by_mm;
        let is_of_stick_out = kind == ChangeKind::Raise(ToolPart::Holder) && by_mm <= MOST_MM;
        is_of_stick_out.then_some(Stopped { stick_out_mm, most_mm, by_overall_length })
    }

    /// A direction with a free pose of the changed tool: the one of its label, or this one.
    fn proved(&self, tool: &Assembly, direction: Vec3) -> Result<Option<Vec3>> {
        let found = self.label(tool, self.query.directions, Between::Quick)?;
        if !self.proves {
            return Ok(found.witness);
        }
        for direction in found.witness.into_iter().chain([direction]) {
            if self.prove(tool, direction)?.is_some() {
                return Ok(Some(direction));
            }
        }
        Ok(None)
    }

    /// The largest of the smaller cutters that are sold and may stand here, with a longer stick-out if nothing else
    /// does.
    fn smaller_diameter(&self, tool: &Assembly) -> Result<Option<Change>> {
        let kind = ChangeKind::Diameter;
        let by_mm = |smaller: &Assembly| diameter(tool) - diameter(smaller);
        let longer_mm = |changed: &Assembly| changed.stick_out_mm() - tool.stick_out_mm();
        if let Some((smaller, direction)) = self.largest_end(tool, Length::AsHeld)? {
            let direction = self.proved(&smaller, direction)?;
            return Ok(direction.map(|direction| Change {
                kind,
                by_mm: by_mm(&smaller),
                longer_mm: longer_mm(&smaller),
                is_least: true,
                tool: smaller,
                direction,
            }));
        }
        let Some((long, _)) = self.largest_end(tool, Length::Most)? else { return Ok(None) };
        let share = diameter(&long) / diameter(tool);
        let Some(held) = self.with_end(tool, share, Length::AsHeld)? else { return Ok(None) };
        let (parted, meetings) = self.meetings(&held, self.tested.vectors())?;
        let tolerance = self.label(&held, self.query.directions, Between::None)?.tolerance;
        let longer = ChangeKind::Raise(ToolPart::Holder);
        let raised = self.least_change(longer, &held, (&parted, &meetings), tolerance)?.ok();
        let both = |raised: Change| Change {
            kind,
            by_mm: by_mm(&raised.tool),
            longer_mm: longer_mm(&raised.tool),
            ..raised
        };
        Ok(raised.map(both))
    }

    /// The tool with the largest of the sold ends that fits, and a direction.
    fn largest_end(&self, tool: &Assembly, length: Length) -> Result<Option<(Assembly, Vec3)>> {
        let sizes = self.query.remedies.smaller_diameters(diameter(tool));
        let share = |size: &f64| size / diameter(tool);
        // What a cutter does not reach at any length, no larger one does.
        let by = if length == Length::Most { MOST_MM } else { 0.0 };
        let is_small_enough = |size: &f64| {
            let longest = tool.clone().without_overall().with_smaller_end(share(size));
            let longest = longest.and_then(|tool| tool.raised(ToolPart::Holder, by));
            longest.is_ok_and(|tool| self.stands(&tool).is_ok_and(|found| found.is_some()))
        };
        if !sizes.last().is_some_and(is_small_enough) {
            return Ok(None);
        }
        let n_too_large = sizes.partition_point(|size| !is_small_enough(size));
        for size in &sizes[n_too_large..] {
            let Some(smaller) = self.with_end(tool, share(size), length)? else { continue };
            if let Some(direction) = self.stands(&smaller)? {
                return Ok(Some((smaller, direction)));
            }
        }
        Ok(None)
    }

    /// The tool with a smaller end, and a stick-out that it may have; `None` if no one would make it.
    fn with_end(&self, tool: &Assembly, share: f64, length: Length) -> Result<Option<Assembly>> {
        // Thinner than any cutter.
        let Ok(smaller) = tool.with_smaller_end(share) else { return Ok(None) };
        let most = self.query.remedies.longest(&smaller).0.min(tool.stick_out_mm() + MOST_MM);
        let stick_out = match length {
            Length::AsHeld => most.min(tool.stick_out_mm()),
            Length::Most => most,
        };
        let held = smaller.raised(ToolPart::Holder, stick_out - tool.stick_out_mm());
        Ok(held.ok().filter(|tool| self.query.remedies.makes(tool)))
    }

    /// A direction in which a tool may stand here.
    fn stands(&self, tool: &Assembly) -> Result<Option<Vec3>> {
        match self.label(tool, self.query.directions, Between::Quick) {
            Ok(found) => Ok(found.witness),
            // Thinner than its tolerance.
            Err(Error::Argument { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// How far a smaller cutter sticks out.
#[derive(Clone, Copy, PartialEq)]
enum Length {
    /// As the tool does, or less if it would be too slender.
    AsHeld,
    /// As far as it may.
    Most,
}

/// By how much a direction needs the tool to be changed; `None` if such a change does not help there.
fn amount(kind: ChangeKind, tool: &ShrunkTool, meeting: &Meeting) -> Option<f64> {
    let amount = match kind {
        ChangeKind::Raise(part) => meeting.raise(tool, part),
        ChangeKind::Narrow(part) => meeting.narrow(tool, part),
        ChangeKind::Diameter => None,
    };
    amount.filter(|amount| amount.is_finite())
}

fn changed(kind: ChangeKind, tool: &Assembly, by: f64) -> Result<Assembly> {
    match kind {
        ChangeKind::Raise(part) => tool.raised(part, by),
        ChangeKind::Narrow(part) => tool.narrowed(part, by),
        ChangeKind::Diameter => tool.with_smaller_end(by),
    }
}

/// A change that no greater one goes beyond.
fn most(kind: ChangeKind, tool: &Assembly) -> f64 {
    match kind {
        ChangeKind::Narrow(_) => {
            let steps = tool.body().iter().chain(tool.holder());
            let radii = steps.map(|step| step.radius_mm).filter(|radius| radius.is_finite());
            radii.fold(0.0, f64::max) - tool.tip()[0] - tool.tip()[1]
        }
        _ => MOST_MM,
    }
}
