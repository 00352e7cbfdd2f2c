//! Blades and screws: impellers, bladed discs, turbine blades, propellers, augers.

use super::blocks::OVER;
use super::freeform::twisted_column;
use super::outline::{Outline, polar};
use super::solid::Solid;
use super::turned::{cut_around, put_around};
use super::whole;
use crate::numeric::rng::Stream;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A cambered section along x about the origin: `chord` long, at most `thick` wide.
fn airfoil(chord: f64, thick: f64, camber: f64) -> Outline {
    const N: usize = 14;
    let point = |i: usize, side: f64| {
        let t = 0.5 * (1.0 - libm::cos(std::f64::consts::PI * i as f64 / N as f64));
        // The four-digit thickness curve with a blunt trailing edge.
        let half = thick
            * (1.4845 * t.sqrt() - 0.63 * t - 1.758 * t * t + 1.4215 * t * t * t
                - 0.46 * t * t * t * t);
        let line = 4.0 * camber * t * (1.0 - t);
        DVec2::new(chord * (t - 0.4), line + side * half.max(0.02 * thick))
    };
    let under = (0..=N).map(|i| point(i, -1.0));
    Outline(under.chain((0..=N).rev().map(|i| point(i, 1.0))).collect())
}

/// An airfoil column along z, twisted and tapered on its way up.
fn blade(random: &mut Stream, chord: f64, length: f64) -> Solid {
    let thick = chord * random.range(0.07, 0.2);
    let camber = chord * random.range(0.0, 0.18);
    let setting = random.range(0.3, 1.1);
    let section = airfoil(chord, thick.max(1.2), camber).turned(setting);
    twisted_column(&section, length, random.range(-0.7, 0.7), random.range(0.5, 1.0))
}

pub(super) fn impeller(random: &mut Stream) -> Solid {
    let radius = random.log_range(28.0, 90.0);
    let plate = radius * random.range(0.06, 0.12);
    let height = radius * random.range(0.3, 0.7);
    let eye = radius * random.range(0.3, 0.45);
    let tip = plate + (height - plate) * random.range(0.3, 0.7);
    let n = whole(random, 5, 10);
    let sweep = random.range(0.5, 1.6) * if random.chance(0.5) { 1.0 } else { -1.0 };
    let half = 0.5 * random.log_range(1.2, 0.05 * radius + 1.5);
    let path: Vec<DVec2> = (0..=16)
        .map(|i| f64::from(i) / 16.0)
        .map(|t| polar(0.5 * eye + (1.05 * radius - 0.5 * eye) * t, sweep * t))
        .collect();
    let vane = Solid::prism(&Outline::stroke(&path, half), 0.5 * plate, 2.0 * height);
    // The meridian envelope trims the vanes.
    let cap = |lift: f64| -> Vec<[f64; 2]> {
        let curve = (0..=10).map(|i| {
            let t = f64::from(i) / 10.0;
            let s = (1.0 - t) * (1.0 - t);
            [radius + (eye - radius) * (1.0 - s), tip + (height - tip) * t * t + lift]
        });
        curve.collect()
    };
    let mut envelope = vec![[0.0, 0.0], [radius, 0.0]];
    envelope.extend(cap(0.0));
    envelope.push([0.0, height]);
    let vanes =
        put_around(Solid::cylinder(0.3 * eye, 0.0, height), &vane, n) & Solid::turned(&envelope);
    let hub = [
        [0.0, 0.0],
        [radius, 0.0],
        [radius, plate],
        [0.6 * eye, plate + 0.25 * height],
        [0.4 * eye, height],
        [0.0, height],
    ];
    let mut body = vanes + Solid::turned(&hub);
    if random.chance(0.4) {
        let wall = radius * random.range(0.03, 0.06) + 1.0;
        let mut shroud = cap(-0.4);
        shroud.extend(cap(wall).into_iter().rev());
        let shroud = Outline::polygon(&shroud.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>());
        body += Solid::revolved(&shroud.counter_clockwise(), 360.0);
    }
    body - Solid::cylinder(eye * random.range(0.12, 0.3), -OVER, 2.0 * height)
}

pub(super) fn blisk(random: &mut Stream) -> Solid {
    let disc = random.log_range(16.0, 50.0);
    let length = disc * random.range(0.5, 1.2);
    let n = whole(random, 7, 18);
    let chord = (TAU * disc / n as f64 * random.range(0.8, 1.2)).min(0.8 * disc);
    let blade = blade(random, chord, length + 0.2 * disc).along_x().at(0.8 * disc, 0.0, 0.0);
    let width = 0.45 * chord + 2.0;
    let bore = disc * random.range(0.2, 0.4);
    let rim = 0.75 * disc;
    let web = width * random.range(0.2, 0.6);
    let hub = 1.5 * bore;
    let profile = [
        [0.0, -width],
        [hub, -width],
        [hub, -web],
        [rim, -web],
        [rim, -width],
        [disc, -width],
        [disc, width],
        [rim, width],
        [rim, web],
        [hub, web],
        [hub, width],
        [0.0, width],
    ];
    let mut body = put_around(Solid::turned(&profile), &blade, n);
    if random.chance(0.25) {
        let (inner, outer) = (disc + 0.9 * length, disc + 1.1 * length);
        let ring = Solid::cylinder(outer, -width, width)
            - Solid::cylinder(inner, -2.0 * width, 2.0 * width);
        body += ring;
    }
    let body = body - Solid::cylinder(bore, -2.0 * width, 2.0 * width);
    let hole = Solid::cylinder(0.25 * (rim - hub), -2.0 * width, 2.0 * width).at(
        0.5 * (rim + hub),
        0.0,
        0.0,
    );
    let n_holes = whole(random, 0, 6);
    if rim > hub + 4.0 { cut_around(body, &hole, n_holes) } else { body }
}

