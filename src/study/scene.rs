//! A scene of a study: jobs, searches and scores that differ in one thing from case to case.

use std::cell::OnceCell;

use super::lidars::SearchSpace;
use super::table::check_distinct;
use super::{Kind, Row, StudyError, StudyObserver, StudySettings};
use crate::job::{Job, JobError, JobScene, Losses};
use crate::json::counted;
use crate::near_field::self_hits;
use crate::psog::{PsogError, Roi};
use crate::scan::conditions::under;
use crate::scan::scan_scene;
use crate::scene::{PsogSource, ScanSettings, Scene};
use crate::score::{Objective, Scores, lidar_name};
use crate::search::{Evaluator, Event, Limits, Settings, optimize};
use crate::vehicle::{Constraints, Placement, table_7, table_7_held_by};

/// The job that all cases of a study in one scene vary.
pub(super) struct StudyScene<'a> {
    pub(super) job: Job,
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a StudySettings,
    /// Own rigs; without any the layouts of Table 7 for the paper's car (one model, a mount that holds them).
    pub(super) layouts: Vec<Placement>,
    rig: OnceCell<SearchSpace>,
    observer: &'a dyn StudyObserver,
}

impl<'a> StudyScene<'a> {
    pub(super) fn new(
        kind: Kind,
        scene: &'a JobScene,
        settings: &'a StudySettings,
        observer: &'a dyn StudyObserver,
    ) -> Result<Self, StudyError> {
        if kind == Kind::Published && !scene.scene().vehicle().is_nameless() {
            return Err(StudyError::OtherVehicle { scene: scene.place() });
        }
        let mut layouts = match kind {
            Kind::Published => table_7(),
            _ => table_7_held_by(scene.scene().vehicle()),
        };
        scene.models()?.name_first(&mut layouts);
        if !settings.placements.is_empty() {
            layouts.clone_from(&settings.placements);
        }
        let names = layouts.iter().map(|layout| &*layout.name);
        check_distinct(names, "placements", "give each a `name` of its own")?;
        let weather = if kind == Kind::Weather { &[][..] } else { &settings.conditions };
        let job = Job::new(scene.clone()).conditions(weather);
        let job = job.frames(Some(settings.frames)).engine(settings.engine.clone());
        let this =
            Self { job, scene: scene.scene(), settings, layouts, rig: OnceCell::new(), observer };
        if this.scene.vehicle().is_nameless() && settings.budget.is_some() {
            return Err(JobError::NoPrices.into());
        }
        let objective = &settings.objective;
        let psog = scene.psog(|_| observer.goes_on())?;
        if objective.needs_detection() && this.scene.detection_among(psog.classes()).is_empty() {
            let (scene, objective) = (this.place(), objective.to_string());
            return Err(StudyError::NoDetection { scene, objective });
        }
        Ok(this)
    }

    /// The scene's file, or its name where it was read from none.
    pub(super) fn place(&self) -> String {
        self.job.scenes()[0].place()
    }

    /// Title of a study of this scene, with its frames and the weather that it is made in.
    pub(super) fn title(&self, text: &str) -> String {
        let (under, count) = (under(&self.job.conditions_in_words()), self.frames().len());
        format!("{}, {}{under}: {text}", self.scene.name(), counted(count, "frame"))
    }

    /// Own rigs, or the paper's layouts.
    ///
    /// # Errors
    /// There are none: the vehicle is not the paper's car.
    pub(super) fn some_layouts(&self) -> Result<&[Placement], StudyError> {
        match &self.layouts[..] {
            [] => Err(StudyError::NoPlacements { scene: self.place() }),
            layouts => Ok(layouts),
        }
    }

    /// The rig whose placements are searched, chosen on first use.
    pub(super) fn rig(&self) -> Result<&SearchSpace, StudyError> {
        if self.rig.get().is_none() {
            let _ = self.rig.set(SearchSpace::chosen(self)?);
        }
        Ok(self.rig.get().expect("set above"))
    }

    /// Sensors of the rig that is searched, in words; nothing where none was chosen.
    pub(super) fn rig_in_words(&self) -> Option<String> {
        let words = self.rig.get()?.words.as_ref()?;
        Some(format!("{}: the sensors searched are {words}.", self.scene.name()))
    }

    /// Money and number of sensors that the settings allow.
    pub(super) fn limits(&self) -> Limits {
        Limits::budget(self.settings.budget.unwrap_or(f64::INFINITY))
    }

    /// Names of the LiDARs of a placement: the number, and the mount where the vehicle names some.
    pub(super) fn lidar_names(&self, placement: &Placement) -> Vec<String> {
        let rules = self.scene.rules();
        let mounts = rules.mount_names(placement);
        let name = |lidar: usize| lidar_name(lidar, mounts.get(lidar).copied().flatten());
        (0..placement.lidars.len()).map(name).collect()
    }

