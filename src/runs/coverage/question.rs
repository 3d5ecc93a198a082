//! The question of `study targets`: its targets, distances and bearings.

use super::TargetsRequest;
use crate::json::counted;
use crate::runs::{Computing, RunError, Watcher};
use crate::scan::conditions::weather;
use crate::scene::Target;
use crate::targets::{Receiving, TargetQuestion, card_bearings};
use crate::vehicle::{Placement, Sensors};

/// Notes on distances that were told, and the longest range of the LiDARs where distances go to it.
#[derive(Default)]
pub(super) struct DistanceNotes {
    told: Vec<String>,
    /// Metres.
    pub range: Option<f32>,
}

/// The question with distances to the range of the LiDARs where none are given; notes given ones that lie beyond.
pub(super) fn with_distances(
    question: &TargetQuestion,
    (sensors, placements): (&Sensors, &[Placement]),
    reached: &mut DistanceNotes,
    watcher: &dyn Watcher,
) -> TargetQuestion {
    if !question.distances.is_empty() {
        note_beyond(question, sensors, placements, &mut reached.told, watcher);
        return question.clone();
    }
    let lidars = placements.iter().flat_map(|placement| &placement.lidars);
    let ranges = lidars.filter_map(|pose| Some(sensors.table(sensors.number(pose).ok()?).range()));
    let range = ranges.fold(0.0, f32::max);
    reached.range = Some(reached.range.map_or(range, |other| other.max(range)));
    TargetQuestion { distances: usual_distances(range), ..question.clone() }
}

/// Notes distances beyond the range of every sensor of a placement; a sentence that was `told` is not told again.
fn note_beyond(
    question: &TargetQuestion,
    sensors: &Sensors,
    placements: &[Placement],
    told: &mut Vec<String>,
    watcher: &dyn Watcher,
) {
    for placement in placements {
        let Some((range, beyond)) = question.beyond(sensors, &placement.lidars) else { continue };
        let beyond = beyond.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let words = format!(
            "--distances: a rig whose sensors reach {range} m at most meets no target at {beyond} m: this lies beyond their range; \
             leave them out, or give sensors of longer range"
        );
        if !told.contains(&words) {
            watcher.note(&words);
            told.push(words);
        }
    }
}

/// Targets of a study that names none.
const TARGETS: [&str; 5] = ["child", "adult", "cyclist", "car", "tyre"];

/// Distances of a study that names none: every 5 m to 60 m, then every 10 m to 200 m, none beyond a range but the first.
pub(super) fn usual_distances(range: f32) -> Vec<f64> {
    let all = (1..=12).map(|k| 5.0 * f64::from(k)).chain((7..=20).map(|k| 10.0 * f64::from(k)));
    all.filter(|metres| *metres <= f64::from(range.max(5.0))).collect()
}

/// Reads targets by preset or file, each once.
pub(in crate::runs) fn named(
    names: &[String],
    computing: &Computing<'_>,
) -> Result<Vec<Target>, RunError> {
    let mut targets: Vec<Target> = Vec::new();
    for name in names {
        let target = Target::named(name)?;
        target.notes.iter().try_for_each(|note| computing.watcher.tell(note))?;
        if targets.iter().any(|known| known.name == target.name) {
            let name = &target.name;
            return Err(RunError::Usage(format!("--target {name}: is given twice; leave one out")));
        }
        targets.push(target);
    }
    Ok(targets)
}

/// Reads the targets, and orders distances; there are none where none are given.
pub(super) fn question(
    request: &TargetsRequest,
    computing: &Computing<'_>,
) -> Result<TargetQuestion, RunError> {
    let targets = match &request.targets[..] {
        [] => named(&TARGETS.map(str::to_owned), computing)?,
        given => named(given, computing)?,
    };
    let mut distances = request.distances.clone();
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    let mut bearings: Vec<f64> = Vec::new();
    let usual = if request.bearings.is_empty() { card_bearings() } else { Vec::new() };
    for bearing in request.bearings.iter().copied().chain(usual) {
        let is_same = |known: &f64| (known - bearing).rem_euclid(360.0) == 0.0;
        match bearings.iter().copied().find(is_same) {
            Some(known) if known != bearing => computing
                .watcher
                .note(&format!("--bearings: {bearing}° is {known}°: given once, as {known}°")),
            Some(_) => {}
            None => bearings.push(bearing),
        }
    }
    let (frames, of_frames) = (request.frames, request.of_frames.unwrap_or(request.frames));
    if of_frames > frames {
        return Err(RunError::Usage(format!(
            "--in {of_frames}: is more than the {} that are looked at; give --frames {of_frames} or more, \
             or --in 1 to {frames}",
            counted(frames as usize, "frame")
        )));
    }
    let of_frames = of_frames as usize;
    Ok(TargetQuestion { targets, distances, bearings, beams: request.beams, of_frames })
}

/// Light that must come back, where it counts.
pub(super) fn receiving(request: &TargetsRequest) -> Result<Option<Receiving>, RunError> {
    for condition in &request.conditions.condition {
        if !condition.dims_light() {
            return Err(RunError::Usage(format!(
                "--condition {condition}: beams on targets are dimmed by fog, snow and rain alone; leave it out"
            )));
        }
    }
    let weather = weather(&request.conditions.condition)?;
    let counts = request.response || !request.conditions.condition.is_empty();
    Ok(counts.then(|| Receiving::from(weather)))
}
