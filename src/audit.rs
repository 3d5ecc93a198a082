//! Trials against the metric itself: attempts to raise a score while seeing less, guards that notice
//! them, and rankings under changes of the model.

mod trial;

use serde::Serialize;

use crate::engine::BackendError;
use crate::job::{Job, JobError};
use crate::scene::Scene;
use crate::score::{Objective, Scores, kendall_tau, mean_height, spearman};
use crate::search::Evaluator;
use crate::vehicle::Placement;
use trial::{changed_worlds, gaming_placements, jittered};

pub(crate) use trial::LIKES_LOSS;
pub use trial::{Trial, TrialResult};

/// Mountings that are drawn within the tolerance.
const MOUNTINGS: u64 = 12;
/// Seed of the first mounting; the others follow.
const FIRST_MOUNTING: u64 = 1000;
/// Mounting tolerance: a millimetre, and a tenth of a degree in radians.
const TOLERANCE: (f64, f64) = (1e-3, 0.1 * std::f64::consts::PI / 180.0);
/// Ranges in metres to which the visibility is cut.
const VISIBILITIES: [f32; 3] = [10.0, 20.0, 40.0];

/// Frames that an audit averages over by default.
pub(crate) const AUDIT_FRAMES: u32 = 2;

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
    /// One of `AUDIT_PARTS` parts is done.
    PartDone,
}

pub(crate) const AUDIT_PARTS: u64 = 4;

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
) -> Result<Audit, JobError> {
    let [scene] = job.scenes() else {
        return Err(JobError::SeveralToAudit { given: job.scenes().len() });
    };
    let objective = &job.settings().objective;
    let (mut own, notes) = job.evaluator(|_| {})?;
    notes.iter().for_each(|note| tell(AuditEvent::Note(note)));
    let scores = own.scores(honest)?;
    let ranking = Ranking::new(honest, &scores, objective).ok_or(JobError::NothingToAudit)?;
    tell(AuditEvent::PartDone);
    let mut base = scores[ranking.base].clone();
    job.add_range_cards([(&honest[ranking.base], &mut base)])?;
    let trials = trials(job, &mut own, &honest[ranking.base], &base)?;
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
        let free = |draw| -> Result<_, JobError> {
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
        ranking_against_mean_height: spearman(&ranking.values, &ranking.heights()),
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

fn trials(
    job: &Job,
    evaluator: &mut Evaluator,
    base: &Placement,
    scores: &Scores,
) -> Result<Vec<Trial>, JobError> {
    let attempts =
        gaming_placements(base, evaluator.problem().sensors()).map_err(BackendError::from)?;
    let (names, placements): (Vec<_>, Vec<_>) = attempts.into_iter().unzip();
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
) -> Result<Vec<Stability>, JobError> {
    let (sensors, lidars) = (scene.sensors()?, scene.lidars());
    let mut draws = Vec::new();
    for seed in FIRST_MOUNTING..FIRST_MOUNTING + MOUNTINGS {
        let jittered = |p| jittered(p, TOLERANCE.0, TOLERANCE.1, seed);
        let mounted: Vec<Placement> = ranking.honest.iter().map(jittered).collect();
        draws.push(evaluator.scores(&mounted)?);
    }
    let mut turned = ranking.honest.to_vec();
    for pose in turned.iter_mut().flat_map(|placement| &mut placement.lidars) {
        // Half an azimuth step; listed directions have a mean step of 360° / their number.
        let model = sensors.number(pose).map_err(BackendError::from)?;
        pose.yaw += 0.5 * lidars[model].azimuth_step().to_radians();
    }
    let phase = evaluator.scores(&turned)?;
    Ok(vec![
        ranking.under("mounted within 1 mm and 0.1°", &draws),
        ranking.under("azimuth phase by half a step", &[phase]),
    ])
}

/// The honest placements under one change that should matter little.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stability {
    /// The change.
    pub change: String,
    /// Scores of the base under the change; the first draw's where there are several.
    pub base: Scores,
    /// Largest |after − before| / |before| of the objective over placements and draws.
    pub worst_relative_change: f64,
    /// Median of these relative changes.
    pub median_relative_change: f64,
    /// Lowest Kendall's τ-b of a draw with the unchanged ranking; `None` where either is constant.
    pub kendall_tau: Option<f64>,
    /// Median of Kendall's τ-b over the draws.
    pub median_kendall_tau: Option<f64>,
    /// Spearman's rank correlation of the changed ranking with mean height alone.
    pub ranking_against_mean_height: Option<f64>,
    /// The placement that comes first under the change.
    pub first: String,
}

/// The honest placements before any change.
struct Ranking<'a> {
    honest: &'a [Placement],
    objective: &'a Objective,
    values: Vec<f64>,
    /// Index of the placement that comes first.
    base: usize,
}

