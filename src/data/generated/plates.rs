//! Plates and blocks cut many times: panels, terraces, mazes, fins, windows.

use super::blocks::{OVER, Stock};
use super::outline::{Outline, polar};
use super::solid::Solid;
use super::whole;
use crate::numeric::rng::Stream;
use glam::DVec2;
use std::f64::consts::TAU;

pub(super) fn grid_panel(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [8.0, 45.0]);
    let h = stock.h;
    let mut body = stock.body(random);
    let rib = random.log_range(0.8, 5.0);
    let floor = (h * random.range(0.05, 0.4)).max(1.0);
    let flange = if random.chance(0.3) { random.range(0.08, 0.2) * h } else { 0.0 };
    let (nx, ny) = (whole(random, 2, 5), whole(random, 1, 4));
    let (cells, [w, d]) = stock.cells(nx, ny, rib);
    let radius = random.log_range(0.5, 0.4 * w.min(d));
    let inset = if flange > 0.0 { random.range(0.1, 0.25) * w.min(d) } else { 0.0 };
    for [x, y] in cells {
        if random.chance(0.1) {
            continue;
        }
        let pocket = Solid::prism(&Outline::rounded(w, d, radius), floor, h - flange);
        let (mw, md) = (w - 2.0 * inset, d - 2.0 * inset);
        let mouth = Outline::rounded(mw, md, radius.min(0.4 * mw.min(md)));
        let mut cut = pocket + Solid::prism(&mouth, 0.5 * (floor + h), h + OVER);
        if random.chance(0.15) {
            cut += Solid::cylinder(0.3 * w.min(d), -OVER, h);
        }
        body -= cut.at(x, y, 0.0);
    }
    body
}

pub(super) fn terraces(random: &mut Stream) -> Solid {
    let radius = random.log_range(35.0, 100.0);
    let n_steps = whole(random, 3, 7);
    let rise = radius * random.log_range(0.06, 0.25);
    let lobes = whole(random, 2, 5) as f64;
    let depth = random.range(0.05, 0.25);
    let phase = random.range(0.0, TAU);
    let shape = |size: f64, shift: f64| {
        Outline::round(72, |a| size * (1.0 + depth * libm::cos(lobes * a + phase + shift)))
    };
    let sunk = random.chance(0.4);
    let total = rise * n_steps as f64;
    let side = 2.0 * radius * (1.08 + depth);
    let mut body = match sunk {
        true => Solid::prism(&Outline::rectangle(side, side), 0.0, total + random.range(3.0, 10.0)),
        false => Solid::prism(&Outline::rounded(side, side, 6.0), -random.range(4.0, 12.0), 0.5),
    };
    let mut size = radius;
    for k in 0..n_steps {
        let outline = shape(size, 0.15 * k as f64);
        let low = rise * k as f64;
        match sunk {
            true => body -= Solid::prism(&outline, total - low, 2.0 * total + 20.0),
            false => body += Solid::prism(&outline, low - 0.5, low + rise),
        }
        size *= random.range(0.72, 0.9);
    }
    if random.chance(0.4) {
        body -= Solid::cylinder(0.4 * size, -30.0, 2.0 * total + 30.0);
    }
    body
}

pub(super) fn maze(random: &mut Stream) -> Solid {
    let (nx, ny) = (whole(random, 3, 6), whole(random, 3, 5));
    let pitch = random.log_range(12.0, 28.0);
    let channel = 0.5 * pitch * random.range(0.35, 0.75);
    let (w, d) = (nx as f64 * pitch, ny as f64 * pitch);
    let h = random.log_range(12.0, 45.0);
    let floor = random.range(0.1, 0.5) * h;
    let center = |c: usize| {
        DVec2::new((c % nx) as f64 + 0.5, (c / nx) as f64 + 0.5) * pitch - 0.5 * DVec2::new(w, d)
    };
    let mut channels = Solid::block([0.0; 3], [0.0; 3]);
    for (a, b) in spanning_tree(random, nx, ny) {
        let path = [center(a), center(b)];
        let (low, high) = (path[0].min(path[1]) - channel, path[0].max(path[1]) + channel);
        channels += Solid::block([low.x, low.y, floor], [high.x, high.y, h + OVER]);
    }
    let mut body = Solid::block([-0.5 * w, -0.5 * d, 0.0], [0.5 * w, 0.5 * d, h]);
    if random.chance(0.5) {
        let lid = random.range(-0.2, 0.3) * w;
        let roof = h - random.range(0.1, 0.25) * h;
        channels -= Solid::block([lid, -d, roof], [w, d, h + 2.0 * OVER]);
    }
    body -= channels;
    body - Solid::block(
        [-w, -0.5 * d + 0.2 * pitch, floor],
        [0.2 * pitch - 0.5 * w, 0.6 * pitch - 0.5 * d, h + OVER],
    )
}

