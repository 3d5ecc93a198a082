//! Rows of a scene: samples, clouds, poses and boxes, in one pass over its records.

use std::collections::BTreeMap;

use glam::DQuat;
use serde_json::{Value, json};

use super::tables::{CAMERAS, CATEGORIES, OutputTables, attribute, visibility};
use super::{SceneExport, channels, right_forward, token};
use crate::export::folder::Folder;
use crate::export::labels::MOVES;
use crate::export::record::{CloudOrigin, FrameRecord};
use crate::export::{ExportError, SceneFacts};
use lidar_cast::geom::Pose;
use sightline_scan::BOX_MARGIN;

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
pub(super) fn scene_rows(
    folder: &Folder,
    about: &SceneExport,
    number: usize,
    scene: &SceneFacts,
    tables: &mut OutputTables,
) -> Result<usize, ExportError> {
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

    fn scene(&mut self, scene: &SceneFacts) -> Result<(), ExportError> {
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

    fn sensors(&mut self, record: &FrameRecord) -> Result<(), ExportError> {
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

    fn clouds(&mut self, at: usize, record: &FrameRecord) -> Result<(), ExportError> {
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

    fn sample(&mut self, at: usize, record: &FrameRecord) -> Result<(), ExportError> {
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
    ) -> Result<(), ExportError> {
        let step = self.about.settings.keyframe_every;
        let name =
            |instance: u16, at: usize| self.token("sample_annotation", format!("{instance}/{at}"));
        let mut rows = Vec::new();
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
            rows.push((tracked, json!({
                "token": name(instance, at), "sample_token": self.token("sample", at),
                "instance_token": self.token("instance", instance),
                "visibility_token": visibility(tracked.visible, tracked.points),
                "attribute_tokens": attributes.into_iter().collect::<Vec<_>>(),
                "translation": translation(&pose), "size": [width, length, height],
                "rotation": rotation(&pose),
                "prev": in_frame(before, at.saturating_sub(step)), "next": in_frame(ahead, at + step),
                "num_lidar_pts": tracked.points, "num_radar_pts": 0,
            }), name(instance, at)));
        }
        for (tracked, row, token) in rows {
            self.tables.sample_annotation.push(&row)?;
            let known = self.instances.entry(tracked.instance).or_insert_with(|| ActorRow {
                category: tracked.category,
                first: token.clone(),
                last: String::new(),
                count: 0,
            });
            known.last = token;
            known.count += 1;
        }
        Ok(())
    }

    fn instances(&mut self) -> Result<(), ExportError> {
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
