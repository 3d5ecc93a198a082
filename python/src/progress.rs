//! How far long work is: noted by the thread that works, shown by `sightline._progress` from the one that waits.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::arguments::shown;
use crate::errors::bad;

/// Time between two looks at how far the work is; shorter work is not shown.
const LOOK: Duration = Duration::from_millis(100);

/// Steps done of a kind of work.
#[derive(Clone, Default, PartialEq)]
struct Reached {
    work: String,
    done: u64,
    total: u64,
}

/// Messages between a thread that works and the one that waits for it.
#[derive(Default)]
pub(crate) struct WorkMessages {
    stop: AtomicBool,
    reached: Mutex<Reached>,
}

impl WorkMessages {
    /// False once the caller no longer waits for the result.
    pub(crate) fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::SeqCst)
    }

    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::SeqCst);
    }

    /// Notes how far the work is; returns whether to go on. `work` names its steps, as `placements`.
    pub(crate) fn reach(&self, work: &str, done: usize, total: usize) -> bool {
        let mut reached = self.reached.lock().unwrap_or_else(PoisonError::into_inner);
        if reached.work != work {
            work.clone_into(&mut reached.work);
        }
        (reached.done, reached.total) = (done as u64, total as u64);
        self.goes_on()
    }

    fn reached(&self) -> Reached {
        self.reached.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The argument `progress`: `None`, `True`, `False` or a function.
#[derive(Default)]
pub(crate) struct Progress(pub Option<Py<PyAny>>);

impl FromPyObject<'_, '_> for Progress {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        if given.is_none() || given.is_instance_of::<PyBool>() || given.is_callable() {
            return Ok(Self((!given.is_none()).then(|| given.to_owned().unbind())));
        }
        let found = shown(&given);
        Err(bad(format!("progress: is {found}; give True, False, None or a function")))
    }
}

/// Shows how far work is while it is waited for.
pub(crate) struct Shown {
    progress: Progress,
    watch: Arc<WorkMessages>,
    begun: Instant,
    looked: Instant,
    /// The `Reporter` of the package, once the work has taken [`LOOK`].
    reporter: Option<Py<PyAny>>,
    told: Reached,
}

impl Shown {
    pub(crate) fn new(progress: Progress, watch: Arc<WorkMessages>) -> Self {
        let now = Instant::now();
        let told = Reached::default();
        Self { progress, watch, begun: now, looked: now, reporter: None, told }
    }

    /// Tells the reporter of the progress since the last time, at most ten times a second.
    ///
    /// # Errors
    /// An exception of the caller's function, which is not called again.
    pub(crate) fn look(&mut self, py: Python<'_>) -> PyResult<()> {
        if self.looked.elapsed() < LOOK {
            return Ok(());
        }
        self.looked = Instant::now();
        self.tell(py)
    }

    fn tell(&mut self, py: Python<'_>) -> PyResult<()> {
        let reached = self.watch.reached();
        if reached == self.told || self.is_off(py) {
            return Ok(());
        }
        let reporter = match &self.reporter {
            Some(reporter) => reporter.bind(py).clone(),
            None => {
                let class = py.import("sightline._progress")?.getattr("Reporter")?;
                let made = class.call1((&self.progress.0, self.begun.elapsed().as_secs_f64()))?;
                self.reporter = Some(made.clone().unbind());
                made
            }
        };
        let told = reporter.call1((&reached.work, reached.done, reached.total));
        self.told = reached;
        if told.is_err() {
            self.progress = Progress(Some(PyBool::new(py, false).to_owned().into_any().unbind()));
        }
        told.map(drop)
    }

    fn is_off(&self, py: Python<'_>) -> bool {
        let given = self.progress.0.as_ref().map(|given| given.bind(py));
        given.is_some_and(|given| {
            given.is_instance_of::<PyBool>() && !given.is_truthy().unwrap_or(true)
        })
    }

    /// Tells of the last step where the work `is_done`, and takes a bar away.
    pub(crate) fn end(mut self, py: Python<'_>, is_done: bool) -> PyResult<()> {
        let asked = self.progress.0.as_ref().is_some_and(|given| given.bind(py).is_callable());
        let is_told = is_done && (asked || self.reporter.is_some());
        let told = if is_told { self.tell(py) } else { Ok(()) };
        if let Some(reporter) = &self.reporter {
            reporter.call_method0(py, "close")?;
        }
        told
    }
}

/// Hands a sentence of the library to the logger `sightline`, from any thread; `level` is `info` or `warning`.
pub(crate) fn log(level: &str, sentence: &str) {
    // A thread that outlives the interpreter has nobody to tell.
    let _ = Python::try_attach(|py| -> PyResult<()> {
        let logger = py.import("sightline._progress")?.getattr("logger")?;
        logger.call_method1(level, ("%s", sentence)).map(drop)
    });
}
