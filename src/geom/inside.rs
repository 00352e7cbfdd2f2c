//! The inside test: which points of a lattice lie inside a closed mesh.
//!
//! The winding number of a point is the signed count of triangles above it: a triangle that faces up
//! counts +1, one that faces down −1. Whether a triangle is above a point is decided exactly: the
//! signs of the two determinants involved are computed without rounding error (Shewchuk 1997), and
//! a zero – a ray through an edge or vertex, a point on the surface – is decided as if every point
//! were moved by (ε, ε², ε³) with ε too small to matter (Edelsbrunner and Mücke 1990). Every edge is
//! therefore passed on exactly one side, and no ray is ever special.
//!
//! ```
//! use deepmill::access::{LabelOptions, Obstacles, Queries, label};
//! use deepmill::cutter::{Cutter, CutterParams};
//! use deepmill::directions::{DirectionSet, Directions};
//! use deepmill::geom::inside::{Lattice, lattice_inside};
//! use deepmill::geom::sites::{SiteOptions, sample};
//! use deepmill::geom::solids;
//!
//! // Where in the stock around a part can the cutter's tip go?
//! let part = solids::torus(20.0, 8.0, 60, 30);
//! let (low, high) = part.bounds().unwrap();
//! let lattice = Lattice::with_about(low, high, 1000)?;
//! let inside = lattice_inside(&part, &lattice)?;
//! let outside = (0..lattice.len()).filter(|&n| !inside[n]);
//! let stock: Vec<_> = outside.map(|n| lattice.point(n).as_vec3()).collect();
//!
//! let sites = sample(&part, &SiteOptions::default().with_n_sites(2000))?;
//! let lengths = CutterParams { cr_mm: 3.0, ch_mm: 20.0, fr_mm: 25.0, fh_mm: 30.0 };
//! let cutter = Cutter::ball_end(lengths)?;
//! let directions = Directions::new(DirectionSet::FibonacciHemisphere { n_dirs: 50 })?;
//! let obstacles = Obstacles::Points(&sites.points);
//! let queries = Queries::Volume(&stock);
//! let labels = label(queries, obstacles, &cutter, &directions, &LabelOptions::default())?;
//! let n_blocked = labels.answers.n_inaccessible();
//! assert!(0 < n_blocked && n_blocked < stock.len());
//! # Ok::<(), deepmill::Error>(())
//! ```
//!
//! Points above one another share the search for their triangles. Cost for a lattice of m columns of
//! k points over n triangles: O(n + m·(t·log k + k)) with t the triangles near a column.

use super::check::topology::Topology;
use super::mesh::WITHIN_1E12_MM;
use super::{Mesh, check::Place};
use crate::exec::{memory, par};
use crate::spatial::AabbGrid;
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use robust::{Coord, Coord3D, orient2d, orient3d};
use std::collections::BTreeMap;

/// Columns per parallel task.
const BLOCK: usize = 64;
/// A point at worst, alone in its column: that column with a winding number, whether it is inside, its place, and the
/// answers about it.
const POINT_BYTES: usize = 96;
/// A triangle in the grid.
const TRIANGLE_BYTES: usize = 256;
/// Most points of a lattice.
const MAX_POINTS: u64 = 1 << 30;

/// Points `origin + step·(i, j, k)`, numbered with i fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// The first point, mm.
    pub origin: DVec3,
    /// Distance of neighbors, mm.
    pub step_mm: f64,
    /// Number of points along x, y and z.
    pub counts: [usize; 3],
}

impl Lattice {
    /// The midpoints of cubes of edge `step_mm` that cover the box from `low` to `high`, centered.
    ///
    /// # Errors
    /// If a corner is not finite or `low` is above `high`, the step is not a positive number, or there would be more
    /// than 2³⁰ points.
    pub fn covering(low: DVec3, high: DVec3, step_mm: f64) -> Result<Self> {
        if !(low.is_finite() && high.is_finite() && low.cmple(high).all()) {
            let found = format!("{low} to {high}");
            let expected = "finite corners, the least first";
            return Err(Error::argument("box", found, expected, "take the bounds of the part"));
        }
        if !(step_mm > 0.0 && step_mm.is_finite()) {
            let expected = "a positive length in mm";
            return Err(Error::argument("step", step_mm, expected, "try a hundredth of the part"));
        }
        let counts = ((high - low) / step_mm).ceil().max(DVec3::ONE);
        let n_points = counts.element_product();
        if n_points.is_nan() || n_points > MAX_POINTS as f64 {
            return Err(Error::TooLarge {
                operation: "classifying the points of a lattice",
                needed_bytes: (n_points * POINT_BYTES as f64) as u64,
                limit_bytes: MAX_POINTS * POINT_BYTES as u64,
                remedy: "choose a wider step".into(),
            });
        }
        let origin = 0.5 * (low + high - (counts - 1.0) * step_mm);
        Ok(Lattice { origin, step_mm, counts: counts.to_array().map(|c| c as usize) })
    }

