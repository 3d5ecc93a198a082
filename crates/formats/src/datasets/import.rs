//! A scene from a labelled sequence: plates of ground, boxes of static things, actors on their tracks.
//!
//! The world of the scene is the data set's, moved so that the ego starts at its origin. Space that no beam
//! reached is empty, slopes are stairs of 0.1 m, and a tile has one height. The ego's body is unknown, and so
//! is left out.

use glam::{DVec3, Vec3};
use lidar_cast::geom::{Glide, Pose};
use serde_json::{Map, Value, json};
use sightline_scene::scene::DEFAULT_CLASSES;
use sightline_scene::vehicle::SensorPose;

use super::ground::PointCells;
use super::{BoxTrack, Checked, FormatError, LabelledSequence, ground};

const MOST_SHAPES: usize = 500_000;
const MOST_FRAMES: usize = 10_000;
/// Farthest point from the start, metres.
const FARTHEST: f64 = 50_000.0;

/// How to make a scene.
#[derive(Debug, Clone, Copy)]
pub struct ImportOptions {
    /// Edge of the cells that plates and boxes are made of, metres.
    pub cell: f64,
}

impl Default for ImportOptions {
    /// Cells of 0.4 m.
    fn default() -> Self {
        Self { cell: 0.4 }
    }
}

/// A scene file and counts of its parts.
#[derive(Debug, Clone)]
pub struct ImportedScene {
    /// The scene file.
    pub scene: Value,
    /// Plates of ground.
    pub plates: usize,
    /// Boxes of things at rest.
    pub boxes: usize,
    /// Actors.
    pub actors: usize,
}

/// Makes a scene of a labelled sequence. Region, LiDAR and mount are placeholders to be edited: the example scenes'
/// own, the mount above the recording sensor's place.
///
/// # Errors
/// The sequence cannot be read; a cell is not from 0.05 to 10 m; there are more plates and boxes than are of use.
pub fn to_scene(
    sequence: &dyn LabelledSequence,
    options: &ImportOptions,
) -> Result<ImportedScene, FormatError> {
    let (frames, classes) = (sequence.frames(), sequence.classes());
    if !(0.05..=10.0).contains(&options.cell) {
        return Err(refused!("the cell is {} m; give a length from 0.05 to 10 m", options.cell));
    }
    if frames.len() > MOST_FRAMES {
        return Err(refused!(
            "{}: has {} frames, a scene holds at most {MOST_FRAMES}; copy a part of it",
            sequence.name(),
            frames.len()
        ));
    }
    let egos: Vec<Pose> =
        frames.iter().map(|&frame| world_from_ego(sequence, frame)).collect::<Result<_, _>>()?;
    let start = egos.first().map_or(DVec3::ZERO, |ego| ego.translation);
    let mut cells = PointCells::new(options.cell, &classes);
    for &frame in &frames {
        count(sequence, frame, start, &mut cells)?;
    }
    let ground::Shapes { shapes, plates, boxes } = cells.shapes();
    if shapes.len() > MOST_SHAPES {
        return Err(refused!(
            "the scene would have {} plates and boxes, at most {MOST_SHAPES} are of use; give larger cells or fewer frames",
            shapes.len()
        ));
    }
    let tracks = sequence.tracks()?;
    let others = tracks.iter().filter(|track| !is_ego(track, &frames, &egos));
    let actors: Vec<Value> = others
        .map(|track| actor(track, &classes[usize::from(track.class)], &frames, start))
        .collect();
    let sensor = frames.first().map_or(Ok(Pose::IDENTITY), |&f| sequence.ego_from_sensor(f))?;
    let mut scene = frame_of_scene(&sequence.name(), sensor.translation);
    let poses: Vec<Value> = egos.iter().map(|ego| pose(&moved(ego, start))).collect();
    if !classes.iter().eq(DEFAULT_CLASSES) {
        scene["classes"] = json!(classes);
    }
    if let Some(rate) = sequence.rate() {
        scene["rate"] = rate.into();
    }
    let count = actors.len();
    scene["frames"] = poses.len().into();
    scene["ego"] = json!({ "poses": poses });
    scene["static"] = shapes.into();
    scene["actors"] = actors.into();
    Ok(ImportedScene { scene, plates, boxes, actors: count })
}

pub(super) fn world_from_ego(sequence: &dyn LabelledSequence, frame: u32) -> Checked<Pose> {
    let ego_from_sensor = sequence.ego_from_sensor(frame)?;
    Ok(sequence.world_from_sensor(frame)?.compose(&ego_from_sensor.inverse()))
}

