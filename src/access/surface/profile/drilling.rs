//! Drills and reamers: along their axis alone, in bores of their own diameter.
//!
//! # Definition
//!
//! The part is cut across the axis at the height of the site. Where the ends of the cut lie on a circle about as wide
//! as the tool, and its wall goes more than half of the way around, there is a **bore**. It is the tool's own if its
//! radius is not more than the tool's by the finish tolerance and the gouge tolerance together. The pose is on the axis
//! of the bore, no deeper than it must to touch the site, and the site is *reached by drilling* if that pose is free
//! and a retreat along the axis is. A site on the cone of a blind bore is reached if the tool is free where its own
//! cone touches it, on the axis of a bore of its own. Single walls, slots and square pockets are no bores, whatever the
//! tool fits. A center drill or a step drill has several radii or cones: its own bores are those of each of its
//! cylinders, and each of its cones is tried.
//!
//! ```text
//! axes = those of the bores of its own at the triangles of the part
//! for every site:
//!     for every direction across its normal: the bore at its height; own and free: reached
//!     with the normal of the cone: for every axis that passes within the radius: the pose that touches with it, free: reached
//! ```
//!
//! What is not reached is inaccessible where something that does not cut is in the way in a bore of its own; else the
//! tip does not fit. Of an even set only the directions that the part suggests are tested.

use super::drill::{Drill, DrillCone, Margin, NEAR};
use super::frame::Frame;
use super::label::{Form, ProfileTool, SiteResult};
use crate::access::evidence::WitnessPose;
use crate::access::surface::tool::{Contact, Stand};
use crate::exec::par;
use glam::{DVec2, DVec3, dvec2};
use std::f64::consts::{PI, TAU};

/// Where a drill touches a site in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum DrillPose {
    /// With its tip here, on the axis of a bore of its own, or of a little less.
    OnAxis(DVec3),
    NotAtOwnBore,
    /// Neither margin nor cone has the site's normal.
    DoesNotTouch,
}

/// Sites per task.
const BLOCK: usize = 32;
/// Ends of a cut count to the wall of a bore if they are as near as this share of the radius to where it may be.
const LOOSE: f64 = 0.25;
/// Times that the circle is found again without the inner half of its ends: those of facets' diagonals are within.
const ROUNDS: usize = 6;
/// Facets are within the round wall that they approximate by less than so many of their tolerances.
const FACETS: f64 = 2.0;
/// Above where the margin begins, mm.
const ABOVE_MM: f64 = 1e-3;
/// Triangles that are looked at for bores: all, or as many evenly.
const MOST_PROBES: usize = 20_000;
/// Axes nearer than this are one, mm.
const SAME_AXIS_MM: f64 = 1e-2;

