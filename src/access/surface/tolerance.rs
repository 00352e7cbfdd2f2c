//! The gouge tolerance: how deep a tool may seem to cut where it only touches.
//!
//! # Definition
//!
//! Facets of a concave curve stand off the curve that they replace by their *chord error*, and a tool that touches the
//! curve seems to cut them by as much. So the tolerance belongs to the facet that is met, wherever the tool touches:
//!
//! ```text
//! τ(facet) = 0.01 mm + 1.1 · e · min(1, R·κ)          R = radius of the tool's lower end
//! ```
//!
//! `κ` is the facet's concave curvature and `e` the greatest distance between the facet and a surface of that curvature
//! through its corners. A tool of radius `R < 1/κ` that touches two facets leaves only `R·κ` of `e` between them. Both
//! come from the facet's width and its turns against the three neighbors (Grinspun, Gingold, Reisman and Zorin 2006,
//! Computing discrete shape operators on general meshes):
//!
//! ```text
//! Λ = Σ over its edges of  w(ratio) · θ/h · t tᵀ      θ: concave turn; h: height of the facet on the edge; t: across the edge
//! e = max over the facet of ½ Σ λᵢλⱼ (pᵢ − pⱼ)ᵀ Λ (pᵢ − pⱼ)                λ: barycentric coordinates
//! κ = greatest eigenvalue of Λ
//! ```
//!
//! For a strip of width `b` that turns by θ this is `b·θ/8`. `ratio` is the neighbor's height over the facet's own:
//! facets of one curve have similar widths, a plane beside a fillet does not belong to it. Turns above 36° (ten facets
//! to the turn) count less and less, from 45° on they are corners. A face that meets a facet of a curve in a corner, as
//! the top of a bore does, is granted what that is: their edge is a chord.

use super::bvh::Bvh;
use super::tool::Outline;
use crate::Result;
use crate::geom::Mesh;
use crate::par;
use crate::spatial::CountingSort;
use glam::{DMat2, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// By how much, in mm, the tool is shrunk all around before it is tested.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ContactTolerance {
    /// [`LEAST_MM`], and more against facets of concave curves: their chord error.
    #[default]
    Tessellation,
    /// As `Tessellation`, but no more than this, mm.
    AtMost(f64),
    /// This much against every facet.
    #[serde(rename = "millimetres", alias = "millimeters")]
    Millimeters(f64),
}

/// The tolerance where facets imply no more, mm.
pub const LEAST_MM: f64 = 0.01;

/// Turns up to this belong to a curve: ten facets to the full turn.
const SMOOTH_RAD: f64 = 0.63;
/// Turns from this on are corners.
const CORNER_RAD: f64 = 0.785;
/// Turns below this are rounding.
const FLAT_RAD: f64 = 1e-5;
/// Facets of one curve have at least this ratio of widths; below the next it is none.
const SAME_CURVE: f64 = 0.5;
const OTHER_SURFACE: f64 = 0.25;
/// More than what the estimate of a chord error may lack, as a factor.
const ESTIMATE: f64 = 1.1;
/// Sites per task.
const BLOCK: usize = 256;
/// Vertices per task.
const VERTICES: usize = 4096;
/// A site is on the facets within this share of the part's size.
const ON_FACET: f64 = 1e-6;

/// What a facet says of the concave curve that it stands for.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Chord {
    /// Distance between facet and curve, mm.
    error: f64,
    /// Curvature, 1/mm.
    curvature: f64,
}

impl Chord {
    /// What is granted beyond [`LEAST_MM`] to a tool of this radius.
    fn granted(self, radius: f64) -> f64 {
        ESTIMATE * self.error * (radius * self.curvature).min(1.0)
    }

    fn max(self, other: Chord) -> Chord {
        Chord { error: self.error.max(other.error), curvature: self.curvature.max(other.curvature) }
    }
}

/// The chords of all faces of a mesh.
#[derive(Debug)]
pub(super) struct Chords(Vec<Chord>);

/// Two faces over an edge, by half edge: three times the face, plus the number of the corner where it begins.
struct Fold {
    halves: [u32; 2],
    /// Concave turn, radians; 0 for a flat edge or a corner.
    turn: f64,
    kind: FoldKind,
}

impl Fold {
    fn faces(&self) -> [usize; 2] {
        self.halves.map(|half| half as usize / 3)
    }
}

#[derive(PartialEq)]
enum FoldKind {
    Flat,
    Curve,
    /// The edge of a curve's facet is a chord as well: another face that begins there reaches in as far.
    Corner,
}