    /// Frames that every score is a mean over.
    pub(super) fn frames(&self) -> Vec<usize> {
        self.job.scenes()[0].frame_numbers()
    }

    /// An evaluator of the scene as it is.
    pub(super) fn evaluator(&self) -> Result<Evaluator, StudyError> {
        self.open(&self.job)
    }

    /// An evaluator with other rules of the mount, over the same trees.
    pub(super) fn evaluator_under(
        &self,
        constraints: &Constraints,
    ) -> Result<Evaluator, StudyError> {
        self.job.problem()?;
        self.open(&self.job.clone().constraints(constraints))
    }

    /// An evaluator of the rig that is searched.
    pub(super) fn evaluator_of_rig(&self) -> Result<Evaluator, StudyError> {
        self.evaluator_under(&self.rig()?.constraints)
    }

    /// Settings of the scan that voxels of another size are made by.
    ///
    /// # Errors
    /// [`StudyError::FixedVoxels`] for a scene whose P-SOG is a file.
    pub(super) fn may_have_voxels(&self) -> Result<&ScanSettings, StudyError> {
        match self.scene.psog_source() {
            PsogSource::Scan(settings) => Ok(settings),
            PsogSource::File(_) => Err(StudyError::FixedVoxels { scene: self.place() }),
        }
    }

    /// An evaluator with voxels of another size; an error for a scene whose P-SOG is a file.
    pub(super) fn evaluator_of_voxels(&self, voxel: [f64; 3]) -> Result<Evaluator, StudyError> {
        let settings = self.may_have_voxels()?;
        let bounds = self.scene.roi();
        let roi = Roi::from_bounds(bounds.min, bounds.max, voxel).map_err(PsogError::from)?;
        let (psog, _) = scan_scene(self.scene, &roi, settings, |_| self.goes_on())?;
        self.open(&self.job.clone().on_grid_of(psog))
    }

    pub(super) fn open(&self, job: &Job) -> Result<Evaluator, StudyError> {
        let (evaluator, notes) = job.evaluator(|_| {})?;
        self.observer.opened(&notes);
        Ok(evaluator)
    }

    /// The best placement of the rig that a search of the study's size finds.
    pub(super) fn optimize(&self, evaluator: &Evaluator) -> Result<Option<Placement>, StudyError> {
        self.optimize_from(evaluator, &self.settings.objective, &self.rig()?.starts)
    }

    /// Like [`Self::optimize`], for another objective and from other starts.
    pub(super) fn optimize_from(
        &self,
        evaluator: &Evaluator,
        objective: &Objective,
        starts: &[Placement],
    ) -> Result<Option<Placement>, StudyError> {
        let settings = Settings {
            objective: objective.clone(),
            evaluations: self.settings.evaluations,
            seed: self.settings.seed,
            baselines: starts.to_vec(),
            engine: self.settings.engine.clone(),
            ..Settings::default()
        };
        let mut observe = |_: &Event| self.goes_on();
        let outcome = optimize(evaluator.shared_problem(), &settings, &mut observe)?;
        Ok(outcome.best.map(|best| best.placement))
    }

    /// Scores of placements. The observer is asked before every few of them.
    ///
    /// # Errors
    /// [`StudyError::Stopped`] once the observer wants to stop.
    pub(super) fn scores(
        &self,
        evaluator: &mut Evaluator,
        placements: &[Placement],
    ) -> Result<Vec<Scores>, StudyError> {
        let scores = evaluator.scores_while(placements, &mut || self.goes_on())?;
        scores.ok_or(StudyError::Stopped)
    }

    /// Scores of one placement, looked at for the guard `self_hit`, too, as `sightline score` does; see [`Self::scores`].
    pub(super) fn score(
        &self,
        evaluator: &mut Evaluator,
        placement: &Placement,
    ) -> Result<Scores, StudyError> {
        let mut scores = self.scores(evaluator, std::slice::from_ref(placement))?.remove(0);
        let problem = evaluator.shared_problem();
        let hits = self_hits(self.scene, &problem, evaluator.backend_mut(), placement)?;
        scores.guards.extend(hits);
        Ok(scores)
    }

    /// A placement with each of its LiDARs lost in turn.
    pub(super) fn losses(
        &self,
        evaluator: &mut Evaluator,
        placement: &Placement,
    ) -> Result<Losses, StudyError> {
        let losses = self.job.losses_while(evaluator, placement, &mut || self.goes_on())?;
        losses.ok_or(StudyError::Stopped)
    }

    /// A case in which no placement was found.
    pub(super) fn none_found(&self) -> Row {
        Row::unanswered(format!(
            "no placement that keeps the rules and has a value of `{}` was found by {} evaluations",
            self.settings.objective, self.settings.evaluations
        ))
    }

    /// False once the observer wants to stop.
    pub(super) fn goes_on(&self) -> bool {
        self.observer.goes_on()
    }
}
