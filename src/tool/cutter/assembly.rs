//! A tool in its holder, as makers describe it: sections of cylinders and cones, and how far it sticks out.
//!
//! # Definition
//!
//! The *body* is what is clamped: flutes, neck, shank, without an upper end. The *holder* begins at its nose,
//! `stick_out` above the tip; above its top everything is spindle. Tip and flutes cut, all else does not. Flutes, the
//! rest of the body, and the holder become [`Step`]s:
//!
//! ```text
//! widest = 0
//! for every section from below, of radius a at its lower and b at its upper end:
//!     b ≤ a (cylinder): a step of radius a at its lower end, if a > widest
//!     b > a (cone):     cut off what is narrower than `widest`; n steps of equal height, each as wide as the cone at its upper end
//!     widest = the greater of a, b and widest
//! ```
//!
//! So no step is thinner than the tool, and none is wider than it by more than [`Assembly::excess_mm`]: a cone whose
//! radius grows by `g` over `n` steps is exceeded by at most `g/n`. What is narrower than something below it counts as
//! wide as that; but a margin ([`Assembly::with_clearance`]) is about its own width. A tool of any stick-out is the
//! body together with the holder at that height, so collisions only decrease with the stick-out.

mod lower_end;
mod parts;
mod profile;
mod read;
mod section;

pub use parts::ToolPart;
pub use section::Section;

use super::margins::{check_allowance, check_margin, envelope, grown};
use super::{Cutter, Profile, Step, is_wider, positive};
use crate::{Error, Result};
use lower_end::LowerEnd;
use serde::{Deserialize, Serialize};

/// The lower end of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TipShape {
    /// A disc of `radius_mm` whose edge is rounded by `corner_mm` (0: flat end, the radius: ball end), below a
    /// cylinder.
    Straight {
        /// Radius of the cylinder, mm.
        radius_mm: f64,
        /// Radius of the corner, mm.
        corner_mm: f64,
    },
    /// As `Straight`, below a cone. A corner of the whole radius is a ball to which the cone is tangent; a lesser one
    /// is tangent to the cone and to the disc, and `radius_mm` is that of the cone at the height of the tip.
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

