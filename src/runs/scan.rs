//! Labelled scans of placements, written as data sets that can be resumed.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::json;

use super::inputs::{Given, file_and_name, named_placements, repeated};
use super::{Computing, RunError, Silent, Watcher, opening, outputs};
use crate::export::{
    Dataset, DatasetSettings, GltfView, Input, Layout, SceneFacts, Splits, record,
};
use crate::files::{FileNames, Session};
use crate::scan::conditions::{Condition, in_words};
use crate::scan::{ScanError, Scanner, Scanning, Stage};
use crate::scene::Scene;
use crate::vehicle::Placement;

/// Time after a stop request: trees and large frames are finished without a look at it, and a frame that is not in
/// its place by then is written by the same command later.
const GRACE: Duration = Duration::from_millis(1500);

/// The data set of one placement.
#[derive(Debug, Serialize)]
pub struct Scanned {
    /// Name of the placement.
    pub placement: String,
    /// Its folder.
    pub out: PathBuf,
    /// Name of the layout.
    pub layout: &'static str,
    /// Scenes in it.
    pub scenes: usize,
    /// Frames of all scenes.
    pub frames: usize,
    /// Points of all frames.
    pub points: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// Points written now; the others were there before.
    pub points_now: u64,
    /// Time that it took.
    pub seconds: f64,
    /// Threads of the process.
    pub threads: usize,
}

/// Scans every placement in every scene; `None` if the watcher stopped it: the next call goes on.
///
/// # Errors
/// Files that cannot be read or written, placements of one name, errors of [`Scanner::on`], of [`Dataset::create`] and
/// of the engine.
pub fn scan(
    request: &ScanRequest,
    computing: &Computing<'_>,
) -> Result<Option<Vec<Scanned>>, RunError> {
    let _session = Session::begin();
    let (watcher, scanning) = (computing.watcher, request.scanning());
    request.check()?;
    if let Some(what) = repeated(&request.scenes) {
        return Err(RunError::Usage(format!(
            "{what}, and a data set has each scene once; leave it out"
        )));
    }
    let placements = placements(&request.placement)?;
    let (files_given, mut placements): (Vec<&Path>, Vec<Placement>) =
        placements.into_iter().unzip();
    let read = |path: &PathBuf| opening::read(path, computing.vehicle.as_deref(), watcher);
    let scenes = request.scenes.iter().map(read).collect::<Result<Vec<Scene>, RunError>>()?;
    // Mistakes are found before anything is written.
    for (file, placement) in files_given.into_iter().zip(&mut placements) {
        for (k, scene) in scenes.iter().enumerate() {
            // Scenes of a data set share the vehicle: once is enough.
            let watcher: &dyn Watcher = if k == 0 { watcher } else { &Silent };
            let computing = Computing { watcher, ..computing.clone() };
            let given = Given::new(file, &scene.sensors()?, &scene.rules(), &computing);
            given.all([&mut *placement])?;
            Scanner::check(scene, placement, &scanning)?;
        }
    }
    request.check_gltf(&scenes, &placements)?;
    let facts: Vec<SceneFacts> = scenes.iter().map(|scene| request.facts(scene)).collect();
    let plans = request.plans(&scenes, &placements, &facts, computing)?;
    watcher.listen(GRACE);
    let mut work = ScanState::new(request, computing, &scenes);
    let mut sets = Vec::new();
    for (k, plan) in plans.iter().enumerate() {
        match work.one(plan, &plans[k + 1..])? {
            Some(set) => sets.push(set),
            None => {
                let others = match plans.len() - k - 1 {
                    0 => String::new(),
                    1 => " and another one was not looked at".to_owned(),
                    others => format!(" and {others} more were not looked at"),
                };
                watcher.note(&format!(
                    "stopped; {} is not complete{others}, the same command goes on",
                    plan.out.display()
                ));
                return Ok(None);
            }
        }
    }
    if let ([scene], [placement]) = (&scenes[..], &placements[..]) {
        request.write_gltf(scene, placement, || work.stage(0, false), watcher)?;
    }
    Ok(Some(sets))
}

