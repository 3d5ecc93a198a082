//! The tables of nuScenes, streamed from the records of frames.

use serde_json::{Value, json};

use super::fixed::{ATTRIBUTES, CAMERAS, CATEGORIES, VISIBILITIES};
use super::frames::scene_rows;
use super::table::{Table, Tables};
use super::{About, channels, names, token};
use crate::export::folder::Folder;
use crate::export::plan::Planned;
use crate::export::{DatasetSettings, ExportError, SceneFacts, Split};

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
    let mut versions = Split::ALL.map(|split| names::version(counts, split)).to_vec();
    versions.dedup();
    for version in versions {
        let of_version = |at: &usize| names::version(counts, plan[*at].split) == version;
        let members: Vec<usize> = (0..scenes.len()).filter(of_version).collect();
        if members.is_empty() {
            continue;
        }
        let mut tables = Tables::begin(folder, version)?;
        let mut lidars = 0;
        for &number in &members {
            let about = About { settings, planned: &plan[number], counts };
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
    let mut table = Table::begin(folder, version, name)?;
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
