//! Arguments as numbers of the library: whole and in range, or a `ValueError` with name, value and range.
//!
//! Sizes are known before memory is taken for them: [`room_for`] raises `MemoryError` where they do not fit.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use lidar_cast::memory;
use pyo3::PyClass;
use pyo3::exceptions::{
    PyArithmeticError, PyAttributeError, PyBufferError, PyLookupError, PyMemoryError,
    PyNotImplementedError, PyTypeError, PyValueError,
};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};
use sightline::job::Tolerance;
use sightline::problem::spread;
use sightline::vehicle::FARTHEST_ON_VEHICLE;

use crate::arrays::{MOST_BYTES, few_numbers, wholes};
use crate::errors::{bad, warn_of_frames};
use crate::sensors::PyVehicle;

/// Longest value in a message, in characters.
const LONGEST: usize = 60;
/// Most placements and beams of a call: a zero too many is an error, not days of work.
const MOST: i128 = 1_000_000_000;
const THREADS_A_CORE: i128 = 4;
/// Threads that any machine may be asked for, as in the program.
const THREADS_ANYWHERE: i128 = 16;
/// Sizes below this many bytes are not checked: the check takes longer than they do.
const FEW_BYTES: u128 = 1 << 20;

/// Converters of whole numbers: converter, argument, type, least and most.
macro_rules! whole_numbers {
    ($($name:ident = $what:literal: $kind:ty, $least:expr, $most:expr;)*) => {$(
        pub(crate) fn $name(given: &Bound<'_, PyAny>) -> PyResult<$kind> {
            whole($what, given, $least as i128..=$most as i128)
        }
    )*};
}

/// Converters of whole numbers that may be `None`.
macro_rules! maybe_whole_numbers {
    ($($name:ident: $kind:ty, $least:expr, $most:expr;)*) => {$(
        pub(crate) fn $name(given: &Bound<'_, PyAny>) -> PyResult<Option<$kind>> {
            maybe(given, |given| whole(stringify!($name), given, $least as i128..=$most as i128))
        }
    )*};
}

/// Converters of finite numbers that may be `None`: converter, wanted value in words, and its rule.
macro_rules! maybe_reals {
    ($($name:ident: $wanted:literal, $is_allowed:expr;)*) => {$(
        pub(crate) fn $name(given: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
            maybe(given, |given| real(stringify!($name), given, $wanted, $is_allowed))
        }
    )*};
}

/// Converters of paths: texts, bytes and what has `__fspath__`.
macro_rules! paths {
    ($($name:ident = $what:literal;)*) => {$(
        pub(crate) fn $name(given: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
            path_of($what, given)
        }
    )*};
}

paths! {
    path = "path";
    folder_path = "folder";
    out_path = "out";
}

/// The argument `folder`, which may be `None`.
pub(crate) fn folder(given: &Bound<'_, PyAny>) -> PyResult<Option<PathBuf>> {
    maybe(given, folder_path)
}

/// The argument `vehicle` of a scene: a file, or a `Vehicle`, which is read again.
pub(crate) fn vehicle(given: &Bound<'_, PyAny>) -> PyResult<Option<PathBuf>> {
    if let Ok(vehicle) = given.cast::<PyVehicle>() {
        return Ok(Some(vehicle.get().file()));
    }
    if given.is_instance_of::<PyDict>() {
        let how = "write it to a file, or put it under `vehicle` of the dict of Scene.from_dict";
        return Err(bad(format!("vehicle: is a dict; {how}")));
    }
    maybe(given, |given| path_of("vehicle", given))
}

/// The argument `sensor_files`, which may be `None`.
pub(crate) fn sensor_files(given: &Bound<'_, PyAny>) -> PyResult<Option<Vec<PathBuf>>> {
    maybe(given, |given| {
        let files = entries("sensor_files", given, "a list of paths")?.into_iter().enumerate();
        files.map(|(k, file)| path_of(&format!("sensor_files[{k}]"), &file)).collect()
    })
}

/// A file of placements or the folder of a run, as text.
pub(crate) fn placement_file(given: &Bound<'_, PyAny>) -> PyResult<String> {
    let wanted = "a Placement, or the path of a file of placements or of a run's folder";
    text_of("placement", path_or("placement", given, wanted)?)
}

/// A path as text.
fn text_of(what: &str, path: PathBuf) -> PyResult<String> {
    let text = path.into_os_string().into_string();
    text.map_err(|_| bad(format!("{what}: the path is not UTF-8; rename the file")))
}

fn path_of(what: &str, given: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    path_or(what, given, "a path as text or Path")
}

