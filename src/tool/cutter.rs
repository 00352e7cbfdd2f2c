//! Cutters: solids of revolution, given as a list of steps whose radii never shrink upward.
//!
//! A [`Cutter`] is a rule for where its *reference point* lies when it touches a site, and a list of
//! [`Step`]s above that point: everything higher than a step's height and nearer to the axis than its
//! radius is inside the cutter. Because radii never shrink upward, a step needs no upper end. What
//! lies below the first step, the ball and its neighborhood, is contact and not collision.
//!
//! Tip and lowest steps *cut*; neck, shank, holder and spindle above them do not. Two margins keep
//! them apart, since what cuts is to touch and what does not is to stay away:
//!
//! ```text
//! clearance C (with_clearance):  every step that does not cut begins C lower and is C wider
//! allowance A (with_allowance):  what cuts is dilated by a ball of radius A: corner r + A about the same
//!                                center, cutting steps begin A lower and are A wider
//! ```

mod assembly;
mod margins;
mod params;
mod profile;
mod read;

pub use assembly::{Assembly, Section, TipShape, ToolPart};
pub use params::{CutterParams, CutterSet};
pub use profile::Profile;
#[cfg(feature = "formats")]
pub(crate) use profile::{Crest, ProfileSection};
pub(crate) use profile::{Piece, require_steps};

use crate::{Error, Result};
use margins::joined;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// One widening of a cutter: from `height_mm` above its reference point on, it fills `radius_mm`.
///
/// ```
/// use deepmill::cutter::{Cutter, Step};
///
/// let tool = Cutter::ball_end("1.5,20,20,30".parse()?)?; // CR, CH, FR, FH
/// let holder = tool.steps().iter().find(|step| step.radius_mm > 1.5);
/// assert_eq!(holder, Some(&Step { height_mm: 21.5, radius_mm: 20.0 })); // CR + CH above the center of the ball
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Height above the reference point, mm.
    pub height_mm: f64,
    /// Radius from there upward, mm; infinite for the spindle's half-space, serialized as none.
    #[serde(with = "infinite")]
    pub radius_mm: f64,
}

/// Lengths, none for an infinite one, which text formats cannot hold.
pub(crate) mod infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(length: &f64, to: S) -> Result<S::Ok, S::Error> {
        Some(length).filter(|length| **length != f64::INFINITY).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
    }
}

/// A checked cutter: where it touches, and steps whose heights increase and radii do not decrease.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "read::Unchecked")]
pub struct Cutter {
    /// The allowance included.
    corner_mm: f64,
    side_mm: f64,
    /// All that widens the tool, from below.
    steps: Vec<Step>,
    /// Steps that cut.
    cutting: Vec<Step>,
    /// Steps that do not, from the end of the flutes on; they may be narrower than the flutes.
    upper: Vec<Step>,
    allowance_mm: f64,
    /// Of a tool that may be wider below than above; the steps hold it.
    #[serde(skip_serializing_if = "Option::is_none")]
    profile: Option<Profile>,
}

