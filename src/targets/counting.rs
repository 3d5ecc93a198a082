//! Requirements that no place or cell counts for: they would be met, or missed, by every rig alike.

use super::beams::TargetSite;
use super::places::places_of;
use crate::near_field::least_metres;
use crate::problem::{Problem, ProblemError};
use crate::vehicle::{GroundAsked, Vehicle};

/// Checks that every rule of a vehicle on targets and on the ground has something that counts, in the vehicle's problem.
///
/// # Errors
/// The first rule whose places all lie in the own body, or whose distance reaches no cell; a body from whose outline no
/// ground is counted.
pub(crate) fn check_counting(problem: &Problem, vehicle: &Vehicle) -> Result<(), ProblemError> {
    let Vehicle { require, targets, ground, require_order, .. } = vehicle;
    let index = |number: usize| require_order.get(number).copied().unwrap_or(number);
    let site = (!targets.is_empty()).then(|| TargetSite::of(problem));
    for (number, rule) in targets.iter().enumerate() {
        let has_room = |at: [f64; 3]| site.as_ref().is_none_or(|s| s.has_room(&rule.target, at));
        if !places_of(rule).into_iter().any(has_room) {
            let (index, name) = (index(require.len() + number), rule.name.clone());
            return Err(ProblemError::NoPlace { index, name });
        }
    }
    let least = least_metres(problem, ground)?;
    for ((number, rule), least) in ground.iter().enumerate().zip(least) {
        let index = index(require.len() + targets.len() + number);
        let (key, metres) = match rule.asked {
            GroundAsked::Within(metres) => ("ground", metres),
            GroundAsked::BlindZone(_, metres) => ("depth", metres),
        };
        let name = rule.name.clone();
        match least {
            None => return Err(ProblemError::NoLane { index, name }),
            Some(least) if least > metres => {
                // Rounded up to whole centimetres.
                let least = (100.0 * least - 1e-9).ceil() / 100.0;
                return Err(ProblemError::NoCell { index, name, key, least });
            }
            Some(_) => {}
        }
    }
    Ok(())
}
