//! Tools of any profile of revolution: radius over height in lines and arcs, not necessarily growing upward.
//!
//! # Definition
//!
//! A profile begins on the axis at height 0, the tip. A flat lower end of radius `start` comes first, if that is not 0;
//! then one section after the other leads to a radius and a height that is not below the one before: a line, or an arc
//! about a center. Two sections of one height are a face across the axis: it looks down where the radius grows and up
//! where it shrinks. The tool is everything nearer to the axis than the profile; above its last point it goes on as
//! wide as that. A section cuts or does not; the lower end cuts if the first section does.
//!
//! ```text
//! radius(height) on an arc about (c, z): c + √(ρ² − (height − z)²) if its ends are beyond c (it bulges outward),
//!                                        c − √(ρ² − (height − z)²) if they are nearer than c (it is hollow)
//! ```
//!
//! A **drill** or a **reamer** cuts along its axis alone: it reaches the walls of bores of its own size, and nothing
//! else.
//!
//! As text a profile is its points `radius:height`, an arc with its center behind an `@`, and `|` where what does not
//! cut begins: `0:0 1.5:5.598@0:3 | 1.5:20 3:22` is a lollipop of diameter 6 on a neck of diameter 3; of a drill
//! `drill` comes first.

mod changes;
mod dilated;
mod drills;
mod families;
mod mills;
mod segments;
mod text;

#[cfg(feature = "formats")]
pub(crate) use mills::Crest;

use super::{MAX_LENGTH_MM, Step};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A line or an arc of a [`Profile`], from the end of the one before.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct ProfileSection {
    /// Radius at its end, mm; infinite above a spindle's lower face, serialized as none.
    #[serde(with = "super::infinite")]
    pub radius_mm: f64,
    /// Height of its end above the tip, mm.
    pub height_mm: f64,
    /// Of an arc, the center: distance from the axis, negative beyond it, and height above the tip, mm.
    pub center_mm: Option<[f64; 2]>,
    /// Whether it cuts.
    pub cuts: bool,
}

impl ProfileSection {
    /// A line that cuts, to a radius and a height, mm.
    pub fn line(radius_mm: f64, height_mm: f64) -> Self {
        ProfileSection { radius_mm, height_mm, center_mm: None, cuts: true }
    }

    /// An arc that cuts, to a radius and a height about a center, mm.
    pub fn arc(radius_mm: f64, height_mm: f64, center_mm: [f64; 2]) -> Self {
        ProfileSection { center_mm: Some(center_mm), ..ProfileSection::line(radius_mm, height_mm) }
    }

    /// The same without cutting: neck, shank, holder.
    pub fn non_cutting(self) -> Self {
        ProfileSection { cuts: false, ..self }
    }

    fn end(&self) -> [f64; 2] {
        [self.radius_mm, self.height_mm]
    }
}

/// The profile of a tool that may be wider below than above, checked; checked again when it is deserialized. It is read
/// from text, or made by the constructor of its family and [`Profile::with_shank`]:
///
/// ```text
/// radius:height from the tip upward, mm; an arc with its center behind an @; | where what does not cut begins;
/// the word drill before all points of a drill or a reamer
/// ```
///
/// ```
/// use deepmill::cutter::Profile;
/// // A T-slot cutter, 21 mm wide and 9 mm high, on a neck of 10 mm.
/// let profile = Profile::t_slot(10.5, 9.0, 0.0, 5.0)?;
/// assert_eq!(profile.radius_at(4.0), 10.5);
/// assert_eq!(profile.radius_at(9.5), 5.0);
/// assert_eq!(profile, profile.to_string().parse()?);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Profile {
    start_mm: f64,
    /// Height of the lower end above the tip: 0, or below it where what cuts leaves stock.
    #[serde(default, skip_serializing_if = "is_zero")]
    base_mm: f64,
    sections: Vec<ProfileSection>,
    #[serde(default, skip_serializing_if = "is_false")]
    is_drill: bool,
}

fn is_zero(base_mm: &f64) -> bool {
    *base_mm == 0.0
}

fn is_false(is_drill: &bool) -> bool {
    !is_drill
}