impl Cutter {
    /// Ball-end cutter with a cylindrical holder and a spindle above it (the paper's cutter).
    ///
    /// Steps above the ball's center: `(CR, CR)`, `(CR+CH, FR)`, `(CR+CH+FH, ∞)`.
    ///
    /// # Errors
    /// If a length is not a number from 0.0001 mm to 10 m, or FR < CR.
    ///
    /// ```
    /// use deepmill::cutter::{Cutter, CutterParams};
    /// let cutter = Cutter::ball_end(CutterParams::from_array([1.5, 6.0, 40.0, 5.0]))?;
    /// assert_eq!(cutter.steps()[1].height_mm, 7.5);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn ball_end(params: CutterParams) -> Result<Self> {
        Cutter::bull_nose(params, params.cr_mm)
    }

    /// Flat-end cutter with the lengths of a ball-end one: its tip is a disc of radius CR.
    ///
    /// # Errors
    /// As [`Cutter::ball_end`].
    pub fn flat_end(params: CutterParams) -> Result<Self> {
        Cutter::bull_nose(params, 0.0)
    }

    /// Cutter whose tip is a disc with edges rounded by `corner_mm` (0: flat end, CR: ball end).
    ///
    /// The outline above the tip is that of the ball-end cutter: steps begin `2·CR`, `2·CR+CH`,
    /// `2·CR+CH+FH` above the tip, whatever the corner. The reference point is `corner_mm` above the
    /// tip.
    ///
    /// # Errors
    /// As [`Cutter::ball_end`], or if the corner is negative or greater than CR.
    pub fn bull_nose(params: CutterParams, corner_mm: f64) -> Result<Self> {
        let CutterParams { cr_mm, ch_mm, fr_mm, fh_mm } = params;
        let names =
            ["cutter radius CR", "cutter height CH", "holder radius FR", "holder height FH"];
        for (name, length) in names.into_iter().zip(params.to_array()) {
            positive(name, length)?;
        }
        if fr_mm < cr_mm {
            let expected = format!("at least CR = {cr_mm} mm");
            return Err(Error::argument("holder radius FR", fr_mm, expected, ORDER));
        }
        if !(0.0..=cr_mm).contains(&corner_mm) {
            let expected = format!("between 0 and CR = {cr_mm} mm");
            return Err(Error::argument("corner radius", corner_mm, expected, "use CR for a ball"));
        }
        let first = cr_mm + (cr_mm - corner_mm);
        Cutter::widening(
            [corner_mm, cr_mm - corner_mm],
            vec![Step { height_mm: first, radius_mm: cr_mm }],
            vec![
                Step { height_mm: first + ch_mm, radius_mm: fr_mm },
                Step { height_mm: first + ch_mm + fh_mm, radius_mm: f64::INFINITY },
            ],
        )
    }

    /// Ball-end cutter with any holder: each section is `(length, radius)` mm, from the ball's top
    /// upward; the first is the cutter's own cylinder. `spindle` puts a half-space on top.
    ///
    /// # Errors
    /// If there is no section, a length or radius is not positive, or a radius shrinks upward.
    pub fn stepped(cr_mm: f64, sections: &[(f64, f64)], spindle: bool) -> Result<Self> {
        positive("cutter radius CR", cr_mm)?;
        if sections.is_empty() {
            let remedy = "begin with the cutter's own cylinder";
            return Err(Error::argument("number of sections", 0, "1 or more", remedy));
        }
        let mut height_mm = cr_mm;
        let mut steps = Vec::with_capacity(sections.len() + 1);
        for &(length, radius_mm) in sections {
            positive("section length", length)?;
            steps.push(Step { height_mm, radius_mm });
            height_mm += length;
        }
        if spindle {
            steps.push(Step { height_mm, radius_mm: f64::INFINITY });
        }
        let upper = steps.split_off(1);
        Cutter::widening([cr_mm, 0.0], steps, upper)
    }

    /// Ball-end cutter whose flank widens by `taper_rad` over the height CH, in `n_steps` steps that
    /// enclose the true cone; then holder and spindle as in [`Cutter::ball_end`].
    ///
    /// # Errors
    /// As [`Cutter::ball_end`], or if the taper is not below a right angle, there are no steps, or the
    /// cone is wider than the holder.
    pub fn tapered(params: CutterParams, taper_rad: f64, n_steps: usize) -> Result<Self> {
        let base = Cutter::ball_end(params)?;
        let allowed = "between 0 and a right angle";
        if !(0.0..1.57).contains(&taper_rad) {
            let remedy = "give the angle between flank and axis in radians";
            return Err(Error::argument("taper", taper_rad, allowed, remedy));
        }
        if n_steps == 0 || n_steps > MAX_STEPS - 2 {
            let expected = format!("1 to {}", MAX_STEPS - 2);
            return Err(Error::argument("steps of the taper", n_steps, expected, "16 is plenty"));
        }
        let slope = libm::tan(taper_rad);
        let length = params.ch_mm / n_steps as f64;
        let cone = (0..n_steps).map(|i| Step {
            height_mm: params.cr_mm + i as f64 * length,
            radius_mm: params.cr_mm + (i + 1) as f64 * length * slope,
        });
        Cutter::widening([params.cr_mm, 0.0], cone.collect(), base.upper)
    }

    /// The general form. Touching a site with normal `n` in direction `d`, the reference point is
    /// `s + corner·n + side·n⊥/|n⊥|`, where `n⊥` is the part of `n` across `d`. Steps that are no wider than the tip
    /// cut.
    ///
    /// # Errors
    /// If there are no steps or more than 64, a length is negative or not a number, heights do not
    /// increase, or a radius shrinks upward (a lollipop): collision must only ever grow upward.
    pub fn from_steps(corner_mm: f64, side_mm: f64, mut steps: Vec<Step>) -> Result<Self> {
        let end = corner_mm + side_mm;
        let n_cutting = steps.iter().take_while(|step| !is_wider(step, end)).count();
        let upper = steps.split_off(n_cutting);
        Cutter::from_parts([corner_mm, side_mm], steps, upper)
    }

    /// As [`Cutter::from_steps`], of steps that cut and steps that do not: neck, shank, holder and spindle from the end
    /// of the flutes on. The latter may be narrower than the former, and each list must be as that one.
    ///
    /// # Errors
    /// As [`Cutter::from_steps`].
    pub fn from_parts(
        [corner_mm, side_mm]: [f64; 2],
        cutting: Vec<Step>,
        upper: Vec<Step>,
    ) -> Result<Self> {
        for (name, length) in [("corner radius", corner_mm), ("side offset", side_mm)] {
            if !(0.0..=MAX_LENGTH_MM).contains(&length) {
                let expected = "zero or more, at most 10 m";
                return Err(Error::argument(name, length, expected, "give it in mm"));
            }
        }
        let n_steps = cutting.len() + upper.len();
        if n_steps == 0 || n_steps > MAX_STEPS {
            let expected = format!("1 to {MAX_STEPS}");
            return Err(Error::argument("number of steps", n_steps, expected, "merge steps"));
        }
        for (first, steps) in [(0, &cutting), (cutting.len(), &upper)] {
            for (i, step) in steps.iter().enumerate() {
                check_step(first + i, step, steps.get(i.wrapping_sub(1)))?;
            }
        }
        let steps = joined(&cutting, &upper);
        let (allowance_mm, profile) = (0.0, None);
        Ok(Cutter { corner_mm, side_mm, steps, cutting, upper, allowance_mm, profile })
    }

    /// As [`Cutter::from_parts`], of parts that are no narrower than what is below them.
    fn widening(end: [f64; 2], cutting: Vec<Step>, upper: Vec<Step>) -> Result<Self> {
        if let (Some(below), Some(first)) = (cutting.last(), upper.first()) {
            check_step(cutting.len(), first, Some(below))?;
        }
        Cutter::from_parts(end, cutting, upper)
    }

    /// Reference point's distance from the touched site along the normal, and its height above the
    /// tip, mm.
    pub fn corner_mm(&self) -> f64 {
        self.corner_mm
    }

    /// Reference point's further distance across the direction, mm; 0 for a ball end.
    pub fn side_mm(&self) -> f64 {
        self.side_mm
    }

    /// The steps, heights increasing, radii not decreasing.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Steps that cut.
    pub(crate) fn cutting_steps(&self) -> &[Step] {
        &self.cutting
    }

    /// Steps that do not cut, from the end of the flutes on.
    pub(crate) fn upper_steps(&self) -> &[Step] {
        &self.upper
    }

    /// The four lengths, if this is what [`Cutter::ball_end`] makes of them: a ball, its cylinder, one holder, a
    /// spindle.
    ///
    /// They are differences of heights, so their last bits may differ from those given.
    ///
    /// ```
    /// use deepmill::cutter::{Cutter, CutterParams};
    /// let params = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
    /// assert_eq!(Cutter::ball_end(params)?.as_ball_end(), Some(params));
    /// assert_eq!(Cutter::flat_end(params)?.as_ball_end(), None);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn as_ball_end(&self) -> Option<CutterParams> {
        let [ball, holder, spindle] = self.steps[..] else { return None };
        let cr_mm = self.corner_mm;
        let is_ball = self.side_mm == 0.0 && ball == Step { height_mm: cr_mm, radius_mm: cr_mm };
        let params = CutterParams {
            cr_mm,
            ch_mm: holder.height_mm - cr_mm,
            fr_mm: holder.radius_mm,
            fh_mm: spindle.height_mm - holder.height_mm,
        };
        let is_whole = is_ball && spindle.radius_mm == f64::INFINITY;
        (is_whole && Cutter::ball_end(params).is_ok()).then_some(params)
    }

    /// The profile, if the tool was given by one. The steps are those of a flat end mill that holds it.
    pub fn profile(&self) -> Option<&Profile> {
        self.profile.as_ref()
    }

    /// Height above the reference point at which the cutting portion ends, mm; infinite if nothing is above it.
    pub fn flutes_mm(&self) -> f64 {
        self.upper.first().map_or(f64::INFINITY, |step| step.height_mm)
    }
}

