//! Regions of a surface: groups of marked sites that are connected along it.
//!
//! # Definition
//!
//! Site `i` stands for the area `a_i` and has the radius `ρ_i = 2·√a_i`. Two sites with the same mark are *neighbors*
//! if one is within the radius of the other along the surface:
//!
//! - on a mesh whose triangles the sites know ([`Sites::faces`]): the triangle of `j` is reached from that of `i`
//!   across shared edges, over triangles that meet the ball of radius `ρ_i` about `i`, which holds `j`;
//! - otherwise: the ball holds `j`, and both are on one sheet.
//!
//! A *region* is a connected component of that graph. So the two sides of a thin wall are apart, and a floor and its
//! wall are not.
//!
//! ```text
//! for every marked site i, for every site j of the same mark in the ball about i that is in another region so far:
//!     walk from the triangle of i over edges within the ball; if that meets the triangle of j: join the regions
//! ```

use super::sites::same_sheet;
use super::{Mesh, Sites};
use crate::Result;
use crate::spatial::PointGrid;
use glam::DVec3;

/// Radius of a site in units of the edge of a square of its area. Neighbors in a hexagonal lattice are 1.07 apart.
pub(crate) const RADIUS: f64 = 2.0;

/// Per site its region: the lowest index of a site in it; `None` where `marks` is `None`. Deterministic.
///
/// `areas_mm2` are those that the sites stand for. `mesh` is used if every site names a triangle of it.
///
/// # Errors
/// If the sites fail [`Sites::check`].
///
/// # Panics
/// If `marks` or `areas_mm2` has not one entry per site, an area is negative or not finite, or the mesh names a missing
/// vertex.
pub fn regions(
    sites: &Sites,
    mesh: Option<&Mesh>,
    areas_mm2: &[f64],
    marks: &[Option<u8>],
) -> Result<Vec<Option<u32>>> {
    sites.check()?;
    let n = sites.len();
    assert!(marks.len() == n && areas_mm2.len() == n, "one mark and one area per site");
    if let Some(i) = areas_mm2.iter().position(|area| !(*area >= 0.0 && area.is_finite())) {
        panic!("the area of site {i} is {}, expected 0 mm² or more", areas_mm2[i]);
    }
    let grid = PointGrid::new(&sites.points);
    let mut walk = mesh.filter(|mesh| knows_triangles(sites, mesh)).map(Walk::new);
    let mut parent: Vec<u32> = (0..n as u32).collect();
    let mut near = Vec::new();
    for i in (0..n).filter(|&i| marks[i].is_some()) {
        let radius = RADIUS * areas_mm2[i].sqrt();
        let own = root(&mut parent, i as u32);
        near.clear();
        grid.for_each_within(sites.points[i], radius as f32, |j, _| {
            if marks[j as usize] == marks[i] && root(&mut parent, j) != own {
                near.push(j);
            }
        });
        match &mut walk {
            Some(walk) => walk.keep_reached(sites, i, radius, &mut near),
            None => near.retain(|&j| on_one_sheet(sites, i, j as usize)),
        }
        for &j in &near {
            let (a, b) = (root(&mut parent, i as u32), root(&mut parent, j));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    Ok((0..n).map(|i| marks[i].map(|_| root(&mut parent, i as u32))).collect())
}

/// Whether every site names a triangle of the mesh.
fn knows_triangles(sites: &Sites, mesh: &Mesh) -> bool {
    let n = mesh.triangles.len();
    sites.faces.len() == sites.len() && sites.faces.iter().all(|f| (*f as usize) < n)
}

fn on_one_sheet(sites: &Sites, i: usize, j: usize) -> bool {
    let at = |i: usize| (sites.points[i].as_dvec3(), sites.normals[i].as_dvec3());
    let ((p, m), (q, n)) = (at(i), at(j));
    same_sheet(p - q, m, n)
}

/// The lowest member of a group; the chain is shortened on the way.
fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Walks over the triangles of a mesh.
struct Walk<'a> {
    mesh: &'a Mesh,
    /// Per triangle and edge, the next triangle at that edge, in a ring; itself at a border.
    across: Vec<[u32; 3]>,
    /// Per triangle, the last walk that met it.
    met: Vec<u32>,
    /// Number of this walk.
    number: u32,
    open: Vec<u32>,
}

impl<'a> Walk<'a> {
    fn new(mesh: &'a Mesh) -> Self {
        let n = mesh.triangles.len();
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * n);
        for (f, t) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                edges.push(([a.min(b), a.max(b)], (3 * f + k) as u32));
            }
        }
        edges.sort_unstable();
        let mut across = vec![[0; 3]; n];
        for same in edges.chunk_by(|x, y| x.0 == y.0) {
            for (k, &(_, slot)) in same.iter().enumerate() {
                let (_, next) = same[(k + 1) % same.len()];
                across[slot as usize / 3][slot as usize % 3] = next / 3;
            }
        }
        Walk { mesh, across, met: vec![0; n], number: 0, open: Vec::new() }
    }

    /// Keeps the sites of `near` whose triangles are reached from that of site `i` within `radius` about it.
    fn keep_reached(&mut self, sites: &Sites, i: usize, radius: f64, near: &mut Vec<u32>) {
        let home = sites.faces[i];
        if near.iter().all(|&j| sites.faces[j as usize] == home) {
            return;
        }
        self.number += 1;
        self.met[home as usize] = self.number;
        self.open.push(home);
        let middle = sites.points[i].as_dvec3();
        while let Some(f) = self.open.pop() {
            for g in self.across[f as usize] {
                let is_new = self.met[g as usize] != self.number;
                // What is no number, at a triangle without area, counts as near.
                let is_far =
                    || square_distance(middle, self.mesh.corners(g as usize)) > radius * radius;
                if is_new && !is_far() {
                    self.met[g as usize] = self.number;
                    self.open.push(g);
                }
            }
        }
        near.retain(|&j| self.met[sites.faces[j as usize] as usize] == self.number);
    }
}

