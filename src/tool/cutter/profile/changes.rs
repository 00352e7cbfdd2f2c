//! Profiles that differ in one thing: a thinner or longer neck, a smaller end.
//!
//! The **neck** is what does not cut up to where the profile widens for the last time, to the shank; all of it where it
//! does not widen.

use super::{Profile, ProfileSection, arc_of};
use crate::{Error, Result};

/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-9;
/// No neck is thinner, mm.
const LEAST_RADIUS_MM: f64 = 1e-3;

impl Profile {
    /// Heights above the tip between which the neck is, mm, and its least radius; the upper one is infinite where no
    /// shank follows.
    pub(crate) fn neck(&self) -> ([f64; 2], f64) {
        let [first, end] = self.neck_sections();
        let [radius, low] = self.below(first);
        let high = match end < self.sections.len() {
            true => self.below(end)[1],
            false => f64::INFINITY,
        };
        let radii = self.sections[first..end].iter().map(|section| section.radius_mm);
        ([low, high], radii.fold(radius, f64::min))
    }

    /// Of its sections the first, and the first above it.
    fn neck_sections(&self) -> [usize; 2] {
        let last_cutting = self.sections.iter().rposition(|section| section.cuts);
        let first = last_cutting.map_or(0, |k| k + 1);
        let widens = |k: &usize| self.sections[*k].radius_mm > self.below(*k)[0] + SAME_MM;
        let end = (first..self.sections.len()).rfind(widens).unwrap_or(self.sections.len());
        [first, end]
    }

    /// Radius and height of the lower end of a section.
    fn below(&self, k: usize) -> [f64; 2] {
        match k.checked_sub(1) {
            Some(before) => self.sections[before].end(),
            None => [self.start_mm, 0.0],
        }
    }

    /// With a neck that is thinner by this in radius. Where it begins on a face or on an arc that narrows, that goes on
    /// inward as far; elsewhere a face leads there.
    ///
    /// # Errors
    /// If there is no neck, or it would have no radius.
    pub(crate) fn with_thinner_neck(&self, by_mm: f64) -> Result<Self> {
        let [first, end] = self.neck_sections();
        if first == end && end < self.sections.len() {
            return Err(no_neck("leave the neck as it is"));
        }
        let mut sections = self.sections.clone();
        for section in &mut sections[first..end] {
            section.radius_mm -= by_mm;
            section.center_mm = section.center_mm.map(|[c, z]| [c - by_mm, z]);
        }
        let [radius, height] = self.below(first);
        let thin = radius - by_mm;
        let begins_with_face = sections[first..end]
            .first()
            .is_some_and(|section| section.height_mm - height < SAME_MM);
        if !begins_with_face && !self.prolong(&mut sections, first, thin) {
            sections.insert(first, ProfileSection::line(thin, height).non_cutting());
        }
        let radii = sections.iter().skip(first.saturating_sub(1)).map(|s| s.radius_mm);
        if radii.fold(thin, f64::min) < LEAST_RADIUS_MM {
            let remedy = "make it thinner by less";
            return Err(Error::argument("neck", thin, "a positive radius", remedy));
        }
        self.with_sections(self.start_mm, sections)
    }

    /// Whether the last section that cuts, below `first`, goes on to a smaller radius.
    fn prolong(&self, sections: &mut [ProfileSection], first: usize, radius_mm: f64) -> bool {
        let Some(k) = first.checked_sub(1) else { return false };
        let next = sections.get(first).map_or(f64::INFINITY, |section| section.height_mm);
        let (last, from) = (&mut sections[k], self.below(k));
        let narrows = last.radius_mm < from[0];
        let Some(center) = last.center_mm else {
            let is_face = last.height_mm - from[1] < SAME_MM;
            if is_face && narrows {
                last.radius_mm = radius_mm;
            }
            return is_face && narrows;
        };
        let arc = arc_of([from, last.end()], center);
        let aside = radius_mm - arc.center[0];
        if !arc.is_convex || last.height_mm < arc.center[1] || aside < 0.0 {
            return false;
        }
        let height_mm = arc.center[1] + (arc.radius * arc.radius - aside * aside).max(0.0).sqrt();
        if height_mm > next {
            return false;
        }
        (last.radius_mm, last.height_mm) = (radius_mm, height_mm);
        true
    }

    /// With a neck that is longer by this: the shank begins as much higher.
    ///
    /// # Errors
    /// If no shank follows the neck, or a height is beyond 10 m.
    pub(crate) fn with_longer_neck(&self, by_mm: f64) -> Result<Self> {
        let [_, end] = self.neck_sections();
        if end == self.sections.len() {
            return Err(no_neck("leave its length as it is"));
        }
        let [radius, height] = self.below(end);
        let mut sections = self.sections.clone();
        for section in &mut sections[end..] {
            section.height_mm += by_mm;
            section.center_mm = section.center_mm.map(|[c, z]| [c, z + by_mm]);
        }
        sections.insert(end, ProfileSection::line(radius, height + by_mm).non_cutting());
        self.with_sections(self.start_mm, sections)
    }

