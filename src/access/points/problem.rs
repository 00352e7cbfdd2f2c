//! The checked input of labeling: queries, obstacles and cutters as arrays of numbers.

use super::bottom::bottom_sites;
use super::kernels::Rotate;
use super::predicate::{self, Frame, StepSquared};
use crate::geom::Sites;
use crate::geom::sites::{check_points, check_sites};
use crate::simd::Isa;
use crate::spatial::Coordinates;
use crate::tool::cutter::Cutter;
use crate::{Error, Result};
use glam::Vec3;

/// Where the cutter is to go.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Queries<'a> {
    /// Touching a surface at these sites: the reference point is `s + CR·n`.
    Sites(&'a Sites),
    /// With its tip at these points of space (roughing), mm: the reference point is `p + CR·d`.
    Volume(&'a [Vec3]),
}

impl<'a> From<&'a Sites> for Queries<'a> {
    fn from(sites: &'a Sites) -> Self {
        Queries::Sites(sites)
    }
}

impl Queries<'_> {
    /// Number of queries.
    pub fn len(&self) -> usize {
        self.points().len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points().is_empty()
    }

    fn points(&self) -> &[Vec3] {
        match self {
            Queries::Sites(sites) => &sites.points,
            Queries::Volume(points) => points,
        }
    }
}

