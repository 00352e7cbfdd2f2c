//! Wheels: gears, cams, spirals.

use super::outline::{Outline, polar};
use super::solid::Solid;
use super::{freeform, whole};
use crate::numeric::rng::Stream;
use std::f64::consts::TAU;

/// The outline of a spur gear: `n` trapezoidal teeth between `root` and `tip` mm.
fn gear_outline(n: usize, root: f64, tip: f64) -> Outline {
    let middle = 0.5 * (root + tip);
    Outline::wheel(
        n,
        &[
            [root, 0.0],
            [root, 0.2],
            [middle, 0.29],
            [tip, 0.38],
            [tip, 0.6],
            [middle, 0.69],
            [root, 0.78],
        ],
    )
}

pub(super) fn gear(random: &mut Stream) -> Solid {
    let n = whole(random, 10, 40);
    let tip = random.log_range(22.0, 90.0);
    let tooth = (2.2 * TAU * tip / (6.5 * n as f64)).min(0.25 * tip);
    let height = random.log_range(6.0, 50.0);
    if random.chance(0.2) {
        let ring = Solid::cylinder(tip + random.range(4.0, 15.0), 0.0, height);
        return ring - Solid::prism(&gear_outline(n, tip - tooth, tip), -1.0, height + 1.0);
    }
    let outline = gear_outline(n, tip - tooth, tip);
    let mut body = match random.chance(0.4) {
        true => freeform::twisted_column(&outline, height, random.range(-0.5, 0.5), 1.0),
        false => Solid::prism(&outline, 0.0, height),
    };
    let root = tip - tooth;
    let bore = root * random.range(0.12, 0.25);
    let hub = bore * random.range(1.4, 1.9);
    let rim = root * random.range(0.78, 0.9);
    if rim > hub + 4.0 && random.chance(0.7) {
        let web = height * random.range(0.15, 0.4);
        let recess = Solid::plate(&Outline::circle(rim), &[Outline::circle(hub)], 0.0, height);
        body -= recess.clone().at(0.0, 0.0, 0.5 * height + 0.5 * web);
        body -= recess.at(0.0, 0.0, -0.5 * height - 0.5 * web);
        let n_holes = whole(random, 0, 7);
        let hole = 0.38 * (rim - hub);
        let spread = 0.5 * (rim + hub);
        if n_holes > 1 && TAU * spread / n_holes as f64 > 2.3 * hole {
            for i in 0..n_holes {
                let place = polar(spread, TAU * i as f64 / n_holes as f64);
                body -= Solid::cylinder(hole, -1.0, height + 1.0).at(place.x, place.y, 0.0);
            }
        }
    }
    if random.chance(0.5) {
        body += Solid::cylinder(hub, 0.5 * height, height * random.range(1.2, 1.8));
    }
    body -= Solid::cylinder(bore, -1.0, 2.0 * height);
    let key = 0.35 * bore;
    body - Solid::block([0.0, -key, -1.0], [1.25 * bore, key, 2.0 * height])
}

pub(super) fn cam(random: &mut Stream) -> Solid {
    let base = random.log_range(20.0, 60.0);
    let lift = base * random.range(0.2, 0.6);
    let lobes = whole(random, 1, 3) as f64;
    let sharp = random.range(0.5, 2.0);
    let radius = move |a: f64| {
        let rise = 0.5 * (1.0 + libm::cos(lobes * a));
        base + lift * libm::pow(rise, sharp)
    };
    let height = random.log_range(8.0, 40.0);
    let mut body = Solid::prism(&Outline::round(120, radius), 0.0, height);
    if random.chance(0.5) {
        let wall = random.log_range(2.0, 8.0);
        let groove = random.range(0.2, 0.7) * height;
        let outer = Outline::round(120, |a| radius(a) - wall);
        let inner = Outline::round(120, |a| (radius(a) - wall) * 0.75);
        body -= Solid::plate(&outer, &[inner], height - groove, height + 1.0);
    }
    let bore = base * random.range(0.15, 0.35);
    if random.chance(0.6) {
        body += Solid::cylinder(1.5 * bore, 0.0, height * random.range(1.3, 2.5));
    }
    body - Solid::cylinder(bore, -1.0, 3.0 * height)
}

pub(super) fn scroll(random: &mut Stream) -> Solid {
    let radius = random.log_range(25.0, 80.0);
    let turns = random.range(1.3, 3.2);
    let pitch = radius / (turns + 0.6);
    let wall = pitch * random.range(0.15, 0.4);
    let start = 0.5 * pitch;
    let n = (30.0 * turns) as usize;
    let point = |i: usize| {
        let t = turns * i as f64 / n as f64;
        polar(start + pitch * t, TAU * t)
    };
    let path: Vec<_> = (0..=n).map(point).collect();
    let (base, height) = (random.range(3.0, 12.0), random.range(0.2, 0.7) * radius);
    let plate = Solid::cylinder(radius + wall, 0.0, base);
    let spiral = Solid::prism(&Outline::stroke(&path, 0.5 * wall), base - 1.0, base + height);
    let body = plate + spiral;
    match random.chance(0.5) {
        true => body - Solid::cylinder(0.3 * pitch, -1.0, base + 1.0),
        false => body + Solid::cylinder(0.5 * radius, -random.range(5.0, 20.0), 1.0),
    }
}
