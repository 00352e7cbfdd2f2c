//! A tool as files describe it, whatever their format, and what becomes of it.

mod family;

pub(super) use family::{CENTER_RAD, Cone, Family};

use super::holder::Holder;
use super::place::Place;
use super::{MissingParameters, Tool};
use crate::geom::units::Unit;
use crate::geom::units::length::tidy;
use crate::tool::cutter::{Assembly, Profile, Section, TipShape};
use crate::{Error, Result};

/// Form of the lower end; lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form {
    Ball,
    Flat,
    Bull {
        corner: f64,
    },
    /// With this corner and the angle between flank and axis, radians. Of a ball, the diameter is the ball's; else that
    /// of the cone at the height of the tip.
    Tapered {
        corner: f64,
        taper: f64,
    },
    /// One that is given by its profile.
    Family(Family),
}

/// What a file says, in mm.
#[derive(Debug, Clone)]
pub(super) struct Described {
    pub name: String,
    pub form: Form,
    pub diameter: f64,
    pub flutes: Option<f64>,
    /// Where the neck ends, above the tip, and its diameter.
    pub neck_end: Option<f64>,
    pub neck: Option<f64>,
    pub shank: Option<f64>,
    /// Of a shaft that is no cylinder: its sections from the neck's end upward; the last goes on as wide as its end.
    pub shaft: Vec<Section>,
    /// Diameter at the upper end of tapered flutes.
    pub taper_end: Option<f64>,
    pub overall: Option<f64>,
    pub stick_out: Option<f64>,
    pub holder: Option<Holder>,
    pub clearance: f64,
    /// Number in the machine's table.
    pub number: Option<u32>,
    /// Millimeters of the unit that the file states its lengths in.
    pub unit_mm: f64,
    /// All of the tool below the holder, in place of form and lengths.
    pub profile: Option<Profile>,
}

/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-6;
/// No tapered mill has less than this between flank and axis, degrees: it is an angle in radians.
const LEAST_TAPER_DEG: f64 = 0.25;
/// Greatest angle in degrees that may be one in radians: beyond, it would be more than a half of a right angle.
const MOST_TAPER_RAD: f64 = 0.8;
/// Diameters that differ by less are those of the same end: a share, and mm.
const SAME_END: (f64, f64) = (0.02, 0.05);

fn is_same_end(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_END.0 * a.max(b) + SAME_END.1
}

impl Described {
    /// Without what a file may leave defaults.
    pub fn new(name: impl Into<String>, form: Form, diameter: f64) -> Self {
        Described {
            name: name.into(),
            form,
            diameter,
            flutes: None,
            neck_end: None,
            neck: None,
            shank: None,
            shaft: Vec::new(),
            taper_end: None,
            overall: None,
            stick_out: None,
            holder: None,
            clearance: 0.0,
            number: None,
            unit_mm: 1.0,
            profile: None,
        }
    }

    /// A tool of which the file has the whole profile.
    pub fn of_profile(name: impl Into<String>, profile: Profile) -> Self {
        let diameter = 2.0 * profile.cutting_radius_mm();
        Described { profile: Some(profile), ..Described::new(name, Form::Flat, diameter) }
    }

    /// The tool, and what was changed to the safe side.
    pub fn tool(&self, defaults: &MissingParameters, place: &Place) -> Result<(Tool, Vec<String>)> {
        let missing = |what: &str, option: &str| {
            let found = format!("the file does not say the {what}");
            place.error(found, format!("give it with {option}"))
        };
        let stick_out = self.stick_out.or(defaults.stick_out_mm);
        let stick_out = stick_out.ok_or_else(|| {
            missing("stick-out", "`stick_out_mm` in a program, or --stick-out MM")
        })?;
        let holder = self.holder.as_ref().or(defaults.holder.as_ref());
        let holder =
            holder.ok_or_else(|| missing("holder", "`holder` in a program, or --holder FILE"))?;
        let shank = || {
            let shaft = self.shaft.last().map(|last| 2.0 * last.upper_radius_mm);
            let shank = shaft.or(self.shank).or(defaults.shank_mm);
            shank.ok_or_else(|| {
                missing("diameter of the shank", "`shank_mm` in a program, or --shank MM")
            })
        };
        let mut notices = Vec::new();
        let assembly = match (&self.profile, self.form) {
            (Some(profile), _) => {
                Assembly::from_profile(profile.clone(), &holder.sections, stick_out)
            }
            (None, Form::Family(family)) => {
                let flutes = self.flutes.or(defaults.flutes_mm);
                let profile = self.profile_of(family, flutes, shank()?, place)?;
                Assembly::from_profile(profile, &holder.sections, stick_out)
            }
            _ => {
                let shank = shank()?;
                self.check_taper(defaults, shank, place)?;
                let body = self.body(defaults, shank, place, &mut notices)?;
                let tip = self.tip(defaults, place)?;
                let assembly = Assembly::new(tip, &body, &holder.sections, stick_out);
                match self.end_of_flutes(defaults) {
                    Some(flutes) => assembly.and_then(|tool| tool.with_flutes(flutes)),
                    None => assembly,
                }
            }
        };
        self.check_lengths(stick_out, place)?;
        let assembly = match self.overall {
            Some(overall) => assembly.and_then(|tool| tool.with_overall(overall)),
            None => assembly,
        };
        let assembly = assembly.map_err(|error| place.within(error))?;
        self.say_narrow_holder(holder, &mut notices);
        let words = format!("{}, {} mm out of {}", self.words(), round(stick_out), holder.name);
        let tool = Tool::of_assembly(&self.name, assembly, self.clearance, words);
        let mut tool = tool.map_err(|error| place.within(error))?;
        tool.number = self.number;
        let unit = Unit::ALL.into_iter().find(|unit| unit.millimeters() == self.unit_mm);
        tool.unit = unit.unwrap_or_default();
        let notices = notices.into_iter().map(|words| place.sentence(words)).collect();
        Ok((tool, notices))
    }

