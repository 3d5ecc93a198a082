//! One scene of a job: P-SOG, frames, sensors and weather, the problem that these pose, and redundancy and overlap in it.

use std::sync::{Arc, OnceLock};

use super::Job;
use super::error::JobError;
use crate::engine::{EngineChoice, open};
use crate::geom::Pose;
use crate::near_field::{BlindDepths, NearSite, cast_frames, place};
use crate::problem::{Problem, ProblemError, spread};
use crate::psog::{Psog, read_psog};
use crate::scan::conditions::{Condition, in_words};
use crate::scan::{in_conditions, scan_scene};
use crate::scene::{PsogSource, Scene};
use crate::score::Scores;
use crate::shared::{Overlap, Redundancy, RedundancySite};
use crate::targets::{TargetQuestion, TargetSite, check_counting};
use crate::vehicle::{Constraints, Placement, Sensors};

/// One scene of a [`Job`](super::Job), with all that decides about its problem.
#[derive(Debug, Clone)]
pub struct JobScene {
    scene: Arc<Scene>,
    /// P-SOG, once it is given, read or scanned; copies of this scene share it.
    pub(super) psog: Arc<OnceLock<Arc<Psog>>>,
    pub(super) worth: Worth,
    pub(super) frames: Frames,
    pub(super) conditions: Vec<Condition>,
    /// Sensors that replace the scene's own.
    pub(super) sensors: Option<Sensors>,
    /// Rules that replace the scene's own.
    constraints: Option<Constraints>,
    pub(super) draw: u64,
    problem: OnceLock<Arc<Problem>>,
    /// Sensors and body for beams on targets, made on first use; copies of this scene share it.
    site: Arc<OnceLock<TargetSite>>,
    /// The vehicle on the ground of the scene for range cards, made on first use; `None` where that is level.
    on_ground: Arc<OnceLock<Option<TargetSite>>>,
    /// Ground near the vehicle in a few frames, made on first use; `None` without own body or ground.
    near: Arc<OnceLock<Option<NearSite>>>,
}

/// Voxels that hold information.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Worth {
    /// Voxels of a P-SOG on the scene's own grid.
    OwnGrid,
    /// Voxels of a P-SOG on another grid.
    OtherGrid,
    /// No voxel: geometry and requirements.
    Nothing,
    /// No voxel and no requirement, which the scene may be unable to judge: geometry alone.
    Unasked,
}

/// Frames that beams are cast into.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Frames {
    /// This many, spread evenly from the first on; all if `None`.
    Spread(Option<u32>),
    One(usize),
}

impl From<Arc<Scene>> for JobScene {
    fn from(scene: Arc<Scene>) -> Self {
        Self {
            scene,
            psog: Arc::default(),
            worth: Worth::OwnGrid,
            frames: Frames::Spread(None),
            conditions: Vec::new(),
            sensors: None,
            constraints: None,
            draw: 0,
            problem: OnceLock::new(),
            site: Arc::default(),
            on_ground: Arc::default(),
            near: Arc::default(),
        }
    }
}

impl From<Scene> for JobScene {
    fn from(scene: Scene) -> Self {
        Arc::new(scene).into()
    }
}

