//! Margins of a cutter: clearance of what does not cut, allowance of what does.

use super::{Cutter, MAX_LENGTH_MM, Step};
use crate::{Error, Result};

impl Cutter {
    /// How much stock what cuts leaves, mm: [`Cutter::with_allowance`].
    pub fn allowance_mm(&self) -> f64 {
        self.allowance_mm
    }

    /// This cutter with a safety margin: every step that does not cut begins `clearance_mm` lower and is as much wider,
    /// a shank as wide as the flutes too.
    ///
    /// A negative margin shrinks them; radii stop at 0. What cuts, and the point of contact, do not move.
    ///
    /// # Errors
    /// If the margin is not a number or beyond 10 m.
    pub fn with_clearance(&self, clearance_mm: f64) -> Result<Self> {
        check_margin("clearance", clearance_mm)?;
        let upper = grown(&self.upper, clearance_mm);
        let profile = self.profile.as_ref().map(|profile| profile.with_margin(clearance_mm));
        Ok(Cutter { steps: joined(&self.cutting, &upper), upper, profile, ..self.clone() })
    }

    /// This cutter with stock left by what cuts: that is dilated by a ball of radius `allowance_mm`. A ball of radius R
    /// becomes one of R + A with the same center, a flat end of radius R a bull nose of radius R + A with a corner of
    /// A, and cutting steps begin A lower and are A wider. So it is clear of the part iff the true tool is A away from
    /// it. Of a tool given by its profile the cutting portion, up to its end, is dilated as a solid.
    ///
    /// ```
    /// use deepmill::cutter::Cutter;
    /// let rough = "3,20,25,40".parse::<Cutter>()?.with_allowance(0.5)?;
    /// assert_eq!((rough.corner_mm(), rough.side_mm()), (3.5, 0.0));
    /// assert_eq!(rough.steps()[0].radius_mm, 3.5);
    /// assert_eq!(rough.steps()[1].radius_mm, 25.0);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the allowance is not a number from 0 to 10 m, or more than that with the one it has.
    pub fn with_allowance(&self, allowance_mm: f64) -> Result<Self> {
        check_allowance(allowance_mm)?;
        check_allowance(self.allowance_mm + allowance_mm)?;
        let cutting = grown(&self.cutting, allowance_mm);
        let profile = self.profile.as_ref().map(|profile| profile.dilated(allowance_mm));
        Ok(Cutter {
            profile,
            corner_mm: self.corner_mm + allowance_mm,
            allowance_mm: self.allowance_mm + allowance_mm,
            steps: joined(&cutting, &self.upper),
            cutting,
            ..self.clone()
        })
    }

    /// This cutter with every step, cutting or not, beginning `by_mm` lower and as much wider; negative: shrunk, radii
    /// stop at 0. The point of contact does not move.
    ///
    /// # Errors
    /// If the length is not a number or beyond 10 m.
    pub fn grown(&self, by_mm: f64) -> Result<Self> {
        check_margin("growth of the steps", by_mm)?;
        let [cutting, upper] = [&self.cutting, &self.upper].map(|steps| grown(steps, by_mm));
        Ok(Cutter { steps: grown(&self.steps, by_mm), cutting, upper, ..self.clone() })
    }

    /// The steps, of which those that do not cut have a margin; of a negative one all are shrunk.
    pub(crate) fn steps_with_margin(&self, margin_mm: f64) -> Vec<Step> {
        match margin_mm > 0.0 {
            true => joined(&self.cutting, &grown(&self.upper, margin_mm)),
            false => grown(&self.steps, margin_mm),
        }
    }
}

pub(super) fn check_margin(name: &'static str, margin_mm: f64) -> Result<()> {
    if (-MAX_LENGTH_MM..=MAX_LENGTH_MM).contains(&margin_mm) {
        return Ok(());
    }
    Err(Error::argument(name, margin_mm, "a length within 10 m", "give it in mm"))
}

pub(super) fn check_allowance(allowance_mm: f64) -> Result<()> {
    if (0.0..=MAX_LENGTH_MM).contains(&allowance_mm) {
        return Ok(());
    }
    let remedy = "give how much stock is left, in mm";
    Err(Error::argument("allowance", allowance_mm, "0 or more, at most 10 m", remedy))
}

