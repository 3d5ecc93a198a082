//! Scores along one field of a placement, and under errors of mounting.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::inputs::{Files, Given, file_and_name, fit_alone, note_repeated};
use super::opening::{LoadTimes, Loaded, no_hidden_places, vehicle_alone};
use super::outputs::Drawings;
use super::run_folder::with_run;
use super::{Computing, Conditions, FiguresOut, GRACE, RunError, opening, outputs};
use crate::Note;
use crate::files::Session;
use crate::job::{Job, JobError, JobScene, Room, RoomSteps, Sweep, SweptField, moves_of};
use crate::report::study::sweep_plot;
use crate::report::tables::{room_csv, sweep_csv};
use crate::scan::conditions::in_words;
use crate::search::Evaluator;
use crate::vehicle::{Constraints, Placement, read_placements};

/// Values that are scored at once.
const AT_ONCE: usize = 8;
/// Frames of each scene over which deviations are looked at unless told otherwise: each of hundreds of them looks at all.
const FRAMES_OF_ROOM: u32 = 4;

/// A pose field, its values, and the scenes and placements to score.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct SweepRequest {
    /// Field to move: x, y, z in metres, roll, pitch, yaw in degrees
    #[cfg_attr(feature = "cli", arg(long = "of", value_name = "LIDAR.FIELD"))]
    pub field: String,
    /// First value
    #[cfg_attr(feature = "cli", arg(long, value_name = "V", allow_negative_numbers = true))]
    pub from: f64,
    /// Last value
    #[cfg_attr(feature = "cli", arg(long, value_name = "V", allow_negative_numbers = true))]
    pub to: f64,
    /// Values from the first to the last
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(2..=1000)))]
    pub values: u32,
    /// Draw scores and requirements over the values into this SVG file
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub shared: SharedRequest,
}

impl SweepRequest {
    /// First and last value.
    fn range(&self) -> Result<[f64; 2], RunError> {
        let Self { from, to, .. } = *self;
        if !(from.is_finite() && to.is_finite()) || from == to {
            let range = format!("--from {from} --to {to}");
            return Err(RunError::Usage(format!("{range}: give two different numbers")));
        }
        Ok([from, to])
    }
}

/// Rows of every placement.
#[derive(Debug, Serialize)]
pub struct SweepFound {
    /// Scenes and frames behind the numbers, in words.
    #[serde(skip)]
    pub over: String,
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// A sweep a placement.
    pub sweeps: Vec<Sweep>,
}

/// Scores each placement as it is given and with the field at each value.
///
/// # Errors
/// Files that cannot be read, a LiDAR or field that a placement does not have, a range of no length.
pub fn sweep(request: &SweepRequest, computing: &Computing<'_>) -> Result<SweepFound, RunError> {
    let _session = Session::begin();
    let [from, to] = request.range()?;
    let drawings = Drawings::new(&request.out, &request.figures);
    drawings.check()?;
    let (files, computing) = &with_run(&request.shared.files, computing)?;
    let (scenes, file) = Files::or_level_ground(files, computing)?;
    if !scenes.is_empty() {
        check_field(&request.field, &file, computing)?;
    }
    let mut opened = OpenJob::new(&request.shared, &scenes, &file, computing)?;
    opening::note_relief(&opened.job, computing.watcher)?;
    let given = (&*file, &*opened.placements);
    let fields = fields(&request.field, given, opened.job.problem()?.rules())?;
    if request.out.is_some() && opened.placements.len() > 1 {
        let words = "--out draws one placement; leave the other placements out of the file";
        return Err(RunError::Usage(format!("{}: {words}", file.display())));
    }
    let steps = f64::from(request.values - 1).max(1.0);
    let value = |k: u32| from + (to - from) * f64::from(k) / steps;
    // Values between two good ones are good.
    let mut each = opened.placements.iter().zip(&fields);
    each.try_for_each(|(placement, field)| field.check(placement, &[from, to]))?;
    if let Some(doubt) = fields.iter().find_map(|field| field.doubt([from, to])) {
        let of = format!("--of {} --from {from} --to {to}: {doubt}", request.field);
        computing.watcher.tell(&Note::doubt(of))?;
    }
    let as_given = std::iter::once(None);
    let values: Vec<Option<f64>> =
        as_given.chain((0..request.values).map(|k| Some(value(k)))).collect();
    let total = values.len() * opened.placements.len();
    let bar = computing.watcher.bar(total as u64, Some("placements"));
    let mut sweeps = Vec::new();
    for (placement, field) in opened.placements.clone().iter().zip(fields) {
        let mut rows = Vec::new();
        for some in values.chunks(AT_ONCE) {
            let (evaluator, go_on) = (&mut opened.evaluator, &mut || computing.watcher.goes_on());
            let Some(more) = opened.job.sweep_rows(evaluator, placement, field, some, go_on)?
            else {
                break;
            };
            rows.extend(more);
            bar.advance(some.len() as u64);
        }
        sweeps.push(Sweep::new(placement, field, rows));
    }
    drop(bar);
    opened.finish(computing);
    if computing.watcher.goes_on() {
        let figure = |sweep: &Sweep| (format!("sweep-{}", sweep.placement), sweep_plot(sweep));
        let figures = sweeps.iter().map(figure).collect();
        let table = ("sweep", || sweep_csv(&sweeps));
        drawings.write(figures, table, || sweeps.first().map(sweep_plot), computing.watcher)?;
    }
    Ok(SweepFound {
        over: opened.over(&scenes),
        conditions: in_words(&request.shared.conditions.condition),
        sweeps,
    })
}

