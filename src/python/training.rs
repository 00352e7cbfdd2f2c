//! Training of a network on samples.

use super::errors::{checked, detached, detached_long, refused, wrong_type};
use super::network::Network;
use super::online::Sample;
use super::options::Options;
use super::output::of_json;
use super::part::path_of;
use crate::access::LabelOptions;
use crate::answers::Definition;
use crate::data;
use crate::tool::directions::Directions;
use crate::train::{Checkpoint, EpochRow, Observer, Run, Settings, StepReport};
use crate::{Error, Result};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, TryLockError};

/// Where a run draws its samples.
enum Source {
    Fixed(Vec<data::Sample>),
    Online(Box<data::Online>),
}

/// A training run: settings, network, optimizer and how far it is. A run that was saved and resumed ends with the bits
/// of one that was not.
///
/// Trainer(samples, validation=(), *, preset="small", settings=None, definition=None)
///
/// samples, validation: sequences of Sample. preset: "paper", "reference", "small" or "tiny".
/// settings: dict over the preset, with the keys of `Trainer.settings`, such as {"n_epochs": 10, "lr": 0.1}; with
/// "online" every sample gets a new cutter, orientation and labels each time.
/// definition: "mesh" or "published", of the labels; goes into the weights.
#[pyclass(frozen, module = "deepmill")]
pub struct Trainer {
    run: Mutex<Run>,
    source: Source,
    validation: Vec<data::Sample>,
}

/// Of a sequence of samples.
fn samples_of(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<Vec<data::Sample>> {
    let expected = "a sequence of deepmill.Sample";
    let items = value.try_iter().map_err(|_| wrong_type(name, value, expected))?;
    let one = |item: PyResult<Bound<'_, PyAny>>| {
        let item = item?;
        let sample = item.cast::<Sample>().map_err(|_| wrong_type(name, &item, expected))?;
        Ok(sample.get().sample().clone())
    };
    items.map(one).collect()
}

/// The preset with changes; objects are joined key by key unless their `kind` differs.
fn overlaid(base: Value, changes: Value) -> Value {
    match (base, changes) {
        (Value::Object(mut base), Value::Object(changes))
            if changes.get("kind").is_none_or(|kind| base.get("kind") == Some(kind)) =>
        {
            for (key, change) in changes {
                let old = base.remove(&key).unwrap_or(Value::Null);
                base.insert(key, overlaid(old, change));
            }
            Value::Object(base)
        }
        (_, changes) => changes,
    }
}

fn settings_of(options: &mut Options<'_>) -> PyResult<Settings> {
    let py = options.py();
    let preset = options.text("preset")?.unwrap_or_else(|| "small".into());
    let preset = checked(py, Settings::preset(&preset))?;
    let Some(changes) = options.take("settings")? else { return Ok(preset) };
    if !changes.is_instance_of::<PyDict>() {
        return Err(wrong_type("settings", &changes, "a dict"));
    }
    let remedy = "compare with Trainer.settings";
    let bad = |e: String| refused(py, "settings", e, "the keys and values of settings", remedy);
    let text =
        py.import("json")?.call_method1("dumps", (&changes,)).map_err(|e| bad(e.to_string()))?;
    let changes =
        serde_json::from_str(&text.extract::<String>()?).map_err(|e| bad(e.to_string()))?;
    let base = serde_json::to_value(&preset).map_err(|e| bad(e.to_string()))?;
    serde_json::from_value(overlaid(base, changes)).map_err(|e| bad(e.to_string()))
}

impl Trainer {
    fn with(run: Run, samples: Vec<data::Sample>, validation: Vec<data::Sample>) -> Result<Self> {
        samples.iter().chain(&validation).try_for_each(data::Sample::check)?;
        if samples.is_empty() {
            let remedy = "give samples to train on";
            return Err(Error::argument("samples", "empty", "one sample or more", remedy));
        }
        let source = match run.settings.online {
            None => Source::Fixed(samples),
            Some(online) => {
                let (directions, options) = (Directions::published(), LabelOptions::published());
                let seed = run.settings.seed;
                let online = data::Online::new(&samples, directions, options, online, seed)?;
                Source::Online(online.into())
            }
        };
        Ok(Trainer { run: Mutex::new(run), source, validation })
    }

    /// The run, unless it is at work.
    fn run(&self) -> PyResult<MutexGuard<'_, Run>> {
        match self.run.try_lock() {
            Ok(run) => Ok(run),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
                "the trainer is at work, in another thread or in its progress callable",
            )),
            Err(TryLockError::Poisoned(_)) => Err(PyRuntimeError::new_err(
                "the trainer failed in an earlier call; resume it from a saved state",
            )),
        }
    }

    /// Trains until the end, or until the watch stops it.
    fn go_on(&self, py: Python<'_>, watch: &mut Steps) -> PyResult<bool> {
        let mut run = self.run()?;
        let run = &mut *run;
        let done = detached_long(py, || match &self.source {
            Source::Fixed(samples) => run.train(&samples[..], &self.validation, watch),
            Source::Online(online) => run.train(&**online, &self.validation, watch),
        });
        match watch.raised.take() {
            Some(raised) => Err(raised),
            None => Ok(done?.is_continue()),
        }
    }
}

/// Passes steps on to a callable, and stops at signals, exceptions and `False`; or after one step.
struct Steps {
    callable: Option<Py<PyAny>>,
    is_one: bool,
    last: Option<Value>,
    raised: Option<PyErr>,
}

