//! `cast`: every beam's hit in one frame of a scene.

use std::path::PathBuf;
use std::time::Instant;

use crate::export::GltfView;
use crate::scan::BeamHits;
use crate::scene::EgoBody;
use crate::vehicle::read_placements;
use serde_json::json;

use super::args::{Compute, Format};
use super::error::Error;
use super::exit::Exit;
use super::glb::Gltf;
use super::load;
use crate::internals::{writable_file, write_whole};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline cast scenes/highway.json scenes/placements.json --frame 3 --out hits.npz
  sightline cast scenes/highway.json scenes/placements.json --gltf highway.glb")]
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
    gltf: Gltf,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let placements = read_placements(&args.placements)?;
    let mut loaded = load::geometry(&args.scene, args.frame, &args.compute)?;
    if let Some(path) = &args.out {
        writable_file(path, loaded.inputs(&args.placements))?;
    }
    args.gltf.check(loaded.inputs(&args.placements))?;
    let soup = loaded.scene.frame(args.frame as usize, EgoBody::Include);
    let problem = loaded.evaluator.problem().clone();
    let columns = BeamHits::of(&placements, &problem, &soup.face_class, |poses| {
        loaded.evaluator.backend_mut().hits(poses, 0)
    })?;
    if let Some(path) = &args.out {
        write_whole(path, |file| columns.write(file, &soup).map_err(Error::io(path)))?;
    }
    if args.gltf.gltf.is_some() {
        let points: Vec<_> = columns.points().collect();
        let (scene, frame) = (&loaded.scene, args.frame as usize);
        let view = GltfView { scene, frame, placements: &placements, points: &points };
        args.gltf.write(args.compute.talk, &view)?;
    }
    let stages = loaded.evaluator.backend().times();
    let (beams, hits) = (columns.beams(), columns.hits());
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
    Ok(Exit::Done)
}
