//! The parts of a tool from the tip upward, and tools that differ in one of them.

use super::{Assembly, raise};
use crate::tool::cutter::margins::{envelope, grown};
use crate::tool::cutter::{Cutter, Profile, Step, is_wider};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A part of a tool; the order is from the tip upward.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ToolPart {
    /// Ball, corner or flat that touches the site.
    Tip,
    /// Steps of the flutes that are no wider than the tip.
    Cutter,
    /// Other steps of the body: neck, shank, or the flank of a tapered end.
    Shank,
    /// Steps of the holder.
    Holder,
    /// What has no outer radius.
    Spindle,
}

impl ToolPart {
    /// Every part, from the tip upward.
    pub const ALL: [ToolPart; 5] =
        [ToolPart::Tip, ToolPart::Cutter, ToolPart::Shank, ToolPart::Holder, ToolPart::Spindle];

    /// `tip`, `cutter`, `shank`, `holder` or `spindle`.
    pub fn name(self) -> &'static str {
        match self {
            ToolPart::Tip => "tip",
            ToolPart::Cutter => "cutter",
            ToolPart::Shank => "shank",
            ToolPart::Holder => "holder",
            ToolPart::Spindle => "spindle",
        }
    }
}

/// No drill becomes wider by a greater factor.
const MOST_WIDER: f64 = 10.0;

impl fmt::Display for ToolPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Assembly {
    /// Every step with the part that it belongs to, heights above the reference point, lowest first, with a margin of
    /// `clearance_mm` for what does not cut ([`Assembly::with_clearance`]).
    ///
    /// # Errors
    /// As [`Assembly::with_clearance`].
    pub fn parts(&self, clearance_mm: f64) -> Result<Vec<(ToolPart, Step)>> {
        let held = self.with_clearance(clearance_mm)?;
        let cutting = grown(&held.cutting, held.allowance_mm).into_iter().zip(&held.cutting);
        let cutting = cutting.map(|(step, own)| (self.part_of_cutting(own), step));
        let upper = held.upper.iter().map(|step| (ToolPart::Shank, *step));
        let holder = held.holder.iter().map(|step| match step.radius_mm.is_finite() {
            true => (ToolPart::Holder, raise(step, self.stick_out_mm)),
            false => (ToolPart::Spindle, raise(step, self.stick_out_mm)),
        });
        let in_body = |step: &Step| held.body.contains(step);
        let body = cutting.chain(upper).filter(|(_, step)| in_body(step));
        let lower = |(part, step)| (part, raise(&step, -self.corner_mm));
        let mut parts: Vec<(ToolPart, Step)> = body.chain(holder).map(lower).collect();
        parts.sort_by(|a, b| a.1.height_mm.total_cmp(&b.1.height_mm).then(a.0.cmp(&b.0)));
        Ok(parts)
    }

    fn part_of_cutting(&self, step: &Step) -> ToolPart {
        if is_wider(step, self.end_mm()) { ToolPart::Shank } else { ToolPart::Cutter }
    }

    /// The steps wider than the tip: shank, and flank of a tapered end.
    fn shank_mut(&mut self) -> impl Iterator<Item = &mut Step> {
        let end = self.end_mm();
        self.cutting.iter_mut().chain(&mut self.upper).filter(move |step| is_wider(step, end))
    }

    /// Whether some step belongs to the part; of the shank, whether some is wider than the tip. A tool given by its
    /// profile has a tip, which is all that cuts, and a shank, which is all else below the holder.
    pub fn has(&self, part: ToolPart) -> bool {
        let is_shank = |step: &Step| is_wider(step, self.end_mm());
        match part {
            ToolPart::Tip => true,
            ToolPart::Cutter | ToolPart::Shank if self.profile.is_some() => part == ToolPart::Shank,
            ToolPart::Cutter => self.cutting.iter().any(|step| !is_shank(step)),
            ToolPart::Shank => self.cutting.iter().chain(&self.upper).any(is_shank),
            ToolPart::Holder => self.holder.iter().any(|step| step.radius_mm.is_finite()),
            ToolPart::Spindle => self.holder.iter().any(|step| step.radius_mm == f64::INFINITY),
        }
    }

