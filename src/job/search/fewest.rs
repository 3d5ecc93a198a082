//! The fewest sensors with which all requirements are met: choices under growing numbers and falling prices. Among the
//! choices of one number whose placements may meet all, the cheapest that does is found by bisection over their prices.

use serde::{Deserialize, Serialize};

use super::told::points_in_words;
use crate::json::counted;
use crate::search::{Equipped, Event, Limits, Observer};
use crate::vehicle::{Equipment, Vehicle};

/// Share by which the next price is less than one that is met.
pub(in crate::job) const LESS: f64 = 1e-9;
/// Share of the requirements, summed, that a choice on the coarse grid may miss: the search of placements, over finer
/// poses and all frames, often closes a gap as wide.
pub(in crate::job) const NEARLY: f64 = 0.3;

/// State of a choice of the fewest sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::job) struct Fewest {
    /// Limits of the choice under way.
    pub limits: Limits,
    /// Choices of this number that miss little or nothing on the grid. Once one is taken, those cheaper than it, the cheapest
    /// last.
    #[serde(default)]
    open: Vec<Equipped>,
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
        Self { limits, open: Vec::new(), searched: Vec::new() }
    }

    /// Rigs of more sensors than the choice under way allows, in words.
    pub(super) fn untried(&self) -> String {
        format!("rigs of more than {}", counted(self.limits.sensors, "sensor"))
    }

    /// Rigs below a price that may meet all requirements, in words; `None` where there are none.
    pub(super) fn untried_below(&self, price: f64) -> Option<String> {
        let words = || format!("cheaper rigs of {}", counted(self.limits.sensors, "sensor"));
        self.open.iter().any(|of| of.cost < price).then(words)
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

    /// Looks at the result of a choice under [`Self::limits`]. Where little is missing on the grid, so that the search of
    /// placements may close the gap, a cheaper choice is looked for, down to `cheapest`; then the one that misses least is
    /// taken. Where all miss much, and for equipment that was searched before, one sensor more is allowed, up to `most`.
    pub(super) fn next(&mut self, found: Equipped, most: usize, cheapest: f64) -> Next {
        let is_new = !found.equipment.is_empty() && !self.was_searched(&found.equipment);
        if is_new && found.missing <= NEARLY {
            let is_cheapest = found.cost <= cheapest;
            self.limits.budget = found.cost * (1.0 - LESS);
            self.open.push(found);
            if !is_cheapest {
                return Next::Again(self.limits);
            }
        } else if self.open.is_empty() {
            if self.limits.sensors >= most {
                return Next::Take(Box::new(found));
            }
            self.limits.sensors += 1;
            return Next::Again(self.limits);
        }
        self.take().map_or(Next::Again(self.limits), |taken| Next::Take(Box::new(taken)))
    }

    /// Takes the choice that misses least, the cheapest of equal ones; cheaper ones stay open.
    pub(super) fn take(&mut self) -> Option<Equipped> {
        let missing = |of: &Equipped| of.missing.max(0.0);
        let by = |a: &Equipped, b: &Equipped| {
            missing(a).total_cmp(&missing(b)).then(a.cost.total_cmp(&b.cost))
        };
        let taken = self.open.iter().cloned().min_by(by)?;
        self.open.retain(|of| of.cost < taken.cost);
        self.open.sort_by(|a, b| b.cost.total_cmp(&a.cost));
        Some(taken)
    }

    /// The next choice to be searched, the middle of the open ones by price. Choices that are cheaper stay open where the
    /// placement of the equipment searched meets all, dearer ones where it does not.
    pub(super) fn cheaper(&mut self, searched: &Equipped, is_met: bool) -> Option<Equipped> {
        self.open
            .retain(|of| if is_met { of.cost < searched.cost } else { of.cost > searched.cost });
        self.open.get(self.open.len() / 2).cloned()
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
