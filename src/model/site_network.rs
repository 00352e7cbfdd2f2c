//! What the networks here are to runs and the predictor, and a network whose kind is known at run time only.

use super::batch::{Batch, Shape};
use super::graph::{GraphBatch, N_FEATURES};
use super::graph_sage::{GraphSage, SavedGraphSage};
use super::network::Network;
use super::network_config::NetworkConfig;
use super::training::{SavedUNet, TrainingPass};
use super::unet::OctreeExtent;
use super::unet::UNet;
use super::{graph_sage, unet};
use crate::Result;
use crate::nn::arena::Buffer;
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Inference, Training};
use crate::numeric::rng::Stream;
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::fmt::Debug;
use std::ops::Range;

/// An encoder of shapes and cutters with two or three heads at the points, of two classes each.
pub trait SiteNetwork<T: Scalar>:
    Network<T, Batch: Debug, Saved: Debug> + Debug + Clone + Send
{
    /// The configuration it was built with.
    fn configuration(&self) -> NetworkConfig;

    /// The input for `shapes`. Where training reads a random part of it, such as some neighbors in a graph, shape `i`
    /// draws from `streams[i]`; inference has no streams and reads all.
    ///
    /// # Errors
    /// If a shape has no points, lacks what the network reads, or holds a number that is not finite.
    fn batch(&self, shapes: &[Shape], streams: Option<&mut [Stream]>) -> Result<Self::Batch>;

    /// What the network reads of each point beside the shape, `[n_points, 4]`; empty if nothing.
    fn coarse_answers<'a>(&self, _: &'a Self::Batch) -> &'a [T] {
        &[]
    }

    /// Bytes that a pass over `batch` takes from its arena, for training with the backward pass: an upper estimate.
    fn pass_bytes(&self, batch: &Self::Batch, training: bool) -> u64;
}

impl<T: Scalar> Network<T> for UNet {
    type Batch = Batch<T>;
    type Saved = SavedUNet<T>;

    fn layout(&self) -> &Layout {
        UNet::layout(self)
    }

    fn n_shapes(&self, batch: &Batch<T>) -> usize {
        batch.n_shapes()
    }

    fn logits(&self, pass: &Inference<T>, batch: &Batch<T>) -> Vec<Buffer<T>> {
        self.forward(pass, batch).logits
    }

    fn forward_train(&self, pass: &mut Training<T>, batch: &Batch<T>) -> TrainingPass<T> {
        UNet::forward_train(self, pass, batch)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        forward: TrainingPass<T>,
        dlogits: &[&[T]],
    ) {
        UNet::backward(self, pass, batch, forward, dlogits);
    }
}

impl<T: Scalar> SiteNetwork<T> for UNet {
    fn configuration(&self) -> NetworkConfig {
        NetworkConfig::Octree(self.config().clone())
    }

    fn batch(&self, shapes: &[Shape], _: Option<&mut [Stream]>) -> Result<Batch<T>> {
        Batch::new(shapes, &self.config().input)
    }

    fn coarse_answers<'a>(&self, batch: &'a Batch<T>) -> &'a [T] {
        &batch.coarse_answers
    }

    fn pass_bytes(&self, batch: &Batch<T>, training: bool) -> u64 {
        let octree = &batch.octree;
        let most = |level: &OctreeLevel| level.ranges.iter().map(Range::len).max().unwrap_or(0);
        let extent = OctreeExtent {
            n_nodes: octree.levels.iter().map(OctreeLevel::n_nodes).collect(),
            max_nodes: octree.levels.iter().map(most).collect(),
            n_points: batch.n_points(),
            n_shapes: octree.point_ranges.len(),
        };
        let c_in = self.stem.linear.c_in();
        let numbers = unet::memory(self.config(), c_in, &extent, training);
        numbers.saturating_mul(size_of::<T>() as u64)
    }
}

impl<T: Scalar> Network<T> for GraphSage {
    type Batch = GraphBatch<T>;
    type Saved = SavedGraphSage<T>;

    fn layout(&self) -> &Layout {
        GraphSage::layout(self)
    }

    fn n_shapes(&self, batch: &GraphBatch<T>) -> usize {
        batch.shapes.len()
    }

