//! Facets: triangles that hang together in one plane.
//!
//! A file may cut a facet into any number of triangles: a bore's strip that another bore crosses, or every facet of a
//! mesh that was subdivided. Its width, its sides and its chord error are those of all of them together.

use super::faces::root;
use crate::geom::Mesh;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// The facets of a mesh that are more than two triangles.
pub(super) struct Facets {
    /// Per face, the first of those that hang together with it in one plane, as pairs of them do.
    first: Vec<u32>,
    /// Per face, its facet, or [`NONE`].
    by_face: Vec<u32>,
    facets: Vec<Facet>,
}

const NONE: u32 = u32::MAX;

/// Triangles in one plane.
pub(super) struct Facet {
    /// Twice the area, mm².
    pub double_area: f64,
    /// Across the normal.
    axes: [DVec3; 2],
    /// Corners of the convex hull, counterclockwise: all, or of many those that are farthest in [`N_DIRECTIONS`].
    pub hull: Vec<DVec2>,
}

/// The normals of a facet's triangles, added, are at least this long as a share of the sum of their lengths.
const FLAT_SHARE: f64 = 0.9999;

impl Facets {
    /// Of pairs of faces that are in one plane and share an edge.
    pub fn of(mesh: &Mesh, flat: impl Iterator<Item = [usize; 2]>) -> Facets {
        let n = mesh.triangles.len();
        let mut first: Vec<u32> = (0..n as u32).collect();
        for [f, g] in flat {
            let (f, g) = (root(&mut first, f as u32), root(&mut first, g as u32));
            first[f.max(g) as usize] = f.min(g);
        }
        let first: Vec<u32> = (0..n as u32).map(|f| root(&mut first, f)).collect();
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.sort_unstable_by_key(|&f| (first[f as usize], f));
        let (mut by_face, mut facets) = (vec![NONE; n], Vec::new());
        for faces in order.chunk_by(|f, g| first[*f as usize] == first[*g as usize]) {
            if faces.len() > 2
                && let Some(facet) = Facet::of(mesh, faces)
            {
                faces.iter().for_each(|&f| by_face[f as usize] = facets.len() as u32);
                facets.push(facet);
            }
        }
        Facets { first, by_face, facets }
    }

    pub fn all(&self) -> &[Facet] {
        &self.facets
    }

    /// The first of the faces that hang together with a face in one plane; of two, too.
    pub fn first(&self, face: usize) -> u32 {
        self.first[face]
    }

    /// The number of a face's facet.
    pub fn number(&self, face: usize) -> Option<usize> {
        let number = self.by_face[face];
        (number != NONE).then_some(number as usize)
    }

    /// A face's facet.
    pub fn facet(&self, face: usize) -> Option<&Facet> {
        self.number(face).map(|k| &self.facets[k])
    }
}

impl Facet {
    /// None if the triangles, though each is in one plane with its neighbors, are not all in one.
    fn of(mesh: &Mesh, faces: &[u32]) -> Option<Facet> {
        let areas = || faces.iter().map(|&f| mesh.area_vector(f as usize));
        let (sum, double_area) = (areas().sum::<DVec3>(), areas().map(|a| a.length()).sum());
        if sum.length() < FLAT_SHARE * double_area {
            return None;
        }
        let (u, v) = sum.normalize().any_orthonormal_pair();
        let mut facet = Facet { double_area, axes: [u, v], hull: Vec::new() };
        let corners = faces.iter().flat_map(|&f| mesh.corners(f as usize));
        facet.hull = farthest(convex_hull(corners.map(|p| facet.flat(p)).collect()));
        Some(facet)
    }

