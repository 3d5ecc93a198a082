//! `verify` and `bench`: engines beside each other, and the speed of a device.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::inputs::{Files, Given};
use super::{Computing, Conditions, RunError, opening};
use crate::engine::gpu::{GpuBackend, SelfTest, TestedAdapter, test_adapters};
use crate::engine::{Backend, BackendError, CpuBackend, EngineKind};
use crate::json::counted;
use crate::problem::Problem;
use crate::scan::conditions::in_words;
use crate::vehicle::{Placement, random_placements_by_the_rules, read_placements};
use crate::verify::{Verification, compared_frames, usual_placements, verify};

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
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct VerifyRequest {
    /// Scene files, and placements [default: Table 7 of the paper, random ones from the mount, and hostile
    /// ones]
    #[cfg_attr(feature = "cli", arg(value_name = "SCENE… [PLACEMENTS]", required = true))]
    pub files: Vec<PathBuf>,
    /// Frames to compare, spread evenly over the scene
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: u32,
    /// Random placements [default: 200]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = super::parse::whole::<usize>))]
    pub random: Option<usize>,
    /// Hostile placements: on voxel faces, along axes, in solids, underground, far away [default: 50]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = super::parse::whole::<usize>))]
    pub hostile: Option<usize>,
    /// Beams of the CPU reference that are compared with brute force in f64
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 20_000, value_parser = super::parse::whole::<u64>))]
    pub sample: u64,
    /// Seed of the random placements and of the sample
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 1, value_parser = super::parse::whole::<u64>))]
    pub seed: u64,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
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
        let (conditions, seconds) =
            (in_words(&request.conditions.condition), start.elapsed().as_secs_f64());
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
    let files = opening::files(&scenes, &request.conditions.condition, frames, computing);
    let job = opening::job(&files, computing)?.job;
    let problem = job.problem()?;
    let (random, hostile) = (request.random.unwrap_or(RANDOM), request.hostile.unwrap_or(HOSTILE));
    let usual = || usual_placements(&problem, random, hostile, request.seed);
    let placements = match given {
        Some((file, given)) => {
            let mut given = given.to_vec();
            Given::in_problem(file, &problem, computing).whole(&mut given)?;
            given
        }
        None => usual(),
    };
    let memory = computing.engine.memory_budget() / 2;
    let gpu = GpuBackend::open(problem.task().clone(), &computing.engine, memory);
    let mut gpu = gpu.map_err(needs_device)?;
    let steps = (placements.len() * compared_frames(&problem)) as u64;
    computing.watcher.note(&format!(
        "comparing {} × {} on {} with the CPU, then {} with f64",
        counted(placements.len(), "placement"),
        counted(compared_frames(&problem), "frame"),
        gpu.adapter(),
        counted(request.sample as usize, "beam")
    ));
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
fn needs_device(error: BackendError) -> RunError {
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

/// Random placements, hostile ones and beams of the verification of a scene.
const VERIFIED: (usize, usize, u64) = (100, 50, 20_000);
/// Seed of everything random.
const SEED: u64 = 1;

/// Files and settings of a measurement.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct DeviceBenchRequest {
    /// Scene files
    #[cfg_attr(feature = "cli", arg(value_name = "SCENE", required = true))]
    pub scenes: Vec<PathBuf>,
    /// Numbers of placements that are scored at once
    #[cfg_attr(feature = "cli", arg(long, value_name = "N,…", value_delimiter = ',', default_value = "12,256,4096", value_parser = clap::value_parser!(u32).range(1..=100_000)))]
    pub placements: Vec<u32>,
    /// Frames of each scene, spread evenly over it
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: u32,
    /// Rounds in which device and CPU take turns; the median counts
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000)))]
    pub rounds: u32,
}

/// A device measured in scene files. Its text is a block of Markdown.
#[derive(Debug, Serialize)]
pub struct DeviceBench {
    /// Version of this program.
    pub sightline: &'static str,
    /// Commit that it was built from, where `SIGHTLINE_COMMIT` said so at its build.
    pub commit: Option<&'static str>,
    /// Device and driver.
    pub adapter: String,
    /// Its answers to a table of arithmetic; none where the driver lists it no more.
    pub self_test: Option<SelfTest>,
    /// Threads of the CPU beside it.
    pub threads: usize,
    /// Frames of each scene that were scored.
    pub frames: u32,
    /// Results scene by scene.
    pub scenes: Vec<SceneBench>,
}

