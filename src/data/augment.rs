//! Augmentation: random mirroring, turning about +z and elastic deformation of a sample.
//!
//! Mirroring in x or y and turning about +z keep labels exactly when the direction set has the same
//! symmetry. The Fibonacci set has not: 7 to 9 % of the labels of head 1 change (docs/training.md), because
//! many sites are accessible from one or two directions only; labels made anew ([`super::online`]) are
//! right. Elastic deformation changes the geometry and keeps the labels by decree, as in the published
//! training.

use crate::data::Sample;
use crate::geom::Sites;
use crate::numeric::rng::Stream;
use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How far a sample may be turned about +z.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Turn {
    /// Not at all.
    #[default]
    None,
    /// By 0°, 90°, 180° or 270°.
    Quarter,
    /// By any angle.
    Any,
}

/// Smooth random displacement of all points.
///
/// ```
/// use deepmill::data::{Sample, augment::{Augment, Elastic}};
/// # use deepmill::{answers::SiteAnswers, geom::Sites, glam::Vec3};
/// use deepmill::rng::{Purpose, Stream};
///
/// # let points = vec![Vec3::ZERO, Vec3::new(100.0, 0.0, 0.0), Vec3::new(100.0, 0.0, 1.0)];
/// # let sites = Sites { points, normals: vec![Vec3::Z; 3], faces: vec![] };
/// # let answers = SiteAnswers::new(vec![true; 3], vec![false; 3]);
/// # let sample = Sample::new("bar", sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers);
/// // A bar of 100 mm: displacements of about 1 mm, nearly the same for sites 1 mm apart.
/// let augment = Augment::default().with_elastic(Some(Elastic::new(0.25, 0.01)));
/// let moved = augment.apply(&sample, &mut Stream::new(1, 0, 0, Purpose::Augment));
/// let shift = |i: usize| moved.sites.points[i] - sample.sites.points[i];
/// assert!(shift(1).length() > 0.0 && shift(1).length() < 6.0 && (shift(2) - shift(1)).length() < 0.3);
/// assert_eq!((&moved.sites.normals, &moved.answers), (&sample.sites.normals, &sample.answers));
/// assert!(!Elastic::new(0.0, 0.01).is_sound());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Elastic {
    /// Spacing of the random displacements, as a share of the longest box edge.
    pub spacing: f64,
    /// Standard deviation of each component, as a share of the longest box edge.
    pub magnitude: f64,
}

setters!(Elastic {
    with_spacing(spacing: f64),
    with_magnitude(magnitude: f64),
});

/// Which changes to draw.
///
/// ```
/// use deepmill::data::augment::{Augment, Elastic, Turn};
/// let augment = Augment::default().with_turn(Turn::None).with_elastic(Some(Elastic::new(0.25, 0.01)));
/// assert!(augment.elastic.unwrap().is_sound());
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Augment {
    /// Mirror in x with probability ½, and in y with probability ½.
    pub mirror: bool,
    /// Turn about +z.
    pub turn: Turn,
    /// Elastic deformation, or none.
    pub elastic: Option<Elastic>,
}

setters!(Augment {
    with_mirror(mirror: bool),
    with_turn(turn: Turn),
    with_elastic(elastic: Option<Elastic>),
});

impl Augment {
    /// `sample` changed at random by numbers from `stream`.
    pub fn apply(&self, sample: &Sample, stream: &mut Stream) -> Sample {
        let flip = |yes: bool| if yes { -1.0 } else { 1.0 };
        let mirror = match self.mirror {
            true => Vec3::new(flip(stream.chance(0.5)), flip(stream.chance(0.5)), 1.0),
            false => Vec3::ONE,
        };
        let (sin, cos) = self.turn.draw(stream);
        let map = |v: Vec3| {
            let v = v * mirror;
            Vec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)
        };
        let map_all = |sites: &Sites| Sites {
            points: sites.points.iter().map(|p| map(*p)).collect(),
            normals: sites.normals.iter().map(|n| map(*n)).collect(),
            faces: sites.faces.clone(),
        };
        let mut sites = map_all(&sample.sites);
        let mut surface = sample.surface.as_deref().map(map_all);
        let field = self.elastic.and_then(|e| e.field(&sites, surface.as_ref(), false, stream));
        if let Some(field) = field {
            let points = &mut sites.points;
            let of_surface = surface.iter_mut().flat_map(|surface| &mut surface.points);
            points.iter_mut().chain(of_surface).for_each(|p| *p += field.at(*p));
        }
        let (sites, surface) = (Arc::new(sites), surface.map(Arc::new));
        Sample { sites, surface, ..sample.clone() }
    }
}

impl Turn {
    /// Sine and cosine of a random angle.
    pub(super) fn draw(self, stream: &mut Stream) -> (f32, f32) {
        match self {
            Turn::None => (0.0, 1.0),
            Turn::Quarter => [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][stream.below(4)],
            Turn::Any => {
                let (sin, cos) = libm::sincos(stream.range(0.0, std::f64::consts::TAU));
                (sin as f32, cos as f32)
            }
        }
    }
}

