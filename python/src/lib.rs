//! Python module of sightline: arrays in, the library's work beside the interpreter, arrays out.
//!
//! | file | holds |
//! |---|---|
//! | `arguments` | every number and list of names that comes in, checked |
//! | `arrays` | conversions |
//! | `errors` | exceptions |
//! | `wait` | long work without the GIL, with Ctrl-C; how far it is, as bars, records of `logging`, or for a function |
//! | `sensors`, `placements`, `psogs`, `rigs`, `scenes` | objects of the user |
//! | `engine` | P-SOG, problem and engine of a scene, built once; an engine that tells how many casts are done |
//! | `columns` | scores as arrays, by the rules of a vehicle |
//! | `space` | variables, bounds and rules for optimizers of others |
//! | `atlas` | sensor poses cast once, placements of them without a cast |
//! | `by_hand` | a search by ask and tell |
//! | `rays` | rays of callers, into meshes and frames |
//! | `scans` | scans as an iterator, and over time as files of viewers |
//! | `search` | suites and `optimize` |
//! | `pages` | pages of searches |
//! | `handover` | the folder of a rig for those who build it |
//! | `questions` | studies of one placement as methods of a scene |
//! | `studies` | studies that take many runs; the front of objectives |

#![allow(clippy::too_many_arguments, reason = "keywords of Python")]

mod arguments;
mod arrays;
mod atlas;
mod by_hand;
mod columns;
mod engine;
mod errors;
mod handover;
mod pages;
mod placements;
mod psogs;
mod questions;
mod rays;
mod rigs;
mod scans;
mod scenes;
mod search;
mod sensors;
mod space;
mod studies;
mod wait;

use std::error::Error;
use std::ffi::OsString;

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

use errors::bad;
use sightline::internals::Sentence;

/// Allocator that ends the process with a sentence instead of a crash where indispensable memory is refused.
#[global_allocator]
static ALLOCATOR: Sentence = Sentence;

/// Runs the program with the arguments that a shell would give, its own name first; returns the exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| wait::pooled(|| sightline::cli::run(arguments).code()))
}

/// Lets the CPU engine use `count` threads, at most 4 for each core, or 16 where that is more. To be called before anything
/// is computed. Raises `ValueError` for another number and for a later call.
#[pyfunction]
fn set_threads(#[pyo3(from_py_with = arguments::threads)] count: usize) -> PyResult<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count);
    pool.build_global().map_err(|error| match error.source() {
        Some(system) => {
            PyOSError::new_err(format!("count: {count} threads cannot be started: {system}"))
        }
        None => {
            bad("count: threads are at work already; call set_threads before anything is computed")
        }
    })
}

#[pymodule]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::{
        atlas::PyAtlas,
        by_hand::PySearch,
        errors::in_python,
        handover::hand_over,
        main,
        placements::{PyPlacement, published, read, write},
        psogs::PyPsog,
        rays::PyRaycaster,
        rigs::PyRig,
        scans::ScanIterator,
        scenes::PyScene,
        search::{PySuite, search},
        sensors::{PySensor, PyVehicle},
        set_threads,
        space::PySpace,
        studies::{front, study_table},
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::wait::remember_home();
        module.add("DoubtWarning", module.py().get_type::<super::errors::DoubtWarning>())?;
        module.add("FEW_PLACEMENTS", sightline::near_field::FEW_PLACEMENTS)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