/// Steps that begin lower by a margin and are as much wider; radii stop at 0.
pub(super) fn grown(steps: &[Step], by_mm: f64) -> Vec<Step> {
    let grow = |step: &Step| Step {
        height_mm: step.height_mm - by_mm,
        radius_mm: (step.radius_mm + by_mm).max(0.0),
    };
    steps.iter().map(grow).collect()
}

/// The steps of both that widen the tool, from below.
pub(super) fn joined(cutting: &[Step], upper: &[Step]) -> Vec<Step> {
    let (Some(top), Some(first)) = (cutting.last(), upper.first()) else {
        return [cutting, upper].concat();
    };
    if first.height_mm > top.height_mm && first.radius_mm > top.radius_mm {
        return [cutting, upper].concat();
    }
    envelope([cutting, upper].concat())
}

/// The steps that widen the tool, from below.
pub(super) fn envelope(mut steps: Vec<Step>) -> Vec<Step> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::CutterParams;

    fn ball(lengths: [f64; 4]) -> Result<Cutter> {
        Cutter::ball_end(CutterParams::from_array(lengths))
    }

    fn as_pairs(cutter: &Cutter) -> Vec<(f64, f64)> {
        cutter.steps().iter().map(|step| (step.height_mm, step.radius_mm)).collect()
    }

    #[test]
    fn clearance_grows_what_does_not_cut() {
        let cutter = ball([1.5, 6.0, 40.0, 5.0]).unwrap();
        let wide = cutter.with_clearance(0.5).unwrap();
        assert_eq!(as_pairs(&wide), [(1.5, 1.5), (7.0, 40.5), (12.0, f64::INFINITY)]);
        assert_eq!((wide.corner_mm(), wide.flutes_mm()), (1.5, 7.0));
        assert!(cutter.with_clearance(f64::NAN).is_err() && cutter.with_clearance(2e4).is_err());
        let all = cutter.grown(0.5).unwrap();
        assert_eq!(as_pairs(&all), [(1.0, 2.0), (7.0, 40.5), (12.0, f64::INFINITY)]);
        assert_eq!(cutter.grown(-2.0).unwrap().steps()[0].radius_mm, 0.0);
    }

    #[test]
    fn a_shank_as_wide_as_the_flutes_or_narrower_has_clearance() {
        let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
        let flutes = vec![step(3.0, 3.0)];
        let cutter = |shank: f64| {
            Cutter::from_parts(
                [3.0, 0.0],
                flutes.clone(),
                vec![step(12.0, shank), step(30.0, 20.0)],
            )
        };
        let with = |shank, by| as_pairs(&cutter(shank).unwrap().with_clearance(by).unwrap());
        assert_eq!(with(3.0, 0.5), [(3.0, 3.0), (11.5, 3.5), (29.5, 20.5)]);
        // A relieved neck is clear of the wall up to its relief.
        assert_eq!(with(2.5, 0.5), [(3.0, 3.0), (29.5, 20.5)]);
        assert_eq!(with(2.5, 0.75), [(3.0, 3.0), (11.25, 3.25), (29.25, 20.75)]);
        assert_eq!(with(2.5, 0.0), [(3.0, 3.0), (30.0, 20.0)]);
    }

    #[test]
    fn allowance_dilates_what_cuts_in_any_order_with_clearance() {
        let params = CutterParams::from_array([3.0, 20.0, 25.0, 40.0]);
        let flat = Cutter::flat_end(params).unwrap().with_allowance(0.5).unwrap();
        // A corner of the allowance about the edge.
        assert_eq!((flat.corner_mm(), flat.side_mm(), flat.allowance_mm()), (0.5, 3.0, 0.5));
        assert_eq!(as_pairs(&flat), [(5.5, 3.5), (26.0, 25.0), (66.0, f64::INFINITY)]);
        for cutter in [Cutter::ball_end(params).unwrap(), Cutter::tapered(params, 0.1, 8).unwrap()]
        {
            let one = cutter.with_allowance(0.25).unwrap().with_clearance(1.0).unwrap();
            let other = cutter.with_clearance(1.0).unwrap().with_allowance(0.25).unwrap();
            assert_eq!(one, other);
        }
        for bad in [-0.1, f64::NAN, f64::INFINITY] {
            assert!(flat.with_allowance(bad).is_err());
        }
    }
}
