//! Checks of a new run before a scene is read: its files, and what the vehicle file alone tells.

use crate::files::holds_run;
use crate::job::{FrontObjectives, Job, JobError, JobFiles};
use crate::runs::inputs::can_be_read;
use crate::runs::opening::vehicle_alone;
use crate::runs::run_folder::RESULT;
use crate::runs::{Computing, RunError};
use crate::search::SearchError;
use crate::vehicle::placement_file::holds_placements;

/// Refuses the folder of a run, and a file of placements, in the place of a scene; and a scene after the first that cannot
/// be read.
pub(super) fn check_scenes(files: &JobFiles) -> Result<(), RunError> {
    for path in files.scenes() {
        let file = path.display();
        let fault = if path.join(RESULT).exists() || holds_run(path) {
            format!("is the folder of a run; go on with --resume {file}, or give a scene file")
        } else if path.is_file() && holds_placements(path) {
            "is a file of placements, where a scene belongs; give it by --baselines or --inject"
                .into()
        } else {
            continue;
        };
        return Err(RunError::Usage(format!("{file}: {fault}")));
    }
    let missing = files.more_scenes.iter().find(|path| can_be_read(path).is_err());
    missing.map_or(Ok(()), |path| Ok(files.read_scene(path).map(drop)?))
}

/// Refuses what a vehicle file alone forbids: a budget below its cheapest rig, and where it requires nothing or has no prices
/// `--fewest` and a front that need them. Other faults are told later.
pub(super) fn check_vehicle(
    files: &JobFiles,
    front: Option<&FrontObjectives>,
    computing: &Computing<'_>,
) -> Result<(), RunError> {
    if files.budget.is_none() && !files.fewest && front.is_none() {
        return Ok(());
    }
    let Some(ground) = vehicle_alone(computing) else { return Ok(()) };
    files.check_vehicle(ground.vehicle())?;
    let job = Job::new(ground).budget(files.budget);
    front.map_or(Ok(()), |objectives| job.check_front(objectives))?;
    if files.budget.is_none() {
        return Ok(());
    }
    match job.check_room() {
        Err(error @ JobError::Search(SearchError::Budget { .. })) => Err(error.into()),
        _ => Ok(()),
    }
}
