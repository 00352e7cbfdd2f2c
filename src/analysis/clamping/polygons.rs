//! Convex polygons: what of a triangle is between two planes, and what two patches have in common.

use glam::{DVec2, DVec3};

/// What of a convex polygon has this coordinate within the limits.
pub(super) fn clipped(polygon: &[DVec3], axis: usize, [low, high]: [f64; 2]) -> Vec<DVec3> {
    let above = cut(polygon, |p| p[axis] - low);
    cut(&above, |p| high - p[axis])
}

/// What of a convex polygon has a height of 0 or more.
fn cut(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, &from) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()];
        let (a, b) = (height(from), height(to));
        if a >= 0.0 {
            kept.push(from);
        }
        if (a < 0.0) != (b < 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
    }
    kept
}

/// A convex polygon in a plane, counter-clockwise.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flat {
    corners: Vec<DVec2>,
    low: DVec2,
    high: DVec2,
}

/// Seen along the first axis.
pub(super) fn project(polygon: &[DVec3]) -> Flat {
    Flat::of(polygon.iter().map(|p| DVec2::new(p.y, p.z)).collect())
}

impl Flat {
    fn of(mut corners: Vec<DVec2>) -> Self {
        if signed_area(&corners) < 0.0 {
            corners.reverse();
        }
        let low = corners.iter().fold(DVec2::INFINITY, |low, p| low.min(*p));
        let high = corners.iter().fold(DVec2::NEG_INFINITY, |high, p| high.max(*p));
        Flat { corners, low, high }
    }

    pub(super) fn area(&self) -> f64 {
        signed_area(&self.corners)
    }

    /// The area that is in both.
    fn common(&self, other: &Flat) -> f64 {
        let mut left: Vec<DVec3> = self.corners.iter().map(|p| p.extend(0.0)).collect();
        for (k, from) in other.corners.iter().enumerate() {
            let along = other.corners[(k + 1) % other.corners.len()] - *from;
            left = cut(&left, |p| along.perp_dot(p.truncate() - *from));
        }
        signed_area(&left.iter().map(|p| p.truncate()).collect::<Vec<_>>()).max(0.0)
    }
}

fn signed_area(corners: &[DVec2]) -> f64 {
    let Some(first) = corners.first() else { return 0.0 };
    let pairs = corners.windows(2).map(|pair| (pair[0] - *first).perp_dot(pair[1] - *first));
    0.5 * pairs.sum::<f64>()
}

/// The area that both patches cover; polygons of one patch do not overlap.
pub(super) fn common_area(a: &[Flat], b: &[Flat]) -> f64 {
    let mut sorted: Vec<&Flat> = b.iter().collect();
    sorted.sort_by(|p, q| p.low.x.total_cmp(&q.low.x));
    let widest = sorted.iter().map(|p| p.high.x - p.low.x).fold(0.0, f64::max);
    let of = |p: &Flat| {
        let first = sorted.partition_point(|q| q.low.x < p.low.x - widest);
        let near = sorted[first..].iter().take_while(|q| q.low.x <= p.high.x);
        let near =
            near.filter(|q| q.high.x >= p.low.x && q.low.y <= p.high.y && q.high.y >= p.low.y);
        near.map(|q| p.common(q)).sum::<f64>()
    };
    a.iter().map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle([x, y]: [f64; 2], [width, height]: [f64; 2]) -> Flat {
        let corners = [[x, y], [x, y + height], [x + width, y + height], [x + width, y]];
        Flat::of(corners.map(DVec2::from_array).into())
    }

    #[test]
    fn patches_have_the_area_of_their_overlap_in_common() {
        let a = [rectangle([0.0, 0.0], [4.0, 2.0]), rectangle([4.0, 0.0], [1.0, 8.0])];
        let b = [rectangle([3.0, 1.0], [6.0, 3.0]), rectangle([-9.0, 0.0], [9.0, 9.0])];
        // 1 × 1 of the first, 1 × 3 of the second; the third only touches.
        assert!((common_area(&a, &b) - 4.0).abs() < 1e-12);
        assert!((common_area(&b, &a) - 4.0).abs() < 1e-12);
        assert_eq!(common_area(&a, &[]), 0.0);
    }

    #[test]
    fn a_triangle_between_two_planes_is_a_polygon() {
        let triangle = [[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]].map(DVec3::from_array);
        let band = project(&clipped(&triangle, 2, [1.0, 2.0]));
        // Widths of 3 and 2, 1 high.
        assert!((band.area() - 2.5).abs() < 1e-12);
        assert!(clipped(&triangle, 2, [5.0, 6.0]).is_empty());
    }
}
