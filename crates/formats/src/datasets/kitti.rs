//! Labelled scans in the SemanticKITTI layout, and the classes of its label ids.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use lidar_cast::geom::Pose;
use sightline_files::Note;

use super::ground::NearRoad;
use super::import::HEIGHT_LIMIT;
use super::sequence::{
    check_count, entries, folder_name, no_frame, read_points, read_text, read_units, two_scans,
};
use super::{BoxTrack, Checked, FormatError, LabelledScan, LabelledSequence, PointLabel, ground};

/// Height of the KITTI car's LiDAR above the ground, in metres.
const KITTI_LIDAR_HEIGHT: f64 = 1.73;
/// Metres within which a road's depth counts as KITTI's height: on sequence 00 it is 1.79 to 1.83 m.
const SAME_HEIGHT: f64 = 0.15;
/// Lines of `calib.txt` beside `Tr`, which LiDAR scans do not need.
const CALIB_PASSED: [&str; 8] =
    ["P0", "P1", "P2", "P3", "R0_rect", "Tr_imu_to_velo", "calib_time", "Tr_cam_to_road"];
/// File beside `calib.txt` in exports of this program, which loaders of SemanticKITTI pass over: the pose of the
/// LiDAR on the vehicle, whose frame stands on the ground, as twelve numbers.
pub(crate) const EGO_FROM_LIDAR: &str = "ego_from_lidar.txt";

/// A sequence of labelled scans in the SemanticKITTI layout: `velodyne/NNNNNN.bin`,
/// `labels/NNNNNN.label`, `poses.txt`, `calib.txt`. Scans may be a part of the sequence: the number
/// in the name is the frame, and line n + 1 of `poses.txt` is the pose of frame n.
#[derive(Debug, Clone)]
pub struct KittiSequence {
    folder: PathBuf,
    /// Frame number and path of each scan, by rising number.
    scans: Vec<(u32, PathBuf)>,
    world_from_lidar: Vec<Pose>,
    /// The ego frame stands on the ground, below the LiDAR where the sequence does not say more.
    ego_from_lidar: Pose,
    notes: Vec<Note>,
}

impl KittiSequence {
    /// Opens a sequence folder: lists its scans and reads its poses. The file gives poses P of
    /// camera 0; LiDAR pose i is Tr⁻¹·P_i·Tr, so that the world is the LiDAR frame of frame 0. The LiDAR stands
    /// where `ego_from_lidar.txt` says, as in exports of this program, else 1.73 m above the ground, as on KITTI's car;
    /// [`Self::open_at`] asks the labelled road first.
    ///
    /// # Errors
    /// Missing or malformed files, a scan without a pose; see [`FormatError`].
    pub fn open(folder: &Path) -> Result<Self, FormatError> {
        let scans = list_scans(&folder.join("velodyne"))?;
        let mut notes = Vec::new();
        let camera_from_lidar = read_tr(&folder.join("calib.txt"), &mut notes)?;
        let poses = folder.join("poses.txt");
        let lidar_from_camera = camera_from_lidar.inverse();
        let world_from_lidar: Vec<_> = read_text(&poses)?
            .trim_end()
            .lines()
            .enumerate()
            .map(|(n, line)| {
                let pose = parse_pose(&poses, n + 1, line)?;
                Ok(lidar_from_camera.compose(&pose).compose(&camera_from_lidar))
            })
            .collect::<Result<_, FormatError>>()?;
        if let Some(&(frame, _)) = scans.last()
            && frame as usize >= world_from_lidar.len()
        {
            return Err(no_pose(&poses, frame, world_from_lidar.len()));
        }
        let beyond =
            world_from_lidar.len().saturating_sub(scans.last().map_or(0, |s| s.0 as usize + 1));
        let text =
            format!("{}: its last {beyond} poses belong to no scan; not read.", poses.display());
        notes.extend((beyond > 0).then(|| Note::fact(text)));
        notes.extend(labels_alone(folder, &scans));
        let own = folder.join(EGO_FROM_LIDAR);
        let mut sequence = Self {
            folder: folder.to_owned(),
            scans,
            world_from_lidar,
            ego_from_lidar: above_ground(KITTI_LIDAR_HEIGHT)?,
            notes,
        };
        if own.is_file() {
            sequence.ego_from_lidar = parse_pose(&own, 1, read_text(&own)?.trim_end())?;
        }
        Ok(sequence)
    }

