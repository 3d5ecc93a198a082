//! A scene of a study: problems, searches and scores that differ in one thing from case to case.

use std::sync::Arc;

use super::{StudyError, StudyObserver, StudySettings};
use crate::engine::open;
use crate::problem::{Problem, ProblemError, spread};
use crate::psog::{Psog, Roi};
use crate::scan::conditions::{in_words, under};
use crate::scan::{in_conditions, scan_scene};
use crate::scene::{PsogSource, Scene};
use crate::score::{Objective, Scores};
use crate::search::{Evaluator, Event, Settings, optimize};
use crate::vehicle::{Constraints, Placement, Sensors, table_7};

/// A scene with its P-SOG and everything that the cases of a study share.
pub(super) struct StudyScene<'a> {
    pub(super) scene: &'a Scene,
    pub(super) psog: &'a Psog,
    pub(super) settings: &'a StudySettings,
    /// The layouts of Table 7, which stand beside every result.
    pub(super) published: Vec<Placement>,
    observer: &'a dyn StudyObserver,
}

impl<'a> StudyScene<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        psog: &'a Psog,
        settings: &'a StudySettings,
        observer: &'a dyn StudyObserver,
    ) -> Result<Self, StudyError> {
        // The notes of a table say so.
        let mut published = table_7();
        scene.sensors()?.name_first(&mut published);
        let this = Self { scene, psog, settings, published, observer };
        let objective = &settings.objective;
        if objective.needs_detection() && scene.detection_among(psog.classes()).is_empty() {
            let (scene, objective) = (this.place(), objective.to_string());
            return Err(StudyError::NoDetection { scene, objective });
        }
        Ok(this)
    }

    /// The scene's file, or its name where it was read from none.
    pub(super) fn place(&self) -> String {
        let file = self.scene.files().first();
        file.map_or_else(|| self.scene.name().to_owned(), |file| file.display().to_string())
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
        spread(self.scene.frame_count(), Some(self.settings.frames))
    }

    /// An evaluator of the scene as it is.
    pub(super) fn evaluator(&self) -> Result<Evaluator, StudyError> {
        self.evaluator_with(self.scene.sensors()?, self.constraints())
    }

    /// An evaluator with another sensor or other rules of the mount.
    pub(super) fn evaluator_with(
        &self,
        sensors: impl Into<Sensors>,
        constraints: Constraints,
    ) -> Result<Evaluator, StudyError> {
        let problem = Problem::from_scene(self.scene, self.psog, sensors, &self.frames());
        let problem = problem.map_err(|source| self.misfit(source))?;
        self.open(problem.with_constraints(constraints))
    }

    /// An evaluator with voxels of another size; an error for a scene whose P-SOG is a file.
    pub(super) fn evaluator_of_voxels(&self, voxel: [f64; 3]) -> Result<Evaluator, StudyError> {
        let PsogSource::Scan(settings) = self.scene.psog_source() else {
            return Err(StudyError::FixedVoxels { scene: self.place() });
        };
        let bounds = self.scene.roi();
        let roi = Roi::from_bounds(bounds.min, bounds.max, voxel)?;
        let (psog, _) = scan_scene(self.scene, &roi, settings, || ())?;
        let sensors = self.scene.sensors()?;
        let problem = Problem::on_grid_of(&psog, self.scene, sensors, &self.frames());
        let problem = problem.map_err(|source| self.misfit(source))?;
        self.open(problem)
    }

    fn misfit(&self, source: ProblemError) -> StudyError {
        StudyError::Problem { scene: self.place(), source }
    }

    fn open(&self, problem: Problem) -> Result<Evaluator, StudyError> {
        let conditions = &self.settings.conditions;
        let problem = Arc::new(in_conditions(self.scene, problem, conditions)?);
        let opened = open(&problem, &self.settings.engine, |_| {})?;
        self.observer.opened(&opened.notes);
        Ok(Evaluator::new(problem, opened.engine))
    }

    /// The best placement that a search of the study's size finds from the published ones.
    pub(super) fn optimize(&self, evaluator: &Evaluator) -> Result<Option<Placement>, StudyError> {
        self.optimize_from(evaluator, &self.settings.objective, &self.published)
    }

    /// As [`Self::optimize`], for another objective and from other starts.
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

    /// Whether nobody has asked to stop.
    pub(super) fn goes_on(&self) -> bool {
        self.observer.goes_on()
    }
}

/// Scores of one placement.
pub(super) fn score(
    evaluator: &mut Evaluator,
    placement: &Placement,
) -> Result<Scores, StudyError> {
    Ok(evaluator.scores(std::slice::from_ref(placement))?.remove(0))
}
