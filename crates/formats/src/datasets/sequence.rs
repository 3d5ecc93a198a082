//! Interface of all data sets (frames, poses, labelled points, things that move), a P-SOG from them, and whole files of
//! records.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt::Display;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;

use super::{Checked, FormatError};
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_files::json::is_utf_16;
use sightline_scene::psog::{BuildReport, FrameVotes, Psog, PsogBuilder, Roi};
use sightline_scene::scene::ActorKind;

/// Meaning of a point's label.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointLabel {
    /// Position in [`LabelledSequence::classes`]; `None` for labels that do not vote.
    pub class: Option<u16>,
    /// The thing may have moved while it was recorded, so its points belong to one frame only.
    pub moving: bool,
    /// The point lies on a thing that [`LabelledSequence::tracks`] follows.
    pub on_track: bool,
}

/// One scan with its labels, in the sensor frame, metres.
#[derive(Debug, Clone)]
pub struct LabelledScan {
    /// Coordinates `[N]`, all finite.
    pub points: Vec<[f32; 3]>,
    /// Meaning of each point's label `[N]`.
    pub labels: Vec<PointLabel>,
}

/// A box on its way through a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxTrack {
    /// Category, as the data set calls it.
    pub name: String,
    /// Its kind in a scene.
    pub kind: ActorKind,
    /// Position in [`LabelledSequence::classes`].
    pub class: u16,
    /// Largest extent along its own x (forward), y and z over all frames, metres.
    pub size: [f64; 3],
    /// Where the box stood, by rising frame, at most once a frame.
    pub poses: Vec<TrackPose>,
}

/// A track in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPose {
    /// Number of the frame.
    pub frame: u32,
    /// Middle of the box; takes its own frame to the world.
    pub world_from_box: Pose,
}

impl BoxTrack {
    /// Farthest that a thing at rest seems to move, metres: boxes are drawn by hand.
    const AT_REST: f64 = 0.5;
    /// Farthest that a box moves, in metres, and turns, in radians, by noise alone.
    const NOISE: [f64; 2] = [0.05, 0.02];

    /// True if the box stays within 0.5 m of where it was first seen: its points are merged over frames.
    pub(super) fn at_rest(&self) -> bool {
        self.stays_within([Self::AT_REST, f64::INFINITY])
    }

    /// True if the box stays where it was first seen, but for noise of 5 cm and 0.02 rad.
    pub(super) fn is_fixed(&self) -> bool {
        self.stays_within(Self::NOISE)
    }

    fn stays_within(&self, [metres, radians]: [f64; 2]) -> bool {
        let mut poses = self.poses.iter().map(|pose| pose.world_from_box);
        let Some(first) = poses.next() else { return true };
        poses.all(|pose| {
            let columns =
                (0..3).map(|k| pose.rotation.col(k).distance_squared(first.rotation.col(k)));
            // |A − B|² = 8 sin²(angle / 2), and the sine of a small angle is the angle.
            let turned = (columns.sum::<f64>() / 2.0).sqrt();
            pose.translation.distance(first.translation) <= metres && turned <= radians
        })
    }
}

/// Frames of one recording, each a labelled scan, in one world.
pub trait LabelledSequence {
    /// Name of the recording.
    fn name(&self) -> String;

    /// Class names; a class is a position in this list.
    fn classes(&self) -> Vec<String>;

    /// Numbers of the frames that have a scan, rising.
    fn frames(&self) -> Vec<u32>;

    /// Frames a second, where the data set says so.
    fn rate(&self) -> Option<f64>;

    /// Pose of the sensor on the vehicle at a frame; the ego frame stands on the ground.
    ///
    /// # Errors
    /// The frame is not there.
    fn ego_from_sensor(&self, frame: u32) -> Checked<Pose>;

    /// Pose of the sensor in the world at a frame.
    ///
    /// # Errors
    /// The frame is not there.
    fn world_from_sensor(&self, frame: u32) -> Checked<Pose>;

    /// Boxes that the data set follows through its frames.
    ///
    /// # Errors
    /// Like [`Self::read`], where boxes are made from points.
    fn tracks(&self) -> Checked<Vec<BoxTrack>>;

    /// Sentences about the files: passed over, taken in place of a default, or most likely wrong.
    fn notes(&self) -> &[Note] {
        &[]
    }

    /// Reads the scan and the labels of a frame.
    ///
    /// # Errors
    /// A frame that is not there, files that are cut short or do not fit each other, a coordinate that is
    /// not finite, an unknown label.
    fn read(&self, frame: u32) -> Checked<LabelledScan>;
}

