//! Test bodies with known answers: boxes, spheres, cylinders and others.

use super::Mesh;
use glam::{DVec2, DVec3};

/// A box from the origin to `size` mm: 8 vertices, 12 triangles.
///
/// # Panics
/// If a length is not positive and finite.
pub fn cuboid(size: DVec3) -> Mesh {
    assert!(size.is_finite() && size.min_element() > 0.0, "a box of size {size}");
    let outline = [[0.0, 0.0], [size.x, 0.0], [size.x, size.y], [0.0, size.y]];
    prism(&outline.map(DVec2::from_array), &[[0, 1, 2], [0, 2, 3]], size.z)
}

/// The outline (counter-clockwise, mm; cut into the triangles `cap`) raised from z = 0 to
/// `height_mm`: two vertices per outline corner.
///
/// # Panics
/// If the outline has less than three corners or one that is not finite, `cap` names another corner, or the height is
/// not positive and finite.
pub fn prism(outline: &[DVec2], cap: &[[u32; 3]], height_mm: f64) -> Mesh {
    let n = outline.len() as u32;
    assert!(n > 2 && outline.iter().all(|p| p.is_finite()), "an outline of {outline:?}");
    let stray = cap.iter().flatten().find(|&&corner| corner >= n);
    assert!(stray.is_none(), "corner {stray:?} of an outline of {n}");
    assert!(height_mm > 0.0 && height_mm.is_finite(), "a prism {height_mm} mm high");
    let bottom = outline.iter().map(|p| p.extend(0.0));
    let vertices = bottom.chain(outline.iter().map(|p| p.extend(height_mm))).collect();
    let caps = cap.iter().flat_map(|[a, b, c]| [[*a, *c, *b], [a + n, b + n, c + n]]);
    let walls = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, j, j + n], [i, j + n, i + n]]
    });
    Mesh { vertices, triangles: caps.chain(walls).collect() }
}

/// A torus about the z axis: `n_around` × `n_across` quads cut in two. A tube thicker than the ring intersects itself.
///
/// # Panics
/// If a radius is not positive and finite, or a number is below 3 or their product above 2^24.
pub fn torus(major_mm: f64, minor_mm: f64, n_around: u32, n_across: u32) -> Mesh {
    let is_ring = [major_mm, minor_mm].iter().all(|radius| *radius > 0.0 && radius.is_finite());
    assert!(is_ring, "a torus with the radii {major_mm} and {minor_mm} mm");
    let n = u64::from(n_around) * u64::from(n_across);
    assert!(n_around.min(n_across) > 2 && n <= 1 << 24, "{n_around} times {n_across} quads");
    let angle = |i: u32, n: u32| std::f64::consts::TAU * f64::from(i) / f64::from(n);
    let mut mesh = Mesh::default();
    for i in 0..n_around {
        for j in 0..n_across {
            let (around, across) = (angle(i, n_around), angle(j, n_across));
            let radius = major_mm + minor_mm * libm::cos(across);
            let (x, y) = (radius * libm::cos(around), radius * libm::sin(around));
            mesh.vertices.push(DVec3::new(x, y, minor_mm * libm::sin(across)));
            let (i1, j1) = ((i + 1) % n_around, (j + 1) % n_across);
            let [a, b, c, d] = [(i, j), (i1, j), (i1, j1), (i, j1)].map(|(i, j)| i * n_across + j);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_and_areas_are_the_textbook_ones() {
        let cuboid = cuboid(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!((cuboid.volume(), cuboid.area()), (6.0, 22.0));
        let torus = torus(3.0, 1.0, 400, 200);
        let exact = 2.0 * std::f64::consts::PI.powi(2) * 3.0;
        assert!((torus.volume() / exact - 1.0).abs() < 1e-3);
    }
}
