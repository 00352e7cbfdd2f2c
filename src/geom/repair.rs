//! Repair of small faults of a mesh, with a report: weld, drop, turn.
//!
//! Nothing here invents surface: holes stay open, and overlapping bodies stay as they are.

mod loose;

use super::check::topology::{Topology, has_three_corners};
use super::check::{Fault, check, volume_of};
use super::{Mesh, inside, weld};
use crate::Result;
use crate::exec::par;
use glam::DVec3;
pub use loose::drop_loose;
use std::collections::{HashMap, HashSet};
use std::fmt;

/// Tolerance with which gaps are welded, as a fraction of the diagonal; see
/// [`weld::DEFAULT_TOLERANCE`] for how far one can go.
pub(crate) const GAP_TOLERANCE: f64 = 1e-5;

/// Something that a repair did or found it could not do.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Change {
    /// Vertices joined with others, and by which fraction of the diagonal they were apart at most.
    Welded {
        /// Vertices that are gone.
        n_vertices: usize,
        /// The tolerance.
        tolerance: f64,
    },
    /// Triangles dropped because a corner occurs twice in them.
    DroppedCollapsed(usize),
    /// Triangles without area, or thinner than a sliver, dropped because they bound nothing.
    DroppedLoose(usize),
    /// Triangles dropped because another one has the same corners: copies, and pairs that face
    /// opposite sides and enclose nothing.
    DroppedDoubled(usize),
    /// Triangles turned over to face the same side as their neighbors.
    TurnedTriangles(usize),
    /// Components of which all triangles were turned, to face out of the solid.
    TurnedComponents(usize),
    /// Shells within a body that faced outward, turned: they bound cavities.
    Cavities(usize),
    /// Bodies that overlap or lie on each other were joined.
    Joined {
        /// Bodies that were joined.
        n_bodies: usize,
        /// What they became.
        n_into: usize,
        /// Their surface that was inside another, mm²; of walls that lie on each other both.
        inner_mm2: f64,
    },
    /// Components whose triangles cannot be turned to agree, as on a Möbius strip.
    Unorientable(usize),
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |n: usize, noun: &str| format!("{n} {noun}{}", if n == 1 { "" } else { "s" });
        match *self {
            Change::Welded { n_vertices, tolerance } => write!(
                f,
                "joined {n_vertices} {} with others closer than {tolerance:e} of the diagonal",
                if n_vertices == 1 { "vertex" } else { "vertices" }
            ),
            Change::DroppedCollapsed(n) => {
                write!(f, "dropped {} with a corner used twice", count(n, "triangle"))
            }
            Change::DroppedLoose(n) => {
                let verb = if n == 1 { "bounds" } else { "bound" };
                write!(f, "left out {} without area that {verb} nothing", count(n, "triangle"))
            }
            Change::DroppedDoubled(n) => write!(f, "dropped {}", count(n, "doubled triangle")),
            Change::TurnedTriangles(n) => {
                write!(f, "turned {} to agree with neighbors", count(n, "triangle"))
            }
            Change::TurnedComponents(n) => {
                write!(f, "turned {} that faced the wrong way", count(n, "component"))
            }
            Change::Cavities(n) => {
                let (verb, what) = if n == 1 { ("is", "a cavity") } else { ("are", "cavities") };
                write!(f, "{} within a body {verb} taken for {what}", count(n, "shell"))
            }
            Change::Joined { n_bodies, n_into, inner_mm2 } => write!(
                f,
                "{n_bodies} bodies that overlap or touch are joined into {n_into}: {inner_mm2:.2} mm² of their walls \
                 are inside and no surface"
            ),
            Change::Unorientable(n) => {
                write!(f, "{} cannot be oriented, left as it is", count(n, "component"))
            }
        }
    }
}

/// Welds gaps, drops triangles that collapsed or are doubled, and orients; returns what it did, which
/// is nothing for a faultless mesh.
///
/// Welding is kept only if it closes open edges without making others non-manifold.
///
/// # Errors
/// If the mesh fails [`Mesh::check`]; it is unchanged then.
pub fn repair(mesh: &mut Mesh) -> Result<Vec<Change>> {
    mesh.check()?;
    let mut changes: Vec<Change> = weld_gaps(mesh)?.into_iter().collect();
    changes.extend(drop_collapsed(mesh));
    changes.extend(drop_doubled(mesh));
    changes.extend(orient(mesh));
    Ok(changes)
}

