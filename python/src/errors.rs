//! The library's errors as exceptions: `OSError` for files and devices, with number and file name where the system says
//! them, `MemoryError`, else `ValueError`.

use std::error::Error as StdError;
use std::ffi::CString;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use pyo3::create_exception;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use serde_json::json;
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
const PHRASES: [(&str, &str); 42] = [
    ("`study targets` with this scene looks", "`detections` looks"),
    ("`sightline score` tells", "`Scene.score` tells"),
    ("`sightline psog build` writes it", "`Psog.save` writes it"),
    ("`sightline study regions --help`", "help(sightline.study)"),
    ("sightline study loss", "sightline.study(\"loss\", …)"),
    ("sightline optimize", "sightline.optimize"),
    ("with --budget PRICE", "with budget=PRICE"),
    (
        "give --vehicle FILE for level ground, or a scene before the placements",
        "give vehicle= or scene=",
    ),
    ("give it by --vehicle", "give it as vehicle="),
    ("give a vehicle with --vehicle", "give vehicle="),
    ("give --vehicle ", "give vehicle="),
    ("each --", "each of --"),
    ("for the --box", "in --box"),
    ("--backend cpu", "backend=\"cpu\""),
    ("--backend gpu", "backend=\"gpu\""),
    ("--front: ", "objectives: "),
    ("`--front price,near_gain`", "`sightline.front`"),
    ("`sightline rig import` reads", "`Rig.load` reads"),
    ("--condition blur: takes", "conditions: blur takes"),
    (
        "the scores of --objective, as in `price,near_gain`",
        "scores, as in [\"price\", \"near_gain\"]",
    ),
    ("raise --memory, widen --delta or use fewer --threads", "raise memory=, or lower set_threads"),
    ("widen --delta, or take --method both", "or take method=\"both\""),
    ("; widen --delta", "; narrow the mounts"),
    ("--method swaps", "method=\"swaps\""),
    ("(--fidelity full)", "(frames=\"all\")"),
    ("more time (--resume goes on)", "more seconds="),
    ("go on with --resume and more time", "search again with more time"),
    ("--fewest` looks", "fewest=True` looks"),
    ("--fewest</code> looks", "fewest=True</code> looks"),
    ("give it as SCENE", "load it by Scene.load"),
    ("behind the scenes, or by --placement, --baselines or --inject", "to read_placements"),
    ("by --target", "as one of targets="),
    (" (in Python load the scene with one)", " when the scene is loaded"),
    ("as FILE:NAME (in Python name=NAME)", "as name=NAME"),
    ("give sensors=[…]", "give sensors=[…]; random_poses() has the models of space().sensors"),
    (", or give --force", ""),
    (", or give --trust-paths if you trust the file that refers to it", ""),
    ("set of `--layout", "set of `python -m sightline scan --layout"),
    ("--max-seconds for a run", "seconds= for a search"),
    ("--base-frame ", "base_frame="),
    ("give --frame 0 to ", "give frame=0 to "),
    ("leave out --frame", "leave out frame="),
];
/// Options of the program that are arguments in Python.
const OPTIONS: [(&str, &str); 19] = [
    ("base-link", "base_link"),
    ("baselines", "baselines"),
    ("bound", "bound"),
    ("box", "regions"),
    ("budget", "budget"),
    ("condition", "conditions"),
    ("evaluations", "evaluations"),
    ("fewest", "fewest"),
    ("format", "format"),
    ("frame", "frames"),
    ("frames", "frames"),
    ("inject", "starts"),
    ("max-seconds", "seconds"),
    ("memory", "memory"),
    ("objective", "objective"),
    ("seed", "seed"),
    ("sensor-file", "sensor_files"),
    ("tolerance", "tolerance"),
    ("vehicle", "vehicle"),
];

/// A sentence of the library with Python's arguments in place of the program's options.
#[pyfunction(name = "_in_python")]
pub(crate) fn in_python(sentence: &str) -> String {
    let mut told = with_own_words(sentence);
    PHRASES.iter().for_each(|(old, new)| told = told.replace(old, new));
    told = with_models(&told);
    for (option, argument) in OPTIONS {
        let written = format!("--{option}");
        let mut parts = told.split(&written).map(str::to_owned);
        let mut all = parts.next().unwrap_or_default();
        for part in parts {
            all += &match part.chars().next() {
                Some('-' | 'a'..='z') => format!("--{option}{part}"),
                Some(':' | '=') => format!("{argument}{part}"),
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

/// A sentence that has an argument of Python beside an option, `--sensor 0=a (in Python sensors=[…])`, with that alone.
fn with_own_words(sentence: &str) -> String {
    let found = sentence.split_once(" (in Python ").and_then(|(before, after)| {
        let (words, after) = after.split_once(')').filter(|(words, _)| words.contains('='))?;
        let before = &before[..before.rfind("--")?];
        Some(format!("{}{words}{after}", before.strip_suffix('`').unwrap_or(before)))
    });
    found.unwrap_or_else(|| sentence.to_owned())
}

/// A sentence with models by frame as Python takes them, `models={"top": "MODEL"}`, and with the last word alone of the command
/// of a hand-over. No argument has the height of an optical centre.
fn with_models(sentence: &str) -> String {
    let mut told = sentence.to_owned();
    if let Some((before, after)) = told.split_once("`sightline rig handover ") {
        let (command, after) = after.split_once('`').unwrap_or((after, ""));
        let last = command.rsplit_once(' ').map_or(command, |(_, last)| last);
        told = format!("{before}`{last}`{after}");
    }
    let end = |text: &str| text.find([' ', ',', ';']).unwrap_or(text.len());
    if let Some((before, after)) = told.split_once(" or --optical-height ") {
        told = format!("{before}{}", &after[end(after)..]);
    }
    if let Some((before, after)) = told.split_once("give --optical-height ") {
        told = format!("{before}add it to z of `poses`{}", &after[end(after)..]);
    }
    while let Some((before, after)) = told.split_once("--sensor") {
        if after.starts_with("-file") {
            break;
        }
        let (choice, rest) = match after.strip_prefix(' ') {
            Some(given) => given.split_at(end(given)),
            None => ("", after),
        };
        told = match choice.split_once('=') {
            Some((frame, model)) => format!("{before}models={{\"{frame}\": \"{model}\"}}{rest}"),
            None => format!("{before}models={after}"),
        };
    }
    told
}

/// JSON whose sentences have Python's words. Numbers and names stay to the bit.
pub(crate) fn json_in_python(json: String) -> String {
    if !json.contains("--") && !json.contains("`sightline ") {
        return json;
    }
    let (mut told, mut rest) = (String::with_capacity(json.len()), &*json);
    while let Some(start) = rest.find('"') {
        let mut is_escaped = false;
        let is_end = |letter: char| {
            let is_end = letter == '"' && !is_escaped;
            is_escaped = letter == '\\' && !is_escaped;
            is_end
        };
        let Some(length) = rest[start + 1..].find(is_end) else { break };
        let (literal, after) = rest[start..].split_at(length + 2);
        told += &rest[..start];
        let text = serde_json::from_str(literal).ok().filter(|text: &String| text.contains(' '));
        told += &text.map_or(literal.to_owned(), |text| json!(in_python(&text)).to_string());
        rest = after;
    }
    told + rest
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
