//! The contact tolerance: how deep a tool may seem to cut where it only touches.

use super::bvh::Bvh;
use super::tool::Outline;
use crate::Result;
use crate::geom::{Mesh, Sites};
use crate::par;
use crate::spatial::CountingSort;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// By how much, in mm, the tool is shrunk all around before it is tested.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactTolerance {
    /// [`LEAST_MM`], and more at sites beside concave smooth edges: what these say of the difference between the
    /// facets and the surface they stand for.
    #[default]
    Tessellation,
    /// This much at every site.
    #[serde(rename = "millimetres", alias = "millimeters")]
    Millimeters(f64),
}

/// The tolerance where facets imply no more, mm.
pub const LEAST_MM: f64 = 0.01;

/// Edges whose faces turn by no more than this belong to a tessellated curve: ten facets and more to the turn.
const SMOOTH_RAD: f64 = 0.63;
/// A tolerance implied by facets is at most this share of the cutter's radius.
const GREATEST_SHARE: f64 = 0.25;
/// How far from a site edges matter, in radii of the cutter: beyond `tan(SMOOTH_RAD/2)` the facet across does not
/// come nearer to the axis than the site's own.
const AROUND: f64 = 0.35;
/// Sites per task.
const BLOCK: usize = 256;
/// Vertices per task.
const VERTICES: usize = 4096;
/// Fewer sites than this do not need the depths of all faces.
const FEW: usize = 16;

/// How a face bends toward the outside across its edges.
#[derive(Debug, Clone, Copy, Default)]
struct Bend {
    /// Greatest turn against a neighbor across a concave smooth edge, radians; 0 for none.
    turn: f64,
    /// Radius of the circle whose chords the two facets are, mm.
    radius: f64,
}

impl Bend {
    /// How deep the neighbor reaches into a tool of this radius that touches the face.
    ///
    /// Beside the edge it is `r·(1 − cos turn)`. In a bore of radius `b` not much wider than the tool further facets reach
    /// deeper: `e·b/(b − r)` with the chord error `e`; up to twice the former is granted.
    fn depth(&self, r: f64) -> f64 {
        if self.turn == 0.0 {
            return 0.0;
        }
        let beside = r * (1.0 - libm::cos(self.turn));
        let chord_error = self.radius * (1.0 - libm::cos(0.5 * self.turn));
        let around = chord_error * self.radius / (self.radius - r);
        let depth = if self.radius > r { around.clamp(beside, 2.0 * beside) } else { beside };
        depth.min(GREATEST_SHARE * r)
    }
}

/// The bends of all faces of a mesh.
#[derive(Debug)]
pub(super) struct Bends(Vec<[Bend; 3]>);

impl Bends {
    /// Number of faces.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn of(mesh: &Mesh) -> Self {
        let ends = |half: u32| {
            let (corners, k) = (mesh.triangles[half as usize / 3], half as usize % 3);
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            [a.min(b), a.max(b)]
        };
        let n_halves = 3 * mesh.triangles.len() as u32;
        let mut sort = CountingSort::default();
        sort.clear(mesh.vertices.len());
        (0..n_halves).for_each(|half| sort.count(ends(half)[0] as usize));
        sort.finish_counting();
        let mut by_lower_end = vec![[0; 2]; n_halves as usize];
        for half in 0..n_halves {
            let [low, high] = ends(half);
            by_lower_end[sort.place(low as usize)] = [high, half];
        }
        let blocks = par::map_blocks(mesh.vertices.len(), VERTICES, |range| {
            let mut found = Vec::new();
            let mut edges = Vec::new();
            for vertex in range {
                edges.clear();
                edges.extend_from_slice(&by_lower_end[sort.range(vertex, vertex)]);
                edges.sort_unstable();
                for same in edges.chunk_by(|x, y| x[0] == y[0]) {
                    let &[[_, x], [_, y]] = same else { continue };
                    found.extend(bend(mesh, x, y).map(|bend| ([x, y], bend)));
                }
            }
            found
        });
        let mut bends = vec![[Bend::default(); 3]; mesh.triangles.len()];
        for (halves, bend) in blocks.into_iter().flatten() {
            for half in halves {
                bends.as_flattened_mut()[half as usize] = bend;
            }
        }
        Bends(bends)
    }
}