/// Squared distance of a point from a triangle, mm²: from the foot of the perpendicular if that is within, else from
/// the nearest edge.
fn square_distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let edges = [(a, b), (b, c), (c, a)];
    let is_above = |(from, to): (DVec3, DVec3)| (to - from).cross(p - from).dot(normal) >= 0.0;
    if normal.length_squared() > 0.0 && edges.into_iter().all(is_above) {
        let height = (p - a).dot(normal);
        return height * height / normal.length_squared();
    }
    let to_edge = |(from, to): (DVec3, DVec3)| {
        let (edge, way) = (to - from, p - from);
        let length = edge.length_squared();
        let share = if length > 0.0 { (way.dot(edge) / length).clamp(0.0, 1.0) } else { 0.0 };
        (way - edge * share).length_squared()
    };
    edges.into_iter().map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids::cuboid;
    use crate::geom::spacing::areas_mm2;
    use glam::{Vec3, dvec3};

    fn sampled(mesh: &Mesh, n_sites: usize) -> Sites {
        sample(mesh, &SiteOptions { n_sites, ..SiteOptions::default() }).unwrap()
    }

    /// Number of regions and of sites in the first.
    fn count(found: &[Option<u32>]) -> (usize, usize) {
        let mut roots: Vec<u32> = found.iter().flatten().copied().collect();
        roots.sort_unstable();
        let first = roots.first().map_or(0, |r| roots.iter().filter(|x| *x == r).count());
        roots.dedup();
        (roots.len(), first)
    }

    #[test]
    fn the_sides_of_a_thin_plate_are_apart_and_faces_around_an_edge_are_not() {
        let plate = cuboid(dvec3(60.0, 40.0, 0.5));
        let sites = sampled(&plate, 800);
        let areas = areas_mm2(&sites, Some(plate.area())).unwrap();
        let half = |z: f32| -> Vec<Option<u8>> {
            let flat =
                sites.normals.iter().map(|n| (n.z.abs() > 0.5 && n.z * z >= 0.0).then_some(1));
            flat.collect()
        };
        let up = half(1.0);
        let both = half(0.0);
        // Well away from the rim, so that no way leads around it.
        let inner = |marks: Vec<Option<u8>>| -> Vec<Option<u8>> {
            let far = |p: &Vec3| p.x > 6.0 && p.x < 54.0 && p.y > 6.0 && p.y < 34.0;
            marks.iter().zip(&sites.points).map(|(m, p)| m.filter(|_| far(p))).collect()
        };
        for mesh in [Some(&plate), None] {
            assert_eq!(count(&regions(&sites, mesh, &areas, &up).unwrap()).0, 1);
            assert_eq!(count(&regions(&sites, mesh, &areas, &inner(both.clone())).unwrap()).0, 2);
            let all = vec![Some(1); sites.len()];
            let (n, size) = count(&regions(&sites, mesh, &areas, &all).unwrap());
            assert_eq!((n, size), (1, sites.len()));
        }
    }

    #[test]
    fn marks_part_regions_and_a_gap_does() {
        let block = cuboid(dvec3(40.0, 20.0, 10.0));
        let sites = sampled(&block, 600);
        let areas = areas_mm2(&sites, Some(block.area())).unwrap();
        let top = |keep: &dyn Fn(&Vec3) -> Option<u8>| -> Vec<Option<u8>> {
            let on_top = sites.points.iter().zip(&sites.normals);
            on_top.map(|(p, n)| if n.z > 0.5 { keep(p) } else { None }).collect()
        };
        let by_half = top(&|p| Some(u8::from(p.x > 20.0)));
        assert_eq!(count(&regions(&sites, Some(&block), &areas, &by_half).unwrap()).0, 2);
        let with_gap = top(&|p| (p.x < 15.0 || p.x > 25.0).then_some(0));
        assert_eq!(count(&regions(&sites, Some(&block), &areas, &with_gap).unwrap()).0, 2);
        let none = vec![None; sites.len()];
        assert_eq!(count(&regions(&sites, Some(&block), &areas, &none).unwrap()), (0, 0));
    }

    #[test]
    fn another_mesh_and_no_sites_are_no_failure() {
        let block = cuboid(dvec3(4.0, 4.0, 4.0));
        let mut sites = sampled(&block, 60);
        let areas = areas_mm2(&sites, None).unwrap();
        sites.faces[3] = 900;
        assert_eq!(count(&regions(&sites, Some(&block), &areas, &[Some(0); 60]).unwrap()).0, 1);
        assert!(regions(&Sites::default(), None, &[], &[]).unwrap().is_empty());
    }

    #[test]
    fn distances_from_a_triangle() {
        let t = [dvec3(0.0, 0.0, 0.0), dvec3(4.0, 0.0, 0.0), dvec3(0.0, 3.0, 0.0)];
        let at = |x, y, z| square_distance(dvec3(x, y, z), t);
        assert!((at(1.0, 1.0, 2.0) - 4.0).abs() < 1e-12);
        assert!((at(-3.0, 0.0, 4.0) - 25.0).abs() < 1e-12);
        assert!((at(2.0, -1.0, 0.0) - 1.0).abs() < 1e-12);
        let flat = [t[0], t[1], t[1]];
        assert!((square_distance(dvec3(2.0, 2.0, 0.0), flat) - 4.0).abs() < 1e-12);
    }
}
