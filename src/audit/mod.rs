//! Trials against the metric itself: attempts to raise a score while seeing less, guards that notice
//! them, and rankings under changes of the model.

mod error;
mod stability;
mod trial;
mod worlds;

use serde::Serialize;

use crate::job::Job;
use crate::scene::Scene;
use crate::score::Scores;
use crate::search::Evaluator;
use crate::vehicle::Placement;

pub use error::AuditError;
pub use stability::Stability;
pub use trial::{Trial, TrialResult};

use stability::Ranking;
use trial::{gaming_placements, jittered};
use worlds::changed_worlds;

/// Mountings that are drawn within the tolerance.
const MOUNTINGS: u64 = 12;
/// Seed of the first mounting; the others follow.
const FIRST_MOUNTING: u64 = 1000;
/// Mounting tolerance: a millimetre, and a tenth of a degree in radians.
const TOLERANCE: (f64, f64) = (1e-3, 0.1 * std::f64::consts::PI / 180.0);
/// Ranges in metres to which the visibility is cut.
const VISIBILITIES: [f32; 3] = [10.0, 20.0, 40.0];

/// Frames that an audit averages over by default.
pub const AUDIT_FRAMES: u32 = 2;

/// Result of an audit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Audit {
    /// Name of the scene.
    pub scene: String,
    /// The objective that ranks.
    pub objective: String,
    /// Scores of the base, which attempts are compared with: the honest placement that is best by the objective, among
    /// those without a violated guard if there are any.
    pub base: Scores,
    /// Attempts to look better than the base while seeing less.
    pub trials: Vec<Trial>,
    /// The honest placements under changes of the model.
    pub stability: Vec<Stability>,
    /// Spearman's rank correlation of the objective with mean height alone over the honest placements;
    /// `None` where either is constant.
    pub ranking_against_mean_height: Option<f64>,
    /// True if no trial fooled a score without a guard that says so.
    pub passed: bool,
}

/// Progress of an audit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AuditEvent<'a> {
    /// A sentence for the user: which engine computes.
    Note(&'a str),
    /// One of [`AUDIT_PARTS`] parts is done.
    PartDone,
}

/// Parts of an audit.
pub const AUDIT_PARTS: u64 = 4;

/// Tries to fool the scores of a job in one scene, and ranks `honest` placements by its objective under changes of
/// the model.
///
/// `tell` is called with notes and finished parts.
///
/// # Errors
/// No placement, several scenes, a P-SOG that does not fit the scene, or from the backend.
pub fn audit(
    job: &Job,
    honest: &[Placement],
    tell: &dyn Fn(AuditEvent),
) -> Result<Audit, AuditError> {
    let [scene] = job.scenes() else {
        return Err(AuditError::OneScene { given: job.scenes().len() });
    };
    let objective = &job.settings().objective;
    let (mut own, notes) = job.evaluator(|_| {})?;
    notes.iter().for_each(|note| tell(AuditEvent::Note(note)));
    let scores = own.scores(honest)?;
    let ranking = Ranking::new(honest, &scores, objective).ok_or(AuditError::NoPlacement)?;
    tell(AuditEvent::PartDone);
    let mut base = scores[ranking.base()].clone();
    job.add_range_cards([(&honest[ranking.base()], &mut base)])?;
    let trials = trials(job, &mut own, &honest[ranking.base()], &base)?;
    tell(AuditEvent::PartDone);
    let mut stability = mounted(&mut own, &ranking, scene.scene())?;
    tell(AuditEvent::PartDone);
    for world in changed_worlds(scene)? {
        let changed = job.clone().on_grid_of(world.psog).frames(Some(world.frames));
        let scores = changed.evaluator(|_| {})?.0.scores(honest)?;
        stability.push(ranking.under(&world.name, &[scores]));
    }
    let sensors = scene.models()?;
    if sensors.turns() && !sensors.has_free_phase() {
        let unlocked = without_phases(honest);
        let free = |draw| -> Result<_, AuditError> {
            let freed = job.clone().sensors(&sensors.with_free_phases().with_seed(draw));
            Ok(freed.evaluator(|_| {})?.0.scores(&unlocked)?)
        };
        let draws = (1..=PHASE_DRAWS).map(free).collect::<Result<Vec<_>, _>>()?;
        stability.push(ranking.under("azimuth phases free, not in step", &draws));
    }
    tell(AuditEvent::PartDone);
    Ok(Audit {
        scene: scene.scene().name().to_owned(),
        objective: objective.to_string(),
        base,
        passed: trials.iter().all(|trial| trial.verdict != TrialResult::Fooled),
        trials,
        stability,
        ranking_against_mean_height: ranking.against_mean_height(),
    })
}

/// Draws of free phases that the ranking is tried with.
const PHASE_DRAWS: u64 = 3;

/// Copy of the placements whose LiDARs have no phases of their own, so that the models' phases hold.
fn without_phases(placements: &[Placement]) -> Vec<Placement> {
    let mut freed = placements.to_vec();
    freed.iter_mut().flat_map(|p| &mut p.lidars).for_each(|pose| pose.phase = None);
    freed
}

/// Attempts to look better than the base, and the base in fog.
fn trials(
    job: &Job,
    evaluator: &mut Evaluator,
    base: &Placement,
    scores: &Scores,
) -> Result<Vec<Trial>, AuditError> {
    let (names, placements): (Vec<_>, Vec<_>) = gaming_placements(base).into_iter().unzip();
    let mut attempts = evaluator.scores(&placements)?;
    job.add_range_cards(placements.iter().zip(&mut attempts))?;
    let trial = |(name, attempt)| Trial::new(name, scores, attempt);
    let mut trials: Vec<Trial> = names.into_iter().zip(attempts).map(trial).collect();
    for metres in VISIBILITIES {
        let attempt = evaluator.scores_at(std::slice::from_ref(base), Some(metres))?.remove(0);
        trials.push(Trial::new(&format!("visibility cut to {metres} m"), scores, attempt));
    }
    Ok(trials)
}

/// The honest placements as mechanics would mount them, and turned by half a step of azimuth.
fn mounted(
    evaluator: &mut Evaluator,
    ranking: &Ranking,
    scene: &Scene,
) -> Result<Vec<Stability>, AuditError> {
    let (sensors, lidars) = (scene.sensors()?, scene.lidars());
    let mut draws = Vec::new();
    for seed in FIRST_MOUNTING..FIRST_MOUNTING + MOUNTINGS {
        let jittered = |p| jittered(p, TOLERANCE.0, TOLERANCE.1, seed);
        let mounted: Vec<Placement> = ranking.honest().iter().map(jittered).collect();
        draws.push(evaluator.scores(&mounted)?);
    }
    let mut turned = ranking.honest().to_vec();
    for pose in turned.iter_mut().flat_map(|placement| &mut placement.lidars) {
        // Half an azimuth step; listed directions have a mean step of 360° / their number.
        pose.yaw += 0.5 * lidars[sensors.number(pose)?].azimuth_step().to_radians();
    }
    let phase = evaluator.scores(&turned)?;
    Ok(vec![
        ranking.under("mounted within 1 mm and 0.1°", &draws),
        ranking.under("azimuth phase by half a step", &[phase]),
    ])
}
