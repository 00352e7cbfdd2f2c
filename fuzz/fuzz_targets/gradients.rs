//! The gradient of a small network of any shape, on any points: along one direction it is the difference of the loss,
//! where steps of different length, forward and back, agree about that difference (beside a kink of a ReLU they do
//! not).
#![no_main]

use deepmill::gradcheck::probe;
use deepmill::model::config::{CutterPlacement, InputConfig};
use deepmill::model::{Batch, Model, Shape, UNetConfig};
use deepmill::nn::arena::Arena;
use glam::Vec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let Some((head, coordinates)) = input.split_at_checked(8) else { return };
    let small = |b: u8, n: u8| usize::from(b % n) + 1;
    let n_stages = small(head[0], 2);
    let placements = [
        CutterPlacement::None,
        CutterPlacement::First,
        CutterPlacement::Last,
        CutterPlacement::All,
    ];
    let mut config = UNetConfig::tiny()
        .with_input(InputConfig::default().with_depth(n_stages + 1).with_full_depth(1))
        .with_stem_width(small(head[1], 5))
        .with_encoder_widths(
            (0..n_stages).map(|s| small(head[2].wrapping_add(s as u8), 6)).collect(),
        )
        .with_encoder_blocks(vec![small(head[3], 2); n_stages])
        .with_decoder_widths(
            (0..n_stages).map(|s| small(head[4].wrapping_mul(3 + s as u8), 6)).collect(),
        )
        .with_decoder_blocks(vec![small(head[5], 2); n_stages])
        .with_head_width(small(head[6], 4));
    config.cutter.placement = placements[usize::from(head[7] % 4)];
    config.cutter.dropout = 0.0;
    config.input.point_normals = head[7] & 4 != 0;
    config.input.coarse_directions = usize::from(head[7] & 8);
    let Ok(mut model) = Model::<f64>::new(&config, u64::from(head[7])) else { return };
    let at = |b: u8| f32::from(b) - 127.5;
    let points: Vec<Vec3> =
        coordinates.as_chunks::<3>().0.iter().take(40).map(|p| Vec3::from(p.map(at))).collect();
    let normals: Vec<Vec3> = points.iter().map(|p| p.normalize()).collect();
    let n = points.len() / 2;
    let shapes: Vec<Shape> = [0..n, n..points.len()]
        .into_iter()
        .filter(|rows| !rows.is_empty())
        .map(|rows| Shape::new(&points[rows.clone()], &normals[rows], [1.5, 6.0, 40.0, 5.0]))
        .collect();
    let Ok(batch) = Batch::<f64>::new(&shapes, &config.input) else { return };
    let arena = Arena::default();
    let dlogits = [1, 2].map(|seed| probe(2 * batch.n_points(), seed));
    let along = probe(model.params.len(), 3);
    // At their first values biases are 0, and what batch norm makes of equal rows lies on the kink of the next ReLU.
    model.params.iter_mut().zip(probe(along.len(), 4)).for_each(|(p, x)| *p += 0.1 * x);
    let start = model.params.clone();
    let mut loss = |step: f64| {
        let moved = start.iter().zip(&along).map(|(p, v)| p + step * v);
        model.params = moved.collect();
        let logits = model.forward_train(&batch, None, &arena).logits;
        let dot =
            |head: usize| logits[head].iter().zip(&dlogits[head]).map(|(y, d)| y * d).sum::<f64>();
        dot(0) + dot(1)
    };
    let difference = |loss: &mut dyn FnMut(f64) -> f64, h: f64| (loss(h) - loss(-h)) / (2.0 * h);
    let [coarse, fine, finest] = [4e-6, 2e-6, 1e-6].map(|h| difference(&mut loss, h));
    let middle = loss(0.0);
    let [ahead, back] = [1e-6, -1e-6].map(|step| (loss(step) - middle) / step);
    model.params = start;
    let pass = model.forward_train(&batch, None, &arena);
    let mut grads = vec![0.0; model.params.len()];
    model.backward(&batch, pass, &[&dlogits[0], &dlogits[1]], &mut grads, &arena);
    assert!(grads.iter().all(|g| g.is_finite()));
    let analytic: f64 = grads.iter().zip(&along).map(|(g, v)| g * v).sum();
    let scale = grads.iter().map(|g| g * g).sum::<f64>().sqrt().max(1.0);
    let agree = |a: f64, b: f64| (a - b).abs() < 1e-4 * scale;
    // A kink much nearer than the steps changes all of them alike, but not both sides.
    if agree(coarse, fine) && agree(fine, finest) && agree(ahead, back) {
        assert!((analytic - finest).abs() < 1e-3 * scale, "{analytic} and {finest}, scale {scale}");
    }
});
