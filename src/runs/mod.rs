//! Work on files: each command of the program as a function of scenes, placements and folders, for any caller.
//!
//! A request is plain data. A [`Watcher`] hears of progress and may ask to stop. An answer is plain data or a folder.
//! Nothing here prints or reads arguments; the program's commands parse, call and print.
//!
//! | file | holds |
//! |---|---|
//! | `computing` | watcher, engine, vehicle and error of all commands |
//! | `inputs`, `opening` | files sorted into scenes and placements, checks of placements, jobs and evaluators of them |
//! | `run_folder` | the folder of a run in place of its files |
//! | `parse` | parsers of numbers with units, as options have them |
//! | `outputs` | figures, tables and binary glTF beside an answer |
//! | `score` | scores of a batch: as a stream in one scene, with their mean in several |
//! | `optimize` | a search in a run folder: begun, saved, resumed, recorded |
//! | `study`, `chart` | experiments in folders of their own, resumed |
//! | `devices`, `coverage`, `sensitivity`, `sharing` | experiments of scene files |
//! | `scan`, `cast` | labelled scans as data sets; every beam's hit, and the page about a placement |
//! | `handover` | the folder of a rig for others: tables, masks, drawing, profiles |
//! | `psog`, `rig`, `scene` | files of P-SOGs, of rigs and of scenes |

pub mod cast;
pub mod chart;
mod computing;
pub mod coverage;
#[cfg(feature = "gpu")]
pub mod devices;
pub mod handover;
mod inputs;
mod opening;
pub mod optimize;
mod outputs;
#[cfg(feature = "cli")]
pub(crate) mod parse;
pub mod psog;
pub mod rig;
mod run_folder;
pub mod scan;
pub mod scene;
pub mod score;
pub mod sensitivity;
pub mod sharing;
pub mod study;

use computing::GRACE;
pub use computing::{
    Bar, Computing, Conditions, FiguresOut, Gltf, MountingArgs, RunError, Silent, TableFormat,
    Watcher,
};
pub use opening::notes_on;
