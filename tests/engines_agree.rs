//! Promise: every engine gives the same labels and counts, bit for bit, whatever the scene, the
//! cutter, the number of threads and the instruction set.

mod scenes;

use deepmill::access::{Engine, LabelOptions, Labels, Obstacles, Queries, label, label_many};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::geom::Sites;
use deepmill::par::with_threads;
use deepmill::rng::{Purpose, Stream};
use deepmill::simd::Isa;
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use scenes::{cutters, hemisphere, sites, solids};

fn unit(stream: &mut Stream) -> Vec3 {
    let v = DVec3::new(stream.normal(), stream.normal(), stream.normal());
    v.try_normalize().unwrap_or(DVec3::Z).as_vec3()
}

/// Points anywhere in a box, normals anywhere, some points doubled.
fn cloud(n: usize, size: f64, stream: &mut Stream) -> Sites {
    let mut point = || {
        let mut at = || stream.range(0.0, size) as f32;
        Vec3::new(at(), at(), at())
    };
    let mut points: Vec<Vec3> = (0..n).map(|_| point()).collect();
    for i in (7..n).step_by(7) {
        points[i] = points[i - 7];
    }
    let normals = (0..n).map(|_| unit(stream)).collect();
    sites(points, normals)
}

/// A gridded pocket: floor, four walls exactly one ball radius apart in places, and a rim. Thousands
/// of borderline cases: equal heights, equal radii, distances of exactly CR.
fn gridded_pocket(cells: i32, pitch: f32) -> Sites {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    let mut add = |x: i32, y: i32, z: i32, normal: Vec3| {
        points.push(Vec3::new(x as f32, y as f32, z as f32) * pitch);
        normals.push(normal);
    };
    for a in 0..=cells {
        for b in 0..=cells {
            add(a, b, 0, Vec3::Z);
            add(0, a, b, Vec3::X);
            add(cells, a, b, Vec3::NEG_X);
            add(a, 0, b, Vec3::Y);
            add(a, cells, b, Vec3::NEG_Y);
            add(a - cells, b, cells, Vec3::Z);
        }
    }
    sites(points, normals)
}

fn options(engine: Engine, isa: Isa) -> LabelOptions {
    LabelOptions::default().with_engine(engine).with_isa(isa).with_collision_matrix(true)
}

/// Everything but the account of the work.
fn answer(mut labels: Labels) -> Labels {
    labels.stats = Default::default();
    labels
}

fn assert_engines_agree<'a>(
    queries: impl Into<Queries<'a>>,
    obstacles: Obstacles,
    cutters: &[Cutter],
    directions: &Directions,
    what: &str,
) -> Vec<Labels> {
    let queries = queries.into();
    let run = |engine, isa, n_threads| {
        let work = || label_many(queries, obstacles, cutters, directions, &options(engine, isa));
        let labels = with_threads(n_threads, work).unwrap().unwrap();
        labels.into_iter().map(answer).collect::<Vec<_>>()
    };
    let expected = run(Engine::Reference, Isa::fastest(), 2);
    let mut runs = vec![(Engine::Batched, Isa::fastest(), 2)];
    for &isa in Isa::available() {
        runs.extend([1, 3].map(|n_threads| (Engine::Pruned, isa, n_threads)));
    }
    for &isa in Isa::available() {
        let options = options(Engine::Pruned, isa).with_beta(false);
        let found = label_many(queries, obstacles, cutters, directions, &options).unwrap();
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(found.answers, expected.answers, "{what}, {}: without beta", isa.name());
            assert!(found.beta.is_empty());
        }
    }
    for (engine, isa, n_threads) in runs {
        let place = format!("{what}, {engine:?}, {}, {n_threads} threads", isa.name());
        for (t, (found, expected)) in run(engine, isa, n_threads).iter().zip(&expected).enumerate()
        {
            assert_same(found, expected, &format!("{place}, cutter {t}"));
        }
    }
    expected
}

fn assert_same(found: &Labels, expected: &Labels, place: &str) {
    assert_eq!(
        found.answers.accessible_directions(),
        expected.answers.accessible_directions(),
        "{place}: directions"
    );
    assert_eq!(found.witness, expected.witness, "{place}: witness");
    assert_eq!(found.beta, expected.beta, "{place}: beta");
    assert!(found == expected, "{place}: labels");
}