impl Elastic {
    /// With this spacing and magnitude.
    pub fn new(spacing: f64, magnitude: f64) -> Self {
        Elastic { spacing, magnitude }
    }

    /// Whether both numbers are in their domain.
    pub fn is_sound(&self) -> bool {
        self.spacing > 0.0 && self.spacing <= 1.0 && (0.0..=1.0).contains(&self.magnitude)
    }

    /// Displaces sites, and those of the surface about points of space, with the normals of the displaced surface. If
    /// the part `stands`, the lowest of them keep their height.
    pub(super) fn deform(
        &self,
        sites: &mut Sites,
        surface: Option<&mut Sites>,
        stands: bool,
        stream: &mut Stream,
    ) {
        let Some(field) = self.field(sites, surface.as_deref(), stands, stream) else { return };
        for sites in std::iter::once(sites).chain(surface) {
            for (p, n) in sites.points.iter().zip(&mut sites.normals) {
                // A surface element with normal n gets the normal J⁻ᵀ n; J = 1 + the field's derivative.
                let jacobian = Mat3::IDENTITY + field.derivative(*p);
                *n = (jacobian.inverse().transpose() * *n).try_normalize().unwrap_or(*n);
            }
            sites.points.iter_mut().for_each(|p| *p += field.at(*p));
        }
    }

    /// Smoothed normal noise on a grid over the box of the points and the surface, to be interpolated trilinearly; none
    /// if that is a point.
    fn field(
        &self,
        sites: &Sites,
        surface: Option<&Sites>,
        stands: bool,
        stream: &mut Stream,
    ) -> Option<Field> {
        let points = sites.points.iter().chain(surface.into_iter().flat_map(|s| &s.points));
        let low = points.clone().copied().reduce(Vec3::min)?;
        let high = points.copied().reduce(Vec3::max)?;
        let longest = (high - low).max_element();
        let cell = (self.spacing as f32 * longest).max(longest / 64.0);
        let draw = || NoiseGrid::draw(low, high, cell, self.magnitude as f32 * longest, stream);
        (cell > 0.0).then(draw).map(|noise| Field { low, cell, stands, noise })
    }
}

/// Displacement of every point of space.
struct Field {
    low: Vec3,
    cell: f32,
    /// Whether the part stands: heights change less and less towards the lowest site, from a cell above it on.
    stands: bool,
    noise: NoiseGrid,
}

impl Field {
    fn at(&self, p: Vec3) -> Vec3 {
        let place = (p - self.low) / self.cell;
        let moved = self.noise.at(place);
        match self.stands {
            true => moved * Vec3::new(1.0, 1.0, place.z.clamp(0.0, 1.0)),
            false => moved,
        }
    }

    /// By central differences over a quarter of a cell.
    fn derivative(&self, p: Vec3) -> Mat3 {
        let step = 0.125 * self.cell;
        let along =
            |axis: Vec3| (self.at(p + step * axis) - self.at(p - step * axis)) / (2.0 * step);
        Mat3::from_cols(along(Vec3::X), along(Vec3::Y), along(Vec3::Z))
    }
}

/// Random displacements at the corners of a grid.
struct NoiseGrid {
    size: [usize; 3],
    values: Vec<Vec3>,
}

impl NoiseGrid {
    fn draw(low: Vec3, high: Vec3, cell: f32, sigma: f32, stream: &mut Stream) -> Self {
        let size = ((high - low) / cell).to_array().map(|cells| cells as usize + 2);
        let n = size.iter().product();
        let mut normal = || stream.normal() as f32;
        let values = (0..n).map(|_| Vec3::new(normal(), normal(), normal()) * sigma).collect();
        NoiseGrid { size, values }.smoothed()
    }

    /// One pass of the mean over each corner and its neighbors along every axis, rescaled so that
    /// inner corners keep their standard deviation: three means of three shrink it by 27^½.
    fn smoothed(mut self) -> Self {
        let strides = [self.size[1] * self.size[2], self.size[2], 1];
        for (axis, stride) in strides.into_iter().enumerate() {
            let old = self.values.clone();
            for (i, value) in self.values.iter_mut().enumerate() {
                let place = i / stride % self.size[axis];
                let before = if place > 0 { old[i - stride] } else { old[i] };
                let after = if place + 1 < self.size[axis] { old[i + stride] } else { old[i] };
                *value = (before + old[i] + after) * (1.0 / 3f32.sqrt());
            }
        }
        self
    }

