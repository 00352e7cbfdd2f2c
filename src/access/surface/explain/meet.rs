//! What of a tool meets what of the surface, in one direction, and by how much.

use crate::access::surface::bvh::Bvh;
use crate::access::surface::drop;
use crate::access::surface::penetrate::is_clear_of_tip;
use crate::access::surface::problem::Problem;
use crate::access::surface::query::{Scratch, from_box};
use crate::access::surface::tool::{Contact, Outline, Stand, Tip, across, axes};
use crate::cutter::ToolPart;
use glam::{DVec2, DVec3, Vec3};

/// A tool as it is tested: shrunk steps above the reference point, with their parts.
pub(super) struct ShrunkTool {
    /// Lowest first.
    pub steps: Vec<(ToolPart, [f64; 2])>,
    /// None where contact is not tested.
    pub tip: Option<Tip>,
    /// Greatest length, mm.
    pub size: f64,
}

/// Where a part of the tool meets the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Met {
    /// How far it would have to be raised to be clear, mm.
    pub raise: f64,
    /// How much its radius must be less to be clear, mm; infinite for the tip and the spindle.
    pub narrow: f64,
    /// Triangle, or point, that it meets.
    pub face: u32,
    pub at: DVec3,
}

/// One direction.
#[derive(Debug, Clone)]
pub(super) struct Meeting {
    /// Per step of the tool.
    pub steps: Vec<Option<Met>>,
    pub tip: Option<Met>,
}

impl Meeting {
    /// The lowest step that meets the surface, with its place in the list; else the tip.
    pub fn lowest(&self, tool: &ShrunkTool) -> Option<(ToolPart, Met)> {
        let parts = tool.steps.iter().zip(&self.steps);
        let step = parts.filter_map(|((part, _), met)| met.map(|met| (*part, met))).next();
        step.or(self.tip.map(|met| (ToolPart::Tip, met)))
    }

    /// By how much `part` and all above must be raised; `None` if that does not help, 0 if there is no need.
    pub fn raise(&self, tool: &ShrunkTool, from: ToolPart) -> Option<f64> {
        let mut raise = self.tip.is_none().then_some(0.0f64)?;
        for ((part, _), met) in tool.steps.iter().zip(&self.steps) {
            match met {
                Some(_) if *part < from => return None,
                Some(met) => raise = raise.max(met.raise),
                None => {}
            }
        }
        Some(raise)
    }

    /// By how much the radii of `part` must be less; `None` if that does not help, 0 if there is no need.
    pub fn narrow(&self, tool: &ShrunkTool, of: ToolPart) -> Option<f64> {
        let mut narrow = self.tip.is_none().then_some(0.0f64)?;
        for ((part, _), met) in tool.steps.iter().zip(&self.steps) {
            match met {
                Some(met) if *part == of => narrow = narrow.max(met.narrow),
                Some(_) => return None,
                None => {}
            }
        }
        Some(narrow)
    }
}

/// Measures against the triangles of a problem with one query: greatest heights, as the plain loops of
/// [`raise`](crate::access::surface::raise) have them.
pub(super) fn among_triangles(problem: &Problem, tool: &ShrunkTool, direction: Vec3) -> Meeting {
    let stand = stand(problem, direction);
    let bvh = problem.bvh;
    let size = tool.size + problem.reach;
    let step = |&(_, [height, radius]): &(ToolPart, [f64; 2])| {
        let value = |corners: &[DVec3; 3], _| drop::disc(corners, radius) - height;
        let (_, raise) = max_raise(bvh, &stand, ([height, radius], size), value)?;
        // Of all that is as high, what is nearest to the axis.
        let top = [height + raise - BEYOND_MM, radius];
        let (_, face, at) = nearest(bvh, &stand, top, size)?;
        let (distance, ..) = nearest(bvh, &stand, [height, radius], size)?;
        let narrow = if radius.is_finite() { radius - distance } else { f64::INFINITY };
        Some(Met { raise, narrow, face, at: back(&stand, at) })
    };
    let tip = tool.tip.and_then(|tip| {
        let lower_end = match tip {
            Tip::Round { ring, radius } => [-radius, ring + radius],
            Tip::Flat { height, radius } => [height, radius],
        };
        let value = |corners: &[DVec3; 3], least| match is_clear_of_tip(corners, tip, least) {
            true => least,
            false => drop::tip(corners, tip),
        };
        let (place, raise) = max_raise(bvh, &stand, (lower_end, size), value)?;
        let corners = stand.triangle(bvh.triangle(place));
        let (_, at) = nearest_above(&corners, lower_end[0])?;
        let at = back(&stand, at);
        Some(Met { raise, narrow: f64::INFINITY, face: bvh.face(place), at })
    });
    Meeting { steps: tool.steps.iter().map(step).collect(), tip }
}