#[test]
fn engines_agree_around_every_block_edge() {
    let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
    for n in [0, 1, 2, 3, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65, 71, 127, 128, 129, 511, 513, 577]
    {
        let scene = cloud(n, 25.0, &mut stream);
        let what = format!("cloud of {n}");
        assert_engines_agree(
            &scene,
            Obstacles::Queries,
            &cutters(4, n as u64),
            &hemisphere(7),
            &what,
        );
    }
}

#[test]
fn engines_agree_on_solids_for_thirty_cutters() {
    let scene = solids(900);
    let cutters = cutters(32, 2);
    let labels =
        assert_engines_agree(&scene, Obstacles::Queries, &cutters, &hemisphere(10), "solids");
    assert!(labels.iter().any(|l| l.answers.n_inaccessible() > 100 && l.answers.n_occlusion() > 0));
}

/// Enough sites for every level of boxes that splits lists.
#[test]
fn engines_agree_on_deep_trees() {
    let scene = solids(4800);
    assert_engines_agree(&scene, Obstacles::Queries, &cutters(4, 5), &hemisphere(2), "deep trees");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Coordinates and lengths on a coarse grid make ties and borderline cases common.
    #[test]
    fn engines_agree_on_whatever_comes(
        points in prop::collection::vec(prop::array::uniform3(0u8..40), 0..300),
        lengths in prop::array::uniform4(1u8..32),
        vectors in prop::collection::vec(prop::array::uniform3(-2i8..3), 1..4),
        seed in any::<u64>(),
    ) {
        let mut stream = Stream::new(seed, 0, 0, Purpose::Probe);
        let length = |k: usize| 0.25 * f64::from(lengths[k]);
        let params = [length(0), length(1), length(0) + length(2) - 0.25, length(3)];
        let cutter = Cutter::ball_end(CutterParams::from_array(params)).unwrap();
        let vectors = vectors.iter().map(|v| [v[0].into(), v[1].into(), f64::from(v[2]) + 2.5]);
        let directions = DirectionSet::List { vectors: vectors.collect() };
        let directions = Directions::new(directions).unwrap();
        let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        let normal = |_: &[u8; 3]| axes[stream.range(0.0, 6.0) as usize % 6];
        let normals = points.iter().map(normal).collect();
        let at = |p: &[u8; 3]| Vec3::from(p.map(f32::from)) * 0.25;
        let scene = sites(points.iter().map(at).collect(), normals);
        assert_engines_agree(&scene, Obstacles::Queries, &[cutter], &directions, "drawn");
    }
}

#[test]
fn engines_agree_on_borderline_cases() {
    let exact = |lengths| Cutter::ball_end(CutterParams::from_array(lengths)).unwrap();
    let cutters =
        [exact([1.0, 1.0, 2.0, 1.0]), exact([1.0, 2.0, 1.0, 3.0]), exact([2.0, 4.0, 8.0, 2.0])];
    let axes = vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8]];
    let axes = Directions::new(DirectionSet::List { vectors: axes }).unwrap();
    for pitch in [1.0, 0.5, 0.1] {
        let scene = gridded_pocket(9, pitch);
        let what = format!("pocket of pitch {pitch}");
        assert_engines_agree(&scene, Obstacles::Queries, &cutters, &axes, &what);
        assert_engines_agree(&scene, Obstacles::Queries, &cutters, &hemisphere(6), &what);
    }
}

