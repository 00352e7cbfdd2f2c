//! Labels of a tool of any profile, in the directions of a set.

use super::balls::{Around, Balls};
use super::bands::Bands;
use super::body::{Body, Shrunk};
use super::contact::{Contacts, FEW_PUSHES, PUSHES, Pose, REACH};
use super::drill::Drill;
use super::frame::Frame;
use super::meet::{Hit, deepest, penetrates};
use super::outline::Outline;
use super::shallow::{Candidate, Shallow};
use crate::access::evidence::WitnessPose;
use crate::access::surface::bvh::{Band, Bvh};
use crate::access::surface::tolerance::Tolerances;
use crate::access::surface::tool::{Contact, Stand};
use crate::answers::SiteAnswer;
use crate::tool::cutter::Profile;
use glam::{DVec2, DVec3, Vec3};

/// One tool against all triangles.
pub(in crate::access::surface) struct ProfileTool<'a> {
    bvh: &'a Bvh,
    pub(super) outline: Outline,
    pub(super) contacts: Contacts,
    /// Finish tolerance, mm.
    finish: f64,
    /// For every tolerance, rounded up, from the least.
    bodies: Vec<Shrunk>,
    /// Per place of the tree; empty if all are the least.
    body_of: Vec<u16>,
    /// Of every [`Form`] of the widest of the bodies.
    bands: [Bands; 3],
    /// Greatest radius of what cuts, mm.
    pub(super) radius: f64,
    /// Height at which what cuts ends, mm.
    pub(super) flutes: f64,
    /// No move across the axis is longer, mm.
    pub(super) farthest: f64,
    pub(super) only_widens: bool,
    /// Of a drill or a reamer.
    pub(super) drill: Option<Drill>,
}

/// What of a tool is tested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form {
    Whole,
    /// See [`Body::retracting`].
    Retracting,
    NonCutting,
}

impl Form {
    fn of(self, shrunk: &Shrunk) -> &Body {
        match self {
            Form::Whole => &shrunk.whole,
            Form::Retracting => &shrunk.retracting,
            Form::NonCutting => &shrunk.non_cutting,
        }
    }
}

/// Tolerances are rounded up to a power of this, times the least.
const TOLERANCE_STEP: f64 = 1.02;
// The limits of the search over poses, chosen on the T-slot and the turned part of the tests.
/// Size of the ball that must fit, of the one that the tool holds: the search for its place is a single one.
const BALL_SHARE: f64 = 0.7;
/// Free poses of one site whose retreat is tried.
pub(super) const MOST_RETREATS: usize = 6;
/// A triangle counts as deeper if it is by this factor.
const DEEPER: f64 = 1.25;

/// The result for a site.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::access::surface) struct SiteResult {
    pub witness: Option<WitnessPose>,
    /// Whether some pose is free; the one that was found last.
    pub is_free: bool,
    pub last_free: DVec3,
    pub last_free_direction: Vec3,
    pub only_tip: bool,
    pub(super) n_tested: u64,
}

impl SiteResult {
    pub fn answer(&self) -> SiteAnswer {
        match self.witness {
            Some(_) => SiteAnswer::Accessible,
            None if self.only_tip && !self.is_free => SiteAnswer::TipDoesNotFit,
            None => SiteAnswer::Inaccessible,
        }
    }

    /// With the pose that is free and has a retreat, in a direction of the set.
    pub(super) fn with_witness(self, direction: Vec3, state: &State) -> SiteResult {
        let witness = Some(WitnessPose { direction, tip_mm: self.last_free });
        SiteResult { witness, n_tested: state.n_tested, ..self }
    }
}

#[derive(Default)]
pub(super) struct State {
    pub last: Option<u32>,
    last_retracting: Option<u32>,
    last_non_cutting: Option<u32>,
    pub n_tested: u64,
    pub n_retreats: usize,
}

impl<'a> ProfileTool<'a> {
    pub fn new(bvh: &'a Bvh, tolerances: &Tolerances, profile: &Profile, finish: f64) -> Self {
        let least = tolerances.least;
        let level = |tolerance: f64| -> u16 {
            let exact = libm::log(tolerance / least) / libm::log(TOLERANCE_STEP);
            (exact - 1e-9).ceil().max(0.0) as u16
        };
        let n_places = bvh.n_triangles() as u32;
        let all: Vec<u16> = match tolerances.most > least {
            false => Vec::new(),
            true => (0..n_places).map(|place| level(tolerances.at(place))).collect(),
        };
        let mut used: Vec<u16> = all.clone();
        used.push(0);
        used.sort_unstable();
        used.dedup();
        let of_level = |level: &u16| {
            let tolerance = least * libm::pow(TOLERANCE_STEP, f64::from(*level));
            Shrunk::new(profile, tolerance)
        };
        let bodies: Vec<Shrunk> = used.iter().map(of_level).collect();
        let body_of =
            all.iter().map(|level| used.binary_search(level).unwrap_or(0) as u16).collect();
        let [widest, height] = bodies[0].whole.size();
        let radius = profile.cutting_radius_mm();
        let farthest = 2.0 * bvh.radius() + 2.0 * radius;
        let size = height + widest + farthest;
        let bands = [Form::Whole, Form::Retracting, Form::NonCutting]
            .map(|form| Bands::new(form.of(&bodies[0]), size));
        ProfileTool {
            bvh,
            outline: Outline::new(profile),
            contacts: Contacts::new(profile, finish),
            finish,
            bodies,
            body_of,
            bands,
            radius,
            flutes: profile.flutes_mm(),
            farthest,
            only_widens: profile.only_widens(),
            drill: Drill::of(profile),
        }
    }

