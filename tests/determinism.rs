//! The same bits for any number of threads and with every instruction set.

use deepmill::loss::CrossEntropy;
use deepmill::model::{Batch, Model, Shape, UNetConfig};
use deepmill::nn::arena::Arena;
use deepmill::optim::Sgd;
use deepmill::par;
use deepmill::rng::{Purpose, Stream};
use deepmill::simd::Isa;
use glam::Vec3;

const THREADS: [usize; 4] = [1, 2, 3, 8];
const STEPS: usize = 10;

/// Points on a wavy sheet, some doubled, with their normals.
fn cloud(n: usize, seed: u64) -> (Vec<Vec3>, Vec<Vec3>) {
    let mut stream = Stream::new(seed, 0, 0, Purpose::Probe);
    let point = |_| {
        let [x, y] = [0; 2].map(|_| stream.range(-40.0, 40.0) as f32);
        Vec3::new(x, y, 0.01 * x * x - 0.3 * y)
    };
    let mut points: Vec<Vec3> = (0..n).map(point).collect();
    points.push(points[0]);
    let normals = points.iter().map(|p| Vec3::new(-0.02 * p.x, 0.3, 1.0).normalize()).collect();
    (points, normals)
}

fn batch(config: &UNetConfig) -> Batch<f32> {
    let clouds = [cloud(1500, 1), cloud(700, 2), cloud(900, 3)];
    let shapes: Vec<_> = clouds
        .iter()
        .map(|(points, normals)| Shape::new(points, normals, [1.5, 6.0, 40.0, 5.0]))
        .collect();
    Batch::new(&shapes, &config.input).unwrap()
}

/// Dropout and attention on, widths that are no multiple of a tile, several blocks of rows.
fn config() -> UNetConfig {
    let mut config = UNetConfig::tiny();
    config.input.depth = 5;
    config.encoder_widths = vec![17, 24, 33];
    config.cutter.dropout = 0.3;
    config.attention.depths = vec![3];
    config
}

/// Everything a run of ten steps produces: losses, parameters, running statistics, last gradients, and
/// the logits of an inference with the final network.
fn train() -> Vec<u32> {
    let config = config();
    let (batch, mut model) = (batch(&config), Model::<f32>::new(&config, 7).unwrap());
    let (arena, mut dlogits) = (Arena::default(), [vec![], vec![]]);
    let n = model.params.len();
    let (mut grads, mut velocity, mut losses) = (vec![0.0; n], vec![0.0; n], Vec::new());
    let mut last = Vec::new();
    let targets: Vec<u8> = (0..batch.n_points()).map(|i| (i % 7 == 0) as u8).collect();
    for step in 0..STEPS as u64 {
        let stream = |shape| Stream::new(7, step, shape, Purpose::Dropout);
        let mut dropout: Vec<_> = (0..batch.n_shapes() as u64).map(stream).collect();
        let pass = model.forward_train(&batch, Some(&mut dropout), &arena);
        for (logits, d) in pass.logits.iter().zip(&mut dlogits) {
            losses.push(CrossEntropy::binary().loss(logits, &targets, 0.5, d) as f32);
        }
        let [first, second] = &dlogits;
        model.backward(&batch, pass, &[first, second], &mut grads, &arena);
        let sgd = Sgd::new(0.9, 5e-4);
        last.clone_from(&grads);
        sgd.step(0.1, &mut grads, &mut velocity, &mut model.params);
    }
    let activations = model.forward(&batch, &arena);
    assert!(losses.iter().all(|loss| loss.is_finite()));
    assert!(losses[2 * STEPS - 2] < losses[0], "it learns: {losses:?}");
    let [first, second] = &activations.logits[..] else { panic!("two heads") };
    let all: [&[f32]; 6] = [&losses, &model.params, &model.buffers, &last, first, second];
    all.into_iter().flatten().map(|x| x.to_bits()).collect()
}

/// One test, because the instruction set in force belongs to the whole process.
#[test]
fn ten_training_steps_are_identical_for_any_threads_and_any_level() {
    let expected = par::with_threads(1, train).unwrap();
    for n_threads in THREADS {
        assert!(par::with_threads(n_threads, train).unwrap() == expected, "{n_threads} threads");
    }
    let chosen = Isa::requested().unwrap();
    for &isa in Isa::available() {
        isa.activate();
        let got = par::with_threads(2, train).unwrap();
        chosen.activate();
        assert!(got == expected, "{}", isa.name());
    }
}
