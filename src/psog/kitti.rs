//! Labelled scans in the SemanticKITTI layout.

use std::io::Read;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::kitti_labels::{KittiLabel, kitti_label};
use super::{GridError, Psog};
use crate::geom::Pose;

/// Why frames in the SemanticKITTI layout were not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum KittiError {
    /// A file or folder cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read { path: PathBuf, cause: std::io::Error },
    /// No scan to read.
    #[error("{} holds no scan named like 000000.bin; give a sequence folder with velodyne, labels, poses.txt and calib.txt", path.display())]
    NoScans { path: PathBuf },
    /// A scan is not named by its frame number.
    #[error("{}: a scan is named by its frame number, like 000000.bin; rename or remove it", path.display())]
    Name { path: PathBuf },
    /// One frame number, two files.
    #[error("{} has two scans of frame {frame}; keep one", path.display())]
    Twice { path: PathBuf, frame: u32 },
    /// A scan does not end with a whole point.
    #[error("{} has {bytes} bytes, not a multiple of {unit}, so it is cut short or of another kind; copy it again", path.display())]
    Truncated { path: PathBuf, bytes: u64, unit: u64 },
    /// Points and labels do not match.
    #[error("{} has {labels} labels, but {} has {points} points; the two must come from the same frame", path.display(), scan.display())]
    LabelCount { path: PathBuf, labels: usize, scan: PathBuf, points: usize },
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
    /// A frame was asked for that is not there.
    #[error("{} has no frame {frame}; it has {have:?}", path.display())]
    NoFrame { path: PathBuf, frame: u32, have: Vec<u32> },
    /// The LiDAR height is unusable.
    #[error("the LiDAR height is {value} m; give a finite height above the ground")]
    Height { value: f64 },
    /// The grid or the vote refused.
    #[error(transparent)]
    Grid(#[from] GridError),
}

/// A sequence of labelled scans in the SemanticKITTI layout: `velodyne/NNNNNN.bin`,
/// `labels/NNNNNN.label`, `poses.txt`, `calib.txt`. Scans may be a part of the sequence: the number
/// in the name is the frame, and line n + 1 of `poses.txt` is the pose of frame n.
#[derive(Debug, Clone)]
pub struct KittiSequence {
    folder: PathBuf,
    /// Frame number and path of each scan, by rising number.
    scans: Vec<(u32, PathBuf)>,
    world_from_lidar: Vec<Pose>,
}

/// One scan with its labels, in the LiDAR frame (x forward, y left, z up), metres.
#[derive(Debug, Clone)]
pub struct LabelledScan {
    /// Coordinates `[N]`, all finite.
    pub points: Vec<[f32; 3]>,
    /// Meaning of each point's label `[N]`.
    pub labels: Vec<KittiLabel>,
}

impl KittiSequence {
    /// Opens a sequence folder: lists its scans and reads its poses. The file gives poses P of
    /// camera 0; LiDAR pose i is Tr⁻¹·P_i·Tr, so that the world is the LiDAR frame of frame 0.
    ///
    /// # Errors
    /// Missing or malformed files, a scan without a pose; see [`KittiError`].
    pub fn open(folder: &Path) -> Result<Self, KittiError> {
        let scans = list_scans(&folder.join("velodyne"))?;
        let camera_from_lidar = read_tr(&folder.join("calib.txt"))?;
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
            .collect::<Result<_, KittiError>>()?;
        if let Some(&(frame, _)) = scans.last()
            && frame as usize >= world_from_lidar.len()
        {
            let poses_read = world_from_lidar.len();
            return Err(KittiError::NoPose { path: poses, frame, poses: poses_read });
        }
        Ok(Self { folder: folder.to_owned(), scans, world_from_lidar })
    }

    /// The sequence folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Numbers of the frames that have a scan, rising.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.scans.iter().map(|&(frame, _)| frame)
    }

    /// Pose of the LiDAR at a frame, in the LiDAR frame of frame 0.
    ///
    /// # Errors
    /// The frame has no pose.
    pub fn world_from_lidar(&self, frame: u32) -> Result<Pose, KittiError> {
        self.world_from_lidar.get(frame as usize).copied().ok_or_else(|| KittiError::NoPose {
            path: self.folder.join("poses.txt"),
            frame,
            poses: self.world_from_lidar.len(),
        })
    }

    /// Reads the scan and the labels of a frame.
    ///
    /// # Errors
    /// A frame that is not there, a file cut short, counts that differ, a coordinate that is not
    /// finite, an unknown label id.
    pub fn read(&self, frame: u32) -> Result<LabelledScan, KittiError> {
        let Ok(at) = self.scans.binary_search_by_key(&frame, |&(n, _)| n) else {
            let (path, have) = (self.folder.join("velodyne"), self.frames().collect());
            return Err(KittiError::NoFrame { path, frame, have });
        };
        let scan = &self.scans[at].1;
        let points = read_points(scan)?;
        let mut label_path = self.folder.join("labels");
        label_path.push(scan.file_stem().unwrap_or_default());
        label_path.set_extension("label");
        let labels = read_labels(&label_path)?;
        if points.len() != labels.len() {
            let (labels, points) = (labels.len(), points.len());
            return Err(KittiError::LabelCount {
                path: label_path,
                labels,
                scan: scan.clone(),
                points,
            });
        }
        Ok(LabelledScan { points, labels })
    }
}

