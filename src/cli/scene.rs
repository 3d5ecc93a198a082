//! `scene`: a seeded street of as many triangles as asked for.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::{Value, json};
use sightline::geom::TriangleSoup;
use sightline::internals::{
    FEWEST_STREET_TRIANGLES, FileError, is_sink, target, writable_file, write_whole,
};
use sightline::scene::{DEFAULT_CLASSES, street};

use super::args::{Talk, whole};
use super::error::Error;

/// Most triangles, well below the limit of a frame.
const MOST: i64 = 50_000_000;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scene --triangles 200000 --seed 1 --out street.json
  sightline scene --triangles 2000000 --frames 2 --out big.json")]
pub struct Args {
    /// Triangles of the static world
    #[arg(long, value_name = "N", default_value_t = 200_000,
          value_parser = clap::value_parser!(u32).range(FEWEST_STREET_TRIANGLES as i64..=MOST))]
    triangles: u32,
    /// Seed of where things stand and how large they are
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Frames, three metres apart along the street
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: u32,
    /// Scene file to write; the mesh stands beside it, with the ending .ply
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    talk: Talk,
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let mesh = args.out.with_extension("ply");
    if mesh == args.out {
        return Err(Error::Usage(format!(
            "{}: is the name of the mesh; give the scene the ending .json",
            args.out.display()
        )));
    }
    if is_sink(&target(&args.out)?) {
        return Err(Error::Usage(format!(
            "{}: is no regular file, and the mesh is to stand beside it; name a file",
            args.out.display()
        )));
    }
    writable_file(&args.out, [])?;
    let soup = street(args.triangles as usize, args.seed);
    write_whole(&mesh, |file| write_ply(&soup, file).map_err(Error::io(&mesh)))?;
    let scene = scene(args, &mesh, &soup);
    write_whole(&args.out, |file| {
        serde_json::to_writer_pretty(&mut *file, &scene)
            .map_err(|source| FileError::Json { path: args.out.clone(), source })?;
        file.write_all(b"\n").map_err(Error::io(&args.out))
    })?;
    args.talk.note(format!(
        "{} triangles in {}, scene in {}",
        soup.faces.len(),
        mesh.display(),
        args.out.display()
    ));
    Ok(ExitCode::SUCCESS)
}

/// Binary PLY with the class of each face as `label`.
fn write_ply(soup: &TriangleSoup, file: &mut impl Write) -> std::io::Result<()> {
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nproperty uchar label\nend_header\n",
        soup.vertices.len(),
        soup.faces.len()
    )?;
    for coordinate in soup.vertices.iter().flatten() {
        file.write_all(&coordinate.to_le_bytes())?;
    }
    for (face, &class) in soup.faces.iter().zip(&soup.face_class) {
        file.write_all(&[3])?;
        for vertex in face {
            file.write_all(&vertex.to_le_bytes())?;
        }
        file.write_all(&[class as u8])?;
    }
    Ok(())
}

/// Region, sensor and mount of the own scenes, the sensor with 720 azimuth steps.
fn scene(args: &Args, mesh: &Path, soup: &TriangleSoup) -> Value {
    let used: BTreeSet<u16> = soup.face_class.iter().copied().collect();
    let classes: serde_json::Map<String, Value> =
        used.into_iter().map(|c| (c.to_string(), json!(DEFAULT_CLASSES[usize::from(c)]))).collect();
    let body = |size: [f64; 3]| json!([{ "class": "vehicle", "box": { "foot": [0, 0, 0.25], "size": size } }]);
    let route = |from: [f64; 2], to: [f64; 2], spacing: f64| json!({ "points": [from, to], "spacing": spacing });
    json!({
        "sightline": 1,
        "name": args.out.file_stem().unwrap_or_default().to_string_lossy(),
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 720, "range": 100 },
        "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "first-hit",
        "frames": args.frames,
        "ego": { "body": body([4.5, 1.8, 1.3]), "route": route([-12.0, -1.7], [100.0, -1.7], 3.0) },
        "static": [{ "class": "static",
                     "mesh": { "file": mesh.file_name().unwrap_or_default().to_string_lossy(),
                               "classes": classes } }],
        "actors": [
            { "name": "oncoming", "parts": body([4.4, 1.8, 1.4]), "route": route([40.0, 1.7], [-100.0, 1.7], 5.0) },
            { "name": "ahead", "parts": body([4.4, 1.8, 1.4]), "route": route([6.0, -1.7], [100.0, -1.7], 4.0) },
            { "name": "crossing", "parts": body([8.0, 2.4, 2.8]), "route": route([1.7, -30.0], [1.7, 100.0], 6.0) }
        ]
    })
}