/// Pairs of neighboring cells of an `nx` by `ny` grid that join all of them without a loop.
fn spanning_tree(random: &mut Stream, nx: usize, ny: usize) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for c in 0..nx * ny {
        if c % nx + 1 < nx {
            pairs.push((c, c + 1));
        }
        if c / nx + 1 < ny {
            pairs.push((c, c + nx));
        }
    }
    random.shuffle(&mut pairs);
    let mut group: Vec<usize> = (0..nx * ny).collect();
    pairs.retain(|&(a, b)| {
        let (keep, old) = (group[a], group[b]);
        group.iter_mut().filter(|g| **g == old).for_each(|g| *g = keep);
        keep != old
    });
    pairs
}

pub(super) fn heat_sink(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [15.0, 60.0]);
    let Stock { w, d, h } = stock;
    let base = random.range(0.1, 0.3) * h;
    let fin = random.log_range(0.9, 4.0);
    let gap = random.log_range(1.5, 9.0).max(w / 30.0 - fin);
    let n = ((w - fin) / (fin + gap)) as usize;
    let pitch = (w - fin) / n as f64;
    let mut grooves = Vec::new();
    for i in 0..n {
        let x = fin + i as f64 * pitch - 0.5 * w;
        grooves.push(Solid::block([x, -d, base], [x + pitch - fin, d, h + OVER]));
    }
    let mut body = stock.body(random);
    for groove in grooves {
        body -= groove;
    }
    for _ in 0..whole(random, 0, 4) {
        let width = random.range(1.0, 3.0) * gap;
        let y = random.range(-0.4, 0.4) * d;
        body -= Solid::block([-w, y, base], [w, y + width, h + OVER]);
    }
    body
}

pub(super) fn lattice(random: &mut Stream) -> Solid {
    let n = [0; 3].map(|_| whole(random, 1, 3));
    let pitch = random.log_range(18.0, 45.0);
    let strut = pitch * random.range(0.18, 0.35);
    let size = n.map(|n| n as f64 * pitch + strut);
    let half = size.map(|s| 0.5 * s);
    let mut body = Solid::block(half.map(|h| -h), half);
    let round = random.chance(0.4);
    let fillet = random.log_range(0.5, 4.0);
    let open = pitch - strut;
    let place = |i: usize, n: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
    for (axis, reach) in size.into_iter().enumerate() {
        if axis > 0 && random.chance(0.25) {
            continue;
        }
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let window = match round {
            true => Outline::circle(0.5 * open),
            false => Outline::rounded(open, open, fillet),
        };
        for k in 0..n[u] * n[v] {
            let (x, y) = (place(k % n[u], n[u]), place(k / n[u], n[v]));
            let cut = Solid::prism(&window.clone().at(x, y), -reach, reach);
            body -= match axis {
                0 => cut.along_x(),
                1 => cut.along_y(),
                _ => cut,
            };
        }
    }
    body
}

pub(super) fn manifold(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [35.0, 80.0]);
    let Stock { w, d, h } = stock;
    let mut body = stock.body(random);
    let bore = random.range(0.06, 0.14) * h.min(d);
    let port = bore * random.range(1.3, 1.9);
    let n = whole(random, 2, 5);
    let level = random.range(0.35, 0.65) * h;
    body -= Solid::cylinder(1.2 * bore, -0.5 * w - OVER, random.range(0.2, 0.6) * w)
        .along_x()
        .at(0.0, 0.0, level);
    for i in 0..n {
        let x = (i as f64 - 0.5 * (n as f64 - 1.0)) * 0.8 * w / n as f64;
        body -= match whole(random, 0, 2) {
            0 => {
                Solid::cylinder(bore, level, h + OVER).at(x, 0.0, 0.0)
                    + Solid::cylinder(port, h - random.range(0.1, 0.25) * h, h + OVER)
                        .at(x, 0.0, 0.0)
            }
            1 => Solid::cylinder(bore, 0.0, d).along_y().at(x, 0.0, level),
            _ => Solid::cylinder(0.8 * bore, -d, 0.1).along_y().at(x, 0.0, level),
        };
    }
    for corner in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        let hole = Solid::cylinder(0.5 * bore + 1.0, -OVER, h + OVER);
        body -= hole.at(corner[0] * 0.43 * w, corner[1] * 0.4 * d, 0.0);
    }
    body
}

