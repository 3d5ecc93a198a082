//! Long work beside the interpreter: the GIL is free, Ctrl-C is heard, a forked process gets threads of its own, and
//! `sightline._progress` shows from the thread that waits how far it is.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SendError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyBool;
use serde::Serialize;

use crate::arguments::shown;
use crate::arrays::to_python;
use crate::errors::{bad, in_python};

/// The process that imported the module. Threads of the shared pool may live in it, and in no copy of it.
static HOME: OnceLock<u32> = OnceLock::new();

/// Remembers this process as the one whose threads are shared; called when the module is imported.
pub(crate) fn remember_home() {
    HOME.get_or_init(std::process::id);
}

/// True in a copy of the process, which a fork has made: threads do not survive a fork.
pub(crate) fn is_forked() -> bool {
    HOME.get().is_some_and(|home| *home != std::process::id())
}

/// Runs work that may use the shared threads; in a forked process on threads of its own, as many as the parent has.
pub(crate) fn pooled<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if !is_forked() {
        return work();
    }
    let threads = rayon::current_num_threads();
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        // Without any thread, work waits for threads that are not there; one is enough.
        Err(error) => {
            panic!("a forked process gets no threads: {error}; use the start method `spawn`")
        }
    }
}

type Job = Box<dyn FnOnce() + Send>;

/// Idle threads, ready for the next call. In this process no thread ends; in a fork they do. The C
/// library gives a new thread what an ended one leaves, and aborts where that thread finds no memory for thread-local variables.
static IDLE: Mutex<Vec<Sender<Job>>> = Mutex::new(Vec::new());

fn idle() -> MutexGuard<'static, Vec<Sender<Job>>> {
    IDLE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts work on a thread of its own.
///
/// # Errors
/// A thread that the system does not give.
pub(crate) fn start(work: impl FnOnce() + Send + 'static) -> PyResult<()> {
    let mut job: Job = Box::new(|| pooled(work));
    // A fork has no threads but the one that forked.
    while let Some(waiting) = (!is_forked()).then(|| idle().pop()).flatten() {
        match waiting.send(job) {
            Ok(()) => return Ok(()),
            Err(SendError(unsent)) => job = unsent,
        }
    }
    let named = std::thread::Builder::new().name("sightline".into());
    let started = named.spawn(move || {
        let (sender, jobs) = channel();
        job();
        // No call there would find it again.
        if is_forked() {
            return;
        }
        idle().push(sender.clone());
        // `sender` is kept, so that it waits for ever.
        for next in &jobs {
            next();
            idle().push(sender.clone());
        }
    });
    started.map(drop).map_err(|error| {
        PyOSError::new_err(format!(
            "cannot start a thread: {error}; raise the limits of memory (ulimit -v) or threads (ulimit -u) of this process"
        ))
    })
}

/// Time between two looks for a signal.
const LOOK: Duration = Duration::from_millis(20);

/// Waits for a value without the GIL, looking for signals in between, and at how far the work is; `None` where the sender
/// is gone.
///
/// # Errors
/// A signal whose handler raises, as Ctrl-C does; an exception of the function that is told of progress.
pub(crate) fn wait<T: Send>(
    py: Python<'_>,
    receiver: &Mutex<Receiver<T>>,
    mut shown: Option<&mut Shown>,
) -> PyResult<Option<T>> {
    let receive = || receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK);
    loop {
        match py.detach(receive) {
            Ok(value) => return Ok(Some(value)),
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals()?;
                shown.as_mut().map_or(Ok(()), |shown| shown.look(py))?;
            }
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}

/// Runs `work` on a thread of its own and waits for it, showing how far it is as calls do that are not told how. A signal
/// that raises stops the watch that `work` gets; `work` goes on in the background until it looks there.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&WorkMessages) -> T + Send + 'static,
) -> PyResult<T> {
    watched(py, Progress::default(), work)
}

/// Like [`interruptible`], and shows how far the work is as `progress` says.
pub(crate) fn watched<T: Send + 'static>(
    py: Python<'_>,
    progress: Progress,
    work: impl FnOnce(&WorkMessages) -> T + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(WorkMessages::default());
    let mut shown = Shown::new(progress, watch.clone());
    let (sender, receiver) = channel();
    let told = watch.clone();
    start(move || drop(sender.send(work(&told))))?;
    let ended = wait(py, &Mutex::new(receiver), Some(&mut shown));
    if ended.is_err() {
        watch.stop();
    }
    // The end of the work is told before an exception that a function raised at its last step.
    let closed = shown.end(py, ended.is_ok());
    let value = ended?;
    closed?;
    value.ok_or_else(|| PyRuntimeError::new_err("the work ended without a result; see stderr"))
}

/// The record that `work` makes, as `dict`s, `list`s and numbers; see [`watched`].
pub(crate) fn answer<'py, T: Serialize + Send + 'static>(
    py: Python<'py>,
    progress: Option<Progress>,
    work: impl FnOnce(&WorkMessages) -> PyResult<T> + Send + 'static,
) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &watched(py, progress.unwrap_or_default(), work)??)
}

/// Time between two looks at how far the work is; shorter work is not shown.
const SHOW: Duration = Duration::from_millis(100);

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
    /// The `Reporter` of the package, once the work has taken [`SHOW`].
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
    pub(crate) fn look(&mut self, py: Python<'_>) -> PyResult<()> {
        if self.looked.elapsed() < SHOW {
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
        logger.call_method1(level, ("%s", in_python(sentence))).map(drop)
    });
}
