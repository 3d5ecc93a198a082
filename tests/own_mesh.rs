//! The example of docs/own-mesh.md on real meshes: OBJ, PLY and glTF together, mounts on the body of a car.

use std::path::Path;

use sightline::Scene;
use sightline::job::{Job, JobStep};
use sightline::search::{Event, Settings};
use sightline::vehicle::Region;

/// Where the files of the example are among the real data.
const FILES: [(&str, &str); 5] = [
    ("meshes/mcity.obj", "scenes/mcity/mcity.obj"),
    ("meshes/prius.obj", "vehicles/prius/hybrid_body.obj"),
    ("meshes/low_poly_car.ply", "vehicles/low_poly_car.ply"),
    ("meshes/CesiumMilkTruck.glb", "vehicles/CesiumMilkTruck.glb"),
    ("meshes/kenney_motorcycle.glb", "vehicles/kenney_motorcycle.glb"),
];

/// The scene of the example, its vehicle inline.
fn town() -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = |name: &str| std::fs::read_to_string(root.join("docs/own-mesh").join(name)).unwrap();
    let vehicle = text("prius.json").replacen("\"sightline\": 1,", "", 1);
    let mut scene = text("town.json").replace("\"prius.json\"", &vehicle);
    let data = root.join(env!("REAL_DATA"));
    for (name, file) in FILES {
        scene = scene.replace(name, &data.join(file).display().to_string());
    }
    Scene::from_json(&scene, root, "town.json").unwrap()
}

/// Poses all over a mount, also beside it, keep its rules and are found again.
fn check_mount(region: &Region) {
    let middle = |k: usize| 0.5 * (region.lower[k] + region.upper[k]);
    for i in 0..400_u32 {
        // Two sequences that fill the square, a third beyond its edges.
        let share = |step: f64| (f64::from(i) * step).fract() * 1.3 - 0.15;
        let [u, v] = if region.upper[2] > 0.25 { [1, 2] } else { [0, 1] };
        let mut fields: [f64; 6] = std::array::from_fn(middle);
        for (k, share) in [(u, share(0.754_877_666)), (v, share(0.569_840_291))] {
            fields[k] = region.lower[k] + share * (region.upper[k] - region.lower[k]);
        }
        let pose = region.pose(fields, Default::default());
        assert_eq!(region.outside(&pose), [], "{}: {fields:?}", region.name);
        let again = region.pose(region.fields(&pose), Default::default());
        let moved = pose.position().distance(again.position());
        assert!(moved < 1e-6, "{}: {fields:?} moves by {moved} m", region.name);
    }
}

#[test]
#[cfg_attr(not(has_meshes), ignore = "needs the meshes of ../shared/data or SIGHTLINE_DATA")]
fn the_example_of_the_docs_runs_on_real_meshes() {
    let scene = town();
    let vehicle = scene.vehicle().clone();
    let regions: Vec<&Region> = vehicle.mounts.iter().map(|mount| &*mount.region).collect();
    regions.iter().for_each(|region| check_mount(region));
    // The car is 1.53 m high; its nose is ahead.
    let roof = regions[0].pose([0.0; 6], Default::default());
    assert!((1.4..1.55).contains(&roof.z) && roof.roll.abs() < 0.05, "{roof:?}");
    let nose = regions[1].pose([0.0; 6], Default::default());
    assert!((1.9..2.4).contains(&nose.x) && nose.yaw.abs() < 0.1, "{nose:?}");
    let frame = scene.frame(0, sightline::scene::EgoBody::Include);
    assert!(frame.faces.len() > 7333 + 1676 + 2856 + 960, "{} triangles", frame.faces.len());

    let objective = Settings::default().objective;
    let silent = &mut |_: &Event| true;
    let settings = Settings { evaluations: 16, baselines: vec![], ..Settings::default() };
    let job = Job::new(scene).search(settings).objective(objective).budget(Some(1500.0));
    let mut run = job.begin().unwrap();
    let outcome = loop {
        match run.step(silent).unwrap() {
            JobStep::On => {}
            JobStep::Stopped => panic!("nobody stops it"),
            JobStep::Done(outcome) => break outcome,
        }
    };
    let (best, found) = (outcome.best.unwrap(), run.equipped().unwrap());
    assert!(best.violations.is_empty(), "{:?}", best.violations);
    assert!(best.objective.unwrap() >= 0.5 * found.value && best.scores.covered > 1000.0);
}