    fn logits(&self, pass: &Inference<T>, batch: &GraphBatch<T>) -> Vec<Buffer<T>> {
        self.forward(pass, batch)
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        batch: &GraphBatch<T>,
    ) -> TrainingPass<T, SavedGraphSage<T>> {
        GraphSage::forward_train(self, pass, batch)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        batch: &GraphBatch<T>,
        forward: TrainingPass<T, SavedGraphSage<T>>,
        dlogits: &[&[T]],
    ) {
        GraphSage::backward(self, pass, batch, forward, dlogits);
    }
}

impl<T: Scalar> SiteNetwork<T> for GraphSage {
    fn configuration(&self) -> NetworkConfig {
        NetworkConfig::GraphSage(self.config().clone())
    }

    fn batch(&self, shapes: &[Shape], streams: Option<&mut [Stream]>) -> Result<GraphBatch<T>> {
        GraphSage::batch(self, shapes, streams)
    }

    fn pass_bytes(&self, batch: &GraphBatch<T>, training: bool) -> u64 {
        let extent = (batch.n_points(), batch.shapes.len());
        let numbers = graph_sage::memory(self.config(), N_FEATURES, extent, training);
        numbers.saturating_mul(size_of::<T>() as u64)
    }
}

/// A network of either kind: what files hold and commands run.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum AnyNetwork {
    /// The octree network.
    Octree(Box<UNet>),
    /// GraphSAGE on the graph of the sites.
    #[doc(hidden)] // of the program
    GraphSage(Box<GraphSage>),
}

/// The input of an [`AnyNetwork`].
#[derive(Debug, Clone)]
pub enum AnyBatch<T> {
    /// For the octree network.
    Octree(Box<Batch<T>>),
    /// For GraphSAGE.
    GraphSage(Box<GraphBatch<T>>),
}

/// What the training pass of an [`AnyNetwork`] leaves for backward.
#[derive(Debug)]
pub enum AnySaved<T> {
    /// By the octree network.
    Octree(Box<SavedUNet<T>>),
    /// By GraphSAGE.
    GraphSage(Box<SavedGraphSage<T>>),
}

const OTHER_KIND: &str = "the batch of another kind of network";

impl AnyNetwork {
    /// Checks the configuration and lays out all parameters.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain.
    pub fn new(config: &NetworkConfig) -> Result<Self> {
        Ok(match config {
            NetworkConfig::Octree(config) => UNet::new(config)?.into(),
            NetworkConfig::GraphSage(config) => GraphSage::new(config)?.into(),
        })
    }

    /// The configuration it was built with.
    pub fn config(&self) -> NetworkConfig {
        match self {
            AnyNetwork::Octree(net) => net.config().clone().into(),
            AnyNetwork::GraphSage(net) => net.config().clone().into(),
        }
    }

    /// Names, shapes and places of all parameters and running statistics.
    pub fn layout(&self) -> &Layout {
        match self {
            AnyNetwork::Octree(net) => net.layout(),
            AnyNetwork::GraphSage(net) => net.layout(),
        }
    }
}

impl From<UNet> for AnyNetwork {
    fn from(net: UNet) -> Self {
        AnyNetwork::Octree(net.into())
    }
}

impl From<GraphSage> for AnyNetwork {
    fn from(net: GraphSage) -> Self {
        AnyNetwork::GraphSage(net.into())
    }
}

impl<T> TrainingPass<T, AnySaved<T>> {
    fn of<S>(pass: TrainingPass<T, S>, saved: impl FnOnce(Box<S>) -> AnySaved<T>) -> Self {
        TrainingPass { logits: pass.logits, saved: saved(Box::new(pass.saved)) }
    }
}

/// Every method but `n_shapes` panics on a batch that another kind of network has made.
impl<T: Scalar> Network<T> for AnyNetwork {
    type Batch = AnyBatch<T>;
    type Saved = AnySaved<T>;

    fn layout(&self) -> &Layout {
        AnyNetwork::layout(self)
    }

    fn n_shapes(&self, batch: &AnyBatch<T>) -> usize {
        match batch {
            AnyBatch::Octree(batch) => batch.n_shapes(),
            AnyBatch::GraphSage(batch) => batch.shapes.len(),
        }
    }