/// Counts the points of a frame that lie on things at rest and on no track.
fn count(
    sequence: &dyn LabelledSequence,
    frame: u32,
    start: DVec3,
    cells: &mut PointCells,
) -> Checked<()> {
    let world_from_sensor = moved(&sequence.world_from_sensor(frame)?, start);
    let scan = sequence.read(frame)?;
    for (index, (&point, label)) in scan.points.iter().zip(&scan.labels).enumerate() {
        let Some(class) = label.class.filter(|_| !label.moving && !label.on_track) else {
            continue;
        };
        let at = world_from_sensor.apply(Vec3::from(point).as_dvec3());
        if at.abs().max_element() > FARTHEST {
            return Err(refused!(
                "{} frame {frame}: point {index} lies {} m from the start; a scene reaches at most {FARTHEST} m",
                sequence.name(),
                at.length()
            ));
        }
        cells.add(at, class);
    }
    Ok(())
}

/// True if a track is the ego vehicle itself: its box stands around the ego's origin in most frames.
fn is_ego(track: &BoxTrack, frames: &[u32], egos: &[Pose]) -> bool {
    let around = track.poses.iter().filter(|seen| {
        let Ok(at) = frames.binary_search(&seen.frame) else { return false };
        let origin = seen.world_from_box.inverse().apply(egos[at].translation);
        2.0 * origin.x.abs() <= track.size[0] && 2.0 * origin.y.abs() <= track.size[1]
    });
    2 * around.count() > track.poses.len()
}

/// Everything of a scene but its world and its motion.
fn frame_of_scene(name: &str, sensor: DVec3) -> Value {
    let [x, y, z] = sensor.to_array();
    let corner =
        |out: f64, up: f64| [x + out, y + out, z + up].map(|v| (v * 100.0).round() / 100.0);
    json!({
        "sightline": 1,
        "name": name,
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 100 },
        "mount": { "min": corner(-0.6, 0.0), "max": corner(0.6, 0.6), "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "first-hit",
    })
}

/// Metres below its place at which a moving thing waits while it is not seen: an actor needs a pose in every frame, and no
/// sensor reaches there.
const BELOW: f64 = 1000.0;

/// An actor of the scene; `start` is the scene's origin in the world.
fn actor(track: &BoxTrack, class: &str, frames: &[u32], start: DVec3) -> Value {
    let poses = frames.iter().map(|&frame| pose(&moved(&pose_at(track, frame), start)));
    json!({
        "name": track.name,
        "kind": track.kind.name(),
        "parts": [{ "class": class, "box": { "center": [0, 0, 0], "size": track.size.map(rounded) } }],
        "poses": poses.collect::<Vec<Value>>(),
    })
}

/// Pose of a track's box in a frame: as seen, or on a straight line between two sightings. Before the first and after the
/// last sighting, a thing that stays within half a metre keeps that pose; any other waits [`BELOW`] it.
fn pose_at(track: &BoxTrack, frame: u32) -> Pose {
    let poses = &track.poses;
    if track.is_fixed() {
        return poses.first().map_or(Pose::IDENTITY, |seen| seen.world_from_box);
    }
    let next = poses.partition_point(|seen| seen.frame < frame);
    let aside = |seen: &Pose| match track.at_rest() {
        true => *seen,
        false => Pose { translation: seen.translation - BELOW * DVec3::Z, ..*seen },
    };
    match (next.checked_sub(1).map(|before| &poses[before]), poses.get(next)) {
        (_, Some(seen)) if seen.frame == frame => seen.world_from_box,
        (Some(before), Some(after)) => {
            let share = f64::from(frame - before.frame) / f64::from(after.frame - before.frame);
            Glide::new(&before.world_from_box, &after.world_from_box).at(share)
        }
        (Some(seen), None) | (None, Some(seen)) => aside(&seen.world_from_box),
        (None, None) => Pose::IDENTITY,
    }
}

/// A pose seen from the scene's origin.
fn moved(pose: &Pose, start: DVec3) -> Pose {
    Pose { translation: pose.translation - start, ..*pose }
}

/// A pose as scenes have it; angles that are 0 are left out.
fn pose(pose: &Pose) -> Value {
    let fields = SensorPose::from(pose).fields();
    let written = fields.into_iter().map(|(key, value)| {
        let digits = if ["x", "y", "z"].contains(&key) { 1e4 } else { 1e7 };
        (key, (value * digits).round() / digits)
    });
    let needed = written.filter(|(key, value)| *value != 0.0 || ["x", "y", "z"].contains(key));
    Value::Object(needed.map(|(key, value)| (key.to_owned(), value.into())).collect::<Map<_, _>>())
}

/// Metres to a tenth of a millimetre: more digits are noise.
pub(super) fn rounded(metres: f64) -> f64 {
    (metres * 1e4).round() / 1e4
}

/// Largest distance of a recording LiDAR from the ground, in metres.
pub(super) const HEIGHT_LIMIT: f64 = 1000.0;