/// Obstacles that fill no area, all of one height, or far from the queries; steps as wide as nothing and
/// wider than everything.
#[test]
fn engines_agree_at_the_edges_of_the_grid() {
    let mut stream = Stream::new(7, 0, 0, Purpose::Probe);
    let mut within = |size: [f64; 3], step: f64, n: usize| -> Vec<Vec3> {
        let mut along = |length: f64| ((stream.range(0.0, length) / step).round() * step) as f32;
        (0..n).map(|_| Vec3::from(size.map(&mut along))).collect()
    };
    let axes = vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.3, -0.5, 0.7]];
    let axes = Directions::new(DirectionSet::List { vectors: axes }).unwrap();
    let stepped =
        |sections: &[(f64, f64)], spindle| Cutter::stepped(1e-3, sections, spindle).unwrap();
    let cutters = [
        stepped(&[(0.5, 1e-3), (3.0, 2.0)], true),
        stepped(&[(0.25, 0.5), (0.25, 1.0), (2.0, 1e4)], false),
        stepped(&[(1.0, 25.0)], false),
        Cutter::stepped(1e4, &[(1e4, 1e4)], false).unwrap(),
        Cutter::ball_end(CutterParams::from_array([0.5, 2.0, 30.0, 4.0])).unwrap(),
    ];
    let clouds = [
        ("line", within([60.0, 0.0, 0.0], 0.5, 300)),
        ("column", within([0.0, 0.0, 40.0], 0.5, 300)),
        ("plate", within([40.0, 30.0, 0.0], 0.25, 2000)),
        ("one place", vec![Vec3::splat(3.0); 100]),
        ("one", vec![Vec3::splat(-2.0)]),
        ("block", within([9.0, 9.0, 20.0], 0.5, 700)),
    ];
    let mut queries = within([90.0, 90.0, 40.0], 0.5, 300);
    queries.iter_mut().step_by(2).for_each(|p| *p -= Vec3::new(30.0, 30.0, 0.0));
    queries.extend([
        Vec3::new(9e3, 0.0, 1.0),
        Vec3::new(-9e5, 5.0, 2.0),
        Vec3::new(1.0, 2e4, -9e4),
    ]);
    for (name, cloud) in &clouds {
        let volume = Queries::Volume(&queries);
        assert_engines_agree(volume, Obstacles::Points(cloud), &cutters, &axes, name);
        for shift in [0.0, 1e5] {
            let points: Vec<Vec3> = cloud.iter().map(|&p| p + shift).collect();
            let normals =
                (0..points.len()).map(|i| [Vec3::Z, Vec3::X, Vec3::NEG_Z][i % 3]).collect();
            let scene = sites(points, normals);
            assert_engines_agree(&scene, Obstacles::Queries, &cutters, &axes, name);
        }
    }
}

#[test]
fn engines_agree_on_other_obstacles_and_volumes() {
    let mut stream = Stream::new(6, 0, 0, Purpose::Probe);
    let scene = solids(300);
    let dense = solids(1100).points;
    let space = cloud(200, 40.0, &mut stream).points;
    let cutters = cutters(4, 9);
    let few = hemisphere(9);
    assert_engines_agree(&scene, Obstacles::Points(&dense), &cutters, &few, "points");
    assert_engines_agree(&scene, Obstacles::Points(&[]), &cutters, &few, "no obstacles");
    let both = assert_engines_agree(&scene, Obstacles::QueriesAnd(&dense), &cutters, &few, "both");
    assert_eq!((both[0].beta.len(), both[0].answers.occlusion().len()), (1400, 300));
    let volume = Queries::Volume(&space);
    assert_engines_agree(volume, Obstacles::Points(&dense), &cutters, &few, "volume");
}

#[test]
fn engines_agree_on_every_kind_of_cutter() {
    let params = CutterParams::from_array([1.5, 6.0, 12.0, 5.0]);
    let cutters = [
        Cutter::flat_end(params).unwrap(),
        Cutter::bull_nose(params, 0.5).unwrap(),
        Cutter::tapered(params, 0.1, 9).unwrap(),
        Cutter::stepped(1.0, &[(4.0, 1.0), (6.0, 3.0), (5.0, 9.0)], false).unwrap(),
        Cutter::stepped(1.0, &[(4.0, 1.0)], true).unwrap(),
        Cutter::ball_end(params).unwrap().grown(0.7).unwrap(),
        Cutter::ball_end(params).unwrap().grown(-1.6).unwrap(),
    ];
    let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 11 }).unwrap();
    assert_engines_agree(&solids(700), Obstacles::Queries, &cutters, &sphere, "cutters");
    assert_engines_agree(&gridded_pocket(8, 1.0), Obstacles::Queries, &cutters, &sphere, "pocket");
}

