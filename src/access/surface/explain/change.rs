//! The least changes of a tool with which it may stand at a site.

use super::meet::{Meeting, ShrunkTool};
use super::{Between, Case};
use crate::cutter::{Assembly, ToolPart};
use crate::{Error, Result};
use glam::Vec3;

/// One length of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ChangeKind {
    /// The part and everything above it is higher: a longer stick-out (holder), a longer holder (spindle), a longer neck and stick-out (shank).
    Raise(ToolPart),
    /// All radii of the part, holder or shank, are less.
    Narrow(ToolPart),
    /// Tip and cutter have a smaller diameter; shank, holder and stick-out stay.
    Diameter,
}

/// A change of the tool that helps.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Change {
    /// What is changed.
    pub kind: ChangeKind,
    /// By how much, mm; of the diameter for [`ChangeKind::Diameter`], of the radius for [`ChangeKind::Narrow`].
    pub by_mm: f64,
    /// By how much the stick-out is longer besides, mm.
    pub longer_mm: f64,
    /// Whether less by 2τ (for points by 0.001 mm, for a diameter by [`FINE_MM`]) was labeled and does not do.
    pub is_least: bool,
    /// The changed tool, without a margin.
    pub tool: Assembly,
    /// A direction in which the changed tool may stand, by the reference engine.
    pub direction: Vec3,
}

