//! Equipment of a vehicle: against every combination of a small one, and what must be seen.

use std::time::{Duration, Instant};

use sightline::engine::EngineChoice;
use sightline::search::{
    Choosing, EquipStep, Equipped, Equipping, Event, Limits, Observer, SearchError, Work,
    cost_front,
};
use sightline::vehicle::{
    Region, Requirement, Response, SensorName, SpinPhase, Vehicle, VehicleMount, VehicleSensor,
};

use crate::common::*;

mod few;

/// Two models, two small mounts of at most two and one sensors.
fn vehicle(require: Vec<Requirement>) -> Vehicle {
    let lidar = |steps, range, name: &str| {
        let text = format!(
            r#"{{ "sightline": 1, "roi": {{ "min": [0,0,0], "max": [9,9,9], "voxel": [1,1,1] }}, "psog": {{ "file": "x" }},
                 "lidar": {{ "channels": 5, "fov": [-30, 30], "azimuth_steps": {steps}, "range": {range} }},
                 "mount": {{ "min": [1,1,1], "max": [1,1,1], "lidars": 1 }} }}"#
        );
        let scene = sightline::scene::Scene::from_json(&text, "".as_ref(), "s").unwrap();
        let name = SensorName::new(name).unwrap();
        let price = f64::from(steps) / 10.0;
        let (lidar, phase) = (scene.lidars()[0].clone(), SpinPhase::Locked(0.0));
        let response = Response::usual(f64::from(range));
        VehicleSensor { name, lidar, phase, price, has_price: true, response, has_rate: false }
    };
    let sensors = vec![lidar(60, 12, "dear"), lidar(20, 6, "cheap")];
    let mount = |name: &str, x: f64, sensors: Vec<SensorName>, count| VehicleMount {
        region: Arc::new(Region {
            name: name.into(),
            lower: [x, -0.2, 0.0, 0.0, 0.0, 0.0],
            upper: [x, 0.2, 0.2, 0.0, 0.0, 0.0],
            ..Region::default()
        }),
        sensors,
        count,
    };
    let names: Vec<SensorName> = sensors.iter().map(|sensor| sensor.name).collect();
    Vehicle {
        name: "small".into(),
        mounts: vec![
            mount("front", 1.5, names.clone(), [0, 2]),
            mount("rear", -1.5, names, [0, 1]),
        ],
        sensors,
        min_distance: 0.15,
        keep_out: Vec::new(),
        notes: Vec::new(),
        ties: Default::default(),
        require,
        targets: Vec::new(),
        overlap: Vec::new(),
        require_order: Vec::new(),
        ground: Vec::new(),
        other_sensors: Vec::new(),
    }
}

fn problem(seed: u64, vehicle: &Vehicle) -> Problem {
    let problem = Arc::unwrap_or_clone(random_problem(seed, true));
    let models = vehicle.models().unwrap();
    problem.with_sensors(models)
}

/// The choice by the gain, for 14, on the CPU.
fn opened(
    suite: &sightline::Suite,
    vehicle: &Vehicle,
    deadline: Option<Instant>,
    observer: &mut dyn Observer,
) -> Option<Equipping> {
    let objective = "information_gain".parse().unwrap();
    let (limits, engine) = (Limits::budget(14.0), EngineChoice::cpu());
    Equipping::open(suite, vehicle, &objective, limits, &engine, deadline, observer).unwrap()
}

/// The choice without anybody looking on.
fn equip(
    suite: &sightline::Suite,
    vehicle: &Vehicle,
    objective: &sightline::Objective,
    budget: f64,
    engine: &EngineChoice,
) -> Result<Equipped, SearchError> {
    let silent = &mut |_: &Event| true;
    let found = watched(suite, vehicle, objective, budget, engine, silent)?;
    Ok(found.expect("nobody stops it"))
}

/// The choice step by step; `None` where the observer stops it.
fn watched(
    suite: &sightline::Suite,
    vehicle: &Vehicle,
    objective: &sightline::Objective,
    budget: f64,
    engine: &EngineChoice,
    observer: &mut dyn Observer,
) -> Result<Option<Equipped>, SearchError> {
    let opened =
        Equipping::open(suite, vehicle, objective, Limits::budget(budget), engine, None, observer)?;
    let Some(mut choice) = opened else { return Ok(None) };
    loop {
        match choice.step(observer)? {
            EquipStep::On => {}
            EquipStep::Stopped => return Ok(None),
            EquipStep::Done(found) | EquipStep::OutOfTime(found) => return Ok(Some(found)),
        }
    }
}

