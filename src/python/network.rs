//! Answers of a network.

use super::answers::array;
use super::errors::{checked, detached, detached_long, wrong_type};
use super::options::Options;
use super::output::{flags, list, rows};
use super::part::{Mesh, Sites, path_of};
use super::tool::cutter_of;
use crate::answers::SiteAnswers;
use crate::model::weights::{self, Storage};
use crate::model::{self, AnyModel, Model, Predictor};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A trained network; `Network.shipped()` comes with the package.
#[pyclass(frozen, module = "deepmill")]
pub struct Network(AnyModel<f32>);

impl Network {
    /// Of a model.
    pub fn of(model: AnyModel<f32>) -> Self {
        Network(model)
    }
}

#[pymethods]
impl Network {
    /// The network that comes with the package: ball ends, machine parts, directions over the upper half, by the mesh
    /// definition.
    ///
    /// >>> import deepmill
    /// >>> network = deepmill.Network.shipped()
    /// >>> network.definition
    /// 'mesh'
    #[staticmethod]
    fn shipped(py: Python<'_>) -> PyResult<Self> {
        detached(py, || Model::<f32>::shipped().map(|model| Network(model.into())))
    }

    /// Reads weights, a file of safetensors that `deepmill train` has written.
    #[staticmethod]
    fn read(path: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (py, path) = (path.py(), path_of("path", path)?);
        detached(py, || weights::read::<f32>(&path).map(Network))
    }

    /// Writes the weights, a file of safetensors; returns the path.
    fn save(&self, path: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
        let (py, path) = (path.py(), path_of("path", path)?);
        detached(py, || weights::write(&path, &self.0, Storage::Exact, ""))?;
        Ok(path)
    }

    /// "mesh" or "published": by which definition it was trained; None if that is not known.
    #[getter]
    fn definition(&self) -> Option<&'static str> {
        let name = |definition: crate::answers::Definition| match definition.is_by_mesh() {
            true => "mesh",
            false => "published",
        };
        self.0.definition.map(name)
    }

    /// What it predicts for sites and a cutter.
    ///
    /// points: float [n, 3], mm. normals: float [n, 3], unit vectors. cutter: a ball end, Tool, "CR,CH,FR,FH" or four
    /// numbers, mm. part: the Mesh that points are on, on which sites are added if they are fewer than in training.
    /// few_sites: predict fewer than half of those without it. out_of_domain: predict also what it was not trained
    /// for. occlusion_share: mark that share.
    #[pyo3(signature = (points, normals, cutter, **options))]
    #[pyo3(
        text_signature = "($self, points, normals, cutter, *, part=None, few_sites=False, out_of_domain=False, occlusion_share=None)"
    )]
    fn predict(
        &self,
        points: &Bound<'_, PyAny>,
        normals: &Bound<'_, PyAny>,
        cutter: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Prediction> {
        let py = points.py();
        let sites = Sites::of(points, normals)?;
        let cutter = cutter_of("cutter", cutter)?;
        let mut options = Options::new(py, options)?;
        let part = match options.take("part")? {
            None => None,
            Some(given) => match Mesh::of(&given)? {
                Some(mesh) => Some(mesh),
                None => return Err(wrong_type("part", &given, "a deepmill.Mesh")),
            },
        };
        let few_sites = options.flag("few_sites")?.unwrap_or(false);
        let out_of_domain = options.flag("out_of_domain")?.unwrap_or(false);
        let share = options.number("occlusion_share")?;
        options.finish()?;
        let mut predictor = Predictor::new(self.0.clone());
        if let Some(share) = share {
            predictor = checked(py, predictor.with_occlusion_share(share))?;
        }
        if out_of_domain {
            predictor = predictor.allow_out_of_domain();
        }
        if few_sites {
            predictor = predictor.allow_few_sites();
        }
        let part = part.as_ref().map(|part| &part.get().mesh);
        detached_long(py, || {
            let (prediction, outside) = match part {
                Some(part) => predictor.predict_on(part, &sites.0, &cutter)?,
                None => predictor.predict(&sites.0, &cutter)?,
            };
            let answers = share
                .map_or_else(|| prediction.answers(), |share| prediction.answers_ranked(share));
            let outside = outside.iter().map(ToString::to_string).collect();
            Ok(Prediction { prediction, answers, outside })
        })
    }
}

/// What a network predicts; read-only arrays, one entry per site.
#[pyclass(frozen, module = "deepmill")]
pub struct Prediction {
    prediction: model::Prediction<f32>,
    answers: SiteAnswers,
    outside: Vec<String>,
}

#[pymethods]
impl Prediction {
    /// The cutter collides in every direction: bool [n].
    #[getter]
    fn inaccessible<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<bool>>> {
        flags(py, self.answers.inaccessible())
    }

    /// Among the sites that are most often in the way: bool [n].
    #[getter]
    fn occlusion<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<bool>>> {
        list(this, |of| &of.answers.occlusion[..])
    }

    /// Probability of `inaccessible`: float32 [n].
    #[getter]
    fn probability_inaccessible<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| of.answers.probability_inaccessible())
    }

    /// Probability of `occlusion`: float32 [n].
    #[getter]
    fn probability_occlusion<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| of.answers.probability_occlusion())
    }

    /// Share of the directions that are accessible: float32 [n]; None of a network without that head.
    #[getter]
    fn accessible_share<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| &of.answers.accessible_share[..])
    }

    /// Logits: accessible, inaccessible; float32 [n, 2].
    #[getter]
    fn logits_inaccessible<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| &of.prediction.logits_inaccessible[..])
    }

    /// Logits: no occlusion point, occlusion point; float32 [n, 2].
    #[getter]
    fn logits_occlusion<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| &of.prediction.logits_occlusion[..])
    }

    /// What the network reads of each site beside the shape, float32 [n, 4], a copy; None of a network without it.
    #[getter]
    fn coarse_answers<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f32>>> {
        let coarse = &self.prediction.coarse_answers;
        (!coarse.is_empty()).then(|| array(coarse.clone()).into_pyarray(py))
    }

    /// What of part and cutter the network was not trained for, a sentence each.
    #[getter]
    fn outside_domain(&self) -> Vec<String> {
        self.outside.clone()
    }

    fn __len__(&self) -> usize {
        self.answers.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "<deepmill.Prediction: {} of {} sites inaccessible>",
            self.answers.n_inaccessible(),
            self.answers.len()
        )
    }
}
