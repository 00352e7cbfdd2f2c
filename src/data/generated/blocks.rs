//! Milled blocks: pockets, steps, slots and undercuts.

use super::outline::Outline;
use super::solid::Solid;
use super::whole;
use crate::rng::Stream;

/// How far cutting bodies reach past the surface, mm.
const OVER: f64 = 1.0;

/// Size of a block, mm: width ≥ depth, and height.
struct Stock {
    w: f64,
    d: f64,
    h: f64,
}

impl Stock {
    fn draw(random: &mut Stream, height: [f64; 2]) -> Self {
        let w = random.log_range(60.0, 180.0);
        let d = w * random.range(0.5, 1.0);
        Stock { w, d, h: random.log_range(height[0], height[1]) }
    }

    /// The block, sometimes with rounded vertical edges.
    fn body(&self, random: &mut Stream) -> Solid {
        let outline = match random.chance(0.4) {
            true => Outline::rounded(self.w, self.d, random.range(2.0, 0.15 * self.d)),
            false => Outline::rectangle(self.w, self.d),
        };
        Solid::prism(&outline, 0.0, self.h)
    }

    /// Centre and size of the cells of an `nx` by `ny` grid that leaves walls of `wall` mm.
    fn cells(&self, nx: usize, ny: usize, wall: f64) -> (Vec<[f64; 2]>, [f64; 2]) {
        let pitch = [(self.w - wall) / nx as f64, (self.d - wall) / ny as f64];
        let place = |i: usize, n: usize, p: f64| (i as f64 - 0.5 * (n as f64 - 1.0)) * p;
        let centre = |k: usize| [place(k % nx, nx, pitch[0]), place(k / nx, ny, pitch[1])];
        ((0..nx * ny).map(centre).collect(), pitch.map(|p| p - wall))
    }
}

pub(super) fn pocket_block(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [20.0, 70.0]);
    let mut body = stock.body(random);
    let wall = random.log_range(3.0, 10.0);
    let (cells, [cw, cd]) = stock.cells(whole(random, 1, 3), whole(random, 1, 2), wall);
    for [x, y] in cells {
        match whole(random, 0, 5) {
            0 => body -= counterbore(random, 0.5 * cw.min(cd), stock.h).at(x, y, 0.0),
            1 => {
                body -= Solid::cylinder(random.range(0.2, 0.5) * cw.min(cd), -OVER, stock.h + OVER)
                    .at(x, y, 0.0)
            }
            _ => body -= pocket(random, cw, cd, stock.h).at(x, y, 0.0),
        }
    }
    body
}

/// A pocket to cut from a block of height `top`, sometimes with an island, a step or a hole.
fn pocket(random: &mut Stream, w: f64, d: f64, top: f64) -> Solid {
    let (w, d) = (w * random.range(0.7, 1.0), d * random.range(0.7, 1.0));
    let floor = top * random.range(0.1, 0.75);
    let radius = random.log_range(1.0, 0.5 * w.min(d));
    let cut = Solid::prism(&Outline::rounded(w, d, radius), floor, top + OVER);
    match whole(random, 0, 4) {
        0 => {
            let island = random.range(0.1, 0.28) * w.min(d);
            cut - Solid::cylinder(island, floor - OVER, top * random.range(0.8, 1.1))
        }
        1 => {
            let inner = Outline::rounded(0.7 * w, 0.7 * d, radius.min(0.35 * w.min(d)));
            cut + Solid::prism(&inner, 0.5 * floor, top)
        }
        2 => cut + Solid::cylinder(random.range(0.1, 0.35) * w.min(d), -OVER, top),
        3 => {
            let t = random.log_range(1.0, 0.12 * w);
            cut - Solid::block(
                [-0.5 * t, -d, floor - OVER],
                [0.5 * t, d, random.range(floor + 1.0, top)],
            )
        }
        _ => cut,
    }
}

/// A through hole with a wider mouth, within `room` mm of its axis.
pub(super) fn counterbore(random: &mut Stream, room: f64, top: f64) -> Solid {
    let outer = room * random.range(0.4, 0.9);
    let inner = outer * random.range(0.4, 0.75);
    let depth = top * random.range(0.15, 0.5);
    let hole = Solid::cylinder(inner, -OVER, top + OVER);
    match random.chance(0.3) {
        true => hole + Solid::cone(inner, outer, top - (outer - inner), top + 1e-3),
        false => hole + Solid::cylinder(outer, top - depth, top + OVER),
    }
}

