//! Promise: the published definition is its text, whatever the engine, and the earlier rule is made of its parts.

mod published_rule;
mod scenes;

use deepmill::access::{
    Engine, LabelOptions, Labeler, Labels, Obstacles, Queries, label, label_many,
};
use deepmill::answers::Rounding;
use deepmill::cutter::Cutter;
use deepmill::directions::Directions;
use deepmill::geom::sites::from_vertices;
use deepmill::geom::{Sites, solids};
use deepmill::rng::{Purpose, Stream};
use deepmill::simd::Isa;
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use scenes::{cutters, hemisphere, sites};

/// A block with a deep pocket and points on all of its walls, none of which lie on a lattice.
fn pocket(n: usize, seed: u64) -> Sites {
    let mut stream = Stream::new(seed, 0, 0, Purpose::Probe);
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for k in 0..n {
        let [a, b] = [0, 1].map(|_| stream.range(-1.0, 1.0));
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let (point, normal) = match k % 7 {
            0 => (DVec3::new(20.0 * a, 20.0 * b, 0.0), DVec3::NEG_Z),
            1 => (DVec3::new(20.0 * side, 20.0 * a, 12.5 + 12.5 * b), DVec3::X * side),
            2 => (DVec3::new(20.0 * a, 20.0 * side, 12.5 + 12.5 * b), DVec3::Y * side),
            3 => (DVec3::new(13.0 * side + 7.0 * a, 20.0 * b, 25.0), DVec3::Z),
            4 => (DVec3::new(6.0 * side, 6.0 * a, 15.0 + 10.0 * b), DVec3::X * -side),
            5 => (DVec3::new(6.0 * a, 6.0 * side, 15.0 + 10.0 * b), DVec3::Y * -side),
            _ => (DVec3::new(6.0 * a, 6.0 * b, 5.0), DVec3::Z),
        };
        points.push(point.as_vec3());
        normals.push(normal.as_vec3());
    }
    sites(points, normals)
}

const TOOLS: [&str; 3] = ["1.02,0.515,43.2,5.75", "1.5,9,6,12", "1,2,80,0.2"];

#[test]
fn labels_are_those_of_plain_loops() {
    let part = pocket(420, 3);
    let mut n_marked = 0;
    for tool in TOOLS {
        let cutter: Cutter = tool.parse().unwrap();
        let lengths = tool.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        let lengths = lengths.try_into().unwrap();
        let plain = published_rule::label(&part.points, &part.normals, lengths, 1.0, None);
        let found = Labeler::published().label(&part, &cutter).unwrap();
        assert!(plain.n_bottom > 50);
        assert_eq!(found.answers.inaccessible(), plain.inaccessible, "{tool}");
        assert_eq!(found.answers.occlusion(), plain.occlusion, "{tool}");
        let n_occlusion = found.answers.n_occlusion();
        assert_eq!(n_occlusion, (420 - plain.n_bottom) / 10);
        assert_eq!(LabelOptions::published().n_occlusion(&part.points), n_occlusion);
        n_marked += found.answers.n_inaccessible();
    }
    assert!(n_marked > 100, "{n_marked}");
}

#[test]
fn centroids_decide_and_vertices_are_ranked() {
    let part = solids::torus(14.0, 5.0, 24, 16);
    let (vertices, centroids) = (from_vertices(&part).unwrap(), part.centroids());
    assert_eq!((vertices.len(), centroids.len()), (384, 768));
    let cutter: Cutter = TOOLS[0].parse().unwrap();
    let obstacles = Obstacles::Centroids(&centroids);
    let (directions, options) = (Directions::published(), LabelOptions::published());
    let found = label(&vertices, obstacles, &cutter, &directions, &options).unwrap();
    let lengths = [1.02, 0.515, 43.2, 5.75];
    let Sites { points, normals, .. } = &vertices;
    let plain = published_rule::label(points, normals, lengths, 1.0, Some(&centroids));
    assert_eq!(found.answers.inaccessible(), plain.inaccessible);
    assert_eq!(found.answers.occlusion(), plain.occlusion);
    assert_eq!(found.beta.len(), vertices.len());
    assert!(found.answers.n_inaccessible() > 20 && found.answers.n_occlusion() > 20);
    // Collisions are those of the centroids alone.
    let alone = label(&vertices, Obstacles::Points(&centroids), &cutter, &directions, &options);
    assert_eq!(
        found.answers.accessible_directions(),
        alone.unwrap().answers.accessible_directions()
    );
}

