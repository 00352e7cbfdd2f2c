//! `deepmill bench layers`: time and efficiency of every kind of layer of the network.

use super::input::{self, median_seconds};
use crate::output::Output;
use deepmill::Result;
use deepmill::model::{Batch, UNetConfig};
use deepmill::nn::arena::Arena;
use deepmill::nn::column_norm::Epilogue;
use deepmill::nn::conv::OctreeConv;
use deepmill::nn::deconv::OctreeDeconv;
use deepmill::nn::linear_operator::LinearOperator;
use deepmill::nn::operand::Operand;
use deepmill::nn::params::Layout;
use deepmill::nn::pass::{Backward, Context};
use deepmill::nn::strided_conv::{OctreeStridedConv, OutputRows};
use deepmill::par;
use deepmill::scalar;
use deepmill::simd::Isa;
use deepmill::simd::gemm::matmul_rows;
use deepmill::tables::{Cell, Table};
use serde_json::json;

/// Time every kind of layer, forward and backward, against this machine's own matrix product.
///
/// Useful operations count neither missing neighbors nor columns that are constant over a shape.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill bench layers --batch 8 --threads 2")]
pub struct Args {
    #[command(flatten)]
    input: input::Args,
}

/// One kind of layer, and how often the network has it.
struct Layer {
    name: String,
    count: usize,
    kind: Kind,
    /// Depth of its output.
    depth: usize,
    c_in: Vec<usize>,
    c_out: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Stem,
    Conv,
    /// A convolution of three operands side by side, the second constant over a shape.
    Concatenated,
    Down,
    Up,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let config = args.input.config()?;
    let batch = input::batch(&args.input.clouds()?, &config)?;
    let isa = scalar::simd_isa()?.name();
    let peak = peak(args.input.seconds);
    output.say(format!(
        "{isa}, {} threads, own matrix product {peak:.1} GFLOP/s; batch of {} shapes",
        par::threads(),
        batch.n_shapes()
    ));
    let mut table = Table::new(&[
        ("layer", "layer"),
        ("count", "count"),
        ("rows", "rows"),
        ("gflop", "useful GFLOP"),
        ("forward_ms", "forward ms"),
        ("forward_gflops", "GFLOP/s"),
        ("forward_share", "of product"),
        ("backward_ms", "backward ms"),
        ("backward_gflops", "GFLOP/s"),
        ("backward_share", "of product"),
    ]);
    let (mut work, mut times) = ([0.0; 2], [0.0; 2]);
    for layer in layers(&config, batch.features.len() / batch.octree.finest().n_nodes()) {
        let passes = layer.measure(&batch, args.input.seconds / 4.0);
        let rows = batch.octree.levels[layer.depth].n_nodes();
        let mut cells = vec![Cell::text(layer.name), Cell::count(layer.count), Cell::count(rows)];
        cells.push(Cell::Number(passes[0].0));
        for (pass, (gflop, seconds)) in passes.into_iter().enumerate() {
            let rate = gflop / seconds;
            cells.extend([
                Cell::Number(1e3 * seconds),
                Cell::Number(rate),
                Cell::Share(rate / peak),
            ]);
            work[pass] += layer.count as f64 * gflop;
            times[pass] += layer.count as f64 * seconds;
        }
        table.row(cells);
    }
    output.say(table.text());
    for (pass, (work, seconds)) in ["forward", "backward"].iter().zip(work.iter().zip(times)) {
        let rate = work / seconds;
        output.say(format!(
            "all of these, {pass}: {work:.1} GFLOP in {seconds:.3} s, {rate:.1} GFLOP/s, {:.0} % of \
             the product",
            100.0 * rate / peak
        ));
    }
    output.result(&json!({
        "isa": isa, "threads": par::threads(), "product_gflops": peak, "layers": table.json(),
        "gflop": work, "seconds": times,
    }));
    Ok(())
}

/// GFLOP/s of the machine's own product of 256 columns, on all threads at once.
fn peak(seconds: f64) -> f64 {
    const SIZE: usize = 256;
    const REPEATS: usize = 8;
    let numbers = |n: usize| (0..n).map(|i| (i % 7) as f32 - 3.0).collect::<Vec<f32>>();
    let (a, b, n_tasks) = (numbers(SIZE * SIZE), numbers(SIZE * SIZE), par::threads());
    let rows: Vec<u32> = (0..SIZE as u32).collect();
    let (seconds, _) = median_seconds(seconds, || {
        par::map(n_tasks, |_| {
            let mut c = vec![0.0; SIZE * SIZE];
            for _ in 0..REPEATS {
                matmul_rows(Isa::active(), (&a, &rows), SIZE, &b, SIZE, (&mut c, &rows));
            }
            c[SIZE]
        });
    });
    2e-9 * (n_tasks * REPEATS * SIZE * SIZE * SIZE) as f64 / seconds
}

