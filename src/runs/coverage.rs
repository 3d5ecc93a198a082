//! Near field and targets of placements, scene by scene.
//!
//! | file | holds |
//! |---|---|
//! | `question` | targets, distances and bearings of `study targets` |

mod question;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::inputs::{Files, Given, fit_alone, held, name_published, no_ground, no_second};
use super::opening::{LoadTimes, Loaded};
use super::outputs::Drawings;
use super::run_folder::{rig_path, with_run, with_run_scenes, with_run_vehicle};
use super::{Computing, Conditions, FiguresOut, GRACE, RunError, opening, outputs};
use crate::audit::{AUDIT_FRAMES, AUDIT_PARTS, Audit, AuditEvent, audit};
use crate::engine::BackendError;
use crate::files::Session;
use crate::job::Job;
use crate::near_field::{Footprint, NearField, NearSite, under_raised_in_words};
use crate::report::coverage::near_field_svg;
use crate::report::tables::{near_field_csv, targets_csv};
use crate::report::targets::{targets_figures, targets_svg};
use crate::scan::conditions::in_words;
use crate::scene::{Scene, Target};
use crate::score::Objective;
use crate::targets::{GroundBelow, Receiving, TargetQuestion, TargetSite, TargetTable};
use crate::vehicle::{Placement, read_placements, table_7};
pub(super) use question::named;
use question::{DistanceNotes, question, receiving, usual_distances, with_distances};

/// Placements whose near field is looked at.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct NearFieldRequest {
    /// Scene file with geometry and an own body; a file of placements alone is looked at on level ground, with --vehicle
    pub scene: PathBuf,
    /// Placements [default: Table 7 of the paper, where the vehicle is its car: one model, a mount that holds them]
    pub placements: Option<PathBuf>,
    /// Draw blind zones and poles from above into this SVG file
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
    /// Average over this many frames, spread evenly over the scene [default: all]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
}

/// Near fields in one scene; an interrupted answer holds the first ones.
#[derive(Debug, Serialize)]
pub struct NearFields {
    /// Name of the scene.
    pub scene: String,
    /// Frames averaged over.
    pub frames: usize,
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Outline of the own vehicle.
    pub footprint: Footprint,
    /// Ground within 10 m in m², mean of the frames.
    pub ground_area: f64,
    /// Near field of each placement, in order.
    pub near_fields: Vec<NearField>,
}

/// Looks at the near field of each placement, and draws it where the request names a file.
///
/// # Errors
/// Files that cannot be read or written, a scene without geometry or own body, a condition given twice.
pub fn near_fields(
    request: &NearFieldRequest,
    computing: &Computing<'_>,
) -> Result<NearFields, RunError> {
    let _session = Session::begin();
    let (request, computing) = &of_run(request, computing)?;
    let watcher = computing.watcher;
    let (scene, file) = site_of(request, computing)?;
    let read = file.as_deref().map(read_placements).transpose()?;
    let drawings = Drawings::new(&request.out, &request.figures);
    drawings.check()?;
    opening::note_conditions(&in_words(&request.conditions.condition), watcher);
    let job = Job::new(scene).geometry_alone().frames(request.frames);
    let job = job.conditions(&request.conditions.condition).engine(computing.engine.clone());
    let mut loaded = Loaded { job, times: LoadTimes::default() };
    let mut evaluator = loaded.evaluator(computing)?;
    let scene = loaded.job.scene();
    let placements = match file.as_deref().zip(read) {
        Some((file, mut read)) => {
            Given::in_problem(file, evaluator.problem(), computing).whole(&mut read)?;
            read
        }
        None => held(scene.vehicle(), evaluator.problem().sensors(), computing)?,
    };
    if file.is_none() && placements.is_empty() {
        return Err(no_layouts(&request.scene));
    }
    let site = NearSite::new(scene, &evaluator.shared_problem())?;
    under_raised_in_words(scene).iter().for_each(|words| watcher.note(words));
    watcher.listen(GRACE);
    let bar = watcher.bar(placements.len() as u64, Some("placements"));
    let mut all = Vec::new();
    for placement in placements.iter().take_while(|_| watcher.goes_on()) {
        all.push(site.look(evaluator.backend_mut(), placement)?);
        bar.advance(1);
    }
    drop(bar);
    if watcher.goes_on() {
        let drawn: Vec<(&Placement, &NearField)> = placements.iter().zip(&all).collect();
        let outline = site.footprint();
        let figure = |one: &(&Placement, &NearField)| {
            (format!("near-field-{}", one.0.name), near_field_svg(outline, &[*one]))
        };
        let figures = drawn.iter().map(figure).collect();
        let table = ("near-field", || near_field_csv(&all));
        drawings.write(figures, table, || Some(near_field_svg(outline, &drawn)), watcher)?;
    } else {
        watcher.note_interrupted(drawings.file.or(drawings.folder));
    }
    Ok(NearFields {
        scene: scene.name().to_owned(),
        frames: evaluator.problem().frame_count(),
        conditions: in_words(&request.conditions.condition),
        footprint: site.footprint().clone(),
        ground_area: site.ground_area(),
        near_fields: all,
    })
}

