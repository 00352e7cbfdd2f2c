//! Labels on the fly: every sample of every epoch gets a new cutter, a new orientation and exact labels.
//!
//! The labeler runs inside the training loop, so turned and mirrored parts carry exact labels for any
//! direction set, and no (part, cutter) pair is ever seen twice. Everything is keyed by (seed, epoch,
//! sample): the same arguments give the same sample, whatever was drawn before. Of samples about space the sites of the
//! part's surface turn with the points, and are the obstacles.

use crate::access::{self, LabelOptions, Obstacles};
use crate::answers::SiteAnswers;
use crate::data::augment::{Elastic, Turn};
use crate::data::volume::VolumeObstacles;
use crate::data::{Sample, SampleSource};
use crate::geom::Sites;
use crate::numeric::rng::{Purpose, Stream};
use crate::tool::cutter::{Cutter, CutterParams, CutterSet};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is drawn for every sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct OnlineSettings {
    /// Where cutters are drawn from.
    pub cutter_set: CutterSet,
    /// Probability of a cutter to be drawn from [`CutterSet::Extreme`] instead, in `[0, 1]`.
    #[serde(skip_serializing_if = "is_zero")]
    pub extreme: f64,
    /// Mirror in x with probability ½.
    pub mirror: bool,
    /// Turn about +z.
    pub turn: Turn,
    /// Probability of a part to lie on one of its six sides, chosen evenly, in `[0, 1]`.
    pub sides: f64,
    /// Probability of a part to get any rotation, in `[0, 1]`; comes before the other turns.
    pub tilt: f64,
    /// Range of the largest box edge that a part is scaled to, mm, drawn log-uniformly; `None`: as in the data set.
    /// Answers depend on the ratios of the cutter's lengths to the part's alone, so this trains for cutters of all
    /// sizes, too.
    pub size_mm: Option<[f64; 2]>,
    /// Elastic deformation before labeling, or none. With a bottom rule a part keeps standing: its lowest sites keep
    /// their height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elastic: Option<Elastic>,
}

setters!(OnlineSettings {
    with_cutter_set(cutter_set: CutterSet),
    with_extreme(extreme: f64),
    with_mirror(mirror: bool),
    with_turn(turn: Turn),
    with_sides(sides: f64),
    with_tilt(tilt: f64),
    with_size_mm(size_mm: Option<[f64; 2]>),
    with_elastic(elastic: Option<Elastic>),
});

impl Default for OnlineSettings {
    /// Uniform cutters, mirroring, quarter turns, every tenth part tilted and of the others three in ten
    /// on another side.
    fn default() -> Self {
        OnlineSettings {
            cutter_set: CutterSet::Uniform,
            extreme: 0.0,
            mirror: true,
            turn: Turn::Quarter,
            sides: 0.3,
            tilt: 0.1,
            size_mm: None,
            elastic: None,
        }
    }
}

impl OnlineSettings {
    /// Whether [`OnlineSettings::size_mm`] is a range of sizes that parts may have.
    pub fn has_sound_sizes(&self) -> bool {
        self.size_mm.is_none_or(|range| is_size_range(&range))
    }

    /// Factor that brings points to a random size.
    fn scale(&self, points: &[Vec3], stream: &mut Stream) -> f32 {
        let Some([low, high]) = self.size_mm else { return 1.0 };
        let wanted = stream.log_range(low, high);
        let least = points.iter().copied().reduce(Vec3::min).unwrap_or_default();
        let greatest = points.iter().copied().reduce(Vec3::max).unwrap_or_default();
        let edge = f64::from((greatest - least).max_element());
        if edge > 0.0 { (wanted / edge) as f32 } else { 1.0 }
    }

    /// A random cutter.
    fn cutter(&self, stream: &mut Stream) -> CutterParams {
        // Where there are none, no number is drawn for them.
        let extreme = self.extreme > 0.0 && stream.chance(self.extreme);
        let set = if extreme { CutterSet::Extreme } else { self.cutter_set };
        set.draw(stream)
    }

