//! Building octrees of 1,000 to 1,000,000 points, and the layers that run on them.
//!
//! The throughput of convolutions is printed in products (one multiplication and one addition) per
//! second over the neighbors that exist: twice that is FLOP/s.

mod timing;

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
use timing::time;

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
    let options = OctreeOptions::default().with_depth(depth);
    Octree::build(&[Cloud::new(points, points)], &options).expect("a sphere")
}

fn build() {
    for (n, depth) in [(1000, 5), (N_SITES, 5), (10_000, 6), (100_000, 7), (1_000_000, 9)] {
        let points = sphere(n);
        assert_eq!(octree(&points, depth).n_points(), n);
        time(format!("octree, depth {depth}: {n}"), n, || octree(&points, depth));
    }
    let (points, depth) = (sphere(N_SITES), 5);
    let (octree, range) = (octree(&points, depth), 0..N_SITES);
    time("features", 0, || octree.features(Features::default()));
    let ranges = std::slice::from_ref(&range);
    time("interpolation", 0, || Interpolation::<f32>::linear(&octree, depth, &points, ranges));
}

fn numbers(n: usize) -> Vec<f32> {
    (0..n).map(|i| (i * 7 % 13) as f32 * 0.1 - 0.6).collect()
}

/// The 3×3×3 convolutions of the reference network: depth, channels in and out.
const CONVOLUTIONS: [(usize, usize, usize); 7] =
    [(5, 4, 32), (5, 96, 96), (4, 32, 32), (4, 96, 96), (3, 64, 64), (2, 128, 128), (1, 256, 256)];

fn convolutions() {
    let octree = octree(&sphere(N_SITES), 5);
    for (depth, c_in, c_out) in CONVOLUTIONS {
        let mut layout = Layout::default();
        let conv = OctreeConv::new(&mut layout, "conv", c_in, c_out);
        let (map, params) = (&octree.levels[depth].conv, layout.init_params::<f32>(1));
        let (x, dy) = (numbers(map.n_inputs() * c_in), numbers(map.n_outputs() * c_out));
        let (arena, mut grads) = (&Arena::default(), vec![0.0; params.len()]);
        let (context, x) = (Context::new(&params, arena), Operand::new(&x, c_in));
        let name = format!("conv 3x3x3, depth {depth}, {c_in} to {c_out}");
        let n_products = map.n_pairs() * c_in * c_out;
        time(format!("{name}: forward"), n_products, || {
            conv.apply(context, map, x, Epilogue::Identity)
        });
        let mut pass = Backward::new(&params, &mut grads, arena);
        time(format!("{name}: backward"), 2 * n_products, || {
            conv.gradients(&mut pass, map, x, &dy)
        });
    }
}

fn strides() {
    let octree = octree(&sphere(N_SITES), 5);
    for (depth, c_fine, c_coarse) in [(4, 32, 32), (4, 96, 96), (1, 128, 256)] {
        let coarse = &octree.levels[depth];
        let mut layout = Layout::default();
        let rows = OutputRows::AllNodes;
        let down = OctreeStridedConv::new(&mut layout, "down", c_fine, c_coarse, rows);
        let params = layout.init_params::<f32>(1);
        let up = OctreeDeconv::new(&mut Layout::default(), "up", c_coarse, c_fine);
        let (fine, rough) =
            (numbers(8 * coarse.n_nonempty() * c_fine), numbers(coarse.n_nodes() * c_coarse));
        let name = format!("stride 2, depth {depth}, {c_fine} and {c_coarse}");
        let arena = Arena::default();
        let context = Context::new(&params, &arena);
        let (x, rough) = (Operand::new(&fine, c_fine), Operand::new(&rough, c_coarse));
        let n_products = fine.len() * c_coarse;
        time(format!("{name}: down"), n_products, || {
            down.apply(context, coarse, x, Epilogue::Identity)
        });
        time(format!("{name}: up"), n_products, || {
            up.apply(context, coarse, rough, Epilogue::Identity)
        });
    }
}

fn main() {
    build();
    convolutions();
    strides();
}