/// The request, with the files of a run whose folder stands alone.
fn of_run<'a>(
    request: &NearFieldRequest,
    computing: &Computing<'a>,
) -> Result<(NearFieldRequest, Computing<'a>), RunError> {
    let given: Vec<PathBuf> =
        [&request.scene].into_iter().chain(&request.placements).cloned().collect();
    let (files, computing) = with_run(&given, computing)?;
    let (scene, placements) = match &files[..] {
        [scene] => (scene.clone(), None),
        [scene, placements] => (scene.clone(), Some(placements.clone())),
        _ => return Err(RunError::Usage(several_scenes(&request.scene))),
    };
    Ok((NearFieldRequest { scene, placements, ..request.clone() }, computing))
}

/// Scene and file of placements of a request; level ground where a vehicle and placements alone are given.
fn site_of(
    request: &NearFieldRequest,
    computing: &Computing<'_>,
) -> Result<(Scene, Option<PathBuf>), RunError> {
    let watcher = computing.watcher;
    if request.placements.is_none() {
        // A file that is neither is told as a scene.
        let alone = Files::told_apart(std::slice::from_ref(&request.scene)).ok();
        if let Some(file) = alone.and_then(|files| files.placements) {
            let vehicle = computing.vehicle.as_deref();
            let vehicle = vehicle.ok_or_else(|| no_ground(file.display()))?;
            let scene = opening::level_ground(vehicle, request.frames, watcher)?;
            return Ok((scene, Some(rig_path(&file)?)));
        }
    }
    if let Some(placements) = &request.placements {
        no_second(&request.scene, placements)?;
    }
    let mend = "static shapes, actors and an ego body";
    let scene = opening::geometry(&request.scene, mend, computing)?;
    opening::note_frames(&scene, request.frames, watcher);
    Ok((scene, request.placements.as_deref().map(rig_path).transpose()?))
}

/// Error of the folder of a run over several scenes, where one is looked at.
fn several_scenes(folder: &Path) -> String {
    let folder = folder.display();
    format!(
        "{folder}: its run has several scenes, and one is looked at; give one before the folder"
    )
}

/// Error of a vehicle without layouts of its own where no placements are given.
fn no_layouts(scene: &Path) -> RunError {
    RunError::Usage(format!(
        "{}: the vehicle is not the paper's car, whose layouts are looked at by default; give a file of placements behind \
         the scene",
        scene.display()
    ))
}

/// Placements, targets and their places.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct TargetsRequest {
    /// Scene files, none for level ground, and a file of placements
    #[cfg_attr(feature = "cli", arg(value_name = "[SCENE…] PLACEMENTS", required = true))]
    pub files: Vec<PathBuf>,
    /// Target: a preset, or a file { "sightline": 1, "name", "shapes", "reflectance" }; may be given several
    /// times [default: child, adult, cyclist, car, tyre]
    #[cfg_attr(feature = "cli", arg(long = "target", value_name = "NAME|FILE"))]
    pub targets: Vec<String>,
    /// Metres from the vehicle's origin to the middle of the target, separated by commas [default: 5 to the sensors' range, at most 200]
    #[cfg_attr(feature = "cli", arg(long, value_name = "M,…", value_delimiter = ',', value_parser = super::parse::number_that(crate::targets::is_distance, "metres above 0 and up to 1000, as 10,20,30")))]
    pub distances: Vec<f64>,
    /// Degrees counter-clockwise from straight ahead, separated by commas [default: sixteen all round]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEG,…", value_delimiter = ',', value_parser = super::parse::number_that(crate::targets::is_bearing, "degrees from -360 to 360, as 0,90,180")))]
    pub bearings: Vec<f64>,
    /// Beams from which on a target is detected in a frame
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..)))]
    pub beams: u32,
    /// Frames to look at in each scene, spread evenly
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: u32,
    /// Frames in which the target must be detected, no more than --frames [default: all]
    #[cfg_attr(feature = "cli", arg(long = "in", value_name = "M", value_parser = clap::value_parser!(u32).range(1..)))]
    pub of_frames: Option<u32>,
    /// Count only beams of which the sensor sees enough light: by the target's reflectance and the sensor's response
    #[cfg_attr(feature = "cli", arg(long))]
    pub response: bool,
    /// Draw the distances of detection by bearing into this SVG file
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
}

