//! A tool in its holder, as makers describe it: sections of cylinders and cones, and how far it sticks out.
//!
//! # Definition
//!
//! The *body* is what is clamped: flutes, neck, shank, without an upper end. The *holder* begins at its nose, `stick_out` above the
//! tip; above its top everything is spindle. Both become [`Step`]s:
//!
//! ```text
//! widest = 0
//! for every section from below, of radius a at its lower and b at its upper end:
//!     b ≤ a (cylinder): a step of radius a at its lower end, if a > widest
//!     b > a (cone):     cut off what is narrower than `widest`; n steps of equal height, each as wide as the cone at its upper end
//!     widest = the greater of a, b and widest
//! ```
//!
//! So no step is thinner than the tool, and none is wider than it by more than [`Assembly::excess_mm`]: a cone whose radius grows by `g`
//! over `n` steps is exceeded by at most `g/n`. What is narrower than something below it counts as wide as that.
//! A tool of any stick-out is the body together with the holder at that height, so collisions only decrease with the stick-out.

mod parts;

pub use parts::ToolPart;

use super::{Cutter, MAX_LENGTH_MM, Step, positive};
use crate::{Error, Result};
use serde::Serialize;

/// A cylinder or cone of a solid of revolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Height, mm.
    pub length_mm: f64,
    /// Radius at its lower end, mm.
    pub lower_radius_mm: f64,
    /// Radius at its upper end, mm.
    pub upper_radius_mm: f64,
}

impl Section {
    /// A cylinder.
    pub fn cylinder(length_mm: f64, radius_mm: f64) -> Self {
        Section { length_mm, lower_radius_mm: radius_mm, upper_radius_mm: radius_mm }
    }

    fn check(&self, name: &'static str) -> Result<()> {
        positive(name, self.length_mm)?;
        positive(name, self.lower_radius_mm)?;
        positive(name, self.upper_radius_mm)
    }
}

/// The lower end of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipShape {
    /// A disc of `radius_mm` whose edge is rounded by `corner_mm` (0: flat end, the radius: ball end), below a cylinder.
    Straight {
        /// Radius of the cylinder, mm.
        radius_mm: f64,
        /// Radius of the corner, mm.
        corner_mm: f64,
    },
    /// As `Straight`, below a cone. A corner of the whole radius is a ball to which the cone is tangent; a lesser one is tangent to the cone
    /// and to the disc, and `radius_mm` is that of the cone at the height of the tip.
    Tapered {
        /// Radius of the ball, or of the cone at the height of the tip, mm.
        radius_mm: f64,
        /// Radius of the corner, mm.
        corner_mm: f64,
        /// Angle between flank and axis, radians.
        taper_rad: f64,
        /// Height of the flutes above the tip, mm.
        flutes_mm: f64,
    },
}

/// A checked tool in its holder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Assembly {
    corner_mm: f64,
    side_mm: f64,
    body: Vec<Step>,
    holder: Vec<Step>,
    stick_out_mm: f64,
    excess_mm: f64,
    /// From tip to end, holder and spindle left out; `None` where no one has stated it.
    overall_mm: Option<f64>,
}

/// Most steps of all cones of a body, and of a holder.
const CONE_STEPS: usize = 24;
/// Cones are not cut finer than to this excess, mm.
const FINE_MM: f64 = 0.05;
/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-6;
/// By how much the excess grows until the steps are few enough.
const COARSER: f64 = 1.1;

impl Assembly {
    /// `body` goes on above the tip, for a straight one from the tip on and for a tapered one from the end of its flutes; its last section has no
    /// upper end. `holder` is from the nose upward.
    ///
    /// # Errors
    /// If a length is not a number from 0.0001 mm to 10 m, a corner is greater than its radius, a taper is not below a right angle, there is
    /// no holder, or there are too many sections.
    pub fn new(
        tip: TipShape,
        body: &[Section],
        holder: &[Section],
        stick_out_mm: f64,
    ) -> Result<Self> {
        positive("stick-out", stick_out_mm)?;
        body.iter().try_for_each(|section| section.check("length or radius of the tool"))?;
        holder.iter().try_for_each(|section| section.check("length or radius of the holder"))?;
        if holder.is_empty() {
            let remedy = "give the segments of the holder from its nose upward";
            return Err(Error::argument("holder", "without segments", "1 or more", remedy));
        }
        let lower = LowerEnd::of(tip)?;
        let mut sections = lower.cone.into_iter().collect::<Vec<_>>();
        let start_mm = lower.start_mm;
        sections.extend_from_slice(body);
        let widest = if lower.cone.is_none() { lower.radius_mm } else { 0.0 };
        let (mut body, body_excess) = steps(&sections, start_mm, widest);
        if lower.cone.is_none() {
            // Up to the ball's top there is contact, as for the cutters of four lengths.
            body.insert(0, Step { height_mm: 2.0 * lower.radius_mm, radius_mm: lower.radius_mm });
        }
        let (mut holder_steps, holder_excess) = steps(holder, 0.0, 0.0);
        let top = holder.iter().map(|section| section.length_mm).sum();
        holder_steps.push(Step { height_mm: top, radius_mm: f64::INFINITY });
        let assembly = Assembly {
            corner_mm: lower.corner_mm,
            side_mm: lower.side_mm,
            body: envelope(body),
            holder: holder_steps,
            stick_out_mm,
            excess_mm: body_excess.max(holder_excess),
            overall_mm: None,
        };
        assembly.cutter().map(|_| assembly)
    }

