//! Cost and scores of one setting.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::early::{IN_F64, StoppingRule};
use super::exact::Exact;
use super::{ChartError, ChartWorld, Engine, Left, SceneDetail, Setting};
use crate::bvh::Hit;
use crate::engine::{Backend, BackendError, EngineChoice, EngineKind, open};
use crate::problem::{Problem, Tally};
use crate::score::Objective;
use crate::search::atlas::{Atlas, Union};
use crate::search::{SWAP_SPACING, coarse_grid};
use crate::vehicle::{Placement, PoseGrid, SensorPose, Sensors};

/// Placements by which the GPU is compared with the CPU before the CPU's scores stand for both.
const COMPARED: usize = 8;
/// Fewest placements of one repeat, of the setting and of the yardstick.
const TIMED: usize = 2;
/// Least wall time of one repeat, in seconds, where there are placements enough.
const REPEAT_SECONDS: f64 = 0.15;
/// The unit of time casts into one frame in this many of the scene's.
const UNIT_FRAMES: u32 = 4;

/// Cost of one pose of an atlas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct PoseCost {
    /// Wall time of casting it, once, all threads at work.
    pub seconds: f64,
    /// Bytes of its bitmaps.
    pub bytes: u64,
}

/// Cost and scores of one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The setting.
    #[serde(rename = "rung")]
    pub setting: Setting,
    /// Wall time of a placement in seconds, all threads at work; for an atlas with every pose held. Median of
    /// repeats, each divided by a run of the unit (a fixed setting) just before it, times the unit's median: a
    /// machine that is slower for a while changes both.
    pub seconds: f64,
    /// Least and most of these repeats.
    pub spread: [f64; 2],
    /// Bytes of scene, P-SOG and the work buffers of one placement; for an atlas also of its poses' bitmaps.
    pub bytes: u64,
    /// Beams of one placement over all frames.
    pub beams: u64,
    /// Triangles, a mean over frames.
    pub triangles: u64,
    /// Cost of casting a pose of an atlas, once; `seconds` is with every pose cast. `None` for other engines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) pose: Option<PoseCost>,
    /// Repeats of the timing; 0 where the scoring of the placements was timed instead, eight at a time.
    pub repeats: usize,
    /// Reason for which only the first placements were scored; `None` where all were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left: Option<Left>,
    /// Objective of each placement; `None` where it covers nothing.
    pub scores: Vec<Option<f64>>,
}

/// Scores of the first placements of a setting.
struct FirstScores {
    scores: Vec<Option<f64>>,
    left: Option<Left>,
    /// Seconds a placement of each batch.
    batches: Vec<f64>,
}

/// Measures settings of one scene with the same placements.
pub(super) struct Bench {
    pub(super) world: ChartWorld,
    pub(super) placements: Vec<Placement>,
    objective: Objective,
    engine: EngineChoice,
    repeats: usize,
    /// The setting whose time the others are divided by: the scene at its own fidelity over few frames.
    unit: Scorer,
    /// Median seconds a placement of the unit, from the first setting measured.
    pub(super) unit_seconds: Option<f64>,
}

impl Bench {
    /// A bench over `placements`, of which there must be one or more; every cost is the median of
    /// `repeats`. `unit_seconds` goes on with those of an interrupted run.
    pub(super) fn new(
        mut world: ChartWorld,
        placements: Vec<Placement>,
        objective: Objective,
        engine: EngineChoice,
        repeats: usize,
        unit_seconds: Option<f64>,
    ) -> Result<Self, ChartError> {
        let own = SceneDetail::of_scene(&world.scene);
        let fidelity = SceneDetail { frames: own.frames.div_ceil(UNIT_FRAMES), ..own };
        let setting = Setting { fidelity, engine: Engine::Cpu };
        let unit = Scorer::new(&mut world, &setting, &objective, &engine, &placements)?;
        Ok(Self { world, placements, objective, engine, repeats, unit, unit_seconds })
    }

