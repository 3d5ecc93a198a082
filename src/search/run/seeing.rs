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

#[cfg(test)]
mod tests {
    use super::super::securing::tests::{run_in, walled};
    use super::*;
    use crate::search::observer::Event;

    #[test]
    fn a_result_gives_up_one_per_cent_at_most_to_lose_a_car_at_fewer_places() {
        let mut run = run_in(&walled());
        let mut goes_on = |_: &Event| true;
        let watch = &mut Watch::new(&mut goes_on, false);
        let turned = |yaw: f64, run: &Run| {
            let lidars = run.suite.constraints().poses_of(&[yaw]);
            Placement { name: "turned".into(), lidars }
        };
        let both = [turned(-0.9, &run), turned(0.9, &run)];
        let car = run.car_all_round();
        let [many, few] = [0, 1].map(|k| places_lost(car.as_ref(), &both[k]).unwrap());
        assert!(few > 0 && many > few, "{many} and {few} places lose the car");
        let judged = run.judged_over_all(&both, watch).unwrap().unwrap();
        let mut scored = run.scored(&both, judged, watch).unwrap();
        scored.iter_mut().for_each(|of| {
            of.scores.required.clear();
            of.scores.guards.clear();
        });
        for (values, best) in [([1.0, 0.995], 1), ([1.0, 0.98], 0), ([0.98, 1.0], 1)] {
            scored.iter_mut().zip(values).for_each(|(of, value)| of.objective = Some(value));
            let found = run.best_of(&scored.iter().collect::<Vec<_>>()).unwrap();
            assert_eq!(found, Some(best), "{values:?}");
        }
        assert_eq!(run.best_of(&[]).unwrap(), None);
        run.state.settings.objective = "m_sog".parse().unwrap();
        assert!(run.car_all_round().is_none());
    }
}