/// Diameters are found to this, mm.
pub const FINE_MM: f64 = 0.01;
/// Amounts are rounded up to this, mm.
const ROUND_MM: f64 = 1e-4;
/// More than the roundings of greatest heights, mm.
const BEYOND_MM: f64 = 1e-6;
/// Directions between those tested that are followed for one change.
const ROUNDS: usize = 8;
/// Sizes of cutters that are tried.
const N_SIZES: usize = 24;
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
            ChangeKind::Narrow(ToolPart::Shank) => format!("shank thinner by {by} mm in radius"),
            ChangeKind::Narrow(_) => format!(
                "holder thinner by {by} mm in radius (diameter {} instead of {} mm)",
                short(widest(&self.tool)),
                short(widest(from))
            ),
            ChangeKind::Diameter => {
                let more = match self.longer_mm > 0.0 {
                    true => format!(", and stick-out longer by {} mm", short(self.longer_mm)),
                    false => String::new(),
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
    /// Every kind of change that helps, the least first.
    pub(super) fn changes(&self, tolerance: f64) -> Result<Vec<Change>> {
        let tool = self.query.tool;
        let mut changes = match self.ball_gouges(tool)? {
            true => Vec::new(),
            false => self.changes_above_tip(tool, tolerance)?,
        };
        if changes.is_empty() {
            changes.extend(self.smaller_diameter(tool)?);
        }
        changes.sort_by(|a, b| a.by_mm.total_cmp(&b.by_mm));
        Ok(changes)
    }

    /// Those that leave the tip as it is.
    fn changes_above_tip(&self, tool: &Assembly, tolerance: f64) -> Result<Vec<Change>> {
        let kinds = [
            ChangeKind::Raise(ToolPart::Holder),
            ChangeKind::Narrow(ToolPart::Holder),
            ChangeKind::Raise(ToolPart::Shank),
            ChangeKind::Narrow(ToolPart::Shank),
            ChangeKind::Raise(ToolPart::Spindle),
        ];
        let (parted, meetings) = self.meetings(tool, self.tested.vectors())?;
        let mut changes = Vec::new();
        for kind in kinds {
            let (ChangeKind::Raise(part) | ChangeKind::Narrow(part)) = kind else { continue };
            if tool.has(part) {
                changes.extend(self.least_change(kind, tool, (&parted, &meetings), tolerance)?);
            }
        }
        Ok(changes)
    }

    /// The least change of one kind, proved.
    fn least_change(
        &self,
        kind: ChangeKind,
        tool: &Assembly,
        (parted, meetings): (&ShrunkTool, &[Meeting]),
        tolerance: f64,
    ) -> Result<Option<Change>> {
        let fine = if tolerance > 0.0 { 2.0 * tolerance } else { FINE_POINTS_MM };
        let over = self.tested.vectors().iter().zip(meetings);
        let over = over.filter_map(|(d, meeting)| Some((amount(kind, parted, meeting)?, *d)));
        let mut best = over.reduce(|a, b| if b.0 < a.0 { b } else { a });
        let mut is_least = false;
        for _ in 0..ROUNDS {
            let less = best.map_or_else(|| most(kind, tool), |(by, _)| by - fine);
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
        let Some((by, direction)) = best else { return Ok(None) };
        let by_mm = ((by + BEYOND_MM) / ROUND_MM).ceil() * ROUND_MM;
        let Ok(changed) = changed(kind, tool, by_mm) else { return Ok(None) };
        let direction = self.proved(&changed, direction)?;
        let of = |direction| Change {
            kind,
            by_mm,
            longer_mm: 0.0,
            is_least,
            tool: changed.clone(),
            direction,
        };
        Ok(direction.map(of))
    }

    /// A direction in which the changed tool may stand: the one of its label, or this one.
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

    /// The largest of the smaller cutters that may stand here, with a longer stick-out if nothing else does.
    fn smaller_diameter(&self, tool: &Assembly) -> Result<Option<Change>> {
        let kind = ChangeKind::Diameter;
        let by_mm = |factor: f64| diameter(tool) * (1.0 - factor);
        if let Some((factor, tool, direction)) = self.largest_end(tool, 0.0)? {
            let (by_mm, longer_mm, is_least) = (by_mm(factor), 0.0, true);
            let direction = self.proved(&tool, direction)?;
            return Ok(direction.map(|direction| Change {
                kind,
                by_mm,
                longer_mm,
                is_least,
                tool,
                direction,
            }));
        }
        let Some((factor, ..)) = self.largest_end(tool, MOST_MM)? else { return Ok(None) };
        let held = tool.with_smaller_end(factor)?;
        let (parted, meetings) = self.meetings(&held, self.tested.vectors())?;
        let tolerance = self.label(&held, self.query.directions, Between::None)?.tolerance;
        let longer = ChangeKind::Raise(ToolPart::Holder);
        let raised = self.least_change(longer, &held, (&parted, &meetings), tolerance)?;
        let both = |raised: Change| Change {
            kind,
            longer_mm: raised.by_mm,
            by_mm: by_mm(factor),
            ..raised
        };
        Ok(raised.map(both))
    }

    /// The largest share of the diameter that fits with a stick-out longer by this, the tool, and a direction.
    fn largest_end(&self, tool: &Assembly, longer: f64) -> Result<Option<(f64, Assembly, Vec3)>> {
        let share = |k: usize| k as f64 / N_SIZES as f64;
        // What the smallest cutter does not reach, no larger one does.
        if self.with_end(tool, share(1), longer)?.is_none() {
            return Ok(None);
        }
        let (mut fails, mut found) = (1.0, None);
        for k in (1..N_SIZES).rev() {
            found = self.with_end(tool, share(k), longer)?;
            if found.is_some() {
                break;
            }
            fails = share(k);
        }
        let Some(mut fits) = found else { return Ok(None) };
        while (fails - fits.0) * diameter(tool) > FINE_MM {
            let middle = 0.5 * (fits.0 + fails);
            match self.with_end(tool, middle, longer)? {
                Some(larger) => fits = larger,
                None => fails = middle,
            }
        }
        Ok(Some(fits))
    }

    /// The tool with a smaller end and a longer stick-out, if it may stand here.
    fn with_end(
        &self,
        tool: &Assembly,
        share: f64,
        longer: f64,
    ) -> Result<Option<(f64, Assembly, Vec3)>> {
        let changed = tool.with_smaller_end(share).and_then(|t| t.raised(ToolPart::Holder, longer));
        // Thinner than any cutter.
        let Ok(changed) = changed else { return Ok(None) };
        match self.label(&changed, self.query.directions, Between::Quick) {
            Ok(found) => Ok(found.witness.map(|direction| (share, changed, direction))),
            // Thinner than its tolerance.
            Err(Error::Argument { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// Diameter of the lower end, mm.
pub(super) fn diameter(tool: &Assembly) -> f64 {
    2.0 * (tool.tip()[0] + tool.tip()[1])
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
