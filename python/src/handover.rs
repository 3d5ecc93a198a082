//! The folder of a rig for those who build it.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use sightline::runs::handover::{HandoverRequest, Held, handover};
use sightline::runs::{Computing, RunError, Watcher};
use sightline::{EngineChoice, Note};

use crate::arguments;
use crate::arrays::to_python;
use crate::errors::{bad, raised_of_run, warn_of};
use crate::placements::PyPlacement;
use crate::scenes::PyScene;
use crate::wait::{WorkMessages, interruptible, log};

/// Watcher of a call: its sentences are warned of at the end.
struct Heard<'a> {
    watch: &'a WorkMessages,
    notes: Mutex<Vec<Note>>,
}

impl Watcher for Heard<'_> {
    fn note(&self, sentence: &str) {
        let _ = self.tell(&Note::fact(sentence));
    }

    fn tell(&self, note: &Note) -> Result<(), RunError> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(note.clone());
        Ok(())
    }

    fn device(&self, sentence: &str) {
        log("info", sentence);
    }

    fn notes(&self) -> Arc<dyn Fn(&str) + Send + Sync> {
        Arc::new(|sentence| log("warning", sentence))
    }

    fn goes_on(&self) -> bool {
        self.watch.goes_on()
    }
}

/// Writes the folder of one placement for those who build the rig, as `sightline rig handover` does: poses in millimetres
/// and degrees, bill of materials, masks and crop boxes of the own body, drawing, sensor profiles, `README.txt`.
///
/// - `placement`: a `Placement`, a file of placements (`"rigs.json:NAME"` where it has several), or the folder of a run of
///   the program, whose result is meant
/// - `out`: the folder, new or empty
/// - `scene`: a `Scene` with geometry; `vehicle`: a `Vehicle` or its file on level ground, where no scene is given. The
///   folder of a run needs neither.
/// - `frame`: frame of the scene, from 0, that body, masks and drawing are of
/// - `margin`: metres from 0 to 10 that crop boxes reach beyond the own body
/// - `base_link`: `[3]` metres, position of `base_link` in the ego frame
///
/// Returns a `dict`:
///
/// - `out`, `placement` (its name), `files` (names in the folder), `price` (of all sensors)
/// - `own_beams`: for each LiDAR `[2]`, its beams that end at the own body, and all its beams
/// - `guards`: sentences on LiDARs that look into the own body
///
/// Warns of these, of broken rules and of missed requirements. The folder is written whole or not at all. Raises
/// `ValueError` for a folder that holds files, a frame that is not there, several placements without a name and a
/// placement of unknown models, `OSError` for files that cannot be read or written.
#[pyfunction(name = "handover")]
#[pyo3(signature = (placement, out, *, scene = None, vehicle = None, frame = 0, margin = 0.05, base_link = None))]
pub(crate) fn hand_over<'py>(
    py: Python<'py>,
    placement: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = arguments::out_path)] out: PathBuf,
    scene: Option<&Bound<'py, PyScene>>,
    #[pyo3(from_py_with = arguments::vehicle)] vehicle: Option<PathBuf>,
    #[pyo3(from_py_with = arguments::frame_from_0)] frame: u32,
    #[pyo3(from_py_with = arguments::margin)] margin: f64,
    #[pyo3(from_py_with = arguments::base_link)] base_link: Option<[f64; 3]>,
) -> PyResult<Bound<'py, PyAny>> {
    if scene.is_some() && vehicle.is_some() {
        return Err(bad(
            "vehicle: the scene has one; load the scene with vehicle=, or leave one out",
        ));
    }
    let one = placement.cast::<PyPlacement>().ok().map(|one| one.get().0.clone());
    let mut files = vec![match &one {
        Some(one) => one.name.clone(),
        None => arguments::placement_file(placement)?,
    }];
    let mut held = Held { placement: one, scene: None };
    let (mut vehicle, mut engine) = (vehicle, EngineChoice::default());
    if let Some(scene) = scene.map(Bound::get) {
        engine = scene.built.options.engine.clone();
        // A run is known by the files of its scene and vehicle.
        match scene.files_read().filter(|_| held.placement.is_none()) {
            Some((file, own)) => {
                files.insert(0, file.display().to_string());
                vehicle = own;
            }
            None => {
                files.insert(0, scene.built.scene.name().to_owned());
                held.scene = Some(scene.built.scene.clone());
            }
        }
    }
    let request = HandoverRequest { files, out, frame, margin, base_link, held };
    let (made, notes) = interruptible(py, move |watch| {
        let heard = Heard { watch, notes: Mutex::default() };
        let computing = Computing { engine, vehicle, sensors: Vec::new(), watcher: &heard };
        let made = handover(&request, &computing);
        (made, heard.notes.into_inner().unwrap_or_else(PoisonError::into_inner))
    })?;
    let made = to_python(py, &made.map_err(raised_of_run)?)?;
    warn_of(py, &notes)?;
    Ok(made)
}
