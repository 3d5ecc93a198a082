//! Arrays in and out: checked on the way in, moved on the way out; JSON for records that are trees.

use std::fmt::Display;
use std::ops::RangeInclusive;

use numpy::ndarray::{ArrayD, ArrayView2, Ix2};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods,
    PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString, PyTuple};
use serde::Serialize;
use sightline::geom::Pose;

use crate::arguments::{or_raised, room_for, shown, whole_in_words, whole_of_float};
use crate::errors::{bad, json_in_python};

/// Bytes that an element of a Python list takes, at least: a pointer, a number, and its copy in an array.
const LISTED_BYTES: usize = 40;
/// Bytes of the largest number that is taken.
pub(crate) const MOST_BYTES: usize = 8;
/// Axes that an array may have: those of NumPy before 2.
const MOST_AXES: usize = 32;

/// An array of numbers of any real type as one of `T`; `wanted` describes the required shape in words.
///
/// Aligned arrays of that type come without a copy, however they are strided; others are converted.
pub(crate) fn numbers<'py, T: Element>(
    what: &str,
    given: &Bound<'py, PyAny>,
    wanted: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    converted(&real_numbers::<T>(what, given, wanted)?.0)
}

/// An array of whole numbers in `allowed`, of any real type, as values of `T` in C order, and its shape.
pub(crate) fn wholes<T: Element + TryFrom<i128>>(
    what: &str,
    given: &Bound<'_, PyAny>,
    wanted: &str,
    allowed: RangeInclusive<i128>,
) -> PyResult<(Vec<T>, Vec<usize>)> {
    let (array, kind) = real_numbers::<T>(what, given, wanted)?;
    let shape = array.shape().to_vec();
    let checked = |(n, value): (usize, Result<i128, f64>)| {
        let number = value.ok().filter(|number| allowed.contains(number));
        number.and_then(|number| T::try_from(number).ok()).ok_or_else(|| {
            let place: Vec<String> = place(n, &shape).iter().map(ToString::to_string).collect();
            let value = value.map_or_else(|value| format!("{value:?}"), |value| value.to_string());
            let allowed = whole_in_words(&allowed);
            bad(format!("{what}[{}]: is {value}; give {allowed}", place.join(", ")))
        })
    };
    let whole = |value: i128| -> Result<i128, f64> { Ok(value) };
    let values: PyResult<Vec<T>> = match kind {
        'u' => {
            let array = converted::<u64>(&array)?;
            array.as_array().iter().map(|&v| whole(v.into())).enumerate().map(checked).collect()
        }
        'i' => {
            let array = converted::<i64>(&array)?;
            array.as_array().iter().map(|&v| whole(v.into())).enumerate().map(checked).collect()
        }
        _ => {
            let array = converted::<f64>(&array)?;
            let whole = |&v: &f64| whole_of_float(v).ok_or(v);
            array.as_array().iter().map(whole).enumerate().map(checked).collect()
        }
    };
    values.map(|values| (values, shape))
}

/// Index in an array of the element of number `n` in C order.
pub(crate) fn place(mut n: usize, shape: &[usize]) -> Vec<usize> {
    let mut place = vec![0; shape.len()];
    for (at, &length) in place.iter_mut().zip(shape).rev() {
        *at = n % length.max(1);
        n /= length.max(1);
    }
    place
}

/// An object as NumPy sees it: tensors without their gradients, and those of DLPack alone.
fn as_array<'py>(given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let numpy = given.py().import("numpy")?;
    let given = match given.getattr_opt("detach")? {
        Some(detach) => detach.call0()?,
        None => given.clone(),
    };
    let is_shared = given.hasattr("__dlpack__")? && !given.hasattr("__array__")?;
    let make = if is_shared { "from_dlpack" } else { "asarray" };
    Ok(numpy.call_method1(make, (given,))?.cast_into()?)
}

/// An array of real numbers, of which there is room for copies as `T`; and the letter of their kind: `f`, `i` or `u`.
fn real_numbers<'py, T: Element>(
    what: &str,
    given: &Bound<'py, PyAny>,
    wanted: &str,
) -> PyResult<(Bound<'py, PyUntypedArray>, char)> {
    let py = given.py();
    if let (Ok(length), false) = (given.len(), given.hasattr("__array__")?) {
        room_for("lists of numbers", length, LISTED_BYTES)?;
    }
    let array = match as_array(given) {
        Ok(array) => array,
        Err(error) => {
            or_raised(py, error)?;
            return Err(bad(format!("{what}: is no array of numbers; give {wanted}")));
        }
    };
    if py.import("numpy.ma")?.call_method1("is_masked", (given,))?.is_truthy()? {
        let how = "fill them, or leave their rows out";
        return Err(bad(format!("{what}: has masked values, which have no number; {how}")));
    }
    let dtype = array.dtype();
    let kind = dtype.getattr("kind")?.extract::<char>()?;
    // `long double` holds numbers that no type of ours does.
    if !matches!(kind, 'f' | 'i' | 'u') || dtype.itemsize() > MOST_BYTES {
        let real = numpy::dtype::<T>(py);
        return Err(bad(format!(
            "{what}: has the type {dtype}; give {wanted}, as {real} or other real numbers"
        )));
    }
    if array.ndim() > MOST_AXES {
        return Err(bad(format!("{what}: has {} axes; give {wanted}", array.ndim())));
    }
    let elements = array.shape().iter().fold(1, |all: usize, &length| all.saturating_mul(length));
    // Once converted, once in the library's own order.
    room_for("arrays", elements, MOST_BYTES + size_of::<T>())?;
    Ok((array, kind))
}