    /// What is below `part`, with a margin; `None` if that is no step. Of a tool given by its profile the shank and
    /// what is below it are no tool by themselves.
    ///
    /// # Errors
    /// As [`Assembly::with_clearance`] and [`Assembly::cutter`].
    pub fn below(&self, part: ToolPart, clearance_mm: f64) -> Result<Option<Cutter>> {
        if self.profile.is_some() {
            return self.profile_below(part, clearance_mm);
        }
        let parts = self.parts(clearance_mm)?.into_iter().filter(|(p, _)| *p < part);
        let steps = envelope(parts.map(|(_, step)| step).collect());
        match steps.is_empty() {
            true => Ok(None),
            false => {
                let corner_mm = self.corner_mm + self.allowance_mm;
                Cutter::from_steps(corner_mm, self.side_mm, steps).map(Some)
            }
        }
    }

    /// This tool with `part` and everything above it raised: a longer neck and stick-out, a longer stick-out, a longer
    /// holder. Of a tool given by its profile the shank begins where the profile widens for the last time.
    ///
    /// # Errors
    /// If the part is none of shank, holder and spindle, the stick-out would be beyond the overall length
    /// ([`Assembly::with_overall`]), or as
    /// [`Assembly::cutter`].
    pub fn raised(&self, part: ToolPart, by_mm: f64) -> Result<Self> {
        let mut tool = self.clone();
        match (part, &self.profile) {
            (ToolPart::Tip | ToolPart::Cutter, _) => return Err(unchangeable(part)),
            (ToolPart::Shank, Some(profile)) => {
                tool = self.with_changed(profile.with_longer_neck(by_mm)?);
                tool.stick_out_mm += by_mm;
            }
            (ToolPart::Shank, None) => {
                let flutes_mm = tool.flutes_mm();
                tool.shank_mut().for_each(|step| step.height_mm += by_mm);
                if tool.flutes_mm() > flutes_mm {
                    // The neck begins where the shank did.
                    let radius_mm = tool.end_mm();
                    tool.upper.insert(0, Step { height_mm: flutes_mm, radius_mm });
                }
                tool.stick_out_mm += by_mm;
            }
            (ToolPart::Holder, _) => tool.stick_out_mm += by_mm,
            (ToolPart::Spindle, _) => {
                let spindle = tool.holder.iter_mut().filter(|step| step.radius_mm == f64::INFINITY);
                spindle.for_each(|step| step.height_mm += by_mm);
            }
        }
        tool.checked()
    }

    /// This tool with all radii of `part` less by `by_mm`; none less than that of the tip. Of a tool given by its
    /// profile the neck takes the place of the shank, and may be thinner than the tip.
    ///
    /// # Errors
    /// If the part is neither shank nor holder, or as [`Assembly::cutter`].
    pub fn narrowed(&self, part: ToolPart, by_mm: f64) -> Result<Self> {
        let least = self.end_mm();
        let narrow = |step: &mut Step| step.radius_mm = (step.radius_mm - by_mm).max(least);
        let mut tool = self.clone();
        match (part, &self.profile) {
            (ToolPart::Shank, Some(profile)) => {
                tool = self.with_changed(profile.with_thinner_neck(by_mm)?);
            }
            (ToolPart::Shank, None) => tool.shank_mut().for_each(narrow),
            (ToolPart::Holder, _) => {
                let finite = tool.holder.iter_mut().filter(|step| step.radius_mm.is_finite());
                finite.for_each(narrow);
            }
            (part, _) => return Err(unchangeable(part)),
        }
        tool.checked()
    }

    /// This tool with tip and cutter less in diameter by a factor; shank, holder and stick-out stay. Of a tool given by
    /// its profile all that cuts is scaled, in radius and height, and its neck is as much thinner; a drill may become
    /// wider.
    ///
    /// # Errors
    /// If the factor is not above 0 and at most 1, of a drill at most 10, or as [`Assembly::cutter`].
    pub fn with_smaller_end(&self, factor: f64) -> Result<Self> {
        let is_drill = self.profile.as_ref().is_some_and(Profile::is_drill);
        if !(factor > 0.0 && factor <= if is_drill { MOST_WIDER } else { 1.0 }) {
            let expected = "above 0, at most 1";
            return Err(Error::argument("factor", factor, expected, "1 changes nothing"));
        }
        if let Some(profile) = &self.profile {
            return self.with_changed(profile.with_scaled_end(factor)?).checked();
        }
        let mut tool = Assembly {
            corner_mm: factor * self.corner_mm,
            side_mm: factor * self.side_mm,
            ..self.clone()
        };
        let end = self.end_mm();
        for step in tool.cutting.iter_mut().filter(|step| !is_wider(step, end)) {
            step.radius_mm *= factor;
            // Where contact ends.
            step.height_mm -= (2.0 * end * (1.0 - factor)).min(step.height_mm);
        }
        // Neck and shank of the cutter's own diameter are part of it.
        let narrow = tool.upper.iter_mut().filter(|step| !is_wider(step, end));
        narrow.for_each(|step| step.radius_mm *= factor);
        tool.checked()
    }

