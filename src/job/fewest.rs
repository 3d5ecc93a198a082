//! How few sensors of a vehicle meet its requirements: first their number, then their price.

use serde::{Deserialize, Serialize};

use crate::search::{Equipped, Limits};

/// Share by which the next price is less than one that is met.
const LESS: f64 = 1e-9;
/// Share of the requirements, summed, that a choice on the coarse grid may miss: the search of placements, over finer
/// poses and all frames, often closes a gap as wide.
const NEARLY: f64 = 0.3;

/// State of a choice of the fewest sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Fewest {
    /// Limits of the choice under way.
    pub limits: Limits,
    /// Equipment with the fewest sensors so far that meets the requirements on the grid; the choice now looks for a cheaper
    /// one.
    held: Option<Equipped>,
}

/// What follows a choice.
pub(super) enum Next {
    /// Another choice under other limits.
    Again(Limits),
    /// The equipment. It may miss a requirement where no choice met all.
    Take(Box<Equipped>),
}

impl Fewest {
    /// A choice that begins with `least` sensors.
    pub fn new(budget: f64, least: usize) -> Self {
        Self { limits: Limits { budget, sensors: least.max(1) }, held: None }
    }

    /// Looks at the result of a choice under [`Self::limits`]. Where all is met on the grid, a cheaper choice is looked for,
    /// down to `cheapest`; where little is missing, the search of placements may close the gap; else one sensor more is
    /// allowed, up to `most`.
    pub fn next(&mut self, found: Equipped, most: usize, cheapest: f64) -> Next {
        match &self.held {
            _ if found.missing <= 0.0 => {
                let is_cheapest = found.cost <= cheapest;
                self.limits.budget = found.cost * (1.0 - LESS);
                self.held = Some(found.clone());
                if is_cheapest { Next::Take(Box::new(found)) } else { Next::Again(self.limits) }
            }
            Some(held) => Next::Take(Box::new(held.clone())),
            None if found.missing > NEARLY && self.limits.sensors < most => {
                self.limits.sensors += 1;
                Next::Again(self.limits)
            }
            None => Next::Take(Box::new(found)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Placement;

    fn found(sensors: usize, cost: f64, missing: f64) -> Equipped {
        let placement = Placement { name: "x".to_owned(), lidars: vec![] };
        let equipment = vec![(0, crate::vehicle::SensorName::NONE); sensors];
        Equipped { equipment, placement, cost, value: 0.0, missing }
    }

    #[test]
    fn the_number_grows_until_all_is_met_and_then_the_price_falls() {
        let mut fewest = Fewest::new(f64::INFINITY, 0);
        assert_eq!(fewest.limits.sensors, 1);
        assert!(
            matches!(fewest.next(found(1, 5.0, 0.4), 4, 1.0), Next::Again(l) if l.sensors == 2)
        );
        let again = fewest.next(found(2, 9.0, 0.0), 4, 1.0);
        assert!(
            matches!(again, Next::Again(l) if l.sensors == 2 && l.budget < 9.0 && l.budget > 8.9)
        );
        assert!(
            matches!(fewest.next(found(2, 7.0, 0.0), 4, 1.0), Next::Again(l) if l.budget < 7.0)
        );
        // The next cheaper one misses something: the one held is taken.
        assert!(matches!(fewest.next(found(2, 6.0, 0.1), 4, 1.0), Next::Take(e) if e.cost == 7.0));
    }

    #[test]
    fn a_choice_that_misses_little_and_the_last_one_are_taken() {
        // The search of placements may close a small gap.
        assert!(matches!(Fewest::new(9.0, 1).next(found(1, 5.0, 0.2), 4, 1.0), Next::Take(_)));
        let mut fewest = Fewest::new(10.0, 2);
        assert!(matches!(fewest.next(found(2, 5.0, 0.6), 3, 1.0), Next::Again(_)));
        assert!(
            matches!(fewest.next(found(3, 5.0, 0.5), 3, 1.0), Next::Take(e) if e.missing == 0.5)
        );
    }
}
