//! Tables in the words of a shop: CSV files with a diameter in place of the four lengths.
//!
//! ```text
//! T,name,diameter,corner,flute_length,shank,stick_out
//! 3,1/4" ball,0.25 in,0.125 in,0.75 in,0.25 in,1.1 in
//! ```
//!
//! A length has the unit written with it, else that of its heading (`diameter_in`, `D [mm]`), of the row's column
//! `unit`, what [`MissingParameters`] gives, or mm. The form is that of the column `type`, or follows from the corner,
//! or from the name.

use super::described::{CENTER_RAD, Cone, Described, Family, Form};
use super::place::{Place, shown};
use super::reading::Reading;
use super::table_text::TableText;
use super::words::{Remark, is_pointed, remark};
use super::{MissingParameters, Tool};
use crate::geom::units::length::{Length, unit_mm};
use crate::tool::cutter::Profile;
use crate::{Error, Result};
use csv::StringRecord;

/// What a column means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Meaning {
    Name,
    Number,
    Diameter,
    Corner,
    Form,
    Flutes,
    StickOut,
    Shank,
    Overall,
    Neck,
    NeckEnd,
    Taper,
    Tip,
    TipLength,
    Point,
    Clearance,
    Profile,
    Unit,
}

/// Headings by letters and digits alone, in small letters.
const WORDS: [(Meaning, &[&str]); 18] = [
    (Meaning::Name, &["name", "tool", "toolname", "description", "bezeichnung", "werkzeug"]),
    (Meaning::Number, &["t", "nr", "no", "number", "toolnumber", "toolno", "toolnr"]),
    (
        Meaning::Diameter,
        &["diameter", "d", "dia", "dc", "ø", "durchmesser", "tooldiameter", "cutterdiameter"],
    ),
    (Meaning::Corner, &["corner", "cornerradius", "r", "re", "radius", "eckenradius"]),
    (Meaning::Form, &["type", "form", "shape", "kind", "tooltype", "art", "typ"]),
    (
        Meaning::Flutes,
        &[
            "flute",
            "flutelength",
            "fluteslength",
            "lcf",
            "loc",
            "cuttinglength",
            "lengthofcut",
            "cutlength",
            "schneidenlänge",
        ],
    ),
    (
        Meaning::StickOut,
        &["stickout", "lb", "overhang", "projection", "ausspannlänge", "auskraglänge"],
    ),
    (
        Meaning::Shank,
        &["shank", "shankdiameter", "shankdia", "sfdm", "schaft", "schaftdurchmesser"],
    ),
    (Meaning::Overall, &["overall", "oal", "overalllength", "gesamtlänge"]),
    (Meaning::Neck, &["neck", "neckdiameter", "shoulderdiameter"]),
    (Meaning::NeckEnd, &["necklength", "shoulderlength"]),
    (Meaning::Taper, &["taper", "taperangle", "ta"]),
    (Meaning::Tip, &["tip", "tipdiameter", "pilot", "pilotdiameter"]),
    (Meaning::TipLength, &["tiplength", "pilotlength"]),
    (Meaning::Point, &["point", "pointangle", "sig", "spitzenwinkel"]),
    (Meaning::Clearance, &["clearance"]),
    (Meaning::Profile, &["profile", "profil"]),
    (Meaning::Unit, &["unit", "units", "einheit"]),
];

struct Column {
    meaning: Meaning,
    at: usize,
    heading: String,
    unit_mm: Option<f64>,
}

/// The columns of a table with a diameter.
pub(super) struct Columns {
    columns: Vec<Column>,
    n: usize,
    pub unused: Vec<String>,
}

impl Columns {
    /// `None` without a diameter or profile.
    pub fn of(header: &StringRecord) -> Option<Self> {
        let (mut columns, mut unused) = (Vec::new(), Vec::new());
        for (at, heading) in header.iter().enumerate().filter(|(_, heading)| !heading.is_empty()) {
            let (letters, unit_mm) = letters_and_unit(heading);
            let known = WORDS.iter().find(|(_, words)| words.contains(&letters.as_str()));
            match known {
                Some((meaning, _)) => {
                    columns.push(Column {
                        meaning: *meaning,
                        at,
                        heading: heading.into(),
                        unit_mm,
                    });
                }
                None => unused.push(shown(heading)),
            }
        }
        let is_needed = [Meaning::Diameter, Meaning::Profile];
        let has_size = columns.iter().any(|column| is_needed.contains(&column.meaning));
        has_size.then(|| Columns { columns, n: header.len(), unused })
    }

