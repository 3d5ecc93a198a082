//! Arrays in and out: checked on the way in, moved on the way out.

use numpy::ndarray::{ArrayD, ArrayView2, Ix2};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sightline::geom::Pose;

use crate::errors::bad;

/// An array of numbers of any real type as one of `T`; `shape` says in words what is wanted.
///
/// Arrays of that type come without a copy, however they are strided; others are converted.
pub fn numbers<'py, T: Element>(
    what: &str,
    given: &Bound<'py, PyAny>,
    wanted: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = given.py();
    let numpy = py.import("numpy")?;
    let is_jagged = |_| bad(format!("{what}: is no array of numbers; give {wanted}"));
    let array = numpy.call_method1("asarray", (given,)).map_err(is_jagged)?;
    let untyped = array.cast::<PyUntypedArray>()?;
    let kind = untyped.dtype().getattr("kind")?.extract::<String>()?;
    if !matches!(kind.as_str(), "f" | "i" | "u") {
        let dtype = untyped.dtype();
        let real = numpy::dtype::<T>(py);
        return Err(bad(format!(
            "{what}: has the type {dtype}; give {wanted}, as {real} or other real numbers"
        )));
    }
    let options = PyDict::new(py);
    options.set_item("copy", false)?;
    let array = array.call_method("astype", (numpy::dtype::<T>(py),), Some(&options))?;
    Ok(array.cast::<PyArrayDyn<T>>()?.readonly())
}

/// A shape in words, as `[3, 4, 6]`.
pub fn shape_in_words(shape: &[usize]) -> String {
    format!("{shape:?}")
}

/// Rows of `width` numbers, `[N, width]`.
pub fn rows<'a, T: Element>(
    what: &str,
    array: &'a PyReadonlyArrayDyn<'_, T>,
    width: usize,
) -> PyResult<ArrayView2<'a, T>> {
    let shape = array.shape().to_vec();
    match array.as_array().into_dimensionality::<Ix2>() {
        Ok(view) if view.ncols() == width => Ok(view),
        _ => {
            Err(bad(format!("{what}: has the shape {}; give [N, {width}]", shape_in_words(&shape))))
        }
    }
}

/// A column of values.
pub fn column<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    PyArray1::from_vec(py, values)
}

/// Values in rows of `width`, moved.
pub fn matrix<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = values.len() / width.max(1);
    PyArray1::from_vec(py, values).reshape([count, width])
}

/// Values of any shape, moved.
pub fn shaped<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = ArrayD::from_shape_vec(shape, values);
    Ok(array.map_err(|error| bad(error.to_string()))?.into_pyarray(py))
}

/// A pose as a 4 × 4 matrix that takes column vectors of the inner frame to the outer one.
pub fn homogeneous<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (r, t) = (pose.rotation.transpose().to_cols_array_2d(), pose.translation.to_array());
    let mut values = Vec::with_capacity(16);
    for k in 0..3 {
        values.extend(r[k]);
        values.push(t[k]);
    }
    values.extend([0.0, 0.0, 0.0, 1.0]);
    matrix(py, values, 4)
}