/// The bend over half edges `x` and `y` (three times the face, plus the number of the corner where it begins), if the faces
/// rise toward each other.
fn bend(mesh: &Mesh, x: u32, y: u32) -> Option<Bend> {
    let normal = |half: u32| mesh.area_vector(half as usize / 3).normalize_or_zero();
    // From the corner where a half edge begins: to where it ends, and to the corner across.
    let side = |half: u32| {
        let (corners, k) = (mesh.corners(half as usize / 3), half as usize % 3);
        let start = corners[k];
        (start, corners[(k + 1) % 3] - start, corners[(k + 2) % 3] - start)
    };
    let (n, m) = (normal(x), normal(y));
    let (near, far) = (side(x), side(y));
    let rises = n.dot(far.0 + far.2 - near.0) > 0.0;
    if n == DVec3::ZERO || m == DVec3::ZERO || !rises {
        return None;
    }
    let turn = libm::atan2(n.cross(m).length(), n.dot(m));
    if !(FLAT_RAD..=SMOOTH_RAD).contains(&turn) {
        return None;
    }
    let width = |(_, edge, opposite): (DVec3, DVec3, DVec3)| {
        let edge = edge.normalize_or_zero();
        (opposite - edge * opposite.dot(edge)).length()
    };
    let radius = 0.5 * width(near).min(width(far)) / libm::sin(0.5 * turn);
    Some(Bend { turn, radius })
}

/// Turns below this are rounding.
const FLAT_RAD: f64 = 1e-5;

impl ContactTolerance {
    /// The tolerance away from the part's surface, mm.
    ///
    /// # Errors
    /// As [`ContactTolerance::at_sites`].
    pub(super) fn least(self, outline: &Outline) -> Result<f64> {
        outline.check_tolerance(match self {
            ContactTolerance::Tessellation => LEAST_MM,
            ContactTolerance::Millimeters(given) => given,
        })
    }

    /// The tolerance at every site, mm; `bends` in the order of the mesh's faces, which come first in `bvh`.
    ///
    /// # Errors
    /// If a given tolerance is not positive or not below the cutter's radius, or the cutter's radius not above [`LEAST_MM`].
    pub(super) fn at_sites(
        self,
        outline: &Outline,
        bends: &Bends,
        bvh: &Bvh,
        sites: &Sites,
    ) -> Result<Vec<f64>> {
        let least = match self {
            ContactTolerance::Tessellation => outline.check_tolerance(LEAST_MM)?,
            ContactTolerance::Millimeters(given) => {
                return Ok(vec![outline.check_tolerance(given)?; sites.len()]);
            }
        };
        let r = outline.radius();
        let depth = |bends: &[Bend; 3]| bends.iter().map(|b| b.depth(r)).fold(0.0, f64::max);
        // For a few sites only those of the faces around them.
        let is_many = sites.len() > FEW;
        let depths: Vec<f64> =
            if is_many { bends.0.iter().map(depth).collect() } else { Vec::new() };
        let deep = |f: u32| match is_many {
            true => depths.get(f as usize).copied().unwrap_or(0.0),
            false => bends.0.get(f as usize).map_or(0.0, depth),
        };
        if is_many && !(0..depths.len() as u32).any(|f| deep(f) > least) {
            return Ok(vec![least; sites.len()]);
        }
        let at = |i: usize| {
            let (point, normal) = (sites.points[i].as_dvec3(), sites.normals[i].as_dvec3());
            let mut tolerance = least;
            bvh.near(point, AROUND * r, |place| {
                let [a, b, c] = bvh.triangle(place);
                let along = (*b - *a).cross(*c - *a).dot(normal) > 0.0;
                if along && deep(bvh.face(place)) > tolerance {
                    tolerance = deep(bvh.face(place));
                }
                false
            });
            tolerance
        };
        let blocks = par::map_blocks(sites.len(), BLOCK, |range| range.map(at).collect::<Vec<_>>());
        Ok(blocks.into_iter().flatten().collect())
    }
}