#[test]
fn the_choice_tells_how_far_it_is_and_stops_when_told() {
    let vehicle = vehicle(Vec::new());
    let problem = problem(5, &vehicle);
    let objective = "information_gain".parse().unwrap();
    let (suite, engine) = (problem.clone().into(), EngineChoice::cpu());
    let mut told: Vec<(Work, u64, u64)> = Vec::new();
    for stop_after in [1, 3, usize::MAX] {
        told.clear();
        let mut observe = |event: &Event| {
            if let Event::Progress { work, done, total } = *event {
                told.push((work, done, total));
            }
            told.len() < stop_after
        };
        let found = watched(&suite, &vehicle, &objective, 14.0, &engine, &mut observe).unwrap();
        assert_eq!(found.is_some(), stop_after == usize::MAX);
        assert!(told.len() <= stop_after);
        if let Some(found) = found {
            assert_eq!(found, equipped(&problem, &vehicle, 14.0), "looking on changes nothing");
        }
    }
    assert!(told.iter().any(|(work, ..)| *work == Work::Equipment));
    assert!(told.iter().any(|(work, ..)| *work == Work::Exchanges));
    assert!(told.iter().all(|(_, done, total)| done < total), "{told:?}");
}

#[test]
fn a_grid_of_both_ends_alone_is_told() {
    let told = |mounts: u32| {
        let mut vehicle = vehicle(Vec::new());
        let mount = vehicle.mounts[1].clone();
        let numbered = |k: u32| {
            let mut mount = mount.clone();
            let (region, x) = (Arc::make_mut(&mut mount.region), f64::from(k));
            region.name = format!("mount-{k}");
            (region.lower, region.upper) =
                ([x, -0.2, 0.0, -0.1, -0.1, -0.1], [x + 0.2, 0.2, 0.2, 0.1, 0.1, 0.1]);
            mount
        };
        vehicle.mounts = (0..mounts).map(numbered).collect();
        let suite = problem(5, &vehicle).into();
        let (mut notes, mut poses) = (Vec::new(), 0);
        let mut observe = |event: &Event| {
            match *event {
                Event::Note(words) => notes.push(words.to_owned()),
                Event::Progress { work: Work::Equipment, total, .. } => poses = total,
                _ => {}
            }
            poses == 0
        };
        let opened = opened(&suite, &vehicle, None, &mut observe);
        assert!(opened.is_none(), "it is stopped before it casts");
        notes.retain(|words| words.contains("both ends of every pose field"));
        (poses, notes)
    };
    // Two ends of six fields are 64 poses, for each of two models on every mount.
    let (poses, notes) = told(10);
    assert_eq!(poses, 2 * 10 * 64);
    assert!(notes.len() == 1 && notes[0].contains("among 1280 poses"), "{notes:?}");
    let (poses, notes) = told(9);
    assert!(poses <= 1200 && notes.is_empty(), "{poses} {notes:?}");
}

#[test]
fn time_that_ends_at_any_moment_leaves_a_rig() {
    // No mount must hold a sensor: a choice that is cut before its first has none.
    let vehicle = vehicle(Vec::new());
    let suite = problem(5, &vehicle).into();
    for moment in 0..4 {
        let deadline = Instant::now() + Duration::from_millis(300);
        let mut exchanges = 0;
        let mut wait = |event: &Event| {
            if let Event::Progress { work: Work::Exchanges, .. } = event {
                if exchanges == moment {
                    std::thread::sleep(deadline.saturating_duration_since(Instant::now()));
                }
                exchanges += 1;
            }
            true
        };
        let mut choice =
            opened(&suite, &vehicle, Some(deadline), &mut wait).expect("nobody stops it");
        let rig = loop {
            match choice.step(&mut wait).unwrap() {
                EquipStep::On => {}
                EquipStep::OutOfTime(rig) => break rig,
                other => panic!("cut at {moment}: {other:?}"),
            }
        };
        assert!(!rig.equipment.is_empty() && rig.cost <= 14.0, "cut at {moment}: {rig:?}");
    }
}

#[test]
fn a_grid_that_memory_does_not_hold_is_an_error() {
    let vehicle = vehicle(Vec::new());
    let suite = problem(5, &vehicle).into();
    let objective = "information_gain".parse().unwrap();
    let engine = EngineChoice { memory: Some(1 << 14), ..EngineChoice::cpu() };
    let error = equip(&suite, &vehicle, &objective, 14.0, &engine).unwrap_err().to_string();
    assert!(error.contains("equipment") && error.contains("--memory"), "{error}");
}

