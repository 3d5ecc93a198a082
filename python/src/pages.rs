//! Pages of searches: results and fronts write them.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde_json::Value;
use sightline::Job;
use sightline::job::Found;
use sightline::report::{NearRecord, RunRecord, found_html};
use sightline::search::Stopped;

use crate::arguments;
use crate::errors::{in_python, raised, write_text};
use crate::wait::{WorkMessages, interruptible};

/// A search at its end.
pub(crate) struct EndedSearch {
    pub job: Job,
    pub found: Found,
    /// Near ground that its result sees.
    pub near: Option<NearRecord>,
    /// Settings of the call that `found` does not have, by the names of the program.
    pub asked: Value,
}

impl EndedSearch {
    /// The page of its record, with all settings.
    fn page(&self, mut record: RunRecord, watch: &WorkMessages) -> PyResult<String> {
        for (key, value) in self.asked.as_object().into_iter().flatten() {
            record.settings[key] = value.clone();
        }
        if self.found.outcome.stopped != Stopped::Time {
            // A limit that did not end the search does not matter.
            record.settings["max_seconds"] = Value::Null;
        }
        found_html(&self.job, &self.found, &record, &mut || watch.goes_on()).map_err(raised)
    }
}

/// Content of a page: of a search it is looked at and drawn when it is written.
pub(crate) enum Page {
    Search(Arc<EndedSearch>, Box<RunRecord>),
    Front(String),
}

/// A page to write. Pickles have `None` in its place, since scenes with their trees do not travel.
#[pyclass(module = "sightline._native", frozen)]
pub(crate) struct PyPage(pub Page);

#[pymethods]
impl PyPage {
    fn write(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
    ) -> PyResult<()> {
        let page = match &self.0 {
            Page::Front(page) => page.clone(),
            Page::Search(ended, record) => {
                let (ended, record) = (ended.clone(), RunRecord::clone(record));
                interruptible(py, move |watch| ended.page(record, watch))??
            }
        };
        py.detach(|| write_text(&path, &in_python(&page)))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        PyTuple::new(py, [py.None().bind(py).get_type().into_any(), PyTuple::empty(py).into_any()])
    }
}