/// A [`Profile`] as it is read.
#[derive(Deserialize)]
#[serde(rename = "Profile")]
struct Unchecked {
    start_mm: f64,
    #[serde(default)]
    base_mm: f64,
    sections: Vec<ProfileSection>,
    #[serde(default)]
    is_drill: bool,
}

impl TryFrom<Unchecked> for Profile {
    type Error = Error;

    /// # Errors
    /// As [`Profile::new`], of heights above the lower end, which is the tip or, where stock is left, below it.
    fn try_from(read: Unchecked) -> Result<Self> {
        let Unchecked { start_mm, base_mm, sections, is_drill } = read;
        check_length("depth of the lower end below the tip", -base_mm)?;
        let is_spindle =
            |section: &ProfileSection| section.radius_mm == f64::INFINITY && !section.cuts;
        let above = |section: &ProfileSection| ProfileSection {
            radius_mm: if is_spindle(section) { MAX_LENGTH_MM } else { section.radius_mm },
            height_mm: section.height_mm - base_mm,
            center_mm: section.center_mm.map(|[radius, height]| [radius, height - base_mm]),
            ..*section
        };
        Profile::new(start_mm, sections.iter().map(above).collect())?;
        Ok(Profile { start_mm, base_mm, sections, is_drill })
    }
}

/// What is between two points of the profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    /// Radius and height of both ends, mm.
    pub ends: [[f64; 2]; 2],
    pub arc: Option<ProfileArc>,
    pub cuts: bool,
}

/// Of an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ProfileArc {
    pub center: [f64; 2],
    pub radius: f64,
    /// Whether it bulges outward.
    pub is_convex: bool,
}

impl Piece {
    /// Its radius at a height between its ends; the lower end's on a face across the axis.
    pub fn radius_at(&self, height: f64) -> f64 {
        let [[r0, z0], [r1, z1]] = self.ends;
        match self.arc {
            Some(ProfileArc { center: [c, z], radius, is_convex }) => {
                let half = (radius * radius - (height - z) * (height - z)).max(0.0).sqrt();
                if is_convex { c + half } else { c - half }
            }
            None if z1 > z0 && r1.is_finite() => r0 + (r1 - r0) * ((height - z0) / (z1 - z0)),
            None => r0,
        }
    }
}

/// More sections than any real tool has.
const MOST_SECTIONS: usize = 64;
/// Both ends of an arc are as far from its center as this share of its radius, or this many mm.
const SAME_RADIUS: f64 = 1e-3;

impl Profile {
    /// From the radius of a flat lower end, 0 for a pointed or round one, and the sections from there upward.
    ///
    /// # Errors
    /// If a length is not a number from 0 to 10 m, a height is below the one before, nothing cuts, the upper end has no
    /// radius, the ends of an arc are not equally far from its center or lie on both sides of it, or there are no
    /// sections or more than 64.
    pub(crate) fn new(start_mm: f64, sections: Vec<ProfileSection>) -> Result<Self> {
        check_length("radius of the lower end", start_mm)?;
        if sections.is_empty() || sections.len() > MOST_SECTIONS {
            let expected = format!("1 to {MOST_SECTIONS}");
            let remedy = "describe the profile from the tip upward";
            return Err(Error::argument(
                "sections of the profile",
                sections.len(),
                expected,
                remedy,
            ));
        }
        let mut from = [start_mm, 0.0];
        for (k, section) in sections.iter().enumerate() {
            check_section(k, from, section)?;
            from = section.end();
        }
        if from[0] <= 0.0 {
            let remedy = "end with the radius of the shank";
            return Err(Error::argument("upper end of the profile", "0 mm", "a radius", remedy));
        }
        if !sections.iter().any(|section| section.cuts) {
            let remedy = "say which of its sections cut";
            return Err(Error::argument("profile", "without a cutting portion", "one", remedy));
        }
        Ok(Profile { start_mm, base_mm: 0.0, sections, is_drill: false })
    }

    /// The sections, from the tip upward.
    #[cfg(all(test, feature = "formats"))]
    pub(crate) fn sections(&self) -> &[ProfileSection] {
        &self.sections
    }