/// An array as one of `T`, aligned.
fn converted<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = array.py();
    let arguments = (array, numpy::dtype::<T>(py), ["ALIGNED"]);
    let array = py.import("numpy")?.call_method1("require", arguments)?;
    let readonly = array.cast::<PyArrayDyn<T>>()?.try_readonly();
    readonly.map_err(|error| bad(error.to_string()))
}

/// The exception for an array of another shape than `wanted`.
pub(crate) fn misshapen(what: &str, shape: &[usize], wanted: impl Display) -> PyErr {
    bad(format!("{what}: has the shape {shape:?}; give {wanted}"))
}

/// Rows of `width` numbers, `[N, width]`.
pub(crate) fn rows<'a, T: Element>(
    what: &str,
    array: &'a PyReadonlyArrayDyn<'_, T>,
    width: usize,
) -> PyResult<ArrayView2<'a, T>> {
    let shape = array.shape().to_vec();
    match array.as_array().into_dimensionality::<Ix2>() {
        Ok(view) if view.ncols() == width => Ok(view),
        _ => Err(misshapen(what, &shape, format!("[N, {width}]"))),
    }
}

pub(crate) fn column<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    PyArray1::from_vec(py, values)
}

/// Values in rows of `width`, moved.
pub(crate) fn matrix<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = values.len() / width.max(1);
    PyArray1::from_vec(py, values).reshape([count, width])
}

/// `N` numbers, as the corner of a box.
pub(crate) fn few_numbers<const N: usize>(
    what: &str,
    given: &Bound<'_, PyAny>,
) -> PyResult<[f64; N]> {
    let wanted = format!("{N} numbers");
    let array = numbers::<f64>(what, given, &wanted)?;
    let values: Vec<f64> = array.as_array().iter().copied().collect();
    values.try_into().map_err(|_| misshapen(what, array.shape(), wanted))
}

/// Values of any shape, moved.
pub(crate) fn shaped<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = ArrayD::from_shape_vec(shape, values);
    Ok(array.map_err(|error| bad(error.to_string()))?.into_pyarray(py))
}

/// A pose as a 4 × 4 matrix that takes column vectors of the inner frame to the outer one.
pub(crate) fn homogeneous<'py>(
    py: Python<'py>,
    pose: &Pose,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (r, t) = (pose.rotation.transpose().to_cols_array_2d(), pose.translation.to_array());
    let mut values = Vec::with_capacity(16);
    for k in 0..3 {
        values.extend(r[k]);
        values.push(t[k]);
    }
    values.extend([0.0, 0.0, 0.0, 1.0]);
    matrix(py, values, 4)
}

/// A record as `dict`s, `list`s and numbers; its sentences have Python's words.
pub(crate) fn to_python<'py>(
    py: Python<'py>,
    record: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(record).map_err(|error| bad(error.to_string()))?;
    py.import("json")?.call_method1("loads", (json_in_python(text),))
}

/// A Python object as JSON text, arrays and numbers of NumPy as lists and numbers; `what` names it in errors.
pub(crate) fn to_text(what: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    let options = PyDict::new(given.py());
    options.set_item("allow_nan", false)?;
    options.set_item("default", given.py().import("sightline._extra")?.getattr("plain")?)?;
    let dumps = given.py().import("json")?.getattr("dumps")?;
    let text = dumps.call((given,), Some(&options));
    let fault = |error| {
        bad(no_json(given, what, 0).unwrap_or_else(|| format!("{what}: is not JSON: {error}")))
    };
    text.map_err(fault)?.extract()
}

/// Sentence on the first value in dicts and lists that JSON does not have, with its place, as `scene.roi.min[0]`.
fn no_json(given: &Bound<'_, PyAny>, at: &str, depth: usize) -> Option<String> {
    /// Deepest list or dict: one that holds itself has no end.
    const DEEPEST: usize = 64;
    if depth > DEEPEST {
        return None;
    }
    if let Ok(dict) = given.cast::<PyDict>() {
        let mut items = dict.iter();
        return items.find_map(|(key, value)| {
            if !key.is_instance_of::<PyString>() {
                return Some(format!("{at}: has the key {}; give texts as keys", shown(&key)));
            }
            no_json(&value, &format!("{at}.{key}"), depth + 1)
        });
    }
    if given.hasattr("tolist").unwrap_or(false) {
        return no_json(&given.call_method0("tolist").ok()?, at, depth + 1);
    }
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        let mut items = given.try_iter().ok()?.flatten().enumerate();
        return items.find_map(|(k, value)| no_json(&value, &format!("{at}[{k}]"), depth + 1));
    }
    if given.is_none() || given.is_instance_of::<PyString>() {
        return None;
    }
    match given.extract::<f64>() {
        Ok(number) if number.is_finite() => None,
        Ok(number) => Some(format!("{at}: is {number}; give a finite number")),
        Err(_) => {
            let wanted = "a number, a text, a list or a dict, as JSON has them";
            Some(format!("{at}: is {}; give {wanted}", shown(given)))
        }
    }
}
