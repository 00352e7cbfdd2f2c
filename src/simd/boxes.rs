//! Boxes around runs of eight, sixty-four, … obstacles, built anew in every direction from the rotated
//! coordinates at a cost of about one operation per obstacle.

use super::collide::{Coordinates, PADDING, eights, eights_mut};
use super::level::{Kernel, Level, Simd};

/// Boxes across the direction, unbounded downward; arrays are padded with empty boxes to a multiple
/// of [`PADDING`].
#[derive(Debug, Clone, Default)]
pub struct Boxes {
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

impl Boxes {
    /// `n` empty boxes.
    pub fn empty(n: usize) -> Self {
        let all = |value| vec![value; n.next_multiple_of(PADDING)];
        let (least, greatest) = (all(f32::INFINITY), all(f32::NEG_INFINITY));
        Boxes {
            x0: least.clone(),
            x1: greatest.clone(),
            y0: least,
            y1: greatest.clone(),
            top: greatest,
            n,
        }
    }
}

/// Boxes around runs of eight points or boxes.
pub struct Enclose<'a> {
    /// What is enclosed: x, x, y, y, z of points, or the five arrays of boxes.
    pub from: [&'a [f32]; 5],
    /// One box for every eight of `from`.
    pub to: &'a mut Boxes,
}

impl Kernel for Enclose<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let [x0, x1, y0, y1, top] = self.from;
        let to = self.to;
        for (from, to) in [(x0, &mut to.x0), (y0, &mut to.y0)] {
            for (rows, to) in eights(from).as_chunks::<8>().0.iter().zip(eights_mut(to)) {
                s.store(s.least_of_each(load_rows(s, rows)), to);
            }
        }
        for (from, to) in [(x1, &mut to.x1), (y1, &mut to.y1), (top, &mut to.top)] {
            for (rows, to) in eights(from).as_chunks::<8>().0.iter().zip(eights_mut(to)) {
                s.store(s.greatest_of_each(load_rows(s, rows)), to);
            }
        }
    }
}

#[inline(always)]
fn load_rows<S: Simd>(s: S, rows: &[[f32; 8]; 8]) -> [S::Eight; 8] {
    let [a, b, c, d, e, f, g, h] = rows;
    [s.load(a), s.load(b), s.load(c), s.load(d), s.load(e), s.load(f), s.load(g), s.load(h)]
}

/// Obstacles in the direction's frame and the boxes around them.
#[derive(Debug, Clone)]
pub struct Tree {
    /// The obstacles, neighbours in space close together; padding at height −∞.
    pub points: Coordinates,
    /// Boxes of 8, 64, 512, … obstacles, up to the first level of at most eight.
    pub levels: Vec<Boxes>,
}

impl Tree {
    /// A tree for `n` obstacles, to be filled.
    pub fn new(n: usize) -> Self {
        let mut levels = Vec::new();
        let mut count = n;
        while count > 8 || levels.is_empty() {
            count = count.div_ceil(8);
            levels.push(Boxes::empty(count));
        }
        Tree { points: Coordinates::zeros(n), levels }
    }

    /// Puts the boxes around the points.
    pub fn enclose(&mut self, level: Level) {
        let (first, rest) = self.levels.split_first_mut().expect("a tree has a level of boxes");
        let Coordinates { x, y, z, .. } = &self.points;
        level.run(Enclose { from: [x, x, y, y, z], to: &mut *first });
        let mut below: &Boxes = first;
        for boxes in rest {
            let from = [&below.x0[..], &below.x1, &below.y0, &below.y1, &below.top];
            level.run(Enclose { from, to: &mut *boxes });
            below = boxes;
        }
    }
}