/// A device measured in one scene.
#[derive(Debug, Serialize)]
pub struct SceneBench {
    /// Name of the scene.
    pub scene: String,
    /// Device against CPU reference, and that against f64.
    pub verification: Verification,
    /// Speed for each number of placements.
    pub speeds: Vec<Speed>,
}

/// Placements × frames a second.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Speed {
    /// Placements scored at once.
    pub placements: usize,
    /// By the device.
    pub gpu: f64,
    /// By the CPU.
    pub cpu: f64,
    /// Share of the time in which the device worked, as it says itself.
    pub busy: f64,
}

impl DeviceBench {
    /// True if device and CPU gave the same bits in every scene, and the device passed its self-test.
    pub fn passed(&self) -> bool {
        self.scenes.iter().all(|scene| scene.verification.passed)
            && self.self_test.as_ref().is_none_or(|test| test.passed)
    }
}

/// Measures a device in scene after scene.
///
/// # Errors
/// The CPU in place of a device, files that cannot be read, no device, an interruption.
pub fn bench_device(
    request: &DeviceBenchRequest,
    computing: &Computing<'_>,
) -> Result<DeviceBench, RunError> {
    if computing.engine.kind == EngineKind::Cpu {
        let words =
            "--backend cpu: a Vulkan device is measured, the CPU only beside it; leave it out";
        return Err(RunError::Usage(words.to_owned()));
    }
    let Files { scenes, placements } = Files::sort(&request.scenes, computing.watcher)?;
    if let Some(file) = placements {
        let file = file.display();
        return Err(RunError::Usage(format!("{file}: holds placements; give scene files alone")));
    }
    let mut adapter = String::new();
    let mut found = Vec::new();
    for path in &scenes {
        let (device, scene) = bench_of_scene(path, request, computing)?;
        adapter = device;
        found.push(scene);
    }
    let is_same = |tested: &TestedAdapter| adapter.starts_with(&tested.summary.name);
    let tested = test_adapters().into_iter().find(is_same);
    Ok(DeviceBench {
        sightline: env!("CARGO_PKG_VERSION"),
        commit: option_env!("SIGHTLINE_COMMIT"),
        self_test: tested.and_then(|tested| tested.self_test),
        adapter,
        threads: rayon::current_num_threads(),
        frames: request.frames,
        scenes: found,
    })
}

/// Device and results in one scene.
fn bench_of_scene(
    path: &Path,
    request: &DeviceBenchRequest,
    computing: &Computing<'_>,
) -> Result<(String, SceneBench), RunError> {
    let files = opening::files(&[path.to_owned()], &[], Some(request.frames), computing);
    let job = opening::job(&files, computing)?.job;
    let memory = computing.engine.memory_budget() / 2;
    let open = |task: &_| {
        let gpu = GpuBackend::open(Clone::clone(task), &computing.engine, memory);
        gpu.map_err(needs_device)
    };
    let rounds = (1 + request.rounds as usize) * request.placements.len();
    let bar = computing.watcher.bar(1 + rounds as u64, Some("measurements"));
    let one = job.clone().frames(Some(1)).problem()?;
    let (random, hostile, sample) = VERIFIED;
    let usual = usual_placements(&one, random, hostile, SEED);
    let mut gpu = open(one.task())?;
    let verification = verify(&one, &mut gpu, &usual, sample, SEED, &|| {});
    let verification = verification.map_err(needs_device)?;
    drop(gpu);
    bar.advance(1);
    let problem = job.problem()?;
    let mut gpu = open(problem.task())?;
    let mut cpu = CpuBackend::new(problem.task().clone(), memory);
    let mut speeds = Vec::new();
    for &count in &request.placements {
        let batch = random_placements_by_the_rules(problem.constraints(), count as usize, SEED);
        let turn = || {
            bar.advance(1);
            match computing.watcher.goes_on() {
                true => Ok(()),
                false => Err(RunError::Interrupted("interrupted: nothing is printed".to_owned())),
            }
        };
        speeds.push(speed(&problem, &batch, request.rounds as usize, (&mut gpu, &mut cpu), &turn)?);
    }
    let adapter = gpu.adapter().to_owned();
    Ok((adapter, SceneBench { scene: job.scene().name().to_owned(), verification, speeds }))
}

