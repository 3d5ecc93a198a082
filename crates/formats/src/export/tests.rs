//! Data sets of a made-up drive, written and read again by rules that are spelled out here.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{Dataset, DatasetSettings, Layout, SceneFacts, Split};
use lidar_cast::geom::Pose;
use sightline_scan::{NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox};
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES};

const FRAMES: usize = 11;

fn class(name: &str) -> u16 {
    DEFAULT_CLASSES.iter().position(|known| *known == name).unwrap() as u16
}

fn facts(name: &str, split: Split) -> SceneFacts {
    SceneFacts {
        name: name.to_owned(),
        classes: DEFAULT_CLASSES.map(str::to_owned).to_vec(),
        frames: (0..FRAMES).collect(),
        split: Some(split),
    }
}

fn pole_at(i: i32, j: i32) -> DVec3 {
    DVec3::new(f64::from(i) * 3.0, f64::from(j) * 2.0, 0.0)
}

/// A drive round a bend over points that stand still, past a car that moves and a person who stands.
fn scan(scene: &str, frame: usize) -> Scan {
    let time = frame as f64 * 0.1;
    let ego = Pose::new(DVec3::new(100.0 + 8.0 * time, 50.0 + time, 0.1), 0.0, 0.01, 0.3 * time);
    let ego_from_world = ego.inverse();
    let mounts = [DVec3::new(0.5, 0.6, 1.9), DVec3::new(0.1, -0.6, 2.1)];
    let lidars = mounts.map(|at| ScanLidar {
        model: "sixteen".to_owned(),
        ego_from_sensor: Pose::new(at, 0.1, 0.0, at.y),
        ego_from_mount: Pose::new(at, 0.1, 0.0, at.y),
        channels: 16,
        columns: 360,
        range: 80.0,
    });
    let car = Pose::new(DVec3::new(115.0 + 5.0 * time, 52.0, 0.8), 0.0, 0.0, 0.2);
    let person = Pose::new(DVec3::new(108.0, 47.0, 0.9), 0.0, 0.0, 1.0);
    let actors = [
        (car, ActorKind::Car, "vehicle", DVec3::new(4.4, 1.8, 1.6), DVec3::X * 5.0),
        (person, ActorKind::Pedestrian, "pedestrian", DVec3::new(0.6, 0.7, 1.8), DVec3::ZERO),
    ];
    let mut returns = Vec::new();
    let mut put = |world: DVec3, class: u16, instance: u16, status: Status| {
        let i = returns.len();
        let position = ego_from_world.apply(world).as_vec3().to_array();
        returns.push(Return {
            position,
            raw: position,
            range: 1.0,
            intensity: (i % 5) as f32 / 4.0,
            time: i as f32 * 1e-6,
            lidar: (i % 2) as u16,
            channel: (i % 16) as u16,
            column: i as u32,
            class,
            clean_class: class,
            instance,
            incidence: 0.5,
            status,
        });
    };
    for i in 25..45 {
        for j in 15..35 {
            put(
                pole_at(i, j),
                class(["road", "building"][(i % 2) as usize]),
                NO_INSTANCE,
                Status::Hit,
            );
        }
    }
    for (number, (pose, _, name, size, _)) in actors.iter().enumerate() {
        for k in 0..40 {
            let along =
                DVec3::new(f64::from(k % 5) / 4.0 - 0.5, -0.5, f64::from(k / 5) / 7.0 - 0.5);
            put(pose.apply(along * *size), class(name), 1 + number as u16, Status::Hit);
        }
    }
    put(DVec3::new(100.0, 50.0, 1.0), u16::MAX, NO_INSTANCE, Status::Fog);
    put(DVec3::NAN, u16::MAX, NO_INSTANCE, Status::Miss);
    let boxes =
        (1..).zip(&actors).map(|(instance, (pose, kind, name, size, velocity))| TrackedBox {
            instance,
            name: String::new(),
            kind: *kind,
            class: class(name),
            ego_from_box: ego_from_world.compose(pose),
            size: *size,
            velocity: *velocity,
            points: 40,
            visible: None,
        });
    Scan {
        scene: scene.into(),
        frame,
        time,
        classes: DEFAULT_CLASSES.map(str::to_owned).to_vec().into(),
        lidars: lidars.to_vec(),
        world_from_ego: ego,
        boxes: boxes.collect(),
        returns,
    }
}