/// Turns a mesh whose triangles agree, but all face inward. Returns the notice to show if so; any other mesh,
/// usable or not, stays as it is.
pub fn face_outward(mesh: &mut Mesh) -> Option<Change> {
    let report = check(mesh);
    let turned = report.n_components == 1
        && report.blocking().is_some_and(|finding| finding.fault == Fault::Inward);
    turned.then(|| {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        Change::TurnedComponents(1)
    })
}

fn weld_gaps(mesh: &mut Mesh) -> Result<Option<Change>> {
    let count = |mesh: &Mesh| {
        let report = check(mesh);
        (report.count(Fault::OpenEdge), report.count(Fault::NonManifoldEdge))
    };
    let before = count(mesh);
    if before.0 == 0 {
        return Ok(None);
    }
    let welded = weld::weld(mesh, GAP_TOLERANCE)?;
    let after = count(&welded);
    if after.0 >= before.0 || after.1 > before.1 {
        return Ok(None);
    }
    let n_vertices = mesh.vertices.len() - welded.vertices.len();
    *mesh = welded;
    Ok(Some(Change::Welded { n_vertices, tolerance: GAP_TOLERANCE }))
}

fn drop_collapsed(mesh: &mut Mesh) -> Option<Change> {
    let before = mesh.triangles.len();
    mesh.triangles.retain(has_three_corners);
    let n = before - mesh.triangles.len();
    (n > 0).then_some(Change::DroppedCollapsed(n))
}

/// Of triangles with the same corners, keeps one of the side that has more, or none.
fn drop_doubled(mesh: &mut Mesh) -> Option<Change> {
    let mut surplus: HashMap<[u32; 3], (i64, i64)> = HashMap::new();
    for triangle in &mesh.triangles {
        let (key, even) = sorted(*triangle);
        let entry = surplus.entry(key).or_default();
        *if even { &mut entry.0 } else { &mut entry.1 } += 1;
    }
    let before = mesh.triangles.len();
    mesh.triangles.retain(|triangle| {
        let (key, even) = sorted(*triangle);
        let Some(entry) = surplus.get_mut(&key) else { return true };
        let (mine, other) = if even { (entry.0, entry.1) } else { (entry.1, entry.0) };
        if mine <= other {
            return false;
        }
        // The first one stays; the marker makes all later ones, of either side, go.
        *entry = (0, 0);
        true
    });
    let n = before - mesh.triangles.len();
    (n > 0).then_some(Change::DroppedDoubled(n))
}

