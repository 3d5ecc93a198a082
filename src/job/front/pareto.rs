//! Pareto filter over two or three objectives, and the knee of a front.

use serde::{Deserialize, Serialize};

use crate::json::distinct;
use crate::score::Objective;
use crate::search::{Equipped, EveryRig, Limits};
use crate::vehicle::{Equipment, Placement};

/// Distance below which a point does not stand out of the plane between the extremes.
const FLAT: f64 = 1e-9;

/// Values of a point, turned so that less is better.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Objectives {
    pub values: Vec<f64>,
    /// All requirements are met.
    pub meets: bool,
}

impl Objectives {
    /// True if no value is worse than the other point's. A point that misses a requirement takes the place of none that
    /// meets all.
    fn is_no_worse_than(&self, other: &Self) -> bool {
        let values = self.values.iter().zip(&other.values);
        (self.meets || !other.meets) && values.into_iter().all(|(one, other)| one <= other)
    }
}

/// Numbers of the points that no other point beats; of equal ones the first.
pub(super) fn front(points: &[Objectives]) -> Vec<usize> {
    let is_beaten = |k: usize| {
        (0..points.len()).any(|other| {
            let (one, other_one) = (&points[k], &points[other]);
            let is_equal = one.is_no_worse_than(other_one);
            other != k && other_one.is_no_worse_than(one) && (!is_equal || other < k)
        })
    };
    (0..points.len()).filter(|&k| !is_beaten(k)).collect()
}

/// The point with the greatest distance from the line or plane between the extremes, on the side of better values; each
/// axis is scaled to [0, 1]. `None` where no point stands out.
pub(super) fn knee(points: &[Objectives]) -> Option<usize> {
    let axes = points.first()?.values.len();
    let column = |axis: usize| points.iter().map(move |point| point.values[axis]);
    let low: Vec<f64> = (0..axes).map(|axis| column(axis).fold(f64::MAX, f64::min)).collect();
    let high: Vec<f64> = (0..axes).map(|axis| column(axis).fold(f64::MIN, f64::max)).collect();
    // An axis on which all points are equal says nothing.
    let axes: Vec<usize> = (0..axes).filter(|&axis| high[axis] > low[axis]).collect();
    let scale = |point: &Objectives| -> Vec<f64> {
        let one = |&axis: &usize| (point.values[axis] - low[axis]) / (high[axis] - low[axis]);
        axes.iter().map(one).collect()
    };
    let scaled: Vec<Vec<f64>> = points.iter().map(scale).collect();
    let normal = normal(&scaled, axes.len())?;
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let distance = |point: &Vec<f64>| {
        (1.0 - normal.iter().zip(point).map(|(n, value)| n * value).sum::<f64>()) / length
    };
    let standing_out = (0..scaled.len()).map(|k| (k, distance(&scaled[k])));
    let best = standing_out.reduce(|best, other| if other.1 > best.1 { other } else { best });
    best.filter(|(_, distance)| *distance > FLAT).map(|(k, _)| k)
}

/// Normal n of the line or plane n·x = 1 through the best point of each axis, the shortest where fewer points leave a
/// choice; that through (1, 0, …), (0, 1, …), … where these points span none. `None` for less than two axes.
fn normal(scaled: &[Vec<f64>], axes: usize) -> Option<Vec<f64>> {
    let sum = |point: &[f64]| point.iter().sum::<f64>();
    let best_of = |axis: usize| {
        let order = |a: &&Vec<f64>, b: &&Vec<f64>| {
            a[axis].total_cmp(&b[axis]).then(sum(a).total_cmp(&sum(b)))
        };
        scaled.iter().min_by(order)
    };
    let rows = distinct((0..axes).filter_map(best_of));
    if axes < 2 {
        return None;
    }
    // n = Aᵀ y with A Aᵀ y = 1.
    let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let product = |i: usize, j: usize| match (rows.get(i), rows.get(j)) {
        (Some(a), Some(b)) => inner(a, b),
        _ => f64::from(u8::from(i == j)),
    };
    let found = solved(std::array::from_fn(|i| std::array::from_fn(|j| product(i, j))));
    let normal = found.map(|y| -> Vec<f64> {
        let of_axis = |axis: usize| rows.iter().zip(y).map(|(row, y)| y * row[axis]).sum();
        (0..axes).map(of_axis).collect()
    });
    let is_sound = |n: &Vec<f64>| n.iter().all(|value| value.is_finite() && *value > 0.0);
    Some(normal.filter(is_sound).unwrap_or_else(|| vec![1.0; axes]))
}

/// Solution of A x = 1 by Cramer's rule; `None` where there is none.
fn solved(rows: [[f64; 3]; 3]) -> Option<[f64; 3]> {
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
            - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(rows);
    let found: [f64; 3] = std::array::from_fn(|column| {
        let mut replaced = rows;
        replaced.iter_mut().for_each(|row| row[column] = 1.0);
        determinant(replaced) / whole
    });
    found.iter().all(|value| value.is_finite()).then_some(found)
}