/// Speed of device and CPU at a batch; `turn` is called before each round.
fn speed(
    problem: &Problem,
    batch: &[Placement],
    rounds: usize,
    (gpu, cpu): (&mut GpuBackend, &mut CpuBackend),
    turn: &dyn Fn() -> Result<(), RunError>,
) -> Result<Speed, RunError> {
    let work = (batch.len() * problem.frame_count()) as f64;
    let (mut on_gpu, mut on_cpu, mut busy) = (Vec::new(), Vec::new(), Vec::new());
    // The first round warms up.
    for round in 0..=rounds {
        turn()?;
        let worked = gpu.traffic().busy;
        let timed = |engine: &mut dyn Backend| {
            let start = Instant::now();
            engine.tally(batch, None).map_err(needs_device)?;
            Ok::<_, RunError>(start.elapsed().as_secs_f64())
        };
        let took = [timed(gpu)?, timed(cpu)?];
        if round > 0 {
            busy.push((gpu.traffic().busy - worked).as_secs_f64() / took[0]);
            on_gpu.push(work / took[0]);
            on_cpu.push(work / took[1]);
        }
    }
    let placements = batch.len();
    Ok(Speed { placements, gpu: median(on_gpu), cpu: median(on_cpu), busy: median(busy) })
}

/// Median, the upper one of two; 0 of no rates.
fn median(mut rates: Vec<f64>) -> f64 {
    rates.sort_by(f64::total_cmp);
    rates.get(rates.len() / 2).copied().unwrap_or(0.0)
}

impl fmt::Display for DeviceBench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (version, threads, frames) = (self.sightline, self.threads, self.frames);
        writeln!(f, "### {}\n", self.adapter)?;
        let commit = self.commit.map_or(String::new(), |commit| format!(", commit {commit}"));
        writeln!(f, "sightline {version}{commit}; {threads} threads of the CPU beside it.\n")?;
        if let Some(test) = &self.self_test {
            let [outcome, sums, division, denormals] = test.words();
            writeln!(
                f,
                "Self-test: {outcome}; product + sum: {sums}; division: {division}; denormals: {denormals}.\n"
            )?;
        }
        writeln!(f, "| scene | beams | differing | voxels | differing | scores | differing |")?;
        writeln!(f, "|---|--:|--:|--:|--:|--:|--:|")?;
        for SceneBench { scene, verification, .. } in &self.scenes {
            let found = &verification.gpu_against_cpu;
            let beams = found.triangles.max(found.distances);
            writeln!(
                f,
                "| {scene} | {} | {beams} | {} | {} | {} | {} |",
                found.beams,
                found.voxels,
                found.differing_voxels,
                found.scores,
                found.differing_scores
            )?;
        }
        writeln!(
            f,
            "\nPlacements × frames a second, {}, device / CPU (share of the time that the device worked):\n",
            counted(frames as usize, "frame")
        )?;
        let counts = self.scenes.first().map_or(&[][..], |scene| &scene.speeds);
        let titles: Vec<String> = counts.iter().map(|speed| speed.placements.to_string()).collect();
        writeln!(f, "| scene | {} |", titles.join(" | "))?;
        writeln!(f, "|---|{}", "--:|".repeat(titles.len()))?;
        for SceneBench { scene, speeds, .. } in &self.scenes {
            let cells = speeds.iter().map(|speed| {
                let Speed { gpu, cpu, busy, .. } = speed;
                format!("{gpu:.0} / {cpu:.0} ({:.0} %)", 100.0 * busy)
            });
            writeln!(f, "| {scene} | {} |", cells.collect::<Vec<_>>().join(" | "))?;
        }
        Ok(())
    }
}