    /// Fails if two columns mean the same.
    pub fn check(&self, text: &TableText, line: usize) -> Result<()> {
        for (k, column) in self.columns.iter().enumerate() {
            let mut before = self.columns[..k].iter();
            if let Some(first) = before.find(|first| first.meaning == column.meaning) {
                let found = format!(
                    "{} and {} mean the same",
                    shown(&first.heading),
                    shown(&column.heading)
                );
                return Err(text.at(line, found, "delete or rename one"));
            }
        }
        Ok(())
    }

    /// The tool of a row, or why there is none.
    pub fn add(
        &self,
        text: &TableText,
        line: usize,
        row: &StringRecord,
        defaults: &MissingParameters,
        reading: &mut Reading,
    ) {
        let name = match self.field(row, Meaning::Name) {
            "" => format!("line {line}"),
            name => name.to_string(),
        };
        let label = format!("line {line}, tool {}", shown(&name));
        let place = Place { path: text.path, name: &label };
        let number = text.number(line, self.field(row, Meaning::Number), &mut reading.notices);
        if let Err(why) = text.check_width(line, row, self.n) {
            return reading.add(Err(why));
        }
        let row = Row { columns: self, row, defaults, place: &place };
        if !row.field(Meaning::Profile).is_empty() {
            return reading.add(row.tool_of_profile(&name, number));
        }
        match row.form(&name) {
            Err(why) => reading.add(Err(why)),
            Ok(Found::Other(kind)) => {
                let (found, remedy) = match is_pointed(kind) {
                    _ if kind == "center drill" => (
                        "a center drill without the diameter and the length of its pilot".into(),
                        "give them in columns tip and tip_length",
                    ),
                    true => (
                        format!("a {kind} without the angle of its point"),
                        "give the angle between flank and axis in a column taper",
                    ),
                    false => (
                        format!(
                            "a {kind} cannot be represented, only ball, bull-nose, flat and tapered end mills, \
                             drills, reamers and pointed mills"
                        ),
                        "it is left out, or give its profile in a column profile",
                    ),
                };
                reading.leave_out_kind(place.error(found, remedy));
            }
            Ok(Found::Form(form, notice)) => {
                let tool = row.tool(&name, form, number);
                let sentence = notice.map(|notice| place.sentence(notice));
                reading.add(tool.map(|(tool, mut notices)| {
                    notices.extend(sentence);
                    (tool, notices)
                }));
            }
        }
    }

    fn column(&self, meaning: Meaning) -> Option<&Column> {
        self.columns.iter().find(|column| column.meaning == meaning)
    }

    fn field<'a>(&self, row: &'a StringRecord, meaning: Meaning) -> &'a str {
        self.column(meaning).and_then(|column| row.get(column.at)).unwrap_or("")
    }
}

/// `Stick-out [in]` → `stickout` and the inch's millimeters.
fn letters_and_unit(heading: &str) -> (String, Option<f64>) {
    let heading = heading.to_lowercase();
    let end = heading.trim_end_matches([')', ']']);
    let parts = end.rsplit_once(['(', '[', '_', ' ', '-', '/']);
    let unit = parts.and_then(|(name, unit)| Some((name, unit_mm(unit)?)));
    let (name, unit) = unit.map_or((&*heading, None), |(name, unit)| (name, Some(unit)));
    (name.chars().filter(|c| c.is_alphanumeric()).collect(), unit)
}

enum Found {
    /// With what is to be said about it.
    Form(Form, Option<&'static str>),
    Other(&'static str),
}

struct Row<'a> {
    columns: &'a Columns,
    row: &'a StringRecord,
    defaults: &'a MissingParameters,
    place: &'a Place<'a>,
}

const CENTER: &str =
    "of a center drill, angles that are not given count as 60° (countersink) and 118° (point)";
/// Radii that differ by less are the same, as a share.
const SAME: f64 = 1e-3;

impl Row<'_> {
    fn field(&self, meaning: Meaning) -> &str {
        self.columns.field(self.row, meaning)
    }

    fn error(&self, found: String, remedy: &str) -> Error {
        self.place.error(found, remedy)
    }

