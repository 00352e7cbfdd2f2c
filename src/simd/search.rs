//! The search for labels: queries that the greatest height leaves open descend the boxes together.
//!
//! Neighbours in the spatial order ask the same boxes. A crowd of up to 64 open queries goes down the
//! boxes as one, box against box, and collects those that may matter to some of it: its front. Packets of
//! eight queries then look at the front, eight boxes at once against the box around the packet; a box that
//! may matter is compared with the eight queries, and those that it concerns go on. All comparisons use the
//! predicate's own operations, and rounding is monotone: for every query and every obstacle of two boxes
//! `near² ≤ r² ≤ far²` holds bit for bit, as in [`boxes`](super::boxes).

use super::boxes::Tree;
use super::collide::{Coordinates, StepSquared, eights, squared_distance};
use super::level::{Kernel, Simd};

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
        let spindle = self.steps.last().filter(|step| step.radius_squared == f32::INFINITY);
        let steps = &self.steps[..self.steps.len() - usize::from(spindle.is_some())];
        let mut descent = Descent {
            steps,
            tree: self.tree,
            front: Front::default(),
            struck: 0,
            blocking: (0, 0),
            done: Searched::default(),
        };
        let highest = s.splat(self.tree.highest());
        let first = s.splat(self.steps[0].height);
        let mut crowd = Crowd::default();
        let blocks = eights(&self.centres.z).iter().zip(eights(self.own_z)).enumerate();
        for (block, (z, own_z)) in blocks.take(self.centres.n.div_ceil(8)) {
            let z = s.load(z);
            let valid = !0u32 >> (24 + (8 * block + 8).saturating_sub(self.centres.n));
            let contact = s.add(z, first);
            let own = s.greater(s.load(own_z), contact) & valid;
            let reached = s.greater(highest, contact) & valid;
            let hit = spindle.map_or(0, |step| s.greater(highest, s.add(z, s.splat(step.height))));
            let hit = hit & valid & !own;
            let open = reached & !hit & !own;
            descent.done.by_height += u64::from((valid & !own & !open).count_ones());
            self.row[block / 8] |= u64::from(hit) << (8 * (block % 8));
            for lane in ones(own) {
                self.undecided.push((8 * block + lane) as u32);
            }
            for lane in ones(open) {
                crowd.push(8 * block + lane, self.centres);
                if crowd.n == CROWD {
                    descent.answer(s, &mut crowd, self.row);
                }
            }
        }
        if crowd.n > 0 {
            descent.answer(s, &mut crowd, self.row);
        }
        descent.done
    }
}

/// The places of the bits that are set.
#[inline(always)]
fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = bits.trailing_zeros() as usize;
        let more = bits != 0;
        bits &= bits.wrapping_sub(1);
        more.then_some(place)
    })
}

/// Most queries that go down the boxes together; a multiple of eight.
const CROWD: usize = 64;

/// Open queries, neighbours in the spatial order.
struct Crowd {
    x: [f32; CROWD],
    y: [f32; CROWD],
    z: [f32; CROWD],
    query: [u32; CROWD],
    n: usize,
}

impl Default for Crowd {
    fn default() -> Self {
        let zeros = [0.0; CROWD];
        Crowd { x: zeros, y: zeros, z: zeros, query: [0; CROWD], n: 0 }
    }
}

impl Crowd {
    #[inline(always)]
    fn push(&mut self, query: usize, centres: &Coordinates) {
        [self.x[self.n], self.y[self.n], self.z[self.n]] = centres.get(query);
        self.query[self.n] = query as u32;
        self.n += 1;
    }

    /// Repeats the last query up to a multiple of eight.
    #[inline(always)]
    fn pad(&mut self) {
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            let last = axis[self.n - 1];
            axis[self.n..self.n.next_multiple_of(8)].fill(last);
        }
    }

    /// The coordinates of eight queries.
    #[inline(always)]
    fn packet(&self, packet: usize) -> [&[f32; 8]; 3] {
        [&self.x, &self.y, &self.z].map(|axis| &eights(axis)[packet])
    }
}

