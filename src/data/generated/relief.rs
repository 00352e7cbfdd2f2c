//! Blocks with a curved top, molds, and smooth lumps.

use super::blocks::{OVER, Stock, counterbore};
use super::outline::{Outline, polar};
use super::solid::Solid;
use super::whole;
use crate::geom::Mesh;
use crate::numeric::rng::Stream;
use glam::DVec3;
use std::f64::consts::TAU;

/// A sum of a few waves in space, between −1 and 1.
struct Waves(Vec<(DVec3, f64)>);

impl Waves {
    /// `n` waves of at most `most` radians per unit of length.
    fn draw(random: &mut Stream, n: usize, most: f64) -> Self {
        let wave = |_| {
            let push = DVec3::new(random.normal(), random.normal(), random.normal());
            (push.normalize_or_zero() * random.range(0.3 * most, most), random.range(0.0, TAU))
        };
        Waves((0..n).map(wave).collect())
    }

    fn at(&self, p: DVec3) -> f64 {
        let sum: f64 = self.0.iter().map(|(k, phase)| libm::sin(k.dot(p) + phase)).sum();
        sum / self.0.len() as f64
    }
}

/// The body over the rectangle `w` by `d` from z = 0 up to `height(x, y)`, which is sampled at
/// `n + 1` places each way.
fn relief(w: f64, d: f64, n: usize, height: impl Fn(f64, f64) -> f64) -> Solid {
    let place = |i: usize, size: f64| size * (i as f64 / n as f64 - 0.5);
    let mut mesh = Mesh::default();
    for layer in 0..2 {
        for k in 0..(n + 1) * (n + 1) {
            let (x, y) = (place(k % (n + 1), w), place(k / (n + 1), d));
            let z = if layer == 0 { 0.0 } else { height(x, y) };
            mesh.vertices.push(DVec3::new(x, y, z));
        }
    }
    let index = |i: usize, j: usize, layer: usize| ((layer * (n + 1) + j) * (n + 1) + i) as u32;
    let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for i in 0..n {
        for j in 0..n {
            quad([index(i, j, 1), index(i + 1, j, 1), index(i + 1, j + 1, 1), index(i, j + 1, 1)]);
            quad([index(i, j, 0), index(i, j + 1, 0), index(i + 1, j + 1, 0), index(i + 1, j, 0)]);
        }
        quad([index(i, 0, 0), index(i + 1, 0, 0), index(i + 1, 0, 1), index(i, 0, 1)]);
        quad([index(i + 1, n, 0), index(i, n, 0), index(i, n, 1), index(i + 1, n, 1)]);
        quad([index(0, i + 1, 0), index(0, i, 0), index(0, i, 1), index(0, i + 1, 1)]);
        quad([index(n, i, 0), index(n, i + 1, 0), index(n, i + 1, 1), index(n, i, 1)]);
    }
    Solid::from_mesh(&mesh)
}

pub(super) fn dome_block(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [25.0, 70.0]);
    let Stock { w, d, h } = stock;
    let n_waves = whole(random, 1, 4);
    let waves = Waves::draw(random, n_waves, 3.5);
    let swing = random.range(0.15, 0.4) * h;
    let dome = random.range(-0.3, 0.6) * h;
    let mut body = relief(w, d, 40, |x, y| {
        let (u, v) = (2.0 * x / w, 2.0 * y / d);
        let round = (1.0 - u * u) * (1.0 - v * v);
        0.6 * h + dome * round + 0.6 * swing * waves.at(DVec3::new(u, v, 0.0))
    });
    for _ in 0..whole(random, 0, 3) {
        let (x, y) = (random.range(-0.32, 0.32) * w, random.range(-0.32, 0.32) * d);
        body -= match whole(random, 0, 2) {
            0 => Solid::cylinder(random.range(0.04, 0.1) * d, -OVER, 3.0 * h),
            1 => {
                let (a, b) = (random.range(0.1, 0.3) * w, random.range(0.1, 0.3) * d);
                let pocket = Outline::rounded(a, b, random.range(0.1, 0.45) * a.min(b));
                Solid::prism(&pocket, random.range(0.1, 0.4) * h, 3.0 * h)
            }
            _ => {
                let slot = Outline::oblong(0.4 * w, random.log_range(2.0, 10.0));
                Solid::prism(
                    &slot.turned(random.range(0.0, 3.0)),
                    random.range(0.1, 0.4) * h,
                    3.0 * h,
                )
            }
        }
        .at(x, y, 0.0);
    }
    body
}

/// A ball of `radius` pushed in and out along its rays by `swing` of the radius.
fn lump(random: &mut Stream, radius: f64, swing: f64, most: f64) -> Solid {
    let waves = Waves::draw(random, 4, most);
    Solid::ball(radius).bent(|p| p * (1.0 + swing * waves.at(p / radius)))
}

