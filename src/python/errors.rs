//! Errors as Python exceptions, and work without the interpreter's lock.

use crate::analysis::{Observer, Progress, Stage};
use crate::exec::par;
use crate::{Error, Result};
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};
use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// The exceptions.
struct Types {
    error: Py<PyType>,
    file: Py<PyType>,
    interrupted: Py<PyType>,
}

static TYPES: PyOnceLock<Types> = PyOnceLock::new();

impl Types {
    fn of(py: Python<'_>) -> PyResult<&Self> {
        TYPES.get_or_try_init(py, || {
            let error = class(
                py,
                ("Error", "What was found, what is right, and what to do; `kind` is the kind of failure, in a word."),
                (py.get_type::<PyValueError>(),).into_pyobject(py)?,
            )?;
            let file = class(
                py,
                ("FileError", "A file cannot be read or written, or its content is faulty."),
                (error.bind(py), py.get_type::<PyOSError>()).into_pyobject(py)?,
            )?;
            let interrupted = class(
                py,
                ("Interrupted", "The progress callable returned False."),
                (error.bind(py),).into_pyobject(py)?,
            )?;
            Ok(Types { error, file, interrupted })
        })
    }
}

/// An exception with these bases.
fn class(
    py: Python<'_>,
    (name, doc): (&str, &str),
    bases: Bound<'_, PyTuple>,
) -> PyResult<Py<PyType>> {
    let members = PyDict::new(py);
    members.set_item("__doc__", doc)?;
    members.set_item("__module__", "deepmill")?;
    let class = py.get_type::<PyType>().call1((name, bases, members))?;
    Ok(class.cast_into::<PyType>()?.unbind())
}

/// Puts the exceptions into the module.
pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let types = Types::of(py)?;
    module.add("Error", types.error.bind(py))?;
    module.add("FileError", types.file.bind(py))?;
    module.add("Interrupted", types.interrupted.bind(py))
}

/// Of [`crate::error::ErrorKind`], in words.
fn kind(error: &Error) -> &'static str {
    use crate::error::ErrorKind::{
        Argument, File, Geometry, Gradient, Interrupted, NotFinite, OtherProcess, Read, TooLarge,
        Write,
    };
    match error.kind() {
        Read => "read",
        Write => "write",
        File => "file",
        Geometry => "geometry",
        Argument => "argument",
        TooLarge => "too large",
        NotFinite => "not finite",
        Gradient => "gradient",
        OtherProcess => "other process",
        Interrupted => "interrupted",
    }
}

/// The exception that states an error.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let types = Types::of(py)?;
        let of = match error {
            Error::Io { .. } | Error::File { .. } => &types.file,
            Error::Interrupted { .. } => &types.interrupted,
            _ => &types.error,
        };
        let value = of.bind(py).call1((error.to_string(),))?;
        value.setattr("kind", kind(error))?;
        if let Error::Io { source, .. } = error {
            value.setattr("errno", source.raw_os_error())?;
        }
        Ok(PyErr::from_value(value))
    };
    made().unwrap_or_else(|failed| failed)
}

/// The result, an error as its exception.
pub fn checked<T>(py: Python<'_>, result: Result<T>) -> PyResult<T> {
    result.map_err(|error| exception(py, &error))
}

/// An argument that is not right.
pub fn refused(
    py: Python<'_>,
    name: &'static str,
    found: impl ToString,
    expected: impl Into<String>,
    remedy: impl Into<String>,
) -> PyErr {
    exception(py, &Error::argument(name, found, expected, remedy))
}

/// The error of an argument by its name in the library, by that here; any other error as it is.
pub fn called(name: &str, error: Error, here: &'static str) -> Error {
    match error {
        Error::Argument { name: there, found, expected, remedy } if there == name => {
            Error::Argument { name: here, found, expected, remedy }
        }
        other => other,
    }
}

/// An argument of another Python type.
pub fn wrong_type(name: &str, found: &Bound<'_, PyAny>, expected: &str) -> PyErr {
    PyTypeError::new_err(format!("{name} is {}, expected {expected}", shown(found)))
}

/// A value with its type, short.
pub fn shown(value: &Bound<'_, PyAny>) -> String {
    const MOST: usize = 60;
    let kind = value.get_type().name().map_or_else(|_| "object".into(), |name| name.to_string());
    let text = value.repr().map(|text| text.to_string()).unwrap_or_default();
    match text.chars().count() {
        0 => format!("a {kind}"),
        n if n > MOST || text.contains('\n') => format!("a {kind}"),
        _ => format!("{text} ({kind})"),
    }
}

/// Runs work on threads of its own, as the program does. A caller from outside of the shared threads would be one more
/// than there are processors, and take turns with one that waits for work: 7 % of the time of labels on two.
fn with_own_pool<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    par::with_threads(0, work)?
}

