//! The estimate of a pass against the arena's peak.

use crate::model::config::{AttentionConfig, CutterConfig, InputConfig};
use crate::model::graph_sage::GraphSageConfig;
use crate::model::policy::MemoryPolicy;
use crate::model::{GraphSage, Model, Shape, SiteNetwork, UNet, UNetConfig};
use crate::nn::arena::Arena;
use crate::nn::pass::Inference;
use crate::nn::saved::Policy;
use crate::numeric::rng::{Purpose, Stream};
use crate::octree::tests::sheet;

/// The arena's peak in bytes and the estimate, of inference and of a step.
fn measure<N: SiteNetwork<f32>>(net: N, n_points: &[usize]) -> [(u64, u64); 2] {
    let clouds: Vec<_> = n_points.iter().map(|&n| sheet(n, n as u64 % 7)).collect();
    let cutter_mm = [1.5, 6.0, 40.0, 5.0];
    let shapes: Vec<_> =
        clouds.iter().map(|(points, normals)| Shape::new(points, normals, cutter_mm)).collect();
    let streams = |purpose| (0..shapes.len()).map(move |i| Stream::new(1, 0, i as u64, purpose));
    let mut drawn: Vec<_> = streams(Purpose::Neighbors).collect();
    let mut dropout: Vec<_> = streams(Purpose::Dropout).collect();
    let mut model = Model::with_network(net, 1);
    let batch = model.net.batch(&shapes, Some(&mut drawn)).unwrap();
    let estimate = |training| model.net.pass_bytes(&batch, training);
    let [inference, training] = [false, true].map(estimate);
    let arena = Arena::default();
    let pass = Inference { params: &model.params, buffers: &model.buffers, arena: &arena };
    drop(model.net.logits(&pass, &batch));
    let of_inference = arena.peak_bytes().max(arena.reserved_bytes()) as u64;
    let arena = Arena::default();
    let pass = model.forward_train(&batch, Some(&mut dropout), &arena);
    let d = vec![0.5; pass.logits[0].len()];
    let dlogits = vec![&d[..]; pass.logits.len()];
    let mut grads = vec![0.0; model.params.len()];
    model.backward(&batch, pass, &dlogits, &mut grads, &arena);
    let of_training = arena.peak_bytes().max(arena.reserved_bytes()) as u64;
    [(of_inference, inference), (of_training, training)]
}

fn require_covered(name: &str, measured: [(u64, u64); 2]) {
    for (peak, estimate) in measured {
        assert!(peak <= estimate, "{name}: {peak} bytes in use, {estimate} estimated");
    }
}

fn configurations() -> Vec<(String, UNetConfig)> {
    let tiny = UNetConfig::tiny;
    let input = |input| UNetConfig { input, ..tiny() };
    let mut all = vec![
        ("tiny".into(), tiny()),
        ("small".into(), UNetConfig::small()),
        ("empty parents".into(), UNetConfig { normalize_empty_parents: false, ..tiny() }),
        ("share".into(), UNetConfig { share_head: true, ..tiny() }),
        ("coarse".into(), input(InputConfig { coarse_directions: 20, ..tiny().input })),
        ("normals".into(), input(InputConfig { point_normals: true, ..tiny().input })),
        ("deep".into(), input(InputConfig { depth: 6, full_depth: 3, ..tiny().input })),
        ("full".into(), input(InputConfig { depth: 4, full_depth: 4, ..tiny().input })),
        ("modules".into(), UNetConfig { cutter: CutterConfig::default(), ..tiny() }),
    ];
    for (depths, n_heads) in [(vec![2], 4), (vec![2, 3, 4], 1), (vec![3], 8)] {
        let attention = AttentionConfig { depths, n_heads };
        all.push((format!("{attention:?}"), UNetConfig { attention, ..tiny() }));
    }
    for widths in [[1, 1, 1], [7, 64, 200], [130, 3, 64], [64, 64, 64], [128, 128, 96]] {
        let [stem_width, a, b] = widths;
        for n_blocks in [1, 3] {
            let config = UNetConfig {
                stem_width,
                encoder_widths: vec![a, b],
                encoder_blocks: vec![n_blocks; 2],
                decoder_widths: vec![b, a],
                decoder_blocks: vec![n_blocks; 2],
                ..tiny()
            };
            all.push((format!("{widths:?}, {n_blocks} blocks"), config));
        }
    }
    all
}

#[test]
fn no_pass_takes_more_than_its_estimate() {
    for (name, config) in configurations() {
        for sizes in [&[1][..], &[700], &[40, 2000, 3]] {
            let name = format!("{name}, {sizes:?} points");
            require_covered(&name, measure(UNet::new(&config).unwrap(), sizes));
            let all = MemoryPolicy::uniform(Policy::Save);
            let net = UNet::with_policy(&config, &all).unwrap();
            require_covered(&format!("{name}, all saved"), measure(net, sizes));
        }
    }
    for (widths, n_nearest) in [(vec![64; 4], 16), (vec![3, 200], 2), (vec![1; 9], 30)] {
        let config = GraphSageConfig { widths, n_nearest, ..GraphSageConfig::default() };
        for sizes in [&[1][..], &[700], &[40, 2000, 3]] {
            let name = format!("{:?}, {sizes:?} points", config.widths);
            require_covered(&name, measure(GraphSage::new(&config).unwrap(), sizes));
        }
    }
}

/// An estimate far above would refuse what fits.
#[test]
fn the_estimate_of_usual_work_is_at_most_four_times_what_it_takes() {
    for (name, config, sizes) in [
        ("small", UNetConfig::small(), vec![7000]),
        ("small, four at once", UNetConfig::small(), vec![5000; 4]),
    ] {
        for (peak, estimate) in measure(UNet::new(&config).unwrap(), &sizes) {
            assert!(estimate <= 4 * peak, "{name}: {peak} bytes in use, {estimate} estimated");
        }
    }
}
