//! Answers and predictions are compared within a tolerance: decisions exactly, numbers nearly.
#![cfg(feature = "approx")]

use approx::{abs_diff_eq, assert_abs_diff_eq, assert_relative_eq, relative_eq};
use deepmill::answers::SiteAnswers;
use deepmill::model::{Model, UNetConfig};
use glam::Vec3;

fn answers() -> SiteAnswers {
    let mut answers = SiteAnswers::new(vec![true, false], vec![false; 2]);
    answers.probability_inaccessible = vec![0.9, 0.2];
    answers.witness = vec![None, Some(Vec3::Z)];
    answers
}

#[test]
fn answers_are_near_if_decisions_are_the_same_and_numbers_near() {
    let (exact, mut other) = (answers(), answers());
    other.probability_inaccessible[0] += 1e-4;
    other.witness[1] = Some(Vec3::new(1e-4, 0.0, 1.0));
    assert_abs_diff_eq!(exact, other, epsilon = 1e-3);
    assert_relative_eq!(exact, other, epsilon = 1e-3, max_relative = 1e-3);
    assert!(!abs_diff_eq!(exact, other) && !relative_eq!(exact, other));
    let changes: [fn(&mut SiteAnswers); 4] = [
        |answers| answers.inaccessible[1] = true,
        |answers| answers.witness[1] = None,
        |answers| answers.probability_inaccessible.truncate(1),
        |answers| answers.probability_inaccessible[1] = f32::NAN,
    ];
    for change in changes {
        let mut other = answers();
        change(&mut other);
        assert!(!abs_diff_eq!(exact, other, epsilon = 10.0));
    }
}

#[test]
fn predictions_are_near_if_all_logits_are() {
    let model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
    let (points, normals) = ([Vec3::ZERO, Vec3::X], [Vec3::Z; 2]);
    let prediction = model.predict(&points, &normals, [1.5, 6.0, 40.0, 5.0]).unwrap();
    let mut other = prediction.clone();
    other.logits_occlusion[1][0] += 1e-4;
    assert_abs_diff_eq!(prediction, other, epsilon = 1e-3);
    assert!(!abs_diff_eq!(prediction, other, epsilon = 1e-5));
    other.logits_occlusion.pop();
    assert!(!relative_eq!(prediction, other, epsilon = 10.0));
}
