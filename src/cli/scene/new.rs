//! `scene new`: a world by rule, or a plain street of as many triangles as asked for.

use std::path::PathBuf;

use crate::geom::TriangleSoup;
use crate::internals::FEWEST_STREET_TRIANGLES;
use crate::scene::street;
use crate::worlds::{self, generate, mesh_shape};
use clap::ValueEnum;
use serde_json::{Value, json};

use super::target::Target;
use crate::cli::args::{Talk, whole};
use crate::cli::error::Error;

/// Most triangles, well below the limit of a frame.
const MOST: i64 = 50_000_000;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scene new --kind town --seed 7 --out town.json
  sightline scene new --triangles 2000000 --frames 2 --out big.json")]
pub struct Args {
    /// What the world is
    #[arg(long, value_enum, default_value_t = Kind::Street, conflicts_with = "triangles")]
    kind: Kind,
    /// A plain crossing of exactly this many triangles instead, for timings
    #[arg(long, value_name = "N",
          value_parser = clap::value_parser!(u32).range(FEWEST_STREET_TRIANGLES as i64..=MOST))]
    triangles: Option<u32>,
    /// Seed of where things stand and how large they are
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Frames, a tenth of a second apart [default: 40; with --triangles 4, three metres apart]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: Option<u32>,
    /// Scene file to write; the mesh stands beside it, with the ending .ply
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    talk: Talk,
}

/// Value of `--kind`.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Kind {
    /// A street through a town, with side streets
    Street,
    /// A motorway between barriers, under a bridge
    Highway,
    /// Narrow streets between houses with gardens
    Residential,
    /// Halls, containers and lorries
    Yard,
    /// Blocks of houses on a grid of streets
    Town,
}

impl From<Kind> for worlds::Kind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Street => Self::Street,
            Kind::Highway => Self::Highway,
            Kind::Residential => Self::Residential,
            Kind::Yard => Self::Yard,
            Kind::Town => Self::Town,
        }
    }
}

pub fn run(args: &Args) -> Result<(), Error> {
    let target = Target::new(&args.out, None)?;
    if let Some(triangles) = args.triangles {
        let soup = street(triangles as usize, args.seed);
        let scene = plain(&target, args.frames.unwrap_or(4), &soup);
        return target.write(&soup, &scene, args.talk);
    }
    let frames = args.frames.unwrap_or(40) as usize;
    let world = generate(args.kind.into(), args.seed, frames)?;
    target.write(world.mesh(), &world.scene(&target.name(), &target.mesh_name()), args.talk)
}

/// Region, sensor and mount of the own scenes, the sensor with 720 azimuth steps.
fn plain(target: &Target<'_>, frames: u32, soup: &TriangleSoup) -> Value {
    let body = |size: [f64; 3]| json!([{ "class": "vehicle", "box": { "foot": [0, 0, 0.25], "size": size } }]);
    let route = |from: [f64; 2], to: [f64; 2], spacing: f64| json!({ "points": [from, to], "spacing": spacing });
    json!({
        "sightline": 1,
        "name": target.name(),
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 720, "range": 100 },
        "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "first-hit",
        "frames": frames,
        "ego": { "body": body([4.5, 1.8, 1.3]), "route": route([-12.0, -1.7], [100.0, -1.7], 3.0) },
        "static": [mesh_shape(soup, &target.mesh_name())],
        "actors": [
            { "name": "oncoming", "parts": body([4.4, 1.8, 1.4]), "route": route([40.0, 1.7], [-100.0, 1.7], 5.0) },
            { "name": "ahead", "parts": body([4.4, 1.8, 1.4]), "route": route([6.0, -1.7], [100.0, -1.7], 4.0) },
            { "name": "crossing", "parts": body([8.0, 2.4, 2.8]), "route": route([1.7, -30.0], [1.7, 100.0], 6.0) }
        ]
    })
}
