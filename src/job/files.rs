//! Files and options of a job, as a checkpoint keeps them and a run is repeated from them.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Job, JobError, JobScene, Tolerance};
use crate::scan::conditions::Condition;
use crate::scene::Scene;
use crate::vehicle::{MountRules, Vehicle};

/// Files and options of a [`Job`]; an option that is left out of the file has its default.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JobFiles {
    /// The first scene.
    pub scene: PathBuf,
    /// Scenes after the first; the mean over all is maximized.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub more_scenes: Vec<PathBuf>,
    /// Each scene counts mirrored left to right, too.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirror: bool,
    /// Rules of placements, added to the rules of the scenes.
    #[serde(default)]
    pub rules: MountRules,
    /// Vehicle file that replaces the vehicle or mount of every scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<PathBuf>,
    /// Most that the sensors may cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<f64>,
    /// The fewest sensors that meet all requirements, then the cheapest.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fewest: bool,
    /// Mounting tolerance within which requirements are to hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Tolerance>,
    /// Weather and faults, as they are written: `fog:mor=50`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Frames of each scene, spread evenly; all if `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<u32>,
}

impl JobFiles {
    /// Scene files alone, with every option at its default. Without scene files, the first scene is the empty path.
    pub fn new(scenes: &[PathBuf], vehicle: Option<&Path>) -> Self {
        let mut scenes = scenes.iter().cloned();
        Self {
            scene: scenes.next().unwrap_or_default(),
            more_scenes: scenes.collect(),
            vehicle: vehicle.map(Path::to_owned),
            ..Self::default()
        }
    }

    /// The scene files, in the order given.
    pub fn scenes(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.scene).chain(&self.more_scenes)
    }

    /// Reads one of the scenes, with the vehicle and the rules.
    ///
    /// # Errors
    /// See [`Scene::read_with`] and [`Scene::with_rules`].
    pub(crate) fn read_scene(&self, path: &Path) -> Result<Scene, JobError> {
        let scene = Scene::read_with(path, self.vehicle.as_deref())?;
        if self.rules != MountRules::default() && !scene.vehicle().is_nameless() {
            let file = self.vehicle.as_deref().unwrap_or(path);
            return Err(JobError::RulesOfVehicle { file: file.display().to_string() });
        }
        scene.with_rules(&self.rules, &path.display().to_string()).map_err(JobError::Rules)
    }

    /// The job over scenes that [`Self::read_scene`] has read.
    ///
    /// # Errors
    /// Conditions that cannot be read, no scene.
    pub(crate) fn job_over(
        &self,
        scenes: impl IntoIterator<Item = JobScene>,
    ) -> Result<Job, JobError> {
        let conditions = self.conditions.iter().map(|text| text.parse());
        let conditions = conditions.collect::<Result<Vec<Condition>, _>>()?;
        let mut job = Job::join(scenes.into_iter().map(Job::new))?;
        job.vehicle_file.clone_from(&self.vehicle);
        let job = job.conditions(&conditions).frames(self.frames);
        Ok(job
            .mirrored(self.mirror)
            .budget(self.budget)
            .fewest(self.fewest)
            .tolerance(self.tolerance))
    }

    /// Checks that a vehicle requires something where the fewest sensors that meet it are wanted.
    ///
    /// # Errors
    /// [`JobError::NothingRequired`].
    pub(crate) fn check_vehicle(&self, vehicle: &Vehicle) -> Result<(), JobError> {
        match self.fewest && !vehicle.requires() {
            true => Err(JobError::NothingRequired { asked: "--fewest" }),
            false => Ok(()),
        }
    }

    /// The job, its scenes read.
    ///
    /// # Errors
    /// A file that cannot be read, options that do not fit its scene or vehicle.
    pub fn read(&self) -> Result<Job, JobError> {
        let scenes = self.scenes().map(|path| self.read_scene(path).map(JobScene::from));
        self.job_over(scenes.collect::<Result<Vec<_>, _>>()?)
    }
}
