//! The poses of a site that are worth a push.

use super::contact::Pose;

/// Poses of one site that are pushed as far as that leads, those that penetrate least: at least so many, more along few
/// directions.
const PUSHED: usize = 10;
const PUSHED_OF_FEW: usize = 40;
const PUSHED_OF_ALL: usize = 200;
/// So many after them are pushed a few times: most that come clear do so by then.
const PUSHED_SHORTLY: usize = 60;

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
    poses: Vec<Candidate>,
    /// How many of them are pushed as far as that leads.
    n_first: usize,
}

impl Shallow {
    pub fn along(n_directions: usize) -> Self {
        let n_first = (PUSHED_OF_ALL / n_directions.max(1)).clamp(PUSHED, PUSHED_OF_FEW);
        Shallow { poses: Vec::new(), n_first }
    }

    /// Along the directions that the part suggests, beside the others.
    pub fn suggested() -> Self {
        Shallow { poses: Vec::new(), n_first: PUSHED }
    }

    pub fn add(&mut self, candidate: Candidate) {
        let at = self.poses.partition_point(|other| other.depth <= candidate.depth);
        let most = self.n_first + PUSHED_SHORTLY;
        if at < most {
            self.poses.truncate(most - 1);
            self.poses.insert(at, candidate);
        }
    }

    /// The first of each, then those after them.
    pub fn in_turns(of: [Shallow; 2]) -> [Vec<Candidate>; 2] {
        let mut turns = [Vec::new(), Vec::new()];
        for Shallow { poses, n_first } in of {
            let (first, after) = poses.split_at(n_first.min(poses.len()));
            turns[0].extend_from_slice(first);
            turns[1].extend_from_slice(after);
        }
        turns
    }
}