    fn logits(&self, pass: &Inference<T>, batch: &AnyBatch<T>) -> Vec<Buffer<T>> {
        match (self, batch) {
            (AnyNetwork::Octree(net), AnyBatch::Octree(batch)) => net.logits(pass, batch),
            (AnyNetwork::GraphSage(net), AnyBatch::GraphSage(batch)) => net.logits(pass, batch),
            _ => panic!("{OTHER_KIND}"),
        }
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        batch: &AnyBatch<T>,
    ) -> TrainingPass<T, AnySaved<T>> {
        match (self, batch) {
            (AnyNetwork::Octree(net), AnyBatch::Octree(batch)) => {
                TrainingPass::of(net.forward_train(pass, batch), AnySaved::Octree)
            }
            (AnyNetwork::GraphSage(net), AnyBatch::GraphSage(batch)) => {
                TrainingPass::of(net.forward_train(pass, batch), AnySaved::GraphSage)
            }
            _ => panic!("{OTHER_KIND}"),
        }
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        batch: &AnyBatch<T>,
        forward: TrainingPass<T, AnySaved<T>>,
        dlogits: &[&[T]],
    ) {
        let TrainingPass { logits, saved } = forward;
        match (self, batch, saved) {
            (AnyNetwork::Octree(net), AnyBatch::Octree(batch), AnySaved::Octree(saved)) => {
                net.backward(pass, batch, TrainingPass { logits, saved: *saved }, dlogits);
            }
            (
                AnyNetwork::GraphSage(net),
                AnyBatch::GraphSage(batch),
                AnySaved::GraphSage(saved),
            ) => {
                net.backward(pass, batch, TrainingPass { logits, saved: *saved }, dlogits);
            }
            _ => panic!("{OTHER_KIND}"),
        }
    }
}

impl<T: Scalar> SiteNetwork<T> for AnyNetwork {
    fn configuration(&self) -> NetworkConfig {
        self.config()
    }

    fn batch(&self, shapes: &[Shape], streams: Option<&mut [Stream]>) -> Result<AnyBatch<T>> {
        Ok(match self {
            AnyNetwork::Octree(net) => {
                AnyBatch::Octree(SiteNetwork::<T>::batch(&**net, shapes, streams)?.into())
            }
            AnyNetwork::GraphSage(net) => AnyBatch::GraphSage(net.batch(shapes, streams)?.into()),
        })
    }

    fn coarse_answers<'a>(&self, batch: &'a AnyBatch<T>) -> &'a [T] {
        match batch {
            AnyBatch::Octree(batch) => &batch.coarse_answers,
            AnyBatch::GraphSage(_) => &[],
        }
    }

    fn pass_bytes(&self, batch: &AnyBatch<T>, training: bool) -> u64 {
        match (self, batch) {
            (AnyNetwork::Octree(net), AnyBatch::Octree(batch)) => net.pass_bytes(batch, training),
            (AnyNetwork::GraphSage(net), AnyBatch::GraphSage(batch)) => {
                net.pass_bytes(&**batch, training)
            }
            _ => panic!("{OTHER_KIND}"),
        }
    }
}

