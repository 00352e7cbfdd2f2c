//! Checks of a mesh: which faults it has, where, and which of them block labeling.
//!
//! A mesh can be labeled if it bounds one solid: every edge has two triangles that pass it in
//! opposite directions, the triangles at every vertex form one fan, all hang together, and they face
//! outward. Everything is decided by indices, so corners must be welded before (the readers do);
//! only size, area and volume look at coordinates. Cost: O(n log n).

mod fault;
mod junction;
pub(crate) mod topology;

use super::{Mesh, origin};
use crate::{Error, Result};
pub use fault::Fault;
use glam::DVec3;
use std::fmt;
use topology::Topology;

/// Places reported per finding.
pub(crate) const N_PLACES: usize = 5;

/// Triangles lower than this fraction of the bounding box's diagonal are slivers: with corners
/// rounded to f32 (6e-8) their normal is uncertain by up to half a degree.
pub(crate) const SLIVER: f64 = 1e-5;

/// Where a fault is: coordinates in mm, indices as in the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Place {
    /// The mesh as a whole.
    Whole,
    /// A vertex.
    Vertex(u32, DVec3),
    /// An edge by its two ends.
    Edge([u32; 2], [DVec3; 2]),
    /// A triangle and its center.
    Triangle(u32, DVec3),
    /// A triangle and the vertex it names, which there is not.
    Corner(u32, u32),
    /// Two triangles and the middle of the box they share.
    Triangles([u32; 2], DVec3),
    /// A component: its number of triangles, and the center of the first of them.
    Component(usize, DVec3),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = |p: &DVec3| format!("({:.6}, {:.6}, {:.6})", p.x, p.y, p.z);
        match self {
            Place::Whole => write!(f, "mesh"),
            Place::Vertex(v, p) => write!(f, "vertex {v} {}", at(p)),
            Place::Edge([a, b], [p, q]) => write!(f, "edge {a}–{b} {}–{}", at(p), at(q)),
            Place::Triangle(t, p) => write!(f, "triangle {t} at {}", at(p)),
            Place::Corner(t, v) => write!(f, "triangle {t}, vertex {v}"),
            Place::Triangles([s, t], p) => write!(f, "triangles {s} and {t} at {}", at(p)),
            Place::Component(n, p) => write!(f, "component of {n} triangles at {}", at(p)),
        }
    }
}

/// One kind of fault with all its places counted and the first few named.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Finding {
    /// What is wrong.
    pub fault: Fault,
    /// How often.
    pub count: usize,
    /// The first few places, in index order.
    pub places: Vec<Place>,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.count, self.fault.words(self.count))
    }
}

/// The result of [`check`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MeshReport {
    /// Number of vertices.
    pub n_vertices: usize,
    /// Number of triangles.
    pub n_triangles: usize,
    /// Number of pieces that share no edge.
    pub n_components: usize,
    /// V − E + F over triangles with three different corners: 2 − 2·genus for one closed body.
    pub euler: i64,
    /// Least and greatest corner of the bounding box, mm; `None` without vertices.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Surface area, mm².
    pub area_mm2: f64,
    /// Enclosed volume, mm³; meaningful if the mesh is closed, negative if it faces inward.
    pub volume_mm3: f64,
    /// Faults, the most fundamental first; none is listed with count 0.
    pub findings: Vec<Finding>,
}

impl MeshReport {
    /// The most fundamental finding that makes labels meaningless.
    pub fn blocking(&self) -> Option<&Finding> {
        self.findings.iter().find(|f| f.fault.blocks_labeling())
    }

    /// Passes if nothing blocks labeling.
    ///
    /// # Errors
    /// [`Error::Geometry`] with the place, count and remedy of the most fundamental blocking finding.
    pub fn require_labelable(&self) -> Result<()> {
        require_none(self.blocking())
    }

    /// As [`MeshReport::require_labelable`], but several components may be.
    ///
    /// # Errors
    /// As [`MeshReport::require_labelable`], of [`MeshReport::blocking_bodies`].
    pub fn require_bodies(&self) -> Result<()> {
        require_none(self.blocking_bodies())
    }

    /// [`MeshReport::blocking`], but several components may be: each of several bodies is labeled against all.
    pub fn blocking_bodies(&self) -> Option<&Finding> {
        self.findings.iter().find(|f| f.fault.blocks_bodies())
    }

    /// How often `fault` was found.
    pub fn count(&self, fault: Fault) -> usize {
        self.findings.iter().find(|f| f.fault == fault).map_or(0, |f| f.count)
    }

