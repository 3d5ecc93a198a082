//! Why a job cannot be posed, scored or searched.

use super::front::FrontError;
use crate::engine::BackendError;
use crate::problem::ProblemError;
use crate::psog::PsogError;
use crate::scan::ScanError;
use crate::scene::DescriptionError;
use crate::search::SearchError;
use crate::shared::OverlapError;
use crate::vehicle::SensorError;

/// Why a job cannot be posed, scored or searched.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum JobError {
    #[error(transparent)]
    Scene(#[from] DescriptionError),
    /// Rules that the mounts of a scene do not allow.
    #[error("options that set rules, such as --fix: {0}")]
    Rules(DescriptionError),
    /// Options for the one mount of a scene, given to a vehicle with mounts of its own.
    #[error(
        "--fix, --symmetric and --equal-height are rules for the `mount` of a scene, and the vehicle of {file} has \
         mounts of its own; write `symmetric` or `equal_height` into the vehicle's file, and for --fix the value as \
         `min` and `max` of a mount"
    )]
    RulesOfVehicle { file: String },
    /// From the region of interest, or from building the P-SOG.
    #[error(transparent)]
    Grid(#[from] PsogError),
    /// From the P-SOG file that the scene names.
    #[error("{place}: {source}")]
    Psog { place: String, source: PsogError },
    /// A sensor without beams, or a placement that cannot be scored.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// Scene and P-SOG do not fit together.
    #[error("{files}: {source}")]
    Problem { files: String, source: ProblemError },
    /// Weather and faults that cannot be read, or that scores and scans cannot be computed under.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// An engine that is missing or fails.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// Pairs of LiDARs that cannot be looked at.
    #[error(transparent)]
    Overlap(#[from] OverlapError),
    #[error(transparent)]
    Search(#[from] SearchError),
    /// A search over mounts that all lie inside the own body; the sentence tells the first of them and the mend.
    #[error("{0}")]
    Buried(String),
    /// A scene that does not fit the others, or the objective.
    #[error("{scene}: {source}")]
    InScene { scene: String, source: SearchError },
    /// A budget for a scene whose LiDAR has no price.
    #[error(
        "--budget: the LiDARs of the scene have no prices; give a vehicle with --vehicle (in Python load the scene \
         with one)"
    )]
    NoPrices,
    /// Poses of a grid whose step no mount is wide enough for.
    #[error(
        "--delta: {given} m from pose to pose is more than any mount of {scene} measures, {widest:.3} m at most; lengths \
         are in metres: give a smaller step, 0.1 for example"
    )]
    WideStep { given: f64, scene: String, widest: f64 },
    /// A question about requirements where there are none.
    #[error(
        "{asked}: the vehicle requires nothing; write what it must see under `require` in a vehicle file, and give it \
         with --vehicle"
    )]
    NothingRequired { asked: &'static str },
    /// Objectives of a front that cannot be read, or that the vehicle does not have.
    #[error(transparent)]
    Front(#[from] FrontError),
    /// An audit without a placement.
    #[error("there are no placements to audit; name at least one")]
    NothingToAudit,
    /// An audit of several scenes.
    #[error("an audit is of one scene, not of {given}; audit them one by one")]
    SeveralToAudit { given: usize },
    /// A saved search that was begun with another vehicle or other scenes.
    #[error("{why}")]
    OtherState { why: String },
}

impl JobError {
    /// The engine's error, where it is one.
    pub fn of_engine(&self) -> Option<&BackendError> {
        match self {
            Self::Backend(error)
            | Self::Search(SearchError::Backend(error))
            | Self::InScene { source: SearchError::Backend(error), .. } => Some(error),
            _ => None,
        }
    }
}
