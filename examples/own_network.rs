//! An octree network with labels of one's own, in five classes: trained, stopped, stored, resumed and scored.
//!
//! It learns in which of five bands of a sphere a point lies. `cargo run --release --example own_network`
#![allow(clippy::print_stdout)]

use deepmill::model::config::{CutterConfig, CutterPlacement, InputConfig};
use deepmill::model::{Batch, Shape, UNet, UNetConfig};
use deepmill::nn::arena::{Arena, Buffer};
use deepmill::rng::{Purpose, Stream};
use deepmill::{Result, glam::Vec3, loss::CrossEntropy, metrics::ConfusionMatrix, train::Trainer};
use std::ops::ControlFlow::{Break, Continue};

const N_CLASSES: usize = 5;

fn main() -> Result<()> {
    let config = UNetConfig::tiny()
        .with_input(InputConfig::default().with_depth(4).with_features("NDP".into()))
        .with_cutter(CutterConfig::default().with_placement(CutterPlacement::None));
    let net = UNet::with_heads(&config, &[N_CLASSES])?;
    let source = |epoch, step| batch(epoch, step, &config.input);
    let loss = |logits: &[Buffer<f32>], classes: &Vec<u8>, dlogits: &mut [Vec<f32>]| {
        CrossEntropy::equal(N_CLASSES).try_loss(&logits[0], classes, 1.0, &mut dlogits[0])
    };

    let path = std::env::temp_dir().join(format!("own-{}.safetensors", std::process::id()));
    let mut trainer = Trainer::new(net.clone(), 1, (3, 8))?;
    let _ = trainer.train(source, loss, |trainer, loss| {
        println!("loss {loss:.3}");
        Ok(if trainer.position() == (2, 4) { Break(()) } else { Continue(()) }) // in the second epoch
    })?;
    trainer.write(&path)?;
    let mut trainer = Trainer::resume(net, &path)?;
    let _ = trainer.train(source, loss, |_, _| Ok(Continue(())))?;

    let (points, classes) = source(4, 0)?;
    let mut counts = ConfusionMatrix::new(N_CLASSES)?;
    counts.add_logits(&trainer.model().logits(&points, &Arena::default())[0], &classes)?;
    println!("accuracy {:.3}, mean IoU {:.3}", counts.accuracy(), counts.mean_iou());
    std::fs::remove_file(&path).map_err(|e| deepmill::Error::write(&path, e))
}

/// Points of two spheres, which are their own normals, with their classes.
fn batch(epoch: u64, step: u64, input: &InputConfig) -> Result<(Batch<f32>, Vec<u8>)> {
    let mut stream = Stream::new(7, epoch, step, Purpose::Probe);
    let mut normal = || Vec3::from_array([0; 3].map(|_| stream.normal() as f32));
    let spheres = [(); 2].map(|()| [(); 600].map(|()| normal().normalize_or(Vec3::Z)));
    let class = |p: &Vec3| ((p.z + 1.0) * 2.5).min(4.0) as u8;
    // The network has no cutter module; the lengths only have to make a cutter.
    let shape = |p| Shape::new(p, p, [1.0, 1.0, 2.0, 1.0]);
    let shapes: Vec<Shape> = spheres.iter().map(|p| shape(p.as_slice())).collect();
    Ok((Batch::new(&shapes, input)?, spheres.iter().flatten().map(class).collect()))
}