/// The data set of one placement, before anything of it is written.
struct Plan<'a> {
    placement: &'a Placement,
    out: PathBuf,
    settings: DatasetSettings,
    facts: &'a [SceneFacts],
    /// Frames that are not there.
    missing: usize,
}

/// State that the scans of all placements share.
struct ScanState<'a> {
    request: &'a ScanRequest,
    computing: &'a Computing<'a>,
    scenes: &'a [Scene],
    /// Trees of each scene, kept while another scan needs them.
    stages: Vec<Option<Arc<Stage>>>,
    /// True once the engine that casts was named.
    told: bool,
}

impl<'a> ScanState<'a> {
    fn new(request: &'a ScanRequest, computing: &'a Computing<'a>, scenes: &'a [Scene]) -> Self {
        let stages = scenes.iter().map(|_| None).collect();
        Self { request, computing, scenes, stages, told: false }
    }

    /// Trees of the scene of a number, built the first time, kept if they are needed `again`.
    fn stage(&mut self, scene: usize, again: bool) -> Result<Arc<Stage>, ScanError> {
        let stage = match self.stages[scene].take() {
            Some(stage) => stage,
            None => Arc::new(Stage::new(&self.scenes[scene])?),
        };
        self.stages[scene] = again.then(|| stage.clone());
        Ok(stage)
    }

    /// The data set of one placement, others to follow; `None` if it was interrupted.
    fn one(&mut self, plan: &Plan<'_>, others: &[Plan<'_>]) -> Result<Option<Scanned>, RunError> {
        let start = Instant::now();
        let ahead: usize = others.iter().map(|plan| plan.missing).sum();
        let dataset = Dataset::create(&plan.out, &plan.settings, plan.facts)?;
        let dataset = dataset.ahead_of(ahead as u64);
        let again = ahead > 0 || self.request.gltf.is_some();
        let points_now = match self.frames_of(plan, &dataset, again) {
            Ok(Some(points)) => points,
            ended => {
                // An error that ended the run comes before one of `say_missing`.
                let said = dataset.say_missing();
                ended?;
                return said.map(|()| None).map_err(RunError::from);
            }
        };
        let summary = dataset.finish()?;
        let seconds = start.elapsed().as_secs_f64();
        self.computing.watcher.detail(&format!(
            "{points_now} points in {seconds:.2} s, {:.2} million a second",
            points_now as f64 / seconds / 1e6
        ));
        Ok(Some(Scanned {
            placement: plan.placement.name.clone(),
            out: plan.out.clone(),
            layout: self.request.layout.name(),
            scenes: summary.scenes,
            frames: summary.frames,
            points: summary.points,
            bytes: summary.bytes,
            points_now,
            seconds,
            threads: rayon::current_num_threads(),
        }))
    }

    /// Writes the frames that a data set lacks, and counts their points; `None` if it was interrupted. Names the engine
    /// the first time.
    fn frames_of(
        &mut self,
        plan: &Plan<'_>,
        dataset: &Dataset,
        again: bool,
    ) -> Result<Option<u64>, RunError> {
        let (watcher, scenes) = (self.computing.watcher, self.scenes);
        let missing: Vec<usize> =
            (0..scenes.len()).map(|scene| dataset.missing_of(scene).len()).collect();
        let bar = watcher.bar(missing.iter().sum::<usize>() as u64, Some("frames"));
        let points = AtomicU64::new(0);
        for (k, scene) in scenes.iter().enumerate() {
            if !watcher.goes_on() {
                return Ok(None);
            }
            if missing[k] == 0 {
                continue;
            }
            let (stage, scanning) = (self.stage(k, again)?, self.request.scanning());
            let mut scanner = Scanner::on(stage, scene, plan.placement, &scanning)?;
            let notes = scanner.cast_on(&self.computing.engine)?;
            if !std::mem::replace(&mut self.told, true) {
                notes.iter().for_each(|note| watcher.note(note));
            }
            let whole = record(dataset, k, &scanner, |scan| {
                points.fetch_add(scan.points().count() as u64, Ordering::Relaxed);
                bar.advance(1);
                watcher.goes_on()
            })?;
            if let Some(why) = scanner.device_failure() {
                watcher.note(&format!("{why}; the rest of `{}` was cast on the CPU", scene.name()));
            }
            if !whole {
                return Ok(None);
            }
        }
        Ok(Some(points.into_inner()))
    }
}

