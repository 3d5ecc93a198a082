//! The library's errors as exceptions: `OSError` for files and devices, with number and file name where the system says
//! them, `MemoryError`, else `ValueError`.

use std::error::Error as StdError;
use std::ffi::CString;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use pyo3::create_exception;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use sightline::engine::BackendError;
use sightline::internals::{FileError, write_whole};
use sightline::job::JobError;
use sightline::problem::ProblemError;
use sightline::psog::PsogError;
use sightline::runs::RunError;
use sightline::scan::ScanError;
use sightline::{Error, Note};

/// The exception for an error of the library, with the library's sentence.
pub(crate) fn raised(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let sentence = in_python(&error.to_string());
    if lacks_memory(&error) {
        PyMemoryError::new_err(sentence)
    } else if let Some((number, file)) = of_system(&error) {
        // Python makes a FileNotFoundError or PermissionError of the number, and tells number and file itself.
        let sentence = sentence.replacen(&format!("{file}: "), "", 1);
        let sentence = sentence.replace(&format!(" (os error {number})"), "");
        PyOSError::new_err((number, sentence.replacen("cannot be read: ", "", 1), file))
    } else if lacks_file_or_device(&error) {
        PyOSError::new_err(sentence)
    } else {
        PyValueError::new_err(sentence)
    }
}

/// The exception for an error of a command.
pub(crate) fn raised_of_run(error: RunError) -> PyErr {
    match error {
        RunError::Library(error) => raised(error),
        other => bad(other.to_string()),
    }
}

/// Writes a file of text, whole at any time.
pub(crate) fn write_text(path: &Path, text: &str) -> PyResult<()> {
    let write = |file: &mut dyn Write| file.write_all(text.as_bytes());
    write_whole(path, |file| write(file).map_err(FileError::io(path))).map_err(raised)
}

/// [`raised`] for a fault in a dict named `what`, without line and column. A fault in a file that the dict names keeps both.
pub(crate) fn raised_of_dict(py: Python<'_>, what: &str, error: impl Into<Error>) -> PyErr {
    let error = raised(error);
    let sentence = error.value(py).to_string();
    match sentence.rsplit_once(" (line 1, column ") {
        Some((told, _)) if sentence.starts_with(&format!("{what}: ")) => bad(told),
        _ => error,
    }
}

/// A `ValueError` with a sentence of the module, or of the library.
pub(crate) fn bad(sentence: impl Into<String>) -> PyErr {
    PyValueError::new_err(in_python(&sentence.into()))
}

/// Phrases of the program, and their words in Python. A phrase stands before a shorter one with the same beginning.
const PHRASES: [(&str, &str); 14] = [
    ("`study targets` with this scene looks", "`detections` looks"),
    ("give it by --vehicle", "give it as vehicle="),
    ("--backend cpu", "backend=\"cpu\""),
    ("--front: ", "objectives: "),
    ("--condition blur: takes", "conditions: blur takes"),
    (
        "the scores of --objective, as in `price,near_gain`",
        "scores, as in [\"price\", \"near_gain\"]",
    ),
    ("--method swaps", "method=\"swaps\""),
    ("--method both", "method=\"both\""),
    ("give it as SCENE", "load it by Scene.load"),
    ("behind the scenes, or by --placement, --baselines or --inject", "to read_placements"),
    ("by --target", "as one of targets="),
    (" (in Python load the scene with one)", " when the scene is loaded"),
    ("give a vehicle with --vehicle", "give vehicle="),
    (
        "(in Python sensors=[…])",
        "(in Python sensors=[…]; random_poses() has the models of space().sensors)",
    ),
];
/// Options of the program that are arguments in Python.
const OPTIONS: [(&str, &str); 16] = [
    ("baselines", "baselines"),
    ("bound", "bound"),
    ("budget", "budget"),
    ("condition", "conditions"),
    ("evaluations", "evaluations"),
    ("fewest", "fewest"),
    ("format", "format"),
    ("frames", "frames"),
    ("inject", "starts"),
    ("max-seconds", "seconds"),
    ("memory", "memory"),
    ("objective", "objective"),
    ("sensor-file", "sensor_files"),
    ("tolerance", "tolerance"),
    ("vehicle", "vehicle"),
    ("base-link", "base_link"),
];

/// A sentence of the library with Python's arguments in place of the program's options.
pub(crate) fn in_python(sentence: &str) -> String {
    let mut told = sentence.to_owned();
    PHRASES.iter().for_each(|(old, new)| told = told.replace(old, new));
    for (option, argument) in OPTIONS {
        let written = format!("--{option}");
        let mut parts = told.split(&written).map(str::to_owned);
        let mut all = parts.next().unwrap_or_default();
        for part in parts {
            all += &match part.chars().next() {
                Some('-' | 'a'..='z') => format!("--{option}{part}"),
                Some(':') => format!("{argument}{part}"),
                Some(' ') if part[1..].starts_with(|c: char| c.is_ascii_digit()) => {
                    format!("{argument}={}", &part[1..])
                }
                _ => format!("{argument}={part}"),
            };
        }
        told = all;
    }
    told
}

/// Warns that a call asks for more frames than there are.
pub(crate) fn warn_of_frames(py: Python<'_>, wanted: usize, count: usize) -> PyResult<()> {
    let is_more = wanted > count;
    let note = || {
        Note::fact(format!("frames: is {wanted}, and the scene has {count}; all of them are used."))
    };
    warn_of(py, is_more.then(note).as_slice())
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
    PyErr::warn(py, &category, &CString::new(in_python(note.text()).replace('\0', ""))?, 1)
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
