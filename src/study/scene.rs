//! A scene of a study: jobs, searches and scores that differ in one thing from case to case.

use super::{StudyError, StudyObserver, StudySettings};
use crate::engine::BackendError;
use crate::job::{Job, JobScene};
use crate::psog::{PsogError, Roi};
use crate::scan::conditions::{in_words, under};
use crate::scan::scan_scene;
use crate::scene::{PsogSource, Scene};
use crate::score::{Objective, Scores};
use crate::search::{Evaluator, Event, Settings, optimize};
use crate::targets::RangeCard;
use crate::vehicle::{Constraints, Placement, Sensors, table_7};

/// The job that all cases of a study in one scene vary.
pub(super) struct StudyScene<'a> {
    job: Job,
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a StudySettings,
    /// The layouts of Table 7, which stand beside every result.
    pub(super) published: Vec<Placement>,
    observer: &'a dyn StudyObserver,
}

impl<'a> StudyScene<'a> {
    pub(super) fn new(
        scene: &'a JobScene,
        settings: &'a StudySettings,
        observer: &'a dyn StudyObserver,
    ) -> Result<Self, StudyError> {
        // The notes of a table say so.
        let mut published = table_7();
        scene.models()?.name_first(&mut published);
        let job = Job::new(scene.clone()).conditions(&settings.conditions);
        let job = job.frames(Some(settings.frames)).engine(settings.engine.clone());
        let this = Self { job, scene: scene.scene(), settings, published, observer };
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

    /// Title of a study of this scene, with the weather that it is made in.
    pub(super) fn title(&self, text: &str) -> String {
        let under = under(&in_words(&self.settings.conditions));
        format!("{}{under}: {text}", self.scene.name())
    }

    /// The mount's rules as the scene has them.
    pub(super) fn constraints(&self) -> Constraints {
        self.scene.constraints()
    }

    /// Frames that every score is a mean over.
    pub(super) fn frames(&self) -> Vec<usize> {
        self.job.scenes()[0].frame_numbers()
    }

    /// An evaluator of the scene as it is.
    pub(super) fn evaluator(&self) -> Result<Evaluator, StudyError> {
        self.open(&self.job)
    }

    /// Range cards of placements; empty where beams end at nothing.
    pub(super) fn range_cards(
        &self,
        placements: &[Placement],
    ) -> Result<Vec<RangeCard>, StudyError> {
        let Some(site) = self.job.target_site()? else { return Ok(Vec::new()) };
        let cards = placements.iter().map(|placement| RangeCard::new(site, &placement.lidars));
        Ok(cards.collect::<Result<_, _>>().map_err(BackendError::from)?)
    }

    /// An evaluator with other rules of the mount, over the same trees.
    pub(super) fn evaluator_under(
        &self,
        constraints: &Constraints,
    ) -> Result<Evaluator, StudyError> {
        self.job.problem()?;
        self.open(&self.job.clone().constraints(constraints))
    }

    /// An evaluator with other sensors.
    pub(super) fn evaluator_with(&self, sensors: &Sensors) -> Result<Evaluator, StudyError> {
        self.open(&self.job.clone().sensors(sensors))
    }

    /// An evaluator with voxels of another size; an error for a scene whose P-SOG is a file.
    pub(super) fn evaluator_of_voxels(&self, voxel: [f64; 3]) -> Result<Evaluator, StudyError> {
        let PsogSource::Scan(settings) = self.scene.psog_source() else {
            return Err(StudyError::FixedVoxels { scene: self.place() });
        };
        let bounds = self.scene.roi();
        let roi = Roi::from_bounds(bounds.min, bounds.max, voxel).map_err(PsogError::from)?;
        let (psog, _) = scan_scene(self.scene, &roi, settings, |_| self.goes_on())?;
        self.open(&self.job.clone().on_grid_of(psog))
    }

    fn open(&self, job: &Job) -> Result<Evaluator, StudyError> {
        let (evaluator, notes) = job.evaluator(|_| {})?;
        self.observer.opened(&notes);
        Ok(evaluator)
    }

    /// The best placement that a search of the study's size finds from the published ones.
    pub(super) fn optimize(&self, evaluator: &Evaluator) -> Result<Option<Placement>, StudyError> {
        self.optimize_from(evaluator, &self.settings.objective, &self.published)
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

    /// Scores of one placement; see [`Self::scores`].
    pub(super) fn score(
        &self,
        evaluator: &mut Evaluator,
        placement: &Placement,
    ) -> Result<Scores, StudyError> {
        Ok(self.scores(evaluator, std::slice::from_ref(placement))?.remove(0))
    }

    /// False once the observer wants to stop.
    pub(super) fn goes_on(&self) -> bool {
        self.observer.goes_on()
    }
}
