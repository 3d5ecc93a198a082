//! Labelled scans of placements, written as data sets, gone on with after an interruption.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use serde::Serialize;
use serde_json::json;

use super::inputs::named_placements;
use super::{Computing, Error, glb, opening};
use crate::engine::scanning_on;
use crate::export::{
    Dataset, DatasetSettings, GltfView, Input, Layout, SceneFacts, Splits, record,
};
use crate::scan::conditions::Condition;
use crate::scan::{Scanner, Scanning};
use crate::scene::Scene;
use crate::vehicle::Placement;

/// Scans to be written.
#[derive(Debug, Clone)]
pub struct ScanRequest {
    /// Scene files with geometry.
    pub scenes: Vec<PathBuf>,
    /// Files of placements, perhaps with a name behind a colon; several placements get a folder each.
    pub placements: Vec<String>,
    /// Folder to write.
    pub out: PathBuf,
    /// Format.
    pub layout: Layout,
    /// How a rig scans.
    pub scanning: Scanning,
    /// First frames of each scene alone; all if none.
    pub frames: Option<u32>,
    /// Shares of the scenes for training, validation and tests.
    pub splits: Splits,
    /// nuScenes: of so many frames one is a keyframe.
    pub keyframe_every: usize,
    /// nuScenes: rows of cameras without pictures.
    pub camera_stubs: bool,
    /// Whether each LiDAR has a cloud of its own, too.
    pub each_lidar: bool,
    /// Classes that count as another, as `lamp=pole`.
    pub map: Vec<String>,
    /// Whether fog, snow and crosstalk have labels as in Robo3D.
    pub robo3d_labels: bool,
    /// File for one frame with its points as binary glTF, and the frame.
    pub gltf: Option<(PathBuf, u32)>,
}

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

