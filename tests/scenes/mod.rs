//! Scenes, cutters and directions of the labeler's tests.
#![allow(dead_code)] // Each test file uses some of it.

use deepmill::cutter::{Cutter, CutterSet};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::Sites;
use deepmill::rng::{Purpose, Stream};
use glam::Vec3;

pub fn sites(points: Vec<Vec3>, normals: Vec<Vec3>) -> Sites {
    Sites { points, normals, faces: vec![] }
}

/// A sphere and a deep tube: most of the tube's inside is out of reach.
pub fn solids(n: usize) -> Sites {
    let spiral = Directions::new(DirectionSet::FibonacciSphere { n_dirs: n }).unwrap();
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for (k, &d) in spiral.vectors().iter().enumerate() {
        if k % 2 == 0 {
            points.push(Vec3::new(40.0, 0.0, 0.0) + 15.0 * d);
            normals.push(d);
        } else {
            let out = Vec3::new(d.x, d.y, 0.0).normalize();
            points.push(6.0 * out + Vec3::Z * 30.0 * d.z);
            normals.push(-out);
        }
    }
    sites(points, normals)
}

pub fn cutters(n: usize, seed: u64) -> Vec<Cutter> {
    let mut stream = Stream::new(seed, 0, 0, Purpose::Cutter);
    let draw = |i: usize| CutterSet::PUBLISHED[i % 4].draw(&mut stream);
    (0..n).map(draw).map(|params| Cutter::ball_end(params).unwrap()).collect()
}

pub fn hemisphere(n_dirs: usize) -> Directions {
    Directions::fibonacci_hemisphere(n_dirs).unwrap()
}