impl JobScene {
    /// The scene with other settings; its problem is made anew.
    pub(super) fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        (self.problem, self.site) = (OnceLock::new(), Arc::default());
        (self.on_ground, self.near) = (Arc::default(), Arc::default());
        change(&mut self);
        self
    }

    /// The scene with its own bodies moved by `turn` in the ego frame.
    pub(super) fn turn_bodies(&mut self, turn: &Pose) {
        self.scene = Arc::new(self.scene.with_bodies_turned(turn));
    }

    /// See [`Job::constraints`](super::Job::constraints): a problem that is there keeps its trees.
    pub(super) fn under(mut self, constraints: &Constraints) -> Self {
        let known = self.problem.take().map(|problem| {
            Arc::new(Arc::unwrap_or_clone(problem).with_constraints(constraints.clone()))
        });
        self.problem = known.map_or_else(OnceLock::new, Into::into);
        self.constraints = Some(constraints.clone());
        self
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Weather and faults, as they are written.
    pub fn conditions_in_words(&self) -> Vec<String> {
        in_words(&self.conditions)
    }

    /// File of the scene, or its name where it was read from none.
    pub fn place(&self) -> String {
        place(&self.scene)
    }

    /// Numbers of the frames that beams are cast into, rising.
    pub(crate) fn frame_numbers(&self) -> Vec<usize> {
        match self.frames {
            Frames::Spread(wanted) => spread(self.scene.frame_count(), wanted),
            Frames::One(frame) => vec![frame],
        }
    }

    /// Sensor models that placements may name, at the draw of this scene.
    ///
    /// # Errors
    /// A model without beams.
    pub fn models(&self) -> Result<Sensors, JobError> {
        let sensors = self.sensors.clone().map_or_else(|| self.scene.sensors(), Ok)?;
        Ok(if self.draw > 0 { sensors.with_seed(self.draw) } else { sensors })
    }

    /// The P-SOG: given, read from the file that the scene names, or scanned, on first use; a scan asks `go_on` as
    /// [`scan_scene`] does.
    ///
    /// # Errors
    /// A file that cannot be read or lacks a class of the scene's detection target; more frames or voxels than a
    /// P-SOG holds; a scan that `go_on` has stopped.
    pub fn psog(&self, go_on: impl Fn(usize) -> bool) -> Result<Arc<Psog>, JobError> {
        if let Some(psog) = self.psog.get() {
            return Ok(psog.clone());
        }
        let psog = Arc::new(psog_of(&self.scene, go_on)?);
        Ok(self.psog.get_or_init(|| psog).clone())
    }

    /// Sensors and body of the vehicle, for beams on targets, made on first use; `None` with coverage `through`.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub fn target_site(&self) -> Result<Option<&TargetSite>, JobError> {
        let problem = self.problem()?;
        Ok(problem.ends_at_hits().then(|| self.site.get_or_init(|| TargetSite::of(&problem))))
    }

    /// Site of range cards: alone on the ground of the scene in the frame in which it lies farthest from z = 0, where that is
    /// more than 1.5 m; else [`Self::target_site`].
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub fn card_site(&self) -> Result<Option<&TargetSite>, JobError> {
        let Some(level) = self.target_site()? else { return Ok(None) };
        let problem = self.problem()?;
        let on_ground = || TargetSite::on_ground(&self.scene, &problem);
        Ok(Some(self.on_ground.get_or_init(on_ground).as_ref().unwrap_or(level)))
    }

    /// Ground near the vehicle. `None` with coverage `through`, and without own body or ground.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub(crate) fn near_site(&self) -> Result<Option<&NearSite>, JobError> {
        let problem = self.problem()?;
        let site = || NearSite::new(&self.scene, &cast_frames(&problem)).ok();
        Ok(problem.ends_at_hits().then(|| self.near.get_or_init(site).as_ref()).flatten())
    }

    /// Adds the depth of the blind zone on each side to scores; none without a [site](Self::near_site).
    ///
    /// # Errors
    /// See [`Self::problem`]; an engine that fails, a sensor that the vehicle does not have.
    pub(super) fn add_blind_zones<'a>(
        &self,
        memory: Option<u64>,
        all: impl IntoIterator<Item = (&'a Placement, &'a mut Scores)>,
    ) -> Result<(), JobError> {
        let Some(site) = self.near_site()? else { return Ok(()) };
        let choice = EngineChoice { memory, ..EngineChoice::cpu() };
        let mut engine = open(site.problem().task(), &choice, |_| {})?.engine;
        for (placement, scores) in all {
            scores.blind_zone = Some(BlindDepths::from(&site.look(&mut *engine, placement)?));
        }
        Ok(())
    }

    /// The problem, made on first use.
    ///
    /// # Errors
    /// See [`Self::psog`]; a sensor without beams, a P-SOG on another grid than the region of interest, weather with
    /// coverage `through`.
    pub fn problem(&self) -> Result<Arc<Problem>, JobError> {
        if let Some(problem) = self.problem.get() {
            return Ok(problem.clone());
        }
        let problem = Arc::new(self.posed()?);
        Ok(self.problem.get_or_init(|| problem).clone())
    }

    /// Makes the problem of the scene; no other code does.
    fn posed(&self) -> Result<Problem, JobError> {
        let (mut scene, frames, sensors) = (&*self.scene, self.frame_numbers(), self.models()?);
        let unasked;
        if self.worth == Worth::Unasked && !scene.vehicle().require_order.is_empty() {
            unasked = scene.clone().without_requirements();
            scene = &unasked;
        }
        let problem = match self.worth {
            Worth::OwnGrid => {
                let psog = self.psog(|_| true)?;
                scene.check_detection(psog.classes())?;
                Problem::from_scene(scene, &psog, sensors, &frames)
            }
            Worth::OtherGrid => {
                Problem::on_grid_of(&*self.psog(|_| true)?, scene, sensors, &frames)
            }
            Worth::Nothing | Worth::Unasked => {
                let (grid, classes) = (scene.roi().grid()?, scene.classes().to_vec());
                let empty = Psog::new(grid, 1, classes, Vec::new(), Vec::new())?;
                Problem::on_grid_of(&empty, scene, sensors, &frames)
            }
        };
        let of_files = |source: ProblemError| {
            let files = match source.is_of_vehicle() {
                true => scene.vehicle_file().to_owned(),
                false => self.files(),
            };
            JobError::Problem { files, source }
        };
        let mut problem = problem.map_err(of_files)?;
        check_counting(&problem, scene.vehicle()).map_err(of_files)?;
        if let Some(constraints) = &self.constraints {
            problem = problem.with_constraints(constraints.clone());
        }
        Ok(in_conditions(scene, problem, &self.conditions)?)
    }

    /// The scene file, and the P-SOG file if it names one.
    fn files(&self) -> String {
        match self.scene.psog_source() {
            PsogSource::File(file) => format!("{} and {}", self.place(), file.display()),
            PsogSource::Scan(_) => self.place(),
        }
    }

    /// The scene's voxels, ground and targets, to count the LiDARs that see them. Under conditions a beam meets a target
    /// if enough light comes back; fog, snow and rain dim it, others change no target.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub fn redundancy_site(&self) -> Result<RedundancySite, JobError> {
        let targets = self.target_site()?.cloned();
        Ok(RedundancySite::new(self.scene(), self.problem()?, targets))
    }
}

