//! What is written with serde is read back the same, and what makes no sense is refused on reading.
#![cfg(feature = "formats")]

use deepmill::access::surface::explain::Query;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
use deepmill::access::{CollisionMatrix, Engine, LabelOptions, Labeler, Labels};
use deepmill::answers::SiteAnswers;
use deepmill::cutter::{Assembly, Cutter, CutterParams, Profile, Section, TipShape};
use deepmill::data::files::tools::Tool;
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites, solids};
use deepmill::gradcheck::GradcheckSettings;
use deepmill::loss::CrossEntropy;
use deepmill::model::{Model, Prediction, Predictor, UNetConfig};
use deepmill::octree::OctreeOptions;
use deepmill::optim::Sgd;
use deepmill::planning::setups::{Candidates, Choice, Clampings, Plan};
use glam::{DVec3, Vec3};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::fmt::Debug;

fn again<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) -> Value {
    let text = serde_json::to_string(value).unwrap();
    assert_eq!(&serde_json::from_str::<T>(&text).unwrap(), value);
    serde_json::from_str(&text).unwrap()
}

/// Reading fails with these words once `key` has this value.
fn refused<T: DeserializeOwned + Debug>(written: &Value, key: &str, value: Value, words: &str) {
    let mut changed = written.clone();
    changed[key] = value;
    let message = serde_json::from_value::<T>(changed).unwrap_err().to_string();
    assert!(message.contains(words), "{message}");
}

fn scene() -> (Mesh, Sites, Cutter) {
    let part = solids::cuboid(DVec3::new(30.0, 20.0, 10.0));
    let sites = sample(&part, &SiteOptions::default().with_n_sites(100)).unwrap();
    (part, sites, "1.5,6,40,5".parse().unwrap())
}

#[test]
fn tools_are_built_again_when_they_are_read() {
    let straight = |length_mm, diameter_mm: f64| Section::cylinder(length_mm, diameter_mm / 2.0);
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.5 };
    let body = [straight(20.0, 6.0), straight(40.0, 8.0)];
    let tool = Assembly::new(tip, &body, &[straight(30.0, 40.0)], 45.0).unwrap();
    let tool = tool.with_overall(60.0).unwrap().with_allowance(0.2).unwrap();
    let written = again(&tool);
    assert!(written["holder"][1]["radius_mm"].is_null(), "the spindle: {written}");
    for (key, value, words) in [
        ("stick_out_mm", json!(-1.0), "stick-out is -1"),
        ("stick_out_mm", json!(70.0), "at most the overall length"),
        ("holder", json!([]), "holder is without steps"),
        ("allowance_mm", json!(-0.1), "allowance is -0.1"),
        ("excess_mm", json!(-0.1), "excess is -0.1"),
        ("corner_mm", json!(-0.5), "corner radius is -0.5"),
        ("cutting", json!([{ "height_mm": 1.0, "radius_mm": -2.0 }]), "radii of 0 or more"),
        ("upper", json!([{ "height_mm": null, "radius_mm": 4.0 }]), "null"),
    ] {
        refused::<Assembly>(&written, key, value, words);
    }
    again(&CutterParams::from_array([1.5, 6.0, 40.0, 5.0]));
}

#[test]
fn tools_of_tables_keep_name_folder_and_unit() {
    let tool = Tool::new("3,20,20,30".parse().unwrap(), Some(0.5), 0.25).unwrap();
    let written = again(&tool.named("T2: rougher/\"6\"").with_allowance(0.1).unwrap());
    assert_eq!(
        (&written["unit"], &written["folder"]),
        (&json!("millimeter"), &json!("T2 rougher 6"))
    );
    for folder in ["", "..", "a/b", "a\\b", "c:"] {
        refused::<Tool>(&written, "folder", json!(folder), "the name of a folder");
    }
    refused::<Tool>(&written, "clearance_mm", json!(-3.0), "clearance is -3");
    refused::<Tool>(&written, "cutter", json!(1), "invalid type");
}

#[test]
fn cutters_are_checked_when_they_are_read() {
    let ball: Cutter = "1.5,6,40,5".parse().unwrap();
    let params = CutterParams::from_array([1.0, 8.0, 20.0, 5.0]);
    let lollipop = Profile::lollipop(5.0, 2.0).unwrap();
    let holder = [Section::cylinder(30.0, 20.0)];
    let lollipop = Assembly::from_profile(lollipop, &holder, 45.0).unwrap().cutter().unwrap();
    let wide = ball.with_clearance(0.5).unwrap();
    for cutter in [
        ball.clone(),
        Cutter::flat_end(params).unwrap(),
        Cutter::tapered(params, 0.1, 8).unwrap(),
        ball.grown(-2.0).unwrap(),
        wide.with_allowance(0.25).unwrap(),
        lollipop.with_allowance(0.1).unwrap().with_clearance(0.2).unwrap(),
        lollipop,
    ] {
        again(&cutter);
    }
    let written = again(&ball);
    for (key, value, words) in [
        ("corner_mm", json!(-1.5), "corner radius is -1.5"),
        ("side_mm", json!(1e9), "side offset is 1000000000"),
        ("allowance_mm", json!(-0.1), "allowance is -0.1"),
        ("cutting", json!([{ "height_mm": 1.5, "radius_mm": -1.5 }]), "cutting steps is "),
        ("upper", json!([]), "those of the flutes"),
        ("steps", json!([]), "those of the flutes"),
        ("steps", json!(null), "invalid type"),
    ] {
        refused::<Cutter>(&written, key, value, words);
    }
    let turned = json!([
        { "height_mm": 12.5, "radius_mm": 40.0 },
        { "height_mm": 7.5, "radius_mm": null },
    ]);
    refused::<Cutter>(&written, "upper", turned, "rising heights");
}