/// A checked tool in its holder; checked again when it is deserialized.
///
/// ```
/// use deepmill::cutter::{Assembly, Section, TipShape};
///
/// // A ball end of 6 mm with a shank of 10 mm from 25 mm on, 40 mm out of a holder of 30 mm.
/// let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 3.0 };
/// let body = [Section::cylinder(25.0, 3.0), Section::cylinder(60.0, 5.0)];
/// let tool = Assembly::new(tip, &body, &[Section::cylinder(50.0, 15.0)], 40.0)?.with_overall(80.0)?;
/// assert_eq!((tool.flutes_mm(), tool.most_stick_out_mm()), (25.0, 80.0));
/// let nose = |stick_out_mm| -> deepmill::Result<f64> {
///     let cutter = tool.at_stick_out(stick_out_mm)?;
///     Ok(cutter.steps().iter().find(|step| step.radius_mm == 15.0).expect("a holder").height_mm)
/// };
/// assert_eq!(nose(55.0)? - nose(40.0)?, 15.0);
/// let error = tool.clone().with_overall(35.0).unwrap_err().to_string();
/// assert!(error.ends_with("correct one of them, or take a longer tool"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "read::Unchecked")]
pub struct Assembly {
    /// Without the allowance, as all that cuts.
    corner_mm: f64,
    side_mm: f64,
    /// Steps of the flutes.
    cutting: Vec<Step>,
    /// Steps of neck and shank, from the end of the flutes on.
    upper: Vec<Step>,
    /// Both, the allowance included.
    body: Vec<Step>,
    holder: Vec<Step>,
    stick_out_mm: f64,
    allowance_mm: f64,
    excess_mm: f64,
    /// From tip to end, holder and spindle left out; `None` where no one has stated it.
    overall_mm: Option<f64>,
    /// Of a tool that may be wider below than above, what is clamped; the steps hold it.
    #[serde(skip_serializing_if = "Option::is_none")]
    profile: Option<Profile>,
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
    /// `body` goes on above the tip, for a straight one from the tip on and for a tapered one from the end of its
    /// flutes; its last section has no upper end. The first of several sections of a straight one is its flutes; of a
    /// single one see [`Assembly::with_flutes`]. `holder` is from the nose upward.
    ///
    /// # Errors
    /// If a length is not a number from 0.0001 mm to 10 m, a corner is greater than its radius, a taper is not below a
    /// right angle, there is no holder, or there are too many sections.
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
        let (mut cutting, upper, body_excess) = steps(&sections, 1, start_mm, widest);
        if lower.cone.is_none() {
            // Up to the ball's top there is contact, as for the cutters of four lengths.
            let top = Step { height_mm: 2.0 * lower.radius_mm, radius_mm: lower.radius_mm };
            cutting.insert(0, top);
        }
        let (mut holder_steps, _, holder_excess) = steps(holder, holder.len(), 0.0, 0.0);
        let top = holder.iter().map(|section| section.length_mm).sum();
        holder_steps.push(Step { height_mm: top, radius_mm: f64::INFINITY });
        let end = [lower.corner_mm, lower.side_mm];
        let excess_mm = body_excess.max(holder_excess);
        let cutting = envelope(cutting);
        Assembly::of_parts(end, cutting, envelope(upper), holder_steps, stick_out_mm, excess_mm)
    }

    /// From steps: those of the body above the tip, those of the holder above its nose. Steps of the body that are no
    /// wider than the tip cut, up to the first that is wider.
    ///
    /// # Errors
    /// As [`Cutter::from_steps`].
    pub fn from_steps(
        [corner_mm, side_mm]: [f64; 2],
        mut body: Vec<Step>,
        holder: Vec<Step>,
        stick_out_mm: f64,
    ) -> Result<Self> {
        let end = corner_mm + side_mm;
        let n_cutting = body.iter().take_while(|step| !is_wider(step, end)).count();
        let upper = body.split_off(n_cutting);
        Assembly::of_parts([corner_mm, side_mm], body, upper, holder, stick_out_mm, 0.0)
    }

    fn of_parts(
        [corner_mm, side_mm]: [f64; 2],
        cutting: Vec<Step>,
        upper: Vec<Step>,
        holder: Vec<Step>,
        stick_out_mm: f64,
        excess_mm: f64,
    ) -> Result<Self> {
        positive("stick-out", stick_out_mm)?;
        let (body, overall_mm, allowance_mm, profile) = (Vec::new(), None, 0.0, None);
        let assembly = Assembly {
            corner_mm,
            side_mm,
            cutting,
            upper,
            body,
            holder,
            stick_out_mm,
            allowance_mm,
            excess_mm,
            overall_mm,
            profile,
        };
        let assembly = assembly.whole();
        assembly.cutter().map(|_| assembly)
    }

    /// With the steps of the whole body.
    fn whole(self) -> Self {
        let body = envelope([grown(&self.cutting, self.allowance_mm), self.upper.clone()].concat());
        Assembly { body, ..self }
    }

    /// The same tool, of which the flutes end at this height above the tip: what is above does not cut, however wide it
    /// is.
    ///
    /// # Errors
    /// If the length is not a number from 0.0001 mm to 10 m.
    pub fn with_flutes(self, flutes_mm: f64) -> Result<Self> {
        positive("flute length", flutes_mm)?;
        self.require_steps()?;
        let is_below = |step: &&Step| step.height_mm < flutes_mm;
        let all = || self.cutting.iter().chain(&self.upper);
        let mut cutting: Vec<Step> = all().filter(is_below).copied().collect();
        if cutting.is_empty() {
            // Flutes that end within the tip's own height.
            cutting.extend(self.cutting.first());
        }
        let widest = |steps: &[Step]| {
            let below = steps.iter().filter(|step| step.height_mm <= flutes_mm);
            below.map(|step| step.radius_mm).fold(0.0, f64::max)
        };
        // Right above the flutes: what is said to be there, or as wide as they are.
        let radius_mm = match widest(&self.upper) {
            0.0 => widest(&self.cutting).max(self.end_mm()),
            said => said,
        };
        let begins = |step: &&Step| step.height_mm > flutes_mm;
        let first = Step { height_mm: flutes_mm, radius_mm };
        let upper = [first].into_iter().chain(all().filter(begins).copied()).collect();
        let flutes = Assembly { cutting, upper: envelope(upper), ..self.clone() }.whole();
        flutes.cutter().map(|_| flutes)
    }

    /// Height above the tip at which the flutes end, mm; infinite where no one has stated it and nothing of the body is
    /// wider.
    pub fn flutes_mm(&self) -> f64 {
        self.upper.first().map_or(f64::INFINITY, |step| step.height_mm)
    }

    /// Steps of neck and shank, which do not cut, heights above the tip; they may be narrower than the flutes.
    pub fn neck_and_shank(&self) -> &[Step] {
        &self.upper
    }

    /// The same tool, of which neck and shank are these steps, as [`Assembly::neck_and_shank`] has them: the steps of
    /// the body below the first of them cut.
    ///
    /// # Errors
    /// As [`Assembly::cutter`].
    pub fn with_neck_and_shank(self, upper: Vec<Step>) -> Result<Self> {
        self.require_steps()?;
        let end = upper.first().map_or(f64::INFINITY, |step| step.height_mm);
        let body = self.own_body();
        let cutting = body.into_iter().filter(|step| step.height_mm < end).collect();
        let tool = Assembly { cutting, upper, ..self }.whole();
        tool.cutter().map(|_| tool)
    }

    /// How much stock the flutes leave, mm: [`Assembly::with_allowance`].
    pub fn allowance_mm(&self) -> f64 {
        self.allowance_mm
    }

    /// Radius of the lower end, without an allowance, mm.
    fn end_mm(&self) -> f64 {
        self.corner_mm + self.side_mm
    }

    /// The same tool, of which the overall length is stated: [`Assembly::most_stick_out_mm`] is no more.
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

    /// Steps of the body, heights above the tip; the allowance is included.
    pub fn body(&self) -> &[Step] {
        &self.body
    }

    /// As [`Assembly::body`], without the allowance.
    pub fn own_body(&self) -> Vec<Step> {
        envelope([&self.cutting[..], &self.upper].concat())
    }

    /// Steps of the holder and the spindle, heights above the nose.
    pub fn holder(&self) -> &[Step] {
        &self.holder
    }

    /// Radius of the tip's corner and distance of its center from the axis, mm, without an allowance.
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

    /// The whole tool with its holder's nose at another height above the tip, whatever its overall length.
    ///
    /// # Errors
    /// As [`Assembly::cutter`], or if the stick-out is not a number from 0.0001 mm to 10 m.
    pub fn at_stick_out(&self, stick_out_mm: f64) -> Result<Cutter> {
        positive("stick-out", stick_out_mm)?;
        let raised = self.holder.iter().map(|step| raise(step, stick_out_mm));
        let cutter = self.cutter_of(self.upper.iter().copied().chain(raised).collect())?;
        Ok(self.with_profile_of(cutter, Some(stick_out_mm)))
    }

    /// The body alone, without an upper end.
    ///
    /// # Errors
    /// As [`Assembly::cutter`].
    pub fn body_cutter(&self) -> Result<Cutter> {
        let cutter = self.cutter_of(self.upper.clone())?;
        Ok(self.with_profile_of(cutter, None))
    }

    /// Every step of neck, shank, holder and spindle begins lower by a margin and is as much wider, as
    /// [`Cutter::with_clearance`]; radii stop at 0. What cuts stays.
    ///
    /// # Errors
    /// If the margin is not a number or beyond 10 m.
    pub fn with_clearance(&self, clearance_mm: f64) -> Result<Self> {
        check_margin("clearance", clearance_mm)?;
        let [upper, holder] = [&self.upper, &self.holder].map(|steps| grown(steps, clearance_mm));
        let profile = self.profile.as_ref().map(|profile| profile.with_margin(clearance_mm));
        Ok(Assembly { upper, holder, profile, ..self.clone() }.whole())
    }

    /// The same tool, leaving stock: what cuts is dilated by a ball of this radius, as [`Cutter::with_allowance`].
    /// Heights stay above the tip of the tool itself.
    ///
    /// # Errors
    /// If the allowance is not a number from 0 to 10 m, or as [`Assembly::cutter`].
    pub fn with_allowance(self, allowance_mm: f64) -> Result<Self> {
        check_allowance(allowance_mm)?;
        let rough = Assembly { allowance_mm, ..self }.whole();
        rough.cutter().map(|_| rough)
    }

    fn cutter_of(&self, upper: Vec<Step>) -> Result<Cutter> {
        let lowered = |steps: Vec<Step>| -> Vec<Step> {
            envelope(steps).iter().map(|step| raise(step, -self.corner_mm)).collect()
        };
        let end = [self.corner_mm, self.side_mm];
        let cutter = Cutter::from_parts(end, lowered(self.cutting.clone()), lowered(upper))?;
        match self.allowance_mm > 0.0 {
            true => cutter.with_allowance(self.allowance_mm),
            false => Ok(cutter),
        }
    }
}

