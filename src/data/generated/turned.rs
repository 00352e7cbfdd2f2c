//! Turned parts: bodies of revolution, then drilled, slit and keyed.

use super::blocks::OVER;
use super::outline::{Outline, polar};
use super::solid::Solid;
use super::whole;
use crate::numeric::rng::Stream;
use std::f64::consts::TAU;

/// `body` less `n` copies of `tool` around z.
pub(super) fn cut_around(mut body: Solid, tool: &Solid, n: usize) -> Solid {
    for i in 0..n {
        body -= tool.clone().about_z(TAU * i as f64 / n as f64);
    }
    body
}

/// `body` with `n` copies of `piece` around z.
pub(super) fn put_around(mut body: Solid, piece: &Solid, n: usize) -> Solid {
    for i in 0..n {
        body += piece.clone().about_z(TAU * i as f64 / n as f64);
    }
    body
}

/// A keyway along z in a bore or on a shaft: the box to cut, outermost at `depth` mm.
fn key(radius: f64, depth: f64, low: f64, high: f64) -> Solid {
    let half = 0.2 * radius;
    Solid::block([0.0, -half, low], [depth, half, high])
}

pub(super) fn flange(random: &mut Stream) -> Solid {
    let radius = random.log_range(30.0, 100.0);
    let thick = radius * random.range(0.12, 0.3);
    let neck = radius * random.range(0.3, 0.55);
    let height = thick + radius * random.range(0.1, 1.0);
    let bore = neck * random.range(0.4, 0.85);
    let fillet = (height - thick).min(0.2 * (radius - neck));
    let mut profile = vec![[bore, 0.0], [radius, 0.0], [radius, thick], [neck + fillet, thick]];
    for i in 1..6 {
        let a = polar(fillet, TAU * 0.25 * f64::from(i) / 6.0);
        profile.push([neck + fillet - a.y, thick + fillet - a.x]);
    }
    profile.extend([[neck, thick + fillet], [neck, height + 0.5], [bore, height + 0.5]]);
    let mut body = Solid::turned(&profile);
    let n = whole(random, 3, 10);
    let circle = 0.5 * (radius + neck + fillet);
    let hole = (0.5 * (radius - circle)).min(1.2 * circle / n as f64);
    let tool = Solid::cylinder(hole, -OVER, thick + OVER).at(circle, 0.0, 0.0);
    body = cut_around(body, &tool, n);
    if random.chance(0.4) {
        let groove = Outline::circle(0.5 * (bore + circle - hole) + 1.0);
        let inner = Outline::circle(0.5 * (bore + circle - hole) - 1.0);
        body -= Solid::plate(&groove, &[inner], -OVER, 0.25 * thick);
    }
    if random.chance(0.4) {
        let window = Solid::block([-0.3 * neck, 0.0, height], [0.3 * neck, radius, height + OVER]);
        body -= window.at(0.0, 0.0, -0.35 * (height - thick));
    }
    body
}

pub(super) fn pulley(random: &mut Stream) -> Solid {
    let radius = random.log_range(25.0, 100.0);
    let n = whole(random, 1, 5);
    let groove = random.log_range(3.0, 12.0);
    let depth = (groove * random.range(0.5, 1.6)).min(0.35 * radius);
    let land = random.range(0.8, 3.0);
    let floor = groove * random.range(0.15, 0.8);
    let width = n as f64 * (groove + land) + land;
    let bore = radius * random.range(0.1, 0.2);
    let mut profile = vec![[bore, 0.0], [radius, 0.0]];
    for i in 0..n {
        let z = land + i as f64 * (groove + land);
        let middle = z + 0.5 * groove;
        let (low, high) = (middle - 0.5 * floor, middle + 0.5 * floor);
        profile.extend([
            [radius, z],
            [radius - depth, low],
            [radius - depth, high],
            [radius, z + groove],
        ]);
    }
    profile.extend([[radius, width], [bore, width]]);
    let mut body = Solid::turned(&profile);
    let rim = radius - depth - random.range(2.0, 5.0);
    let hub = 1.8 * bore;
    if rim > hub + 5.0 && random.chance(0.7) {
        let web = width * random.range(0.2, 0.5);
        let recess = Solid::plate(&Outline::circle(rim), &[Outline::circle(hub)], 0.0, width);
        body -= recess.clone().at(0.0, 0.0, 0.5 * (width + web));
        body -= recess.at(0.0, 0.0, -0.5 * (width + web));
        let tool =
            Solid::cylinder(0.3 * (rim - hub), -OVER, width + OVER).at(0.5 * (rim + hub), 0.0, 0.0);
        body = cut_around(body, &tool, whole(random, 0, 5));
    }
    body - key(bore, 1.3 * bore, -OVER, width + OVER)
}

