//! Scans of CARLA's semantic LiDAR, a file a frame, with a table of the LiDAR's poses.
//!
//! Points come in the sensor's frame with y to the right; y is mirrored on reading, as are the poses.

mod frames;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::ground::{self, MOST_SCANS, NearRoad};
use super::kitti::above_ground;
use super::sequence::{entries, folder_name, no_frame, two_scans};
use super::{BoxTrack, Checked, FormatError, LabelledScan, LabelledSequence, PointLabel};
use frames::{ActorPoints, Record, TimedPose, frame_of};
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES};

/// Metres of height within which the points of a road near the LiDAR lie; house fronts do not.
const FLAT: f64 = 1.5;
/// Metres by which one surface lies clearly below another.
const LOWER: f64 = 0.3;

/// A point with the name and the meaning of its tag.
type Tagged = (Record, (&'static str, Tag));

/// A folder of scans of one LiDAR.
#[derive(Debug, Clone)]
pub struct CarlaSequence {
    folder: PathBuf,
    frames: BTreeMap<u32, (PathBuf, TimedPose)>,
    tags: CarlaTags,
    /// Meaning of each tag, by its number.
    meanings: Vec<(&'static str, Tag)>,
    /// The ego frame stands on the ground below the LiDAR.
    ego_from_sensor: Pose,
    notes: Vec<Note>,
}

impl CarlaSequence {
    /// Opens a folder of scans named by their frames (`000123.ply`, `.bin` or `.npy`) and a table of
    /// `carla.Transform` of the LiDAR: frame or file, x, y, z, roll, pitch, yaw, and perhaps time. Without `tags`
    /// the first scan with a road tells their version; without a height of the LiDAR above the ground, the road
    /// within 10 m does.
    ///
    /// # Errors
    /// Files that are missing, malformed or named by no frame, a scan without a pose; see [`FormatError`].
    pub fn open(
        folder: &Path,
        poses: &Path,
        tags: Option<CarlaTags>,
        lidar_height: Option<f64>,
    ) -> Result<Self, FormatError> {
        let (table, mut notes) = frames::read_poses(poses)?;
        let mut frames = BTreeMap::new();
        for (frame, scan) in list_scans(folder)? {
            let Some(&stood) = table.get(&frame) else {
                return Err(refused!(
                    "{} has no row for frame {frame}, whose scan is {}; each scan needs the pose of its LiDAR",
                    poses.display(),
                    scan.display()
                ));
            };
            if frames.insert(frame, (scan, stood)).is_some() {
                return Err(two_scans(folder, frame));
            }
        }
        let more = table.len() - frames.len();
        notes.extend((more > 0).then(|| {
            Note::fact(format!("{}: {more} rows belong to no scan; not read.", poses.display()))
        }));
        notes.extend(frames::backwards(poses, &frames));
        let mut sequence = Self {
            folder: folder.to_owned(),
            frames,
            tags: tags.unwrap_or(CarlaTags::Since0914),
            meanings: Vec::new(),
            ego_from_sensor: Pose::IDENTITY,
            notes,
        };
        let road = sequence.choose_tags(tags)?;
        let height = match (lidar_height, road) {
            (Some(height), _) => height,
            (None, Some(road)) => road.depth,
            (None, None) => return Err(sequence.no_ground()),
        };
        if let (None, Some(NearRoad { points, depth, .. })) =
            (lidar_height, road.filter(|road| !road.is_sure()))
        {
            sequence.notes.push(Note::doubt(format!(
                "{}: the road within {} m of the LiDAR has at most {points} points in a scan, which put the LiDAR \
                 {depth:.2} m above the ground; --lidar-height gives the LiDAR's height.",
                folder.display(),
                ground::NEAR
            )));
        }
        sequence.ego_from_sensor = above_ground(height)?;
        sequence.notes.extend(ground::doubts(&sequence, Some("--lidar-height"))?);
        Ok(sequence)
    }

    /// Height of the LiDAR above the ground in metres.
    pub fn lidar_height(&self) -> f64 {
        self.ego_from_sensor.translation.z
    }

    /// Version whose tags the points are taken to have.
    pub fn tags(&self) -> CarlaTags {
        self.tags
    }

    /// The error of scans without a road below the LiDAR: a tag that no version has, if it keeps roads from being found.
    fn no_ground(&self) -> FormatError {
        let mut first = self.frames.values().take(MOST_SCANS);
        let path = self.frames.values().next().map_or(&self.folder, |(path, _)| path);
        first.find_map(|(path, _)| self.records(path).err()).unwrap_or_else(|| {
            refused!(
                "{}: has no road point within {} m of the LiDAR to measure its height by; give --lidar-height",
                path.display(),
                ground::NEAR
            )
        })
    }

    /// Takes the version that is given, or the one in which the road of the first scans lies flat below the LiDAR.
    /// Returns the road in that version.
    fn choose_tags(&mut self, given: Option<CarlaTags>) -> Checked<Option<NearRoad>> {
        let [old, new] = self.roads()?;
        let fits = |road: Option<NearRoad>| {
            road.is_some_and(|road| road.is_sure() && road.depth > 0.0 && road.spread < FLAT)
        };
        let fitting = match (fits(old), fits(new)) {
            (true, false) => Some(CarlaTags::Until0913),
            (false, true) => Some(CarlaTags::Since0914),
            (true, true) => deeper(old, new),
            (false, false) => None,
        };
        self.tags = given.or(fitting).unwrap_or(CarlaTags::Since0914);
        let of = |tags: CarlaTags| if tags == CarlaTags::Until0913 { old } else { new };
        let said = |tags: CarlaTags| match of(tags) {
            None => format!("no road in {}", tags.version()),
            Some(NearRoad { points, depth, spread }) => format!(
                "{points} points of road {depth:.2} m below the LiDAR within {spread:.2} m of height in {}",
                tags.version()
            ),
        };
        let name = self.folder.display();
        let both = format!("{}, {}", said(CarlaTags::Until0913), said(CarlaTags::Since0914));
        let taken = self.tags.version();
        self.notes.extend(match (given, fitting) {
            (Some(given), Some(fitting)) if given != fitting => Some(Note::doubt(format!(
                "{name}: tags are those of CARLA {taken}, as given, and those of {} fit better: {both}. --carla-tags gives \
                 the version.",
                fitting.version()
            ))),
            (None, Some(CarlaTags::Until0913)) => Some(Note::fact(format!(
                "{name}: tags are taken to be those of CARLA {taken} to 0.9.13: {both}. --carla-tags gives the version."
            ))),
            (None, None) => Some(Note::doubt(format!(
                "{name}: tags are taken to be those of CARLA {taken} and later, and nothing speaks for either version: \
                 {both}. --carla-tags gives the version."
            ))),
            _ => None,
        });
        let found =
            self.tags.names().iter().map(|&name| class_of_name(name).map(|tag| (name, tag)));
        self.meanings = found.flatten().collect();
        Ok(of(self.tags))
    }

    /// Roads near the LiDAR by either version's tags, in the first scan that has enough of one, else in the scan that has most.
    fn roads(&self) -> Checked<[Option<NearRoad>; 2]> {
        if self.frames.is_empty() {
            return Err(no_scans(&self.folder));
        }
        let mut found = [None; 2];
        let points =
            |roads: &[Option<NearRoad>; 2]| roads.iter().flatten().map(|road| road.points).max();
        for (path, _) in self.frames.values().take(MOST_SCANS) {
            let records = frames::read_points(path)?;
            let roads = [CarlaTags::Until0913, CarlaTags::Since0914].map(|tags| {
                let is_road: Vec<bool> =
                    tags.names().iter().map(|name| is_road_tag(name)).collect();
                let near = records.iter().filter(|record| {
                    let [x, y, _] = record.xyz.map(f64::from);
                    is_road.get(record.tag as usize) == Some(&true)
                        && maths::hypot(x, y) <= ground::NEAR
                });
                // A version is out if the scan has tags that it lacks.
                let known = records.iter().all(|record| (record.tag as usize) < is_road.len());
                NearRoad::of(near.map(|record| 0.0 - f64::from(record.xyz[2])).collect())
                    .filter(|_| known)
            });
            if points(&roads) > points(&found) {
                found = roads;
                if roads.iter().flatten().any(NearRoad::is_sure) {
                    break;
                }
            }
        }
        Ok(found)
    }

    /// The points of a scan with the name and meaning of their tags.
    fn records(&self, path: &Path) -> Checked<Vec<Tagged>> {
        let meaning = |(point, record): (usize, Record)| {
            let found = self.meanings.get(record.tag as usize).copied();
            let found = found.ok_or_else(|| {
                refused!(
                    "{}: point {point} has tag {}; tags of CARLA {} end at {}, see --carla-tags",
                    path.display(),
                    record.tag,
                    self.tags.version(),
                    self.meanings.len() - 1
                )
            })?;
            Ok((record, found))
        };
        frames::read_points(path)?.into_iter().enumerate().map(meaning).collect()
    }

    fn frame(&self, frame: u32) -> Checked<&(PathBuf, TimedPose)> {
        self.frames.get(&frame).ok_or_else(|| no_frame(self.folder.display(), frame, self))
    }
}

impl LabelledSequence for CarlaSequence {
    fn name(&self) -> String {
        folder_name(&self.folder)
    }

    fn classes(&self) -> Vec<String> {
        DEFAULT_CLASSES.map(str::to_owned).to_vec()
    }

    fn frames(&self) -> Vec<u32> {
        self.frames.keys().copied().collect()
    }

    fn rate(&self) -> Option<f64> {
        let times = || self.frames.values().map(|(_, stood)| stood.time);
        let (first, last) = (times().next()??, times().next_back()??);
        let rate = (self.frames.len() - 1) as f64 / (last - first);
        Some((rate * 1000.0).round() / 1000.0).filter(|rate| *rate > 0.0 && *rate <= 1000.0)
    }

    fn ego_from_sensor(&self, _: u32) -> Checked<Pose> {
        Ok(self.ego_from_sensor)
    }

    fn world_from_sensor(&self, frame: u32) -> Checked<Pose> {
        Ok(self.frame(frame)?.1.world_from_sensor)
    }

    /// Boxes around the points of each actor; `carla/frames.rs` lists their limits.
    fn tracks(&self) -> Checked<Vec<BoxTrack>> {
        let mut seen: BTreeMap<u32, ActorPoints> = BTreeMap::new();
        for (&frame, (path, stood)) in &self.frames {
            for (record, meaning) in self.records(path)? {
                if is_actor(&record, &meaning.1) {
                    let point = Vec3::from(record.xyz).as_dvec3();
                    let actor = seen.entry(record.object).or_default();
                    actor.tag = actor.tag.or(Some(meaning));
                    let points = actor.frames.entry(frame).or_default();
                    points.push(stood.world_from_sensor.apply(point));
                }
            }
        }
        Ok(seen.values().filter_map(ActorPoints::track).collect())
    }

    fn notes(&self) -> &[Note] {
        &self.notes
    }

    fn read(&self, frame: u32) -> Checked<LabelledScan> {
        let records = self.records(&self.frame(frame)?.0)?;
        let label = |(record, (_, tag)): &(Record, (&str, Tag))| {
            let actor = is_actor(record, tag);
            PointLabel { class: tag.0, moving: actor, on_track: actor }
        };
        let labels = records.iter().map(label).collect();
        Ok(LabelledScan { points: records.iter().map(|(record, _)| record.xyz).collect(), labels })
    }
}

/// The version whose road lies clearly lower than the other's: a road is the lowest surface near a car.
fn deeper(old: Option<NearRoad>, new: Option<NearRoad>) -> Option<CarlaTags> {
    match old?.depth - new?.depth {
        more if more > LOWER => Some(CarlaTags::Until0913),
        more if more < -LOWER => Some(CarlaTags::Since0914),
        _ => None,
    }
}

fn is_road_tag(name: &str) -> bool {
    let class = class_of_name(name).and_then(|(class, ..)| class);
    class.is_some_and(|class| ground::is_road(DEFAULT_CLASSES[usize::from(class)]))
}

/// True if a point lies on a vehicle or person that the simulator moves: parts of the map have object 0.
fn is_actor(record: &Record, (_, boxed, _): &Tag) -> bool {
    *boxed && record.object != 0
}

fn no_scans(folder: &Path) -> FormatError {
    let folder = folder.display();
    refused!("{folder} holds no scan named by its frame like 000123.ply, .bin or .npy")
}

fn list_scans(folder: &Path) -> Checked<Vec<(u32, PathBuf)>> {
    let mut scans = Vec::new();
    for path in entries(folder)? {
        let ending = path.extension().and_then(|ending| ending.to_str());
        if matches!(ending, Some("ply" | "bin" | "npy")) {
            let Some(frame) = frame_of(&path) else {
                return Err(refused!(
                    "{}: a scan of CARLA is named by its frame, at most 4294967295, like 000123.ply; rename or remove it",
                    path.display()
                ));
            };
            scans.push((frame, path));
        }
    }
    if scans.is_empty() {
        return Err(no_scans(folder));
    }
    scans.sort();
    Ok(scans)
}

/// Version of CARLA whose numbers the tags of a scan are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CarlaTags {
    /// 0.9.10 to 0.9.13: 0 to 22.
    Until0913,
    /// 0.9.14 and later: 0 to 28, of CityScapes' order.
    Since0914,
}

/// Meaning of a tag: its class, whether boxes are drawn around its things, their kind.
type Tag = (Option<u16>, bool, ActorKind);

#[rustfmt::skip]
const UNTIL_0913: [&str; 23] = [
    "Unlabeled", "Building", "Fence", "Other", "Pedestrian", "Pole", "RoadLine", "Road", "SideWalk",
    "Vegetation", "Vehicles", "Wall", "TrafficSign", "Sky", "Ground", "Bridge", "RailTrack",
    "GuardRail", "TrafficLight", "Static", "Dynamic", "Water", "Terrain",
];

#[rustfmt::skip]
const SINCE_0914: [&str; 29] = [
    "Unlabeled", "Roads", "SideWalks", "Building", "Wall", "Fence", "Pole", "TrafficLight",
    "TrafficSign", "Vegetation", "Terrain", "Sky", "Pedestrian", "Rider", "Car", "Truck", "Bus",
    "Train", "Motorcycle", "Bicycle", "Static", "Dynamic", "Other", "Water", "RoadLine", "Ground",
    "Bridge", "RailTrack", "GuardRail",
];

/// Class and kind of things that move, by the name without the s of a plural.
const THINGS: [(&str, &str, ActorKind); 9] = [
    ("pedestrian", "pedestrian", ActorKind::Pedestrian),
    ("rider", "pedestrian", ActorKind::Pedestrian),
    ("vehicle", "vehicle", ActorKind::Car),
    ("car", "vehicle", ActorKind::Car),
    ("truck", "vehicle", ActorKind::Truck),
    ("bu", "vehicle", ActorKind::Bus),
    ("train", "vehicle", ActorKind::Bus),
    ("motorcycle", "vehicle", ActorKind::Motorcycle),
    ("bicycle", "vehicle", ActorKind::Bicycle),
];

impl CarlaTags {
    pub(super) fn names(self) -> &'static [&'static str] {
        match self {
            Self::Until0913 => &UNTIL_0913,
            Self::Since0914 => &SINCE_0914,
        }
    }

    /// The first version that has these tags.
    fn version(self) -> &'static str {
        match self {
            Self::Until0913 => "0.9.10",
            Self::Since0914 => "0.9.14",
        }
    }
}

