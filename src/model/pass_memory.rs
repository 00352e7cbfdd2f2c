//! Upper estimates of what a pass takes from its arena: a batch that does not fit is refused before the pass begins.
//!
//! ```text
//! numbers     Σ saved over all layers + the greatest workspace of a layer
//! saved       lives until the pass ends: outputs; in training also what backward reads, and gradients that wait for other layers
//! workspace   lives while a layer runs: its input as one matrix, packed weights, partial sums of gradients
//! ```
//!
//! All that any [memory policy](super::policy) saves is counted. The tests hold the estimate against the arena's peak.

use super::config::UNetConfig;
use super::cutter_modules::N_LENGTHS;
use super::graph_sage::GraphSageConfig;
use super::heads::{N_CLASSES, N_HEADS};
use crate::exec::memory::product;
use crate::exec::par;
use crate::nn::OperatorShape;

/// Memory of a pass, layer by layer, in numbers.
struct PassMemory {
    training: bool,
    n_shapes: usize,
    saved: u64,
    workspace: u64,
}

impl PassMemory {
    fn new(n_shapes: usize, training: bool) -> Self {
        PassMemory { training, n_shapes, saved: 0, workspace: 0 }
    }

    fn save(&mut self, n: u64) {
        self.saved = self.saved.saturating_add(n);
    }

    fn use_workspace(&mut self, n: u64) {
        self.workspace = self.workspace.max(n);
    }

    fn run(&mut self, operator: OperatorShape) {
        self.use_workspace(operator.workspace(self.n_shapes, self.training));
    }

    /// An operator whose output lasts, before and after its norm if it is for training.
    fn layer(&mut self, operator: OperatorShape) {
        self.run(operator);
        self.save(operator.output_len().saturating_mul(if self.training { 2 } else { 1 }));
    }

    /// Residual blocks on `n` rows.
    fn blocks(&mut self, n: usize, n_blocks: usize, c_in: usize, c: usize) {
        let shortcut = OperatorShape::linear(n, c_in, c);
        self.run(OperatorShape::convolution(n, c_in, c));
        self.run(OperatorShape::convolution(n, c, c));
        self.run(shortcut);
        // Before each norm, and the sum; in inference each block's output replaces that of the one before.
        let n_saved = if self.training { 3 * n_blocks + usize::from(c_in != c) } else { 1 };
        self.save(product([n, c, n_saved]));
    }

    /// Attention between the nodes of each shape, `n` in all, at most `max_nodes` in one.
    fn attention(&mut self, n: usize, max_nodes: usize, c: usize, n_heads: usize) {
        let at_once = par::threads().min(n_heads.saturating_mul(self.n_shapes));
        let squares = if self.training { 5 } else { 1 };
        let of_heads = product([at_once, max_nodes, squares * max_nodes + 8 * (c / n_heads)]);
        let rows = product([n, if self.training { 12 } else { 6 }, c]);
        self.use_workspace(of_heads.saturating_add(rows));
        self.layer(OperatorShape::linear(n, c, 3 * c));
        self.layer(OperatorShape::linear(n, c, c));
    }

    fn heads(&mut self, n_heads: usize, n_points: usize, c: usize, width: usize) {
        for _ in 0..n_heads {
            self.run(OperatorShape::linear(n_points, c, width));
            self.run(OperatorShape::linear(n_points, width, N_CLASSES));
            let n_saved = if self.training { width } else { 0 };
            self.save(product([n_points, N_CLASSES + n_saved]));
        }
    }

    /// Cutter modules of these widths.
    fn cutters(&mut self, n_modules: usize, hidden_width: usize, width: usize) {
        for _ in 0..n_modules {
            for (c_in, c) in [(N_LENGTHS, hidden_width), (hidden_width, width)] {
                self.layer(OperatorShape::linear(self.n_shapes, c_in, c));
                // Rectified, dropped out, their gradients.
                self.save(product([self.n_shapes, c, 4]));
            }
        }
    }

    /// All numbers; an arena holds up to an eighth more than what is in use.
    fn numbers(self) -> u64 {
        let sum = self.saved.saturating_add(self.workspace);
        sum.saturating_add(sum / 8)
    }
}

