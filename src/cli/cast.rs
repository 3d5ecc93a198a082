use std::io::{Seek, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use bytemuck::NoUninit;
use npyz::npz::NpzWriter;
use npyz::zip::{CompressionMethod, DateTime, write::FileOptions};
use npyz::{AutoSerialize, WriterBuilder};
use serde_json::json;
use sightline::bvh::{Hit, NO_HIT};
use sightline::geom::TriangleSoup;
use sightline::problem::beam_direction;
use sightline::problem::{DevicePose, Problem};
use sightline::scene::EgoBody;
use sightline::vehicle::{Placement, SensorPose, read_placements};

use super::args::{Compute, Format};
use super::error::Error;
use super::load;
use super::output::{writable_file, write_whole};

/// Beams that are cast in one batch: sensors that share directions are cast together.
const BEAMS_TOGETHER: usize = 16 << 20;

#[derive(clap::Args)]
#[command(after_help = "Example:
  sightline cast scenes/highway.json scenes/placements.json --frame 3 --out hits.npz")]
pub struct Args {
    /// Scene file; it must have geometry
    scene: PathBuf,
    /// Placements
    placements: PathBuf,
    /// Write the hits to this .npz file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Frame of the scene, from 0
    #[arg(long, default_value_t = 0, value_name = "T")]
    frame: u32,
    /// How to print the summary
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

/// Columns of the beams, in the order of the contract.
#[derive(Default)]
struct Columns {
    origin: Vec<f32>,
    direction: Vec<f32>,
    distance: Vec<f32>,
    triangle: Vec<u32>,
    class: Vec<u16>,
    placement: Vec<u32>,
    lidar: Vec<u16>,
}

/// A sensor and where it belongs.
struct Sensor {
    placement: u32,
    lidar: u16,
    pose: SensorPose,
}

fn sensors_of(placements: &[Placement]) -> Vec<Sensor> {
    let mut sensors = Vec::new();
    for (placement, of) in (0..).zip(placements) {
        for (lidar, &pose) in (0..).zip(&of.lidars) {
            sensors.push(Sensor { placement, lidar, pose });
        }
    }
    sensors
}

impl Columns {
    /// Adds the beams of a sensor.
    fn add(&mut self, sensor: &Sensor, hits: &[Hit], problem: &Problem, face_class: &[u16]) {
        let pose = DevicePose::new(&sensor.pose, problem.roi());
        for (&direction, hit) in problem.table().directions().iter().zip(hits) {
            self.origin.extend(pose.rows.map(|row| row[3]));
            self.direction.extend(beam_direction(&pose, direction).to_array());
            self.distance.push(if hit.is_hit() { hit.t } else { f32::INFINITY });
            self.triangle.push(hit.prim);
            let class = if hit.is_hit() { face_class[hit.prim as usize] } else { u16::MAX };
            self.class.push(class);
            self.placement.push(sensor.placement);
            self.lidar.push(sensor.lidar);
        }
    }
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let placements = read_placements(&args.placements)?;
    let mut loaded = load::geometry(&args.scene, args.frame, &args.compute)?;
    if let Some(path) = &args.out {
        writable_file(path, loaded.inputs(&args.placements))?;
    }
    let soup = loaded.scene.frame(args.frame as usize, EgoBody::Include);
    let mut columns = Columns::default();
    let beams = loaded.evaluator.problem().table().directions().len();
    for sensors in sensors_of(&placements).chunks((BEAMS_TOGETHER / beams).max(1)) {
        let poses: Vec<SensorPose> = sensors.iter().map(|sensor| sensor.pose).collect();
        let hits = loaded.evaluator.backend_mut().hits(&poses, 0)?;
        for (sensor, hits) in sensors.iter().zip(hits.chunks(beams)) {
            columns.add(sensor, hits, loaded.evaluator.problem(), &soup.face_class);
        }
    }
    if let Some(path) = &args.out {
        write_whole(path, |file| {
            let mut npz = NpzWriter::new(file);
            let end = |npz: &mut NpzWriter<_>| Ok(npz.zip_writer().finish().map(drop)?);
            let written = put_all(&mut npz, &columns, &soup).and_then(|()| end(&mut npz));
            if written.is_err() {
                // Dropped, it would try to write its end again and complain on stderr.
                std::mem::forget(npz);
            }
            written.map_err(Error::io(path))
        })?;
    }
    let stages = loaded.evaluator.backend().times();
    let beams = columns.distance.len();
    let hits = columns.triangle.iter().filter(|&&t| t != NO_HIT).count();
    match args.format {
        Format::Json => outln!(
            "{}",
            json!({
                "scene": loaded.scene.name(),
                "backend": loaded.evaluator.backend().name(),
                "adapter": loaded.evaluator.backend().adapter(),
                "frame": args.frame,
                "beams": beams,
                "hits": hits,
                "triangles": soup.faces.len(),
                "out": args.out,
                "threads": rayon::current_num_threads(),
                "timings": {
                    "load": loaded.times.load,
                    "build": loaded.times.build,
                    "cast": stages.cast.as_secs_f64(),
                    "cover": stages.cover.as_secs_f64(),
                    "reduce": stages.reduce.as_secs_f64(),
                    "total": start.elapsed().as_secs_f64(),
                },
            })
        )?,
        Format::Text => outln!(
            "{}: {beams} beams, {hits} hits on {} triangles",
            loaded.scene.name(),
            soup.faces.len()
        )?,
    }
    Ok(ExitCode::SUCCESS)
}

fn put_all(
    npz: &mut NpzWriter<impl Write + Seek>,
    columns: &Columns,
    soup: &TriangleSoup,
) -> std::io::Result<()> {
    let beams = columns.distance.len() as u64;
    put(npz, "origin", &[beams, 3], &columns.origin)?;
    put(npz, "direction", &[beams, 3], &columns.direction)?;
    put(npz, "distance", &[beams], &columns.distance)?;
    put(npz, "triangle", &[beams], &columns.triangle)?;
    put(npz, "class", &[beams], &columns.class)?;
    put(npz, "placement", &[beams], &columns.placement)?;
    put(npz, "lidar", &[beams], &columns.lidar)?;
    put(npz, "vertices", &[soup.vertices.len() as u64, 3], soup.vertices.as_flattened())?;
    put(npz, "faces", &[soup.faces.len() as u64, 3], soup.faces.as_flattened())?;
    put(npz, "face_class", &[soup.face_class.len() as u64], &soup.face_class)
}

/// Writes one array as `numpy.savez` does, without compression: the header by `npyz`, the data at once
/// (an element at a time is slow).
fn put<T: AutoSerialize + NoUninit>(
    npz: &mut NpzWriter<impl Write + Seek>,
    name: &str,
    shape: &[u64],
    data: &[T],
) -> std::io::Result<()> {
    // No time of writing: the same hits are the same bytes.
    let options = FileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default())
        .large_file(size_of_val(data) as u64 > u64::from(u32::MAX) / 2);
    let array = npz.array::<T>(name, options)?.default_dtype();
    let out = array.shape(shape).write_header_only()?;
    out.write_all(bytemuck::cast_slice(data))
}