/// The field that `text` names in each placement of a file.
fn fields(
    text: &str,
    (file, placements): (&Path, &[Placement]),
    rules: &Constraints,
) -> Result<Vec<SweptField>, RunError> {
    let file = file.display();
    let wrong = |error| RunError::Usage(format!("{file}: --of {text}: {error}"));
    let find = |placement| SweptField::find(text, placement, rules).map_err(wrong);
    placements.iter().map(find).collect()
}

/// Refuses a field that no LiDAR has, before a scene is read: of a LiDAR by its name, where the vehicle is a file. Placements
/// of a pipe are read once, later.
fn check_field(text: &str, file: &Path, computing: &Computing<'_>) -> Result<(), RunError> {
    let plain = file.to_str().map_or(file, |text| Path::new(file_and_name(text).0));
    if !plain.is_file() {
        return Ok(());
    }
    let placements = read_placements(file)?;
    if let Some((ground, named)) = fit_alone(file, &placements, computing)? {
        return fields(text, (file, &named), &ground.rules()).map(drop);
    }
    let by_name = text.rsplit_once('.').is_some_and(|(lidar, _)| lidar.parse::<usize>().is_err());
    if by_name {
        return Ok(());
    }
    fields(text, (file, &placements), &Constraints::default()).map(drop)
}

/// Room of each placement; an interrupted answer holds the first ones.
#[derive(Debug, Serialize)]
pub struct RoomFound {
    /// Scenes and frames behind the numbers, in words.
    #[serde(skip)]
    pub over: String,
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Deviations that were looked at.
    #[serde(flatten)]
    pub steps: RoomSteps,
    /// A row a placement.
    pub rows: Vec<Room>,
}

impl RoomFound {
    /// True if every placement meets its requirements as it is.
    pub fn all_meet(&self) -> bool {
        self.rows.iter().all(|row| row.missed.is_empty())
    }
}

/// Scenes, placements, and deviations to look at.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(mut_arg("frames", |frames| frames
    .help("Average over this many frames, spread evenly over each scene [default: at most 4, all where own bodies move]"))))]
pub struct RoomRequest {
    /// Farthest deviation of x, y and z, millimetres
    #[cfg_attr(feature = "cli", arg(long, value_name = "MM", default_value_t = 100.0, value_parser = super::parse::number_that(|mm| mm > 0.0 && mm <= 10_000.0, "millimetres above 0 and up to 10000")))]
    pub most_mm: f64,
    /// Farthest deviation of roll, pitch and yaw, degrees
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEG", default_value_t = 5.0, value_parser = super::parse::number_that(|degrees| degrees > 0.0 && degrees <= 180.0, "degrees above 0 and up to 180")))]
    pub most_deg: f64,
    /// Farthest tilt of the body, degrees
    #[cfg_attr(feature = "cli", arg(long = "most-tilt", value_name = "DEG", default_value_t = 3.0, value_parser = super::parse::number_that(|degrees| degrees > 0.0 && degrees <= crate::job::MOST_TILT, format!("degrees above 0 and up to {}", crate::job::MOST_TILT))))]
    pub most_tilt_deg: f64,
    /// Point of the ground about which the body tilts, metres of the ego frame
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y", default_value = "0,0", value_parser = super::parse::tilt_about, allow_hyphen_values = true))]
    pub tilt_about: [f64; 2],
    /// Deviations up to the farthest one, on each side
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000)))]
    pub steps: u32,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub shared: SharedRequest,
}

