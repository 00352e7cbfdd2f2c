//! How deep triangles are in a tool at most, beyond their tolerance.
//!
//! A point is deeper in a tool than t iff it is in the tool shrunk by t. So the greatest depth is between two tools
//! that are shrunk by t and a little more, of which a triangle penetrates the first alone: roughly on a *ladder* of
//! such tools, which is made once, and exactly by halving.
//!
//! Of one part of the tool the points at its heights are counted.

use super::body::{Body, Element, finite_pieces};
use super::frame::Frame;
use super::label::{Form, ProfileTool};
use super::meet::{Hit, penetrates};
use super::outline::Outline;
use crate::access::surface::tool::Stand;
use crate::tool::cutter::{Profile, ToolPart};
use glam::{DVec2, DVec3};
use std::sync::OnceLock;

/// Heights above the tip at which holder and spindle begin, mm.
#[derive(Debug, Clone, Copy)]
pub(in crate::access::surface) struct PartHeights {
    pub holder: f64,
    pub spindle: f64,
}

impl PartHeights {
    /// Heights of every one of [`PARTS`].
    fn of(&self, profile: &Profile) -> [Vec<[f64; 2]>; 4] {
        let mut heights = [const { Vec::new() }; 4];
        for piece in finite_pieces(profile).iter().filter(|p| p.ends[0][1] < p.ends[1][1]) {
            let [low, high] = piece.ends.map(|[_, height]| height);
            for (k, part) in PARTS.into_iter().enumerate() {
                let within = match part {
                    _ if piece.cuts => [low, if part == ToolPart::Tip { high } else { low }],
                    ToolPart::Shank => [low, high.min(self.holder)],
                    ToolPart::Holder => [low.max(self.holder), high.min(self.spindle)],
                    ToolPart::Spindle => [low.max(self.spindle), high],
                    ToolPart::Tip | ToolPart::Cutter => [low, low],
                };
                if within[0] < within[1] {
                    heights[k].push(within);
                }
            }
        }
        heights
    }
}

/// What of a body is between heights.
fn between(body: &Body, heights: &[[f64; 2]]) -> Body {
    let mut elements = Vec::new();
    for &[low, high] in heights {
        let cut = |element: &Element| Element {
            low: element.low.max(low),
            high: element.high.min(high),
            ..*element
        };
        let cut = body.elements.iter().map(cut);
        elements.extend(cut.filter(|element| element.low < element.high));
    }
    Body { elements }
}

/// A tool shrunk by more and more.
pub(in crate::access::surface) struct Ladder<'a> {
    profile: &'a Profile,
    outline: Outline,
    /// By which the lowest is shrunk, mm.
    least: f64,
    rungs: Vec<OnceLock<Rung>>,
    /// Of every one of [`PARTS`].
    heights: [Vec<[f64; 2]>; 4],
}

/// The parts of a tool, the one that is named first.
const PARTS: [ToolPart; 4] = [ToolPart::Shank, ToolPart::Holder, ToolPart::Spindle, ToolPart::Tip];
/// By this factor each tool is shrunk more than the one before.
const RUNG: f64 = 1.05;
/// Up to which tools are shrunk, mm: more than any part is high.
const MOST_MM: f64 = 2e4;
/// More than chords of hollow arcs are off, mm.
const CHORD_MM: f64 = 1e-3;
/// To this the greatest depth is halved, mm.
const EXACT_MM: f64 = 1e-4;

/// The tool, shrunk, and its [`PARTS`].
struct Rung {
    whole: Body,
    parts: [Body; 4],
}

/// The greatest depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deepest {
    /// Beyond the tolerance, mm.
    pub mm: f64,
    /// Of the triangle.
    pub place: u32,
    /// About the deepest point, in the frame of the tool.
    pub point: DVec3,
}

