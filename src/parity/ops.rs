//! Single layers on recorded inputs: forward, backward, running statistics.

use super::fixture::{Fixture, OPS};
use super::{Tensors, tensor};
use crate::loss::CrossEntropy;
use crate::model::config::CutterConfig;
use crate::model::cutter_modules::{self, CutterModule};
use crate::model::heads::{self, Head};
use crate::model::weights::tensors::{TensorFile, Values};
use crate::nn::batch_norm::{self, BatchNorm};
use crate::nn::conv::OctreeConv;
use crate::nn::conv_transpose::OctreeUp;
use crate::nn::down::OctreeDown;
use crate::nn::interp::Interpolation;
use crate::nn::params::{Entry, Layout};
use crate::nn::residual::{self, Residual, Scratch};
use crate::nn::unit::LinearMap;
use crate::octree::Octree;
use crate::optim::Sgd;
use crate::scalar::Scalar;
use crate::{Error, Result};
use std::path::Path;

/// Runs every operation that `recorded` has, in `T`.
pub(super) fn run<T: Scalar>(
    fixture: &Fixture,
    recorded: &TensorFile,
    to: &mut Tensors,
) -> Result<()> {
    let octree = Octree::build(&fixture.clouds(), &fixture.model.net.config().input.octree())?;
    let mut names: Vec<&str> =
        recorded.tensors.keys().filter_map(|k| k.split('.').next()).collect();
    names.dedup();
    for name in names {
        let mut op = Op::<T>::new(name, recorded);
        match name {
            "conv3" => op.map(&octree.levels[4].conv, OctreeConv::new)?,
            "down" => op.map(&octree.levels[3], OctreeDown::new)?,
            "up" => {
                let weights = op.shape("weights", 3)?;
                let layer = OctreeUp::new(&mut op.layout, name, weights[2], weights[1]);
                op.linear_map(&octree.levels[3], &layer)?;
            }
            "interp" => op.interpolation(fixture, &octree)?,
            "bn_train" | "bn_eval" => op.batch_norm(name == "bn_train")?,
            "resblock" | "resblock_same" => op.residual(&octree)?,
            "fc_module" => op.cutter_module()?,
            "header" => op.head()?,
            "ce" => op.cross_entropy()?,
            "sgd" => op.sgd(fixture)?,
            _ => {
                let found = "the comparison knows no such operation";
                return Err(Error::file(OPS, format!("tensor {name}"), found, "remove it"));
            }
        }
        to.0.extend(op.results.0);
    }
    Ok(())
}

/// One operation: its recorded numbers, its layer's layout, its results.
struct Op<'a, T> {
    name: &'a str,
    recorded: &'a TensorFile,
    layout: Layout,
    results: Tensors,
    numbers: std::marker::PhantomData<T>,
}

impl<'a, T: Scalar> Op<'a, T> {
    fn new(name: &'a str, recorded: &'a TensorFile) -> Self {
        let (layout, results) = (Layout::default(), Tensors::default());
        Op { name, recorded, layout, results, numbers: std::marker::PhantomData }
    }

    fn shape(&self, part: &str, rank: usize) -> Result<Vec<usize>> {
        let name = format!("{}.{part}", self.name);
        let shape = &tensor(self.recorded, &name, Path::new(OPS))?.shape;
        if shape.len() != rank {
            let found = format!("its shape is {shape:?}");
            return Err(Error::file(
                OPS,
                format!("tensor {name}"),
                found,
                "make the fixture again",
            ));
        }
        Ok(shape.clone())
    }

    fn get(&self, part: &str) -> Result<Vec<T>> {
        let tensor = tensor(self.recorded, &format!("{}.{part}", self.name), Path::new(OPS))?;
        Ok(tensor.to_f64().into_iter().map(T::from_f64).collect())
    }

