//! JSON as Python objects, for records that are trees rather than columns.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;

use crate::errors::bad;

/// A record as `dict`s, `list`s and numbers.
pub fn to_python<'py>(py: Python<'py>, record: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(record).map_err(|error| bad(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// A Python object as JSON text; `what` names it in errors.
pub fn to_text(what: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    let options = PyDict::new(given.py());
    options.set_item("allow_nan", false)?;
    let dumps = given.py().import("json")?.getattr("dumps")?;
    let text = dumps.call((given,), Some(&options));
    text.map_err(|error| bad(format!("{what}: is not JSON: {error}")))?.extract()
}
