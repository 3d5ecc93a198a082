//! From tables to scenes: only rows of the wanted scenes are kept.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::tables::{
    AnnotationRow, CalibratedRow, CategoryRow, EgoPoseRow, InstanceRow, LIDARSEG_CATEGORIES,
    LidarsegRow, SampleDataRow, SampleRow, SceneRow, SensorRow, SourceTables,
};
use super::{Category, Keyframe, NuscenesScene, category, known};
use crate::datasets::sequence::entries;
use crate::datasets::{BoxTrack, Checked, FormatError, TrackPose, ground};
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_files::json::quoted;
use sightline_scene::scene::DEFAULT_CLASSES;
use sightline_scene::vehicle::{SensorPose, doubts_of_units};

/// Shortest way between two keyframes that tells where a vehicle drives, in metres.
const STEP: f64 = 0.5;
/// The channel whose keyframes lidarseg labels.
const CHANNEL: &str = "LIDAR_TOP";

/// Reads scenes of a set in the layout of nuScenes with lidarseg, by name, or all: `folder` holds the
/// tables of `version`, `samples` and `lidarseg`. Without a version the only folder with tables is taken.
///
/// # Errors
/// Missing or malformed tables, rows that name others that are not there, categories without a class, a
/// scene that is not there or is named twice; see [`FormatError`].
pub fn read_nuscenes(
    folder: &Path,
    version: Option<&str>,
    names: &[String],
) -> Result<Vec<NuscenesScene>, FormatError> {
    let version = version.map_or_else(|| only_version(folder), |version| Ok(version.to_owned()))?;
    let tables = SourceTables::new(folder.join(version));
    let scenes = scenes(&tables, names)?;
    let (samples, all) = samples(&tables, &scenes)?;
    let (categories, by_token) = categories(&tables)?;
    let mut keyframes = keyframes(&tables, folder, &samples, &all)?;
    let mut tracks = tracks(&tables, &samples, &by_token)?;
    let categories = Arc::new(categories);
    let mut read = Vec::new();
    for (index, (_, name, stated)) in scenes.iter().enumerate() {
        let times: Vec<f64> =
            samples.iter().filter(|s| s.scene == index).map(|s| s.timestamp).collect();
        let keyframes = keyframes.remove(&index).unwrap_or_default();
        if keyframes.is_empty() {
            return Err(tables.no_row("sample", name, "scene.json"));
        }
        let mut scene = NuscenesScene {
            name: name.clone(),
            keyframes,
            tracks: tracks.remove(&index).unwrap_or_default(),
            rate: rate(&times),
            categories: Arc::clone(&categories),
            notes: times_doubted(&tables, name, &times).into_iter().chain(tables.notes()).collect(),
        };
        scene.notes.extend(samples_doubted(&tables, name, times.len(), *stated));
        scene.notes.extend(poses_doubted(&tables, &scene));
        scene.notes.extend(boxes_doubted(&tables, &scene));
        scene.notes.extend(ground::doubts(&scene, None)?);
        read.push(scene);
    }
    Ok(read)
}

fn only_version(folder: &Path) -> Checked<String> {
    let mut found = entries(folder)?;
    found.retain(|entry| entry.join("scene.json").is_file());
    found.sort();
    let name =
        |entry: PathBuf| entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let found: Vec<String> = found.into_iter().map(name).collect();
    match <[String; 1]>::try_from(found) {
        Ok([only]) => Ok(only),
        Err(found) => {
            let none = found.is_empty().then(|| "no folder with a scene.json".to_owned());
            let (folder, held) = (folder.display(), none.unwrap_or_else(|| quoted(found)));
            Err(refused!("{folder} holds {held}; name the version, as --version v1.0-mini"))
        }
    }
}

/// Frames a second, from the times of keyframes in microseconds.
fn rate(times: &[f64]) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    let rate = (times.len() - 1) as f64 * 1e6 / (last - first);
    Some((rate * 1000.0).round() / 1000.0).filter(|rate| *rate > 0.0 && *rate <= 1000.0)
}

