//! What the mesh definition gives beside its answers.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// What only the mesh definition gives beside its answers, in the order of the queries.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurfaceEvidence {
    /// Number of directions tested and counted: those of the set, and +z where the set stands for all within an angle
    /// that +z is among.
    #[doc(hidden)] // of the program
    pub n_directions: usize,
    /// Per query: directions in which no step penetrates the part; empty if not counted.
    pub collision_free_directions: Vec<u32>,
    /// Per query: a free pose of the tool there, in the first direction of the set that has one, or in one between
    /// them.
    pub witness: Vec<Option<WitnessPose>>,
    /// Per query that is not accessible: share of the directions which the set stands for that was not proven closed.
    /// At 0 the answer holds for every direction, not only for those tested; 1 if there was no search between them.
    pub open_directions: Vec<f32>,
    /// Per query: the gouge tolerance against the facet that it lies on, mm.
    #[doc(hidden)] // of the program
    pub tolerance_mm: Vec<f64>,
    /// The finish tolerance, mm.
    #[doc(hidden)] // of the program
    pub finish_mm: f64,
    /// Per query, whether it is accessible by a gouge tolerance above [`WIDE_MM`](super::surface::WIDE_MM) alone; empty
    /// if none is, or it was not computed
    /// ([`TriangleObstacles::rest_on_wide_tolerance`](super::surface::TriangleObstacles::rest_on_wide_tolerance)).
    #[doc(hidden)] // of warnings
    pub rests_on_tolerance: Vec<bool>,
    /// Per query that is inaccessible, whether a pose of the tool is free, but no retreat from one is proven; empty for
    /// tools that only widen upward, which leave as they came.
    #[serde(default)]
    pub retreat_unproven: Vec<bool>,
    /// Per query, the pose that leaves least, if the rest was computed and the tool removes anything there; empty
    /// without that option. `None` too where the query is accessible.
    #[doc(hidden)] // of the program
    #[serde(default)]
    pub rest_pose: Vec<Option<WitnessPose>>,
    /// What was done.
    #[doc(hidden)] // counts for benches
    pub stats: SurfaceStats,
}

/// A pose of the tool: where it is, and in which direction its axis points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct WitnessPose {
    /// From tip to spindle, a unit vector.
    pub direction: Vec3,
    /// The lowest point of the tool on its axis, mm.
    pub tip_mm: DVec3,
}

/// Counts of the work done; they do not depend on the number of threads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurfaceStats {
    /// Pairs (query, direction).
    pub pairs: u64,
    /// Of these, collisions that a point of the surface proves.
    pub by_points: u64,
    /// Whole tools tested against the triangles for the rest.
    pub tools_tested: u64,
    /// Triangles tested for these.
    pub triangles_tested: u64,
    /// Sites that only a direction between those of the set reaches.
    pub found_between: u64,
    /// Borderline sites: whose answer rests on a triangle that a change of the tolerance by 1e-6 mm
    /// would take out of the tool or put into it; at most this many would have another answer then.
    pub borderline: u64,
}

impl AddAssign for SurfaceStats {
    fn add_assign(&mut self, other: SurfaceStats) {
        self.pairs += other.pairs;
        self.by_points += other.by_points;
        self.tools_tested += other.tools_tested;
        self.triangles_tested += other.triangles_tested;
        self.found_between += other.found_between;
        self.borderline += other.borderline;
    }
}