fn path_or(what: &str, given: &Bound<'_, PyAny>, wanted: &str) -> PyResult<PathBuf> {
    match given.py().import("os")?.call_method1("fsdecode", (given,)) {
        Ok(text) => text.extract(),
        Err(error) => {
            or_raised(given.py(), error)?;
            Err(bad(format!("{what}: is {}; give {wanted}", shown(given))))
        }
    }
}

/// The argument `callback`: a function or `None`.
pub(crate) fn callback(given: &Bound<'_, PyAny>) -> PyResult<Option<Py<PyAny>>> {
    if !given.is_none() && !given.is_callable() {
        return Err(bad(format!("callback: is {}; give a function or None", shown(given))));
    }
    maybe(given, |given| Ok(given.clone().unbind()))
}

/// The argument `objectives` of a front.
pub(crate) fn objectives(given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    texts("objectives", given)
}

/// Presets and files of targets, as texts or paths.
pub(crate) fn targets(given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    let is_text = |one: &Bound<'_, PyAny>| one.is_instance_of::<PyString>();
    if is_text(given) {
        return texts("targets", given);
    }
    let all = entries("targets", given, "a list of presets and paths")?.into_iter().enumerate();
    let named = all.map(|(k, one)| match is_text(&one) {
        true => one.extract(),
        false => {
            let what = format!("targets[{k}]");
            text_of(&what, path_of(&what, &one)?)
        }
    });
    named.collect()
}

/// Converters of lists of texts that may be `None`: converter and argument.
macro_rules! maybe_texts {
    ($($name:ident = $what:literal;)*) => {$(
        pub(crate) fn $name(given: &Bound<'_, PyAny>) -> PyResult<Option<Vec<String>>> {
            maybe(given, |given| texts($what, given))
        }
    )*};
}

whole_numbers! {
    beams = "beams": u32, 1, u32::MAX;
    count = "count": usize, 0, MOST;
    drawn = "n": usize, 0, MOST;
    evaluations = "evaluations": u64, 1, u64::MAX;
    evaluations_around = "evaluations": u64, 0, u64::MAX;
    // The scene says how many frames it has.
    frame = "frame": i128, i128::MIN, i128::MAX;
    frame_from_0 = "frame": u32, 0, u32::MAX;
    hostile = "hostile": usize, 0, MOST;
    least_shared = "least_shared": u64, 1, u64::MAX;
    random = "random": usize, 0, MOST;
    sample = "sample": u64, 0, MOST;
    seed = "seed": u64, 0, u64::MAX;
    study_random = "random": u32, 2, 100_000;
    steps = "steps": u32, 1, 1000;
    counted_frames = "frames": u32, 0, u32::MAX;
    verified_frames = "frames": u32, 1, u32::MAX;
}

maybe_whole_numbers! {
    azimuth_steps: u32, 1, 100_000;
    frames: u32, 1, u32::MAX;
    memory: u64, 1, u64::MAX;
    of_frames: u32, 1, u32::MAX;
    population: usize, 4, 10_000;
    window: u32, 0, u32::MAX;
}

maybe_reals! {
    bound: "per cent, 0 to 100, or None", |percent| (0.0..=100.0).contains(&percent);
    budget: "a price from 0 to 1e12, or None", |price| (0.0..=1e12).contains(&price);
    range: "metres, more than 0, or None", |metres| metres > 0.0;
    reach: "metres, 0 or more, or None", |metres| metres >= 0.0;
    seconds: "more than 0 and less than 10⁹, or None", |seconds| seconds > 0.0 && seconds < 1e9;
    target: "a finite number or None", |_| true;
}

maybe_texts! {
    conditions = "conditions";
    frame_names = "frames";
    moving = "moving";
    sensors = "sensors";
}

fn maybe<T>(
    given: &Bound<'_, PyAny>,
    read: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>,
) -> PyResult<Option<T>> {
    if given.is_none() { Ok(None) } else { read(given).map(Some) }
}

/// The argument `margin` of a hand-over.
pub(crate) fn margin(given: &Bound<'_, PyAny>) -> PyResult<f64> {
    real("margin", given, "metres, 0 to 10", |metres| (0.0..=10.0).contains(&metres))
}

/// The argument `base_link`: its position in the ego frame, or `None`.
pub(crate) fn base_link(given: &Bound<'_, PyAny>) -> PyResult<Option<[f64; 3]>> {
    maybe(given, |given| {
        let place: [f64; 3] = few_numbers("base_link", given)?;
        if place.iter().all(|metres| metres.abs() <= FARTHEST_ON_VEHICLE) {
            return Ok(place);
        }
        let most = format!("metres, at most {FARTHEST_ON_VEHICLE} from the ego origin");
        Err(bad(format!("base_link: is {place:?}; give x, y, z in {most}")))
    })
}

