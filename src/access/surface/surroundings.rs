//! The surface around a site: how much the normal of a tool that touches there may differ from the site's at most.
//!
//! Points of the surface on rings about the site are in the way of all poses but those that touch nearly with the
//! site's normal. With `v` from the site to such a point, the tip's corner of radius `r`, grown by δ and touching with
//! normal `n`, holds it iff
//!
//! ```text
//! n·v > T = ((r + δ)² − (r − τ)² + |v|²) / (2·(r + δ))
//! ```
//!
//! For eight points around the site at distance ρ, `D` below the tangent plane, all `n` farther than β from the site's
//! normal are closed by one of them, if `ρ·cos(π/8)·sin β − D·cos β ≥ T`. Poses within the material are left out: what
//! is above them is in the way.

use super::bvh::Bvh;
use super::pose::blockers::Blocker;
use super::tolerance::Tolerances;
use super::tool::{OBLIQUE, Outline};
use crate::tool::directions::basis;
use glam::{DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_8};

/// Points on a ring.
const N_AROUND: usize = 8;

/// Bounds of all poses about a point of contact, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseBounds {
    /// No reference point is farther from the middle of the corner that touches with the site's normal.
    pub from_center: f64,
    /// None is farther from the one that touches with the site's normal, in [oblique](super::tool::Contact::is_oblique)
    /// directions.
    pub oblique: f64,
    /// Directions whose cosine with the normal is less than minus this come from behind the surface: no pose is free.
    pub behind: f64,
    /// No pose is deeper in the plane of the site than the one that touches with its normal by more than this; infinite
    /// if that is not known.
    pub slack: f64,
}

/// Radii of the rings, for one tool.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rings {
    corner: f64,
    side: f64,
    finish: f64,
    /// For the corner, and for the rim of a flat end; one of them if they are the same.
    radii: [f64; 2],
}

/// A point of a ring.
#[derive(Debug, Clone, Copy)]
struct RingPoint {
    /// Above the tangent plane, mm.
    height: f64,
    tolerance: f64,
}

/// The rings about a site.
struct Found {
    axes: [DVec3; 3],
    points: [[Option<RingPoint>; N_AROUND]; 2],
}

/// Beyond what is found on the plane that the rim's bound allows for, as a factor.
const BEYOND: f64 = 1.4;
/// Drops of the surface up to so many times the tolerances are still a plane to the rim of a flat end.
const MOST_DROP: f64 = 4.0;

impl Rings {
    pub fn new(outline: &Outline, tolerance: f64) -> Self {
        let (corner, side, finish) = (outline.corner(), outline.side(), outline.finish());
        let radius = |r: f64| (2.0 * r * (tolerance + finish)).sqrt();
        Rings { corner, side, finish, radii: [radius(corner), radius(rim(corner, side))] }
    }

    /// Bounds for a point of space: all its poses.
    pub fn everywhere(&self) -> PoseBounds {
        let all = self.side + std::f64::consts::SQRT_2 * self.corner + self.finish;
        PoseBounds { from_center: all, oblique: all, behind: f64::INFINITY, slack: f64::INFINITY }
    }

    /// What the bounds of a site on a plane come to, and a little more.
    pub fn on_plane(&self, tolerance: f64) -> f64 {
        const MORE: f64 = 1.15;
        let flat = RingPoint { height: 0.0, tolerance };
        let points = [[Some(flat); N_AROUND]; 2];
        MORE * self.bounds(&points).oblique
    }

    /// Bounds for a site.
    pub fn at(&self, bvh: &Bvh, tolerances: &Tolerances, site: DVec3, normal: DVec3) -> PoseBounds {
        self.bounds(&self.find(bvh, tolerances, site, normal).points)
    }

    /// The points of the rings.
    pub fn blockers(
        &self,
        bvh: &Bvh,
        tolerances: &Tolerances,
        site: DVec3,
        normal: DVec3,
    ) -> impl Iterator<Item = Blocker> {
        let Found { axes: [u, v, w], points } = self.find(bvh, tolerances, site, normal);
        let radii = self.radii;
        (0..2 * N_AROUND).filter_map(move |k| {
            let (ring, k) = (k / N_AROUND, k % N_AROUND);
            let point = points[ring][k]?;
            let [cos, sin] = around(k);
            let offset = (u * cos + v * sin) * radii[ring] + w * point.height;
            Some(Blocker { point: site + offset, tolerance: point.tolerance })
        })
    }

    fn bounds(&self, points: &[[Option<RingPoint>; N_AROUND]; 2]) -> PoseBounds {
        let grown = self.corner + self.finish;
        let angle = self.angle(points);
        let cap = 2.0 * grown * libm::sin(0.5 * angle) + self.finish;
        let from_center = self.side + cap;
        let oblique =
            if self.side == 0.0 { cap } else { self.rim(points).min(2.0 * self.side + cap) };
        let slack = self.slack(&points[1]).unwrap_or(f64::INFINITY);
        PoseBounds { from_center, oblique, behind: self.behind(points), slack }
    }

    /// A plane about the site, as far as the wider ring, is in the tool above where it touches: with the tilt `t`
    /// against the direction, of all that touches within the tolerances by no more than twice their sum over `t` beside
    /// the site.
    fn behind(&self, points: &[[Option<RingPoint>; N_AROUND]; 2]) -> f64 {
        const BEYOND: f64 = 2.5;
        let flat = |ring: usize| {
            let slack = self.slack(&points[ring])?;
            Some(BEYOND * slack / self.radii[ring])
        };
        let least = |a: f64, b: Option<f64>| b.map_or(a, |b| a.min(b));
        least(least(f64::INFINITY, flat(0)), flat(1))
    }

