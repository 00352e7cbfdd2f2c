//! Answers compared within a tolerance: decisions and counts must be the same, numbers near.

use super::SiteAnswers;
use approx::{AbsDiffEq, RelativeEq};
use glam::Vec3;

/// Numbers are compared one by one.
impl AbsDiffEq for SiteAnswers {
    type Epsilon = f32;

    fn default_epsilon() -> f32 {
        f32::default_epsilon()
    }

    fn abs_diff_eq(&self, other: &Self, epsilon: f32) -> bool {
        same_decisions(self, other) && near(self, other, |a, b| a.abs_diff_eq(b, epsilon))
    }
}

/// Numbers are compared one by one.
impl RelativeEq for SiteAnswers {
    fn default_max_relative() -> f32 {
        f32::default_max_relative()
    }

    fn relative_eq(&self, other: &Self, epsilon: f32, max_relative: f32) -> bool {
        let are_near = |a: &f32, b: &f32| a.relative_eq(b, epsilon, max_relative);
        same_decisions(self, other) && near(self, other, are_near)
    }
}

fn same_decisions(a: &SiteAnswers, b: &SiteAnswers) -> bool {
    let outside = |of: &SiteAnswers| of.network.as_ref().map(|n| n.outside_domain.clone());
    (&a.of_sites, a.tests_tip) == (&b.of_sites, b.tests_tip)
        && a.occlusion == b.occlusion
        && a.accessible_directions == b.accessible_directions
        && outside(a) == outside(b)
}

fn lists(answers: &SiteAnswers) -> [&[f32]; 6] {
    [
        &answers.accessible_share,
        &answers.clearance_mm,
        &answers.rest_mm,
        &answers.rest_volume_mm3,
        answers.probability_inaccessible(),
        answers.probability_occlusion(),
    ]
}

fn near(a: &SiteAnswers, b: &SiteAnswers, are_near: impl Fn(&f32, &f32) -> bool) -> bool {
    let all_near =
        |a: &[f32], b: &[f32]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| are_near(a, b));
    let witness = |(a, b): (&Option<Vec3>, &Option<Vec3>)| match (a, b) {
        (Some(a), Some(b)) => all_near(&a.to_array(), &b.to_array()),
        _ => a == b,
    };
    lists(a).into_iter().zip(lists(b)).all(|(a, b)| all_near(a, b))
        && a.witness.len() == b.witness.len()
        && a.witness.iter().zip(&b.witness).all(witness)
}
