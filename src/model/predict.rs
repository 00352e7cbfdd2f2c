//! A network with its parameters, and its prediction for one part and one cutter.

use super::UNetConfig;
use super::batch::{Batch, Shape};
use super::cutter_modules::N_LENGTHS;
use super::domain::Domain;
use super::heads::{N_CLASSES, N_HEADS, SHARE_HEAD};
use super::network::Network;
use super::network_config::NetworkConfig;
use super::prediction::{
    Calibration, INACCESSIBLE_CLASS, OCCLUSION_CLASS, Prediction, probabilities,
};
use super::site_network::{AnyNetwork, SiteNetwork};
use super::training::{InputGradients, TrainingPass};
use super::unet::{Activations, UNet};
use crate::answers::Definition;
use crate::exec::{memory, par};
use crate::nn::arena::{Arena, Buffer};
use crate::nn::pass::{Backward, Inference, Training, Update};
use crate::numeric::rng::Stream;
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use glam::Vec3;

/// A network and its numbers; the octree U-Net unless another is named.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Model<T, N = UNet> {
    /// The description.
    pub net: N,
    /// Learned numbers, laid out as `net.layout().params` says.
    pub params: Vec<T>,
    /// Running statistics, laid out as `net.layout().buffers` says.
    pub buffers: Vec<T>,
    /// What it was trained for; `None` if that is not known.
    #[doc(hidden)] // what files of weights hold beside them
    pub domain: Option<Domain>,
    /// What its labels were about; `None` if that is not known.
    #[doc(hidden)] // what files of weights hold beside them
    pub definition: Option<Definition>,
    /// What [`Model::predict`] applies to the logits of each head, so that probabilities are frequencies; the identity
    /// unless it was [fitted](crate::train::calibration::fit).
    #[doc(hidden)] // what files of weights hold beside them
    pub calibration: [Calibration; N_HEADS],
}

/// A model of either kind of network: what files hold.
pub type AnyModel<T> = Model<T, AnyNetwork>;

impl<T: Scalar, N: Network<T>> Model<T, N> {
    /// A network with these numbers, of which nothing more is known.
    pub(crate) fn of(net: N, params: Vec<T>, buffers: Vec<T>) -> Self {
        let calibration = [Calibration::IDENTITY; N_HEADS];
        Model { net, params, buffers, domain: None, definition: None, calibration }
    }

    /// What it was trained for, if that is known.
    pub fn domain(&self) -> Option<&Domain> {
        self.domain.as_ref()
    }

    /// `net` with random starting weights.
    pub fn with_network(net: N, seed: u64) -> Self {
        let (params, buffers) = (net.layout().init_params(seed), net.layout().init_buffers());
        Model::of(net, params, buffers)
    }

    /// Inference on a batch, see [`Network::logits`].
    pub fn logits(&self, batch: &N::Batch, arena: &Arena<T>) -> Vec<Buffer<T>> {
        let pass = Inference { params: &self.params, buffers: &self.buffers, arena };
        par::keep_workers_hot(|| self.net.logits(&pass, batch))
    }

    /// Training pass, see [`Network::forward_train`]; moves the running statistics. `dropout` holds one stream per
    /// shape, keyed by (seed, epoch, sample); `None` turns dropout off.
    pub fn forward_train(
        &mut self,
        batch: &N::Batch,
        dropout: Option<&mut [Stream]>,
        arena: &Arena<T>,
    ) -> TrainingPass<T, N::Saved> {
        let Model { net, params, buffers, .. } = self;
        par::keep_workers_hot(|| {
            net.forward_train(&mut Training { params, buffers, dropout, arena }, batch)
        })
    }

    /// Adds the gradient of a loss to `grads`, see [`Network::backward`].
    ///
    /// # Panics
    /// If there is not one gradient by logits for each head.
    pub fn backward(
        &self,
        batch: &N::Batch,
        forward: TrainingPass<T, N::Saved>,
        dlogits: &[&[T]],
        grads: &mut [T],
        arena: &Arena<T>,
    ) {
        let mut pass = Backward::new(&self.params, grads, arena);
        par::keep_workers_hot(|| self.net.backward(&mut pass, batch, forward, dlogits));
    }

