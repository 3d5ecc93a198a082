//! The main job: scenes, a vehicle, weather, an objective, a budget, an engine; scores and the best placement.
//!
//! | file | holds |
//! |---|---|
//! | `scene` | one scene of a job: P-SOG, frames, sensors and weather, and the problem that these pose |
//! | `search` | the search of a job step by step: sensors for the money, placements, own body |
//! | `files` | a job as its files and options say it, to be saved and repeated |
//! | `sweep` | one pose field of one LiDAR moved through a range |
//! | `loss` | a placement without each of its LiDARs in turn |
//! | `room` | how far each pose field may be off until a requirement breaks |
//! | `front` | the front of two or three objectives |
//! | `holds` | requirements in copies that are mounted a little off |
//! | `on_targets` | a closer look at requirements on targets |
//! | `error` | why a job cannot be posed or searched |
//!
//! Program, Python module, studies, chart and audit all go through a [`Job`].

mod error;
mod files;
mod front;
mod holds;
mod loss;
mod on_targets;
mod relief;
mod room;
mod scene;
mod search;
mod sweep;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use crate::engine::{Backend, BackendError, EngineChoice};
use crate::json::distinct;
use crate::near_field::{FEW_PLACEMENTS, below_ground, self_hits};
use crate::problem::Problem;
use crate::psog::Psog;
use crate::scan::conditions::Condition;
use crate::scene::Scene;
use crate::score::{Guard, Objective, Scores};
use crate::search::{Evaluator, Judged, SearchError, Settings, Suite, TimeLimit};
use crate::targets::{RangeCard, TargetSite};
use crate::vehicle::{Constraints, Placement, Sensors};
use scene::{Frames, Worth};

pub use crate::search::Tolerance;
pub use error::JobError;
pub use files::JobFiles;
pub use front::{
    FRONT_EVALUATIONS, Front, FrontError, FrontObjective, FrontObjectives, FrontPoint, FrontState,
    FrontStopped, Pick,
};
pub(crate) use loss::without;
pub use loss::{Loss, Losses};
pub use room::{
    MOST_ABOUT, MOST_TILT, Room, RoomOfCopies, RoomOfField, RoomOfLidar, RoomOfSide, RoomOfTilt,
    RoomSteps, TiltedTo, moves_of,
};
pub use scene::JobScene;
pub use search::{Found, JobRun, JobState, JobStep};
pub use sweep::{Sweep, SweepRow, SweptField};

/// Scenes with a vehicle, weather, budget and settings: [`Self::score`] judges placements in them, [`Self::optimize`]
/// searches the best one.
///
/// Methods that take the job by value change one of these, as `.frames(Some(4))`, and give it back.
#[derive(Debug, Clone)]
pub struct Job {
    /// At least one.
    scenes: Vec<JobScene>,
    /// Each scene counts mirrored left to right, too.
    mirror: bool,
    /// Vehicle file given beside the scenes, for errors.
    vehicle_file: Option<PathBuf>,
    /// Most that the sensors of the vehicle may cost; `None` sets no limit.
    budget: Option<f64>,
    /// The fewest sensors that meet all requirements, then the cheapest.
    fewest: bool,
    /// Mounting within which requirements are to hold; `None` does not look.
    tolerance: Option<Tolerance>,
    /// Objective, seed, engine and length of the search.
    settings: Settings,
    /// True if a vehicle's result is compared with a plain layout of its own sensors, not with [`Settings::baselines`].
    is_plain: bool,
}

impl Job {
    /// A job in one scene: its own vehicle, all frames, clear air, the default search.
    pub fn new(scene: impl Into<JobScene>) -> Self {
        let (scenes, settings) = (vec![scene.into()], Settings::default());
        Self {
            scenes,
            mirror: false,
            vehicle_file: None,
            budget: None,
            fewest: false,
            tolerance: None,
            settings,
            is_plain: true,
        }
    }

    /// A job over the scenes of several jobs, each with its own frames and weather; their mean is maximized.
    /// Mirroring, budget and search come from the first.
    ///
    /// # Errors
    /// No job at all.
    pub fn join(jobs: impl IntoIterator<Item = Self>) -> Result<Self, JobError> {
        let mut jobs = jobs.into_iter();
        let mut all = jobs.next().ok_or(SearchError::NoScene)?;
        all.scenes.extend(jobs.flat_map(|job| job.scenes));
        Ok(all)
    }

    fn with(mut self, change: impl Fn(&mut JobScene)) -> Self {
        self.scenes = self.scenes.into_iter().map(|scene| scene.with(&change)).collect();
        self
    }