/// Checkpoint of a front: every choice of sensors and every search of placements that came to its end. A front that goes
/// on from it has the bits of one that never stopped; only the part under way is done again.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FrontState {
    pub(super) choices: Vec<Answered<Equipped>>,
    pub(super) polished: Vec<Answered<Option<Placement>>>,
    pub(super) met: Vec<Answered<Option<(Placement, Equipment)>>>,
    /// Every rig of a vehicle that has few, none of one that has many; `None` until they are counted.
    #[serde(default)]
    pub(super) every: Option<EveryRig>,
}

/// One part of a front: a question and its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Answered<T> {
    pub asked: String,
    pub found: T,
}

/// Answer to a question that was asked before.
pub(super) fn known<'a, T>(parts: &'a [Answered<T>], asked: &str) -> Option<&'a T> {
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

    /// Question for the cheapest sensors and placement that meet all requirements, by a search of so many evaluations.
    pub(super) fn cheapest(objective: &Objective, evaluations: u64) -> String {
        text((objective, "cheapest", evaluations))
    }

    /// Question for sensors and placement that meet all requirements: the fewest sensors, or the best for all the money.
    pub(super) fn meeting(objective: &Objective, fewest: bool) -> String {
        text((objective, fewest))
    }
}

/// The state of a front under way, and who is told whenever a part is finished.
pub(super) struct FrontProgress<'a> {
    pub state: &'a mut FrontState,
    pub tell: &'a mut dyn FnMut(&FrontState),
}

impl FrontProgress<'_> {
    /// Changes the state, and tells it.
    pub(super) fn keep(&mut self, change: impl FnOnce(&mut FrontState)) {
        change(self.state);
        (self.tell)(self.state);
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn points(values: &[&[f64]]) -> Vec<Objectives> {
        let of = |values: &&[f64]| Objectives { values: values.to_vec(), meets: true };
        values.iter().map(of).collect()
    }

    #[test]
    fn the_front_is_that_of_the_definition() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for round in 0..200 {
            let axes = 2 + round % 2;
            // Few different values, so that many are equal.
            let point = |_| Objectives {
                values: (0..axes).map(|_| f64::from(rng.random_range(0..6))).collect(),
                meets: rng.random_range(0..3) > 0,
            };
            let all: Vec<Objectives> = (0..30).map(point).collect();
            let found = front(&all);
            let beats = |a: &Objectives, b: &Objectives| {
                let no_worse = (0..axes).all(|k| a.values[k] <= b.values[k]);
                let better = (0..axes).any(|k| a.values[k] < b.values[k]) || a.meets && !b.meets;
                (a.meets || !b.meets) && no_worse && better
            };
            let is_best = |k: &usize| all.iter().all(|other| !beats(other, &all[*k]));
            let is_first = |k: &usize| !all[..*k].contains(&all[*k]);
            let exact: Vec<usize> = (0..all.len()).filter(is_best).filter(is_first).collect();
            assert_eq!(found, exact, "round {round}");
            assert!(found.len() < all.len());
        }
    }

    #[test]
    fn one_that_misses_a_requirement_beats_none_that_meets_all() {
        let mut all = points(&[&[1.0, 1.0], &[2.0, 2.0], &[3.0, 3.0]]);
        (all[0].meets, all[2].meets) = (false, false);
        assert_eq!(front(&all), [0, 1]);
    }

    #[test]
    fn the_knee_is_farthest_from_the_line_or_plane() {
        let bent = points(&[&[0.0, 100.0], &[1.0, 30.0], &[2.0, 20.0], &[10.0, 0.0]]);
        // Scaled sums: .4 for both, so that the first of them is taken.
        assert!(matches!(knee(&bent), Some(1 | 2)));
        let bent = points(&[&[0.0, 100.0], &[1.0, 40.0], &[2.0, 20.0], &[10.0, 0.0]]);
        assert_eq!(knee(&bent), Some(2));
        assert_eq!(
            knee(&points(&[&[0.0, 2.0], &[1.0, 1.0], &[2.0, 0.0]])),
            None,
            "a straight line"
        );
        assert_eq!(knee(&points(&[&[0.0, 2.0]])), None);
        assert_eq!(knee(&[]), None);
        // Bent outwards: nothing lies on the side of better values.
        assert_eq!(knee(&points(&[&[0.0, 2.0], &[1.8, 1.8], &[2.0, 0.0]])), None);
        let extremes: [&[f64]; 3] = [&[0.0, 8.0, 8.0], &[8.0, 0.0, 8.0], &[8.0, 8.0, 0.0]];
        let [a, b, c] = extremes;
        let solid = points(&[a, b, c, &[5.0, 5.0, 5.0], &[4.0, 4.0, 5.0]]);
        assert_eq!(knee(&solid), Some(4));
        // Two axes that go together count as one.
        let along =
            points(&[&[0.0, 0.0, 9.0], &[1.0, 1.0, 8.0], &[4.0, 4.0, 3.0], &[9.0, 9.0, 0.0]]);
        assert_eq!(knee(&along), Some(2));
    }
}
