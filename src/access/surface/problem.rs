//! One cutter at many queries: what is the same for all directions, and where points of the surface decide.

use super::bvh::Bvh;
use super::labels::SurfaceOptions;
use super::pose::PoseSet;
use super::pose::blockers::Shape;
use super::query::Probe;
use super::samples;
use super::surroundings::{PoseBounds, Rings};
use super::tolerance::Tolerances;
use super::tool::{Contact, Outline};
use crate::Result;
use crate::access::{self, CollisionMatrix, LabelOptions, Obstacles, Queries};
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::{Cutter, Step};
use crate::tool::directions::Directions;
use glam::{DVec3, Vec3};

/// What separates a collision that a point proves from one that is left to the triangles, as a share of all lengths:
/// several times what `f32` can round.
pub(super) const MARGIN: f64 = 2e-6;

/// One cutter at all queries.
pub(super) struct Problem<'a> {
    /// Search tree over all triangles.
    pub bvh: &'a Bvh,
    /// Corners of the part's own triangles, mm.
    pub part: &'a [[DVec3; 3]],
    pub contacts: Vec<Contact>,
    pub tolerances: Tolerances,
    /// Of the facets that every query is on, mm.
    pub own_tolerances: Vec<f64>,
    pub outline: Outline,
    pub poses: PoseSet,
    pub rings: Rings,
    /// Per query.
    pub bounds: Vec<PoseBounds>,
    /// All poses in oblique directions that points may decide are within this of the query's own, mm.
    pub trusted: f64,
    pub probes: Probes,
    /// The whole tool, and its ball, as blockers see them.
    pub shapes: [Shape; 2],
    /// Greatest distance of a reference point from the middle of the triangles, mm.
    pub reach: f64,
}

/// The tool in all forms that are tested.
pub(super) struct Probes {
    pub whole: Probe,
    /// Where the ball is known to fit: see [`Probe::above_ball`].
    pub above_ball: Probe,
    pub ball: Probe,
    /// Where the ball is known to gouge.
    pub steps: Probe,
}

impl Probes {
    fn new(outline: &Outline, least: f64, bvh: &Bvh, reach: f64) -> Self {
        Probes {
            whole: Probe::new(outline, least, bvh, reach),
            above_ball: Probe::above_ball(outline, least, bvh, reach),
            ball: Probe::of_ball(outline, least, bvh, reach),
            steps: Probe::of_steps(outline, least, bvh, reach),
        }
    }
}

/// A block of queries shares a word of the answers by points.
pub(super) const WORD: usize = 64;
/// Queries per task of their surroundings.
const SURROUNDED: usize = 256;
/// Samples are taken of facets whose tolerance is at most this many times the least, or this share of the tool's
/// radius.
const USUAL: f64 = 2.0;
const USUAL_SHARE: f64 = 0.02;

impl<'a> Problem<'a> {
    pub fn new(
        bvh: &'a Bvh,
        part: &'a [[DVec3; 3]],
        contacts: Vec<Contact>,
        tolerances: Tolerances,
        outline: Outline,
    ) -> Self {
        let far = contacts.iter().map(|contact| contact.point.distance(bvh.origin()));
        let farthest = far.fold(bvh.radius(), f64::max);
        // The same for any queries about the part: margins are not to depend on what else is asked.
        let mut reach = (1.001 * bvh.radius()).max(f64::MIN_POSITIVE);
        while reach < farthest {
            reach *= 2.0;
        }
        let reach = reach + outline.radius() + outline.finish();
        let rings = Rings::new(&outline, tolerances.least);
        let of = |contact: &Contact| match contact.normal {
            Some(normal) => rings.at(bvh, &tolerances, contact.point, normal),
            None => rings.everywhere(),
        };
        let bounds = par::map_blocks(contacts.len(), SURROUNDED, |range| {
            contacts[range].iter().map(of).collect::<Vec<_>>()
        });
        let in_space = contacts.first().is_some_and(|contact| contact.normal.is_none());
        let trusted = match in_space {
            true => rings.everywhere().from_center,
            false => rings.on_plane(tolerances.least),
        };
        let points: Vec<DVec3> = contacts.iter().map(|contact| contact.point).collect();
        let own_tolerances = tolerances.at_sites(bvh, &points);
        let probes = Probes::new(&outline, tolerances.least, bvh, reach);
        let bounds = bounds.into_iter().flatten().collect();
        let poses = PoseSet::new(&outline);
        let margin = MARGIN * (bvh.radius() + reach + outline.size());
        let shapes = [false, true].map(|is_ball| Shape::new(&outline, is_ball, margin));
        Problem {
            bvh,
            part,
            contacts,
            tolerances,
            own_tolerances,
            outline,
            poses,
            rings,
            bounds,
            trusted,
            probes,
            shapes,
            reach,
        }
    }

