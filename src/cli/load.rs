use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use sightline::engine::CpuBackend;
use sightline::engine::gpu::GpuBackend;
use sightline::engine::{Backend, BackendError, Failover};
use sightline::problem::Problem;
use sightline::psog::{BuildReport, Psog, Roi, read_psog};
use sightline::scan::scan_scene;
use sightline::scene::{Lidar, Mount, PsogSource, ScanSettings, Scene};
use sightline::search::Evaluator;
use sightline::vehicle::{BeamTable, Constraints, Ties};

use super::args::{BackendChoice, Compute, Talk};
use super::error::Error;
use super::progress;

/// Seconds until scoring could begin.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadTimes {
    /// Reading files.
    pub load: f64,
    /// P-SOG, trees, device.
    pub build: f64,
}

/// A scene ready to be scored.
pub struct Loaded {
    pub scene: Scene,
    pub evaluator: Evaluator,
    pub psog: Arc<Psog>,
    pub times: LoadTimes,
}

impl Loaded {
    /// Every file that was read for the scene, and one beside them.
    pub fn inputs<'a>(&'a self, placements: &'a Path) -> impl Iterator<Item = &'a Path> {
        self.scene.files().iter().map(PathBuf::as_path).chain([placements])
    }
}

/// Reads a scene and its P-SOG, and opens a backend over `frames` of its frames (all if `None`).
pub fn scene(path: &Path, frames: Option<u32>, compute: &Compute) -> Result<Loaded, Error> {
    let (scene, psog, mut times) = scene_and_psog(path, compute.talk)?;
    let start = Instant::now();
    let frames = spread(scene.frame_count(), frames);
    let evaluator = evaluator(&scene, &psog, &frames, compute)?;
    times.build += start.elapsed().as_secs_f64();
    Ok(Loaded { scene, evaluator, psog, times })
}

/// Reads a scene and says what in it is most likely not meant.
pub fn read(path: &Path, talk: Talk) -> Result<Scene, Error> {
    let scene = Scene::read(path)?;
    scene.notes().iter().for_each(|note| talk.note(note));
    Ok(scene)
}

/// Reads a scene and reads or builds its P-SOG.
pub fn scene_and_psog(path: &Path, talk: Talk) -> Result<(Scene, Arc<Psog>, LoadTimes), Error> {
    let start = Instant::now();
    let scene = read(path, talk)?;
    let file = psog_file(&scene)?;
    let load = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let psog = match file {
        Some(psog) => psog,
        None => build_psog(&scene, talk)?.0,
    };
    let same = |&count: &u16| count == 0 || u32::from(count) == psog.frames();
    if psog.counts().iter().all(same) {
        talk.note(format!(
            "the P-SOG tells nothing: each voxel is the same in all of its {} frame(s), so that every \
             entropy is 0; give it frames in which something moves",
            psog.frames()
        ));
    }
    let times = LoadTimes { load, build: start.elapsed().as_secs_f64() };
    Ok((scene, Arc::new(psog), times))
}

/// Reads a scene for its geometry in one frame; its P-SOG is not needed and stays empty.
pub fn geometry(path: &Path, frame: u32, compute: &Compute) -> Result<Loaded, Error> {
    let start = Instant::now();
    let scene = read(path, compute.talk)?;
    if !scene.has_geometry() {
        return Err(Error::Usage(format!(
            "{}: has no geometry to cast into; add static shapes, actors or an ego body",
            path.display()
        )));
    }
    let (frame, frames) = (frame as usize, scene.frame_count());
    if frame >= frames {
        return Err(Error::Usage(format!(
            "{}: there is no frame {frame}; give --frame 0 to {}",
            path.display(),
            frames - 1
        )));
    }
    let psog = Psog::new(roi_of(&scene)?, 1, scene.classes().to_vec(), vec![], vec![])?;
    let psog = Arc::new(psog);
    let load = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let evaluator = evaluator(&scene, &psog, &[frame], compute)?;
    let times = LoadTimes { load, build: start.elapsed().as_secs_f64() };
    Ok(Loaded { scene, evaluator, psog, times })
}

/// A scene's problem without a backend.
pub struct Posed {
    pub name: String,
    pub problem: Problem,
    pub constraints: Constraints,
}

