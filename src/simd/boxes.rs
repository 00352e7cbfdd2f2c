//! Boxes around runs of eight, sixty-four, … obstacles, and the search among them.
//!
//! A box is built from the rotated `f32` coordinates themselves and compared with the predicate's own
//! operations in their own order. Rounding is monotone, so for every obstacle of a box
//! `near² ≤ r² ≤ far²` holds bit for bit: boxes decide without an epsilon and never wrongly.

use super::collide::{Coordinates, PADDING, StepSquared, eights, eights_mut, squared_distance};
use super::level::{Kernel, Simd};

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

    /// The greatest height of all obstacles; −∞ if there are none.
    pub fn highest(&self) -> f32 {
        let tops = self.levels.last().map_or(&[][..], |level| &level.top);
        tops.iter().fold(f32::NEG_INFINITY, |a, &b| if b > a { b } else { a })
    }
}

/// Sets the bit of every query at which some obstacle collides.
pub struct Search<'a> {
    /// Reference points in the direction's frame.
    pub centres: &'a Coordinates,
    /// The cutter; only the last step may be infinitely wide.
    pub steps: &'a [StepSquared],
    /// Obstacles.
    pub tree: &'a Tree,
    /// Height of the obstacle that is the query itself, −∞ for none; as long as the centres.
    pub own_z: &'a [f32],
    /// Bits of the queries, zeroed.
    pub row: &'a mut [u64],
    /// Receives the queries whose own obstacle is high enough to matter; their bits stay 0.
    pub undecided: &'a mut Vec<u32>,
}

/// How queries were decided.
#[derive(Debug, Clone, Copy, Default)]
pub struct Searched {
    /// By the greatest height alone.
    pub by_height: u64,
    /// By boxes.
    pub by_box: u64,
    /// Obstacles tested for the others.
    pub tested: u64,
}

impl Kernel for Search<'_> {
    type Output = Searched;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Searched {
        let mut done = Searched::default();
        let spindle = self.steps.last().filter(|step| step.radius_squared == f32::INFINITY);
        let finite = &self.steps[..self.steps.len() - usize::from(spindle.is_some())];
        let highest = s.splat(self.tree.highest());
        let first = s.splat(self.steps[0].height);
        let mut stack = [(0, 0); STACK];
        let mut struck = 0;
        let blocks = eights(&self.centres.z).iter().zip(eights(self.own_z)).enumerate();
        for (block, (z, own_z)) in blocks.take(self.centres.n.div_ceil(8)) {
            let z = s.load(z);
            let valid = !0u32 >> (24 + (8 * block + 8).saturating_sub(self.centres.n));
            let contact = s.add(z, first);
            let own = s.greater(s.load(own_z), contact) & valid;
            let reached = s.greater(highest, contact) & valid;
            let hit = spindle.map_or(0, |step| s.greater(highest, s.add(z, s.splat(step.height))));
            let hit = hit & valid & !own;
            let mut open = reached & !hit & !own;
            done.by_height += u64::from((valid & !own & !open).count_ones());
            let mut bits = hit;
            while open != 0 {
                let lane = open.trailing_zeros() as usize;
                open &= open - 1;
                let centre = self.centres.get(8 * block + lane);
                // What stood in a neighbour's way often stands in this one's.
                done.tested += 8;
                if strikes(s, centre, finite, &self.tree.points, struck) {
                    bits |= 1 << lane;
                    continue;
                }
                let tested = done.tested;
                if let Some(group) =
                    descend(s, centre, finite, self.tree, &mut stack, &mut done.tested)
                {
                    bits |= 1 << lane;
                    struck = group.unwrap_or(struck);
                }
                done.by_box += u64::from(tested == done.tested);
            }
            self.row[block / 8] |= u64::from(bits) << (8 * (block % 8));
            let mut own = own;
            while own != 0 {
                self.undecided.push(8 * block as u32 + own.trailing_zeros());
                own &= own - 1;
            }
        }
        done
    }
}

