//! Several bodies in one mesh: which overlap, and one surface about them.
//!
//! # Definition
//!
//! A *piece* is a set of triangles that hang together by edges; at an edge with more than two triangles, those hang
//! together that have material between them. Pieces that are all closed and oriented by themselves are taken apart,
//! even if they share corners or edges. Then
//!
//! - a piece that lies within another one, apart from its walls, is a cavity: it stays surface and faces into itself;
//! - bodies of which triangles pierce each other, or lie on each other, are joined: what is inside another body is no
//!   surface. The union is that of the `manifold-rust` crate, whose corners do not depend on the platform;
//! - all others stay as they are, each an obstacle to the others.
//!
//! ```text
//! pieces: union of triangles across edges with two uses; then across the others, in their order about the edge
//! a piece with an edge that it does not pass once each way: nothing is done
//! groups: pieces with an intersecting pair of triangles; an inward piece also with the least body that holds it
//! a piece alone, facing outward, of which all extreme corners lie inside an odd number of other groups: turned
//! a group of several: the union of its bodies, each with its cavities
//! ```

#[cfg(feature = "formats")]
mod crumbs;
mod pieces;
mod solid;

use super::check::topology::{Topology, has_three_corners};
use super::check::volume_of;
use super::inside::TriangleGroups;
use super::repair::{Change, extremes};
use super::weld::{join as unite, root};
use super::{Mesh, intersect};
use crate::{Error, Result};
#[cfg(feature = "formats")]
pub(crate) use crumbs::settle;
use glam::DVec3;
use manifold_rust::manifold::Manifold;
use pieces::{are_closed, owners, pieces};
#[cfg(feature = "formats")]
pub(crate) use solid::union;
use solid::{mesh_of, solid_of};
use std::collections::BTreeMap;

/// Joins bodies that overlap or lie on each other, and turns shells within a body to bound cavities; returns what it
/// did, which is nothing for a mesh of one body, or of one that is not closed and oriented.
///
/// ```
/// use deepmill::geom::{bodies, solids};
/// let mut part = solids::cuboid(deepmill::glam::DVec3::new(20.0, 10.0, 10.0));
/// let other = solids::cuboid(deepmill::glam::DVec3::new(20.0, 10.0, 10.0));
/// part.vertices.extend(other.vertices.iter().map(|v| *v + deepmill::glam::DVec3::new(10.0, 2.0, 3.0)));
/// part.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + 8)));
/// assert_eq!(part.volume(), 4000.0);
/// bodies::join(&mut part)?;
/// // They have 10 × 8 × 7 mm in common.
/// assert!((part.volume() - 3440.0).abs() < 1e-9);
/// # Ok::<(), deepmill::Error>(())
/// ```
///
/// # Errors
/// If the mesh fails [`Mesh::check`], a piece that overlaps others encloses no volume, or faces inward and is within
/// none, or the union does not bound a solid; the mesh is unchanged then.
pub fn join(mesh: &mut Mesh) -> Result<Vec<Change>> {
    mesh.check()?;
    let topology = Topology::of(mesh);
    let pieces = pieces(mesh, &topology);
    if pieces.len() < 2 || !are_closed(&topology, &pieces, mesh.triangles.len()) {
        return Ok(Vec::new());
    }
    let mut apart = Pieces::new(mesh, &pieces);
    let groups = apart.groups()?;
    let mut changes = Vec::new();
    let n_cavities = apart.turn_cavities(&groups);
    if n_cavities > 0 {
        changes.push(Change::Cavities(n_cavities));
    }
    changes.extend(apart.unite(&groups)?);
    if !changes.is_empty() || apart.mesh.vertices.len() > mesh.vertices.len() {
        *mesh = apart.mesh;
    }
    Ok(changes)
}