/// A doubt about keyframe times that are not in microseconds, or two of which are equal.
fn times_doubted(tables: &SourceTables, scene: &str, times: &[f64]) -> Option<Note> {
    let fault = match rate(times) {
        _ if times.len() < 2 => return None,
        _ if times.windows(2).any(|pair| pair[0] == pair[1]) => "has two keyframes of one time",
        Some(rate) if (0.1..=100.0).contains(&rate) => return None,
        _ => "has less than 0.1 or more than 100 keyframes a second",
    };
    let path = tables.path("sample");
    Some(Note::doubt(format!(
        "{}: the scene {scene:?} {fault}; `timestamp` is in microseconds.",
        path.display()
    )))
}

/// A doubt about a scene whose number of samples is another one in the table of scenes.
fn samples_doubted(
    tables: &SourceTables,
    scene: &str,
    found: usize,
    stated: Option<u64>,
) -> Option<Note> {
    let stated = stated.filter(|stated| *stated != found as u64)?;
    Some(Note::doubt(format!(
        "{}: `nbr_samples` of the scene {scene:?} is {stated}, and {found} samples name it; is each `scene_token` right?",
        tables.path("scene").display()
    )))
}

/// Doubts about where LIDAR_TOP stands on the vehicle, and about a vehicle that does not drive forwards.
fn poses_doubted(tables: &SourceTables, scene: &NuscenesScene) -> Vec<Note> {
    let keyframes = &scene.keyframes;
    let poses = keyframes.iter().map(|frame| SensorPose::from(&frame.ego_from_sensor));
    let units: BTreeSet<String> = poses.flat_map(|pose| doubts_of_units(&pose)).collect();
    let path = tables.path("calibrated_sensor");
    let of_units = |doubt: String| {
        Note::doubt(format!(
            "{}: {CHANNEL} of the scene {:?}: {doubt}.",
            path.display(),
            scene.name
        ))
    };
    let mut notes: Vec<Note> = units.into_iter().map(of_units).collect();
    let ego = |frame: &Keyframe| frame.world_from_sensor.compose(&frame.ego_from_sensor.inverse());
    let turns = |pair: &[Keyframe]| {
        let [before, now] = [0, 1].map(|k| ego(&pair[k]).rotation.x_axis);
        before.dot(now) < 0.0
    };
    if let Some(k) = keyframes.windows(2).position(turns) {
        notes.push(Note::doubt(format!(
            "{}: the vehicle of the scene {:?} turns by more than 90 degrees between its keyframes {k} and {}; rotations are w, x, \
             y, z.",
            tables.path("ego_pose").display(),
            scene.name,
            k + 1
        )));
    }
    let steps = keyframes.windows(2).map(|pair| {
        let step = ego(&pair[0]).inverse().apply(ego(&pair[1]).translation);
        (step.x, step.length())
    });
    let steps: Vec<(f64, f64)> = steps.filter(|(_, length)| *length >= STEP).collect();
    let odd = steps.iter().filter(|(ahead, length)| *ahead < 0.5 * length).count();
    if 2 * odd > steps.len() {
        notes.push(Note::doubt(format!(
            "{}: in {odd} of {} steps between keyframes of the scene {:?} the vehicle drives backwards or sideways; \
             rotations are w, x, y, z.",
            tables.path("ego_pose").display(),
            steps.len(),
            scene.name
        )));
    }
    notes
}