/// The box around some queries, in all lanes.
#[derive(Clone, Copy)]
struct Around<E> {
    x: [E; 2],
    y: [E; 2],
    z: [f32; 2],
}

impl<E: Copy> Around<E> {
    /// Around `least` to `greatest` of x, y and z.
    #[inline(always)]
    fn of<S: Simd<Eight = E>>(s: S, least: [E; 3], greatest: [E; 3]) -> Self {
        let rows = |[x, y, z]: [E; 3]| [x, y, z, x, x, x, x, x];
        let (mut lo, mut hi) = ([0.0; 8], [0.0; 8]);
        s.store(s.least_of_each(rows(least)), &mut lo);
        s.store(s.greatest_of_each(rows(greatest)), &mut hi);
        let ends = |axis: usize| [s.splat(lo[axis]), s.splat(hi[axis])];
        Around { x: ends(0), y: ends(1), z: [lo[2], hi[2]] }
    }
}

/// Most boxes of a front; a multiple of eight.
const FRONT: usize = 128;

/// The boxes of one level that may matter to a crowd: indices, and x0, x1, y0, y1, top.
struct Front {
    boxes: [[f32; FRONT]; 5],
    index: [u32; FRONT],
    n: usize,
    level: usize,
}

impl Default for Front {
    fn default() -> Self {
        Front { boxes: [[0.0; FRONT]; 5], index: [0; FRONT], n: 0, level: 0 }
    }
}

/// The finite steps' way down the boxes.
struct Descent<'a> {
    steps: &'a [StepSquared],
    tree: &'a Tree,
    front: Front,
    /// The group of eight obstacles that was in the way last: what stood in a neighbour's way often stands
    /// in this one's.
    struck: usize,
    /// Level and index of the box that was in the way last.
    blocking: (usize, usize),
    done: Searched,
}

/// Most groups that can wait: seven per level and no tree has more than eleven levels.
const STACK: usize = 96;