impl ProfileTool<'_> {
    /// The results for all sites.
    pub(super) fn drilled(&self, contacts: &[Contact], frames: &[Frame]) -> Vec<SiteResult> {
        let Some(drill) = &self.drill else { return vec![SiteResult::default(); contacts.len()] };
        let along: Vec<usize> = match frames.iter().any(|frame| frame.is_suggested) {
            true => (0..frames.len()).filter(|k| frames[*k].is_suggested).collect(),
            false => (0..frames.len()).collect(),
        };
        let by_cone = |contact: &Contact| {
            let normal = contact.normal.unwrap_or_default();
            along.iter().any(|&k| drill.is_by_cone(frames[k].local(normal)))
        };
        let axes = match contacts.iter().any(by_cone) {
            true => self.axes_of_bores(drill, (frames, &along)),
            false => Vec::new(),
        };
        let found = par::map_blocks(contacts.len(), BLOCK, |range| {
            let of = |i: usize| {
                let found = self.in_wall(drill, &contacts[i], (frames, &along));
                match found.witness {
                    Some(_) => found,
                    None => self.on_cone(drill, &contacts[i], (frames, &axes), found),
                }
            };
            range.map(of).collect::<Vec<_>>()
        });
        found.into_iter().flatten().collect()
    }

    /// Of every bore of its own the direction and the axis.
    fn axes_of_bores(
        &self,
        drill: &Drill,
        (frames, along): (&[Frame], &[usize]),
    ) -> Vec<(usize, DVec2)> {
        let n = if drill.cones.is_empty() { 0 } else { self.bvh().n_triangles() };
        let step = n.div_ceil(MOST_PROBES).max(1);
        let found = par::map_blocks(n.div_ceil(step), BLOCK, |range| {
            let mut axes = Vec::new();
            for probe in range {
                let [a, b, c] = *self.bvh().triangle((probe * step) as u32);
                let normal = (b - a).cross(c - a).normalize_or_zero();
                for &k in along {
                    let wall = ([(a + b + c) / 3.0, normal], self.most_tolerance());
                    let axes_of = |margin: &Margin| self.bore(margin, &frames[k], wall);
                    axes.extend(drill.margins.iter().filter_map(axes_of).map(|axis| (k, axis)));
                }
            }
            axes
        });
        let mut axes: Vec<(usize, DVec2)> = Vec::new();
        for (k, axis) in found.into_iter().flatten() {
            let same =
                |other: &(usize, DVec2)| other.0 == k && other.1.distance(axis) < SAME_AXIS_MM;
            if !axes.iter().any(same) {
                axes.push((k, axis));
            }
        }
        axes
    }

    /// A site on the wall of a bore.
    fn in_wall(
        &self,
        drill: &Drill,
        contact: &Contact,
        (frames, along): (&[Frame], &[usize]),
    ) -> SiteResult {
        let mut found = SiteResult { only_tip: true, ..SiteResult::default() };
        let Some(normal) = contact.normal else { return found };
        for &k in along {
            let frame = &frames[k];
            let wall = ([contact.point, normal], self.most_tolerance());
            for margin in &drill.margins {
                let Some(axis) = self.bore(margin, frame, wall) else { continue };
                let height = frame.local(contact.point).z - margin.low - ABOVE_MM;
                if self.reaches_from(frame, axis.extend(height), &mut found) {
                    return found;
                }
            }
        }
        found
    }

    /// A site on the cone of a blind bore.
    fn on_cone(
        &self,
        drill: &Drill,
        contact: &Contact,
        (frames, axes): (&[Frame], &[(usize, DVec2)]),
        mut found: SiteResult,
    ) -> SiteResult {
        let Some(normal) = contact.normal else { return found };
        for (k, axis) in axes {
            let frame = &frames[*k];
            let site = frame.local(contact.point);
            for cone in drill.cones_by(frame.local(normal)) {
                if let Some(tip) = self.pose_by_cone(cone, site, *axis)
                    && self.reaches_from(frame, tip, &mut found)
                {
                    return found;
                }
            }
        }
        found
    }

    /// Whether a pose, its tip in the frame of the direction, is free and may be drawn back.
    fn reaches_from(&self, frame: &Frame, tip: DVec3, found: &mut SiteResult) -> bool {
        let tip = frame.global(tip);
        found.n_tested += 1;
        match self.first_hit(frame, tip, Form::NonCutting, &mut None) {
            Some(_) => found.only_tip = false,
            None if self.first_hit(frame, tip, Form::Whole, &mut None).is_some() => {}
            None => {
                found.is_free = true;
                (found.last_free, found.last_free_direction) = (tip, frame.direction);
                if self.retracts_along_axis(frame, tip, &mut None) {
                    found.witness = Some(WitnessPose { direction: frame.direction, tip_mm: tip });
                }
            }
        }
        found.witness.is_some()
    }

    /// The pose of a drill in one direction.
    pub(super) fn drill_pose(&self, contact: &Contact, frame: &Frame) -> DrillPose {
        let (Some(drill), Some(normal)) = (&self.drill, contact.normal) else {
            return DrillPose::DoesNotTouch;
        };
        let site = frame.local(contact.point);
        let wall = ([contact.point, normal], f64::INFINITY);
        for margin in &drill.margins {
            if let Some(axis) = self.bore(margin, frame, wall) {
                let height = site.z - margin.low - ABOVE_MM;
                return DrillPose::OnAxis(frame.global(axis.extend(height)));
            }
        }
        if !drill.is_by_cone(frame.local(normal)) {
            let is_by_margin = frame.local(normal).z.abs() <= NEAR;
            return if is_by_margin { DrillPose::NotAtOwnBore } else { DrillPose::DoesNotTouch };
        }
        let axes = self.axes_of_bores(drill, (std::slice::from_ref(frame), &[0]));
        let cones = || drill.cones_by(frame.local(normal));
        let of_axis = |(_, axis): &(usize, DVec2)| {
            cones().find_map(|cone| self.pose_by_cone(cone, site, *axis))
        };
        let mut poses = axes.iter().filter_map(of_axis);
        let on_axis = |tip| DrillPose::OnAxis(frame.global(tip));
        poses.next().map_or(DrillPose::NotAtOwnBore, on_axis)
    }

    /// The tip of the pose on an axis that touches a site with the cone, all in the frame of the direction; none where
    /// the cone is not as wide.
    fn pose_by_cone(&self, cone: &DrillCone, site: DVec3, axis: DVec2) -> Option<DVec3> {
        let [[r0, z0], [r1, z1]] = cone.ends;
        let radius = site.truncate().distance(axis);
        let height = site.z - (z0 + (z1 - z0) * (radius - r0) / (r1 - r0)) + self.finish();
        (r0..=r1).contains(&radius).then_some(axis.extend(height))
    }

    /// The axis of the bore of about a margin's radius whose wall a place is on, with its normal; of one that is
    /// narrower by no more than `narrower`, mm.
    fn bore(
        &self,
        margin: &Margin,
        frame: &Frame,
        ([site, normal], narrower): ([DVec3; 2], f64),
    ) -> Option<DVec2> {
        if normal == DVec3::ZERO || normal.dot(frame.axes[2]).abs() > NEAR {
            return None;
        }
        let site = frame.local(site);
        let toward = frame.local(normal).truncate().normalize_or_zero();
        let about = site.truncate() + toward * margin.radius;
        let stand = Stand { reference: frame.global(about.extend(site.z)), axes: frame.axes };
        let reach = (1.0 + LOOSE) * margin.radius;
        let mut bands = vec![self.bvh().band([0.0, 0.0], reach, self.size())];
        let mut cuts: Vec<([DVec2; 2], f64)> = Vec::new();
        self.bvh().visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            let ends = cut_at(&stand.triangle(self.bvh().triangle(place)), 0.0);
            cuts.extend(ends.map(|ends| (ends, self.shrunk(place).tolerance)));
            false
        });
        let is_near = |p: &DVec2| (p.length() - margin.radius).abs() <= LOOSE * margin.radius;
        let ends: Vec<DVec2> = cuts.iter().flat_map(|cut| cut.0).filter(is_near).collect();
        let (center, radius) = outer_circle(ends)?;
        let own = self.finish() + self.shrunk_least().tolerance;
        if radius > margin.radius + own || radius + narrower < margin.radius {
            return None;
        }
        // A chord of the wall is not farther within than facets of its tolerance are.
        let arc = |([a, b], tolerance): &([DVec2; 2], f64)| {
            let ends = [*a - center, *b - center];
            let is_wall = nearest(ends) >= radius - own - FACETS * tolerance;
            is_wall.then(|| arc_within(ends, radius + own)).flatten()
        };
        let is_around = covered(cuts.iter().filter_map(arc).collect()) > PI;
        is_around.then_some(about + center)
    }
}

