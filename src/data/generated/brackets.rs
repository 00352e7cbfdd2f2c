//! Brackets, links, forks and levers.

use super::blocks::{OVER, counterbore};
use super::outline::{Outline, polar};
use super::solid::Solid;
use super::whole;
use crate::numeric::rng::Stream;
use std::f64::consts::{FRAC_PI_2, PI};

/// The convex outline around two circles: of radius `a` at the origin and `b` at (`length`, 0).
fn tangent_link(a: f64, b: f64, length: f64) -> Outline {
    let lean = libm::acos((a - b) / length);
    let arc = |radius: f64, from: f64, to: f64, x: f64| {
        let n = (((to - from) / 0.2).ceil() as usize).max(3);
        let angle = move |i: usize| from + (to - from) * i as f64 / n as f64;
        (0..=n).map(move |i| polar(radius, angle(i)) + glam::DVec2::new(x, 0.0))
    };
    let big = arc(a, lean, 2.0 * PI - lean, 0.0);
    Outline(big.chain(arc(b, -lean, lean, length)).collect())
}

pub(super) fn angle_bracket(random: &mut Stream) -> Solid {
    let [w, d, h] = [0; 3].map(|_| random.log_range(35.0, 130.0));
    let t = random.range(4.0, 0.18 * w.min(h).max(30.0));
    let mut body =
        Solid::block([0.0, 0.0, 0.0], [w, d, t]) + Solid::block([0.0, 0.0, 0.0], [t, d, h]);
    let n_ribs = whole(random, 0, 3);
    let rib = random.log_range(2.0, 0.12 * d + 2.0);
    for i in 0..n_ribs {
        let y = if n_ribs == 1 {
            0.5 * (d - rib)
        } else {
            (d - rib) * i as f64 / (n_ribs as f64 - 1.0)
        };
        let (x, z) = (w * random.range(0.5, 0.9), h * random.range(0.5, 0.9));
        let web = Outline::polygon(&[[0.5 * t, 0.5 * t], [x, 0.5 * t], [0.5 * t, z]]);
        body += Solid::prism(&web, -0.5 * rib, 0.5 * rib).turned_up().at(0.0, y + 0.5 * rib, 0.0);
    }
    let room = 0.15 * d.min(w).min(h);
    for y in [0.25 * d, 0.75 * d] {
        body -= counterbore(random, room, t).at(0.7 * w, y, 0.0);
        if random.chance(0.7) {
            body -= Solid::cylinder(0.6 * room, -OVER, t + OVER).along_x().at(0.0, y, 0.7 * h);
        }
    }
    if random.chance(0.5) {
        let slot = Outline::oblong(0.4 * d, room).turned(FRAC_PI_2);
        body -= Solid::prism(&slot, -OVER, t + OVER).at(0.4 * w, 0.5 * d, 0.0);
    }
    body
}

pub(super) fn u_bracket(random: &mut Stream) -> Solid {
    let [w, d, h] = [0; 3].map(|_| random.log_range(30.0, 110.0));
    let t = random.range(3.0, 0.2 * w);
    let outer = Outline::polygon(&[[-0.5 * w, 0.0], [0.5 * w, 0.0], [0.5 * w, h], [-0.5 * w, h]]);
    let mut body = Solid::prism(&outer, -0.5 * d, 0.5 * d).turned_up();
    let (inner, radius) = (w - 2.0 * t, random.log_range(0.5, 0.3 * (w - 2.0 * t)));
    let gap = Outline::rounded(inner, 2.0 * (h - t), radius).at(0.0, h);
    body -= Solid::prism(&gap, -d, d).turned_up();
    let hole = random.range(0.1, 0.3) * d.min(h);
    body -= Solid::cylinder(hole, -w, w).along_x().at(
        0.0,
        0.0,
        random.range(0.55, 0.8) * h.max(2.5 * hole),
    );
    body -= Solid::cylinder(0.3 * inner.min(d), -OVER, t + OVER);
    if random.chance(0.4) {
        body -= Solid::block([-0.2 * inner, -d, -OVER], [0.2 * inner, -0.25 * d, t + OVER]);
    }
    body
}

