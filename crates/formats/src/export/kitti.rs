//! SemanticKITTI: sequences of clouds and labels, poses, calibration, lists for mmdetection3d.
//!
//! Points lie in the frame of one LiDAR in the middle of all (x forward, y left, z up). `Tr` is the identity, so that
//! poses are this LiDAR's, counted from the first frame as in KITTI. Each LiDAR by itself is a data set of its own,
//! `lidar_0` and on.

use std::io;
use std::io::Write;

use glam::DMat3;
use lidar_cast::geom::Pose;
use sightline_scan::Scan;

use super::folder::{Folder, StagedFile};
use super::plan::{Label, Planned, ScanLabels};
use super::record::{CloudOrigin, FrameRecord, LidarRecord, Mover, Written, mounts};
use super::{Checked, DatasetSettings, SceneFacts, Split};
use crate::datasets::kitti::EGO_FROM_LIDAR;

/// Floats of a point.
const COLUMNS: i32 = 4;

/// Folder of a source, from the root of the data set.
fn root_of(source: CloudOrigin) -> String {
    match source {
        CloudOrigin::Merged => String::new(),
        CloudOrigin::Lidar(lidar) => format!("lidar_{lidar}/"),
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
) -> Checked<FrameRecord> {
    let labels = ScanLabels::new(classes, &scan.boxes);
    let each = settings.each_lidar;
    let mounts = mounts(scan);
    let mut files: Vec<Written> = Vec::new();
    let most = scan.returns.len();
    let (mut cloud, mut ids) = (Vec::<[f32; 4]>::with_capacity(most), Vec::with_capacity(most));
    for source in CloudOrigin::all(mounts.len(), each && mounts.len() > 1) {
        let mover = Mover::new(&source.ego_from_sensor(&mounts, DMat3::IDENTITY));
        cloud.clear();
        ids.clear();
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

/// Writes poses, calibration, times and lists beside the clouds.
pub(super) fn finish(
    folder: &Folder,
    scenes: &[SceneFacts],
    plan: &[Planned],
    each: bool,
) -> Checked<()> {
    let mut lidars = 0;
    for (number, (scene, planned)) in scenes.iter().zip(plan).enumerate() {
        let first = folder.record(number, scene.frames[0])?;
        lidars = lidars.max(first.lidars.len());
        let sources = CloudOrigin::all(first.lidars.len(), each && first.lidars.len() > 1);
        let begun = sources.map(|source| Sequence::begin(folder, &planned.name, source, &first));
        let mut sequences = begun.collect::<Checked<Vec<Sequence>>>()?;
        for &frame in &scene.frames {
            let record = folder.record(number, frame)?;
            sequences.iter_mut().try_for_each(|sequence| sequence.add(&record))?;
        }
        sequences.into_iter().try_for_each(Sequence::end)?;
    }
    for source in CloudOrigin::all(lidars, each && lidars > 1) {
        for split in Split::ALL {
            infos(folder, scenes, plan, source, split)?;
        }
    }
    Ok(())
}

fn ego_from_source(record: &FrameRecord, source: CloudOrigin) -> Pose {
    let pose = |lidar: &LidarRecord| lidar.ego_from_mount.pose();
    let mounts: Vec<Pose> = record.lidars.iter().map(pose).collect();
    source.ego_from_sensor(&mounts, DMat3::IDENTITY)
}

fn world_from_source(record: &FrameRecord, source: CloudOrigin) -> Pose {
    record.world_from_ego.pose().compose(&ego_from_source(record, source))
}

/// Poses, times, calibration and the LiDAR's place on the vehicle, of a sequence of one source.
struct Sequence {
    source: CloudOrigin,
    poses: StagedFile,
    times: StagedFile,
    /// Pose and time that the others are counted from.
    first_from_world: Pose,
    begin: f64,
}

impl Sequence {
    fn begin(
        folder: &Folder,
        name: &str,
        source: CloudOrigin,
        first: &FrameRecord,
    ) -> Checked<Self> {
        let place = format!("{}sequences/{name}", root_of(source));
        let unit = line(&Pose::IDENTITY);
        let rows = ["P0", "P1", "P2", "P3", "Tr"].map(|name| format!("{name}: {unit}\n"));
        folder.put(&format!("{place}/calib.txt"), rows.concat().as_bytes())?;
        let mount = format!("{}\n", line(&ego_from_source(first, source)));
        folder.put(&format!("{place}/{EGO_FROM_LIDAR}"), mount.as_bytes())?;
        Ok(Self {
            source,
            poses: folder.begin(&format!("{place}/poses.txt"))?,
            times: folder.begin(&format!("{place}/times.txt"))?,
            first_from_world: world_from_source(first, source).inverse(),
            begin: first.time,
        })
    }

    fn add(&mut self, record: &FrameRecord) -> Checked<()> {
        let here = self.first_from_world.compose(&world_from_source(record, self.source));
        self.poses.write(|out| writeln!(out, "{}", line(&here)))?;
        let time = record.time - self.begin;
        self.times.write(|out| writeln!(out, "{time:e}"))
    }

    fn end(self) -> Checked<()> {
        self.poses.end()?;
        self.times.end().map(drop)
    }
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
    source: CloudOrigin,
    split: Split,
) -> Checked<()> {
    let name = format!("{}semantickitti_infos_{}.pkl", root_of(source), split.name());
    let mut staged: StagedFile = folder.begin(&name)?;
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

fn info<W: Write>(p: &mut Pickle<W>, sequence: &str, at: usize) -> io::Result<()> {
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

struct Pickle<W: Write>(W);

impl<W: Write> Pickle<W> {
    fn new(mut out: W) -> io::Result<Self> {
        out.write_all(b"\x80\x02")?;
        Ok(Self(out))
    }

    fn text(&mut self, text: &str) -> io::Result<()> {
        self.0.write_all(b"X")?;
        self.0.write_all(&(text.len() as u32).to_le_bytes())?;
        self.0.write_all(text.as_bytes())
    }

    fn number(&mut self, number: i32) -> io::Result<()> {
        self.0.write_all(b"J")?;
        self.0.write_all(&number.to_le_bytes())
    }

    /// Writes a list with the items of `items`.
    fn list(&mut self, items: impl FnOnce(&mut Self) -> io::Result<()>) -> io::Result<()> {
        self.0.write_all(b"](")?;
        items(self)?;
        self.0.write_all(b"e")
    }

    /// Writes a dictionary with the pairs of `pairs`: key, value, key, value.
    fn dict(&mut self, pairs: impl FnOnce(&mut Self) -> io::Result<()>) -> io::Result<()> {
        self.0.write_all(b"}(")?;
        pairs(self)?;
        self.0.write_all(b"u")
    }

    fn end(mut self) -> io::Result<()> {
        self.0.write_all(b".")?;
        self.0.flush()
    }
}
