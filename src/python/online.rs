//! Labels on the fly, for training loops of Python.

use super::errors::{checked, detached, detached_long, refused, wrong_type};
use super::input;
use super::options::{Options, text_of};
use super::output::{flags, list, rows, threes};
use super::part::{Part, Sites, placement};
use super::tool::ball_end_of;
use crate::access::LabelOptions;
use crate::data::augment::Turn;
use crate::data::loader::batches;
use crate::data::online::OnlineSettings;
use crate::data::{self, SampleSource};
use crate::geom::{self, sites};
use crate::tool::directions::Directions;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, PoisonError};

/// Training samples without end: each has a part, turned at random, a random cutter, and exact labels by the published
/// definition. The same arguments give the same samples.
///
/// parts: a sequence of Mesh, of objects with `vertices` and `faces`, or of Sites.
/// cutters: "uniform", "short", "long" or "extreme", the published ranges, or "full", every length. seed: of everything
/// that is drawn.
/// epochs: stop after so many rounds over the parts; None: never. first_epoch: begin there.
/// directions: as of `analyze`, by default the published ones. sites: as of `analyze`, of meshes.
/// mirror: in x with probability 1/2. turn: about +z, "none", "quarter" or "any". sides: probability of another side
/// down. tilt: probability of any rotation. size_mm: range (least, greatest) that parts are scaled to, mm.
///
/// >>> import deepmill, itertools
/// >>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> for sample in itertools.islice(deepmill.online([mesh], seed=1, sites=200), 2):
/// ...     print(sample.points.shape, sample.inaccessible.dtype)
/// (200, 3) bool
/// (200, 3) bool
#[pyfunction]
#[pyo3(signature = (parts, cutters=None, **options))]
#[pyo3(
    text_signature = "(parts, cutters='uniform', *, seed=0, epochs=None, first_epoch=1, directions=None, \
        sites=7000, smooth=None, mirror=True, turn='quarter', sides=0.3, tilt=0.1, size_mm=None)"
)]
pub fn online(
    parts: &Bound<'_, PyAny>,
    cutters: Option<&Bound<'_, PyAny>>,
    options: Option<Bound<'_, PyDict>>,
) -> PyResult<Online> {
    let py = parts.py();
    let mut options = Options::new(py, options)?;
    let settings = settings_of(cutters, &mut options)?;
    let (placed, seed) = placement(&mut options)?;
    let directions = options.directions()?.unwrap_or_else(Directions::published);
    let epochs: Option<u64> = options.whole("epochs")?;
    let epoch: u64 = options.whole("first_epoch")?.unwrap_or(1);
    options.finish()?;
    let expected = "a sequence of deepmill.Mesh or deepmill.Sites";
    let items = parts.try_iter().map_err(|_| wrong_type("parts", parts, expected))?;
    let mut samples = Vec::new();
    for (k, item) in items.enumerate() {
        let (name, sites) = match Part::of(&item?)? {
            Part::Cloud(cloud) => (format!("part {k}"), Arc::clone(&cloud.get().0)),
            Part::Mesh(mesh) => {
                let of = mesh.get();
                let spread = || match &placed {
                    Some(options) => sites::sample(&of.mesh, options),
                    None => sites::from_vertices(&of.mesh),
                };
                (of.name.clone(), Arc::new(detached(py, spread)?))
            }
        };
        samples.push(unlabeled(name, sites));
    }
    let source = detached(py, || {
        data::Online::new(&samples, directions, LabelOptions::published(), settings, seed)
    })?;
    let last = epochs.map(|n| epoch.saturating_add(n));
    Ok(Online { source, seed, last, next: Mutex::new(Next { epoch, order: Vec::new() }) })
}

/// A part whose labels are not known yet.
fn unlabeled(name: String, sites: Arc<geom::Sites>) -> data::Sample {
    let n = sites.len();
    let answers = crate::answers::SiteAnswers::new(vec![false; n], vec![false; n]);
    data::Sample::new(name, sites, [1.0; 4].into(), answers)
}

fn settings_of(
    cutters: Option<&Bound<'_, PyAny>>,
    options: &mut Options<'_>,
) -> PyResult<OnlineSettings> {
    let py = options.py();
    let mut settings = OnlineSettings::default();
    if let Some(cutters) = cutters {
        let name = text_of("cutters", cutters)?;
        settings.cutter_set = name.parse().map_err(|_| {
            let expected = "uniform, short, long, extreme or full";
            refused(py, "cutters", format!("`{name}`"), expected, "uniform is that of the paper")
        })?;
    }
    settings.mirror = options.flag("mirror")?.unwrap_or(settings.mirror);
    settings.turn = match options.text("turn")?.as_deref() {
        None => settings.turn,
        Some("none") => Turn::None,
        Some("quarter") => Turn::Quarter,
        Some("any") => Turn::Any,
        Some(other) => {
            let remedy = "quarter turns need no new directions";
            return Err(refused(py, "turn", format!("`{other}`"), "none, quarter or any", remedy));
        }
    };
    for (name, probability) in [("sides", &mut settings.sides), ("tilt", &mut settings.tilt)] {
        if let Some(given) = options.number(name)? {
            if !(0.0..=1.0).contains(&given) {
                return Err(refused(py, name, given, "a probability from 0 to 1", "0 is never"));
            }
            *probability = given;
        }
    }
    if let Some(range) = options.take("size_mm")? {
        settings.size_mm = Some(input::numbers("size_mm", &range, "least and greatest size, mm")?);
        if !settings.has_sound_sizes() {
            let found = format!("{:?}", settings.size_mm.unwrap_or_default());
            return Err(refused(
                py,
                "size_mm",
                found,
                "0 < least <= greatest, at most 10 m",
                "give for example (15, 600)",
            ));
        }
    }
    Ok(settings)
}