    fn checked(self) -> Result<Self> {
        let tool = self.whole();
        tool.cutter()?;
        tool.within_overall()
    }
}

fn unchangeable(part: ToolPart) -> Error {
    Error::argument("part", part, "a part that can be changed alone", "take the holder")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::{CutterParams, Section, TipShape};

    fn plain() -> Assembly {
        let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
        let holder = vec![step(0.0, 40.0), step(5.0, f64::INFINITY)];
        Assembly::from_steps([1.5, 0.0], vec![step(3.0, 1.5)], holder, 9.0).unwrap()
    }

    fn lengths(tool: &Assembly) -> [f64; 4] {
        tool.cutter().unwrap().as_ball_end().unwrap().to_array()
    }

    #[test]
    fn changes_of_a_plain_tool_are_changes_of_its_four_lengths() {
        let tool = plain();
        assert_eq!(lengths(&tool), [1.5, 6.0, 40.0, 5.0]);
        assert_eq!(lengths(&tool.raised(ToolPart::Holder, 2.5).unwrap()), [1.5, 8.5, 40.0, 5.0]);
        assert_eq!(lengths(&tool.raised(ToolPart::Spindle, 2.0).unwrap()), [1.5, 6.0, 40.0, 7.0]);
        assert_eq!(lengths(&tool.narrowed(ToolPart::Holder, 8.0).unwrap()), [1.5, 6.0, 32.0, 5.0]);
        // The nose stays where it is.
        assert_eq!(lengths(&tool.with_smaller_end(0.5).unwrap()), [0.75, 7.5, 40.0, 5.0]);
        assert!(tool.raised(ToolPart::Tip, 1.0).is_err() && tool.with_smaller_end(0.0).is_err());
        assert!(tool.narrowed(ToolPart::Spindle, 1.0).is_err());
        assert!(tool.raised(ToolPart::Holder, 1e9).is_err());
    }

    #[test]
    fn parts_are_in_order_and_make_the_whole() {
        let shank = [Section::cylinder(20.0, 1.5), Section::cylinder(20.0, 3.0)];
        let tip = TipShape::Straight { radius_mm: 1.5, corner_mm: 1.5 };
        let tool = Assembly::new(tip, &shank, &[Section::cylinder(9.0, 12.0)], 35.0).unwrap();
        let parts = tool.parts(0.1).unwrap();
        let names: Vec<&str> = parts.iter().map(|(part, _)| part.name()).collect();
        assert_eq!(names, ["cutter", "shank", "holder", "spindle"]);
        let whole = tool.cutter().unwrap().with_clearance(0.1).unwrap();
        for ((_, step), expected) in parts.iter().zip(whole.steps()) {
            assert!((step.height_mm - expected.height_mm).abs() < 1e-12);
            assert!((step.radius_mm - expected.radius_mm).abs() < 1e-12 || step.radius_mm > 1e9);
        }
        let below = |part| tool.below(part, 0.0).unwrap().map(|cutter| cutter.steps().len());
        assert_eq!(ToolPart::ALL.map(below), [None, None, Some(1), Some(2), Some(3)]);
        let thin = tool.narrowed(ToolPart::Shank, 9.0).unwrap();
        assert_eq!(thin.cutter().unwrap().steps().len(), 3, "as thin as the cutter");
        let long = tool.raised(ToolPart::Shank, 4.0).unwrap();
        assert_eq!((long.body()[1].height_mm, long.stick_out_mm()), (24.0, 39.0));
        assert!(tool.has(ToolPart::Shank) && !plain().has(ToolPart::Shank));
        let params = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
        assert_eq!(plain().below(ToolPart::Tip, 0.0).unwrap(), None);
        assert_eq!(params.to_array(), lengths(&plain()));
    }
}
