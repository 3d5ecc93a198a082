//! Beams on targets and range cards of a scene's vehicle.

use pyo3::prelude::*;
use sightline::Placement;
use sightline::scene::Target;
use sightline::targets::{RangeCard, TargetQuestion};

use crate::engine::Built;
use crate::errors::{bad, raised};

/// Targets by preset or file, at finite distances in metres and bearings in degrees.
pub fn target_question(
    targets: &[String],
    distances: Vec<f64>,
    bearings: Vec<f64>,
) -> PyResult<TargetQuestion> {
    let named = |name: &String| Target::named(name).map_err(|error| bad(error.to_string()));
    let targets = targets.iter().map(named).collect::<PyResult<Vec<_>>>()?;
    if !distances.iter().chain(&bearings).all(|number| number.is_finite()) {
        return Err(bad("distances and bearings: give finite numbers".to_owned()));
    }
    Ok(TargetQuestion { targets, distances, bearings, beams: 1, of_frames: 1 })
}

impl Built {
    /// Range card of a placement; `None` where beams end at nothing.
    pub fn range_card(&self, placement: &Placement) -> PyResult<Option<RangeCard>> {
        let site = self.job.target_site().map_err(raised)?;
        let card = site.map(|site| RangeCard::new(&site, &placement.lidars)).transpose();
        card.map_err(|unknown| bad(unknown.to_string()))
    }

    /// Beams of a placement on each target at each bearing and distance on level ground, by LiDAR, in that order.
    pub fn beams_on(&self, question: &TargetQuestion, placement: &Placement) -> PyResult<Vec<u32>> {
        let site = self.job.target_site().map_err(raised)?;
        let site = site.ok_or_else(|| {
            bad("beams end at nothing in this scene; give it geometry and a body".to_owned())
        })?;
        let table = question.on_level_ground(&site, placement);
        let table = table.map_err(|unknown| bad(unknown.to_string()))?;
        Ok(table.rows.into_iter().flat_map(|row| row.by_lidar).collect())
    }
}
