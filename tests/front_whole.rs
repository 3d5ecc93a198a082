//! The front of a vehicle with few rigs: the one of every rig, and a cheapest that is the cheapest.

use sightline::job::{Front, FrontObjectives, Pick};
use sightline::score::Scores;
use sightline::vehicle::{PoseGrid, Spacing};
use sightline::{Event, Job, JobFiles, Placement, Settings};

use crate::cli::*;
use crate::front::street;

/// A street whose cart has four brackets with fixed poses, for three models whose sums are more than 24 prices.
fn brackets(dir: &Path) {
    street(dir, [1, 1], json!([]));
    let model = |name: &str, price: u32, channels: u32, steps: u32, range: u32| {
        json!({ "name": name, "price": price, "lidar": { "channels": channels, "fov": [-24, 6],
            "azimuth_steps": steps, "range": range } })
    };
    let mount = |name: &str, at: [f64; 3], yaw: f64, sensors: Value| json!({ "name": name, "min": at, "max": at, "yaw": [yaw, yaw], "sensors": sensors, "count": [0, 1] });
    let require = json!([
        { "target": "child", "within": 12, "bearing": [-60, 60], "share": 0.6 },
        { "target": "car", "within": 12, "share": 0.6, "without_any_one": true }]);
    let vehicle = json!({ "sightline": 1, "name": "cart", "require": require,
        "body": [{ "class": "vehicle", "box": { "min": [-1, -0.6, 0.2], "max": [1, 0.6, 1.2] } }],
        "sensors": [model("long", 2800, 16, 180, 40), model("wide", 1500, 10, 120, 30), model("short", 900, 8, 120, 18)],
        "mounts": [
            mount("roof", [0.0, 0.0, 1.6], 0.0, json!(["long", "wide", "short"])),
            mount("front", [1.1, 0.0, 0.7], 0.0, json!(["long", "wide", "short"])),
            mount("rear", [-1.1, 0.0, 0.7], 3.1, json!(["long", "wide", "short"])),
            mount("left", [0.0, 0.7, 0.9], 1.6, json!(["wide", "short"]))] });
    write(dir, "cart.json", &vehicle);
}

fn job(dir: &Path, evaluations: u64) -> Job {
    let files = JobFiles::new(&[dir.join("street.json")], None);
    files.read().unwrap().search(Settings { evaluations, ..Settings::default() })
}

fn front(job: &Job, objectives: &FrontObjectives) -> Front {
    job.front(objectives, &mut |_: &Event| true).unwrap()
}

/// Every rig of a vehicle with at most one LiDAR on each fixed bracket.
fn every_rig(job: &Job) -> Vec<Placement> {
    let spacing = Spacing { metres: 0.1, radians: 0.1 };
    let grid = PoseGrid::new(&job.scene().vehicle().every_kind(), spacing).unwrap();
    let poses: Vec<_> = (0..grid.len()).map(|number| grid.pose(number)).collect();
    assert_eq!(poses.len(), 11);
    let mut all = vec![Vec::new()];
    for pose in &poses {
        let is_free = |rig: &&Vec<_>| {
            let mut others = rig.iter().map(|&k: &usize| &poses[k]);
            others.all(|o| (o.x, o.y, o.z) != (pose.x, pose.y, pose.z))
        };
        let number = poses.iter().position(|other| other == pose).unwrap();
        let with = all.iter().filter(is_free).map(|rig| [&rig[..], &[number]].concat());
        let with: Vec<Vec<usize>> = with.collect();
        all.extend(with);
    }
    let rigs = all.iter().filter(|rig| !rig.is_empty()).enumerate();
    let lidars = |rig: &Vec<usize>| rig.iter().map(|&k| poses[k]).collect();
    rigs.map(|(k, rig)| Placement { name: format!("p{k}"), lidars: lidars(rig) }).collect()
}