    /// With neck and shank on top, which do not cut: lines to these radii and heights above the tip, mm.
    ///
    /// # Errors
    /// If a length is not a number from 0 to 10 m, a height is below the one before, or there are more than 64
    /// sections in all.
    pub fn with_shank(mut self, points: &[[f64; 2]]) -> Result<Self> {
        let line = |[radius_mm, height_mm]: &[f64; 2]| ProfileSection::line(*radius_mm, *height_mm);
        self.sections.extend(points.iter().map(|point| line(point).non_cutting()));
        Ok(Profile { is_drill: self.is_drill, ..Profile::new(self.start_mm, self.sections)? })
    }

    /// With all lengths times a factor, to change the unit.
    #[cfg(feature = "formats")]
    pub(crate) fn scaled(&self, by: f64) -> Result<Self> {
        let scale = |section: &ProfileSection| ProfileSection {
            radius_mm: by * section.radius_mm,
            height_mm: by * section.height_mm,
            center_mm: section.center_mm.map(|center| center.map(|x| by * x)),
            cuts: section.cuts,
        };
        let sections = self.sections.iter().map(scale).collect();
        Ok(Profile { is_drill: self.is_drill, ..Profile::new(by * self.start_mm, sections)? })
    }

    /// Radius at a height above the tip, mm: the greater one at a face across the axis. 0 below the tip; NaN at NaN.
    pub fn radius_at(&self, height_mm: f64) -> f64 {
        if height_mm.is_nan() {
            return f64::NAN;
        }
        if height_mm < self.base_mm {
            return 0.0;
        }
        let over = |piece: &Piece| (piece.ends[0][1]..=piece.ends[1][1]).contains(&height_mm);
        let pieces = self.pieces();
        let top = pieces.last().map_or([0.0; 2], |piece| piece.ends[1]);
        let above = if height_mm >= top[1] { top[0] } else { 0.0 };
        let at = |piece: &Piece| match piece.ends {
            [[r0, z0], [r1, z1]] if z0 == z1 => r0.max(r1),
            _ => piece.radius_at(height_mm),
        };
        pieces.iter().filter(|piece| over(piece)).map(at).fold(above, f64::max)
    }

    /// Greatest radius of what cuts, mm.
    pub fn cutting_radius_mm(&self) -> f64 {
        self.greatest(|piece| piece.cuts)
    }

    /// Height above the tip at which the topmost section ends that cuts, mm.
    pub fn flutes_mm(&self) -> f64 {
        let cutting = self.sections.iter().filter(|section| section.cuts);
        cutting.map(|section| section.height_mm).fold(0.0, f64::max)
    }

    /// Whether it cuts along its axis alone, in a wall of its own diameter: a drill or a reamer.
    pub fn is_drill(&self) -> bool {
        self.is_drill
    }

    /// Whether radii never shrink upward.
    pub(crate) fn only_widens(&self) -> bool {
        let shrinks = |piece: &Piece| {
            let [[r0, _], [r1, z1]] = piece.ends;
            let past_equator = |arc: ProfileArc| arc.is_convex && z1 > arc.center[1];
            let hollow_below = |arc: ProfileArc| !arc.is_convex && piece.ends[0][1] < arc.center[1];
            r1 < r0 || piece.arc.is_some_and(|arc| past_equator(arc) || hollow_below(arc))
        };
        !self.pieces().iter().any(shrinks)
    }

    /// The pieces from the axis upward; a flat lower end is the first.
    pub(crate) fn pieces(&self) -> Vec<Piece> {
        let mut pieces = Vec::with_capacity(self.sections.len() + 1);
        let mut from = [0.0, self.base_mm];
        if self.start_mm > 0.0 {
            let ends = [from, [self.start_mm, self.base_mm]];
            pieces.push(Piece { ends, arc: None, cuts: self.sections[0].cuts });
            from = ends[1];
        }
        for section in &self.sections {
            let ends = [from, section.end()];
            let arc = section.center_mm.map(|center| arc_of(ends, center));
            if ends[0] != ends[1] {
                pieces.push(Piece { ends, arc, cuts: section.cuts });
            }
            from = ends[1];
        }
        pieces
    }