impl Descent<'_> {
    /// Sets the bits of the crowd's queries and empties it.
    #[inline(always)]
    fn answer<S: Simd>(&mut self, s: S, crowd: &mut Crowd, row: &mut [u64]) {
        crowd.pad();
        let n_packets = crowd.n.div_ceil(8);
        let mut open = [0u32; CROWD / 8];
        for (packet, open) in open[..n_packets].iter_mut().enumerate() {
            let all = !0u32 >> (24 + (8 * packet + 8).saturating_sub(crowd.n));
            *open = self.again(s, crowd.packet(packet), all);
        }
        let all_hit = open == [0; CROWD / 8] || self.advance(s, crowd, &open[..n_packets]);
        for (packet, &open) in open[..n_packets].iter().enumerate() {
            let queries = &crowd.query[8 * packet..crowd.n.min(8 * packet + 8)];
            let all = !0u32 >> (32 - queries.len());
            let free = match all_hit {
                true => 0,
                false if open == 0 => 0,
                false => self.search(s, crowd.packet(packet), open),
            };
            self.done.by_box += if all_hit { u64::from(open.count_ones()) } else { 0 };
            for lane in ones(all & !free) {
                let query = queries[lane];
                row[query as usize / 64] |= 1 << (query % 64);
            }
        }
        crowd.n = 0;
    }

    /// The lanes that what was in the way before is not in the way of.
    #[inline(always)]
    fn again<S: Simd>(&mut self, s: S, packet: [&[f32; 8]; 3], all: u32) -> u32 {
        let (level, group) = self.blocking;
        let (hit, _) = self.compare(s, packet, level, group);
        let open = all & !hit;
        self.done.by_box += u64::from((all & hit).count_ones());
        open & !self.strikes(s, packet, open, self.struck)
    }

    /// Finds the front of the crowd's packets that have open lanes: the last level of at most [`FRONT`] boxes that may matter. Returns
    /// true, and no front, if an obstacle was found that collides with all queries.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, s: S, crowd: &Crowd, open: &[u32]) -> bool {
        let (mut least, mut greatest) =
            ([s.splat(f32::INFINITY); 3], [s.splat(f32::NEG_INFINITY); 3]);
        for packet in (0..open.len()).filter(|&packet| open[packet] != 0) {
            for (axis, values) in crowd.packet(packet).into_iter().enumerate() {
                least[axis] = s.min(least[axis], s.load(values));
                greatest[axis] = s.max(greatest[axis], s.load(values));
            }
        }
        let around = Around::of(s, least, greatest);
        let levels = &self.tree.levels;
        let (mut nodes, mut n) = ([0u32; FRONT], 1);
        let mut level = levels.len();
        'down: while level > 0 {
            let (mut next, mut n_next) = ([0u32; FRONT], 0);
            for &node in &nodes[..n] {
                let boxes = &levels[level - 1];
                let sides = [&boxes.x0, &boxes.x1, &boxes.y0, &boxes.y1, &boxes.top];
                let sides = sides.map(|side| &eights(side)[node as usize]);
                let (all_hit, some) = compare_boxes(s, self.steps, &around, sides);
                if all_hit != 0 {
                    self.blocking = (level - 1, (8 * node + all_hit.trailing_zeros()) as usize);
                    return true;
                }
                if n_next + 8 > FRONT {
                    break 'down;
                }
                for child in ones(some) {
                    next[n_next] = 8 * node + child as u32;
                    n_next += 1;
                }
            }
            (nodes, n) = (next, n_next);
            level -= 1;
        }
        let boxes = &levels[level.min(levels.len() - 1)];
        let front = &mut self.front;
        (front.index, front.n, front.level) = (nodes, n, level);
        let from = [&boxes.x0, &boxes.x1, &boxes.y0, &boxes.y1, &boxes.top];
        for (side, from) in front.boxes.iter_mut().zip(from) {
            for (value, &node) in side.iter_mut().zip(&nodes[..n]) {
                *value = from[node as usize];
            }
        }
        front.boxes[4][n..n.next_multiple_of(8)].fill(f32::NEG_INFINITY);
        false
    }

    /// Which of these lanes of a packet does no obstacle collide with?
    #[inline(always)]
    fn search<S: Simd>(&mut self, s: S, packet: [&[f32; 8]; 3], mut open: u32) -> u32 {
        let lanes = packet.map(|axis| s.load(axis));
        let around = Around::of(s, lanes, lanes);
        let mut untested = open;
        let mut stack = [(0u32, 0u32); STACK];
        for eight in 0..self.front.n.div_ceil(8) {
            let front = &self.front;
            let sides = front.boxes.each_ref().map(|side| &eights(side)[eight]);
            let (all_hit, some) = compare_boxes(s, self.steps, &around, sides);
            if all_hit != 0 {
                let box_hit = front.index[8 * eight + all_hit.trailing_zeros() as usize];
                self.blocking = (front.level, box_hit as usize);
                open = 0;
                break;
            }
            let mut depth = 0;
            for lane in ones(some) {
                stack[depth] = (front.level as u32, front.index[8 * eight + lane]);
                depth += 1;
            }
            while depth > 0 && open != 0 {
                depth -= 1;
                let (level, group) = stack[depth];
                let (level, group) = (level as usize, group as usize);
                let (hit, concerned) = self.compare(s, packet, level, group);
                if hit & open != 0 {
                    self.blocking = (level, group);
                    open &= !hit;
                }
                let lanes = concerned & open;
                if lanes == 0 {
                    continue;
                }
                if level == 0 {
                    untested &= !lanes;
                    let hit = self.strikes(s, packet, lanes, group);
                    self.struck = if hit == 0 { self.struck } else { group };
                    open &= !hit;
                    continue;
                }
                let boxes = &self.tree.levels[level - 1];
                let sides = [&boxes.x0, &boxes.x1, &boxes.y0, &boxes.y1, &boxes.top];
                let sides = sides.map(|side| &eights(side)[group]);
                let (all_hit, some) = compare_boxes(s, self.steps, &around, sides);
                if all_hit != 0 {
                    self.blocking = (level - 1, 8 * group + all_hit.trailing_zeros() as usize);
                    open = 0;
                }
                for child in ones(some) {
                    stack[depth] = (level as u32 - 1, (8 * group + child) as u32);
                    depth += 1;
                }
            }
            if open == 0 {
                break;
            }
        }
        self.done.by_box += u64::from(untested.count_ones());
        open
    }

    /// Which lanes collide with an obstacle of this group for certain, and which may?
    #[inline(always)]
    fn compare<S: Simd>(
        &self,
        s: S,
        packet: [&[f32; 8]; 3],
        level: usize,
        group: usize,
    ) -> (u32, u32) {
        let boxes = &self.tree.levels[level];
        let [x, y, z] = packet.map(|axis| s.load(axis));
        let side = |side: &[f32]| s.splat(side[group]);
        let (near_x, far_x) = near_and_far(s, [x, x], side(&boxes.x0), side(&boxes.x1));
        let (near_y, far_y) = near_and_far(s, [y, y], side(&boxes.y0), side(&boxes.y1));
        let (near, far) = (s.add(near_x, near_y), s.add(far_x, far_y));
        let top = side(&boxes.top);
        let (mut hit, mut some) = (0, 0);
        for step in self.steps {
            let above = s.add(z, s.splat(step.height));
            let within = s.splat(step.radius_squared);
            hit |= s.greater_and_at_most(top, above, far, within);
            some |= s.greater_and_at_most(top, above, near, within);
        }
        (hit, some)
    }

    /// Which of these lanes collide with an obstacle of this group of eight?
    #[inline(always)]
    fn strikes<S: Simd>(
        &mut self,
        s: S,
        [cx, cy, cz]: [&[f32; 8]; 3],
        lanes: u32,
        group: usize,
    ) -> u32 {
        self.done.tested += 8 * u64::from(lanes.count_ones());
        let points = &self.tree.points;
        let [x, y, z] = [&points.x, &points.y, &points.z].map(|axis| &eights(axis)[group]);
        let mut hits = 0;
        for lane in ones(lanes) {
            let squared = squared_distance(s, s.splat(cx[lane]), s.splat(cy[lane]), x, y);
            for step in self.steps {
                let above = s.splat(cz[lane] + step.height);
                let within = s.splat(step.radius_squared);
                let struck = s.greater_and_at_most(s.load(z), above, squared, within);
                hits |= u32::from(struck != 0) << lane;
            }
        }
        hits
    }
}