/// The circle that points are on or within, by least squares over those that are farthest out.
fn outer_circle(mut points: Vec<DVec2>) -> Option<(DVec2, f64)> {
    /// Spread of radii that is none, mm.
    const SAME: f64 = 1e-7;
    let mut circle = circle_through(&points)?;
    for _ in 0..ROUNDS {
        let distance = |p: &DVec2| p.distance(circle.0);
        let least = points.iter().map(distance).fold(f64::INFINITY, f64::min);
        let most = points.iter().map(distance).fold(0.0, f64::max);
        if most - least < SAME {
            break;
        }
        let outer: Vec<DVec2> =
            points.iter().copied().filter(|p| distance(p) >= 0.5 * (least + most)).collect();
        match circle_through(&outer) {
            Some(next) if outer.len() < points.len() => (circle, points) = (next, outer),
            _ => break,
        }
    }
    Some(circle)
}

/// The circle of least squares (Kåsa 1976), center and radius; none through fewer than three points or along a line.
fn circle_through(points: &[DVec2]) -> Option<(DVec2, f64)> {
    let n = points.len() as f64;
    if points.len() < 3 {
        return None;
    }
    let middle = points.iter().sum::<DVec2>() / n;
    let (mut xx, mut xy, mut yy, mut right) = (0.0, 0.0, 0.0, DVec2::ZERO);
    for p in points {
        let q = *p - middle;
        (xx, xy, yy) = (xx + q.x * q.x, xy + q.x * q.y, yy + q.y * q.y);
        right += 0.5 * q.length_squared() * q;
    }
    let determinant = xx * yy - xy * xy;
    if determinant <= 1e-12 * (xx + yy) * (xx + yy) {
        return None;
    }
    let center = dvec2(yy * right.x - xy * right.y, xx * right.y - xy * right.x) / determinant;
    let radius = ((xx + yy) / n + center.length_squared()).sqrt();
    Some((middle + center, radius))
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

/// Distance of a segment from the axis.
fn nearest([a, b]: [DVec2; 2]) -> f64 {
    let run = b - a;
    let share = (-a.dot(run) / run.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (a + run * share).length()
}

/// Angles about the axis, the second less than half a turn beyond the first, between which a segment is within a
/// radius.
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