    /// The flat vector of a layer from recorded tensors; counters start at 0.
    fn gather(&self, entries: &[Entry]) -> Result<Vec<T>> {
        let mut values = Vec::new();
        for entry in entries {
            let recorded = self.recorded.tensors.get(&entry.name);
            match recorded.filter(|t| t.shape == entry.shape) {
                Some(t) => values.extend(t.to_f64().into_iter().map(T::from_f64)),
                None if entry.name.ends_with("num_batches_tracked") => values.push(T::ZERO),
                None => {
                    let found = format!("it is missing or not of shape {:?}", entry.shape);
                    let place = format!("tensor {}", entry.name);
                    return Err(Error::file(OPS, place, found, "make the fixture again"));
                }
            }
        }
        Ok(values)
    }

    fn params(&self) -> Result<Vec<T>> {
        self.gather(&self.layout.params)
    }

    fn add(&mut self, part: &str, c: usize, values: &[T]) {
        self.results.add_rows(format!("{}.{part}", self.name), c, values);
    }

    fn add_all(&mut self, kind: &str, entries: &[Entry], values: &[T]) {
        for entry in entries.iter().filter(|e| !e.name.ends_with("num_batches_tracked")) {
            let part = &entry.name[self.name.len() + 1..];
            let name = format!("{}.{kind}.{part}", self.name);
            self.results.add(name, &entry.shape, &values[entry.range.clone()]);
        }
    }

    /// Results of a trained layer: output, gradients, running statistics.
    fn finish(&mut self, y: (usize, &[T]), dx: (usize, &[T]), grads: &[T], buffers: &[T]) {
        self.add("y", y.0, y.1);
        self.add("grad.x", dx.0, dx.1);
        let layout = std::mem::take(&mut self.layout);
        self.add_all("grad", &layout.params, grads);
        self.add_all("after", &layout.buffers, buffers);
    }

    fn map<M: LinearMap>(
        &mut self,
        rows: &M::Rows,
        new: impl Fn(&mut Layout, &str, usize, usize) -> M,
    ) -> Result<()> {
        let weights = self.shape("weights", 3)?;
        let layer = new(&mut self.layout, self.name, weights[1], weights[2]);
        self.linear_map(rows, &layer)
    }

    fn linear_map<M: LinearMap>(&mut self, rows: &M::Rows, layer: &M) -> Result<()> {
        let (params, x, dy) = (self.params()?, self.get("x")?, self.get("gy")?);
        let (mut y, mut dx, mut grads) = (Vec::new(), Vec::new(), vec![T::ZERO; params.len()]);
        layer.forward(&params, rows, (&x).into(), &mut y);
        let to = Some((&mut dx).into());
        layer.backward(&params, rows, (&x).into(), &dy, to, &mut grads);
        let (c_out, c_in) = (self.shape("gy", 2)?[1], self.shape("x", 2)?[1]);
        self.finish((c_out, &y), (c_in, &dx), &grads, &[]);
        Ok(())
    }

    fn interpolation(&mut self, fixture: &Fixture, octree: &Octree) -> Result<()> {
        let (points, shapes) = (&fixture.points, &fixture.shapes);
        let layer = Interpolation::<T>::linear(octree, octree.depth(), points, shapes);
        let c = self.shape("x", 2)?[1];
        let (mut y, mut dx) = (Vec::new(), Vec::new());
        layer.forward(c, &self.get("x")?, &mut y);
        layer.backward(c, &self.get("gy")?, &mut dx);
        self.finish((c, &y), (c, &dx), &[], &[]);
        Ok(())
    }

    fn batch_norm(&mut self, train: bool) -> Result<()> {
        let c = self.shape("x", 2)?[1];
        let norm = BatchNorm::new(&mut self.layout, self.name, c);
        let (params, x, mut d) = (self.params()?, self.get("x")?, self.get("gy")?);
        let mut buffers = self.gather(&self.layout.buffers)?;
        let (mut y, mut cache) = (Vec::new(), batch_norm::Cache::default());
        let mut grads = vec![T::ZERO; params.len()];
        if train {
            norm.forward_train(&params, &mut buffers, &x, &mut y, &mut cache);
        } else {
            y.clone_from(&x);
            norm.forward(&params, &buffers, &mut y);
            cache = norm.running(&buffers);
        }
        norm.backward(&params, &x, &cache, &mut d, &mut grads);
        self.finish((c, &y), (c, &d), &grads, &buffers);
        Ok(())
    }

