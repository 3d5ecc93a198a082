//! Files and options that a run was begun with, and the content of its checkpoint.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::request::NewRun;
use crate::job::{JobFiles, JobState};
use crate::problem::Problem;
use crate::runs::given::Given;
use crate::runs::{Computing, RunError};
use crate::search::Settings;
use crate::vehicle::read_placements;

/// Files and options that a run was begun with.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Begun {
    /// Files and options of the job; paths are absolute.
    #[serde(flatten)]
    pub files: JobFiles,
    /// File of the placements to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baselines: Option<PathBuf>,
    /// File of the placements to start from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inject: Option<PathBuf>,
}

/// Content of a checkpoint.
#[derive(Serialize, Deserialize)]
pub(super) struct RunCheckpoint {
    pub begun: Begun,
    #[serde(flatten)]
    pub state: JobState,
}

impl Begun {
    /// Default name of the run's folder.
    pub fn folder(&self) -> String {
        let stem = self.files.scene.file_stem().unwrap_or_default().to_string_lossy();
        match self.files.more_scenes.len() {
            0 => stem.into_owned(),
            more => format!("{stem}-and-{more}-more"),
        }
    }
}

impl NewRun {
    /// Files and options that the checkpoint keeps.
    pub(super) fn begun(&self) -> Result<Begun, RunError> {
        let absolute = |path: &PathBuf| std::path::absolute(path).map_err(RunError::io(path));
        let files = &self.files;
        if files.scene.as_os_str().is_empty() {
            return Err(RunError::Usage("give a scene to search in".into()));
        }
        let files = JobFiles {
            scene: absolute(&files.scene)?,
            more_scenes: files.more_scenes.iter().map(absolute).collect::<Result<_, _>>()?,
            vehicle: files.vehicle.as_ref().map(absolute).transpose()?,
            ..files.clone()
        };
        let baselines = self.baselines.as_ref().map(absolute).transpose()?;
        Ok(Begun { files, baselines, inject: self.inject.as_ref().map(absolute).transpose()? })
    }

    /// The settings with the objective and the placements of the request.
    pub(super) fn settings(&self) -> Result<Settings, RunError> {
        let mut settings = self.settings.clone();
        if let Some(text) = &self.objective {
            settings.objective = text.parse()?;
        }
        if let Some(file) = &self.baselines {
            settings.baselines = read_placements(file)?;
        }
        if let Some(file) = &self.inject {
            settings.starts = read_placements(file)?;
        }
        Ok(settings)
    }

    /// Looks at the placements of the request's files; rules of the mount that they break stand in the result.
    pub(super) fn look(
        &self,
        settings: &mut Settings,
        problem: &Problem,
        computing: &Computing<'_>,
    ) -> Result<(), RunError> {
        if let ([choice, ..], None, None) = (&computing.sensors[..], &self.baselines, &self.inject)
        {
            return Err(RunError::Usage(format!(
                "--sensor {choice}: names LiDARs of a file of placements; give one with --baselines or \
                 --inject, or leave it out"
            )));
        }
        let files =
            [(&self.baselines, &mut settings.baselines), (&self.inject, &mut settings.starts)];
        for (file, placements) in files {
            if let Some(file) = file {
                Given::in_problem(file, problem, computing).ruled().all(placements)?;
            }
        }
        Ok(())
    }
}
