//! `deepmill gradcheck`: its table, its exit codes, and fixtures that another implementation can rebuild.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, json};
use deepmill::gradcheck::fixture::METADATA_KEY;
use deepmill::model::weights::tensors::TensorFile;
use deepmill::nn::arena::Arena;
use deepmill::nn::conv::OctreeConv;
use deepmill::nn::layer::Layer;
use deepmill::nn::operand::Operand;
use deepmill::nn::params::Layout;
use deepmill::nn::pass::{Backward, Training};
use deepmill::octree::KernelMap;
use serde_json::Value;
use std::path::Path;

const NAMES: [&str; 3] = ["linear", "batch_norm", "octree_conv"];

fn run(folder: &Folder, out: &str, more: &[&str]) -> Value {
    let out = folder.path(out);
    let layers = NAMES.iter().flat_map(|name| ["--layer", name]);
    let args = ["gradcheck", "--json", "--out", &out].into_iter().chain(layers);
    json(&deepmill(&args.chain(more.iter().copied()).collect::<Vec<_>>()))
}

struct File(TensorFile);

impl File {
    fn read(path: &str) -> Self {
        File(TensorFile::read(Path::new(path)).unwrap())
    }

    fn get(&self, name: &str) -> Vec<f64> {
        self.0.tensors[name].to_f64()
    }

    fn require(&self, name: &str, computed: &[f64]) {
        let recorded = self.get(name);
        assert_eq!(recorded.len(), computed.len(), "{name}");
        for (a, b) in recorded.iter().zip(computed) {
            assert!((a - b).abs() <= 1e-13 * a.abs().max(1.0), "{name}: {a} {b}");
        }
    }
}

/// `a: [n, k]` times `b: [k, m]`, where an element is read through a function of row and column.
fn product(
    [n, k, m]: [usize; 3],
    a: impl Fn(usize, usize) -> f64,
    b: impl Fn(usize, usize) -> f64,
) -> Vec<f64> {
    let element = |i: usize| (0..k).map(|j| a(i / m, j) * b(j, i % m)).sum();
    (0..n * m).map(element).collect()
}

#[test]
fn cases_pass_and_their_fixtures_reproduce() {
    let folder = Folder::new();
    let result = run(&folder, "out", &[]);
    assert_eq!(result["passed"], true);
    let cases = result["cases"].as_array().unwrap();
    assert_eq!(cases.len(), NAMES.len());
    assert!(cases.iter().all(|c| c["error"].as_f64().unwrap() <= 1e-7 && c["n_checked"] != 0));
    assert!(cases.iter().all(|c| c["n_shapes"] == 4 && c["n_controls"].as_u64().unwrap() >= 4));
    assert_eq!(result["files"].as_array().unwrap().len(), NAMES.len());

    let file = File::read(&folder.path("out/linear.safetensors"));
    let about: Value = serde_json::from_str(&file.0.metadata[METADATA_KEY]).unwrap();
    assert_eq!((&about["version"], &about["case"]), (&1.into(), &"linear".into()));
    assert_eq!(about["arrays"]["input.x"]["shape"], serde_json::json!([7, 3]));
    let [x, w, b, dy] =
        ["input.x", "param.linear.weight", "param.linear.bias", "dy"].map(|name| file.get(name));
    let mut y = product([7, 3, 4], |i, k| x[3 * i + k], |k, j| w[3 * j + k]);
    y.iter_mut().enumerate().for_each(|(i, y)| *y += b[i % 4]);
    file.require("y", &y);
    file.require("grad.x", &product([7, 4, 3], |i, k| dy[4 * i + k], |k, j| w[3 * k + j]));
    let dw = product([4, 7, 3], |i, k| dy[4 * k + i], |k, j| x[3 * k + j]);
    file.require("grad.linear.weight", &dw);
    file.require("grad.linear.bias", &product([1, 7, 4], |_, _| 1.0, |k, j| dy[4 * k + j]));
}

#[test]
fn a_layer_on_the_geometry_of_a_fixture_gives_its_output_and_gradients() {
    let folder = Folder::new();
    run(&folder, "out", &[]);
    let file = File::read(&folder.path("out/octree_conv.safetensors"));
    let neigh = file.get("geometry.neigh");
    let neigh: Vec<[i32; 27]> = neigh.as_chunks().0.iter().map(|n| n.map(|i| i as i32)).collect();
    let map = KernelMap::convolution(&neigh, Vec::new());
    let (x, params) = (file.get("input.x"), file.get("param.conv.weights"));
    let (mut layout, arena) = (Layout::default(), &Arena::default());
    let conv = OctreeConv::new(&mut layout, "conv", 3, 5);
    let mut grads = vec![0.0; params.len()];
    let x = Operand::new(&x, 3);
    let mut pass = Training::new(&params, &mut [], arena);
    let (y, ()) = conv.forward_train(&mut pass, &map, x);
    let mut pass = Backward::new(&params, &mut grads, arena);
    let dx = conv.backward(&mut pass, &map, x, (), arena.copy_of(&file.get("dy"))).into_first();
    file.require("y", &y);
    file.require("grad.x", &dx);
    file.require("grad.conv.weights", &grads);
}

#[test]
fn fixtures_are_the_same_bytes_for_any_number_of_threads() {
    let folder = Folder::new();
    run(&folder, "one", &["--threads", "1"]);
    run(&folder, "three", &["--threads", "3"]);
    for name in NAMES {
        let [one, three] = ["one", "three"]
            .map(|out| std::fs::read(folder.path(&format!("{out}/{name}.safetensors"))).unwrap());
        assert!(one == three, "{name}");
    }
}

#[test]
fn an_error_above_the_limit_fails_with_code_1_and_names_the_element() {
    let output = deepmill(&["gradcheck", "--layer", "batch_norm", "--limit", "1e-18"]);
    let message = failure(&output, 1);
    assert!(message.starts_with("error: gradient of batch_norm: "), "{message}");
    assert!(message.contains("analytic") && message.contains("1e-18"), "{message}");
}

#[test]
fn unknown_layers_and_limits_fail_with_code_2() {
    let folder = Folder::new();
    let out = folder.path("out");
    let message = failure(&deepmill(&["gradcheck", "--layer", "linaer", "--out", &out]), 2);
    assert!(message.contains("--layer is linaer") && message.contains("linear, "), "{message}");
    for limit in ["-1", "NaN", "inf"] {
        let message = failure(&deepmill(&["gradcheck", "--limit", limit, "--out", &out]), 2);
        assert!(message.contains("--limit"), "{message}");
    }
    assert!(!Path::new(&out).exists());
}