    /// How far beside the rim of the tool a query still touches it, mm: see [`PoseSet::touches`].
    pub fn rim(&self, i: usize) -> f64 {
        self.own_tolerances[i] + self.outline.finish()
    }

    /// The search tree with the tolerance of each of its triangles.
    pub fn triangles(&self) -> (&Bvh, &Tolerances) {
        (self.bvh, &self.tolerances)
    }

    /// Corners of all triangles, with the tolerance against each.
    pub fn all_triangles(&self) -> impl Iterator<Item = ([DVec3; 3], f64)> {
        let places = 0..self.bvh.n_triangles() as u32;
        places.map(|place| (*self.bvh.triangle(place), self.tolerances.at(place)))
    }

    /// More than the roundings of `f32`, mm.
    pub fn margin(&self) -> f64 {
        MARGIN * (self.bvh.radius() + self.reach + self.outline.size())
    }

    /// Where points of the surface prove that the queries' own poses collide.
    pub fn own_by_points(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<CollisionMatrix> {
        self.by_points(cutter, directions, options, (0.0, &self.contacts))
    }

    /// Where points of the surface prove that all poses collide which are within [`Problem::trusted`] of the query's
    /// own, for some queries.
    pub fn all_by_points(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
        of: &[usize],
    ) -> Result<CollisionMatrix> {
        let contacts: Vec<Contact> = of.iter().map(|&i| self.contacts[i]).collect();
        self.by_points(cutter, directions, options, (self.trusted, &contacts))
    }

    /// The tool is shrunk by `within`, by the tolerance and by more than all roundings, and all is about the middle of
    /// the triangles, where `f32` is finest.
    fn by_points(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
        (within, contacts): (f64, &[Contact]),
    ) -> Result<CollisionMatrix> {
        let origin = self.bvh.origin();
        let least = self.tolerances.least;
        let usual = (USUAL * least).max(USUAL_SHARE * self.outline.radius());
        let tolerance = self.tolerances.most.min(usual);
        let shrink = tolerance + within + self.margin();
        let Some(shrunk) = shrunk(cutter, shrink)? else {
            let rows = vec![vec![0; contacts.len().div_ceil(WORD)]; directions.len()];
            return Ok(CollisionMatrix::new(contacts.len(), rows));
        };
        // A table would take nearly all points for itself.
        let samples = match self.tolerances.most > usual {
            false => samples::points(self.part, options.n_samples, origin),
            true => {
                let n = self.bvh.n_triangles() as u32;
                let usual = (0..n).filter(|&place| {
                    let is_of_part = (self.bvh.face(place) as usize) < self.part.len();
                    is_of_part && self.tolerances.at(place) <= tolerance
                });
                let usual: Vec<_> = usual.map(|place| *self.bvh.triangle(place)).collect();
                samples::points(&usual, options.n_samples, origin)
            }
        };
        let samples: Vec<Vec3> = samples.into_iter().map(|p| p.as_vec3()).collect();
        let mut sites = Sites::default();
        for contact in contacts {
            sites.points.push((contact.point - origin).as_vec3());
            sites.normals.extend(contact.normal.map(|normal| normal.as_vec3()));
        }
        let volume = sites.normals.is_empty();
        let queries = if volume { Queries::Volume(&sites.points) } else { Queries::Sites(&sites) };
        let obstacles = Obstacles::Points(&samples);
        let options =
            LabelOptions { occlusion: false, collision_matrix: true, ..LabelOptions::default() };
        let labels = access::label(queries, obstacles, &shrunk, directions, &options)?;
        Ok(labels.collision_matrix.expect("the option is set"))
    }

    /// Whether a collision that points prove holds for all poses of a query along a direction.
    pub fn is_trusted(&self, i: usize, direction: DVec3) -> bool {
        let contact = &self.contacts[i];
        contact.normal.is_none()
            || (self.bounds[i].oblique <= self.trusted
                && contact.is_oblique(&self.outline, direction))
    }
}

/// The steps that are left after shrinking them; none if none is.
fn shrunk(cutter: &Cutter, by_mm: f64) -> Result<Option<Cutter>> {
    /// Thinner steps hold no point.
    const THIN_MM: f64 = 1e-3;
    let left = cutter.steps().iter().filter(|step| step.radius_mm > by_mm + THIN_MM);
    let steps: Vec<Step> = left
        .map(|step| Step { height_mm: step.height_mm + by_mm, radius_mm: step.radius_mm - by_mm })
        .collect();
    if steps.is_empty() {
        return Ok(None);
    }
    Cutter::from_steps(cutter.corner_mm(), cutter.side_mm(), steps).map(Some)
}