/// Doubts about boxes of vehicles, most of which are wider than long, or do not move ahead.
fn boxes_doubted(tables: &SourceTables, scene: &NuscenesScene) -> Vec<Note> {
    let is_vehicle = |track: &&BoxTrack| DEFAULT_CLASSES[usize::from(track.class)] == "vehicle";
    let vehicles: Vec<&BoxTrack> = scene.tracks.iter().filter(is_vehicle).collect();
    let wide = vehicles.iter().filter(|track| track.size[1] > track.size[0]).count();
    let pairs = vehicles.iter().flat_map(|track| track.poses.windows(2));
    let steps = pairs.map(|pair| {
        let [from, to] = [0, 1].map(|k| pair[k].world_from_box);
        let step = from.inverse().apply(to.translation);
        (step.x, step.length())
    });
    let steps: Vec<(f64, f64)> = steps.filter(|(_, length)| *length >= STEP).collect();
    let odd = steps.iter().filter(|(ahead, length)| *ahead < 0.5 * length).count();
    let told = |is_odd: bool, words: String| {
        let (path, name) = (tables.path("sample_annotation"), &scene.name);
        is_odd.then(|| Note::doubt(format!("{}: {words} of the scene {name:?}.", path.display())))
    };
    let of_sizes = format!(
        "`size` is width, length, height, and by it {wide} of {} vehicles are wider than long: boxes",
        vehicles.len()
    );
    let of_turns = format!(
        "rotations are w, x, y, z, and by them vehicles move backwards or sideways in {odd} of {} steps: boxes",
        steps.len()
    );
    let doubts = [told(2 * wide > vehicles.len(), of_sizes), told(2 * odd > steps.len(), of_turns)];
    doubts.into_iter().flatten().collect()
}

/// Token, name and stated number of samples of the scenes, in the requested order or the table's.
fn scenes(tables: &SourceTables, names: &[String]) -> Checked<Vec<WantedScene>> {
    if let Some(k) = (1..names.len()).find(|&k| names[..k].contains(&names[k])) {
        let name = &names[k];
        return Err(refused!(
            "the scene {name:?} is named twice; its scans count once, so name it once"
        ));
    }
    let (mut all, mut tokens, mut known) = (Vec::new(), HashSet::new(), HashSet::new());
    tables.rows("scene", |row: SceneRow| {
        tables.refuse_twice("scene", &row.token, !tokens.insert(row.token.clone()))?;
        tables.refuse_twice("scene", &row.name, !known.insert(row.name.clone()))?;
        let stated = row.nbr_samples.and_then(|count| count.as_u64());
        all.push((row.token, row.name, stated));
        Ok(())
    })?;
    if all.is_empty() {
        let path = tables.path("scene");
        return Err(refused!("{}: lists no scene; give a set of at least one", path.display()));
    }
    let find = |name: &String| {
        all.iter().find(|(_, known, _)| known == name).cloned().ok_or_else(|| {
            let known = quoted(all.iter().map(|(_, name, _)| name));
            refused!(
                "{}: no scene is called {name:?}; it has {known}",
                tables.path("scene").display()
            )
        })
    };
    let wanted: Result<Vec<_>, _> = names.iter().map(find).collect();
    Ok(if names.is_empty() { all } else { wanted? })
}

/// Token, name and stated number of samples of a scene.
type WantedScene = (String, String, Option<u64>);

struct Sample {
    token: String,
    scene: usize,
    frame: u32,
    timestamp: f64,
}

/// Samples of the scenes, by scene and time, and the tokens of all samples.
fn samples(
    tables: &SourceTables,
    scenes: &[WantedScene],
) -> Checked<(Vec<Sample>, HashSet<String>)> {
    let scene: HashMap<&str, usize> =
        scenes.iter().enumerate().map(|(i, (token, ..))| (token.as_str(), i)).collect();
    let (mut samples, mut tokens) = (Vec::new(), HashSet::new());
    tables.rows("sample", |row: SampleRow| {
        let again = !tokens.insert(row.token.clone());
        if let Some(&scene) = scene.get(row.scene_token.as_str()) {
            let SampleRow { token, timestamp, .. } = row;
            tables.refuse_twice("sample", &token, again)?;
            samples.push(Sample { token, scene, frame: 0, timestamp });
        }
        Ok(())
    })?;
    let key = |s: &Sample| (s.scene, s.timestamp);
    samples.sort_by(|a, b| {
        let ((a_scene, a_time), (b_scene, b_time)) = (key(a), key(b));
        a_scene.cmp(&b_scene).then(a_time.total_cmp(&b_time))
    });
    let mut next = (0, 0);
    for sample in &mut samples {
        next = if sample.scene == next.0 { next } else { (sample.scene, 0) };
        sample.frame = next.1;
        next.1 += 1;
    }
    Ok((samples, tokens))
}

