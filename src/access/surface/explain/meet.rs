//! What of a tool meets what of the surface, in one direction, and by how much.

use crate::access::surface::bvh::Bvh;
use crate::access::surface::drop;
use crate::access::surface::penetrate::{is_clear_of_tip, nearest_above};
use crate::access::surface::problem::Problem;
use crate::access::surface::query::{Scratch, from_box};
use crate::access::surface::tool::{Contact, Outline, Stand, Tip, across, axes};
use crate::tool::cutter::ToolPart;
use glam::{DVec3, Vec3};

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
    let stand = problem.own_stand(0, direction);
    let (bvh, tolerances) = problem.triangles();
    let more = |place: u32| tolerances.at(place) - tolerances.least;
    let size = tool.size + problem.reach;
    let step = |&(_, [height, radius]): &(ToolPart, [f64; 2])| {
        let value = |place: u32, corners: &[DVec3; 3], _| {
            let more = more(place);
            drop::disc(corners, (radius - more).max(0.0)) - height - more
        };
        let (_, raise) = max_raise(bvh, &stand, ([height, radius], size), value)?;
        // Of all that is as high, what is nearest to the axis.
        let top = [height + raise - BEYOND_MM, radius];
        let (_, face, at) = nearest(bvh, &stand, top, size)?;
        let (distance, ..) = nearest(bvh, &stand, [height, radius], size)?;
        let narrow = if radius.is_finite() { radius - distance } else { f64::INFINITY };
        Some(Met { raise, narrow, face, at: stand.back(at) })
    };
    let tip = tool.tip.and_then(|tip| {
        let lower_end = match tip {
            Tip::Round { ring, radius } => [-radius, ring + radius],
            Tip::Flat { height, radius } => [height, radius],
        };
        let value =
            |place: u32, corners: &[DVec3; 3], least| match is_clear_of_tip(corners, tip, least) {
                true => least,
                false => drop::tip(corners, problem.outline.tip(tolerances.at(place))),
            };
        let (place, raise) = max_raise(bvh, &stand, (lower_end, size), value)?;
        let corners = stand.triangle(bvh.triangle(place));
        let (_, at) = nearest_above(&corners, lower_end[0])?;
        let at = stand.back(at);
        Some(Met { raise, narrow: f64::INFINITY, face: bvh.face(place), at })
    });
    Meeting { steps: tool.steps.iter().map(step).collect(), tip }
}

/// Heights that differ by less are the same, mm.
const BEYOND_MM: f64 = 1e-6;

/// The place of the triangle with the greatest positive value, and that value; `value` need not be right where it is at
/// most its second argument.
fn max_raise(
    bvh: &Bvh,
    stand: &Stand,
    (step, size): ([f64; 2], f64),
    value: impl Fn(u32, &[DVec3; 3], f64) -> f64,
) -> Option<(u32, f64)> {
    let mut scratch = Scratch::default();
    let [height, radius] = step;
    let of = |place: u32, least: f64| {
        let corners = stand.triangle(bvh.triangle(place));
        let top = corners[0].z.max(corners[1].z).max(corners[2].z);
        let is_near = top - height > least && from_box(&corners) <= radius * radius;
        if is_near { value(place, &corners, least).max(least) } else { least }
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
        let contact = Contact { point: self.site, normal: Some(self.normal) };
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
