//! The library's errors as exceptions: `OSError` for files and devices, with number and file name where the system says
//! them, `MemoryError`, else `ValueError`.

use std::error::Error as StdError;
use std::ffi::CString;
use std::io::{self, ErrorKind};

use pyo3::create_exception;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use sightline::engine::BackendError;
use sightline::job::JobError;
use sightline::problem::ProblemError;
use sightline::psog::PsogError;
use sightline::scan::ScanError;
use sightline::{Error, Note};

/// The exception for an error of the library, with the library's sentence.
pub(crate) fn raised(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let sentence = error.to_string();
    if lacks_memory(&error) {
        PyMemoryError::new_err(sentence)
    } else if let Some((number, file)) = of_system(&error) {
        // Python makes a FileNotFoundError or PermissionError of the number.
        let prefix = format!("{file}: ");
        let sentence = sentence.strip_prefix(&prefix).unwrap_or(&sentence).to_owned();
        PyOSError::new_err((number, sentence, file))
    } else if lacks_file_or_device(&error) {
        PyOSError::new_err(sentence)
    } else {
        PyValueError::new_err(sentence)
    }
}

/// A `ValueError` with a sentence of the module's own.
pub(crate) fn bad(sentence: impl Into<String>) -> PyErr {
    PyValueError::new_err(sentence.into())
}

create_exception!(
    sightline,
    DoubtWarning,
    PyUserWarning,
    "A likely mistake in a file or in poses, such as millimetres in place of metres."
);

/// Most doubts about placements that a call warns of: of a million placements in degrees, the first say enough.
const MOST_WARNINGS: usize = 3;

/// Warns the caller's line in Python of the first placements that are likely mistakes.
pub(crate) fn warn_of_placements(
    py: Python<'_>,
    doubts: impl Iterator<Item = String>,
) -> PyResult<()> {
    doubts.take(MOST_WARNINGS).try_for_each(|doubt| warn(py, &Note::doubt(doubt)))
}

/// Warns the caller's line in Python of every sentence on a file: a `UserWarning` each, doubts a [`DoubtWarning`].
pub(crate) fn warn_of(py: Python<'_>, notes: &[Note]) -> PyResult<()> {
    notes.iter().try_for_each(|note| warn(py, note))
}

fn warn(py: Python<'_>, note: &Note) -> PyResult<()> {
    let category = if note.is_doubt() {
        py.get_type::<DoubtWarning>()
    } else {
        py.get_type::<PyUserWarning>()
    };
    PyErr::warn(py, &category, &CString::new(note.text().replace('\0', ""))?, 1)
}

/// The engine's error, where it is one.
fn of_engine(error: &Error) -> Option<&BackendError> {
    match error {
        Error::Job(error) => error.of_engine(),
        _ => None,
    }
}

fn lacks_memory(error: &Error) -> bool {
    let engine = of_engine(error);
    matches!(engine, Some(BackendError::TooLarge { .. } | BackendError::OutOfMemory(_)))
        || matches!(
            error,
            Error::Job(JobError::Scan(ScanError::OutOfMemory(_)))
                | Error::Problem(ProblemError::OutOfMemory(_))
                | Error::Job(JobError::Grid(PsogError::OutOfMemory(_)))
                | Error::Job(JobError::Problem { source: ProblemError::OutOfMemory(_), .. })
        )
}

/// An error and its causes, one after the other.
fn causes(error: &Error) -> impl Iterator<Item = &(dyn StdError + 'static)> {
    let first: &(dyn StdError + 'static) = error;
    std::iter::successors(Some(first), |&error| error.source())
}

/// Number of the system's error and the file that it is about, where the error is of a file.
fn of_system(error: &Error) -> Option<(i32, String)> {
    let (cause, system) = causes(error).find_map(|cause| {
        let system = cause.source()?.downcast_ref::<io::Error>()?;
        Some((cause, system))
    })?;
    let number = system.raw_os_error().or(match system.kind() {
        ErrorKind::NotFound => Some(2),
        ErrorKind::PermissionDenied => Some(13),
        ErrorKind::NotADirectory => Some(20),
        ErrorKind::IsADirectory => Some(21),
        _ => None,
    })?;
    // Every error of a file begins with its name, and goes on with the system's words.
    let told = cause.to_string();
    let (told, _) = told.split_once(&system.to_string())?;
    let file = told.trim_end_matches(": ").trim_end_matches(": cannot be read");
    Some((number, file.trim_end_matches(": cannot be written").to_owned()))
}

fn lacks_file_or_device(error: &Error) -> bool {
    let engine = of_engine(error);
    matches!(engine, Some(BackendError::NoDevice { .. } | BackendError::Device { .. }))
        || causes(error).any(|cause| cause.is::<io::Error>())
}
