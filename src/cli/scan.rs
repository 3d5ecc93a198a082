//! `scan`: labelled scans of placements, written as data sets.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::Placement;
use crate::export::{Dataset, DatasetSettings, GltfView, Layout, SceneFacts, Splits, record};
use crate::scan::conditions::Condition;
use crate::scan::{Scanner, Scanning};
use crate::scene::Scene;
use serde_json::json;

use super::args::{Format, Talk, finite, whole};
use super::error::Error;
use super::exit::Exit;
use super::files::named_placements;
use super::glb::Gltf;
use super::interrupt::Interrupt;
use super::{load, progress};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scan scenes/urban-crossing.json --placement scenes/placements.json:Pyramid --out scans
  sightline scan scenes/highway.json scenes/residential.json --placement scenes/placements.json:Ours-seg \
    --layout nuscenes --out nusc
  sightline scan scenes/highway.json --placement scenes/placements.json:Line --condition fog:mor=50 \\
    --condition snow:rate=1 --out winter

The same command again goes on with a folder that was not finished. docs/scans.md says what is in a scan,
docs/exports.md what the layouts hold.")]
pub struct Args {
    /// Scene files; they must have geometry
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// File of placements, or one of them; several give a folder each
    #[arg(long, required = true, value_name = "FILE[:NAME]")]
    placement: Vec<String>,
    /// Folder to write
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Format: npz, semantickitti or nuscenes
    #[arg(long, value_name = "NAME", default_value = "npz")]
    layout: Layout,
    /// Geometry alone: every beam returns at once, without error, from what it meets
    #[arg(long, conflicts_with = "condition")]
    ideal: bool,
    /// Weather or a fault, as fog:mor=50, snow:rate=1, wet:water=1, blur, crosstalk:share=0.01, echo:ratio=0.85;
    /// with mode=robo3d by the rules of the public benchmark, with level=light|moderate|heavy
    #[arg(long, value_name = "NAME[:KEY=VALUE,…]")]
    condition: Vec<Condition>,
    /// Seed of all that is left to chance
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<u64>)]
    seed: u64,
    /// First frames of each scene alone
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Shares of the scenes for training, validation and tests
    #[arg(long, num_args = 3, value_names = ["TRAIN", "VAL", "TEST"], value_parser = finite)]
    splits: Option<Vec<f64>>,
    /// nuscenes: of so many frames one is a keyframe, the others are sweeps
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = whole::<usize>)]
    keyframe_every: usize,
    /// nuscenes: rows of six cameras without pictures, which mmdetection3d asks for
    #[arg(long)]
    with_camera_stubs: bool,
    /// All LiDARs as one cloud only, not each by itself as well
    #[arg(long)]
    merged_only: bool,
    /// A class of the scenes that is to count as another, as lamp=pole
    #[arg(long, value_name = "CLASS=CLASS")]
    map: Vec<String>,
    /// Label fog, snow and crosstalk as Robo3D does: 21, 22, 23 in semantickitti and 41, 42, 43 in nuscenes,
    /// whose evaluators know no such categories; else they are unlabelled
    #[arg(long)]
    robo3d_labels: bool,
    /// Vehicle file: its sensors, mounts and body in place of the scenes'
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
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

pub fn run(args: &Args) -> Result<Exit, Error> {
    super::args::start_threads(args.threads)?;
    let interrupt = Interrupt::listen(args.talk);
    let placements = placements(&args.placement)?;
    let read = |path: &PathBuf| load::read(path, args.vehicle.as_deref(), args.talk);
    let scenes = args.scenes.iter().map(read).collect::<Result<Vec<Scene>, Error>>()?;
    // All that may be wrong is found before anything is written.
    for placement in &placements {
        for scene in &scenes {
            Scanner::check(scene, placement, &args.scanning())?;
        }
    }
    args.check_gltf(&scenes, &placements)?;
    let mut rows = Vec::new();
    for placement in &placements {
        let out = match placements.len() {
            1 => args.out.clone(),
            _ => args.out.join(&placement.name),
        };
        match one(args, placement, &scenes, &out, &interrupt)? {
            Some(row) => rows.push(row),
            None => {
                let again = "the same command goes on";
                args.talk.note(format!("stopped; {} is not complete, {again}", out.display()));
                return Ok(Exit::Interrupted);
            }
        }
    }
    args.write_gltf(&scenes, &placements)?;
    match args.format {
        Format::Json => outln!("{}", json!({ "datasets": rows }))?,
        Format::Text => {
            for row in rows {
                outln!(
                    "{}: {} frames of {} scenes, {} points, {:.1} MB in {}",
                    row["placement"].as_str().unwrap_or_default(),
                    row["frames"],
                    row["scenes"],
                    row["points"],
                    row["bytes"].as_f64().unwrap_or_default() / 1e6,
                    row["out"].as_str().unwrap_or_default()
                )?;
            }
        }
    }
    Ok(Exit::Done)
}