    /// A random orthogonal matrix: a rotation, or a rotation after mirroring.
    fn orientation(&self, stream: &mut Stream) -> Mat3 {
        let mirrored = self.mirror && stream.chance(0.5);
        let mirror = Mat3::from_diagonal(Vec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0));
        if stream.chance(self.tilt) {
            return any_rotation(stream) * mirror;
        }
        let side = if stream.chance(self.sides) { SIDES[stream.below(6)] } else { Mat3::IDENTITY };
        let (sin, cos) = self.turn.draw(stream);
        let turn = Mat3::from_cols(Vec3::new(cos, sin, 0.0), Vec3::new(-sin, cos, 0.0), Vec3::Z);
        turn * side * mirror
    }
}

fn is_zero(share: &f64) -> bool {
    *share == 0.0
}

/// Whether parts may have sizes of this range, mm.
pub(super) fn is_size_range(&[low, high]: &[f64; 2]) -> bool {
    low > 0.0 && low <= high && high <= MAX_SIZE_MM
}

/// 10 m: larger parts are none that a milling cutter works on.
const MAX_SIZE_MM: f64 = 1e4;

/// Rotations that bring +z, −z, +x, −x, +y, −y up.
const SIDES: [Mat3; 6] = [
    Mat3::IDENTITY,
    Mat3::from_cols(Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z),
    Mat3::from_cols(Vec3::Z, Vec3::Y, Vec3::NEG_X),
    Mat3::from_cols(Vec3::NEG_Z, Vec3::Y, Vec3::X),
    Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y),
    Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y),
];

/// Evenly distributed: four normal numbers are a random quaternion.
fn any_rotation(stream: &mut Stream) -> Mat3 {
    let [x, y, z, w] = [0; 4].map(|_| stream.normal() as f32);
    match Quat::from_xyzw(x, y, z, w).length_recip() {
        scale if scale.is_finite() => Mat3::from_quat(Quat::from_xyzw(x, y, z, w) * scale),
        _ => Mat3::IDENTITY,
    }
}

/// Parts without labels: each sample is oriented, given a cutter and labeled when it is drawn.
#[derive(Debug, Clone)]
pub struct Online {
    /// Each with one of its samples.
    parts: Vec<Sample>,
    directions: Directions,
    options: LabelOptions,
    settings: OnlineSettings,
    seed: u64,
}

impl Online {
    /// The parts of `samples`, each once, whatever their cutters, to be labeled with these options. Points of space are
    /// labeled among the sites of their surface, by the directions alone.
    ///
    /// # Errors
    /// If there are no parts, or one is about points of space without the part's [surface](Sample::with_surface).
    pub fn new(
        samples: &[Sample],
        directions: Directions,
        options: LabelOptions,
        settings: OnlineSettings,
        seed: u64,
    ) -> Result<Self> {
        let mut parts: Vec<Sample> = Vec::new();
        for sample in samples {
            sample.check()?;
            if sample.is_volume() && sample.surface.is_none() {
                let place = format!("sample {}", sample.name);
                let found = "points of space without the part's surface, which blocks the tool";
                let remedy = "build the data set again, or give each sample its surface";
                return Err(Error::geometry(place, found, remedy));
            }
            if parts.last().is_none_or(|part| !Arc::ptr_eq(&part.sites, &sample.sites)) {
                let answers = SiteAnswers::default();
                parts.push(Sample { answers, ..sample.clone() });
            }
        }
        if parts.is_empty() {
            let remedy = "build a data set with at least one part that can be labeled";
            return Err(Error::argument("training set", "empty", "one part or more", remedy));
        }
        let options = LabelOptions { beta: false, ..options };
        Ok(Online { parts, directions, options, settings, seed })
    }
}

impl SampleSource for Online {
    fn len(&self) -> usize {
        self.parts.len()
    }

