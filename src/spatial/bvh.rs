//! A bounding volume hierarchy, eight boxes to a node, over points in a spatial order.
//!
//! It is built anew in every direction from rotated coordinates at about one operation per point.

use super::coordinates::{Coordinates, PADDING};

/// Children of a node.
pub const FAN_OUT: usize = 8;

/// Axis-aligned boxes, unbounded downward; arrays are padded with empty boxes to a multiple of [`PADDING`].
#[derive(Debug, Clone, Default)]
pub struct Aabbs {
    /// Least x, mm.
    pub x0: Vec<f32>,
    /// Greatest x, mm.
    pub x1: Vec<f32>,
    /// Least y, mm.
    pub y0: Vec<f32>,
    /// Greatest y, mm.
    pub y1: Vec<f32>,
    /// Greatest z, mm; −∞ for an empty box.
    pub top: Vec<f32>,
    /// Number of boxes without padding.
    pub n: usize,
}

impl Aabbs {
    /// `n` empty boxes.
    pub fn empty(n: usize) -> Self {
        let all = |value| vec![value; n.next_multiple_of(PADDING)];
        let (least, greatest) = (all(f32::INFINITY), all(f32::NEG_INFINITY));
        Aabbs {
            x0: least.clone(),
            x1: greatest.clone(),
            y0: least,
            y1: greatest.clone(),
            top: greatest,
            n,
        }
    }

    /// One box for every eight of x, x, y, y, z of points, or of the five arrays of boxes.
    fn enclose(&mut self, from: [&[f32]; 5]) {
        let [x0, x1, y0, y1, top] = from;
        for (from, to) in [(x0, &mut self.x0), (y0, &mut self.y0)] {
            reduce(from, to, |a, b| if b < a { b } else { a });
        }
        for (from, to) in [(x1, &mut self.x1), (y1, &mut self.y1), (top, &mut self.top)] {
            reduce(from, to, |a, b| if b > a { b } else { a });
        }
    }
}

fn reduce(from: &[f32], to: &mut [f32], pick: impl Fn(f32, f32) -> f32) {
    for (&[a, b, c, d, e, f, g, h], to) in from.as_chunks::<FAN_OUT>().0.iter().zip(to) {
        let (first, second) = (pick(pick(a, b), pick(c, d)), pick(pick(e, f), pick(g, h)));
        *to = pick(first, second);
    }
}

/// Points and the boxes around them.
#[derive(Debug, Clone)]
pub struct Bvh8 {
    /// The points, in a spatial order; padding must not enlarge the last box: at the last point's place, its height −∞.
    pub points: Coordinates,
    /// Boxes of 8, 64, 512, … points, up to the first level of at most eight.
    pub levels: Vec<Aabbs>,
}

impl Bvh8 {
    /// A tree for `n` points, to be filled.
    pub fn new(n: usize) -> Self {
        let mut levels = Vec::new();
        let mut count = n;
        while count > FAN_OUT || levels.is_empty() {
            count = count.div_ceil(FAN_OUT);
            levels.push(Aabbs::empty(count));
        }
        Bvh8 { points: Coordinates::zeros(n), levels }
    }

    /// Puts the boxes around the points.
    pub fn enclose(&mut self) {
        let (first, rest) = self.levels.split_first_mut().expect("a tree has a level of boxes");
        let Coordinates { x, y, z, .. } = &self.points;
        first.enclose([x, x, y, y, z]);
        let mut below: &Aabbs = first;
        for boxes in rest {
            boxes.enclose([&below.x0, &below.x1, &below.y0, &below.y1, &below.top]);
            below = boxes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn boxes_touch_their_points_on_every_side() {
        for n in [1, 8, 9, 64, 70, 600] {
            let mut stream = Stream::new(n as u64, 0, 0, Purpose::Probe);
            let mut tree = Bvh8::new(n);
            for i in 0..n {
                tree.points.set(i, [0; 3].map(|_| stream.range(-9.0, 9.0) as f32));
            }
            let [x, y, _] = tree.points.get(n - 1);
            tree.points.x[n..].fill(x);
            tree.points.y[n..].fill(y);
            tree.points.pad_z(f32::NEG_INFINITY);
            tree.enclose();
            for (level, boxes) in tree.levels.iter().enumerate() {
                let run = FAN_OUT.pow(level as u32 + 1);
                assert_eq!(boxes.n, n.div_ceil(run));
                for b in 0..boxes.n {
                    let inside = b * run..n.min((b + 1) * run);
                    let greatest = |axis: &[f32]| {
                        axis[inside.clone()].iter().copied().fold(f32::MIN, f32::max)
                    };
                    let least = |axis: &[f32]| {
                        axis[inside.clone()].iter().copied().fold(f32::MAX, f32::min)
                    };
                    let Coordinates { x, y, z, .. } = &tree.points;
                    let expected = [least(x), greatest(x), least(y), greatest(y), greatest(z)];
                    let found = [&boxes.x0, &boxes.x1, &boxes.y0, &boxes.y1, &boxes.top]
                        .map(|side| side[b]);
                    assert_eq!(found, expected, "box {b} of level {level} of {n}");
                }
            }
            assert!(tree.levels[tree.levels.len() - 1].n <= FAN_OUT);
        }
    }
}