    /// From steps: those of the body above the tip, those of the holder above its nose.
    ///
    /// # Errors
    /// As [`Cutter::from_steps`].
    pub fn from_steps(
        [corner_mm, side_mm]: [f64; 2],
        body: Vec<Step>,
        holder: Vec<Step>,
        stick_out_mm: f64,
    ) -> Result<Self> {
        positive("stick-out", stick_out_mm)?;
        let excess_mm = 0.0;
        let overall_mm = None;
        let assembly =
            Assembly { corner_mm, side_mm, body, holder, stick_out_mm, excess_mm, overall_mm };
        assembly.cutter().map(|_| assembly)
    }

    /// The same tool, of which the overall length is stated: it cannot stick out further.
    ///
    /// # Errors
    /// If the length is not a number from 0.0001 mm to 10 m, or less than the stick-out.
    pub fn with_overall(self, overall_mm: f64) -> Result<Self> {
        positive("overall length", overall_mm)?;
        Assembly { overall_mm: Some(overall_mm), ..self }.within_overall()
    }

    /// Length from the tip to the tool's end, mm, where it is stated.
    pub fn overall_mm(&self) -> Option<f64> {
        self.overall_mm
    }

    /// No stick-out is longer, mm: the overall length; infinite where it is not stated.
    pub fn most_stick_out_mm(&self) -> f64 {
        self.overall_mm.unwrap_or(f64::INFINITY)
    }

    pub(crate) fn without_overall(self) -> Self {
        Assembly { overall_mm: None, ..self }
    }

    fn within_overall(self) -> Result<Self> {
        match self.overall_mm {
            Some(overall) if self.stick_out_mm > overall + SAME_MM => {
                let expected = format!("at most the overall length of {overall} mm");
                let remedy = "correct one of them, or take a longer tool";
                Err(Error::argument("stick-out", self.stick_out_mm, expected, remedy))
            }
            _ => Ok(self),
        }
    }

    /// Height of the holder's nose above the tip, mm.
    pub fn stick_out_mm(&self) -> f64 {
        self.stick_out_mm
    }

    /// No step is wider than the tool by more than this, mm.
    pub fn excess_mm(&self) -> f64 {
        self.excess_mm
    }

    /// Steps of the body, heights above the tip.
    pub fn body(&self) -> &[Step] {
        &self.body
    }

    /// Steps of the holder and the spindle, heights above the nose.
    pub fn holder(&self) -> &[Step] {
        &self.holder
    }

    /// Radius of the tip's corner and distance of its center from the axis, mm.
    pub fn tip(&self) -> [f64; 2] {
        [self.corner_mm, self.side_mm]
    }

    /// The whole tool.
    ///
    /// # Errors
    /// If it has more steps than a cutter may have, or a length is beyond 10 m.
    pub fn cutter(&self) -> Result<Cutter> {
        self.at_stick_out(self.stick_out_mm)
    }

    /// The whole tool with its holder's nose at another height above the tip.
    ///
    /// # Errors
    /// As [`Assembly::cutter`].
    pub fn at_stick_out(&self, stick_out_mm: f64) -> Result<Cutter> {
        let raised = self.holder.iter().map(|step| raise(step, stick_out_mm));
        self.cutter_of(self.body.iter().copied().chain(raised).collect())
    }

    /// The body alone, without an upper end.
    ///
    /// # Errors
    /// As [`Assembly::cutter`].
    pub fn body_cutter(&self) -> Result<Cutter> {
        self.cutter_of(self.body.clone())
    }