/// How to build a P-SOG from labelled frames.
#[derive(Debug, Clone)]
pub struct PsogOptions {
    /// The voxel grid, in the ego frame.
    pub roi: Roi,
    /// Frames to vote, by number, in each sequence; `None` takes all that have a scan.
    pub frames: Option<Vec<u32>>,
    /// Frame t merges the scans of frames t − w ..= t + w; `None` merges all of `frames`.
    /// Without a window all scans of a sequence are in memory at once (14 bytes a point).
    pub window: Option<u32>,
}

impl PsogOptions {
    /// All frames, all merged.
    pub fn new(roi: Roi) -> Self {
        Self { roi, frames: None, window: None }
    }
}

/// Builds a P-SOG from labelled sequences that have the same classes.
///
/// The dense points of frame t are its own scan and the scans of the other frames of its window,
/// moved through the sensor's poses into the ego frame of t. Each votes in the voxel of its hit
/// ([`Roi::voxel_of_hit`]), seen from where its own sensor stood. Points of moving objects vote only in
/// their own frame, since they would smear in others; ignored labels never vote.
pub fn build_psog<S: LabelledSequence>(
    sequences: &[S],
    options: &PsogOptions,
) -> Result<(Psog, BuildReport), FormatError> {
    let classes = sequences.first().map(S::classes).unwrap_or_default();
    let mut builder = PsogBuilder::new(options.roi, classes)?;
    for sequence in sequences {
        add(sequence, options, &mut builder)?;
    }
    Ok(builder.finish()?)
}

fn add(
    sequence: &impl LabelledSequence,
    options: &PsogOptions,
    builder: &mut PsogBuilder,
) -> Checked<()> {
    let mut frames = options.frames.clone().unwrap_or_else(|| sequence.frames());
    frames.sort_unstable();
    frames.dedup();
    let mut scans = BTreeMap::new();
    for &t in &frames {
        let near = |&n: &u32| options.window.is_none_or(|w| n.abs_diff(t) <= w);
        scans.retain(|n, _| near(n));
        for n in frames.iter().copied().filter(near) {
            if let Entry::Vacant(slot) = scans.entry(n) {
                slot.insert(VotingPoints::new(sequence.read(n)?));
            }
        }
        let ego_from_sensor = sequence.ego_from_sensor(t)?;
        let ego_from_world = ego_from_sensor.compose(&sequence.world_from_sensor(t)?.inverse());
        let mut votes = FrameVotes::new();
        for (&n, scan) in &scans {
            // Frame t's own points need no pose, and so lose nothing to its rounding.
            let ego_from_scan = if n == t {
                ego_from_sensor
            } else {
                ego_from_world.compose(&sequence.world_from_sensor(n)?)
            };
            scan.vote(&options.roi, &ego_from_scan, n == t, &mut votes);
        }
        builder.frame(votes)?;
    }
    Ok(())
}

/// The voting points of a scan in the sensor frame: points of things at rest, then of moving things.
struct VotingPoints {
    points: Vec<([f32; 3], u16)>,
    at_rest: usize,
}

impl VotingPoints {
    fn new(scan: LabelledScan) -> Self {
        let labelled = || scan.points.iter().zip(&scan.labels);
        let pick = |moving| {
            labelled()
                .filter(move |(_, label)| label.moving == moving)
                .filter_map(|(&point, label)| Some((point, label.class?)))
        };
        let mut points: Vec<_> = pick(false).collect();
        let at_rest = points.len();
        points.extend(pick(true));
        points.shrink_to_fit();
        Self { points, at_rest }
    }

    fn vote(&self, roi: &Roi, ego_from_sensor: &Pose, own: bool, votes: &mut FrameVotes) {
        let points = if own { &self.points[..] } else { &self.points[..self.at_rest] };
        let origin = ego_from_sensor.translation;
        votes.par_extend(points.par_iter().with_min_len(8192).map(|&(point, class)| {
            let point = ego_from_sensor.apply(Vec3::from(point).as_dvec3());
            (roi.voxel_of_hit(origin, point), class)
        }));
    }
}

/// Most bytes of a scan, a list of labels or a table of poses: 16 million points.
const LARGEST: u64 = 256 << 20;

/// Opens a file; refuses pipes and devices, which may have no end.
pub(super) fn open(path: &Path) -> Checked<File> {
    let to_read = |source| FormatError::Read { path: path.to_owned(), source };
    sightline_files::files::open(path).map_err(to_read)
}

