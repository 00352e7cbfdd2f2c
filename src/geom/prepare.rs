//! From a mesh as it was read to one that can be labeled.

use super::repair::{self, Change};
use super::{Mesh, bodies, check};
use crate::Result;

/// Makes of a mesh as it was read what can be labeled, as the commands do: loose vertices are dropped, a mesh that
/// faces inward is turned, bodies that overlap are joined, shells within a body bound cavities. Returns what it did.
///
/// ```
/// use deepmill::geom::{self, solids};
/// let mut part = solids::cuboid(deepmill::glam::DVec3::new(20.0, 10.0, 10.0));
/// part.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1)); // it faces inward
/// assert_eq!(geom::prepare(&mut part)?.len(), 1);
/// assert_eq!(part.volume(), 2000.0);
/// # Ok::<(), deepmill::Error>(())
/// ```
///
/// # Errors
/// As [`bodies::join`], or [`Error::Geometry`](crate::Error::Geometry) with place, count and remedy of what still keeps
/// it from bounding solids.
pub fn prepare(mesh: &mut Mesh) -> Result<Vec<Change>> {
    mesh.check()?;
    let mut changes: Vec<Change> = repair::drop_loose(mesh).into_iter().collect();
    changes.extend(repair::face_outward(mesh));
    changes.extend(bodies::join(mesh)?);
    check::check(mesh).require_bodies()?;
    Ok(changes)
}
