//! nuScenes v1.0 with lidarseg: clouds of each frame, and tables of all of them.
//!
//! `LIDAR_TOP` stands in the middle of all LiDARs and holds the points of all; its x axis points right,
//! its y axis forward, as on the vehicles of nuScenes. Each LiDAR is a channel of its own, `LIDAR_0` and on.

mod frames;

use glam::{DMat3, DVec3};
use lidar_cast::geom::Pose;
use sha2::{Digest, Sha256};
use sightline_scan::{BOX_MARGIN, Scan};

use super::folder::Folder;
use super::plan::{Label, Planned, ScanLabels, of_kind};
use super::record::{CloudOrigin, FrameRecord, Mover, mounts};
use super::{Checked, DatasetSettings, Split};

pub(super) use frames::finish;

const FULL: f32 = 255.0;
/// Microseconds at which the first scene begins; scenes lie apart by their number.
const EPOCH: i64 = 1_532_402_927_000_000;

/// Settings of a data set and the scene that is being written.
pub(super) struct SceneExport<'a> {
    pub settings: &'a DatasetSettings,
    pub planned: &'a Planned,
    /// Scenes of each split.
    pub counts: [usize; 3],
}

impl SceneExport<'_> {
    fn is_keyframe(&self, at: usize) -> bool {
        at.is_multiple_of(self.settings.keyframe_every)
    }

    /// Microseconds of a moment of the scene.
    fn timestamp(&self, time: f64) -> i64 {
        let number = self.planned.name.trim_start_matches("scene-").parse::<i64>().unwrap_or(0);
        EPOCH + number * 100_000_000_000 + (time * 1e6).round() as i64
    }

    fn sample_data_token(&self, channel: &str, at: usize) -> String {
        token(&["sample_data", &self.planned.name, channel, &at.to_string()])
    }

    fn file(&self, channel: &str, at: usize, time: f64) -> String {
        let folder = if self.is_keyframe(at) { "samples" } else { "sweeps" };
        let (scene, stamp) = (&self.planned.name, self.timestamp(time));
        format!("{folder}/{channel}/{scene}__{channel}__{stamp}.pcd.bin")
    }

    fn lidarseg_file(&self, at: usize) -> String {
        let token = self.sample_data_token("LIDAR_TOP", at);
        let version = version(self.counts, self.planned.split);
        format!("lidarseg/{version}/{token}_lidarseg.bin")
    }
}

/// 32 hexadecimal digits that the parts decide.
fn token(parts: &[&str]) -> String {
    let digest = Sha256::digest(parts.join("/").as_bytes());
    digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect()
}

/// Channels of a rig, `LIDAR_TOP` first.
fn channels(lidars: usize, each: bool) -> impl Iterator<Item = (String, CloudOrigin)> {
    CloudOrigin::all(lidars, each).map(|source| match source {
        CloudOrigin::Merged => ("LIDAR_TOP".to_owned(), source),
        CloudOrigin::Lidar(lidar) => (format!("LIDAR_{lidar}"), source),
    })
}

/// The rotation of `LIDAR_TOP`: x right, y forward.
fn right_forward() -> DMat3 {
    DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z)
}

/// Writes the clouds of a scan, and labels of a keyframe; `at` is its number among the scene's frames.
pub(super) fn write(
    folder: &Folder,
    about: SceneExport,
    at: usize,
    scan: &Scan,
    classes: &[Label],
) -> Checked<FrameRecord> {
    let mounts = mounts(scan);
    let rings = first_rings(scan);
    let mut files = Vec::new();
    let mut inside = vec![0; scan.boxes.len()];
    for (channel, source) in channels(mounts.len(), about.settings.each_lidar) {
        let ego_from_sensor = source.ego_from_sensor(&mounts, right_forward());
        let mover = Mover::new(&ego_from_sensor);
        let merged = source == CloudOrigin::Merged;
        let points = scan.points().filter(|point| source.takes(point)).map(|point| {
            let [x, y, z] = mover.position(point);
            let first = if merged { rings[usize::from(point.lidar)] } else { 0 };
            [x, y, z, point.intensity * FULL, (first + u32::from(point.channel)) as f32]
        });
        let cloud: Vec<[f32; 5]> = points.collect();
        let file = about.file(&channel, at, scan.time);
        files.push(folder.put(&file, bytemuck::cast_slice(&cloud))?);
        if merged && about.is_keyframe(at) {
            inside = count(&cloud, &ego_from_sensor, scan);
            let labels = ScanLabels::new(classes, &scan.boxes);
            let labels: Vec<u8> = scan.points().map(|point| labels.nuscenes(point)).collect();
            files.push(folder.put(&about.lidarseg_file(at), &labels)?);
        }
    }
    let category = |tracked: &sightline_scan::TrackedBox| {
        let class = classes.get(usize::from(tracked.class)).copied();
        let label = of_kind(tracked.kind).or(class).map(|label| label.nuscenes);
        label.filter(|label| frames::BOXED.contains(label)).unwrap_or(frames::DEBRIS)
    };
    let boxes = scan.boxes.iter().map(category).zip(inside).collect();
    Ok(FrameRecord { files, ..FrameRecord::new(scan, boxes) })
}

