//! The least changes of a tool given by its profile with which it reaches a site: every amount is labeled.
//!
//! ```text
//! for every kind of change:
//!     the most that is proposed does not help: none
//!     multiples of 0.01 mm, doubled until one helps; then halved between the last that does not and the first that does
//! if none helps: of the sold diameters the greatest that fits; of a drill the nearest to its own
//! each is labeled again, as any other tool, and left out if it is not accessible
//! ```

use super::profile::ProfileCase;
use super::remedies::diameter;
use super::{Change, ChangeKind, Remedies, Stopped};
use crate::Result;
use crate::tool::cutter::{Assembly, Profile, ToolPart};

/// Amounts are multiples of this, mm.
const PER_MM: f64 = 100.0;
/// No raise is longer, mm.
const MOST_MM: f64 = 1e3;

impl ProfileCase<'_> {
    /// Every kind of change that helps, the least first; and a stick-out that would help and is not proposed.
    pub fn changes(&self) -> Result<(Vec<Change>, Option<Stopped>)> {
        let (tool, remedies) = (self.query.tool, &self.query.remedies);
        let (mut changes, mut stopped) = (Vec::new(), None);
        match self.longer_stick_out()? {
            Ok(change) => changes.extend(change),
            Err(beyond) => stopped = Some(beyond),
        }
        if !remedies.only_this_tool {
            for (kind, most) in [
                (
                    ChangeKind::Narrow(ToolPart::Holder),
                    widest_of_holder(tool) - diameter(tool) / 2.0,
                ),
                (ChangeKind::Raise(ToolPart::Shank), remedies.most_longer_neck(tool)),
                (ChangeKind::Narrow(ToolPart::Shank), remedies.most_thinner_neck(tool)),
                (ChangeKind::Raise(ToolPart::Spindle), MOST_MM),
            ] {
                changes.extend(self.least(kind, tool, most)?);
            }
            if changes.is_empty() {
                changes.extend(self.other_diameter()?);
            }
        }
        changes.sort_by(|a, b| a.by_mm.total_cmp(&b.by_mm));
        Ok((changes, stopped))
    }

    /// The least stick-out; or the one that would help beyond what is proposed.
    fn longer_stick_out(&self) -> Result<std::result::Result<Option<Change>, Stopped>> {
        let (tool, kind) = (self.query.tool, ChangeKind::Raise(ToolPart::Holder));
        let (most_mm, by_overall_length) = self.query.remedies.longest_of_own(tool);
        let free = tool.clone().without_overall();
        let Some(change) = self.least(kind, &free, MOST_MM)? else { return Ok(Ok(None)) };
        let stick_out_mm = change.tool.stick_out_mm();
        match tool.raised(ToolPart::Holder, change.by_mm) {
            Ok(tool) if stick_out_mm <= most_mm => Ok(Ok(Some(Change { tool, ..change }))),
            _ => Ok(Err(Stopped { stick_out_mm, most_mm, by_overall_length })),
        }
    }

    /// The least change of one kind, of at most `most` mm.
    fn least(&self, kind: ChangeKind, tool: &Assembly, most: f64) -> Result<Option<Change>> {
        let most = (most.min(MOST_MM) * PER_MM).floor();
        if most < 1.0 {
            return Ok(None);
        }
        let most = most as u32;
        let changed = |n: u32| {
            let by = f64::from(n) / PER_MM;
            match kind {
                ChangeKind::Raise(part) => tool.raised(part, by),
                ChangeKind::Narrow(part) => tool.narrowed(part, by),
                ChangeKind::Diameter => tool.with_smaller_end(by),
            }
        };
        let helps = |n: u32| match changed(n) {
            Ok(tool) => Ok::<_, crate::Error>(self.reached_from(&tool)?.is_some()),
            Err(_) => Ok(false),
        };
        if !helps(most)? {
            return Ok(None);
        }
        let (mut low, mut high) = (0, 1);
        while high < most && !helps(high)? {
            (low, high) = (high, (2 * high).min(most));
        }
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if helps(middle)? { high = middle } else { low = middle }
        }
        self.proved(kind, f64::from(high) / PER_MM, changed(high)?)
    }

    /// The tool of another diameter: the greatest smaller one that is sold, of a drill the nearest.
    fn other_diameter(&self) -> Result<Option<Change>> {
        let (tool, remedies) = (self.query.tool, &self.query.remedies);
        let own = diameter(tool);
        let of_size = |size: f64| tool.with_smaller_end(size / own).ok();
        let fits = |size: f64| match of_size(size).filter(|tool| remedies.makes_neck(tool)) {
            Some(tool) => Ok::<_, crate::Error>(self.reached_from(&tool)?.is_some()),
            None => Ok(false),
        };
        let found = match tool.profile().is_some_and(Profile::is_drill) {
            true => first(&remedies.drills_near(own), fits)?,
            false => first(&remedies.smaller_diameters(own), fits)?,
        };
        let Some(size) = found else { return Ok(None) };
        let Some(changed) = of_size(size) else { return Ok(None) };
        self.proved(ChangeKind::Diameter, (own - diameter(&changed)).abs(), changed)
    }

    /// A change that helps, by a label like any other.
    fn proved(&self, kind: ChangeKind, by_mm: f64, tool: Assembly) -> Result<Option<Change>> {
        let (_, pose, _) = self.label(&tool, self.query.directions)?;
        let of =
            |direction| Change { kind, by_mm, longer_mm: 0.0, is_least: true, tool, direction };
        Ok(pose.map(|pose| of(pose.direction)))
    }
}