#[cfg(test)]
mod memory_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::par;
    use crate::geom::Sites;
    use crate::model::config::InputConfig;
    use crate::model::graph_sage::GraphSageConfig;
    use crate::model::{AnyModel, Model, UNetConfig};
    use crate::nn::arena::Arena;
    use crate::numeric::rng::Purpose;
    use crate::octree::tests::sheet;
    use glam::Vec3;
    use std::ops::Range;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    fn clouds() -> Vec<(Vec<Vec3>, Vec<Vec3>)> {
        [300, 200].map(|n| sheet(n, 3)).into()
    }

    fn shapes(clouds: &[(Vec<Vec3>, Vec<Vec3>)]) -> Vec<Shape<'_>> {
        let cutters = [[1.5, 6.0, 40.0, 5.0], [1.0, 0.2, 90.0, 0.1]];
        let parts = clouds.iter().zip(cutters);
        parts.map(|((points, normals), cutter_mm)| Shape::new(points, normals, cutter_mm)).collect()
    }

    fn graph() -> Model<f32, GraphSage> {
        let config = GraphSageConfig { widths: vec![12; 3], ..GraphSageConfig::default() };
        Model::with_network(GraphSage::new(&config).unwrap(), 3)
    }

    /// Logits, gradients and running statistics of a step.
    fn step<N: SiteNetwork<f32>>(mut model: Model<f32, N>) -> [Vec<f32>; 3] {
        let clouds = clouds();
        let mut streams = [0, 1].map(|i| Stream::new(1, 0, i, Purpose::Neighbors));
        let batch = model.net.batch(&shapes(&clouds), Some(&mut streams)).unwrap();
        let (arena, mut grads) = (Arena::default(), vec![0.0; model.params.len()]);
        let pass = model.forward_train(&batch, None, &arena);
        let logits = pass.logits.iter().map(|l| l.to_vec()).collect::<Vec<_>>().concat();
        let d: Vec<f32> = (0..1000).map(|i| (i % 7) as f32 - 3.0).collect();
        model.backward(&batch, pass, &[&d, &d], &mut grads, &arena);
        assert_eq!(arena.in_use_bytes(), 0);
        [logits, grads, model.buffers]
    }

    #[test]
    fn a_network_of_any_kind_has_the_bits_of_its_own() {
        let octree = Model::<f32>::new(&UNetConfig::tiny(), 3).unwrap();
        assert!(step(octree.clone()) == step(AnyModel::from(octree)));
        let graph = graph();
        let config = graph.net.config().clone().into();
        assert!(step(graph) == step(AnyModel::of_config(&config, 3).unwrap()));
    }

    #[test]
    fn a_graph_network_has_the_same_bits_on_any_number_of_threads() {
        let [one, four] = [1, 4].map(|n| par::with_threads(n, || step(graph())).unwrap());
        assert!(one == four);
        assert!(one[1].iter().all(|g| g.is_finite()) && one[1].iter().any(|g| *g != 0.0));
    }

    #[test]
    fn gradients_of_a_graph_network_come_layer_by_layer_and_each_once() {
        let (mut model, arena, clouds) = (graph(), &Arena::default(), clouds());
        let whole = step(model.clone())[1].clone();
        let mut streams = [0, 1].map(|i| Stream::new(1, 0, i, Purpose::Neighbors));
        let batch = model.net.batch(&shapes(&clouds), Some(&mut streams)).unwrap();
        let d: Vec<f32> = (0..1000).map(|i| (i % 7) as f32 - 3.0).collect();
        let (mut seen, mut parts) = (vec![0; whole.len()], vec![0.0; whole.len()]);
        let mut update = |range: Range<usize>, grads: &mut [f32], params: &mut [f32]| {
            seen[range.clone()].iter_mut().for_each(|n| *n += 1);
            parts[range].copy_from_slice(grads);
            params.fill(f32::NAN); // a later read would make gradients NaN
        };
        let pass = model.forward_train(&batch, None, arena);
        model.backward_and_update(&batch, pass, &[&d, &d], &mut update, arena);
        assert!(seen.iter().all(|&n| n == 1));
        assert_eq!(parts, whole);
    }

    #[test]
    fn training_reads_some_neighbors_and_inference_all() {
        let (model, clouds) = (graph(), clouds());
        let mut streams = [0, 1].map(|i| Stream::new(1, 0, i, Purpose::Neighbors));
        let batch: GraphBatch<f32> = model.net.batch(&shapes(&clouds), Some(&mut streams)).unwrap();
        assert_eq!(batch.samples.len(), 3);
        assert!(batch.neighbors.iter().all(|list| list.len() == 16));
        let n_read = |sample: &crate::nn::neighbor_mean::Neighbors| sample.lists().1.len();
        assert_eq!(batch.samples.iter().map(n_read).collect::<Vec<_>>(), [5000; 3]);
        assert_ne!(batch.samples[0], batch.samples[1]);
        let all: GraphBatch<f32> = model.net.batch(&shapes(&clouds), None).unwrap();
        assert!(all.samples.is_empty());
    }

    #[test]
    fn points_without_normals_are_for_networks_that_read_none() {
        let (clouds, cutter) = (clouds(), [1.5, 6.0, 40.0, 5.0]);
        let model = |features: &str, point_normals| {
            let input = InputConfig {
                features: features.into(),
                point_normals,
                ..UNetConfig::tiny().input
            };
            Model::<f32>::new(&UNetConfig { input, ..UNetConfig::tiny() }, 1).unwrap()
        };
        let answer = |model: &Model<f32>| model.predict(&clouds[0].0, &[], cutter);
        assert_eq!(answer(&model("P", false)).unwrap().logits_occlusion.len(), 300);
        let refused = |features, point_normals| {
            answer(&model(features, point_normals)).unwrap_err().to_string()
        };
        assert!(refused("ND", false).contains("P for points without normals"));
        assert!(refused("P", true).starts_with("point_normals is true"));
        let message = graph().predict(&clouds[0].0, &[], cutter).unwrap_err().to_string();
        assert!(message.contains("0 normals for 300 vertices"), "{message}");
    }

    #[test]
    fn a_surface_is_read_beside_points_of_space_and_not_answered() {
        let (clouds, cutter) = (clouds(), [1.5, 6.0, 40.0, 5.0]);
        let (space, [surface, other]) = (&clouds[1].0, [&clouds[0], &clouds[1]].map(sites_of));
        let model = |features: &str| {
            let input = InputConfig { features: features.into(), ..UNetConfig::tiny().input };
            Model::<f32>::new(&UNetConfig { input, ..UNetConfig::tiny() }, 1).unwrap()
        };
        let answer = |model: &Model<f32>, surface: &Sites| {
            let shape = Shape::new(space, &[], cutter).with_surface(surface);
            model.predict_shape(&shape).unwrap().logits_inaccessible
        };
        let both = model("NDP");
        let [one, two] = [&surface, &other].map(|surface| answer(&both, surface));
        assert_eq!((one.len(), two.len()), (200, 200));
        assert_ne!(one, two);
        // Positions alone cannot tell the surface from the space.
        let positions = model("P");
        let alone = positions.predict(space, &[], cutter).unwrap().logits_inaccessible;
        assert_eq!(answer(&positions, &surface), alone);
        // Together as alone.
        let shape = |surface| Shape::new(space, &[], cutter).with_surface(surface);
        let input = &both.net.config().input;
        let batch = Batch::new(&[shape(&surface), shape(&other)], input).unwrap();
        assert_eq!((batch.n_points(), batch.octree.n_points()), (400, 900));
        let logits = both.logits(&batch, &Arena::default());
        let row = |i: usize| [logits[0][2 * i + 1], logits[0][2 * i]];
        assert_eq!((row(3), row(203)), (one[3], two[3]));
        let refused = |shape: Shape| both.predict_shape(&shape).unwrap_err().to_string();
        let message = refused(Shape::new(&clouds[1].0, &clouds[1].1, cutter).with_surface(&other));
        assert!(message.starts_with("normals is given, expected none"), "{message}");
        assert!(refused(Shape::new(space, &[], cutter)).contains("the part's surface"));
        let input = InputConfig { point_normals: true, ..input.clone() };
        let message = Batch::<f32>::new(&[shape(&surface)], &input).unwrap_err().to_string();
        assert!(message.starts_with("point_normals is true"), "{message}");
    }

    fn sites_of((points, normals): &(Vec<Vec3>, Vec<Vec3>)) -> Sites {
        Sites::new(points.clone(), normals.clone()).unwrap()
    }

    #[test]
    fn the_batch_of_another_kind_is_a_mistake_in_the_program() {
        let clouds = clouds();
        let mut octree = AnyModel::from(Model::<f32>::new(&UNetConfig::tiny(), 3).unwrap());
        let graph = AnyModel::<f32>::of_config(&graph().net.config().clone().into(), 3).unwrap();
        let batch = SiteNetwork::<f32>::batch(&graph.net, &shapes(&clouds), None).unwrap();
        let pass = || octree.forward_train(&batch, None, &Arena::default());
        assert!(catch_unwind(AssertUnwindSafe(pass)).is_err());
    }
}
