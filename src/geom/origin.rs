//! Parts far from the origin: they are worked on about a local one.
//!
//! Sites are single precision, whose numbers are 0.0005 mm apart at 4 m from the origin and 0.06 mm at 800 m: more than
//! the contact tolerance. So the corners of such a part are taken relative to the low corner of its box, along the axes
//! where it is far, in double precision; the offset is kept beside the answers. What the subtraction leaves of the last
//! digits is rounded away, so that a part moved by an offset of as many decimals has the same corners to the bit.

use super::Mesh;
use glam::DVec3;

/// A box that begins farther than this from the origin along an axis is far, mm.
pub const FAR_MM: f64 = 4096.0;
/// Decimals of a millimeter that corners keep at most.
const DECIMALS: f64 = 1e9;
/// Rounding is to this many of the distances between numbers of double precision at the least.
const SPACINGS: f64 = 4.0;

/// The local origin of a part: the low corner of its box along the axes where that is far, 0 along the others; `None`
/// if it is far along no axis.
///
/// ```
/// use deepmill::geom::{origin, solids};
/// use deepmill::glam::DVec3;
/// let near = solids::cuboid(DVec3::splat(0.1));
/// let mut far = near.clone();
/// far.vertices.iter_mut().for_each(|v| v.x += 400_000.37);
/// let at = origin::local_origin(&far).unwrap();
/// origin::make_relative(&mut far, at);
/// assert_eq!((at, far), (DVec3::new(400_000.37, 0.0, 0.0), near));
/// ```
pub fn local_origin(mesh: &Mesh) -> Option<DVec3> {
    let (low, high) = mesh.bounds()?;
    let along = |low: f64, high: f64| {
        let is_far = low > FAR_MM || high < -FAR_MM;
        if is_far && (high - low).is_finite() { low } else { 0.0 }
    };
    let [x, y, z] = [0, 1, 2].map(|k| along(low[k], high[k]));
    let origin = DVec3::new(x, y, z);
    (origin != DVec3::ZERO).then_some(origin)
}

/// Takes every corner relative to an origin.
pub fn make_relative(mesh: &mut Mesh, origin: DVec3) {
    let decimals = origin.to_array().map(decimals);
    for vertex in &mut mesh.vertices {
        for k in 0..3 {
            if origin[k] != 0.0 {
                vertex[k] = libm::round((vertex[k] - origin[k]) * decimals[k]) / decimals[k];
            }
        }
    }
}

/// A power of ten, of which a part is still well above the distance between numbers of the size of `x`.
fn decimals(x: f64) -> f64 {
    let spacing = x.abs() * f64::EPSILON;
    let mut decimals = DECIMALS;
    while decimals > 1.0 && SPACINGS * spacing * decimals > 1.0 {
        decimals /= 10.0;
    }
    decimals
}

/// The distance between neighboring numbers of single precision at `x`, mm.
pub fn single_spacing(x: f64) -> f64 {
    let x = x.abs() as f32;
    if x.is_finite() { f64::from(x.next_up()) - f64::from(x) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::torus;

    fn moved(mesh: &Mesh, by: DVec3) -> Mesh {
        let vertices = mesh.vertices.iter().map(|v| *v + by).collect();
        Mesh { vertices, triangles: mesh.triangles.clone() }
    }

    /// With its low corner at the origin, and as many decimals as people write.
    fn part() -> Mesh {
        let mut mesh = torus(30.0, 9.5, 24, 16);
        let low = mesh.bounds().unwrap().0;
        mesh.vertices.iter_mut().for_each(|v| *v = ((*v - low) * 1e6).round() / 1e6);
        mesh
    }

    #[test]
    fn answers_do_not_depend_on_an_offset_however_far() {
        let near = part();
        assert_eq!(local_origin(&near), None);
        for by in [
            DVec3::new(400_000.37, 800_000.21, 0.0),
            DVec3::new(-5000.0, 4096.5, 123_456.789),
            DVec3::new(0.0, 0.0, 8e5 + 0.125),
        ] {
            let mut far = moved(&near, by);
            let at = local_origin(&far).unwrap();
            assert_eq!(at, by);
            make_relative(&mut far, at);
            assert_eq!(far, near, "{by}");
        }
    }

    #[test]
    fn parts_about_the_origin_or_near_it_stay_where_they_are() {
        let long = crate::geom::solids::cuboid(DVec3::new(20_000.0, 10.0, 10.0));
        assert_eq!(local_origin(&long), None);
        assert_eq!(local_origin(&moved(&long, DVec3::new(-9000.0, 4000.0, -3000.0))), None);
        assert_eq!(local_origin(&Mesh::default()), None);
        assert_eq!((single_spacing(800_000.21), single_spacing(0.5)), (0.0625, 2f64.powi(-24)));
    }
}