    fn greatest(&self, of: impl Fn(&Piece) -> bool) -> f64 {
        let greatest = |piece: &Piece| {
            let ends = piece.ends[0][0].max(piece.ends[1][0]);
            match piece.arc {
                Some(ProfileArc { center: [c, z], radius, is_convex: true })
                    if (piece.ends[0][1]..=piece.ends[1][1]).contains(&z) =>
                {
                    ends.max(c + radius)
                }
                _ => ends,
            }
        };
        self.pieces().iter().filter(|piece| of(piece)).map(greatest).fold(0.0, f64::max)
    }

    /// Steps, heights above the tip, that hold all pieces for which `of` is true, or all that is above some of it.
    pub(crate) fn steps(&self, of: impl Fn(&Piece) -> bool) -> Vec<Step> {
        /// Steps of a cone or an arc.
        const N_STEPS: usize = 6;
        let mut steps = Vec::new();
        for piece in self.pieces().iter().filter(|piece| of(piece)) {
            let [[r0, z0], [r1, z1]] = piece.ends;
            if z0 == z1 {
                steps.push(Step { height_mm: z0, radius_mm: r0.max(r1) });
                continue;
            }
            let n = if piece.arc.is_none() && r0 >= r1 { 1 } else { N_STEPS };
            let at = |k: usize| z0 + (z1 - z0) * (k as f64 / n as f64);
            for k in 0..n {
                let [low, high] = [at(k), at(k + 1)];
                let equator = piece.arc.map_or(low, |arc| arc.center[1].clamp(low, high));
                let ends = [low, equator, high].map(|height| piece.radius_at(height));
                let radius_mm = ends.into_iter().fold(0.0, f64::max);
                steps.push(Step { height_mm: low, radius_mm });
            }
        }
        steps
    }

    /// The tool as it is held: of the profile what is below the holder, and the steps of that, heights above its nose
    /// at `stick_out_mm`, which may be infinitely wide. With a margin they begin below the nose.
    pub(crate) fn held(&self, holder: &[Step], stick_out_mm: f64) -> Profile {
        let begin = stick_out_mm + holder.first().map_or(0.0, |step| step.height_mm.min(0.0));
        let mut sections: Vec<ProfileSection> = Vec::new();
        let mut from = [self.start_mm, self.base_mm];
        for section in &self.sections {
            if section.height_mm > begin {
                let ends = [from, section.end()];
                let arc = section.center_mm.map(|center| arc_of(ends, center));
                let radius_mm = Piece { ends, arc, cuts: section.cuts }.radius_at(begin);
                if from[1] < begin {
                    sections.push(ProfileSection { radius_mm, height_mm: begin, ..*section });
                }
                break;
            }
            sections.push(*section);
            from = section.end();
        }
        let mut widest = self.greatest(|piece| piece.ends[1][1] > begin);
        widest = widest.max(self.sections[self.sections.len() - 1].radius_mm);
        for step in holder {
            let last = sections.last().map_or([self.start_mm, self.base_mm], ProfileSection::end);
            let height_mm = (step.height_mm + stick_out_mm).max(last[1]);
            if height_mm > last[1] {
                sections.push(ProfileSection::line(last[0], height_mm).non_cutting());
            }
            widest = widest.max(step.radius_mm);
            sections.push(ProfileSection::line(widest, height_mm).non_cutting());
        }
        let Profile { start_mm, base_mm, is_drill, .. } = *self;
        Profile { start_mm, base_mm, sections, is_drill }
    }