    /// With what cuts times a factor, in radius and in height, and the neck as much thinner; all above stays where it
    /// is.
    ///
    /// # Errors
    /// If the result is no profile.
    pub(crate) fn with_scaled_end(&self, factor: f64) -> Result<Self> {
        let [first, end] = self.neck_sections();
        let top = self.below(first)[1];
        let mut sections = self.sections.clone();
        for (k, section) in sections[..end].iter_mut().enumerate() {
            section.radius_mm *= factor;
            // What cuts, and a face right above it.
            let is_low = k < first || section.height_mm - top < SAME_MM;
            match is_low {
                true => {
                    section.height_mm *= factor;
                    section.center_mm = section.center_mm.map(|center| center.map(|x| factor * x));
                }
                // An arc would lead elsewhere.
                false => section.center_mm = None,
            }
        }
        self.with_sections(factor * self.start_mm, sections)
    }

    fn with_sections(&self, start_mm: f64, sections: Vec<ProfileSection>) -> Result<Self> {
        Ok(Profile { is_drill: self.is_drill, ..Profile::new(start_mm, sections)? })
    }
}

fn no_neck(remedy: &'static str) -> Error {
    Error::argument("profile", "without a neck below a shank", "one with a neck", remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(profile: &str, change: impl Fn(Profile) -> Result<Profile>) -> String {
        change(profile.parse().unwrap()).unwrap().to_string()
    }

    #[test]
    fn a_thinner_neck_begins_where_what_cuts_goes_on_to() {
        let thinner = |profile: &str| text(profile, |profile| profile.with_thinner_neck(0.5));
        assert_eq!(thinner("6:0 6:3 3:3 | 3:20 6:20"), "6:0 6:3 2.5:3 | 2.5:20 6:20");
        assert_eq!(thinner("6:0 6:3 | 3:3 3:20 6:25 6:40"), "6:0 6:3 | 2.5:3 2.5:20 6:25 6:40");
        // Without a shank, and right above a cylinder.
        assert_eq!(thinner("6:0 6:3 3:3"), "6:0 6:3 2.5:3");
        assert_eq!(thinner("3:0 3:5 | 3:40"), "3:0 3:5 | 2.5:5 2.5:40");
        // A ball goes on.
        let ball: Profile = "0:0 1.8:5.4@0:3 | 1.8:20 3:22".parse().unwrap();
        let thin = ball.with_thinner_neck(0.5).unwrap();
        assert!((thin.radius_at(3.0 + (9f64 - 1.69).sqrt() + 1e-9) - 1.3).abs() < 1e-6);
        assert!((thin.radius_at(5.4) - 1.8).abs() < 1e-9 && thin.radius_at(15.0) == 1.3);
        assert!("6:0 6:3 | 8:3 8:9".parse::<Profile>().unwrap().with_thinner_neck(0.1).is_err());
        assert!(ball.with_thinner_neck(2.0).is_err());
    }

    #[test]
    fn a_longer_neck_raises_the_shank_and_a_smaller_end_lowers_the_neck() {
        let longer = |profile: &str| text(profile, |profile| profile.with_longer_neck(4.0));
        assert_eq!(longer("6:0 6:3 3:3 | 3:20 6:20"), "6:0 6:3 3:3 | 3:20 3:24 6:24");
        assert_eq!(longer("3:0 3:5 | 5:6 5:40"), "3:0 3:5 | 3:9 5:10 5:44");
        assert!("6:0 6:3 3:3".parse::<Profile>().unwrap().with_longer_neck(1.0).is_err());
        let half = |profile: &str| text(profile, |profile| profile.with_scaled_end(0.5));
        assert_eq!(half("6:0 6:3 3:3 | 3:20 6:20"), "3:0 3:1.5 1.5:1.5 | 1.5:20 6:20");
        assert_eq!(half("6:0 6:3 | 3:3 3:20 6:25"), "3:0 3:1.5 | 1.5:1.5 1.5:20 6:25");
        assert_eq!(half("drill 0:0 3:2 3:30 | 3:60"), "drill 0:0 1.5:1 1.5:15 | 1.5:60");
    }

    #[test]
    fn the_neck_is_what_does_not_cut_below_the_shank() {
        let neck = |profile: &str| profile.parse::<Profile>().unwrap().neck();
        assert_eq!(neck("6:0 6:3 3:3 | 3:20 6:20"), ([3.0, 20.0], 3.0));
        assert_eq!(neck("6:0 6:3 3:3"), ([3.0, f64::INFINITY], 3.0));
        assert_eq!(neck("3:0 3:5 | 5:6 5:40"), ([5.0, 5.0], 3.0));
    }
}