pub(super) fn clevis(random: &mut Stream) -> Solid {
    let radius = random.log_range(12.0, 30.0);
    let length = radius * random.range(2.0, 4.0);
    let width = radius * random.range(1.4, 2.4);
    let gap = width * random.range(0.3, 0.6);
    let head = tangent_link(radius, radius * random.range(0.8, 0.99), length);
    let mut body = Solid::prism(&head, -0.5 * width, 0.5 * width);
    let reach = length * random.range(0.3, 0.75);
    body -=
        Solid::block([-2.0 * radius, -2.0 * radius, -0.5 * gap], [reach, 2.0 * radius, 0.5 * gap]);
    body -= Solid::cylinder(radius * random.range(0.3, 0.6), -width, width);
    let shank = 0.45 * width.min(1.6 * radius);
    let end = length + radius * random.range(1.5, 4.0);
    body += Solid::cylinder(shank, length, end).along_x();
    if random.chance(0.6) {
        body -= Solid::cylinder(0.5 * shank, end - random.range(0.5, 1.5) * radius, end + OVER)
            .along_x();
    }
    if random.chance(0.4) { body.turned_up() } else { body }
}

pub(super) fn conrod(random: &mut Stream) -> Solid {
    let big = random.log_range(14.0, 35.0);
    let small = big * random.range(0.45, 0.8);
    let length = random.range(2.2, 4.5) * big;
    let height = big * random.range(0.5, 0.9);
    let mut body = Solid::cylinder(big, 0.0, height);
    body += Solid::cylinder(small, 0.1 * height, 0.9 * height).at(length, 0.0, 0.0);
    let beam = tangent_link(0.7 * big, 0.75 * small, length);
    let web = random.range(0.2, 0.7) * height;
    let mut shank = Solid::prism(&beam, 0.15 * height, 0.85 * height);
    let inner = tangent_link(0.7 * big - 2.5, 0.75 * small - 2.0, length);
    shank -= Solid::prism(&inner, 0.5 * (height + web), height);
    shank -= Solid::prism(&inner, 0.0, 0.5 * (height - web));
    body += shank;
    // The recess stops short of the eyes.
    body += Solid::cylinder(big, 0.0, height);
    body += Solid::cylinder(small, 0.1 * height, 0.9 * height).at(length, 0.0, 0.0);
    body -= Solid::cylinder(big * random.range(0.6, 0.8), -OVER, height + OVER);
    body -=
        Solid::cylinder(small * random.range(0.5, 0.75), -OVER, height + OVER).at(length, 0.0, 0.0);
    if random.chance(0.5) {
        for side in [-1.0, 1.0] {
            let lug =
                Solid::block([-0.5 * big, -3.0, 0.2 * height], [0.5 * big, 3.0, 0.8 * height]);
            let lug = lug
                - Solid::cylinder(0.15 * height, -big, big).along_x().at(0.0, 0.0, 0.5 * height);
            body += lug.at(0.0, side * (big + 1.5), 0.0);
        }
    }
    body
}

pub(super) fn lever(random: &mut Stream) -> Solid {
    let hub = random.log_range(10.0, 24.0);
    let height = hub * random.range(0.8, 2.2);
    let thick = height * random.range(0.25, 0.6);
    let mut body = Solid::cylinder(hub, 0.0, height);
    let mut bores = Solid::cylinder(hub * random.range(0.4, 0.7), -OVER, height + OVER);
    let mut angle = random.range(0.0, 6.0);
    for _ in 0..whole(random, 1, 3) {
        angle += random.range(1.0, 2.3);
        let length = hub * random.range(2.0, 4.5);
        let end = hub * random.range(0.4, 0.8);
        let low = random.range(0.0, height - thick);
        let arm = Solid::prism(&tangent_link(0.85 * hub, 0.8 * end, length), low, low + thick);
        let top = low + thick * random.range(1.05, 2.0);
        let boss = Solid::cylinder(end, low, top).at(length, 0.0, 0.0);
        body += (arm + boss).about_z(angle);
        let bore = Solid::cylinder(end * random.range(0.4, 0.7), low - 3.0, top + OVER);
        bores += bore.at(length, 0.0, 0.0).about_z(angle);
    }
    body - bores
}