#[test]
fn directions_are_read_from_their_set() {
    let cone = DirectionSet::Cone { axis: [0.0, 0.0, 1.0], half_angle_rad: 0.5, n_dirs: 9 };
    let written = again(&Directions::new(cone).unwrap());
    assert_eq!(written["kind"], "cone");
    refused::<Directions>(&written, "n_dirs", json!(0), "directions is 0");
    refused::<Directions>(&written, "half_angle_rad", json!(-1.0), "-1");
    again(&Directions::published());
    again(&Directions::up());
}

#[test]
fn answers_are_read_with_lists_of_one_length_and_known_quantities() {
    let (part, sites, cutter) = scene();
    let options = SurfaceOptions::default().with_clearance_limit_mm(Some(2.0));
    let labeler = Labeler::of_part(&part, &[], "20".parse().unwrap(), options).unwrap();
    let written = again(&labeler.answer(&sites, &cutter).unwrap());
    refused::<SiteAnswers>(
        &written,
        "clearance_mm",
        json!([0.5]),
        "a list of 1, expected none, or 100",
    );
    refused::<SiteAnswers>(&written, "witness", json!([[0, 0, 2]]), "witness");
    let share = json!(vec![1.5; 100]);
    refused::<SiteAnswers>(&written, "accessible_share", share, "accessible_share is 1.5");
    let outside = json!([{ "quantity": "weight", "value": 1.0, "range": [0.0, 0.5] }]);
    refused::<SiteAnswers>(&written, "outside_domain", outside, "`weight`");
    let predictor = Predictor::new(Model::new(&UNetConfig::tiny(), 1).unwrap());
    again(&predictor.answer(&sites, &cutter).unwrap());
    again(&SiteAnswers::new(vec![true; 3], vec![]));
}

#[test]
fn labels_of_the_mesh_definition_are_read_back() {
    let (part, sites, cutter) = scene();
    let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
    let options = SurfaceOptions::default();
    let labels = obstacles.label(&sites, &cutter, &Directions::up(), &options).unwrap();
    let mut written = again(&labels);
    // As earlier versions wrote them, with a second copy of the answers.
    let n = labels.answers.len();
    written["surface"]["answers"] = json!(vec!["accessible"; n]);
    written["surface"]["clearance_mm"] = json!([]);
    written["surface"]["accessible_directions"] = json!(vec![1; n]);
    let earlier: Labels = serde_json::from_value(written).unwrap();
    assert_eq!(earlier, labels);
    let surface = labels.surface.unwrap();
    assert!(surface.witness.iter().flatten().all(|pose| pose.direction == Vec3::Z));
}

#[test]
fn labels_and_their_collision_matrix_are_read_back() {
    let (part, sites, cutter) = scene();
    let options = LabelOptions::default().with_collision_matrix(true);
    let by_points = Labeler::of_sites("20".parse().unwrap(), options);
    let labels = by_points.label(&sites, &cutter).unwrap();
    again::<Labels>(&labels);
    let written = again(labels.collision_matrix.as_ref().unwrap());
    let words = "rows of a collision matrix is row ";
    for n_queries in [64, 129] {
        refused::<CollisionMatrix>(&written, "n_queries", json!(n_queries), words);
    }
    let past_the_end = json!([[0, 1_u64 << 40]]); // the 105th of 100
    refused::<CollisionMatrix>(&written, "rows", past_the_end, words);
    let options = SurfaceOptions::default().with_beta(true);
    let by_part = Labeler::of_part(&part, &[], Directions::up(), options).unwrap();
    again::<Labels>(&by_part.label(&sites, &cutter).unwrap());
}

