//! Which changed tools are worth a proposal: those that a maker would sell.
//!
//! ```text
//! diameter of a smaller cutter: a sold size, at least 0.5 mm; sold are steps of 0.1 mm below 3 mm, of 0.5 mm to 12 mm,
//! of 1 mm above
//! length to diameter:           at most 10, of the cutter up to its shank or holder, and of the shank up to the holder
//! stick-out:                    at most the overall length, where that is stated
//! ```

use crate::tool::cutter::{Assembly, ToolPart};
use serde::{Deserialize, Serialize};

/// What a proposed tool must keep.
///
/// ```
/// use deepmill::access::surface::explain::Remedies;
///
/// let remedies = Remedies::default().with_least_diameter_mm(2.0); // this shop has no thinner cutter
/// assert_eq!(remedies.most_slender, 10.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Remedies {
    /// No cutter thinner than this is proposed, mm.
    pub least_diameter_mm: f64,
    /// No tool of a greater ratio of length to diameter is proposed; a tool that has a greater one already may keep it.
    pub most_slender: f64,
    /// Only the stick-out may change: the tool is one of a library, and no other exists.
    pub only_this_tool: bool,
}

impl Default for Remedies {
    fn default() -> Self {
        Remedies { least_diameter_mm: 0.5, most_slender: 10.0, only_this_tool: false }
    }
}

setters!(Remedies {
    with_least_diameter_mm(least_diameter_mm: f64),
    with_most_slender(most_slender: f64),
    with_only_this_tool(only_this_tool: bool),
});

/// A stick-out that would help and is not proposed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Stopped {
    /// The stick-out, mm.
    pub(crate) stick_out_mm: f64,
    /// The longest that is proposed, mm.
    pub(crate) most_mm: f64,
    /// Whether that is the overall length of the tool; else the ratio of length to diameter.
    pub(crate) by_overall_length: bool,
}

impl Stopped {
    /// In words.
    pub fn words(&self) -> String {
        let [needed, most] = [self.stick_out_mm, self.most_mm].map(super::short);
        match self.by_overall_length {
            true => format!(
                "a stick-out of {needed} mm, beyond the tool's overall length of {most} mm: take a longer tool"
            ),
            false => format!(
                "a stick-out of {needed} mm; more than {most} mm is too slender to be proposed"
            ),
        }
    }
}

/// Diameters that differ by less are the same, mm.
const SAME_MM: f64 = 1e-6;

/// The greatest sold diameter of at most `diameter_mm`; rounded so that it prints as it is sold.
///
/// ```
/// use deepmill::access::surface::explain::sold_diameter;
/// assert_eq!([1.98, 3.4, 11.99, 25.3].map(sold_diameter), [1.9, 3.0, 11.5, 25.0]);
/// ```
pub fn sold_diameter(diameter_mm: f64) -> f64 {
    let per_mm = match diameter_mm + SAME_MM {
        d if d < 3.0 => 10.0,
        d if d < 12.0 => 2.0,
        _ => 1.0,
    };
    ((diameter_mm + SAME_MM) * per_mm).floor() / per_mm
}

impl Remedies {
    /// The sold diameters below this one, from the greatest down.
    pub(super) fn smaller_diameters(&self, diameter_mm: f64) -> Vec<f64> {
        let next = |d: &f64| Some(sold_diameter(d - 2.0 * SAME_MM));
        let sizes = std::iter::successors(next(&diameter_mm), next);
        sizes.take_while(|d| *d > 0.0 && *d >= self.least_diameter_mm - SAME_MM).collect()
    }

    /// Ratio of length to diameter that a change of `tool` may have: no greater one than it has, if that is beyond the
    /// bound.
    fn ratio(&self, tool: &Assembly) -> f64 {
        self.most_slender.max(slenderness(tool))
    }

    /// Whether a cutter like this would be made, whatever its stick-out.
    pub(super) fn makes(&self, tool: &Assembly) -> bool {
        cutter_ratio(tool) <= self.most_slender + SAME_MM || first_shank(tool).is_none()
    }

    /// The longest stick-out that a new tool may have, mm, and whether its overall length is what bounds it.
    pub(super) fn longest(&self, tool: &Assembly) -> (f64, bool) {
        longest(tool, self.most_slender)
    }

    /// As [`Remedies::longest`], of a tool that someone has.
    pub(super) fn longest_of_own(&self, tool: &Assembly) -> (f64, bool) {
        longest(tool, self.ratio(tool))
    }

