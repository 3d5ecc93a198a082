//! Work on files: what each command of the program does with scenes, placements and folders, for any caller.
//!
//! A request is plain data, a [`Watcher`] is told what is going on and may ask to stop, and an answer is plain data or
//! a folder. Nothing here prints or reads arguments; the program's commands parse, call and print.
//!
//! | file | holds |
//! |---|---|
//! | `inputs` | which of the files given are scenes, names of placements behind a colon |
//! | `opening` | from files to jobs and evaluators |
//! | `given` | placements of a file: sensors that the vehicle lacks, and what is most likely not meant |
//! | `glb` | a frame with its rigs as binary glTF |
//! | `score` | scores of a batch: as a stream in one scene, with their mean in several |
//! | `optimize` | a search in a run folder: begun, saved, resumed, recorded |
//! | `study`, `chart` | experiments in folders of their own, resumed |
//! | `audit`, `verify`, `near_field`, `targets`, `view` | experiments of scene files, and the page about a placement |
//! | `scan`, `cast` | labelled scans as data sets, every beam's hit |
//! | `psog`, `rig`, `scene` | files of P-SOGs, of rigs and of scenes |

pub mod audit;
pub mod cast;
pub mod chart;
mod inputs;
pub mod near_field;
mod opening;
pub mod optimize;
pub mod psog;
pub mod rig;
pub mod scan;
pub mod scene;
pub mod score;
pub mod study;
pub mod targets;
#[cfg(feature = "gpu")]
pub mod verify;
pub mod view;

mod error;
mod given;
mod glb;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

pub use error::Error;

use crate::Note;
use crate::engine::EngineChoice;
use crate::vehicle::SensorChoice;

/// Time after a wish to stop for work that has a result to write, such as the page of a search.
const GRACE: Duration = Duration::from_secs(20);

/// Who is told of work under way, and may end it. Every part is optional.
pub trait Watcher: Sync {
    /// A sentence that is of interest by default.
    fn note(&self, _sentence: &str) {}

    /// A sentence about an input.
    ///
    /// # Errors
    /// A doubt, where doubts are refused (`--strict`).
    fn tell(&self, note: &Note) -> Result<(), Error> {
        self.note(note.text());
        Ok(())
    }

    /// A sentence for who wants to know more.
    fn detail(&self, _sentence: &str) {}

    /// [`Self::note`] for engines, which outlive the call that opens them.
    fn notes(&self) -> Arc<dyn Fn(&str) + Send + Sync> {
        Arc::new(|_| {})
    }

    /// Work of so many steps begins; it ends when the bar is dropped. Without a unit only its share is of interest.
    fn bar(&self, _total: u64, _unit: Option<&str>) -> Box<dyn Bar> {
        Box::new(Silent)
    }

    /// Work begins that can be interrupted without loss: from now on it asks [`Self::goes_on`] for a wish to stop. Work
    /// that still runs `grace` after such a wish may be ended with the process.
    fn listen(&self, _grace: Duration) {}

    /// Whether the work is to go on.
    fn goes_on(&self) -> bool {
        true
    }
}

/// How far some work is.
pub trait Bar: Sync {
    /// So many more steps are done.
    fn advance(&self, _steps: u64) {}

    /// So many steps of a total are done.
    fn set(&self, _done: u64, _total: u64) {}

    /// What is being done.
    fn say(&self, _words: String) {}
}

/// Says nothing and never stops.
pub struct Silent;

impl Watcher for Silent {}

impl Bar for Silent {}

/// What computes, for which vehicle, and who is told.
#[derive(Clone)]
pub struct Computing<'a> {
    /// The engine asked for.
    pub engine: EngineChoice,
    /// Vehicle file in place of what scenes say.
    pub vehicle: Option<PathBuf>,
    /// Models of LiDARs that placements of files leave without a name.
    pub sensors: Vec<SensorChoice>,
    /// Who is told.
    pub watcher: &'a dyn Watcher,
}

impl Computing<'_> {
    /// The best engine there is, the vehicle of each scene, and nobody who is told.
    pub fn silent() -> Computing<'static> {
        Computing {
            engine: EngineChoice::default(),
            vehicle: None,
            sensors: Vec::new(),
            watcher: &Silent,
        }
    }
}