impl<'a> Ladder<'a> {
    pub fn new(tool: &ProfileTool, profile: &'a Profile, parts: PartHeights) -> Self {
        let least = tool.shrunk_least().tolerance;
        let n = (libm::log((MOST_MM / least).max(1.0)) / libm::log(RUNG)).ceil() as usize + 1;
        let (rungs, outline) = ((0..n).map(|_| OnceLock::new()).collect(), Outline::new(profile));
        Ladder { profile, outline, least, rungs, heights: parts.of(profile) }
    }

    /// By how much the tool of a rung is shrunk, mm.
    fn depth(&self, rung: usize) -> f64 {
        self.least * libm::pow(RUNG, rung as f64)
    }

    /// The whole tool of a rung, or a part of it.
    fn body(&self, rung: usize, part: Option<usize>) -> &Body {
        let Rung { whole, parts } = self.rungs[rung].get_or_init(|| {
            let whole = Body::deep(self.profile, self.depth(rung));
            Rung { parts: [0, 1, 2, 3].map(|k| between(&whole, &self.heights[k])), whole }
        });
        part.map_or(whole, |part| &parts[part])
    }

    /// The lowest rung that is shrunk by more than this.
    fn above(&self, depth: f64) -> usize {
        let exact = libm::log((depth / self.least).max(1.0)) / libm::log(RUNG);
        exact.floor() as usize + 1
    }

    /// Whether a triangle is in a body that is shrunk by `depth`; a point of it that is not as deep is none.
    fn penetrates(&self, body: &Body, corners: &[DVec3; 3], depth: f64) -> Option<Hit> {
        let hit = penetrates(body, corners, DVec2::ZERO)?;
        (self.outline.depth(hit.point).mm >= depth - CHORD_MM).then_some(hit)
    }