    /// [`Lattice::covering`] with about `n_points` points: the step is the edge of a cube with that
    /// share of the box.
    ///
    /// # Errors
    /// If the box has no volume, `n_points` is 0, or there would be more than 2³⁰ points.
    pub fn with_about(low: DVec3, high: DVec3, n_points: usize) -> Result<Self> {
        let volume = (high - low).element_product();
        if !(volume > 0.0 && volume.is_finite()) || n_points == 0 {
            let found = format!("{n_points} points in a volume of {volume} mm³");
            let expected = "at least one point, and a box with a volume";
            return Err(Error::argument("volume samples", found, expected, "check the part"));
        }
        Lattice::covering(low, high, libm::cbrt(volume / n_points as f64))
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point number `n`, mm.
    pub fn point(&self, n: usize) -> DVec3 {
        let [nx, ny, _] = self.counts;
        self.at([n % nx, n / nx % ny, n / nx / ny])
    }

    /// The point of these numbers along x, y and z, mm.
    pub(crate) fn at(&self, ijk: [usize; 3]) -> DVec3 {
        self.origin + self.step_mm * DVec3::from_array(ijk.map(|c| c as f64))
    }
}

/// For every point of the lattice, in its order, whether it lies inside the mesh (winding number not
/// zero; for a mesh without self-intersections that is the plain meaning).
///
/// # Errors
/// If a face names a missing vertex, or a vertex is not finite or beyond 10¹² mm; if the mesh is not closed and
/// consistently oriented, so that there is no inside; if the points and the answers about them do not fit into the
/// memory.
pub fn lattice_inside(mesh: &Mesh, lattice: &Lattice) -> Result<Vec<bool>> {
    let points = memory::product([lattice.len(), POINT_BYTES]);
    let triangles = memory::product([mesh.triangles.len(), TRIANGLE_BYTES]);
    let needed = points.saturating_add(triangles);
    memory::require("classifying the points of a lattice", needed, "choose a wider step")?;
    let grid = TriangleGrid::new(mesh)?;
    let [nx, ny, nz] = lattice.counts;
    let heights: Vec<f64> = (0..nz).map(|k| lattice.at([0, 0, k]).z).collect();
    let blocks = par::map_blocks(nx * ny, BLOCK, |range| {
        let column = |c: usize| grid.windings(lattice.at([c % nx, c / nx, 0]).truncate(), &heights);
        range.map(column).collect::<Vec<_>>()
    });
    let mut inside = vec![false; lattice.len()];
    for (c, windings) in blocks.into_iter().flatten().enumerate() {
        for (k, winding) in windings.into_iter().enumerate() {
            inside[k * nx * ny + c] = winding != 0;
        }
    }
    Ok(inside)
}

/// Calls `take` with every column of a lattice, by its number `i + counts[0]·j`, and which of its points lie inside a
/// closed mesh; columns of a block one after another, blocks side by side.
///
/// # Errors
/// As [`lattice_inside`], but for the memory.
pub(crate) fn columns_inside(
    mesh: &Mesh,
    lattice: &Lattice,
    take: impl Fn(usize, &[bool]) + Sync,
) -> Result<()> {
    let grid = TriangleGrid::new(mesh)?;
    let [nx, ny, nz] = lattice.counts;
    let heights: Vec<f64> = (0..nz).map(|k| lattice.at([0, 0, k]).z).collect();
    par::map_blocks(nx * ny, BLOCK, |range| {
        for c in range {
            let at = lattice.at([c % nx, c / nx, 0]).truncate();
            let inside: Vec<bool> = grid.windings(at, &heights).iter().map(|w| *w != 0).collect();
            take(c, &inside);
        }
    });
    Ok(())
}

/// How often the mesh winds around each point, mm: 1 inside a solid, 0 outside.
///
/// # Errors
/// As [`lattice_inside`]; if a point is not finite.
pub fn windings(mesh: &Mesh, points: &[DVec3]) -> Result<Vec<i32>> {
    if let Some(i) = points.iter().position(|p| !p.is_finite()) {
        let found = format!("position {}", points[i]);
        return Err(Error::geometry(format!("point {i}"), found, "give finite coordinates in mm"));
    }
    let grid = TriangleGrid::new(mesh)?;
    let one = |i: usize| grid.windings(points[i].truncate(), &[points[i].z])[0];
    let blocks = par::map_blocks(points.len(), BLOCK, |range| range.map(one).collect::<Vec<_>>());
    Ok(blocks.into_iter().flatten().collect())
}

/// Groups of triangles, each closed by itself.
pub(crate) struct TriangleGroups {
    grid: TriangleGrid,
    /// Of each triangle of the grid.
    group: Vec<u32>,
}

impl TriangleGroups {
    /// `group` is each triangle's group, `u32::MAX` for none.
    pub fn new(mesh: &Mesh, group: &[u32]) -> Self {
        let grouped = || (0..mesh.triangles.len()).filter(|&f| group[f] != u32::MAX);
        TriangleGroups {
            grid: TriangleGrid::of(grouped().map(|f| mesh.corners(f)).collect()),
            group: grouped().map(|f| group[f]).collect(),
        }
    }

