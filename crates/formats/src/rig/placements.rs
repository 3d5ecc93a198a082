//! Placements of this program as rigs: a LiDAR may name its sensor.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::model::default_frame;
use super::{Rig, RigError, RigLidar, Source};
use sightline_files::json::{self, Place};
use sightline_scene::vehicle::placement_to_nanometres;
use sightline_scene::vehicle::{Placement, SensorName, SensorPose};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    placements: Vec<Placement>,
}

/// Reads one placement of a file; where the file holds several, `name` picks it.
///
/// # Errors
/// A file that cannot be read, or none or several placements to pick from.
pub fn read_rig(path: &Path, name: Option<&str>) -> Result<Rig, RigError> {
    rig_of(&Source::read(path)?, name)
}

/// Reads one placement of a text, a document or one placement a line.
pub(super) fn rig_of(source: &Source, name: Option<&str>) -> Result<Rig, RigError> {
    let Source { file, text } = source;
    let mut all = if file.ends_with(".jsonl") {
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let parse = |(number, line)| json::parse(line, &format!("{file}, line {}", number + 1));
        lines.map(parse).collect::<Result<Vec<Placement>, _>>()?
    } else {
        json::parse::<Document>(text, file)?.placements
    };
    let picked = match name {
        Some(name) => all.iter().position(|placement| placement.name == name),
        None => (all.len() == 1).then_some(0),
    };
    let Some(picked) = picked else {
        if all.is_empty() {
            let at = Box::new(Place::top(file));
            return Err(RigError::Missing { at, key: "a placement".to_owned() });
        }
        return Err(RigError::PickPlacement {
            file: file.clone(),
            name: name.map(str::to_owned),
            known: all.into_iter().map(|placement| placement.name).collect(),
        });
    };
    let Placement { name, lidars } = all.swap_remove(picked);
    let lidar = |(index, pose): (usize, SensorPose)| RigLidar {
        frame: default_frame(index),
        sensor: (!pose.sensor.is_none()).then(|| pose.sensor.to_string()),
        pose: SensorPose { sensor: SensorName::default(), ..pose },
    };
    let rig = Rig { name, lidars: lidars.into_iter().enumerate().map(lidar).collect() };
    rig.validate()
        .map_err(|source| RigError::Within { file: file.clone(), source: Box::new(source) })?;
    Ok(rig)
}

/// The placements file of rigs, with numbers of at most nine digits.
pub fn rig_json(rigs: &[&Rig]) -> Value {
    let written = rigs.iter().map(|rig| placement_to_nanometres(&rig.placement()));
    serde_json::json!(Document { placements: written.collect() })
}
