//! A batch of shapes and cutters in the form of the network's input.

use super::coarse;
use super::config::{CutterInput, InputConfig, N_COARSE};
use super::cutter_modules::N_LENGTHS;
use crate::exec::par;
use crate::geom::Sites;
use crate::geom::sites::{check_points, check_sites};
use crate::nn::interp::Interpolation;
use crate::nn::operand::Operand;
use crate::numeric::scalar::Scalar;
use crate::octree::{Cloud, CubeTransform, Features, Octree};
use crate::tool::cutter::{Cutter, CutterParams};
use crate::{Error, Result};
use glam::Vec3;
use std::borrow::Cow;

/// One shape to be judged, in millimeters.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::model::{Batch, Shape, UNetConfig};
///
/// let points = [Vec3::ZERO, Vec3::new(30.0, 0.0, 0.0)];
/// let shape = Shape::new(&points, &[Vec3::Z; 2], [1.5, 6.0, 40.0, 5.0]);
/// assert_eq!(Batch::<f32>::new(&[shape], &UNetConfig::tiny().input)?.n_points(), 2);
/// let long = [Vec3::new(0.0, 0.0, 2.0); 2]; // no unit normals
/// let long = Shape::new(&points, &long, [1.5, 6.0, 40.0, 5.0]);
/// assert!(Batch::<f32>::new(&[long], &UNetConfig::tiny().input).is_err());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    pub(crate) points: &'a [Vec3],
    pub(crate) normals: &'a [Vec3],
    pub(crate) cutter_mm: [f64; N_LENGTHS],
    surface: Option<&'a Sites>,
}

impl<'a> Shape<'a> {
    /// Sites, mm, with their outward unit normals; none at all for points of the space around the part. CR, CH, FR, FH
    /// of the cutter, mm.
    pub fn new(points: &'a [Vec3], normals: &'a [Vec3], cutter_mm: [f64; N_LENGTHS]) -> Self {
        Shape { points, normals, cutter_mm, surface: None }
    }

    /// With sites of the part's surface, mm, beside points of the space around it. An octree that reads normals holds
    /// both; answers are about the points alone. One that reads positions alone leaves the surface out.
    ///
    /// ```
    /// use deepmill::{geom::Sites, glam::Vec3};
    /// use deepmill::model::{Batch, Shape, UNetConfig};
    ///
    /// let surface = Sites::new(vec![Vec3::ZERO, Vec3::X], vec![Vec3::Z; 2])?;
    /// let above = [Vec3::new(0.5, 0.0, 3.0)];
    /// let shape = Shape::new(&above, &[], [1.5, 6.0, 40.0, 5.0]).with_surface(&surface);
    /// let input = UNetConfig::tiny().input; // reads normals
    /// assert_eq!(Batch::<f32>::new(&[shape], &input)?.n_points(), 1);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn with_surface(self, surface: &'a Sites) -> Self {
        Shape { surface: Some(surface), ..self }
    }

    /// What the octree holds, in mm: the points, then the sites of the surface if it reads normals. Points of space
    /// have normals of length 0 beside a surface.
    fn seen(&self, features: Features) -> (Cow<'a, [Vec3]>, Cow<'a, [Vec3]>) {
        match self.surface.filter(|_| features.needs_normals()) {
            None => (self.points.into(), self.normals.into()),
            Some(surface) => {
                let none = vec![Vec3::ZERO; self.points.len()];
                let points = [self.points, &surface.points].concat();
                (points.into(), [&none, &surface.normals[..]].concat().into())
            }
        }
    }

    /// Checks that a network can say something about the shape: sites that are somewhere, unit normals or none,
    /// and a cutter.
    ///
    /// # Errors
    /// Names what is wrong.
    pub(super) fn check(&self) -> Result<()> {
        match self.normals {
            [] => check_points("point", self.points)?,
            normals => check_sites("site", self.points, normals)?,
        }
        if let Some(surface) = self.surface {
            surface.check()?;
            if !self.normals.is_empty() {
                let (found, expected) =
                    ("given", "none for points of space, which a surface is for");
                let remedy = "leave out the normals of the points, or the surface";
                return Err(Error::argument("normals", found, expected, remedy));
            }
        }
        Cutter::ball_end(CutterParams::from_array(self.cutter_mm)).map(drop)
    }
}

/// Several shapes, ready for the network.
///
/// The logits of a shape do not depend on the others of its batch:
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::model::{Batch, Model, Shape, UNetConfig};
/// use deepmill::nn::arena::Arena;
///
/// let (config, arena) = (UNetConfig::tiny(), Arena::default());
/// let points = [Vec3::ZERO, Vec3::new(30.0, 0.0, 0.0), Vec3::new(0.0, 20.0, 10.0)];
/// let one = Shape::new(&points, &[Vec3::Z; 3], [1.5, 6.0, 40.0, 5.0]);
/// let other = Shape::new(&points[1..], &[Vec3::X; 2], [3.0, 6.0, 40.0, 20.0]);
/// let [alone, both] = [Batch::<f32>::new(&[one], &config.input)?, Batch::new(&[one, other], &config.input)?];
/// assert_eq!((both.n_shapes(), both.n_points()), (2, 5));
/// let model = Model::new(&config, 1)?;
/// let logits = |batch| model.logits(batch, &arena)[0].to_vec(); // two for each point
/// assert_eq!(logits(&both)[..6], logits(&alone));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Batch<T> {
    /// The joint octree.
    pub octree: Octree,
    /// Features of its finest nodes, `[n_nodes, n_channels]`.
    pub features: Vec<T>,
    /// From the finest nodes to the points, shape after shape.
    pub(crate) interpolation: Interpolation<T>,
    /// Cutter lengths as the network takes them, `[n_shapes, 4]`.
    pub(crate) cutters: Vec<T>,
    /// Normals of the points for the heads, `[n_points, 3]`; empty if they do not read them.
    pub(crate) point_normals: Vec<T>,
    /// What a coarse labeling says of the points ([`InputConfig::coarse_directions`]), `[n_points, 4]`; empty if the
    /// network does not read it.
    pub(crate) coarse_answers: Vec<T>,
}

