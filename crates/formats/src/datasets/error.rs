//! Errors of data sets: file, place in it, mend.

use std::path::PathBuf;

use sightline_scene::psog::PsogError;

/// Largest distance of a recording LiDAR from the ground, in metres.
pub(super) const HEIGHT_LIMIT: f64 = 1000.0;

/// Why labelled scans were not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum DatasetError {
    /// A file or folder cannot be read.
    #[error("{}: cannot be read: {source}; give a folder that holds all files of its set", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    /// No scan to read.
    #[error("{} holds no scan named like 000000.bin; give a sequence folder with velodyne, labels, poses.txt and calib.txt", path.display())]
    NoScans { path: PathBuf },
    /// A scan is not named by its frame number.
    #[error("{}: a scan is named by its frame number, like 000000.bin; rename or remove it", path.display())]
    Name { path: PathBuf },
    /// A scan of CARLA is not named by its frame.
    #[error("{}: a scan of CARLA is named by its frame, at most 4294967295, like 000123.ply; rename or remove it", path.display())]
    CarlaName { path: PathBuf },
    /// One frame number, two files.
    #[error("{} has two scans of frame {frame}; keep one", path.display())]
    Twice { path: PathBuf, frame: u32 },
    /// A scan does not end with a whole point.
    #[error("{} has {bytes} bytes, not a multiple of {unit}, so it is cut short or of another kind; copy it again", path.display())]
    Truncated { path: PathBuf, bytes: u64, unit: u64 },
    /// Points and labels do not match.
    #[error("{} has {labels} labels, but {} has {points} points; the two must come from the same frame", path.display(), scan.display())]
    LabelCount { path: PathBuf, labels: usize, scan: PathBuf, points: usize },
    /// Points of more or fewer columns.
    #[error("{} has {columns} numbers for each label, {wanted} are read as one point; write 32-bit floats, {wanted} a point", path.display())]
    Columns { path: PathBuf, columns: usize, wanted: usize },
    /// A file larger than any scan.
    #[error("{} has more than {} MiB, more than a scan has; give the file of one frame", path.display(), limit >> 20)]
    TooLarge { path: PathBuf, limit: u64 },
    /// A text in another encoding.
    #[error("{} is not UTF-8 text; save it as UTF-8", path.display())]
    NotUtf8 { path: PathBuf },
    /// A coordinate is not a number.
    #[error("{}: point {point} has {axis} = {value}; remove the point and its label", path.display())]
    NotFinite { path: PathBuf, point: usize, axis: char, value: f32 },
    /// A label id that SemanticKITTI does not define.
    #[error("{}: point {point} has label id {id}, which SemanticKITTI does not define; map it to one of its ids (0 is ignored)", path.display())]
    LabelId { path: PathBuf, point: usize, id: u16 },
    /// A matrix line is not twelve numbers of a rigid transform.
    #[error("{} line {line}: {fault}; give a rigid 3×4 transform as twelve numbers, row by row", path.display())]
    Matrix { path: PathBuf, line: usize, fault: String },
    /// No LiDAR-to-camera transform.
    #[error("{} has no line `Tr:`; it takes LiDAR to camera coordinates, and the poses of the camera cannot be used without it: take the calib.txt of KITTI's data_odometry_calib.zip, or, if poses.txt holds poses of the LiDAR, add the line `Tr: 1 0 0 0 0 1 0 0 0 0 1 0`", path.display())]
    NoTr { path: PathBuf },
    /// A frame without a pose.
    #[error("{} has {poses} poses, none for frame {frame}; line n + 1 is the pose of frame n", path.display())]
    NoPose { path: PathBuf, frame: u32, poses: usize },
    /// A requested frame does not exist.
    #[error("{} has no frame {frame}; it has {have:?}", path.display())]
    NoFrame { path: PathBuf, frame: u32, have: Vec<u32> },
    /// The LiDAR height is unusable.
    #[error(
        "the LiDAR height is {value} m; give a height above the ground, at most {HEIGHT_LIMIT} m from it"
    )]
    Height { value: f64 },
    /// A table of nuScenes that is not there.
    #[error("{}: the table is missing ({source}); give a folder that holds the version's tables, samples and lidarseg", path.display())]
    Table { path: PathBuf, source: std::io::Error },
    /// A table that is no list of rows.
    #[error("{}: row {row}: {cause}; a table is a list of objects, as nuScenes has it", path.display())]
    Json { path: PathBuf, row: usize, cause: serde_json::Error },
    /// A row that another one names is not there.
    #[error("{}: has no row for {token:?}, which {wanted} names; take all tables from one version of the set", path.display())]
    NoRow { path: PathBuf, token: String, wanted: String },
    /// A scene that the set does not have.
    #[error("{}: no scene is called {name:?}; it has {}", path.display(), listed(known))]
    NoScene { path: PathBuf, name: String, known: Vec<String> },
    /// A scene is named twice.
    #[error("the scene {name:?} is named twice; its scans count once, so name it once")]
    SceneTwice { name: String },
    /// Tables of several versions, or of none.
    #[error("{} holds {}; name the version, as --version v1.0-mini", path.display(), if found.is_empty() { "no folder with a scene.json".to_owned() } else { listed(found) })]
    Version { path: PathBuf, found: Vec<String> },
    /// A row with a number that is of no use.
    #[error("{}: the row {token:?}: {fault}", path.display())]
    Row { path: PathBuf, token: String, fault: &'static str },
    /// Categories without the labels of points.
    #[error("{}: no category has an `index`, the label of its points; take category.json of nuScenes-lidarseg", path.display())]
    NoIndex { path: PathBuf },
    /// A row that names a file outside of the set.
    #[error("{}: {fault}", path.display())]
    Outside { path: PathBuf, fault: String },
    /// A category that has no class here.
    #[error("{}: category {name:?} is unknown; known are {}", path.display(), listed(known))]
    Category { path: PathBuf, name: String, known: Vec<String> },
    /// A label that names no category.
    #[error("{}: point {point} has label {label}, and category.json has no category with that index", path.display())]
    Label { path: PathBuf, point: usize, label: u32 },
    /// A tag that this version of CARLA does not have.
    #[error("{}: point {point} has tag {tag}; tags of CARLA {version} end at {most}, see --carla-tags", path.display())]
    Tag { path: PathBuf, point: usize, tag: u32, version: &'static str, most: u32 },
    /// A text file with a line that cannot be used.
    #[error("{} line {line}: {fault}", path.display())]
    Line { path: PathBuf, line: usize, fault: String },
    /// A NumPy array of another kind.
    #[error("{}: is no one-dimensional little-endian array of records x, y, z, CosAngle (f4), ObjIdx, ObjTag (u4), as CARLA's raw data has it", path.display())]
    Array { path: PathBuf },
    /// A folder without a scan of CARLA.
    #[error("{} holds no scan named by its frame like 000123.ply, .bin or .npy", path.display())]
    NoCarlaScans { path: PathBuf },
    /// A scan of CARLA without a pose.
    #[error("{} has no row for frame {frame}, whose scan is {}; each scan needs the pose of its LiDAR", path.display(), scan.display())]
    NoCarlaPose { path: PathBuf, frame: u32, scan: PathBuf },
    /// Nothing to measure the sensor's height by.
    #[error("{}: has no road point within {radius} m of the LiDAR to measure its height by; give --lidar-height", path.display())]
    NoGround { path: PathBuf, radius: f64 },
    /// Too many boxes for a scene.
    #[error(
        "the scene would have {shapes} plates and boxes, at most {limit} are of use; give larger cells or fewer frames"
    )]
    TooManyShapes { shapes: usize, limit: usize },
    /// The cell of a scene is unusable.
    #[error("the cell is {value} m; give a length from 0.05 to 10 m")]
    Cell { value: f64 },
    /// Points too far apart for cells of this size.
    #[error("{}: point {point} lies {distance} m from the start; a scene reaches at most {limit} m", path.display())]
    TooFar { path: PathBuf, point: usize, distance: f64, limit: f64 },
    /// More frames than a scene holds.
    #[error("{}: has {frames} frames, a scene holds at most {limit}; copy a part of it", path.display())]
    TooManyFrames { path: PathBuf, frames: usize, limit: usize },
    /// The grid or the vote refused.
    #[error(transparent)]
    Grid(#[from] PsogError),
}

fn listed(names: &[String]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