    /// How many groups but `own` wind around `probe` (mm).
    pub fn n_others_around(&self, probe: DVec3, own: u32) -> usize {
        self.others_around(probe, own).len()
    }

    /// The groups but `own` that wind around `probe` (mm), ascending.
    pub fn others_around(&self, probe: DVec3, own: u32) -> Vec<u32> {
        let mut winding = BTreeMap::<u32, i32>::new();
        for (f, facing) in self.grid.crossings(probe.truncate()) {
            let of = self.group[f];
            if of != own && is_below(probe, &self.grid.triangles[f], facing) {
                *winding.entry(of).or_default() += facing;
            }
        }
        winding.into_iter().filter(|(_, w)| *w != 0).map(|(of, _)| of).collect()
    }
}

/// The triangles of a mesh, by where they lie seen from above.
struct TriangleGrid {
    triangles: Vec<[DVec3; 3]>,
    boxes: AabbGrid,
}

impl TriangleGrid {
    fn new(mesh: &Mesh) -> Result<Self> {
        mesh.check_within(&WITHIN_1E12_MM)?;
        require_balanced(mesh)?;
        Ok(TriangleGrid::over(mesh))
    }

    fn over(mesh: &Mesh) -> Self {
        TriangleGrid::of((0..mesh.triangles.len()).map(|f| mesh.corners(f)).collect())
    }

    fn of(triangles: Vec<[DVec3; 3]>) -> Self {
        let flat = |v: DVec3| v.truncate().extend(0.0);
        let bounds = |[a, b, c]: &[DVec3; 3]| (flat(a.min(*b).min(*c)), flat(a.max(*b).max(*c)));
        let boxes = AabbGrid::new(&triangles.iter().map(bounds).collect::<Vec<_>>());
        TriangleGrid { triangles, boxes }
    }

    /// The triangles that the vertical line through `at` meets, with their facing.
    fn crossings(&self, at: DVec2) -> impl Iterator<Item = (usize, i32)> {
        let near = self.boxes.in_cell(self.boxes.cell_of(at.extend(0.0)));
        let facing = move |f: &u32| (*f as usize, facing_above(&self.triangles[*f as usize], at));
        near.iter().map(facing).filter(|(_, facing)| *facing != 0)
    }

    /// Winding numbers of the points at ascending `heights` above `at`.
    fn windings(&self, at: DVec2, heights: &[f64]) -> Vec<i32> {
        // changes[k]: by how much the winding number falls from point k − 1 to point k.
        let mut changes = vec![0; heights.len() + 1];
        let mut winding = 0;
        for (f, facing) in self.crossings(at) {
            let below = |z: &f64| is_below(at.extend(*z), &self.triangles[f], facing);
            winding += facing;
            changes[heights.partition_point(below)] += facing;
        }
        let step = |change: &i32| {
            winding -= change;
            winding
        };
        changes[..heights.len()].iter().map(step).collect()
    }
}

/// Passes meshes in which every edge is used equally often in both directions.
fn require_balanced(mesh: &Mesh) -> Result<()> {
    match Topology::of(mesh).unbalanced().next() {
        None => Ok(()),
        Some(uses) => {
            let ends = uses[0].ends();
            Err(Error::geometry(
                Place::Edge(ends, ends.map(|v| mesh.vertices[v as usize])).to_string(),
                "the mesh is open or its triangles face different sides, so it has no inside",
                "repair it (`geom::repair::repair`; `deepmill check --repair` at the command line)",
            ))
        }
    }
}

/// +1 or −1 if the vertical line through `at` + (ε, ε²) meets the triangle and that faces up or down,
/// 0 if it misses.
fn facing_above([a, b, c]: &[DVec3; 3], at: DVec2) -> i32 {
    let outside = |k: fn(DVec2) -> f64| {
        let [a, b, c] = [a, b, c].map(|v| k(v.truncate()));
        k(at) < a.min(b).min(c) || k(at) > a.max(b).max(c)
    };
    if outside(|v| v.x) || outside(|v| v.y) {
        return 0;
    }
    let first = side(a.truncate(), b.truncate(), at);
    if first != side(b.truncate(), c.truncate(), at)
        || first != side(c.truncate(), a.truncate(), at)
    {
        return 0;
    }
    first
}

/// On which side of the line from `a` to `b` the point `at` + (ε, ε²) lies: +1 left, −1 right, 0 if
/// the two are one.
fn side(a: DVec2, b: DVec2, at: DVec2) -> i32 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    // (b − a) × (ε, ε²) decides when the point is on the line.
    let terms = [orient2d(coord(a), coord(b), coord(at)), a.y - b.y, b.x - a.x];
    first_sign(terms)
}