    /// Takes this P-SOG in place of each scene's own. It must lie on the scene's grid.
    #[must_use]
    pub fn psog(self, psog: impl Into<Arc<Psog>>) -> Self {
        let psog = Arc::new(OnceLock::from(psog.into()));
        self.with(|scene| (scene.psog, scene.worth) = (psog.clone(), Worth::OwnGrid))
    }

    /// Takes this P-SOG in place of each scene's own, and its grid in place of the scene's.
    #[must_use]
    pub(crate) fn on_grid_of(self, psog: impl Into<Arc<Psog>>) -> Self {
        self.psog(psog).with(|scene| scene.worth = Worth::OtherGrid)
    }

    /// Takes geometry alone, without P-SOGs and requirements: no voxel holds information. For beams, hits and scans.
    #[must_use]
    pub fn geometry_alone(self) -> Self {
        self.with(|scene| scene.worth = Worth::Unasked)
    }

    /// Takes geometry and requirements, without P-SOGs: no voxel holds information.
    #[must_use]
    pub(crate) fn without_psogs(self) -> Self {
        self.with(|scene| scene.worth = Worth::Nothing)
    }

    /// Sets weather and faults of every scene.
    #[must_use]
    pub fn conditions(self, conditions: &[Condition]) -> Self {
        self.with(|scene| scene.conditions = conditions.to_vec())
    }

    /// Takes `frames` frames of each scene, spread evenly from the first on; all if `None`.
    #[must_use]
    pub fn frames(self, frames: Option<u32>) -> Self {
        self.with(|scene| scene.frames = Frames::Spread(frames))
    }

    /// Takes one frame by its number from 0, which each scene must have.
    #[must_use]
    pub fn one_frame(self, frame: usize) -> Self {
        self.with(|scene| scene.frames = Frames::One(frame))
    }

    /// Replaces the sensor models of the scenes' vehicle.
    #[must_use]
    pub fn sensors(self, sensors: &Sensors) -> Self {
        self.with(|scene| scene.sensors = Some(sensors.clone()))
    }

    /// Replaces the rules of placements of the scenes' vehicle. Problems made so far keep their trees.
    #[must_use]
    pub fn constraints(mut self, constraints: &Constraints) -> Self {
        self.scenes = self.scenes.into_iter().map(|scene| scene.under(constraints)).collect();
        self
    }

    /// Random draw, by its number, of free phases and of the beams that return through weather; 0 is the usual one.
    #[must_use]
    pub fn draw(self, draw: u64) -> Self {
        self.with(|scene| scene.draw = draw)
    }

    /// If `mirror`, each scene also counts mirrored left to right.
    #[must_use]
    pub fn mirrored(self, mirror: bool) -> Self {
        Self { mirror, ..self }
    }

    /// Most that the sensors of the vehicle may cost, in the currency of its prices; `None` sets no limit.
    #[must_use]
    pub fn budget(self, budget: Option<f64>) -> Self {
        Self { budget, ..self }
    }

    /// Takes the fewest sensors of the vehicle that meet all requirements: among equal numbers the cheapest, and their best
    /// placement.
    #[must_use]
    pub fn fewest(self, fewest: bool) -> Self {
        Self { fewest, ..self }
    }

    /// Mounting tolerance within which requirements are to hold; `None` does not look.
    #[must_use]
    pub fn tolerance(self, tolerance: Option<Tolerance>) -> Self {
        Self { tolerance, ..self }
    }

    /// Length and method of the search, with its objective, seed and engine.
    #[must_use]
    pub fn search(self, settings: Settings) -> Self {
        let is_plain = settings.baselines == Settings::default().baselines;
        Self { settings, is_plain, ..self }
    }

    /// Score to maximize.
    #[must_use]
    pub fn objective(mut self, objective: Objective) -> Self {
        self.settings.objective = objective;
        self
    }

    /// Sets the placements that a result is compared with.
    ///
    /// By default they are Table 7 of Place3D. For a vehicle it is one plain layout of the sensors found.
    #[must_use]
    pub fn baselines(mut self, baselines: Vec<Placement>) -> Self {
        (self.settings.baselines, self.is_plain) = (baselines, false);
        self
    }

    /// Placements that a front is compared with: none unless they were given.
    fn compared_with(&self) -> &[Placement] {
        if self.is_plain { &[] } else { &self.settings.baselines }
    }

    /// Engine that computes; every engine gives the same bits.
    #[must_use]
    pub fn engine(mut self, engine: EngineChoice) -> Self {
        self.settings.engine = engine;
        self
    }

    /// Limit of wall time of a search.
    #[must_use]
    pub fn within(mut self, time: Option<TimeLimit>) -> Self {
        self.settings.time = time;
        self
    }

    /// The scenes, in order.
    pub fn scenes(&self) -> &[JobScene] {
        &self.scenes
    }

