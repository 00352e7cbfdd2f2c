//! Poses: where on the profile a tool touches a site.
//!
//! The cutting portion, grown by the finish tolerance δ, is a curve of radius over height again, in lines and arcs: a
//! line or a face moved outward by δ, an arc with a radius more by δ (less, if hollow), an arc of radius δ about every
//! corner that points outward. A place of this curve has a normal, an angle ω above the plane across the axis. With `e`
//! the unit vector from the axis toward the site, across the axis, the tip of the tool is at
//!
//! ```text
//! tip = site − (radius·e + height·d)
//! ```
//!
//! The tool touches a surface of normal `n` there iff `−n` is `cos ω·e + sin ω·d`. A place that is near this is tried
//! as well: facets have no normals of the curve that they stand for. From a place a pose is pushed along the curve, and
//! around the axis, until it is clear.

use super::body::{finite_pieces, normal_at};
use super::outline::Outline;
use crate::tool::cutter::Profile;
use glam::{DVec2, DVec3, dvec2};
use std::f64::consts::PI;

/// A part of the grown cutting portion.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// From one end to the other, with its normal.
    Line { ends: [DVec2; 2], normal: f64 },
    /// About a center, between two normals; `radius` is negative for a hollow arc.
    Arc { center: DVec2, radius: f64, normals: [f64; 2] },
}

impl Place {
    fn length(&self) -> f64 {
        match *self {
            Place::Line { ends: [a, b], .. } => (b - a).length(),
            Place::Arc { radius, normals: [a, b], .. } => radius.abs() * (b - a).abs(),
        }
    }

    fn at(&self, share: f64) -> DVec2 {
        match *self {
            Place::Line { ends: [a, b], .. } => a.lerp(b, share),
            Place::Arc { center, radius, normals: [a, b] } => {
                let angle = a + (b - a) * share;
                center + radius * dvec2(libm::cos(angle), libm::sin(angle))
            }
        }
    }

    fn normal(&self, share: f64) -> f64 {
        match *self {
            Place::Line { normal, .. } => normal,
            Place::Arc { normals: [a, b], .. } => a + (b - a) * share,
        }
    }
}

/// The grown cutting portion of a tool.
#[derive(Debug, Clone)]
pub(super) struct Contacts {
    places: Vec<Place>,
    /// Where each begins along the curve, mm.
    starts: Vec<f64>,
    /// Of each arc, radius of a ball that touches it everywhere from within the tool, mm; 0 of a line.
    balls: Vec<f64>,
    length: f64,
}

/// A pose: how far along the curve the site is, and in which direction across the axis, in the frame of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    pub along: f64,
    pub toward: DVec2,
}

/// A surface is touched with normals that have at least this cosine with its own: what only passes around an edge does
/// not touch it.
pub(super) const LEAST_COSINE: f64 = 0.1;
/// Poses are pushed farther than what they penetrate, mm.
pub(super) const BEYOND_MM: f64 = 1e-5;
/// Pushes that leave a pose less deep than this share of the least so far count as progress.
pub(super) const SHALLOWER: f64 = 0.9;
/// Poses are pushed if what they penetrate is not deeper than this many times their freedom.
pub(super) const REACH: f64 = 1.5;
/// Pushes of a pose that is among the first. Chosen on the T-slot and the turned part of the tests.
pub(super) const PUSHES: usize = 16;
/// Pushes of a pose that comes after them. Chosen with `cargo bench --bench profiles -- times`, as is their number.
pub(super) const FEW_PUSHES: usize = 4;
/// Even shares of an arc at which its balls are compared.
const BALLS: usize = 9;
/// Normals may differ by this where a pose is tried, radians: more than facets of one curve do.
const NEAR_RAD: f64 = 0.12;
/// Places of a line that are tried.
const LINE_SHARES: [f64; 3] = [0.02, 0.98, 0.5];
/// Places of a face across the axis that are tried, and directions from the axis: of one that
/// holds the axis about its middle first.
const FACE_SHARES: [f64; 4] = [0.05, 0.35, 0.65, 0.95];
const DISC_SHARES: [f64; 3] = [0.02, 0.97, 0.5];
const FACE_DIRECTIONS: usize = 6;
/// Turns of the tool about its axis that are tried at a point of space.
const TURNS: usize = 6;