/// Heights that differ by less are the same, mm.
const BEYOND_MM: f64 = 1e-6;

/// Where the tool of a problem with one query stands.
pub(super) fn stand(problem: &Problem, direction: Vec3) -> Stand {
    let axes = axes(direction);
    Stand { reference: problem.contacts[0].reference_point(&problem.outline, axes[2]), axes }
}

/// The place of the triangle with the greatest positive value, and that value; `value` need not be right where it is at most its second
/// argument.
fn max_raise(
    bvh: &Bvh,
    stand: &Stand,
    (step, size): ([f64; 2], f64),
    value: impl Fn(&[DVec3; 3], f64) -> f64,
) -> Option<(u32, f64)> {
    let mut scratch = Scratch::default();
    let [height, radius] = step;
    let of = |place: u32, least: f64| {
        let corners = stand.triangle(bvh.triangle(place));
        let top = corners[0].z.max(corners[1].z).max(corners[2].z);
        let is_near = top - height > least && from_box(&corners) <= radius * radius;
        if is_near { value(&corners, least).max(least) } else { least }
    };
    let found = scratch.max_raise(bvh, stand, (&[step], size), [0.0, f64::INFINITY], of);
    scratch.last.map(|place| (place, found))
}

/// The place nearest to the axis of all that is in a step: its distance, its triangle, and where it is.
fn nearest(
    bvh: &Bvh,
    stand: &Stand,
    [height, radius]: [f64; 2],
    size: f64,
) -> Option<(f64, u32, DVec3)> {
    let mut best: Option<(f64, u32, DVec3)> = None;
    let mut levels = [bvh.level(height, radius, size)];
    bvh.visit(stand, &mut levels, &mut Vec::new(), |place, levels| {
        let found = nearest_above(&stand.triangle(bvh.triangle(place)), height);
        if let Some((distance, at)) = found {
            let face = bvh.face(place);
            let is_nearer = |b: &(f64, u32, DVec3)| (distance, face) < (b.0, b.1);
            if best.as_ref().is_none_or(is_nearer) {
                best = Some((distance, face, at));
                *levels = [bvh.level(height, distance.min(radius), size)];
            }
        }
        false
    });
    best.map(|(distance, face, at)| (distance.min(radius), face, at))
}

/// Of the part of a triangle that is higher than `height`, the distance from the axis and the place nearest to it.
fn nearest_above(corners: &[DVec3; 3], height: f64) -> Option<(f64, DVec3)> {
    let (mut rim, mut n_rim) = ([DVec3::ZERO; 4], 0);
    let mut push = |p: DVec3| {
        rim[n_rim] = p;
        n_rim += 1;
    };
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a.z > height {
            push(a);
        }
        if (a.z > height) != (b.z > height) {
            push(a.lerp(b, (height - a.z) / (b.z - a.z)));
        }
    }
    let rim = &rim[..n_rim];
    let mut best: Option<(f64, DVec3)> = None;
    let (mut left, mut right) = (true, true);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (k, &a) in rim.iter().enumerate() {
        let b = rim[(k + 1) % rim.len()];
        let (start, run) = (across(a), across(b - a));
        (low, high) = (low.min(start), high.max(start));
        let turn = start.perp_dot(run);
        (left, right) = (left && turn >= 0.0, right && turn <= 0.0);
        let length = run.length_squared();
        let part = if length > 0.0 { (-start.dot(run) / length).clamp(0.0, 1.0) } else { 0.0 };
        let at = a.lerp(b, part);
        let distance = across(at).length();
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, at));
        }
    }
    // A facet seen edge-on turns by roundings alone, but then its box is beside the axis.
    if left != right && low.max(-high).max_element() <= 0.0 {
        let [a, b, c] = *corners;
        let normal = (b - a).cross(c - a);
        return Some((0.0, DVec3::Z * (normal.dot(a) / normal.z)));
    }
    best
}