/// Most groups that can wait: seven per level and no tree has more than eleven levels.
const STACK: usize = 96;

/// Does some obstacle of this group of eight collide with the cutter at `centre`?
#[inline(always)]
fn strikes<S: Simd>(
    s: S,
    [cx, cy, cz]: [f32; 3],
    steps: &[StepSquared],
    points: &Coordinates,
    group: usize,
) -> bool {
    let (x, y) = (&eights(&points.x)[group], &eights(&points.y)[group]);
    let squared = squared_distance(s, s.splat(cx), s.splat(cy), x, y);
    let z = s.load(&eights(&points.z)[group]);
    for step in steps {
        let (above, within) = (s.splat(cz + step.height), s.splat(step.radius_squared));
        if s.greater_and_at_most(z, above, squared, within) != 0 {
            return true;
        }
    }
    false
}

/// Does some obstacle collide with the cutter at `centre`? If so, which group of eight was found to do so,
/// if it was one.
#[inline(always)]
fn descend<S: Simd>(
    s: S,
    centre: [f32; 3],
    steps: &[StepSquared],
    tree: &Tree,
    stack: &mut [(u32, u32); STACK],
    tested: &mut u64,
) -> Option<Option<usize>> {
    let [cx, cy, cz] = centre;
    let (cx, cy) = (s.splat(cx), s.splat(cy));
    let zero = s.splat(0.0);
    stack[0] = (tree.levels.len() as u32, 0);
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let (level, group) = stack[depth];
        let group = group as usize;
        if level == 0 {
            *tested += 8;
            if strikes(s, centre, steps, &tree.points, group) {
                return Some(Some(group));
            }
            continue;
        }
        let boxes = &tree.levels[level as usize - 1];
        let (near, far) = distances(s, cx, cy, zero, boxes, group);
        let top = s.load(&eights(&boxes.top)[group]);
        let mut open = 0;
        for step in steps {
            let (above, within) = (s.splat(cz + step.height), s.splat(step.radius_squared));
            if s.greater_and_at_most(top, above, far, within) != 0 {
                return Some(None);
            }
            open |= s.greater_and_at_most(top, above, near, within);
        }
        while open != 0 {
            let child = 8 * group as u32 + open.trailing_zeros();
            open &= open - 1;
            stack[depth] = (level - 1, child);
            depth += 1;
        }
    }
    None
}

/// Squared distances across the direction from a point to the nearest and farthest place of eight
/// boxes.
#[inline(always)]
fn distances<S: Simd>(
    s: S,
    cx: S::Eight,
    cy: S::Eight,
    zero: S::Eight,
    boxes: &Boxes,
    group: usize,
) -> (S::Eight, S::Eight) {
    let least_x = s.load(&eights(&boxes.x0)[group]);
    let least_y = s.load(&eights(&boxes.y0)[group]);
    let greatest_x = s.load(&eights(&boxes.x1)[group]);
    let greatest_y = s.load(&eights(&boxes.y1)[group]);
    let (near_x, far_x) = near_and_far(s, cx, least_x, greatest_x, zero);
    let (near_y, far_y) = near_and_far(s, cy, least_y, greatest_y, zero);
    (s.add(near_x, near_y), s.add(far_x, far_y))
}

/// Squared distances from `c` to the nearest and farthest place of an interval.
#[inline(always)]
fn near_and_far<S: Simd>(
    s: S,
    c: S::Eight,
    least: S::Eight,
    greatest: S::Eight,
    zero: S::Eight,
) -> (S::Eight, S::Eight) {
    let (past_least, to_greatest) = (s.sub(c, least), s.sub(greatest, c));
    let near = s.min(zero, s.min(past_least, to_greatest));
    let far = s.max(past_least, to_greatest);
    (s.mul(near, near), s.mul(far, far))
}