fn layers(config: &UNetConfig, n_features: usize) -> Vec<Layer> {
    let (finest, n) = (config.input.depth, config.encoder_widths.len());
    let layer = |name: String, count, kind, depth, c_in: &[usize], c_out| -> Layer {
        let name = format!("{name} {} to {c_out}, depth {depth}", c_in.iter().sum::<usize>());
        Layer { name, count, kind, depth, c_in: c_in.to_vec(), c_out }
    };
    let conv = |name: &str, count, depth, c_in, c_out| {
        layer(name.into(), count, Kind::Conv, depth, &[c_in], c_out)
    };
    let stem = &[n_features];
    let mut layers = vec![layer("stem".into(), 1, Kind::Stem, finest, stem, config.stem_width)];
    let mut skips = vec![config.stem_width];
    let mut c_in = config.stem_width;
    for (i, (&c, blocks)) in config.encoder_widths.iter().zip(&config.encoder_blocks).enumerate() {
        let depth = finest - 1 - i;
        layers.push(layer(format!("down {i}"), 1, Kind::Down, depth, &[c_in], c));
        layers.push(conv(&format!("encoder {i}"), 2 * blocks, depth, c, c));
        skips.push(c);
        c_in = c;
    }
    for (i, (&c, blocks)) in config.decoder_widths.iter().zip(&config.decoder_blocks).enumerate() {
        let depth = finest + 1 + i - n;
        layers.push(layer(format!("up {i}"), 1, Kind::Up, depth, &[c_in], c));
        let widths = [skips[n - 1 - i], config.cutter.width, c];
        layers.push(layer(format!("decoder {i} joined"), 1, Kind::Concatenated, depth, &widths, c));
        layers.push(conv(&format!("decoder {i}"), 2 * blocks - 1, depth, c, c));
        c_in = c;
    }
    layers
}

impl Layer {
    /// Useful GFLOP forward and backward, and the seconds of each.
    fn measure(&self, batch: &Batch<f32>, limit: f64) -> [(f64, f64); 2] {
        let mut layout = Layout::default();
        let (c_in, c_out) = (self.c_in.iter().sum(), self.c_out);
        let level = &batch.octree.levels[self.depth];
        let n = level.n_nodes();
        let gflop = |pairs: usize, c_in: usize| 2e-9 * (pairs * c_in * c_out) as f64;
        let (forward, [y, dy]) = match self.kind {
            Kind::Stem | Kind::Conv => {
                let conv = OctreeConv::new(&mut layout, "conv", c_in, c_out);
                let x = values(n * c_in);
                // The network's input needs no gradient.
                let timing = Timing { limit, to_input: self.kind == Kind::Conv };
                let work = gflop(level.conv.n_pairs(), c_in);
                (work, timing.run(&conv, &layout, &level.conv, Operand::new(&x, c_in), n * c_out))
            }
            Kind::Concatenated => {
                let conv = OctreeConv::new(&mut layout, "conv", c_in, c_out);
                let [skip, cutter, up] = self.c_in[..] else { unreachable!("three parts") };
                let shapes = &level.ranges[..];
                let x = [n * skip, shapes.len() * cutter, n * up].map(values);
                let parts = [
                    Operand::new(&x[0], skip),
                    Operand::PerShape { x: &x[1], c: cutter, shapes },
                    Operand::new(&x[2], up),
                ];
                let timing = Timing { limit, to_input: true };
                let work = gflop(level.conv.n_pairs(), skip + up);
                let x = Operand::Concat(&parts);
                (work, timing.run(&conv, &layout, &level.conv, x, n * c_out))
            }
            Kind::Down => {
                let rows = OutputRows::AllNodes;
                let down = OctreeStridedConv::new(&mut layout, "down", c_in, c_out, rows);
                let x = values(batch.octree.levels[self.depth + 1].n_nodes() * c_in);
                let timing = Timing { limit, to_input: true };
                let work = gflop(8 * level.n_nonempty(), c_in);
                (work, timing.run(&down, &layout, level, Operand::new(&x, c_in), n * c_out))
            }
            Kind::Up => {
                let up = OctreeDeconv::new(&mut layout, "up", c_in, c_out);
                let coarse = &batch.octree.levels[self.depth - 1];
                let x = values(coarse.n_nodes() * c_in);
                let timing = Timing { limit, to_input: true };
                let work = gflop(8 * coarse.n_nonempty(), c_in);
                (work, timing.run(&up, &layout, coarse, Operand::new(&x, c_in), n * c_out))
            }
        };
        let backward = if self.kind == Kind::Stem { forward } else { 2.0 * forward };
        [(forward, y), (backward, dy)]
    }
}

/// How long to measure, and whether the input's gradient belongs to backward.
struct Timing {
    limit: f64,
    to_input: bool,
}

impl Timing {
    /// Seconds forward and backward.
    fn run<M: LinearOperator>(
        &self,
        operator: &M,
        layout: &Layout,
        geometry: &M::Geometry,
        x: Operand<f32>,
        n_outputs: usize,
    ) -> [f64; 2] {
        let (params, arena) = (layout.init_params::<f32>(1), &Arena::default());
        let context = Context::new(&params, arena);
        let forward = || drop(operator.apply(context, geometry, x, Epilogue::Identity));
        let (forward, _) = median_seconds(self.limit, forward);
        let (dy, mut grads) = (values(n_outputs), vec![0.0; params.len()]);
        let (backward, _) = median_seconds(self.limit, || {
            let mut pass = Backward::new(&params, &mut grads, arena);
            match self.to_input {
                true => drop(operator.gradients(&mut pass, geometry, x, &dy)),
                false => operator.weight_gradient(&mut pass, geometry, x, &dy),
            }
        });
        [forward, backward]
    }
}

/// Numbers that are neither zero nor subnormal.
fn values(n: usize) -> Vec<f32> {
    (0..n).map(|i| (i % 23) as f32 * 0.1 - 1.05).collect()
}