    fn scorer(&mut self, setting: &Setting) -> Result<Scorer, ChartError> {
        let Self { world, objective, engine, placements, .. } = self;
        Scorer::new(world, setting, objective, engine, placements)
    }

    /// The score of the first placement alone; one that differs from before tells of a changed scene.
    pub(super) fn first_score(&mut self, setting: &Setting) -> Result<Option<f64>, ChartError> {
        let mut scorer = self.scorer(setting)?;
        let tallies = scorer.tallies(&self.placements[..1])?;
        Ok(scorer.value(&tallies[0], &self.objective))
    }

    /// Measures one setting as far as `rule` says. `goes_on` is called with the number of placements just scored; a no
    /// drops the setting.
    ///
    /// For a GPU setting whose equal on the CPU is in `done`, a few placements are scored. Where their scores are equal
    /// to the last bit, the CPU's scores stand for both.
    pub(super) fn measure(
        &mut self,
        setting: &Setting,
        done: &[Measured],
        rule: &StoppingRule,
        goes_on: &dyn Fn(usize) -> bool,
    ) -> Result<Option<Measured>, ChartError> {
        let voxel = setting.fidelity.voxel;
        if self.world.psog(voxel, &|| goes_on(0))?.is_none() {
            return Ok(None);
        }
        let mut scorer = self.scorer(setting)?;
        let on_cpu = Setting { engine: Engine::Cpu, ..*setting };
        let is_whole = |m: &&Measured| m.setting == on_cpu && m.left.is_none();
        let on_cpu = done.iter().filter(|_| setting.engine == Engine::Gpu).find(is_whole);
        let start = Instant::now();
        let Some(FirstScores { scores, left, batches }) =
            self.score(&mut scorer, on_cpu, rule, goes_on)?
        else {
            return Ok(None);
        };
        let pose = scorer.pose(start.elapsed().as_secs_f64());
        let each = median(&batches);
        let is_timed = left.is_none() && (rule.full || rule.is_candidate(setting, &scores));
        let seconds = if is_timed { self.time(&mut scorer, each)? } else { batches };
        let (mut beams, lidars) = (0, self.placements[0].lidars.len() as u64);
        if let Some(tally) = scorer.tallies(&self.placements[..1])?.first() {
            beams = tally.beams;
        }
        if let Some(change) = scorer.changes().first() {
            return Err(ChartError::DeviceLost { change: change.clone() });
        }
        Ok(Some(Measured {
            setting: *setting,
            seconds: median(&seconds),
            spread: [
                seconds.iter().copied().fold(f64::INFINITY, f64::min),
                seconds.iter().copied().fold(0.0, f64::max),
            ],
            bytes: scorer.bytes(lidars),
            beams,
            triangles: scorer.triangles(),
            pose,
            repeats: if is_timed { self.repeats } else { 0 },
            left,
            scores,
        }))
    }

    /// Scores placements until `rule` has enough; `None` after a no.
    fn score(
        &self,
        scorer: &mut Scorer,
        on_cpu: Option<&Measured>,
        rule: &StoppingRule,
        goes_on: &dyn Fn(usize) -> bool,
    ) -> Result<Option<FirstScores>, ChartError> {
        let scores = Vec::with_capacity(self.placements.len());
        let mut scored = FirstScores { scores, left: None, batches: Vec::new() };
        let most = if matches!(scorer, Scorer::Exact(_)) { IN_F64 } else { BATCH };
        for batch in self.placements.chunks(most) {
            let start = Instant::now();
            let tallies = scorer.tallies(batch)?;
            scored.batches.push(start.elapsed().as_secs_f64() / batch.len() as f64);
            let values = tallies.iter().map(|tally| scorer.value(tally, &self.objective));
            scored.scores.extend(values);
            if !goes_on(batch.len()) {
                return Ok(None);
            }
            let so_far = scored.scores.len();
            if let Some(on_cpu) = on_cpu
                && so_far >= COMPARED
                && scored.scores[..] == on_cpu.scores[..so_far]
            {
                scored.scores.clone_from(&on_cpu.scores);
                break;
            }
            scored.left = rule.leaves(&scored.scores, median(&scored.batches));
            if scored.left.is_some() {
                break;
            }
        }
        Ok(Some(scored))
    }