    fn sample(&self, epoch: u64, index: usize) -> Result<Sample> {
        let part = &self.parts[index];
        let stream = |purpose| Stream::new(self.seed, epoch, index as u64, purpose);
        let mut placement = stream(Purpose::Orientation);
        let turn = self.settings.orientation(&mut placement);
        let whole = part.surface.as_ref().unwrap_or(&part.sites);
        let scale = self.settings.scale(&whole.points, &mut placement);
        let place = |sites: &Sites| Sites {
            points: sites.points.iter().map(|p| turn * *p * scale).collect(),
            normals: sites.normals.iter().map(|n| turn * *n).collect(),
            faces: Vec::new(),
        };
        let (mut sites, mut surface) = (place(&part.sites), part.surface.as_deref().map(place));
        if let Some(elastic) = self.settings.elastic {
            let stands = surface.is_none() && self.options.bottom_mm.is_some();
            elastic.deform(&mut sites, surface.as_mut(), stands, &mut stream(Purpose::Augment));
        }
        let cutter = self.settings.cutter(&mut stream(Purpose::Cutter));
        let tool = Cutter::ball_end(cutter)?;
        let directions = &self.directions;
        let (answers, surface) = match surface {
            None => {
                let obstacles = Obstacles::Queries;
                let labels = access::label(&sites, obstacles, &tool, directions, &self.options)?;
                (labels.answers, None)
            }
            Some(surface) => {
                let obstacles = VolumeObstacles::Points(surface.points.clone());
                let answers = obstacles.answers(&sites.points, &tool, directions)?;
                (answers, Some(Arc::new(surface)))
            }
        };
        Ok(Sample { name: part.name.clone(), sites: Arc::new(sites), cutter, answers, surface })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::volume::Volume;
    use crate::geom::sites::{self, SiteOptions};
    use crate::geom::solids;

    fn bowl() -> Sample {
        let points: Vec<Vec3> = (0..400)
            .map(|i| {
                let p = Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0) * 2.0 - 19.0;
                Vec3::new(p.x, p.y, p.x * p.x / 12.0 + 0.1 * p.y)
            })
            .collect();
        let normal = |p: &Vec3| Vec3::new(-p.x / 6.0, -0.1, 1.0).normalize();
        let n = points.len();
        Sample {
            surface: None,
            name: "bowl".into(),
            sites: Arc::new(Sites {
                normals: points.iter().map(normal).collect(),
                points,
                faces: vec![],
            }),
            cutter: CutterParams::from_array([1.0, 1.0, 5.0, 1.0]),
            answers: SiteAnswers::new(vec![false; n], vec![false; n]),
        }
    }

    fn online(settings: OnlineSettings) -> Online {
        let directions = Directions::fibonacci_hemisphere(20).unwrap();
        Online::new(&[bowl(), bowl()], directions, LabelOptions::published(), settings, 5).unwrap()
    }

    #[test]
    fn a_sample_depends_on_seed_epoch_and_index_alone() {
        let source = online(OnlineSettings::default());
        let first = source.sample(3, 1).unwrap();
        source.sample(4, 0).unwrap();
        let again = source.sample(3, 1).unwrap();
        assert_eq!(first.sites, again.sites);
        assert_eq!((first.cutter, &first.answers), (again.cutter, &again.answers));
        assert_ne!(first.cutter, source.sample(4, 1).unwrap().cutter);
        assert_ne!(first.cutter, source.sample(3, 0).unwrap().cutter);
        assert!(
            (1..9).any(|e| source.sample(e, 1).unwrap().answers.inaccessible().contains(&true))
        );
    }

    #[test]
    fn extreme_cutters_take_their_share() {
        let n_long = |extreme| {
            let source = online(OnlineSettings { extreme, ..OnlineSettings::default() });
            (0..100).filter(|epoch| source.sample(*epoch, 0).unwrap().cutter.ch_mm >= 20.0).count()
        };
        assert_eq!((n_long(0.0), n_long(1.0)), (0, 100));
        assert!((30..70).contains(&n_long(0.5)), "{}", n_long(0.5));
        #[cfg(feature = "formats")]
        {
            let text = serde_json::to_string(&OnlineSettings::default()).unwrap();
            assert!(!text.contains("extreme"), "settings of before are written as before: {text}");
        }
    }

