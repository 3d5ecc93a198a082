//! Archives of NumPy arrays, one a frame, with all that a scan knows; the table stands in `docs/exports.md`.

use glam::DMat4;

use super::ExportError;
use super::folder::Folder;
use super::record::FrameRecord;
use lidar_cast::geom::Pose;
use sightline_scan::{Return, Scan};
use sightline_scene::psog::{NpzOut, write_npz};

/// Writes a scan to `SCENE/NNNNNN.npz`.
pub(super) fn write(
    folder: &Folder,
    scene: &str,
    at: usize,
    scan: &Scan,
) -> Result<FrameRecord, ExportError> {
    let mut staged = folder.begin(&format!("{scene}/{at:06}.npz"))?;
    staged.write(|out| {
        write_npz(out, false, |npz| {
            put_beams(npz, &scan.returns)?;
            put_rig(npz, scan)?;
            put_boxes(npz, scan)
        })
    })?;
    let files = vec![staged.end()?];
    let boxes = scan.boxes.iter().map(|tracked| (0, tracked.points)).collect();
    Ok(FrameRecord { files, ..FrameRecord::new(scan, boxes) })
}

type Io = std::io::Result<()>;

/// Beams that are turned to columns together: their records lie in the first cache.
const TOGETHER: usize = 256;

fn put_beams<W: std::io::Write + std::io::Seek>(npz: &mut NpzOut<W>, beams: &[Return]) -> Io {
    let n = beams.len() as u64;
    macro_rules! columns {
        ($($name:ident: $of:expr => $shape:expr, $data:expr;)*) => {
            $(let mut $name = Vec::with_capacity(beams.len());)*
            for beams in beams.chunks(TOGETHER) {
                $($name.extend(beams.iter().map($of));)*
            }
            $(npz.put(stringify!($name), $shape, $data)?;)*
        };
    }
    columns! {
        position: |beam: &Return| beam.position => &[n, 3], position.as_flattened();
        raw: |beam: &Return| beam.raw => &[n, 3], raw.as_flattened();
        range: |beam: &Return| beam.range => &[n], &range;
        intensity: |beam: &Return| beam.intensity => &[n], &intensity;
        time: |beam: &Return| beam.time => &[n], &time;
        lidar: |beam: &Return| beam.lidar => &[n], &lidar;
        ring: |beam: &Return| beam.channel => &[n], &ring;
        column: |beam: &Return| beam.column => &[n], &column;
        class: |beam: &Return| beam.class => &[n], &class;
        clean_class: |beam: &Return| beam.clean_class => &[n], &clean_class;
        instance: |beam: &Return| beam.instance => &[n], &instance;
        incidence: |beam: &Return| beam.incidence => &[n], &incidence;
        status: |beam: &Return| beam.status as u8 => &[n], &status;
    }
    Ok(())
}

/// Rows of 4×4 matrices, one after the other.
fn matrices<'a>(poses: impl Iterator<Item = &'a Pose>) -> Vec<f64> {
    let matrix = |pose: &Pose| {
        let (x, y, z) = (pose.rotation.x_axis, pose.rotation.y_axis, pose.rotation.z_axis);
        let columns = [x.extend(0.0), y.extend(0.0), z.extend(0.0), pose.translation.extend(1.0)];
        DMat4::from_cols(columns[0], columns[1], columns[2], columns[3]).transpose().to_cols_array()
    };
    poses.flat_map(matrix).collect()
}

fn put_rig<W: std::io::Write + std::io::Seek>(npz: &mut NpzOut<W>, scan: &Scan) -> Io {
    let lidars = &scan.lidars;
    let n = lidars.len() as u64;
    npz.put("frame", &[], &[scan.frame as u64])?;
    npz.put("frame_time", &[], &[scan.time])?;
    npz.put("world_from_ego", &[4, 4], &matrices([&scan.world_from_ego].into_iter()))?;
    let poses = matrices(lidars.iter().map(|lidar| &lidar.ego_from_sensor));
    npz.put("ego_from_lidar", &[n, 4, 4], &poses)?;
    let channels: Vec<u32> = lidars.iter().map(|lidar| lidar.channels).collect();
    npz.put("lidar_channels", &[n], &channels)?;
    let columns: Vec<u32> = lidars.iter().map(|lidar| lidar.columns).collect();
    npz.put("lidar_columns", &[n], &columns)?;
    let ranges: Vec<f32> = lidars.iter().map(|lidar| lidar.range).collect();
    npz.put("lidar_range", &[n], &ranges)
}

fn put_boxes<W: std::io::Write + std::io::Seek>(npz: &mut NpzOut<W>, scan: &Scan) -> Io {
    let boxes = &scan.boxes;
    let n = boxes.len() as u64;
    let numbers =
        |of: fn(&sightline_scan::TrackedBox) -> u16| boxes.iter().map(of).collect::<Vec<_>>();
    npz.put("box_instance", &[n], &numbers(|tracked| tracked.instance))?;
    npz.put("box_class", &[n], &numbers(|tracked| tracked.class))?;
    npz.put("box_kind", &[n], &boxes.iter().map(|b| b.kind as u8).collect::<Vec<_>>())?;
    npz.put("ego_from_box", &[n, 4, 4], &matrices(boxes.iter().map(|b| &b.ego_from_box)))?;
    let list = |of: fn(&sightline_scan::TrackedBox) -> glam::DVec3| {
        boxes.iter().flat_map(|tracked| of(tracked).to_array()).collect::<Vec<f64>>()
    };
    npz.put("box_size", &[n, 3], &list(|tracked| tracked.size))?;
    npz.put("box_velocity", &[n, 3], &list(|tracked| tracked.velocity))?;
    npz.put("box_points", &[n], &boxes.iter().map(|b| b.points).collect::<Vec<_>>())
}