/// The argument of `set_threads`: at most [`THREADS_A_CORE`] for each core, and [`THREADS_ANYWHERE`] on any machine.
pub(crate) fn threads(given: &Bound<'_, PyAny>) -> PyResult<usize> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    whole("count", given, 1..=(THREADS_A_CORE * cores as i128).max(THREADS_ANYWHERE))
}

/// The argument `objective` of calls that take no function.
pub(crate) fn objective_in_words<'a>(given: &'a Bound<'_, PyAny>) -> PyResult<&'a str> {
    let text = given.cast::<PyString>().map_err(|_| {
        let found = shown(given);
        bad(format!(
            "objective: is {found}; give the name of a score or a weighted sum of scores as text"
        ))
    })?;
    text.to_str()
}

/// The argument `tolerance`: a length and an angle as text, or `None`.
pub(crate) fn tolerance(given: &Bound<'_, PyAny>) -> PyResult<Option<Tolerance>> {
    maybe(given, |given| {
        let text = given.cast::<PyString>().ok().map(|text| text.to_str()).transpose()?;
        let wanted = "a length and an angle as text, such as \"5mm,0.5deg\", or None";
        let wrong = || bad(format!("tolerance: is {}; give {wanted}", shown(given)));
        text.ok_or_else(wrong)?.parse().map_err(|why| bad(format!("tolerance: {why}")))
    })
}

/// Objective of a search.
pub(crate) enum Aim {
    /// The name of a score, or a weighted sum of scores.
    Text(String),
    Function(Py<PyAny>),
}

pub(crate) fn objective(given: &Bound<'_, PyAny>) -> PyResult<Aim> {
    if given.is_callable() {
        return Ok(Aim::Function(given.clone().unbind()));
    }
    objective_in_words(given).map(|text| Aim::Text(text.to_owned()))
}

pub(crate) fn classes(given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    texts("classes", given)
}

/// Objects of the module in a list; `None` where it does not begin with one.
pub(crate) fn listed<'py, T: PyClass>(
    what: &str,
    given: &Bound<'py, PyAny>,
    wanted: &str,
) -> PyResult<Option<Vec<Bound<'py, T>>>> {
    let is_first = given.len().is_ok_and(|length| length > 0)
        && given.get_item(0).is_ok_and(|first| first.is_instance_of::<T>());
    if !is_first {
        return Ok(None);
    }
    let items = given.try_iter()?.take(given.len()?).enumerate().map(|(k, item)| {
        let item = item?.cast_into::<T>();
        item.map_err(|_| bad(format!("{what}[{k}]: is not {wanted}; give a list of them alone")))
    });
    items.collect::<PyResult<_>>().map(Some)
}