/// What a batch of octrees is made of.
pub(super) struct OctreeExtent {
    /// Nodes of each depth, over all shapes.
    pub n_nodes: Vec<usize>,
    /// Most nodes of a shape in each depth.
    pub max_nodes: Vec<usize>,
    pub n_points: usize,
    pub n_shapes: usize,
}

/// Numbers of a pass of the octree network with `c_in` columns of features.
pub(super) fn of_octree(
    config: &UNetConfig,
    c_in: usize,
    of: &OctreeExtent,
    training: bool,
) -> u64 {
    let (depth, n) = (config.input.depth, config.encoder_widths.len());
    let mut pass = PassMemory::new(of.n_shapes, training);
    let mut c = config.stem_width;
    pass.layer(OperatorShape::convolution(of.n_nodes[depth], c_in, c));
    let mut skips = vec![c];
    for (i, (&width, &n_blocks)) in
        config.encoder_widths.iter().zip(&config.encoder_blocks).enumerate()
    {
        let [n_in, n_out] = [depth - i, depth - 1 - i].map(|d| of.n_nodes[d]);
        pass.layer(OperatorShape { n_in, n_out, c_in: c, c_out: width, n_offsets: 8 });
        pass.blocks(n_out, n_blocks, width, width);
        // The gradient of what skips to the decoder.
        pass.save(if training { product([n_in, c]) } else { 0 });
        c = width;
        skips.push(c);
    }
    let cutter = &config.cutter;
    pass.cutters(n, cutter.hidden_width, cutter.width);
    let mut skips = skips.into_iter().rev().skip(1);
    for (i, (&width, &n_blocks)) in
        config.decoder_widths.iter().zip(&config.decoder_blocks).enumerate()
    {
        let d = depth + 1 + i - n;
        let [n_in, n_out] = [d - 1, d].map(|d| of.n_nodes[d]);
        pass.layer(OperatorShape { n_in, n_out, c_in: c, c_out: width, n_offsets: 8 });
        let c_cutter = if config.sees_cutter(i) { cutter.width } else { 0 };
        let joined = skips.next().unwrap_or_default() + c_cutter + width;
        pass.blocks(n_out, n_blocks, joined, width);
        if config.attention.depths.contains(&d) {
            pass.attention(n_out, of.max_nodes[d], width, config.attention.n_heads);
        }
        c = width;
    }
    // Features at the points; with the gradients by them and by the nodes.
    pass.save(product([of.n_points, c, if training { 2 } else { 1 }]));
    pass.use_workspace(product([of.n_nodes[depth], c, 3]));
    let c = c + config.input.n_point_channels();
    pass.heads(config.n_heads(), of.n_points, c, config.head_width);
    pass.numbers()
}

/// Numbers of a pass of the graph network.
pub(super) fn of_graph(
    config: &GraphSageConfig,
    c_in: usize,
    (n, n_shapes): (usize, usize),
    training: bool,
) -> u64 {
    let mut pass = PassMemory::new(n_shapes, training);
    pass.cutters(config.widths.len(), config.cutter.hidden_width, config.cutter.width);
    let mut c = c_in;
    for &width in &config.widths {
        let own = c + config.cutter.width;
        let operator = OperatorShape::linear(n, 2 * own, width);
        pass.layer(operator);
        let gathered = product([n, own, 2]);
        if training {
            pass.save(gathered.saturating_add(product([n, c])));
            pass.use_workspace(
                operator.workspace(n_shapes, true).saturating_add(gathered.saturating_mul(2)),
            );
        } else {
            pass.use_workspace(operator.workspace(n_shapes, false).saturating_add(gathered));
        }
        c = width;
    }
    pass.heads(N_HEADS, n, c, config.head_width);
    pass.numbers()
}

#[cfg(test)]
mod tests {
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
            clouds.iter().map(|(points, normals)| Shape { points, normals, cutter_mm }).collect();
        let streams =
            |purpose| (0..shapes.len()).map(move |i| Stream::new(1, 0, i as u64, purpose));
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
}
