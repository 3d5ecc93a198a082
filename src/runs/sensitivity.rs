//! Scores along one field of a placement, and under errors of mounting.

use std::io::Write;
use std::path::PathBuf;

use serde::Serialize;

use super::inputs::Files;
use super::shared::{OpenJob, SharedRequest};
use super::{Computing, RunError, outputs};
use crate::files::{Session, writable_file, write_whole};
use crate::job::{Room, RoomSteps, Sweep, SweptField, TILTS};
use crate::report::study::sweep_plot;
use crate::scan::conditions::in_words;
use crate::vehicle::Placement;

/// Most values of a sweep.
pub const MOST_VALUES: u32 = 1000;
/// Values that are scored at once.
const AT_ONCE: usize = 8;

/// A pose field, its values, and the scenes and placements to score.
#[derive(Debug, Clone)]
pub struct SweepRequest {
    /// Scenes, none for level ground, and a file of placements; frames and weather.
    pub shared: SharedRequest,
    /// `LIDAR.FIELD`, see [`SweptField::find`].
    pub field: String,
    /// First value, metres or degrees.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Values from the first to the last, at equal distances.
    pub values: u32,
    /// SVG file for the chart of a single placement.
    pub out: Option<PathBuf>,
    /// Folder for the chart of each placement.
    pub figures: Option<PathBuf>,
}

/// Rows of every placement.
#[derive(Debug, Serialize)]
pub struct SweepFound {
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
    let SweepRequest { from, to, .. } = *request;
    if !(from.is_finite() && to.is_finite()) || from == to {
        let range = format!("--from {from} --to {to}");
        return Err(RunError::Usage(format!("{range}: give two different numbers")));
    }
    if let Some(out) = &request.out {
        writable_file(out)?;
    }
    outputs::check_figures(request.figures.as_deref())?;
    let (scenes, file) = Files::or_level_ground(&request.shared.files, computing)?;
    let mut opened = OpenJob::new(&request.shared, &scenes, &file, computing)?;
    let fields = opened.fields(&request.field, &file.display().to_string())?;
    if request.out.is_some() && opened.placements.len() > 1 {
        let words = "--out draws one placement; leave the other placements out of the file";
        return Err(RunError::Usage(format!("{}: {words}", file.display())));
    }
    let steps = f64::from(request.values - 1).max(1.0);
    let value = |k: u32| from + (to - from) * f64::from(k) / steps;
    // What lies between two good values is good.
    let mut each = opened.placements.iter().zip(&fields);
    each.try_for_each(|(placement, field)| field.check(placement, &[from, to]))?;
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
        draw(request, &sweeps)?;
    }
    Ok(SweepFound { conditions: in_words(&request.shared.conditions), sweeps })
}

/// Draws a chart where the request names places.
fn draw(request: &SweepRequest, sweeps: &[Sweep]) -> Result<(), RunError> {
    // First, since the file may lie in their folder.
    let figure = |sweep: &Sweep| (format!("sweep-{}", sweep.placement), sweep_plot(sweep));
    outputs::write_figures(request.figures.as_deref(), sweeps.iter().map(figure).collect())?;
    if let (Some(out), [sweep]) = (&request.out, sweeps) {
        let svg = sweep_plot(sweep);
        write_whole(out, |file| file.write_all(svg.as_bytes()).map_err(RunError::io(out)))?;
    }
    Ok(())
}

impl OpenJob {
    /// The field that `text` names in each placement of a file.
    fn fields(&self, text: &str, file: &str) -> Result<Vec<SweptField>, RunError> {
        let problem = self.job.problem()?;
        let find = |placement: &Placement| {
            let found = SweptField::find(text, placement, problem.constraints());
            found.map_err(|error| RunError::Usage(format!("{file}: --of {text}: {error}")))
        };
        self.placements.iter().map(find).collect()
    }
}

/// Room of each placement; an interrupted answer holds the first ones.
#[derive(Debug, Serialize)]
pub struct RoomFound {
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

/// Looks how far each field of each placement may be off, and how far the body may tilt.
///
/// # Errors
/// Files that cannot be read, a vehicle that requires nothing.
pub fn room(
    request: &SharedRequest,
    steps: RoomSteps,
    computing: &Computing<'_>,
) -> Result<RoomFound, RunError> {
    let _session = Session::begin();
    let (scenes, file) = Files::or_level_ground(&request.files, computing)?;
    let mut opened = OpenJob::new(request, &scenes, &file, computing)?;
    let moves = |placement: &Placement| SweptField::all(placement).count() as u64 + TILTS;
    let bar = computing.watcher.bar(opened.placements.iter().map(moves).sum(), Some("moves"));
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
    Ok(RoomFound { conditions: in_words(&request.conditions), steps, rows })
}
