//! SemanticKITTI: sequences of clouds and labels, poses, calibration, lists for mmdetection3d.
//!
//! Points lie in the frame of one LiDAR in the middle of all (x forward, y left, z up). `Tr` is the
//! identity, so that poses are those of the LiDAR, counted from the first frame as KITTI does. Each LiDAR
//! by itself is a data set of its own, `lidar_0` and on.

use std::io::Write;

use glam::DMat3;

use super::cloud::{Mover, Source, mounts};
use super::folder::{Folder, Staged};
use super::labels::{Label, Labels};
use super::pickle::Pickle;
use super::plan::Planned;
use super::record::{FrameRecord, LidarRecord, Written};
use super::{DatasetSettings, ExportError, SceneFacts, Split};
use crate::datasets::kitti::EGO_FROM_LIDAR;
use crate::geom::Pose;
use crate::scan::Scan;

/// Floats of a point.
const COLUMNS: i32 = 4;

/// Folder of a source, from the root of the data set.
fn root_of(source: Source) -> String {
    match source {
        Source::Merged => String::new(),
        Source::Lidar(lidar) => format!("lidar_{lidar}/"),
    }
}

/// Writes clouds and labels of a scan; `at` is its number in the sequence.
pub(super) fn write(
    folder: &Folder,
    sequence: &str,
    at: usize,
    scan: &Scan,
    classes: &[Label],
    settings: &DatasetSettings,
) -> Result<FrameRecord, ExportError> {
    let labels = Labels::new(classes, &scan.boxes, settings.robo3d_labels);
    let each = settings.each_lidar;
    let mounts = mounts(scan);
    let mut files: Vec<Written> = Vec::new();
    for source in Source::all(mounts.len(), each && mounts.len() > 1) {
        let mover = Mover::new(&source.ego_from_sensor(&mounts, DMat3::IDENTITY));
        let (mut cloud, mut ids): (Vec<[f32; 4]>, Vec<u32>) = Default::default();
        for point in scan.points().filter(|point| source.takes(point)) {
            let [x, y, z] = mover.position(point);
            cloud.push([x, y, z, point.intensity]);
            ids.push(labels.kitti(point));
        }
        let place = format!("{}sequences/{sequence}", root_of(source));
        let bytes = bytemuck::cast_slice(&cloud);
        files.push(folder.put(&format!("{place}/velodyne/{at:06}.bin"), bytes)?);
        let bytes = bytemuck::cast_slice(&ids);
        files.push(folder.put(&format!("{place}/labels/{at:06}.label"), bytes)?);
    }
    let boxes = scan.boxes.iter().map(|tracked| (0, tracked.points)).collect();
    Ok(FrameRecord { files, ..FrameRecord::new(scan, boxes) })
}

/// Writes what stands beside the clouds.
pub(super) fn finish(
    folder: &Folder,
    scenes: &[SceneFacts],
    plan: &[Planned],
    each: bool,
) -> Result<(), ExportError> {
    let mut lidars = 0;
    for (number, (scene, planned)) in scenes.iter().zip(plan).enumerate() {
        let first = folder.record(number, scene.frames[0])?;
        lidars = lidars.max(first.lidars.len());
        for source in Source::all(first.lidars.len(), each && first.lidars.len() > 1) {
            sequence(folder, number, scene, &planned.name, source)?;
        }
    }
    for source in Source::all(lidars, each && lidars > 1) {
        for split in Split::ALL {
            infos(folder, scenes, plan, source, split)?;
        }
    }
    Ok(())
}

fn ego_from_source(record: &FrameRecord, source: Source) -> Pose {
    let pose = |lidar: &LidarRecord| lidar.ego_from_mount.pose();
    let mounts: Vec<Pose> = record.lidars.iter().map(pose).collect();
    source.ego_from_sensor(&mounts, DMat3::IDENTITY)
}

fn world_from_source(record: &FrameRecord, source: Source) -> Pose {
    record.world_from_ego.pose().compose(&ego_from_source(record, source))
}

/// Poses, times, calibration and the LiDAR's place on the vehicle, of a sequence.
fn sequence(
    folder: &Folder,
    number: usize,
    scene: &SceneFacts,
    name: &str,
    source: Source,
) -> Result<(), ExportError> {
    let place = format!("{}sequences/{name}", root_of(source));
    let mut poses = folder.begin(&format!("{place}/poses.txt"))?;
    let mut times = folder.begin(&format!("{place}/times.txt"))?;
    let mut first: Option<(Pose, f64)> = None;
    for &frame in &scene.frames {
        let record = folder.record(number, frame)?;
        let here = world_from_source(&record, source);
        let (start, begin) = *first.get_or_insert((here.inverse(), record.time));
        poses.write(|out| writeln!(out, "{}", line(&start.compose(&here))))?;
        times.write(|out| writeln!(out, "{:e}", record.time - begin))?;
    }
    poses.end()?;
    times.end()?;
    let unit = line(&Pose::IDENTITY);
    let calib: String = ["P0", "P1", "P2", "P3", "Tr"].map(|n| format!("{n}: {unit}\n")).concat();
    folder.put(&format!("{place}/calib.txt"), calib.as_bytes())?;
    let first = folder.record(number, scene.frames[0])?;
    let here = format!("{}\n", line(&ego_from_source(&first, source)));
    folder.put(&format!("{place}/{EGO_FROM_LIDAR}"), here.as_bytes()).map(drop)
}

/// The upper three rows of a matrix, row by row.
fn line(pose: &Pose) -> String {
    let row = |i: usize| {
        let [x, y, z] = pose.rotation.row(i).to_array();
        format!("{x} {y} {z} {}", pose.translation[i])
    };
    [row(0), row(1), row(2)].join(" ")
}

/// The list of a split as mmdetection3d reads it.
fn infos(
    folder: &Folder,
    scenes: &[SceneFacts],
    plan: &[Planned],
    source: Source,
    split: Split,
) -> Result<(), ExportError> {
    let name = format!("{}semantickitti_infos_{}.pkl", root_of(source), split.name());
    let mut staged: Staged = folder.begin(&name)?;
    staged.write(|out| {
        let mut pickle = Pickle::new(out)?;
        pickle.dict(|p| {
            p.text("metainfo")?;
            p.dict(|p| {
                p.text("DATASET")?;
                p.text("SemanticKITTI")
            })?;
            p.text("data_list")?;
            p.list(|p| {
                let of_split =
                    scenes.iter().zip(plan).filter(|(_, planned)| planned.split == split);
                for (scene, planned) in of_split {
                    for at in 0..scene.frames.len() {
                        info(p, &planned.name, at)?;
                    }
                }
                Ok(())
            })
        })?;
        pickle.end()
    })?;
    staged.end().map(drop)
}

fn info<W: Write>(p: &mut Pickle<W>, sequence: &str, at: usize) -> std::io::Result<()> {
    p.dict(|p| {
        p.text("lidar_points")?;
        p.dict(|p| {
            p.text("lidar_path")?;
            p.text(&format!("sequences/{sequence}/velodyne/{at:06}.bin"))?;
            p.text("num_pts_feats")?;
            p.number(COLUMNS)
        })?;
        p.text("pts_semantic_mask_path")?;
        p.text(&format!("sequences/{sequence}/labels/{at:06}.label"))?;
        p.text("sample_id")?;
        p.text(&format!("{sequence}{at:06}"))
    })
}