/// Beams on targets, and the settings behind the numbers.
#[derive(Debug, Serialize)]
pub struct TargetsFound {
    /// Scenes and frames behind the numbers, in words.
    #[serde(skip)]
    pub over: String,
    /// Targets with their dimensions and where these are from.
    pub targets: Vec<Target>,
    /// Least beams on a target for a frame to count.
    pub beams: u32,
    /// Frames that must count for a detection.
    pub of_frames: usize,
    /// Weather, as it is written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Longest range of the LiDARs in metres, where distances were not given and go to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach: Option<f32>,
    /// Rows and ranges.
    #[serde(flatten)]
    pub table: TargetTable,
}

/// Counts the beams of each placement on each target, and draws the ranges of detection where a file is given.
///
/// # Errors
/// Files that cannot be read or written, neither scene nor vehicle, weather that no beam is dimmed by.
pub fn targets(
    request: &TargetsRequest,
    computing: &Computing<'_>,
) -> Result<TargetsFound, RunError> {
    let _session = Session::begin();
    let watcher = computing.watcher;
    let (files, computing) = &with_run_vehicle(&request.files, computing)?;
    let (scenes, file) = Files::or_level_ground(files, computing)?;
    let mut question = question(request, computing)?;
    let receiving = receiving(request)?;
    let drawings = Drawings::new(&request.out, &request.figures);
    drawings.check()?;
    let placements = read_placements(&file)?;
    fit_alone(&file, &placements, computing)?;
    let (mut table, mut looked_at) = (TargetTable::default(), Vec::new());
    let mut reached = DistanceNotes::default();
    watcher.listen(GRACE);
    if let Some(vehicle) = computing.vehicle.as_deref().filter(|_| scenes.is_empty()) {
        let scene = opening::level_ground(vehicle, Some(request.frames), watcher)?;
        let given = (&*file, &*placements);
        let place = (&scene, &mut reached);
        table = on_level_ground(&question, receiving.clone(), place, given, computing)?;
    }
    for scene in scenes.iter().take_while(|_| watcher.goes_on()) {
        let given = (&*file, &*placements);
        let place = (&**scene, request.frames, &mut reached);
        let (found, frames) = in_scene(&question, receiving.clone(), place, given, computing)?;
        looked_at.push((found.detections.first().and_then(|of| of.scene.clone()), frames));
        table.append(found);
    }
    let scenes: Vec<(&str, usize)> = looked_at
        .iter()
        .map(|(name, frames)| (name.as_deref().unwrap_or_default(), *frames))
        .collect();
    if question.distances.is_empty() {
        question.distances = usual_distances(reached.range.unwrap_or_default());
    }
    if watcher.goes_on() {
        let figures = targets_figures(&question, &table);
        let csv = ("targets", || targets_csv(&table));
        drawings.write(figures, csv, || Some(targets_svg(&question, &table)), watcher)?;
    } else {
        watcher.note_interrupted(drawings.file.or(drawings.folder));
    }
    let TargetQuestion { targets, beams, of_frames, .. } = question;
    let conditions = in_words(&request.conditions.condition);
    let over = outputs::over(&scenes);
    let reach = reached.range;
    Ok(TargetsFound { over, targets, beams, of_frames, conditions, reach, table })
}

/// Table of placements of a file on level ground.
fn on_level_ground(
    question: &TargetQuestion,
    receiving: Option<Receiving>,
    (ground, reached): (&Scene, &mut DistanceNotes),
    (file, placements): (&Path, &[Placement]),
    computing: &Computing<'_>,
) -> Result<TargetTable, RunError> {
    let (watcher, mut placements) = (computing.watcher, placements.to_vec());
    let site = TargetSite::of_vehicle(ground)?.receiving(receiving);
    Given::new(file, site.sensors(), &ground.rules(), computing).whole(&mut placements)?;
    let question = with_distances(question, (site.sensors(), &placements), reached, watcher);
    let bar = watcher.bar(placements.len() as u64, Some("placements"));
    let mut table = TargetTable::default();
    for placement in placements.iter().take_while(|_| watcher.goes_on()) {
        let found = question.on_level_ground(&site, placement);
        table.append(found.map_err(BackendError::from)?);
        bar.advance(1);
    }
    Ok(table)
}