/// Numbers of frames of a scene that has `count`: all for `None`, so many spread evenly from the first on for a number,
/// those that a list names.
pub(crate) fn which_frames(given: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Vec<usize>> {
    let Some(given) = given else { return Ok((0..count).collect()) };
    if given.len().is_ok() {
        return Ok(wholes("frames", given, "numbers of frames", 0..=count as i128 - 1)?.0);
    }
    let wanted = whole("frames", given, 1..=u32::MAX as i128)?;
    warn_of_frames(given.py(), wanted as usize, count)?;
    Ok(spread(count, Some(wanted)))
}

pub(crate) fn texts(what: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    // A text is a list of letters in Python.
    let letters = given.is_instance_of::<PyString>();
    let length = given.len().ok().filter(|_| !letters);
    let wrong = || bad(format!("{what}: is {}; give a list of texts", shown(given)));
    let mut texts = Vec::new();
    for (k, text) in given.try_iter().map_err(|_| wrong())?.enumerate() {
        if length.is_none_or(|length| k >= length) {
            return Err(wrong());
        }
        let text = text?;
        match text.extract::<String>() {
            Ok(text) => texts.push(text),
            Err(_) => {
                return Err(bad(format!("{what}[{k}]: is {}; give a text", shown(&text))));
            }
        }
    }
    Ok(texts)
}

/// Entries of a list, as many as it says it has.
pub(crate) fn entries<'py>(
    what: &str,
    given: &Bound<'py, PyAny>,
    wanted: &str,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let found = given.len().and_then(|length| {
        room_for("lists", length, size_of::<Bound<'_, PyAny>>())?;
        (0..length).map(|k| given.get_item(k)).collect()
    });
    found.or_else(|error| {
        or_raised(given.py(), error)?;
        Err(bad(format!("{what}: is {}; give {wanted}", shown(given))))
    })
}

/// A whole number in `allowed`: an `int`, or a float without a fraction; no `bool`.
pub(crate) fn whole<T: TryFrom<i128>>(
    what: &str,
    given: &Bound<'_, PyAny>,
    allowed: RangeInclusive<i128>,
) -> PyResult<T> {
    let number = exact(given)?.filter(|number| allowed.contains(number));
    number.and_then(|number| T::try_from(number).ok()).ok_or_else(|| {
        let wanted = whole_in_words(&allowed);
        bad(format!("{what}: is {}; give {wanted}", shown(given)))
    })
}

pub(crate) fn whole_in_words(allowed: &RangeInclusive<i128>) -> String {
    let (least, most) = (*allowed.start(), *allowed.end());
    if most == i128::MAX {
        return "a whole number".to_owned();
    }
    format!("a whole number, {least} to {most}")
}

/// The whole number that a float is.
pub(crate) fn whole_of_float(value: f64) -> Option<i128> {
    // 2¹²⁷ in size: all that `i128` holds.
    (value.fract() == 0.0 && value.abs() < 1.7e38).then_some(value as i128)
}

/// True for one number of a real type: no truth value, text, or array with axes.
///
/// Python takes truth values for whole numbers; NumPy takes texts, and arrays of one element, for numbers.
fn is_one_number(given: &Bound<'_, PyAny>) -> PyResult<bool> {
    if given.is_instance_of::<PyBool>() {
        return Ok(false);
    }
    let Some(dtype) = given.getattr_opt("dtype")? else { return Ok(true) };
    let has_no_axes = match given.getattr_opt("ndim")? {
        Some(axes) => axes.eq(0)?,
        None => true,
    };
    // PyTorch names its types; NumPy has a letter for their kind. A `long double` is rounded where it is read.
    let is_real = match dtype.getattr_opt("kind")? {
        Some(kind) => {
            let bytes = dtype.getattr("itemsize")?.extract::<usize>()?;
            bytes <= MOST_BYTES && ["i", "u", "f"].iter().any(|real| kind.eq(real).unwrap_or(false))
        }
        None => {
            let name = dtype.str()?;
            let name = name.to_string_lossy();
            !name.contains("bool") && !name.contains("complex")
        }
    };
    Ok(has_no_axes && is_real)
}

/// The whole number that an object stands for; `None` where it stands for none.
fn exact(given: &Bound<'_, PyAny>) -> PyResult<Option<i128>> {
    if !is_one_number(given)? {
        return Ok(None);
    }
    match given.extract::<i128>() {
        Ok(number) => return Ok(Some(number)),
        Err(error) => or_raised(given.py(), error)?,
    }
    match given.extract::<f64>() {
        Ok(value) => Ok(whole_of_float(value)),
        Err(error) => or_raised(given.py(), error).map(|()| None),
    }
}

/// A finite number that `is_allowed`.
fn real(
    what: &str,
    given: &Bound<'_, PyAny>,
    wanted: &str,
    is_allowed: fn(f64) -> bool,
) -> PyResult<f64> {
    let value = match is_one_number(given)?.then(|| given.extract::<f64>()).transpose() {
        Ok(value) => value,
        Err(error) => or_raised(given.py(), error).map(|()| None)?,
    };
    value
        .filter(|&value| value.is_finite() && is_allowed(value))
        .ok_or_else(|| bad(format!("{what}: is {}; give {wanted}", shown(given))))
}

/// Raises an error that does not depend on the argument's value, such as Ctrl-C or a lack of memory.
pub(crate) fn or_raised(py: Python<'_>, error: PyErr) -> PyResult<()> {
    let of_value = error.is_instance_of::<PyTypeError>(py)
        || error.is_instance_of::<PyValueError>(py)
        || error.is_instance_of::<PyArithmeticError>(py)
        || error.is_instance_of::<PyAttributeError>(py)
        || error.is_instance_of::<PyLookupError>(py)
        || error.is_instance_of::<PyBufferError>(py)
        // Views of memory of several axes have no rows to give.
        || error.is_instance_of::<PyNotImplementedError>(py);
    if of_value { Ok(()) } else { Err(error) }
}

/// A value as Python writes it, cut where it is long.
pub(crate) fn shown(given: &Bound<'_, PyAny>) -> String {
    let Ok(text) = given.repr() else {
        // Python refuses to write whole numbers of thousands of digits.
        let kind = given.get_type();
        return kind.name().map_or("unknown".to_owned(), |name| format!("of the type {name}"));
    };
    let text = text.to_string_lossy();
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.into_owned(),
    }
}

/// Raises `MemoryError` where `count` elements of `each` bytes do not fit into memory that is left.
pub(crate) fn room_for(what: &'static str, count: usize, each: usize) -> PyResult<()> {
    let bytes = count as u128 * each as u128;
    if bytes < FEW_BYTES {
        return Ok(());
    }
    let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
    memory::check(what, bytes).map_err(|error| PyMemoryError::new_err(error.to_string()))
}