    /// A length in mm; `None` where the field is empty.
    fn length(&self, meaning: Meaning) -> Result<Option<f64>> {
        let Some(column) = self.columns.column(meaning) else { return Ok(None) };
        let field = self.field(meaning);
        if field.is_empty() {
            return Ok(None);
        }
        let length = Length::read(field).ok_or_else(|| {
            let found = format!("{} is {}, not a length", column.heading, shown(field));
            self.error(found, "write a number, or one with its unit (1/4 in)")
        })?;
        let unit = column.unit_mm.or(self.unit()?).or(self.defaults.unit_mm).unwrap_or(1.0);
        self.place.not_negative(&column.heading, length.mm_of(unit)).map(Some)
    }

    /// That of the row's column.
    fn unit(&self) -> Result<Option<f64>> {
        match self.field(Meaning::Unit) {
            "" => Ok(None),
            name => unit_mm(name).map(Some).ok_or_else(|| {
                self.error(format!("the unit is {}", shown(name)), "expected mm or in: correct it")
            }),
        }
    }

    /// Millimeters of the unit that a length is written in.
    fn written_in(&self, meaning: Meaning) -> Result<f64> {
        let column = self.columns.column(meaning).and_then(|column| column.unit_mm);
        let own = Length::read(self.field(meaning)).filter(|length| length.has_unit());
        let own = own.map(|length| length.unit_or(1.0)).or(column);
        Ok(own.or(self.unit()?).or(self.defaults.unit_mm).unwrap_or(1.0))
    }

    fn diameter(&self) -> Result<f64> {
        let diameter = self.length(Meaning::Diameter)?.filter(|d| *d > 0.0);
        diameter.ok_or_else(|| self.error("the diameter is missing or 0".into(), "give it"))
    }

    fn form(&self, name: &str) -> Result<Found> {
        let (diameter, corner) = (self.diameter()?, self.length(Meaning::Corner)?);
        let kind = self.field(Meaning::Form);
        let said =
            remark(if kind.is_empty() { name } else { kind }, self.defaults.unit_mm.unwrap_or(1.0));
        let by_corner = |corner: f64| match corner {
            0.0 => Form::Flat,
            corner if (2.0 * corner - diameter).abs() <= SAME * diameter => Form::Ball,
            corner => Form::Bull { corner },
        };
        let form = match (said, corner) {
            (Remark::Other("tapered mill"), _) if self.columns.column(Meaning::Taper).is_some() => {
                by_corner(corner.unwrap_or(0.5 * diameter))
            }
            (Remark::Other(kind), _) => match self.pointed(kind)? {
                Some(form) => form,
                None => return Ok(Found::Other(kind)),
            },
            (Remark::Form(form @ Form::Family(_)), _) => form,
            (Remark::Nothing, _) if !kind.is_empty() => {
                let found = format!("the type is {}", shown(kind));
                return Err(self.error(found, "expected ball, flat or bull: correct it"));
            }
            (Remark::Form(form), Some(corner)) if !kind.is_empty() => {
                self.check_corner(form, by_corner(corner), corner)?
            }
            (_, Some(corner)) => by_corner(corner),
            (Remark::Form(form), None) => form,
            (Remark::EndMill, None) => {
                let notice = "it is an end mill and no more is said: it counts as a flat end";
                return Ok(Found::Form(Form::Flat, Some(notice)));
            }
            (Remark::Bull | Remark::Nothing, None) => {
                let found =
                    "the form is not said: neither corner nor type (ball, flat, bull) is there";
                return Err(self.error(found.into(), "add a column corner: 0 for a flat end"));
            }
        };
        let is_assumed = match form {
            Form::Family(Family::CenterDrill { .. }) => {
                self.taper()?.is_none() || self.field(Meaning::Point).is_empty()
            }
            _ => false,
        };
        Ok(Found::Form(form, is_assumed.then_some(CENTER)))
    }

    fn check_corner(&self, said: Form, by_corner: Form, corner: f64) -> Result<Form> {
        let agrees = match said {
            Form::Bull { .. } => true,
            form => form == by_corner,
        };
        match agrees {
            true => Ok(by_corner),
            false => {
                let found = format!(
                    "the type is {} and the corner {corner} mm",
                    shown(self.field(Meaning::Form))
                );
                Err(self.error(found, "correct one of them"))
            }
        }
    }

