use std::io::{Seek, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use npyz::WriterBuilder;
use npyz::npz::NpzWriter;
use npyz::zip::{DateTime, write::FileOptions};
use serde_json::json;
use sightline::backend::{DevicePose, cpu::beam_direction};
use sightline::bvh::NO_HIT;
use sightline::placement::read_placements;
use sightline::scene::EgoBody;

use super::args::{Compute, Format, format_or_default};
use super::error::Error;
use super::load;
use super::output::{writable_file, write_whole};

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
    /// How to print the summary [default: text on a terminal, else json]
    #[arg(long, value_enum)]
    format: Option<Format>,
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

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start_threads()?;
    let placements = read_placements(&args.placements)?;
    if let Some(path) = &args.out {
        writable_file(path)?;
    }
    let mut loaded = load::geometry(&args.scene, args.frame, &args.compute)?;
    let soup = loaded.scene.frame(args.frame as usize, EgoBody::Include);
    let mut columns = Columns::default();
    for (index, placement) in placements.iter().enumerate() {
        let hits = loaded.evaluator.backend_mut().hits(placement, 0)?;
        let problem = loaded.evaluator.problem();
        let table = problem.table();
        let mut hits = hits.iter();
        for (lidar, pose) in placement.lidars.iter().enumerate() {
            let pose = DevicePose::new(pose, problem.roi());
            for (&direction, hit) in table.directions().iter().zip(hits.by_ref()) {
                columns.origin.extend(pose.rows.map(|row| row[3]));
                columns.direction.extend(beam_direction(&pose, direction).to_array());
                let is_hit = hit.prim != NO_HIT;
                columns.distance.push(if is_hit { hit.t } else { f32::INFINITY });
                columns.triangle.push(hit.prim);
                let class = if is_hit { soup.face_class[hit.prim as usize] } else { u16::MAX };
                columns.class.push(class);
                columns.placement.push(index as u32);
                columns.lidar.push(lidar as u16);
            }
        }
    }
    if let Some(path) = &args.out {
        write_whole(path, |file| {
            let mut npz = NpzWriter::new(file);
            let beams = columns.distance.len() as u64;
            put(&mut npz, path, "origin", &[beams, 3], &columns.origin)?;
            put(&mut npz, path, "direction", &[beams, 3], &columns.direction)?;
            put(&mut npz, path, "distance", &[beams], &columns.distance)?;
            put(&mut npz, path, "triangle", &[beams], &columns.triangle)?;
            put(&mut npz, path, "class", &[beams], &columns.class)?;
            put(&mut npz, path, "placement", &[beams], &columns.placement)?;
            put(&mut npz, path, "lidar", &[beams], &columns.lidar)?;
            let vertices = soup.vertices.as_flattened();
            put(&mut npz, path, "vertices", &[soup.vertices.len() as u64, 3], vertices)?;
            put(&mut npz, path, "faces", &[soup.faces.len() as u64, 3], soup.faces.as_flattened())?;
            put(&mut npz, path, "face_class", &[soup.face_class.len() as u64], &soup.face_class)
        })?;
    }
    let stages = loaded.evaluator.backend().times();
    let beams = columns.distance.len();
    let hits = columns.triangle.iter().filter(|&&t| t != NO_HIT).count();
    match format_or_default(args.format) {
        Format::Json => println!(
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
        ),
        Format::Text => println!(
            "{}: {beams} beams, {hits} hits on {} triangles",
            loaded.scene.name(),
            soup.faces.len()
        ),
    }
    Ok(ExitCode::SUCCESS)
}

fn put<W: Write + Seek, T>(
    npz: &mut NpzWriter<W>,
    path: &Path,
    name: &str,
    shape: &[u64],
    data: &[T],
) -> Result<(), Error>
where
    T: npyz::AutoSerialize + Copy,
{
    // No time of writing: the same hits are the same bytes.
    let options = FileOptions::default()
        .last_modified_time(DateTime::default())
        .large_file(size_of_val(data) as u64 > u64::from(u32::MAX) / 2);
    let array = npz.array(name, options).map_err(Error::io(path))?;
    let mut writer = array.default_dtype().shape(shape).begin_nd().map_err(Error::io(path))?;
    writer.extend(data.iter().copied()).map_err(Error::io(path))?;
    writer.finish().map_err(Error::io(path))
}