    /// Whether every edge has triangles on both sides.
    pub fn is_closed(&self) -> bool {
        self.count(Fault::Empty) == 0 && self.count(Fault::OpenEdge) == 0
    }
}

/// Examines everything but self-intersections, which [`super::intersect`] finds. Any mesh may be given: one
/// that names missing vertices has that finding alone, and no numbers but those of its elements.
pub fn check(mesh: &Mesh) -> MeshReport {
    if mesh.face_without_vertex().is_some() {
        return without_vertices(mesh);
    }
    let topology = Topology::of(mesh);
    let mut found = Findings::default();
    if topology.is_empty() {
        found.add(Fault::Empty, Place::Whole);
    }
    for (v, place) in mesh.vertices.iter().enumerate().filter(|(_, place)| !place.is_finite()) {
        found.add(Fault::NotFinite, Place::Vertex(v as u32, *place));
    }
    check_edges(mesh, &topology, &mut found);
    for vertex in junction::t_junctions(mesh, &topology) {
        found.add(Fault::TJunction, Place::Vertex(vertex, mesh.vertices[vertex as usize]));
    }
    for vertex in topology.split_vertices(mesh) {
        found.add(Fault::NonManifoldVertex, Place::Vertex(vertex, mesh.vertices[vertex as usize]));
    }
    let n_components = check_components(mesh, &topology, &mut found);
    check_shapes(mesh, &mut found);
    MeshReport {
        n_vertices: mesh.vertices.len(),
        n_triangles: mesh.triangles.len(),
        n_components,
        euler: topology.euler(mesh),
        bounds: mesh.bounds(),
        area_mm2: mesh.area(),
        volume_mm3: volume(mesh),
        findings: found.sorted(),
    }
}

/// Enclosed volume, mm³; of a part far from the origin about a local one, so that it keeps its digits.
fn volume(mesh: &Mesh) -> f64 {
    let Some(at) = origin::local_origin(mesh) else { return mesh.volume() };
    let mut near = mesh.clone();
    origin::make_relative(&mut near, at);
    near.volume()
}

/// Per triangle, the number of the piece it belongs to: pieces share no edge, and are numbered by their first triangle.
/// Triangles without three different corners belong to piece 0.
///
/// # Errors
/// If a triangle names a missing vertex.
pub fn bodies(mesh: &Mesh) -> Result<Vec<u32>> {
    if let Some(face) = mesh.face_without_vertex() {
        let found = "names a vertex that the mesh lacks";
        return Err(Error::geometry(format!("face {face}"), found, "check the file"));
    }
    let mut body = vec![0; mesh.triangles.len()];
    for (k, faces) in Topology::of(mesh).components().iter().enumerate() {
        faces.iter().for_each(|&f| body[f as usize] = k as u32);
    }
    Ok(body)
}

/// MeshReport of a mesh with triangles that name missing vertices.
fn without_vertices(mesh: &Mesh) -> MeshReport {
    let mut found = Findings::default();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        if let Some(v) = triangle.iter().find(|v| **v as usize >= mesh.vertices.len()) {
            found.add(Fault::MissingVertex, Place::Corner(t as u32, *v));
        }
    }
    MeshReport {
        n_vertices: mesh.vertices.len(),
        n_triangles: mesh.triangles.len(),
        n_components: 0,
        euler: 0,
        bounds: mesh.bounds(),
        area_mm2: 0.0,
        volume_mm3: 0.0,
        findings: found.0,
    }
}

fn require_none(blocking: Option<&Finding>) -> Result<()> {
    match blocking {
        None => Ok(()),
        Some(finding) => Err(Error::geometry(
            finding.places[0].to_string(),
            finding.to_string(),
            finding.fault.remedy(),
        )),
    }
}

/// Passes meshes that bound one solid and face outward.
///
/// # Errors
/// As [`MeshReport::require_labelable`].
pub fn require_labelable(mesh: &Mesh) -> Result<()> {
    check(mesh).require_labelable()
}

#[derive(Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn add(&mut self, fault: Fault, place: Place) {
        let known = self.0.iter().position(|f| f.fault == fault);
        let i = known.unwrap_or_else(|| {
            self.0.push(Finding { fault, count: 0, places: Vec::new() });
            self.0.len() - 1
        });
        let finding = &mut self.0[i];
        finding.count += 1;
        if finding.places.len() < N_PLACES {
            finding.places.push(place);
        }
    }

    fn sorted(mut self) -> Vec<Finding> {
        self.0.sort_by_key(|f| f.fault);
        self.0
    }
}