/// Reads a scene and its P-SOG and puts the problem over `frames` of its frames together.
pub fn problem(path: &Path, frames: u32, talk: Talk) -> Result<Posed, Error> {
    let scene = read(path, talk)?;
    let psog = match psog_file(&scene)? {
        Some(psog) => psog,
        None => build_psog(&scene, talk)?.0,
    };
    note_frames(&scene, Some(frames), talk);
    let frames = spread(scene.frame_count(), Some(frames));
    let problem = problem_of(&scene, &psog, beam_table(scene.lidar())?, &frames)?;
    Ok(Posed { name: scene.name().to_owned(), problem, constraints: constraints(scene.mount()) })
}

/// The problem of a scene over the given frames.
pub fn problem_of(
    scene: &Scene,
    psog: &Psog,
    table: BeamTable,
    frames: &[usize],
) -> Result<Problem, Error> {
    Problem::from_scene(scene, psog, table, frames).map_err(|source| {
        let psog = match scene.psog_source() {
            PsogSource::File(file) => Some(file),
            PsogSource::Scan(_) => None,
        };
        let files = scene.files().iter().take(1).chain(psog);
        let files: Vec<String> = files.map(|file| file.display().to_string()).collect();
        Error::Problem { files: files.join(" and "), source }
    })
}

/// Says where `--frames` asks for more than there are.
pub fn note_frames(scene: &Scene, wanted: Option<u32>, talk: Talk) {
    let count = scene.frame_count();
    if let Some(wanted) = wanted.filter(|wanted| *wanted as usize > count) {
        talk.note(format!("--frames {wanted}: the scene has {count}; all of them are used"));
    }
}

/// An evaluator of a scene over the given frames.
pub fn evaluator(
    scene: &Scene,
    psog: &Psog,
    frames: &[usize],
    compute: &Compute,
) -> Result<Evaluator, Error> {
    let problem = Arc::new(problem_of(scene, psog, beam_table(scene.lidar())?, frames)?);
    evaluator_of(problem, constraints(scene.mount()), compute)
}

/// An evaluator of a problem.
pub fn evaluator_of(
    problem: Arc<Problem>,
    constraints: Constraints,
    compute: &Compute,
) -> Result<Evaluator, Error> {
    let budget = compute.memory_budget();
    compute.talk.detail(problem.modelled().to_string());
    compute.talk.detail(format!(
        "scene and P-SOG take {} MiB, work buffers at most {} MiB",
        problem.bytes() >> 20,
        budget >> 20
    ));
    let backend = open_backend(&problem, budget, compute)?;
    Ok(Evaluator::new(problem, backend, constraints))
}

/// The backend asked for; a device that is lost while it computes is replaced.
pub fn open_backend(
    problem: &Arc<Problem>,
    budget: u64,
    compute: &Compute,
) -> Result<Box<dyn Backend>, Error> {
    let gpu = || -> Result<Box<dyn Backend>, BackendError> {
        let gpu = GpuBackend::new(problem.clone(), compute.adapter.as_deref(), budget)?;
        if gpu.is_software() && compute.backend == BackendChoice::Auto {
            compute.talk.note(
                "the only Vulkan device is a program on the host; --backend cpu gives the same bits \
                 sooner",
            );
        }
        Ok(surviving(doomed(gpu), problem, budget, compute))
    };
    let cpu = || Box::new(CpuBackend::new(problem.clone(), budget));
    // A device asked for by name is not silently replaced.
    let backend: Box<dyn Backend> = match compute.backend {
        BackendChoice::Cpu => cpu(),
        BackendChoice::Gpu => gpu()?,
        BackendChoice::Auto if compute.adapter.is_some() => gpu()?,
        BackendChoice::Auto => match gpu() {
            Ok(gpu) => gpu,
            Err(error) => {
                compute.talk.note(format!("computing on the CPU: {error}"));
                return Ok(cpu());
            }
        },
    };
    compute.talk.note(format!("computing on {}: {}", backend.name(), backend.adapter()));
    Ok(backend)
}

