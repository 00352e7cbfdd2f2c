//! A tool in section as it was understood: what cuts, neck, shank and holder, with its dimensions in the unit of its
//! maker. A picture of SVG for people: the long plain part of the shank is broken, the holder cut off.

mod outline;
mod solid;
mod svg;

use crate::data::files::tools::Tool;
use crate::geom::units::Unit;
use outline::{Outline, Section};
pub(super) use solid::{Portion, Solid};
use svg::Drawing;

/// The drawing of a tool as SVG.
pub fn draw(tool: &Tool) -> String {
    let outline = Outline::of(tool);
    let unit = tool.unit();
    let view = View::of(&outline);
    let mut drawing = Drawing::new(view, outline.widest());
    parts(&mut drawing, &outline);
    dimensions(&mut drawing, &outline, unit);
    let words = match unit {
        Unit::Inch => "lengths in inches".to_string(),
        unit => format!("lengths in {}", unit.symbol()),
    };
    drawing.finish([&tool.name, &tool.words(), &words])
}

/// Where heights and radii are, pixels.
#[derive(Debug, Clone, Copy)]
struct View {
    scale: f64,
    /// Heights between these, mm, are left out.
    gap: Option<[f64; 2]>,
    /// Height of the upper edge, mm.
    top: f64,
}

/// Height of the tool, half of its width, and what is shown of the holder: its height and half of its width, pixels.
const HEIGHT: f64 = 340.0;
const HALF_WIDTH: f64 = 90.0;
const HOLDER: f64 = 46.0;
const HOLDER_HALF_WIDTH: f64 = 115.0;
/// Between the halves of a broken shank, pixels.
const BREAK: f64 = 10.0;

impl View {
    fn of(outline: &Outline) -> Self {
        let nose = outline.nose;
        let widest = outline.widest();
        let plain = outline.plain_from.min(nose);
        // What stays of the plain part, and of the holder.
        let keep = (0.4 * plain).max(1.2 * outline.shank).max(0.12 * nose);
        let shown = nose.min(plain + keep);
        let gap = (nose - shown > 0.15 * nose).then_some([plain + 0.5 * keep, nose - 0.5 * keep]);
        let shown = if gap.is_some() { shown } else { nose };
        let scale = (HEIGHT / shown).min(HALF_WIDTH / widest);
        View { scale, gap, top: nose + outline.holder_height().min(HOLDER / scale) }
    }

    fn removed(&self, height: f64) -> f64 {
        self.gap.map_or(0.0, |[from, to]| (height.clamp(from, to) - from).max(0.0))
    }

    /// Down from the upper edge.
    fn y(&self, height: f64) -> f64 {
        let above = self.gap.filter(|[from, _]| height > *from).map_or(0.0, |_| BREAK);
        let total = self.top - self.removed(self.top);
        let all = self.gap.map_or(0.0, |_| BREAK);
        self.scale * (total - (height - self.removed(height))) + all - above
    }
}

fn parts(drawing: &mut Drawing, outline: &Outline) {
    let mut from = [outline.start, 0.0];
    let mut group: Vec<Section> = Vec::new();
    let mut begin = from;
    for section in &outline.sections {
        if group.last().is_some_and(|last| last.kind != section.kind) {
            drawing.part(begin, &group);
            begin = from;
            group.clear();
        }
        group.push(*section);
        from = section.to;
    }
    if !group.is_empty() {
        drawing.part(begin, &group);
    }
    drawing.holder(outline);
    drawing.axis();
}

fn dimensions(drawing: &mut Drawing, outline: &Outline, unit: Unit) {
    let length = |mm: f64| number(mm, unit);
    let Outline { widest_cut, start, nose, .. } = *outline;
    // The flat below a corner is not what makers state.
    let is_stated = start > 0.02 * widest_cut[0] && start < 0.98 * widest_cut[0];
    if is_stated && !outline.begins_with_corner() {
        drawing.across([start, 0.0], widest_cut[0], &format!("Ø{}", length(2.0 * start)));
    }
    let widest = format!("Ø{}", length(2.0 * widest_cut[0]));
    drawing.across(widest_cut, widest_cut[0], &widest);
    let mut heights: Vec<f64> = Vec::new();
    let ends = [outline.flutes, outline.neck_end(), Some(nose)];
    for height in ends.into_iter().flatten() {
        let is_new = heights.iter().all(|other| (other - height).abs() > 1e-6);
        if is_new && height > 0.0 && height <= nose {
            heights.push(height);
            let radii = [outline.radius_at(height), outline.widest_below(height)];
            drawing.up_to(height, radii, &length(height));
        }
    }
    for (radius, height) in outline.cylinders() {
        let words = format!("Ø{}", length(2.0 * radius));
        drawing.leader([radius, height], &words);
    }
    for (point, radius) in outline.arcs() {
        drawing.leader(point, &format!("R{}", length(radius)));
    }
    for (point, degrees) in outline.slopes() {
        drawing.leader(point, &format!("{}°", rounded(degrees, 2)));
    }
}

/// A length for people, in a unit.
fn number(mm: f64, unit: Unit) -> String {
    let digits = if unit == Unit::Millimeter { 3 } else { 4 };
    rounded(mm / unit.millimeters(), digits)
}

fn rounded(x: f64, digits: usize) -> String {
    let text = format!("{x:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

#[cfg(test)]
mod tests;
