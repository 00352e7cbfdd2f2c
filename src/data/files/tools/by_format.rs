//! Reading a file of tools of any format, and folders of such files.

use super::place::shown;
use super::reading::Reading;
use super::unpack::{Content, content};
use super::{
    MissingParameters, ToolTable, camotics, export, freecad, fusion, hsmlib, linuxcnc, place, table,
};
use crate::storage::input_file;
use crate::{Error, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Reads a file of tools, or all `.fctb` files of a folder in the order of their names.
///
/// # Errors
/// If a file is not what its format demands, or no tool is left.
pub fn read(path: &Path, defaults: &MissingParameters) -> Result<ToolTable> {
    of_path(path, defaults)?.finish(path)
}

/// As [`read`], of several files: one of which no tool is left does not lose the others, nor does a tool bit that
/// cannot be read.
///
/// # Errors
/// If another file is not what its format demands, or no tool of any is left.
#[doc(hidden)] // of the program
pub fn read_several(paths: &[PathBuf], defaults: &MissingParameters) -> Result<Vec<ToolTable>> {
    let mut readings = Vec::new();
    for path in paths {
        let mut reading = Reading::default();
        match has_extension(path, "fctb") && path.is_file() {
            true => add_bit(&mut reading, path, None, defaults),
            false => reading = of_path(path, defaults)?,
        }
        readings.push(reading);
    }
    if let Some(path) = paths.first().filter(|_| readings.iter().all(|of| of.tools.is_empty())) {
        let mut all = Reading::default();
        readings.into_iter().for_each(|reading| all.extend(reading));
        return Err(all.none_left(path));
    }
    Ok(readings.into_iter().map(Reading::table).collect())
}

fn of_path(path: &Path, defaults: &MissingParameters) -> Result<Reading> {
    match path.is_dir() {
        true => of_folder(path, defaults),
        false => of_file(path, defaults),
    }
}

/// Reads tools from the content of a file; `path` is for its extension and for messages. A FreeCAD library (`.fctl`),
/// which only names other files, is read by [`read`].
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path, defaults: &MissingParameters) -> Result<ToolTable> {
    match of_bytes(bytes, path, defaults)? {
        Read::Tools(reading) => reading.finish(path),
        Read::Bits(_) => {
            let found = "it names tool bits in other files";
            Err(Error::file(path, "tools", found, "give the bits, or the library by its path"))
        }
    }
}

/// What a file holds.
enum Read {
    Tools(Reading),
    /// Files of tools, by number and path.
    Bits(Vec<freecad::Bit>),
}

fn of_file(path: &Path, defaults: &MissingParameters) -> Result<Reading> {
    let bytes = input_file::read(path, input_file::LIBRARY)?;
    match of_bytes(&bytes, path, defaults)? {
        Read::Tools(reading) => Ok(reading),
        Read::Bits(bits) => of_bits(&bits, path, defaults),
    }
}

fn of_folder(folder: &Path, defaults: &MissingParameters) -> Result<Reading> {
    let mut files = tool_bits(folder)?;
    let within = folder.join("Bit");
    if files.is_empty() && within.is_dir() {
        files = tool_bits(&within)?;
    }
    if files.is_empty() {
        let remedy = "name a file, or a folder of FreeCAD tool bits";
        return Err(Error::file(folder, "folder", "there is no .fctb file in it", remedy));
    }
    let mut all = Reading::default();
    for file in files {
        add_bit(&mut all, &file, None, defaults);
    }
    Ok(all)
}

/// The tools of a FreeCAD library, with its numbers.
fn of_bits(bits: &[freecad::Bit], library: &Path, defaults: &MissingParameters) -> Result<Reading> {
    let mut all = Reading::default();
    for bit in bits {
        match freecad::find(&bit.path, library) {
            Some(file) => add_bit(&mut all, &file, bit.number, defaults),
            None => {
                let place = bit.number.map_or("tool".into(), |number| format!("tool {number}"));
                let found = format!("there is no file {}", shown(&bit.path));
                let remedy = "put it beside the library, or into the folder Bit beside it";
                all.add(Err(Error::file(library, place, found, remedy)));
            }
        }
    }
    Ok(all)
}