    /// Like [`Self::open`], with the LiDAR at `height` metres above the ground. Without a height and without
    /// `ego_from_lidar.txt` the median depth of the labelled road within 10 m counts, where it differs from 1.73 m by
    /// more than 0.15 m.
    ///
    /// # Errors
    /// Like [`Self::open`]; first scans that cannot be read; a height that is not finite.
    pub fn open_at(folder: &Path, height: Option<f64>) -> Result<Self, FormatError> {
        let mut sequence = Self::open(folder)?;
        match height {
            Some(height) => sequence = sequence.with_lidar_height(height)?,
            None if !folder.join(EGO_FROM_LIDAR).is_file() => sequence.take_height_of_road()?,
            None => {}
        }
        sequence.notes.extend(ground::doubts(&sequence, Some("--lidar-height"))?);
        Ok(sequence)
    }

    /// Takes the road's depth below the LiDAR where it contradicts KITTI's height.
    fn take_height_of_road(&mut self) -> Checked<()> {
        let found = ground::road(self)?;
        let Some((frame, road)) = found.filter(|(_, road)| road.is_sure()) else {
            let why = match found {
                Some((frame, NearRoad { points, .. })) => format!(
                    "the labelled road within {} m has at most {points} points in a scan, in frame {frame}, too few to tell",
                    ground::NEAR
                ),
                None => format!("no labelled road within {} m tells", ground::NEAR),
            };
            self.notes.push(Note::fact(format!(
                "{}: {why} how high the LiDAR stands; {KITTI_LIDAR_HEIGHT} m are taken, as for KITTI's car. --lidar-height \
                 gives another height.",
                self.folder.display()
            )));
            return Ok(());
        };
        if road.depth <= 0.0 {
            self.ego_from_lidar = above_ground(road.depth)?;
            self.notes.push(Note::doubt(format!(
                "{}: the labelled road of frame {frame} lies {:.2} m above the LiDAR; does z point up in the scans? \
                 --lidar-height gives the LiDAR's height.",
                self.folder.display(),
                0.0 - road.depth
            )));
        } else if (road.depth - KITTI_LIDAR_HEIGHT).abs() > SAME_HEIGHT {
            self.ego_from_lidar = above_ground(road.depth)?;
            self.notes.push(Note::fact(format!(
                "{}: the labelled road of frame {frame} lies {:.2} m below the LiDAR, not {KITTI_LIDAR_HEIGHT} m as on \
                 KITTI's car; {:.2} m is taken as its height. --lidar-height gives another one.",
                self.folder.display(),
                road.depth,
                road.depth
            )));
        }
        Ok(())
    }

    /// The sequence with the LiDAR upright at `height` metres above the ground.
    ///
    /// # Errors
    /// A height that is not finite.
    pub(super) fn with_lidar_height(self, height: f64) -> Checked<Self> {
        Ok(Self { ego_from_lidar: above_ground(height)?, ..self })
    }
}

impl LabelledSequence for KittiSequence {
    fn name(&self) -> String {
        folder_name(&self.folder)
    }

    fn classes(&self) -> Vec<String> {
        KITTI_CLASSES.map(str::to_owned).to_vec()
    }

    fn frames(&self) -> Vec<u32> {
        self.scans.iter().map(|&(frame, _)| frame).collect()
    }

    fn rate(&self) -> Option<f64> {
        Some(10.0)
    }

    fn ego_from_sensor(&self, _: u32) -> Checked<Pose> {
        Ok(self.ego_from_lidar)
    }

    /// Pose of the LiDAR at a frame, in the LiDAR frame of frame 0.
    fn world_from_sensor(&self, frame: u32) -> Checked<Pose> {
        let poses = &self.world_from_lidar;
        let missing = || no_pose(&self.folder.join("poses.txt"), frame, poses.len());
        poses.get(frame as usize).copied().ok_or_else(missing)
    }

    fn tracks(&self) -> Checked<Vec<BoxTrack>> {
        Ok(Vec::new())
    }

    fn notes(&self) -> &[Note] {
        &self.notes
    }

