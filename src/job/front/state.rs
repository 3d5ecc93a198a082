//! Finished parts of the search of a front, from which a stopped one goes on.

use serde::{Deserialize, Serialize};

use crate::score::Objective;
use crate::search::{Equipped, Limits};
use crate::vehicle::{Equipment, Placement};

/// Checkpoint of a front: every choice of sensors and every search of placements that came to its end. A front that goes
/// on from it has the bits of one that never stopped; only the part under way is done again.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FrontState {
    choices: Vec<Answered<Equipped>>,
    polished: Vec<Answered<Option<Placement>>>,
    met: Vec<Answered<Option<(Placement, Equipment)>>>,
}

/// One part of a front: a question and its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Answered<T> {
    asked: String,
    found: T,
}

/// Answer to a question that was asked before.
fn known<'a, T>(parts: &'a [Answered<T>], asked: &str) -> Option<&'a T> {
    parts.iter().find(|part| part.asked == asked).map(|part| &part.found)
}

/// A question as one text: numbers in it have every digit.
fn text(question: impl Serialize) -> String {
    // Names, numbers and poses are always text.
    serde_json::to_string(&question).unwrap_or_default()
}

impl FrontState {
    /// True before any part is finished.
    pub fn is_empty(&self) -> bool {
        self.choices.is_empty()
    }

    /// Question for sensors by a gain, with a weight of the requirements, under limits.
    pub(super) fn choice(gain: &Objective, weight: f64, limits: Limits) -> String {
        let Limits { budget, sensors } = limits;
        // A budget without a limit is no number of JSON.
        text((gain, weight, budget.to_string(), sensors))
    }

    /// Sensors chosen for a question.
    pub(super) fn chosen(&self, asked: &str) -> Option<&Equipped> {
        known(&self.choices, asked)
    }

    /// Keeps sensors chosen for a question; a choice without a value, which JSON does not hold, is left out.
    pub(super) fn keep_choice(&mut self, asked: String, found: &Equipped) {
        if found.value.is_finite() && found.missing.is_finite() {
            self.choices.push(Answered { asked, found: found.clone() });
        }
    }

    /// Question for the best placement of sensors from a start; `is_bound` puts requirements first.
    pub(super) fn polish(
        start: &Placement,
        kinds: &Equipment,
        objective: &Objective,
        is_bound: bool,
    ) -> String {
        text((&start.lidars, kinds, objective, is_bound))
    }

    /// Placement found for a question, if any was.
    pub(super) fn polished(&self, asked: &str) -> Option<&Option<Placement>> {
        known(&self.polished, asked)
    }

    /// Keeps the placement found for a question.
    pub(super) fn keep_polished(&mut self, asked: String, found: Option<Placement>) {
        self.polished.push(Answered { asked, found });
    }

    /// Question for sensors and placement that meet all requirements: the fewest sensors, or the best for all the money.
    pub(super) fn meeting(objective: &Objective, fewest: bool) -> String {
        text((objective, fewest))
    }

    /// Placement and sensors found for a question, if any were.
    pub(super) fn met(&self, asked: &str) -> Option<&Option<(Placement, Equipment)>> {
        known(&self.met, asked)
    }

    /// Keeps placement and sensors found for a question.
    pub(super) fn keep_met(&mut self, asked: String, found: Option<(Placement, Equipment)>) {
        self.met.push(Answered { asked, found });
    }
}

/// The state of a front under way, and who is told whenever a part is finished.
pub(super) struct FrontProgress<'a> {
    pub state: &'a mut FrontState,
    pub tell: &'a mut dyn FnMut(&FrontState),
}

impl FrontProgress<'_> {
    /// Changes the state, and tells it.
    pub fn keep(&mut self, change: impl FnOnce(&mut FrontState)) {
        change(self.state);
        (self.tell)(self.state);
    }
}
