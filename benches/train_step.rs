//! One training step of the tiny and the small network: batch, forward, losses, backward, update.

mod timing;

use deepmill::data::generated::mixed_part;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::loss::CrossEntropy;
use deepmill::model::{Batch, Model, Shape, UNetConfig};
use deepmill::nn::arena::Arena;
use deepmill::optim::Sgd;

const CUTTER_MM: [f64; 4] = [1.5, 6.0, 40.0, 5.0];

fn main() {
    let options = SiteOptions::default().with_n_sites(7000);
    let parts: Vec<_> = (0..2).map(|i| sample(&mixed_part(0, i), &options)).collect();
    let parts: Vec<_> = parts.into_iter().filter_map(Result::ok).collect();
    let shapes: Vec<Shape> =
        parts.iter().map(|s| Shape::new(&s.points, &s.normals, CUTTER_MM)).collect();
    for (name, config) in [("tiny", UNetConfig::tiny()), ("small", UNetConfig::small())] {
        let mut model = Model::<f32>::new(&config, 1).expect("a preset is a network");
        let arena = Arena::default();
        let n = model.params.len();
        let (mut velocity, mut grads) = (vec![0.0; n], vec![0.0; n]);
        let sgd = Sgd::new(0.9, 5e-4);
        let mut step = || {
            let batch = Batch::new(&shapes, &config.input).expect("generated parts are sound");
            let labels = vec![0; batch.n_points()];
            let pass = model.forward_train(&batch, None, &arena);
            let (mut d, mut loss) = ([Vec::new(), Vec::new()], 0.0);
            for (logits, d) in pass.logits.iter().zip(&mut d) {
                loss += CrossEntropy::binary().loss(logits, &labels, 1.0, d);
            }
            model.backward(&batch, pass, &[&d[0], &d[1]], &mut grads, &arena);
            sgd.step(1e-3, &mut grads, &mut velocity, &mut model.params);
            loss
        };
        assert!(step().is_finite());
        timing::time(name, 0, step);
    }
}
