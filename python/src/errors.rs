//! The library's errors as exceptions: `OSError` for files and devices, `MemoryError`, else `ValueError`.

use std::error::Error as StdError;

use pyo3::PyErr;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyValueError};
use sightline::engine::{BackendError, OutOfMemory};

/// The exception for an error of the library, with the library's sentence.
pub fn raised(error: impl Into<sightline::Error>) -> PyErr {
    let error = error.into();
    let sentence = error.to_string();
    let mut cause: Option<&(dyn StdError + 'static)> = Some(&error);
    while let Some(error) = cause {
        if error.is::<std::io::Error>() {
            return PyOSError::new_err(sentence);
        }
        if error.is::<OutOfMemory>() {
            return PyMemoryError::new_err(sentence);
        }
        match error.downcast_ref::<BackendError>() {
            Some(BackendError::NoDevice { .. } | BackendError::Device { .. }) => {
                return PyOSError::new_err(sentence);
            }
            Some(BackendError::TooLarge { .. } | BackendError::OutOfMemory(_)) => {
                return PyMemoryError::new_err(sentence);
            }
            _ => cause = error.source(),
        }
    }
    PyValueError::new_err(sentence)
}

/// A `ValueError` with a sentence of the module's own.
pub fn bad(sentence: impl Into<String>) -> PyErr {
    PyValueError::new_err(sentence.into())
}
