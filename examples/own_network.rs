//! Build and train an own network on octrees: other widths, an own target, an own loop.
//!
//! It learns which points of a sphere lie above a plane. `cargo run --release --example own_network`
#![allow(clippy::print_stdout)]

use deepmill::glam::Vec3;
use deepmill::loss::CrossEntropy;
use deepmill::metrics::Confusion;
use deepmill::model::config::{CutterConfig, CutterPlacement, InputConfig};
use deepmill::model::{Batch, Model, Shape, UNetConfig};
use deepmill::nn::arena::Arena;
use deepmill::optim::Sgd;
use deepmill::rng::{Purpose, Stream};

const N_POINTS: usize = 600;
const N_STEPS: usize = 20;

fn main() -> deepmill::Result<()> {
    let config = UNetConfig {
        input: InputConfig { depth: 4, features: "NDP".into(), ..InputConfig::default() },
        stem_width: 8,
        encoder_widths: vec![16, 24],
        encoder_blocks: vec![1, 1],
        decoder_widths: vec![24, 16],
        decoder_blocks: vec![1, 1],
        head_width: 8,
        cutter: CutterConfig { placement: CutterPlacement::None, ..CutterConfig::default() },
        ..UNetConfig::tiny()
    };
    let mut model = Model::<f32>::new(&config, 1)?;
    println!("{} parameters", model.params.len());

    let (arena, mut dlogits) = (Arena::default(), [vec![], vec![]]);
    let (mut grads, mut velocity) = (vec![0.0; model.params.len()], vec![0.0; model.params.len()]);
    let sgd = Sgd { momentum: 0.9, weight_decay: 1e-4 };
    let criterion = CrossEntropy::binary();
    for step in 0..N_STEPS {
        let spheres = [sphere(2 * step as u64), sphere(2 * step as u64 + 1)];
        let targets: Vec<u8> = spheres.iter().flatten().map(|p| u8::from(p.z > 0.3)).collect();
        let batch = batch(&spheres, &config.input)?;
        let pass = model.forward_train(&batch, None, &arena);
        let mut loss = 0.0;
        for (logits, d) in pass.logits.iter().zip(&mut dlogits) {
            loss += criterion.loss(logits, &targets, 1.0, d);
        }
        if step % 5 == 4 {
            let scores = Confusion::of_logits(&pass.logits[1], &targets, 1);
            println!("step {:2}: loss {loss:.3}, F1 {:.3}", step + 1, scores.f1());
        }
        let [first, second] = &dlogits;
        model.backward(&batch, pass, &[first, second], &mut grads, &arena);
        sgd.step(0.05, &mut grads, &mut velocity, &mut model.params);
    }
    Ok(())
}

/// Random points on a unit sphere, which are their own normals.
fn sphere(seed: u64) -> Vec<Vec3> {
    let mut stream = Stream::new(seed, 0, 0, Purpose::Probe);
    let mut point =
        || Vec3::from_array([0; 3].map(|_| stream.normal() as f32)).normalize_or(Vec3::Z);
    (0..N_POINTS).map(|_| point()).collect()
}

fn batch(spheres: &[Vec<Vec3>], input: &InputConfig) -> deepmill::Result<Batch<f32>> {
    // The network has no cutter module; the lengths only have to make a cutter.
    let cutter_mm = [1.0, 1.0, 2.0, 1.0];
    let shape = |points: &'_ Vec<Vec3>| (points.clone(), points.clone());
    let clouds: Vec<_> = spheres.iter().map(shape).collect();
    let shapes: Vec<Shape> =
        clouds.iter().map(|(points, normals)| Shape { points, normals, cutter_mm }).collect();
    Batch::new(&shapes, input)
}