fn raise(step: &Step, by_mm: f64) -> Step {
    Step { height_mm: step.height_mm + by_mm, ..*step }
}

/// A part of a section that widens the tool.
struct Growth {
    is_cutting: bool,
    start_mm: f64,
    end_mm: f64,
    from_mm: f64,
    to_mm: f64,
}

/// Steps that enclose the first `n_cutting` sections and those that enclose the others, and by how much they exceed
/// them.
fn steps(
    sections: &[Section],
    n_cutting: usize,
    start_mm: f64,
    mut widest: f64,
) -> (Vec<Step>, Vec<Step>, f64) {
    let mut parts = Vec::new();
    let mut height = start_mm;
    for (k, &Section { length_mm, lower_radius_mm: a, upper_radius_mm: b }) in
        sections.iter().enumerate()
    {
        let is_cutting = k < n_cutting;
        if k == n_cutting {
            widest = 0.0;
        }
        let end_mm = height + length_mm;
        if b > a && b > widest {
            let share = ((widest - a) / (b - a)).max(0.0);
            let from_mm = widest.max(a);
            let start_mm = height + share * length_mm;
            parts.push(Growth { is_cutting, start_mm, end_mm, from_mm, to_mm: b });
        } else if a > widest {
            parts.push(Growth { is_cutting, start_mm: height, end_mm, from_mm: a, to_mm: a });
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
    let (mut cutting, mut others, mut worst) = (Vec::new(), Vec::new(), 0.0f64);
    for part in &parts {
        let n = n_steps(part, excess);
        let (rise, growth) =
            ((part.end_mm - part.start_mm) / n as f64, (part.to_mm - part.from_mm) / n as f64);
        worst = worst.max(growth);
        let of = if part.is_cutting { &mut cutting } else { &mut others };
        of.extend((0..n).map(|k| Step {
            height_mm: part.start_mm + k as f64 * rise,
            radius_mm: if k + 1 == n { part.to_mm } else { part.from_mm + (k + 1) as f64 * growth },
        }));
    }
    (cutting, others, worst)
}

#[cfg(test)]
mod tests;
