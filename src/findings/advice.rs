//! What would help at a finding: a change of the tool, changes of the part.

use crate::access::surface::{PartChange, PartLength};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A change of the tool that reaches sites of a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ToolChange {
    /// In words.
    pub words: String,
    /// Share of the region's sites that the changed tool reaches.
    pub share: f64,
}

impl ToolChange {
    /// A change in words, and what it reaches.
    pub fn new(words: String, share: f64) -> Self {
        ToolChange { words, share }
    }
}

/// A change of the part that lets the tool reach sites of a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
#[doc(hidden)] // of the page and the program
pub struct PartAdvice {
    /// For which tool, where no one of several tools reaches.
    pub tool: Option<String>,
    /// Which length of the part.
    pub kind: PartLength,
    /// What it is.
    pub from: f64,
    /// What the tool needs.
    pub to: f64,
    /// Of both.
    pub unit: Cow<'static, str>,
    /// Area that it frees, mm².
    pub frees_mm2: f64,
    /// A place that it frees, mm; of what blocks, where that is.
    pub at_mm: DVec3,
    /// Depth of the slot or bore, mm.
    pub depth_mm: Option<f64>,
    /// In words.
    pub words: String,
}

impl PartAdvice {
    /// Of a change, which frees its share of an area; `tool` is the name of the tool where there are others.
    pub fn new(change: &PartChange, area_mm2: f64, tool: Option<&str>) -> Self {
        let frees_mm2 = change.share * area_mm2;
        let with = tool.map_or(String::new(), |tool| format!(" for {tool}"));
        PartAdvice {
            tool: tool.map(str::to_owned),
            kind: change.kind,
            from: change.from_mm,
            to: change.to_mm,
            unit: "mm".into(),
            frees_mm2,
            at_mm: change.at_mm,
            depth_mm: change.depth_mm,
            words: format!("{} frees {}{with}", part_change_words(change), area_words(frees_mm2)),
        }
    }
}

/// An axis that was not tested and along which tools reach a region: the part would have to be turned so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
#[doc(hidden)] // of the page and the program
pub struct Opening {
    /// The tool axis, from tip to spindle: `+x` to `-z`.
    pub axis: Cow<'static, str>,
    /// Share of the region's sites that are reached along it.
    pub share: f64,
}

impl Opening {
    /// An axis, and what is reached along it.
    pub fn new(axis: &'static str, share: f64) -> Self {
        Opening { axis: axis.into(), share }
    }
}

/// Openings in words.
#[doc(hidden)] // of the page and the program
pub fn openings_words(openings: &[Opening]) -> String {
    let words = |of: &Opening| format!("{} ({:.1} %)", of.axis, 100.0 * of.share);
    let words: Vec<String> = openings.iter().map(words).collect();
    format!("reached with this axis up, which was not tested: {}", words.join(", "))
}

/// A change of the part in words, without what it frees.
#[doc(hidden)] // of explanations
pub fn part_change_words(change: &PartChange) -> String {
    let name = match change.kind {
        PartLength::CornerRadius => "corner radius",
        PartLength::SlotWidth => "slot width",
        PartLength::BoreDiameter => "bore diameter",
        PartLength::HeightInTheWay => {
            let [x, y, z] = change.at_mm.to_array().map(|mm| (10.0 * mm).round() / 10.0 + 0.0);
            return format!("what blocks at {x}, {y}, {z} lower by {} mm", change.from_mm);
        }
    };
    let depth = change.depth_mm.filter(|_| change.from_mm > 0.0).map(|depth| {
        let ratio = (10.0 * depth / change.from_mm).round() / 10.0;
        format!(" ({depth} mm deep, depth/width {ratio})")
    });
    let (from, to) = (change.from_mm, change.to_mm);
    format!("{name} {from} → {to} mm{}", depth.unwrap_or_default())
}

/// An area with about three digits.
fn area_words(mm2: f64) -> String {
    match mm2 {
        mm2 if mm2 >= 1e4 => format!("{:.0} cm²", mm2 / 100.0),
        mm2 if mm2 >= 1e3 => format!("{:.1} cm²", mm2 / 100.0),
        mm2 if mm2 >= 100.0 => format!("{:.2} cm²", mm2 / 100.0),
        mm2 if mm2 >= 10.0 => format!("{mm2:.1} mm²"),
        mm2 => format!("{mm2:.2} mm²"),
    }
}