pub(super) fn lump_with_cuts(random: &mut Stream) -> Solid {
    let radius = random.log_range(25.0, 80.0);
    let swing = random.range(0.25, 0.6);
    let [a, b, c] = [0; 3].map(|_| random.range(0.55, 1.2));
    let mut body = lump(random, radius, swing, 4.5).bent(|p| p * DVec3::new(a, b, c));
    if random.chance(0.6) {
        let floor = -c * radius * random.range(0.2, 0.6);
        body -= Solid::block(
            [-3.0 * radius, -3.0 * radius, -3.0 * radius],
            [3.0 * radius, 3.0 * radius, floor],
        );
    }
    for _ in 0..whole(random, 1, 4) {
        let (u, v) = (random.range(-0.4, 0.4) * radius, random.range(-0.4, 0.4) * radius);
        let cut = match random.chance(0.5) {
            true => Solid::cylinder(radius * random.range(0.08, 0.3), -0.4 * radius, 3.0 * radius),
            false => {
                let side = radius * random.range(0.2, 0.6);
                Solid::prism(&Outline::rounded(side, 0.7 * side, 0.2 * side), 0.0, 3.0 * radius)
            }
        };
        body -= match whole(random, 0, 2) {
            0 => cut.at(u, v, 0.0),
            1 => cut.along_x().at(0.0, u, v),
            _ => cut.along_y().at(u, 0.0, v),
        };
    }
    body
}

pub(super) fn mold(random: &mut Stream) -> Solid {
    let stock = Stock::draw(random, [25.0, 60.0]);
    let Stock { w, d, h } = stock;
    let mut body = stock.body(random);
    let depth = h * random.range(0.4, 0.8);
    let reach = 0.36 * d;
    let stretch = [0.34 * w / reach, 1.0, depth / reach];
    let swing = random.range(0.0, 0.2);
    let cavity = match whole(random, 0, 2) {
        0 => lump(random, reach, swing, 3.0).bent(|p| p * DVec3::from_array(stretch)),
        1 => {
            let star = Outline::round(80, |a| reach * (1.0 + swing * libm::cos(5.0 * a)));
            let draft = random.range(0.5, 0.95);
            Solid::divided(&star, -depth, OVER, 1).bent(|p| {
                let t = (p.z + depth) / (depth + OVER);
                (p.truncate() * (draft + (1.0 - draft) * t)).extend(p.z)
            })
        }
        _ => {
            let tub = Outline::rounded(0.7 * w, 0.7 * d, random.range(0.05, 0.3) * d);
            let core = Outline::rounded(0.4 * w, 0.35 * d, random.range(0.05, 0.15) * d);
            let lift = depth * random.range(0.3, 0.9);
            Solid::prism(&tub, -depth, OVER) - Solid::prism(&core, -2.0 * depth, lift - depth)
        }
    };
    body -= cavity.at(0.0, 0.0, h);
    let pin = 0.04 * d;
    for [x, y] in [[-0.43, -0.42], [0.43, 0.42], [-0.43, 0.42], [0.43, -0.42]] {
        let proud = random.chance(0.5);
        let (x, y) = (x * w, y * d);
        match proud {
            true => body += Solid::cylinder(0.6 * pin, h - OVER, 1.2 * h).at(x, y, 0.0),
            false => body -= Solid::cylinder(0.6 * pin, 0.5 * h, h + OVER).at(x, y, 0.0),
        }
    }
    let gate = 0.04 * d;
    body -= Solid::cylinder(gate, 0.0, w).along_x().at(0.0, 0.0, h);
    if random.chance(0.4) {
        body -= counterbore(random, 0.1 * d, h);
    }
    body
}

pub(super) fn superquadric(random: &mut Stream) -> Solid {
    let size = [0; 3].map(|_| random.log_range(18.0, 70.0));
    let [east, north] = [0; 2].map(|_| random.range(0.3, 1.3));
    let power = |v: f64, e: f64| v.signum() * libm::pow(v.abs(), e);
    let body = Solid::ball(60.0).bent(|p| {
        let flat = libm::hypot(p.x, p.y) / 60.0;
        let unit = if flat > 1e-9 { p.truncate() / (60.0 * flat) } else { p.truncate() * 0.0 };
        let ring = power(flat.min(1.0), north);
        let z = power((p.z / 60.0).clamp(-1.0, 1.0), north);
        DVec3::new(ring * power(unit.x, east), ring * power(unit.y, east), z)
            * DVec3::from_array(size)
    });
    let least = size.into_iter().fold(f64::INFINITY, f64::min);
    let mut body = body;
    for k in 0..whole(random, 0, 3) {
        let place = polar(0.35 * least, 2.1 * k as f64);
        let radius = least * random.range(0.08, 0.22);
        let floor =
            if random.chance(0.5) { -2.0 * size[2] } else { size[2] * random.range(-0.6, 0.3) };
        body -= Solid::cylinder(radius, floor, 2.0 * size[2]).at(place.x, place.y, 0.0);
    }
    body
}