/// Table of placements of a file in a scene, over some of its frames, and the number of these.
fn in_scene(
    question: &TargetQuestion,
    receiving: Option<Receiving>,
    (path, frames, reached): (&Path, u32, &mut DistanceNotes),
    (file, placements): (&Path, &[Placement]),
    computing: &Computing<'_>,
) -> Result<(TargetTable, usize), RunError> {
    let (watcher, mut placements) = (computing.watcher, placements.to_vec());
    let scene = opening::geometry(path, "static shapes and actors", computing)?;
    opening::note_frames(&scene, Some(frames), watcher);
    let ground = GroundBelow::new(&scene);
    let job = Job::new(scene).geometry_alone().frames(Some(frames));
    let job = job.engine(computing.engine.clone());
    let mut loaded = Loaded { job, times: LoadTimes::default() };
    let mut evaluator = loaded.evaluator(computing)?;
    let problem = evaluator.shared_problem();
    Given::in_problem(file, &problem, computing).whole(&mut placements)?;
    let site = TargetSite::of(&problem).receiving(receiving);
    let question = with_distances(question, (site.sensors(), &placements), reached, watcher);
    let bar = watcher.bar(placements.len() as u64, Some("placements"));
    let mut table = TargetTable::default();
    for placement in placements.iter().take_while(|_| watcher.goes_on()) {
        let place = (&*problem, &ground);
        table.append(question.in_scene(&site, place, evaluator.backend_mut(), placement)?);
        bar.advance(1);
    }
    Ok((table.of_scene(loaded.job.scene().name()), problem.frame_count()))
}

/// Files and settings of an audit.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct AuditRequest {
    /// Scene files, and placements to start from, which should be sound ones: the best of them is changed so
    /// that it sees less, and no score may rise unnoticed [default: Table 7 of the paper]
    #[cfg_attr(feature = "cli", arg(value_name = "SCENE… [PLACEMENTS]", required = true))]
    pub files: Vec<PathBuf>,
    /// Score by which the best placement is chosen, and that is watched while the model changes
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Objective::default().to_string()))]
    pub objective: String,
    /// Frames to average over, spread evenly over the scene [default: 2]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
}

/// Audits scene after scene, and calls `each` with every result.
///
/// # Errors
/// Files that cannot be read, errors of [`audit`] and of `each`.
pub fn audit_scenes(
    request: &AuditRequest,
    computing: &Computing<'_>,
    mut each: impl FnMut(&Audit) -> Result<(), RunError>,
) -> Result<Vec<Audit>, RunError> {
    let (files, computing) = &with_run_scenes(&request.files, computing)?;
    let Files { scenes, placements } = Files::sort(files, computing.watcher)?;
    let honest = placements.as_deref().map(read_placements).transpose()?;
    let objective: Objective = request.objective.parse()?;
    let mut all = Vec::new();
    for path in &scenes {
        let given = placements.as_deref();
        let given = given.zip(honest.as_deref());
        let found = of_scene(path, given, &objective, request.frames, computing)?;
        each(&found)?;
        all.push(found);
    }
    Ok(all)
}

/// The audit of one scene.
fn of_scene(
    path: &Path,
    given: Option<(&Path, &[Placement])>,
    objective: &Objective,
    frames: Option<u32>,
    computing: &Computing<'_>,
) -> Result<Audit, RunError> {
    let watcher = computing.watcher;
    let files = opening::files(&[path.to_owned()], &[], frames, computing);
    let job = opening::job(&files, computing)?.job.frames(frames.or(Some(AUDIT_FRAMES)));
    let job = job.objective(objective.clone());
    let scene = job.scene();
    let sensors = scene.sensors()?;
    let honest = match given {
        Some((file, given)) => {
            let mut given = given.to_vec();
            Given::new(file, &sensors, &scene.rules(), computing).whole(&mut given)?;
            given
        }
        None => name_published(table_7(), &sensors, computing)?,
    };
    let bar = watcher.bar(AUDIT_PARTS, Some("parts"));
    let tell = |event: AuditEvent| match event {
        AuditEvent::Note(note) => watcher.note(note),
        AuditEvent::PartDone => bar.advance(1),
    };
    Ok(audit(&job, &honest, &tell)?)
}