/// Meaning of each label.
type LabelCategories = Vec<Option<Category>>;
/// Name and meaning of categories, by token.
type ByToken = HashMap<String, (String, Category)>;

fn categories(tables: &SourceTables) -> Checked<(LabelCategories, ByToken)> {
    let (mut labels, mut by_token) = (vec![None; 256], HashMap::new());
    // Sets of Place3D have one table of categories for points and another for boxes.
    let apart = Some(LIDARSEG_CATEGORIES).filter(|name| tables.path(name).exists());
    for table in ["category"].into_iter().chain(apart) {
        let (mut here, mut tokens): (HashSet<u8>, _) = (HashSet::new(), HashSet::new());
        tables.rows(table, |CategoryRow { token, name, index, .. }| {
            tables.refuse_twice(table, &token, !tokens.insert(token.clone()))?;
            let Some(found) = category(&name) else {
                let (path, known) = (tables.path(table), quoted(known()));
                let path = path.display();
                return Err(refused!("{path}: category {name:?} is unknown; known are {known}"));
            };
            if let Some(index) = index {
                let label = usize::from(index);
                if !here.insert(index) && labels[label] != Some(found) {
                    let fault = "its `index` is that of another category; give each its own";
                    return Err(tables.refused(table, &token, fault));
                }
                labels[label] = Some(found);
            }
            by_token.insert(token, (name, found));
            Ok(())
        })?;
    }
    if labels.iter().all(Option::is_none) {
        return Err(refused!(
            "{}: no category has an `index`, the label of its points; take category.json of nuScenes-lidarseg",
            tables.path("category").display()
        ));
    }
    Ok((labels, by_token))
}

/// Keyframes of the scenes, by scene, in the order of their samples.
fn keyframes(
    tables: &SourceTables,
    folder: &Path,
    samples: &[Sample],
    all: &HashSet<String>,
) -> Checked<HashMap<usize, Vec<Keyframe>>> {
    let calibrated = calibrated(tables)?;
    let wanted: HashSet<&str> = samples.iter().map(|s| s.token.as_str()).collect();
    let mut data: HashMap<String, SampleDataRow> = HashMap::new();
    let mut tokens = HashSet::new();
    tables.rows("sample_data", |row: SampleDataRow| {
        let of_lidar = calibrated.contains_key(&row.calibrated_sensor_token);
        if !row.is_key_frame || !of_lidar {
            return Ok(());
        }
        if !all.contains(&row.sample_token) {
            return Err(tables.no_row("sample", &row.sample_token, "sample_data.json"));
        }
        if wanted.contains(row.sample_token.as_str()) {
            let token = row.token.clone();
            tables.refuse_twice("sample_data", &token, !tokens.insert(token.clone()))?;
            if data.insert(row.sample_token.clone(), row).is_some() {
                let fault = "its sample has a keyframe of LIDAR_TOP already; leave one out";
                return Err(tables.refused("sample_data", &token, fault));
            }
        }
        Ok(())
    })?;
    let wanted = data.values().map(|row| row.ego_pose_token.as_str()).collect();
    let ego: HashMap<_, EgoPoseRow> = tables.by_token("ego_pose", &wanted, "sample_data.json")?;
    let wanted = tokens.iter().map(String::as_str).collect();
    let lidarseg: HashMap<_, LidarsegRow> =
        tables.by_token("lidarseg", &wanted, "sample_data.json, as a keyframe of LIDAR_TOP,")?;
    let mut keyframes: HashMap<usize, Vec<Keyframe>> = HashMap::new();
    for sample in samples {
        let Some(row) = data.get(&sample.token) else {
            return Err(tables.no_row("sample_data", &sample.token, "sample.json, for LIDAR_TOP,"));
        };
        let pose = &ego[&row.ego_pose_token];
        let world_from_ego =
            tables.pose("ego_pose", &pose.token, pose.translation, pose.rotation)?;
        let ego_from_sensor = calibrated[&row.calibrated_sensor_token];
        keyframes.entry(sample.scene).or_default().push(Keyframe {
            scan: tables.file("sample_data", folder, &row.filename)?,
            labels: tables.file("lidarseg", folder, &lidarseg[&row.token].filename)?,
            ego_from_sensor,
            world_from_sensor: world_from_ego.compose(&ego_from_sensor),
        });
    }
    Ok(keyframes)
}

