//! Tool libraries of HSMWorks, Inventor CAM and Fusion 360 as XML (`.hsmlib`): what [`fusion`](super::fusion) reads, in
//! other words.
//!
//! ```text
//! <tool-library> or <tool-table>
//!   <tool type="flat end mill" unit="millimeters">
//!     <description>…</description> <nc number="4"/>
//!     <body diameter="12.7" flute-length="31.75" …/>
//!     <holder description="…"> <section diameter="25.2" length="0"/> … </holder>
//! ```
//!
//! The sections of a holder go from its nose upward, those of a shaft from the neck's end: each says the diameter that
//! is reached over its length, a step where that is 0. `taper-angle` is the angle of the whole point of tools that make
//! holes, and per side of others.

use super::fusion::Spelling;
use super::place::shown;
use crate::storage::input_file;
use crate::{Error, Result};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Whether a text is XML.
pub(super) fn is_xml(text: &str) -> bool {
    text.trim_start().starts_with('<')
}

/// The library in the structure of Fusion 360's JSON, its words those of the file: [`Spelling::Xml`].
///
/// # Errors
/// If it is no XML or no such library.
pub(super) fn library(text: &str, path: &Path) -> Result<Value> {
    let mut reader = Reader::from_str(text);
    let mut library = Library::default();
    let mut depth = 0usize;
    let line = |at: u64| format!("line {}", input_file::line_of(text.as_bytes(), at as usize));
    loop {
        let event = reader.read_event().map_err(|e| {
            let found = format!("the XML cannot be read ({})", one_line(&e.to_string()));
            Error::file(path, line(reader.error_position()), found, "export the tools again")
        })?;
        match event {
            Event::Start(tag) => {
                check_root(&tag, depth, path)?;
                library.open(&tag);
                depth += 1;
            }
            Event::Empty(tag) => {
                check_root(&tag, depth, path)?;
                library.open(&tag);
                library.close(tag.local_name().as_ref());
            }
            Event::End(tag) => {
                library.close(tag.local_name().as_ref());
                depth = depth.saturating_sub(1);
            }
            Event::Text(text) => library.text.push_str(&text),
            Event::CData(text) => library.text.push_str(&text),
            Event::GeneralRef(reference) => {
                let name: &str = reference.as_ref();
                match reference.resolve_char_ref() {
                    Ok(Some(letter)) => library.text.push(letter),
                    _ => library.text.push_str(match name {
                        "amp" => "&",
                        "lt" => "<",
                        "gt" => ">",
                        "quot" => "\"",
                        "apos" => "'",
                        _ => "?",
                    }),
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if depth > 0 {
        let found = "the XML ends before its tools do";
        return Err(Error::file(path, "last line", found, "copy or export the file again"));
    }
    Ok(json!({ "data": library.tools }))
}

/// The outermost tag is that of a library, or of one tool.
fn check_root(tag: &BytesStart, depth: usize, path: &Path) -> Result<()> {
    let local = tag.local_name();
    let name = local.as_ref();
    if depth > 0 || ["tool-library", "tool-table", "tool"].contains(&name) {
        return Ok(());
    }
    let found = format!("it is XML, but no tool library: its outermost tag is {}", shown(name));
    Err(Error::file(path, "top level", found, "name a .hsmlib file of HSMWorks or Fusion 360"))
}

#[derive(Default)]
struct Library {
    tools: Vec<Value>,
    tool: Option<Map<String, Value>>,
    /// Diameter and length of the sections of a holder.
    sections: Option<Vec<[Value; 2]>>,
    text: String,
}

impl Library {
    fn open(&mut self, tag: &BytesStart) {
        self.text.clear();
        let name = tag.local_name();
        if name.as_ref() == "tool" && self.tool.is_none() {
            let mut tool = Map::new();
            for key in ["type", "unit"] {
                tool.extend(attribute(tag, key).map(|value| (key.to_string(), value.into())));
            }
            self.tool = Some(tool);
            return;
        }
        let Some(tool) = &mut self.tool else { return };
        match name.as_ref() {
            "body" => drop(tool.insert("geometry".into(), numbers(tag).into())),
            "nc" => {
                let number = attribute(tag, "number").and_then(|n| n.trim().parse::<u64>().ok());
                tool.insert("post-process".into(), json!({ "number": number }));
            }
            "holder" => {
                let mut holder = Map::new();
                let unit = tool.get("unit").cloned();
                holder.extend(unit.map(|unit| ("unit".to_string(), unit)));
                let description = attribute(tag, "description");
                holder.extend(description.map(|name| ("description".to_string(), name.into())));
                if let Some(gauge) = attribute(tag, "gauge-length") {
                    holder.insert("gaugeLength".into(), number(&gauge));
                }
                tool.insert("holder".into(), holder.into());
                self.sections = Some(Vec::new());
            }
            "shaft" => self.sections = Some(Vec::new()),
            "section" => {
                if let Some(sections) = &mut self.sections {
                    let of = |key| attribute(tag, key).map_or(Value::Null, |text| number(&text));
                    sections.push([of("diameter"), of("length")]);
                }
            }
            _ => {}
        }
    }

    fn close(&mut self, name: &str) {
        let Some(tool) = &mut self.tool else { return };
        match name {
            "tool" => {
                self.tools.extend(self.tool.take().map(Value::Object));
            }
            "description" | "product-id" if self.sections.is_none() => {
                let words = self.text.trim();
                if !words.is_empty() {
                    tool.entry(name).or_insert_with(|| words.into());
                }
            }
            "holder" | "shaft" => {
                let sections = self.sections.take().unwrap_or_default();
                if sections.is_empty() {
                    return;
                }
                let object = tool.entry(name).or_insert_with(|| json!({}));
                if let Some(object) = object.as_object_mut() {
                    object.insert("segments".into(), segments(&sections).into());
                }
            }
            _ => {}
        }
        self.text.clear();
    }
}

/// A segment from each section of some length: from the diameter before it to its own.
fn segments(sections: &[[Value; 2]]) -> Vec<Value> {
    let mut before = None;
    let mut segments = Vec::new();
    for [diameter, length] in sections {
        let lower = before.unwrap_or(diameter);
        before = Some(diameter);
        if length.as_f64() != Some(0.0) {
            segments.push(json!({
                "height": length, "lower-diameter": lower, "upper-diameter": diameter,
            }));
        }
    }
    segments
}

fn attribute(tag: &BytesStart, name: &str) -> Option<String> {
    let mut all = tag.attributes();
    let mut all = all.with_checks(false).flatten();
    let found = all.find(|a| a.key.local_name().as_ref() == name)?;
    Some(match found.normalized_value(quick_xml::XmlVersion::Implicit1_0) {
        Ok(value) => value.into_owned(),
        Err(_) => found.value.into_owned(),
    })
}

/// The attributes, numbers where they are.
fn numbers(tag: &BytesStart) -> Map<String, Value> {
    let mut all = tag.attributes();
    let all = all.with_checks(false).flatten();
    let pair = |key: &str, value: &str| (key.to_string(), number(value));
    all.map(|a| pair(a.key.local_name().as_ref(), a.value.as_ref())).collect()
}

fn number(text: &str) -> Value {
    let number: Option<f64> = text.trim().parse().ok();
    match number.and_then(serde_json::Number::from_f64) {
        Some(number) => Value::Number(number),
        None => text.into(),
    }
}

fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

impl Spelling {
    /// The word that the file has for a length or angle of Fusion 360's JSON.
    pub(super) fn key(self, key: &'static str) -> &'static str {
        if self == Spelling::Json {
            return key;
        }
        match key {
            "DC" => "diameter",
            "DCX" => "maximum-diameter",
            "RE" => "corner-radius",
            "LCF" => "flute-length",
            "LB" => "body-length",
            "OAL" => "overall-length",
            "SFDM" => "shaft-diameter",
            // Of the whole point, or per side: by the kind of tool.
            "SIG" | "TA" => "taper-angle",
            "TA2" => "taper-angle2",
            "TP" => "thread-pitch",
            "NT" => "number-of-teeth",
            key => key,
        }
    }
}