    fn tool(&self, name: &str, form: Form, number: Option<u32>) -> Result<(Tool, Vec<String>)> {
        let (form, diameter) = (self.tapered(form)?, self.diameter()?);
        Described {
            number,
            unit_mm: self.written_in(Meaning::Diameter)?,
            flutes: self.length(Meaning::Flutes)?,
            neck: self.length(Meaning::Neck)?,
            neck_end: self.length(Meaning::NeckEnd)?,
            shank: self.length(Meaning::Shank)?,
            overall: self.length(Meaning::Overall)?,
            stick_out: self.length(Meaning::StickOut)?,
            clearance: self.length(Meaning::Clearance)?.unwrap_or(0.0),
            ..Described::new(name, form, diameter)
        }
        .tool(self.defaults, self.place)
    }

    /// A tool of the column profile, which describes all of it below the holder.
    fn tool_of_profile(&self, name: &str, number: Option<u32>) -> Result<(Tool, Vec<String>)> {
        let column = self.columns.column(Meaning::Profile);
        let unit = column.and_then(|column| column.unit_mm).or(self.unit()?);
        let unit = unit.or(self.defaults.unit_mm).unwrap_or(1.0);
        let profile: Result<Profile> = self.field(Meaning::Profile).parse();
        let profile = profile.and_then(|profile| profile.scaled(unit));
        let profile = profile.map_err(|error| self.place.within(error))?;
        Described {
            number,
            unit_mm: unit,
            overall: self.length(Meaning::Overall)?,
            stick_out: self.length(Meaning::StickOut)?,
            clearance: self.length(Meaning::Clearance)?.unwrap_or(0.0),
            ..Described::of_profile(name, profile)
        }
        .tool(self.defaults, self.place)
    }

    /// A cone or a drill whose angle is in the column taper; or a reamer, or a center drill with its pilot.
    fn pointed(&self, kind: &str) -> Result<Option<Form>> {
        if kind == "reamer" {
            return Ok(Some(Form::Family(Family::Reamer)));
        }
        if kind == "center drill" {
            let lengths = [self.length(Meaning::Tip)?, self.length(Meaning::TipLength)?];
            let [Some(pilot), Some(length)] = lengths.map(|x| x.filter(|x| *x > 0.0)) else {
                return Ok(None);
            };
            let angle = self.taper()?.map_or(CENTER_RAD[0], f64::to_radians);
            let point = self.degrees(Meaning::Point, "the whole angle", 180.0)?;
            let point = point.map_or(CENTER_RAD[1], |whole| 0.5 * whole.to_radians());
            return Ok(Some(Form::Family(Family::CenterDrill { pilot, length, point, angle })));
        }
        if kind == "drill" {
            let drill = |degrees: f64| Family::Drill { angle: degrees.to_radians() };
            return Ok(self.taper()?.map(|degrees| Form::Family(drill(degrees))));
        }
        let Some(kind) = Cone::named(kind) else { return Ok(None) };
        let tip = self.length(Meaning::Tip)?.unwrap_or(0.0);
        let family = |degrees: f64| Family::Cone { kind, tip, angle: degrees.to_radians() };
        Ok(self.taper()?.map(|degrees| Form::Family(family(degrees))))
    }

    /// The angle between flank and axis of the column taper, degrees.
    fn taper(&self) -> Result<Option<f64>> {
        self.degrees(Meaning::Taper, "per side", 90.0)
    }

    /// An angle below `most`, degrees; none where the field is empty or 0.
    fn degrees(&self, meaning: Meaning, what: &str, most: f64) -> Result<Option<f64>> {
        let field = self.field(meaning).trim_end_matches(['°', ' ']);
        if field.is_empty() || field == "0" {
            return Ok(None);
        }
        let degrees: Option<f64> = field.replace(',', ".").parse().ok();
        let degrees = degrees.filter(|degrees| *degrees > 0.0 && *degrees < most);
        let heading = self.columns.column(meaning).map_or("angle", |column| &column.heading);
        let found = || format!("the {heading} is {}", shown(field));
        degrees.map(Some).ok_or_else(|| self.error(found(), &format!("give it in degrees, {what}")))
    }

    /// With the angle of the column taper.
    fn tapered(&self, form: Form) -> Result<Form> {
        if let Form::Family(_) = form {
            return Ok(form);
        }
        let Some(degrees) = self.taper()? else { return Ok(form) };
        let corner = match form {
            Form::Ball => 0.5 * self.diameter()?,
            Form::Bull { corner } | Form::Tapered { corner, .. } => corner,
            Form::Flat => 0.0,
            Form::Family(_) => return Ok(form),
        };
        Ok(Form::Tapered { corner, taper: degrees.to_radians() })
    }
}
