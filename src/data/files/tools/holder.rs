//! Holders: segments from the nose upward, from a library or a table of their own.

use super::MissingParameters;
use super::place::{Place, shown, shown_value};
use crate::geom::units::length::{converted, unit_mm};
use crate::geom::units::{Length, Unit};
use crate::tool::cutter::Section;
use crate::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// A holder; what is above its last section is spindle.
///
/// ```
/// use deepmill::data::files::tools::{MissingParameters, holder_from_bytes};
/// use std::path::Path;
///
/// let table = b"height,lower,upper\n10,24,32\n30,32,32\n"; // diameters
/// let holder = holder_from_bytes(table, Path::new("er16.csv"), &MissingParameters::default())?;
/// assert_eq!((holder.sections.len(), holder.sections[0].upper_radius_mm), (2, 16.0));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Holder {
    /// Name.
    pub name: String,
    /// Sections from the nose upward.
    pub sections: Vec<Section>,
}

/// A FreeCAD holder: an outline of points (radius, height above the face that the tool comes out of).
pub(super) fn of_profile(object: &Value, profile: &Value, path: &Path) -> Result<Holder> {
    let stem = path.file_stem().map_or("holder".into(), |stem| stem.to_string_lossy().into_owned());
    let name = object.get("name").and_then(Value::as_str).map_or(stem, str::to_string);
    let label = format!("holder {}", shown(&name));
    let place = Place { path, name: &label };
    let unit = match object.get("units").and_then(Value::as_str) {
        None => 1.0,
        Some(name) => unit_mm(name).ok_or_else(|| {
            place.error(format!("its units are {}", shown(name)), "expected mm: correct it")
        })?,
    };
    let bad = |found: String| {
        let remedy = "give points [radius, height], from the nose upward";
        place.error(found, remedy)
    };
    let points = profile.as_array().ok_or_else(|| bad("profile is not a list".into()))?;
    let mut outline: Vec<[f64; 2]> = Vec::new();
    for (k, point) in points.iter().enumerate() {
        let numbers =
            point.as_array().map(|p| p.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
        let point = numbers.and_then(|p| <[f64; 2]>::try_from(p).ok());
        let point = point.filter(|p| p.iter().all(|x| (0.0..=1e6).contains(x)));
        let point =
            point.ok_or_else(|| bad(format!("point {} is {}", k + 1, shown_value(&points[k]))))?;
        outline.push(point.map(|x| converted(x, unit)));
    }
    if let Some(k) = (1..outline.len()).find(|k| outline[*k][1] < outline[k - 1][1]) {
        return Err(bad(format!("point {} is lower than the one before it", k + 1)));
    }
    // What is below the first point counts as wide as it.
    if let Some(&[radius, _]) = outline.first().filter(|[_, height]| *height > 0.0) {
        outline.insert(0, [radius, 0.0]);
    }
    let section = |pair: &[[f64; 2]]| {
        let ([a, from], [b, to]) = (pair[0], pair[1]);
        let wide = |radius: f64| radius.max(LEAST_MM);
        Section { length_mm: to - from, lower_radius_mm: wide(a), upper_radius_mm: wide(b) }
    };
    let sections =
        outline.windows(2).map(section).filter(|section| section.length_mm > 0.0).collect();
    checked(Holder { name: name.clone(), sections }, &place)
}

/// Where an outline begins on the axis, mm.
const LEAST_MM: f64 = 1e-3;

pub(super) fn of_library(
    value: &Value,
    path: &Path,
    defaults: &MissingParameters,
) -> Result<Holder> {
    let tools = value.get("data").and_then(Value::as_array);
    let mut found: Vec<Holder> = Vec::new();
    for object in tools.into_iter().flatten().chain([value]) {
        for object in [Some(object), object.get("holder")].into_iter().flatten() {
            let holder = of_object(object, path, defaults)?;
            if let Some(holder) = holder.filter(|holder| !found.contains(holder)) {
                found.push(holder);
            }
        }
    }
    let remedy = "export a library with one holder, or write a table height,lower,upper in mm";
    match (found.len(), found.pop()) {
        (1, Some(holder)) => Ok(holder),
        (0, _) | (_, None) => Err(Error::file(path, "top level", "there is no holder", remedy)),
        (n, Some(last)) => {
            let names: Vec<String> =
                found.iter().chain([&last]).take(5).map(|holder| shown(&holder.name)).collect();
            let found = format!("there are {n} holders: {}", names.join(", "));
            Err(Error::file(path, "top level", found, remedy))
        }
    }
}

/// A Fusion 360 holder; `None` if the object has no segments.
pub(super) fn of_object(
    object: &Value,
    path: &Path,
    defaults: &MissingParameters,
) -> Result<Option<Holder>> {
    let Some(segments) = object.get("segments") else { return Ok(None) };
    let name = object.get("description").and_then(Value::as_str).unwrap_or("holder");
    let label = format!("holder {}", shown(name));
    let place = Place { path, name: &label };
    let unit = unit(object, &place, defaults)?;
    let sections = sections_of(segments, unit, &place)?;
    let gauge = place.length(object, "gaugeLength", unit)?.filter(|g| *g > 0.0);
    let sections = below_gauge(sections, gauge);
    checked(Holder { name: name.to_string(), sections }, &place).map(Some)
}

/// The sections of a holder or a shaft.
pub(super) fn sections_of(segments: &Value, unit: f64, place: &Place) -> Result<Vec<Section>> {
    const REMEDY: &str = "correct it where it was made, and export again";
    let Some(segments) = segments.as_array() else {
        return Err(place.error("segments is not a list", REMEDY));
    };
    let section = |(k, segment): (usize, &Value)| {
        let length = |key: &str| {
            let missing = || place.error(format!("segment {} has no {key}", k + 1), REMEDY);
            place.length(segment, key, unit)?.ok_or_else(missing)
        };
        Ok(Section {
            length_mm: length("height")?,
            lower_radius_mm: 0.5 * length("lower-diameter")?,
            upper_radius_mm: 0.5 * length("upper-diameter")?,
        })
    };
    segments.iter().enumerate().map(section).collect()
}

/// The spindle's face is at the gauge length: what is above it is spindle.
fn below_gauge(sections: Vec<Section>, gauge: Option<f64>) -> Vec<Section> {
    let Some(gauge) = gauge else { return sections };
    let mut kept = Vec::new();
    let mut height = 0.0;
    for mut section in sections {
        let room = gauge - height;
        height += section.length_mm;
        if room <= 0.0 {
            break;
        }
        if section.length_mm > room {
            let share = room / section.length_mm;
            section.upper_radius_mm = section.lower_radius_mm
                + share * (section.upper_radius_mm - section.lower_radius_mm);
            section.length_mm = room;
        }
        kept.push(section);
    }
    kept
}

/// Most segments of a holder.
const MOST: usize = 30;

fn checked(holder: Holder, place: &Place) -> Result<Holder> {
    let n = holder.sections.len();
    if n == 0 || n > MOST {
        let found = format!("{n} segments");
        return Err(place.error(found, format!("give 1 to {MOST} segments, from the nose upward")));
    }
    for (k, section) in holder.sections.iter().enumerate() {
        let Section { length_mm, lower_radius_mm, upper_radius_mm } = *section;
        for (what, x) in [
            ("height", length_mm),
            ("lower radius", lower_radius_mm),
            ("upper radius", upper_radius_mm),
        ] {
            if !(1e-4..=1e4).contains(&x) {
                let found = format!("the {what} of segment {} is {x} mm", k + 1);
                let remedy =
                    "give heights and diameters from 0.0001 mm to 10 m, and check the unit";
                return Err(place.error(found, remedy));
            }
        }
    }
    Ok(holder)
}

/// Millimeters of the unit that a Fusion 360 object states.
pub(super) fn unit(object: &Value, place: &Place, defaults: &MissingParameters) -> Result<f64> {
    match object.get("unit") {
        None | Some(Value::Null) => defaults.unit_mm.ok_or_else(|| {
            place.error(
                "the file does not say the unit",
                "give it with `unit_mm` in a program, or --tool-unit mm or in",
            )
        }),
        Some(name) => name.as_str().and_then(unit_mm).ok_or_else(|| {
            let found = format!("the unit is {}", shown_value(name));
            place.error(found, "expected millimeters or inches: correct it")
        }),
    }
}

pub(super) fn of_table(text: &str, path: &Path) -> Result<Holder> {
    let name = path.file_stem().map_or("holder".into(), |stem| stem.to_string_lossy().into_owned());
    let bad = |line: usize, found: String| {
        let remedy = "write a table with the header height,lower,upper (mm, diameters), a row per segment from the nose upward";
        Error::file(path, format!("line {line}"), found, remedy)
    };
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let (line, header) = lines.next().ok_or_else(|| bad(1, "the table is empty".into()))?;
    let candidates = ['\t', ';', ','];
    let separator =
        candidates.into_iter().max_by_key(|c| header.matches(*c).count()).unwrap_or(',');
    let headings: Vec<String> =
        header.split(separator).map(|h| h.trim().to_ascii_lowercase()).collect();
    let mut column = [0; 3];
    for (k, name) in ["height", "lower", "upper"].into_iter().enumerate() {
        let at = headings.iter().position(|heading| heading == name);
        column[k] = at.ok_or_else(|| bad(line, format!("there is no column {name}")))?;
    }
    let mut sections = Vec::new();
    for (line, row) in lines {
        let fields: Vec<&str> = row.split(separator).map(str::trim).collect();
        let number = |k: usize| {
            let field = fields.get(column[k]).copied().unwrap_or("");
            let read = || Length::read(field).map(|length| length.mm(Unit::Millimeter));
            field
                .parse()
                .ok()
                .or_else(read)
                .ok_or_else(|| bad(line, format!("{} is not a length", shown(field))))
        };
        sections.push(Section {
            length_mm: number(0)?,
            lower_radius_mm: 0.5 * number(1)?,
            upper_radius_mm: 0.5 * number(2)?,
        });
    }
    let label = format!("holder {}", shown(&name));
    checked(Holder { name: name.clone(), sections }, &Place { path, name: &label })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::files::tools::holder_from_bytes;
    use serde_json::json;

    fn library(text: &str) -> Result<Holder> {
        of_library(
            &serde_json::from_str(text).unwrap(),
            "h.json".as_ref(),
            &MissingParameters::default(),
        )
    }

    #[test]
    fn holders_come_from_tables_and_libraries() {
        let path = Path::new("er20.csv");
        let comma = of_table("# ER20\nheight,lower,upper\n8,28,34\n22,34,34\n", path).unwrap();
        assert_eq!((comma.name.as_str(), comma.sections[0].upper_radius_mm), ("er20", 17.0));
        assert_eq!(of_table("upper;height;lower\n34;8,0;28\n34;22;34\n", path).unwrap(), comma);
        let inch = library(
            r#"{"data": [{"type": "holder", "description": "A", "unit": "inches",
               "segments": [{"height": 1, "lower-diameter": 1, "upper-diameter": 2}]}]}"#,
        );
        let section = inch.unwrap().sections[0];
        assert_eq!((section.length_mm, section.upper_radius_mm), (25.4, 25.4));
    }

    #[test]
    fn freecad_holders_are_outlines_of_radius_and_height() {
        let read = |text: &str| {
            holder_from_bytes(text.as_bytes(), "a.fcholder".as_ref(), &MissingParameters::default())
        };
        let nut = r#"{"version": 1, "name": "ER20 nut", "units": "mm", "type": "ER20",
            "profile": [[0, 0], [16.1, 0], [17.5, 1.4], [17.5, 19], [0, 19]]}"#;
        let holder = read(nut).unwrap();
        let cone = Section { length_mm: 1.4, lower_radius_mm: 16.1, upper_radius_mm: 17.5 };
        assert_eq!(holder.sections, [cone, Section::cylinder(17.6, 17.5)]);
        assert_eq!(holder.name, "ER20 nut");
        let raised = nut.replace("[0, 0], [16.1, 0]", "[16.1, 2]").replace("1.4]", "3]");
        assert_eq!(read(&raised).unwrap().sections[0], Section::cylinder(2.0, 16.1));
        for (text, words) in [
            (nut.replace("[17.5, 19]", "[17.5, 1]"), "point 4 is lower"),
            (nut.replace("[17.5, 19]", "[17.5]"), "point 4 is \"[17.5]\""),
            (nut.replace("[17.5, 19]", "[-17.5, 19]"), "point 4 is"),
            (nut.replace("\"mm\"", "\"furlong\""), "its units are \"furlong\""),
            (r#"{"profile": []}"#.into(), "0 segments"),
            (r#"{"profile": 3}"#.into(), "not a list"),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(
                message.starts_with("a.fcholder: holder ") && message.contains(words),
                "{message}"
            );
        }
    }

    #[test]
    fn what_is_above_the_gauge_length_is_spindle() {
        let object = json!({ "unit": "mm", "gaugeLength": 10, "segments": [
            { "height": 8, "lower-diameter": 20, "upper-diameter": 20 },
            { "height": 8, "lower-diameter": 20, "upper-diameter": 40 },
            { "height": 8, "lower-diameter": 60, "upper-diameter": 60 } ] });
        let holder =
            of_object(&object, "h".as_ref(), &MissingParameters::default()).unwrap().unwrap();
        let last = holder.sections[1];
        assert_eq!((holder.sections.len(), last.length_mm, last.upper_radius_mm), (2, 2.0, 12.5));
    }

    #[test]
    fn bad_holders_are_refused_with_a_remedy() {
        let path = Path::new("h.csv");
        for (text, words) in [
            ("", "empty"),
            ("height,lower\n1,2\n", "no column upper"),
            ("height,lower,upper\n", "0 segments"),
            ("height,lower,upper\n1,2,x\n", "line 2"),
            ("height,lower,upper\n1,-2,3\n", "lower radius of segment 1"),
            ("height,lower,upper\nNaN,2,3\n", "height of segment 1"),
        ] {
            let message = of_table(text, path).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("; "), "{message}");
        }
        for (text, words) in [
            (r#"{"data": []}"#, "no holder"),
            (r#"{"segments": []}"#, "--tool-unit"),
            (r#"{"segments": [], "unit": "mm"}"#, "0 segments"),
            (r#"{"segments": [{}], "unit": "mm"}"#, "segment 1 has no height"),
            (r#"{"segments": 3, "unit": "mm"}"#, "not a list"),
            (r#"{"segments": [], "unit": "furlongs"}"#, "the unit is \"furlongs\""),
        ] {
            let message = library(text).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("; "), "{message}");
        }
    }
}