    fn read(&self, frame: u32) -> Checked<LabelledScan> {
        let Ok(at) = self.scans.binary_search_by_key(&frame, |&(n, _)| n) else {
            return Err(no_frame(self.folder.join("velodyne").display(), frame, self));
        };
        let scan = &self.scans[at].1;
        let points = read_points::<16>(scan)?;
        let mut label_path = self.folder.join("labels");
        label_path.push(scan.file_stem().unwrap_or_default());
        label_path.set_extension("label");
        let labels = read_labels(&label_path)?;
        check_count(&label_path, labels.len(), scan, points.len(), 16)?;
        Ok(LabelledScan { points, labels })
    }
}

/// Pose of a sensor above the origin of the ego frame.
pub(super) fn above_ground(height: f64) -> Checked<Pose> {
    if !(-HEIGHT_LIMIT..=HEIGHT_LIMIT).contains(&height) {
        return Err(refused!(
            "the LiDAR height is {height} m; give a height above the ground, at most {HEIGHT_LIMIT} m from it"
        ));
    }
    Ok(Pose { translation: DVec3::new(0.0, 0.0, height), ..Pose::IDENTITY })
}

fn list_scans(folder: &Path) -> Checked<Vec<(u32, PathBuf)>> {
    let mut scans = Vec::new();
    for path in entries(folder)? {
        if path.extension().is_none_or(|e| e != "bin") {
            continue;
        }
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        match stem.parse() {
            Ok(frame) if stem.bytes().all(|b| b.is_ascii_digit()) => scans.push((frame, path)),
            _ => {
                return Err(refused!(
                    "{}: a scan is named by its frame number, like 000000.bin; rename or remove it",
                    path.display()
                ));
            }
        }
    }
    scans.sort();
    if let Some(pair) = scans.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(two_scans(folder, pair[0].0));
    }
    if scans.is_empty() {
        return Err(refused!(
            "{} holds no scan named like 000000.bin; give a sequence folder with velodyne, labels, poses.txt and calib.txt",
            folder.display()
        ));
    }
    Ok(scans)
}

fn read_labels(path: &Path) -> Checked<Vec<PointLabel>> {
    let bytes = read_units(path, 4)?;
    let ids = bytes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b) as u16);
    ids.enumerate()
        .map(|(point, id)| {
            kitti_label(id).ok_or_else(|| {
                refused!(
                    "{}: point {point} has label id {id}, which SemanticKITTI does not define; map it to one of its ids (0 \
                     is ignored)",
                    path.display()
                )
            })
        })
        .collect()
}

/// Metres beyond which no LiDAR is from its camera.
const FARTHEST: f64 = 20.0;

/// Pose of the LiDAR in the camera's frame; lines that are not known become a note.
fn read_tr(path: &Path, notes: &mut Vec<Note>) -> Checked<Pose> {
    let (mut found, mut unknown) = (None, Vec::new());
    let text = read_text(path)?;
    for (n, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let line = line.trim_start().trim_start_matches('\u{feff}');
        let (name, numbers) = line.split_once(':').unwrap_or((line, ""));
        match name.trim() {
            "Tr" if found.is_none() => found = Some(parse_pose(path, n + 1, numbers)?),
            "Tr" => {
                return Err(no_matrix(path, n + 1, "a second `Tr`; leave one out"));
            }
            name if CALIB_PASSED.contains(&name) => {}
            name => unknown.push(name.chars().take(40).collect::<String>()),
        }
    }
    let known = unknown.len();
    unknown.truncate(8);
    notes.extend((known > 0).then(|| {
        let names = unknown.join("`, `");
        Note::fact(format!(
            "{}: {known} lines, `{names}`, are not known here, and not read.",
            path.display()
        ))
    }));
    let far = found.as_ref().map_or(0.0, |pose| pose.translation.abs().max_element());
    notes.extend((far > FARTHEST).then(|| {
        Note::doubt(format!(
            "{}: `Tr` moves by {far} m, farther than a vehicle is long; millimetres? Write metres.",
            path.display()
        ))
    }));
    found.ok_or_else(|| {
        refused!(
            "{} has no line `Tr:`; it takes LiDAR to camera coordinates, and the poses of the camera cannot be used without \
             it: take the calib.txt of KITTI's data_odometry_calib.zip, or, if poses.txt holds poses of the LiDAR, add the \
             line `Tr: 1 0 0 0 0 1 0 0 0 0 1 0`",
            path.display()
        )
    })
}

