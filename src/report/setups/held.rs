//! What holds the part in a setup: columns of the table, and the bodies in the way.

use super::turned_mesh;
use crate::data::files::label_query::joined;
use crate::geom::Mesh;
use crate::tables::Cell;
use glam::DMat3;

/// What holds the part in a setup.
#[doc(hidden)] // of the analysis
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// What there is, as `vise on ±y + table`.
    pub words: String,
    /// Between the faces that a vise grips.
    pub opening_mm: Option<f64>,
    /// How high its jaws reach above what the part lies on.
    pub grip_mm: Option<f64>,
    /// Of the part.
    pub under_jaws_mm2: Option<f64>,
    /// Share of the surface that is out of reach for it alone.
    pub kept_out: f64,
    /// In the part's coordinates.
    pub bodies: Vec<Mesh>,
}

impl Held {
    /// All of it, in the coordinates of the setup.
    pub(super) fn body(&self, turn: DMat3) -> Option<Mesh> {
        joined(&self.bodies).map(|body| turned_mesh(&body, turn))
    }
}

/// Columns, with headings if something holds the part, and one of a vise if there is one.
pub(super) fn columns(held: &[Held]) -> [(&'static str, &'static str); 5] {
    let shown = |heading, is_shown: bool| if is_shown { heading } else { "" };
    let is_gripped = held.iter().any(|held| held.opening_mm.is_some());
    [
        ("held_by", shown("held by", !held.is_empty())),
        ("opening_mm", shown("opening, mm", is_gripped)),
        ("grip_mm", shown("grip, mm", is_gripped)),
        ("under_jaws_mm2", shown("under jaws, mm²", is_gripped)),
        ("kept_out", shown("kept out", !held.is_empty())),
    ]
}

/// A cell per column.
pub(super) fn cells(held: Option<&Held>) -> [Cell; 5] {
    let number = |x: Option<f64>| x.map_or(Cell::Missing, Cell::Number);
    [
        held.map_or(Cell::Missing, |held| Cell::text(&held.words)),
        number(held.and_then(|held| held.opening_mm)),
        number(held.and_then(|held| held.grip_mm)),
        number(held.and_then(|held| held.under_jaws_mm2)),
        held.map_or(Cell::Missing, |held| Cell::Share(held.kept_out)),
    ]
}
