//! What a run was begun with, and all that its checkpoint holds.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::request::NewRun;
use crate::runs::given::Given;
use crate::runs::{Computing, Error};
use crate::scan::conditions::in_words;
use crate::search::{Choosing, Equipped, Settings, State, Suite};
use crate::vehicle::{MountRules, read_placements};

/// Scenes and rules that a run was begun with.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Begun {
    pub scene: PathBuf,
    /// Those after the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub more_scenes: Vec<PathBuf>,
    /// Whether each scene is there mirrored, too.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirror: bool,
    /// Beside those of the scene.
    pub rules: MountRules,
    /// Vehicle file in place of what the scenes say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<PathBuf>,
    /// Files of the placements to compare with, and of those to start from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baselines: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inject: Option<PathBuf>,
    /// Most that the sensors may cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<f64>,
    /// Weather and faults, as they are written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// What a vehicle carries in this run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equipped: Option<Equipped>,
}

/// All that a checkpoint holds.
#[derive(Serialize, Deserialize)]
pub(super) struct Saved {
    pub begun: Begun,
    #[serde(flatten)]
    pub course: Course,
}

/// Where a run stands.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Course {
    /// A vehicle's sensors are to be chosen.
    Equipping(Box<Wanted>),
    /// The search has begun.
    Run(Box<State>),
}

/// A choice of sensors, and the search that is to follow.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Wanted {
    pub choosing: Choosing,
    pub settings: Settings,
    /// Whether the result is compared with the same sensors put up plainly.
    pub plainly: bool,
}

impl Begun {
    /// The scene files, in the order given.
    pub fn scenes(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.scene).chain(&self.more_scenes)
    }

    /// Name of the run's folder where none is given.
    pub fn folder(&self) -> String {
        let stem = self.scene.file_stem().unwrap_or_default().to_string_lossy();
        match self.more_scenes.len() {
            0 => stem.into_owned(),
            more => format!("{stem}-and-{more}-more"),
        }
    }
}

impl NewRun {
    /// What is kept of the request beside the settings; `vehicle` is a file in place of what the scenes say.
    pub(super) fn begun(&self, vehicle: Option<&PathBuf>) -> Result<Begun, Error> {
        let absolute = |scene: &PathBuf| std::path::absolute(scene).map_err(Error::io(scene));
        let mut scenes = self.scenes.iter().map(absolute);
        let none = || Error::Usage("give a scene to search in".into());
        Ok(Begun {
            scene: scenes.next().ok_or_else(none)??,
            more_scenes: scenes.collect::<Result<_, _>>()?,
            mirror: self.mirror,
            rules: self.rules.clone(),
            vehicle: vehicle.map(absolute).transpose()?,
            baselines: self.baselines.as_ref().map(absolute).transpose()?,
            inject: self.inject.as_ref().map(absolute).transpose()?,
            budget: self.budget,
            conditions: in_words(&self.conditions),
            equipped: None,
        })
    }

    /// What the search begins with.
    pub(super) fn wanted(&self) -> Result<Wanted, Error> {
        let (choosing, plainly) = (Choosing::default(), self.baselines.is_none());
        Ok(Wanted { choosing, settings: self.settings()?, plainly })
    }

    /// Looks at the placements of the request's files; what they break of the mount's rules stands in the result.
    pub(super) fn look(
        &self,
        settings: &mut Settings,
        suite: &Suite,
        computing: &Computing<'_>,
    ) -> Result<(), Error> {
        let Some(member) = suite.members().first() else { return Ok(()) };
        if let ([choice, ..], None, None) = (&computing.sensors[..], &self.baselines, &self.inject)
        {
            return Err(Error::Usage(format!(
                "--sensor {choice}: names LiDARs of a file of placements; give one with --baselines or \
                 --inject, or leave it out"
            )));
        }
        let files =
            [(&self.baselines, &mut settings.baselines), (&self.inject, &mut settings.starts)];
        for (file, placements) in files {
            if let Some(file) = file {
                Given::in_problem(file, member.problem(), computing).ruled().all(placements)?;
            }
        }
        Ok(())
    }

    /// The settings with the objective and the placements of the request.
    fn settings(&self) -> Result<Settings, Error> {
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
}