impl Contacts {
    pub fn new(profile: &Profile, finish: f64) -> Self {
        let pieces = finite_pieces(profile);
        let mut places = Vec::new();
        for (k, piece) in pieces.iter().enumerate() {
            if piece.cuts {
                let normals = [0, 1].map(|end| normal_at(piece, end));
                let out = |angle: f64| dvec2(libm::cos(angle), libm::sin(angle));
                places.push(match piece.arc {
                    None => {
                        let ends =
                            piece.ends.map(|end| DVec2::from_array(end) + finish * out(normals[0]));
                        Place::Line { ends, normal: normals[0] }
                    }
                    Some(arc) => {
                        let sign = if arc.is_convex { 1.0 } else { -1.0 };
                        let radius = sign * arc.radius + finish;
                        Place::Arc { center: DVec2::from_array(arc.center), radius, normals }
                    }
                });
            }
            let Some(next) = pieces.get(k + 1) else { continue };
            let [before, after] = [normal_at(piece, 1), normal_at(next, 0)];
            // A corner of something that cuts.
            if (piece.cuts || next.cuts) && after > before + 1e-9 {
                let center = DVec2::from_array(piece.ends[1]);
                places.push(Place::Arc { center, radius: finish, normals: [before, after] });
            }
        }
        let (mut starts, mut length) = (Vec::with_capacity(places.len()), 0.0);
        for place in &places {
            starts.push(length);
            length += place.length();
        }
        let (outline, most) = (Outline::new(profile), profile.cutting_radius_mm());
        let away = |angle: f64| dvec2(libm::cos(angle), libm::sin(angle));
        let ball = |place: &Place| {
            // Not at its ends, which files round.
            let shares = (0..BALLS).map(|k| (k as f64 + 0.5) / BALLS as f64);
            let ball = |share: f64| {
                greatest_ball(&outline, [place.at(share), away(place.normal(share))], finish, most)
            };
            match place {
                Place::Line { .. } => 0.0,
                Place::Arc { .. } => shares.map(ball).fold(f64::INFINITY, f64::min),
            }
        };
        let balls = places.iter().map(ball).collect();
        Contacts { places, starts, length, balls }
    }

    /// Radius of a ball that is in the tool wherever the pose may be pushed to, and touches there, mm.
    pub fn ball(&self, pose: &Pose) -> f64 {
        self.balls[self.place_at(pose.along)]
    }

    fn place_at(&self, along: f64) -> usize {
        self.starts.partition_point(|start| *start <= along).saturating_sub(1)
    }

    pub fn length(&self) -> f64 {
        self.length
    }

    fn place(&self, along: f64) -> (&Place, f64) {
        let k = self.place_at(along);
        let place = &self.places[k];
        let share = (along - self.starts[k]) / place.length().max(f64::MIN_POSITIVE);
        (place, share.clamp(0.0, 1.0))
    }

    /// From the tip to the site, in the frame of the tool.
    pub fn offset(&self, pose: &Pose) -> DVec3 {
        let (place, share) = self.place(pose.along);
        let at = place.at(share);
        (pose.toward * at.x).extend(at.y)
    }

    /// The outward normal of the tool at the site, in its frame.
    pub fn normal(&self, pose: &Pose) -> DVec3 {
        let (place, share) = self.place(pose.along);
        let angle = place.normal(share);
        (pose.toward * libm::cos(angle)).extend(libm::sin(angle))
    }

    /// Calls `then` with the poses that touch a surface of this normal, in the frame of the tool, or nearly; until it
    /// is true.
    pub fn for_each(&self, normal: DVec3, mut then: impl FnMut(Pose) -> bool) -> bool {
        let wanted = libm::asin((-normal.z).clamp(-1.0, 1.0));
        let flat = normal.truncate();
        let toward = if flat.length() > 1e-9 { -flat.normalize() } else { DVec2::X };
        for (place, start) in self.places.iter().zip(&self.starts) {
            let along = |share: f64| start + share * place.length();
            match *place {
                Place::Arc { normals: [a, b], .. } => {
                    let nearest = wanted.clamp(a.min(b), a.max(b));
                    let share = if a == b { 0.0 } else { (nearest - a) / (b - a) };
                    if (nearest - wanted).abs() <= NEAR_RAD
                        && then(Pose { along: along(share), toward })
                    {
                        return true;
                    }
                }
                Place::Line { normal, .. } if (normal - wanted).abs() > NEAR_RAD => {}
                Place::Line { normal, .. } => {
                    // A face across the axis touches in any direction from it.
                    let is_face = normal.abs() > 0.5 * PI - 1e-9;
                    let is_disc = is_face && place.at(0.0).x.min(place.at(1.0).x) <= 0.0;
                    let (shares, n): (&[f64], usize) = match (is_face, is_disc) {
                        (true, true) => (&DISC_SHARES, FACE_DIRECTIONS),
                        (true, false) => (&FACE_SHARES, FACE_DIRECTIONS),
                        _ => (&LINE_SHARES, 1),
                    };
                    for &share in shares {
                        for k in 0..n {
                            let turn = 2.0 * PI * (k as f64 / n as f64);
                            let turned = dvec2(libm::cos(turn), libm::sin(turn)).rotate(toward);
                            if then(Pose { along: along(share), toward: turned }) {
                                return true;
                            }
                        }
                    }
                }
            }
        }
        false
    }

