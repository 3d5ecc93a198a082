//! Flaws of the best end of the swaps that a search mends by swaps of their own: a look at the own body, blind sectors.

use super::state::Run;
use crate::engine::BackendError;
use crate::score::Standing;
use crate::search::error::SearchError;
use crate::search::observer::Watch;
use crate::search::outcome::Scored;
use crate::targets::CarAllRound;
use crate::vehicle::Placement;

/// Share of the objective that a result gives up for fewer places that lose a car: blind sectors that cost more stay, and
/// are named.
const MOST_GIVEN_UP: f64 = 0.01;

/// A flaw of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flaw {
    /// A LiDAR looks at the own body, or stands below the ground.
    AtBody,
    /// A car is lost somewhere around the vehicle.
    Blind,
}

impl Run {
    pub(super) fn has(
        &mut self,
        flaw: Flaw,
        placement: &Placement,
        watch: &mut Watch,
    ) -> Result<bool, SearchError> {
        match flaw {
            Flaw::AtBody => Ok(!self.guards_of_body(placement, watch)?.is_empty()),
            Flaw::Blind => Ok(places_lost(self.car_all_round().as_ref(), placement)? > 0),
        }
    }

    /// Position of the result among finalists: of those within 1 % of the best objective, with no more guards and no more of
    /// the requirements missed, the one that loses a car at the fewest places; `None` of none.
    pub(super) fn best_of(&self, finalists: &[&Scored]) -> Result<Option<usize>, SearchError> {
        let standings: Vec<Standing> = finalists.iter().map(|of| of.standing()).collect();
        let Some(best) = Standing::best(&standings) else { return Ok(None) };
        let (car, first) = (self.car_all_round(), &standings[best]);
        let Some(value) = first.value.filter(|_| car.is_some()) else { return Ok(Some(best)) };
        let least = value - MOST_GIVEN_UP * value.abs();
        let is_near = |of: &Standing| {
            let is_as_good = of.violation <= first.violation && of.guards <= first.guards;
            is_as_good && of.value.is_some_and(|value| value >= least)
        };
        let mut chosen = (best, places_lost(car.as_ref(), &finalists[best].placement)?);
        for (k, standing) in standings.iter().enumerate().filter(|(_, of)| is_near(of)) {
            let lost = places_lost(car.as_ref(), &finalists[k].placement)?;
            if lost < chosen.1 || (lost == chosen.1 && standing.beats(&standings[chosen.0])) {
                chosen = (k, lost);
            }
        }
        Ok(Some(chosen.0))
    }

    /// Places of a car all round; `None` where the objective does not look for cars.
    pub(super) fn car_all_round(&self) -> Option<CarAllRound> {
        let is_looked_for = self.state.settings.objective.weighs_place();
        let first = self.suite.members().iter().find(|member| !member.is_mirrored());
        CarAllRound::of(first.filter(|_| is_looked_for)?.problem())
    }
}

/// Number of places at which a placement loses the car; 0 where nobody looks.
pub(super) fn places_lost(
    car: Option<&CarAllRound>,
    placement: &Placement,
) -> Result<usize, SearchError> {
    let lost = car.map_or(Ok(0), |car| car.lost(&placement.lidars));
    Ok(lost.map_err(BackendError::from)?)
}