impl Chords {
    /// The chord errors, as if they were tolerances.
    pub fn as_tolerances(&self, bvh: &Bvh) -> Tolerances {
        let error = |place: u32| self.0.get(bvh.face(place) as usize).map_or(0.0, |c| c.error);
        let by_place: Vec<f64> = (0..bvh.n_triangles() as u32).map(error).collect();
        let most = by_place.iter().fold(0.0, |a: f64, b| a.max(*b));
        Tolerances { least: 0.0, most, by_place }
    }

    /// Those of some of the faces, or of pieces of them.
    pub fn of_faces(&self, faces: &[u32]) -> Self {
        Chords(faces.iter().map(|&f| self.0[f as usize]).collect())
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn of(mesh: &Mesh) -> Self {
        let folds = folds(mesh);
        let mut across = vec![[None; 3]; mesh.triangles.len()];
        for fold in folds.iter().filter(|fold| fold.turn > 0.0) {
            let [x, y] = fold.halves;
            for (half, other) in [(x, y), (y, x)] {
                across.as_flattened_mut()[half as usize] = Some((fold.turn, other));
            }
        }
        let chord = |f: usize| {
            if across[f] == [None; 3] { Chord::default() } else { chord(mesh, f, &across[f]) }
        };
        let own = par::map(mesh.triangles.len(), chord);
        // The two triangles of a strip's quadrangle are one facet.
        let mut facets = own.clone();
        for fold in folds.iter().filter(|fold| fold.kind == FoldKind::Flat) {
            let [x, y] = fold.faces();
            if is_similar(mesh, fold.halves) {
                facets[x] = facets[x].max(own[y]);
                facets[y] = facets[y].max(own[x]);
            }
        }
        let mut chords = facets.clone();
        for fold in folds.iter().filter(|fold| fold.kind == FoldKind::Corner) {
            let [x, y] = fold.faces();
            chords[x] = chords[x].max(facets[y]);
            chords[y] = chords[y].max(facets[x]);
        }
        Chords(chords)
    }
}

/// Whether the faces over an edge are about as high on it.
fn is_similar(mesh: &Mesh, [x, y]: [u32; 2]) -> bool {
    let [x, y] = [height(mesh, x), height(mesh, y)];
    x.min(y) >= SAME_CURVE * x.max(y)
}

/// Height of a face over one of its edges.
fn height(mesh: &Mesh, half: u32) -> f64 {
    let (corners, k) = (mesh.corners(half as usize / 3), half as usize % 3);
    let edge = (corners[(k + 1) % 3] - corners[k]).length();
    if edge > 0.0 { mesh.area_vector(half as usize / 3).length() / edge } else { 0.0 }
}

/// How much a neighbor tells of a facet, by the ratio of its height on the edge to the facet's own.
fn weight(ratio: f64) -> f64 {
    if ratio >= 1.0 {
        return 1.0;
    }
    let share = ((ratio - OTHER_SURFACE) / (SAME_CURVE - OTHER_SURFACE)).clamp(0.0, 1.0);
    share * 2.0 / (1.0 + ratio.max(SAME_CURVE))
}

/// How much a turn counts.
fn smoothness(turn: f64) -> f64 {
    ((CORNER_RAD - turn) / (CORNER_RAD - SMOOTH_RAD)).clamp(0.0, 1.0)
}

/// The chord of a face whose neighbors rise over some of its edges.
fn chord(mesh: &Mesh, f: usize, across: &[Option<(f64, u32)>; 3]) -> Chord {
    let corners = mesh.corners(f);
    let normal = mesh.area_vector(f).normalize_or_zero();
    let u = (corners[1] - corners[0]).normalize_or_zero();
    let v = normal.cross(u);
    let flat = corners.map(|p| DVec2::new((p - corners[0]).dot(u), (p - corners[0]).dot(v)));
    let mut shape = DMat2::ZERO;
    for (k, fold) in across.iter().enumerate() {
        let Some((turn, other)) = *fold else { continue };
        let own = height(mesh, (3 * f + k) as u32);
        let edge = (flat[(k + 1) % 3] - flat[k]).normalize_or_zero();
        if own <= 0.0 || edge == DVec2::ZERO {
            continue;
        }
        let t = edge.perp();
        let counted = weight(height(mesh, other) / own) * smoothness(turn) * turn / own;
        shape += DMat2::from_cols(t * t.x, t * t.y) * counted;
    }
    let second = |a: usize, b: usize| (flat[a] - flat[b]).dot(shape * (flat[a] - flat[b]));
    let q = [second(0, 1), second(1, 2), second(2, 0)];
    let on_edges = q.iter().fold(0.0, |a: f64, b| a.max(*b)) / 8.0;
    let within = q.iter().sum::<f64>() / 18.0;
    let half_trace = 0.5 * (shape.x_axis.x + shape.y_axis.y);
    let spread = (half_trace * half_trace - shape.determinant()).max(0.0).sqrt();
    Chord { error: on_edges.max(within), curvature: half_trace + spread }
}

/// The folds over all edges that two faces share, but for convex curves.
fn folds(mesh: &Mesh) -> Vec<Fold> {
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
                found.extend(fold(mesh, [x, y]));
            }
        }
        found
    });
    blocks.into_iter().flatten().collect()
}