    /// The same with a margin about what does not cut: it is as much wider, and where it widens upward it begins as
    /// much lower, but not below the end of the flutes.
    pub(crate) fn with_margin(&self, margin_mm: f64) -> Profile {
        let radius_below = |k: usize| match k {
            0 => self.start_mm,
            _ => self.sections[k - 1].radius_mm,
        };
        let widens = |k: usize| {
            let section = self.sections.get(k).filter(|section| !section.cuts);
            section.is_some_and(|section| section.radius_mm > radius_below(k))
        };
        let wider = |radius: f64| (radius + margin_mm).max(0.0);
        let mut sections: Vec<ProfileSection> = Vec::with_capacity(self.sections.len() + 1);
        for (k, section) in self.sections.iter().enumerate() {
            if section.cuts {
                sections.push(*section);
                continue;
            }
            let below = sections.last().map_or([self.start_mm, self.base_mm], ProfileSection::end);
            if k == 0 || self.sections[k - 1].cuts {
                // Right above the flutes.
                sections.push(ProfileSection::line(wider(radius_below(k)), below[1]).non_cutting());
            }
            let lower = if widens(k) || widens(k + 1) { margin_mm } else { 0.0 };
            sections.push(ProfileSection {
                radius_mm: wider(section.radius_mm),
                height_mm: (section.height_mm - lower).max(below[1]),
                center_mm: section.center_mm.map(|[c, z]| [c + margin_mm, z - lower]),
                ..*section
            });
        }
        // Above its last point the tool goes on without cutting.
        if let Some(last) = self.sections.last().filter(|last| last.cuts) {
            sections
                .push(ProfileSection::line(wider(last.radius_mm), last.height_mm).non_cutting());
        }
        let Profile { start_mm, base_mm, is_drill, .. } = *self;
        Profile { start_mm, base_mm, sections, is_drill }
    }
}

fn arc_of([[r0, z0], [r1, _]]: [[f64; 2]; 2], center: [f64; 2]) -> ProfileArc {
    let radius = libm::hypot(r0 - center[0], z0 - center[1]);
    ProfileArc { center, radius, is_convex: r0 + r1 > 2.0 * center[0] }
}

/// Refuses a tool given by its profile, where only its steps would be looked at.
///
/// # Errors
/// If there is a profile.
pub(crate) fn require_steps(profile: Option<&Profile>, remedy: &'static str) -> Result<()> {
    match profile {
        None => Ok(()),
        Some(_) => {
            let found = "given by its profile";
            Err(Error::argument("tool", found, "one given by lengths", remedy))
        }
    }
}

fn check_length(name: &'static str, length: f64) -> Result<()> {
    if (0.0..=MAX_LENGTH_MM).contains(&length) {
        return Ok(());
    }
    Err(Error::argument(name, length, "0 or more, at most 10 m", "give it in mm"))
}

fn check_section(k: usize, from: [f64; 2], section: &ProfileSection) -> Result<()> {
    let ProfileSection { radius_mm, height_mm, center_mm, .. } = *section;
    let place = |what: &str, found: f64| format!("{what} {found} of section {}", k + 1);
    if !(0.0..=MAX_LENGTH_MM).contains(&radius_mm) {
        let found = place("radius", radius_mm);
        return Err(Error::argument("profile", found, "0 or more, at most 10 m", "give it in mm"));
    }
    if !(from[1]..=MAX_LENGTH_MM).contains(&height_mm) {
        let found = place("height", height_mm);
        let expected = format!("at least {}, the height before it, at most 10 m", from[1]);
        let remedy = "list sections from the tip upward";
        return Err(Error::argument("profile", found, expected, remedy));
    }
    let Some([c, z]) = center_mm else { return Ok(()) };
    let radii = [from, [radius_mm, height_mm]].map(|[r, height]| libm::hypot(r - c, height - z));
    let greatest = radii[0].max(radii[1]);
    if !((radii[0] - radii[1]).abs() <= SAME_RADIUS * greatest.min(1.0) && greatest > 0.0) {
        let found = format!("{} and {} mm in section {}", radii[0], radii[1], k + 1);
        let remedy = "give a center that is as far from both ends of the arc";
        return Err(Error::argument("distances of an arc's ends", found, "equal ones", remedy));
    }
    let slack = SAME_RADIUS * greatest.min(1.0);
    let is_beyond = from[0].min(radius_mm) >= c - slack;
    let is_nearer = from[0].max(radius_mm) <= c + slack;
    if height_mm == from[1] || !(is_beyond || is_nearer) {
        let found =
            format!("about {c}:{z} from {}:{} to {radius_mm}:{height_mm}", from[0], from[1]);
        let remedy =
            "cut an arc in two where it turns back, and give a face across the axis as a line";
        let expected = "an arc that leads upward on one side of its center";
        return Err(Error::argument("arc of the profile", found, expected, remedy));
    }
    Ok(())
}

#[cfg(all(test, feature = "formats"))]
mod tests;