pub(super) fn step_plate(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [15.0, 50.0]);
    let Stock { w, d, h } = stock;
    let mut body = stock.body(random);
    for side in [-1.0, 1.0] {
        let mut reach = 0.0;
        let mut floor = h;
        for _ in 0..whole(random, 0, 3) {
            reach += random.range(0.04, 0.13) * w;
            floor *= random.range(0.5, 0.85);
            let from = side * (0.5 * w - reach);
            let (x0, x1) = if side > 0.0 { (from, w) } else { (-w, from) };
            let y = if random.chance(0.7) { d } else { d * random.range(0.1, 0.3) };
            body -= Solid::block([x0, -y, floor], [x1, y, h + OVER]);
        }
    }
    let rows = whole(random, 1, 2);
    let (cells, [_, cd]) = stock.cells(4, rows, 4.0);
    for [x, y] in cells.into_iter().filter(|c| c[0].abs() < 0.25 * w) {
        if random.chance(0.7) {
            body -= counterbore(random, (0.08 * w).min(0.5 * cd), h).at(x, y, 0.0);
        }
    }
    if random.chance(0.5) {
        let width = random.log_range(2.0, 12.0);
        body -=
            Solid::block([-w, -0.5 * width, -OVER], [w, 0.5 * width, h * random.range(0.1, 0.25)]);
    }
    body
}

pub(super) fn fixture(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [12.0, 30.0]);
    let h = stock.h;
    let mut body = stock.body(random);
    let (nx, ny) = (whole(random, 3, 6), whole(random, 2, 4));
    let (cells, [cw, cd]) = stock.cells(nx, ny, 3.0);
    let hole = random.range(0.1, 0.25) * cw.min(cd);
    for (k, [x, y]) in cells.into_iter().enumerate() {
        let top = h + random.range(5.0, 40.0);
        let border = k % nx == 0 || k / nx == 0;
        match whole(random, 0, 4) {
            0 if border => {
                body += Solid::block(
                    [x - 0.5 * cw, y - 0.45 * cd, h - OVER],
                    [x + 0.2 * cw, y + 0.45 * cd, top],
                );
            }
            1 => body += Solid::cylinder(1.2 * hole, h - OVER, top).at(x, y, 0.0),
            2 => {
                body -=
                    Solid::cylinder(1.4 * hole, h * random.range(0.2, 0.6), h + OVER).at(x, y, 0.0)
            }
            _ => body -= Solid::cylinder(hole, -OVER, h + OVER).at(x, y, 0.0),
        }
    }
    body
}

pub(super) fn angled_slots(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [25.0, 80.0]);
    let Stock { w, d, h } = stock;
    let mut body = stock.body(random);
    let n = whole(random, 2, 5);
    let pitch = 0.9 * w / n as f64;
    let lean = random.range(-0.6, 0.6);
    for i in 0..n {
        let x = (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
        let width = random.log_range(1.5, (0.5 * pitch).max(2.0));
        let depth = random.range(0.3, 0.8) * h;
        let length = if random.chance(0.5) { 2.0 * d } else { random.range(0.4, 0.8) * d };
        let slot = match random.chance(0.5) {
            true => {
                Solid::block([-0.5 * width, -0.5 * length, -depth], [0.5 * width, 0.5 * length, h])
            }
            false => Solid::prism(&Outline::oblong(length, width).turned(1.5), -depth, h),
        };
        let lean = if random.chance(0.7) { lean } else { -0.3 * lean };
        body -= slot.about_y(lean).at(x, 0.0, h);
    }
    if random.chance(0.5) {
        let angle = random.range(0.2, 0.9);
        body -= Solid::block([0.0, -d, -h], [w, d, h]).about_y(-angle).at(0.45 * w, 0.0, 0.6 * h);
    }
    body
}

pub(super) fn lip_pocket(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [25.0, 80.0]);
    let mut body = stock.body(random);
    let wall = random.log_range(3.0, 8.0);
    let (cells, [cw, cd]) = stock.cells(whole(random, 1, 3), whole(random, 1, 2), wall);
    let lip = random.range(0.1, 0.3) * stock.h;
    let inset = random.range(0.08, 0.25) * cw.min(cd);
    for [x, y] in cells {
        let radius = random.log_range(1.0, 0.5 * cw.min(cd));
        let floor = stock.h * random.range(0.08, 0.5);
        let cavity = Solid::prism(&Outline::rounded(cw, cd, radius), floor, stock.h - lip);
        let (w, d) = (cw - 2.0 * inset, cd - 2.0 * inset);
        let mouth = match whole(random, 0, 2) {
            0 => Outline::circle(0.5 * w.min(d)),
            1 => Outline::rounded(w, cd + 0.0, radius.min(0.5 * w)).stretched(1.0, d / cd),
            _ => Outline::rounded(w, d, radius.min(0.49 * w.min(d))),
        };
        body -= (cavity + Solid::prism(&mouth, stock.h - lip - OVER, stock.h + OVER)).at(x, y, 0.0);
    }
    body
}

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
