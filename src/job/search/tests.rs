//! Tests of `search`.

use super::*;

fn found(sensors: usize, cost: f64, missing: f64) -> Equipped {
    let placement = Placement { name: "x".to_owned(), lidars: vec![] };
    let equipment = vec![(0, crate::vehicle::SensorName::NONE); sensors];
    let (value, out_of_reach, is_cut) = (0.0, Vec::new(), false);
    let ceilings = Vec::new();
    Equipped { equipment, placement, cost, value, missing, out_of_reach, ceilings, is_cut }
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
    // The next cheaper choice misses much: among choices that miss nothing the cheapest is taken.
    assert!(matches!(fewest.next(found(2, 4.0, 0.4), 4, 1.0), Next::Take(e) if e.cost == 8.0));
    // Its placement meets all: bisection over 7, 6 and 5.
    let cost = |of: Option<Equipped>| of.map(|of| of.cost);
    assert_eq!(cost(fewest.cheaper(&found(2, 8.0, 0.0), true)), Some(6.0));
    let mut dearer = fewest.clone();
    assert_eq!(cost(dearer.cheaper(&found(2, 6.0, 0.0), false)), Some(7.0));
    assert_eq!(dearer.untried_below(8.0).as_deref(), Some("cheaper rigs of 2 sensors"));
    assert_eq!(dearer.untried_below(7.0), None);
    assert_eq!(cost(dearer.cheaper(&found(2, 7.0, 0.0), false)), None);
    assert_eq!(cost(fewest.cheaper(&found(2, 6.0, 0.0), true)), Some(5.0));
    assert_eq!(cost(fewest.cheaper(&found(2, 5.0, 0.0), true)), None);
    assert_eq!(fewest.untried_below(5.0), None);
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

/// A scene of one LiDAR, with a box from the ground to `top` as the own body.
fn with_body(top: f64) -> crate::scene::Scene {
    let text = format!(
        r#"{{ "sightline": 1, "roi": {{ "min": [-9,-9,0], "max": [9,9,9], "voxel": [1,1,1] }}, "psog": {{ "file": "x" }},
             "ego": {{ "body": [{{ "class": "vehicle", "box": {{ "min": [-3,-1.2,0], "max": [3,1.2,{top}] }} }}] }},
             "lidar": {{ "channels": 5, "fov": [-30, 30], "azimuth_steps": 60, "range": 12 }},
             "mount": {{ "min": [-1,-1,4], "max": [1,1,4.2], "lidars": 2 }} }}"#
    );
    crate::scene::Scene::from_json(&text, "".as_ref(), "s").unwrap()
}

#[test]
fn layouts_of_the_paper_inside_the_own_body_are_no_baselines() {
    let usual = Settings::default().baselines.len();
    let of = |top: f64, plainly: bool| {
        let scene = with_body(top);
        let (settings, note) =
            begun(Settings::default(), plainly, &scene, &scene.vehicle().rules());
        (settings.baselines, note.unwrap_or_default())
    };
    let (car, note) = of(1.5, true);
    assert_eq!((car.len(), &*note), (usual, ""));
    let (truck, note) = of(3.9, true);
    assert_eq!((truck.len(), &*truck[0].name, truck[0].lidars.len()), (1, "plain", 2));
    assert!(truck[0].lidars.iter().all(|lidar| lidar.z == 4.2));
    assert_eq!(
        note,
        format!(
            "{usual} of {usual} layouts of Table 7 are left out: a LiDAR of each stands inside the own body; --baselines \
             gives others; the baseline is `plain`, the same sensors placed without a search"
        )
    );
    // Baselines that were given stay.
    assert_eq!(of(3.9, false).0.len(), usual);
    assert!(with_body(3.9).is_in_body([0.0, 0.0, 3.8].into()));
    assert!(!with_body(3.9).is_in_body([0.0, 0.0, 4.0].into()));
}
