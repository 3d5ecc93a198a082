//! Tables of nuScenes, streamed from the records of frames: lists of objects, one a line.
//!
//! Categories, attributes and visibilities are tables that every nuScenes set has.

use std::io::Write;

use serde_json::{Value, json};

use super::frames::scene_rows;
use super::{SceneExport, channels, token};
use crate::export::folder::{Folder, StagedFile};
use crate::export::plan::Planned;
use crate::export::{DatasetSettings, ExportError, SceneFacts, Split, nuscenes};

/// Categories; the index is the label of lidarseg, and none may be left out.
pub(super) use crate::datasets::NUSCENES_CATEGORIES as CATEGORIES;

/// A picture of one white pixel, 8-bit grey without alpha as the masks of real maps: the devkit draws no other.
const PIXEL: &[u8] = &[
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 1, 0, 0, 0, 1, 8, 0, 0,
    0, 0, 58, 126, 155, 85, 0, 0, 0, 10, 73, 68, 65, 84, 120, 218, 99, 248, 15, 0, 1, 1, 1, 0, 28,
    176, 140, 153, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

/// Writes the tables of every version that has scenes.
pub(in crate::export) fn finish(
    folder: &Folder,
    settings: &DatasetSettings,
    scenes: &[SceneFacts],
    plan: &[Planned],
) -> Result<(), ExportError> {
    let counts = Split::ALL.map(|split| plan.iter().filter(|at| at.split == split).count());
    let mut versions = Split::ALL.map(|split| nuscenes::version(counts, split)).to_vec();
    versions.dedup();
    for version in versions {
        let of_version = |at: &usize| nuscenes::version(counts, plan[*at].split) == version;
        let members: Vec<usize> = (0..scenes.len()).filter(of_version).collect();
        if members.is_empty() {
            continue;
        }
        let mut tables = OutputTables::begin(folder, version)?;
        let mut lidars = 0;
        for &number in &members {
            let about = SceneExport { settings, planned: &plan[number], counts };
            lidars = lidars.max(scene_rows(folder, &about, number, &scenes[number], &mut tables)?);
        }
        fixed_tables(folder, settings, version, lidars, members.iter().map(|&at| &plan[at]))?;
        tables.end()?;
    }
    folder.put("maps/plain.png", PIXEL).map(drop)
}

fn whole(
    folder: &Folder,
    version: &str,
    name: &str,
    rows: impl IntoIterator<Item = Value>,
) -> Result<(), ExportError> {
    let mut table = OutputTable::begin(folder, version, name)?;
    for row in rows {
        table.push(&row)?;
    }
    table.end()
}

/// Tables that do not grow with frames.
fn fixed_tables<'a>(
    folder: &Folder,
    settings: &DatasetSettings,
    version: &str,
    lidars: usize,
    scenes: impl Iterator<Item = &'a Planned>,
) -> Result<(), ExportError> {
    let categories = (0..).zip(CATEGORIES).map(|(index, name): (u8, _)| {
        json!({"token": token(&["category", name]), "name": name, "description": "", "index": index})
    });
    whole(folder, version, "category", categories)?;
    let attributes = ATTRIBUTES
        .iter()
        .map(|name| json!({"token": token(&["attribute", name]), "name": name, "description": ""}));
    whole(folder, version, "attribute", attributes)?;
    let visibilities = (1..).zip(VISIBILITIES).map(|(number, level): (u8, _)| {
        json!({"token": number.to_string(), "level": level, "description": ""})
    });
    whole(folder, version, "visibility", visibilities)?;
    let sensor = |channel: &str, modality: &str| json!({"token": token(&["sensor", channel]), "channel": channel, "modality": modality});
    let lidars =
        channels(lidars, settings.each_lidar).map(|(channel, _)| sensor(&channel, "lidar"));
    let cameras = CAMERAS.iter().filter(|_| settings.camera_stubs);
    let cameras = cameras.map(|(channel, _)| sensor(channel, "camera"));
    whole(folder, version, "sensor", lidars.chain(cameras))?;
    let logs: Vec<String> = scenes.map(|planned| token(&["log", &planned.name])).collect();
    let map = json!({
        "token": token(&["map", version]), "log_tokens": logs, "category": "semantic_prior",
        "filename": "maps/plain.png",
    });
    whole(folder, version, "map", [map])
}

/// A table that is being written.
pub(super) struct OutputTable {
    staged: StagedFile,
    empty: bool,
}

impl OutputTable {
    pub fn begin(folder: &Folder, version: &str, name: &str) -> Result<Self, ExportError> {
        let staged = folder.begin(&format!("{version}/{name}.json"))?;
        Ok(Self { staged, empty: true })
    }