/// Looks how far each field of each placement may be off, and how far the body may tilt.
///
/// # Errors
/// Files that cannot be read, a vehicle that requires nothing.
pub fn room(request: &RoomRequest, computing: &Computing<'_>) -> Result<RoomFound, RunError> {
    let _session = Session::begin();
    let &RoomRequest { most_mm, most_deg, most_tilt_deg, tilt_about, steps, .. } = request;
    let (shared, drawings) = (&request.shared, Drawings::in_folder(&request.figures));
    drawings.check()?;
    let steps = RoomSteps { most_mm, most_deg, most_tilt_deg, tilt_about, steps };
    let (files, computing) = &with_run(&shared.files, computing)?;
    let (scenes, file) = Files::or_level_ground(files, computing)?;
    if vehicle_alone(computing).is_some_and(|ground| !ground.vehicle().requires()) {
        return Err(JobError::NothingRequired { asked: "tolerance" }.into());
    }
    let mut opened = OpenJob::over_frames(Some(FRAMES_OF_ROOM), shared, &scenes, &file, computing)?;
    if opened.job.problem()?.target_rules().iter().any(|rule| !rule.on_scene) {
        opening::note_relief(&opened.job, computing.watcher)?;
    }
    let bar = computing.watcher.bar(opened.placements.iter().map(moves_of).sum(), Some("moves"));
    let mut go_on = |moves: u64| {
        bar.advance(moves);
        computing.watcher.goes_on()
    };
    let mut rows = Vec::new();
    for placement in &opened.placements {
        if !go_on(0) {
            break;
        }
        rows.push(opened.job.room_while(&mut opened.evaluator, placement, &steps, &mut go_on)?);
    }
    drop(bar);
    opened.finish(computing);
    let over = opened.over(&scenes);
    if computing.watcher.goes_on() {
        let table = ("tolerance", || room_csv(&rows));
        drawings.write(Vec::new(), table, || None, computing.watcher)?;
    }
    Ok(RoomFound { over, conditions: in_words(&shared.conditions.condition), steps, rows })
}

/// Scenes and placements that are looked at.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct SharedRequest {
    /// Scene files, none for level ground, and a file of placements
    #[cfg_attr(feature = "cli", arg(value_name = "[SCENE…] PLACEMENTS", required = true))]
    pub files: Vec<PathBuf>,
    /// Average over this many frames, spread evenly over each scene [default: all]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
}

/// A job over the scenes of a request with its engines, and the placements.
pub(super) struct OpenJob {
    pub job: Job,
    pub evaluator: Evaluator,
    pub placements: Vec<Placement>,
}

impl OpenJob {
    pub(crate) fn new(
        request: &SharedRequest,
        scenes: &[PathBuf],
        file: &Path,
        computing: &Computing<'_>,
    ) -> Result<Self, RunError> {
        Self::over_frames(None, request, scenes, file, computing)
    }

    /// Like [`Self::new`], with at most `few` frames of each scene where nothing says how many and no own body moves.
    fn over_frames(
        few: Option<u32>,
        request: &SharedRequest,
        scenes: &[PathBuf],
        file: &Path,
        computing: &Computing<'_>,
    ) -> Result<Self, RunError> {
        let (watcher, mut placements) = (computing.watcher, read_placements(file)?);
        if !scenes.is_empty() {
            fit_alone(file, &placements, computing)?;
        }
        let mut loaded = match (scenes, &computing.vehicle) {
            ([], Some(vehicle)) => {
                vehicle_alone(computing).map_or(Ok(()), |alone| no_hidden_places(&alone))?;
                let scene = opening::level_ground(vehicle, request.frames, watcher)?;
                let job = Job::new(scene).conditions(&request.conditions.condition);
                let job = job.engine(computing.engine.clone());
                Loaded { job, times: LoadTimes::default() }
            }
            _ => {
                note_repeated(scenes, watcher);
                let (conditions, frames) = (&request.conditions.condition, request.frames);
                opening::job(&opening::files(scenes, conditions, frames, computing), computing)?
            }
        };
        let is_still = loaded.job.scenes().iter().all(|of| !of.scene().has_moving_bodies());
        if let Some(few) = few.filter(|_| request.frames.is_none() && is_still) {
            let frames = |scene: &JobScene| scene.scene().frame_count();
            for scene in loaded.job.scenes().iter().filter(|scene| frames(scene) > few as usize) {
                let (place, all) = (scene.place(), frames(scene));
                let looked = format!("{few} of {all} frames are looked at, spread evenly");
                watcher.note(&format!("{place}: {looked}; --frames {all} looks at all"));
            }
            loaded.job = loaded.job.frames(Some(few));
        }
        let evaluator = loaded.evaluator(computing)?;
        Given::in_problem(file, evaluator.problem(), computing).whole(&mut placements)?;
        watcher.listen(GRACE);
        Ok(Self { job: loaded.job, evaluator, placements })
    }

    pub(super) fn bar<'a>(&self, computing: &Computing<'a>) -> Box<dyn super::Bar> {
        let rows = self.placements.len() * self.job.scenes().len();
        computing.watcher.bar(rows as u64, Some("placements"))
    }

    /// Scenes of these files and frames of each, in words.
    pub(super) fn over(&self, files: &[PathBuf]) -> String {
        let scenes = self.job.scenes().iter().take(files.len());
        let each: Vec<(&str, usize)> =
            scenes.map(|scene| (scene.scene().name(), scene.frame_numbers().len())).collect();
        outputs::over(&each)
    }

    pub(crate) fn finish(&self, computing: &Computing<'_>) {
        if !computing.watcher.goes_on() {
            computing.watcher.note_interrupted(None);
        }
    }
}
