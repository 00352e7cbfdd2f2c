//! `deepmill predict`: what a network answers, and what of it is computed.
#![cfg(all(feature = "cli", feature = "weights"))]

mod command;

use command::{CUTTER, Folder, block, deepmill, failure, json, stl, text};
use deepmill::answers::{SiteAnswer, SiteAnswers};
use deepmill::data::files::{LabelFile, PredictionFile};
use deepmill::model::Model;
use std::process::Output;

/// The size decides, not the number of sites: half of the network's own is in its domain.
#[test]
fn predictions_outside_of_the_networks_domain_are_marked_and_far_ones_refused() {
    let folder = Folder::new();
    let predict = |edge: f32, cutter: &str, more: &[&str]| {
        let part = folder.file("part.stl", stl(&block([0.0; 3], [edge, edge, edge])));
        let out = folder.path("out");
        let args = ["predict", &part, "--cutter", cutter, "--out", &out, "--no-picture", "--json"];
        deepmill(&[&args[..], &["--sites", "3600"], more].concat())
    };
    let inside = predict(100.0, CUTTER, &[]);
    assert_eq!(json(&inside)["outside_domain"].as_array().unwrap().len(), 0);
    let outside = predict(10.0, "2,6,40,5", &[]);
    let found = json(&outside)["outside_domain"][0].as_str().unwrap().to_owned();
    assert!(found.starts_with("CR is 0.2 of the largest edge, trained from"), "{found}");
    assert!(text(&outside.stderr).contains(&format!("warning: {found}")));
    let message = failure(&predict(4.0, CUTTER, &[]), 2);
    assert!(message.contains("CR is 0.375") && message.contains("--far"), "{message}");
    let accepted = predict(4.0, CUTTER, &["--far"]);
    assert!(!json(&accepted)["outside_domain"].as_array().unwrap().is_empty());
}

/// Few sites of a mesh are filled up; those of a cloud cannot be, and are a matter apart from tool and part.
#[test]
fn a_mesh_may_have_few_sites_and_a_cloud_only_if_that_is_allowed() {
    let folder = Folder::new();
    let part = folder.file("part.stl", stl(&block([0.0; 3], [100.0, 60.0, 40.0])));
    let (cloud, out) = (folder.path("cloud.ply"), folder.path("out"));
    json(&deepmill(&["sample", &part, "--out", &cloud, "--sites", "900", "--json"]));
    let predict = |part: &str, cutter: &str, more: &[&str]| {
        let args = ["predict", part, "--cutter", cutter, "--out", &out, "--no-picture", "--json"];
        deepmill(&[&args[..], more].concat())
    };
    let of_mesh = json(&predict(&part, CUTTER, &["--sites", "900"]));
    assert_eq!(of_mesh["n_sites"].as_u64(), Some(900));
    assert_eq!(of_mesh["outside_domain"].as_array().unwrap().len(), 0);
    let file = PredictionFile::read(format!("{out}/predictions.npz").as_ref()).unwrap();
    assert_eq!(file.prediction.logits_inaccessible.len(), 900);
    let message = failure(&predict(&cloud, CUTTER, &[]), 2);
    let said = "number of sites is 900, trained with 7000, expected at least half as many";
    assert!(message.contains(said) && message.contains("--few-sites"), "{message}");
    let allowed = json(&predict(&cloud, CUTTER, &["--few-sites"]));
    assert_eq!(allowed["outside_domain"].as_array().unwrap().len(), 1);
    let message = failure(&predict(&cloud, "36,6,40,5", &["--few-sites"]), 2);
    assert!(message.contains("CR is 0.36") && message.contains("--far"), "{message}");
}

fn run(folder: &Folder, verb: &str, more: &[&str]) -> Output {
    let part = folder.block();
    let out = folder.path(verb);
    let shared = ["--cutter", CUTTER, "--out", &out, "--no-picture", "--json", "--sites", "900"];
    deepmill(&[&[verb, &part], &shared[..], more].concat())
}