    /// Tolerances about a site, and how far the surface drops; none if that is far, or not known all around.
    fn slack(&self, ring: &[Option<RingPoint>; N_AROUND]) -> Option<f64> {
        let (mut slack, mut drop): (f64, f64) = (0.0, 0.0);
        for point in ring {
            let point = (*point)?;
            drop = drop.max(-point.height);
            slack = slack.max(point.tolerance + self.finish);
        }
        (drop <= MOST_DROP * slack).then_some(slack + drop)
    }

    /// Within which angle of the site's normal the corner touches; a right angle if that is not known.
    fn angle(&self, points: &[[Option<RingPoint>; N_AROUND]; 2]) -> f64 {
        let (grown, cos) = (self.corner + self.finish, libm::cos(FRAC_PI_8));
        let closed_from = |ring: usize, k: usize| {
            let (Some(point), rho) = (points[ring][k], self.radii[ring]) else { return FRAC_PI_2 };
            let least = (self.corner - point.tolerance).max(0.0);
            let squared = rho * rho + point.height * point.height;
            let needed = (grown * grown - least * least + squared) / (2.0 * grown);
            let (across, drop) = (rho * cos, -point.height);
            let length = across.hypot(drop);
            if needed >= length || across < needed {
                return FRAC_PI_2;
            }
            (libm::asin(needed / length) + libm::atan2(drop, across)).clamp(0.0, FRAC_PI_2)
        };
        let around = (0..N_AROUND).map(|k| closed_from(0, k).min(closed_from(1, k)));
        around.fold(0.0, f64::max)
    }

    /// How far from the site's own pose the rim of a flat or bull-nose end may touch.
    fn rim(&self, points: &[[Option<RingPoint>; N_AROUND]; 2]) -> f64 {
        let Some(slack) = self.slack(&points[1]) else { return f64::INFINITY };
        BEYOND * (2.0 * rim(self.corner, self.side) * slack).sqrt() + slack / OBLIQUE
    }

    fn find(&self, bvh: &Bvh, tolerances: &Tolerances, site: DVec3, normal: DVec3) -> Found {
        let axes = basis(normal);
        let [u, v, w] = axes;
        let mut points = [[None; N_AROUND]; 2];
        let n_rings = if self.radii[0] == self.radii[1] { 1 } else { 2 };
        let greatest = self.radii[0].max(self.radii[1]);
        bvh.near(site, greatest * std::f64::consts::SQRT_2, |place| {
            let corners = bvh.triangle(place).map(|p| {
                let p = p - site;
                dvec3(p.dot(u), p.dot(v), p.dot(w))
            });
            let tolerance = tolerances.at(place);
            for (k, [cos, sin]) in (0..N_AROUND).map(|k| (k, around(k))) {
                // Along the ray and beside it.
                let seen = corners.map(|p| [p.x * cos + p.y * sin, p.y * cos - p.x * sin, p.z]);
                let Some(segment) = crossing(&seen) else { continue };
                for (ring, &rho) in points.iter_mut().zip(&self.radii).take(n_rings) {
                    let Some(height) = height_at(segment, rho) else { continue };
                    let best: &mut Option<RingPoint> = &mut ring[k];
                    if height.abs() <= rho && best.is_none_or(|best| height > best.height) {
                        *best = Some(RingPoint { height, tolerance });
                    }
                }
            }
            false
        });
        if n_rings == 1 {
            points[1] = points[0];
        }
        Found { axes, points }
    }
}

/// Greatest radius of curvature of the rim where a flat or bull-nose end touches, in an oblique direction.
fn rim(corner: f64, side: f64) -> f64 {
    corner + side / OBLIQUE
}

fn around(k: usize) -> [f64; 2] {
    const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
    const ALL: [[f64; 2]; N_AROUND] = [
        [1.0, 0.0],
        [HALF, HALF],
        [0.0, 1.0],
        [-HALF, HALF],
        [-1.0, 0.0],
        [-HALF, -HALF],
        [0.0, -1.0],
        [HALF, -HALF],
    ];
    ALL[k]
}

/// Where a triangle crosses the plane upright over a ray: the ends, along the ray and in height.
fn crossing(corners: &[[f64; 3]; 3]) -> Option<[[f64; 2]; 2]> {
    let (mut ends, mut n) = ([[0.0; 2]; 2], 0);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if (a[1] >= 0.0) != (b[1] >= 0.0) && n < 2 {
            let share = a[1] / (a[1] - b[1]);
            ends[n] = [a[0] + share * (b[0] - a[0]), a[2] + share * (b[2] - a[2])];
            n += 1;
        }
    }
    (n == 2).then_some(ends)
}

/// Height of a segment at a distance along the ray; none if it does not go there.
fn height_at([a, b]: [[f64; 2]; 2], along: f64) -> Option<f64> {
    let (low, high) = (a[0].min(b[0]), a[0].max(b[0]));
    if !(low..=high).contains(&along) {
        return None;
    }
    let share = if high > low { (along - a[0]) / (b[0] - a[0]) } else { 0.0 };
    Some(a[1] + share * (b[1] - a[1]))
}