/// What comes next.
struct Next {
    epoch: u64,
    /// Of that epoch, the parts that are left, the next one last.
    order: Vec<usize>,
}

/// An iterator of training samples.
#[pyclass(frozen, module = "deepmill")]
pub struct Online {
    source: data::Online,
    seed: u64,
    /// The epoch that is not begun any more.
    last: Option<u64>,
    next: Mutex<Next>,
}

impl Online {
    /// Epoch and part of the next sample.
    fn draw(&self) -> Option<(u64, usize)> {
        let mut next = self.next.lock().unwrap_or_else(PoisonError::into_inner);
        if next.order.is_empty() {
            if self.last.is_some_and(|last| next.epoch >= last) {
                return None;
            }
            next.order = batches(self.source.len(), 1, self.seed, next.epoch).concat();
            next.order.reverse();
        }
        let drawn = next.order.pop().map(|index| (next.epoch, index));
        if next.order.is_empty() {
            next.epoch += 1;
        }
        drawn
    }
}

#[pymethods]
impl Online {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Sample>> {
        let Some((epoch, index)) = self.draw() else { return Ok(None) };
        let sample = detached_long(py, || self.source.sample(epoch, index))?;
        let cutter = sample.cutter.to_array();
        Ok(Some(Sample { sample, cutter, epoch, index }))
    }
}

/// A part, a cutter, and labels; read-only arrays, one entry per site.
///
/// Sample(points, normals, cutter, inaccessible, occlusion, *, name="part")
///
/// points: float array [n, 3], mm. normals: float array [n, 3], unit vectors. inaccessible, occlusion: bool arrays [n].
/// cutter: a ball end, Tool, "CR,CH,FR,FH" or four numbers, mm.
#[pyclass(frozen, module = "deepmill")]
pub struct Sample {
    sample: data::Sample,
    cutter: [f64; 4],
    epoch: u64,
    index: usize,
}

impl Sample {
    /// What the library has of it.
    pub fn sample(&self) -> &data::Sample {
        &self.sample
    }
}

#[pymethods]
impl Sample {
    #[new]
    #[pyo3(signature = (points, normals, cutter, inaccessible, occlusion, *, name=None))]
    #[pyo3(text_signature = "(points, normals, cutter, inaccessible, occlusion, *, name='part')")]
    fn new(
        points: &Bound<'_, PyAny>,
        normals: &Bound<'_, PyAny>,
        cutter: &Bound<'_, PyAny>,
        inaccessible: &Bound<'_, PyAny>,
        occlusion: &Bound<'_, PyAny>,
        name: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let name = name.map_or_else(|| Ok("part".into()), |name| text_of("name", name))?;
        let sites = Sites::of(points, normals)?.0;
        let params = ball_end_of("cutter", cutter)?;
        let marks = input::flags("inaccessible", inaccessible, (sites.len(), "site"))?;
        let occlusion = input::flags("occlusion", occlusion, (sites.len(), "site"))?;
        let answers = crate::answers::SiteAnswers::new(marks, occlusion);
        let sample = data::Sample::new(name, sites, params, answers);
        checked(points.py(), sample.check())?;
        Ok(Sample { cutter: params.to_array(), sample, epoch: 0, index: 0 })
    }

    /// Name of the part.
    #[getter]
    fn name(&self) -> &str {
        &self.sample.name
    }

    /// The round over the parts, from 1 on; 0 of a sample that was given.
    #[getter]
    fn epoch(&self) -> u64 {
        self.epoch
    }

    /// The number of the part.
    #[getter]
    fn index(&self) -> usize {
        self.index
    }

    /// Positions, float32 [n, 3], mm.
    #[getter]
    fn points<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.sample.sites.points))
    }

    /// Outward unit normals, float32 [n, 3].
    #[getter]
    fn normals<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.sample.sites.normals))
    }

    /// CR, CH, FR, FH: float64 [4], mm.
    #[getter]
    fn cutter_mm<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f64>>> {
        list(this, |of| &of.cutter[..])
    }

    /// The cutter collides in every direction: bool [n].
    #[getter]
    fn inaccessible<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<bool>>> {
        flags(py, self.sample.answers.inaccessible())
    }

    /// Among the sites that are most often in the way: bool [n].
    #[getter]
    fn occlusion<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<bool>>> {
        list(this, |of| &of.sample.answers.occlusion[..])
    }

    /// Share of the directions that are accessible: float32 [n].
    #[getter]
    fn accessible_share<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| &of.sample.answers.accessible_share[..])
    }

    fn __len__(&self) -> usize {
        self.sample.sites.len()
    }

    fn __repr__(&self) -> String {
        format!("<deepmill.Sample of {:?}: {} sites>", self.sample.name, self.sample.sites.len())
    }
}
