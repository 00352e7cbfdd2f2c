//! Open queries that go down the boxes together, and the boxes that may matter to them.

use super::compare::Around;
use crate::simd::collide::{Coordinates, eights};
use crate::simd::level::Simd;

/// The places of the bits that are set.
#[inline(always)]
pub fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = bits.trailing_zeros() as usize;
        let more = bits != 0;
        bits &= bits.wrapping_sub(1);
        more.then_some(place)
    })
}

/// Most queries that go down the boxes together; a multiple of eight.
pub const CROWD: usize = 64;

/// Open queries, neighbours in the spatial order.
pub struct Crowd {
    x: [f32; CROWD],
    y: [f32; CROWD],
    z: [f32; CROWD],
    pub query: [u32; CROWD],
    pub n: usize,
}

impl Default for Crowd {
    fn default() -> Self {
        let zeros = [0.0; CROWD];
        Crowd { x: zeros, y: zeros, z: zeros, query: [0; CROWD], n: 0 }
    }
}

impl Crowd {
    #[inline(always)]
    pub fn push(&mut self, query: usize, centres: &Coordinates) {
        [self.x[self.n], self.y[self.n], self.z[self.n]] = centres.get(query);
        self.query[self.n] = query as u32;
        self.n += 1;
    }

    /// Repeats the last query up to a multiple of eight.
    #[inline(always)]
    pub fn pad(&mut self) {
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            let last = axis[self.n - 1];
            axis[self.n..self.n.next_multiple_of(8)].fill(last);
        }
    }

    /// The box around the packets with open lanes.
    #[inline(always)]
    pub fn around<S: Simd>(&self, s: S, open: &[u32]) -> Around<S::Eight> {
        let mut least = [s.splat(f32::INFINITY); 3];
        let mut greatest = [s.splat(f32::NEG_INFINITY); 3];
        for packet in (0..open.len()).filter(|&packet| open[packet] != 0) {
            for (axis, values) in self.packet(packet).into_iter().enumerate() {
                least[axis] = s.min(least[axis], s.load(values));
                greatest[axis] = s.max(greatest[axis], s.load(values));
            }
        }
        Around::of(s, least, greatest)
    }

    /// The coordinates of eight queries.
    #[inline(always)]
    pub fn packet(&self, packet: usize) -> [&[f32; 8]; 3] {
        [&self.x, &self.y, &self.z].map(|axis| &eights(axis)[packet])
    }
}

/// Most boxes of a front; a multiple of eight.
pub const FRONT: usize = 128;

/// Boxes of one level that may matter to a crowd.
pub struct Front {
    /// x0, x1, y0, y1, top; with room for eight more.
    pub sides: [[f32; FRONT + 8]; 5],
    pub index: [u32; FRONT + 8],
    pub n: usize,
    pub level: usize,
}

impl Front {
    pub fn new() -> Self {
        Front { sides: [[0.0; FRONT + 8]; 5], index: [0; FRONT + 8], n: 0, level: 0 }
    }

    /// Appends those of eight boxes that `some` names; the first of the eight has index `first`. There must
    /// be room.
    #[inline(always)]
    pub fn append<S: Simd>(&mut self, s: S, sides: [&[f32; 8]; 5], first: u32, some: u32) {
        for (to, from) in self.sides.iter_mut().zip(sides) {
            if let Some(to) = to[self.n..].first_chunk_mut() {
                s.store(s.compress(s.load(from), some), to);
            }
        }
        for (place, lane) in self.index[self.n..].iter_mut().zip(ones(some)) {
            *place = first + lane as u32;
        }
        self.n += some.count_ones() as usize;
    }
}
