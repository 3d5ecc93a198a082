//! `scan` and `cast`: labelled scans of placements, and every beam's hit in one frame.

use std::path::PathBuf;

use serde_json::json;

use super::args::{Asked, BackendChoice, Format, UnnamedModelArgs, engine, start_threads};
use super::output::{Exit, Talk, Terminal};
use crate::json::counted;
use crate::runs::cast::{CastRequest, cast};
use crate::runs::scan::{ScanRequest, scan};
use crate::runs::{Computing, Gltf, RunError};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scan scenes/highway.json --placement mine.json:roof --out scans
  sightline scan scenes/highway.json scenes/residential.json --placement scenes/placements.json:Ours-seg \
    --layout nuscenes --out nusc
  sightline scan scenes/highway.json --placement scenes/placements.json:Line --condition fog:mor=50 --condition snow:rate=1 --out winter

The same command again goes on with a folder that was not finished. docs/scans.md says what is in a scan,
docs/exports.md what the layouts hold.")]
pub(super) struct ScanArgs {
    #[command(flatten)]
    request: ScanRequest,
    /// Where to cast: the best hardware Vulkan device, or the CPU where there is none (auto); any Vulkan device,
    /// also one in software (gpu); the CPU (cpu). The bytes are the same
    #[arg(long, value_enum, default_value_t = BackendChoice::Auto)]
    backend: BackendChoice,
    /// Take the Vulkan device whose name contains this
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Vehicle file: its sensors, mounts and body in place of the scenes'
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    #[command(flatten)]
    named: UnnamedModelArgs,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    gltf: Gltf,
    /// Frame that --gltf shows, with its points, from 0
    #[arg(long, default_value_t = 0, value_name = "T", requires = "gltf")]
    frame: u32,
    /// How to print the summary
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    talk: Talk,
}

pub(super) fn run(args: &ScanArgs) -> Result<Exit, RunError> {
    start_threads(args.threads, args.talk)?;
    let terminal = Terminal::new(args.talk);
    let engine = engine(args.backend, args.adapter.as_deref(), None)?;
    let (vehicle, sensors) = (args.vehicle.clone(), args.named.sensor.clone());
    let computing = Computing { engine, vehicle, sensors, watcher: &terminal };
    let gltf = args.gltf.gltf.clone().map(|file| (file, args.frame));
    let request = ScanRequest { gltf, ..args.request.clone() };
    let Some(sets) = scan(&request, &computing)? else { return Ok(Exit::Interrupted) };
    match args.format {
        Format::Json => outln!("{}", json!({ "datasets": sets }))?,
        Format::Text => {
            for set in sets {
                outln!(
                    "{}: {} of {}, {} points, {:.1} MB in {}",
                    set.placement,
                    counted(set.frames, "frame"),
                    counted(set.scenes, "scene"),
                    set.points,
                    set.bytes as f64 / 1e6,
                    set.out.display()
                )?;
            }
        }
    }
    Ok(Exit::Done)
}

pub(super) type CastArgs = Asked<CastRequest>;

pub(super) fn run_cast(args: &CastArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = cast(&args.request, &args.computing(&terminal))?;
    match args.format {
        Format::Json => outln!("{}", json!(found))?,
        Format::Text => outln!(
            "{}: {} beams, {} hits on {} triangles",
            found.scene,
            found.beams,
            found.hits,
            found.triangles
        )?,
    }
    Ok(Exit::Done)
}
