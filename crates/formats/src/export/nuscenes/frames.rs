//! Rows of a scene: samples, clouds, poses and boxes, in one pass over its records.

use std::collections::BTreeMap;
use std::io::Write;

use glam::DQuat;
use lidar_cast::geom::Pose;
use serde_json::{Value, json};
use sightline_scan::BOX_MARGIN;

use super::{SceneExport, channels, right_forward, token};
use crate::export::folder::{Folder, StagedFile};
use crate::export::plan::{MOVES, Planned};
use crate::export::record::{CloudOrigin, FrameRecord};
use crate::export::{Checked, DatasetSettings, SceneFacts, Split};

/// An actor's row while its scene is read.
struct ActorRow {
    category: u8,
    first: String,
    last: String,
    count: usize,
}

/// A scene whose rows are being written.
struct Rows<'a> {
    about: &'a SceneExport<'a>,
    tables: &'a mut OutputTables,
    channels: Vec<(String, CloudOrigin)>,
    frames: usize,
    instances: BTreeMap<u16, ActorRow>,
}

/// Writes the rows of a scene; returns the number of its LiDARs.
fn scene_rows(
    folder: &Folder,
    about: &SceneExport,
    number: usize,
    scene: &SceneFacts,
    tables: &mut OutputTables,
) -> Checked<usize> {
    let first = folder.record(number, scene.frames[0])?;
    let lidars = first.lidars.len();
    let channels = channels(lidars, about.settings.each_lidar).collect();
    let frames = scene.frames.len();
    let mut rows = Rows { about, tables, channels, frames, instances: BTreeMap::new() };
    rows.scene(scene)?;
    rows.sensors(&first)?;
    let step = about.settings.keyframe_every;
    let (mut before, mut next) = (None, Some(first));
    for (at, &frame) in scene.frames.iter().enumerate() {
        if !about.is_keyframe(at) {
            rows.clouds(at, &folder.record(number, frame)?)?;
            continue;
        }
        // Boxes name their neighbours in time.
        let ahead = scene.frames.get(at + step);
        let ahead = ahead.map(|&frame| folder.record(number, frame)).transpose()?;
        let Some(here) = next else { continue };
        rows.clouds(at, &here)?;
        rows.sample(at, &here)?;
        rows.boxes(at, &here, before.as_ref(), ahead.as_ref())?;
        (before, next) = (Some(here), ahead);
    }
    rows.instances()?;
    Ok(lidars)
}

fn translation(pose: &Pose) -> Value {
    json!(pose.translation.to_array())
}

/// Quaternion w, x, y, z.
fn rotation(pose: &Pose) -> Value {
    let [x, y, z, w] = DQuat::from_mat3(&pose.rotation).normalize().to_array();
    json!([w, x, y, z])
}

