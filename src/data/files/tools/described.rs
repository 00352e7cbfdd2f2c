//! A tool as files describe it, whatever their format, and what becomes of it.

use super::holder::Holder;
use super::place::Place;
use super::{Tool, Unsaid};
use crate::Result;
use crate::cutter::{Assembly, Section, TipShape};

/// Form of the lower end; lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form {
    Ball,
    Flat,
    Bull {
        corner: f64,
    },
    /// With this corner and the angle between flank and axis, radians.
    Tapered {
        corner: f64,
        taper: f64,
    },
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
    pub overall: Option<f64>,
    pub stick_out: Option<f64>,
    pub holder: Option<Holder>,
}

/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

impl Described {
    /// The tool, and what was changed to the safe side.
    pub fn tool(&self, unsaid: &Unsaid, place: &Place) -> Result<(Tool, Vec<String>)> {
        let missing = |what: &str, option: &str| {
            let found = format!("the file does not say the {what}");
            place.error(found, format!("give it with {option}"))
        };
        let stick_out = self.stick_out.or(unsaid.stick_out_mm);
        let stick_out = stick_out.ok_or_else(|| missing("stick-out", "--stick-out MM"))?;
        let holder = self.holder.as_ref().or(unsaid.holder.as_ref());
        let holder = holder.ok_or_else(|| missing("holder", "--holder FILE"))?;
        let shank = self.shank.or(unsaid.shank_mm);
        let shank = shank.ok_or_else(|| missing("diameter of the shank", "--shank MM"))?;
        let mut notices = Vec::new();
        let body = self.body(unsaid, shank, place, &mut notices)?;
        self.check_lengths(stick_out, place)?;
        let tip = self.tip(unsaid, place)?;
        let assembly = Assembly::new(tip, &body, &holder.sections, stick_out);
        let with_overall = |tool: Assembly| match self.overall {
            Some(overall) => tool.with_overall(overall),
            None => Ok(tool),
        };
        let assembly = assembly.and_then(with_overall).map_err(|error| place.within(error))?;
        self.say_narrow_holder(holder, &mut notices);
        let words = format!("{}, {} mm out of {}", self.words(), round(stick_out), holder.name);
        let tool = Tool::of_assembly(&self.name, assembly, 0.0, words);
        let notices = notices.into_iter().map(|words| place.sentence(words)).collect();
        Ok((tool.map_err(|error| place.within(error))?, notices))
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

    fn flutes(&self, unsaid: &Unsaid, place: &Place) -> Result<f64> {
        self.flutes.or(unsaid.flutes_mm).ok_or_else(|| {
            let found = "the file does not say the flute length";
            place.error(found, "give it with --flute-length MM")
        })
    }

    fn tip(&self, unsaid: &Unsaid, place: &Place) -> Result<TipShape> {
        let radius_mm = 0.5 * self.diameter;
        Ok(match self.form {
            Form::Ball => TipShape::Straight { radius_mm, corner_mm: radius_mm },
            Form::Flat => TipShape::Straight { radius_mm, corner_mm: 0.0 },
            Form::Bull { corner } => TipShape::Straight { radius_mm, corner_mm: corner },
            Form::Tapered { corner, taper } => TipShape::Tapered {
                radius_mm,
                corner_mm: corner,
                taper_rad: taper,
                flutes_mm: self.flutes(unsaid, place)?,
            },
        })
    }

    /// Flutes (of a straight tool), neck and shank; the last has no upper end, whatever its length.
    fn body(
        &self,
        unsaid: &Unsaid,
        shank: f64,
        place: &Place,
        notices: &mut Vec<String>,
    ) -> Result<Vec<Section>> {
        const REST: f64 = 1.0;
        let top = self.top_of_flutes(unsaid, place)?;
        if shank < top - SAME_MM {
            notices.push(format!(
                "the shank of {} mm is thinner than what is below it and counts as {} mm wide",
                round(shank),
                round(top)
            ));
        }
        let is_tapered = matches!(self.form, Form::Tapered { .. });
        if shank <= top && !is_tapered && self.neck.is_none_or(|neck| neck <= top) {
            self.say_relieved(top, notices);
            return Ok(vec![Section::cylinder(REST, 0.5 * self.diameter)]);
        }
        let flutes = self.flutes(unsaid, place)?;
        let mut end = self.neck_end.unwrap_or(flutes);
        if end < flutes - SAME_MM {
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
            sections.push(Section::cylinder(end - flutes, 0.5 * neck));
        } else if is_tapered && end < flutes {
            let found =
                format!("the shoulder ends at {end} mm, within the tapered flutes of {flutes} mm");
            return Err(place.error(found, "correct one of them"));
        }
        sections.push(Section::cylinder(REST, 0.5 * shank));
        Ok(sections)
    }

    /// Diameter of the flutes' upper end.
    fn top_of_flutes(&self, unsaid: &Unsaid, place: &Place) -> Result<f64> {
        let Form::Tapered { corner, taper } = self.form else { return Ok(self.diameter) };
        let flutes = self.flutes(unsaid, place)?;
        let rise = (flutes - corner).max(0.0);
        Ok(self.diameter + 2.0 * rise * libm::tan(taper.clamp(0.0, 1.5)))
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
        match self.form {
            Form::Ball => format!("ball end {d} mm"),
            Form::Flat => format!("flat end {d} mm"),
            Form::Bull { corner } => format!("bull nose {d} mm R{}", round(corner)),
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
