//! Normals that several faces share: at vertices, and interpolated over smooth faces.

use super::surface::{Place, Surface};
use super::{Sites, VertexNormals};
use glam::DVec3;

/// Faces around each vertex with the angle each has there: `offsets[v]..offsets[v + 1]` into `corners`.
struct Fans {
    offsets: Vec<u32>,
    corners: Vec<(u32, f64)>,
}

impl Fans {
    /// Faces without area are left out; each fan is in face order.
    fn build(surface: &Surface) -> Self {
        let mesh = surface.mesh;
        let mut offsets = vec![0u32; mesh.vertices.len() + 1];
        let with_area = || (0..mesh.triangles.len()).filter(|&f| surface.areas[f] > 0.0);
        for &v in with_area().flat_map(|f| &mesh.triangles[f]) {
            offsets[v as usize + 1] += 1;
        }
        for v in 0..mesh.vertices.len() {
            offsets[v + 1] += offsets[v];
        }
        let mut next = offsets.clone();
        let mut corners = vec![(0, 0.0); offsets[mesh.vertices.len()] as usize];
        for f in with_area() {
            for (k, &v) in mesh.triangles[f].iter().enumerate() {
                corners[next[v as usize] as usize] = (f as u32, angle(mesh.corners(f), k));
                next[v as usize] += 1;
            }
        }
        Fans { offsets, corners }
    }

    fn around(&self, vertex: usize) -> &[(u32, f64)] {
        &self.corners[self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize]
    }
}

/// Angle of a triangle at corner `k`, radians.
fn angle(corners: [DVec3; 3], k: usize) -> f64 {
    let (u, v) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
    libm::atan2(u.cross(v).length(), u.dot(v))
}

/// See [`super::at_vertices`].
pub(super) fn vertex_sites(surface: &Surface, weights: VertexNormals) -> (Sites, Vec<u32>) {
    let fans = Fans::build(surface);
    let weight = |f: u32, angle: f64| match weights {
        VertexNormals::Angle => angle,
        VertexNormals::Area => surface.areas[f as usize],
    };
    let (mut sites, mut rows) = (Sites::default(), Vec::new());
    for (vertex, point) in surface.mesh.vertices.iter().enumerate() {
        let fan = fans.around(vertex);
        let Some(&(first, _)) = fan.first() else { continue };
        let part = |&(f, angle): &(u32, f64)| surface.normals[f as usize] * weight(f, angle);
        let sum: DVec3 = fan.iter().map(part).sum();
        let along = |f: u32| surface.normals[f as usize].dot(sum);
        let nearer = |best, &(f, _): &(u32, f64)| if along(f) > along(best) { f } else { best };
        let face = fan.iter().fold(first, nearer);
        let normal = sum.try_normalize().unwrap_or(surface.normals[face as usize]);
        sites.points.push(point.as_vec3());
        sites.normals.push(normal.as_vec3().normalize());
        sites.faces.push(face);
        rows.push(vertex as u32);
    }
    (sites, rows)
}

/// Normals at `places` for [`super::Normals::Smooth`].
pub(super) fn smooth(surface: &Surface, places: &[Place], crease_rad: f64) -> Vec<DVec3> {
    let fans = Fans::build(surface);
    let least = libm::cos(crease_rad.clamp(0.0, std::f64::consts::PI));
    let corner_normal = |face: u32, vertex: u32| {
        let own = surface.normals[face as usize];
        let smooth =
            |&&(f, _): &&(u32, f64)| f == face || surface.normals[f as usize].dot(own) > least;
        let fan = fans.around(vertex as usize).iter().filter(smooth);
        let sum: DVec3 = fan.map(|&(f, angle)| surface.normals[f as usize] * angle).sum();
        sum.try_normalize().unwrap_or(own)
    };
    let at = |place: &Place| {
        let corners = surface.mesh.corners(place.face as usize);
        let vertices = surface.mesh.triangles[place.face as usize];
        let weights = barycentric(place.point, corners);
        let sum: DVec3 = (0..3).map(|k| corner_normal(place.face, vertices[k]) * weights[k]).sum();
        sum.try_normalize().unwrap_or(surface.normals[place.face as usize])
    };
    places.iter().map(at).collect()
}

/// Weights, adding up to 1, that make `p` the mean of a triangle's corners; none below 0.
fn barycentric(p: DVec3, corners: [DVec3; 3]) -> [f64; 3] {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let share = |k: usize| {
        let (b, c) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
        (normal.dot((c - b).cross(p - b)) / normal.length_squared()).clamp(0.0, 1.0)
    };
    let weights = [share(0), share(1), share(2)];
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}