/// The P-SOG of a scene: the file that it names, or one built from virtual scans.
///
/// A scan asks `go_on` as [`scan_scene`] does.
fn psog_of(scene: &Scene, go_on: impl Fn(usize) -> bool) -> Result<Psog, JobError> {
    match scene.psog_source() {
        PsogSource::File(path) => {
            let psog = read_psog(path).map_err(|source| {
                let scene = scene.files().first().filter(|file| *file != path);
                let scene = scene.map_or("the scene".to_owned(), |f| f.display().to_string());
                JobError::Psog { place: format!("{scene}: psog.file"), source }
            })?;
            scene.check_detection(psog.classes())?;
            Ok(psog)
        }
        PsogSource::Scan(settings) => {
            Ok(scan_scene(scene, &scene.roi().grid()?, settings, go_on)?.0)
        }
    }
}

impl Job {
    /// Voxels, ground and targets by the number of LiDARs that see them: for each scene, each placement. Targets are
    /// those of [`redundancy_question`](crate::shared::redundancy_question).
    ///
    /// # Errors
    /// See [`Self::evaluator`]; an engine that fails, a sensor that the vehicle does not have.
    pub fn redundancy(
        &self,
        placements: &[Placement],
        question: &TargetQuestion,
    ) -> Result<Vec<Redundancy>, JobError> {
        let (mut evaluator, _) = self.clone().mirrored(false).evaluator(|_| {})?;
        let mut all = Vec::new();
        for (index, scene) in self.scenes.iter().enumerate() {
            let (site, (_, engine)) = (scene.redundancy_site()?, evaluator.member_mut(index));
            for placement in placements {
                all.push(site.look(engine, question, placement)?);
            }
        }
        Ok(all)
    }

    /// Surfaces and directions that pairs of LiDARs share: for each scene, each placement. Pairs of `least_shared` or
    /// more voxels count.
    ///
    /// # Errors
    /// See [`Self::evaluator`] and [`Overlap::new`].
    pub fn overlap(
        &self,
        placements: &[Placement],
        least_shared: u64,
    ) -> Result<Vec<Overlap>, JobError> {
        let (mut evaluator, _) = self.clone().mirrored(false).evaluator(|_| {})?;
        let mut all = Vec::new();
        for (index, scene) in self.scenes.iter().enumerate() {
            let (member, engine) = evaluator.member_mut(index);
            for placement in placements {
                let (scene, problem) = (scene.scene(), member.problem());
                all.push(Overlap::new(scene, problem, engine, placement, least_shared)?);
            }
        }
        Ok(all)
    }
}