/// Names of all tags, each once.
pub(super) fn tag_names() -> impl Iterator<Item = &'static str> {
    let new = SINCE_0914.iter().filter(|name| !UNTIL_0913.contains(name));
    UNTIL_0913.iter().chain(new).copied()
}

/// The meaning of a tag's name, however it is spelt: `RoadLine`, `road_line`, and `RoadLines` as sets of
/// Place3D have it.
pub(super) fn class_of_name(name: &str) -> Option<Tag> {
    let plain = |name: &str| -> String {
        let letters = name.chars().filter(char::is_ascii_alphanumeric).collect::<String>();
        letters.to_ascii_lowercase().trim_end_matches('s').to_owned()
    };
    let name = plain(name);
    if ["unlabeled", "none", "sky"].contains(&name.as_str()) {
        return Some((None, false, ActorKind::Other));
    }
    let thing = THINGS.iter().find(|(known, ..)| *known == name);
    let (class, kind) = thing.map_or((&*name, ActorKind::Other), |&(_, class, kind)| (class, kind));
    let class = DEFAULT_CLASSES.iter().position(|known| plain(known) == class)?;
    let boxed = ["pedestrian", "vehicle"].contains(&DEFAULT_CLASSES[class]);
    Some((Some(class as u16), boxed, kind))
}