/// Name of a folder; `.` and `..` have the name of the folder that they lead to.
pub(super) fn folder_name(folder: &Path) -> String {
    let whole = if folder.file_name().is_none() { folder.canonicalize().ok() } else { None };
    let name = whole.as_deref().unwrap_or(folder).file_name();
    name.unwrap_or_default().to_string_lossy().into_owned()
}

pub(super) fn entries(folder: &Path) -> Checked<Vec<PathBuf>> {
    let to_read = |source| FormatError::Read { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(to_read)? {
        paths.push(entry.map_err(to_read)?.path());
    }
    Ok(paths)
}

/// The bytes of a file of at most [`LARGEST`].
pub(super) fn read_bytes(path: &Path) -> Checked<Vec<u8>> {
    let mut bytes = Vec::new();
    let to_read = |source| FormatError::Read { path: path.to_owned(), source };
    open(path)?.take(LARGEST + 1).read_to_end(&mut bytes).map_err(to_read)?;
    if bytes.len() as u64 > LARGEST {
        let (path, most) = (path.display(), LARGEST >> 20);
        return Err(refused!(
            "{path} has more than {most} MiB, more than a scan has; give the file of one frame"
        ));
    }
    Ok(bytes)
}

/// The bytes of a file that holds records of `unit` bytes.
pub(super) fn read_units(path: &Path, unit: u64) -> Checked<Vec<u8>> {
    let bytes = read_bytes(path)?;
    if !(bytes.len() as u64).is_multiple_of(unit) {
        return Err(refused!(
            "{} has {} bytes, not a multiple of {unit}, so it is cut short or of another kind; copy it again",
            path.display(),
            bytes.len()
        ));
    }
    Ok(bytes)
}

pub(super) fn not_utf_8(path: &Path) -> FormatError {
    refused!("{} is not UTF-8 text; save it as UTF-8", path.display())
}

/// Error of a frame that a sequence at `place` does not have.
pub(super) fn no_frame(place: impl Display, frame: u32, of: &dyn LabelledSequence) -> FormatError {
    refused!("{place} has no frame {frame}; it has {:?}", of.frames())
}

pub(super) fn two_scans(folder: &Path, frame: u32) -> FormatError {
    refused!("{} has two scans of frame {frame}; keep one", folder.display())
}

/// The text of a file, without its byte order mark.
pub(super) fn read_text(path: &Path) -> Checked<String> {
    let bytes = read_bytes(path)?;
    if is_utf_16(&bytes) {
        return Err(not_utf_8(path));
    }
    let text = String::from_utf8(bytes).map_err(|_| not_utf_8(path))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Little-endian x, y, z at the start of each record of `N` bytes.
pub(super) fn read_points<const N: usize>(path: &Path) -> Checked<Vec<[f32; 3]>> {
    let bytes = read_units(path, N as u64)?;
    let mut points = Vec::with_capacity(bytes.len() / N);
    for (point, record) in bytes.as_chunks::<N>().0.iter().enumerate() {
        let xyz = [0, 4, 8]
            .map(|b| f32::from_le_bytes([record[b], record[b + 1], record[b + 2], record[b + 3]]));
        check_finite(path, point, xyz)?;
        points.push(xyz);
    }
    Ok(points)
}

pub(super) fn check_finite(path: &Path, point: usize, xyz: [f32; 3]) -> Checked<()> {
    let named = xyz.into_iter().zip(['x', 'y', 'z']);
    match named.into_iter().find(|(value, _)| !value.is_finite()) {
        None => Ok(()),
        Some((value, axis)) => Err(refused!(
            "{}: point {point} has {axis} = {value}; remove the point and its label",
            path.display()
        )),
    }
}

/// Refuses labels that are not one a point of `unit` bytes.
pub(super) fn check_count(
    path: &Path,
    labels: usize,
    scan: &Path,
    points: usize,
    unit: usize,
) -> Checked<()> {
    if labels == points {
        return Ok(());
    }
    let (path, scan, bytes) = (path.display(), scan.display(), points * unit);
    // Points of three to eight columns, where this many bytes belong to each label.
    match (3..=8).find(|columns| 4 * columns * labels == bytes) {
        Some(columns) => Err(refused!(
            "{scan} has {columns} numbers for each label, {wanted} are read as one point; write 32-bit floats, {wanted} a \
             point",
            wanted = unit / 4
        )),
        None => Err(refused!(
            "{path} has {labels} labels, but {scan} has {points} points; the two must come from the same frame"
        )),
    }
}
