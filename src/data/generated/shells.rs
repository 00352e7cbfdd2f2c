//! Hollow parts: boxes, vessels, drums, pipes, valves, bearing housings.

use super::blocks::OVER;
use super::outline::Outline;
use super::solid::Solid;
use super::turned::cut_around;
use super::whole;
use crate::numeric::rng::Stream;
use std::f64::consts::{FRAC_PI_2, TAU};

pub(super) fn enclosure(random: &mut Stream) -> Solid {
    let w = random.log_range(50.0, 160.0);
    let d = w * random.range(0.5, 1.0);
    let h = w * random.range(0.25, 0.7);
    let wall = random.log_range(1.5, 5.0);
    let radius = random.range(wall + 1.0, 0.2 * d + wall);
    let floor = wall * random.range(0.8, 1.5);
    let mut body = Solid::prism(&Outline::rounded(w, d, radius), 0.0, h);
    let (iw, id) = (w - 2.0 * wall, d - 2.0 * wall);
    body -= Solid::prism(&Outline::rounded(iw, id, radius - wall), floor, h + OVER);
    let post = random.range(3.0, 6.0);
    let top = h * random.range(0.4, 0.95);
    if random.chance(0.7) {
        for [sx, sy] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
            let (x, y) = (sx * (0.5 * iw - 0.9 * post), sy * (0.5 * id - 0.9 * post));
            body += Solid::cylinder(post, 0.5 * floor, top).at(x, y, 0.0);
            body -= Solid::cylinder(0.45 * post, floor + 1.0, h + OVER).at(x, y, 0.0);
        }
    }
    let inside = Solid::block([-0.4 * w, -0.4 * d, 0.0], [0.4 * w, 0.4 * d, h]);
    for _ in 0..whole(random, 0, 3) {
        let x = random.range(-0.35, 0.35) * w;
        let thick = random.log_range(1.0, 4.0);
        let rib = Solid::block(
            [x, -0.5 * d + 0.5 * wall, 0.5 * floor],
            [x + thick, 0.5 * d - 0.5 * wall, random.range(0.2, 0.8) * h],
        );
        body += if random.chance(0.5) { rib } else { rib & inside.clone() };
    }
    let n = whole(random, 0, 6);
    let slit = random.log_range(1.5, 4.0);
    for i in 0..n {
        let z = floor + 2.0 + (h - floor - 4.0) * i as f64 / n as f64;
        body -= Solid::block(
            [0.0, -0.25 * d, z],
            [w, 0.25 * d, z + slit.min(0.5 * (h - floor) / n as f64)],
        );
    }
    if random.chance(0.6) {
        let port = random.range(0.15, 0.3) * h.min(d);
        body -= Solid::cylinder(port, -w, 0.0).along_x().at(0.0, 0.0, 0.55 * h);
    }
    if random.chance(0.3) {
        let lid = h - wall;
        let frame = Solid::plate(
            &Outline::rounded(w, d, radius),
            &[Outline::rounded(0.7 * iw, 0.7 * id, 3.0)],
            lid,
            h,
        );
        body += frame;
    }
    body
}

pub(super) fn closed_shell(random: &mut Stream) -> Solid {
    let size = random.log_range(22.0, 70.0);
    let wall = random.log_range(2.0, 0.15 * size);
    let (mut body, reach) = match whole(random, 0, 2) {
        0 => {
            let (d, h) = (size * random.range(0.6, 1.2), size * random.range(0.5, 1.2));
            let hull = |t: f64| Solid::block([t - size, t - d, t - h], [size - t, d - t, h - t]);
            (hull(0.0) - hull(wall), [size, d, h])
        }
        1 => {
            let h = size * random.range(0.4, 1.2);
            let hull = |t: f64| Solid::cylinder(size - t, t - h, h - t);
            (hull(0.0) - hull(wall), [size, size, h])
        }
        _ => (Solid::ball(size) - Solid::ball(size - wall), [size; 3]),
    };
    for _ in 0..whole(random, 2, 6) {
        let axis = whole(random, 0, 2);
        let across = reach[(axis + 1) % 3].min(reach[(axis + 2) % 3]);
        let window = match random.chance(0.5) {
            true => Outline::circle(across * random.range(0.1, 0.5)),
            false => {
                let (w, d) = (across * random.range(0.2, 0.9), across * random.range(0.2, 0.9));
                Outline::rounded(w, d, 0.2 * w.min(d))
            }
        };
        let both = if random.chance(0.4) { -2.0 * size } else { 0.0 };
        let (u, v) = (random.range(-0.35, 0.35) * across, random.range(-0.35, 0.35) * across);
        let cut = Solid::prism(&window.at(u, v), both, 2.0 * size);
        body -= match axis {
            0 => cut.along_x(),
            1 => cut.along_y(),
            _ => cut,
        };
    }
    body
}