    /// Seconds a placement of each repeat; `each` is a first estimate.
    fn time(&mut self, scorer: &mut Scorer, each: f64) -> Result<Vec<f64>, ChartError> {
        let most = scorer.most().min(self.placements.len());
        let fewest = TIMED.min(most);
        let each = match scorer {
            Scorer::Atlas { .. } => {
                // The first pass warms it.
                scorer.tallies(&self.placements[..most])?;
                seconds_of(scorer, &self.placements[..most])?
            }
            _ => each,
        };
        let wanted = |each: f64| (REPEAT_SECONDS / each).ceil() as usize;
        let count = wanted(each).clamp(fewest, most);
        let mut ratios = Vec::new();
        let mut units = Vec::new();
        for _ in 0..self.repeats {
            let unit = seconds_of(&mut self.unit, &self.placements[..fewest])?;
            ratios.push(seconds_of(scorer, &self.placements[..count])? / unit);
            units.push(unit);
        }
        let unit = *self.unit_seconds.get_or_insert(median(&units));
        Ok(ratios.into_iter().map(|ratio| ratio * unit).collect())
    }
}

fn seconds_of(scorer: &mut Scorer, placements: &[Placement]) -> Result<f64, ChartError> {
    let start = Instant::now();
    scorer.tallies(placements)?;
    Ok(start.elapsed().as_secs_f64() / placements.len() as f64)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Placements scored between two looks at whether to stop.
const BATCH: usize = 8;
/// Bytes of bitmaps that an atlas keeps at most.
const ATLAS_BYTES: u64 = 2 << 30;

/// Poses of a grid nearest to a placement's, each of its LiDAR's model. Refuses a LiDAR of a model that no mount may hold.
fn poses_of(
    sensors: &Sensors,
    grid: &PoseGrid,
    placement: &Placement,
) -> Result<Vec<u32>, ChartError> {
    let nearest = |pose: &SensorPose| {
        let sensor = sensors.models()[sensors.number(pose)?].name;
        grid.nearest_of(sensor, pose).ok_or_else(|| {
            let placement = placement.name.clone();
            ChartError::NoPlace { placement, sensor }
        })
    };
    placement.lidars.iter().map(nearest).collect()
}

/// A setting ready to score.
pub(super) enum Scorer {
    Exact(Box<Exact>),
    Backend(Arc<Problem>, Box<dyn Backend>),
    Atlas { atlas: Box<Atlas>, backend: Box<dyn Backend>, lidars: usize },
}

impl Scorer {
    pub(super) fn new(
        world: &mut ChartWorld,
        setting: &Setting,
        objective: &Objective,
        choice: &EngineChoice,
        placements: &[Placement],
    ) -> Result<Self, ChartError> {
        if setting.engine == Engine::F64 {
            return Ok(Self::Exact(Box::new(Exact::new(world, &setting.fidelity)?)));
        }
        let problem = Arc::new(world.problem(&setting.fidelity)?);
        let kind = match setting.engine {
            Engine::Gpu => EngineKind::Gpu,
            _ => EngineKind::Cpu,
        };
        let choice = EngineChoice { kind, ..choice.clone() };
        let backend = open(problem.task(), &choice, |_| {})?.engine;
        if setting.engine == Engine::Atlas {
            let kinds = world.scene.vehicle().every_kind();
            let (grid, _) = coarse_grid(&kinds, SWAP_SPACING, 1, u64::MAX)?;
            let is_held = |placement| poses_of(problem.sensors(), &grid, placement).map(drop);
            placements.iter().try_for_each(is_held)?;
            let atlas = Atlas::new(problem, grid, objective.needed(), ATLAS_BYTES);
            let lidars = placements.iter().map(|placement| placement.lidars.len()).max();
            let lidars = lidars.unwrap_or(0);
            let held = atlas.page_bytes() * BATCH * lidars;
            if held as u64 > ATLAS_BYTES {
                let (what, need, limit) = ("the pose atlas", held as u64, ATLAS_BYTES);
                return Err(BackendError::TooLarge { what, need, limit }.into());
            }
            return Ok(Self::Atlas { atlas: Box::new(atlas), backend, lidars });
        }
        Ok(Self::Backend(problem, backend))
    }

    /// Placements that can be scored at once.
    pub(super) fn most(&self) -> usize {
        match self {
            Self::Atlas { atlas, lidars, .. } => (atlas.capacity() / (*lidars).max(1)).max(BATCH),
            _ => usize::MAX,
        }
    }

    pub(super) fn tallies(&mut self, placements: &[Placement]) -> Result<Vec<Tally>, ChartError> {
        match self {
            Self::Exact(exact) => Ok(exact.tallies(placements)?),
            Self::Backend(_, backend) => Ok(backend.tally(placements, None)?),
            Self::Atlas { atlas, backend, .. } => {
                let sensors = atlas.problem().sensors();
                let poses = placements.iter().map(|p| poses_of(sensors, atlas.grid(), p));
                let poses = poses.collect::<Result<Vec<Vec<u32>>, _>>()?;
                atlas.hold(&mut **backend, &poses.concat())?;
                let tally = |union: &mut Union, poses: &Vec<u32>| match poses.split_last() {
                    Some((last, others)) => {
                        atlas.union(others, union);
                        atlas.tally_with(union, *last)
                    }
                    None => Tally::default(),
                };
                Ok(poses.par_iter().map_init(Union::default, tally).collect())
            }
        }
    }

    pub(super) fn value(&self, tally: &Tally, objective: &Objective) -> Option<f64> {
        let (content, frames) = match self {
            Self::Exact(exact) => (&exact.content, exact.frame_count()),
            Self::Backend(problem, _) => (problem.content(), problem.frame_count()),
            Self::Atlas { atlas, .. } => (atlas.problem().content(), atlas.problem().frame_count()),
        };
        objective.value_of_tally(tally, content, frames)
    }

    pub(super) fn bytes(&self, lidars: u64) -> u64 {
        match self {
            Self::Exact(exact) => exact.bytes(),
            Self::Backend(problem, _) => {
                let hits = problem.sensors().most_beams() * size_of::<Hit>();
                problem.bytes() + lidars * (problem.roi().voxel_count().div_ceil(8) + hits as u64)
            }
            Self::Atlas { atlas, .. } => {
                atlas.problem().bytes() + lidars * atlas.page_bytes() as u64
            }
        }
    }

    /// Devices lost while it scored, in words.
    pub(super) fn changes(&self) -> &[String] {
        match self {
            Self::Exact(_) => &[],
            Self::Backend(_, backend) | Self::Atlas { backend, .. } => backend.changes(),
        }
    }

    /// Cost of a pose, from the seconds in which all poses so far were cast.
    pub(super) fn pose(&self, elapsed: f64) -> Option<PoseCost> {
        let Self::Atlas { atlas, .. } = self else { return None };
        let seconds = elapsed / atlas.poses_cast().max(1) as f64;
        Some(PoseCost { seconds, bytes: atlas.page_bytes() as u64 })
    }

    pub(super) fn triangles(&self) -> u64 {
        let problem = match self {
            Self::Exact(exact) => return exact.triangles(),
            Self::Backend(problem, _) => problem,
            Self::Atlas { atlas, .. } => atlas.problem(),
        };
        let frames = problem.geometry_frame_count();
        let geometry = (0..frames).filter_map(|frame| problem.geometry(frame));
        geometry.map(|frame| frame.triangle_count()).sum::<u64>() / frames.max(1) as u64
    }
}
