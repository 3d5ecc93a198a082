//! A setting ready to score placements.

use std::sync::Arc;

use rayon::prelude::*;

use super::exact::Exact;
use super::{ChartError, ChartWorld, Engine, PoseCost, Setting};
use crate::bvh::Hit;
use crate::engine::{Backend, BackendError, EngineChoice, EngineKind, open};
use crate::problem::{Problem, Tally};
use crate::score::Objective;
use crate::search::SWAP_SPACING;
use crate::search::atlas::{Atlas, Union};
use crate::vehicle::{Placement, PoseGrid, SensorPose, Sensors, UnknownSensor};

/// Placements scored between two looks at whether to stop.
pub(super) const BATCH: usize = 8;
/// Bytes of bitmaps that an atlas keeps at most.
const ATLAS_BYTES: u64 = 2 << 30;

/// Poses of a grid nearest to a placement's, each of its LiDAR's model. LiDARs of a model that no mount may hold are
/// left out.
fn poses_of(
    sensors: &Sensors,
    grid: &PoseGrid,
    placement: &Placement,
) -> Result<Vec<u32>, UnknownSensor> {
    let nearest = |pose: &SensorPose| {
        let model = sensors.models()[sensors.number(pose)?].name;
        Ok(grid.nearest_of(model, pose))
    };
    let poses = placement.lidars.iter().map(nearest).collect::<Result<Vec<Option<u32>>, _>>()?;
    Ok(poses.into_iter().flatten().collect())
}

/// Refuses a placement with a model that no pose of the grid has.
fn check_places(
    sensors: &Sensors,
    grid: &PoseGrid,
    placements: &[Placement],
) -> Result<(), ChartError> {
    for placement in placements {
        for pose in &placement.lidars {
            let sensor = sensors.models()[sensors.number(pose)?].name;
            if grid.nearest_of(sensor, pose).is_none() {
                let placement = placement.name.clone();
                return Err(ChartError::NoPlace { placement, sensor });
            }
        }
    }
    Ok(())
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
            let kinds = world.scene().vehicle().every_kind();
            let grid = PoseGrid::new(&kinds, SWAP_SPACING)?;
            check_places(problem.sensors(), &grid, placements)?;
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

    pub(super) fn tallies(&mut self, placements: &[Placement]) -> Result<Vec<Tally>, BackendError> {
        match self {
            Self::Exact(exact) => Ok(exact.tallies(placements)?),
            Self::Backend(_, backend) => backend.tally(placements, None),
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
            Self::Exact(exact) => (exact.content(), exact.frame_count()),
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
