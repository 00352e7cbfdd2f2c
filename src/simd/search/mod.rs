//! The search for labels: queries that the greatest height leaves open descend the boxes together.
//!
//! Neighbours in the spatial order ask the same boxes. A crowd of up to 64 open queries goes down the
//! boxes as one, box against box, and collects those that may matter to some of it: its front. Packets of
//! eight queries then look at the front, eight boxes at once against the box around the packet; a box that
//! may matter is compared with the eight queries, and those that it concerns go on. All comparisons use the
//! predicate's own operations, and rounding is monotone: for every query and every obstacle of two boxes
//! `near² ≤ r² ≤ far²` holds bit for bit, as in [`boxes`](super::boxes).

mod compare;
mod crowd;

use super::boxes::Tree;
use super::collide::{Coordinates, StepSquared, eights, squared_distance};
use super::level::{Kernel, Simd};
use compare::{Around, compare_boxes, compare_lanes};
use crowd::{CROWD, Crowd, FRONT, Front, ones};

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
        let mut descent = Descent::new(steps, self.tree);
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

/// The finite steps' way down the boxes.
struct Descent<'a> {
    steps: &'a [StepSquared],
    tree: &'a Tree,
    /// The front of the crowd, and room for the next level's.
    fronts: [Front; 2],
    /// Which of the two is the front.
    front: usize,
    /// The group of eight obstacles that was in the way last: what stood in a neighbour's way often stands
    /// in this one's.
    struck: usize,
    /// Level and index of the box that was in the way last.
    blocking: (usize, usize),
    done: Searched,
}

/// Most boxes that can wait: eight per level and no tree has more than eleven levels.
const STACK: usize = 96;

impl<'a> Descent<'a> {
    fn new(steps: &'a [StepSquared], tree: &'a Tree) -> Self {
        let (fronts, done) = ([Front::new(), Front::new()], Searched::default());
        Descent { steps, tree, fronts, front: 0, struck: 0, blocking: (0, 0), done }
    }

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
        let (level, index) = self.blocking;
        let boxes = &self.tree.levels[level];
        let (hit, _) = compare_lanes(s, self.steps, packet, boxes.get(index));
        let open = all & !hit;
        self.done.by_box += u64::from((all & hit).count_ones());
        open & !self.strikes(s, packet, open, self.struck)
    }

    /// Finds the front for all packets with open lanes: the last level of which at most [`FRONT`] boxes may
    /// matter. Returns true, and no front, if an obstacle was found that collides with all queries.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, s: S, crowd: &Crowd, open: &[u32]) -> bool {
        let around = crowd.around(s, open);
        let [mut now, mut next] = self.fronts.each_mut();
        self.front = 0;
        (now.level, now.index[0], now.n) = (self.tree.levels.len(), 0, 1);
        while now.level > 0 {
            let boxes = &self.tree.levels[now.level - 1];
            (next.level, next.n) = (now.level - 1, 0);
            for &group in &now.index[..now.n] {
                let sides = boxes.eight(group as usize);
                let (all_hit, some) = compare_boxes(s, self.steps, &around, sides);
                if all_hit != 0 {
                    let child = 8 * group + all_hit.trailing_zeros();
                    self.blocking = (next.level, child as usize);
                    return true;
                }
                if next.n > FRONT - 8 {
                    return false;
                }
                next.append(s, sides, 8 * group, some);
            }
            std::mem::swap(&mut now, &mut next);
            self.front ^= 1;
        }
        false
    }

    /// Which of these lanes of a packet does no obstacle collide with?
    #[inline(always)]
    fn search<S: Simd>(&mut self, s: S, packet: [&[f32; 8]; 3], mut open: u32) -> u32 {
        let lanes = packet.map(|axis| s.load(axis));
        let around = Around::of(s, lanes, lanes);
        let mut untested = open;
        let (level, n) = (self.fronts[self.front].level, self.fronts[self.front].n);
        for eight in 0..n.div_ceil(8) {
            let front = &self.fronts[self.front];
            let sides = front.sides.each_ref().map(|side| &eights(side)[eight]);
            let used = !0u32 >> (24 + (8 * eight + 8).saturating_sub(n));
            let (all_hit, some) = compare_boxes(s, self.steps, &around, sides);
            if all_hit & used != 0 {
                let place = 8 * eight + (all_hit & used).trailing_zeros() as usize;
                self.blocking = (level, front.index[place] as usize);
                open = 0;
                break;
            }
            for lane in ones(some & used) {
                let front = &self.fronts[self.front];
                let index = front.index[8 * eight + lane] as usize;
                let sides = front.sides.each_ref().map(|side| side[8 * eight + lane]);
                if self.visit(s, packet, (level, index), sides, [&mut open, &mut untested]) {
                    self.descend(s, packet, &around, (level, index), [&mut open, &mut untested]);
                }
            }
            if open == 0 {
                break;
            }
        }
        self.done.by_box += u64::from(untested.count_ones());
        open
    }

    /// Asks all boxes below this one.
    #[inline(always)]
    fn descend<S: Simd>(
        &mut self,
        s: S,
        packet: [&[f32; 8]; 3],
        around: &Around<S::Eight>,
        (level, index): (usize, usize),
        [open, untested]: [&mut u32; 2],
    ) {
        let mut stack = [(0u32, 0u32); STACK];
        stack[0] = (level as u32, index as u32);
        let mut depth = 1;
        while depth > 0 && *open != 0 {
            depth -= 1;
            let (level, group) = stack[depth];
            let boxes = &self.tree.levels[level as usize - 1];
            let sides = boxes.eight(group as usize);
            let (all_hit, some) = compare_boxes(s, self.steps, around, sides);
            if all_hit != 0 {
                let child = 8 * group + all_hit.trailing_zeros();
                self.blocking = (level as usize - 1, child as usize);
                *open = 0;
            }
            for lane in ones(some) {
                let child = (level as usize - 1, 8 * group as usize + lane);
                let sides = sides.map(|side| side[lane]);
                if self.visit(s, packet, child, sides, [&mut *open, &mut *untested]) {
                    stack[depth] = (level - 1, child.1 as u32);
                    depth += 1;
                }
            }
        }
    }

    /// Compares the lanes with a box, and tests its obstacles if it is of the lowest level. Whether the boxes
    /// below it must be asked.
    #[inline(always)]
    fn visit<S: Simd>(
        &mut self,
        s: S,
        packet: [&[f32; 8]; 3],
        (level, index): (usize, usize),
        sides: [f32; 5],
        [open, untested]: [&mut u32; 2],
    ) -> bool {
        let (hit, concerned) = compare_lanes(s, self.steps, packet, sides);
        if hit & *open != 0 {
            self.blocking = (level, index);
            *open &= !hit;
        }
        let lanes = concerned & *open;
        if level > 0 || lanes == 0 {
            return lanes != 0;
        }
        *untested &= !lanes;
        let hit = self.strikes(s, packet, lanes, index);
        self.struck = if hit == 0 { self.struck } else { index };
        *open &= !hit;
        false
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