/// What a fixture has in common with a part.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[doc(hidden)] // of `analysis`, checked by tests
pub struct Overlap {
    /// Volume inside both, mm³.
    pub common_mm3: f64,
    /// That volume as a share of the part's.
    pub share_of_part: f64,
    /// Whether the part is within a shell of the fixture.
    pub encloses: bool,
}

/// What `fixture` has in common with `part`; none if one of them bounds no solid.
///
/// # Errors
/// If a mesh fails [`Mesh::check`].
#[doc(hidden)] // of `analysis`, checked by tests
pub fn overlap(part: &Mesh, fixture: &Mesh) -> Result<Option<Overlap>> {
    let (mut part, mut fixture) = (part.clone(), fixture.clone());
    for mesh in [&mut part, &mut fixture] {
        mesh.check()?;
        if join(mesh).is_err() {
            return Ok(None);
        }
    }
    let apart = |mesh: &Mesh| {
        let topology = Topology::of(mesh);
        let pieces = pieces(mesh, &topology);
        let closed = are_closed(&topology, &pieces, mesh.triangles.len());
        (closed && !pieces.is_empty()).then(|| Pieces::new(mesh, &pieces))
    };
    let (Some(one), Some(other)) = (apart(&part), apart(&fixture)) else { return Ok(None) };
    let all = |pieces: &Pieces| (0..pieces.mesh.triangles.len() as u32).collect::<Vec<u32>>();
    let (Ok(a), Ok(b)) = (one.solid(&all(&one)), other.solid(&all(&other))) else {
        return Ok(None);
    };
    let groups = TriangleGroups::new(&other.mesh, &other.owner);
    let is_outer = |k: &u32| other.volumes[*k as usize] > 0.0;
    let around = |probe: DVec3| groups.others_around(probe, u32::MAX).into_iter().filter(is_outer);
    let probes = extremes(&one.mesh, &all(&one)).map(|probe| around(probe).collect::<Vec<_>>());
    let encloses = probes[0].iter().any(|k| probes.iter().all(|around| around.contains(k)));
    let common_mm3 = a.intersection(&b).volume().max(0.0);
    Ok(Some(Overlap { common_mm3, share_of_part: common_mm3 / part.volume().abs(), encloses }))
}

/// Pieces with corners of their own, one after another.
struct Pieces {
    mesh: Mesh,
    /// Triangles of each.
    pieces: Vec<Vec<u32>>,
    owner: Vec<u32>,
    /// Enclosed volumes, mm³; negative if a piece faces inward.
    volumes: Vec<f64>,
}

impl Pieces {
    fn new(mesh: &Mesh, pieces: &[Vec<u32>]) -> Self {
        let mut apart = Mesh::default();
        let mut numbers = Vec::new();
        for faces in pieces {
            let begin = apart.triangles.len() as u32;
            append(&mut apart, mesh, faces);
            numbers.push((begin..apart.triangles.len() as u32).collect());
        }
        let owner = owners(&numbers, apart.triangles.len());
        let volumes = numbers.iter().map(|faces: &Vec<u32>| volume_of(&apart, faces)).collect();
        Pieces { mesh: apart, pieces: numbers, owner, volumes }
    }

    /// Per piece the first one that it hangs together with: of those that overlap, each other's.
    fn groups(&self) -> Result<Vec<u32>> {
        let n = self.pieces.len();
        let mut parent: Vec<u32> = (0..n as u32).collect();
        let mut meets = vec![false; n];
        for pair in intersect::pairs(&self.mesh) {
            let [a, b] = pair.map(|f| self.owner[f as usize]);
            if a != b {
                meets[a as usize] = true;
                meets[b as usize] = true;
                unite(&mut parent, a, b);
            }
        }
        let by_piece = TriangleGroups::new(&self.mesh, &self.owner);
        for i in (0..n).filter(|&i| meets[i] && self.volumes[i] <= 0.0) {
            if self.volumes[i] == 0.0 {
                return Err(self.refused(&self.pieces[i], "it encloses no volume"));
            }
            let Some(body) = self.least_around(&by_piece, i) else {
                return Err(self.refused(&self.pieces[i], "it faces inward and lies in none"));
            };
            unite(&mut parent, i as u32, body);
        }
        Ok((0..n as u32).map(|i| root(&mut parent, i)).collect())
    }