    /// [`Model::backward`] without a gradient of the whole network: that of each layer goes to `update`, which may
    /// change the layer's parameters, as soon as it is whole. `update` sees every range of parameters once; its
    /// arguments are the range, the gradient by it and the parameters in it.
    ///
    /// # Panics
    /// As [`Model::backward`].
    pub fn backward_and_update(
        &mut self,
        batch: &N::Batch,
        forward: TrainingPass<T, N::Saved>,
        dlogits: &[&[T]],
        update: &mut Update<T>,
        arena: &Arena<T>,
    ) {
        let Model { net, params, .. } = self;
        let mut pass = Backward::updating(params, update, arena);
        par::keep_workers_hot(|| {
            net.backward(&mut pass, batch, forward, dlogits);
            pass.layer_done();
        });
    }
}

impl<T: Scalar, N: SiteNetwork<T>> Model<T, N> {
    /// All answers for every site of one part, in the order of `points_mm`. Logits are calibrated
    /// ([`Model::calibration`]).
    ///
    /// # Errors
    /// If there are no points, one is not finite or beyond 1 km, a normal is missing that the network reads, or is not
    /// of unit length, or the lengths make no ball-end cutter
    /// ([`Cutter::ball_end`](crate::tool::cutter::Cutter::ball_end)); if a calibration is not sound; if it does not fit
    /// into the memory.
    ///
    /// ```
    /// use deepmill::model::{Model, UNetConfig};
    /// use deepmill::glam::Vec3;
    /// let model = Model::<f32>::new(&UNetConfig::tiny(), 1)?;
    /// let (points, normals) = ([Vec3::ZERO, Vec3::X], [Vec3::Z, Vec3::Z]);
    /// let prediction = model.predict(&points, &normals, [1.5, 6.0, 40.0, 5.0])?;
    /// assert_eq!(prediction.answers().len(), 2);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn predict(
        &self,
        points_mm: &[Vec3],
        normals: &[Vec3],
        cutter_mm: [f64; N_LENGTHS],
    ) -> Result<Prediction<T>> {
        self.predict_shape(&Shape::new(points_mm, normals, cutter_mm))
    }

    /// [`Model::predict`] of a shape, such as points of the space around a part with its
    /// [surface](Shape::with_surface): an answer for each of the points.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn predict_shape(&self, shape: &Shape) -> Result<Prediction<T>> {
        let _floats = par::DefaultFloats::set();
        self.calibration.iter().try_for_each(Calibration::check)?;
        shape.check()?;
        let n_points = shape.points.len();
        let batch = self.net.batch(&[*shape], None)?;
        let remedy = format!("take fewer sites ({n_points}) or a smaller network");
        memory::require("the prediction", self.net.pass_bytes(&batch, false), remedy)?;
        let heads = self.logits(&batch, &Arena::default());
        let mut logits = heads.iter().flat_map(|head| head.iter());
        if let Some(i) = logits.position(|logit| !logit.is_finite()) {
            return Err(Error::NotFinite {
                place: format!("logits of site {}", i / N_CLASSES % n_points),
                found: "not a finite number".into(),
                remedy: "the weights are too large: train the network again".into(),
            });
        }
        let [of_first, of_second] = self.calibration;
        let rows = |logits: &[T], positive: usize, calibration: Calibration| {
            let rows = logits.as_chunks::<N_CLASSES>().0.iter();
            rows.map(|row| calibration.apply(row[1 - positive], row[positive])).collect()
        };
        Ok(Prediction {
            logits_inaccessible: rows(&heads[0], INACCESSIBLE_CLASS, of_first),
            logits_occlusion: rows(&heads[1], OCCLUSION_CLASS, of_second),
            accessible_share: heads
                .get(SHARE_HEAD)
                .map_or_else(Vec::new, |head| probabilities(head.as_chunks::<N_CLASSES>().0)),
            coarse_answers: self
                .net
                .coarse_answers(&batch)
                .as_chunks()
                .0
                .iter()
                .map(|row| row.map(|share| share.to_f64() as f32))
                .collect(),
        })
    }
}

impl<T: Scalar> Model<T> {
    /// A network with random starting weights.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain, or the parameters do not fit into the memory.
    pub fn new(config: &UNetConfig, seed: u64) -> Result<Self> {
        let net = UNet::new(config)?;
        net.layout().require_memory("the network", size_of::<T>())?;
        Ok(Model::with_network(net, seed))
    }

    /// Inference on a batch, with every intermediate result.
    #[doc(hidden)] // checked by tests
    pub fn forward(&self, batch: &Batch<T>, arena: &Arena<T>) -> Activations<T> {
        let pass = Inference { params: &self.params, buffers: &self.buffers, arena };
        par::keep_workers_hot(|| self.net.forward(&pass, batch))
    }