/// One for each LiDAR, the number of its first channel when all are counted through.
fn first_rings(scan: &Scan) -> Vec<u32> {
    let mut next = 0;
    let first = scan.lidars.iter().map(|lidar| {
        next += lidar.channels;
        next - lidar.channels
    });
    first.collect()
}

/// Points of a cloud, as it is rounded, in the boxes as they are written.
fn count(cloud: &[[f32; 5]], ego_from_sensor: &Pose, scan: &Scan) -> Vec<u32> {
    let in_box = |tracked: &sightline_scan::TrackedBox| {
        let box_from_sensor = tracked.ego_from_box.inverse().compose(ego_from_sensor);
        let half = tracked.size / 2.0 + BOX_MARGIN;
        let center = box_from_sensor.inverse().translation;
        let reach = half.length_squared() * (1.0 + 1e-6);
        let inside = |&&[x, y, z, ..]: &&[f32; 5]| {
            let point = DVec3::new(x.into(), y.into(), z.into());
            point.distance_squared(center) <= reach
                && box_from_sensor.apply(point).abs().cmple(half).all()
        };
        cloud.iter().filter(inside).count() as u32
    };
    scan.boxes.iter().map(in_box).collect()
}

/// Scenes of v1.0-mini.
const MINI: [&[u16]; 2] = [&[61, 553, 655, 757, 796, 1077, 1094, 1100], &[103, 916]];

/// First and last numbers of runs of scenes, one run after the other.
type Ranges = &'static [u16];

const TRAIN: Ranges = &[
    1, 2, 4, 11, 19, 34, 41, 76, 120, 135, 138, 139, 149, 152, 154, 155, 157, 168, 170, 185, 187,
    188, 190, 196, 199, 200, 202, 204, 206, 214, 218, 220, 222, 222, 224, 264, 283, 306, 315, 318,
    321, 321, 323, 324, 328, 328, 347, 386, 388, 403, 405, 408, 410, 459, 461, 465, 467, 469, 471,
    472, 474, 480, 499, 502, 504, 515, 517, 518, 525, 539, 541, 546, 566, 566, 568, 568, 570, 578,
    580, 580, 582, 600, 639, 679, 681, 681, 683, 689, 695, 698, 700, 701, 703, 719, 726, 728, 730,
    731, 733, 741, 744, 744, 746, 747, 749, 752, 757, 765, 767, 769, 786, 787, 789, 792, 803, 806,
    808, 813, 815, 817, 819, 822, 847, 856, 858, 858, 860, 866, 868, 873, 875, 878, 880, 880, 882,
    903, 945, 945, 947, 947, 949, 949, 952, 953, 955, 961, 975, 984, 988, 992, 994, 1025, 1044,
    1058, 1074, 1102, 1104, 1110,
];
const VAL: Ranges = &[
    3, 3, 12, 18, 35, 36, 38, 39, 92, 110, 221, 221, 268, 278, 329, 332, 344, 346, 519, 524, 552,
    565, 625, 627, 629, 630, 632, 638, 770, 771, 775, 775, 777, 778, 780, 784, 794, 800, 802, 802,
    904, 917, 919, 931, 962, 963, 966, 969, 971, 972, 1059, 1073,
];
const TEST: Ranges = &[
    77, 91, 111, 119, 140, 140, 142, 148, 265, 266, 279, 282, 307, 314, 333, 343, 481, 498, 547,
    551, 601, 604, 606, 624, 827, 831, 833, 842, 844, 846, 932, 933, 935, 943, 1026, 1043,
];

/// Version of the set for scenes of a split; `counts` is the number of scenes by split.
fn version(counts: [usize; 3], split: Split) -> &'static str {
    match split {
        Split::Test => "v1.0-test",
        _ if is_mini(counts) => "v1.0-mini",
        _ => "v1.0-trainval",
    }
}

/// True if train and val fit into v1.0-mini.
fn is_mini([train, val, _]: [usize; 3]) -> bool {
    train <= MINI[0].len() && val <= MINI[1].len()
}

/// Names of scenes for each split; `counts` is the number of scenes by split.
pub(super) fn scene_names(counts: [usize; 3]) -> [Vec<String>; 3] {
    let name = |number: u16| format!("scene-{number:04}");
    let all =
        |ranges: Ranges| ranges.as_chunks().0.iter().flat_map(|&[a, b]| a..=b).map(name).collect();
    let [mut train, mut val, test]: [Vec<String>; 3] = [all(TRAIN), all(VAL), all(TEST)];
    if is_mini(counts) {
        [train, val] = MINI.map(|list| list.iter().copied().map(name).collect());
    }
    [train, val, test]
}
