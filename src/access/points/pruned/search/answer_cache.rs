//! A cache of the answers for other cutters with the same reference points in the same direction.
//!
//! An obstacle in a cylinder is in every cylinder that contains it; a cylinder without obstacles contains only such
//! cylinders. In `f32` too: heights and squared radii are compared with the same numbers, and adding a greater height
//! to the same one never gives less.

use crate::access::predicate::StepSquared;

/// Answers to queries about cylinders, a bit per query.
#[derive(Debug, Default)]
pub struct AnswerCache {
    answers: Vec<Answers>,
    /// How many of them are valid; the others are memory.
    n: usize,
}

#[derive(Debug, Default)]
struct Answers {
    height: f32,
    radius_squared: f32,
    hit: Vec<u64>,
    collision_free: Vec<u64>,
}

impl Answers {
    /// Whether its cylinders lie in those of `step`, around the same axis.
    fn within(&self, step: &StepSquared) -> bool {
        self.height >= step.height && self.radius_squared <= step.radius_squared
    }

    fn holds(&self, step: &StepSquared) -> bool {
        self.height <= step.height && self.radius_squared >= step.radius_squared
    }
}

impl AnswerCache {
    /// Forgets everything: other reference points, or another direction.
    pub fn clear(&mut self) {
        self.n = 0;
    }

    /// Adds to `hit` the queries for which some obstacle is known to be in the cylinder of one of `steps`.
    #[inline(always)]
    pub fn hits(&self, steps: &[StepSquared], hit: &mut [u64]) {
        for answers in &self.answers[..self.n] {
            if steps.iter().any(|step| answers.within(step)) {
                hit.iter_mut().zip(&answers.hit).for_each(|(hit, known)| *hit |= known);
            }
        }
    }

    /// Takes away from `open` the queries whose cylinder is known to hold no obstacle.
    #[inline(always)]
    pub fn keep_open(&self, step: &StepSquared, open: &mut [u64]) {
        for answers in self.answers[..self.n].iter().filter(|answers| answers.holds(step)) {
            open.iter_mut().zip(&answers.collision_free).for_each(|(open, known)| *open &= !known);
        }
    }

    /// Records the answers to `queries`: those still in `open` are collision-free, the others are hit.
    #[inline(always)]
    pub fn record(&mut self, step: &StepSquared, queries: &[u64], open: &[u64]) {
        if self.n == self.answers.len() {
            self.answers.push(Answers::default());
        }
        let answers = &mut self.answers[self.n];
        self.n += 1;
        (answers.height, answers.radius_squared) = (step.height, step.radius_squared);
        answers.hit.clear();
        answers.hit.extend(queries.iter().zip(open).map(|(queries, open)| queries & !open));
        answers.collision_free.clear();
        answers
            .collision_free
            .extend(queries.iter().zip(open).map(|(queries, open)| queries & open));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(height: f32, radius_squared: f32) -> StepSquared {
        StepSquared { height, radius_squared }
    }

    /// Queries 0 and 1 are answered for a cylinder: 0 is hit, 1 is collision-free.
    #[test]
    fn hits_pass_to_cylinders_around_and_freedom_to_those_inside() {
        let mut cache = AnswerCache::default();
        for _ in 0..2 {
            cache.clear();
            cache.record(&step(3.0, 4.0), &[0b11], &[0b110]);
            let hits = |height, radius| {
                let mut hit = [0];
                cache.hits(&[step(9.0, 1.0), step(height, radius)], &mut hit);
                hit[0]
            };
            let open = |height, radius| {
                let mut open = [0b111];
                cache.keep_open(&step(height, radius), &mut open);
                open[0]
            };
            for (height, radius) in [(3.0, 4.0), (2.9, 4.0), (3.0, 4.1)] {
                assert_eq!(hits(height, radius), 0b1, "{height} {radius}");
            }
            for (height, radius) in [(3.1, 9.0), (2.0, 3.9)] {
                assert_eq!(hits(height, radius), 0, "{height} {radius}");
            }
            for (height, radius) in [(3.0, 4.0), (3.1, 4.0), (3.0, 3.9)] {
                assert_eq!(open(height, radius), 0b101, "{height} {radius}");
            }
            for (height, radius) in [(2.9, 1.0), (9.0, 4.1)] {
                assert_eq!(open(height, radius), 0b111, "{height} {radius}");
            }
        }
        cache.clear();
        let mut open = [0b111];
        cache.keep_open(&step(3.0, 4.0), &mut open);
        assert_eq!(open, [0b111]);
    }
}
