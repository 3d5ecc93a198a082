//! Why a study cannot be made.

use crate::job::JobError;
use crate::score::ObjectiveError;

/// Why a study cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A study of prices of a scene without a vehicle.
    #[error("{scene}: has no vehicle, so no prices; give one with --vehicle")]
    NoVehicle {
        /// File of the scene.
        scene: String,
    },
    /// A budget where nothing is searched.
    #[error(
        "`study {kind}` looks at placements that are there and chooses no sensors; leave --budget out"
    )]
    NoSearch {
        /// Name of the study.
        kind: &'static str,
    },
    /// No placement to look at.
    #[error(
        "{scene}: the vehicle is not the paper's car, whose layouts are looked at by default; give a file of placements \
         behind the scenes"
    )]
    NoPlacements {
        /// File of the scene.
        scene: String,
    },
    /// No study of that name.
    #[error("`{name}` is no study; there are {known}")]
    NoKind {
        /// Name that was given.
        name: String,
        /// The names there are.
        known: String,
    },
    /// Several scenes for a study of one.
    #[error("`study {kind}` takes one scene, not {given}; only `transfer` compares several")]
    OneScene {
        /// Name of the study.
        kind: &'static str,
        /// Scenes given.
        given: usize,
    },
    /// One scene for a study of several.
    #[error("`study transfer` compares scenes; name two or more scene files")]
    SeveralScenes,
    /// An objective of a task that the scene does not have.
    #[error(
        "{scene}: the objective `{objective}` needs a detection target; name its classes under \
         `detection` in the scene"
    )]
    NoDetection {
        /// File of the scene.
        scene: String,
        /// The objective.
        objective: String,
    },
    /// Two tasks of a scene that has one.
    #[error("{scene}: has no detection target; name its classes under `detection` in the scene")]
    OneTask {
        /// File of the scene.
        scene: String,
    },
    /// Other voxels of a P-SOG that is a file.
    #[error(
        "{scene}: its P-SOG is a file, which has voxels of one size; a scene with geometry can be \
         scanned again"
    )]
    FixedVoxels {
        /// File of the scene.
        scene: String,
    },
    /// Channels of a sensor that is a list of directions.
    #[error("{scene}: its LiDAR is a list of directions, which has no channels to vary")]
    NoChannels {
        /// File of the scene.
        scene: String,
    },
    /// Heights of a vehicle whose mounts have their own.
    #[error(
        "{scene}: `study height` puts all LiDARs at one height, and the vehicle has {mounts}; give a vehicle with one mount \
         that is a box"
    )]
    NoHeights {
        /// File of the scene.
        scene: String,
        /// Its mounts, in words.
        mounts: String,
    },
    /// The loss of the only LiDAR.
    #[error("{scene}: its mount has one LiDAR; without it nothing is left to score")]
    OneLidar {
        /// File of the scene.
        scene: String,
    },
    /// Two cases of one name, which would share their numbers.
    #[error("two {cases} are called `{name}`; {mend}")]
    SameName {
        /// The things that the cases are, in the plural.
        cases: &'static str,
        /// The name.
        name: String,
        /// Way to tell them apart.
        mend: &'static str,
    },
    /// The observer wanted to stop.
    #[error("stopped")]
    Stopped,
    /// A job, or a part of it, that cannot be posed, scored or searched.
    #[error(transparent)]
    Job(JobError),
    /// An objective that cannot be read.
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
}

impl<E> From<E> for StudyError
where
    JobError: From<E>,
{
    fn from(error: E) -> Self {
        Self::Job(error.into())
    }
}
