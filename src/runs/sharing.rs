//! Things that several LiDARs of a placement see, and the overlap of pairs.

use serde::Serialize;

use super::coverage::named;
use super::inputs::Files;
use super::outputs::Drawings;
use super::run_folder::{with_run, with_run_scenes};
use super::sensitivity::{OpenJob, SharedRequest};
use super::{Computing, FiguresOut, RunError};
use crate::files::Session;
use crate::report::tables::{overlap_csv, redundancy_csv};
use crate::scan::conditions::in_words;
use crate::scene::Target;
use crate::shared::{Overlap, REDUNDANCY_TARGETS, Redundancy, redundancy_question};
use crate::vehicle::read_placements;

/// Scenes, placements, and targets to count the LiDARs on.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct RedundancyRequest {
    /// Target: a preset, or a file { "sightline": 1, "name", "shapes", "reflectance" }; may be given several
    /// times [default: car, adult, child, tyre]
    #[cfg_attr(feature = "cli", arg(long = "target", value_name = "NAME|FILE"))]
    pub targets: Vec<String>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub shared: SharedRequest,
}

/// Scenes and placements whose pairs are looked at.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(mut_arg("files", |files| files.value_name("SCENE… PLACEMENTS")
    .help("Scene files, and a file of placements with two LiDARs or more each"))))]
pub struct OverlapRequest {
    /// Least surface voxels that a pair must share to count, a mean over frames
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = crate::shared::LEAST_SHARED, value_parser = super::parse::at_least_one))]
    pub least_shared: u64,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub shared: SharedRequest,
}

/// Redundancy of placements, and the settings behind the numbers; an interrupted answer holds the first rows.
#[derive(Debug, Serialize)]
pub struct RedundancyFound {
    /// Scenes and frames behind the numbers, in words.
    #[serde(skip)]
    pub over: String,
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

impl RedundancyFound {
    /// All rows, the means last.
    pub(crate) fn all(&self) -> Vec<&Redundancy> {
        self.rows.iter().chain(&self.mean).collect()
    }
}

/// Overlap of placements; an interrupted answer holds the first rows.
#[derive(Debug, Serialize)]
pub struct OverlapFound {
    /// Scenes and frames behind the numbers, in words.
    #[serde(skip)]
    pub over: String,
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
    RedundancyRequest { shared: request, targets, figures }: &RedundancyRequest,
    computing: &Computing<'_>,
) -> Result<RedundancyFound, RunError> {
    let _session = Session::begin();
    let drawings = Drawings::in_folder(figures);
    drawings.check()?;
    let targets = match &targets[..] {
        [] => named(&REDUNDANCY_TARGETS.map(str::to_owned), computing)?,
        given => named(given, computing)?,
    };
    let question = redundancy_question(targets);
    let (files, computing) = &with_run(&request.files, computing)?;
    let (scenes, file) = Files::or_level_ground(files, computing)?;
    for condition in request.conditions.condition.iter().filter(|condition| !condition.dims_light())
    {
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
        if index == 0 && site.has_cones() && !request.conditions.condition.is_empty() {
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
    let found = RedundancyFound {
        over: opened.over(&scenes),
        beams: question.beams,
        targets: question.targets,
        distances: question.distances,
        bearings: question.bearings,
        conditions: in_words(&request.conditions.condition),
        mean: Redundancy::means(&rows, opened.placements.len()),
        rows,
    };
    if computing.watcher.goes_on() {
        let table = ("redundancy", || redundancy_csv(&found.all()));
        drawings.write(Vec::new(), table, || None, computing.watcher)?;
    }
    Ok(found)
}

/// Overlap of the LiDARs of each placement, pair by pair. A pair counts if it shares `least_shared` voxels or more.
///
/// # Errors
/// Files that cannot be read, a scene without geometry or in which beams end at nothing, a placement of one LiDAR.
pub fn overlap(
    OverlapRequest { shared: request, least_shared, figures }: &OverlapRequest,
    computing: &Computing<'_>,
) -> Result<OverlapFound, RunError> {
    let _session = Session::begin();
    let drawings = Drawings::in_folder(figures);
    drawings.check()?;
    let (files, computing) = &with_run_scenes(&request.files, computing)?;
    let (scenes, file) = Files::with_placements(files, computing.watcher)?;
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
            rows.push(Overlap::new(scene, problem, engine, placement, *least_shared)?);
            bar.advance(1);
        }
    }
    drop(bar);
    opened.finish(computing);
    let over = opened.over(&scenes);
    if computing.watcher.goes_on() {
        let table = ("overlap", || overlap_csv(&rows));
        drawings.write(Vec::new(), table, || None, computing.watcher)?;
    }
    Ok(OverlapFound { over, conditions: in_words(&request.conditions.condition), rows })
}
