//! Equipment where few rigs are possible: against all of them.

use super::*;

/// The vehicle with five mounts of one pose each instead, each for one sensor of either model or none.
fn brackets() -> Vehicle {
    let vehicle = vehicle(Vec::new());
    let at =
        [[1.5, 0.2, 0.0], [-1.5, 0.0, 0.1], [0.3, 1.4, 0.2], [0.2, -1.5, 0.0], [0.0, 0.1, 0.9]];
    let mount = |k: usize| {
        let [x, y, z] = at[k];
        let pose = [x, y, z, 0.0, 0.0, 0.0];
        let name = format!("bracket-{k}");
        let region = Arc::new(Region { name, lower: pose, upper: pose, ..Region::default() });
        VehicleMount { region, count: [0, 1], ..vehicle.mounts[0].clone() }
    };
    Vehicle { mounts: (0..at.len()).map(mount).collect(), ..vehicle.clone() }
}

#[test]
fn the_best_of_all_rigs_on_fixed_brackets_is_chosen() {
    let vehicle = brackets();
    // None, the dear or the cheap model on each of five brackets, each rig with its gain as the only one that there is.
    let rigs = (1..3_usize.pow(5)).map(|rig| {
        let on = |k: usize| (rig / 3_usize.pow(k as u32) % 3).checked_sub(1);
        let chosen = (0..5).filter_map(|k| on(k).map(|model| (k, &vehicle.sensors[model])));
        chosen.collect::<Vec<_>>()
    });
    let rigs: Vec<_> = rigs.collect();
    for seed in 1..=4 {
        let problem = problem(seed, &vehicle);
        let gains: Vec<(f64, f64)> = rigs
            .iter()
            .map(|rig| {
                let of = |&(k, sensor): &(usize, &VehicleSensor)| VehicleMount {
                    sensors: vec![sensor.name],
                    count: [1, 1],
                    ..vehicle.mounts[k].clone()
                };
                let only = Vehicle { mounts: rig.iter().map(of).collect(), ..vehicle.clone() };
                let found = equipped(&problem, &only, 30.0);
                (found.cost, found.value)
            })
            .collect();
        for budget in [2.0, 4.5, 6.0, 8.5, 10.5, 12.5, 14.5, 16.5, 18.5, 20.5] {
            let within = gains.iter().filter(|(cost, _)| *cost <= budget);
            let best = within.map(|(_, gain)| *gain).fold(f64::MIN, f64::max);
            let found = equipped(&problem, &vehicle, budget);
            assert!(found.cost <= budget, "seed {seed}, budget {budget}: {}", found.cost);
            assert!(found.value >= best, "seed {seed}, budget {budget}: {} of {best}", found.value);
        }
    }
}