/// A note on label files without a scan.
fn labels_alone(folder: &Path, scans: &[(u32, PathBuf)]) -> Option<Note> {
    let folder = folder.join("labels");
    let is_alone = |path: &Path| {
        let frame =
            path.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse().ok());
        frame.is_none_or(|frame: u32| scans.binary_search_by_key(&frame, |&(n, _)| n).is_err())
    };
    let paths = std::fs::read_dir(&folder).ok()?.flatten().map(|entry| entry.path());
    let labels = paths.filter(|path| path.extension().is_some_and(|ending| ending == "label"));
    let alone = labels.filter(|path| is_alone(path)).count();
    let text =
        format!("{}: {alone} label files have no scan in velodyne; not read.", folder.display());
    (alone > 0).then(|| Note::fact(text))
}

fn no_matrix(path: &Path, line: usize, fault: &str) -> FormatError {
    let path = path.display();
    refused!(
        "{path} line {line}: {fault}; give a rigid 3×4 transform as twelve numbers, row by row"
    )
}

fn no_pose(path: &Path, frame: u32, poses: usize) -> FormatError {
    let path = path.display();
    refused!("{path} has {poses} poses, none for frame {frame}; line n + 1 is the pose of frame n")
}

/// A 3×4 transform from twelve numbers, row by row. The printed rotation is rounded, so it is made
/// orthonormal again: x kept in direction, y in its plane with x.
fn parse_pose(path: &Path, line: usize, text: &str) -> Checked<Pose> {
    let error = |fault: &str| no_matrix(path, line, fault);
    let numbers: Vec<f64> = text
        .split_whitespace()
        .map(|word| match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(error(&format!("{word:?} is not a finite number"))),
        })
        .collect::<Result<_, _>>()?;
    let &[a, b, c, x, d, e, f, y, g, h, i, z] = &numbers[..] else {
        return Err(error(&format!("it has {} numbers", numbers.len())));
    };
    let printed = DMat3::from_cols_array(&[a, d, g, b, e, h, c, f, i]);
    let x_axis = printed.x_axis.normalize_or_zero();
    let y_axis = (printed.y_axis - x_axis * x_axis.dot(printed.y_axis)).normalize_or_zero();
    let rotation = DMat3::from_cols(x_axis, y_axis, x_axis.cross(y_axis));
    if !rotation.abs_diff_eq(printed, 1e-3) {
        return Err(error("its left 3×3 part is not a rotation"));
    }
    Ok(Pose { rotation, translation: DVec3::new(x, y, z) })
}

/// The classes of a P-SOG from SemanticKITTI labels: the 19 that its benchmark scores, in its order.
pub(super) const KITTI_CLASSES: [&str; 19] = [
    "car", "bicycle", "motorcycle", "truck", "other-vehicle", "person", "bicyclist",
    "motorcyclist", "road", "parking", "sidewalk", "other-ground", "building", "fence",
    "vegetation", "trunk", "terrain", "pole", "traffic-sign",
];

/// The meaning of a label id (the lower 16 bits of a label); `None` for an id that the data set
/// does not define.
///
/// Follows the benchmark's own folding of its 34 ids: buses, trains and trams are other vehicles,
/// lane markings are road, moving things belong to the class of the thing. Unlabelled points, outliers,
/// other structures and other objects do not vote.
pub(super) fn kitti_label(id: u16) -> Option<PointLabel> {
    let class = match id {
        0 | 1 | 52 | 99 => None, // unlabelled, outlier, other structure, other object
        10 | 252 => Some(0),
        11 => Some(1),
        15 => Some(2),
        18 | 258 => Some(3),
        13 | 16 | 20 | 256 | 257 | 259 => Some(4), // bus, on rails, other
        30 | 254 => Some(5),
        31 | 253 => Some(6),
        32 | 255 => Some(7),
        40 | 60 => Some(8), // road, lane marking
        44 => Some(9),
        48 => Some(10),
        49 => Some(11),
        50 => Some(12),
        51 => Some(13),
        70 => Some(14),
        71 => Some(15),
        72 => Some(16),
        80 => Some(17),
        81 => Some(18),
        _ => return None,
    };
    Some(PointLabel { class, moving: id >= 252, on_track: false })
}