/// Three scenes, two of them to validate, as the devkit's evaluators want them.
fn scenes(layout: Layout) -> Vec<SceneFacts> {
    let second = if layout == Layout::Nuscenes { Split::Val } else { Split::Test };
    vec![facts("one", Split::Train), facts("two", Split::Val), facts("three", second)]
}

fn written(dir: &Path, settings: &DatasetSettings) {
    let scenes = scenes(settings.layout);
    let set = Dataset::create(dir, settings, &scenes).unwrap();
    for (number, scene) in scenes.iter().enumerate() {
        for &frame in &scene.frames {
            set.write(number, &scan(&scene.name, frame)).unwrap();
        }
    }
    let summary = set.finish().unwrap();
    assert_eq!((summary.scenes, summary.frames), (3, 3 * FRAMES));
}

/// All files with their bytes, but for the hidden ones.
fn files(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let (mut open, mut found) = (vec![dir.to_owned()], Vec::new());
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true if path.ends_with(".sightline") => {}
                true => open.push(path),
                false => {
                    let bytes = std::fs::read(&path).unwrap();
                    found.push((path.strip_prefix(dir).unwrap().to_owned(), bytes));
                }
            }
        }
    }
    found.sort();
    found
}

const LAYOUTS: [Layout; 3] = [Layout::SemanticKitti, Layout::Nuscenes, Layout::Npz];

/// Writes small sets for the loaders of `tests/loaders` where `SIGHTLINE_LOADERS` names a folder.
#[test]
fn sets_are_written_for_loaders() {
    let temporary = tempfile::tempdir().unwrap();
    let dir = std::env::var_os("SIGHTLINE_LOADERS").map(PathBuf::from);
    let dir = dir.unwrap_or_else(|| temporary.path().to_owned());
    for layout in LAYOUTS {
        let settings = DatasetSettings { camera_stubs: true, ..DatasetSettings::new(layout) };
        written(&dir.join(layout.name()), &settings);
        assert!(!dir.join(layout.name()).join("INCOMPLETE.txt").exists());
    }
}

#[test]
fn a_run_that_was_ended_goes_on_to_the_same_bytes() {
    for layout in LAYOUTS {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let settings = DatasetSettings::new(layout);
        written(a.path(), &settings);
        let scenes = scenes(layout);
        let set = Dataset::create(b.path(), &settings, &scenes).unwrap();
        set.write(1, &scan("two", 4)).unwrap();
        assert!(set.has(1, 4) && !set.has(1, 5));
        let error = set.finish().unwrap_err().to_string();
        assert_holds!(error, "32 of 33 frames are missing, the first is frame 0 of `one`");
        let told = std::fs::read_to_string(b.path().join("INCOMPLETE.txt")).unwrap();
        assert!(told.contains("32 of 33 frames were missing"), "{told}");
        let lines: Vec<&str> = told.lines().skip(1).collect();
        let ends = ["): frames 0 to 10", "): frames 0 to 3, 5 to 10", "): frames 0 to 10"];
        assert!(lines[1].starts_with("two ("), "{told}");
        assert_eq!(lines.len(), 3, "{told}");
        assert!(lines.iter().zip(ends).all(|(line, end)| line.ends_with(end)), "{told}");
        written(b.path(), &settings);
        assert_eq!(files(a.path()), files(b.path()));
    }
}