pub(super) fn cylinder_block(random: &mut Stream) -> Solid {
    let n = whole(random, 1, 4);
    let bore = random.log_range(12.0, 26.0);
    let liner = random.range(2.5, 6.0);
    let jacket = random.log_range(1.8, 6.0);
    let wall = random.range(4.0, 9.0);
    let reach = bore + liner + jacket;
    let pitch = 2.0 * (bore + liner) + 0.8 * jacket;
    let (w, d) = ((n - 1) as f64 * pitch + 2.0 * (reach + wall), 2.0 * (reach + wall));
    let h = random.range(1.4, 3.5) * bore;
    let floor = random.range(0.1, 0.5) * h;
    let mut body = Solid::prism(&Outline::rounded(w, d, 0.6 * wall), 0.0, h);
    let xs: Vec<f64> = (0..n).map(|i| (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch).collect();
    let mut water = Solid::cylinder(reach, floor, h + OVER).at(xs[0], 0.0, 0.0);
    for &x in &xs[1..] {
        water += Solid::cylinder(reach, floor, h + OVER).at(x, 0.0, 0.0);
    }
    for &x in &xs {
        water -= Solid::cylinder(bore + liner, 0.0, h + 2.0 * OVER).at(x, 0.0, 0.0);
    }
    body -= water;
    for &x in &xs {
        body -= Solid::cylinder(bore, -OVER, h + OVER).at(x, 0.0, 0.0);
    }
    for [sx, sy] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        let inset = 0.5 * wall + 0.15 * bore;
        let hole =
            Solid::cylinder(random.range(0.25, 0.42) * wall, h * random.range(0.0, 0.5), h + OVER);
        body -= hole.at(sx * (0.5 * w - inset), sy * (0.5 * d - inset), 0.0);
    }
    body
}

pub(super) fn engraved(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [6.0, 25.0]);
    let h = stock.h;
    let mut body = stock.body(random);
    let (cells, [cw, cd]) = stock.cells(whole(random, 2, 5), whole(random, 1, 2), 6.0);
    let half = random.log_range(0.4, (0.06 * cw.min(cd)).max(0.5));
    let depth = random.range(0.15, 0.6) * h;
    let proud = random.chance(0.35);
    for [x, y] in cells {
        for path in glyph(random) {
            let place = |p: &[f64; 2]| DVec2::new(p[0] * 0.35 * cw + x, p[1] * 0.4 * cd + y);
            let path: Vec<DVec2> = path.iter().map(place).collect();
            let stroke = Outline::stroke(&path, half);
            match proud {
                true => body += Solid::prism(&stroke, h - OVER, h + depth),
                false => body -= Solid::prism(&stroke, h - depth, h + OVER),
            }
        }
    }
    body
}

/// Strokes of a letter-like sign in the square −1…1.
fn glyph(random: &mut Stream) -> Vec<Vec<[f64; 2]>> {
    let arc = |from: f64, to: f64| -> Vec<[f64; 2]> {
        let angle = |i: i32| from + (to - from) * f64::from(i) / 16.0;
        (0..=16).map(|i| (0.85 * polar(1.0, angle(i))).to_array()).collect()
    };
    match whole(random, 0, 6) {
        0 => vec![vec![[-1.0, -1.0], [0.0, 1.0], [1.0, -1.0]], vec![[-0.6, -0.3], [0.6, -0.3]]],
        1 => vec![arc(0.7, TAU - 0.7)],
        2 => vec![vec![[-0.8, 1.0], [-0.8, -1.0], [0.8, -1.0]]],
        3 => vec![vec![[-0.9, -1.0], [-0.9, 1.0], [0.9, -1.0], [0.9, 1.0]]],
        4 => vec![vec![[-1.0, 0.9], [1.0, 0.9]], vec![[0.0, 1.0], [0.0, -1.0]]],
        5 => vec![vec![[-0.8, 0.9], [0.8, 0.9], [-0.8, -0.9], [0.8, -0.9]]],
        _ => vec![arc(0.4, TAU - 0.2), vec![[0.2, -0.2], [1.0, -1.0]]],
    }
}
