//! Guard `self_hit` of a result and its baselines.

use crate::scene::Scene;
use crate::search::{Outcome, Suite};

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
