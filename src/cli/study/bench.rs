use std::path::Path;
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sightline::problem::Problem;
use sightline::problem::spread;
use sightline::psog::{Psog, Roi};
use sightline::scan::scan_scene;
use sightline::scene::{PsogSource, Scene};
use sightline::score::{Objective, Scores};
use sightline::search::{Evaluator, SearchSettings, best_placement};
use sightline::vehicle::{BeamTable, Constraints, Placement};

use super::{Args, FRAMES};
use crate::cli::args::{Compute, Talk};
use crate::cli::error::Error;
use crate::cli::interrupt::Interrupt;
use crate::cli::{load, optimize};

/// A scene with all that stays the same while a study varies something.
pub(super) struct Bench<'a> {
    pub args: &'a Args,
    pub objective: Objective,
    pub scene: Scene,
    pub psog: Arc<Psog>,
    pub table_7: Vec<Placement>,
    compute: Compute,
    interrupt: Interrupt,
}

impl<'a> Bench<'a> {
    /// Opens the first scene.
    pub fn new(
        args: &'a Args,
        objective: &Objective,
        interrupt: &Interrupt,
    ) -> Result<Self, Error> {
        Self::of(args, &args.scenes[0], objective, interrupt)
    }

    /// Opens another scene of the same study.
    pub fn beside(&self, scene: &Path) -> Result<Self, Error> {
        Self::of(self.args, scene, &self.objective, &self.interrupt)
    }

    fn of(
        args: &'a Args,
        path: &Path,
        objective: &Objective,
        interrupt: &Interrupt,
    ) -> Result<Self, Error> {
        let (scene, psog, _) = load::scene_and_psog(path, args.compute.talk)?;
        load::note_frames(&scene, args.frames, args.compute.talk);
        // Backends are opened again and again; which one is said once would be said each time.
        let quiet = Talk { quiet: true, verbose: false };
        let bench = Self {
            args,
            objective: objective.clone(),
            scene,
            psog,
            table_7: optimize::table_7()?,
            compute: Compute { talk: quiet, ..args.compute.clone() },
            interrupt: interrupt.clone(),
        };
        let evaluator = bench.evaluator()?;
        let backend = evaluator.backend();
        args.compute.talk.note(format!("computing on {}: {}", backend.name(), backend.adapter()));
        if objective.needs_detection() && !evaluator.problem().content().has_detection() {
            return Err(Error::Usage(format!(
                "{}: the objective `{objective}` needs a detection target; name its classes under \
                 `detection` in the scene",
                path.display()
            )));
        }
        Ok(bench)
    }

    /// The mount as the scene has it.
    pub fn constraints(&self) -> Constraints {
        Constraints::from(self.scene.mount())
    }

    /// Frames of the study.
    pub fn frames(&self) -> Vec<usize> {
        spread(self.scene.frame_count(), Some(self.args.frames.unwrap_or(FRAMES)))
    }

    /// An evaluator of the scene as it is.
    pub fn evaluator(&self) -> Result<Evaluator, Error> {
        self.evaluator_with(&self.psog, self.scene.lidar().table()?, self.constraints())
    }

    /// An evaluator with another P-SOG, sensor or mount.
    pub fn evaluator_with(
        &self,
        psog: &Psog,
        table: BeamTable,
        constraints: Constraints,
    ) -> Result<Evaluator, Error> {
        let frames = self.frames();
        let problem = if std::ptr::eq(psog, &*self.psog) {
            Problem::from_scene(&self.scene, psog, table, &frames)?
        } else {
            Problem::on_grid_of(psog, &self.scene, table, &frames)?
        };
        load::evaluator(problem.with_constraints(constraints), &self.compute)
    }

    /// The P-SOG with voxels of another size; an error for a scene without geometry.
    pub fn psog_of(&self, voxel: [f64; 3]) -> Result<Psog, Error> {
        let PsogSource::Scan(settings) = self.scene.psog_source() else {
            return Err(Error::Usage(format!(
                "{}: its P-SOG is a file, which has voxels of one size; a scene with geometry can be \
                 scanned again",
                self.args.scenes[0].display()
            )));
        };
        let bounds = self.scene.roi();
        let roi = Roi::from_bounds(bounds.min, bounds.max, voxel)?;
        Ok(scan_scene(&self.scene, &roi, settings, || ())?.0)
    }

    /// The best placement that a search of the study's size finds.
    pub fn optimize(
        &self,
        evaluator: &mut Evaluator,
        starts: &[Placement],
    ) -> Result<Option<Placement>, Error> {
        self.optimize_for(evaluator, &self.objective, starts)
    }

    /// As [`Self::optimize`], for another objective.
    pub fn optimize_for(
        &self,
        evaluator: &mut Evaluator,
        objective: &Objective,
        starts: &[Placement],
    ) -> Result<Option<Placement>, Error> {
        let settings = SearchSettings {
            objective: objective.to_string(),
            evaluations: self.args.evaluations,
            population: None,
            batch: None,
            seed: self.args.seed,
            delta: None,
        };
        let memory = self.compute.memory_budget() / 2;
        let go_on = || !self.interrupt.is_set();
        let best = best_placement(evaluator, objective, starts, &settings, memory, &go_on)?;
        Ok(best.map(|(placement, _)| placement))
    }

    /// Whether the user has not asked to stop.
    pub fn goes_on(&self) -> bool {
        !self.interrupt.is_set()
    }

    /// Random placements within the mount that keep its rules, uniform in every free pose field.
    pub fn random(&self, count: usize) -> Vec<Placement> {
        let constraints = self.constraints();
        let bounds = constraints.variable_bounds();
        let mut rng = ChaCha8Rng::seed_from_u64(self.args.seed);
        let mut drawn = Vec::new();
        // Crowded mounts are given up on in the end.
        for _ in 0..1000 * count {
            if drawn.len() == count {
                break;
            }
            let variables: Vec<f64> =
                bounds.iter().map(|&(low, high)| rng.random_range(low..=high)).collect();
            let name = format!("random-{}", drawn.len());
            let placement = Placement { name, lidars: constraints.poses_of(&variables) };
            if constraints.violations(&placement).is_empty() {
                drawn.push(placement);
            }
        }
        drawn
    }

    /// Scores of one placement.
    pub fn score(&self, evaluator: &mut Evaluator, placement: &Placement) -> Result<Scores, Error> {
        Ok(evaluator.scores(std::slice::from_ref(placement))?.remove(0))
    }
}