/// A device's backend with others to take its place.
fn surviving(
    gpu: GpuBackend,
    problem: &Arc<Problem>,
    budget: u64,
    compute: &Compute,
) -> Box<dyn Backend> {
    let (adapter, talk) = (compute.adapter.clone(), compute.talk);
    let (for_gpu, for_cpu) = (problem.clone(), problem.clone());
    let reopen = move || -> Result<Box<dyn Backend>, BackendError> {
        Ok(Box::new(GpuBackend::new(for_gpu.clone(), adapter.as_deref(), budget)?))
    };
    let cpu = move || -> Box<dyn Backend> { Box::new(CpuBackend::new(for_cpu.clone(), budget)) };
    let note = move |line: &str| talk.note(line);
    let failover = Failover::new(Box::new(gpu), Box::new(reopen), cpu, note);
    let is_asked_for = compute.backend == BackendChoice::Gpu || compute.adapter.is_some();
    Box::new(if is_asked_for { failover } else { failover.take_what_is_too_large() })
}

/// A drill: `SIGHTLINE_LOSE_DEVICE_AFTER=N` destroys the first device after N batches, so that anybody
/// can see what a run does then.
fn doomed(mut gpu: GpuBackend) -> GpuBackend {
    let batches = std::env::var("SIGHTLINE_LOSE_DEVICE_AFTER").ok();
    if let Some(batches) = batches.and_then(|text| text.parse().ok()) {
        gpu.lose_device_after(batches);
    }
    gpu
}

/// The P-SOG file that the scene names, if it names one.
fn psog_file(scene: &Scene) -> Result<Option<Psog>, Error> {
    match scene.psog_source() {
        PsogSource::File(path) => {
            let psog = read_psog(path)?;
            scene.check_detection(psog.classes())?;
            Ok(Some(psog))
        }
        PsogSource::Scan(_) => Ok(None),
    }
}

/// Builds the P-SOG of a scene with geometry from virtual scans.
pub fn build_psog(scene: &Scene, talk: Talk) -> Result<(Psog, BuildReport), Error> {
    let settings = match scene.psog_source() {
        PsogSource::Scan(settings) => *settings,
        PsogSource::File(_) => ScanSettings::default_of(scene),
    };
    let bar = progress::bar(scene.frame_count() as u64, "frames scanned for the P-SOG", talk);
    let built = scan_scene(scene, &roi_of(scene)?, &settings, || bar.inc(1))?;
    bar.finish_and_clear();
    Ok(built)
}

/// The scene's region of interest as a grid.
pub fn roi_of(scene: &Scene) -> Result<Roi, Error> {
    let bounds = scene.roi();
    Ok(Roi::new(bounds.min, bounds.voxel, bounds.shape)?)
}

/// The scene's sensor as a beam table.
pub fn beam_table(lidar: &Lidar) -> Result<BeamTable, Error> {
    Ok(match lidar {
        Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, range } => {
            let channels: Vec<(f64, f64)> =
                elevations.iter().copied().zip(azimuth_offsets.iter().copied()).collect();
            BeamTable::spinning(&channels, *azimuth_steps, *range)?
        }
        Lidar::Directions { directions, range } => {
            BeamTable::from_directions(directions.iter().map(|&d| d.into()), *range)?
        }
    })
}

/// The mount's rules.
pub fn constraints(mount: &Mount) -> Constraints {
    let angles = [mount.roll, mount.pitch, mount.yaw];
    let bound = |side: usize, corner: [f64; 3]| {
        let [x, y, z] = corner;
        [x, y, z, angles[0][side], angles[1][side], angles[2][side]]
    };
    Constraints {
        lower: bound(0, mount.min),
        upper: bound(1, mount.max),
        min_distance: mount.min_distance,
        lidars: mount.lidars as usize,
        keep_out: mount.keep_out.clone(),
        ties: Ties { equal_height: mount.equal_height, symmetric: mount.symmetric },
    }
}

/// `wanted` of `count` frames, spread evenly from the first on; all of them if `None`.
pub fn spread(count: usize, wanted: Option<u32>) -> Vec<usize> {
    let wanted = wanted.map_or(count, |w| (w as usize).min(count));
    (0..wanted).map(|k| k * count / wanted).collect()
}

/// The coverage as the scene file spells it.
pub fn coverage_name(problem: &Problem) -> &'static str {
    if problem.ends_at_hits() { "first-hit" } else { "through" }
}