/// Scans every placement in every scene; nothing if the watcher stopped it, whose next call goes on.
///
/// # Errors
/// Files that cannot be read or written, placements of one name, as of [`Scanner::new`], of [`Dataset::create`] and of
/// the engine.
pub fn scan(
    request: &ScanRequest,
    computing: &Computing<'_>,
) -> Result<Option<Vec<Scanned>>, Error> {
    let watcher = computing.watcher;
    watcher.listen();
    let placements = placements(&request.placements)?;
    let read = |path: &PathBuf| opening::read(path, computing.vehicle.as_deref(), watcher);
    let scenes = request.scenes.iter().map(read).collect::<Result<Vec<Scene>, Error>>()?;
    // All that may be wrong is found before anything is written.
    for placement in &placements {
        for scene in &scenes {
            Scanner::check(scene, placement, &request.scanning)?;
        }
    }
    request.check_gltf(&scenes, &placements)?;
    let facts: Vec<SceneFacts> = scenes.iter().map(|scene| request.facts(scene)).collect();
    let files = scenes.iter().map(Input::names_of).collect::<Result<Vec<_>, _>>()?.concat();
    let mut plans = Vec::new();
    for placement in &placements {
        let out = match placements.len() {
            1 => request.out.clone(),
            _ => request.out.join(&placement.name),
        };
        let settings = request.settings(placement, files.clone(), computing)?;
        Dataset::check(&out, &settings, &facts)?;
        plans.push(Plan { placement, out, settings, facts: &facts });
    }
    let (mut sets, mut told) = (Vec::new(), false);
    for (k, plan) in plans.iter().enumerate() {
        match one(request, computing, plan, &scenes, &mut told)? {
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
    request.write_gltf(&scenes, &placements, computing)?;
    Ok(Some(sets))
}

/// The data set of one placement, before anything of it is written.
struct Plan<'a> {
    placement: &'a Placement,
    out: PathBuf,
    settings: DatasetSettings,
    facts: &'a [SceneFacts],
}

/// The data set of one placement; `None` if it was interrupted. Which engine casts is said the first time.
fn one(
    request: &ScanRequest,
    computing: &Computing<'_>,
    plan: &Plan<'_>,
    scenes: &[Scene],
    told: &mut bool,
) -> Result<Option<Scanned>, Error> {
    let start = Instant::now();
    let dataset = Dataset::create(&plan.out, &plan.settings, plan.facts)?;
    let points_now = match frames_of(request, computing, plan, scenes, &dataset, told) {
        Ok(Some(points)) => points,
        ended => {
            // Of an error that ended the run, the first is told.
            let said = dataset.say_missing();
            ended?;
            return said.map(|()| None).map_err(Error::from);
        }
    };
    let summary = dataset.finish()?;
    let seconds = start.elapsed().as_secs_f64();
    computing.watcher.detail(&format!(
        "{points_now} points in {seconds:.2} s, {:.2} million a second",
        points_now as f64 / seconds / 1e6
    ));
    Ok(Some(Scanned {
        placement: plan.placement.name.clone(),
        out: plan.out.clone(),
        layout: request.layout.name(),
        scenes: summary.scenes,
        frames: summary.frames,
        points: summary.points,
        bytes: summary.bytes,
        points_now,
        seconds,
        threads: rayon::current_num_threads(),
    }))
}

/// Writes the frames that a data set lacks, and counts their points; `None` if it was interrupted.
fn frames_of(
    request: &ScanRequest,
    computing: &Computing<'_>,
    plan: &Plan<'_>,
    scenes: &[Scene],
    dataset: &Dataset,
    told: &mut bool,
) -> Result<Option<u64>, Error> {
    let watcher = computing.watcher;
    let frames: usize = (0..scenes.len()).map(|scene| dataset.missing_of(scene).len()).sum();
    let bar = watcher.bar(frames as u64, Some("frames"));
    let points = AtomicU64::new(0);
    for (k, scene) in scenes.iter().enumerate() {
        if !watcher.goes_on() {
            return Ok(None);
        }
        if dataset.missing_of(k).is_empty() {
            continue;
        }
        let mut scanner = Scanner::new(scene, plan.placement, &request.scanning)?;
        let notes = scanning_on(&mut scanner, &computing.engine)?;
        if !std::mem::replace(told, true) {
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

impl ScanRequest {
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
        let (Some((path, frame)), [scene, ..]) = (&self.gltf, scenes) else { return Ok(()) };
        if scenes.len() > 1 || placements.len() > 1 {
            return Err(Error::Usage(format!(
                "--gltf {}: shows one scene and one placement; give one of each",
                path.display()
            )));
        }
        let frames = scene.frame_count();
        if *frame as usize >= frames {
            return Err(Error::Usage(format!(
                "--frame {}: the scene `{}` has frames 0 to {}",
                frame,
                scene.name(),
                frames - 1
            )));
        }
        glb::check(Some(path), scene.files().iter().map(PathBuf::as_path))
    }

    /// Writes the frame of `--gltf` with the points of its scan.
    fn write_gltf(
        &self,
        scenes: &[Scene],
        placements: &[Placement],
        computing: &Computing<'_>,
    ) -> Result<(), Error> {
        let (Some((path, frame)), [scene], [placement]) = (&self.gltf, scenes, placements) else {
            return Ok(());
        };
        let scan = Scanner::new(scene, placement, &self.scanning)?.scan(*frame as usize);
        let points: Vec<_> = scan.points().map(|point| (point.class, point.position)).collect();
        let frame = *frame as usize;
        let view = GltfView { scene, frame, placements, points: &points };
        glb::write(Some(path), computing.watcher, &view)
    }

    fn settings(
        &self,
        placement: &Placement,
        files: Vec<Input>,
        computing: &Computing<'_>,
    ) -> Result<DatasetSettings, Error> {
        let mut map = Vec::new();
        for pair in &self.map {
            let Some((class, to)) = pair.split_once('=') else {
                return Err(Error::Usage(format!("--map {pair}: write CLASS=CLASS, as lamp=pole")));
            };
            map.push((class.to_owned(), to.to_owned()));
        }
        let Scanning { ideal, seed, conditions } = &self.scanning;
        let conditions: Vec<String> = conditions.iter().map(Condition::to_string).collect();
        let provenance = json!({
            "scenes": self.scenes,
            "vehicle": computing.vehicle,
            "placement": placement,
            "ideal": ideal,
            "seed": seed,
            "conditions": conditions,
            "sightline": env!("CARGO_PKG_VERSION"),
        });
        Ok(DatasetSettings {
            keyframe_every: self.keyframe_every,
            camera_stubs: self.camera_stubs,
            each_lidar: self.each_lidar,
            splits: self.splits,
            seed: *seed,
            map,
            robo3d_labels: self.robo3d_labels,
            files,
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