impl Rows<'_> {
    fn token(&self, table: &str, at: impl ToString) -> String {
        token(&[table, &self.about.planned.name, &at.to_string()])
    }

    /// The token of a neighbour, if there is one.
    fn neighbour(&self, table: &str, at: Option<usize>) -> String {
        let at = at.filter(|&at| at < self.frames);
        at.map_or(String::new(), |at| self.token(table, at))
    }

    fn scene(&mut self, scene: &SceneFacts) -> Checked<()> {
        let (name, step) = (&self.about.planned.name, self.about.settings.keyframe_every);
        let last = (self.frames - 1) / step * step;
        let log = token(&["log", name]);
        self.tables.scene.push(&json!({
            "token": token(&["scene", name]), "log_token": log, "nbr_samples": last / step + 1,
            "first_sample_token": self.token("sample", 0),
            "last_sample_token": self.token("sample", last),
            "name": name, "description": scene.name,
        }))?;
        self.tables.log.push(&json!({
            "token": log, "logfile": scene.name, "vehicle": "sightline",
            "date_captured": "2018-07-24", "location": "simulated",
        }))
    }

    fn sensors(&mut self, record: &FrameRecord) -> Checked<()> {
        let mounts: Vec<Pose> =
            record.lidars.iter().map(|lidar| lidar.ego_from_mount.pose()).collect();
        for (channel, source) in &self.channels {
            let pose = source.ego_from_sensor(&mounts, right_forward());
            self.tables.calibrated_sensor.push(&json!({
                "token": self.token("calibrated_sensor", channel),
                "sensor_token": token(&["sensor", channel]),
                "translation": translation(&pose), "rotation": rotation(&pose),
                "camera_intrinsic": [],
            }))?;
        }
        if !self.about.settings.camera_stubs {
            return Ok(());
        }
        for (channel, yaw) in CAMERAS {
            // z ahead, x right, y down.
            let turn = DQuat::from_rotation_z(f64::to_radians(yaw))
                * DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);
            let [x, y, z, w] = turn.to_array();
            self.tables.calibrated_sensor.push(&json!({
                "token": self.token("calibrated_sensor", channel),
                "sensor_token": token(&["sensor", channel]),
                "translation": [0.0, 0.0, 1.5], "rotation": [w, x, y, z],
                "camera_intrinsic": [[1250.0, 0.0, 800.0], [0.0, 1250.0, 450.0], [0.0, 0.0, 1.0]],
            }))?;
        }
        Ok(())
    }

    fn clouds(&mut self, at: usize, record: &FrameRecord) -> Checked<()> {
        let about = self.about;
        let (pose, stamp) = (record.world_from_ego.pose(), about.timestamp(record.time));
        let ego_pose = self.token("ego_pose", at);
        self.tables.ego_pose.push(&json!({
            "token": ego_pose, "timestamp": stamp,
            "translation": translation(&pose), "rotation": rotation(&pose),
        }))?;
        let step = about.settings.keyframe_every;
        // A sweep belongs to the keyframe that is nearest to it.
        let nearest = ((at + step / 2) / step * step).min((self.frames - 1) / step * step);
        let channels = self.channels.iter().map(|(channel, _)| (channel.as_str(), false));
        let stubs = about.settings.camera_stubs && about.is_keyframe(at);
        let cameras = CAMERAS.iter().filter(|_| stubs).map(|(channel, _)| (*channel, true));
        for (channel, camera) in channels.chain(cameras) {
            let hop = if camera { step } else { 1 };
            let other = |at: Option<usize>| {
                let at = at.filter(|&at| at < self.frames);
                at.map_or(String::new(), |at| about.sample_data_token(channel, at))
            };
            let file = about.file(channel, at, record.time);
            let file = if camera { file.replace(".pcd.bin", ".jpg") } else { file };
            self.tables.sample_data.push(&json!({
                "token": about.sample_data_token(channel, at),
                "sample_token": self.token("sample", nearest),
                "ego_pose_token": ego_pose,
                "calibrated_sensor_token": self.token("calibrated_sensor", channel),
                "timestamp": stamp, "fileformat": if camera { "jpg" } else { "pcd" },
                "is_key_frame": about.is_keyframe(at),
                "height": if camera { 900 } else { 0 }, "width": if camera { 1600 } else { 0 },
                "filename": file,
                "prev": other(at.checked_sub(hop)), "next": other(Some(at + hop)),
            }))?;
        }
        Ok(())
    }

    fn sample(&mut self, at: usize, record: &FrameRecord) -> Checked<()> {
        let step = self.about.settings.keyframe_every;
        self.tables.sample.push(&json!({
            "token": self.token("sample", at), "timestamp": self.about.timestamp(record.time),
            "prev": self.neighbour("sample", at.checked_sub(step)),
            "next": self.neighbour("sample", Some(at + step)),
            "scene_token": token(&["scene", &self.about.planned.name]),
        }))?;
        let cloud = self.about.sample_data_token("LIDAR_TOP", at);
        self.tables.lidarseg.push(&json!({
            "token": cloud, "sample_data_token": cloud, "filename": self.about.lidarseg_file(at),
        }))
    }

    fn boxes(
        &mut self,
        at: usize,
        here: &FrameRecord,
        before: Option<&FrameRecord>,
        ahead: Option<&FrameRecord>,
    ) -> Checked<()> {
        let (step, scene) = (self.about.settings.keyframe_every, &self.about.planned.name);
        let name = |instance: u16, at: usize| {
            token(&["sample_annotation", scene, &format!("{instance}/{at}")])
        };
        for tracked in &here.boxes {
            let instance = tracked.instance;
            let in_frame = |other: Option<&FrameRecord>, at: usize| {
                let found = other.is_some_and(|o| o.boxes.iter().any(|b| b.instance == instance));
                if found { name(instance, at) } else { String::new() }
            };
            let pose = here.world_from_ego.pose().compose(&tracked.ego_from_box.pose());
            let [length, width, height] = tracked.size.map(|extent| extent + 2.0 * BOX_MARGIN);
            let moves = tracked.velocity.iter().map(|v| v * v).sum::<f64>() > MOVES * MOVES;
            let attributes = attribute(tracked.category, moves);
            let attributes = attributes.map(|name| token(&["attribute", name]));
            let own = name(instance, at);
            self.tables.sample_annotation.push(&json!({
                "token": own, "sample_token": self.token("sample", at),
                "instance_token": self.token("instance", instance),
                "visibility_token": visibility(tracked.visible, tracked.points),
                "attribute_tokens": attributes.into_iter().collect::<Vec<_>>(),
                "translation": translation(&pose), "size": [width, length, height],
                "rotation": rotation(&pose),
                "prev": in_frame(before, at.saturating_sub(step)), "next": in_frame(ahead, at + step),
                "num_lidar_pts": tracked.points, "num_radar_pts": 0,
            }))?;
            let (category, first) = (tracked.category, own.clone());
            let unseen = ActorRow { category, first, last: String::new(), count: 0 };
            let known = self.instances.entry(instance).or_insert(unseen);
            known.last = own;
            known.count += 1;
        }
        Ok(())
    }

    fn instances(&mut self) -> Checked<()> {
        for (instance, row) in std::mem::take(&mut self.instances) {
            let category = CATEGORIES[usize::from(row.category).min(CATEGORIES.len() - 1)];
            self.tables.instance.push(&json!({
                "token": self.token("instance", instance),
                "category_token": token(&["category", category]),
                "nbr_annotations": row.count,
                "first_annotation_token": row.first, "last_annotation_token": row.last,
            }))?;
        }
        Ok(())
    }
}

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
) -> Checked<()> {
    let counts = Split::ALL.map(|split| plan.iter().filter(|at| at.split == split).count());
    let mut versions = Split::ALL.map(|split| super::version(counts, split)).to_vec();
    versions.dedup();
    for version in versions {
        let of_version = |at: &usize| super::version(counts, plan[*at].split) == version;
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
) -> Checked<()> {
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
) -> Checked<()> {
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

struct OutputTable {
    staged: StagedFile,
    empty: bool,
}

impl OutputTable {
    fn begin(folder: &Folder, version: &str, name: &str) -> Checked<Self> {
        let staged = folder.begin(&format!("{version}/{name}.json"))?;
        Ok(Self { staged, empty: true })
    }

    fn push(&mut self, row: &Value) -> Checked<()> {
        let before: &[u8] = if std::mem::take(&mut self.empty) { b"[\n" } else { b",\n" };
        self.staged.write(|out| {
            out.write_all(before)?;
            Ok(serde_json::to_writer(out, row)?)
        })
    }

    fn end(mut self) -> Checked<()> {
        let end: &[u8] = if self.empty { b"[]\n" } else { b"\n]\n" };
        self.staged.write(|out| out.write_all(end))?;
        self.staged.end().map(drop)
    }
}

macro_rules! tables {
    ($($name:ident),*) => {
        /// Tables that grow with scenes and frames.
        struct OutputTables {
            $($name: OutputTable,)*
        }

        impl OutputTables {
            fn begin(folder: &Folder, version: &str) -> Checked<Self> {
                Ok(Self { $($name: OutputTable::begin(folder, version, stringify!($name))?,)* })
            }

            fn end(self) -> Checked<()> {
                $(self.$name.end()?;)*
                Ok(())
            }
        }
    };
}

tables! {
    calibrated_sensor, ego_pose, instance, lidarseg, log, sample, sample_annotation, sample_data, scene
}

/// Category of an actor of no other.
pub(super) const DEBRIS: u8 = 10;
/// First and last category of things that have boxes.
pub(super) const BOXED: std::ops::RangeInclusive<u8> = 1..=23;

#[rustfmt::skip] // Words of a list stand side by side.
const ATTRIBUTES: [&str; 8] = [
    "vehicle.moving", "vehicle.stopped", "vehicle.parked", "cycle.with_rider", "cycle.without_rider",
    "pedestrian.sitting_lying_down", "pedestrian.standing", "pedestrian.moving",
];

/// Attribute of an actor; `None` for categories without attributes.
fn attribute(category: u8, moves: bool) -> Option<&'static str> {
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
fn visibility(seen: Option<f32>, points: u32) -> &'static str {
    let seen = seen.unwrap_or(if points > 0 { 1.0 } else { 0.0 });
    match [0.4, 0.6, 0.8].iter().filter(|&&least| seen >= least).count() {
        0 => "1",
        1 => "2",
        2 => "3",
        _ => "4",
    }
}

/// Cameras that mmdetection3d asks for, and where they look: degrees to the left.
#[rustfmt::skip] // Words of a list stand side by side.
const CAMERAS: [(&str, f64); 6] = [
    ("CAM_FRONT", 0.0), ("CAM_FRONT_RIGHT", -55.0), ("CAM_FRONT_LEFT", 55.0), ("CAM_BACK", 180.0),
    ("CAM_BACK_LEFT", 110.0), ("CAM_BACK_RIGHT", -110.0),
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
