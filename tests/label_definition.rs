//! Promise: labels, β and clearances are those of the definition, on cases done by hand and by plain loops, and
//! unusable queries are refused.

mod scenes;

use deepmill::access::{Engine, LabelOptions, Obstacles, Queries, label};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::Sites;
use deepmill::par::with_threads;
use deepmill::simd::Isa;
use glam::{DVec3, Vec3};
use scenes::{cutters, hemisphere, sites, solids};

/// Against the formula as plain loops, and against relabeling with a grown cutter.
#[test]
fn clearance_is_the_growth_at_which_the_label_flips() {
    let scene = solids(250);
    let few = hemisphere(5);
    let limit_mm = 8.0;
    let options = LabelOptions::default().with_clearance_limit_mm(Some(limit_mm));
    for cutter in &cutters(4, 8) {
        let run = |n| {
            let work = || label(&scene, Obstacles::Queries, cutter, &few, &options).unwrap();
            with_threads(n, work).unwrap()
        };
        let labels = run(1);
        assert_eq!(labels.answers.clearance_mm(), run(3).answers.clearance_mm());
        for (i, &clearance) in labels.answers.clearance_mm().iter().enumerate() {
            let by_formula =
                clearance_by_formula(&scene, i, cutter, &few).clamp(-limit_mm, limit_mm);
            assert!(
                (f64::from(clearance) - by_formula).abs() < 1e-4,
                "{i}: {clearance} {by_formula}"
            );
            assert!(if labels.answers.inaccessible()[i] {
                clearance <= 0.0
            } else {
                clearance >= 0.0
            });
        }
        for growth in [-2.0, -0.3, 0.4, 3.0] {
            let grown = cutter.grown(growth).unwrap();
            let flipped = label(&scene, Obstacles::Queries, &grown, &few, &options).unwrap();
            for (i, &clearance) in labels.answers.clearance_mm().iter().enumerate() {
                let away = f64::from(clearance) - growth;
                if away.abs() > 1e-4 {
                    assert_eq!(
                        flipped.answers.inaccessible()[i],
                        away < 0.0,
                        "{i}: {clearance} {growth}"
                    );
                }
            }
        }
    }
}

fn clearance_by_formula(scene: &Sites, i: usize, cutter: &Cutter, directions: &Directions) -> f64 {
    let corner = cutter.corner_mm();
    let center = scene.points[i].as_dvec3() + corner * scene.normals[i].as_dvec3();
    let in_direction = |d: DVec3| {
        let others = (0..scene.len()).filter(|&j| j != i);
        let growth = others.map(|j| {
            let offset = scene.points[j].as_dvec3() - center;
            let (h, r) = (offset.dot(d), (offset - offset.dot(d) * d).length());
            let steps = cutter.steps().iter();
            steps.map(|s| (s.height_mm - h).max(r - s.radius_mm)).fold(f64::INFINITY, f64::min)
        });
        growth.fold(f64::INFINITY, f64::min)
    };
    let growths = directions.vectors().iter().map(|d| in_direction(d.as_dvec3()));
    growths.fold(f64::NEG_INFINITY, f64::max)
}

/// Five points by hand. CR 1, CH 2, FR 5, FH 3, so steps (1, 1), (3, 5), (6, ∞); direction +z alone.
/// The query's ball center is (0, 0, 1).
#[test]
fn definition_holds_on_a_case_done_by_hand() {
    let up = Directions::new(DirectionSet::List { vectors: vec![[0.0, 0.0, 1.0]] }).unwrap();
    let cutter = Cutter::ball_end(CutterParams::from_array([1.0, 2.0, 5.0, 3.0])).unwrap();
    let query = sites(vec![Vec3::ZERO], vec![Vec3::Z]);
    let cases = [
        (Vec3::new(0.0, 0.0, 2.0), false, "h = CR: contact"),
        (Vec3::new(1.0, 0.0, 2.5), true, "in the cutter, r = CR"),
        (Vec3::new(1.5, 0.0, 4.0), false, "beside the cutter, h = CR + CH"),
        (Vec3::new(3.0, 4.0, 4.5), true, "in the holder, r = FR"),
        (Vec3::new(3.0, 4.5, 7.0), false, "beside the holder, h = CR + CH + FH"),
        (Vec3::new(300.0, 0.0, 7.5), true, "in the spindle"),
    ];
    for (obstacle, expected, what) in cases {
        for engine in Engine::ALL {
            let options = LabelOptions::default()
                .with_engine(engine)
                .with_isa(Isa::fastest())
                .with_collision_matrix(true);
            let obstacles = [obstacle];
            let labels =
                label(&query, Obstacles::Points(&obstacles), &cutter, &up, &options).unwrap();
            assert_eq!(labels.answers.inaccessible(), [expected], "{what}, {engine:?}");
            assert_eq!(labels.beta, [u64::from(expected)], "{what}, {engine:?}");
            assert_eq!(labels.answers.occlusion(), [expected], "{what}, {engine:?}");
            assert_eq!(labels.witness, [(!expected).then_some(0)], "{what}, {engine:?}");
        }
    }
}

#[test]
fn unusable_queries_are_refused_with_a_remedy() {
    let cutter = &cutters(1, 1)[0];
    let few = hemisphere(3);
    let good = solids(20);
    fn refused(sites: &Sites, obstacles: Obstacles, options: &LabelOptions) -> String {
        let cutter = &cutters(1, 1)[0];
        label(sites, obstacles, cutter, &hemisphere(3), options).unwrap_err().to_string()
    }
    let defaults = LabelOptions::default();
    for bad in [f32::NAN, f32::INFINITY, 1e9] {
        let mut sites = good.clone();
        sites.points[3].y = bad;
        let message = refused(&sites, Obstacles::Queries, &defaults);
        assert!(message.contains("query 3") && message.contains("finite"), "{message}");
        let message = refused(&good, Obstacles::Points(&sites.points), &defaults);
        assert!(message.contains("obstacle 3"), "{message}");
    }
    let mut sites = good.clone();
    sites.normals.pop();
    assert!(refused(&sites, Obstacles::Queries, &defaults).contains("19 normals for 20 sites"));
    let mut sites = good.clone();
    sites.normals[4] *= 2.0;
    assert!(refused(&sites, Obstacles::Queries, &defaults).contains("query 4"));
    for share in [0.0, -1.0, 1.5, f64::NAN] {
        let options = defaults.with_share(share);
        assert!(refused(&good, Obstacles::Queries, &options).contains("occlusion share"));
    }
    let options = defaults.with_clearance_limit_mm(Some(0.0));
    assert!(refused(&good, Obstacles::Queries, &options).contains("clearance limit"));
    let volume = label(Queries::Volume(&good.points), Obstacles::Queries, cutter, &few, &defaults);
    assert!(volume.unwrap_err().to_string().contains("obstacles of their own"));
}
