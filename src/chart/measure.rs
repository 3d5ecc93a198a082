use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Engine, Exact, Fidelity, FidelityError, Rung, World};
use crate::bvh::Hit;
use crate::engine::{Backend, BackendError};
use crate::problem::{Problem, Tally};
use crate::score::Objective;
use crate::search::SWAP_SPACING;
use crate::search::atlas::{Atlas, Union};
use crate::vehicle::{Constraints, Placement, PoseGrid};

/// Placements scored between two looks at whether to stop.
const BATCH: usize = 8;
/// Placements by which the GPU is compared with the CPU before the CPU's scores stand for both.
const COMPARED: usize = 8;
/// Fewest placements of one repeat.
const TIMED: usize = 4;
/// Least wall time of one repeat, in seconds, where there are placements enough.
const REPEAT_SECONDS: f64 = 0.15;
/// Bytes of bitmaps that an atlas keeps at most.
const ATLAS_BYTES: u64 = 2 << 30;
/// The yardstick casts into this share of the scene's frames.
const YARDSTICK_FRAMES: u32 = 4;

/// Opens the backend of an engine over a problem.
pub type Open<'a> = dyn Fn(&Arc<Problem>, Engine) -> Result<Box<dyn Backend>, BackendError> + 'a;

/// What one pose of an atlas costs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseCost {
    /// Wall time of casting it, once, all threads at work.
    pub seconds: f64,
    /// Bytes of its bitmaps.
    pub bytes: u64,
}

/// What one setting costs and gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The setting.
    pub rung: Rung,
    /// Wall time of a placement in seconds, all threads at work: the median of repeats, each divided by
    /// a yardstick run just before it, times the yardstick's median. Of an atlas with every pose held.
    pub seconds: f64,
    /// Least and most of these repeats.
    pub spread: [f64; 2],
    /// Bytes of scene, P-SOG and the work buffers of one placement; of an atlas, with its poses'
    /// bitmaps.
    pub bytes: u64,
    /// Beams of one placement over all frames.
    pub beams: u64,
    /// Triangles, a mean over frames.
    pub triangles: u64,
    /// Of an atlas, what a pose costs before placements are as cheap as `seconds` says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseCost>,
    /// Objective of each placement; `None` where it covers nothing.
    pub scores: Vec<Option<f64>>,
}

/// Measures settings of one scene with the same placements.
pub struct Workshop<'a> {
    world: World,
    placements: Vec<Placement>,
    constraints: Constraints,
    objective: Objective,
    open: Box<Open<'a>>,
    repeats: usize,
    yardstick: Scorer,
    /// Median seconds a placement of the yardstick, from the first setting measured.
    yardstick_seconds: Option<f64>,
}

impl<'a> Workshop<'a> {
    /// A workshop over `placements`, of which there must be one or more; every cost is the median of
    /// `repeats`. `yardstick_seconds` goes on with those of an interrupted run.
    ///
    /// # Errors
    /// The scene at its own voxel size cannot be scored on the CPU.
    pub fn new(
        mut world: World,
        placements: Vec<Placement>,
        constraints: Constraints,
        objective: Objective,
        open: Box<Open<'a>>,
        repeats: usize,
        yardstick_seconds: Option<f64>,
    ) -> Result<Self, FidelityError> {
        let own = Fidelity::of_scene(world.scene());
        let fidelity = Fidelity { frames: own.frames.div_ceil(YARDSTICK_FRAMES), ..own };
        let rung = Rung { fidelity, engine: Engine::Cpu };
        let yardstick = Scorer::new(&mut world, &rung, &constraints, &objective, &open)?;
        Ok(Self {
            world,
            placements,
            constraints,
            objective,
            open,
            repeats,
            yardstick,
            yardstick_seconds,
        })
    }

    /// The scene and its P-SOGs.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// What is scored.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Median seconds a placement of the yardstick; `None` before the first setting.
    pub fn yardstick_seconds(&self) -> Option<f64> {
        self.yardstick_seconds
    }

