//! Smooth and twisted bodies, and bodies put together at random.

use super::outline::{Outline, polar};
use super::solid::Solid;
use super::whole;
use crate::numeric::rng::Stream;
use glam::DVec3;
use std::f64::consts::TAU;

/// A column over `outline` that turns by `twist_rad` and scales to `taper` on its way up.
pub(super) fn twisted_column(outline: &Outline, height: f64, twist_rad: f64, taper: f64) -> Solid {
    let divisions = (twist_rad.abs() / 0.12).ceil().max(8.0) as usize;
    Solid::divided(outline, 0.0, height, divisions).bent(|p| {
        let share = p.z / height;
        let turn = polar(1.0 + (taper - 1.0) * share, twist_rad * share);
        turn.rotate(p.truncate()).extend(p.z)
    })
}

pub(super) fn twisted(random: &mut Stream) -> Solid {
    let (radius, height) = (random.log_range(20.0, 60.0), random.log_range(40.0, 160.0));
    let outline = match whole(random, 0, 2) {
        0 => {
            Outline::regular(whole(random, 3, 8), radius).filleted(random.range(0.5, 0.3 * radius))
        }
        1 => {
            let n = whole(random, 3, 9);
            let valley = radius * random.range(0.5, 0.85);
            let star = Outline::wheel(n, &[[radius, 0.0], [valley, 0.5]]);
            star.filleted(random.range(0.3, 0.15 * radius))
        }
        _ => Outline::rectangle(2.0 * radius, radius * random.range(0.5, 1.6)).filleted(1.0),
    };
    let twist = random.range(-2.5, 2.5);
    let taper = random.range(0.45, 1.1);
    let outline = outline.refined(0.1 * radius);
    let mut body = twisted_column(&outline, height, twist, taper);
    if random.chance(0.6) {
        let bore = radius * random.range(0.1, 0.3);
        let floor = if random.chance(0.5) { -1.0 } else { height * random.range(0.1, 0.6) };
        body -= Solid::cylinder(bore * taper.min(1.0), floor, height + 1.0);
    }
    if random.chance(0.4) {
        body += Solid::cylinder(1.15 * radius, -random.range(4.0, 12.0), 1.0);
    }
    body
}

pub(super) fn knot(random: &mut Stream) -> Solid {
    let (p, q) = [(1, 0), (1, 2), (1, 3), (2, 3), (3, 2), (2, 5)][random.below(6)];
    let ring = random.log_range(25.0, 60.0);
    let tube = ring * if p > 1 { random.range(0.08, 0.14) } else { random.range(0.12, 0.3) };
    let wave = if q == 0 { 0.0 } else { ring * random.range(0.3, 0.42) };
    let curve = |t: f64| {
        let flat = polar(ring + wave * libm::cos(q as f64 * t), p as f64 * t);
        flat.extend(wave * libm::sin(q as f64 * t))
    };
    let n = 90 * p.max(1) + 30 * q;
    let (lobes, depth) = (whole(random, 2, 6) as f64, random.range(0.0, 0.25));
    let section = Outline::round(24, |a| tube * (1.0 - depth * libm::cos(lobes * a)));
    // The frame of a torus knot: the direction away from the ring's core circle is periodic.
    let rings = (0..n).map(|i| {
        let t = TAU * i as f64 / n as f64;
        let tangent = (curve(t + 1e-4) - curve(t - 1e-4)).normalize();
        let core = polar(ring, p as f64 * t).extend(0.0);
        let away = if wave > 0.0 { curve(t) - core } else { core };
        let side = (away - tangent * away.dot(tangent)).normalize();
        let up = tangent.cross(side);
        section.0.iter().map(|s| curve(t) + side * s.x + up * s.y).collect()
    });
    Solid::loop_of_rings(&rings.collect::<Vec<Vec<DVec3>>>())
}

pub(super) fn random_bodies(random: &mut Stream) -> Solid {
    let size = random.log_range(25.0, 60.0);
    let mut body = primitive(random, size);
    for _ in 0..whole(random, 2, 5) {
        let s = size * random.range(0.35, 0.8);
        let [x, y, z] = [0; 3].map(|_| random.range(-0.7, 0.7) * size);
        let piece = primitive(random, s).at(x, y, z);
        if random.chance(0.45) { body += piece } else { body -= piece }
    }
    body
}

/// A box, cylinder, cone, ball or ring of about `size` mm half-width, turned at random.
fn primitive(random: &mut Stream, size: f64) -> Solid {
    let [a, b, c] = [0; 3].map(|_| size * random.range(0.4, 1.0));
    let body = match whole(random, 0, 4) {
        0 => Solid::block([-a, -b, -c], [a, b, c]),
        1 => Solid::cylinder(0.8 * a, -b, b),
        2 => Solid::cone(a, 0.4 * b, -c, c),
        3 => Solid::ball(0.9 * a),
        _ => Solid::revolved(&Outline::circle(0.3 * a).at(size - 0.3 * a, 0.0), 360.0),
    };
    match random.chance(0.6) {
        true => match whole(random, 0, 2) {
            0 => body,
            1 => body.along_x(),
            _ => body.along_y(),
        },
        false => body.about_y(random.range(0.0, 3.0)).about_z(random.range(0.0, 6.0)),
    }
}
