//! What searches with other cutters have found out about the same reference points in the same direction.
//!
//! An obstacle in a cylinder is in every cylinder that holds it, and a free cylinder holds none that is not
//! free. In `f32` too: heights and squared radii are compared with the same numbers, and adding a greater height
//! to the same one never gives less.

use crate::simd::collide::StepSquared;

/// Answers to questions about cylinders, a bit per query, eight to a byte.
#[derive(Debug, Default)]
pub struct Known {
    answers: Vec<Answers>,
    /// How many of them hold; the others are memory.
    n: usize,
}

#[derive(Debug, Default)]
struct Answers {
    height: f32,
    radius_squared: f32,
    hit: Vec<u8>,
    free: Vec<u8>,
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

impl Known {
    /// Forgets everything: other reference points, or another direction.
    pub fn clear(&mut self) {
        self.n = 0;
    }

    /// Adds to `hit` the queries at which some obstacle is known to be in the cylinder of one of `steps`.
    #[inline(always)]
    pub fn hits(&self, steps: &[StepSquared], hit: &mut [u8]) {
        for answers in &self.answers[..self.n] {
            if steps.iter().any(|step| answers.within(step)) {
                hit.iter_mut().zip(&answers.hit).for_each(|(hit, known)| *hit |= known);
            }
        }
    }

    /// Takes away from `open` the queries whose cylinder is known to be free.
    #[inline(always)]
    pub fn keep_open(&self, step: &StepSquared, open: &mut [u8]) {
        for answers in self.answers[..self.n].iter().filter(|answers| answers.holds(step)) {
            open.iter_mut().zip(&answers.free).for_each(|(open, known)| *open &= !known);
        }
    }

    /// Of the queries `asked`, those in `open` are free, the others are hit.
    #[inline(always)]
    pub fn learn(&mut self, step: &StepSquared, asked: &[u8], open: &[u8]) {
        if self.n == self.answers.len() {
            self.answers.push(Answers::default());
        }
        let answers = &mut self.answers[self.n];
        self.n += 1;
        (answers.height, answers.radius_squared) = (step.height, step.radius_squared);
        answers.hit.clear();
        answers.hit.extend(asked.iter().zip(open).map(|(asked, open)| asked & !open));
        answers.free.clear();
        answers.free.extend(asked.iter().zip(open).map(|(asked, open)| asked & open));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(height: f32, radius_squared: f32) -> StepSquared {
        StepSquared { height, radius_squared }
    }

    /// Queries 0 and 1 are asked about a cylinder: 0 is hit, 1 is free.
    #[test]
    fn hits_pass_to_cylinders_around_and_freedom_to_those_inside() {
        let mut known = Known::default();
        for _ in 0..2 {
            known.clear();
            known.learn(&step(3.0, 4.0), &[0b11], &[0b110]);
            let hits = |height, radius| {
                let mut hit = [0];
                known.hits(&[step(9.0, 1.0), step(height, radius)], &mut hit);
                hit[0]
            };
            let open = |height, radius| {
                let mut open = [0b111];
                known.keep_open(&step(height, radius), &mut open);
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
        known.clear();
        let mut open = [0b111];
        known.keep_open(&step(3.0, 4.0), &mut open);
        assert_eq!(open, [0b111]);
    }
}
