//! Solids bounded by triangles, and the union, difference and intersection of two of them.
//!
//! The set operations are those of the `manifold-rust` crate, whose results have manifold
//! connectivity and do not depend on the platform; its own sine and cosine are portable too.

use super::outline::{Outline, circle_corners};
use crate::geom::Mesh;
use glam::{DMat3, DVec2, DVec3};
use manifold_rust::linalg::{Mat3x4, Vec2, Vec3};
use manifold_rust::manifold::Manifold;
use manifold_rust::types::{MeshGLP, SimplePolygon};
use std::ops::{Add, AddAssign, BitAnd, Sub, SubAssign};

/// A solid, lengths in millimeters.
#[derive(Clone)]
pub(super) struct Solid(Manifold);

/// `z → x → y → z`: a body standing on z lies along x.
const ALONG_X: DMat3 = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
/// `z → y → x → z`: a body standing on z lies along y.
const ALONG_Y: DMat3 = DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y);

impl Solid {
    /// The box between two corners.
    pub fn block(low: [f64; 3], high: [f64; 3]) -> Self {
        let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
        let size = high - low;
        Solid(Manifold::cube(vector(size), false)).moved(low)
    }

    /// A right cylinder about z.
    pub fn cylinder(radius: f64, low: f64, high: f64) -> Self {
        Self::prism(&Outline::circle(radius), low, high)
    }

    /// A truncated cone about z.
    pub fn cone(low_radius: f64, high_radius: f64, low: f64, high: f64) -> Self {
        Self::turned(&[[0.0, low], [low_radius, low], [high_radius, high], [0.0, high]])
    }

    /// A ball about the origin.
    pub fn ball(radius: f64) -> Self {
        Solid(Manifold::sphere(radius, circle_corners(radius) as i32))
    }

    /// A right prism over `outline`.
    pub fn prism(outline: &Outline, low: f64, high: f64) -> Self {
        Self::plate(outline, &[], low, high)
    }

    /// A right prism over `outline` with through holes; holes lie inside and do not meet.
    pub fn plate(outline: &Outline, holes: &[Outline], low: f64, high: f64) -> Self {
        let mut polygons = vec![polygon(&outline.0)];
        for hole in holes {
            let mut points = polygon(&hole.0);
            points.reverse();
            polygons.push(points);
        }
        Self::column(&polygons, low, high, 0)
    }

    /// A prism whose walls are cut at `divisions` heights, ready to be bent.
    pub fn divided(outline: &Outline, low: f64, high: f64, divisions: usize) -> Self {
        Self::column(&[polygon(&outline.0)], low, high, divisions)
    }

    fn column(polygons: &[SimplePolygon], low: f64, high: f64, divisions: usize) -> Self {
        let polygons = polygons.to_vec();
        let one = Vec2::new(1.0, 1.0);
        let column = Manifold::extrude(&polygons, high - low, divisions as i32, 0.0, one);
        Solid(column).moved(DVec3::new(0.0, 0.0, low))
    }

    /// A body of revolution about z over a profile of (radius, height), counter-clockwise.
    pub fn turned(profile: &[[f64; 2]]) -> Self {
        let points: Vec<DVec2> = profile.iter().map(|p| DVec2::from_array(*p)).collect();
        Self::revolved(&Outline(points), 360.0)
    }

    /// Revolved about z by `degrees` over an outline of (radius, height), starting at the x axis.
    pub fn revolved(profile: &Outline, degrees: f64) -> Self {
        let radius = profile.0.iter().fold(0.0, |r: f64, p| r.max(p.x));
        let corners = circle_corners(radius) as f64 * degrees / 360.0;
        Solid(Manifold::revolve(&vec![polygon(&profile.0)], corners.ceil() as i32, degrees))
    }

    /// A body from closed rings of equal length, each counter-clockwise seen from the next; the
    /// last ring is joined to the first.
    pub fn loop_of_rings(rings: &[Vec<DVec3>]) -> Self {
        let (n, m) = (rings.len(), rings[0].len());
        let index = |i: usize, j: usize| ((i % n) * m + j % m) as u32;
        let quad = |i, j| {
            let [a, b] = [index(i, j), index(i, j + 1)];
            let [c, d] = [index(i + 1, j + 1), index(i + 1, j)];
            [[a, b, c], [a, c, d]]
        };
        let triangles = (0..n).flat_map(|i| (0..m).flat_map(move |j| quad(i, j))).collect();
        Self::from_mesh(&Mesh { vertices: rings.concat(), triangles })
    }

    /// The solid inside a closed manifold mesh.
    pub fn from_mesh(mesh: &Mesh) -> Self {
        let vert_properties = mesh.vertices.iter().flat_map(|v| v.to_array()).collect();
        let mesh = MeshGLP::<f64, u32> {
            num_prop: 3,
            vert_properties,
            tri_verts: mesh.triangles.as_flattened().to_vec(),
            ..Default::default()
        };
        Solid(Manifold::from_mesh_glp(&mesh))
    }

    /// Corners and triangles; corners that coincide are kept apart.
    pub fn to_mesh(&self) -> Mesh {
        let mesh: MeshGLP<f64, u32> = self.0.get_mesh_glp(-1);
        let stride = mesh.num_prop as usize;
        let corners = mesh.vert_properties.chunks_exact(stride);
        Mesh {
            vertices: corners.map(|p| DVec3::new(p[0], p[1], p[2])).collect(),
            triangles: mesh.tri_verts.as_chunks().0.to_vec(),
        }
    }