/// Wider than the tip by more than this share of its radius is no flute.
const WIDER: f64 = 1e-6;

/// Whether a step is wider than a lower end of this radius.
fn is_wider(step: &Step, end_mm: f64) -> bool {
    step.radius_mm > end_mm * (1.0 + WIDER)
}

impl TryFrom<CutterParams> for Cutter {
    type Error = Error;

    /// As [`Cutter::ball_end`].
    fn try_from(params: CutterParams) -> Result<Self> {
        Cutter::ball_end(params)
    }
}

/// Reads the ball-end cutter `CR,CH,FR,FH`, mm.
impl FromStr for Cutter {
    type Err = Error;

    /// # Errors
    /// As [`CutterParams::from_str`] and [`Cutter::ball_end`].
    fn from_str(text: &str) -> Result<Self> {
        Cutter::ball_end(text.parse()?)
    }
}

/// Writes corner, side offset and steps: `corner 1.5, side 0, steps height:radius 1.5:1.5 7.5:40 12.5:inf mm`.
impl fmt::Display for Cutter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "corner {}, side {}, steps height:radius", self.corner_mm, self.side_mm)?;
        for Step { height_mm, radius_mm } in &self.steps {
            write!(f, " {height_mm}:{radius_mm}")?;
        }
        f.write_str(" mm")
    }
}

