//! Milled blocks: pockets, steps, slots and undercuts.

use super::outline::Outline;
use super::solid::Solid;
use super::whole;
use crate::numeric::rng::Stream;

/// How far cutting bodies reach past the surface, mm.
pub(super) const OVER: f64 = 1.0;

/// Size of a block, mm: width ≥ depth, and height.
pub(super) struct Stock {
    pub w: f64,
    pub d: f64,
    pub h: f64,
}

impl Stock {
    pub fn draw(random: &mut Stream, height: [f64; 2]) -> Self {
        let w = random.log_range(60.0, 180.0);
        let d = w * random.range(0.5, 1.0);
        Stock { w, d, h: random.log_range(height[0], height[1]) }
    }

    /// The block, sometimes with rounded vertical edges.
    pub fn body(&self, random: &mut Stream) -> Solid {
        let outline = match random.chance(0.4) {
            true => Outline::rounded(self.w, self.d, random.range(2.0, 0.15 * self.d)),
            false => Outline::rectangle(self.w, self.d),
        };
        Solid::prism(&outline, 0.0, self.h)
    }

    /// Center and size of the cells of an `nx` by `ny` grid that leaves walls of `wall` mm.
    pub fn cells(&self, nx: usize, ny: usize, wall: f64) -> (Vec<[f64; 2]>, [f64; 2]) {
        let pitch = [(self.w - wall) / nx as f64, (self.d - wall) / ny as f64];
        let place = |i: usize, n: usize, p: f64| (i as f64 - 0.5 * (n as f64 - 1.0)) * p;
        let center = |k: usize| [place(k % nx, nx, pitch[0]), place(k / nx, ny, pitch[1])];
        ((0..nx * ny).map(center).collect(), pitch.map(|p| p - wall))
    }
}

pub(super) fn pocket_block(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [20.0, 70.0]);
    let mut body = stock.body(random);
    let wall = random.log_range(3.0, 10.0);
    let (cells, [cw, cd]) = stock.cells(whole(random, 1, 3), whole(random, 1, 2), wall);
    for (k, [x, y]) in cells.into_iter().enumerate() {
        match if k == 0 { 2 } else { whole(random, 0, 5) } {
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