    #[test]
    fn sizes_are_drawn_over_the_whole_range_and_labels_are_those_of_the_scaled_part() {
        let settings = OnlineSettings { size_mm: Some([15.0, 600.0]), ..Default::default() };
        let source = online(settings);
        let sizes = (0..200).map(|epoch| {
            let sample = source.sample(epoch, 0).unwrap();
            let points = &sample.sites.points;
            let least = points.iter().copied().reduce(Vec3::min).unwrap();
            let greatest = points.iter().copied().reduce(Vec3::max).unwrap();
            assert!(sample.sites.check().is_ok());
            f64::from((greatest - least).length())
        });
        let sizes: Vec<f64> = sizes.collect();
        let small = sizes.iter().filter(|size| **size < 95.0).count();
        assert!((70..130).contains(&small), "{small} of 200 in the lower half of the logarithm");
        let sample = source.sample(3, 0).unwrap();
        let cutter = Cutter::ball_end(sample.cutter).unwrap();
        let labels = access::label(
            &*sample.sites,
            Obstacles::Queries,
            &cutter,
            &source.directions,
            &source.options,
        );
        assert_eq!(sample.answers, labels.unwrap().answers);
        let unsound = |size| !OnlineSettings { size_mm: Some(size), ..settings }.has_sound_sizes();
        assert!(unsound([0.0, 1.0]) && unsound([2.0, 1.0]) && unsound([1.0, f64::NAN]));
    }

    /// Only the cutter changes, and the shape by `elastic`.
    fn deformed_by(elastic: Option<Elastic>) -> OnlineSettings {
        let still = OnlineSettings::default().with_mirror(false).with_turn(Turn::None);
        still.with_tilt(0.0).with_sides(0.0).with_elastic(elastic)
    }

    #[test]
    fn deformed_parts_are_labeled_as_they_are_then() {
        let elastic = Some(Elastic { spacing: 0.2, magnitude: 0.05 });
        let [plain, deformed] =
            [None, elastic].map(|elastic| online(deformed_by(elastic)).sample(2, 0).unwrap());
        assert_eq!(plain.cutter, deformed.cutter);
        assert_eq!(plain.sites.points, bowl().sites.points);
        let cutter = Cutter::ball_end(deformed.cutter).unwrap();
        let source = online(deformed_by(None));
        let exact = |sites: &Sites| {
            let obstacles = Obstacles::Queries;
            access::label(sites, obstacles, &cutter, &source.directions, &source.options).unwrap()
        };
        assert_eq!(deformed.answers, exact(&deformed.sites).answers);
        assert_ne!(deformed.answers.inaccessible(), plain.answers.inaccessible());
        assert!(deformed.sites.check().is_ok());
    }

    #[test]
    fn a_deformed_part_keeps_standing_on_its_bottom() {
        let block = solids::cuboid(glam::DVec3::new(80.0, 60.0, 40.0));
        let sites = sites::sample(&block, &SiteOptions { n_sites: 500, ..Default::default() });
        let sites = Arc::new(sites.unwrap());
        let answers = SiteAnswers::new(vec![false; 500], vec![false; 500]);
        let part = Sample::new("block", sites.clone(), [1.5, 6.0, 40.0, 5.0].into(), answers);
        let bottom: Vec<usize> = (0..500).filter(|&i| sites.normals[i] == Vec3::NEG_Z).collect();
        assert!(bottom.len() > 50);
        let deformed = |options| {
            let settings = deformed_by(Some(Elastic::new(0.2, 0.02)));
            let directions = Directions::published();
            let source = Online::new(std::slice::from_ref(&part), directions, options, settings, 3);
            source.unwrap().sample(0, 0).unwrap()
        };
        let standing = deformed(LabelOptions::published());
        let inaccessible = standing.answers.inaccessible();
        for &i in &bottom {
            assert_eq!(standing.sites.points[i].z, sites.points[i].z);
            assert!(standing.sites.normals[i].distance(Vec3::NEG_Z) < 1e-4);
            assert!(!inaccessible[i], "the bottom rule is about the whole underside");
        }
        let moved = |i: &usize| standing.sites.points[*i].distance(sites.points[*i]) > 0.1;
        assert!((0..500).filter(moved).count() > 400);
        let free = deformed(LabelOptions { bottom_mm: None, ..LabelOptions::published() });
        assert!(bottom.iter().any(|&i| (free.sites.points[i].z - sites.points[i].z).abs() > 1.0));
    }