    /// The first scene, whose vehicle all share.
    pub fn scene(&self) -> &Arc<Scene> {
        self.scenes[0].scene()
    }

    /// Objective, seed, engine and length of the search.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Weather and faults of any scene, as they are written, each once.
    pub fn conditions_in_words(&self) -> Vec<String> {
        distinct(self.scenes.iter().flat_map(JobScene::conditions_in_words))
    }

    /// The problem of the first scene, made on first use.
    ///
    /// # Errors
    /// A P-SOG, sensors or weather that do not fit the scene.
    pub fn problem(&self) -> Result<Arc<Problem>, JobError> {
        self.scenes[0].problem()
    }

    /// The problems of all scenes and of their mirror images, each made on first use.
    ///
    /// # Errors
    /// See [`Self::problem`]; scenes that do not share sensors and rules, each named by its file.
    pub fn suite(&self) -> Result<Suite, JobError> {
        let named = |scene: &JobScene| Ok((scene.scene().name().to_owned(), scene.problem()?));
        let named = self.scenes.iter().map(named).collect::<Result<Vec<_>, JobError>>()?;
        let suite = Suite::new(named).map_err(|error| self.in_scene(error))?;
        Ok(if self.mirror { suite.with_mirror_images() } else { suite })
    }

    /// Opens an engine for each scene and mirror image; returns notes for the user, too: the device, and why not
    /// another. `on_change` is called with a sentence on each device that is lost later.
    ///
    /// # Errors
    /// See [`Self::suite`]; the chosen device is missing, or cannot hold the problem.
    pub fn evaluator(
        &self,
        on_change: impl Fn(&str) + Clone + Send + 'static,
    ) -> Result<(Evaluator, Vec<String>), JobError> {
        Ok(Evaluator::open(&self.suite()?, &self.settings.engine, on_change)?)
    }

    /// Scores and guards of placements, over all scenes and in each of several. Up to [`FEW_PLACEMENTS`] are looked
    /// at for the guard `self_hit`, too, as `sightline score` does.
    ///
    /// # Errors
    /// See [`Self::evaluator`]; an engine that fails, a sensor that the vehicle does not have.
    pub fn score(&self, placements: &[Placement]) -> Result<Vec<Judged>, JobError> {
        let (mut evaluator, _) = self.evaluator(|_| {})?;
        let mut judged = evaluator.judged(placements)?;
        self.add_broken_rules(evaluator.problem().rules(), placements, &mut judged);
        if placements.len() <= FEW_PLACEMENTS {
            self.look_closely_by_scene(&mut evaluator, placements, &mut judged)?;
        }
        Ok(judged)
    }

    /// Adds the rules of the vehicle that placements break, which `rules` hold, to scores over all scenes and in each.
    pub(crate) fn add_broken_rules(
        &self,
        rules: &Constraints,
        placements: &[Placement],
        judged: &mut [Judged],
    ) {
        for (placement, judged) in placements.iter().zip(judged) {
            let broken = self.scene().vehicle().broken_rules(rules, placement);
            for scene in &mut judged.by_scene {
                scene.scores.broken_rules.clone_from(&broken);
            }
            judged.scores.broken_rules = broken;
        }
    }