    pub fn push(&mut self, row: &Value) -> Result<(), ExportError> {
        let before: &[u8] = if std::mem::take(&mut self.empty) { b"[\n" } else { b",\n" };
        self.staged.write(|out| {
            out.write_all(before)?;
            Ok(serde_json::to_writer(out, row)?)
        })
    }

    pub fn end(mut self) -> Result<(), ExportError> {
        let end: &[u8] = if self.empty { b"[]\n" } else { b"\n]\n" };
        self.staged.write(|out| out.write_all(end))?;
        self.staged.end().map(drop)
    }
}

/// Tables that grow with scenes and frames.
pub(super) struct OutputTables {
    pub calibrated_sensor: OutputTable,
    pub ego_pose: OutputTable,
    pub instance: OutputTable,
    pub lidarseg: OutputTable,
    pub log: OutputTable,
    pub sample: OutputTable,
    pub sample_annotation: OutputTable,
    pub sample_data: OutputTable,
    pub scene: OutputTable,
}

impl OutputTables {
    /// Begins all of them.
    pub fn begin(folder: &Folder, version: &str) -> Result<Self, ExportError> {
        let table = |name: &str| OutputTable::begin(folder, version, name);
        Ok(Self {
            calibrated_sensor: table("calibrated_sensor")?,
            ego_pose: table("ego_pose")?,
            instance: table("instance")?,
            lidarseg: table("lidarseg")?,
            log: table("log")?,
            sample: table("sample")?,
            sample_annotation: table("sample_annotation")?,
            sample_data: table("sample_data")?,
            scene: table("scene")?,
        })
    }

    /// Ends all of them.
    pub fn end(self) -> Result<(), ExportError> {
        self.calibrated_sensor.end()?;
        self.ego_pose.end()?;
        self.instance.end()?;
        self.lidarseg.end()?;
        self.log.end()?;
        self.sample.end()?;
        self.sample_annotation.end()?;
        self.sample_data.end()?;
        self.scene.end()
    }
}

/// Category of an actor of no other.
pub(super) const DEBRIS: u8 = 10;
/// First and last category of things that have boxes.
pub(super) const BOXED: std::ops::RangeInclusive<u8> = 1..=23;

/// All attributes.
const ATTRIBUTES: [&str; 8] = [
    "vehicle.moving",
    "vehicle.stopped",
    "vehicle.parked",
    "cycle.with_rider",
    "cycle.without_rider",
    "pedestrian.sitting_lying_down",
    "pedestrian.standing",
    "pedestrian.moving",
];

/// Attribute of an actor; `None` for categories without attributes.
pub(super) fn attribute(category: u8, moves: bool) -> Option<&'static str> {
    let name = CATEGORIES.get(usize::from(category))?;
    Some(match *name {
        "vehicle.bicycle" | "vehicle.motorcycle" => "cycle.with_rider",
        _ if name.starts_with("vehicle") && moves => "vehicle.moving",
        _ if name.starts_with("vehicle") => "vehicle.stopped",
        _ if name.starts_with("human") && moves => "pedestrian.moving",
        _ if name.starts_with("human") => "pedestrian.standing",
        _ => return None,
    })
}

/// Visibilities by token, from 1.
const VISIBILITIES: [&str; 4] = ["v0-40", "v40-60", "v60-80", "v80-100"];

/// Token of a visibility, by the share of a box's hull that is seen; where nobody looked, by whether it has points.
pub(super) fn visibility(seen: Option<f32>, points: u32) -> &'static str {
    let seen = seen.unwrap_or(if points > 0 { 1.0 } else { 0.0 });
    match [0.4, 0.6, 0.8].iter().filter(|&&least| seen >= least).count() {
        0 => "1",
        1 => "2",
        2 => "3",
        _ => "4",
    }
}

/// Cameras that mmdetection3d asks for, and where they look: degrees to the left.
pub(super) const CAMERAS: [(&str, f64); 6] = [
    ("CAM_FRONT", 0.0),
    ("CAM_FRONT_RIGHT", -55.0),
    ("CAM_FRONT_LEFT", 55.0),
    ("CAM_BACK", 180.0),
    ("CAM_BACK_LEFT", 110.0),
    ("CAM_BACK_RIGHT", -110.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visibilities_are_those_of_the_share_that_is_seen() {
        let shares = [0.0, 0.39, 0.4, 0.5, 0.6, 0.79, 0.8, 1.0];
        let tokens = shares.map(|share| visibility(Some(share), 7));
        assert_eq!(tokens, ["1", "1", "2", "2", "3", "3", "4", "4"]);
        assert_eq!([0, 1].map(|points| visibility(None, points)), ["1", "4"]);
    }
}
