//! The way out of a pose: along the axis, or aside and then along the axis.
//!
//! ```text
//! straight: the retracting tool is free in the pose
//! moved = the pose, pushed across the axis, clear of what the retracting tool penetrates, again and again
//!     free there, and the way to it free: proven
//! for directions around the axis, for lengths that double: the way blocked → next direction; retracting tool free there → proven
//! ```

use super::contact::BEYOND_MM;
use super::frame::Frame;
use super::label::{Form, ProfileTool};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Directions across the axis that are tried.
const DIRECTIONS: usize = 24;
/// The first length, as a share of the tool's radius, and the factor to the next.
const FIRST: f64 = 0.25;
const FACTOR: f64 = 1.6;
/// Pushes after which the first way out is given up.
const PUSHES: usize = 25;

impl ProfileTool<'_> {
    /// Whether a tool may be drawn back along its axis.
    pub(in crate::access::surface) fn retracts_along_axis(
        &self,
        frame: &Frame,
        tip: DVec3,
        last: &mut Option<u32>,
    ) -> bool {
        self.first_hit(frame, tip, Form::Retracting, last).is_none()
    }

    /// Whether a tool may be moved across its axis, and then drawn back.
    pub(super) fn retracts_aside(&self, frame: &Frame, tip: DVec3, last: &mut Option<u32>) -> bool {
        self.way_aside(frame, tip, last).is_some()
    }

    /// A move across the axis after which a tool may be drawn back.
    pub(in crate::access::surface) fn way_aside(
        &self,
        frame: &Frame,
        tip: DVec3,
        last: &mut Option<u32>,
    ) -> Option<DVec2> {
        let pushed = self.pushed_aside(frame, tip);
        if let Some(by) = pushed.filter(|by| !self.is_way_blocked(frame, tip, *by)) {
            return Some(by);
        }
        for k in 0..DIRECTIONS {
            let angle = TAU * (k as f64 / DIRECTIONS as f64);
            let toward = DVec2::new(libm::cos(angle), libm::sin(angle));
            let mut length = FIRST * self.radius;
            while length <= self.farthest {
                if self.is_way_blocked(frame, tip, toward * length) {
                    break;
                }
                if self.retracts_along_axis(frame, frame.moved(tip, toward * length), last) {
                    return Some(toward * length);
                }
                length *= FACTOR;
            }
        }
        None
    }

    /// Whether a move across the axis is free, and the tool may be drawn back after it.
    pub(in crate::access::surface) fn is_way_out(
        &self,
        frame: &Frame,
        tip: DVec3,
        by: DVec2,
    ) -> bool {
        self.retracts_along_axis(frame, frame.moved(tip, by), &mut None)
            && !self.is_way_blocked(frame, tip, by)
    }

    /// By how much across its axis the tool is clear of what it would penetrate on its way out.
    fn pushed_aside(&self, frame: &Frame, tip: DVec3) -> Option<DVec2> {
        let (mut by, mut last) = (DVec2::ZERO, None);
        for _ in 0..PUSHES {
            let Some((place, point)) =
                self.deepest_hit(frame, frame.moved(tip, by), Form::Retracting, last, |_, _| false)
            else {
                return Some(by);
            };
            last = Some(place);
            let flat = point.truncate();
            let depth = self.shrunk(place).retracting.radius_at(point.z) - flat.length();
            if flat.length() < 1e-9 || by.length() + depth > self.farthest {
                return None;
            }
            by -= flat.normalize() * (depth + BEYOND_MM);
        }
        None
    }
}