    /// A point in the plane.
    pub fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.dot(self.axes[0]), p.dot(self.axes[1]))
    }

    /// How far it extends from the line through two points.
    pub fn width(&self, [a, b]: [DVec3; 2]) -> f64 {
        let from = self.flat(a);
        let across = (self.flat(b) - from).normalize_or_zero().perp();
        self.hull.iter().map(|p| across.dot(*p - from).abs()).fold(0.0, f64::max)
    }

    /// The ends of its side on which two points are; none if they are between its sides, as the edge of a hole is.
    pub fn side(&self, [a, b]: [DVec3; 2]) -> Option<[DVec3; 2]> {
        /// Of its width: what is nearer to a line is on it.
        const ON: f64 = 1e-3;
        let (from, length) = (self.flat(a), (b - a).length());
        let along = (self.flat(b) - from).normalize_or_zero();
        let away = |p: &DVec2| along.perp().dot(*p - from);
        let [low, high] = self
            .hull
            .iter()
            .map(away)
            .fold([0.0, 0.0], |[low, high], away| [f64::min(low, away), f64::max(high, away)]);
        let near = ON * (high - low);
        if low.abs().min(high) > near {
            return None;
        }
        let on = self.hull.iter().filter(|p| away(p).abs() <= near);
        let [low, high] = on
            .map(|p| along.dot(*p - from))
            .fold([0.0, length], |[low, high], s| [f64::min(low, s), f64::max(high, s)]);
        let along = (b - a).normalize_or_zero();
        Some([a + along * low, a + along * high])
    }
}

/// In so many directions the corners of a hull are kept: work grows with their square. Widths are off by 0.03 %.
const N_DIRECTIONS: usize = 128;

/// Of many corners of a hull those that are farthest in some direction, in their order.
fn farthest(hull: Vec<DVec2>) -> Vec<DVec2> {
    if hull.len() <= N_DIRECTIONS {
        return hull;
    }
    let mut kept: Vec<usize> = (0..N_DIRECTIONS)
        .filter_map(|k| {
            let angle = TAU * k as f64 / N_DIRECTIONS as f64;
            let toward = DVec2::new(libm::cos(angle), libm::sin(angle));
            let along = |k: &usize| toward.dot(hull[*k]);
            (0..hull.len()).max_by(|a, b| along(a).total_cmp(&along(b)))
        })
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|k| hull[k]).collect()
}

/// The corners of the convex hull of points, counterclockwise (Andrew 1979).
fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_unstable_by(|p, q| p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)));
    points.dedup();
    let mut hull = chain(points.iter());
    let upper = chain(points.iter().rev());
    // Both end where the other begins.
    hull.pop();
    hull.extend(upper.iter().take(upper.len().saturating_sub(1)));
    hull
}

/// Of points in the order of a sweep, those at which the outline to their right turns left.
fn chain<'a>(points: impl Iterator<Item = &'a DVec2>) -> Vec<DVec2> {
    let mut chain: Vec<DVec2> = Vec::new();
    for &p in points {
        while let [.., a, b] = chain[..] {
            if (b - a).perp_dot(p - b) > 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(p);
    }
    chain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::prism;
    use proptest::prelude::*;

    #[test]
    fn a_disc_of_many_corners_keeps_its_width() {
        let n = 100_000;
        let at = |k: usize| DVec2::from_angle(TAU * k as f64 / n as f64) * 5.0;
        let outline: Vec<DVec2> = (0..n).map(at).collect();
        let cap: Vec<[u32; 3]> = (2..n as u32).map(|k| [0, k - 1, k]).collect();
        let mesh = prism(&outline, &cap, 1.0);
        let faces: Vec<u32> = (0..mesh.triangles.len() as u32)
            .filter(|f| mesh.area_vector(*f as usize).normalize_or_zero().z > 0.5)
            .collect();
        let facet = Facet::of(&mesh, &faces).unwrap();
        assert!(facet.hull.len() <= N_DIRECTIONS);
        for k in [0, n / 7, n / 3] {
            let width = facet.width([at(k), at(k + 1)].map(|p| p.extend(1.0)));
            assert!((width - 10.0).abs() < 0.01, "{width}");
        }
    }

    proptest! {
        #[test]
        fn a_hull_holds_all_points_and_turns_left(
            points in prop::collection::vec((-4i8..4, -4i8..4), 3..30),
        ) {
            let points: Vec<DVec2> =
                points.iter().map(|(x, y)| DVec2::new(f64::from(*x), f64::from(*y))).collect();
            let hull = convex_hull(points.clone());
            prop_assert!(hull.iter().all(|p| points.contains(p)));
            for k in 0..hull.len() {
                let [a, b] = [hull[k], hull[(k + 1) % hull.len()]];
                for p in &points {
                    prop_assert!((b - a).perp_dot(*p - a) >= 0.0, "{hull:?} {p}");
                }
            }
        }
    }
}
