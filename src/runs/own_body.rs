//! The guard of placements that look at the own vehicle, which needs hits of its own.

use crate::engine::{EngineChoice, open};
use crate::near_field;
use crate::scene::Scene;
use crate::search::{Scored, Suite};

use super::Error;

/// Adds the guard `self_hit` where a LiDAR looks at the own vehicle, by the first scene: neither scores nor
/// searches know it.
pub fn add_self_hits<'a>(
    scenes: &[Scene],
    suite: &Suite,
    all: impl Iterator<Item = &'a mut Scored>,
) -> Result<(), Error> {
    let Some(member) = suite.members().first() else { return Ok(()) };
    let (scene, problem) = (&scenes[member.scene()], member.problem());
    let mut engine = open(problem, &EngineChoice::cpu(), |_| {})?.engine;
    let all = all.map(|Scored { placement, scores, .. }| (&*placement, scores));
    Ok(near_field::add_self_hits(scene, problem, &mut *engine, all)?)
}