    /// Of the bodies that hold all extreme corners of a piece, the one of least volume.
    fn least_around(&self, by_piece: &TriangleGroups, i: usize) -> Option<u32> {
        let around = |probe| by_piece.others_around(probe, i as u32);
        let mut all = extremes(&self.mesh, &self.pieces[i]).into_iter().map(around);
        let first = all.next()?;
        let rest: Vec<Vec<u32>> = all.collect();
        let volume = |k: &u32| self.volumes[*k as usize];
        let bodies = first.into_iter().filter(|k| volume(k) > 0.0);
        let holding = bodies.filter(|k| rest.iter().all(|around| around.contains(k)));
        holding.min_by(|a, b| volume(a).total_cmp(&volume(b)).then(a.cmp(b)))
    }

    /// Turns pieces that face outward, meet no other and lie within one; returns how many.
    fn turn_cavities(&mut self, groups: &[u32]) -> usize {
        let owner: Vec<u32> = self.owner.iter().map(|i| groups[*i as usize]).collect();
        let by_group = TriangleGroups::new(&self.mesh, &owner);
        let is_alone = |i: usize| groups.iter().filter(|g| **g == groups[i]).count() == 1;
        let is_cavity = |i: &usize| {
            self.volumes[*i] > 0.0
                && is_alone(*i)
                && extremes(&self.mesh, &self.pieces[*i])
                    .into_iter()
                    .all(|probe| by_group.n_others_around(probe, groups[*i]) % 2 == 1)
        };
        let cavities: Vec<usize> = (0..self.pieces.len()).filter(is_cavity).collect();
        for &i in &cavities {
            self.volumes[i] = -self.volumes[i];
            self.pieces[i].iter().for_each(|f| self.mesh.triangles[*f as usize].swap(1, 2));
        }
        cavities.len()
    }

    /// The union of every group of several, in the place of its first piece.
    fn unite(&mut self, groups: &[u32]) -> Result<Option<Change>> {
        let (mut joined, mut n_bodies, mut n_into) = (Mesh::default(), 0, 0);
        for first in 0..self.pieces.len() {
            let of: Vec<usize> =
                (first..groups.len()).filter(|&i| groups[i] as usize == first).collect();
            let bodies: Vec<usize> =
                of.iter().copied().filter(|&i| self.volumes[i] > 0.0).collect();
            if of.len() == 1 {
                append(&mut joined, &self.mesh, &self.pieces[first]);
            } else if !of.is_empty() {
                let union = self.union(&of, &bodies)?;
                let all: Vec<u32> = (0..union.triangles.len() as u32).collect();
                append(&mut joined, &union, &all);
                (n_bodies, n_into) = (n_bodies + bodies.len(), n_into + 1);
            }
        }
        if n_bodies == 0 {
            return Ok(None);
        }
        let inner_mm2 = self.mesh.area() - joined.area();
        self.mesh = joined;
        Ok(Some(Change::Joined { n_bodies, n_into, inner_mm2 }))
    }