/// Poses of LIDAR_TOP on the vehicle, by token.
fn calibrated(tables: &SourceTables) -> Checked<HashMap<String, Pose>> {
    let (mut sensors, mut tokens) = (HashSet::new(), HashSet::new());
    tables.rows("sensor", |row: SensorRow| {
        tables.refuse_twice("sensor", &row.token, !tokens.insert(row.token.clone()))?;
        if row.channel == CHANNEL {
            sensors.insert(row.token);
        }
        Ok(())
    })?;
    if sensors.is_empty() {
        return Err(tables.no_row("sensor", CHANNEL, "lidarseg"));
    }
    let (mut poses, mut tokens) = (HashMap::new(), HashSet::new());
    tables.rows("calibrated_sensor", |row: CalibratedRow| {
        let again = !tokens.insert(row.token.clone());
        tables.refuse_twice("calibrated_sensor", &row.token, again)?;
        if sensors.contains(&row.sensor_token) {
            let pose =
                tables.pose("calibrated_sensor", &row.token, row.translation, row.rotation)?;
            poses.insert(row.token, pose);
        }
        Ok(())
    })?;
    Ok(poses)
}

/// Tracks of the scenes, by scene, in the order of their instances' tokens.
fn tracks(
    tables: &SourceTables,
    samples: &[Sample],
    categories: &ByToken,
) -> Checked<HashMap<usize, Vec<BoxTrack>>> {
    let by_token: HashMap<&str, &Sample> = samples.iter().map(|s| (s.token.as_str(), s)).collect();
    type PosesAndSize = (BTreeMap<u32, TrackPose>, [f64; 3]);
    let mut seen: BTreeMap<(usize, String), PosesAndSize> = BTreeMap::new();
    tables.rows("sample_annotation", |row: AnnotationRow| {
        let Some(sample) = by_token.get(row.sample_token.as_str()) else { return Ok(()) };
        let world_from_box =
            tables.pose("sample_annotation", &row.token, row.translation, row.rotation)?;
        let [width, length, height] = row.size;
        if !row.size.iter().all(|edge| (1e-3..=1e3).contains(edge)) {
            let fault = "its size is not three edges from 0.001 to 1000 m";
            return Err(tables.refused("sample_annotation", &row.token, fault));
        }
        let (poses, size) = seen.entry((sample.scene, row.instance_token)).or_default();
        let pose = TrackPose { frame: sample.frame, world_from_box };
        if poses.insert(sample.frame, pose).is_some() {
            let fault = "its instance has another row of the same sample; leave one out";
            return Err(tables.refused("sample_annotation", &row.token, fault));
        }
        for (most, edge) in size.iter_mut().zip([length, width, height]) {
            *most = most.max(edge);
        }
        Ok(())
    })?;
    let tokens = seen.keys().map(|(_, token)| token.as_str()).collect();
    let wanted_by = "sample_annotation.json";
    let instances: HashMap<_, InstanceRow> = tables.by_token("instance", &tokens, wanted_by)?;
    let mut tracks: HashMap<usize, Vec<BoxTrack>> = HashMap::new();
    for ((scene, token), (poses, size)) in seen {
        let category = &instances[&token].category_token;
        let Some((name, found)) = categories.get(category) else {
            return Err(tables.no_row("category", category, "instance.json"));
        };
        // Boxes of a category without a class are no obstacles, and are left out.
        if let Some(class) = found.class {
            let (name, kind) = (name.clone(), found.kind);
            let poses = poses.into_values().collect();
            let track = BoxTrack { name, kind, class, size, poses };
            tracks.entry(scene).or_default().push(track);
        }
    }
    Ok(tracks)
}