#[test]
fn the_front_of_few_rigs_is_that_of_every_rig_and_its_cheapest_is_the_cheapest() {
    let dir = TempDir::new().unwrap();
    brackets(dir.path());
    let job = job(dir.path(), 0);
    let placements = every_rig(&job);
    assert_eq!(placements.len(), 191);
    let scores = job.evaluator(|_| {}).unwrap().0.scores(&placements).unwrap();
    let vehicle = job.scene().vehicle();
    let price = |rig: &Placement| vehicle.price_of_rig(rig).unwrap();
    let mut prices: Vec<f64> = placements.iter().map(price).collect();
    prices.sort_by(f64::total_cmp);
    prices.dedup();
    assert!(prices.len() > 24, "{}", prices.len());
    let meets = |scores: &Scores| scores.missing() <= 0.0;
    let met = placements.iter().zip(&scores).filter(|(_, scores)| meets(scores));
    let cheapest = met.map(|(rig, _)| price(rig)).fold(f64::INFINITY, f64::min);
    assert!(cheapest > prices[3] && cheapest < prices[prices.len() - 3], "{cheapest}: {prices:?}");
    for names in ["price,near_gain", "price,requirements", "price,near_gain,targets"] {
        let objectives: FrontObjectives = names.parse().unwrap();
        let found = front(&job, &objectives);
        // Less is better in each value, the last of which is 1 for a rig that misses a requirement.
        let turned = |values: &[f64], meets: bool| -> Vec<f64> {
            let of = objectives.all().iter().zip(values);
            let turned = of.map(|(of, v)| if of.to_string() == "near_gain" { -v } else { *v });
            turned.chain([if meets { 0.0 } else { 1.0 }]).collect()
        };
        let every = placements.iter().zip(&scores).map(|(rig, scores)| {
            let value = |of: &sightline::job::FrontObjective| {
                of.value(scores, rig.lidars.len(), price(rig)).unwrap()
            };
            let values: Vec<f64> = objectives.all().iter().map(value).collect();
            turned(&values, meets(scores))
        });
        let every: Vec<Vec<f64>> = every.collect();
        let beats = |a: &Vec<f64>, b: &Vec<f64>| a != b && a.iter().zip(b).all(|(a, b)| a <= b);
        let is_best = |one: &&Vec<f64>| every.iter().all(|other| !beats(other, one));
        let mut exact: Vec<Vec<f64>> = every.iter().filter(is_best).cloned().collect();
        let points = found.points.iter().map(|point| turned(&point.values, point.meets));
        let mut points: Vec<Vec<f64>> = points.collect();
        for all in [&mut exact, &mut points] {
            all.sort_by(|a, b| a.partial_cmp(b).unwrap());
            all.dedup();
        }
        assert_eq!(points, exact, "{names}");
        let pick = found.picks.iter().find(|(pick, _)| *pick == Pick::Cheapest);
        assert_eq!(found.points[pick.unwrap().1].price, cheapest, "{names}");
        assert!(found.is_whole);
    }
    stdout(
        &dir,
        "optimize street.json --front price,near_gain --backend cpu --evaluations 0 --out run",
    )
    .says(&format!("The cheapest that meets all requirements costs {cheapest} ("));
    // Under a budget and a search around points nothing is lost.
    let less = job
        .clone()
        .budget(Some(cheapest))
        .search(Settings { evaluations: 5, ..Settings::default() });
    let found = front(&less, &"price,near_gain".parse().unwrap());
    assert_eq!(found.points.iter().filter(|point| point.meets).count(), 1, "{found:?}");
}

#[test]
fn the_cheapest_is_no_dearer_than_the_fewest_sensors_found() {
    let dir = TempDir::new().unwrap();
    for (prices, share) in [([30, 11], 0.95), ([30, 29], 0.5), ([37, 11], 0.8)] {
        street(dir.path(), prices, crate::front::car_ahead(share));
        let job = job(dir.path(), 20);
        let found = front(&job, &"price,near_gain".parse().unwrap());
        assert!(!found.is_whole);
        let pick = found.picks.iter().find(|(pick, _)| *pick == Pick::Cheapest).unwrap();
        let fewest = job.clone().fewest(true).optimize(&mut |_: &Event| true).unwrap().unwrap();
        let price = fewest.outcome.best.unwrap().price.unwrap();
        assert!(found.points[pick.1].price <= price, "{prices:?}, {share}: {price}");
    }
}
