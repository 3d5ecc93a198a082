//! Watcher, engine, vehicle and error that all commands share.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::Note;
use crate::engine::EngineChoice;
use crate::files::{FileError, RunDir};
use crate::job::{JobError, Tolerance};
use crate::scan::conditions::Condition;
use crate::study::StudyError;
use crate::vehicle::SensorChoice;

/// Time after a stop request for work that has a result to write, such as the page of a search.
pub(super) const GRACE: Duration = Duration::from_secs(20);

/// Listener of work under way, which may end it. Every part is optional.
pub trait Watcher: Sync {
    /// Hears a sentence that is shown by default.
    fn note(&self, _sentence: &str) {}

    /// Hears a sentence about an input.
    ///
    /// # Errors
    /// A doubt, where doubts are refused (`--strict`).
    fn tell(&self, note: &Note) -> Result<(), RunError> {
        self.note(note.text());
        Ok(())
    }

    /// Hears a sentence on the device that computes.
    fn device(&self, sentence: &str) {
        self.note(sentence);
    }

    /// Hears a sentence for users who want more detail.
    fn detail(&self, _sentence: &str) {}

    /// [`Self::note`] for engines, which outlive the call that opens them.
    fn notes(&self) -> Arc<dyn Fn(&str) + Send + Sync> {
        Arc::new(|_| {})
    }

    /// Begins a bar of `total` steps, which ends when it is dropped. Without a unit only its share is of interest.
    fn bar(&self, _total: u64, _unit: Option<&str>) -> Box<dyn Bar> {
        Box::new(Silent)
    }

    /// Enables Ctrl-C: from here on [`Self::goes_on`] may return `false`. Work that still runs `grace` after a stop
    /// request may be ended with the process.
    fn listen(&self, _grace: Duration) {}

    /// Hears, once the folder of a run holds a checkpoint, how to go on with it should the process be ended.
    fn resumes(&self, _go_on: &str) {}

    /// Hears that the work was stopped: which placements its table holds, and that a file is not written.
    fn note_interrupted(&self, out: Option<&Path>) {
        let left = out.map(|out| format!("; {} is not written", out.display()));
        let left = left.unwrap_or_default();
        self.note(&format!("interrupted: the table holds the placements looked at so far{left}"));
    }

    /// `false` once the work is to stop.
    fn goes_on(&self) -> bool {
        true
    }
}

/// Progress of some work.
pub trait Bar: Sync {
    /// Adds finished steps.
    fn advance(&self, _steps: u64) {}

    /// Sets the finished steps, and the total.
    fn set(&self, _done: u64, _total: u64) {}

    /// Shows words beside the progress.
    fn say(&self, _words: String) {}
}

/// A watcher and a bar that show nothing and never stop.
pub struct Silent;

impl Watcher for Silent {}

impl Bar for Silent {}

/// Form of an answer that is a table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum TableFormat {
    /// Tables to read.
    #[default]
    Text,
    /// For programs.
    Json,
    /// The table in full precision, with units in its first line.
    Csv,
}

/// Weather and faults that scores are computed under.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct Conditions {
    /// Weather or a fault, as fog:mor=50 or snow:rate=1; may be given several times
    ///
    /// Also rain:rate=5, wet:water=1, crosstalk:share=0.01, echo:ratio=0.85. Beams that do not come back cover and see
    /// nothing.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME[:KEY=VALUE,…]"))]
    pub condition: Vec<Condition>,
}

/// Figures and tables as files.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct FiguresOut {
    /// Write each figure as an SVG file of its own, and the printed table as CSV, into this folder, which is new or empty
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub figures: Option<PathBuf>,
}

/// Option of the commands that have a scene and placements in it.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct Gltf {
    /// Write the scene, the LiDARs with what they see, and the points if there are any as a binary glTF (.glb)
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub gltf: Option<PathBuf>,
}

/// Mounting of the LiDARs.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct MountingArgs {
    /// Most by which a LiDAR's mounting is off: each coordinate and each angle, to either side; 0 for none. Each
    /// requirement is looked at in 200 copies mounted so: one that fewer than 95 % of them meet is met on paper only,
    /// and a search then moves its result a little until enough do
    #[cfg_attr(feature = "cli", arg(long, value_name = "LENGTH,ANGLE", default_value_t = Tolerance::default()))]
    pub tolerance: Tolerance,
}

/// Engine, vehicle, sensor models and watcher of a command.
#[derive(Clone)]
pub struct Computing<'a> {
    /// Engine to use.
    pub engine: EngineChoice,
    /// Vehicle file in place of the scenes' own.
    pub vehicle: Option<PathBuf>,
    /// Models of LiDARs that placements of files leave without a name.
    pub sensors: Vec<SensorChoice>,
    /// Hears of progress, and may stop the work.
    pub watcher: &'a dyn Watcher,
}

impl Computing<'_> {
    /// The best engine there is, the vehicle of each scene, and a silent watcher.
    pub fn silent() -> Computing<'static> {
        Computing {
            engine: EngineChoice::default(),
            vehicle: None,
            sensors: Vec::new(),
            watcher: &Silent,
        }
    }
}

/// Why work on files ended early, as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// From the library, files and folders among it.
    #[error(transparent)]
    Library(crate::Error),
    /// A likely mistake in an input, where such are refused.
    #[error("{0} (refused by --strict)")]
    Doubt(String),
    /// Work that the watcher stopped before it had anything to leave.
    #[error("{0}")]
    Interrupted(String),
    /// A request that does not fit the scene or itself.
    #[error("{0}")]
    Usage(String),
}

/// Errors of the library's modules, so that `?` takes them in one step.
impl<E> From<E> for RunError
where
    crate::Error: From<E>,
{
    fn from(error: E) -> Self {
        Self::Library(error.into())
    }
}

impl RunError {
    /// True for an error that stays however often the run goes on: its folder would be of no use. A full disk, an engine
    /// that fails and a wish to stop may be over at the next sitting.
    pub(super) fn is_lasting(&self) -> bool {
        let of_job = |error: &JobError| error.of_engine().is_none();
        match self {
            Self::Library(crate::Error::File(_)) | Self::Interrupted(_) => false,
            Self::Library(crate::Error::Job(error)) => of_job(error),
            Self::Library(crate::Error::Study(StudyError::Stopped)) => false,
            Self::Library(crate::Error::Study(StudyError::Job(error))) => of_job(error),
            _ => true,
        }
    }

    /// Takes away a run's folder at an error that stays.
    pub(super) fn discarding<S>(self, folder: &RunDir<S>) -> Self {
        if self.is_lasting() {
            folder.discard();
        }
        self
    }

    /// Names the file or folder in an error of the operating system.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| FileError::io(path)(source).into()
    }
}
