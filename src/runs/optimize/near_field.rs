//! What is said of the near field of a result and its baselines: guards, and beside a weighted search the true
//! gain.

use std::sync::Arc;

use crate::engine::{EngineChoice, open};
use crate::near_field::{NearSite, UnweightedGain, unweighted};
use crate::scene::Scene;
use crate::search::{Evaluator, Outcome, Suite};
use crate::vehicle::Placement;

use crate::runs::Error;
use crate::runs::own_body::add_self_hits;

/// The outcome with the guard `self_hit` where a LiDAR looks at the own vehicle: a search does not know it.
pub(super) fn with_self_hits(
    scenes: &[Scene],
    suite: &Suite,
    outcome: &Outcome,
) -> Result<Outcome, Error> {
    let mut outcome = outcome.clone();
    add_self_hits(scenes, suite, outcome.best.iter_mut().chain(&mut outcome.baselines))?;
    Ok(outcome)
}

/// True gain and near field of the result and the baselines in each scene, where near ground had a weight.
pub(super) fn unweighted_gains(
    scenes: &[Scene],
    suite: &Suite,
    outcome: &Outcome,
    nats: f64,
) -> Result<Vec<UnweightedGain>, Error> {
    let all = outcome.best.iter().chain(&outcome.baselines);
    let placements: Vec<Placement> = all.map(|scored| scored.placement.clone()).collect();
    let mut gains = Vec::new();
    for member in suite.members().iter().filter(|member| !member.is_mirrored()) {
        let scene = &scenes[member.scene()];
        let problem = unweighted(scene, member.problem().as_ref().clone(), nats)?;
        let problem = Arc::new(problem);
        let engine = open(&problem, &EngineChoice::cpu(), |_| {})?.engine;
        let mut evaluator = Evaluator::new(problem.clone(), engine);
        let site = NearSite::new(scene, &problem)?;
        for scores in evaluator.scores(&placements)? {
            let placement = &placements[gains.len() % placements.len()];
            let near = site.look(evaluator.backend_mut(), placement)?;
            gains.push(UnweightedGain {
                scene: (suite.scene_count() > 1).then(|| member.name().to_owned()),
                name: scores.name,
                information_gain: scores.segmentation.information_gain,
                near_field: near.near_field,
                ring: near.ring,
            });
        }
    }
    Ok(gains)
}