#[test]
fn a_file_that_was_cut_is_missing() {
    let dir = tempfile::tempdir().unwrap();
    let settings = DatasetSettings::new(Layout::SemanticKitti);
    let set = Dataset::create(dir.path(), &settings, &scenes(settings.layout)).unwrap();
    set.write(0, &scan("one", 3)).unwrap();
    let cloud = dir.path().join("sequences/00/velodyne/000003.bin");
    let bytes = std::fs::read(&cloud).unwrap();
    std::fs::write(&cloud, &bytes[..bytes.len() - 16]).unwrap();
    assert!(!set.has(0, 3));
    // So is one of a set that was whole.
    let whole = tempfile::tempdir().unwrap();
    let scenes = scenes(settings.layout);
    written(whole.path(), &settings);
    std::fs::remove_file(whole.path().join("sequences/00/velodyne/000003.bin")).unwrap();
    Dataset::create(whole.path(), &settings, &scenes).unwrap();
    let told = std::fs::read_to_string(whole.path().join("INCOMPLETE.txt")).unwrap();
    assert!(told.ends_with("one (00): frames 3\n"), "{told}");
    let about = std::fs::read_to_string(whole.path().join("dataset.json")).unwrap();
    assert!(about.contains("\"complete\": false"), "{about}");
}

/// Poses and clouds as SemanticKITTI's own tools read them: pose · point stands still.
#[test]
fn still_points_coincide_over_a_sequence() {
    let dir = tempfile::tempdir().unwrap();
    written(dir.path(), &DatasetSettings::new(Layout::SemanticKitti));
    for root in ["", "lidar_1/"] {
        let place = dir.path().join(format!("{root}sequences/08"));
        let poses = std::fs::read_to_string(place.join("poses.txt")).unwrap();
        let mut firsts: Vec<[f64; 3]> = Vec::new();
        for (at, line) in poses.lines().enumerate() {
            let m: Vec<f64> = line.split(' ').map(|n| n.parse().unwrap()).collect();
            let cloud = std::fs::read(place.join(format!("velodyne/{at:06}.bin"))).unwrap();
            let labels = std::fs::read(place.join(format!("labels/{at:06}.label"))).unwrap();
            let points: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&cloud);
            let labels: Vec<u32> = bytemuck::pod_collect_to_vec(&labels);
            assert_eq!(points.len(), labels.len());
            let still = points.iter().zip(&labels).filter(|(_, label)| [40, 50].contains(*label));
            let world: Vec<[f64; 3]> = still
                .map(|(p, _)| {
                    let [x, y, z] = [p[0], p[1], p[2]].map(f64::from);
                    std::array::from_fn(|r| {
                        m[4 * r] * x + m[4 * r + 1] * y + m[4 * r + 2] * z + m[4 * r + 3]
                    })
                })
                .collect();
            firsts = if firsts.is_empty() { world.clone() } else { firsts };
            assert_eq!(world.len(), if root.is_empty() { 400 } else { 200 });
            let off =
                |(a, b): (&[f64; 3], &[f64; 3])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
            assert!(world.iter().zip(&firsts).all(off), "frame {at}");
            let moving = labels.iter().filter(|&&label| label == 1 << 16 | 252).count();
            let standing = labels.iter().filter(|&&label| label == 2 << 16 | 30).count();
            let all = if root.is_empty() { 40 } else { 20 };
            assert_eq!((moving, standing), (all, all));
        }
    }
}

