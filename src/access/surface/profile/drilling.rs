//! Drills and reamers: what they touch is the wall of a hole of their own size.
//!
//! # Definition
//!
//! At the height of the site the part is cut across the axis. Of all directions around the axis those are counted in
//! which its outline is no farther than the tool is wide there, and a little: the finish tolerance, and that of the
//! triangle, twice, as the axis may be beside the middle of the bore. The site is *reached by drilling* if that is more
//! than half of the way around. A single wall, a corner, the walls of a slot or of a square pocket are not.

use super::label::{Form, Frame, ProfileTool};
use crate::access::surface::tool::Stand;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// From the nominal wall, in finish tolerances and tolerances of triangles.
const BESIDE: f64 = 2.0;
/// Faces of the tool that lie flatter than this have no wall around them: the cosine of its normal across the axis.
const LEAST_ACROSS: f64 = 0.1;

impl ProfileTool<'_> {
    /// Whether the wall of a hole of the tool's own size is about what touches at `offset` from the tip, with the normal
    /// of the tool there.
    pub(super) fn is_in_own_hole(
        &self,
        frame: &Frame,
        tip: DVec3,
        [offset, normal]: [DVec3; 2],
    ) -> bool {
        let across = normal.truncate().length();
        if across < LEAST_ACROSS {
            return false;
        }
        let stand = Stand { reference: tip, axes: frame.axes };
        let (height, radius) = (offset.z, offset.truncate().length());
        let mut arcs: Vec<[f64; 2]> = Vec::new();
        let wider = BESIDE * (self.finish() + self.most_tolerance()) / across;
        let mut bands = self.bands(Form::Whole, wider);
        self.bvh().visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            let corners = stand.triangle(self.bvh().triangle(place));
            let beside = BESIDE * (self.finish() + self.shrunk(place).tolerance) / across;
            if let Some(ends) = cut_at(&corners, height)
                && let Some(arc) = arc_within(ends, radius + beside)
            {
                arcs.push(arc);
            }
            false
        });
        covered(arcs) > PI
    }
}

/// Where a triangle crosses a height, across the axis.
fn cut_at(corners: &[DVec3; 3], height: f64) -> Option<[DVec2; 2]> {
    let above = corners.map(|p| p.z > height);
    let mut ends = [DVec2::ZERO; 2];
    let mut n = 0;
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if above[k] != above[(k + 1) % 3] && n < 2 {
            ends[n] = a.truncate().lerp(b.truncate(), (height - a.z) / (b.z - a.z));
            n += 1;
        }
    }
    (n == 2).then_some(ends)
}

/// Angles about the axis, the second less than half a turn beyond the first, between which a segment is within a radius.
fn arc_within([a, b]: [DVec2; 2], radius: f64) -> Option<[f64; 2]> {
    let run = b - a;
    let squared = run.length_squared();
    if squared == 0.0 {
        return None;
    }
    let nearest = -a.dot(run) / squared;
    let distance = (a + run * nearest).length_squared();
    if distance >= radius * radius {
        return None;
    }
    let half = ((radius * radius - distance) / squared).sqrt();
    let (from, to) = ((nearest - half).max(0.0), (nearest + half).min(1.0));
    if from >= to {
        return None;
    }
    let [p, q] = [from, to].map(|t| a + run * t);
    let turn = libm::atan2(p.perp_dot(q), p.dot(q));
    let start = if turn >= 0.0 { p } else { q };
    let first = libm::atan2(start.y, start.x);
    Some([first, first + turn.abs()])
}

/// How much of a turn is in some of the arcs, radians.
fn covered(arcs: Vec<[f64; 2]>) -> f64 {
    // Those that pass half a turn go on at its other end.
    let mut parts: Vec<[f64; 2]> = Vec::with_capacity(arcs.len() + 2);
    for [from, to] in arcs {
        parts.push([from, to.min(PI)]);
        if to > PI {
            parts.push([-PI, to - TAU]);
        }
    }
    parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut sum, mut reached) = (0.0, -PI);
    for [from, to] in parts {
        sum += (to - from.max(reached)).max(0.0);
        reached = reached.max(to);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    #[test]
    fn arcs_are_counted_once() {
        assert_eq!(covered(Vec::new()), 0.0);
        assert!((covered(vec![[0.0, 1.0], [0.5, 2.0], [3.0, 3.5]]) - 2.5).abs() < 1e-12);
        // Past the end of the turn.
        assert!((covered(vec![[3.0, 3.3], [-3.1, -3.0], [-PI, -3.05]]) - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_segment_is_seen_from_the_axis() {
        let [from, to] = arc_within([dvec2(1.0, -5.0), dvec2(1.0, 5.0)], 2f64.sqrt()).unwrap();
        assert!((from + PI / 4.0).abs() < 1e-12 && (to - PI / 4.0).abs() < 1e-12);
        assert_eq!(arc_within([dvec2(1.0, -5.0), dvec2(1.0, 5.0)], 0.9), None);
        assert_eq!(arc_within([dvec2(1.0, 3.0), dvec2(1.0, 5.0)], 2.0), None);
        // Past the end of the turn.
        let [from, to] = arc_within([dvec2(-1.0, 1.0), dvec2(-1.0, -1.0)], 9.0).unwrap();
        assert!((to - from - PI / 2.0).abs() < 1e-12 && from > 0.0);
    }
}
