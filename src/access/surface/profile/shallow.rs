//! The poses of a site that are worth a push.

use super::contact::Pose;

/// Poses of one site that are pushed, those that penetrate least: at least so many, more along few directions.
const PUSHED: usize = 10;
const PUSHED_OF_FEW: usize = 40;
const PUSHED_OF_ALL: usize = 200;

/// A pose that penetrates something.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    /// How deep a point of what it penetrates is in the tool, beyond the tolerance, mm.
    pub depth: f64,
    /// Of the direction.
    pub k: usize,
    pub pose: Pose,
}

/// The poses that penetrate least, in that order; the first among equals.
#[derive(Debug)]
pub(super) struct Shallow {
    pub poses: Vec<Candidate>,
    most: usize,
}

impl Shallow {
    pub fn along(n_directions: usize) -> Self {
        let most = (PUSHED_OF_ALL / n_directions.max(1)).clamp(PUSHED, PUSHED_OF_FEW);
        Shallow { poses: Vec::new(), most }
    }

    /// Along the directions that the part suggests, beside the others.
    pub fn suggested() -> Self {
        Shallow { poses: Vec::new(), most: PUSHED }
    }

    pub fn add(&mut self, candidate: Candidate) {
        let at = self.poses.partition_point(|other| other.depth <= candidate.depth);
        if at < self.most {
            self.poses.truncate(self.most - 1);
            self.poses.insert(at, candidate);
        }
    }
}