impl Observer for Steps {
    fn step(&mut self, report: &StepReport) -> ControlFlow<()> {
        let [inaccessible, occlusion] = report.scores;
        let step = json!({
            "epoch": report.epoch, "step": report.step, "n_steps": report.n_steps, "loss": report.loss,
            "inaccessible": inaccessible, "occlusion": occlusion,
        });
        let answer = Python::attach(|py| -> PyResult<bool> {
            py.check_signals()?;
            let Some(callable) = &self.callable else { return Ok(true) };
            let answer = callable.bind(py).call1((of_json(py, &step)?,))?;
            Ok(answer.extract::<bool>().unwrap_or(true))
        });
        self.last = Some(step);
        match answer {
            Ok(true) if !self.is_one => ControlFlow::Continue(()),
            Ok(_) => ControlFlow::Break(()),
            Err(raised) => {
                self.raised = Some(raised);
                ControlFlow::Break(())
            }
        }
    }
}

fn row_json(row: &EpochRow) -> Value {
    let mut value = json!(row);
    if let Some([inaccessible, occlusion]) = row.validation {
        value["validation"] = json!({ "inaccessible": inaccessible, "occlusion": occlusion });
    }
    value
}

#[pymethods]
impl Trainer {
    #[new]
    #[pyo3(signature = (samples, validation=None, **options))]
    #[pyo3(
        text_signature = "(samples, validation=(), *, preset='small', settings=None, definition=None)"
    )]
    fn new(
        samples: &Bound<'_, PyAny>,
        validation: Option<&Bound<'_, PyAny>>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let py = samples.py();
        let samples = samples_of("samples", samples)?;
        let validation =
            validation.map_or(Ok(Vec::new()), |value| samples_of("validation", value))?;
        let mut options = Options::new(py, options)?;
        let settings = settings_of(&mut options)?;
        let definition = match options.text("definition")?.as_deref() {
            None => None,
            Some("mesh") => Some(Definition::Part),
            Some("published") => Some(Definition::Sites),
            Some(other) => {
                let remedy = "leave it out if it is not known";
                return Err(refused(
                    py,
                    "definition",
                    format!("`{other}`"),
                    "mesh or published",
                    remedy,
                ));
            }
        };
        options.finish()?;
        detached(py, move || {
            let mut run = Run::new(settings)?;
            if let Some(definition) = definition {
                run.learns(definition);
            }
            Trainer::with(run, samples, validation)
        })
    }

    /// The run whose state `save` has written, with the samples it had.
    #[staticmethod]
    #[pyo3(signature = (path, samples, validation=None))]
    #[pyo3(text_signature = "(path, samples, validation=())")]
    fn resume(
        path: &Bound<'_, PyAny>,
        samples: &Bound<'_, PyAny>,
        validation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (py, path) = (path.py(), path_of("path", path)?);
        let samples = samples_of("samples", samples)?;
        let validation =
            validation.map_or(Ok(Vec::new()), |value| samples_of("validation", value))?;
        detached(py, move || {
            Trainer::with(Run::resume(Checkpoint::read(&path)?)?, samples, validation)
        })
    }

    /// Writes the whole state; returns the path.
    fn save(&self, path: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
        let (py, path) = (path.py(), path_of("path", path)?);
        let checkpoint = self.run()?.checkpoint();
        detached(py, || checkpoint.write(&path))?;
        Ok(path)
    }

    /// One step; returns a dict of epoch, step, n_steps, loss and scores, or None if all are done.
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let mut watch = Steps { callable: None, is_one: true, last: None, raised: None };
        self.go_on(py, &mut watch)?;
        watch.last.map(|step| of_json(py, &step)).transpose()
    }

    /// Trains to the end; returns whether it is finished. It goes on where it was stopped.
    ///
    /// progress: callable that gets the dict of each step; False stops after it, as do Ctrl-C and exceptions.
    #[pyo3(signature = (progress=None))]
    fn train(&self, py: Python<'_>, progress: Option<Bound<'_, PyAny>>) -> PyResult<bool> {
        if let Some(other) = progress.as_ref().filter(|callable| !callable.is_callable()) {
            return Err(wrong_type("progress", other, "a callable (step) or None"));
        }
        let callable = progress.map(Bound::unbind);
        let finished =
            self.go_on(py, &mut Steps { callable, is_one: false, last: None, raised: None })?;
        py.check_signals()?;
        Ok(finished)
    }

    /// Whether all epochs are done.
    #[getter]
    fn is_finished(&self) -> PyResult<bool> {
        Ok(self.run()?.is_finished())
    }

    /// All settings, as a dict.
    #[getter]
    fn settings(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let settings = json!(self.run()?.settings);
        Ok(of_json(py, &settings)?.unbind())
    }

    /// A dict per finished epoch: lr, loss, scores of both heads, validation.
    #[getter]
    fn history(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let rows: Vec<Value> = self.run()?.progress.history.iter().map(row_json).collect();
        Ok(of_json(py, &json!(rows))?.unbind())
    }

    /// The network as it is now, a copy.
    #[getter]
    fn network(&self) -> PyResult<Network> {
        Ok(Network::of(self.run()?.model.clone()))
    }

    fn __repr__(&self) -> PyResult<String> {
        let run = self.run()?;
        Ok(format!(
            "<deepmill.Trainer: {} of {} epochs>",
            run.progress.history.len(),
            run.settings.n_epochs
        ))
    }
}