fn add_bit(all: &mut Reading, file: &Path, number: Option<u32>, defaults: &MissingParameters) {
    match of_file(file, defaults) {
        Ok(mut reading) => {
            let numbered = reading.tools.iter_mut();
            numbered.for_each(|tool| tool.number = number.or(tool.number));
            all.extend(reading);
        }
        Err(why) => all.add(Err(why)),
    }
}

fn tool_bits(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::read(folder, e))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::read(folder, e))?.path();
        if has_extension(&path, "fctb") && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn of_bytes(bytes: &[u8], path: &Path, defaults: &MissingParameters) -> Result<Read> {
    let text = match content(bytes, path)? {
        Content::Text(text) => text,
        Content::Library(unpacked) => place::text(&unpacked, path)?.into_owned().into(),
        Content::Western(text) => return of_western(&text, (bytes, path), defaults),
    };
    Ok(Read::Tools(match text.trim_start().chars().next() {
        Some('{' | '[') => return of_json(&place::json(&text, path)?, path, defaults),
        _ if hsmlib::is_xml(&text) => {
            let library = hsmlib::library(&text, path)?;
            fusion::read(&library, fusion::Spelling::Xml, path, defaults)?
        }
        _ if has_extension(path, "hsmlib") => {
            let remedy = "export the tools again";
            return Err(Error::file(path, "line 1", "the file is not XML", remedy));
        }
        _ if ["fctb", "json", "fctl"].iter().any(|e| has_extension(path, e)) => {
            let remedy = "export the tools again";
            return Err(Error::file(path, "line 1", "the file is not JSON", remedy));
        }
        _ if has_extension(path, "tbl") || linuxcnc::is_table(&text) => {
            linuxcnc::read(&text, path, defaults)
        }
        _ => table::read(&text, path, defaults)?,
    }))
}

/// A table of which the text is not UTF-8; files of other formats are.
fn of_western(
    text: &str,
    (bytes, path): (&[u8], &Path),
    defaults: &MissingParameters,
) -> Result<Read> {
    let is_table = |first: char| !matches!(first, '{' | '[' | '<');
    let others = ["fctb", "json", "fctl", "hsmlib"];
    let is_table = text.trim_start().chars().next().is_some_and(is_table)
        && !others.iter().any(|e| has_extension(path, e));
    let mut reading = match has_extension(path, "tbl") || linuxcnc::is_table(text) {
        _ if !is_table => return Err(place::text(bytes, path).expect_err("it is not UTF-8")),
        true => linuxcnc::read(text, path, defaults),
        false => table::read(text, path, defaults)?,
    };
    let notice = "the text is not UTF-8: it is read as Windows-1252; look at the names";
    reading.notices.insert(0, format!("{}: {notice}", path.display()));
    Ok(Read::Tools(reading))
}

fn of_json(value: &Value, path: &Path, defaults: &MissingParameters) -> Result<Read> {
    if let Some(tools) = export::tools(value) {
        return export::read(tools, path).map(Read::Tools);
    }
    if let Some(bits) = freecad::bits(value) {
        return Ok(Read::Bits(bits));
    }
    if let Some(tools) = camotics::tools(value) {
        return Ok(Read::Tools(camotics::read(&tools, path, defaults)));
    }
    if value.get("parameter").is_some() {
        return Ok(Read::Tools(freecad::read(value, path, defaults)));
    }
    if fusion::is_library(value) {
        return fusion::read(value, fusion::Spelling::Json, path, defaults).map(Read::Tools);
    }
    let found = "neither `data` (Fusion 360) nor `parameter` (FreeCAD) nor tools with a `shape` (CAMotics) are there";
    let remedy = "name a tool library exported as JSON, or a tool bit";
    Err(Error::file(path, "top level", found, remedy))
}

pub(super) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