fn check_edges(mesh: &Mesh, topology: &Topology, found: &mut Findings) {
    for uses in topology.edges() {
        let fault = match uses {
            [_] => Fault::OpenEdge,
            [a, b] if a.forward == b.forward => Fault::InconsistentEdge,
            [_, _] => continue,
            _ => Fault::NonManifoldEdge,
        };
        let ends = uses[0].ends();
        found.add(fault, Place::Edge(ends, ends.map(|v| mesh.vertices[v as usize])));
    }
}

/// Counts components; several of them, and those that are closed but face inward and are no voids, are
/// findings.
fn check_components(mesh: &Mesh, topology: &Topology, found: &mut Findings) -> usize {
    let components = topology.components();
    let mut open = vec![false; mesh.triangles.len()];
    topology.unbalanced().flatten().for_each(|u| open[u.face as usize] = true);
    let mut inward = Vec::new();
    let mut outer = None::<(f64, [DVec3; 2])>;
    for faces in &components {
        let place = Place::Component(faces.len(), center(mesh, faces[0] as usize));
        if components.len() > 1 {
            found.add(Fault::ManyComponents, place);
        }
        if faces.iter().any(|f| open[*f as usize]) {
            continue;
        }
        let (volume, bounds) = (volume_of(mesh, faces), bounds_of(mesh, faces));
        if volume < 0.0 {
            inward.push((place, bounds));
        } else if outer.is_none_or(|(largest, _)| volume > largest) {
            outer = Some((volume, bounds));
        }
    }
    for (place, [low, high]) in inward {
        // A void within the largest body rightly faces inward.
        let within = |(_, [l, h]): (f64, [DVec3; 2])| low.cmpge(l).all() && high.cmple(h).all();
        if !outer.is_some_and(within) {
            found.add(Fault::Inward, place);
        }
    }
    components.len()
}

fn check_shapes(mesh: &Mesh, found: &mut Findings) {
    let sliver = SLIVER * mesh.diagonal();
    for f in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(f);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let height = mesh.area_vector(f).length() / longest;
        if !mesh.has_area(f) {
            found.add(Fault::Degenerate, Place::Triangle(f as u32, center(mesh, f)));
        } else if height < sliver {
            found.add(Fault::Sliver, Place::Triangle(f as u32, center(mesh, f)));
        }
    }
}

/// Volume between some triangles and the first corner of the first, mm³: that of the solid if they
/// are closed. Near the corner, so that a part far from the origin keeps its digits.
pub(crate) fn volume_of(mesh: &Mesh, faces: &[u32]) -> f64 {
    let origin = mesh.corners(faces[0] as usize)[0];
    let six = |f: &u32| {
        let [a, b, c] = mesh.corners(*f as usize).map(|v| v - origin);
        a.dot(b.cross(c))
    };
    faces.iter().map(six).sum::<f64>() / 6.0
}

/// Least and greatest corner of the box around some triangles, mm.
fn bounds_of(mesh: &Mesh, faces: &[u32]) -> [DVec3; 2] {
    let corners = faces.iter().flat_map(|f| mesh.corners(*f as usize));
    let all = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    corners.fold(all, |[low, high], p| [low.min(p), high.max(p)])
}