    /// Enclosed volume, mm³.
    pub fn volume(&self) -> f64 {
        self.0.volume()
    }

    /// Connected pieces of the surface, each with its own volume (negative for a cavity).
    pub fn pieces(&self) -> Vec<Solid> {
        self.0.decompose().into_iter().map(Solid).collect()
    }

    /// With details below `tolerance` mm removed.
    pub fn simplified(&self, tolerance: f64) -> Self {
        Solid(self.0.simplify(tolerance))
    }

    /// Moved by (`x`, `y`, `z`).
    pub fn at(self, x: f64, y: f64, z: f64) -> Self {
        self.moved(DVec3::new(x, y, z))
    }

    fn moved(self, by: DVec3) -> Self {
        Solid(self.0.translate(vector(by)))
    }

    /// Turned about the origin.
    pub fn turned_by(self, turn: &DMat3) -> Self {
        let [x, y, z] = [turn.x_axis, turn.y_axis, turn.z_axis].map(vector);
        Solid(self.0.transform(&Mat3x4::from_cols(x, y, z, Vec3::new(0.0, 0.0, 0.0))))
    }

    /// Laid down: what stood along z lies along x.
    pub fn along_x(self) -> Self {
        self.turned_by(&ALONG_X)
    }

    /// Laid down: what stood along z lies along y.
    pub fn along_y(self) -> Self {
        self.turned_by(&ALONG_Y)
    }

    /// Set up: a prism over an outline of (x, z), extruded along z, runs along -y.
    pub fn turned_up(self) -> Self {
        self.turned_by(&DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y))
    }

    /// Turned about the y axis by `angle_rad`.
    pub fn about_y(self, angle_rad: f64) -> Self {
        let (s, c) = (libm::sin(angle_rad), libm::cos(angle_rad));
        self.turned_by(&DMat3::from_cols(DVec3::new(c, 0.0, -s), DVec3::Y, DVec3::new(s, 0.0, c)))
    }

    /// Turned about the z axis by `angle_rad`.
    pub fn about_z(self, angle_rad: f64) -> Self {
        let (s, c) = (libm::sin(angle_rad), libm::cos(angle_rad));
        self.turned_by(&DMat3::from_cols(DVec3::new(c, s, 0.0), DVec3::new(-s, c, 0.0), DVec3::Z))
    }

    /// Every corner moved by `bend`, which must not fold the surface.
    pub fn bent(self, bend: impl Fn(DVec3) -> DVec3) -> Self {
        Solid(self.0.warp(|v| *v = vector(bend(DVec3::new(v.x, v.y, v.z)))))
    }
}

impl Add for Solid {
    type Output = Solid;
    fn add(self, other: Solid) -> Solid {
        Solid(self.0.union(&other.0))
    }
}

impl Sub for Solid {
    type Output = Solid;
    fn sub(self, other: Solid) -> Solid {
        Solid(self.0.difference(&other.0))
    }
}

impl BitAnd for Solid {
    type Output = Solid;
    fn bitand(self, other: Solid) -> Solid {
        Solid(self.0.intersection(&other.0))
    }
}

impl AddAssign for Solid {
    fn add_assign(&mut self, other: Solid) {
        self.0 = self.0.union(&other.0);
    }
}

impl SubAssign for Solid {
    fn sub_assign(&mut self, other: Solid) {
        self.0 = self.0.difference(&other.0);
    }
}

fn vector(v: DVec3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

fn polygon(points: &[DVec2]) -> SimplePolygon {
    points.iter().map(|p| Vec2::new(p.x, p.y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_enclose_what_their_formulas_say() {
        let close = |solid: &Solid, exact: f64| {
            let volume = solid.volume();
            assert!((volume / exact - 1.0).abs() < 0.02, "{volume} {exact}");
        };
        let pi = std::f64::consts::PI;
        close(&Solid::cylinder(10.0, -2.0, 5.0), 700.0 * pi);
        // A facet lies up to two chord errors inside: 3 · 0.2 / 20 of the volume at most.
        let ball = Solid::ball(20.0).volume() / (32000.0 / 3.0 * pi);
        assert!(ball < 1.0 && ball > 0.97, "{ball}");
        close(&Solid::cone(10.0, 5.0, 0.0, 6.0), 350.0 * pi);
        let plate = Outline::rectangle(30.0, 20.0);
        let holes = [Outline::circle(4.0).at(-8.0, 0.0), Outline::circle(4.0).at(8.0, 0.0)];
        close(&Solid::plate(&plate, &holes, 0.0, 10.0), 6000.0 - 320.0 * pi);
        close(&Solid::cylinder(3.0, 0.0, 10.0).along_x(), 90.0 * pi);
    }

    #[test]
    fn laying_down_keeps_bodies_right_handed() {
        let body = || Solid::block([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]);
        let bounds = |s: Solid| s.to_mesh().bounds().unwrap().1;
        assert_eq!(bounds(body().along_x()), DVec3::new(3.0, 1.0, 2.0));
        assert_eq!(bounds(body().along_y()), DVec3::new(2.0, 3.0, 1.0));
        assert!(body().along_y().volume() > 0.0);
    }

    #[test]
    fn set_operations_add_up() {
        let a = Solid::block([0.0; 3], [4.0; 3]);
        let b = Solid::block([2.0; 3], [6.0; 3]);
        assert!(((a.clone() + b.clone()).volume() - 120.0).abs() < 1e-9);
        assert!(((a.clone() - b.clone()).volume() - 56.0).abs() < 1e-9);
        assert!(((a & b).volume() - 8.0).abs() < 1e-9);
    }
}
