//! A problem, ready to be computed: the task of the engines, and the rules of the mount.

mod assemble;

use std::ops::Deref;
use std::sync::Arc;

use crate::vehicle::{Constraints, GroundRule, OverlapRule, Sensors, TargetRule};
use lidar_cast::memory::OutOfMemory;

pub use assemble::{content_of, ground_triangles, own_bodies, world_of, world_of_parts};
pub use lidar_cast::task::{
    Air, Content, DevicePose, Entropy, Frame, HIT_PUSH, Instance, KINDS, Modelled, OccupiedVoxel,
    REPEATS, RequiredArea, Requirement, SensorBatch, StageTimes, Tally, Task, World,
    beam_direction, beam_origin, spread,
};

/// Error of parts that make no problem.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum ProblemError {
    /// The P-SOG and the scene do not describe the same voxels.
    #[error(
        "the P-SOG has {psog} and the scene's roi {scene}; build the P-SOG with the same roi or \
         correct the roi"
    )]
    GridMismatch { psog: String, scene: String },
    /// A part of space that must be seen has no voxel.
    #[error(
        "require[{index}]: `{name}` holds no voxel of the scene's roi, so that no share of it can be seen; {mend}"
    )]
    EmptyArea { index: usize, name: String, mend: String },
    /// A target must be met at places that all lie in the own body.
    #[error(
        "require[{index}]: every place of `{name}` lies in the own body, so that no share of them can be seen; raise \
         `within` beyond the body, or turn `bearing`"
    )]
    NoPlace { index: usize, name: String },
    /// A target must be met on the surface of a scene, where no place is free ground.
    #[error(
        "require[{index}]: no place of `{name}` is free ground of the scene beside the own body: {why}; change `within` or \
         `bearing`, or leave `ground` out for level ground"
    )]
    NoPlaceInScene { index: usize, name: String, why: String },
    /// A target must be met on the surface of a scene, and there is none.
    #[error(
        "require[{index}].ground: `{name}` stands on the ground of a scene, and there is none; give the command a scene, \
         or leave `ground` out for level ground"
    )]
    TargetWithoutScene { index: usize, name: String },
    /// Ground must be seen nearer to the own body than the middle of any cell.
    #[error(
        "require[{index}].{key}: `{name}` holds no cell of ground, so that no share of it can be seen: cells are 0.25 m \
         wide, and the middle of the nearest one lies {least} m from the own body; give {least} or more"
    )]
    NoCell { index: usize, name: String, key: &'static str, least: f64 },
    /// A blind zone must end where no lane of cells lies before the edge.
    #[error(
        "require[{index}].blind_zone: no lane of `{name}` lies before the own body, which is narrower there than the \
         0.25 m of a lane; leave it out of `require`, or correct the body"
    )]
    NoLane { index: usize, name: String },
    /// Ground must be seen around a body far larger than any vehicle.
    #[error(
        "the vehicle requires `{name}`, and its body is {length:.0} m long or wide, more than the {most:.0} m around \
         which ground is counted; give `body` in metres, or leave the ground out of `require`"
    )]
    LargeBody { name: String, length: f64, most: f64 },
    /// Targets, ground or overlap are required where beams end at nothing.
    #[error(
        "the vehicle requires `{name}`, and beams end at nothing in this scene; give the scene geometry and \
         \"coverage\": \"first-hit\", or leave `{name}` out of `require`"
    )]
    TargetWithoutHits { name: String },
    /// Ground must be seen where there is no own body, or no ground.
    #[error(
        "the vehicle requires `{name}`, and the scene has no {lacks}; give it one, or leave the ground out of `require`"
    )]
    GroundWithout { name: String, lacks: &'static str },
    /// The trees do not fit into memory.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
}

impl ProblemError {
    /// True if a requirement of the vehicle is at fault.
    pub fn is_of_vehicle(&self) -> bool {
        matches!(
            self,
            Self::EmptyArea { .. }
                | Self::NoPlace { .. }
                | Self::NoPlaceInScene { .. }
                | Self::TargetWithoutScene { .. }
                | Self::NoCell { .. }
                | Self::NoLane { .. }
        )
    }
}

/// All that is fixed while placements vary: the [`Task`] of the engines, whose methods it has, and the rules that
/// placements keep.
#[derive(Debug, Clone)]
pub struct Problem {
    task: Arc<Task>,
    constraints: Constraints,
    /// Rules of given placements, where they allow more than `constraints`.
    rules: Option<Constraints>,
    /// Own bodies alone, in the ego frame of frame 0.
    body: Frame,
    required: Arc<Required>,
}

/// Requirements of the vehicle beside its areas.
#[derive(Debug, Default)]
struct Required {
    targets: Vec<TargetRule>,
    ground: GroundRequired,
    overlap: OverlapRequired,
    surface: Option<SceneSurface>,
    /// Position in the vehicle file of each requirement: areas, targets, ground, overlap.
    order: Vec<usize>,
}

/// Surface of a scene in its first frame, on which targets stand.
#[derive(Debug)]
pub struct SceneSurface {
    /// All that is there, own bodies included.
    pub geometry: Frame,
    /// Number of the frame in the scene.
    pub frame: usize,
    /// True for ground, by triangle of the frame; the own bodies are none.
    pub is_ground: Vec<bool>,
}

