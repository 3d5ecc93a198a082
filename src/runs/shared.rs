//! How many LiDARs of placements see a thing, and the overlap of pairs, in scene files.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::coverage::named;
use super::inputs::{Files, Given, note_repeated};
use super::opening::{LoadTimes, Loaded};
use super::{Computing, GRACE, RunError, opening};
use crate::files::Session;
use crate::job::Job;
use crate::scan::conditions::{Condition, in_words};
use crate::scene::{Scene, Target};
use crate::search::Evaluator;
use crate::shared::{Overlap, Redundancy, redundancy_question};
use crate::vehicle::{Placement, read_placements};

/// Scenes and placements that are looked at.
#[derive(Debug, Clone, Default)]
pub struct SharedRequest {
    /// Scenes, none for level ground, and a file of placements.
    pub files: Vec<PathBuf>,
    /// Frames of each scene to average over; all if none.
    pub frames: Option<u32>,
    /// Weather and faults. Beams that do not come back see nothing.
    pub conditions: Vec<Condition>,
}

/// Redundancy of placements, and the settings behind the numbers; an interrupted answer holds the first rows.
#[derive(Debug, Serialize)]
pub struct RedundancyFound {
    /// Least beams of a LiDAR on a target that it sees.
    pub beams: u32,
    /// Targets with their dimensions and where these are from.
    pub targets: Vec<Target>,
    /// Metres from the ego origin to the middle of a target.
    pub distances: Vec<f64>,
    /// Degrees counter-clockwise from straight ahead.
    pub bearings: Vec<f64>,
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// For each scene, each placement.
    pub rows: Vec<Redundancy>,
    /// Means over several scenes, a row a placement; empty where there is one scene.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mean: Vec<Redundancy>,
}

/// Overlap of placements; an interrupted answer holds the first rows.
#[derive(Debug, Serialize)]
pub struct OverlapFound {
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// For each scene, each placement.
    pub rows: Vec<Overlap>,
}

/// Counts the LiDARs of each placement that see voxels, ground and targets given by preset or file.
///
/// # Errors
/// Files that cannot be read, an unknown target or one given twice, neither scene nor vehicle.
pub fn redundancy(
    request: &SharedRequest,
    targets: &[String],
    computing: &Computing<'_>,
) -> Result<RedundancyFound, RunError> {
    let _session = Session::begin();
    let question = redundancy_question(named(targets, computing)?);
    let (scenes, file) = Files::or_level_ground(&request.files, computing)?;
    for condition in request.conditions.iter().filter(|condition| !condition.dims_light()) {
        let words = "changes voxels and ground; targets are dimmed by fog, snow and rain alone";
        computing.watcher.note(&format!("--condition {condition}: {words}"));
    }
    let mut opened = OpenJob::new(request, &scenes, &file, computing)?;
    let mut rows = Vec::new();
    let bar = opened.bar(computing);
    for (index, scene) in opened.job.scenes().iter().enumerate() {
        let (site, (_, engine)) = (scene.redundancy_site()?, opened.evaluator.member_mut(index));
        if let Some(reason) = site.no_ground() {
            computing.watcher.note(reason);
        }
        site.notes().iter().for_each(|note| computing.watcher.note(note));
        if index == 0 && site.has_cones() && !request.conditions.is_empty() {
            let words =
                "weather and faults change the sight of LiDARs; other_sensors see as in clear air";
            computing.watcher.note(words);
        }
        for placement in opened.placements.iter().take_while(|_| computing.watcher.goes_on()) {
            rows.push(site.look(engine, &question, placement)?);
            bar.advance(1);
        }
    }
    drop(bar);
    opened.finish(computing);
    Ok(RedundancyFound {
        beams: question.beams,
        targets: question.targets,
        distances: question.distances,
        bearings: question.bearings,
        conditions: in_words(&request.conditions),
        mean: Redundancy::means(&rows, opened.placements.len()),
        rows,
    })
}

/// Looks at the overlap of each placement's pairs; those of `least_shared` voxels or more count.
///
/// # Errors
/// Files that cannot be read, a scene without geometry or in which beams end at nothing, a placement of one LiDAR.
pub fn overlap(
    request: &SharedRequest,
    least_shared: u64,
    computing: &Computing<'_>,
) -> Result<OverlapFound, RunError> {
    let _session = Session::begin();
    let (scenes, file) = Files::with_placements(&request.files, computing.watcher)?;
    for placement in read_placements(&file)? {
        if placement.lidars.len() < 2 {
            return Err(RunError::Usage(format!(
                "{}: placement `{}` has one LiDAR, and overlap is between two; add a second LiDAR, or leave the \
                 placement out",
                file.display(),
                placement.name
            )));
        }
    }
    let mut opened = OpenJob::new(request, &scenes, &file, computing)?;
    let mut rows = Vec::new();
    let bar = opened.bar(computing);
    for (index, scene) in opened.job.scenes().iter().enumerate() {
        let (member, engine) = opened.evaluator.member_mut(index);
        for placement in opened.placements.iter().take_while(|_| computing.watcher.goes_on()) {
            let (scene, problem) = (scene.scene(), member.problem());
            rows.push(Overlap::new(scene, problem, engine, placement, least_shared)?);
            bar.advance(1);
        }
    }
    drop(bar);
    opened.finish(computing);
    Ok(OverlapFound { conditions: in_words(&request.conditions), rows })
}

/// A job over the scenes of a request with its engines, and the placements.
pub(super) struct OpenJob {
    pub job: Job,
    pub evaluator: Evaluator,
    pub placements: Vec<Placement>,
}

impl OpenJob {
    pub fn new(
        request: &SharedRequest,
        scenes: &[PathBuf],
        file: &Path,
        computing: &Computing<'_>,
    ) -> Result<Self, RunError> {
        let (watcher, mut placements) = (computing.watcher, read_placements(file)?);
        let mut loaded = match (scenes, &computing.vehicle) {
            ([], Some(vehicle)) => {
                let scene = Scene::level_ground(vehicle)?;
                scene.notes().iter().try_for_each(|note| watcher.tell(note))?;
                opening::note_frames(&scene, request.frames, watcher);
                let job = Job::new(scene).conditions(&request.conditions);
                let job = job.engine(computing.engine.clone());
                Loaded { job, times: LoadTimes::default() }
            }
            _ => {
                note_repeated(scenes, watcher);
                let (conditions, frames) = (&request.conditions, request.frames);
                opening::job(&opening::files(scenes, conditions, frames, computing), computing)?
            }
        };
        let evaluator = loaded.evaluator(computing)?;
        Given::in_problem(file, evaluator.problem(), computing).all(&mut placements)?;
        watcher.listen(GRACE);
        Ok(Self { job: loaded.job, evaluator, placements })
    }

    fn bar<'a>(&self, computing: &Computing<'a>) -> Box<dyn super::Bar> {
        let rows = self.placements.len() * self.job.scenes().len();
        computing.watcher.bar(rows as u64, Some("placements"))
    }

    pub fn finish(&self, computing: &Computing<'_>) {
        if !computing.watcher.goes_on() {
            computing.watcher.note_interrupted(None);
        }
    }
}
