//! The definition in plain loops: slow, the law.

use super::outline::Outline;
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Whether some point of a triangle, in the frame of the tool, is deeper in it than `tolerance`; none if that depends
/// on less than `resolution`, mm.
///
/// The depth of a point changes by no more than the point moves:
///
/// ```text
/// triangles = the one
/// the triangle with the greatest depth of its middle + distance to its corners:
///     that sum not above the tolerance: no point of any
///     depth of its middle above the tolerance: yes
///     smaller than the resolution: undecided; else: cut in four
/// ```
pub(super) fn penetrates(
    outline: &Outline,
    corners: &[DVec3; 3],
    tolerance: f64,
    resolution: f64,
) -> Option<bool> {
    let mut triangles = BinaryHeap::from([bounded(outline, *corners)]);
    while let Some(Bounded { corners: [a, b, c], depth, reach }) = triangles.pop() {
        if depth + reach <= tolerance {
            return Some(false);
        }
        if depth > tolerance {
            return Some(true);
        }
        if reach < resolution {
            return None;
        }
        let [ab, bc, ca] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            let part = bounded(outline, part);
            if part.depth + part.reach > tolerance {
                triangles.push(part);
            }
        }
    }
    Some(false)
}

struct Bounded {
    corners: [DVec3; 3],
    /// Of the middle.
    depth: f64,
    /// From there to the corners.
    reach: f64,
}

fn bounded(outline: &Outline, corners: [DVec3; 3]) -> Bounded {
    let [a, b, c] = corners;
    let middle = (a + b + c) / 3.0;
    let reach = corners.map(|p| p.distance(middle)).into_iter().fold(0.0, f64::max);
    Bounded { corners, depth: outline.depth(middle).mm, reach }
}

/// By the greatest depth that they may have.
impl Ord for Bounded {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.depth + self.reach).total_cmp(&(other.depth + other.reach))
    }
}

impl PartialOrd for Bounded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Bounded {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Bounded {}