    /// Displacement at `x`, in cells from the grid's first corner.
    fn at(&self, x: Vec3) -> Vec3 {
        let base: [usize; 3] =
            std::array::from_fn(|a| (x[a].max(0.0) as usize).min(self.size[a] - 2));
        let mut sum = Vec3::ZERO;
        for corner in 0..8usize {
            let bit = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
            let [i, j, k]: [usize; 3] = std::array::from_fn(|a| base[a] + bit[a]);
            let weight = (0..3).map(|a| {
                let t = x[a] - base[a] as f32;
                if bit[a] == 1 { t } else { 1.0 - t }
            });
            sum += self.values[(i * self.size[1] + j) * self.size[2] + k] * weight.product::<f32>();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::SiteAnswers;
    use crate::numeric::rng::Purpose;
    use crate::tool::cutter::CutterParams;

    fn sample() -> Sample {
        let points = (0..500).map(|i| {
            let t = i as f32;
            Vec3::new(t % 10.0, (t / 10.0).floor() % 10.0, (t / 100.0).floor()) * 3.0
        });
        let points: Vec<Vec3> = points.collect();
        let normals = vec![Vec3::new(0.6, 0.0, 0.8); points.len()];
        let n = points.len();
        Sample {
            surface: None,
            name: "grid".into(),
            sites: Arc::new(Sites { points, normals, faces: vec![] }),
            cutter: CutterParams { cr_mm: 1.0, ch_mm: 1.0, fr_mm: 5.0, fh_mm: 1.0 },
            answers: SiteAnswers::new(vec![false; n], vec![true; n]),
        }
    }

    fn stream(i: u64) -> Stream {
        Stream::new(3, 0, i, Purpose::Augment)
    }

    #[test]
    fn no_augmentation_changes_no_bit() {
        let before = sample();
        let after = Augment::default().apply(&before, &mut stream(0));
        assert_eq!(before.sites, after.sites);
    }

    #[test]
    fn turning_and_mirroring_keep_distances_and_heights() {
        let before = sample();
        let augment = Augment { mirror: true, turn: Turn::Any, elastic: None };
        let mut seen = std::collections::HashSet::new();
        for i in 0..20 {
            let after = augment.apply(&before, &mut stream(i));
            seen.insert(after.sites.points[7].x.to_bits());
            for j in 0..before.sites.len() {
                let (p, q) = (before.sites.points[j], after.sites.points[j]);
                assert_eq!(p.z, q.z);
                assert!((p.length() - q.length()).abs() < 1e-4);
                let angle = |s: &Sites| s.points[j].dot(s.normals[j]);
                assert!((angle(&before.sites) - angle(&after.sites)).abs() < 1e-4);
            }
        }
        assert_eq!(seen.len(), 20);
    }

    #[test]
    fn elastic_displacement_has_the_size_asked_for_and_is_smooth() {
        let before = sample();
        let elastic = Elastic { spacing: 0.1, magnitude: 0.01 };
        let augment = Augment { elastic: Some(elastic), ..Augment::default() };
        let (mut square, mut step, mut n) = (0.0, 0.0, 0.0);
        for i in 0..20 {
            let after = augment.apply(&before, &mut stream(i));
            let moved = |j: usize| after.sites.points[j] - before.sites.points[j];
            for j in 0..499 {
                square += f64::from(moved(j).length_squared()) / 3.0;
                step += f64::from((moved(j + 1) - moved(j)).length_squared()) / 3.0;
                n += 1.0;
            }
        }
        // The longest edge is 27 mm; interpolation between corners and the kept edges shift it a little.
        let sigma = (square / n).sqrt() / 27.0;
        assert!((0.006..0.016).contains(&sigma), "{sigma}");
        assert!(step < 1.2 * square, "neighbors move together: {step} against {square}");
    }

    #[test]
    fn deformed_sites_have_the_normals_of_the_deformed_surface() {
        let elastic = Elastic { spacing: 0.3, magnitude: 0.02 };
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let (u, v) = (Vec3::Y, normal.cross(Vec3::Y));
        // Triples on planes: a point and two neighbors; corners of the box come first.
        let mut points = vec![Vec3::ZERO, Vec3::splat(40.0)];
        let grid =
            (0..200).map(|i| Vec3::new((i % 10) as f32, (i / 10) as f32, 7.0 + (i % 7) as f32));
        points.extend(grid.flat_map(|p| [2.0 * p, 2.0 * p + 0.05 * u, 2.0 * p + 0.05 * v]));
        let before = Sites { normals: vec![normal; points.len()], points, faces: vec![] };
        let mut after = before.clone();
        elastic.deform(&mut after, None, false, &mut stream(1));
        let mut turned = 0.0f32;
        let mut errors = Vec::new();
        for i in (2..after.len()).step_by(3) {
            let p = &after.points[i..i + 3];
            let exact = (p[2] - p[0]).cross(p[1] - p[0]).normalize();
            let exact = exact * exact.dot(normal).signum();
            errors.push(exact.angle_between(after.normals[i]));
            turned = turned.max(exact.angle_between(normal));
        }
        errors.sort_by(f32::total_cmp);
        // Near cell borders, where the field has a kink, differences see both sides.
        assert!(errors[errors.len() / 2] < 0.02 && turned > 0.1, "{errors:?}, {turned}");
        // The same sites as points of space, with some of them as the surface: one displacement of all.
        let mut space = Sites { normals: vec![], ..before.clone() };
        let part = |sites: &Sites| Sites {
            points: sites.points[2..60].to_vec(),
            normals: sites.normals[2..60].to_vec(),
            faces: vec![],
        };
        let mut surface = part(&before);
        elastic.deform(&mut space, Some(&mut surface), false, &mut stream(1));
        assert_eq!((space.points, surface), (after.points.clone(), part(&after)));
    }
}