    /// Calls `then` with poses that touch a point with places all over what cuts, until it is true.
    pub fn for_each_around(&self, mut then: impl FnMut(Pose) -> bool) -> bool {
        for (place, start) in self.places.iter().zip(&self.starts) {
            for share in LINE_SHARES {
                let along = start + share * place.length();
                for k in 0..TURNS {
                    let turn = 2.0 * PI * (k as f64 / TURNS as f64);
                    let toward = dvec2(libm::cos(turn), libm::sin(turn));
                    if then(Pose { along, toward }) {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// How far a pose may be pushed while it still touches a surface with about its own normal, mm; `slack` is how deep
    /// it may be in that.
    pub fn freedom(&self, pose: &Pose, slack: f64) -> f64 {
        let (place, share) = self.place(pose.along);
        let around = (2.0 * place.at(share).x.abs() * slack).sqrt();
        match place {
            Place::Line { .. } => place.length() + around,
            Place::Arc { radius, .. } => (2.0 * radius.abs() * slack).sqrt() + around,
        }
    }

    /// The pose that is pushed by a length in a unit direction, as far as that goes along the curve and around the
    /// axis.
    pub fn pushed(&self, pose: &Pose, away: DVec3, by: f64) -> Option<Pose> {
        /// Poses that lie across the push more than this are not moved by it.
        const LEAST: f64 = 1e-4;
        /// Of the radius that a pose is moved by at once.
        const MOST: f64 = 0.5;
        let (place, share) = self.place(pose.along);
        let at = place.at(share);
        let angle = place.normal(share);
        // The tip moves against what the site moves along the tool.
        let upward = dvec2(-libm::sin(angle), libm::cos(angle));
        let sign = match *place {
            Place::Line { ends: [a, b], .. } => {
                if (b - a).dot(upward) < 0.0 {
                    -1.0
                } else {
                    1.0
                }
            }
            Place::Arc { radius, normals: [a, b], .. } => (radius * (b - a)).signum(),
        };
        let along = -sign * (pose.toward * upward.x).extend(upward.y);
        let around = (pose.toward.perp() * -at.x.signum()).extend(0.0);
        let push = [away.dot(along), away.dot(around)];
        let squared = push[0] * push[0] + push[1] * push[1];
        if squared < LEAST {
            return None;
        }
        let step = [push[0], push[1]].map(|part| part * by / squared);
        let most = MOST * (at.x.abs() + self.length).max(by);
        let along = (pose.along + step[0].clamp(-most, most)).clamp(0.0, self.length);
        let turn = (step[1] / at.x.abs().max(1e-3)).clamp(-1.0, 1.0);
        let toward = dvec2(libm::cos(turn), libm::sin(turn)).rotate(pose.toward);
        Some(Pose { along, toward })
    }
}

/// Radius of the greatest ball in a tool, at most `most`, that touches a place of its profile with a normal; `finish`
/// away from that.
fn greatest_ball(
    outline: &Outline,
    [place, normal]: [DVec2; 2],
    finish: f64,
    mut most: f64,
) -> f64 {
    const HALVINGS: usize = 40;
    let mut least = 0.0;
    for _ in 0..HALVINGS {
        let radius = 0.5 * (least + most);
        let center = place - (radius + finish) * normal;
        let depth = outline.depth(DVec3::new(center.x, 0.0, center.y)).mm;
        if depth >= radius * (1.0 - 1e-9) { least = radius } else { most = radius }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_touch_with_the_normal_of_the_surface() {
        let profile = Profile::t_slot(10.5, 9.0, 0.5, 5.0).unwrap();
        let contacts = Contacts::new(&profile, 0.01);
        let wall = DVec3::new(1.0, 0.0, 0.0);
        let mut n = 0;
        contacts.for_each(wall, |pose| {
            assert!((contacts.normal(&pose) + wall).length() < 0.13, "{pose:?}");
            let offset = contacts.offset(&pose);
            assert!(offset.x < -10.4 && (0.0..=9.0).contains(&offset.z));
            n += 1;
            false
        });
        assert!(n >= 5);
        // The upper face touches what looks down.
        let mut found = Vec::new();
        contacts.for_each(-DVec3::Z, |pose| {
            found.push(contacts.offset(&pose).z);
            false
        });
        assert!(found.iter().any(|z| (z - 9.01).abs() < 1e-9) && found.iter().all(|z| *z > 8.0));
    }

    #[test]
    fn a_pushed_pose_moves_the_tool_the_way_that_it_is_pushed() {
        for profile in [Profile::lollipop(3.0, 1.5), Profile::t_slot(10.5, 9.0, 0.5, 5.0)] {
            let contacts = Contacts::new(&profile.unwrap(), 0.01);
            for normal in [DVec3::X, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 0.8, -0.6)] {
                contacts.for_each(normal, |pose| {
                    for away in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.8, 0.0)] {
                        for away in [away, -away] {
                            let Some(pushed) = contacts.pushed(&pose, away, 1e-4) else { continue };
                            let moved = contacts.offset(&pose) - contacts.offset(&pushed);
                            assert!(moved.dot(away) > -1e-7, "{pose:?} {away} {moved}");
                        }
                    }
                    false
                });
            }
        }
    }
}