#[test]
fn a_choice_that_is_saved_after_any_step_goes_on_to_the_same_equipment() {
    let vehicle = vehicle(Vec::new());
    let problem = problem(5, &vehicle);
    let whole = equipped(&problem, &vehicle, 14.0);
    let suite = problem.into();
    let silent = &mut |_: &Event| true;
    let mut state: Option<Choosing> = None;
    let mut steps = 0;
    loop {
        // Nothing lives on from step to step but the text of the state.
        let mut choice = opened(&suite, &vehicle, None, silent).expect("nobody stops it");
        if let Some(state) = &state {
            choice = choice.with_state(state.clone());
            assert_eq!(choice.state(), state);
        }
        match choice.step(silent).unwrap() {
            EquipStep::Done(found) => break assert_eq!(found, whole),
            step => assert_eq!(step, EquipStep::On),
        }
        let text = serde_json::to_string(choice.state()).unwrap();
        state = Some(serde_json::from_str(&text).unwrap());
        steps += 1;
    }
    assert!(steps > 6, "{steps} steps");
    // One of another vehicle begins anew.
    let far: Choosing = serde_json::from_str(r#"{ "ends": [[4000000]], "climb": null }"#).unwrap();
    let choice = opened(&suite, &vehicle, None, silent).unwrap();
    let begun = choice.state().clone();
    assert_eq!(*choice.with_state(far).state(), begun);
    // So does one of another grid, as of an earlier version, whose numbers would fit.
    let other: Choosing = serde_json::from_str(r#"{ "ends": [[0]], "climb": null }"#).unwrap();
    let choice = opened(&suite, &vehicle, None, silent).unwrap();
    assert_eq!(*choice.with_state(other).state(), begun);
}

fn equipped(problem: &Problem, vehicle: &Vehicle, budget: f64) -> Equipped {
    let objective = "information_gain".parse().unwrap();
    equip(&problem.clone().into(), vehicle, &objective, budget, &EngineChoice::cpu()).unwrap()
}

#[test]
fn no_other_equipment_of_a_small_vehicle_gains_much_more() {
    let vehicle = vehicle(Vec::new());
    let [dear, cheap] = [&vehicle.sensors[0], &vehicle.sensors[1]];
    for seed in 1..=3 {
        let problem = problem(seed, &vehicle);
        for budget in [2.0, 5.5, 6.0, 8.5, 9.9, 10.5, 30.0] {
            let found = equipped(&problem, &vehicle, budget);
            assert!(found.cost <= budget && !found.equipment.is_empty());
            // One search with each equipment fixed: no choice is left but that of poses.
            let mut best = f64::MIN;
            for front in [
                vec![],
                vec![dear],
                vec![cheap],
                vec![dear, dear],
                vec![dear, cheap],
                vec![cheap, cheap],
            ] {
                for rear in [vec![], vec![dear], vec![cheap]] {
                    let all: Vec<_> = front.iter().chain(&rear).collect();
                    let cost: f64 = all.iter().map(|sensor| sensor.price).sum();
                    if all.is_empty() || cost > budget {
                        continue;
                    }
                    let mut mounts = Vec::new();
                    for (k, sensors) in [&front, &rear].into_iter().enumerate() {
                        for sensor in sensors {
                            let (sensors, count) = (vec![sensor.name], [1, 1]);
                            let region = vehicle.mounts[k].region.clone();
                            let name = format!("{}-{}", region.name, mounts.len());
                            let region = Arc::new(Region { name, ..Region::clone(&region) });
                            mounts.push(VehicleMount { region, sensors, count });
                        }
                    }
                    let fixed = Vehicle { mounts, ..vehicle.clone() };
                    best = best.max(equipped(&problem, &fixed, budget).value);
                }
            }
            assert!(
                found.value >= 0.97 * best,
                "seed {seed}, budget {budget}: {} of {best}",
                found.value
            );
        }
    }
}

#[test]
fn more_money_never_gains_less_along_a_front() {
    let vehicle = vehicle(Vec::new());
    let problem = problem(4, &vehicle);
    let objective = "information_gain".parse().unwrap();
    let front = cost_front(
        &problem.into(),
        &vehicle,
        &objective,
        Limits::budget(f64::INFINITY),
        &EngineChoice::cpu(),
    )
    .unwrap();
    assert!(front.len() >= 4, "{front:?}");
    assert_eq!(front[0].cost, 2.0);
    assert!(front.windows(2).all(|pair| pair[0].value <= 1.02 * pair[1].value), "{front:?}");
    assert!(front.last().unwrap().equipment.len() == 3);
}

/// A share of the area behind that must be seen.
fn near(share: f64) -> Requirement {
    let inside = [[-4.0, -2.0, -1.0], [-2.0, 2.0, 1.0]];
    Requirement { name: "behind".into(), inside, without: Vec::new(), share }
}

#[test]
fn what_must_be_seen_comes_before_what_gains() {
    let seen = |share, budget| {
        let vehicle = vehicle(vec![near(share)]);
        let problem = problem(5, &vehicle).with_areas(&vehicle.require);
        (equipped(&problem, &vehicle, budget), vehicle)
    };
    let (free, _) = seen(0.0, 2.0);
    let (bound, _) = seen(0.3, 2.0);
    assert_eq!((free.missing, bound.missing), (0.0, 0.0));
    // Without its requirements a problem is that of a vehicle which has none.
    let needy = problem(5, &vehicle(vec![near(1.0)])).with_areas(&[near(1.0), near(0.5)]);
    assert_eq!(needy.content().areas().len(), 2);
    let (freed, plain) = (needy.without_requirements(), problem(5, &vehicle(Vec::new())));
    assert_eq!(freed.content(), plain.content());
    let (all, vehicle) = seen(1.0, 2.0);
    assert!(all.missing > 0.0, "one cheap sensor does not see everything");
    assert_eq!(all.equipment[0].0, 1, "it stands in the rear: {all:?}");
    assert!(all.value <= free.value && vehicle.cost(&all.equipment) <= 2.0);
}

#[test]
fn the_upper_end_of_a_short_axis_is_looked_at() {
    let mut vehicle = vehicle(Vec::new());
    vehicle.mounts.truncate(1);
    let region = Arc::make_mut(&mut vehicle.mounts[0].region);
    (region.lower[2], region.upper[2]) = (0.0, 0.05);
    let problem = problem(7, &vehicle);
    let heights = |budget: f64| {
        let found = equipped(&problem, &vehicle, budget);
        found.placement.lidars.iter().map(|lidar| lidar.z).collect::<Vec<_>>()
    };
    let all: Vec<f64> = [2.0, 4.0, 6.0, 8.0, 12.0].into_iter().flat_map(heights).collect();
    assert!(all.iter().all(|z| [0.0, 0.05].contains(z)) && all.contains(&0.05), "{all:?}");
}

#[test]
fn better_sensors_of_a_given_placement_are_taken_and_dear_ones_are_not() {
    let vehicle = vehicle(vec![near(1.0)]);
    let problem = problem(5, &vehicle).with_areas(&vehicle.require);
    let (objective, engine) = ("information_gain".parse().unwrap(), EngineChoice::cpu());
    let silent = &mut |_: &Event| true;
    let (suite, limits) = (problem.clone().into(), Limits::budget(6.0));
    let open = Equipping::open(&suite, &vehicle, &objective, limits, &engine, None, silent);
    let choice = open.unwrap().unwrap();
    let [few, many, dear] = [2.0, 6.0, 30.0].map(|budget| equipped(&problem, &vehicle, budget));
    assert!(few.missing > many.missing && many.missing > dear.missing, "{few:?} {many:?} {dear:?}");
    let mut given = [&few, &many, &dear].map(|of| of.placement.clone());
    given[1].name = "mine".to_owned();
    // Given in another order than the mounts have, as people write them.
    given[1].lidars.reverse();
    let (taken, name) = choice.or_given(&vehicle, &given, few.clone(), silent).unwrap().unwrap();
    assert_eq!((name.as_deref(), taken.cost), (Some("mine"), many.cost));
    assert_eq!(taken.equipment, many.equipment);
    assert_eq!(taken.placement.lidars, many.placement.lidars);
    // A worse one is not taken, nor the chosen rig itself.
    let worse = [&few, &many].map(|of| of.placement.clone());
    let (kept, name) = choice.or_given(&vehicle, &worse, many.clone(), silent).unwrap().unwrap();
    assert_eq!((name, &kept), (None, &many));
    // One that breaks a rule, and one that is no better, are not taken.
    given[1].lidars[0].y = 3.0;
    let (kept, name) = choice.or_given(&vehicle, &given, few.clone(), silent).unwrap().unwrap();
    assert_eq!((name, kept), (None, few.clone()));
    // The look is told before each cast, and can be stopped there.
    let (mut told, mut is_given, mut notes) = (0, true, 0);
    let mut stop = |event: &Event| {
        is_given &= matches!(event, Event::Progress { work: Work::Given, done: 0, total: 1.. });
        told += 1;
        false
    };
    let stopped = choice.or_given(&vehicle, &given, few.clone(), &mut stop).unwrap();
    assert_eq!((stopped, told, is_given), (None, 1, true));
    // Where the time is over the rig chosen stays, as one of a choice that was cut.
    let choice = choice.until(Some(Instant::now()));
    given[1] = many.placement.clone();
    let listen = &mut |event: &Event| {
        notes += u32::from(matches!(event, Event::Note(_)));
        true
    };
    let kept = choice.or_given(&vehicle, &given, few.clone(), listen).unwrap();
    assert_eq!((kept, notes), (Some((Equipped { is_cut: true, ..few }, None)), 1));
}

#[test]
fn a_budget_below_the_cheapest_rig_is_refused() {
    let mut vehicle = vehicle(Vec::new());
    vehicle.mounts[0].count = [2, 2];
    let problem = problem(6, &vehicle);
    let gain = "information_gain".parse().unwrap();
    let error =
        equip(&problem.clone().into(), &vehicle, &gain, 3.0, &EngineChoice::cpu()).unwrap_err();
    assert!(
        error.to_string().contains("3 is below the cheapest rig of this vehicle, which costs 4"),
        "{error}"
    );
    let m_sog = "m_sog_scaled".parse().unwrap();
    let refused = equip(&problem.clone().into(), &vehicle, &m_sog, 30.0, &EngineChoice::cpu());
    assert!(matches!(refused, Err(SearchError::NotForEquipment { .. })), "{refused:?}");
    assert_eq!(equipped(&problem, &vehicle, 4.0).equipment.len(), 2);
    // Where there is nothing to choose any objective will do.
    for (k, mount) in vehicle.mounts.iter_mut().enumerate() {
        (mount.count, mount.sensors) = ([1, 1], vec![vehicle.sensors[k].name]);
    }
    let fixed = equip(&problem.into(), &vehicle, &m_sog, 30.0, &EngineChoice::cpu()).unwrap();
    assert_eq!((fixed.equipment.len(), fixed.cost, fixed.value < 0.0), (2, 8.0, true));
}

#[test]
fn sensors_of_a_symmetric_vehicle_are_chosen_in_pairs() {
    let mut vehicle = vehicle(Vec::new());
    let side = |name: &str, y: [f64; 2]| {
        let mut mount = vehicle.mounts[1].clone();
        let region = Arc::make_mut(&mut mount.region);
        region.name = name.into();
        (region.lower[1], region.upper[1]) = (y[0], y[1]);
        mount
    };
    let [left, right] = [side("left", [0.3, 0.6]), side("right", [-0.6, -0.3])];
    // A roof for up to three sensors, a door on each side for one; two models on all.
    vehicle.mounts.truncate(1);
    vehicle.mounts[0].count = [0, 3];
    vehicle.mounts.extend([left, right]);
    vehicle.ties.symmetric = true;
    let mut bought = Vec::new();
    for (seed, budget) in [(1, 2.0), (1, 4.0), (1, 6.0), (2, 12.0), (2, 16.0), (3, 100.0)] {
        let problem = problem(seed, &vehicle);
        let found = equipped(&problem, &vehicle, budget);
        assert!(found.cost <= budget && !found.equipment.is_empty());
        let rules = vehicle.constraints(&found.equipment);
        assert_eq!(rules.violations(&found.placement), [], "{:?}", found.placement);
        assert!(rules.variables_of(&found.placement).is_some(), "a search can start from it");
        let on = |mount: usize| found.equipment.iter().filter(move |(k, _)| *k == mount);
        assert!(on(1).map(|(_, name)| name).eq(on(2).map(|(_, name)| name)), "{found:?}");
        bought.push((on(0).count(), on(1).count()));
        // It holds as many as it must, also where that is an odd number.
        vehicle.mounts[0].count = [3, 3];
        let full = equipped(&problem, &vehicle, budget + 100.0);
        assert_eq!(full.equipment.iter().filter(|(k, _)| *k == 0).count(), 3, "{full:?}");
        assert_eq!(vehicle.constraints(&full.equipment).violations(&full.placement), []);
        vehicle.mounts[0].count = [0, 3];
    }
    assert_eq!(bought[0], (1, 0), "for one sensor there is the plane of symmetry alone");
    assert!(bought.iter().any(|(_, doors)| *doors == 1), "{bought:?}");
    // Doors that must hold nothing, and a roof that can: the cheapest is a sensor in the plane.
    assert_eq!(vehicle.cost(&vehicle.cheapest()), 2.0);
    vehicle.mounts.remove(0);
    assert_eq!(vehicle.cost(&vehicle.cheapest()), 4.0, "a door brings its image");
}