    /// Every step begins lower by a margin and is as much wider, as [`Cutter::with_clearance`]; radii stop at 0.
    ///
    /// # Errors
    /// If the margin is not a number or beyond 10 m.
    pub fn with_clearance(&self, clearance_mm: f64) -> Result<Self> {
        let body = super::grown(&self.body, clearance_mm)?;
        let holder = super::grown(&self.holder, clearance_mm)?;
        Ok(Assembly { body, holder, ..self.clone() })
    }

    fn cutter_of(&self, steps: Vec<Step>) -> Result<Cutter> {
        let lowered = envelope(steps).iter().map(|step| raise(step, -self.corner_mm)).collect();
        Cutter::from_steps(self.corner_mm, self.side_mm, lowered)
    }
}

fn raise(step: &Step, by_mm: f64) -> Step {
    Step { height_mm: step.height_mm + by_mm, ..*step }
}

/// The steps that widen the tool, from below.
fn envelope(mut steps: Vec<Step>) -> Vec<Step> {
    steps.sort_by(|a, b| {
        a.height_mm.total_cmp(&b.height_mm).then(b.radius_mm.total_cmp(&a.radius_mm))
    });
    let mut widest = 0.0;
    steps.retain(|step| {
        let widens = step.radius_mm > widest;
        widest = step.radius_mm.max(widest);
        widens
    });
    steps
}

/// A part of a section that widens the tool.
struct Growth {
    start_mm: f64,
    end_mm: f64,
    from_mm: f64,
    to_mm: f64,
}

/// Steps that enclose the sections, and by how much they exceed them.
fn steps(sections: &[Section], start_mm: f64, mut widest: f64) -> (Vec<Step>, f64) {
    let mut parts = Vec::new();
    let mut height = start_mm;
    for &Section { length_mm, lower_radius_mm: a, upper_radius_mm: b } in sections {
        let end_mm = height + length_mm;
        if b > a && b > widest {
            let share = ((widest - a) / (b - a)).max(0.0);
            let from_mm = widest.max(a);
            parts.push(Growth { start_mm: height + share * length_mm, end_mm, from_mm, to_mm: b });
        } else if a > widest {
            parts.push(Growth { start_mm: height, end_mm, from_mm: a, to_mm: a });
        }
        widest = widest.max(a).max(b);
        height = end_mm;
    }
    let n_steps = |part: &Growth, excess: f64| {
        (((part.to_mm - part.from_mm) / excess).ceil() as usize).max(1)
    };
    let mut excess = FINE_MM;
    let is_many = |excess: f64| {
        let cones = parts.iter().filter(|part| part.to_mm > part.from_mm);
        let n: usize = cones.clone().map(|part| n_steps(part, excess)).sum();
        n > CONE_STEPS.max(cones.count())
    };
    while is_many(excess) {
        excess *= COARSER;
    }
    let (mut steps, mut worst) = (Vec::new(), 0.0f64);
    for part in &parts {
        let n = n_steps(part, excess);
        let (rise, growth) =
            ((part.end_mm - part.start_mm) / n as f64, (part.to_mm - part.from_mm) / n as f64);
        worst = worst.max(growth);
        steps.extend((0..n).map(|k| Step {
            height_mm: part.start_mm + k as f64 * rise,
            radius_mm: if k + 1 == n { part.to_mm } else { part.from_mm + (k + 1) as f64 * growth },
        }));
    }
    (steps, worst)
}

/// Lower end of a tool as its contact and, if tapered, its flank.
struct LowerEnd {
    corner_mm: f64,
    side_mm: f64,
    radius_mm: f64,
    /// Height of the cone's or the body's lower end above the tip, mm.
    start_mm: f64,
    cone: Option<Section>,
}

/// A corner within this of the radius, as a share of it, makes a ball.
const BALL: f64 = 1e-6;

