//! Tests of `search`.

use super::*;

fn found(sensors: usize, cost: f64, missing: f64) -> Equipped {
    let placement = Placement { name: "x".to_owned(), lidars: vec![] };
    let equipment = vec![(0, crate::vehicle::SensorName::NONE); sensors];
    let (value, out_of_reach, is_cut) = (0.0, Vec::new(), false);
    Equipped { equipment, placement, cost, value, missing, out_of_reach, is_cut }
}

#[test]
fn the_number_grows_until_little_is_missing_and_then_the_price_falls() {
    let mut fewest = Fewest::new(f64::INFINITY, 0);
    assert_eq!(fewest.limits.sensors, 1);
    assert!(matches!(fewest.next(found(1, 5.0, 0.4), 4, 1.0), Next::Again(l) if l.sensors == 2));
    let again = fewest.next(found(2, 9.0, 0.0), 4, 1.0);
    assert!(matches!(again, Next::Again(l) if l.sensors == 2 && l.budget < 9.0 && l.budget > 8.9));
    for (cost, missing) in [(8.0, 0.0), (7.0, 0.1), (6.0, 0.05), (5.0, 0.2)] {
        let again = fewest.next(found(2, cost, missing), 4, 1.0);
        assert!(matches!(again, Next::Again(l) if l.budget < cost), "{cost}");
    }
    // The next cheaper one misses much: the cheapest of those that miss nothing is taken.
    assert!(matches!(fewest.next(found(2, 4.0, 0.4), 4, 1.0), Next::Take(e) if e.cost == 8.0));
    // Its placement meets all: bisection over 7, 6 and 5.
    let cost = |of: Option<Equipped>| of.map(|of| of.cost);
    assert_eq!(cost(fewest.cheaper(&found(2, 8.0, 0.0), true)), Some(6.0));
    let mut dearer = fewest.clone();
    assert_eq!(cost(dearer.cheaper(&found(2, 6.0, 0.0), false)), Some(7.0));
    assert_eq!(dearer.untried_cheaper().as_deref(), Some("cheaper rigs of 2 sensors"));
    assert_eq!(cost(dearer.cheaper(&found(2, 7.0, 0.0), false)), None);
    assert_eq!(cost(fewest.cheaper(&found(2, 6.0, 0.0), true)), Some(5.0));
    assert_eq!(cost(fewest.cheaper(&found(2, 5.0, 0.0), true)), None);
    assert_eq!(fewest.untried_cheaper(), None);
}

#[test]
fn a_choice_that_misses_little_and_the_last_one_are_taken() {
    // The search of placements may close a small gap; the cheapest rig there is has no cheaper one.
    assert!(matches!(Fewest::new(9.0, 1).next(found(1, 5.0, 0.2), 4, 5.0), Next::Take(_)));
    let mut fewest = Fewest::new(10.0, 2);
    assert!(matches!(fewest.next(found(2, 5.0, 0.6), 3, 1.0), Next::Again(_)));
    assert!(matches!(fewest.next(found(3, 5.0, 0.5), 3, 1.0), Next::Take(e) if e.missing == 0.5));
}

#[test]
fn equipment_that_was_searched_is_not_searched_again() {
    let mut fewest = Fewest::new(9.0, 2);
    fewest.searched.push(found(2, 5.0, 0.2).equipment);
    // Two sensors again, though three are allowed: four are allowed next, and the last choice is taken in any case.
    assert!(matches!(fewest.next(found(2, 5.0, 0.2), 4, 1.0), Next::Again(l) if l.sensors == 3));
    assert!(matches!(fewest.next(found(2, 5.0, 0.0), 4, 1.0), Next::Again(l) if l.sensors == 4));
    assert!(matches!(fewest.next(found(2, 5.0, 0.2), 4, 1.0), Next::Take(_)));
    // Others may close a small gap.
    let three = fewest.next(found(3, 5.0, 0.2), 4, 5.0);
    assert!(matches!(three, Next::Take(e) if e.equipment.len() == 3));
}