#[test]
fn explanations_are_read_back() {
    let table = solids::cuboid(DVec3::new(60.0, 60.0, 5.0));
    let mut wall = solids::cuboid(DVec3::new(60.0, 10.0, 20.0));
    wall.vertices.iter_mut().for_each(|v| *v += DVec3::new(0.0, 35.0, 5.0));
    let obstacles = TriangleObstacles::new(&table, &[wall]).unwrap();
    let tip = TipShape::Straight { radius_mm: 1.5, corner_mm: 1.5 };
    let holder = [Section::cylinder(30.0, 15.0)];
    let tool = Assembly::new(tip, &[Section::cylinder(50.0, 1.5)], &holder, 12.0).unwrap();
    let (up, options) = (Directions::up(), SurfaceOptions::default());
    // In the way, free beside it, and free above all that there is.
    for (site, blocked) in [
        (Vec3::new(30.0, 30.0, 5.0), true),
        (Vec3::new(30.0, 5.0, 5.0), false),
        (Vec3::new(30.0, 40.0, 25.0), false),
    ] {
        let why = obstacles.explain(&Query::new(site, Vec3::Z, &tool, &up, &options)).unwrap();
        assert_eq!(why.blocked_by().is_some(), blocked);
        again(&why);
    }
}

#[test]
fn plans_of_setups_are_read_back() {
    let (part, sites, cutter) = scene();
    let candidates =
        Candidates::new(&part, "5-axis:60".parse().unwrap(), Clampings::Standing, 50).unwrap();
    let accessible = TriangleObstacles::new(&part, &[])
        .unwrap()
        .accessible_directions(&sites, &cutter, candidates.directions(), &SurfaceOptions::default())
        .unwrap();
    let (weights, choice) = (vec![1.0; sites.len()], Choice::share(1.0));
    let plan =
        Plan::new(&candidates, &part, &sites, &[accessible], &weights, choice, &[0]).unwrap();
    assert!(!plan.setups.is_empty());
    again(&plan);
}

#[test]
fn predictions_are_read_back() {
    let (part, sites, cutter) = scene();
    let model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
    let prediction = model.predict(&sites.points, &sites.normals, [1.5, 6.0, 40.0, 5.0]).unwrap();
    again::<Prediction<f32>>(&prediction);
    let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
    let (options, up) = (SurfaceOptions::default(), Directions::up());
    let predicted = prediction.answers();
    let by = (&cutter, &up);
    again(&obstacles.verify(&sites, by, &options, &predicted, (0.05, 1)).unwrap());
}

#[test]
fn settings_are_read_back_and_what_they_leave_out_is_as_by_default() {
    let options = LabelOptions::default().with_engine(Engine::Reference).with_bottom_mm(Some(1.0));
    let written = again(&options);
    refused::<LabelOptions>(&written, "engines", json!(1), "unknown field `engines`");
    let less: LabelOptions = serde_json::from_value(json!({ "share": 0.2 })).unwrap();
    assert_eq!(less, LabelOptions::default().with_share(0.2));
    let options = SurfaceOptions::default().with_finish_mm(0.05).with_clearance_limit_mm(Some(2.0));
    let written = again(&options);
    refused::<SurfaceOptions>(&written, "finish", json!(1), "unknown field `finish`");
    again(&SurfaceOptions::default().with_refinement(None));
    again(&CrossEntropy::equal(5).with_label_smoothing(0.1));
    again(&Sgd::new(0.9, 1e-4));
    again(&OctreeOptions::default().with_depth(5));
    again(&GradcheckSettings::default().with_max_elements(9).with_seed(3));
}

#[cfg(feature = "generate")]
mod outcomes {
    use super::*;
    use deepmill::analysis::{Analysis, Fixture};
    use deepmill::data::files::tools::Tool;
    use deepmill::findings::Findings;

    #[test]
    fn answers_and_findings_of_an_outcome_are_read_back() {
        let outline =
            [(0.0, 0.0), (40.0, 0.0), (40.0, 10.0), (20.0, 10.0), (20.0, 30.0), (0.0, 30.0)];
        let outline = outline.map(|(x, y)| glam::dvec2(x, y));
        let part = solids::prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 30.0);
        let tool = |lengths: &str| Tool::new(lengths.parse().unwrap(), Some(0.0), 0.0).unwrap();
        let mut clamp = solids::cuboid(DVec3::new(4.0, 8.0, 40.0));
        clamp.vertices.iter_mut().for_each(|v| *v += DVec3::new(26.0, 12.0, 0.0));
        let outcome = Analysis::new("step", part, vec![tool("3,4,20,20"), tool("3,24,20,20")])
            .n_sites(600)
            .directions("list:0,1,0".parse().unwrap())
            .fixture(Fixture::new("clamp", clamp))
            .rest(true)
            .run(&mut ())
            .unwrap();
        for answer in outcome.answers() {
            again(answer);
        }
        let findings = outcome.findings();
        assert!(
            findings
                .list
                .iter()
                .any(|finding| finding.helps.is_none() && !finding.opens.is_empty())
        );
        assert!(outcome.answers()[0].findings.list.iter().any(|finding| finding.helps.is_some()));
        let written = again(findings);
        let n = findings.of_site.len();
        for (key, value, words) in [
            ("of_site", json!(vec![99; n]), "of_site is 99"),
            ("of_site", json!(vec![0; n]), "of_site is 0 sites of finding 1"),
            ("scattered_sites", json!([n]), "scattered_sites is others"),
        ] {
            refused::<Findings>(&written, key, value, words);
        }
    }
}