pub(super) fn hook(random: &mut Stream) -> Solid {
    let radius = random.log_range(15.0, 45.0);
    let half = radius * random.range(0.25, 0.45);
    let sweep = random.range(3.6, 4.6);
    let n = 40;
    let bow =
        (0..=n).map(|i| polar(radius, FRAC_PI_2 - sweep + sweep * f64::from(i) / f64::from(n)));
    let stem = glam::DVec2::new(-radius * random.range(1.4, 3.0), radius);
    let path: Vec<_> = bow.chain([stem]).collect();
    let thick = half * random.range(1.0, 2.2);
    let mut body = Solid::prism(&Outline::stroke(&path, half), -0.5 * thick, 0.5 * thick);
    body += Solid::cylinder(half * random.range(1.3, 1.8), -0.6 * thick, 0.6 * thick)
        .at(stem.x, stem.y, 0.0);
    body -= Solid::cylinder(half * random.range(0.5, 1.0), -thick, thick).at(stem.x, stem.y, 0.0);
    if random.chance(0.5) { body.turned_up() } else { body }
}

pub(super) fn gripper(random: &mut Stream) -> Solid {
    let (w, h) = (random.log_range(35.0, 80.0), random.log_range(10.0, 35.0));
    let finger = w * random.range(0.14, 0.26);
    let reach = w * random.range(0.8, 2.0);
    let palm = w * random.range(0.4, 0.8);
    let mut body = Solid::block([-palm, -0.5 * w, 0.0], [0.0, 0.5 * w, h]);
    let pitch = random.log_range(2.5, 8.0);
    for side in [-1.0, 1.0] {
        let inner = 0.5 * w - finger;
        let tip = finger * random.range(0.2, 0.7);
        let mut points = vec![[-1.0, 0.5 * w], [-1.0, inner], [0.4 * reach, inner]];
        let mut x = 0.4 * reach;
        while x + pitch < reach {
            points.extend([[x + 0.5 * pitch, inner - tip], [x + pitch, inner - 0.1]]);
            x += pitch;
        }
        points.extend([[reach, inner - tip], [reach, 0.5 * w - 0.4 * finger]]);
        let outline = Outline::polygon(&points).stretched(1.0, side).counter_clockwise();
        body += Solid::prism(&outline, 0.15 * h, 0.85 * h);
    }
    body -= Solid::cylinder(0.13 * palm, -OVER, h + OVER).at(-0.3 * palm, 0.25 * w, 0.0);
    body -= Solid::cylinder(0.13 * palm, -OVER, h + OVER).at(-0.3 * palm, -0.25 * w, 0.0);
    body - Solid::cylinder(0.2 * h, -palm - OVER, -0.4 * palm).along_x().at(0.0, 0.0, 0.5 * h)
}

pub(super) fn hinge(random: &mut Stream) -> Solid {
    let n = whole(random, 2, 5);
    let pitch = random.log_range(10.0, 28.0);
    let knuckle = random.log_range(5.0, 14.0);
    let leaf = random.range(25.0, 70.0);
    let thick = knuckle * random.range(0.3, 0.8);
    let length = (2 * n - 1) as f64 * pitch;
    let mut body = Solid::block([0.0, 0.0, -knuckle], [leaf, length, thick - knuckle]);
    body += Solid::cylinder(knuckle, 0.0, length).along_y();
    for i in 0..n - 1 {
        let y = (2 * i + 1) as f64 * pitch;
        let r = 1.15 * knuckle;
        body -= Solid::block([-r, y - 0.2, -2.0 * r], [r, y + pitch + 0.2, 2.0 * r]);
    }
    body -= Solid::cylinder(knuckle * random.range(0.35, 0.6), -OVER, length + OVER).along_y();
    let holes = whole(random, 1, 4);
    for i in 0..holes {
        let y = length * (i as f64 + 0.5) / holes as f64;
        let place = counterbore(random, 0.14 * leaf, thick).at(0.7 * leaf, y, -knuckle);
        body -= place;
    }
    body
}