impl<T: Scalar> Batch<T> {
    /// Normalizes each shape, builds the joint octree and its features.
    ///
    /// # Errors
    /// If there are no shapes, or one has no points, lacks normals that the network reads, holds a number that is not
    /// finite, a normal that is not a unit vector, or lengths that make no cutter; if the octree would be too large.
    pub fn new(shapes: &[Shape], input: &InputConfig) -> Result<Self> {
        let _floats = par::DefaultFloats::set();
        let features = input.node_features()?;
        let (mut seen, mut cutters) = (Vec::new(), Vec::new());
        for shape in shapes {
            shape.check()?;
            let (points, normals) = shape.seen(features);
            let transform = input.normalization().transform(&points)?;
            let points: Vec<_> = points.iter().map(|&p| transform.apply(p)).collect();
            seen.push((points, normals));
            cutters.push(shape.cutter_mm.map(|mm| cutter_input(input.cutter, mm, &transform)));
        }
        let clouds: Vec<_> = seen.iter().map(|(points, n)| Cloud::new(points, n)).collect();
        let n_points: Vec<_> = shapes.iter().map(|shape| shape.points.len()).collect();
        Self::of_clouds(&clouds, &n_points, &cutters, input)
    }

    /// Like [`Batch::new`] for points that are normalized already and cutters in the network's unit.
    ///
    /// # Errors
    /// As [`Batch::new`], and if a point lies outside `[-1, 1]³`.
    ///
    /// # Panics
    /// If there are not as many cutters as clouds.
    pub fn from_normalized(
        clouds: &[Cloud],
        cutters: &[[f64; N_LENGTHS]],
        input: &InputConfig,
    ) -> Result<Self> {
        let n_points: Vec<_> = clouds.iter().map(|cloud| cloud.points.len()).collect();
        Self::of_clouds(clouds, &n_points, cutters, input)
    }

    /// Answers are about the first `n_points` of each cloud; others are of the surface.
    fn of_clouds(
        clouds: &[Cloud],
        n_points: &[usize],
        cutters: &[[f64; N_LENGTHS]],
        input: &InputConfig,
    ) -> Result<Self> {
        assert_eq!(clouds.len(), cutters.len(), "numbers of clouds and cutters differ");
        let without = |cloud: &Cloud, n| cloud.normals.is_empty() || n < cloud.points.len();
        if clouds.iter().zip(n_points).any(|(cloud, &n)| without(cloud, n)) {
            input.check_without_normals()?;
        }
        let octree = Octree::build(clouds, &input.octree())?;
        let node_features = input.node_features()?;
        let mut features = octree.features(node_features)?;
        let coarse_answers = coarse::answers(clouds, cutters, input)?;
        if !coarse_answers.is_empty() {
            features =
                coarse::append(&octree, &features, node_features.n_channels(), &coarse_answers);
        }
        let answered = || clouds.iter().zip(n_points);
        let points: Vec<Vec3> = answered().flat_map(|(c, &n)| &c.points[..n]).copied().collect();
        let ends = n_points.iter().scan(0, |end, n| {
            *end += n;
            Some(*end)
        });
        let ranges: Vec<_> = ends.zip(n_points).map(|(end, n)| end - n..end).collect();
        let normals = clouds.iter().filter(|_| input.point_normals).flat_map(|c| c.normals);
        let point_normals = normals.flat_map(|n| n.to_array());
        Ok(Batch {
            interpolation: Interpolation::linear(&octree, octree.depth(), &points, &ranges),
            features: features.into_iter().map(|f| T::from_f64(f64::from(f))).collect(),
            cutters: cutters.as_flattened().iter().map(|&c| T::from_f64(c)).collect(),
            point_normals: point_normals.map(|x| T::from_f64(f64::from(x))).collect(),
            coarse_answers: coarse_answers.into_iter().map(|x| T::from_f64(f64::from(x))).collect(),
            octree,
        })
    }

    /// What the heads read: `features: [n_points, c]`, followed by the point's normal where the network takes
    /// it.
    pub(super) fn head_inputs<'a>(&'a self, features: &'a [T], c: usize) -> Vec<Operand<'a, T>> {
        let of_points = [(&self.point_normals, 3), (&self.coarse_answers, N_COARSE)];
        let read = of_points.into_iter().filter(|(rows, _)| !rows.is_empty());
        let read = read.map(|(rows, c)| Operand::new(rows, c));
        std::iter::once(Operand::new(features, c)).chain(read).collect()
    }

    /// Number of shapes.
    pub fn n_shapes(&self) -> usize {
        self.octree.n_shapes()
    }

    /// Number of points over all shapes that answers are about.
    pub fn n_points(&self) -> usize {
        self.interpolation.n_points()
    }
}

/// Points of a normalized shape are at most 2√3 = 3.47 apart, so that a holder that is wider or a shank that is longer
/// than this collides with the same points (for CR up to 0.5): a network need not learn that.
const LONGEST: f64 = 4.0;

/// A length of a cutter in the unit that the network takes.
pub(super) fn cutter_input(unit: CutterInput, length_mm: f64, transform: &CubeTransform) -> f64 {
    match unit {
        CutterInput::Millimeters => length_mm,
        CutterInput::Scaled => (length_mm * transform.scale).min(LONGEST),
    }
}
