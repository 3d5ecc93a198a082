//! Long work beside the interpreter: the GIL is free, Ctrl-C is heard, and a forked process gets threads of its own.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use serde::Serialize;

use crate::arrays::to_python;
use crate::progress::{Progress, Shown, WorkMessages};

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

/// Starts work on a thread of its own.
///
/// # Errors
/// `OSError`: the system refuses another thread.
pub(crate) fn start(work: impl FnOnce() + Send + 'static) -> PyResult<()> {
    let named = std::thread::Builder::new().name("sightline".into());
    let started = named.spawn(|| pooled(work));
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
