//! Scans exported in the layout of nuScenes and read again: the voxels of each class that the scans themselves give.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::{DVec3, Vec3};
use sightline::datasets::{LabelledSequence, PsogOptions, build_psog, read_nuscenes};
use sightline::export::{Dataset, DatasetSettings, Layout, SceneFacts, Split, record};
use sightline::psog::Roi;
use sightline::scan::{EGO_INSTANCE, NO_INSTANCE, Scan, Scanner, Scanning};
use sightline::scene::{ActorKind, Scene};
use sightline::vehicle::{Placement, read_placements};

const FRAMES: usize = 6;
/// Share by which the voxels of a class may differ: positions are rounded to f32 in another frame.
const TOLERANCE: f64 = 0.002;
/// Classes that an export to nuScenes keeps, alone or with others that share a category with it.
const CLASSES: [(&str, &[&str]); 7] = [
    ("vehicle", &[]),
    ("pedestrian", &[]),
    ("road", &["road_line"]),
    ("sidewalk", &[]),
    ("terrain", &[]),
    ("vegetation", &[]),
    (
        "building",
        &["fence", "pole", "wall", "traffic_sign", "bridge", "guard_rail", "traffic_light"],
    ),
];

/// What a class counts as, once it was exported.
fn merged(name: &str) -> &str {
    CLASSES.iter().find(|(_, others)| others.contains(&name)).map_or(name, |(into, _)| into)
}

/// Whether an actor is never farther than half a metre from where it was in the first of the scans.
fn stands(scans: &[Scan], instance: u16) -> bool {
    let places = scans.iter().filter_map(|scan| {
        let found = scan.boxes.iter().find(|tracked| tracked.instance == instance)?;
        Some(scan.world_from_ego.apply(found.ego_from_box.translation))
    });
    let places: Vec<DVec3> = places.collect();
    places.iter().all(|place| place.distance(places[0]) <= 0.5)
}

/// Voxels of each class with the frames that they have it in: every point votes in all frames, those of
/// actors on their way in their own.
fn truth(scans: &[Scan], roi: &Roi) -> BTreeMap<u16, u64> {
    let names = &scans[0].classes;
    let number = |wanted: &str| names.iter().position(|name| name == wanted).unwrap() as u16;
    let into: Vec<u16> = names.iter().map(|name| number(merged(name))).collect();
    let vehicle = number("vehicle");
    // The export labels actors by their kind: who rides a bicycle is a part of it.
    let ridden = |scan: &Scan, instance: u16| {
        let found = scan.boxes.iter().find(|tracked| tracked.instance == instance);
        found.is_some_and(|it| matches!(it.kind, ActorKind::Bicycle | ActorKind::Motorcycle))
    };
    let [low, edge] = [roi.min(), roi.voxel()].map(DVec3::from);
    let shape = roi.shape().map(i64::from);
    let mut voxels: BTreeMap<u16, u64> = BTreeMap::new();
    for of in scans {
        let mut votes: HashMap<[i64; 3], BTreeMap<u16, u32>> = HashMap::new();
        let ego_from_world = of.world_from_ego.inverse();
        for scan in scans {
            let ego_from_scan = ego_from_world.compose(&scan.world_from_ego);
            let origin = ego_from_scan.apply(scan.lidars[0].ego_from_sensor.translation);
            // The export calls the own body `vehicle.ego`, which does not vote.
            for point in scan.points().filter(|point| point.instance != EGO_INSTANCE) {
                let still = point.instance == NO_INSTANCE || stands(scans, point.instance);
                if scan.frame != of.frame && !still {
                    continue;
                }
                let at = ego_from_scan.apply(Vec3::from(point.position).as_dvec3());
                let cell = (at + 0.001 * (at - origin).normalize() - low) / edge;
                let cell = cell.to_array().map(|v| v.floor() as i64);
                if cell.iter().zip(shape).all(|(v, most)| (0..most).contains(v)) {
                    let own = into[usize::from(point.class)];
                    let class = if ridden(scan, point.instance) { vehicle } else { own };
                    *votes.entry(cell).or_default().entry(class).or_default() += 1;
                }
            }
        }
        for classes in votes.values() {
            let most = classes.values().max().unwrap();
            let (&class, _) = classes.iter().find(|(_, votes)| *votes == most).unwrap();
            *voxels.entry(class).or_default() += 1;
        }
    }
    voxels
}

/// One LiDAR in the middle, so that the merged cloud was seen from one place.
fn one_lidar(scenes: &Path) -> Placement {
    let mut placement = read_placements(scenes.join("placements.json")).unwrap().remove(0);
    placement.lidars.truncate(1);
    placement
}

/// Residential has parked cars among its static shapes, without boxes, and cars that drive.
#[test]
fn an_export_to_nuscenes_read_again_has_the_voxels_of_its_scans() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scene = Scene::read(scenes.join("residential.json")).unwrap();
    let placement = one_lidar(&scenes);
    let ideal = Scanning { ideal: true, ..Scanning::default() };
    let scanner = Scanner::new(&scene, &placement, &ideal).unwrap();
    let scans: Vec<Scan> = (0..FRAMES).map(|frame| scanner.scan(frame)).collect();
    let out = tempfile::tempdir().unwrap();
    let settings = DatasetSettings { keyframe_every: 1, ..DatasetSettings::new(Layout::Nuscenes) };
    let facts = SceneFacts {
        name: "residential".to_owned(),
        classes: scene.classes().to_vec(),
        frames: (0..FRAMES).collect(),
        split: Some(Split::Train),
    };
    let set = Dataset::create(out.path(), &settings, &[facts]).unwrap();
    assert!(record(&set, 0, &scanner, |_| true).unwrap());
    set.finish().unwrap();

    let read = read_nuscenes(out.path(), None, &[]).unwrap();
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    let (psog, _) = build_psog(&read, &PsogOptions::new(roi)).unwrap();
    let (truth, names) = (truth(&scans, &roi), read[0].classes());
    let parked = scans[0].points().filter(|point| {
        point.instance == NO_INSTANCE && scene.classes()[usize::from(point.class)] == "vehicle"
    });
    assert!(parked.count() > 100);
    for (name, _) in CLASSES {
        let class = names.iter().position(|known| known == name).unwrap();
        let ours: u64 = psog.rows().map(|row| u64::from(row[class])).sum();
        let theirs = scene.classes().iter().position(|known| known == name).unwrap();
        let theirs = truth.get(&(theirs as u16)).copied().unwrap_or(0);
        let off = ours.abs_diff(theirs) as f64;
        println!("{name}: {ours} read again, {theirs} of the scans");
        assert!(off <= TOLERANCE * theirs as f64 + 2.0, "{name}: {ours} and {theirs}");
    }
    let class = names.iter().position(|known| known == "vehicle").unwrap();
    assert!(psog.rows().filter(|row| row[class] > 0).count() > 300);
}
