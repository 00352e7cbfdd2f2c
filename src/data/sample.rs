//! A training sample: the sites of one part, one cutter, and the labels of both heads.

use crate::answers::SiteAnswers;
use crate::geom::Sites;
use crate::geom::sites::check_points;
use crate::model::Shape;
use crate::tool::cutter::{Cutter, CutterParams};
use crate::{Error, Result};
use std::sync::Arc;

/// One training or test example. Sites are shared between the cutters of a part.
///
/// ```
/// use deepmill::{answers::SiteAnswers, data::Sample, geom::Sites, glam::Vec3};
///
/// let sites = Sites { points: vec![Vec3::ZERO, Vec3::X], normals: vec![Vec3::Z; 2], faces: vec![] };
/// let answers = SiteAnswers::new(vec![false, true], vec![true, false]);
/// let sample = Sample::new("block", sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers);
/// sample.check()?;
/// let short = SiteAnswers::new(vec![false, true], vec![true]);
/// let short = Sample::new("block", sample.sites, sample.cutter, short);
/// let error = short.check().unwrap_err().to_string();
/// assert!(error.starts_with("sample block: 1 occlusion for 2 sites"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Sample {
    /// Name of the part.
    pub name: String,
    /// Sites of the part, mm; without normals: points of the space around it.
    pub sites: Arc<Sites>,
    /// The cutter, mm.
    pub cutter: CutterParams,
    /// What the network is to answer: `inaccessible` for head 1, `occlusion` for head 2, per site.
    pub answers: SiteAnswers,
    /// Sites of the part's surface, mm, beside points of space.
    pub(crate) surface: Option<Arc<Sites>>,
}

impl Sample {
    /// Of these; [`Sample::check`] tells whether they fit together.
    pub fn new(
        name: impl Into<String>,
        sites: Arc<Sites>,
        cutter: CutterParams,
        answers: SiteAnswers,
    ) -> Self {
        Sample { name: name.into(), sites, cutter, answers, surface: None }
    }

    /// About points of space, with sites of the part's surface, mm, for networks that read them
    /// ([`Shape::with_surface`]) and for [`Online`](super::Online), to which they are the obstacles.
    pub fn with_surface(self, surface: Arc<Sites>) -> Self {
        Sample { surface: Some(surface), ..self }
    }

    /// The part's surface, if it is about points of space and that is known.
    pub fn surface(&self) -> Option<&Arc<Sites>> {
        self.surface.as_ref()
    }

    /// What a network reads of it.
    pub fn shape(&self) -> Shape<'_> {
        let shape = Shape::new(&self.sites.points, &self.sites.normals, self.cutter.to_array());
        self.surface.as_deref().map_or(shape, |surface| shape.with_surface(surface))
    }

    /// Whether it is about points of the space around a part.
    pub fn is_volume(&self) -> bool {
        self.sites.normals.is_empty() && !self.sites.is_empty()
    }

    /// Checks that every vector has one entry per site, that the sites pass [`Sites::check`], or are points of space,
    /// and the lengths make a cutter.
    ///
    /// # Errors
    /// Names the sample and what is wrong with it.
    pub fn check(&self) -> Result<()> {
        let n = self.sites.len();
        let lengths = [
            ("normals", if self.is_volume() { n } else { self.sites.normals.len() }),
            ("inaccessible", self.answers.len()),
            ("occlusion", self.answers.occlusion.len()),
        ];
        match lengths.iter().find(|(_, len)| *len != n) {
            _ if n == 0 => Err(Error::geometry(
                format!("sample {}", self.name),
                "it has no sites",
                "leave it out of the data set",
            )),
            Some((what, len)) => Err(Error::geometry(
                format!("sample {}", self.name),
                format!("{len} {what} for {n} sites"),
                "build the data set again",
            )),
            None => self.check_sites().and_then(|()| Cutter::ball_end(self.cutter).map(drop)),
        }
        .map_err(|e| self.named(e))
    }

    fn check_sites(&self) -> Result<()> {
        match self.is_volume() {
            true => check_points("point", &self.sites.points),
            false => self.sites.check(),
        }?;
        let Some(surface) = &self.surface else { return Ok(()) };
        let refused =
            |found, remedy| Err(Error::geometry(format!("sample {}", self.name), found, remedy));
        if !self.is_volume() {
            let remedy = "leave out the surface, or the normals of points of space";
            return refused("a surface beside sites, which are of it", remedy);
        }
        if surface.is_empty() {
            return refused("a surface without sites", "leave it out, or build the data set again");
        }
        surface.check()
    }

    /// The error of a part of the sample, as one of the sample.
    fn named(&self, error: Error) -> Error {
        let place = format!("sample {}", self.name);
        match error {
            Error::Argument { name, found, expected, remedy } => {
                Error::geometry(place, format!("{name} is {found}, expected {expected}"), remedy)
            }
            Error::Geometry { place: within, found, remedy } if within != place => {
                Error::geometry(place, format!("{within}: {found}"), remedy)
            }
            other => other,
        }
    }
}

/// Where training draws its samples: a fixed list, or one that makes them on the spot.
pub trait SampleSource: Sync {
    /// Samples per epoch.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sample `index` of `epoch`. The same arguments always give the same sample.
    ///
    /// # Errors
    /// If the sample cannot be made or read.
    fn sample(&self, epoch: u64, index: usize) -> Result<Sample>;
}

impl SampleSource for [Sample] {
    fn len(&self) -> usize {
        <[Sample]>::len(self)
    }

    fn sample(&self, _epoch: u64, index: usize) -> Result<Sample> {
        Ok(self[index].clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn samples_that_cannot_be_are_named() {
        let sites =
            Sites { points: vec![Vec3::X, Vec3::Y], normals: vec![Vec3::Z; 2], faces: vec![] };
        let good = Sample {
            surface: None,
            name: "a".into(),
            sites: sites.clone().into(),
            cutter: [1.5, 6.0, 40.0, 5.0].into(),
            answers: SiteAnswers::new(vec![true, false], vec![false, true]),
        };
        good.check().unwrap();
        let cutter = |lengths: [f64; 4]| Sample { cutter: lengths.into(), ..good.clone() };
        let with = |sites: Sites| Sample { sites: sites.into(), ..good.clone() };
        for (sample, expected) in [
            (cutter([f64::NAN, 6.0, 40.0, 5.0]), "sample a: cutter radius CR is NaN"),
            (cutter([1.5, -6.0, 40.0, 5.0]), "sample a: cutter height CH is -6"),
            (cutter([40.0, 6.0, 1.5, 5.0]), "sample a: holder radius FR is 1.5"),
            (
                with(Sites { normals: vec![Vec3::ZERO; 2], ..sites.clone() }),
                "sample a: site 0: normal",
            ),
            (
                with(Sites { points: vec![Vec3::X, Vec3::NAN], ..sites.clone() }),
                "sample a: site 1: position",
            ),
            (good.clone().with_surface(sites.clone().into()), "sample a: a surface beside sites"),
            (
                with(Sites { normals: vec![], ..sites.clone() })
                    .with_surface(Sites::default().into()),
                "sample a: a surface without sites",
            ),
            (
                Sample { answers: SiteAnswers::new(vec![true; 2], vec![]), ..good.clone() },
                "sample a: 0 occlusion for 2 sites",
            ),
        ] {
            let message = sample.check().unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