/// With an obstacle of which of these eight boxes do all queries of another box collide for certain, and with
/// which may some of them? Boxes are x0, x1, y0, y1, top.
#[inline(always)]
fn compare_boxes<S: Simd>(
    s: S,
    steps: &[StepSquared],
    around: &Around<S::Eight>,
    sides: [&[f32; 8]; 5],
) -> (u32, u32) {
    let [x0, x1, y0, y1, top] = sides.map(|side| s.load(side));
    let (near_x, far_x) = near_and_far(s, around.x, x0, x1);
    let (near_y, far_y) = near_and_far(s, around.y, y0, y1);
    let (near, far) = (s.add(near_x, near_y), s.add(far_x, far_y));
    let (mut all, mut some) = (0, 0);
    for step in steps {
        let [least, greatest] = around.z.map(|z| s.splat(z + step.height));
        let within = s.splat(step.radius_squared);
        all |= s.greater_and_at_most(top, greatest, far, within);
        some |= s.greater_and_at_most(top, least, near, within);
    }
    (all, some)
}

/// Squared distances from the nearest pair and of the farthest pair of places of two intervals, the
/// first given by its ends.
#[inline(always)]
fn near_and_far<S: Simd>(
    s: S,
    [c0, c1]: [S::Eight; 2],
    least: S::Eight,
    greatest: S::Eight,
) -> (S::Eight, S::Eight) {
    let (past_least, to_greatest) = (s.sub(c1, least), s.sub(greatest, c0));
    let near = s.min(s.splat(0.0), s.min(past_least, to_greatest));
    let far = s.max(past_least, to_greatest);
    (s.mul(near, near), s.mul(far, far))
}