    /// Adds to scores, by the first scene, whose own body stands for all scenes:
    ///
    /// - the guards `below_ground`, before all others, and `self_hit`, the range card, and the depth of the blind zone
    /// - places at which a target is missed although its requirement is met
    /// - the share of copies within the mounting tolerance that meet the requirements
    ///
    /// # Errors
    /// An engine that fails, a sensor that the vehicle does not have.
    pub fn look_closely<'a>(
        &self,
        engine: &mut dyn Backend,
        all: impl IntoIterator<Item = (&'a Placement, &'a mut Scores)>,
    ) -> Result<(), JobError> {
        self.look_closely_while(engine, all, &mut || true)?;
        Ok(())
    }

    /// Like [`Self::look_closely`]; false where `go_on`, which is asked often, said no before it was known how all
    /// requirements hold.
    ///
    /// # Errors
    /// See [`Self::look_closely`].
    pub fn look_closely_while<'a>(
        &self,
        engine: &mut dyn Backend,
        all: impl IntoIterator<Item = (&'a Placement, &'a mut Scores)>,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<bool, JobError> {
        let problem = self.scenes[0].problem()?;
        let mut all: Vec<_> = all.into_iter().collect();
        for (placement, scores) in &mut all {
            let below = below_ground(self.scene(), &problem, placement);
            scores.guards = [below, std::mem::take(&mut scores.guards)].concat();
            scores.guards.extend(self_hits(self.scene(), &problem, engine, placement)?);
        }
        let is_whole = self.add_holds(&mut all, go_on)?;
        self.look_at_targets(&mut all)?;
        self.add_range_cards(
            all.iter_mut().map(|(placement, scores)| (*placement, &mut **scores)),
        )?;
        // Python looks closely at any number: their arrays have no blind zone, which takes casts of its own.
        if all.len() <= FEW_PLACEMENTS {
            self.scenes[0].add_blind_zones(self.settings.engine.memory, all)?;
        }
        Ok(is_whole)
    }

    /// Adds the range card to scores, and its blind sectors to their guards. Coverage `through` adds nothing.
    ///
    /// # Errors
    /// A sensor that the vehicle does not have.
    pub(crate) fn add_range_cards<'a>(
        &self,
        all: impl IntoIterator<Item = (&'a Placement, &'a mut Scores)>,
    ) -> Result<(), JobError> {
        Ok(add_range_cards(self.card_site()?, all)?)
    }

    /// Sensors and body of the first scene's vehicle, for beams on targets; `None` with coverage `through`.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub fn target_site(&self) -> Result<Option<&TargetSite>, JobError> {
        self.scenes[0].target_site()
    }

    /// Site of range cards, in the first scene: on its ground where that is not level. `None` with coverage `through`.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub fn card_site(&self) -> Result<Option<&TargetSite>, JobError> {
        self.scenes[0].card_site()
    }

    /// Adds the guard `self_hit` to scores over all scenes, and to those in each of several by its own body.
    ///
    /// # Errors
    /// See [`Self::look_closely`].
    pub(crate) fn look_closely_by_scene(
        &self,
        evaluator: &mut Evaluator,
        placements: &[Placement],
        judged: &mut [Judged],
    ) -> Result<(), JobError> {
        self.look_closely_by_scene_while(evaluator, placements, judged, &mut || true)?;
        Ok(())
    }

    /// Like [`Self::look_closely_by_scene`], and as [`Self::look_closely_while`].
    pub(crate) fn look_closely_by_scene_while(
        &self,
        evaluator: &mut Evaluator,
        placements: &[Placement],
        judged: &mut [Judged],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<bool, JobError> {
        let all = placements.iter().zip(judged.iter_mut().map(|judged| &mut judged.scores));
        let is_whole = self.look_closely_while(evaluator.backend_mut(), all, go_on)?;
        let problem = self.problem()?;
        let rules = problem.target_rules();
        for Judged { scores, by_scene, .. } in judged.iter_mut() {
            let required = by_scene.iter_mut().flat_map(|scene| &mut scene.scores.required);
            for seen in required {
                // On level ground every scene is the same; elsewhere each has its own share.
                let is_level = rules.iter().any(|rule| rule.name == seen.name && !rule.on_scene);
                let of = scores.required.iter().find(|of| is_level && of.name == seen.name);
                of.into_iter().for_each(|of| seen.clone_from(of));
            }
        }
        let several = if self.suite()?.is_single() { 0 } else { evaluator.members().len() };
        for index in 0..several {
            let (member, engine) = evaluator.member_mut(index);
            let scene = &self.scenes[member.scene()];
            for (placement, judged) in member.seen(placements).iter().zip(judged.iter_mut()) {
                let below = below_ground(scene.scene(), member.problem(), placement);
                let hits = self_hits(scene.scene(), member.problem(), engine, placement)?;
                judged.by_scene[index].scores.guards.extend(below.into_iter().chain(hits));
            }
            // A mirror image has the sectors of its scene on the other side.
            if !member.is_mirrored() {
                let by_scene = judged.iter_mut().map(|judged| &mut judged.by_scene[index].scores);
                add_range_cards(scene.card_site()?, placements.iter().zip(by_scene))?;
                let by_scene = judged.iter_mut().map(|judged| &mut judged.by_scene[index].scores);
                scene.add_blind_zones(
                    self.settings.engine.memory,
                    placements.iter().zip(by_scene),
                )?;
            }
        }
        Ok(is_whole)
    }

    /// An error of the search with the file of the scene that it is about.
    fn in_scene(&self, source: SearchError) -> JobError {
        match source.scene().and_then(|scene| self.scenes.get(scene)) {
            Some(scene) => JobError::InScene { scene: scene.place(), source },
            None => source.into(),
        }
    }
}

/// Range cards of placements on a site, and their blind sectors as guards; nothing where there is no site.
fn add_range_cards<'a>(
    site: Option<&TargetSite>,
    all: impl IntoIterator<Item = (&'a Placement, &'a mut Scores)>,
) -> Result<(), BackendError> {
    let Some(site) = site else { return Ok(()) };
    for (placement, scores) in all {
        let card = RangeCard::new(site, &placement.lidars)?;
        scores.guards.extend(card.blind.iter().cloned().map(Guard::BlindSector));
        scores.range_card = Some(card);
    }
    Ok(())
}
