//! `scan` and `cast`: labelled scans of placements, and every beam's hit in one frame.

use std::path::PathBuf;

use serde_json::json;

use super::args::{Asked, BackendChoice, Format, UnnamedModelArgs, engine, start_threads};
use super::output::{Exit, Talk, Terminal};
use crate::export::{DatasetSettings, Layout, Splits};
use crate::runs::Gltf;
use crate::runs::cast::{CastRequest, cast};
use crate::runs::parse::{number_as, whole};
use crate::runs::scan::{ScanRequest, scan};
use crate::runs::{Computing, RunError};
use crate::scan::Scanning;
use crate::scan::conditions::Condition;
use sightline_files::json::counted;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scan scenes/highway.json --placement mine.json:roof --out scans
  sightline scan scenes/highway.json scenes/residential.json --placement scenes/placements.json:Ours-seg \
    --layout nuscenes --out nusc
  sightline scan scenes/highway.json --placement scenes/placements.json:Line --condition fog:mor=50 --condition snow:rate=1 --out winter

The same command again goes on with a folder that was not finished. docs/scans.md says what is in a scan,
docs/exports.md what the layouts hold.")]
pub(super) struct ScanArgs {
    /// Scene files; they must have geometry
    #[arg(value_name = "SCENE", required = true)]
    scenes: Vec<PathBuf>,
    /// File of placements, or one of them as FILE:NAME; several give a folder each
    #[arg(long, required = true, value_name = "PLACEMENTS")]
    placement: Vec<String>,
    /// Folder to write
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Format: npz, semantickitti or nuscenes
    #[arg(long, value_name = "NAME", default_value = "npz")]
    layout: Layout,
    /// Geometry alone: every beam returns at once, without error, from what it meets
    #[arg(long)]
    ideal: bool,
    /// Weather or a fault, as fog:mor=50 or snow:rate=1; may be given several times
    ///
    /// Also rain:rate=5, wet:water=1, blur, crosstalk:share=0.01, echo:ratio=0.85, or with level=light|moderate|heavy.
    #[arg(long, value_name = "NAME[:KEY=VALUE,…]")]
    condition: Vec<Condition>,
    /// Seed of all that is left to chance
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// First frames of each scene alone, at most so many
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Shares of the scenes for training, validation and tests
    #[arg(long, num_args = 3, value_names = ["TRAIN", "VAL", "TEST"], value_parser = number_as("0.7"))]
    splits: Option<Vec<f64>>,
    /// nuscenes: of so many frames one is a keyframe, the others are sweeps [default: 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    keyframe_every: Option<u32>,
    /// nuscenes: rows of six cameras without pictures, which mmdetection3d asks for
    #[arg(long)]
    with_camera_stubs: bool,
    /// semantickitti, nuscenes: all LiDARs as one cloud only, not each by itself as well
    #[arg(long)]
    merged_only: bool,
    /// semantickitti, nuscenes: a class of the scenes that is to count as another, as lamp=pole
    #[arg(long, value_name = "CLASS=CLASS")]
    map: Vec<String>,
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
    args.check()?;
    let Some(sets) = scan(&request(args), &computing)? else { return Ok(Exit::Interrupted) };
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

impl ScanArgs {
    /// Finds options that the layout has no use for.
    fn check(&self) -> Result<(), RunError> {
        let (nuscenes, any) =
            (&[Layout::Nuscenes][..], &[Layout::Nuscenes, Layout::SemanticKitti][..]);
        let options = [
            ("--keyframe-every", self.keyframe_every.is_some(), nuscenes),
            ("--with-camera-stubs", self.with_camera_stubs, nuscenes),
            ("--merged-only", self.merged_only, any),
            ("--map", !self.map.is_empty(), any),
        ];
        match options.iter().find(|(_, given, of)| *given && !of.contains(&self.layout)) {
            Some((option, _, of)) => {
                let of: Vec<&str> = of.iter().map(|layout| layout.name()).collect();
                Err(RunError::Usage(format!(
                    "{option}: is for --layout {}, and this one is {}; leave it out",
                    of.join(" and "),
                    self.layout.name()
                )))
            }
            None => Ok(()),
        }
    }
}

fn request(args: &ScanArgs) -> ScanRequest {
    let (ideal, seed, conditions) = (args.ideal, args.seed, args.condition.clone());
    let usual = DatasetSettings::new(args.layout);
    let splits = args.splits.as_deref().map_or_else(Splits::default, |shares| Splits {
        train: shares[0],
        val: shares[1],
        test: shares[2],
    });
    ScanRequest {
        scenes: args.scenes.clone(),
        placements: args.placement.clone(),
        out: args.out.clone(),
        layout: args.layout,
        scanning: Scanning { ideal, seed, conditions },
        frames: args.frames,
        splits,
        keyframe_every: args.keyframe_every.map_or(usual.keyframe_every, |every| every as usize),
        camera_stubs: args.with_camera_stubs,
        each_lidar: !args.merged_only,
        map: args.map.clone(),
        gltf: args.gltf.gltf.clone().map(|file| (file, args.frame)),
    }
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