/// Scans to be written.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ScanRequest {
    /// Scene files; they must have geometry
    #[cfg_attr(feature = "cli", arg(value_name = "SCENE", required = true))]
    pub scenes: Vec<PathBuf>,
    /// File of placements, or one of them as FILE:NAME; several give a folder each
    #[cfg_attr(feature = "cli", arg(long, required = true, value_name = "PLACEMENTS"))]
    pub placement: Vec<String>,
    /// Folder to write
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
    /// Format: npz, semantickitti or nuscenes
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", default_value = "npz"))]
    pub layout: Layout,
    /// Geometry alone: every beam returns at once, without error, from what it meets
    #[cfg_attr(feature = "cli", arg(long))]
    pub ideal: bool,
    /// Weather or a fault, as fog:mor=50 or snow:rate=1; may be given several times
    ///
    /// Also rain:rate=5, wet:water=1, blur, crosstalk:share=0.01, echo:ratio=0.85, or with level=light|moderate|heavy.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME[:KEY=VALUE,…]"))]
    pub condition: Vec<Condition>,
    /// Seed of all that is left to chance
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 1, value_parser = super::parse::whole::<u64>))]
    pub seed: u64,
    /// First frames of each scene alone, at most so many
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
    /// Shares of the scenes for training, validation and tests
    #[cfg_attr(feature = "cli", arg(long, num_args = 3, value_names = ["TRAIN", "VAL", "TEST"], value_parser = super::parse::number_as("0.7")))]
    pub splits: Option<Vec<f64>>,
    /// nuscenes: of so many frames one is a keyframe, the others are sweeps [default: 5]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub keyframe_every: Option<u32>,
    /// nuscenes: rows of six cameras without pictures, which mmdetection3d asks for
    #[cfg_attr(feature = "cli", arg(long))]
    pub with_camera_stubs: bool,
    /// semantickitti, nuscenes: all LiDARs as one cloud only, not each by itself as well
    #[cfg_attr(feature = "cli", arg(long))]
    pub merged_only: bool,
    /// semantickitti, nuscenes: a class of the scenes that is to count as another, as lamp=pole
    #[cfg_attr(feature = "cli", arg(long, value_name = "CLASS=CLASS"))]
    pub map: Vec<String>,
    /// File for one frame with its points as binary glTF, and the frame.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub gltf: Option<(PathBuf, u32)>,
}

impl ScanRequest {
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

    /// Ideal beams or real ones, seed, weather and faults.
    fn scanning(&self) -> Scanning {
        Scanning { ideal: self.ideal, seed: self.seed, conditions: self.condition.clone() }
    }

    /// Frames and classes of a scene.
    fn facts(&self, scene: &Scene) -> SceneFacts {
        let frames = self.frames.map_or(usize::MAX, |frames| frames as usize);
        SceneFacts {
            name: scene.name().to_owned(),
            classes: scene.classes().to_vec(),
            frames: (0..scene.frame_count().min(frames)).collect(),
            split: None,
        }
    }