    #[test]
    fn points_of_space_turn_with_the_surface_that_blocks_them() {
        let part = solids::torus(20.0, 8.0, 40, 20);
        let surface = sites::sample(&part, &SiteOptions { n_sites: 600, ..Default::default() });
        let surface = Arc::new(surface.unwrap());
        let points = Arc::new(Volume::new(&part, 400).unwrap().points());
        let n = points.len();
        let answers = SiteAnswers::new(vec![false; n], vec![false; n]);
        let space = Sample::new("ring", points, [1.5, 6.0, 40.0, 5.0].into(), answers);
        let directions = Directions::published();
        let settings = OnlineSettings { tilt: 1.0, ..OnlineSettings::default() };
        let options = LabelOptions::published();
        let online = |sample| Online::new(&[sample], directions.clone(), options, settings, 5);
        let message = online(space.clone()).unwrap_err().to_string();
        assert!(message.starts_with("sample ring: points of space without"), "{message}");
        let source = online(space.clone().with_surface(Arc::clone(&surface))).unwrap();
        for epoch in 0..4 {
            let drawn = source.sample(epoch, 0).unwrap();
            drawn.check().unwrap();
            let (before, turned) = (&space.sites.points, drawn.surface().unwrap());
            // Distances between points of space and of the surface are kept.
            for (i, j) in (0..n).step_by(37).zip((0..600).step_by(41)) {
                let distance = before[i].distance(surface.points[j]);
                let after = drawn.sites.points[i].distance(turned.points[j]);
                assert!((distance - after).abs() < 1e-3, "{distance} {after}");
            }
            let tool = Cutter::ball_end(drawn.cutter).unwrap();
            let by = VolumeObstacles::Points(turned.points.clone());
            let exact = by.answers(&drawn.sites.points, &tool, &directions).unwrap();
            assert_eq!(drawn.answers, exact);
            assert!(exact.n_inaccessible() > 0 && exact.n_inaccessible() < n, "{epoch}");
        }
    }

    #[test]
    fn cutters_of_one_part_are_one_part() {
        let bowl = bowl();
        let other = Sample { cutter: CutterParams::from_array([2.0; 4]), ..bowl.clone() };
        let directions = Directions::fibonacci_hemisphere(5).unwrap();
        let settings = OnlineSettings::default();
        let options = LabelOptions::published();
        let source = Online::new(&[bowl, other], directions.clone(), options, settings, 0).unwrap();
        assert_eq!(source.len(), 1);
        assert!(Online::new(&[], directions, options, settings, 0).is_err());
    }

    #[test]
    fn orientations_are_rigid_and_quarter_turns_exact() {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let plain = OnlineSettings { tilt: 0.0, sides: 1.0, ..OnlineSettings::default() };
        let mut seen = std::collections::HashSet::new();
        for _ in 0..2000 {
            let m = plain.orientation(&mut stream);
            let entries = m.to_cols_array();
            assert!(entries.iter().all(|x| [-1.0, 0.0, 1.0].contains(x)));
            assert_eq!(m * m.transpose(), Mat3::IDENTITY);
            seen.insert(entries.map(|x| x as i32));
        }
        assert_eq!(seen.len(), 48, "all symmetries of the cube");
        let tilted = OnlineSettings { tilt: 1.0, ..plain };
        for _ in 0..100 {
            let m = tilted.orientation(&mut stream);
            let error = m * m.transpose() - Mat3::IDENTITY;
            assert!(error.to_cols_array().iter().all(|x| x.abs() < 1e-5));
        }
    }
}