impl LowerEnd {
    fn of(tip: TipShape) -> Result<Self> {
        let (TipShape::Straight { radius_mm, corner_mm }
        | TipShape::Tapered { radius_mm, corner_mm, .. }) = tip;
        positive("cutter radius", radius_mm)?;
        let is_ball = (corner_mm - radius_mm).abs() <= BALL * radius_mm;
        let corner_mm = if is_ball { radius_mm } else { corner_mm };
        if !(0.0..=radius_mm).contains(&corner_mm) {
            let expected = format!("between 0 and the cutter's radius of {radius_mm} mm");
            let remedy = "a ball end has the whole radius, a flat end 0";
            return Err(Error::argument("corner radius", corner_mm, expected, remedy));
        }
        let TipShape::Tapered { taper_rad, flutes_mm, .. } = tip else {
            let side_mm = radius_mm - corner_mm;
            return Ok(LowerEnd { corner_mm, side_mm, radius_mm, start_mm: 0.0, cone: None });
        };
        if !(taper_rad > 0.0 && taper_rad < std::f64::consts::FRAC_PI_2) {
            let found = format!("{} degrees", taper_rad.to_degrees());
            let remedy = "give the angle between flank and axis";
            return Err(Error::argument("taper", found, "between 0 and 90 degrees", remedy));
        }
        let [sin, cos, tan] = [libm::sin(taper_rad), libm::cos(taper_rad), libm::tan(taper_rad)];
        let side_mm = if is_ball { 0.0 } else { radius_mm + corner_mm * (tan - 1.0 / cos) };
        let start_mm = corner_mm * (1.0 - sin);
        let lower_radius_mm = side_mm + corner_mm * cos;
        let length_mm = flutes_mm - start_mm;
        if !(length_mm > 0.0 && flutes_mm <= MAX_LENGTH_MM) {
            let expected = format!("more than the tip's height of {start_mm} mm, at most 10 m");
            let remedy = "give the length of the flutes from the tip";
            return Err(Error::argument("flute length", flutes_mm, expected, remedy));
        }
        let upper_radius_mm = lower_radius_mm + length_mm * tan;
        positive("radius at the top of the taper", upper_radius_mm)?;
        let cone = Some(Section { length_mm, lower_radius_mm, upper_radius_mm });
        Ok(LowerEnd { corner_mm, side_mm, radius_mm: corner_mm + side_mm, start_mm, cone })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutter::CutterParams;

    fn radius_at(steps: &[Step], height: f64) -> f64 {
        steps.iter().filter(|s| s.height_mm <= height).map(|s| s.radius_mm).fold(0.0, f64::max)
    }

    fn er20() -> Vec<Section> {
        let segment = |length_mm, lower: f64, upper: f64| Section {
            length_mm,
            lower_radius_mm: 0.5 * lower,
            upper_radius_mm: 0.5 * upper,
        };
        vec![segment(8.0, 28.0, 34.0), segment(22.0, 34.0, 34.0), segment(40.0, 34.0, 50.0)]
    }

    #[test]
    fn a_ball_in_a_cylindrical_holder_is_the_cutter_of_four_lengths() {
        let tip = TipShape::Straight { radius_mm: 1.5, corner_mm: 1.5 };
        let body = [Section::cylinder(60.0, 1.5)];
        let assembly = Assembly::new(tip, &body, &[Section::cylinder(5.0, 40.0)], 9.0).unwrap();
        let params = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
        assert_eq!(assembly.cutter().unwrap(), Cutter::ball_end(params).unwrap());
        assert_eq!(assembly.excess_mm(), 0.0);
        assert_eq!(assembly.body_cutter().unwrap().steps().len(), 1);
    }

    #[test]
    fn steps_enclose_the_sections_and_exceed_them_by_no_more_than_is_said() {
        let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 3.0 };
        let body = [
            Section::cylinder(12.0, 3.0),
            Section::cylinder(18.0, 2.9),
            Section::cylinder(50.0, 4.0),
        ];
        let assembly = Assembly::new(tip, &body, &er20(), 45.0).unwrap();
        assert!(
            assembly.excess_mm() > 0.0 && assembly.excess_mm() < 0.6,
            "{}",
            assembly.excess_mm()
        );
        assert!(assembly.cutter().unwrap().steps().len() <= 30);
        let true_radius = |mut z: f64| {
            for Section { length_mm, lower_radius_mm, upper_radius_mm } in er20() {
                if z < length_mm {
                    return lower_radius_mm + z / length_mm * (upper_radius_mm - lower_radius_mm);
                }
                z -= length_mm;
            }
            f64::INFINITY
        };
        for k in 0..1400 {
            let z = 0.05 * f64::from(k);
            let (found, least) = (radius_at(assembly.holder(), z), true_radius(z));
            assert!(
                found >= least - 1e-12 && found - least <= assembly.excess_mm() + 1e-9
                    || found == least,
                "{z}: {found} {least}"
            );
        }
        // The neck counts as wide as the flutes below it.
        assert_eq!(
            assembly.body().iter().map(|s| (s.height_mm, s.radius_mm)).collect::<Vec<_>>(),
            [(6.0, 3.0), (30.0, 4.0)]
        );
    }

