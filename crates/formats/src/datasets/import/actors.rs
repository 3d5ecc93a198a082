//! Tracks to actors with a pose in every frame.

use glam::DVec3;
use serde_json::{Map, Value, json};

use super::rounding::rounded;
use crate::datasets::BoxTrack;
use lidar_cast::geom::{Glide, Pose};
use sightline_scene::vehicle::SensorPose;

/// A moving thing that is not seen yet or any more waits this far below where it was seen, out of any
/// sensor's range: an actor has a pose in every frame.
const BELOW: f64 = 1000.0;

/// An actor of the scene; `start` is the scene's origin in the world.
pub(super) fn actor(track: &BoxTrack, class: &str, frames: &[u32], start: DVec3) -> Value {
    let poses = frames.iter().map(|&frame| pose(&moved(&pose_at(track, frame), start)));
    json!({
        "name": track.name,
        "kind": track.kind.name(),
        "parts": [{ "class": class, "box": { "center": [0, 0, 0], "size": track.size.map(rounded) } }],
        "poses": poses.collect::<Vec<Value>>(),
    })
}

/// Where a track's box is in a frame: where it was seen, between two sightings on a straight line.
fn pose_at(track: &BoxTrack, frame: u32) -> Pose {
    let poses = &track.poses;
    if track.at_rest() {
        return poses.first().map_or(Pose::IDENTITY, |seen| seen.world_from_box);
    }
    let next = poses.partition_point(|seen| seen.frame < frame);
    let below = |seen: &Pose| Pose { translation: seen.translation - BELOW * DVec3::Z, ..*seen };
    match (next.checked_sub(1).map(|before| &poses[before]), poses.get(next)) {
        (_, Some(seen)) if seen.frame == frame => seen.world_from_box,
        (Some(before), Some(after)) => {
            let share = f64::from(frame - before.frame) / f64::from(after.frame - before.frame);
            Glide::new(&before.world_from_box, &after.world_from_box).at(share)
        }
        (Some(seen), None) | (None, Some(seen)) => below(&seen.world_from_box),
        (None, None) => Pose::IDENTITY,
    }
}

/// A pose seen from the scene's origin.
pub(super) fn moved(pose: &Pose, start: DVec3) -> Pose {
    Pose { translation: pose.translation - start, ..*pose }
}

/// A pose as scenes have it; angles that are 0 are left out.
pub(super) fn pose(pose: &Pose) -> Value {
    let fields = SensorPose::from(pose).fields();
    let written = fields.into_iter().map(|(key, value)| {
        let digits = if ["x", "y", "z"].contains(&key) { 1e4 } else { 1e7 };
        (key, (value * digits).round() / digits)
    });
    let needed = written.filter(|(key, value)| *value != 0.0 || ["x", "y", "z"].contains(key));
    Value::Object(needed.map(|(key, value)| (key.to_owned(), value.into())).collect::<Map<_, _>>())
}