/// The data set of one placement; `None` if it was interrupted.
fn one(
    args: &Args,
    placement: &Placement,
    scenes: &[Scene],
    out: &Path,
    interrupt: &Interrupt,
) -> Result<Option<serde_json::Value>, Error> {
    let start = Instant::now();
    let facts: Vec<SceneFacts> = scenes.iter().map(|scene| args.facts(scene)).collect();
    let dataset = Dataset::create(out, &args.settings(placement)?, &facts)?;
    let frames: usize = (0..scenes.len()).map(|scene| dataset.missing_of(scene).len()).sum();
    let bar = progress::bar(frames as u64, "frames", args.talk);
    let points = AtomicU64::new(0);
    for (k, scene) in scenes.iter().enumerate() {
        if interrupt.is_set() {
            return Ok(None);
        }
        if dataset.missing_of(k).is_empty() {
            continue;
        }
        let scanner = Scanner::new(scene, placement, &args.scanning())?;
        let whole = record(&dataset, k, &scanner, |scan| {
            points.fetch_add(scan.points().count() as u64, Ordering::Relaxed);
            bar.inc(1);
            !interrupt.is_set()
        })?;
        if !whole {
            return Ok(None);
        }
    }
    bar.finish_and_clear();
    let summary = dataset.finish()?;
    let seconds = start.elapsed().as_secs_f64();
    let written = points.into_inner();
    args.talk.detail(format!(
        "{written} points in {seconds:.2} s, {:.2} million a second",
        written as f64 / seconds / 1e6
    ));
    Ok(Some(json!({
        "placement": placement.name,
        "out": out,
        "layout": args.layout.name(),
        "scenes": summary.scenes,
        "frames": summary.frames,
        "points": summary.points,
        "bytes": summary.bytes,
        "points_now": written,
        "seconds": seconds,
        "threads": rayon::current_num_threads(),
    })))
}

impl Args {
    fn scanning(&self) -> Scanning {
        Scanning { ideal: self.ideal, seed: self.seed, conditions: self.condition.clone() }
    }

    fn facts(&self, scene: &Scene) -> SceneFacts {
        let frames = self.frames.map_or(usize::MAX, |frames| frames as usize);
        SceneFacts {
            name: scene.name().to_owned(),
            classes: scene.classes().to_vec(),
            frames: (0..scene.frame_count().min(frames)).collect(),
            split: None,
        }
    }

    /// Checks that what `--gltf` is to show is one frame of one scene, and its file.
    fn check_gltf(&self, scenes: &[Scene], placements: &[Placement]) -> Result<(), Error> {
        let (Some(path), [scene, ..]) = (&self.gltf.gltf, scenes) else { return Ok(()) };
        if scenes.len() > 1 || placements.len() > 1 {
            return Err(Error::Usage(format!(
                "--gltf {}: shows one scene and one placement; give one of each",
                path.display()
            )));
        }
        let frames = scene.frame_count();
        if self.frame as usize >= frames {
            return Err(Error::Usage(format!(
                "--frame {}: the scene `{}` has frames 0 to {}",
                self.frame,
                scene.name(),
                frames - 1
            )));
        }
        self.gltf.check(scene.files().iter().map(PathBuf::as_path))
    }

    /// Writes the frame of `--gltf` with the points of its scan.
    fn write_gltf(&self, scenes: &[Scene], placements: &[Placement]) -> Result<(), Error> {
        let (Some(_), [scene], [placement]) = (&self.gltf.gltf, scenes, placements) else {
            return Ok(());
        };
        let scan = Scanner::new(scene, placement, &self.scanning())?.scan(self.frame as usize);
        let points: Vec<_> = scan.points().map(|point| (point.class, point.position)).collect();
        let frame = self.frame as usize;
        self.gltf.write(self.talk, &GltfView { scene, frame, placements, points: &points })
    }

    fn settings(&self, placement: &Placement) -> Result<DatasetSettings, Error> {
        let mut map = Vec::new();
        for pair in &self.map {
            let Some((class, to)) = pair.split_once('=') else {
                return Err(Error::Usage(format!("--map {pair}: write CLASS=CLASS, as lamp=pole")));
            };
            map.push((class.to_owned(), to.to_owned()));
        }
        let splits = self.splits.as_deref().map_or_else(Splits::default, |shares| Splits {
            train: shares[0],
            val: shares[1],
            test: shares[2],
        });
        let conditions: Vec<String> = self.condition.iter().map(Condition::to_string).collect();
        let provenance = json!({
            "scenes": self.scenes,
            "vehicle": self.vehicle,
            "placement": placement,
            "ideal": self.ideal,
            "seed": self.seed,
            "conditions": conditions,
            "sightline": env!("CARGO_PKG_VERSION"),
        });
        Ok(DatasetSettings {
            keyframe_every: self.keyframe_every,
            camera_stubs: self.with_camera_stubs,
            each_lidar: !self.merged_only,
            splits,
            seed: self.seed,
            map,
            robo3d_labels: self.robo3d_labels,
            provenance: provenance.to_string(),
            ..DatasetSettings::new(self.layout)
        })
    }
}

/// All placements of files, or one by its name behind a colon.
fn placements(given: &[String]) -> Result<Vec<Placement>, Error> {
    let mut found: Vec<Placement> = Vec::new();
    for text in given {
        found.extend(named_placements(text)?);
    }
    for (k, placement) in found.iter().enumerate() {
        if found[..k].iter().any(|other| other.name == placement.name) {
            let name = &placement.name;
            return Err(Error::Usage(format!(
                "--placement: `{name}` comes twice, and each is to have a folder of its own; rename one"
            )));
        }
    }
    Ok(found)
}