    fn scorer(&mut self, rung: &Rung) -> Result<Scorer, FidelityError> {
        Scorer::new(&mut self.world, rung, &self.constraints, &self.objective, &self.open)
    }

    /// The score of the first placement alone: what it was before tells whether the scene has changed.
    ///
    /// # Errors
    /// As [`Self::measure`].
    pub fn first_score(&mut self, rung: &Rung) -> Result<Option<f64>, FidelityError> {
        let mut scorer = self.scorer(rung)?;
        let tallies = scorer.tallies(&self.placements[..1])?;
        Ok(scorer.value(&tallies[0], &self.objective))
    }

    /// Measures one setting; `None` when `go_on`, called with the placements just scored, says stop.
    ///
    /// Of a GPU setting whose CPU twin is in `done`, a few placements are scored; where their tallies
    /// are equal to the last bit, the twin's scores stand for both.
    ///
    /// # Errors
    /// The setting does not fit the scene, or the backend failed.
    pub fn measure(
        &mut self,
        rung: &Rung,
        done: &[Measured],
        go_on: &dyn Fn(usize) -> bool,
    ) -> Result<Option<Measured>, FidelityError> {
        let mut scorer = self.scorer(rung)?;
        let twin = Rung { engine: Engine::Cpu, ..*rung };
        let twin = done.iter().find(|m| rung.engine == Engine::Gpu && m.rung == twin);
        let start = Instant::now();
        let mut scores = Vec::with_capacity(self.placements.len());
        for batch in self.placements.chunks(BATCH) {
            let tallies = scorer.tallies(batch)?;
            scores.extend(tallies.iter().map(|tally| scorer.value(tally, &self.objective)));
            if !go_on(batch.len()) {
                return Ok(None);
            }
            if let Some(twin) = twin
                && scores.len() >= COMPARED
                && scores[..] == twin.scores[..scores.len()]
            {
                break;
            }
        }
        let elapsed = start.elapsed().as_secs_f64();
        let each = elapsed / scores.len() as f64;
        let pose = scorer.pose(elapsed);
        if scores.len() < self.placements.len() {
            scores = twin.map(|twin| twin.scores.clone()).unwrap_or_default();
        }
        let seconds = self.time(&mut scorer, each)?;
        let (mut beams, lidars) = (0, self.placements[0].lidars.len() as u64);
        if let Some(tally) = scorer.tallies(&self.placements[..1])?.first() {
            beams = tally.beams;
        }
        Ok(Some(Measured {
            rung: *rung,
            seconds: median(&seconds),
            spread: [
                seconds.iter().copied().fold(f64::INFINITY, f64::min),
                seconds.iter().copied().fold(0.0, f64::max),
            ],
            bytes: scorer.bytes(lidars),
            beams,
            triangles: scorer.triangles(),
            pose,
            scores,
        }))
    }

    /// Seconds a placement of each repeat; `each` is a first estimate.
    fn time(&mut self, scorer: &mut Scorer, each: f64) -> Result<Vec<f64>, BackendError> {
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
        let mut yards = Vec::new();
        for _ in 0..self.repeats {
            let yard = seconds_of(&mut self.yardstick, &self.placements[..fewest])?;
            ratios.push(seconds_of(scorer, &self.placements[..count])? / yard);
            yards.push(yard);
        }
        let unit = *self.yardstick_seconds.get_or_insert(median(&yards));
        Ok(ratios.into_iter().map(|ratio| ratio * unit).collect())
    }
}