/// More steps than any real tool has.
const MAX_STEPS: usize = 64;
/// Longer than any real tool: beyond it, squares and sums might leave the range of `f32` arithmetic.
const MAX_LENGTH_MM: f64 = 1e4;
/// Shorter than any real length: coordinates are `f32` and may be meters.
const MIN_LENGTH_MM: f64 = 1e-4;
const ORDER: &str = "order the lengths CR,CH,FR,FH; a holder is at least as wide as its cutter";

fn positive(name: &'static str, length: f64) -> Result<()> {
    if (MIN_LENGTH_MM..=MAX_LENGTH_MM).contains(&length) {
        return Ok(());
    }
    Err(Error::argument(name, length, "a positive length, 0.0001 mm to 10 m", "give it in mm"))
}

fn check_step(index: usize, step: &Step, below: Option<&Step>) -> Result<()> {
    let place = |what: &str| format!("{what} of step {index}");
    let Step { height_mm, radius_mm } = *step;
    if !(-MAX_LENGTH_MM..=MAX_LENGTH_MM).contains(&height_mm) {
        let found = format!("{} {height_mm}", place("height"));
        return Err(Error::argument("cutter step", found, "within 10 m", "give it in mm"));
    }
    let finite = (MIN_LENGTH_MM..=MAX_LENGTH_MM).contains(&radius_mm);
    if !(finite || radius_mm == f64::INFINITY) {
        let found = format!("{} {radius_mm}", place("radius"));
        let expected = "0.0001 mm to 10 m, or infinite for the spindle";
        return Err(Error::argument("cutter step", found, expected, "give it in mm"));
    }
    let Some(below) = below else { return Ok(()) };
    if height_mm <= below.height_mm {
        let found = format!("{} {height_mm} above {}", place("height"), below.height_mm);
        let remedy = "list steps from the tip upward";
        return Err(Error::argument("cutter step", found, "increasing heights", remedy));
    }
    if radius_mm < below.radius_mm {
        let found = format!("{} {radius_mm} above {}", place("radius"), below.radius_mm);
        let remedy = "give the neck the radius below it, or the tool as a profile (a lollipop)";
        return Err(Error::argument("cutter step", found, "radii that never shrink", remedy));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(lengths: [f64; 4]) -> Result<Cutter> {
        Cutter::ball_end(CutterParams::from_array(lengths))
    }

    #[test]
    fn steps_of_a_ball_end_are_the_papers() {
        let cutter = ball([1.5, 6.0, 40.0, 5.0]).unwrap();
        let expected = [(1.5, 1.5), (7.5, 40.0), (12.5, f64::INFINITY)];
        let found: Vec<_> = cutter.steps().iter().map(|s| (s.height_mm, s.radius_mm)).collect();
        assert_eq!(found, expected);
        assert_eq!((cutter.corner_mm(), cutter.side_mm()), (1.5, 0.0));
    }

    #[test]
    fn outlines_above_the_tip_do_not_depend_on_the_corner() {
        let params = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
        for corner in [0.0, 0.5, 1.5] {
            let cutter = Cutter::bull_nose(params, corner).unwrap();
            let tip: Vec<_> = cutter.steps().iter().map(|s| s.height_mm + corner).collect();
            assert_eq!(tip, [3.0, 9.0, 14.0]);
            assert_eq!(cutter.side_mm(), 1.5 - corner);
        }
    }

    #[test]
    fn a_taper_encloses_its_cone() {
        let params = CutterParams::from_array([1.0, 8.0, 20.0, 5.0]);
        let cutter = Cutter::tapered(params, 0.1, 8).unwrap();
        assert_eq!(cutter.steps().len(), 10);
        let slope = libm::tan(0.1);
        for step in &cutter.steps()[..8] {
            let cone_at_top = 1.0 + (step.height_mm - 1.0 + 1.0) * slope;
            assert!((step.radius_mm - cone_at_top).abs() < 1e-12);
        }
        assert!(Cutter::tapered(params, 1.3, 8).is_err(), "wider than its holder");
        assert!(Cutter::tapered(params, 2.0, 8).is_err());
        assert!(Cutter::tapered(params, 0.1, 0).is_err());
    }

    #[test]
    fn impossible_cutters_are_refused_with_a_remedy() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            for place in 0..4 {
                let mut lengths = [1.0, 2.0, 30.0, 4.0];
                lengths[place] = bad;
                let message = ball(lengths).unwrap_err().to_string();
                assert!(message.contains("positive") && message.contains("mm"), "{message}");
            }
        }
        let message = ball([2.0, 5.0, 1.0, 5.0]).unwrap_err().to_string();
        assert!(message.contains("holder radius FR is 1"), "{message}");
        let lollipop = Cutter::stepped(3.0, &[(5.0, 3.0), (20.0, 1.0)], true);
        let message = lollipop.unwrap_err().to_string();
        assert!(message.contains("lollipop") && message.contains("step 1"), "{message}");
        assert!(Cutter::stepped(1.0, &[], false).is_err());
        assert!(Cutter::stepped(1.0, &[], true).is_err());
        assert!(ball([1e-30, 2.0, 30.0, 4.0]).is_err() && ball([1.0, 1e-30, 30.0, 4.0]).is_err());
        assert!(Cutter::stepped(1.0, &[(0.0, 1.0)], false).is_err());
    }
}