    /// [`Model::backward`], and the gradient by the input, see [`UNet::backward_to_inputs`].
    ///
    /// # Panics
    /// As [`Model::backward`].
    #[doc(hidden)] // checked by tests
    pub fn backward_to_inputs(
        &self,
        batch: &Batch<T>,
        forward: TrainingPass<T>,
        dlogits: &[&[T]],
        grads: &mut [T],
        arena: &Arena<T>,
    ) -> InputGradients<T> {
        let mut pass = Backward::new(&self.params, grads, arena);
        par::keep_workers_hot(|| self.net.backward_to_inputs(&mut pass, batch, forward, dlogits))
    }
}

impl<T: Scalar> AnyModel<T> {
    /// A network with random starting weights.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain, or the parameters do not fit into the memory.
    pub fn of_config(config: &NetworkConfig, seed: u64) -> Result<Self> {
        let net = AnyNetwork::new(config)?;
        net.layout().require_memory("the network", size_of::<T>())?;
        Ok(Model::with_network(net, seed))
    }

    /// The octree network.
    ///
    /// # Errors
    /// If it is another.
    pub fn into_octree(self) -> Result<Model<T>> {
        let Model { net, params, buffers, domain, definition, calibration } = self;
        match net {
            AnyNetwork::Octree(net) => {
                Ok(Model { net: *net, params, buffers, domain, definition, calibration })
            }
            AnyNetwork::GraphSage(_) => {
                let (expected, remedy) = ("an octree network", "give one that is trained as such");
                Err(Error::argument("network", "a graph network", expected, remedy))
            }
        }
    }
}

impl<T> From<Model<T>> for AnyModel<T> {
    fn from(model: Model<T>) -> Self {
        let Model { net, params, buffers, domain, definition, calibration } = model;
        Model { net: net.into(), params, buffers, domain, definition, calibration }
    }
}

#[cfg(test)]
mod tests {
    use super::super::policy::MemoryPolicy;
    use super::*;
    use crate::model::config::{CutterConfig, CutterPlacement, InputConfig};
    use crate::nn::saved::Policy;
    use crate::octree::tests::sheet;
    use std::ops::Range;

    const CUTTERS: [[f64; 4]; 3] =
        [[1.5, 6.0, 40.0, 5.0], [1.0, 0.2, 90.0, 0.1], [2.0, 20.0, 5.0, 20.0]];

    /// A network whose running statistics are not those of a fresh one.
    fn trained(config: &UNetConfig) -> Model<f32> {
        let mut model = Model::<f32>::new(config, 3).unwrap();
        let shapes: Vec<_> = [400, 300].iter().map(|&n| sheet(n, n as u64 % 7)).collect();
        let batch = Batch::new(&as_shapes(&shapes), &model.net.config().input).unwrap();
        model.forward_train(&batch, None, &Arena::default());
        model
    }

    fn model() -> Model<f32> {
        trained(&UNetConfig::tiny())
    }