impl<'a> Ranking<'a> {
    /// Ranks placements by their scores; `None` without a placement.
    fn new(honest: &'a [Placement], scores: &[Scores], objective: &'a Objective) -> Option<Self> {
        let base = first(scores, objective)?;
        Some(Self { honest, objective, values: values(scores, objective), base })
    }

    /// Mean heights of the honest placements, in metres.
    fn heights(&self) -> Vec<f64> {
        self.honest.iter().map(mean_height).collect()
    }

    /// One or several draws of a change, each with a score for each placement; `draws` is not empty.
    fn under(&self, change: &str, draws: &[Vec<Scores>]) -> Stability {
        let (mut changes, mut taus) = (Vec::new(), Vec::new());
        for draw in draws {
            let after = values(draw, self.objective);
            let pairs = self.values.iter().zip(&after);
            // A placement that covers nothing has no score to change.
            changes.extend(pairs.map(|(b, a)| ((a - b) / b).abs()).filter(|c| c.is_finite()));
            taus.extend(kendall_tau(&self.values, &after));
        }
        changes.sort_by(f64::total_cmp);
        taus.sort_by(f64::total_cmp);
        let first = first(&draws[0], self.objective).map(|k| draws[0][k].name.clone());
        Stability {
            change: change.to_owned(),
            base: draws[0][self.base].clone(),
            worst_relative_change: changes.last().copied().unwrap_or(0.0),
            median_relative_change: changes.get(changes.len() / 2).copied().unwrap_or(0.0),
            kendall_tau: taus.first().copied(),
            median_kendall_tau: taus.get(taus.len() / 2).copied(),
            ranking_against_mean_height: spearman(
                &values(&draws[0], self.objective),
                &self.heights(),
            ),
            first: first.unwrap_or_default(),
        }
    }
}

/// The objective of each placement; −∞ where it does not exist.
fn values(scores: &[Scores], objective: &Objective) -> Vec<f64> {
    scores.iter().map(|s| objective.value(s).unwrap_or(f64::NEG_INFINITY)).collect()
}

/// Index of the placement that comes first: those without a violated guard before the others, then by
/// the objective; of equal ones the first.
fn first(scores: &[Scores], objective: &Objective) -> Option<usize> {
    let values = values(scores, objective);
    let is_free = |k: usize| scores[k].guards.is_empty();
    (0..scores.len()).max_by(|&a, &b| {
        is_free(a).cmp(&is_free(b)).then(values[a].total_cmp(&values[b])).then(b.cmp(&a))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Content, Tally};
    use crate::vehicle::SensorPose;

    fn scores(name: &str, gain: u64, seen: u64) -> Scores {
        let content = Content::new(vec!["a".into()], vec![], &[vec![]], false);
        let tally = |gain: u64| Tally {
            covered: 100,
            entropy: [gain << 28, 0, 0, 0],
            beams: 10,
            ..Tally::zero(1, 1)
        };
        Scores::new(name, &tally(gain), &content, 1, false, Some(&tally(seen)))
    }

    #[test]
    fn a_guarded_placement_never_comes_first() {
        // By M-SOG the blind one is the best, and a guard says why.
        let objective: Objective = "m_sog_scaled".parse().unwrap();
        let all = [scores("blind", 1, 50), scores("seeing", 40, 50), scores("same", 40, 50)];
        let values = values(&all, &objective);
        assert!(values[0] > values[1] && !all[0].guards.is_empty());
        assert_eq!(first(&all, &objective), Some(1));
        assert_eq!(first(&all[..1], &objective), Some(0));
        assert_eq!(first(&[], &objective), None);
    }

    #[test]
    fn several_draws_give_the_worst_and_the_median() {
        let pose = |z| SensorPose { x: 0.0, y: 0.0, z, ..SensorPose::default() };
        let placement = |z: f64| Placement { name: format!("z{z}"), lidars: vec![pose(z)] };
        let honest = [1.0, 2.0, 3.0].map(placement);
        let draw = |gains: [u64; 3]| gains.map(|gain| scores("x", gain, 40)).to_vec();
        let before = draw([20, 40, 30]);
        let objective = "information_gain".parse().unwrap();
        let ranking = Ranking::new(&honest, &before, &objective).unwrap();
        assert_eq!(ranking.base, 1);
        // τ by hand: of three pairs the second draw turns all round. Gains change from 20 to 40 (1), 40 to 20 (1/2).
        let found = ranking.under("test", &[before.clone(), draw([40, 20, 30]), before.clone()]);
        assert_eq!((found.kendall_tau, found.median_kendall_tau), (Some(-1.0), Some(1.0)));
        assert_eq!((found.worst_relative_change, found.median_relative_change), (1.0, 0.0));
        // Ranks 1, 3, 2 against heights 1, 2, 3: 1 − 6 · (0 + 1 + 1) / (3 · 8) = 1/2.
        assert_eq!(found.ranking_against_mean_height, Some(0.5));
        assert_eq!(found.base, before[1]);
    }
}
