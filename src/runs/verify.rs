//! The GPU against the CPU reference bit by bit, and the reference against `f64`, in scene files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::given::Given;
use super::inputs::Files;
use super::{Computing, RunError, opening};
use crate::engine::gpu::{GpuBackend, SelfTest};
use crate::engine::{BackendError, EngineKind};
use crate::scan::conditions::{Condition, in_words};
use crate::vehicle::{Placement, read_placements};
use crate::verify::compare::compared_frames;
use crate::verify::placements::usual_placements;
use crate::verify::{Verification, verify};

/// Random placements by default.
const RANDOM: usize = 200;
/// Hostile placements by default.
const HOSTILE: usize = 50;

/// Most random placements, and most hostile ones.
const MOST_PLACEMENTS: usize = 100_000;
/// Most beams of the sample: each is held until all are explained.
const MOST_BEAMS: u64 = 10_000_000;

/// Files and settings of a verification.
#[derive(Debug, Clone)]
pub struct VerifyRequest {
    /// Scene files, and placements; without them usual and hostile ones.
    pub files: Vec<PathBuf>,
    /// Frames to compare.
    pub frames: u32,
    /// Random placements; 200 if none is given.
    pub random: Option<usize>,
    /// Hostile placements; 50 if none is given.
    pub hostile: Option<usize>,
    /// Beams of the CPU reference that are compared with brute force in `f64`.
    pub sample: u64,
    /// Seed of random and hostile placements, and of the sample.
    pub seed: u64,
    /// Weather and faults under which covered voxels and sums are compared; hits are those of clear air.
    pub conditions: Vec<Condition>,
}

/// Result of a verification in one scene.
#[derive(Debug, Serialize)]
pub struct Verified {
    /// Name of the scene.
    pub scene: String,
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Result of the comparisons.
    #[serde(flatten)]
    pub found: Verification,
    /// Time that it took.
    pub seconds: f64,
}

/// Verifies scene after scene, and calls `each` with every result.
///
/// # Errors
/// The CPU in place of a device, files that cannot be read, numbers of placements beside a file of them, no device, and
/// errors of `each`.
pub fn verify_scenes(
    request: &VerifyRequest,
    computing: &Computing<'_>,
    mut each: impl FnMut(&Verified) -> Result<(), RunError>,
) -> Result<Vec<Verified>, RunError> {
    if computing.engine.kind == EngineKind::Cpu {
        return Err(RunError::Usage(
            "--backend cpu: a Vulkan device is compared with the CPU, which alone is compared with nothing; leave \
             it out, or pick a device with --adapter"
                .to_owned(),
        ));
    }
    request.check()?;
    let Files { scenes, placements } = Files::sort(&request.files, computing.watcher)?;
    let read = match &placements {
        Some(path) if request.random.or(request.hostile).is_some() => {
            return Err(RunError::Usage(format!(
                "{}: holds the placements; leave out --random and --hostile, or this file",
                path.display()
            )));
        }
        Some(path) => Some(read_placements(path)?),
        None => None,
    };
    let given = placements.as_deref().zip(read.as_deref());
    let mut all = Vec::new();
    for path in &scenes {
        let start = Instant::now();
        let (scene, found) = of_scene(path, given, request, computing)?;
        let (conditions, seconds) = (in_words(&request.conditions), start.elapsed().as_secs_f64());
        all.push(Verified { scene, conditions, found, seconds });
        each(&all[all.len() - 1])?;
    }
    Ok(all)
}

impl VerifyRequest {
    /// Refuses numbers that no memory holds.
    fn check(&self) -> Result<(), RunError> {
        let placements = MOST_PLACEMENTS as u64;
        let asked = |count: Option<usize>| count.map_or(0, |count| count as u64);
        for (option, count, most) in [
            ("--random", asked(self.random), placements),
            ("--hostile", asked(self.hostile), placements),
            ("--sample", self.sample, MOST_BEAMS),
        ] {
            if count > most {
                return Err(RunError::Usage(format!("{option} {count}: give at most {most}")));
            }
        }
        Ok(())
    }
}

/// Verifies one scene; returns its name, too.
fn of_scene(
    path: &Path,
    given: Option<(&Path, &[Placement])>,
    request: &VerifyRequest,
    computing: &Computing<'_>,
) -> Result<(String, Verification), RunError> {
    let (frames, scenes) = (Some(request.frames), [path.to_owned()]);
    let files = opening::files(&scenes, &request.conditions, frames, computing);
    let job = opening::job(&files, computing)?.job;
    let problem = job.problem()?;
    let (random, hostile) = (request.random.unwrap_or(RANDOM), request.hostile.unwrap_or(HOSTILE));
    let usual = || usual_placements(&problem, random, hostile, request.seed);
    let placements = match given {
        Some((file, given)) => {
            let mut given = given.to_vec();
            Given::in_problem(file, &problem, computing).all(&mut given)?;
            given
        }
        None => usual(),
    };
    let memory = computing.engine.memory_budget() / 2;
    let gpu = GpuBackend::open(problem.task().clone(), (&computing.engine).into(), memory);
    let mut gpu = gpu.map_err(needs_device)?;
    let steps = (placements.len() * compared_frames(&problem)) as u64;
    let bar = computing.watcher.bar(steps, Some("placements × frames"));
    let done = || bar.advance(1);
    let found = verify(&problem, &mut gpu, &placements, request.sample, request.seed, &done);
    let mut found = found.map_err(needs_device)?;
    if found.gpu_against_cpu.any() {
        found.causes = causes(&gpu.self_test().map_err(needs_device)?);
    }
    Ok((job.scene().name().to_owned(), found))
}

/// Causes of a difference between device and CPU, a sentence each.
fn causes(test: &SelfTest) -> Vec<String> {
    match &test.causes[..] {
        [] => {
            let [_, sums, division, denormals] = test.words();
            vec![format!(
                "the device's arithmetic is right where kernels depend on it (self-test passed; product + sum {sums}, \
                 division {division}, denormals {denormals}), so its compiler changes a kernel otherwise: please report \
                 it with device and driver"
            )]
        }
        causes => causes.to_vec(),
    }
}

/// The error of a missing or failed device: elsewhere the CPU takes over, here it cannot.
pub(super) fn needs_device(error: BackendError) -> RunError {
    match error {
        BackendError::NoDevice { name } => {
            let named = name.map(|name| format!(" named `{name}`")).unwrap_or_default();
            RunError::Usage(format!(
                "no Vulkan device{named}, and there is nothing else to compare with the CPU; install a driver, such \
                 as lavapipe, which needs no hardware"
            ))
        }
        BackendError::Device { adapter, stage, message } => RunError::Usage(format!(
            "the device `{adapter}` failed at {stage}: {message}; pick another one with --adapter"
        )),
        other => other.into(),
    }
}