fn seconds_of(scorer: &mut Scorer, placements: &[Placement]) -> Result<f64, BackendError> {
    let start = Instant::now();
    scorer.tallies(placements)?;
    Ok(start.elapsed().as_secs_f64() / placements.len() as f64)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// A setting ready to score.
enum Scorer {
    Exact(Box<Exact>),
    Backend(Arc<Problem>, Box<dyn Backend>),
    Atlas { atlas: Box<Atlas>, backend: Box<dyn Backend>, lidars: usize },
}

impl Scorer {
    fn new(
        world: &mut World,
        rung: &Rung,
        constraints: &Constraints,
        objective: &Objective,
        open: &Open,
    ) -> Result<Self, FidelityError> {
        if rung.engine == Engine::F64 {
            return Ok(Self::Exact(Box::new(Exact::new(world, &rung.fidelity)?)));
        }
        let problem = Arc::new(world.problem(&rung.fidelity)?);
        let backend = open(&problem, rung.engine)?;
        if rung.engine == Engine::Atlas {
            let grid = PoseGrid::new(constraints, SWAP_SPACING)?;
            let atlas = Atlas::new(problem, grid, objective.counts_all_covered(), ATLAS_BYTES);
            let (held, lidars) =
                (atlas.page_bytes() * BATCH * constraints.lidars, constraints.lidars);
            if held as u64 > ATLAS_BYTES {
                let (what, need, limit) = ("the pose atlas", held as u64, ATLAS_BYTES);
                return Err(BackendError::TooLarge { what, need, limit }.into());
            }
            return Ok(Self::Atlas { atlas: Box::new(atlas), backend, lidars });
        }
        Ok(Self::Backend(problem, backend))
    }

    /// Placements that can be scored at once.
    fn most(&self) -> usize {
        match self {
            Self::Atlas { atlas, lidars, .. } => (atlas.capacity() / (*lidars).max(1)).max(BATCH),
            _ => usize::MAX,
        }
    }

    fn tallies(&mut self, placements: &[Placement]) -> Result<Vec<Tally>, BackendError> {
        match self {
            Self::Exact(exact) => Ok(exact.tallies(placements)),
            Self::Backend(problem, backend) => backend.tally(placements, problem.table().range()),
            Self::Atlas { atlas, backend, .. } => {
                let grid = atlas.grid();
                let poses = placements.iter().map(|p| p.lidars.iter().map(|l| grid.nearest(l)));
                let poses: Vec<Vec<u32>> = poses.map(Iterator::collect).collect();
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

    fn value(&self, tally: &Tally, objective: &Objective) -> Option<f64> {
        let (content, frames) = match self {
            Self::Exact(exact) => (exact.content(), exact.frame_count()),
            Self::Backend(problem, _) => (problem.content(), problem.frame_count()),
            Self::Atlas { atlas, .. } => (atlas.problem().content(), atlas.problem().frame_count()),
        };
        objective.value_of_tally(tally, content, frames)
    }

    fn bytes(&self, lidars: u64) -> u64 {
        match self {
            Self::Exact(exact) => exact.bytes(),
            Self::Backend(problem, _) => {
                let hits = problem.table().directions().len() * size_of::<Hit>();
                problem.bytes() + lidars * (problem.roi().voxel_count().div_ceil(8) + hits as u64)
            }
            Self::Atlas { atlas, .. } => {
                atlas.problem().bytes() + lidars * atlas.page_bytes() as u64
            }
        }
    }

    /// What a pose costs, where all that were cast so far took so many seconds.
    fn pose(&self, elapsed: f64) -> Option<PoseCost> {
        let Self::Atlas { atlas, .. } = self else { return None };
        let seconds = elapsed / atlas.poses_cast().max(1) as f64;
        Some(PoseCost { seconds, bytes: atlas.page_bytes() as u64 })
    }

    fn triangles(&self) -> u64 {
        let problem = match self {
            Self::Exact(exact) => return exact.triangles(),
            Self::Backend(problem, _) => problem,
            Self::Atlas { atlas, .. } => atlas.problem(),
        };
        let frames = problem.geometry_frame_count();
        let trees = (0..frames).filter_map(|frame| problem.geometry(frame));
        trees.map(|bvh| bvh.triangles.len() as u64).sum::<u64>() / frames.max(1) as u64
    }
}