    /// The highest rung from `first` on that a triangle penetrates, or a part of the tool there.
    fn highest(&self, first: usize, part: Option<usize>, corners: &[DVec3; 3]) -> Option<usize> {
        let holds = |rung: usize| {
            rung < self.rungs.len()
                && self.penetrates(self.body(rung, part), corners, self.depth(rung)).is_some()
        };
        if !holds(first) {
            return None;
        }
        let (mut low, mut step) = (first, 1);
        while holds(low + step) {
            (low, step) = (low + step, 2 * step);
        }
        let mut high = low + step;
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if holds(middle) { low = middle } else { high = middle }
        }
        Some(low)
    }

    /// About how deep the deepest triangle is beyond its tolerance, mm, positive; none if that is more than `most`, or
    /// no triangle is penetrated.
    pub(super) fn depth_within(
        &self,
        tool: &ProfileTool,
        frame: &Frame,
        tip: DVec3,
        most: f64,
    ) -> Option<f64> {
        let stand = Stand { reference: tip, axes: frame.axes };
        let (mut greatest, mut is_over) = (0.0, false);
        let mut bands = tool.bands(Form::Whole, 0.0);
        tool.bvh().visit(&stand, &mut bands, &mut Vec::new(), |place, bands| {
            let corners = stand.triangle(tool.bvh().triangle(place));
            let shrunk = tool.shrunk(place);
            let first = self.above(shrunk.tolerance + greatest);
            if let Some(rung) = self.highest(first, None, &corners) {
                greatest = self.depth(rung) - shrunk.tolerance;
                *bands = tool.bands(Form::Whole, -greatest);
            } else if greatest == 0.0 && penetrates(&shrunk.whole, &corners, DVec2::ZERO).is_some()
            {
                greatest = f64::MIN_POSITIVE;
            }
            is_over = greatest > most;
            is_over
        });
        (greatest > 0.0 && !is_over).then_some(greatest)
    }

    /// Of what penetrates the whole tool in a pose: the lowest part that does not cut and is penetrated, else what
    /// cuts, with the greatest depth in it; and the greatest depth of all, mm.
    pub(super) fn exactly(
        &self,
        tool: &ProfileTool,
        frame: &Frame,
        tip: DVec3,
    ) -> Option<(ToolPart, Deepest, f64)> {
        let stand = Stand { reference: tip, axes: frame.axes };
        let mut met: Vec<Met> = Vec::new();
        let mut bands = tool.bands(Form::Whole, 0.0);
        tool.bvh().visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            let corners = stand.triangle(tool.bvh().triangle(place));
            if let Some(hit) = penetrates(&tool.shrunk(place).whole, &corners, DVec2::ZERO) {
                met.push(Met { place, corners, point: hit.point });
            }
            false
        });
        let of = [0, 1, 2, 3].map(|k| (PARTS[k], self.deepest_in(tool, k, &met)));
        let mut found = of.into_iter().filter_map(|(part, deepest)| Some((part, deepest?)));
        let first = found.next()?;
        let greatest = found.map(|(_, deepest)| deepest.mm).fold(first.1.mm, f64::max);
        Some((first.0, first.1, greatest))
    }

    /// The greatest depth of points in one part of the tool.
    fn deepest_in(&self, tool: &ProfileTool, part: usize, met: &[Met]) -> Option<Deepest> {
        let all = self.deeper(tool, part, 0.0, met);
        // Roughly first: few are as deep, and tolerances differ.
        let mut rough: f64 = 0.0;
        let mut rungs = Vec::with_capacity(all.len());
        for met in &all {
            let tolerance = tool.shrunk(met.place).tolerance;
            // No rung below what is known.
            let first = self.above(tolerance + rough / (RUNG * RUNG));
            let rung = self.highest(first, Some(part), &met.corners);
            let bounds = match rung {
                Some(rung) => [self.depth(rung), self.depth(rung + 1)],
                None => [tolerance, self.depth(first)],
            };
            let bounds = bounds.map(|depth| depth - tolerance);
            rough = rough.max(bounds[0]);
            rungs.push(bounds[1]);
        }
        let near = all.iter().zip(&rungs).filter(|(_, most)| **most >= rough);
        let mut deepest: Vec<Met> = near.map(|(met, _)| *met).collect();
        let mut high = rungs.iter().fold(0.0, |a: f64, b| a.max(*b));
        let mut low = 0.0;
        if rough > EXACT_MM {
            // A little less, as bodies of both are made of chords.
            let at = rough - EXACT_MM;
            let still = self.deeper(tool, part, at, &deepest);
            if !still.is_empty() {
                (low, deepest) = (at, still);
            }
        }
        while high - low > EXACT_MM {
            let middle = 0.5 * (low + high);
            let still = self.deeper(tool, part, middle, &deepest);
            match still.is_empty() {
                true => high = middle,
                false => (low, deepest) = (middle, still),
            }
        }
        let Met { place, point, .. } = *deepest.first()?;
        Some(Deepest { mm: 0.5 * (low + high), place, point })
    }

    /// Of triangles those that are deeper in a part than this beyond their tolerance, with a point of each.
    fn deeper(&self, tool: &ProfileTool, part: usize, by: f64, met: &[Met]) -> Vec<Met> {
        let mut bodies: Vec<(f64, Body)> = Vec::new();
        let mut found = Vec::new();
        for met in met {
            let shrunk = tool.shrunk(met.place);
            let known = bodies.iter().position(|(tolerance, _)| *tolerance == shrunk.tolerance);
            let k = known.unwrap_or_else(|| {
                let heights = &self.heights[part];
                let body = match by > 0.0 {
                    true => between(&Body::deep(self.profile, shrunk.tolerance + by), heights),
                    false => between(&shrunk.whole, heights),
                };
                bodies.push((shrunk.tolerance, body));
                bodies.len() - 1
            });
            let depth = if by > 0.0 { shrunk.tolerance + by } else { f64::NEG_INFINITY };
            if let Some(hit) = self.penetrates(&bodies[k].1, &met.corners, depth) {
                found.push(Met { point: hit.point, ..*met });
            }
        }
        found
    }
}

/// A triangle that is penetrated, in the frame of the tool.
#[derive(Debug, Clone, Copy)]
struct Met {
    place: u32,
    corners: [DVec3; 3],
    /// In the tool.
    point: DVec3,
}
