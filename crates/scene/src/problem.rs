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
pub enum ProblemError {
    /// A rule of the vehicle's `require` that nothing could keep; the sentence tells its place and the mend.
    #[error("require[{0}]{1}")]
    Rule(usize, String),
    /// A scene, a P-SOG and a vehicle that do not go together; the sentence tells the mend.
    #[error("{0}")]
    Refused(String),
    /// The trees do not fit into memory.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
}

impl ProblemError {
    /// Ground must be seen where there is no own body, or no ground: `lacks` says which.
    pub fn ground_without(rule: &str, lacks: &str) -> Self {
        Self::Refused(format!(
            "the vehicle requires `{rule}`, and the scene has no {lacks}; give it one, or leave the ground out of `require`"
        ))
    }

    /// True if a requirement of the vehicle is at fault.
    pub fn is_of_vehicle(&self) -> bool {
        matches!(self, Self::Rule(..))
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