/// The corners ascending, and whether that is a rotation of their order.
fn sorted([a, b, c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut key = [a, b, c];
    key.sort_unstable();
    (key, [[a, b, c], [b, c, a], [c, a, b]].contains(&key))
}

/// Makes the triangles of each component agree, then each closed component face out of the solid:
/// away from its own inside, or toward it if it bounds a void within another.
fn orient(mesh: &mut Mesh) -> Vec<Change> {
    let topology = Topology::of(mesh);
    let components = topology.components();
    let neighbors = neighbors(&topology, mesh.triangles.len());
    let (mut n_turned, mut n_unorientable) = (0, 0);
    for faces in &components {
        match agreement(faces, &neighbors) {
            Some(turned) => {
                turned.iter().for_each(|f| mesh.triangles[*f as usize].swap(1, 2));
                n_turned += turned.len();
            }
            None => n_unorientable += 1,
        }
    }
    // Sides have changed with the triangles.
    let n_components = turn_outward(mesh, &Topology::of(mesh), &components);
    let changes = [
        (n_turned, Change::TurnedTriangles(n_turned)),
        (n_components, Change::TurnedComponents(n_components)),
        (n_unorientable, Change::Unorientable(n_unorientable)),
    ];
    changes.into_iter().filter(|(n, _)| *n > 0).map(|(_, change)| change).collect()
}

/// For every face the faces across its manifold edges, and whether they pass the edge oppositely.
fn neighbors(topology: &Topology, n_triangles: usize) -> Vec<Vec<(u32, bool)>> {
    let mut neighbors = vec![Vec::new(); n_triangles];
    for uses in topology.edges() {
        if let [a, b] = uses {
            let agree = a.forward != b.forward;
            neighbors[a.face as usize].push((b.face, agree));
            neighbors[b.face as usize].push((a.face, agree));
        }
    }
    neighbors
}

/// The fewest faces to turn so that all of a component agree; `None` if none would do. Groups that
/// hang together by non-manifold edges only are settled one by one.
fn agreement(faces: &[u32], neighbors: &[Vec<(u32, bool)>]) -> Option<Vec<u32>> {
    let mut turn: HashMap<u32, bool> = HashMap::new();
    let mut all_turned = Vec::new();
    for start in faces {
        if turn.contains_key(start) {
            continue;
        }
        turn.insert(*start, false);
        let mut group = vec![*start];
        let mut next = 0;
        while next < group.len() {
            let face = group[next];
            next += 1;
            for (other, agree) in &neighbors[face as usize] {
                let wanted = turn[&face] == *agree;
                match turn.get(other) {
                    Some(known) if *known != wanted => return None,
                    Some(_) => {}
                    None => {
                        turn.insert(*other, wanted);
                        group.push(*other);
                    }
                }
            }
        }
        let (turned, kept): (Vec<u32>, Vec<u32>) = group.into_iter().partition(|f| turn[f]);
        all_turned.extend(if turned.len() <= kept.len() { turned } else { kept });
    }
    Some(all_turned)
}

/// Turns the closed components that face the wrong way; returns how many.
fn turn_outward(mesh: &mut Mesh, topology: &Topology, components: &[Vec<u32>]) -> usize {
    let mut owner = vec![u32::MAX; mesh.triangles.len()];
    for (i, faces) in components.iter().enumerate() {
        faces.iter().for_each(|f| owner[*f as usize] = i as u32);
    }
    let open: HashSet<u32> = topology
        .unbalanced()
        .flat_map(|uses| uses.iter().map(|u| owner[u.face as usize]))
        .collect();
    owner.iter_mut().filter(|i| open.contains(i)).for_each(|i| *i = u32::MAX);
    let groups = inside::TriangleGroups::new(mesh, &owner);
    let faces_inward = |i: usize| {
        let (faces, own) = (&components[i], i as u32);
        if open.contains(&own) {
            return false;
        }
        // A body that merely overlaps another sticks out of it somewhere.
        let is_within = |probe| groups.n_others_around(probe, own) % 2 == 1;
        let is_void = extremes(mesh, faces).into_iter().all(is_within);
        (volume_of(mesh, faces) < 0.0) != is_void
    };
    let turned = par::map(components.len(), faces_inward);
    let turned = || components.iter().zip(&turned).filter(|(_, turned)| **turned);
    for f in turned().flat_map(|(faces, _)| faces) {
        mesh.triangles[*f as usize].swap(1, 2);
    }
    turned().count()
}

/// The least and greatest corners of some triangles along each axis (ties: the first).
pub(super) fn extremes(mesh: &Mesh, faces: &[u32]) -> [DVec3; 6] {
    let first = mesh.corners(faces[0] as usize)[0];
    let mut found = [first; 6];
    for corner in faces.iter().flat_map(|f| mesh.corners(*f as usize)) {
        for axis in 0..3 {
            if corner[axis] < found[axis][axis] {
                found[axis] = corner;
            }
            if corner[axis] > found[axis + 3][axis] {
                found[axis + 3] = corner;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};
    use crate::numeric::rng::{Purpose, Stream};

    fn together(a: &Mesh, b: &Mesh) -> Mesh {
        let n = a.vertices.len() as u32;
        let mut both = a.clone();
        both.vertices.extend(&b.vertices);
        both.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + n)));
        both
    }

    #[test]
    fn a_faultless_mesh_is_left_alone() {
        let mut mesh = torus(3.0, 1.0, 20, 10);
        let before = mesh.clone();
        assert_eq!(repair(&mut mesh).unwrap(), []);
        assert_eq!(face_outward(&mut mesh), None);
        assert_eq!(mesh, before);
    }

    /// Only closed components are tested for what encloses them: with all of them this would take hours.
    #[test]
    fn many_loose_triangles_are_left_as_they_are() {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let mut corner = || DVec3::from_array([0; 3].map(|_| stream.range(0.0, 100.0)));
        let n = 400_000;
        let vertices = (0..3 * n).map(|_| corner()).collect();
        let triangles = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut soup = Mesh { vertices, triangles };
        let before = soup.triangles.clone();
        repair(&mut soup).unwrap();
        assert_eq!(soup.triangles, before);
    }

    #[test]
    fn gaps_doubles_and_turned_triangles_are_mended_and_named() {
        let solid = torus(3.0, 1.0, 20, 10);
        let mut broken = solid.clone();
        broken.triangles.extend([[0, 1, 1], broken.triangles[250]]);
        broken.triangles[5].swap(0, 1);
        broken.triangles[90].swap(0, 1);
        let moved = broken.vertices[3] + DVec3::splat(2e-5);
        broken.vertices.push(moved);
        let f = broken.triangles.iter().rposition(|t| t.contains(&3)).unwrap();
        broken.triangles[f] = broken.triangles[f].map(|v| if v == 3 { 200 } else { v });
        let changes = repair(&mut broken).unwrap();
        assert_eq!(
            changes,
            [
                Change::Welded { n_vertices: 1, tolerance: GAP_TOLERANCE },
                Change::DroppedCollapsed(1),
                Change::DroppedDoubled(1),
                Change::TurnedTriangles(2),
            ]
        );
        assert!(check(&broken).findings.is_empty());
        assert_eq!(broken.triangles.len(), solid.triangles.len());
    }

    #[test]
    fn an_inward_mesh_is_turned_with_a_notice() {
        let mut mesh = cuboid(DVec3::ONE);
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let notice = face_outward(&mut mesh).unwrap().to_string();
        assert_eq!(notice, "turned 1 component that faced the wrong way");
        assert_eq!(mesh.volume(), 1.0);
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(repair(&mut mesh).unwrap(), [Change::TurnedComponents(1)]);
        assert_eq!(mesh.volume(), 1.0);
    }

    #[test]
    fn a_void_keeps_facing_into_itself() {
        let mut void = cuboid(DVec3::ONE);
        void.vertices.iter_mut().for_each(|v| *v += 1.0);
        let outer = cuboid(DVec3::splat(3.0));
        let mut hollow = together(&outer, &void);
        assert_eq!(repair(&mut hollow).unwrap(), [Change::TurnedComponents(1)]);
        assert_eq!(hollow.volume(), 26.0);
        assert_eq!(repair(&mut hollow).unwrap(), []);
    }

    #[test]
    fn overlapping_bodies_both_face_outward_whichever_way_they_came() {
        let mut other = cuboid(DVec3::splat(2.0));
        other.vertices.iter_mut().for_each(|v| *v += 1.0);
        let mut both = together(&cuboid(DVec3::splat(2.0)), &other);
        assert_eq!(repair(&mut both).unwrap(), []);
        assert_eq!(both.volume(), 16.0);
        both.triangles[12..].iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(repair(&mut both).unwrap(), [Change::TurnedComponents(1)]);
        assert_eq!(both.volume(), 16.0);
    }

    #[test]
    fn a_moebius_strip_and_a_hole_are_left_as_they_are() {
        let n = 12;
        let ring = |i: u32| f64::from(i) * std::f64::consts::TAU / f64::from(n);
        let vertex = |i: u32, side: f64| {
            let (turn, lift) = (ring(i), ring(i) / 2.0);
            let radius = 5.0 + side * lift.cos();
            DVec3::new(radius * turn.cos(), radius * turn.sin(), side * lift.sin())
        };
        let vertices = (0..n).flat_map(|i| [vertex(i, -1.0), vertex(i, 1.0)]).collect();
        let quad = |i: u32| {
            let (a, b) = (2 * i, 2 * i + 1);
            let (c, d) = if i + 1 < n { (a + 2, b + 2) } else { (1, 0) };
            [[a, c, b], [b, c, d]]
        };
        let mut strip = Mesh { vertices, triangles: (0..n).flat_map(quad).collect() };
        assert_eq!(repair(&mut strip).unwrap(), [Change::Unorientable(1)]);
        let mut open = cuboid(DVec3::ONE);
        open.triangles.pop();
        assert_eq!(repair(&mut open).unwrap(), []);
        assert_eq!(check(&open).count(Fault::OpenEdge), 3);
    }

    #[test]
    fn a_flap_of_two_opposite_triangles_goes() {
        let mut mesh = cuboid(DVec3::ONE);
        mesh.vertices.push(DVec3::splat(2.0));
        mesh.triangles.extend([[0, 1, 8], [1, 0, 8]]);
        assert_eq!(repair(&mut mesh).unwrap(), [Change::DroppedDoubled(2)]);
        assert!(check(&mesh).findings.is_empty());
    }

    #[test]
    fn a_mesh_that_names_missing_vertices_is_refused_and_left_alone() {
        let mut mesh = crate::geom::solids::cuboid(DVec3::ONE);
        mesh.triangles[1][1] = 99;
        let before = mesh.clone();
        assert!(repair(&mut mesh).unwrap_err().to_string().starts_with("face 1"));
        assert_eq!(face_outward(&mut mesh), None);
        assert_eq!(mesh, before);
    }
}
