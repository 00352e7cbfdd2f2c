//! The tool in a picture: which part of it holds a place.

use crate::tool::cutter::{Assembly, Profile, Step, ToolPart};

/// Radius over height of a tool, above its reference point.
pub(super) enum Shape {
    /// The lower end, a corner about a disc, and steps.
    Steps { corner: f64, side: f64, steps: Vec<(ToolPart, Step)> },
    /// The reference point is the tip.
    Profile { profile: Profile, radius: f64, flutes: f64, holder: f64, spindle: f64 },
}

impl Shape {
    /// With a margin about what does not cut.
    pub fn of(tool: &Assembly, clearance_mm: f64) -> Self {
        let held = tool.with_clearance(clearance_mm).and_then(|tool| tool.cutter()).ok();
        let profile = held.as_ref().and_then(|cutter| cutter.profile());
        if let (Some(own), Some(profile)) = (tool.profile(), profile) {
            let [holder, spindle] =
                tool.upper_heights_mm(clearance_mm).unwrap_or([f64::INFINITY; 2]);
            let lengths = [own.cutting_radius_mm(), own.flutes_mm()];
            let [radius, flutes] = lengths.map(|length| length + tool.allowance_mm());
            return Shape::Profile { profile: profile.clone(), radius, flutes, holder, spindle };
        }
        let [corner, side] = tool.tip();
        let steps = tool.parts(clearance_mm).unwrap_or_default();
        Shape::Steps { corner: corner + tool.allowance_mm(), side, steps }
    }

    /// How far the reference point is above the tip, mm.
    pub fn above_tip(&self) -> f64 {
        match self {
            Shape::Steps { corner, .. } => *corner,
            Shape::Profile { .. } => 0.0,
        }
    }

    /// Radius of the lower end, mm.
    pub fn radius(&self) -> f64 {
        match self {
            Shape::Steps { corner, side, .. } => corner + side,
            Shape::Profile { radius, .. } => *radius,
        }
    }

    /// Height of the holder, mm, if there is one.
    pub fn nose(&self) -> Option<f64> {
        match self {
            Shape::Steps { steps, .. } => {
                let holder = steps.iter().find(|(part, _)| *part >= ToolPart::Holder);
                holder.map(|(_, step)| step.height_mm)
            }
            Shape::Profile { holder, .. } => Some(*holder).filter(|height| height.is_finite()),
        }
    }

    /// The parts at a height with their radii: the first that holds a place is shown.
    pub fn at(&self, height: f64) -> Vec<(ToolPart, f64)> {
        match self {
            Shape::Steps { corner, side, steps } => {
                let below = height.min(0.0);
                let squared = corner * corner - below * below;
                let tip = (height < 2.0 * (corner + side) && squared >= 0.0)
                    .then(|| (ToolPart::Tip, side + squared.sqrt()));
                let steps = steps.iter().filter(|(_, step)| height > step.height_mm);
                tip.into_iter().chain(steps.map(|(part, step)| (*part, step.radius_mm))).collect()
            }
            Shape::Profile { profile, flutes, holder, spindle, .. } => {
                let part = match height {
                    z if z >= *spindle => ToolPart::Spindle,
                    z if z >= *holder => ToolPart::Holder,
                    z if z > *flutes => ToolPart::Shank,
                    _ => ToolPart::Tip,
                };
                let radius = profile.radius_at(height);
                if radius > 0.0 { vec![(part, radius)] } else { Vec::new() }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::Section;

    #[test]
    fn a_profile_is_shown_as_narrow_as_it_is() {
        let profile = "6:0 6:3 3:3 | 3:20 6:20".parse().unwrap();
        let tool = Assembly::from_profile(profile, &[Section::cylinder(30.0, 20.0)], 40.0).unwrap();
        let shape = Shape::of(&tool, 0.0);
        assert_eq!(shape.at(-0.1), []);
        assert_eq!(shape.at(1.0), [(ToolPart::Tip, 6.0)]);
        assert_eq!(shape.at(10.0), [(ToolPart::Shank, 3.0)]);
        assert_eq!(shape.at(30.0), [(ToolPart::Shank, 6.0)]);
        assert_eq!(shape.at(45.0), [(ToolPart::Holder, 20.0)]);
        assert_eq!(shape.at(75.0), [(ToolPart::Spindle, f64::INFINITY)]);
        assert_eq!((shape.above_tip(), shape.radius(), shape.nose()), (0.0, 6.0, Some(40.0)));
        // What leaves stock begins below the tip.
        let shape = Shape::of(&tool.clone().with_allowance(0.5).unwrap(), 0.0);
        assert_eq!((shape.at(-0.6), shape.at(1.0)), (vec![], vec![(ToolPart::Tip, 6.5)]));
        assert_eq!((shape.at(-0.4)[0].0, shape.radius()), (ToolPart::Tip, 6.5));
        // What the margin lowers and widens.
        assert_eq!(Shape::of(&tool, 1.0).at(39.5), [(ToolPart::Holder, 21.0)]);
    }
}