    fn residual(&mut self, octree: &Octree) -> Result<()> {
        let (c_in, c_out) = (self.shape("x", 2)?[1], self.shape("gy", 2)?[1]);
        let block = Residual::new(&mut self.layout, self.name, c_in, c_out);
        let (params, x, mut d) = (self.params()?, self.get("x")?, self.get("gy")?);
        let mut buffers = self.gather(&self.layout.buffers)?;
        let (mut y, mut cache) = (Vec::new(), residual::Cache::default());
        let (mut dx, mut grads) = (Vec::new(), vec![T::ZERO; params.len()]);
        let (rows, scratch) = (&octree.levels[3].conv, &mut Scratch::default());
        block.forward_train(&params, &mut buffers, rows, &x, &mut y, &mut cache, scratch);
        let to = (&mut dx).into();
        block.backward(&params, rows, &x, &y, &mut cache, &mut d, to, &mut grads, scratch);
        self.finish((c_out, &y), (c_in, &dx), &grads, &buffers);
        Ok(())
    }

    fn cutter_module(&mut self) -> Result<()> {
        let config = CutterConfig {
            hidden_width: self.shape("0.weight", 2)?[0],
            width: self.shape("4.weight", 2)?[0],
            dropout: 0.0,
            ..CutterConfig::default()
        };
        let module = CutterModule::new(&mut self.layout, self.name, &config);
        let (params, x, mut d) = (self.params()?, self.get("x")?, self.get("gy")?);
        let mut buffers = self.gather(&self.layout.buffers)?;
        let (mut y, mut cache) = (Vec::new(), cutter_modules::Cache::default());
        let (mut dx, mut grads) = (Vec::new(), vec![T::ZERO; params.len()]);
        module.forward_train(&params, &mut buffers, None, &x, &mut y, &mut cache);
        module.backward(&params, &x, &cache, &mut d, Some(&mut dx), &mut grads);
        self.finish((config.width, &y), (cutter_modules::N_LENGTHS, &dx), &grads, &buffers);
        Ok(())
    }

    fn head(&mut self) -> Result<()> {
        let weight = self.shape("0.conv.linear.weight", 2)?;
        let head = Head::new(&mut self.layout, self.name, weight[1], weight[0]);
        let (params, x, dy) = (self.params()?, self.get("x")?, self.get("gy")?);
        let mut buffers = self.gather(&self.layout.buffers)?;
        let (mut y, mut cache) = (Vec::new(), heads::Cache::default());
        let (mut dx, mut grads) = (vec![T::ZERO; x.len()], vec![T::ZERO; params.len()]);
        let memory = &mut [Vec::new(), Vec::new()];
        head.forward_train(&params, &mut buffers, &x, &mut y, &mut cache, &mut memory[0]);
        let [hidden, memory] = memory;
        head.backward(&params, &x, &cache, &dy, &mut grads, hidden, memory);
        head.add_dx(&params, hidden, &mut dx);
        self.finish((heads::N_CLASSES, &y), (weight[1], &dx), &grads, &buffers);
        Ok(())
    }

    fn cross_entropy(&mut self) -> Result<()> {
        let labels: Vec<u8> =
            self.get("labels")?.iter().map(|label| label.to_f64() as u8).collect();
        let (logits, mut d) = (self.get("logits")?, Vec::new());
        let loss = CrossEntropy::binary().loss(&logits, &labels, 1.0, &mut d);
        self.results.insert("ce.loss", &[1], Values::F64(vec![loss]));
        self.add("grad.logits", heads::N_CLASSES, &d);
        Ok(())
    }

    fn sgd(&mut self, fixture: &Fixture) -> Result<()> {
        let settings = fixture.config.sgd.unwrap_or_default();
        let mut p = self.get("p0")?;
        let (momentum, weight_decay) = (settings.momentum, settings.weight_decay);
        let (sgd, mut velocity) = (Sgd { momentum, weight_decay }, vec![T::ZERO; p.len()]);
        for step in 0..3 {
            let mut g = self.get(&format!("g{step}"))?;
            sgd.step(settings.lr, &mut g, &mut velocity, &mut p);
            self.results.add(format!("sgd.p{}", step + 1), &[p.len()], &p);
        }
        Ok(())
    }
}