    /// A data set for each placement, whose folder is checked.
    fn plans<'a>(
        &self,
        scenes: &[Scene],
        placements: &'a [Placement],
        facts: &'a [SceneFacts],
        computing: &Computing<'_>,
    ) -> Result<Vec<Plan<'a>>, RunError> {
        let files = scenes.iter().map(|scene| Input::names_of(scene.files()));
        let files = files.collect::<Result<Vec<_>, _>>()?.concat();
        let mut names = FileNames::default();
        let mut plan = |placement: &'a Placement| {
            let out = match placements.len() {
                1 => self.out.clone(),
                _ => self.out.join(names.take(&placement.name, "")?),
            };
            let settings = self.settings(placement, files.clone(), computing)?;
            let missing = Dataset::check(&out, &settings, facts)?;
            Ok(Plan { placement, out, settings, facts, missing })
        };
        placements.iter().map(&mut plan).collect()
    }

    /// Settings that decide the bytes of a placement's data set.
    fn settings(
        &self,
        placement: &Placement,
        files: Vec<Input>,
        computing: &Computing<'_>,
    ) -> Result<DatasetSettings, RunError> {
        let mut map = Vec::new();
        for pair in &self.map {
            let Some((class, to)) = pair.split_once('=') else {
                return Err(RunError::Usage(format!(
                    "--map {pair}: write CLASS=CLASS, as lamp=pole"
                )));
            };
            map.push((class.to_owned(), to.to_owned()));
        }
        let splits = match self.splits.as_deref() {
            None => Splits::default(),
            Some(&[train, val, test]) => Splits { train, val, test },
            Some(_) => return Err(RunError::Usage("--splits: give three shares".to_owned())),
        };
        let usual = DatasetSettings::new(self.layout);
        let provenance = json!({
            "scenes": self.scenes,
            "vehicle": computing.vehicle,
            "placement": placement,
            "ideal": self.ideal,
            "seed": self.seed,
            "conditions": in_words(&self.condition),
            "sightline": env!("CARGO_PKG_VERSION"),
        });
        Ok(DatasetSettings {
            keyframe_every: self
                .keyframe_every
                .map_or(usual.keyframe_every, |every| every as usize),
            camera_stubs: self.with_camera_stubs,
            each_lidar: !self.merged_only,
            splits,
            seed: self.seed,
            map,
            files,
            provenance: provenance.to_string(),
            ..usual
        })
    }

    /// Checks that `--gltf` shows one frame of one scene, and that its file can be written.
    fn check_gltf(&self, scenes: &[Scene], placements: &[Placement]) -> Result<(), RunError> {
        let (Some((path, frame)), [scene, ..]) = (&self.gltf, scenes) else { return Ok(()) };
        if scenes.len() > 1 || placements.len() > 1 {
            return Err(RunError::Usage(format!(
                "--gltf {}: shows one scene and one placement; give one of each",
                path.display()
            )));
        }
        let frames = scene.frame_count();
        if *frame as usize >= frames {
            return Err(RunError::Usage(format!(
                "--frame {}: the scene `{}` has frames 0 to {}",
                frame,
                scene.name(),
                frames - 1
            )));
        }
        outputs::check_gltf(Some(path))
    }

    /// Writes the frame of `--gltf` with the points of its scan, cast into the trees that `stage` gives.
    fn write_gltf(
        &self,
        scene: &Scene,
        placement: &Placement,
        stage: impl FnOnce() -> Result<Arc<Stage>, ScanError>,
        watcher: &dyn Watcher,
    ) -> Result<(), RunError> {
        let Some((path, frame)) = &self.gltf else { return Ok(()) };
        let frame = *frame as usize;
        let scan = Scanner::on(stage()?, scene, placement, &self.scanning())?.scan(frame);
        let points: Vec<_> = scan.points().map(|point| (point.class, point.position)).collect();
        let placements = std::slice::from_ref(placement);
        let view = GltfView { scene, frame, placements, points: &points };
        outputs::write_gltf(Some(path), watcher, &view)
    }
}

/// All placements of files, or one by its name behind a colon, each with its file.
fn placements(given: &[String]) -> Result<Vec<(&Path, Placement)>, RunError> {
    let mut found: Vec<(&Path, Placement)> = Vec::new();
    for text in given {
        let file = Path::new(file_and_name(text).0);
        found.extend(named_placements(text)?.into_iter().map(|placement| (file, placement)));
    }
    for (k, (_, placement)) in found.iter().enumerate() {
        if found[..k].iter().any(|(_, other)| other.name == placement.name) {
            let name = &placement.name;
            return Err(RunError::Usage(format!(
                "--placement: `{name}` comes twice, and each is to have a folder of its own; rename one"
            )));
        }
    }
    Ok(found)
}
