//! The files of a parity fixture: configuration, weights, input and expected tensors.

use super::tensor;
use crate::model::Model;
use crate::model::heads::N_CLASSES;
use crate::model::weights::{self, tensors::TensorFile};
use crate::octree::Cloud;
use crate::storage::input_file;
use crate::{Error, Result};
use glam::Vec3;
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};

const CONFIG: &str = "config.json";
const WEIGHTS: &str = "weights.safetensors";
const INPUT: &str = "input.safetensors";
pub(super) const EXPECTED: &str = "expected.safetensors";
pub(super) const OPS: &str = "ops.safetensors";

/// Everything a fixture folder holds.
pub(super) struct Fixture {
    pub config: Config,
    pub model: Model<f32>,
    pub expected: TensorFile,
    pub ops: Option<TensorFile>,
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Points of each shape.
    pub shapes: Vec<Range<usize>>,
    pub cutters: Vec<[f64; 4]>,
    /// Targets of both heads; `None` if the fixture has no training tensors.
    pub labels: Option<[Vec<u8>; 2]>,
}

/// What `config.json` states beyond the weights.
#[derive(Debug, Deserialize)]
pub(super) struct Config {
    pub depth: usize,
    pub full_depth: usize,
    #[serde(default)]
    nempty: bool,
    #[serde(default = "linear")]
    interp: String,
    #[serde(default)]
    pub dropout: f64,
    pub sgd: Option<Sgd>,
}

fn linear() -> String {
    "linear".into()
}

#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct Sgd {
    pub lr: f64,
    pub momentum: f64,
    pub weight_decay: f64,
    pub steps: usize,
}

impl Default for Sgd {
    fn default() -> Self {
        Sgd { lr: 0.1, momentum: 0.9, weight_decay: 5e-4, steps: 3 }
    }
}

impl Fixture {
    pub fn read(folder: &Path) -> Result<Self> {
        let config = read_config(&folder.join(CONFIG))?;
        let path = folder.join(WEIGHTS);
        let mut model = weights::read::<f32>(&path)?.into_octree()?;
        let mut net = model.net.config().clone();
        net.input.depth = config.depth;
        net.input.full_depth = config.full_depth;
        model.net = crate::model::UNet::new(&net)?;
        let expected = TensorFile::read(&folder.join(EXPECTED))?;
        let ops = folder.join(OPS);
        let ops = ops.exists().then(|| TensorFile::read(&ops)).transpose()?;
        let input =
            Input { path: folder.join(INPUT), file: TensorFile::read(&folder.join(INPUT))? };
        let points = input.rows("points")?.into_iter().map(vec3).collect::<Vec<_>>();
        let batch = input.integers("batch_id")?;
        let cutters = input.rows("cutter")?;
        let trains = expected.tensors.keys().any(|name| name.contains("train."));
        let labels = || Ok::<_, Error>([input.labels("labels")?, input.labels("labels_2")?]);
        let labels = if trains { Some(labels()?) } else { None };
        let fixture = Fixture {
            normals: input.rows("normals")?.into_iter().map(vec3).collect(),
            shapes: input.shapes(&batch, cutters.len())?,
            cutters,
            labels,
            config,
            model,
            expected,
            ops,
            points,
        };
        fixture.check(&input)?;
        Ok(fixture)
    }

    /// The shapes' clouds.
    pub fn clouds(&self) -> Vec<Cloud<'_>> {
        let cloud =
            |r: &Range<usize>| Cloud::new(&self.points[r.clone()], &self.normals[r.clone()]);
        self.shapes.iter().map(cloud).collect()
    }

    fn check(&self, input: &Input) -> Result<()> {
        let n = self.points.len();
        let labels = self.labels.iter().flatten().map(|l| l.len());
        if self.normals.len() == n && labels.clone().all(|l| l == n) {
            return Ok(());
        }
        input.error("normals, labels, labels_2", format!("not all of them have {n} rows"))
    }
}

fn read_config(path: &Path) -> Result<Config> {
    let text = input_file::read_text(path, input_file::LIBRARY)?;
    let remedy = "make the fixture again";
    let config: Config = serde_json::from_str(&text)
        .map_err(|e| Error::file(path, format!("line {}", e.line()), e.to_string(), remedy))?;
    if config.nempty || config.interp != "linear" || config.dropout != 0.0 {
        let found = "it uses nempty, another interpolation or dropout";
        return Err(Error::file(path, "config", found, remedy));
    }
    Ok(config)
}

struct Input {
    path: PathBuf,
    file: TensorFile,
}

impl Input {
    fn rows<const N: usize>(&self, name: &str) -> Result<Vec<[f64; N]>> {
        let tensor = tensor(&self.file, name, &self.path)?;
        if tensor.shape.len() != 2 || tensor.shape[1] != N {
            return self.error(name, format!("its shape is {:?}, not [n, {N}]", tensor.shape));
        }
        Ok(tensor.to_f64().as_chunks().0.to_vec())
    }

    fn integers(&self, name: &str) -> Result<Vec<usize>> {
        let tensor = tensor(&self.file, name, &self.path)?;
        if !tensor.is_integer() || tensor.shape.len() != 1 {
            return self.error(name, "it is not a list of integers".into());
        }
        Ok(tensor.to_f64().into_iter().map(|x| x as usize).collect())
    }

    fn labels(&self, name: &str) -> Result<Vec<u8>> {
        let labels = self.integers(name)?;
        if labels.iter().any(|&label| label >= N_CLASSES) {
            return self.error(name, "it holds other labels than 0 and 1".into());
        }
        Ok(labels.into_iter().map(|label| label as u8).collect())
    }

    fn shapes(&self, batch: &[usize], n_shapes: usize) -> Result<Vec<Range<usize>>> {
        if !batch.is_sorted() || batch.last().is_some_and(|&last| last >= n_shapes) {
            let found = format!("it does not ascend from 0 to {}", n_shapes as i64 - 1);
            return self.error("batch_id", found);
        }
        let start = |shape| batch.partition_point(|&b| b < shape);
        Ok((0..n_shapes).map(|shape| start(shape)..start(shape + 1)).collect())
    }

    fn error<R>(&self, name: &str, found: String) -> Result<R> {
        Err(Error::file(&self.path, format!("tensor {name}"), found, "make the fixture again"))
    }
}

fn vec3(p: [f64; 3]) -> Vec3 {
    Vec3::from_array(p.map(|x| x as f32))
}