/// Rules on the overlap of LiDARs, and which triangles of a frame are the own body's.
#[derive(Debug, Default)]
pub struct OverlapRequired {
    /// Rules, in the order of the vehicle.
    pub rules: Vec<OverlapRule>,
    /// Number of the own body's first triangle in a frame: hits on the body are shared by nobody.
    pub own: usize,
}

/// Rules on the ground near the vehicle, and which triangles of a frame are ground.
#[derive(Debug, Default)]
pub struct GroundRequired {
    /// Rules, in the order of the vehicle.
    pub rules: Vec<GroundRule>,
    /// True for ground, by triangle of a frame; the own body's triangles have no entry. Empty without rules.
    pub is_ground: Vec<bool>,
}

impl Deref for Problem {
    type Target = Task;

    fn deref(&self) -> &Task {
        &self.task
    }
}

impl From<Task> for Problem {
    /// A problem without rules of a mount.
    fn from(task: Task) -> Self {
        let (constraints, body) = (Constraints::default(), Frame::default());
        Self { task: Arc::new(task), constraints, rules: None, body, required: Arc::default() }
    }
}

impl Problem {
    /// Task that engines are opened for.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// Rules of the mount: none where the problem was put together without.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// Rules of given placements: every model that a mount lists may stand there, whatever equipment is searched.
    pub fn rules(&self) -> &Constraints {
        self.rules.as_ref().unwrap_or(&self.constraints)
    }

    /// Own bodies alone, in the ego frame of frame 0; without triangles where the scene has no body.
    pub fn body(&self) -> &Frame {
        &self.body
    }

    /// Targets that must be met.
    pub fn target_rules(&self) -> &[TargetRule] {
        &self.required.targets
    }

    /// Surface of the scene in the first frame that the problem was made of, whatever frames a copy is over; `None` where no
    /// rule on a target stands on it.
    pub fn surface(&self) -> Option<&SceneSurface> {
        self.required.surface.as_ref()
    }

    /// Ground near the vehicle that must be seen.
    pub fn ground_required(&self) -> &GroundRequired {
        &self.required.ground
    }

    /// Overlap by which pairs must connect all LiDARs.
    pub fn overlap_required(&self) -> &OverlapRequired {
        &self.required.overlap
    }

    /// True if the vehicle requires targets, ground or overlap, beside areas of voxels.
    pub fn requires_sight(&self) -> bool {
        let Required { targets, ground, overlap, .. } = &*self.required;
        !(targets.is_empty() && ground.rules.is_empty() && overlap.rules.is_empty())
    }

    /// Puts one thing for each requirement, given as areas, targets, ground and overlap, into the order of the vehicle
    /// file. Lists of another length stay as they are: areas alone are in order.
    pub fn in_file_order<T>(&self, list: &mut Vec<T>) {
        let order = &self.required.order;
        if list.len() != order.len() {
            return;
        }
        let mut placed: Vec<(usize, T)> = order.iter().copied().zip(list.drain(..)).collect();
        placed.sort_by_key(|(position, _)| *position);
        list.extend(placed.into_iter().map(|(_, thing)| thing));
    }

    /// A copy with other rules of the mount, also for given placements.
    pub fn with_constraints(self, constraints: Constraints) -> Self {
        Self { constraints, rules: None, ..self }
    }

    /// A copy whose search is over some equipment; rules of given placements stay.
    pub fn with_equipment(self, constraints: Constraints) -> Self {
        let rules = self.rules.or(Some(self.constraints));
        Self { constraints, rules, ..self }
    }

    /// A copy with separate rules for given placements.
    pub fn with_rules(self, rules: Constraints) -> Self {
        Self { rules: Some(rules), ..self }
    }

    /// A copy with other sensor models.
    pub fn with_sensors(self, sensors: impl Into<Sensors>) -> Self {
        self.changed(|task| task.with_sensors(sensors))
    }

    /// A copy with other information in its voxels.
    pub fn with_content(self, content: impl Into<Arc<Content>>) -> Self {
        self.changed(|task| task.with_content(content))
    }

    /// The problem of a vehicle that requires nothing.
    #[must_use]
    pub fn without_requirements(self) -> Self {
        Self { required: Arc::default(), ..self.changed(Task::without_areas) }
    }

    /// A copy with areas that must be seen.
    pub fn with_areas(self, required: &[Requirement]) -> Self {
        self.changed(|task| task.with_areas(required))
    }

    /// A copy in air that keeps beams from coming back: they then cover less.
    pub fn in_air(self, air: Arc<dyn Air>) -> Self {
        self.changed(|task| task.in_air(air))
    }

    /// A copy over some of its frames, with the same trees and content.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn over(&self, frames: &[usize]) -> Self {
        self.clone().changed(|task| task.over(frames))
    }

    /// A copy with mirrored sensors; see [`Task::mirrored`].
    pub fn mirrored(&self) -> Self {
        self.clone().changed(|task| task.mirrored())
    }

    fn changed(self, change: impl FnOnce(Task) -> Task) -> Self {
        Self { task: Arc::new(change(Arc::unwrap_or_clone(self.task))), ..self }
    }
}