/// What the cutter must not touch. β follows the order of the obstacles.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Obstacles<'a> {
    /// The query sites themselves, as in the paper; a site is never its own obstacle. All are ranked.
    Queries,
    /// The query sites, then these points, mm: a denser and so more faithful surface. A site is never
    /// its own obstacle. β counts all, but only the sites are ranked as occlusion points.
    QueriesAnd(&'a [Vec3]),
    /// These points alone, mm. All are ranked.
    Points(&'a [Vec3]),
    /// These points alone decide where the cutter collides, mm: the [centroids](crate::geom::Mesh::centroids) of the
    /// mesh whose vertices are the query sites. β is that of the query sites, which are ranked; a site is never its
    /// own obstacle.
    Centroids(&'a [Vec3]),
}

impl Obstacles<'_> {
    /// Number of obstacles beside so many queries.
    pub(super) fn n_beside(&self, n_queries: usize) -> usize {
        match self {
            Obstacles::Queries => n_queries,
            Obstacles::QueriesAnd(points) | Obstacles::Centroids(points) => {
                n_queries + points.len()
            }
            Obstacles::Points(points) => points.len(),
        }
    }
}

/// Checked queries and obstacles in an engine's order.
#[derive(Clone)]
pub(super) struct Scene {
    pub points: Vec<Vec3>,
    /// Empty for volume queries.
    pub normals: Vec<Vec3>,
    pub obstacles: Coordinates,
    /// Per query the obstacle that is the query itself, or [`NOT_AN_OBSTACLE`]; empty if none is.
    pub own: Vec<u32>,
    /// Obstacles that can be occlusion points: the first so many as given.
    pub n_ranked: usize,
    /// Per query whether it is labeled accessible whatever collides; empty if none is.
    pub bottom: Vec<bool>,
}

/// Of a query that is none of the obstacles.
pub(super) const NOT_AN_OBSTACLE: u32 = u32::MAX;

impl Scene {
    pub fn new(queries: Queries, obstacles: Obstacles) -> Result<Self> {
        let points = queries.points();
        let normals: &[Vec3] = match queries {
            Queries::Sites(sites) => &sites.normals,
            Queries::Volume(_) => &[],
        };
        let volume = matches!(queries, Queries::Volume(_));
        let (same, extra): (bool, &[Vec3]) = match obstacles {
            Obstacles::Queries => (true, &[]),
            Obstacles::QueriesAnd(extra) => (true, extra),
            Obstacles::Points(points) | Obstacles::Centroids(points) => (false, points),
        };
        if same && volume {
            let found = "the queries are points of space, not of the part";
            return Err(Error::geometry("obstacles", found, "give obstacles of their own"));
        }
        check("query", points)?;
        check("obstacle", extra)?;
        if !volume {
            check_sites("query", points, normals)?;
        }
        let own = if same { 0..points.len() as u32 } else { 0..0 };
        let first = if same { points } else { &[] };
        let n_obstacles = first.len() + extra.len();
        let mut all = Coordinates::zeros(n_obstacles);
        first.iter().chain(extra).enumerate().for_each(|(j, p)| all.set(j, p.to_array()));
        let n_ranked = if same { first.len() } else { n_obstacles };
        Ok(Scene {
            points: points.into(),
            normals: normals.into(),
            obstacles: all,
            own: own.collect(),
            n_ranked,
            bottom: Vec::new(),
        })
    }

    /// With the bottom rule, for queries that are sites.
    pub fn with_bottom(self, bottom_mm: Option<f64>) -> Self {
        match bottom_mm.filter(|_| !self.normals.is_empty()) {
            None => self,
            Some(bottom_mm) => Scene { bottom: bottom_sites(&self.points, bottom_mm), ..self },
        }
    }

    /// With these of its obstacles alone.
    pub fn with_obstacles(mut self, chosen: &[usize]) -> Self {
        let mut places = vec![NOT_AN_OBSTACLE; self.obstacles.n];
        let mut obstacles = Coordinates::zeros(chosen.len());
        for (place, &j) in chosen.iter().enumerate() {
            obstacles.set(place, self.obstacles.get(j));
            places[j] = place as u32;
        }
        let place = |own: u32| places.get(own as usize).copied().unwrap_or(NOT_AN_OBSTACLE);
        self.own.iter_mut().for_each(|own| *own = place(*own));
        self.n_ranked = chosen.iter().filter(|j| **j < self.n_ranked).count();
        Scene { obstacles, ..self }
    }

    /// [`Scene::bottom`] where the ranked obstacles are the queries, in their order; else empty.
    pub fn bottom_of_ranked(&self) -> &[bool] {
        if self.own.is_empty() { &[] } else { &self.bottom }
    }

    pub fn n_queries(&self) -> usize {
        self.points.len()
    }
}

fn check(what: &str, points: &[Vec3]) -> Result<()> {
    if points.len() > u32::MAX as usize / 2 {
        let remedy = "label in parts";
        return Err(Error::geometry(what, format!("{} points", points.len()), remedy));
    }
    check_points(what, points)
}

/// A cutter at every query, before the direction is known.
pub(super) struct PlacedCutter {
    pub steps: Vec<StepSquared>,
    /// Base of each reference point.
    pub bases: Coordinates,
    /// As [`Scene::own`].
    pub own: Vec<u32>,
    /// Only kept for a cutter with a side offset.
    normals: Vec<Vec3>,
    in_order: bool,
    lift: f32,
    side: f32,
    corner: f32,
    /// The same number for all cutters of a call that share their reference points with others.
    pub group: Option<usize>,
}

impl PlacedCutter {
    pub fn new(scene: &Scene, cutter: &Cutter) -> Self {
        let volume = scene.normals.is_empty();
        let corner = cutter.corner_mm() as f32;
        let mut bases = Coordinates::zeros(scene.n_queries());
        for (i, &point) in scene.points.iter().enumerate() {
            let normal = scene.normals.get(i).copied().unwrap_or(Vec3::ZERO);
            bases.set(i, predicate::base(point, normal, corner));
        }
        let side = if volume { 0.0 } else { cutter.side_mm() as f32 };
        PlacedCutter {
            steps: predicate::steps(cutter),
            bases,
            own: scene.own.clone(),
            in_order: !scene.own.is_empty()
                && scene.own.iter().copied().eq(0..scene.n_queries() as u32),
            normals: if side > 0.0 { scene.normals.clone() } else { vec![] },
            lift: if volume { corner } else { 0.0 },
            side,
            corner,
            group: None,
        }
    }

    /// Whether both have the same reference points.
    pub fn shares_reference_points(&self, other: &PlacedCutter) -> bool {
        self.corner == other.corner && self.side == other.side
    }

    /// The same cutter at these queries alone.
    pub fn restricted_to(&self, queries: &[u32]) -> PlacedCutter {
        let mut bases = Coordinates::zeros(queries.len());
        queries.iter().enumerate().for_each(|(p, &i)| bases.set(p, self.bases.get(i as usize)));
        PlacedCutter {
            steps: self.steps.clone(),
            bases,
            own: queries.iter().filter_map(|&i| self.own.get(i as usize).copied()).collect(),
            normals: queries
                .iter()
                .filter_map(|&i| self.normals.get(i as usize).copied())
                .collect(),
            ..*self
        }
    }

    /// Number of queries.
    pub fn n(&self) -> usize {
        self.bases.n
    }

    /// The obstacle that does not count for query `i`; `usize::MAX` for none.
    pub fn own(&self, i: usize) -> usize {
        let own = self.own.get(i).filter(|j| **j != NOT_AN_OBSTACLE);
        own.map_or(usize::MAX, |&j| j as usize)
    }

    /// Whether query `i` is obstacle `i` for all of `n_obstacles`.
    pub fn own_in_order(&self, n_obstacles: usize) -> bool {
        self.in_order && self.n() == n_obstacles
    }

    /// Reference point of query `i` in the frame.
    pub fn center(&self, frame: &Frame, i: usize) -> [f32; 3] {
        let center = predicate::rotate(frame, self.bases.get(i));
        let normal = self.normals.get(i).map_or([0.0; 3], |n| n.to_array());
        predicate::displace(center, self.lift, self.side, predicate::rotate(frame, normal))
    }

    /// Reference points of all queries in the frame, the same bits as [`PlacedCutter::center`].
    pub fn centers(&self, frame: &Frame, isa: Isa, to: &mut Coordinates) {
        isa.run(Rotate { frame, from: &self.bases, to: &mut *to });
        if self.lift != 0.0 || self.side != 0.0 {
            (0..self.n()).for_each(|i| to.set(i, self.center(frame, i)));
        }
    }
}