/// Whether `point` + (ε, ε², ε³) is below a triangle that the vertical line through it meets and that
/// has the given facing.
fn is_below(point: DVec3, [a, b, c]: &[DVec3; 3], facing: i32) -> bool {
    let coord = |p: &DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    let plane = orient3d(coord(a), coord(b), coord(c), coord(&point));
    // The normal's components, which decide when the point is on the plane; moving along the normal
    // is moving up, away from below.
    let component = |u: fn(&DVec3) -> f64, v: fn(&DVec3) -> f64| {
        let [a, b, c] = [a, b, c].map(|p| Coord { x: u(p), y: v(p) });
        -orient2d(a, b, c)
    };
    let sign = if plane != 0.0 {
        first_sign([plane, 0.0, 0.0])
    } else {
        first_sign([
            component(|p| p.y, |p| p.z),
            component(|p| p.z, |p| p.x),
            component(|p| p.x, |p| p.y),
        ])
    };
    sign * facing > 0
}

fn first_sign(terms: [f64; 3]) -> i32 {
    match terms.into_iter().find(|t| *t != 0.0) {
        Some(term) if term > 0.0 => 1,
        Some(_) => -1,
        None => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, prism, torus};
    use crate::geom::weld::weld;
    use crate::numeric::rng::{Purpose, Stream};

    /// Winding number by the solid angle of every triangle (Van Oosterom and Strackee 1983), and
    /// whether the point lies on none of them.
    fn solid_angle_winding(mesh: &Mesh, point: DVec3) -> (f64, bool) {
        let angle = |f: usize| {
            let [a, b, c] = mesh.corners(f).map(|v| v - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * libm::atan2(a.dot(b.cross(c)), below)
        };
        let angles: Vec<f64> = (0..mesh.triangles.len()).map(angle).collect();
        let winding = angles.iter().sum::<f64>() / (4.0 * std::f64::consts::PI);
        // A triangle fills half the sky of a point on it.
        let off = angles.iter().all(|a| a.abs() < std::f64::consts::TAU - 1e-6);
        (winding, off && (winding - winding.round()).abs() < 1e-6)
    }

    /// Compares with the solid angle where that is clear; returns how many points were unclear.
    fn compare(mesh: &Mesh, lattice: &Lattice) -> usize {
        let inside = lattice_inside(mesh, lattice).unwrap();
        let mut unclear = 0;
        for (n, inside) in inside.iter().enumerate() {
            let (winding, clear) = solid_angle_winding(mesh, lattice.point(n));
            unclear += usize::from(!clear);
            assert!(!clear || *inside == (winding.round() != 0.0), "{}", lattice.point(n));
        }
        unclear
    }

    fn stairs() -> Mesh {
        let corners = [[0, 0], [3, 0], [3, 1], [2, 1], [2, 2], [1, 2], [1, 3], [0, 3]];
        let outline = corners.map(|[x, y]| DVec2::new(f64::from(x), f64::from(y)));
        let cap = [[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5], [0, 5, 7], [5, 6, 7]];
        prism(&outline, &cap, 2.0)
    }

    #[test]
    fn lattices_through_edges_and_vertices_agree_with_the_solid_angle() {
        let solids = [cuboid(DVec3::new(2.0, 3.0, 1.0)), stairs(), torus(3.0, 1.0, 16, 8)];
        for mesh in &solids {
            for (step, shift) in [(0.25, 0.0), (0.5, 0.25), (0.37, 0.1)] {
                let (low, high) = mesh.bounds().unwrap();
                let mut lattice = Lattice::covering(low - 0.5, high + 0.5, step).unwrap();
                // Whole steps from the corner: rays run along walls, through edges and vertices.
                lattice.origin = low - 0.5 + shift;
                let unclear = compare(mesh, &lattice);
                assert!(unclear * 3 < lattice.len(), "{unclear} of {}", lattice.len());
            }
        }
    }

    #[test]
    fn turned_solids_agree_with_the_solid_angle_at_random_points() {
        let mut stream = Stream::new(6, 0, 0, Purpose::Probe);
        for mut mesh in [stairs(), torus(3.0, 1.0, 16, 8)] {
            let turn = glam::DMat3::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, 2.0);
            mesh.vertices.iter_mut().for_each(|v| *v = turn * *v);
            let points: Vec<DVec3> = (0..4000)
                .map(|_| DVec3::from_array([0; 3].map(|_| stream.range(-4.0, 4.0))))
                .collect();
            for (point, winding) in points.iter().zip(windings(&mesh, &points).unwrap()) {
                let (expected, clear) = solid_angle_winding(&mesh, *point);
                assert!(clear && (expected - f64::from(winding)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn points_on_the_surface_belong_to_exactly_one_of_two_touching_boxes() {
        // Two boxes that fill a bigger one: every lattice point is in one of them, faces included.
        let left = cuboid(DVec3::new(2.0, 2.0, 2.0));
        let mut right = cuboid(DVec3::new(2.0, 2.0, 2.0));
        right.vertices.iter_mut().for_each(|v| v.x += 2.0);
        let lattice = Lattice { origin: DVec3::splat(-1.0), step_mm: 0.5, counts: [13, 9, 9] };
        let (a, b) =
            (lattice_inside(&left, &lattice).unwrap(), lattice_inside(&right, &lattice).unwrap());
        let n_inside = a.iter().zip(&b).map(|(a, b)| {
            assert!(!(a & b));
            usize::from(a | b)
        });
        // 8 × 4 × 4 half-open cells of the lattice.
        assert_eq!(n_inside.sum::<usize>(), 8 * 4 * 4);
    }

    #[test]
    fn overlapping_and_inward_bodies_count() {
        let mut two = cuboid(DVec3::splat(2.0));
        two.vertices.extend(cuboid(DVec3::splat(2.0)).vertices.iter().map(|v| *v + 1.0));
        two.triangles.extend(cuboid(DVec3::ONE).triangles.iter().map(|t| t.map(|v| v + 8)));
        let points = [0.5, 1.5, 2.5, 3.5].map(DVec3::splat);
        assert_eq!(windings(&two, &points).unwrap(), [1, 2, 1, 0]);
        two.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(windings(&two, &points).unwrap(), [-1, -2, -1, 0]);
    }

    #[test]
    fn an_open_mesh_has_no_inside_and_a_bad_step_no_lattice() {
        let mut mesh = cuboid(DVec3::ONE);
        mesh.triangles.pop();
        let message = windings(&mesh, &[DVec3::ZERO]).unwrap_err().to_string();
        assert!(message.contains("edge") && message.contains("no inside"));
        assert!(windings(&weld(&mesh, 0.0).unwrap(), &[]).is_err());
        assert!(Lattice::covering(DVec3::ZERO, DVec3::ONE, 0.0).is_err());
        assert!(Lattice::covering(DVec3::ZERO, DVec3::ONE, 1e-4).is_err());
        let about = |n| Lattice::with_about(DVec3::ZERO, DVec3::new(4.0, 2.0, 1.0), n);
        assert_eq!(about(1000).unwrap().counts, [20, 10, 5]);
        assert!(about(0).is_err() && Lattice::with_about(DVec3::ZERO, DVec3::X, 9).is_err());
    }

    #[test]
    fn classification_is_the_same_on_any_number_of_threads() {
        let mesh = torus(3.0, 1.0, 60, 30);
        let (low, high) = mesh.bounds().unwrap();
        let lattice = Lattice::covering(low, high, 0.1).unwrap();
        let run = |n| par::with_threads(n, || lattice_inside(&mesh, &lattice).unwrap()).unwrap();
        assert_eq!(run(1), run(4));
        let share = run(2).iter().filter(|i| **i).count() as f64 * lattice.step_mm.powi(3);
        assert!((share / mesh.volume() - 1.0).abs() < 0.01);
    }
}