pub(super) fn vessel(random: &mut Stream) -> Solid {
    let height = random.log_range(45.0, 180.0);
    let belly = height * random.range(0.25, 0.5);
    let mouth = belly * random.range(0.3, 0.9);
    let wall = (height * random.range(0.02, 0.06)).max(1.5);
    let (wave, phase) = (random.range(0.0, 0.25), random.range(0.0, TAU));
    let radius = |t: f64| {
        let swell = libm::sin(std::f64::consts::PI * (0.15 + 0.75 * t));
        let ripple = 1.0 + wave * libm::sin(2.0 * TAU * t + phase);
        mouth + (belly - mouth) * swell * ripple
    };
    let n = 32;
    let mut profile = vec![[0.0, 0.0]];
    profile.extend((0..=n).map(|i| f64::from(i) / f64::from(n)).map(|t| [radius(t), t * height]));
    let floor = wall / height * 1.5;
    let inner = (0..=n).rev().map(|i| floor + (1.0 - floor) * f64::from(i) / f64::from(n));
    profile.extend(inner.map(|t| [radius(t) - wall, t * height]));
    profile.push([0.0, floor * height]);
    let mut body = Solid::turned(&profile);
    if random.chance(0.4) {
        let handle = Outline::oblong(0.8 * wall + 3.0, 2.0 * wall + 2.0).at(0.22 * height, 0.0);
        let ring = Solid::revolved(&handle, 360.0).along_y();
        let at = radius(0.5);
        let keep = Solid::block([at - 0.6 * wall, -height, 0.0], [at + height, height, height]);
        body += ring.at(at, 0.0, 0.5 * height) & keep;
    }
    if random.chance(0.3) {
        body += Solid::cylinder(1.1 * radius(0.0), -0.08 * height, 0.5 * floor * height);
    }
    body
}

pub(super) fn drum(random: &mut Stream) -> Solid {
    let radius = random.log_range(25.0, 75.0);
    let height = radius * random.range(0.8, 2.2);
    let wall = random.log_range(1.5, 0.12 * radius);
    let cap = random.range(0.3, 0.9) * (radius - wall);
    let mut body = Solid::cylinder(radius, 0.0, height);
    body -= Solid::cylinder(radius - wall, wall, height - wall);
    body -= Solid::cylinder(cap, 0.5 * height, height + OVER);
    if random.chance(0.5) {
        body -= Solid::cylinder(0.6 * cap, -OVER, 0.5 * height);
    }
    let n = whole(random, 4, 12);
    let rows = whole(random, 1, 3);
    let room = 0.8 * (height - 2.0 * wall) / rows as f64;
    let hole = (0.35 * TAU * radius / n as f64).min(0.5 * room);
    for row in 0..rows {
        let z = wall + (height - 2.0 * wall) * (row as f64 + 0.5) / rows as f64;
        let window = match random.chance(0.5) {
            true => Outline::circle(0.8 * hole),
            false => Outline::rounded(room, hole, 0.2 * hole),
        };
        let tool = Solid::prism(&window, 0.0, 2.0 * radius).along_x();
        let tool = tool.about_z(TAU * row as f64 / (2 * n) as f64).at(0.0, 0.0, z);
        body = cut_around(body, &tool, n);
    }
    body
}

/// A pipe flange about z between two heights, with bolt holes, as a solid disc and its holes.
fn bolted(radius: f64, low: f64, high: f64, n: usize) -> Solid {
    let hole = Solid::cylinder(0.08 * radius, low - OVER, high + OVER).at(0.84 * radius, 0.0, 0.0);
    cut_around(Solid::cylinder(radius, low, high), &hole, n)
}

