//! The map from millimeters into the cube [−1, 1]³ of an octree, and back.

use crate::{Error, Result};
use glam::{DVec3, Vec3};

/// Which cube a shape is moved into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Normalization {
    /// The paper's unit cube: the bounding box is centered and its longest edge becomes [−1, 1].
    #[default]
    UnitCube,
    /// The reference's preparation: the mean of the points is moved to the origin and the greatest
    /// |coordinate| becomes 0.8.
    Mean,
}

/// The similarity `p ↦ (p − center)·scale` that normalizes one shape.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct CubeTransform {
    /// What becomes the origin, mm.
    pub center: DVec3,
    /// Normalized length of one millimeter.
    pub scale: f64,
}

impl Normalization {
    /// The transform of a shape; one whose points all coincide is moved but not scaled.
    ///
    /// # Errors
    /// If there are no points or one is not finite.
    pub fn transform(self, points: &[Vec3]) -> Result<CubeTransform> {
        if points.is_empty() {
            return Err(Error::geometry("shape", "it has no points", "give it at least one point"));
        }
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            return Err(Error::NotFinite {
                place: format!("point {i}"),
                found: points[i].to_string(),
                remedy: "remove or repair it".into(),
            });
        }
        let exact = || points.iter().map(|p| p.as_dvec3());
        let (center, extent) = match self {
            Normalization::UnitCube => {
                let low = exact().fold(DVec3::INFINITY, DVec3::min);
                let high = exact().fold(DVec3::NEG_INFINITY, DVec3::max);
                (0.5 * (low + high), 1.0)
            }
            Normalization::Mean => (exact().sum::<DVec3>() / points.len() as f64, 0.8),
        };
        let greatest = exact().map(|p| (p - center).abs().max_element()).fold(0.0, f64::max);
        let scale = if greatest > 0.0 { extent / greatest } else { 1.0 };
        Ok(CubeTransform { center, scale })
    }
}

impl CubeTransform {
    /// Millimeters to the cube; coordinates that rounding would put outside are put on its faces if the
    /// excess is below 1e-6.
    pub fn apply(&self, point: Vec3) -> Vec3 {
        let p = ((point.as_dvec3() - self.center) * self.scale).as_vec3();
        let clamped = p.clamp(Vec3::NEG_ONE, Vec3::ONE);
        if (p - clamped).abs().max_element() < 1e-6 { clamped } else { p }
    }

    /// The cube back to millimeters.
    pub fn invert(&self, point: Vec3) -> Vec3 {
        (point.as_dvec3() / self.scale + self.center).as_vec3()
    }
}

/// How points in millimeters are prepared for [`super::Octree::build`].
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::octree::{Cloud, Octree, OctreeOptions, Preparation};
///
/// let points = [Vec3::new(10.0, 0.0, 0.0), Vec3::new(30.0, 0.0, 0.0)]; // mm
/// let prepared = Preparation::default().prepare(&points)?;
/// assert_eq!(prepared.points, [Vec3::NEG_X, Vec3::X]); // the edges of the cube
/// let octree = Octree::build(&[Cloud::new(&prepared.points, &[])], &OctreeOptions::default())?;
/// assert_eq!(octree.finest().n_nodes(), 16); // the children of the two nodes that hold a point
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Preparation {
    /// The cube.
    pub normalization: Normalization,
    /// Drop the points that have a coordinate not strictly inside ± this value after normalizing.
    pub clip: Option<f32>,
}

/// Points ready for [`super::Octree::build`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Prepared {
    /// The kept points in [−1, 1]³.
    pub points: Vec<Vec3>,
    /// Their indices before clipping, ascending; labels and normals must be selected by them.
    pub kept: Vec<u32>,
    /// The similarity that was applied.
    pub transform: CubeTransform,
}

impl Preparation {
    /// What the reference does: [`Normalization::Mean`], and clipping at ±0.99, which drops nothing then.
    pub fn reference() -> Self {
        Preparation { normalization: Normalization::Mean, clip: Some(0.99) }
    }

    /// Normalizes and clips.
    ///
    /// # Errors
    /// If there are no points or one is not finite, or the limit of clipping is not positive.
    pub fn prepare(&self, points: &[Vec3]) -> Result<Prepared> {
        if let Some(limit) = self.clip.filter(|limit| limit.is_nan() || *limit <= 0.0) {
            let remedy = "the reference clips at 0.99; None clips nothing";
            return Err(Error::argument("clip", limit, "above 0", remedy));
        }
        let transform = self.normalization.transform(points)?;
        let points: Vec<Vec3> = points.iter().map(|&p| transform.apply(p)).collect();
        let kept = match self.clip {
            Some(limit) => clip(&points, limit),
            None => (0..points.len() as u32).collect(),
        };
        let points = kept.iter().map(|&i| points[i as usize]).collect();
        Ok(Prepared { points, kept, transform })
    }
}

/// Indices of the points with every coordinate strictly inside (−limit, limit), ascending.
pub(crate) fn clip(points: &[Vec3], limit: f32) -> Vec<u32> {
    let inside = |p: &Vec3| p.abs().max_element() < limit && !p.is_nan();
    (0..points.len() as u32).filter(|&i| inside(&points[i as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn both_cubes_are_as_defined() {
        let points =
            [Vec3::new(10.0, 0.0, 0.0), Vec3::new(14.0, 2.0, 0.0), Vec3::new(12.0, 1.0, 1.0)];
        let cube = Normalization::UnitCube.transform(&points).unwrap();
        assert_eq!((cube.center, cube.scale), (DVec3::new(12.0, 1.0, 0.5), 0.5));
        let mean = Normalization::Mean.transform(&points).unwrap();
        assert!((mean.center - DVec3::new(12.0, 1.0, 1.0 / 3.0)).length() < 1e-12);
        assert_eq!(mean.scale, 0.4);
        for transform in [cube, mean] {
            assert!((transform.invert(transform.apply(points[1])) - points[1]).length() < 1e-5);
        }
    }

    #[test]
    fn rounding_never_leaves_the_unit_cube() {
        let mut stream = Stream::new(3, 0, 0, Purpose::Probe);
        for _ in 0..300 {
            let mut coordinate = || stream.range(-1.0, 1.0) as f32 * 37.7;
            let points: Vec<Vec3> =
                (0..3).map(|_| Vec3::new(coordinate(), coordinate(), coordinate())).collect();
            let prepared = Preparation::default().prepare(&points).unwrap();
            assert!(prepared.points.iter().all(|p| p.abs().max_element() <= 1.0));
        }
    }

    #[test]
    fn coinciding_points_are_centered_and_bad_ones_refused() {
        let transform = Normalization::Mean.transform(&[Vec3::splat(5.0); 4]).unwrap();
        assert_eq!((transform.apply(Vec3::splat(5.0)), transform.scale), (Vec3::ZERO, 1.0));
        assert!(Normalization::UnitCube.transform(&[]).is_err());
        let error =
            Normalization::Mean.transform(&[Vec3::ZERO, Vec3::splat(f32::NAN)]).unwrap_err();
        assert!(error.to_string().starts_with("point 1: "));
    }

    #[test]
    fn clipping_is_strict() {
        let points =
            [Vec3::ZERO, Vec3::splat(0.99), Vec3::new(0.5, -0.999, 0.0), Vec3::splat(-0.98)];
        assert_eq!(clip(&points, 0.99), [0, 3]);
        let prepared =
            Preparation { clip: Some(0.9), ..Default::default() }.prepare(&points).unwrap();
        assert_eq!(prepared.points.len(), prepared.kept.len());
    }
}