    /// The tool shrunk by the tolerance of a triangle.
    pub(super) fn shrunk(&self, place: u32) -> &Shrunk {
        &self.bodies[self.body_of.get(place as usize).map_or(0, |k| *k as usize)]
    }

    pub(super) fn shrunk_least(&self) -> &Shrunk {
        &self.bodies[0]
    }

    pub(super) fn bvh(&self) -> &Bvh {
        self.bvh
    }

    pub(super) fn finish(&self) -> f64 {
        self.finish
    }

    /// The first triangle that the tool penetrates, with a point of it; `last` is tried first, and becomes it.
    pub(super) fn first_hit(
        &self,
        frame: &Frame,
        tip: DVec3,
        form: Form,
        last: &mut Option<u32>,
    ) -> Option<(u32, Hit)> {
        let stand = Stand { reference: tip, axes: frame.axes };
        let test = |place: u32| {
            let corners = stand.triangle(self.bvh.triangle(place));
            Some((place, penetrates(form.of(self.shrunk(place)), &corners, DVec2::ZERO)?))
        };
        if let Some(found) = last.and_then(test) {
            return Some(found);
        }
        let mut found = None;
        let mut bands = self.bands(form, 0.0);
        self.bvh.visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            found = test(place);
            found.is_some()
        });
        if let Some((place, _)) = found {
            *last = Some(place);
        }
        found
    }

    /// Whether the tool penetrates no triangle.
    pub fn is_free(&self, frame: &Frame, tip: DVec3) -> bool {
        self.first_hit(frame, tip, Form::Whole, &mut None).is_none()
    }

    /// Whether the tool penetrates a triangle when it is moved across its axis.
    pub(super) fn is_way_blocked(&self, frame: &Frame, tip: DVec3, by: DVec2) -> bool {
        // About the middle of the way.
        let middle = frame.moved(tip, 0.5 * by);
        let start = Stand { reference: tip, axes: frame.axes };
        let stand = Stand { reference: middle, axes: frame.axes };
        let mut bands = self.bands(Form::Whole, 0.5 * by.length());
        self.bvh.visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            let corners = start.triangle(self.bvh.triangle(place));
            penetrates(&self.shrunk(place).whole, &corners, by).is_some()
        })
    }

    /// About the deepest point of triangles that the tool penetrates, and the place of its triangle; `first` is the
    /// place of a triangle that is tried first. With a place and point that are enough none deeper is looked for.
    pub(super) fn deepest_hit(
        &self,
        frame: &Frame,
        tip: DVec3,
        form: Form,
        first: Option<u32>,
        is_enough: impl Fn(u32, DVec3) -> bool,
    ) -> Option<(u32, DVec3)> {
        let stand = Stand { reference: tip, axes: frame.axes };
        let (mut most, mut best) = (0.0, None);
        let mut test = |place: u32, most: &mut f64| {
            let corners = stand.triangle(self.bvh.triangle(place));
            let found = deepest(form.of(self.shrunk(place)), &corners, DEEPER * *most);
            found.map(|(depth, point)| {
                (*most, best) = (depth, Some((place, point)));
                is_enough(place, point)
            })
        };
        if first.and_then(|place| test(place, &mut most)) == Some(true) {
            return best;
        }
        // What is not deeper than the deepest so far is outside of a narrower tool.
        let mut bands = self.bands(form, -DEEPER * most);
        self.bvh.visit(&stand, &mut bands, &mut Vec::new(), |place, bands| {
            let is_enough = test(place, &mut most);
            if is_enough == Some(false) {
                *bands = self.bands(form, -DEEPER * most);
            }
            is_enough == Some(true)
        });
        best
    }

    pub(super) fn most_tolerance(&self) -> f64 {
        self.bodies[self.bodies.len() - 1].tolerance
    }

    /// Of the tool and all its ways, mm.
    pub(super) fn size(&self) -> f64 {
        self.bands[0].size()
    }

    pub(super) fn bands(&self, form: Form, wider: f64) -> Vec<Band> {
        self.bands[form as usize].widened(self.bvh, wider)
    }

    pub(super) fn tip(&self, frame: &Frame, site: DVec3, pose: &Pose) -> DVec3 {
        site - frame.global(self.contacts.offset(pose))
    }

    /// Answers for one site.
    pub fn site(&self, contact: &Contact, frames: &[Frame]) -> SiteResult {
        match &self.drill {
            Some(_) => self.drilled(std::slice::from_ref(contact), frames).remove(0),
            None => self.milled(contact, frames),
        }
    }

    pub(super) fn milled(&self, contact: &Contact, frames: &[Frame]) -> SiteResult {
        let (mut state, mut found) = (State::default(), SiteResult::default());
        let Some(normal) = contact.normal else { return self.searched(contact.point, frames) };
        let (mut shallow, mut suggested) = (Shallow::along(frames.len()), Shallow::suggested());
        let around = Around {
            bvh: self.bvh,
            tolerance: |place: u32| self.shrunk(place).tolerance,
            least_tolerance: self.shrunk_least().tolerance,
            finish: self.finish,
        };
        let mut balls = Balls::at(around, [contact.point, normal]);
        for (k, frame) in frames.iter().enumerate() {
            let local = frame.local(normal);
            let is_reached = self.contacts.for_each(local, |pose| {
                let tip = self.tip(frame, contact.point, &pose);
                state.n_tested += 1;
                let Some((place, hit)) = self.first_hit(frame, tip, Form::Whole, &mut state.last)
                else {
                    return self.retracts(frame, tip, &mut state, &mut found);
                };
                let depth = self.outline.depth(hit.point).mm - self.shrunk(place).tolerance;
                let slack = self.shrunk(place).tolerance + self.finish;
                if depth <= REACH * self.contacts.freedom(&pose, slack)
                    && balls.may_fit(BALL_SHARE * self.contacts.ball(&pose))
                {
                    let among = if frame.is_suggested { &mut suggested } else { &mut shallow };
                    among.add(Candidate { depth, k, pose });
                }
                if hit.cuts && !found.only_tip {
                    found.only_tip = self.only_cutting_penetrates(frame, tip, &mut state);
                }
                false
            });
            if is_reached {
                return found.with_witness(frame.direction, &state);
            }
        }
        let at = (contact.point, Some(normal));
        self.push_shallow([suggested, shallow], frames, at, state, found)
    }

    /// The result after pushing the poses that penetrate least, at a point and, of a site, with its normal.
    pub(super) fn push_shallow(
        &self,
        shallow: [Shallow; 2],
        frames: &[Frame],
        (point, normal): (DVec3, Option<DVec3>),
        mut state: State,
        mut found: SiteResult,
    ) -> SiteResult {
        let [first, after] = Shallow::in_turns(shallow);
        for (candidates, pushes) in [(first, PUSHES), (after, FEW_PUSHES)] {
            for Candidate { k, pose, .. } in candidates {
                let frame = &frames[k];
                let from = (pose, normal.map(|normal| frame.local(normal)));
                let tip = self.slide(pushes, frame, point, from, &mut state);
                if tip.is_some_and(|tip| self.retracts(frame, tip, &mut state, &mut found)) {
                    return found.with_witness(frame.direction, &state);
                }
            }
        }
        SiteResult { n_tested: state.n_tested, ..found }
    }

    /// Whether a retreat from a free pose is proven.
    pub(super) fn retracts(
        &self,
        frame: &Frame,
        tip: DVec3,
        state: &mut State,
        found: &mut SiteResult,
    ) -> bool {
        (found.last_free, found.last_free_direction) = (tip, frame.direction);
        found.is_free = true;
        if self.retracts_along_axis(frame, tip, &mut state.last_retracting) {
            return true;
        }
        if self.only_widens || state.n_retreats == MOST_RETREATS {
            return false;
        }
        state.n_retreats += 1;
        self.retracts_aside(frame, tip, &mut state.last_retracting)
    }

    /// Whether a pose is free and a retreat from it is proven.
    pub fn is_free_with_retreat(&self, pose: &WitnessPose) -> bool {
        let (frame, tip) = (Frame::along(pose.direction), pose.tip_mm);
        let mut last = None;
        self.is_free(&frame, tip)
            && (self.retracts_along_axis(&frame, tip, &mut last)
                || (!self.only_widens && self.retracts_aside(&frame, tip, &mut last)))
    }

    /// Whether only what cuts is in the way.
    pub(super) fn only_cutting_penetrates(
        &self,
        frame: &Frame,
        tip: DVec3,
        state: &mut State,
    ) -> bool {
        self.first_hit(frame, tip, Form::NonCutting, &mut state.last_non_cutting).is_none()
    }
}
