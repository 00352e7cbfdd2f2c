//! Machines as files: strokes, and rotary axes in the order from the part to the tool, as TOML, or as FreeCAD keeps
//! them.

mod freecad;

use crate::planning::setups::{Carrier, Fault, Kinematics, Machine, RotaryParams};
use crate::storage::input_file;
use crate::{Error, Result};
use glam::DVec3;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

const REMEDY: &str = "compare with the examples in docs/machines and with docs/setups.md";

/// As many numbers, no more: an array of serde leaves out what is too many.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Vec<f64>")]
struct Numbers<const N: usize>([f64; N]);

impl<const N: usize> TryFrom<Vec<f64>> for Numbers<N> {
    type Error = String;

    fn try_from(list: Vec<f64>) -> std::result::Result<Self, String> {
        let found = list.len();
        list.try_into().map(Numbers).map_err(|_| format!("{found} numbers, expected {N}"))
    }
}

/// Keys of a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MachineFile {
    name: Spanned<String>,
    home: Option<Spanned<String>>,
    strokes_mm: Option<Strokes>,
    #[serde(default)]
    axis: Vec<Spanned<AxisFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Strokes {
    x: Option<Spanned<Numbers<2>>>,
    y: Option<Spanned<Numbers<2>>>,
    z: Option<Spanned<Numbers<2>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisFile {
    letter: Spanned<String>,
    on: Spanned<String>,
    axis: Spanned<Numbers<3>>,
    limits: Option<Spanned<Numbers<2>>>,
    center_mm: Option<Spanned<Numbers<3>>>,
}

/// A machine in words, as [`Machine`] reads them, or the path of a file that ends in `.toml` or `.fcm`.
///
/// # Errors
/// As the reader of words, or as [`read`].
pub fn of_words_or_file(text: &str) -> Result<Machine> {
    if is_file(text) { read(Path::new(text)) } else { text.parse() }
}

/// Whether a text is the path of a machine file.
pub fn is_file(text: &str) -> bool {
    let is = |wanted: &str| has_extension(Path::new(text), wanted);
    is("toml") || is("fcm")
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
}

/// Reads a machine; a file that ends in `.fcm` as FreeCAD writes it.
///
/// # Errors
/// If the file cannot be read, is no TOML or no machine of FreeCAD, lacks a key or has another one, or an axis is not
/// what [`Kinematics::new`] takes.
pub fn read(path: &Path) -> Result<Machine> {
    let text = input_file::read_text(path, input_file::SETTINGS)?;
    if has_extension(path, "fcm") { freecad::parse(&text, path) } else { parse(&text, path) }
}

fn parse(text: &str, path: &Path) -> Result<Machine> {
    let place = |span: Option<Range<usize>>| {
        let line = span.map(|span| input_file::line_of(text.as_bytes(), span.start));
        line.map_or_else(|| "file".into(), |line| format!("line {line}"))
    };
    let refused = |span: Range<usize>, found: String, remedy: &str| {
        Error::file(path, place(Some(span)), found, remedy)
    };
    let file: MachineFile = toml::from_str(text).map_err(|e| {
        // A key that is missing in the whole file has no place.
        let words = e.message().trim().replace('\n', ", ");
        Error::file(path, place(e.span()), words, REMEDY)
    })?;
    if let Some(home) = file.home.filter(|home| home.get_ref() != "+z") {
        let found = format!("home is `{}`", home.get_ref());
        let remedy =
            "write home = \"+z\", with the vectors of the axes turned so that the tool is along it";
        return Err(refused(home.span(), found, remedy));
    }
    let mut strokes_mm = DVec3::INFINITY;
    if let Some(Strokes { x, y, z }) = file.strokes_mm {
        for (k, range) in [x, y, z].into_iter().enumerate() {
            let Some(range) = range else { continue };
            let Numbers([low, high]) = *range.get_ref();
            if !(low.is_finite() && high.is_finite() && low < high) {
                let remedy = "give the least and then the greatest place, mm";
                return Err(refused(range.span(), format!("the stroke {low}, {high}"), remedy));
            }
            strokes_mm[k] = high - low;
        }
    }
    let mut axes = Vec::with_capacity(file.axis.len());
    for axis in &file.axis {
        let AxisFile { letter, on, axis, limits, center_mm } = axis.get_ref();
        let mut letters = letter.get_ref().chars();
        let (Some(first), None) = (letters.next(), letters.next()) else {
            let found = format!("letter is `{}`", letter.get_ref());
            return Err(refused(letter.span(), found, "write A, B or C"));
        };
        let carrier = match &**on.get_ref() {
            "table" => Carrier::Table,
            "head" => Carrier::Head,
            other => {
                let remedy =
                    "write \"table\" if the axis turns the part, \"head\" if it turns the tool";
                return Err(refused(on.span(), format!("on is `{other}`"), remedy));
            }
        };
        if let Some(center) =
            center_mm.as_ref().filter(|c| c.get_ref().0.iter().any(|x| !x.is_finite()))
        {
            let Numbers([x, y, z]) = center.get_ref();
            let remedy = "give three numbers, mm, or leave center_mm out";
            return Err(refused(center.span(), format!("the center {x}, {y}, {z}"), remedy));
        }
        axes.push(RotaryParams {
            letter: first,
            on: carrier,
            axis: axis.get_ref().0,
            limits_deg: limits.as_ref().map(|limits| limits.get_ref().0),
        });
    }
    let kinematics = Kinematics::new(file.name.get_ref(), axes);
    let machine = |axes: Kinematics| Machine::Axes(axes.with_strokes_mm(strokes_mm));
    kinematics.map(machine).map_err(|Fault { axis, key, found, remedy }| {
        let of = axis.and_then(|k| file.axis.get(k)).map(Spanned::get_ref);
        let span = match (key, of) {
            ("letter", Some(of)) => of.letter.span(),
            ("on", Some(of)) => of.on.span(),
            ("limits", Some(of)) => of.limits.as_ref().map_or(of.axis.span(), Spanned::span),
            (_, Some(of)) => of.axis.span(),
            (_, None) => file.name.span(),
        };
        refused(span, found, remedy)
    })
}

#[cfg(test)]
mod tests;