pub(crate) fn center(mesh: &Mesh, f: usize) -> DVec3 {
    mesh.corners(f).iter().sum::<DVec3>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};

    fn faults(mesh: &Mesh) -> Vec<(Fault, usize)> {
        check(mesh).findings.iter().map(|f| (f.fault, f.count)).collect()
    }

    fn cube() -> Mesh {
        cuboid(DVec3::ONE)
    }

    /// Both meshes in one, with vertices at equal places shared.
    fn together(a: &Mesh, b: &Mesh) -> Mesh {
        let n = a.vertices.len() as u32;
        let mut both = a.clone();
        both.vertices.extend(&b.vertices);
        both.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + n)));
        crate::geom::weld::weld(&both, 0.0).unwrap()
    }

    fn moved(mesh: &Mesh, by: DVec3) -> Mesh {
        let vertices = mesh.vertices.iter().map(|v| *v + by).collect();
        Mesh { vertices, triangles: mesh.triangles.clone() }
    }

    fn turned_over(mesh: &Mesh) -> Mesh {
        let triangles = mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        Mesh { vertices: mesh.vertices.clone(), triangles }
    }

    #[test]
    fn good_solids_have_no_findings_and_the_right_genus() {
        let report = check(&cube());
        assert_eq!((report.findings.len(), report.n_components, report.euler), (0, 1, 2));
        let torus = torus(3.0, 1.0, 30, 20);
        assert_eq!((faults(&torus), check(&torus).euler), (vec![], 0));
        assert!(require_labelable(&moved(&torus, DVec3::splat(1e6))).is_ok());
    }

    #[test]
    fn corners_without_vertices_and_vertices_without_a_place_are_findings() {
        let mut mesh = cube();
        mesh.triangles[3][2] = 8;
        mesh.triangles[7] = [u32::MAX; 3];
        assert_eq!(faults(&mesh), [(Fault::MissingVertex, 2)]);
        let message = require_labelable(&mesh).unwrap_err().to_string();
        assert!(message.starts_with("triangle 3, vertex 8: 2 triangles that name"), "{message}");
        let mut mesh = cube();
        mesh.vertices[6].z = f64::INFINITY;
        assert_eq!(faults(&mesh)[0], (Fault::NotFinite, 1));
        assert!(require_labelable(&mesh).unwrap_err().to_string().starts_with("vertex 6"));
    }

    #[test]
    fn a_missing_triangle_is_three_open_edges_with_their_coordinates() {
        let mut mesh = cube();
        mesh.triangles.remove(0);
        let report = check(&mesh);
        assert_eq!(faults(&mesh), [(Fault::OpenEdge, 3)]);
        assert!(!report.is_closed());
        let message = require_labelable(&mesh).unwrap_err().to_string();
        assert!(message.contains("edge 0–1 (0.000000, 0.000000, 0.000000)"), "{message}");
        assert!(message.contains("3 open edges") && message.contains("--repair"), "{message}");
    }

    #[test]
    fn a_turned_triangle_and_a_turned_solid_are_told_apart() {
        let mut mesh = cube();
        mesh.triangles[3].swap(0, 1);
        assert_eq!(faults(&mesh), [(Fault::InconsistentEdge, 3)]);
        assert_eq!(faults(&turned_over(&cube())), [(Fault::Inward, 1)]);
        let mut open = turned_over(&cube());
        open.triangles.pop();
        assert_eq!(faults(&open), [(Fault::OpenEdge, 3)]);
        assert!(require_labelable(&turned_over(&cube())).is_err());
    }

    #[test]
    fn touching_and_separate_cubes_are_told_apart() {
        let beside = |by| faults(&together(&cube(), &moved(&cube(), by)));
        let split = (Fault::ManyComponents, 2);
        assert_eq!(beside(DVec3::new(3.0, 0.0, 0.0)), [split]);
        assert_eq!(beside(DVec3::ONE), [(Fault::NonManifoldVertex, 1), split]);
        assert_eq!(beside(DVec3::new(1.0, 1.0, 0.0)), [(Fault::NonManifoldEdge, 1)]);
    }

    #[test]
    fn a_void_within_a_body_rightly_faces_inward_but_an_inward_body_beside_it_does_not() {
        let block = cuboid(DVec3::splat(5.0));
        let hollow = |at: f64| together(&block, &moved(&turned_over(&cube()), DVec3::splat(at)));
        assert_eq!(faults(&hollow(2.0)), [(Fault::ManyComponents, 2)]);
        assert_eq!(faults(&hollow(7.0)), [(Fault::ManyComponents, 2), (Fault::Inward, 1)]);
    }

    #[test]
    fn triangles_without_area_are_reported_but_do_not_block() {
        let mut mesh = cube();
        mesh.triangles.push([1, 1, 2]);
        assert_eq!(faults(&mesh), [(Fault::Degenerate, 1)]);
        assert!(require_labelable(&mesh).is_ok());
        let mut flat = cube();
        flat.vertices.push(DVec3::new(0.5, 0.0, 1e-7));
        let f = flat.triangles.iter().position(|t| t.contains(&0) && t.contains(&1)).unwrap();
        let ends: Vec<u32> = flat.triangles[f].to_vec();
        let at = |k: usize| ends[k % 3];
        let k = (0..3).find(|k| [at(*k), at(k + 1)].iter().all(|v| *v < 2)).unwrap();
        flat.triangles[f] = [at(k), 8, at(k + 2)];
        flat.triangles.extend([[8, at(k + 1), at(k + 2)], [at(k), at(k + 1), 8]]);
        assert_eq!(faults(&flat), [(Fault::Sliver, 1)]);
    }

    #[test]
    fn nothing_is_a_finding_too() {
        assert_eq!(faults(&Mesh::default()), [(Fault::Empty, 1)]);
        let point = Mesh { vertices: vec![DVec3::ONE], triangles: vec![[0, 0, 0]] };
        assert_eq!(faults(&point), [(Fault::Empty, 1), (Fault::Degenerate, 1)]);
    }
}