#[test]
fn the_bottom_is_accessible_by_the_rule_and_keeps_its_counts() {
    let part = pocket(420, 3);
    let cutter: Cutter = TOOLS[0].parse().unwrap();
    let directions = Directions::published();
    let run = |options: &LabelOptions| {
        label(&part, Obstacles::Queries, &cutter, &directions, options).unwrap()
    };
    let plain = LabelOptions::default().with_clearance_limit_mm(Some(5.0));
    let ruled = LabelOptions::published().with_clearance_limit_mm(Some(5.0));
    let (plain, ruled) = (run(&plain), run(&ruled));
    assert_eq!(plain.answers.accessible_directions(), ruled.answers.accessible_directions());
    assert_eq!(
        (&plain.witness, plain.answers.clearance_mm()),
        (&ruled.witness, ruled.answers.clearance_mm())
    );
    let mut n_turned = 0;
    for i in 0..part.len() {
        let at_bottom = part.points[i].z < 1.0;
        let [before, after] = [&plain, &ruled].map(|labels| labels.answers.inaccessible()[i]);
        assert_eq!(after, before && !at_bottom, "{i}");
        assert!(!at_bottom || !ruled.answers.occlusion()[i], "{i}");
        n_turned += usize::from(before != after);
    }
    assert!(n_turned > 50, "{n_turned}");
}

#[test]
fn the_earlier_rule_is_what_its_parts_make() {
    let part = pocket(300, 9);
    let cutter: Cutter = TOOLS[1].parse().unwrap();
    let parts = LabelOptions::published().with_bottom_mm(None).with_rounding(Rounding::Ceil);
    let run =
        |options| label(&part, Obstacles::Queries, &cutter, &hemisphere(150), options).unwrap();
    assert_eq!(run(&parts), run(&LabelOptions::default()));
    for bottom_mm in [-1.0, f64::NAN, f64::INFINITY] {
        let options = parts.with_bottom_mm(Some(bottom_mm));
        let refused = label(&part, Obstacles::Queries, &cutter, &hemisphere(9), &options);
        assert!(refused.unwrap_err().to_string().starts_with("bottom is"));
    }
}

/// Everything but the account of the work.
fn answers_of(labels: Vec<Labels>) -> Vec<Labels> {
    let without = |mut labels: Labels| {
        labels.stats = Default::default();
        labels
    };
    labels.into_iter().map(without).collect()
}

fn assert_engines_agree(queries: Queries, obstacles: Obstacles, seed: u64, options: LabelOptions) {
    let (cutters, directions) = (cutters(3, seed), hemisphere(11));
    let run = |engine, isa, beta| {
        let options = options.with_engine(engine).with_isa(isa).with_beta(beta);
        answers_of(label_many(queries, obstacles, &cutters, &directions, &options).unwrap())
    };
    let expected = run(Engine::Reference, Isa::fastest(), true);
    assert!(run(Engine::Batched, Isa::fastest(), true) == expected, "batched");
    for &isa in Isa::available() {
        assert!(run(Engine::Pruned, isa, true) == expected, "pruned, {}", isa.name());
        for (found, expected) in run(Engine::Pruned, isa, false).iter().zip(&expected) {
            assert!(found.answers == expected.answers, "without beta, {}", isa.name());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn engines_agree_with_the_bottom_rule_and_with_centroids(
        n in 1usize..260,
        n_more in 1usize..200,
        seed in 0u64..1_000_000,
        bottom_mm in prop::option::of(prop::sample::select(vec![0.0, 1.0, 8.0, 24.0, 1e6])),
        floor in any::<bool>(),
        share in prop::sample::select(vec![0.004, 0.1, 0.5, 1.0]),
    ) {
        let (part, more) = (pocket(n, seed), pocket(n_more, seed + 1));
        let rounding = if floor { Rounding::Floor } else { Rounding::Ceil };
        let options = LabelOptions::default().with_share(share).with_rounding(rounding).with_bottom_mm(bottom_mm);
        for obstacles in [
            Obstacles::Queries,
            Obstacles::QueriesAnd(&more.points),
            Obstacles::Points(&more.points),
            Obstacles::Centroids(&more.points),
        ] {
            assert_engines_agree((&part).into(), obstacles, seed, options);
        }
        let space: Vec<Vec3> = part.points.iter().map(|p| *p + Vec3::Z).collect();
        let options = options.with_occlusion(false);
        assert_engines_agree(Queries::Volume(&space), Obstacles::Points(&more.points), seed, options);
    }
}
