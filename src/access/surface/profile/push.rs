//! Poses that are not free, pushed along the profile until they are.
//!
//! ```text
//! again and again, a few times:
//!     the triangle that is deepest across the axis, and the point of it; if that lies on a face of the tool, the point
//!         that is deepest from the faces as well
//!     none: free if nothing at all is penetrated
//!     some point deeper than the pose has freedom: given up
//!     as deep as before for the second time: once more from the first pose, along normals of triangles; then given up
//!     push clear of it along the profile, else across the axis; off the same triangle again, by the secant of its depths
//! ```

use super::contact::{BEYOND_MM, FEW_PUSHES, LEAST_COSINE, Pose, REACH, SHALLOWER};
use super::frame::Frame;
use super::label::{Form, ProfileTool, State};
use super::meet::deepest_from_faces;
use super::outline::Depth;
use crate::access::surface::tool::Stand;
use glam::DVec3;

/// So many pushes of a pose may meet a triangle again that is not less deep by a tenth. Chosen on the T-slot and the
/// turned part of the tests.
const MOST_STALLED: usize = 2;

/// A triangle that a pose was pushed clear of.
struct Pushed {
    place: u32,
    /// The last time, mm.
    depth: f64,
    by: f64,
}

/// What gives the direction of a push.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// The nearest place of the profile.
    Profile,
    /// The triangle that is penetrated.
    Normals,
}

/// What pushes come to.
enum Slid {
    /// The tip of a free pose.
    Free(DVec3),
    /// They go to and fro.
    ToAndFro,
    /// No push leads on.
    Closed,
}

impl Slid {
    fn free(self) -> Option<DVec3> {
        match self {
            Slid::Free(tip) => Some(tip),
            Slid::ToAndFro | Slid::Closed => None,
        }
    }
}

/// The triangles that a pose was pushed clear of.
#[derive(Default)]
pub(super) struct Pushes {
    known: Vec<Pushed>,
    last: Option<u32>,
    n_stalled: usize,
}

impl Pushes {
    /// By how much to push clear of a triangle that is `depth` deep; none if others are again and again as deep.
    pub fn next(&mut self, place: u32, depth: f64) -> Option<f64> {
        /// Of the depth.
        const MOST: f64 = 4.0;
        let mut by = depth;
        match self.known.iter_mut().find(|known| known.place == place) {
            None => self.known.push(Pushed { place, depth, by }),
            Some(known) => {
                if self.last == Some(place) && depth < known.depth {
                    let implied = depth * known.by / (known.depth - depth);
                    by = implied.clamp(depth, MOST * depth);
                }
                let is_less = depth < SHALLOWER * known.depth;
                self.n_stalled = if is_less { 0 } else { self.n_stalled + 1 };
                (known.depth, known.by) = (depth, by);
            }
        }
        self.last = Some(place);
        (self.n_stalled < MOST_STALLED).then_some(by)
    }
}

