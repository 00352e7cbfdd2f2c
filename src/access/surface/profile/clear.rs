//! Poses about a site that are pushed clear, wherever that leads: for what a tool leaves there.

use super::contact::{BEYOND_MM, Pose};
use super::frame::Frame;
use super::label::{Form, ProfileTool};
use super::meet::for_some_points;
use crate::access::surface::tool::Stand;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Places along what cuts, and turns about the axis, of a point that is anywhere on it.
const PLACES: usize = 8;
const TURNS: usize = 8;

/// What a pose lacks to be free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::access::surface) enum Push {
    Free,
    /// A move that clears it of what it penetrates most, mm.
    By(DVec3),
}

impl ProfileTool<'_> {
    /// Whether some pose may have a way out that is not straight along the axis: not of a tool that only widens, nor of
    /// one that cuts along its axis alone.
    pub fn may_leave_aside(&self) -> bool {
        !self.only_widens && self.drill.is_none()
    }

    pub fn push(&self, frame: &Frame, tip: DVec3, last: &mut Option<u32>) -> Push {
        let (place, depth) = match self.deepest(frame, tip, *last, |_, _| false) {
            Some((place, _, depth)) => (place, depth),
            // The deepest point is found roughly: nothing at all must be penetrated.
            None => match self.first_hit(frame, tip, Form::Whole, last) {
                Some((place, hit)) => (place, self.outline.depth(hit.point)),
                None => return Push::Free,
            },
        };
        *last = Some(place);
        // The farthest in across the axis may be near a corner of the tool, and another point of its triangle deeper.
        let (shrunk, stand) = (self.shrunk(place), Stand { reference: tip, axes: frame.axes });
        let mut depth = depth;
        for_some_points(&shrunk.whole, &stand.triangle(self.bvh().triangle(place)), |point| {
            let other = self.outline.depth(point);
            if other.mm > depth.mm {
                depth = other;
            }
        });
        let by = (depth.mm - shrunk.tolerance).max(0.0) + BEYOND_MM;
        Push::By(frame.global(depth.toward) * -by)
    }

    /// Of the poses that touch a site, at a point and with a normal, and penetrate something, the `n` that penetrate
    /// least: the numbers of their directions, and their tips.
    pub fn shallowest_at(
        &self,
        [point, normal]: [DVec3; 2],
        frames: &[Frame],
        n: usize,
    ) -> Vec<(usize, DVec3)> {
        let mut shallowest = Shallowest { n, found: Vec::new(), last: None };
        for (k, frame) in frames.iter().enumerate() {
            self.contacts.for_each(frame.local(normal), |pose| {
                shallowest.add(self, (k, frame), point, &pose);
                false
            });
        }
        shallowest.tips()
    }

    /// As [`ProfileTool::shallowest_at`], whatever the normal: a point is anywhere on what cuts. Along the directions
    /// of these numbers.
    pub fn shallowest_about(
        &self,
        point: DVec3,
        (frames, which): (&[Frame], &[usize]),
        n: usize,
    ) -> Vec<(usize, DVec3)> {
        let mut shallowest = Shallowest { n, found: Vec::new(), last: None };
        for &k in which {
            for (place, turn) in (0..PLACES).flat_map(|p| (0..TURNS).map(move |t| (p, t))) {
                let angle = TAU * (turn as f64 / TURNS as f64);
                let toward = DVec2::new(libm::cos(angle), libm::sin(angle));
                let along = self.contacts.length() * ((place as f64 + 0.5) / PLACES as f64);
                shallowest.add(self, (k, &frames[k]), point, &Pose { along, toward });
            }
        }
        shallowest.tips()
    }
}

/// Poses that penetrate least, so many of them.
struct Shallowest {
    n: usize,
    found: Vec<(f64, usize, DVec3)>,
    last: Option<u32>,
}

impl Shallowest {
    fn add(&mut self, tool: &ProfileTool, (k, frame): (usize, &Frame), point: DVec3, pose: &Pose) {
        let tip = tool.tip(frame, point, pose);
        if let Some((place, hit)) = tool.first_hit(frame, tip, Form::Whole, &mut self.last) {
            let depth = tool.outline.depth(hit.point).mm - tool.shrunk(place).tolerance;
            let at = self.found.partition_point(|(other, ..)| *other <= depth);
            if at < self.n {
                self.found.insert(at, (depth, k, tip));
                self.found.truncate(self.n);
            }
        }
    }

    fn tips(self) -> Vec<(usize, DVec3)> {
        self.found.into_iter().map(|(_, k, tip)| (k, tip)).collect()
    }
}