    fn as_shapes(shapes: &[(Vec<Vec3>, Vec<Vec3>)]) -> Vec<Shape<'_>> {
        let parts = shapes.iter().zip(CUTTERS);
        parts.map(|((points, normals), cutter_mm)| Shape::new(points, normals, cutter_mm)).collect()
    }

    #[test]
    fn gradients_layer_by_layer_are_those_of_the_whole_and_each_comes_once() {
        let (mut model, arena) = (model(), &Arena::default());
        let shapes: Vec<_> = [300, 200].iter().map(|&n| sheet(n, 3)).collect();
        let batch = Batch::new(&as_shapes(&shapes), &model.net.config().input).unwrap();
        let dlogits = vec![0.125; 2 * batch.n_points()];
        let dlogits = [&dlogits[..]; N_HEADS];
        let mut whole = vec![0.0; model.params.len()];
        let pass = model.forward_train(&batch, None, arena);
        model.backward(&batch, pass, &dlogits, &mut whole, arena);
        let (mut seen, mut parts) = (vec![0; whole.len()], vec![0.0; whole.len()]);
        let pass = model.forward_train(&batch, None, arena);
        let mut update = |range: Range<usize>, grads: &mut [f32], params: &mut [f32]| {
            seen[range.clone()].iter_mut().for_each(|n| *n += 1);
            parts[range].copy_from_slice(grads);
            params.fill(f32::NAN); // a later read would make gradients NaN
        };
        model.backward_and_update(&batch, pass, &dlogits, &mut update, arena);
        assert!(seen.iter().all(|&n| n == 1));
        assert_eq!(parts, whole);
        assert_eq!(arena.in_use_bytes(), 0);
    }

    #[test]
    fn presets_have_the_stated_sizes() {
        let count =
            |name: &str| UNet::new(&UNetConfig::preset(name).unwrap()).unwrap().layout().n_params();
        assert_eq!(count("reference"), 43_313_668);
        assert!((1_000_000..4_000_000).contains(&count("small")), "{}", count("small"));
        assert!(count("tiny") < 500_000, "{}", count("tiny"));
        let buffers = UNet::new(&UNetConfig::reference()).unwrap();
        let layout = buffers.layout();
        assert_eq!((layout.params.len(), layout.buffers.len()), (219, 3 * 69));
    }

    fn require_the_same_alone(model: &Model<f32>, sizes: &[usize]) {
        let shapes: Vec<_> = sizes.iter().map(|&n| sheet(n, n as u64)).collect();
        let batch = Batch::new(&as_shapes(&shapes), &model.net.config().input).unwrap();
        let together = model.forward(&batch, &Arena::default());
        let ranges = &batch.octree.point_ranges;
        for ((range, (points, normals)), cutter_mm) in ranges.iter().zip(&shapes).zip(CUTTERS) {
            let alone = model.predict(points, normals, cutter_mm).unwrap();
            let of_shape = |logits: &[f32]| logits[2 * range.start..2 * range.end].to_vec();
            let first = alone.logits_inaccessible.iter().flat_map(|[no, yes]| [*yes, *no]);
            assert_eq!(first.collect::<Vec<_>>(), of_shape(&together.logits[0]));
            assert_eq!(alone.logits_occlusion.as_flattened(), of_shape(&together.logits[1]));
        }
    }

    #[test]
    fn shapes_together_and_one_by_one_give_the_same_bits() {
        let reference = UNetConfig {
            input: InputConfig { depth: 4, ..InputConfig::reference() },
            cutter: CutterConfig { width: 16, ..CutterConfig::default() },
            ..UNetConfig::tiny()
        };
        let packed = UNetConfig { normalize_empty_parents: false, ..UNetConfig::tiny() };
        let mut coarse = UNetConfig::tiny();
        coarse.input.coarse_directions = 30;
        let mut ndp = UNetConfig::tiny();
        ndp.input.features = "NDP".into();
        ndp.input.point_normals = true;
        for config in [ndp, coarse, UNetConfig::tiny(), UNetConfig::small(), reference, packed] {
            let model = trained(&config);
            require_the_same_alone(&model, &[500, 1, 40]);
            require_the_same_alone(&model, &[1]);
        }
    }

    #[test]
    fn logits_and_gradients_do_not_depend_on_the_number_of_threads() {
        let shapes: Vec<_> = [900, 700].iter().map(|&n| sheet(n, n as u64 % 5)).collect();
        let run = || {
            let mut model = model();
            let batch = Batch::new(&as_shapes(&shapes), &model.net.config().input).unwrap();
            let (arena, mut grads) = (Arena::default(), vec![0.0; model.params.len()]);
            let pass = model.forward_train(&batch, None, &arena);
            let logits = pass.logits.iter().map(|logits| logits.to_vec()).collect::<Vec<_>>();
            let d: Vec<f32> = (0..2 * batch.n_points()).map(|i| (i % 7) as f32 - 3.0).collect();
            model.backward(&batch, pass, &[&d, &d], &mut grads, &arena);
            (logits, grads, model.buffers)
        };
        let [one, four] = [1, 4].map(|n| par::with_threads(n, run).unwrap());
        assert!(one == four);
        assert!(one.1.iter().all(|g| g.is_finite()) && one.1.iter().any(|g| *g != 0.0));
    }

    /// Gradients of a step on two shapes.
    fn gradients(net: &UNet, n: usize, arena: &Arena<f32>) -> Vec<f32> {
        let shapes: Vec<_> = [n, n / 2].iter().map(|&n| sheet(n, 1)).collect();
        let (params, buffers) = (net.layout().init_params(3), net.layout().init_buffers());
        let mut model = Model::<f32>::of(net.clone(), params, buffers);
        let batch = Batch::new(&as_shapes(&shapes), &net.config().input).unwrap();
        let mut grads = vec![0.0; model.params.len()];
        let pass = model.forward_train(&batch, None, arena);
        let d: Vec<f32> = (0..2 * batch.n_points()).map(|i| (i % 7) as f32).collect();
        model.backward(&batch, pass, &[&d, &d], &mut grads, arena);
        grads
    }

    fn tiny(n_blocks: usize) -> UNetConfig {
        let mut config = UNetConfig::tiny();
        config.encoder_blocks.fill(n_blocks);
        config.decoder_blocks.fill(n_blocks);
        config
    }

    #[test]
    fn a_used_arena_gives_the_bits_of_a_fresh_one_and_all_memory_comes_back() {
        for n_blocks in [1, 2, 3] {
            let (net, used) = (UNet::new(&tiny(n_blocks)).unwrap(), Arena::default());
            for n in [700, 300, 900] {
                assert!(gradients(&net, n, &used) == gradients(&net, n, &Arena::default()));
                assert_eq!(used.in_use_bytes(), 0);
                assert!(used.reserved_bytes() <= used.peak_bytes() * 9 / 8, "{used:?}");
            }
        }
    }

    #[test]
    fn gradients_have_the_same_bits_under_every_policy_and_the_default_saves_memory() {
        let run = |policy: &MemoryPolicy| {
            let net = UNet::with_policy(&tiny(3), policy).unwrap();
            let arena = Arena::default();
            (gradients(&net, 900, &arena), arena.peak_bytes())
        };
        let [default, save, recompute] = [
            MemoryPolicy::default(),
            MemoryPolicy::uniform(Policy::Save),
            MemoryPolicy::uniform(Policy::Recompute),
        ]
        .map(|policy| run(&policy));
        assert!(default.0 == save.0 && default.0 == recompute.0);
        assert!(default.1 < save.1, "{} {}", default.1, save.1);
    }

    #[test]
    fn cutters_matter_exactly_where_modules_are_placed() {
        let (points, normals) = sheet(200, 1);
        for (placement, expected) in [(CutterPlacement::None, false), (CutterPlacement::Last, true)]
        {
            let mut config = UNetConfig::tiny();
            config.cutter.placement = placement;
            let model = Model::<f32>::new(&config, 3).unwrap();
            let [a, b, _] = CUTTERS.map(|c| model.predict(&points, &normals, c).unwrap());
            assert_eq!(a != b, expected);
        }
    }

    #[test]
    fn answers_follow_the_greater_logit() {
        let prediction = Prediction::<f64> {
            logits_inaccessible: vec![[0.0, 2.0], [1.0, 0.0], [1.0, 1.0]],
            logits_occlusion: vec![[2.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
            ..Prediction::default()
        };
        let answers = prediction.answers();
        assert_eq!(answers.inaccessible(), [true, false, false]);
        assert_eq!(answers.occlusion, [false, true, false]);
        assert_eq!(prediction.answers_ranked(0.4).occlusion, [false, true, true]);
        assert_eq!(prediction.answers_ranked(1.0).occlusion, [true; 3]);
        let p = answers.probability_inaccessible();
        assert!((p[0] - 0.880_797).abs() < 1e-6 && (p[1] - 0.268_941).abs() < 1e-6);
        assert!((answers.probability_occlusion()[0] - 0.119_203).abs() < 1e-6);
    }

    #[test]
    fn unusable_inputs_are_refused() {
        let model = Model::<f32>::new(&UNetConfig::tiny(), 1).unwrap();
        let (points, normals) = ([Vec3::ZERO, Vec3::X], [Vec3::Z, Vec3::Z]);
        let cutter = [1.5, 6.0, 40.0, 5.0];
        model.predict(&points, &normals, cutter).unwrap();
        let refused = |points: &[Vec3], normals: &[Vec3], cutter| {
            model.predict(points, normals, cutter).unwrap_err().to_string()
        };
        for (lengths, expected) in [
            ([f64::NAN, 6.0, 40.0, 5.0], "cutter radius CR is NaN"),
            ([1.5, -6.0, 40.0, 5.0], "cutter height CH is -6"),
            ([40.0, 6.0, 1.5, 5.0], "holder radius FR is 1.5"),
            ([0.0; 4], "cutter radius CR is 0"),
        ] {
            let message = refused(&points, &normals, lengths);
            assert!(message.starts_with(expected), "{message}");
        }
        for normal in [Vec3::ZERO, Vec3::splat(2.0), Vec3::NAN] {
            let message = refused(&points, &[Vec3::Z, normal], cutter);
            assert!(message.starts_with("site 1: normal"), "{message}");
        }
        for point in [Vec3::splat(1e30), Vec3::NAN, Vec3::splat(f32::INFINITY)] {
            let message = refused(&[Vec3::ZERO, point], &normals, cutter);
            assert!(message.starts_with("site 1: position"), "{message}");
        }
        assert!(refused(&points, &normals[..1], cutter).contains("1 normals for 2 sites"));
        assert!(refused(&[], &[], cutter).contains("no points"));
    }
}
