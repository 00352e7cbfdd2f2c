//! Building octrees of 1,000 to 1,000,000 points, and the layers that run on them.
//!
//! The throughput of convolutions is printed in products (one multiplication and one addition) per
//! second over the neighbors that exist: twice that is FLOP/s.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deepmill::nn::arena::Arena;
use deepmill::nn::column_norm::Epilogue;
use deepmill::nn::conv::OctreeConv;
use deepmill::nn::deconv::OctreeDeconv;
use deepmill::nn::interp::Interpolation;
use deepmill::nn::linear_operator::LinearOperator;
use deepmill::nn::operand::Operand;
use deepmill::nn::params::Layout;
use deepmill::nn::pass::{Backward, Context};
use deepmill::nn::strided_conv::{OctreeStridedConv, OutputRows};
use deepmill::octree::{Cloud, Features, Octree, OctreeOptions};
use glam::Vec3;
use std::hint::black_box;
use std::time::Duration;

/// Sites of one part in the paper's data.
const N_SITES: usize = 7000;

/// Fibonacci points on a sphere of radius 0.8: also their own normals, up to length.
fn sphere(n: usize) -> Vec<Vec3> {
    let point = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (radius, angle) = ((1.0 - z * z).sqrt(), i as f64 * 2.399_963_229_728_653);
        Vec3::new((radius * libm::cos(angle)) as f32, (radius * libm::sin(angle)) as f32, z as f32)
            * 0.8
    };
    (0..n).map(point).collect()
}

fn octree(points: &[Vec3], depth: usize) -> Octree {
    let options = OctreeOptions { depth, ..OctreeOptions::default() };
    Octree::build(&[Cloud::new(points, points)], &options).expect("a sphere")
}

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("octree build");
    group.sample_size(10).warm_up_time(Duration::from_millis(200));
    group.measurement_time(Duration::from_millis(1000));
    for (n, depth) in [(1000, 5), (N_SITES, 5), (10_000, 6), (100_000, 7), (1_000_000, 9)] {
        let points = sphere(n);
        assert_eq!(octree(&points, depth).n_points(), n);
        group.throughput(Throughput::Elements(n as u64));
        group.bench_function(BenchmarkId::new(format!("depth {depth}"), n), |bencher| {
            bencher.iter(|| black_box(octree(&points, depth)));
        });
    }
    let (points, depth) = (sphere(N_SITES), 5);
    let (octree, range) = (octree(&points, depth), 0..N_SITES);
    group.bench_function("features", |bencher| {
        bencher.iter(|| black_box(octree.features(Features::default())));
    });
    group.bench_function("interpolation", |bencher| {
        let ranges = std::slice::from_ref(&range);
        bencher.iter(|| black_box(Interpolation::<f32>::linear(&octree, depth, &points, ranges)));
    });
}

fn numbers(n: usize) -> Vec<f32> {
    (0..n).map(|i| (i * 7 % 13) as f32 * 0.1 - 0.6).collect()
}

/// The 3×3×3 convolutions of the reference network: depth, channels in and out.
const CONVOLUTIONS: [(usize, usize, usize); 7] =
    [(5, 4, 32), (5, 96, 96), (4, 32, 32), (4, 96, 96), (3, 64, 64), (2, 128, 128), (1, 256, 256)];

fn convolutions(criterion: &mut Criterion) {
    let octree = octree(&sphere(N_SITES), 5);
    let mut group = criterion.benchmark_group("conv 3x3x3");
    group.sample_size(10).warm_up_time(Duration::from_millis(200));
    group.measurement_time(Duration::from_millis(500));
    for (depth, c_in, c_out) in CONVOLUTIONS {
        let mut layout = Layout::default();
        let conv = OctreeConv::new(&mut layout, "conv", c_in, c_out);
        let (map, params) = (&octree.levels[depth].conv, layout.init_params::<f32>(1));
        let (x, dy) = (numbers(map.n_inputs() * c_in), numbers(map.n_outputs() * c_out));
        let (arena, mut grads) = (&Arena::default(), vec![0.0; params.len()]);
        let (context, x) = (Context { params: &params, arena }, Operand::new(&x, c_in));
        let name = format!("depth {depth}, {c_in} to {c_out}");
        group.throughput(Throughput::Elements((map.n_pairs() * c_in * c_out) as u64));
        group.bench_function(BenchmarkId::new("forward", &name), |bencher| {
            bencher.iter(|| conv.apply(context, map, x, Epilogue::Identity));
        });
        group.throughput(Throughput::Elements((2 * map.n_pairs() * c_in * c_out) as u64));
        group.bench_function(BenchmarkId::new("backward", &name), |bencher| {
            let mut pass = Backward::new(&params, &mut grads, arena);
            bencher.iter(|| conv.gradients(&mut pass, map, x, &dy));
        });
    }
}

fn strides(criterion: &mut Criterion) {
    let octree = octree(&sphere(N_SITES), 5);
    let mut group = criterion.benchmark_group("stride 2");
    group.sample_size(10).warm_up_time(Duration::from_millis(200));
    group.measurement_time(Duration::from_millis(500));
    for (depth, c_fine, c_coarse) in [(4, 32, 32), (4, 96, 96), (1, 128, 256)] {
        let coarse = &octree.levels[depth];
        let mut layout = Layout::default();
        let rows = OutputRows::AllNodes;
        let down = OctreeStridedConv::new(&mut layout, "down", c_fine, c_coarse, rows);
        let params = layout.init_params::<f32>(1);
        let up = OctreeDeconv::new(&mut Layout::default(), "up", c_coarse, c_fine);
        let (fine, rough) =
            (numbers(8 * coarse.n_nonempty() * c_fine), numbers(coarse.n_nodes() * c_coarse));
        let name = format!("depth {depth}, {c_fine} and {c_coarse}");
        let context = Context { params: &params, arena: &Arena::default() };
        let (x, rough) = (Operand::new(&fine, c_fine), Operand::new(&rough, c_coarse));
        group.throughput(Throughput::Elements((fine.len() * c_coarse) as u64));
        group.bench_function(BenchmarkId::new("down", &name), |bencher| {
            bencher.iter(|| down.apply(context, coarse, x, Epilogue::Identity));
        });
        group.bench_function(BenchmarkId::new("up", &name), |bencher| {
            bencher.iter(|| up.apply(context, coarse, rough, Epilogue::Identity));
        });
    }
}

criterion_group!(benches, build, convolutions, strides);
criterion_main!(benches);
