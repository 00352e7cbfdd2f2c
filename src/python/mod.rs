//! The Python module: `pyproject.toml` builds it, `docs/python.md` describes it.
//!
//! Only here do Python and the library meet. Input is copied and checked, so that no array that changes later is
//! read; output is read-only NumPy views of what the library holds. Work runs without the interpreter's lock; errors
//! and panics become exceptions.

mod answers;
mod errors;
mod explain;
mod folder;
mod input;
mod machined;
mod network;
mod octree;
mod online;
mod options;
mod output;
mod part;
mod plans;
mod region;
mod request;
mod tool;
mod training;
mod volume;
mod why;

/// Which parts of a surface a milling cutter cannot reach, and what is in its way.
#[pyo3::pymodule]
#[pyo3(name = "_deepmill")]
mod module {
    #[pymodule_export]
    use super::answers::{Outcome, ToolAnswers, analyze, read_outcome};
    #[pymodule_export]
    use super::explain::explain;
    #[pymodule_export]
    use super::machined::{MachinedOutcome, machined};
    #[pymodule_export]
    use super::network::{Network, Prediction};
    #[pymodule_export]
    use super::octree::{Octree, OctreeLevel};
    #[pymodule_export]
    use super::online::{Online, Sample, online};
    #[pymodule_export]
    use super::part::{Mesh, Sites, sample};
    #[pymodule_export]
    use super::plans::{SetupsOutcome, ToolsOutcome, compare, setups};
    #[pymodule_export]
    use super::tool::{Tool, read_tools};
    #[pymodule_export]
    use super::training::Trainer;
    #[pymodule_export]
    use super::volume::{VolumeOutcome, volume};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::errors::add_to(module)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