/// Instruction sets and threads of the batched engine, which the comparisons above run at one of each.
#[test]
fn batched_is_the_same_at_every_level_and_thread_count() {
    let scene = solids(300);
    let cutter = &cutters(1, 4)[0];
    let run = |engine, isa, n_threads| {
        let options = options(engine, isa);
        let work = || label(&scene, Obstacles::Queries, cutter, &hemisphere(9), &options);
        answer(with_threads(n_threads, work).unwrap().unwrap())
    };
    let expected = run(Engine::Reference, Isa::fastest(), 1);
    for &isa in Isa::available() {
        for n_threads in [1, 2, 5] {
            assert_same(&run(Engine::Batched, isa, n_threads), &expected, isa.name());
        }
    }
    assert_same(&run(Engine::Reference, Isa::fastest(), 4), &expected, "reference");
}

/// Lengths of three cutters, wide and narrow holders, and one twice: some hold others, some do not.
fn families() -> Vec<Cutter> {
    let mut lengths = vec![];
    for ch in [0.5, 2.0, 3.5, 6.0, 11.0] {
        lengths.extend([[1.0, ch, 8.0, 4.0], [2.0, ch, 5.0, 9.0 - 0.5 * ch], [1.0, 7.0, ch, ch]]);
    }
    let params: Vec<_> = lengths.into_iter().map(CutterParams::from_array).collect();
    let mut cutters: Vec<Cutter> =
        params.iter().filter_map(|&p| Cutter::ball_end(p).ok()).collect();
    cutters.extend(params[..9].iter().filter_map(|&p| Cutter::flat_end(p).ok()));
    cutters.push(Cutter::stepped(1.0, &[(4.0, 1.0), (6.0, 3.0), (5.0, 9.0)], false).unwrap());
    cutters.push(cutters[3].clone());
    cutters
}

#[test]
fn cutters_that_learn_from_each_other_agree_with_the_law() {
    let mut stream = Stream::new(9, 0, 0, Purpose::Probe);
    let space = cloud(300, 40.0, &mut stream).points;
    let few = hemisphere(5);
    for scene in [solids(600), gridded_pocket(8, 0.5), cloud(400, 20.0, &mut stream)] {
        assert_engines_agree(&scene, Obstacles::Queries, &families(), &few, "families");
        let volume = Queries::Volume(&space);
        let obstacles = Obstacles::Points(&scene.points);
        assert_engines_agree(volume, obstacles, &families(), &few, "families in space");
    }
}

#[test]
fn labels_do_not_depend_on_the_company_of_other_cutters() {
    let scene = solids(400);
    let mut by_cutter = 0;
    for cutters in [cutters(5, 3), families()] {
        let options = LabelOptions::default().with_collision_matrix(true);
        let together =
            label_many(&scene, Obstacles::Queries, &cutters, &hemisphere(10), &options).unwrap();
        for (cutter, together) in cutters.iter().zip(together) {
            let alone =
                label(&scene, Obstacles::Queries, cutter, &hemisphere(10), &options).unwrap();
            assert_eq!(alone.stats.by_cutter, 0);
            by_cutter += together.stats.by_cutter;
            assert!(answer(alone) == answer(together));
        }
    }
    assert!(by_cutter > 0);
}

/// Without β, the engine looks at the sites in another order.
#[test]
fn labels_do_not_depend_on_whether_occlusion_is_labeled() {
    let mut stream = Stream::new(8, 0, 0, Purpose::Probe);
    for scene in [solids(3000), gridded_pocket(12, 2.0), cloud(1001, 60.0, &mut stream)] {
        for cutter in &cutters(6, 21) {
            let run = |occlusion| {
                let options =
                    LabelOptions::default().with_occlusion(occlusion).with_collision_matrix(true);
                let labels = label(&scene, Obstacles::Queries, cutter, &hemisphere(10), &options);
                let labels = labels.unwrap();
                (
                    labels.answers.inaccessible(),
                    labels.answers.accessible_directions().to_vec(),
                    labels.witness,
                    labels.collision_matrix,
                )
            };
            assert!(run(false) == run(true));
        }
    }
}