#[test]
fn what_cannot_be_written_is_a_sentence_and_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("set");
    let kitti = DatasetSettings::new(Layout::SemanticKitti);
    let refused = |settings: &DatasetSettings, scenes: &[SceneFacts], words: &str| {
        assert_holds!(Dataset::create(&out, settings, scenes).err().unwrap(), words);
        assert!(!out.exists());
    };
    let one = [facts("one", Split::Train)];
    let below = dir.path().join("velodyne/x");
    let named = Dataset::create(&below, &kitti, &one).err().unwrap();
    assert_holds!(named, "has `velodyne` in its path");
    assert!(!below.exists());
    refused(&kitti, &[], "at least one scene");
    let none = [SceneFacts { frames: vec![], ..one[0].clone() }];
    refused(&kitti, &none, "the scene `one` has no frames");
    let own = [SceneFacts { classes: vec!["lamp".to_owned()], ..one[0].clone() }];
    refused(&kitti, &own, "the class `lamp` has no label");
    let mapped = |from: &str, to: &str| DatasetSettings {
        map: vec![(from.to_owned(), to.to_owned())],
        ..kitti.clone()
    };
    refused(&mapped("lamp", "lantern"), &own, "`lantern` is no class with a label");
    let slip = mapped("lanp", "pole");
    refused(&slip, &own, "no scene has a class `lanp`; did you mean `lamp`?");
    refused(&kitti, &[&one[..], &one].concat(), "two scenes are called `one`");
    let alike = [facts("a/b", Split::Train), facts("a_b", Split::Train)];
    refused(&kitti, &alike, "the scenes `a/b` and `a_b` would share the folder `a_b`");
    let npz = DatasetSettings::new(Layout::Npz);
    for name in ["dataset.json", "INCOMPLETE.txt"] {
        let words =
            format!("can have the name of the scene `{name}`: a file of the set has it; rename it");
        refused(&npz, &[facts("one", Split::Train), facts(name, Split::Val)], &words);
    }
    let vals = [facts("a", Split::Val), facts("b", Split::Val)];
    refused(&kitti, &vals, "2 scenes for val: semantickitti has 1 names");
    assert!("kitti".parse::<Layout>().is_err());
    Dataset::create(&out, &mapped("lamp", "pole"), &own).unwrap();
}

#[test]
fn other_folders_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let settings = DatasetSettings::new(Layout::Npz);
    std::fs::write(dir.path().join("note.txt"), "mine").unwrap();
    let scenes = scenes(Layout::Npz);
    let create =
        |settings: &DatasetSettings| Dataset::create(dir.path(), settings, &scenes).map(drop);
    let words = "is not empty and holds no data set of this program";
    assert_holds!(create(&settings).unwrap_err(), words);
    std::fs::remove_file(dir.path().join("note.txt")).unwrap();
    create(&settings).unwrap();
    create(&settings).unwrap();
    let other = DatasetSettings { seed: 1, ..settings };
    assert_holds!(create(&other).unwrap_err(), "holds a data set of other settings (seed)");
}

#[test]
fn a_setting_that_differs_is_named_whatever_the_provenance_says() {
    let dir = tempfile::tempdir().unwrap();
    let mut settings = DatasetSettings::new(Layout::Nuscenes);
    settings.provenance = r#"{ "camera_stubs": 7, "scenes": ["here"] }"#.into();
    let scenes = scenes(settings.layout);
    Dataset::create(dir.path(), &settings, &scenes).unwrap();
    let refused = |settings: &DatasetSettings| {
        Dataset::create(dir.path(), settings, &scenes).map(drop).unwrap_err()
    };
    let stubs = DatasetSettings { camera_stubs: true, ..settings.clone() };
    assert_holds!(refused(&stubs), "other settings (camera_stubs)");
    let text = DatasetSettings { provenance: "by hand".into(), ..settings.clone() };
    assert_holds!(refused(&text), "(provenance");
    let elsewhere = r#"{ "camera_stubs": 7, "scenes": ["there"] }"#.into();
    let moved = DatasetSettings { provenance: elsewhere, ..settings };
    Dataset::create(dir.path(), &moved, &scenes).unwrap();
}

