//! Single layers on recorded inputs: forward, backward, running statistics.

use super::fixture::{Fixture, OPS};
use super::{Tensors, tensor};
use crate::learn::loss::CrossEntropy;
use crate::learn::optim::Sgd;
use crate::model::config::CutterConfig;
use crate::model::cutter_modules::CutterModule;
use crate::model::heads::{self, Head};
use crate::model::policy::MemoryPolicy;
use crate::model::weights::tensors::{TensorFile, TensorValues};
use crate::nn::arena::Arena;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::conv::OctreeConv;
use crate::nn::deconv::OctreeDeconv;
use crate::nn::interp::{Interpolate, Interpolation};
use crate::nn::layer::Layer;
use crate::nn::linear_operator::LinearOperator;
use crate::nn::operand::Operand;
use crate::nn::params::{Entry, Layout};
use crate::nn::pass::{Backward, Inference, Training};
use crate::nn::residual::Residual;
use crate::nn::strided_conv::{OctreeStridedConv, OutputRows};
use crate::numeric::scalar::Scalar;
use crate::octree::Octree;
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
            "conv3" => op.operator(&octree.levels[4].conv, OctreeConv::new)?,
            "down" => op.operator(&octree.levels[3], |layout, name, c_in, c_out| {
                OctreeStridedConv::new(layout, name, c_in, c_out, OutputRows::AllNodes)
            })?,
            "up" => {
                let weights = op.shape("weights", 3)?;
                let layer = OctreeDeconv::new(&mut op.layout, name, weights[2], weights[1]);
                op.layer(&octree.levels[3], &layer)?;
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

    /// A linear operator that is made from its widths.
    fn operator<M: LinearOperator>(
        &mut self,
        geometry: &M::Geometry,
        new: impl Fn(&mut Layout, &str, usize, usize) -> M,
    ) -> Result<()> {
        let weights = self.shape("weights", 3)?;
        let layer = new(&mut self.layout, self.name, weights[1], weights[2]);
        self.layer(geometry, &layer)
    }

    /// Output, gradients and running statistics of a training pass.
    fn layer<L: Layer<T>>(&mut self, geometry: &L::Geometry, layer: &L) -> Result<()> {
        let (c_in, c_out) = (self.shape("x", 2)?[1], self.shape("gy", 2)?[1]);
        let (params, x, arena) = (self.params()?, self.get("x")?, &Arena::default());
        let (mut buffers, dy) = (self.gather(&self.layout.buffers)?, self.get("gy")?);
        let x = Operand::new(&x, c_in);
        let mut pass = Training { params: &params, buffers: &mut buffers, dropout: None, arena };
        let (y, saved) = layer.forward_train(&mut pass, geometry, x);
        let mut grads = vec![T::ZERO; params.len()];
        let mut pass = Backward::new(&params, &mut grads, arena);
        let dx = layer.backward(&mut pass, geometry, x, saved, arena.copy_of(&dy)).into_first();
        self.finish((c_out, &y), (c_in, &dx), &grads, &buffers);
        Ok(())
    }

    fn interpolation(&mut self, fixture: &Fixture, octree: &Octree) -> Result<()> {
        let (points, shapes) = (&fixture.points, &fixture.shapes);
        let map = Interpolation::<T>::linear(octree, octree.depth(), points, shapes);
        self.layer(&map, &Interpolate)
    }

    fn batch_norm(&mut self, train: bool) -> Result<()> {
        let c = self.shape("x", 2)?[1];
        let norm = BatchNorm::new(&mut self.layout, self.name, c);
        if train {
            return self.layer(&(), &norm);
        }
        let (params, x, arena) = (self.params()?, self.get("x")?, &Arena::default());
        let (buffers, dy) = (self.gather(&self.layout.buffers)?, self.get("gy")?);
        let x = Operand::new(&x, c);
        let pass = Inference { params: &params, buffers: &buffers, arena };
        let y = norm.forward(&pass, &(), x);
        let mut grads = vec![T::ZERO; params.len()];
        let mut pass = Backward::new(&params, &mut grads, arena);
        let (running, dy) = (norm.running(&buffers), arena.copy_of(&dy));
        let dx = norm.backward(&mut pass, &(), x, running, dy).into_first();
        self.finish((c, &y), (c, &dx), &grads, &buffers);
        Ok(())
    }

    fn residual(&mut self, octree: &Octree) -> Result<()> {
        let (c_in, c_out) = (self.shape("x", 2)?[1], self.shape("gy", 2)?[1]);
        let policy = MemoryPolicy::default().blocks.block;
        let block = Residual::new(&mut self.layout, self.name, c_in, c_out, policy);
        self.layer(&octree.levels[3].conv, &block)
    }

    fn cutter_module(&mut self) -> Result<()> {
        let config = CutterConfig {
            hidden_width: self.shape("0.weight", 2)?[0],
            width: self.shape("4.weight", 2)?[0],
            dropout: 0.0,
            ..CutterConfig::default()
        };
        let module = CutterModule::new(&mut self.layout, self.name, &config)?;
        self.layer(&(), &module)
    }

    fn head(&mut self) -> Result<()> {
        let weight = self.shape("0.conv.linear.weight", 2)?;
        let policy = MemoryPolicy::default().head;
        let head = Head::new(&mut self.layout, self.name, weight[1], weight[0], policy);
        self.layer(&(), &head)
    }

    fn cross_entropy(&mut self) -> Result<()> {
        let labels: Vec<u8> =
            self.get("labels")?.iter().map(|label| label.to_f64() as u8).collect();
        let (logits, mut d) = (self.get("logits")?, Vec::new());
        let loss = CrossEntropy::binary().loss(&logits, &labels, 1.0, &mut d);
        self.results.insert("ce.loss", &[1], TensorValues::F64(vec![loss]));
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
