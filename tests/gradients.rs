//! Backward passes of layers, blocks and whole networks are the derivatives of their forward passes.
//!
//! Central differences in f64, relative error at most 1e-7, of every case of the suite: on a batch of several
//! shapes and on each kind of shape alone, whatever the blocks save for backward.

#![allow(clippy::print_stdout)]

use deepmill::gradcheck::fixture::ArrayValues;
use deepmill::gradcheck::suite::ProbeShape::{self, Cell, Patch, Point};
use deepmill::gradcheck::suite::{LIMIT, Suite, SuiteCase};
use deepmill::model::policy::MemoryPolicy;
use deepmill::nn::saved::Policy;
use deepmill::par;
use std::sync::atomic::{AtomicUsize, Ordering};

const BATCHES: [&[ProbeShape]; 5] =
    [&[Patch, Point, Cell], &[Patch, Cell], &[Patch], &[Point], &[Cell]];

/// Networks take long: each batch checks some.
const NETWORKS: [(&[ProbeShape], &[&str]); 6] = [
    (&[Patch, Point, Cell], &["unet", "unet_nonempty", "graph_sage"]),
    (&[Patch, Cell], &["unet_shared_cutter"]),
    (&[Patch, Point], &["unet_last_cutter"]),
    (&[Patch], &["unet_first_cutter", "unet_without_cutter", "graph_sage_last_cutter"]),
    (&[Point], &["unet_first_cutter", "unet_without_cutter"]),
    (&[Cell], &["unet_first_cutter", "unet_without_cutter"]),
];

fn suite(shapes: &[ProbeShape]) -> Suite {
    Suite::default().with_shapes(shapes.into())
}

fn require(suite: &Suite, case: &SuiteCase) {
    let report = case.check().unwrap();
    let (name, worst) = (case.name(), report.worst());
    println!("{name} {:?}: {} elements, worst {worst}", suite.shapes, report.n_checked);
    report.require(LIMIT).unwrap();
}

/// The cases are small: several at once, each on a single thread, take least time.
fn each_on_one_thread<T: Sync>(items: &[T], check: impl Fn(&T) + Sync) {
    let next = AtomicUsize::new(0);
    let work = || {
        par::with_threads(1, || {
            while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                check(item);
            }
        })
        .unwrap();
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
}

#[test]
fn layers_and_blocks_under_every_policy() {
    let policies = [Policy::Save, Policy::Recompute];
    let suites: Vec<Suite> = BATCHES
        .iter()
        .flat_map(|shapes| policies.map(|p| (shapes, MemoryPolicy::uniform(p))))
        .map(|(shapes, policy)| suite(shapes).with_policy(policy))
        .collect();
    each_on_one_thread(&suites, |suite| {
        suite.layer_cases().unwrap().iter().for_each(|case| require(suite, case));
    });
}

#[test]
fn networks_with_both_losses() {
    let checks: Vec<_> = NETWORKS
        .iter()
        .flat_map(|(shapes, names)| names.iter().map(move |name| (shapes, *name)))
        .collect();
    each_on_one_thread(&checks, |(shapes, name)| {
        let suite = suite(shapes);
        let cases = suite.cases().unwrap();
        require(&suite, cases.iter().find(|case| case.name() == *name).expect(name));
    });
}

#[test]
fn fixtures_hold_a_gradient_for_every_input_and_parameter() {
    for case in Suite::default().cases().unwrap() {
        let fixture = case.fixture();
        let mut names: Vec<&str> = fixture.arrays.iter().map(|a| a.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), fixture.arrays.len(), "{}: names", case.name());
        assert!(fixture.get("y").is_some());
        for array in &fixture.arrays {
            let n: usize = array.shape.iter().product();
            let len = match &array.values {
                ArrayValues::F64(values) => values.len(),
                ArrayValues::I64(values) => values.len(),
            };
            assert_eq!(n, len, "{} {}", case.name(), array.name);
            let name = ["input.", "param."].iter().find_map(|kind| array.name.strip_prefix(kind));
            if let Some(name) = name {
                let gradient = fixture.get(&format!("grad.{name}")).expect(name);
                assert_eq!(gradient.shape, array.shape, "{} {name}", case.name());
            }
        }
    }
}