pub(super) fn turbine_blade(random: &mut Stream) -> Solid {
    let chord = random.log_range(25.0, 60.0);
    let length = chord * random.range(1.2, 3.0);
    let airfoil = blade(random, chord, length).about_z(-0.6);
    let (w, d) = (1.3 * chord, 1.1 * chord);
    let shelf = random.range(3.0, 8.0);
    let mut body = airfoil.at(0.0, 0.0, -0.5)
        + Solid::block([-0.5 * w, -0.5 * d, -shelf], [0.5 * w, 0.5 * d, 0.2]);
    let n = whole(random, 1, 3);
    let root = chord * random.range(0.5, 0.9);
    let rise = root / n as f64;
    let mut half = random.range(0.28, 0.42) * d;
    let mut right = Vec::new();
    for i in 0..n {
        let z = -shelf - rise * i as f64;
        right.extend([
            [half * 0.62, z - 0.3 * rise],
            [half, z - 0.55 * rise],
            [half, z - 0.75 * rise],
        ]);
        half *= 0.75;
    }
    right.push([half * 0.6, -shelf - root]);
    let top = [right[0][0], 0.5 - shelf];
    let left = right.iter().rev().map(|p| [-p[0], p[1]]);
    let mut points: Vec<[f64; 2]> = vec![[-top[0], top[1]], top];
    points.extend(right.iter().copied());
    points.extend(left);
    let fir = Outline::polygon(&points).counter_clockwise();
    body += Solid::prism(&fir, -0.5 * w, 0.5 * w).turned_up().about_z(FRAC_PI_2);
    if random.chance(0.4) {
        body += Solid::block([-0.4 * w, -0.4 * d, length - 3.0], [0.4 * w, 0.4 * d, length + 1.0]);
    }
    body
}

pub(super) fn propeller(random: &mut Stream) -> Solid {
    let hub = random.log_range(7.0, 18.0);
    let length = hub * random.range(2.0, 4.5);
    let n = whole(random, 2, 5);
    let chord = (hub * random.range(1.0, 2.0)).min(TAU * hub * 1.1 / n as f64);
    let bow = random.range(0.0, 0.5);
    let blade = blade(random, chord, length).bent(|p| {
        let t = (p.z / length).clamp(0.0, 1.0);
        let width = 1.0 + 1.4 * t * (1.0 - t);
        DVec3::new(p.x * width + bow * chord * t * t, p.y * width, p.z)
    });
    let blade = blade.along_x().at(0.7 * hub, 0.0, 0.0);
    let half = 0.55 * chord + 1.0;
    let mut body = Solid::cylinder(hub, -half, half);
    if random.chance(0.6) {
        body += Solid::cone(hub, 0.3 * hub, half - 0.1, half + hub);
    }
    body = put_around(body, &blade, n);
    body - Solid::cylinder(
        hub * random.range(0.2, 0.45),
        -2.0 * half - hub,
        half * random.range(0.0, 3.0),
    )
}

pub(super) fn screw(random: &mut Stream) -> Solid {
    let radius = random.log_range(12.0, 45.0);
    let core = radius * random.range(0.3, 0.6);
    let length = radius * random.range(2.0, 4.0);
    let starts = whole(random, 1, 4);
    let share = random.range(0.1, 0.3);
    let lobe = match starts {
        1 => Outline::circle(radius * 0.8).at(0.2 * radius, 0.0),
        _ => {
            let pitch = [
                [radius, 0.0],
                [radius, share],
                [core, 0.5 * (1.0 + share) - 0.12],
                [core, 0.5 * (1.0 + share) + 0.12],
            ];
            Outline::wheel(starts, &pitch).filleted(0.08 * radius).refined(0.12 * radius)
        }
    };
    let turns = random.range(0.6, 2.2) * if random.chance(0.5) { 1.0 } else { -1.0 };
    let mut body = twisted_column(&lobe, length, TAU * turns / starts as f64, 1.0);
    let end = random.range(0.2, 0.7) * radius;
    body += Solid::cylinder(0.8 * core, -end, length + end);
    if random.chance(0.3) {
        body -= Solid::cylinder(0.45 * core, -end - OVER, length + end + OVER);
    }
    if random.chance(0.6) { body.along_x() } else { body }
}