/// The fold over two half edges; none for a convex curve.
fn fold(mesh: &Mesh, halves: [u32; 2]) -> Option<Fold> {
    let [n, m] = halves.map(|half| mesh.area_vector(half as usize / 3).normalize_or_zero());
    if n == DVec3::ZERO || m == DVec3::ZERO {
        return None;
    }
    let turn = libm::atan2(n.cross(m).length(), n.dot(m));
    let kind = match turn {
        turn if turn < FLAT_RAD => FoldKind::Flat,
        turn if turn >= CORNER_RAD => FoldKind::Corner,
        _ => FoldKind::Curve,
    };
    let corner = |half: u32, k: usize| mesh.corners(half as usize / 3)[(half as usize + k) % 3];
    let rises = n.dot(across(mesh, halves[1]) - corner(halves[0], 0)) > 0.0;
    match kind {
        FoldKind::Curve if !rises => None,
        FoldKind::Curve => Some(Fold { halves, turn, kind }),
        _ => Some(Fold { halves, turn: 0.0, kind }),
    }
}

/// The corner of a face across from one of its edges.
fn across(mesh: &Mesh, half: u32) -> DVec3 {
    mesh.corners(half as usize / 3)[(half as usize % 3 + 2) % 3]
}

/// The tolerance against every triangle of a search tree, for one tool, mm.
#[derive(Debug, Clone)]
pub(super) struct Tolerances {
    /// The least.
    pub least: f64,
    /// The greatest.
    pub most: f64,
    /// By place in the tree; empty if all are the least.
    by_place: Vec<f64>,
}

impl Tolerances {
    /// For the triangle at a place of the tree.
    #[inline(always)]
    pub fn at(&self, place: u32) -> f64 {
        self.by_place.get(place as usize).copied().unwrap_or(self.least)
    }
}

impl ContactTolerance {
    /// The tolerance against every triangle; `chords` are of the faces that come first in `bvh`.
    ///
    /// # Errors
    /// If a given tolerance is not positive or not below the cutter's radius, or the cutter's radius not above
    /// [`LEAST_MM`].
    pub(super) fn of_triangles(
        self,
        outline: &Outline,
        chords: &Chords,
        bvh: &Bvh,
    ) -> Result<Tolerances> {
        let uniform = |mm: f64| Tolerances { least: mm, most: mm, by_place: Vec::new() };
        let cap = match self {
            ContactTolerance::Millimeters(given) => {
                return outline.check_tolerance(given).map(uniform);
            }
            ContactTolerance::AtMost(cap) => outline.check_tolerance(cap)?,
            ContactTolerance::Tessellation => f64::INFINITY,
        };
        let least = outline.check_tolerance(LEAST_MM)?.min(cap);
        let radius = outline.radius();
        let granted = |face: u32| {
            let chord = chords.0.get(face as usize).copied().unwrap_or_default();
            (least + chord.granted(radius)).min(cap).min(GREATEST_SHARE * radius).max(least)
        };
        let n = bvh.n_triangles();
        let most = (0..n as u32).map(|place| granted(bvh.face(place))).fold(least, f64::max);
        if most == least {
            return Ok(uniform(least));
        }
        let by_place = (0..n as u32).map(|place| granted(bvh.face(place))).collect();
        Ok(Tolerances { least, most, by_place })
    }
}

/// A tool that shrinks by more than this share of its radius is another tool: turns of 36° on a sphere imply less.
const GREATEST_SHARE: f64 = 0.5;

impl Tolerances {
    /// The greatest tolerance against the triangles that every site lies on, mm.
    pub fn at_sites(&self, bvh: &Bvh, sites: &[DVec3]) -> Vec<f64> {
        if self.by_place.is_empty() {
            return vec![self.least; sites.len()];
        }
        let near = ON_FACET * bvh.radius();
        let at = |i: usize| {
            let mut tolerance = self.least;
            bvh.near(sites[i], near, |place| {
                if self.at(place) > tolerance && is_on(bvh.triangle(place), sites[i], near) {
                    tolerance = self.at(place);
                }
                false
            });
            tolerance
        };
        let blocks = par::map_blocks(sites.len(), BLOCK, |range| range.map(at).collect::<Vec<_>>());
        blocks.into_iter().flatten().collect()
    }
}

/// Whether a point is within `near` of a triangle.
fn is_on(corners: &[DVec3; 3], p: DVec3, near: f64) -> bool {
    super::penetrate::ball(&corners.map(|corner| corner - p), near)
}