fn first(sizes: &[f64], fits: impl Fn(f64) -> Result<bool>) -> Result<Option<f64>> {
    for &size in sizes {
        if fits(size)? {
            return Ok(Some(size));
        }
    }
    Ok(None)
}

/// Greatest radius of the holder below the spindle, mm.
fn widest_of_holder(tool: &Assembly) -> f64 {
    let radii = tool.holder().iter().map(|step| step.radius_mm);
    radii.filter(|radius| radius.is_finite()).fold(0.0, f64::max)
}

impl Remedies {
    /// Of a neck the greatest ratio of length to diameter.
    fn neck_ratio(&self, tool: &Assembly) -> f64 {
        self.most_slender.max(neck_ratio(tool))
    }

    /// Whether a neck like this would be made.
    fn makes_neck(&self, tool: &Assembly) -> bool {
        neck_ratio(tool) <= self.most_slender * (1.0 + 1e-9)
    }

    /// By how much the neck may be thinner in radius, mm: no thinner than the thinnest cutter.
    fn most_thinner_neck(&self, tool: &Assembly) -> f64 {
        let Some(profile) = tool.profile() else { return 0.0 };
        let ([low, high], radius) = profile.neck();
        let length = high.min(tool.stick_out_mm()) - low;
        let least = (length / self.neck_ratio(tool)).max(self.least_diameter_mm);
        radius - 0.5 * least
    }

    /// By how much the neck may be longer, mm.
    fn most_longer_neck(&self, tool: &Assembly) -> f64 {
        let Some(profile) = tool.profile() else { return 0.0 };
        let ([low, high], radius) = profile.neck();
        if high >= tool.stick_out_mm() {
            return 0.0;
        }
        let by_neck = self.neck_ratio(tool) * 2.0 * radius - (high - low);
        by_neck.min(self.longest_of_own(tool).0 - tool.stick_out_mm())
    }

    /// Diameters of drills near this one, the nearest first.
    fn drills_near(&self, diameter_mm: f64) -> Vec<f64> {
        /// Sizes are sold in steps of 0.05 mm; farther off none is proposed.
        const STEPS_PER_MM: f64 = 20.0;
        const MOST_STEPS: i32 = 40;
        let nearest = (diameter_mm * STEPS_PER_MM).round();
        let size = |k: i32| (nearest + f64::from(k)) / STEPS_PER_MM;
        let mut sizes: Vec<f64> = (-MOST_STEPS..=MOST_STEPS).map(size).collect();
        sizes.retain(|d| *d >= self.least_diameter_mm && (d - diameter_mm).abs() > 1e-6);
        sizes.sort_by(|a, b| (a - diameter_mm).abs().total_cmp(&(b - diameter_mm).abs()));
        sizes
    }
}

/// Length of the neck, up to shank or holder, by its least diameter.
fn neck_ratio(tool: &Assembly) -> f64 {
    let Some(profile) = tool.profile() else { return 0.0 };
    let ([low, high], radius) = profile.neck();
    (high.min(tool.stick_out_mm()) - low) / (2.0 * radius)
}