/// [`detached`], for work that takes long, on threads of its own.
pub fn detached_long<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<T> {
    detached(py, || with_own_pool(work))
}

/// Runs work without the interpreter's lock; a panic becomes a `RuntimeError`.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(result) => checked(py, result),
        Err(panic) => Err(fault(&*panic)),
    }
}

fn fault(panic: &(dyn Any + Send)) -> PyErr {
    let words = panic.downcast_ref::<String>().map(String::as_str);
    let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
    PyRuntimeError::new_err(format!("deepmill failed ({words}); please report it with the input"))
}

/// Passes progress on to a callable, and stops at signals, at exceptions, and if the callable returns `False`.
pub struct Watch {
    callable: Option<Py<PyAny>>,
    /// What the callable raised, or a signal's handler.
    raised: Option<PyErr>,
}

impl Watch {
    /// With a callable `(stage, done, of)`, if there is one.
    pub fn new(callable: Option<Bound<'_, PyAny>>) -> PyResult<Self> {
        match callable {
            Some(other) if !other.is_callable() => {
                Err(wrong_type("progress", &other, "a callable (stage, done, of) or None"))
            }
            callable => Ok(Watch { callable: callable.map(Bound::unbind), raised: None }),
        }
    }

    /// Runs work that it watches, without the interpreter's lock.
    pub fn run<T: Send>(
        mut self,
        py: Python<'_>,
        work: impl FnOnce(&mut dyn Observer) -> Result<T> + Send,
    ) -> PyResult<T> {
        let result = detached(py, || work(&mut self));
        match self.raised.take() {
            Some(raised) => Err(raised),
            None => {
                py.check_signals()?;
                result
            }
        }
    }

    /// As [`Watch::run`], on a thread of its own: signals are seen at once. Work that is left then ends before its next
    /// part.
    pub fn run_apart<T: Send + 'static>(
        self,
        py: Python<'_>,
        work: impl FnOnce(&mut dyn Observer) -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let (send, mut receive) = mpsc::channel();
        let (answer, answers) = mpsc::channel();
        let started = par::start(move || {
            let mut remote = Remote { send: send.clone(), answers };
            let result = catch_unwind(AssertUnwindSafe(|| with_own_pool(|| work(&mut remote))));
            // Nobody may be there any more.
            let _ = send.send(Message::Done(result));
        });
        checked(py, started)?;
        loop {
            let message;
            (message, receive) =
                py.detach(move || (receive.recv_timeout(BETWEEN_SIGNALS), receive));
            match message {
                Ok(Message::Progress(progress)) => {
                    let _ = answer.send(self.call(py, progress)?);
                }
                Ok(Message::Done(Ok(result))) => {
                    py.check_signals()?;
                    return checked(py, result);
                }
                Ok(Message::Done(Err(panic))) => return Err(fault(&*panic)),
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => return Err(fault(&"its thread is gone")),
            }
        }
    }

    fn call(&self, py: Python<'_>, Progress { stage, done, of, .. }: Progress) -> PyResult<bool> {
        py.check_signals()?;
        let Some(callable) = &self.callable else { return Ok(true) };
        let answer = callable.bind(py).call1((name(stage), done, of))?;
        Ok(!answer.extract::<bool>().is_ok_and(|goes_on| !goes_on))
    }
}

fn name(stage: Stage) -> &'static str {
    match stage {
        Stage::Sites => "sites",
        Stage::Labels => "labels",
        Stage::Machining => "machining",
        Stage::Verifying => "verifying",
        Stage::Findings => "findings",
        Stage::Writing => "writing",
    }
}

/// How long a signal may wait.
const BETWEEN_SIGNALS: Duration = Duration::from_millis(50);

/// What work on a thread of its own sends.
enum Message<T> {
    Progress(Progress),
    /// The result, or what a panic has left.
    Done(std::thread::Result<Result<T>>),
}

/// Passes progress on to the thread that waits, and stops if it does not wait any more.
struct Remote<T> {
    send: Sender<Message<T>>,
    answers: Receiver<bool>,
}

impl<T> Observer for Remote<T> {
    fn progress(&mut self, progress: Progress) -> ControlFlow<()> {
        let sent = self.send.send(Message::Progress(progress)).is_ok();
        match sent && self.answers.recv().unwrap_or(false) {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

impl Observer for Watch {
    fn progress(&mut self, progress: Progress) -> ControlFlow<()> {
        match Python::attach(|py| self.call(py, progress)) {
            Ok(true) => ControlFlow::Continue(()),
            Ok(false) => ControlFlow::Break(()),
            Err(raised) => {
                self.raised = Some(raised);
                ControlFlow::Break(())
            }
        }
    }
}