    /// Of the bodies, each with those inward pieces that are within it and not within a lesser one.
    fn union(&self, of: &[usize], bodies: &[usize]) -> Result<Mesh> {
        let by_piece = TriangleGroups::new(&self.mesh, &self.owner);
        let mut parts: Vec<Vec<u32>> = bodies.iter().map(|&b| self.pieces[b].clone()).collect();
        for &i in of.iter().filter(|i| self.volumes[**i] < 0.0) {
            let body = self.least_around(&by_piece, i);
            if let Some(k) = bodies.iter().position(|b| Some(*b as u32) == body) {
                parts[k].extend(&self.pieces[i]);
            }
        }
        let solids = parts.iter().map(|faces| self.solid(faces));
        let union = solids.reduce(|a, b| Ok(a?.union(&b?))).expect("a group has a body")?;
        let mesh = mesh_of(&union);
        let volumes = parts.iter().map(|faces| volume_of(&self.mesh, faces));
        let (least, most) =
            volumes.fold((0.0, 0.0), |(least, sum): (f64, f64), v| (least.max(v), sum + v));
        let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        let volume = if all.is_empty() { 0.0 } else { volume_of(&mesh, &all) };
        let room = 1e-6 * most;
        let is_plausible = volume >= least - room && volume <= most + room;
        match is_plausible && Topology::of(&mesh).unbalanced().next().is_none() {
            true => Ok(mesh),
            false => Err(self.refused(&parts[0], "their union does not bound a solid")),
        }
    }

    fn solid(&self, faces: &[u32]) -> Result<Manifold> {
        let mut part = Mesh::default();
        append(&mut part, &self.mesh, faces);
        solid_of(&part).ok_or_else(|| self.refused(faces, "one of them is no solid by itself"))
    }

    fn refused(&self, faces: &[u32], why: &str) -> Error {
        let place = format!("body at {}", self.mesh.corners(faces[0] as usize)[0]);
        let found = format!("it overlaps another, and {why}");
        let remedy = "unite them in the CAD program, remove what is no solid, or try a repair";
        Error::geometry(place, found, remedy)
    }
}

