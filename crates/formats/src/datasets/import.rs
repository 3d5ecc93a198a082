//! A scene from a labelled sequence: plates of ground, boxes of static things, actors on their tracks.
//!
//! The world of the scene is the data set's, moved so that the ego starts at its origin. Space that no beam
//! reached is empty, slopes are stairs of 0.1 m, and a tile has one height. The ego's body is unknown, and so
//! is left out.

use std::path::PathBuf;

use glam::{DVec3, Vec3};
use lidar_cast::geom::{Glide, Pose};
use serde_json::{Map, Value, json};
use sightline_files::json::quoted;
use sightline_scene::psog::PsogError;
use sightline_scene::scene::DEFAULT_CLASSES;
use sightline_scene::vehicle::SensorPose;

use super::ground::PointCells;
use super::{BoxTrack, LabelledSequence, ground};

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
) -> Result<ImportedScene, DatasetError> {
    let (frames, classes) = (sequence.frames(), sequence.classes());
    if !(0.05..=10.0).contains(&options.cell) {
        return Err(DatasetError::Cell { value: options.cell });
    }
    if frames.len() > MOST_FRAMES {
        let path = PathBuf::from(sequence.name());
        return Err(DatasetError::TooManyFrames { path, frames: frames.len(), limit: MOST_FRAMES });
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
        return Err(DatasetError::TooManyShapes { shapes: shapes.len(), limit: MOST_SHAPES });
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
) -> Result<(), DatasetError> {
    let world_from_sensor = moved(&sequence.world_from_sensor(frame)?, start);
    let scan = sequence.read(frame)?;
    for (index, (&point, label)) in scan.points.iter().zip(&scan.labels).enumerate() {
        let Some(class) = label.class.filter(|_| !label.moving && !label.on_track) else {
            continue;
        };
        let at = world_from_sensor.apply(Vec3::from(point).as_dvec3());
        if at.abs().max_element() > FARTHEST {
            let path = PathBuf::from(format!("{} frame {frame}", sequence.name()));
            let (distance, limit) = (at.length(), FARTHEST);
            return Err(DatasetError::TooFar { path, point: index, distance, limit });
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

/// Why labelled scans were not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum DatasetError {
    #[error("{}: cannot be read: {source}; give a folder that holds all files of its set", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{} holds no scan named like 000000.bin; give a sequence folder with velodyne, labels, poses.txt and calib.txt", path.display())]
    NoScans { path: PathBuf },
    #[error("{}: a scan is named by its frame number, like 000000.bin; rename or remove it", path.display())]
    Name { path: PathBuf },
    #[error("{}: a scan of CARLA is named by its frame, at most 4294967295, like 000123.ply; rename or remove it", path.display())]
    CarlaName { path: PathBuf },
    #[error("{} has two scans of frame {frame}; keep one", path.display())]
    Twice { path: PathBuf, frame: u32 },
    #[error("{} has {bytes} bytes, not a multiple of {unit}, so it is cut short or of another kind; copy it again", path.display())]
    Truncated { path: PathBuf, bytes: u64, unit: u64 },
    #[error("{} has {labels} labels, but {} has {points} points; the two must come from the same frame", path.display(), scan.display())]
    LabelCount { path: PathBuf, labels: usize, scan: PathBuf, points: usize },
    #[error("{} has {columns} numbers for each label, {wanted} are read as one point; write 32-bit floats, {wanted} a point", path.display())]
    Columns { path: PathBuf, columns: usize, wanted: usize },
    #[error("{} has more than {} MiB, more than a scan has; give the file of one frame", path.display(), limit >> 20)]
    TooLarge { path: PathBuf, limit: u64 },
    #[error("{} is not UTF-8 text; save it as UTF-8", path.display())]
    NotUtf8 { path: PathBuf },
    #[error("{}: point {point} has {axis} = {value}; remove the point and its label", path.display())]
    NotFinite { path: PathBuf, point: usize, axis: char, value: f32 },
    /// A label id that SemanticKITTI does not define.
    #[error("{}: point {point} has label id {id}, which SemanticKITTI does not define; map it to one of its ids (0 is ignored)", path.display())]
    LabelId { path: PathBuf, point: usize, id: u16 },
    #[error("{} line {line}: {fault}; give a rigid 3×4 transform as twelve numbers, row by row", path.display())]
    Matrix { path: PathBuf, line: usize, fault: String },
    #[error("{} has no line `Tr:`; it takes LiDAR to camera coordinates, and the poses of the camera cannot be used without it: take the calib.txt of KITTI's data_odometry_calib.zip, or, if poses.txt holds poses of the LiDAR, add the line `Tr: 1 0 0 0 0 1 0 0 0 0 1 0`", path.display())]
    NoTr { path: PathBuf },
    #[error("{} has {poses} poses, none for frame {frame}; line n + 1 is the pose of frame n", path.display())]
    NoPose { path: PathBuf, frame: u32, poses: usize },
    #[error("{} has no frame {frame}; it has {have:?}", path.display())]
    NoFrame { path: PathBuf, frame: u32, have: Vec<u32> },
    #[error(
        "the LiDAR height is {value} m; give a height above the ground, at most {HEIGHT_LIMIT} m from it"
    )]
    Height { value: f64 },
    #[error("{}: the table is missing ({source}); give a folder that holds the version's tables, samples and lidarseg", path.display())]
    Table { path: PathBuf, source: std::io::Error },
    #[error("{}: row {row}: {cause}; a table is a list of objects, as nuScenes has it", path.display())]
    Json { path: PathBuf, row: usize, cause: serde_json::Error },
    #[error("{}: has no row for {token:?}, which {wanted} names; take all tables from one version of the set", path.display())]
    NoRow { path: PathBuf, token: String, wanted: String },
    #[error("{}: no scene is called {name:?}; it has {}", path.display(), quoted(known))]
    NoScene { path: PathBuf, name: String, known: Vec<String> },
    #[error("{}: lists no scene; give a set of at least one", path.display())]
    NoSceneRow { path: PathBuf },
    #[error("the scene {name:?} is named twice; its scans count once, so name it once")]
    SceneTwice { name: String },
    #[error("{} holds {}; name the version, as --version v1.0-mini", path.display(), if found.is_empty() { "no folder with a scene.json".to_owned() } else { quoted(found) })]
    Version { path: PathBuf, found: Vec<String> },
    #[error("{}: the row {token:?}: {fault}", path.display())]
    Row { path: PathBuf, token: String, fault: &'static str },
    #[error("{}: no category has an `index`, the label of its points; take category.json of nuScenes-lidarseg", path.display())]
    NoIndex { path: PathBuf },
    #[error("{}: {fault}", path.display())]
    Outside { path: PathBuf, fault: String },
    #[error("{}: category {name:?} is unknown; known are {}", path.display(), quoted(known))]
    Category { path: PathBuf, name: String, known: Vec<String> },
    #[error("{}: point {point} has label {label}, and category.json has no category with that index", path.display())]
    Label { path: PathBuf, point: usize, label: u32 },
    #[error("{}: point {point} has tag {tag}; tags of CARLA {version} end at {most}, see --carla-tags", path.display())]
    Tag { path: PathBuf, point: usize, tag: u32, version: &'static str, most: u32 },
    #[error("{} line {line}: {fault}", path.display())]
    Line { path: PathBuf, line: usize, fault: String },
    #[error("{}: is no one-dimensional little-endian array of records x, y, z, CosAngle (f4), ObjIdx, ObjTag (u4), as CARLA's raw data has it", path.display())]
    Array { path: PathBuf },
    #[error("{} holds no scan named by its frame like 000123.ply, .bin or .npy", path.display())]
    NoCarlaScans { path: PathBuf },
    #[error("{} has no row for frame {frame}, whose scan is {}; each scan needs the pose of its LiDAR", path.display(), scan.display())]
    NoCarlaPose { path: PathBuf, frame: u32, scan: PathBuf },
    #[error("{}: has no road point within {radius} m of the LiDAR to measure its height by; give --lidar-height", path.display())]
    NoGround { path: PathBuf, radius: f64 },
    #[error(
        "the scene would have {shapes} plates and boxes, at most {limit} are of use; give larger cells or fewer frames"
    )]
    TooManyShapes { shapes: usize, limit: usize },
    #[error("the cell is {value} m; give a length from 0.05 to 10 m")]
    Cell { value: f64 },
    #[error("{}: point {point} lies {distance} m from the start; a scene reaches at most {limit} m", path.display())]
    TooFar { path: PathBuf, point: usize, distance: f64, limit: f64 },
    #[error("{}: has {frames} frames, a scene holds at most {limit}; copy a part of it", path.display())]
    TooManyFrames { path: PathBuf, frames: usize, limit: usize },
    #[error(transparent)]
    Grid(#[from] PsogError),
}

/// Result of a step of reading a data set.
pub(super) type Checked<T> = Result<T, DatasetError>;