#[test]
fn all_sites_verified_are_the_labels_and_some_keep_the_bound() {
    let folder = Folder::new();
    json(&run(&folder, "label", &["--occlusion"]));
    let labels = LabelFile::read(folder.path("label/labels.npz").as_ref()).unwrap().labels;
    let verify = |bound: &[&str]| {
        let result = json(&run(&folder, "predict", &[&["--far", "--verify"], bound].concat()));
        let path = folder.path("predict/predictions.npz");
        (result, PredictionFile::read(path.as_ref()).unwrap())
    };
    let (result, file) = verify(&["all"]);
    let all = file.verified.unwrap();
    assert_eq!((result["verified"].as_f64(), all.n_verified()), (Some(1.0), 900));
    assert_eq!(all.answers.inaccessible(), labels.answers.inaccessible());
    assert_eq!(all.answers.tip_does_not_fit(), labels.answers.tip_does_not_fit());
    assert_eq!(all.answers.occlusion(), labels.answers.occlusion());
    assert_eq!(all.beta, labels.beta);
    let (labeled, predicted) = (folder.path("label"), folder.path("predict/predictions.npz"));
    let compared = ["report", &labeled, "--compare", &predicted, "--json"];
    let compared = json(&deepmill(&compared));
    assert_eq!(compared["scores"][0]["accuracy"].as_f64(), Some(1.0), "{compared}");

    assert_eq!((result["spot_check"].is_null(), all.spot_check), (true, None));

    let (result, file) = verify(&["0.1"]);
    let some = file.verified.as_ref().unwrap();
    let check = some.spot_check.unwrap();
    assert!(check.limit <= 0.1 && check.n_checked > 0, "{check:?}");
    assert_eq!(result["spot_check"]["n_checked"].as_u64(), Some(check.n_checked as u64));
    assert_eq!(result["spot_check"]["limit"].as_f64(), Some(check.limit));
    assert!((1..900).contains(&some.n_verified()), "{}", some.n_verified());
    let of_network = file.prediction.answers();
    let is = |answers: &SiteAnswers, i| answers.of(i) == SiteAnswer::Inaccessible;
    let mut n_wrong = 0;
    for i in 0..900 {
        let expected = if some.verified[i] { &labels.answers } else { &of_network };
        assert_eq!(is(&some.answers, i), is(expected, i), "{i}");
        n_wrong += usize::from(is(&some.answers, i) != is(&labels.answers, i));
    }
    assert!(n_wrong as f64 <= 0.1 * (900 - some.n_verified()) as f64, "{n_wrong}");
    let (_, other) = verify(&["0.1", "--threads", "1"]);
    assert_eq!(other.verified, file.verified);

    let (_, file) = verify(&[]);
    let settings = file.provenance.settings.verify.as_ref().unwrap();
    let stated = (settings.bound, settings.confidence, settings.seed);
    assert_eq!(stated, (0.01, Some(0.95), Some(0)), "one percent is the default");
    let check = file.verified.unwrap().spot_check;
    assert!(check.is_none_or(|check| check.limit <= 0.01), "{check:?}");
}

#[test]
fn what_cannot_be_verified_is_refused() {
    let folder = Folder::new();
    let wrong = run(&folder, "predict", &["--verify", "2"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("a share above 0 and below 1, such as 0.01"));
    let cloud = folder.path("cloud.npz");
    json(&deepmill(&["sample", &folder.block(), "--sites", "400", "--out", &cloud, "--json"]));
    let args = ["predict", &cloud, "--cutter", CUTTER, "--out", &folder.path("out"), "--verify"];
    let message = failure(&deepmill(&args), 2);
    assert!(message.contains("cloud of points") && message.contains("deepmill label"), "{message}");
    let message = failure(&run(&folder, "predict", &["--fail-if", "tip_does_not_fit>1%"]), 2);
    assert!(message.contains("tip_does_not_fit"), "{message}");
}

#[test]
fn as_many_occlusion_points_are_predicted_as_asked_for() {
    let folder = Folder::new();
    for (more, share) in [(&[][..], 0.1), (&["--occlusion-share", "0.25"], 0.25)] {
        let result = json(&run(&folder, "predict", &[&["--far"], more].concat()));
        assert_eq!(result["occlusion"].as_f64(), Some(share));
    }
}

#[test]
fn without_a_file_weights_is_about_the_network_that_comes_with_deepmill_and_writes_its_file() {
    let folder = Folder::new();
    let path = folder.path("shipped.safetensors");
    let shown = json(&deepmill(&["weights", "--bf16", &path, "--json"]));
    assert_eq!(shown["n_parameters"].as_u64(), Some(3_925_012));
    assert_eq!(std::fs::read(&path).unwrap(), Model::shipped_file());
}