impl Psog {
    /// The names of [`super::KITTI_CLASSES`] as a P-SOG's class list.
    pub fn kitti_classes() -> Vec<String> {
        super::KITTI_CLASSES.map(str::to_owned).to_vec()
    }
}

fn list_scans(folder: &Path) -> Result<Vec<(u32, PathBuf)>, KittiError> {
    let to_read = |cause| KittiError::Read { path: folder.to_owned(), cause };
    let mut scans = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(to_read)? {
        let path = entry.map_err(to_read)?.path();
        if path.extension().is_none_or(|e| e != "bin") {
            continue;
        }
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        match stem.parse() {
            Ok(frame) if stem.bytes().all(|b| b.is_ascii_digit()) => scans.push((frame, path)),
            _ => return Err(KittiError::Name { path }),
        }
    }
    scans.sort();
    if let Some(pair) = scans.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(KittiError::Twice { path: folder.to_owned(), frame: pair[0].0 });
    }
    if scans.is_empty() {
        return Err(KittiError::NoScans { path: folder.to_owned() });
    }
    Ok(scans)
}

fn read_points(path: &Path) -> Result<Vec<[f32; 3]>, KittiError> {
    let bytes = read_units(path, 16)?;
    let mut points = Vec::with_capacity(bytes.len() / 16);
    for (point, record) in bytes.as_chunks::<16>().0.iter().enumerate() {
        let xyz = [0, 4, 8]
            .map(|b| f32::from_le_bytes([record[b], record[b + 1], record[b + 2], record[b + 3]]));
        for (value, axis) in xyz.into_iter().zip(['x', 'y', 'z']) {
            if !value.is_finite() {
                return Err(KittiError::NotFinite { path: path.to_owned(), point, axis, value });
            }
        }
        points.push(xyz);
    }
    Ok(points)
}

fn read_labels(path: &Path) -> Result<Vec<KittiLabel>, KittiError> {
    let bytes = read_units(path, 4)?;
    let ids = bytes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b) as u16);
    ids.enumerate()
        .map(|(point, id)| {
            let unknown = || KittiError::LabelId { path: path.to_owned(), point, id };
            kitti_label(id).ok_or_else(unknown)
        })
        .collect()
}

/// The bytes of a file that holds records of `unit` bytes.
fn read_units(path: &Path, unit: u64) -> Result<Vec<u8>, KittiError> {
    let to_read = |cause| KittiError::Read { path: path.to_owned(), cause };
    let bytes = plain(path).and_then(|()| std::fs::read(path)).map_err(to_read)?;
    if !(bytes.len() as u64).is_multiple_of(unit) {
        let (path, bytes) = (path.to_owned(), bytes.len() as u64);
        return Err(KittiError::Truncated { path, bytes, unit });
    }
    Ok(bytes)
}

/// Refuses pipes and devices, which may have no end.
fn plain(path: &Path) -> std::io::Result<()> {
    if std::fs::metadata(path)?.is_file() {
        return Ok(());
    }
    Err(std::io::Error::other("is not a plain file"))
}

fn read_text(path: &Path) -> Result<String, KittiError> {
    let mut text = String::new();
    plain(path)
        .and_then(|()| std::fs::File::open(path))
        .and_then(|mut file| file.read_to_string(&mut text))
        .map_err(|cause| KittiError::Read { path: path.to_owned(), cause })?;
    Ok(text)
}

fn read_tr(path: &Path) -> Result<Pose, KittiError> {
    for (n, line) in read_text(path)?.lines().enumerate() {
        if let Some(numbers) = line.trim_start().strip_prefix("Tr:") {
            return parse_pose(path, n + 1, numbers);
        }
    }
    Err(KittiError::NoTr { path: path.to_owned() })
}

/// A 3×4 transform from twelve numbers, row by row. The printed rotation is rounded, so it is made
/// orthonormal again: x kept in direction, y in its plane with x.
fn parse_pose(path: &Path, line: usize, text: &str) -> Result<Pose, KittiError> {
    let error = |fault: String| KittiError::Matrix { path: path.to_owned(), line, fault };
    let numbers: Vec<f64> = text
        .split_whitespace()
        .map(|word| match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(error(format!("{word:?} is not a finite number"))),
        })
        .collect::<Result<_, _>>()?;
    let &[a, b, c, x, d, e, f, y, g, h, i, z] = &numbers[..] else {
        return Err(error(format!("it has {} numbers", numbers.len())));
    };
    let printed = DMat3::from_cols_array(&[a, d, g, b, e, h, c, f, i]);
    let x_axis = printed.x_axis.normalize_or_zero();
    let y_axis = (printed.y_axis - x_axis * x_axis.dot(printed.y_axis)).normalize_or_zero();
    let rotation = DMat3::from_cols(x_axis, y_axis, x_axis.cross(y_axis));
    if !rotation.abs_diff_eq(printed, 1e-3) {
        return Err(error("its left 3×3 part is not a rotation".to_owned()));
    }
    Ok(Pose { rotation, translation: DVec3::new(x, y, z) })
}