pub(super) fn shaft(random: &mut Stream) -> Solid {
    let mut profile = vec![[0.0, 0.0]];
    let (mut z, mut radius) = (0.0, random.log_range(5.0, 15.0));
    let n = whole(random, 3, 7);
    let mut keyed = None;
    for i in 0..n {
        let length = random.log_range(8.0, 35.0);
        profile.extend([[radius, z], [radius, z + length]]);
        if keyed.is_none() && length > 2.0 * radius {
            keyed = Some((radius, z, length));
        }
        z += length;
        let grows = 2 * i < n - 1;
        if random.chance(0.35) {
            let groove = random.log_range(1.0, 3.0);
            let neck = radius * random.range(0.7, 0.9);
            profile.extend([[neck, z], [neck, z + groove]]);
            z += groove;
        }
        radius *= if grows { random.range(1.08, 1.6) } else { random.range(0.65, 0.93) };
    }
    profile.push([0.0, z]);
    let mut body = Solid::turned(&profile);
    if let Some((radius, low, length)) = keyed {
        let across =
            Outline::oblong(0.8 * length, 0.5 * radius).turned(std::f64::consts::FRAC_PI_2);
        let tool = Solid::prism(&across, 0.6 * radius, 2.0 * radius).turned_up();
        body -= tool.at(0.0, 0.0, low + 0.5 * length);
    }
    if random.chance(0.4) {
        let first = profile[1][0];
        body -= Solid::cylinder(0.45 * first, -OVER, 0.25 * z);
    }
    if random.chance(0.4) {
        let hole = 0.35 * profile[1][0];
        body -= Solid::cylinder(hole, -z, z).along_y().at(0.0, 0.0, 0.5 * profile[2][1]);
    }
    if random.chance(0.7) { body.along_x() } else { body }
}

pub(super) fn collar(random: &mut Stream) -> Solid {
    let bore = random.log_range(10.0, 45.0);
    let radius = bore * random.range(1.35, 1.9);
    let height = bore * random.range(0.5, 1.6);
    let lug = (radius - bore) * random.range(0.8, 1.4);
    let mut body = Solid::cylinder(radius, 0.0, height);
    let ear = radius + lug;
    body += Solid::block([0.5 * bore, -0.8 * lug - 2.0, 0.0], [ear, 0.8 * lug + 2.0, height]);
    body -= Solid::cylinder(bore, -OVER, height + OVER);
    let slit = random.log_range(1.0, 4.0);
    body -= Solid::block([0.0, -0.5 * slit, -OVER], [2.0 * ear, 0.5 * slit, height + OVER]);
    let screw = 0.22 * lug + 0.8;
    let level = if random.chance(0.5) { vec![0.5] } else { vec![0.25, 0.75] };
    for share in level {
        let z = share * height;
        let x = 0.5 * (bore + ear) + 0.25 * (ear - bore);
        body -= Solid::cylinder(screw, -2.0 * ear, 2.0 * ear).along_y().at(x, 0.0, z);
        body -= Solid::cylinder(1.6 * screw, 0.5 * lug + 1.0, 2.0 * ear).along_y().at(x, 0.0, z);
    }
    if random.chance(0.4) {
        let groove = Outline::circle(bore + 0.4 * (radius - bore));
        body -= Solid::prism(&groove, 0.4 * height, 0.6 * height);
    }
    body
}

pub(super) fn coupling(random: &mut Stream) -> Solid {
    let radius = random.log_range(21.0, 55.0);
    let bore = radius * random.range(0.25, 0.5);
    let height = radius * random.range(1.0, 2.4);
    let mut body =
        Solid::cylinder(radius, 0.0, height) - Solid::cylinder(bore, -OVER, height + OVER);
    if random.chance(0.5) {
        let jaws = whole(random, 2, 4);
        let deep = height * random.range(0.2, 0.4);
        let half = TAU / 4.0 / jaws as f64 * random.range(0.6, 1.0);
        let (u, v) = (polar(3.0 * radius, -half), polar(3.0 * radius, half));
        let wedge = Outline::polygon(&[[0.0, 0.0], [u.x, u.y], [v.x, v.y]]);
        body = cut_around(body, &Solid::prism(&wedge, height - deep, height + OVER), jaws);
    } else {
        let slit = random.log_range(0.8, 3.0);
        let n = whole(random, 2, 6);
        let pitch = 0.6 * height / n as f64;
        for i in 0..n {
            let z = 0.2 * height + (i as f64 + 0.5) * pitch;
            let from = -radius * random.range(0.5, 0.7);
            let cut = Solid::block(
                [from, -2.0 * radius, z],
                [2.0 * radius, 2.0 * radius, z + slit.min(0.5 * pitch)],
            );
            body -= cut.about_z(TAU * (i % 2) as f64 / 2.0 + 0.4 * i as f64);
        }
    }
    let screw = radius * random.range(0.06, 0.12);
    body -= Solid::cylinder(screw, 0.0, 2.0 * radius).along_x().at(0.0, 0.0, 0.1 * height + screw);
    body - key(bore, 1.25 * bore, -OVER, height + OVER)
}