impl ProfileTool<'_> {
    /// As [`ProfileTool::deepest_hit`] of the whole tool, with the way out of it.
    ///
    /// The point that is deepest across the axis may lie on a face of the tool, by which a pose would be pushed by
    /// nothing. Then it is the point of its triangle that is deepest from the faces as well.
    pub(super) fn deepest(
        &self,
        frame: &Frame,
        tip: DVec3,
        first: Option<u32>,
        is_enough: impl Fn(u32, DVec3) -> bool,
    ) -> Option<(u32, DVec3, Depth)> {
        let (place, point) = self.deepest_hit(frame, tip, Form::Whole, first, is_enough)?;
        let shrunk = self.shrunk(place);
        let depth = self.outline.depth(point);
        if depth.mm - shrunk.tolerance > BEYOND_MM {
            return Some((place, point, depth));
        }
        let stand = Stand { reference: tip, axes: frame.axes };
        let corners = stand.triangle(self.bvh().triangle(place));
        let Some(point) = deepest_from_faces(&shrunk.whole, &corners) else {
            return Some((place, point, depth));
        };
        Some((place, point, self.outline.depth(point)))
    }

    /// The tip of a free pose, pushed from one that is not: along the profile, and where that goes to and fro in more
    /// than a few pushes along the normals of what is penetrated. Between a facet and a rim of the tool these lead
    /// sideways. `from` is the pose and the normal of the surface that it is to touch; a point of space has none.
    pub(super) fn slide(
        &self,
        n_pushes: usize,
        frame: &Frame,
        site: DVec3,
        from: (Pose, Option<DVec3>),
        state: &mut State,
    ) -> Option<DVec3> {
        match self.slide_by((Way::Profile, n_pushes), frame, site, from, state) {
            Slid::ToAndFro if n_pushes > FEW_PUSHES => {
                self.slide_by((Way::Normals, n_pushes), frame, site, from, state).free()
            }
            slid => slid.free(),
        }
    }

    fn slide_by(
        &self,
        (way, n_pushes): (Way, usize),
        frame: &Frame,
        site: DVec3,
        (mut pose, normal): (Pose, Option<DVec3>),
        state: &mut State,
    ) -> Slid {
        let mut pushes = Pushes::default();
        for _ in 0..n_pushes {
            state.n_tested += 1;
            let tip = self.tip(frame, site, &pose);
            let excess = |place: u32, depth: f64| depth - self.shrunk(place).tolerance;
            let reach = |place: u32| {
                let slack = self.shrunk(place).tolerance + self.finish();
                REACH * self.contacts.freedom(&pose, slack)
            };
            let is_enough = |place: u32, point: DVec3| {
                excess(place, self.outline.depth(point).mm) > reach(place)
            };
            let deepest = self.deepest(frame, tip, state.last, is_enough);
            let Some((place, point, depth)) = deepest else {
                // The deepest point is found roughly: nothing at all must be penetrated.
                let touches = |n: DVec3| self.contacts.normal(&pose).dot(-n) >= LEAST_COSINE;
                if !normal.is_none_or(touches)
                    || self.first_hit(frame, tip, Form::Whole, &mut state.last).is_some()
                {
                    return Slid::Closed;
                }
                return Slid::Free(tip);
            };
            let by = excess(place, depth.mm).max(0.0) + BEYOND_MM;
            state.last = Some(place);
            if by > reach(place) {
                return Slid::Closed;
            }
            let Some(by) = pushes.next(place, by) else { return Slid::ToAndFro };
            let toward = match way {
                Way::Profile => depth.toward,
                Way::Normals => self.triangle_normal(frame, tip, place, depth.toward),
            };
            let Some(next) = self.pushed_clear(&pose, (place, point), (by, toward)) else {
                return Slid::Closed;
            };
            pose = next;
        }
        Slid::ToAndFro
    }

    /// The normal of a triangle, in the frame of the tool, to the side of `toward`; `toward` where it lies across that.
    fn triangle_normal(&self, frame: &Frame, tip: DVec3, place: u32, toward: DVec3) -> DVec3 {
        const LEAST: f64 = 0.5;
        let stand = Stand { reference: tip, axes: frame.axes };
        let [a, b, c] = stand.triangle(self.bvh().triangle(place));
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let along = normal.dot(toward);
        if along.abs() < LEAST { toward } else { normal * along.signum() }
    }

    /// A pose that is pushed clear of a point of a triangle, which is `toward` the profile, `by` mm; where that is no
    /// way along the profile, across the axis.
    pub(super) fn pushed_clear(
        &self,
        pose: &Pose,
        (place, point): (u32, DVec3),
        (by, toward): (f64, DVec3),
    ) -> Option<Pose> {
        let flat = point.truncate();
        let across = || {
            let by = self.shrunk(place).whole.radius_at(point.z) - flat.length() + BEYOND_MM;
            let outward = flat.normalize_or_zero().extend(0.0);
            self.contacts.pushed(pose, -outward, by)
        };
        self.contacts.pushed(pose, -toward, by).or_else(across)
    }
}