/// Adds triangles of another mesh, with corners of their own.
fn append(to: &mut Mesh, from: &Mesh, faces: &[u32]) {
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    for f in faces {
        let triangle = from.triangles[*f as usize];
        debug_assert!(has_three_corners(&triangle));
        to.triangles.push(triangle.map(|v| {
            *number.entry(v).or_insert_with(|| {
                to.vertices.push(from.vertices[v as usize]);
                to.vertices.len() as u32 - 1
            })
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::par;
    use crate::geom::check::{Fault, check};
    use crate::geom::solids::{cuboid, torus};
    use crate::geom::weld::weld;
    use glam::dvec3;

    fn block(low: [f64; 3], high: [f64; 3]) -> Mesh {
        let low = DVec3::from_array(low);
        let mut mesh = cuboid(DVec3::from_array(high) - low);
        mesh.vertices.iter_mut().for_each(|v| *v += low);
        mesh
    }

    fn together(meshes: &[Mesh]) -> Mesh {
        let mut all = Mesh::default();
        for mesh in meshes {
            let n = all.vertices.len() as u32;
            all.vertices.extend(&mesh.vertices);
            all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + n)));
        }
        all
    }

    fn turned(mut mesh: Mesh) -> Mesh {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9 * b.abs().max(1.0)
    }

    #[test]
    fn overlapping_blocks_become_their_union_and_walls_inside_are_gone() {
        let mut two = together(&[
            block([0.0, 0.0, 0.0], [20.0, 10.0, 10.0]),
            block([10.0, 2.0, 3.0], [30.0, 8.0, 15.0]),
        ]);
        let changes = join(&mut two).unwrap();
        // In common: 10 × 6 × 7. Walls inside: five sides of that but its end in the second block.
        assert!(near(two.volume(), 2000.0 + 1440.0 - 420.0), "{}", two.volume());
        let inner = 6.0 * 7.0 * 2.0 + 2.0 * 10.0 * 7.0 + 2.0 * 10.0 * 6.0;
        assert!(near(two.area(), 1000.0 + 864.0 - inner), "{}", two.area());
        let [Change::Joined { n_bodies: 2, n_into: 1, inner_mm2 }] = changes[..] else {
            panic!("{changes:?}")
        };
        assert!(near(inner_mm2, inner));
        let report = check(&two);
        assert!(report.blocking().is_none() && report.n_components == 1, "{report:?}");
        assert_eq!(intersect::finding(&two), None);
        let before = two.clone();
        assert!(join(&mut two).unwrap().is_empty() && two == before);
    }

    #[test]
    fn blocks_that_lie_on_each_other_lose_the_walls_between_welded_or_not() {
        let same = together(&[
            block([0.0, 0.0, 0.0], [20.0, 10.0, 10.0]),
            block([0.0, 0.0, 10.0], [20.0, 10.0, 14.0]),
        ]);
        let welded = weld(&same, 1e-6).unwrap();
        assert!(check(&welded).count(Fault::NonManifoldEdge) > 0);
        let partly = together(&[
            block([0.0, 0.0, 0.0], [20.0, 10.0, 10.0]),
            block([3.0, 2.0, 10.0], [9.0, 8.0, 14.0]),
        ]);
        for (mut mesh, volume, inner) in
            [(same, 2800.0, 400.0), (welded, 2800.0, 400.0), (partly, 2144.0, 72.0)]
        {
            let area = mesh.area();
            assert_eq!(join(&mut mesh).unwrap().len(), 1);
            assert!(near(mesh.volume(), volume) && near(area - mesh.area(), inner), "{volume}");
            let report = check(&mesh);
            assert!(report.blocking().is_none() && report.n_components == 1, "{report:?}");
        }
    }

    #[test]
    fn blocks_that_share_an_edge_or_stand_apart_stay_two() {
        let low = block([0.0; 3], [10.0; 3]);
        let edge = together(&[low.clone(), block([10.0, 10.0, 0.0], [20.0, 20.0, 10.0])]);
        let mut edge = weld(&edge, 1e-6).unwrap();
        assert!(check(&edge).blocking_bodies().is_some());
        assert!(join(&mut edge).unwrap().is_empty());
        let report = check(&edge);
        assert!(report.blocking_bodies().is_none() && report.n_components == 2, "{report:?}");
        let mut apart = together(&[low, block([11.0, 0.0, 0.0], [20.0, 10.0, 10.0])]);
        let before = apart.clone();
        assert!(join(&mut apart).unwrap().is_empty() && apart == before);
    }

    #[test]
    fn shells_within_a_body_are_cavities_whichever_way_they_face() {
        let outer = block([0.0; 3], [30.0; 3]);
        let shell = block([10.0; 3], [20.0; 3]);
        let mut hollow = together(&[outer.clone(), shell.clone()]);
        assert_eq!(join(&mut hollow).unwrap(), [Change::Cavities(1)]);
        assert!(near(hollow.volume(), 26000.0));
        let before = hollow.clone();
        assert!(join(&mut hollow).unwrap().is_empty() && hollow == before);
        // A body within the cavity is none.
        let core = block([12.0; 3], [15.0; 3]);
        let mut three = together(&[outer.clone(), turned(shell.clone()), core]);
        assert!(join(&mut three).unwrap().is_empty());
        assert!(near(three.volume(), 26027.0));
        // A pin through the wall of the cavity fills what it has of it: 5 × 4 × 4.
        let pin = block([15.0, 13.0, 13.0], [40.0, 17.0, 17.0]);
        let mut pinned = together(&[turned(shell), pin, outer]);
        let changes = join(&mut pinned).unwrap();
        assert!(
            matches!(changes[..], [Change::Joined { n_bodies: 2, n_into: 1, .. }]),
            "{changes:?}"
        );
        assert!(near(pinned.volume(), 26000.0 + 5.0 * 16.0 + 10.0 * 16.0), "{}", pinned.volume());
    }

    #[test]
    fn many_bodies_are_joined_by_groups_the_same_on_any_number_of_threads() {
        let chain = (0..6).map(|k| {
            let x = 8.0 * f64::from(k);
            block([x, 0.0, 0.0], [x + 10.0, 10.0, 10.0])
        });
        let mut meshes: Vec<Mesh> = chain.collect();
        let mut ring = torus(20.0, 4.0, 60, 30);
        ring.vertices.iter_mut().for_each(|v| *v += dvec3(0.0, 100.0, 0.0));
        meshes.push(ring);
        meshes.push(block([15.0, 97.0, -1.0], [25.0, 103.0, 12.0]));
        let all = together(&meshes);
        let run = |n| {
            let mut mesh = all.clone();
            let changes = par::with_threads(n, || join(&mut mesh)).unwrap().unwrap();
            (mesh, changes)
        };
        let (mesh, changes) = run(1);
        assert!(
            matches!(changes[..], [Change::Joined { n_bodies: 8, n_into: 2, .. }]),
            "{changes:?}"
        );
        assert_eq!(run(4), (mesh.clone(), changes));
        assert_eq!(check(&mesh).n_components, 2);
        assert_eq!(check(&mesh).blocking_bodies(), None);
    }

    #[test]
    fn what_a_fixture_has_in_common_with_a_part_and_whether_it_encloses_it() {
        let part = block([0.0; 3], [40.0, 30.0, 20.0]);
        let of = |fixture: &Mesh| overlap(&part, fixture).unwrap().unwrap();
        let jaw = of(&block([-10.0, 0.0, 0.0], [0.0, 30.0, 20.0]));
        assert!(jaw.common_mm3 < 1e-9 && !jaw.encloses, "{jaw:?}");
        let deep = of(&block([-10.0, 5.0, 0.0], [2.0, 25.0, 10.0]));
        assert!(near(deep.common_mm3, 400.0) && near(deep.share_of_part, 400.0 / 24000.0));
        let around = block([-5.0; 3], [45.0, 35.0, 25.0]);
        let solid = of(&around);
        assert!(solid.encloses && near(solid.share_of_part, 1.0), "{solid:?}");
        let shell = of(&together(&[around, turned(block([-1.0; 3], [41.0, 31.0, 21.0]))]));
        assert!(shell.encloses && shell.common_mm3 < 1e-9, "{shell:?}");
        let mut open = block([50.0; 3], [60.0; 3]);
        open.triangles.pop();
        assert_eq!(overlap(&part, &open).unwrap(), None);
    }

    #[test]
    fn open_meshes_stay_and_an_inward_body_that_overlaps_is_refused_by_name() {
        let other = block([5.0; 3], [15.0; 3]);
        let mut open = block([0.0; 3], [10.0; 3]);
        open.triangles.pop();
        let mut open = together(&[open, other.clone()]);
        let before = open.clone();
        assert!(join(&mut open).unwrap().is_empty() && open == before);
        let mut inward = together(&[other, turned(block([0.0; 3], [10.0; 3]))]);
        let message = join(&mut inward).unwrap_err().to_string();
        assert!(message.contains("faces inward and lies in none"), "{message}");
    }

    #[test]
    fn bodies_without_volume_are_refused_where_they_meet_others_and_stay_where_they_do_not() {
        let sheet = |corners: [DVec3; 3]| {
            let triangles = vec![[0, 1, 2], [0, 2, 1]];
            Mesh { vertices: corners.to_vec(), triangles }
        };
        let flat = sheet([DVec3::ZERO, 10.0 * DVec3::X, 10.0 * DVec3::Y]);
        let across = sheet([dvec3(3.0, 3.0, -5.0), dvec3(3.0, 3.0, 5.0), dvec3(8.0, -3.0, 0.0)]);
        let solid = block([1.0, 1.0, -1.0], [4.0, 4.0, 2.0]);
        for other in [across, solid] {
            let mut crossing = together(&[flat.clone(), other]);
            let before = crossing.clone();
            let message = join(&mut crossing).unwrap_err().to_string();
            assert!(message.contains("encloses no volume") && crossing == before, "{message}");
        }
        let mut apart = together(&[flat, block([20.0; 3], [30.0; 3])]);
        assert!(join(&mut apart).unwrap().is_empty());
    }
}
