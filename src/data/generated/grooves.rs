//! Bodies with straight profiles: T-slots, dovetails, rails, racks.

use super::blocks::{OVER, Stock, counterbore};
use super::outline::Outline;
use super::solid::Solid;
use super::whole;
use crate::numeric::rng::Stream;

/// A T-shaped groove along y, `length` long, hanging from `top`.
fn t_groove(random: &mut Stream, neck: f64, depth: f64, length: f64, top: f64) -> Solid {
    let head = neck * random.range(1.5, 2.4);
    let roof = top - depth * random.range(0.35, 0.65);
    let y = 0.5 * length;
    Solid::block([-0.5 * neck, -y, roof - OVER], [0.5 * neck, y, top + OVER])
        + Solid::block([-0.5 * head, -y, top - depth], [0.5 * head, y, roof])
}

pub(super) fn t_slot(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [20.0, 60.0]);
    let Stock { w, d, h } = stock;
    let mut body = stock.body(random);
    let n = whole(random, 1, 4);
    let pitch = w / n as f64;
    let neck = (pitch * random.range(0.12, 0.3)).min(18.0);
    let depth = h * random.range(0.4, 0.8);
    for i in 0..n {
        let x = (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
        let blind = random.chance(0.3);
        let shift = if blind { random.range(0.2, 0.5) * d } else { 0.0 };
        body -= t_groove(random, neck, depth, d + 2.0 * OVER, h).at(x, shift, 0.0);
    }
    if random.chance(0.3) {
        body -= t_groove(random, neck, depth, w + 2.0, h).about_z(std::f64::consts::FRAC_PI_2);
    }
    if random.chance(0.5) {
        let side = counterbore(random, 0.15 * d, h).at(0.5 * pitch * (n % 2) as f64, 0.3 * d, 0.0);
        body -= side;
    }
    body
}

pub(super) fn dovetail(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [20.0, 60.0]);
    let Stock { w, d, h } = stock;
    let mut body = stock.body(random);
    let n = whole(random, 1, 3);
    let pitch = w / n as f64;
    let depth = h * random.range(0.25, 0.6);
    let slope = random.range(0.3, 0.8);
    for i in 0..n {
        let x = (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
        let narrow = pitch * random.range(0.12, 0.3);
        let wide = (narrow + slope * depth).min(0.45 * pitch);
        let male = random.chance(0.35);
        let up = if male { 1.0 } else { -1.0 };
        let profile =
            [[-narrow, -up * 0.5], [narrow, -up * 0.5], [wide, up * depth], [-wide, up * depth]];
        let outline = Outline::polygon(&profile).counter_clockwise();
        let ridge = Solid::prism(&outline, -0.5 * d, 0.5 * d).turned_up().at(x, 0.0, h);
        if male {
            body += ridge & Solid::block([-w, -0.45 * d, 0.0], [w, 0.45 * d, 2.0 * h]);
        } else {
            body -= Solid::prism(&outline, -d, d).turned_up().at(x, 0.0, h);
        }
    }
    if random.chance(0.5) {
        body -= Solid::cylinder(random.range(0.05, 0.12) * h, -w, w).along_x().at(
            0.0,
            0.3 * d,
            0.2 * h,
        );
    }
    body
}

pub(super) fn rail(random: &mut Stream) -> Solid {
    let size = random.log_range(25.0, 80.0);
    let length = random.log_range(50.0, 220.0);
    let mut body = Solid::prism(&Outline::rounded(size, size, 0.06 * size), 0.0, length);
    let neck = random.range(0.2, 0.3) * size;
    let depth = random.range(0.22, 0.3) * size;
    let lip = depth * random.range(0.25, 0.4);
    let head = neck * random.range(1.4, 1.9);
    let half = 0.5 * size;
    let (i, o) = (0.5 * neck, 0.5 * head);
    let groove = Outline::polygon(&[
        [-i, -half - OVER],
        [i, -half - OVER],
        [i, lip - half],
        [o, lip - half],
        [i, depth - half],
        [-i, depth - half],
        [-o, lip - half],
        [-i, lip - half],
    ]);
    for side in 0..4 {
        if random.chance(0.85) {
            let groove = groove.clone().turned(std::f64::consts::FRAC_PI_2 * f64::from(side));
            body -= Solid::prism(&groove, -OVER, length + OVER);
        }
    }
    body -= Solid::cylinder(random.range(0.06, 0.15) * size, -OVER, length + OVER);
    if random.chance(0.5) {
        let across = Solid::cylinder(0.3 * neck, -size, size).along_x();
        body -= across.at(0.0, 0.0, length * random.range(0.2, 0.8));
    }
    body.along_x()
}

pub(super) fn rack(random: &mut Stream) -> Solid {
    let n = whole(random, 8, 24);
    let pitch = random.log_range(4.0, 9.0);
    let (depth, width) = (0.7 * pitch, random.range(10.0, 40.0));
    let base = random.range(8.0, 30.0);
    let length = n as f64 * pitch;
    let mut points = vec![[0.0, 0.0], [length, 0.0]];
    for tooth in (0..n).rev() {
        let corner = |share: f64, height: f64| [(tooth as f64 + share) * pitch, height];
        let flank = [(0.88, 0.0), (0.68, depth), (0.32, depth), (0.12, 0.0)];
        points.extend(flank.map(|(share, z)| corner(share, base + z)));
    }
    let profile = Outline::polygon(&points).at(-0.5 * length, 0.0);
    let mut body = Solid::prism(&profile, -0.5 * width, 0.5 * width).turned_up();
    for _ in 0..whole(random, 0, 3) {
        let x = random.range(-0.42, 0.42) * length;
        let radius = random.range(0.12, 0.3) * base;
        body -= Solid::cylinder(radius, -width, width).along_y().at(x, 0.0, 0.45 * base);
    }
    if random.chance(0.5) {
        let slot = random.range(0.15, 0.4) * width;
        let groove = Solid::block([-length, -0.5 * slot, -OVER], [length, 0.5 * slot, 0.3 * base]);
        body -= groove;
    }
    body
}