    /// An angle that looks like one in radians, and a cone that ends elsewhere than the file says.
    fn check_taper(&self, defaults: &MissingParameters, shank: f64, place: &Place) -> Result<()> {
        let Form::Tapered { taper, .. } = self.form else { return Ok(()) };
        let degrees = taper.to_degrees();
        // The same number, in radians.
        let other = degrees;
        let radians = |found: String| -> Error {
            let degrees = other.to_degrees();
            let remedy = format!("give it in degrees: as radians it would be {degrees:.3}°");
            place.error(found, remedy)
        };
        if degrees < LEAST_TAPER_DEG {
            let found =
                format!("a taper of {degrees:.5}° per side is too little for a tapered mill");
            return Err(radians(found));
        }
        let ends = |taper: f64| self.top_of(taper, defaults, place);
        let top = ends(taper)?;
        if degrees < MOST_TAPER_RAD && is_same_end(ends(other)?, shank) && !is_same_end(top, shank)
        {
            let found = format!(
                "with a taper of {degrees:.5}° per side the flutes end {} mm wide, in radians {} mm as the shank",
                round(top),
                round(ends(other)?)
            );
            return Err(radians(found));
        }
        match self.taper_end.filter(|end| !is_same_end(*end, top)) {
            None => Ok(()),
            Some(end) => {
                let found = format!(
                    "a taper of {}° per side ends {} mm wide, the file says {} mm",
                    round(degrees),
                    round(top),
                    round(end)
                );
                Err(place.error(found, "correct the angle, the diameter or the flute length"))
            }
        }
    }

    fn check_lengths(&self, stick_out: f64, place: &Place) -> Result<()> {
        let Some(overall) = self.overall else { return Ok(()) };
        for (what, length) in [("stick-out", Some(stick_out)), ("flute length", self.flutes)] {
            if let Some(length) = length.filter(|length| *length > overall + SAME_MM) {
                let found =
                    format!("the {what} of {length} mm exceeds the overall length of {overall} mm");
                return Err(place.error(found, "correct one of them, and check the unit"));
            }
        }
        Ok(())
    }

    fn flutes(&self, defaults: &MissingParameters, place: &Place) -> Result<f64> {
        self.flutes.or(defaults.flutes_mm).ok_or_else(|| {
            let found = "the file does not say the flute length";
            place.error(found, "give it with `flutes_mm` in a program, or --flute-length MM")
        })
    }

    /// Where what cuts ends, if the file says it; of a tool without flute length all of the cutter's own width counts
    /// as flutes.
    fn end_of_flutes(&self, defaults: &MissingParameters) -> Option<f64> {
        let flutes = self.flutes.or(defaults.flutes_mm).filter(|flutes| *flutes > 0.0)?;
        Some(self.neck_end.map_or(flutes, |end| flutes.min(end)))
    }

    fn tip(&self, defaults: &MissingParameters, place: &Place) -> Result<TipShape> {
        let radius_mm = 0.5 * self.diameter;
        Ok(match self.form {
            Form::Ball => TipShape::Straight { radius_mm, corner_mm: radius_mm },
            Form::Flat => TipShape::Straight { radius_mm, corner_mm: 0.0 },
            Form::Bull { corner } => TipShape::Straight { radius_mm, corner_mm: corner },
            Form::Tapered { corner, taper } => TipShape::Tapered {
                radius_mm,
                corner_mm: corner,
                taper_rad: taper,
                flutes_mm: self.flutes(defaults, place)?,
            },
            // Made of its profile.
            Form::Family(_) => TipShape::Straight { radius_mm, corner_mm: 0.0 },
        })
    }