pub(super) fn collet(random: &mut Stream) -> Solid {
    let bore = random.log_range(4.0, 16.0);
    let mouth = bore * random.range(1.8, 2.6);
    let tail = bore * random.range(1.3, 1.7);
    let length = random.range(5.0, 8.0) * bore;
    let length = length.max(41.0);
    let cone = length * random.range(0.25, 0.5);
    let face = 0.06 * length;
    let profile = [
        [bore, 0.0],
        [tail, 0.0],
        [tail, length - cone],
        [mouth, length - face],
        [mouth * 0.94, length - face],
        [mouth * 0.94, length],
        [bore, length],
    ];
    let mut body = Solid::turned(&profile);
    let slit = random.log_range(0.6, 0.3 * bore + 0.3);
    let n = whole(random, 3, 6);
    let low = length * random.range(0.15, 0.4);
    let cut =
        Solid::block([0.5 * bore, -0.5 * slit, low], [3.0 * mouth, 0.5 * slit, length + OVER]);
    body = cut_around(body, &cut, n);
    if random.chance(0.5) {
        let cut =
            Solid::block([0.5 * bore, -0.5 * slit, -OVER], [3.0 * mouth, 0.5 * slit, 0.8 * length]);
        body = cut_around(body.about_z(std::f64::consts::PI / n as f64), &cut, n);
    }
    body
}

pub(super) fn knob(random: &mut Stream) -> Solid {
    let radius = random.log_range(21.0, 50.0);
    let height = radius * random.range(0.5, 1.2);
    let lobes = whole(random, 3, 12);
    let depth = radius * random.range(0.08, 0.22);
    let outline = Outline::wheel(
        lobes,
        &[[radius, 0.0], [radius, 0.45], [radius - depth, 0.6], [radius - depth, 0.85]],
    );
    let mut body = Solid::prism(&outline.filleted(0.4 * depth), 0.0, height);
    let crown = random.range(1.3, 3.0) * radius;
    let drop = crown - libm::sqrt(crown * crown - radius * radius);
    let dome = Solid::ball(crown).at(0.0, 0.0, height - crown);
    if drop < 0.9 * height {
        body = body & dome;
    }
    body += Solid::cylinder(0.45 * radius, -0.5 * height, 0.1 * height);
    let bore = radius * random.range(0.12, 0.28);
    body -= Solid::cylinder(bore, -height, height * random.range(0.3, 0.7));
    if random.chance(0.4) {
        let inner = Outline::circle(0.55 * radius);
        let outer = Outline::circle(0.55 * radius + 0.25 * (radius - depth));
        body -= Solid::plate(&outer, &[inner], -OVER, 0.4 * height);
    }
    body
}

pub(super) fn handwheel(random: &mut Stream) -> Solid {
    let radius = random.log_range(40.0, 100.0);
    let rim = radius * random.range(0.07, 0.14);
    let hub = radius * random.range(0.15, 0.26);
    let height = hub * random.range(0.8, 2.0);
    let dish = radius * random.range(0.0, 0.3);
    let section = Outline::circle(rim).stretched(1.0, random.range(0.7, 1.3)).at(radius, dish);
    let mut body = Solid::revolved(&section, 360.0);
    body += Solid::cylinder(hub, -0.5 * height, 0.5 * height);
    let n = whole(random, 3, 6);
    let spoke = random.range(0.4, 0.7) * rim;
    let lean = libm::atan2(dish, radius);
    let length = libm::hypot(radius, dish);
    let bar = match random.chance(0.5) {
        true => Solid::cylinder(spoke, 0.5 * hub, length).along_x(),
        false => Solid::block(
            [0.5 * hub, -1.4 * spoke, -0.6 * spoke],
            [length, 1.4 * spoke, 0.6 * spoke],
        ),
    };
    body = put_around(body, &bar.about_y(-lean), n);
    let bore = hub * random.range(0.3, 0.6);
    body -= Solid::cylinder(bore, -height, height);
    body -= key(bore, 1.25 * bore, -height, height);
    if random.chance(0.5) {
        let grip = Solid::cylinder(0.7 * rim, 0.0, radius * random.range(0.3, 0.6));
        body += grip.at(radius, 0.0, dish);
    }
    body
}