    /// By how much the shank may begin higher, mm.
    pub(super) fn most_neck(&self, tool: &Assembly) -> f64 {
        let begins = first_shank(tool).unwrap_or(f64::INFINITY);
        let by_stick_out = self.longest_of_own(tool).0 - tool.stick_out_mm();
        (self.ratio(tool) * diameter(tool) - begins).min(by_stick_out)
    }
}

fn longest(tool: &Assembly, ratio: f64) -> (f64, bool) {
    let (by_ratio, overall) = (ratio * widest_of_body(tool), tool.most_stick_out_mm());
    (by_ratio.min(overall), overall <= by_ratio)
}

/// Diameter of the lower end, mm.
pub(super) fn diameter(tool: &Assembly) -> f64 {
    2.0 * (tool.tip()[0] + tool.tip()[1])
}

/// Diameter of the body at its upper end, mm.
fn widest_of_body(tool: &Assembly) -> f64 {
    tool.body().iter().map(|step| 2.0 * step.radius_mm).fold(diameter(tool), f64::max)
}

/// Where the body first is wider than its lower end, mm above the tip.
fn first_shank(tool: &Assembly) -> Option<f64> {
    let is_wider = |radius: f64| 2.0 * radius > diameter(tool) * (1.0 + SAME_MM);
    tool.has(ToolPart::Shank)
        .then(|| tool.body().iter().find(|step| is_wider(step.radius_mm)).map(|s| s.height_mm))
        .flatten()
}

/// Length of the cutter, up to its shank or holder, by its diameter.
fn cutter_ratio(tool: &Assembly) -> f64 {
    let end = first_shank(tool).map_or(tool.stick_out_mm(), |h| h.min(tool.stick_out_mm()));
    end / diameter(tool)
}

/// The greatest ratio of length to diameter: of the cutter and, up to the holder, of the whole body.
fn slenderness(tool: &Assembly) -> f64 {
    cutter_ratio(tool).max(tool.stick_out_mm() / widest_of_body(tool))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::Step;

    fn tool(radius: f64, stick_out: f64, shank: Option<Step>) -> Assembly {
        let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
        let body = [step(2.0 * radius, radius)].into_iter().chain(shank).collect();
        let holder = vec![step(0.0, 20.0), step(30.0, f64::INFINITY)];
        Assembly::from_steps([radius, 0.0], body, holder, stick_out).unwrap()
    }

    #[test]
    fn sizes_are_those_that_are_sold_and_go_down_to_the_least() {
        let sizes = Remedies::default().smaller_diameters(6.0);
        assert_eq!(sizes[..8], [5.5, 5.0, 4.5, 4.0, 3.5, 3.0, 2.9, 2.8]);
        assert_eq!(sizes.last(), Some(&0.5));
        assert_eq!(Remedies::default().smaller_diameters(14.0)[..4], [13.0, 12.0, 11.5, 11.0]);
        let thin = Remedies { least_diameter_mm: 0.3, ..Remedies::default() };
        assert_eq!(thin.smaller_diameters(0.6), [0.5, 0.4, 0.3]);
        assert!(Remedies::default().smaller_diameters(0.5).is_empty());
    }

    #[test]
    fn lengths_are_at_most_ten_diameters_or_what_the_tool_has() {
        let remedies = Remedies::default();
        assert_eq!(remedies.longest_of_own(&tool(1.5, 9.0, None)), (30.0, false));
        let (own, _) = remedies.longest_of_own(&tool(1.5, 36.0, None));
        assert!((own - 36.0).abs() < 1e-9, "longer than ten diameters already: {own}");
        assert_eq!(remedies.longest(&tool(1.5, 36.0, None)), (30.0, false));
        let short = tool(1.5, 9.0, None).with_overall(20.0).unwrap();
        assert_eq!(remedies.longest_of_own(&short), (20.0, true));
        // A neck 2 mm wide and a shank of 6 mm from 15 mm on.
        let necked = tool(1.0, 40.0, Some(Step { height_mm: 15.0, radius_mm: 3.0 }));
        assert_eq!((remedies.longest_of_own(&necked).0, remedies.most_neck(&necked)), (60.0, 5.0));
        assert!(remedies.makes(&necked));
        let slender = tool(0.5, 40.0, Some(Step { height_mm: 15.0, radius_mm: 3.0 }));
        assert!(!remedies.makes(&slender));
    }
}