pub(super) fn pipe_elbow(random: &mut Stream) -> Solid {
    let pipe = random.log_range(8.0, 28.0);
    let bore = pipe * random.range(0.65, 0.88);
    let bend = pipe * random.range(1.5, 3.5);
    let degrees = [45.0, 60.0, 90.0, 120.0][random.below(4)];
    let thick = pipe * random.range(0.25, 0.5);
    let disc = pipe * random.range(1.6, 2.0);
    let n = whole(random, 3, 8);
    let tube = Solid::revolved(&Outline::circle(pipe).at(bend, 0.0), degrees);
    let hollow = Solid::revolved(&Outline::circle(bore).at(bend, 0.0), degrees);
    let straight = pipe * random.range(0.6, 2.0);
    let turn = degrees.to_radians();
    // Collars a little off the bend's radii: walls that nearly coincide would cross in slivers.
    let overlap = 0.1 * pipe;
    // At the start the pipe runs along -y, at the end along +y turned by the bend.
    let end = |s: Solid| {
        let first = s.clone().along_y().about_z(std::f64::consts::PI).at(bend, 0.0, 0.0);
        let last = s.along_y().at(bend, 0.0, 0.0).about_z(turn);
        (first, last)
    };
    let (a, b) = end(Solid::cylinder(1.03 * pipe, -overlap, straight)
        + bolted(disc, straight, straight + thick, n));
    let (c, d) = end(Solid::cylinder(0.97 * bore, -overlap, straight + thick + OVER));
    tube + a + b - hollow - c - d
}

pub(super) fn valve_body(random: &mut Stream) -> Solid {
    let pipe = random.log_range(8.0, 22.0);
    let bore = pipe * random.range(0.6, 0.85);
    let belly = pipe * random.range(1.3, 1.7);
    let half = pipe * random.range(2.2, 3.5);
    let neck = pipe * random.range(1.8, 3.2);
    let disc = pipe * random.range(1.5, 1.9);
    let thick = pipe * random.range(0.25, 0.5);
    let n = whole(random, 3, 8);
    let shell = match random.chance(0.5) {
        true => Solid::ball(belly),
        false => Solid::cylinder(belly, -belly, belly),
    };
    let room = belly - 0.6 * (pipe - bore) - 1.0;
    let cavity = match random.chance(0.5) {
        true => Solid::ball(room),
        false => Solid::cylinder(room, -room, room),
    };
    let run = Solid::cylinder(pipe, -half, half) + bolted(disc, half - thick, half, n);
    let run = run + bolted(disc, -half, thick - half, n);
    let stem = Solid::cylinder(pipe, 0.0, neck) + bolted(1.1 * disc, neck - thick, neck, n);
    let mut body = shell + run.along_x() + stem;
    body -= cavity;
    body -= Solid::cylinder(bore, -half - OVER, half + OVER).along_x();
    body - Solid::cylinder(bore * random.range(0.7, 1.0), 0.0, neck + OVER)
}

pub(super) fn bearing_housing(random: &mut Stream) -> Solid {
    let radius = random.log_range(18.0, 50.0);
    let width = radius * random.range(0.8, 1.8);
    let axis = radius * random.range(1.05, 1.5);
    let foot = radius * random.range(1.6, 2.2);
    let base = radius * random.range(0.25, 0.5);
    let half = 0.5 * width;
    let mut body = Solid::cylinder(radius, -half, half).along_y().at(0.0, 0.0, axis);
    body += Solid::block([-foot, -0.45 * width, 0.0], [foot, 0.45 * width, base]);
    body += Solid::block(
        [-0.95 * radius, -0.4 * width, 0.5 * base],
        [0.95 * radius, 0.4 * width, axis],
    );
    let bore = radius * random.range(0.35, 0.5);
    let seat = radius * random.range(0.6, 0.8);
    let lip = width * random.range(0.1, 0.25);
    let inner =
        Solid::cylinder(bore, -width, width) + Solid::cylinder(seat, lip - half, half - lip);
    body -= inner.along_y().at(0.0, 0.0, axis);
    let room = foot - radius;
    for x in [-1.0, 1.0] {
        let slot = Outline::oblong(0.8 * room + 2.0, 0.4 * room + 1.0);
        body -= Solid::prism(&slot, -OVER, base + OVER).at(x * (radius + 0.48 * room), 0.0, 0.0);
    }
    if random.chance(0.6) {
        body -= Solid::cylinder(0.06 * radius + 1.0, axis, 3.0 * radius);
    }
    if random.chance(0.4) {
        let pilot = Solid::cylinder(0.05 * radius + 0.7, -width, width).at(0.88 * radius, 0.0, 0.0);
        for i in 0..6 {
            let hole = pilot.clone().about_z(TAU * f64::from(i) / 6.0).along_y();
            body -= hole.at(0.0, 0.0, axis);
        }
    }
    if random.chance(0.5) { body } else { body.about_z(FRAC_PI_2) }
}
