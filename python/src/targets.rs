//! Beams on targets, range cards, redundancy and overlap of a scene's vehicle.

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use sightline::scene::Target;
use sightline::shared::{Overlap, REDUNDANCY_TARGETS, Redundancy, redundancy_question};
use sightline::targets::{
    GroundBelow, RangeCard, TargetQuestion, TargetRow, TargetTable, is_bearing, is_distance,
};
use sightline::{Note, Placement};

use crate::arguments::{self, room_for};
use crate::arrays::{numbers, shape_in_words};
use crate::engine::{Built, counted};
use crate::errors::{bad, raised};
use crate::progress::WorkMessages;

/// Bytes of a row of a table, with its names and the beams of each LiDAR.
const ROW_BYTES: usize = size_of::<TargetRow>() + 128;

/// Targets by preset or file, at distances in metres and bearings in degrees.
pub(crate) fn target_question(
    targets: &Bound<'_, PyAny>,
    distances: &Bound<'_, PyAny>,
    bearings: &Bound<'_, PyAny>,
) -> PyResult<TargetQuestion> {
    let targets = named(&arguments::texts("targets", targets)?)?;
    let above_0 = "metres above 0 and up to 1000";
    let distances = row("distances", distances, above_0, is_distance)?;
    let bearings = row("bearings", bearings, "degrees from -360 to 360", is_bearing)?;
    let rows = [targets.len(), bearings.len(), distances.len()];
    let rows = rows.into_iter().fold(1, usize::saturating_mul);
    room_for("beams on targets", rows, ROW_BYTES)?;
    Ok(TargetQuestion { targets, distances, bearings, beams: 1, of_frames: 1 })
}

/// Targets by preset or file.
fn named(names: &[String]) -> PyResult<Vec<Target>> {
    let named = |name: &String| Target::named(name).map_err(raised);
    names.iter().map(named).collect()
}

/// Targets whose redundancy is counted; the usual presets for `None`.
pub(crate) fn redundancy_targets(targets: Option<&Bound<'_, PyAny>>) -> PyResult<TargetQuestion> {
    let names = match targets {
        Some(targets) => arguments::texts("targets", targets)?,
        None => REDUNDANCY_TARGETS.map(str::to_owned).to_vec(),
    };
    Ok(redundancy_question(named(&names)?))
}

/// Numbers in a row that `is_allowed`.
pub(crate) fn row(
    what: &str,
    given: &Bound<'_, PyAny>,
    allowed: &str,
    is_allowed: fn(f64) -> bool,
) -> PyResult<Vec<f64>> {
    let wanted = format!("[N] {allowed}");
    let array = numbers::<f64>(what, given, &wanted)?;
    let values: Vec<f64> = array.as_array().iter().copied().collect();
    if array.ndim() != 1 {
        let shape = shape_in_words(array.shape());
        return Err(bad(format!("{what}: has the shape {shape}; give {wanted}")));
    }
    match values.iter().position(|value| !is_allowed(*value)) {
        Some(at) => Err(bad(format!("{what}[{at}]: is {}; give {allowed}", values[at]))),
        None => Ok(values),
    }
}

fn ends_at_nothing() -> PyErr {
    bad("beams end at nothing in this scene; give it geometry and a body")
}

impl Built {
    /// Range card of a placement; `None` with coverage `through`.
    pub(crate) fn range_card(&self, placement: &Placement) -> PyResult<Option<RangeCard>> {
        let site = self.job.target_site().map_err(raised)?;
        let card = site.map(|site| RangeCard::new(site, &placement.lidars)).transpose();
        card.map_err(|unknown| bad(unknown.to_string()))
    }

    /// Voxels, ground and targets by the number of LiDARs of a placement that see them.
    pub(crate) fn redundancy(
        &self,
        question: &TargetQuestion,
        placement: &Placement,
        watch: &WorkMessages,
    ) -> PyResult<Redundancy> {
        self.psog(watch)?;
        let site = self.job.scenes()[0].redundancy_site().map_err(raised)?;
        self.evaluate(watch, |evaluator| {
            let frames = evaluator.shared_problem().distinct_frames().len();
            // Voxels first, then ground where there is any.
            let casts = frames * (1 + usize::from(site.no_ground().is_none()));
            let look = counted(evaluator.backend_mut(), watch, casts, |engine| {
                site.look(engine, question, placement)
            });
            look.map_err(raised)
        })
    }

    /// Surfaces and directions that pairs of LiDARs of a placement share.
    pub(crate) fn overlap(
        &self,
        least_shared: u64,
        placement: &Placement,
        watch: &WorkMessages,
    ) -> PyResult<Overlap> {
        self.psog(watch)?;
        let problem = self.job.problem().map_err(raised)?;
        self.evaluate(watch, |evaluator| {
            let frames = problem.distinct_frames().len();
            let found = counted(evaluator.backend_mut(), watch, frames, |engine| {
                Overlap::new(&self.scene, &problem, engine, placement, least_shared)
            });
            found.map_err(raised)
        })
    }

    /// Beams of a placement on each target at its places, and distances of detection; in the scored frames, or on `level`
    /// ground.
    pub(crate) fn detections(
        &self,
        question: &TargetQuestion,
        placement: &Placement,
        level: bool,
        watch: &WorkMessages,
    ) -> PyResult<TargetTable> {
        let site = self.job.target_site().map_err(raised)?.ok_or_else(ends_at_nothing)?;
        if level {
            return question.on_level_ground(site, placement).map_err(|e| bad(e.to_string()));
        }
        let ground = GroundBelow::new(&self.scene);
        self.evaluate(watch, |evaluator| {
            let problem = evaluator.shared_problem();
            let frames = problem.frame_count();
            let found = counted(evaluator.backend_mut(), watch, frames, |engine| {
                question.in_scene(site, (&problem, &ground), engine, placement)
            });
            Ok(found.map_err(raised)?.of_scene(self.scene.name()))
        })
    }

    /// Doubt about distances beyond the range of every LiDAR of a placement; `None` where there are none.
    pub(crate) fn beyond(
        &self,
        question: &TargetQuestion,
        placement: &Placement,
    ) -> PyResult<Option<Note>> {
        let site = self.job.target_site().map_err(raised)?;
        let beyond = site.and_then(|site| question.beyond(site.sensors(), &placement.lidars));
        Ok(beyond.map(|(range, beyond)| {
            let beyond: Vec<String> = beyond.iter().map(ToString::to_string).collect();
            Note::doubt(format!(
                "distances: the LiDARs reach {range} m at most and meet no target at {} m: this lies beyond their range; leave \
                 them out, or take sensors of longer range",
                beyond.join(", ")
            ))
        }))
    }

    /// Beams of a placement on each target at each bearing and distance on level ground, by LiDAR, in that order.
    pub(crate) fn beams_on(
        &self,
        question: &TargetQuestion,
        placement: &Placement,
    ) -> PyResult<Vec<u32>> {
        let site = self.job.target_site().map_err(raised)?;
        let site = site.ok_or_else(ends_at_nothing)?;
        let table = question.on_level_ground(site, placement);
        let table = table.map_err(|unknown| bad(unknown.to_string()))?;
        Ok(table.rows.into_iter().flat_map(|row| row.by_lidar).collect())
    }
}
