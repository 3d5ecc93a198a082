//! Request of a search in a run folder.

use std::path::PathBuf;

use crate::job::JobFiles;
use crate::search::Settings;

/// A search to begin or to go on with.
#[derive(Debug, Clone)]
pub struct OptimizeRequest {
    /// A new run, or one to go on with.
    pub start: Start,
    /// Seconds from the start after which the search ends.
    pub max_seconds: Option<f64>,
    /// Frames given; more than a scene has are worth a note.
    pub frames: Option<u32>,
    /// File for the first scene with the result, as binary glTF.
    pub gltf: Option<PathBuf>,
    /// Folder for each figure of the page.
    pub figures: Option<PathBuf>,
}

/// Start of a search.
#[derive(Debug, Clone)]
pub enum Start {
    /// A new run.
    New(Box<NewRun>),
    /// Folder of a stopped run, which goes on to the same bytes that it would have given.
    Resume(PathBuf),
}

/// A search that is to begin.
#[derive(Debug, Clone, Default)]
pub struct NewRun {
    /// Scenes, vehicle, rules, weather and budget.
    pub files: JobFiles,
    /// Folder of the run; `runs/SCENE`, numbered, if none.
    pub out: Option<PathBuf>,
    /// Score to maximize, in place of the settings' objective.
    pub objective: Option<String>,
    /// Settings of the search.
    pub settings: Settings,
    /// Placements to compare with, in place of Table 7 of the paper.
    pub baselines: Option<PathBuf>,
    /// More placements to start from.
    pub inject: Option<PathBuf>,
}
