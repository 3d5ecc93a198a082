//! Scans exported in the layouts of nuScenes and SemanticKITTI and read again: the voxels of each class that the scans
//! themselves give.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::{DVec3, Vec3};
use sightline::datasets::{
    KittiSequence, LabelledSequence, PsogOptions, build_psog, read_nuscenes,
};
use sightline::export::{Dataset, DatasetSettings, Layout, SceneFacts, Split, record};
use sightline::psog::Roi;
use sightline::scan::{EGO_INSTANCE, NO_INSTANCE, Return, Scan, Scanner, Scanning, TrackedBox};
use sightline::scene::{ActorKind, Scene};
use sightline::vehicle::{Placement, read_placements};

const FRAMES: usize = 6;
/// Share by which the voxels of a class may differ: positions are rounded to f32 in another frame.
const TOLERANCE: f64 = 0.002;
/// Classes that an export to nuScenes keeps, alone or with others that share a category with it.
const NUSCENES: [(&str, &[&str]); 7] = [
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
/// SemanticKITTI likewise, by the names of its benchmark.
const KITTI: [(&str, &[&str]); 11] = [
    ("car", &["vehicle"]),
    ("person", &["pedestrian"]),
    ("road", &["road_line"]),
    ("sidewalk", &[]),
    ("terrain", &[]),
    ("vegetation", &[]),
    ("building", &[]),
    ("fence", &["wall", "guard_rail"]),
    ("pole", &[]),
    ("traffic-sign", &["traffic_sign"]),
    ("other-ground", &["ground", "rail_track"]),
];

/// Name under which an exported class counts.
fn merged<'a>(name: &'a str, classes: &[(&'a str, &[&str])]) -> &'a str {
    classes.iter().find(|(_, others)| others.contains(&name)).map_or(name, |(into, _)| into)
}

/// Class of a point for the reader, by name, and whether it votes in its own frame alone.
type Rule = fn(&[Scan], &Scan, &Return) -> (String, bool);

/// Actors are vehicles or persons whatever they ride, and one that leaves its first place moves in all frames.
fn by_nuscenes(scans: &[Scan], scan: &Scan, point: &Return) -> (String, bool) {
    let own = merged(&scan.classes[usize::from(point.class)], &NUSCENES);
    let found = scan.boxes.iter().find(|tracked| tracked.instance == point.instance);
    // The export labels actors by their kind: who rides a bicycle is a part of it.
    let ridden = |it: &TrackedBox| matches!(it.kind, ActorKind::Bicycle | ActorKind::Motorcycle);
    let class = if found.is_some_and(ridden) { "vehicle" } else { own };
    (class.to_owned(), point.instance != NO_INSTANCE && !stands(scans, point.instance))
}

/// Actors count by their kind, and one that moves in a frame votes in that frame alone.
fn by_kitti(_: &[Scan], scan: &Scan, point: &Return) -> (String, bool) {
    let own = merged(&scan.classes[usize::from(point.class)], &KITTI);
    let found = scan.boxes.iter().find(|tracked| tracked.instance == point.instance);
    let moves = found.is_some_and(|it| it.velocity.length() > 0.3);
    let class = match found.map(|it| it.kind) {
        Some(ActorKind::Car | ActorKind::Van) => "car",
        Some(ActorKind::Truck) => "truck",
        Some(ActorKind::Bus | ActorKind::Trailer | ActorKind::Construction) => "other-vehicle",
        Some(ActorKind::Bicycle) if moves => "bicyclist",
        Some(ActorKind::Bicycle) => "bicycle",
        Some(ActorKind::Motorcycle) if moves => "motorcyclist",
        Some(ActorKind::Motorcycle) => "motorcycle",
        Some(ActorKind::Pedestrian) => "person",
        _ => own,
    };
    (class.to_owned(), moves)
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

/// Voxels of each of the reader's classes with the frames that they have it in: every point votes in all frames,
/// those of actors on their way in their own.
fn truth(scans: &[Scan], roi: &Roi, names: &[String], rule: Rule) -> Vec<u64> {
    let [low, edge] = [roi.min(), roi.voxel()].map(DVec3::from);
    let shape = roi.shape().map(i64::from);
    let mut voxels = vec![0; names.len()];
    for of in scans {
        let mut votes: HashMap<[i64; 3], BTreeMap<usize, u32>> = HashMap::new();
        let ego_from_world = of.world_from_ego.inverse();
        for scan in scans {
            let ego_from_scan = ego_from_world.compose(&scan.world_from_ego);
            let origin = ego_from_scan.apply(scan.lidars[0].ego_from_sensor.translation);
            // The export calls the own body `vehicle.ego` or an outlier, which does not vote.
            for point in scan.points().filter(|point| point.instance != EGO_INSTANCE) {
                let (name, moves) = rule(scans, scan, point);
                let class = names.iter().position(|known| *known == name);
                let Some(class) = class.filter(|_| scan.frame == of.frame || !moves) else {
                    continue;
                };
                let at = ego_from_scan.apply(Vec3::from(point.position).as_dvec3());
                let cell = (at + 0.001 * (at - origin).normalize() - low) / edge;
                let cell = cell.to_array().map(|v| v.floor() as i64);
                if cell.iter().zip(shape).all(|(v, most)| (0..most).contains(v)) {
                    *votes.entry(cell).or_default().entry(class).or_default() += 1;
                }
            }
        }
        for classes in votes.values() {
            let most = classes.values().max().unwrap();
            let (&class, _) = classes.iter().find(|(_, votes)| *votes == most).unwrap();
            voxels[class] += 1;
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

/// Frames of residential, which has parked cars among its static shapes, without boxes, and cars that drive; the same
/// written in a layout.
fn exported(layout: Layout, out: &Path) -> Vec<Scan> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scene = Scene::read(scenes.join("residential.json")).unwrap();
    let placement = one_lidar(&scenes);
    let ideal = Scanning { ideal: true, ..Scanning::default() };
    let scanner = Scanner::new(&scene, &placement, &ideal).unwrap();
    let scans: Vec<Scan> = (0..FRAMES).map(|frame| scanner.scan(frame)).collect();
    let settings = DatasetSettings { keyframe_every: 1, ..DatasetSettings::new(layout) };
    let facts = SceneFacts {
        name: "residential".to_owned(),
        classes: scene.classes().to_vec(),
        frames: (0..FRAMES).collect(),
        split: Some(Split::Train),
    };
    let set = Dataset::create(out, &settings, &[facts]).unwrap();
    assert!(record(&set, 0, &scanner, |_| true).unwrap());
    set.finish().unwrap();
    scans
}

/// Reads a set again and compares its voxels, class by class, with those of its scans.
fn compare<S: LabelledSequence>(scans: &[Scan], read: &[S], classes: &[&str], rule: Rule) {
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    let (psog, _) = build_psog(read, &PsogOptions::new(roi)).unwrap();
    let names = read[0].classes();
    let truth = truth(scans, &roi, &names, rule);
    for name in classes {
        let class = names.iter().position(|known| known == name).unwrap();
        let ours: u64 = psog.rows().map(|row| u64::from(row[class])).sum();
        let off = ours.abs_diff(truth[class]) as f64;
        println!("{name}: {ours} read again, {} of the scans", truth[class]);
        assert!(
            off <= TOLERANCE * truth[class] as f64 + 2.0,
            "{name}: {ours} and {}",
            truth[class]
        );
    }
    // The first of each list are the vehicles.
    let class = names.iter().position(|known| known == classes[0]).unwrap();
    assert!(psog.rows().filter(|row| row[class] > 0).count() > 300);
}

#[test]
fn an_export_to_nuscenes_read_again_has_the_voxels_of_its_scans() {
    let out = tempfile::tempdir().unwrap();
    let scans = exported(Layout::Nuscenes, out.path());
    let parked = scans[0].points().filter(|point| {
        point.instance == NO_INSTANCE && scans[0].classes[usize::from(point.class)] == "vehicle"
    });
    assert!(parked.count() > 100);
    let read = read_nuscenes(out.path(), None, &[]).unwrap();
    compare(&scans, &read, &NUSCENES.map(|(name, _)| name), by_nuscenes);
}

/// The LiDAR of an export stands where `ego_from_lidar.txt` says, not as high as that of the KITTI car.
#[test]
fn an_export_to_semantickitti_read_again_has_the_voxels_of_its_scans() {
    let out = tempfile::tempdir().unwrap();
    let scans = exported(Layout::SemanticKitti, out.path());
    let read = [KittiSequence::open(&out.path().join("sequences/00")).unwrap()];
    compare(&scans, &read, &KITTI.map(|(name, _)| name), by_kitti);
}
