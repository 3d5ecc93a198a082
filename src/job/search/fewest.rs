//! The fewest sensors with which all requirements are met: choices under growing numbers and falling prices.

use serde::{Deserialize, Serialize};

use super::points_in_words;
use crate::json::counted;
use crate::search::{Equipped, Event, Limits, Observer};
use crate::vehicle::{Equipment, Vehicle};

/// Share by which the next price is less than one that is met.
const LESS: f64 = 1e-9;
/// Share of the requirements, summed, that a choice on the coarse grid may miss: the search of placements, over finer
/// poses and all frames, often closes a gap as wide.
const NEARLY: f64 = 0.3;

/// State of a choice of the fewest sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::job) struct Fewest {
    /// Limits of the choice under way.
    pub limits: Limits,
    /// Equipment with the fewest sensors so far that meets the requirements on the grid; the choice now looks for a cheaper
    /// one.
    held: Option<Equipped>,
    /// Equipment whose placements were searched, and none met all requirements.
    #[serde(default)]
    pub searched: Vec<Equipment>,
}

/// Next step after a choice.
pub(super) enum Next {
    /// Another choice under other limits.
    Again(Limits),
    /// The equipment. It may miss a requirement where no choice met all.
    Take(Box<Equipped>),
}

impl Fewest {
    /// A choice that begins with `least` sensors.
    pub(super) fn new(budget: f64, least: usize) -> Self {
        let limits = Limits { budget, sensors: least.max(1) };
        Self { limits, held: None, searched: Vec::new() }
    }

    /// Rigs of more sensors than the choice under way allows, in words.
    pub(super) fn untried(&self) -> String {
        format!("rigs of more than {}", counted(self.limits.sensors, "sensor"))
    }

    /// True for sensors whose placements were searched, in whatever order.
    pub(super) fn was_searched(&self, equipment: &Equipment) -> bool {
        let sorted = |equipment: &Equipment| {
            let mut kinds: Vec<(usize, String)> =
                equipment.iter().map(|(mount, sensor)| (*mount, sensor.to_string())).collect();
            kinds.sort();
            kinds
        };
        self.searched.iter().any(|known| sorted(known) == sorted(equipment))
    }

    /// Looks at the result of a choice under [`Self::limits`]. Where all is met on the grid, a cheaper choice is looked for,
    /// down to `cheapest`; where little is missing, the search of placements may close the gap. Else, and for equipment that
    /// was searched before, one sensor more is allowed, up to `most`.
    pub(super) fn next(&mut self, found: Equipped, most: usize, cheapest: f64) -> Next {
        let was_searched = self.was_searched(&found.equipment);
        match &self.held {
            _ if found.missing <= 0.0 && !was_searched => {
                let is_cheapest = found.cost <= cheapest;
                self.limits.budget = found.cost * (1.0 - LESS);
                self.held = Some(found.clone());
                if is_cheapest { Next::Take(Box::new(found)) } else { Next::Again(self.limits) }
            }
            Some(held) => Next::Take(Box::new(held.clone())),
            None if (found.missing > NEARLY || was_searched) && self.limits.sensors < most => {
                self.limits.sensors += 1;
                Next::Again(self.limits)
            }
            None => Next::Take(Box::new(found)),
        }
    }
}

/// Takes the sensors of a choice, or asks for another choice where the fewest are wanted.
pub(super) fn taken(
    fewest: &mut Option<Fewest>,
    found: Equipped,
    vehicle: &Vehicle,
    observer: &mut dyn Observer,
) -> Next {
    let Some(fewest) = fewest else { return Next::Take(Box::new(found)) };
    let (sensors, short) = (fewest.limits.sensors, found.missing);
    let most = vehicle.most_sensors(fewest.limits.budget);
    let next = fewest.next(found, most, vehicle.cost(&vehicle.cheapest()));
    if short > 0.0 && matches!(next, Next::Again(limits) if limits.sensors > sensors) {
        observer.on(&Event::Note(&format!(
            "no equipment of {} was found that meets all requirements: it misses them by {} percentage points, summed",
            counted(sensors, "sensor"),
            points_in_words(short)
        )));
    }
    next
}