#[test]
#[cfg(unix)]
fn what_another_program_is_writing_is_not_taken_away() {
    let dir = tempfile::tempdir().unwrap();
    let settings = DatasetSettings::new(Layout::Npz);
    let scenes = scenes(settings.layout);
    drop(Dataset::create(dir.path(), &settings, &scenes).unwrap());
    let mut ended = std::process::Command::new("true").spawn().unwrap();
    ended.wait().unwrap();
    let begun = [std::process::id(), ended.id()].map(|process| {
        let path = dir.path().join(format!(".sightline/.sightline-{process}-AbCdEf.tmp"));
        std::fs::write(&path, "half").unwrap();
        path
    });
    Dataset::create(dir.path(), &settings, &scenes).unwrap();
    assert_eq!(
        begun.map(|path| path.exists()),
        [true, false],
        "of a process that runs, of one that ended"
    );
}

#[test]
#[cfg(unix)]
fn files_of_others_are_never_taken_away() {
    let dir = tempfile::tempdir().unwrap();
    let (mine, set) = (dir.path().join("mine"), dir.path().join("set"));
    let settings = DatasetSettings::new(Layout::Npz);
    let scenes = scenes(settings.layout);
    for folder in [&mine, &set] {
        std::fs::create_dir(folder).unwrap();
    }
    std::fs::write(mine.join(".tmp-thesis"), "all of it").unwrap();
    std::os::unix::fs::symlink(&mine, set.join(".sightline")).unwrap();
    for error in [
        Dataset::check(&set, &settings, &scenes).unwrap_err(),
        Dataset::create(&set, &settings, &scenes).err().unwrap(),
    ] {
        let words = ".sightline: is not the folder of records that a data set keeps; take it away";
        assert!(error.to_string().contains(words), "{error}");
    }
    assert!(mine.join(".tmp-thesis").exists());
    std::fs::remove_file(set.join(".sightline")).unwrap();
    drop(Dataset::create(&set, &settings, &scenes).unwrap());
    std::fs::write(set.join(".sightline/notes.txt"), "mine").unwrap();
    Dataset::create(&set, &settings, &scenes).unwrap();
    assert!(set.join(".sightline/notes.txt").exists(), "only what the program began");
}

#[test]
#[cfg(unix)]
fn room_is_asked_for_the_sets_that_follow_as_well() {
    let dir = tempfile::tempdir().unwrap();
    let settings = DatasetSettings::new(Layout::Npz);
    let scenes = scenes(settings.layout);
    assert_eq!(Dataset::check(dir.path(), &settings, &scenes).unwrap(), 3 * FRAMES);
    let set = Dataset::create(dir.path(), &settings, &scenes).unwrap();
    set.write(0, &scan("one", 0)).unwrap();
    assert_eq!(Dataset::check(dir.path(), &settings, &scenes).unwrap(), 3 * FRAMES - 1);
    drop(set);
    let set = Dataset::create(dir.path(), &settings, &scenes).unwrap().ahead_of(1 << 60);
    assert_holds!(set.write(0, &scan("one", 1)).unwrap_err(), ": the frames to come need about ");
}

#[test]
fn splits_are_shares_of_the_scenes() {
    let dir = tempfile::tempdir().unwrap();
    let open = |i: usize| SceneFacts { split: None, ..facts(&format!("s{i}"), Split::Train) };
    let scenes: Vec<SceneFacts> = (0..10).map(open).collect();
    let settings = DatasetSettings::new(Layout::Nuscenes);
    let plan = super::plan::plan(&settings, &scenes).unwrap();
    let count = |split: Split| plan.iter().filter(|planned| planned.split == split).count();
    assert_eq!((count(Split::Train), count(Split::Val), count(Split::Test)), (8, 2, 0));
    let mut names: Vec<&str> = plan.iter().map(|planned| planned.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), 10);
    assert!(names.contains(&"scene-0103") && names.contains(&"scene-0916"));
    let other = super::plan::plan(&DatasetSettings { seed: 7, ..settings }, &scenes).unwrap();
    assert_ne!(plan, other);
    drop(dir);
}
