//! The space around a part as training data: points without normals, each with the cutter's tip at it.

use crate::access::surface::{SurfaceOptions, TriangleObstacles};
use crate::access::{LabelOptions, Obstacles, Queries, label};
use crate::answers::SiteAnswers;
use crate::geom::inside::{Lattice, lattice_inside};
use crate::geom::{Mesh, Sites};
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::Vec3;

/// What blocks the cutter.
#[derive(Debug)]
pub enum VolumeObstacles {
    /// Points of the part's surface, mm: the published definition.
    Points(Vec<Vec3>),
    /// Its triangles, and the search between the directions: the mesh definition.
    Part(Box<TriangleObstacles>),
}

/// The points of a lattice over a part's box that are outside of the part.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Volume {
    /// All points.
    pub lattice: Lattice,
    /// Per point, whether it is inside the part.
    pub inside: Vec<bool>,
}

/// Rounds of the search for a step, and how far from the wanted number of points it ends.
const N_ROUNDS: usize = 6;
const TOLERANCE: f64 = 0.02;
/// Most points of the lattice for one point outside: a part that fills more of its box has no space around it.
const MOST_PER_POINT: usize = 200;

impl Volume {
    /// A lattice of which about `n_points` points are outside of `mesh`.
    ///
    /// # Errors
    /// If the mesh is not closed, or (almost) fills its box.
    pub fn new(mesh: &Mesh, n_points: usize) -> Result<Self> {
        let (low, high) = mesh.bounds().unwrap_or_default();
        let (mut n, wanted) = (n_points, n_points as f64);
        let mut best: Option<(f64, Volume)> = None;
        for _ in 0..N_ROUNDS {
            let lattice = Lattice::with_about(low, high, n)?;
            let volume = Volume { inside: lattice_inside(mesh, &lattice)?, lattice };
            let found = volume.n_outside() as f64;
            let away = (found - wanted).abs() / wanted;
            if found > 0.0 && best.as_ref().is_none_or(|(least, _)| away < *least) {
                best = Some((away, volume));
            }
            if away < TOLERANCE {
                break;
            }
            let next = (n as f64 * wanted / found.max(1.0)) as usize;
            n = next.clamp(1, MOST_PER_POINT * n_points);
        }
        best.map(|(_, volume)| volume).ok_or_else(|| {
            let remedy = "leave the part out, or label its surface";
            Error::geometry("part", "it fills its box: there is no space around it", remedy)
        })
    }

    /// Number of points outside the part.
    pub fn n_outside(&self) -> usize {
        self.inside.iter().filter(|inside| !**inside).count()
    }

    /// The points outside the part, mm, in the order of the lattice: sites without normals.
    pub fn points(&self) -> Sites {
        let outside = (0..self.lattice.len()).filter(|&n| !self.inside[n]);
        let points = outside.map(|n| self.lattice.point(n).as_vec3()).collect();
        Sites { points, ..Sites::default() }
    }
}

impl VolumeObstacles {
    /// For each of `points` whether the tip of `cutter` can be there. None is an occlusion point: those are sites of
    /// the surface.
    ///
    /// # Errors
    /// If a point is not finite, or as [`label`](crate::access::label()) and [`TriangleObstacles::label`].
    pub fn answers(
        &self,
        points: &[Vec3],
        cutter: &Cutter,
        directions: &Directions,
    ) -> Result<SiteAnswers> {
        let queries = Queries::Volume(points);
        let (inaccessible, accessible_directions, n_directions) = match self {
            VolumeObstacles::Points(obstacles) => {
                let options = LabelOptions { occlusion: false, ..LabelOptions::default() };
                let obstacles = Obstacles::Points(obstacles);
                let answers = label(queries, obstacles, cutter, directions, &options)?.answers;
                (answers.inaccessible(), answers.accessible_directions, directions.len())
            }
            VolumeObstacles::Part(triangles) => {
                let options = SurfaceOptions { occlusion: false, ..SurfaceOptions::default() };
                let labels = triangles.surface_labels(queries, cutter, directions, &options)?;
                (labels.inaccessible(), labels.accessible_directions, labels.evidence.n_directions)
            }
        };
        let none = vec![false; inaccessible.len()];
        let answers = SiteAnswers::new(inaccessible, none);
        Ok(SiteAnswers { accessible_directions, ..answers }.with_shares_of(n_directions))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use glam::DVec3;

    #[test]
    fn the_space_around_a_part_has_about_as_many_points_as_wanted() {
        let part = solids::torus(20.0, 8.0, 40, 20);
        for wanted in [200, 3000] {
            let volume = Volume::new(&part, wanted).unwrap();
            let points = volume.points();
            assert_eq!((points.len(), points.normals.len()), (volume.n_outside(), 0));
            assert!(points.len().abs_diff(wanted) < wanted / 4, "{}", points.len());
        }
        let message = Volume::new(&solids::cuboid(DVec3::ONE), 100).unwrap_err().to_string();
        assert!(message.contains("no space around it"), "{message}");
    }

    #[test]
    fn both_kinds_of_obstacles_close_what_the_holder_cannot_enter() {
        let part = solids::torus(20.0, 8.0, 60, 30);
        let points = Volume::new(&part, 2000).unwrap().points().points;
        let sites = sample(&part, &SiteOptions { n_sites: 2000, ..Default::default() }).unwrap();
        let cutter: Cutter = "1.5,6,40,5".parse().unwrap();
        let triangles = Box::new(TriangleObstacles::new(&part, &[]).unwrap());
        let directions = Directions::fibonacci_hemisphere(40).unwrap();
        let [by_points, by_part] =
            [VolumeObstacles::Points(sites.points), VolumeObstacles::Part(triangles)].map(|by| {
                let answers = by.answers(&points, &cutter, &directions).unwrap();
                assert_eq!(answers.n_occlusion(), 0);
                assert_eq!(answers.accessible_directions.len(), points.len());
                answers.inaccessible()
            });
        // The holder is wider than the hole, and begins 7.5 mm above the tip.
        let in_hole = |p: &Vec3| p.truncate().length() < 12.0 && p.z < -2.0;
        assert!(points.iter().filter(|p| in_hole(p)).count() > 20);
        for (p, inaccessible) in points.iter().zip(&by_part) {
            assert!(*inaccessible || !in_hole(p), "{p}");
            assert!(!inaccessible || p.z < 2.0, "{p}");
        }
        let differ = by_points.iter().zip(&by_part).filter(|(a, b)| a != b).count();
        assert!(differ < points.len() / 5, "{differ} of {}", points.len());
    }
}
