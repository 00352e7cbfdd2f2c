//! Answers and predictions are compared within a tolerance: decisions exactly, numbers nearly.
#![cfg(feature = "approx")]

use approx::{abs_diff_eq, assert_abs_diff_eq, assert_relative_eq, relative_eq};
use deepmill::answers::{NetworkEvidence, SiteAnswers};
use deepmill::model::{Model, UNetConfig};
use glam::Vec3;
use serde_json::{Value, json};

fn answers() -> SiteAnswers {
    of([true, false], json!([null, [0.0, 0.0, 1.0]])).with_network(network([0.9, 0.2]))
}

fn of(inaccessible: [bool; 2], witness: Value) -> SiteAnswers {
    let occlusion = [false; 2];
    let answers = json!({"inaccessible": inaccessible, "occlusion": occlusion, "witness": witness});
    serde_json::from_value(answers).unwrap()
}

fn network(probabilities: impl Into<Vec<f32>>) -> NetworkEvidence {
    NetworkEvidence::new(probabilities.into(), vec![])
}

#[test]
fn answers_are_near_if_decisions_are_the_same_and_numbers_near() {
    let exact = answers();
    let other = of([true, false], json!([null, [1e-4, 0.0, 1.0]]));
    let other = other.with_network(network([0.9001, 0.2]));
    assert_abs_diff_eq!(exact, other, epsilon = 1e-3);
    assert_relative_eq!(exact, other, epsilon = 1e-3, max_relative = 1e-3);
    assert!(!abs_diff_eq!(exact, other) && !relative_eq!(exact, other));
    let up = json!([null, [0.0, 0.0, 1.0]]);
    let others = [
        of([true, true], up.clone()).with_network(network([0.9, 0.2])),
        of([true, false], json!([null, null])).with_network(network([0.9, 0.2])),
        answers().with_network(network([0.9])),
        answers().with_network(network([0.9, f32::NAN])),
        of([true, false], up),
    ];
    for other in others {
        assert!(!abs_diff_eq!(exact, other, epsilon = 10.0), "{other:?}");
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