    #[test]
    fn a_tapered_ball_is_tangent_to_its_cone_and_enclosed() {
        let taper = 3f64.to_radians();
        let tip =
            TipShape::Tapered { radius_mm: 0.5, corner_mm: 0.5, taper_rad: taper, flutes_mm: 20.0 };
        let shank = [Section::cylinder(55.0, 3.0)];
        let assembly = Assembly::new(tip, &shank, &er20(), 40.0).unwrap();
        assert_eq!(assembly.tip(), [0.5, 0.0]);
        for k in 0..200 {
            let z = 0.5 + 0.0975 * f64::from(k);
            let cone = 0.5 / taper.cos() + (z - 0.5) * taper.tan();
            let found = radius_at(assembly.body(), z);
            assert!(found >= cone - 1e-12 && found <= cone + assembly.excess_mm() + 1e-12, "{z}");
        }
        assert_eq!(radius_at(assembly.body(), 20.1), 3.0);
    }

    #[test]
    fn a_tapered_bull_nose_touches_with_a_corner_tangent_to_disc_and_cone() {
        let taper = 10f64.to_radians();
        let tip =
            TipShape::Tapered { radius_mm: 2.0, corner_mm: 0.5, taper_rad: taper, flutes_mm: 9.0 };
        let assembly = Assembly::new(tip, &[], &er20(), 40.0).unwrap();
        let [corner, side] = assembly.tip();
        // Distance of the corner's center from the flank is its radius.
        let distance = (2.0 + corner * taper.tan() - side) * taper.cos();
        assert!((distance - corner).abs() < 1e-12, "{distance}");
        let flat =
            TipShape::Tapered { radius_mm: 2.0, corner_mm: 0.0, taper_rad: taper, flutes_mm: 9.0 };
        assert_eq!(Assembly::new(flat, &[], &er20(), 40.0).unwrap().tip(), [0.0, 2.0]);
    }

    #[test]
    fn impossible_tools_are_refused() {
        let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 3.0 };
        let body = [Section::cylinder(12.0, 3.0)];
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e5] {
            assert!(Assembly::new(tip, &body, &er20(), bad).is_err());
            assert!(Assembly::new(tip, &[Section::cylinder(bad, 3.0)], &er20(), 40.0).is_err());
            assert!(Assembly::new(tip, &body, &[Section::cylinder(3.0, bad)], 40.0).is_err());
            let tapered = |radius_mm, taper_rad, flutes_mm| TipShape::Tapered {
                radius_mm,
                corner_mm: 0.0,
                taper_rad,
                flutes_mm,
            };
            for tip in [tapered(bad, 0.1, 9.0), tapered(1.0, bad, 9.0), tapered(1.0, 0.1, bad)] {
                assert!(Assembly::new(tip, &[], &er20(), 40.0).is_err(), "{tip:?}");
            }
        }
        assert!(Assembly::new(tip, &body, &[], 40.0).is_err());
        assert!(
            Assembly::new(
                TipShape::Straight { radius_mm: 1.0, corner_mm: 1.1 },
                &body,
                &er20(),
                9.0
            )
            .is_err()
        );
    }

    #[test]
    fn no_tool_sticks_out_further_than_it_is_long() {
        let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
        let tool = Assembly::new(tip, &[Section::cylinder(60.0, 3.0)], &er20(), 40.0).unwrap();
        assert_eq!((tool.overall_mm(), tool.most_stick_out_mm()), (None, f64::INFINITY));
        assert!(tool.raised(ToolPart::Holder, 500.0).is_ok(), "no one said how long it is");
        let error = tool.clone().with_overall(39.0).unwrap_err().to_string();
        assert!(error.contains("stick-out is 40") && error.contains("39 mm; "), "{error}");
        let tool = tool.with_overall(57.0).unwrap();
        assert_eq!(tool.raised(ToolPart::Holder, 17.0).unwrap().stick_out_mm(), 57.0);
        let error = tool.raised(ToolPart::Holder, 17.1).unwrap_err().to_string();
        assert!(error.contains("overall length of 57 mm"), "{error}");
        assert_eq!(tool.with_clearance(0.2).unwrap().overall_mm(), Some(57.0));
        assert!(tool.with_overall(f64::NAN).is_err());
    }

    #[test]
    fn a_longer_stick_out_only_raises_the_holder() {
        let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
        let assembly = Assembly::new(tip, &[Section::cylinder(60.0, 3.0)], &er20(), 4.0).unwrap();
        let (short, long) = (assembly.cutter().unwrap(), assembly.at_stick_out(30.0).unwrap());
        for k in 0..200 {
            let z = 0.5 * f64::from(k);
            assert!(radius_at(short.steps(), z) >= radius_at(long.steps(), z));
        }
        // The nose is below the height at which the body begins to count.
        assert_eq!(short.steps()[0].height_mm, 4.0);
    }
}