/// A point of the tool's frame in the part's coordinates.
fn back(stand: &Stand, p: DVec3) -> DVec3 {
    let [u, v, d] = stand.axes;
    stand.reference + u * p.x + v * p.y + d * p.z
}

/// Measures against points, by the published definition: nothing is shrunk, and contact is not tested.
pub(super) struct Points<'a> {
    pub obstacles: &'a [Vec3],
    /// The obstacle that is the site itself.
    pub own: Option<usize>,
    pub site: DVec3,
    pub normal: DVec3,
}

impl Points<'_> {
    fn stand(&self, outline: &Outline, direction: Vec3) -> Stand {
        let contact = Contact::Surface { point: self.site, normal: self.normal };
        let axes = axes(direction);
        Stand { reference: contact.reference_point(outline, axes[2]), axes }
    }

    fn each(&self) -> impl Iterator<Item = (usize, DVec3)> + '_ {
        let others = self.obstacles.iter().enumerate().filter(|(j, _)| Some(*j) != self.own);
        others.map(|(j, p)| (j, p.as_dvec3()))
    }

    pub fn meet(&self, tool: &ShrunkTool, outline: &Outline, direction: Vec3) -> Meeting {
        let stand = self.stand(outline, direction);
        let mut steps: Vec<Option<Met>> = vec![None; tool.steps.len()];
        for (j, p) in self.each() {
            let local = stand.local(p);
            let distance = across(local).length();
            for ((_, [height, radius]), met) in tool.steps.iter().zip(&mut steps) {
                let raise = local.z - height;
                if raise <= 0.0 || distance > *radius {
                    continue;
                }
                let new = Met { raise, narrow: radius - distance, face: j as u32, at: p };
                let old = met.unwrap_or(new);
                let higher = if raise > old.raise { new } else { old };
                *met = Some(Met { narrow: old.narrow.max(new.narrow), ..higher });
            }
        }
        Meeting { steps, tip: None }
    }

    /// How far the steps may grow before a point collides (negative: must shrink), at most `limit`.
    pub fn clearance(
        &self,
        tool: &ShrunkTool,
        outline: &Outline,
        direction: Vec3,
        limit: f64,
    ) -> f64 {
        let stand = self.stand(outline, direction);
        let steps = |p: DVec3| {
            let local = stand.local(p);
            let distance = across(local).length();
            let of = tool.steps.iter().map(|(_, [h, r])| (h - local.z).max(distance - r));
            of.fold(f64::INFINITY, f64::min)
        };
        self.each().map(|(_, p)| steps(p)).fold(limit, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    #[test]
    fn the_nearest_place_above_a_height_is_on_the_triangle_and_agrees_with_drop_heights() {
        let mut stream = Stream::new(11, 0, 0, Purpose::Probe);
        let mut n_met = 0;
        for _ in 0..4000 {
            let mut range = || stream.range(-3.0, 3.0);
            let corners = [0; 3].map(|_| DVec3::new(range(), range(), range()));
            let radius = 0.2 + (range() + 3.0) / 3.0;
            let wanted = drop::disc(&corners, radius);
            if !wanted.is_finite() {
                continue;
            }
            n_met += 1;
            // Below the greatest height over a disc something is in it, above it nothing.
            let (distance, at) = nearest_above(&corners, wanted - 1e-6).unwrap();
            assert!(distance <= radius + 1e-6 && (across(at).length() - distance).abs() < 1e-9);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            assert!(normal.dot(at - corners[0]).abs() < 1e-9 && at.z >= wanted - 1e-6 - 1e-9);
            let above = nearest_above(&corners, wanted + 1e-6);
            assert!(above.is_none_or(|(distance, _)| distance > radius - 1e-4));
        }
        assert!(n_met > 1000, "{n_met}");
    }
}