    /// Flutes (of a straight tool), neck and shank; the last has no upper end, whatever its length.
    fn body(
        &self,
        defaults: &MissingParameters,
        shank: f64,
        place: &Place,
        notices: &mut Vec<String>,
    ) -> Result<Vec<Section>> {
        const REST: f64 = 1.0;
        let top = self.top_of_flutes(defaults, place)?;
        if shank < top - SAME_MM {
            notices.push(format!(
                "the shank of {} mm is thinner than what is below it and counts as {} mm wide",
                round(shank),
                round(top)
            ));
        }
        let is_tapered = matches!(self.form, Form::Tapered { .. });
        let is_wider =
            |section: &Section| 2.0 * section.lower_radius_mm.max(section.upper_radius_mm) > top;
        let is_narrow = shank <= top
            && self.neck.is_none_or(|neck| neck <= top)
            && !self.shaft.iter().any(is_wider);
        if is_narrow && !is_tapered && self.end_of_flutes(defaults).is_none() {
            self.say_relieved(top, notices);
            return Ok(vec![Section::cylinder(REST, 0.5 * self.diameter)]);
        }
        let flutes = self.flutes(defaults, place)?;
        let mut end = self.neck_end.unwrap_or(flutes);
        if end < flutes - SAME_MM && is_narrow {
            end = end.max(SAME_MM);
        } else if end < flutes - SAME_MM {
            notices.push(format!(
                "the shoulder ends at {} mm, below the end of the flutes at {} mm: the shank counts from the former on",
                round(end),
                round(flutes)
            ));
        } else {
            end = end.max(flutes);
        }
        self.say_relieved(top, notices);
        let mut sections = Vec::new();
        if !is_tapered {
            sections.push(Section::cylinder(flutes.min(end), 0.5 * self.diameter));
        }
        if end > flutes + SAME_MM {
            let neck = self.neck.unwrap_or(top);
            sections.push(Section::cylinder(tidy(end - flutes), 0.5 * neck));
        } else if is_tapered && end < flutes {
            let found =
                format!("the shoulder ends at {end} mm, within the tapered flutes of {flutes} mm");
            return Err(place.error(found, "correct one of them"));
        }
        sections.extend_from_slice(&self.shaft);
        sections.push(Section::cylinder(REST, 0.5 * shank));
        Ok(sections)
    }

    /// Diameter of the flutes' upper end.
    fn top_of_flutes(&self, defaults: &MissingParameters, place: &Place) -> Result<f64> {
        match self.form {
            Form::Tapered { taper, .. } => self.top_of(taper, defaults, place),
            _ => Ok(self.diameter),
        }
    }

    /// Diameter of the upper end of flutes with this taper.
    fn top_of(&self, taper: f64, defaults: &MissingParameters, place: &Place) -> Result<f64> {
        let flutes = self.flutes(defaults, place)?;
        let taper = taper.clamp(0.0, 1.5);
        let corner = if let Form::Tapered { corner, .. } = self.form { corner } else { 0.0 };
        let is_ball = 2.0 * corner >= self.diameter - SAME_MM;
        Ok(match is_ball {
            true => {
                let rise = (flutes - corner).max(0.0);
                2.0 * (corner / libm::cos(taper) + rise * libm::tan(taper))
            }
            false => self.diameter + 2.0 * flutes * libm::tan(taper),
        })
    }

    fn say_relieved(&self, top: f64, notices: &mut Vec<String>) {
        if let Some(neck) = self.neck.filter(|neck| *neck < top - SAME_MM) {
            notices.push(format!(
                "the neck of {} mm is thinner than what is below it and counts as {} mm wide",
                round(neck),
                round(top)
            ));
        }
    }

    fn say_narrow_holder(&self, holder: &Holder, notices: &mut Vec<String>) {
        let mut widest = 0.0f64;
        for section in &holder.sections {
            let least = section.lower_radius_mm.min(section.upper_radius_mm);
            if least < widest - SAME_MM {
                notices.push(format!(
                    "the holder {} narrows upward to {} mm and counts as {} mm wide there",
                    holder.name,
                    round(2.0 * least),
                    round(2.0 * widest)
                ));
                return;
            }
            widest = widest.max(section.lower_radius_mm).max(section.upper_radius_mm);
        }
    }

    fn words(&self) -> String {
        let d = round(self.diameter);
        if self.profile.is_some() {
            return format!("profile {d} mm");
        }
        match self.form {
            Form::Ball => format!("ball end {d} mm"),
            Form::Flat => format!("flat end {d} mm"),
            Form::Bull { corner } => format!("bull nose {d} mm R{}", round(corner)),
            Form::Family(family) => format!("{} {d} mm", family.words()),
            Form::Tapered { corner, taper } => {
                let degrees = round(taper.to_degrees());
                match (corner == 0.0, 2.0 * corner >= self.diameter - SAME_MM) {
                    (true, _) => format!("tapered flat {d} mm {degrees}°"),
                    (_, true) => format!("tapered ball {d} mm {degrees}°"),
                    _ => format!("tapered bull nose {d} mm R{} {degrees}°", round(corner)),
                }
            }
        }
    }
}

/// For people: to a ten-thousandth.
pub(super) fn round(x: f64) -> f64 {
    (x * 1e4).round() / 1e4
}
