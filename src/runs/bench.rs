//! A Vulkan device measured in scene files: its self-test, its bits beside those of the CPU, and its speed.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::inputs::Files;
use super::verify::needs_device;
use super::{Computing, RunError, opening};
use crate::engine::gpu::{GpuBackend, SelfTest, TestedAdapter, test_adapters};
use crate::engine::{Backend, CpuBackend, EngineKind};
use crate::problem::Problem;
use crate::vehicle::{Placement, random_placements_by_the_rules};
use crate::verify::placements::usual_placements;
use crate::verify::{Verification, verify};

/// Random placements, hostile ones and beams of the verification of a scene.
const VERIFIED: (usize, usize, u64) = (100, 50, 20_000);
/// Seed of everything random.
const SEED: u64 = 1;

/// Files and settings of a measurement.
#[derive(Debug, Clone)]
pub struct DeviceBenchRequest {
    /// Scene files.
    pub scenes: Vec<PathBuf>,
    /// Numbers of placements that are scored at once.
    pub placements: Vec<usize>,
    /// Frames of each scene that are scored, spread evenly.
    pub frames: u32,
    /// Rounds in which device and CPU take turns; the median counts.
    pub rounds: usize,
}

/// A device measured in scene files. As text it is a block of Markdown.
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
        let (device, scene) = of_scene(path, request, computing)?;
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
fn of_scene(
    path: &Path,
    request: &DeviceBenchRequest,
    computing: &Computing<'_>,
) -> Result<(String, SceneBench), RunError> {
    let files = opening::files(&[path.to_owned()], &[], Some(request.frames), computing);
    let job = opening::job(&files, computing)?.job;
    let memory = computing.engine.memory_budget() / 2;
    let open = |task: &_| {
        let gpu = GpuBackend::open(Clone::clone(task), (&computing.engine).into(), memory);
        gpu.map_err(needs_device)
    };
    let rounds = (1 + request.rounds) * request.placements.len();
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
        let batch = random_placements_by_the_rules(problem.constraints(), count, SEED);
        let turn = || {
            bar.advance(1);
            match computing.watcher.goes_on() {
                true => Ok(()),
                false => Err(RunError::Interrupted("interrupted: nothing is printed".to_owned())),
            }
        };
        speeds.push(speed(&problem, &batch, request.rounds, (&mut gpu, &mut cpu), &turn)?);
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
            "\nPlacements × frames a second, {frames} frame(s), device / CPU (share of the time that the device worked):\n"
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
