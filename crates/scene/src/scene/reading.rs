//! From the text of a scene file to a scene and its vehicle, with doubts about angles in degrees.
//!
//! The vehicle is inline, from a file, or made of the scene's `lidar` and `mount`.

use std::collections::HashSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use sightline_files::Note;
use sightline_files::json::{Checked, Location};

use super::carriers::check_names;
use super::classes::Classes;
use super::description::{
    BodyDescription, PoseDescription, SceneDescription, ShapeDescription, VehicleSource,
};
use super::doubts::SceneLocations;
use super::doubts::size::{BodyScales, too_large};
use super::parts::{OwnBodies, OwnBody};
use super::shapes::Builder;
use super::*;
use crate::vehicle::{self, Vehicle, VehicleDescription, read_vehicle};

/// Scene of [`Scene::level_ground`]. The ground lies in the middle of a layer of voxels, so that an area of the ground has
/// some.
const LEVEL_GROUND: &str = r#"{
    "sightline": 1,
    "roi": { "min": [-50, -50, -5.1], "max": [50, 50, 15.1], "voxel": [0.5, 0.5, 0.2] },
    "static": [{ "class": "road", "plane": { "min": [-300, -300], "max": [300, 300], "z": 0 } }]
}"#;

impl Scene {
    /// Reads a scene file and every sensor and mesh file that it names.
    ///
    /// File names in the scene are relative to the folder of the scene. A P-SOG file is not opened.
    pub fn read(path: impl AsRef<Path>) -> Checked<Self> {
        Self::read_with(path, None)
    }

    /// A copy with the vehicle of another file in place of the scene's own, and of the ego body if the file has one.
    pub fn read_with(path: impl AsRef<Path>, vehicle: Option<&Path>) -> Checked<Self> {
        let path = path.as_ref();
        let (text, name) = (json::read_text(path, MAX_FILE)?, path.display().to_string());
        let dir = path.parent().unwrap_or(Path::new(""));
        let mut scene = Self::from_text(&text, (dir, &name), vehicle, false)?;
        scene.files.insert(0, path.to_owned());
        scene.is_of_file = true;
        Ok(scene)
    }

    /// Level ground of 600 by 600 m around a vehicle of a file, in one frame. Bodies with a pose for each frame stand as
    /// in frame 0, with a note.
    pub fn level_ground(vehicle: &Path) -> Checked<Self> {
        let mut scene =
            Self::from_text(LEVEL_GROUND, (Path::new(""), "level ground"), Some(vehicle), true)?;
        scene.is_level_ground = true;
        // Errors name the first file: the vehicle rather than one of its meshes.
        scene.files.retain(|file| file != vehicle);
        scene.files.insert(0, vehicle.to_owned());
        scene.is_of_file = true;
        Ok(scene)
    }

    /// Reads a scene from JSON text.
    ///
    /// File names are relative to `dir`; error messages call the text `name_for_errors`.
    ///
    /// A scene without a name, or with a blank one, is called `name_for_errors` without folder and ending.
    pub fn from_json(text: &str, dir: &Path, name_for_errors: &str) -> Checked<Self> {
        Self::from_text(text, (dir, name_for_errors), None, false)
    }

    /// Reads the text of a scene, on the vehicle of another file if one is given; `holds_still` takes the vehicle as in its
    /// frame 0.
    fn from_text(
        text: &str,
        (dir, name_for_errors): (&Path, &str),
        vehicle: Option<&Path>,
        holds_still: bool,
    ) -> Checked<Self> {
        json::check_version(text, name_for_errors, FileKind::Scene)?;
        let mut scene: SceneDescription = json::parse(text, name_for_errors)?;
        let top = Location::top(name_for_errors);
        let angles = of_angles(&top, &scene);
        let name = name_of(&top, scene.name.take())?;
        let roi = RoiBounds::new(&top.key("roi"), &scene.roi)?;
        let mut carrier = SceneVehicle::new(&top, &mut scene, dir, vehicle)?;
        roi.check_mounts(&top, &carrier.vehicle, |mount| carrier.mount(mount))?;
        let classes = std::mem::take(&mut scene.classes);
        let classes = Classes::new(&top, classes, std::mem::take(&mut scene.detection))?;
        let mut things = things(&top, &scene, &classes, &mut carrier, dir)?;
        if holds_still {
            carrier.notes.extend(things.own.hold_still());
        }
        carrier.notes.extend(angles);
        let mut places = carrier.places(&top, &scene);
        places.scales.told = things.own.told;
        places.scales.first = places.scales.first.filter(|_| !things.own.joined);
        let mut scene = Self::of_parts(&top, scene, (name, roi, classes), carrier, things, dir)?;
        let (doubts, buried) = scene.doubts(&places);
        scene.notes.extend(doubts);
        scene.notes = repeated::folded(std::mem::take(&mut scene.notes));
        scene.buried_mounts = buried;
        let large = too_large("ego body", &scene.body, places.scales.first);
        scene.large_body = large.map(|large| format!("{}: {large}", places.body));
        scene.vehicle_file = places.vehicle.file;
        Ok(scene)
    }

    /// Assembles the scene: checks motion, coverage, P-SOG source and reflectances.
    fn of_parts(
        top: &Location,
        scene: SceneDescription,
        (name, roi, classes): (String, RoiBounds, Classes),
        carrier: SceneVehicle,
        things: SceneGeometry,
        dir: &Path,
    ) -> Checked<Self> {
        let SceneVehicle { at, vehicle, mut files, mut notes, .. } = carrier;
        notes.extend(things.own.moving.iter().map(OwnBody::note));
        let reflectances = Reflectances::new(top, &classes, &scene.reflectance, &scene.actors)?;
        let has_geometry = things.has_geometry();
        let frames = things.frames(top, scene.frames)?;
        let rate = check::rate(&top.key("rate"), scene.rate.unwrap_or(RATE))?;
        let SceneGeometry { world, actors, own, ego } = things;
        let coverage = scene.coverage.as_deref();
        let coverage = Coverage::new(&top.key("coverage"), coverage, has_geometry)?;
        let mount_at = |mount| at.key("mounts").item(mount);
        OwnBodies::check_carriers(&vehicle.mounts, coverage, mount_at)?;
        let OwnBodies { body, moving: bodies, still, doubts, .. } = own;
        notes.extend(doubts);
        let ego = ego.unwrap_or(Motion::Still);
        let mut origins = vec![super::parts::middle_of_way(&top.key("ego"), &ego, frames, &world)?];
        origins.extend(actors.iter().map(|actor| super::parts::middle(&actor.parts)));
        origins.resize(origins.len() + 1 + bodies.len(), DVec3::ZERO);
        let psog = scene.psog.as_ref();
        let (range, top_of_mounts) = (vehicle.longest_range(), vehicle.corners()[1][2]);
        let psog = PsogSource::new(top, psog, has_geometry, dir, range, top_of_mounts)?;
        match &psog {
            PsogSource::File(file) => files.push(file.clone()),
            PsogSource::Scan(_) => classes.check_detection(&classes.names)?,
        }
        Ok(Self {
            name,
            classes,
            roi,
            vehicle,
            vehicle_file: String::new(),
            sensors: OnceLock::new(),
            coverage,
            psog,
            frames,
            rate,
            world,
            actors,
            body,
            bodies,
            still,
            ego,
            origins,
            reflectances,
            files,
            is_of_file: false,
            notes,
            is_level_ground: false,
            large_body: None,
            buried_mounts: None,
        })
    }
}

/// World, actors and ego body of a scene; their files and notes are added to the carrier.
fn things(
    top: &Location,
    scene: &SceneDescription,
    classes: &Classes,
    carrier: &mut SceneVehicle,
    dir: &Path,
) -> Checked<SceneGeometry> {
    let mut builder = Builder::new(top, classes, &scene.shapes, dir);
    builder.check_named()?;
    let mut things =
        SceneGeometry::new(&mut builder, top, &scene.world, &scene.actors, scene.ego.as_ref())?;
    carrier.files.extend(builder.files());
    if let Some(VehicleBody { shapes, others, dir }) = &carrier.body {
        let mut builder = Builder::new(&carrier.at, classes, &scene.shapes, dir);
        things.own = OwnBodies::new(&mut builder, &carrier.at, shapes, others)?;
        carrier.files.extend(builder.files());
        carrier.notes.extend(builder.notes());
        carrier.notes.extend(of_own_bodies(&carrier.at, shapes, others));
    }
    carrier.notes.extend(builder.notes());
    Ok(things)
}

/// Stated name, or the file name without its ending.
fn name_of(top: &Location, given: Option<String>) -> Checked<String> {
    let given = given.filter(|name| !name.trim().is_empty());
    let given = given.map(|name| check::name(&top.key("name"), name)).transpose()?;
    let stem = || Path::new(&top.file).file_stem().unwrap_or_default().to_string_lossy();
    Ok(given.unwrap_or_else(|| stem().replace(char::is_control, "-")))
}

/// A scene's vehicle, its body and its files.
struct SceneVehicle {
    /// Where the vehicle is described: its file, or a place in the scene.
    at: Location,
    vehicle: Vehicle,
    /// A body that takes the place of the scene's own.
    body: Option<VehicleBody>,
    files: Vec<PathBuf>,
    /// Sentences about the vehicle and its sensors.
    notes: Vec<Note>,
}

struct VehicleBody {
    shapes: Vec<ShapeDescription>,
    /// Bodies beside the first.
    others: Vec<BodyDescription>,
    /// Where its files are.
    dir: PathBuf,
}

impl SceneVehicle {
    /// From a scene's description, or from the vehicle file given beside it.
    fn new(
        top: &Location,
        scene: &mut SceneDescription,
        dir: &Path,
        given: Option<&Path>,
    ) -> Checked<Self> {
        let file = match (given, scene.vehicle.take()) {
            (Some(file), _) => file.to_owned(),
            (None, Some(VehicleSource::Inline(vehicle))) => {
                only_vehicle(top, scene)?;
                let bodies = scene_bodies(scene);
                return Self::of_vehicle(top.key("vehicle"), *vehicle, (None, dir), bodies);
            }
            (None, Some(VehicleSource::File(file))) => {
                only_vehicle(top, scene)?;
                dir.join(file)
            }
            (None, None) => return Self::nameless(top, scene, dir),
        };
        let at = Location::top(&file.display().to_string());
        let dir = file.parent().unwrap_or(Path::new("")).to_owned();
        Self::of_vehicle(at, read_vehicle(&file)?, (Some(file), &dir), scene_bodies(scene))
    }

    /// From the `lidar` and `mount` of a scene.
    fn nameless(top: &Location, scene: &mut SceneDescription, dir: &Path) -> Checked<Self> {
        let missing = |key, mend: &str| check::missing(top, key, mend);
        let lidar = scene.lidar.take();
        let lidar =
            lidar.ok_or_else(|| missing("lidar", "describe the sensor, or give a `vehicle`"))?;
        let mount = scene.mount.take();
        let mount = mount
            .ok_or_else(|| missing("mount", "say where sensors may stand, or give a `vehicle`"))?;
        let files = lidar.file.iter().map(|file| dir.join(file)).collect();
        let vehicle = Vehicle::nameless(top, lidar, &mount, dir)?;
        let (at, notes) = (top.clone(), vehicle.notes.clone());
        Ok(Self { at, notes, vehicle, body: None, files })
    }

    fn mount(&self, index: usize) -> Location {
        match self.vehicle.is_nameless() {
            true => self.at.key("mount"),
            false => self.at.key("mounts").item(index),
        }
    }

    /// Where scene, mounts and body are described.
    fn places(&self, top: &Location, scene: &SceneDescription) -> SceneLocations {
        let body = if self.body.is_some() { &self.at } else { top };
        let mounts = (0..self.vehicle.mounts.len()).map(|mount| self.mount(mount)).collect();
        let scales = match (&self.body, &scene.ego) {
            (Some(VehicleBody { shapes, .. }), _) => BodyScales::of(shapes),
            (None, Some(ego)) => BodyScales::of(&ego.body),
            (None, None) => BodyScales::default(),
        };
        SceneLocations {
            scales,
            scene: top.file.clone(),
            vehicle: self.at.clone(),
            mounts,
            body: body.file.clone(),
        }
    }

    fn of_vehicle(
        at: Location,
        mut vehicle: VehicleDescription<ShapeDescription, BodyDescription>,
        (file, dir): (Option<PathBuf>, &Path),
        of_scene: &[BodyDescription],
    ) -> Checked<Self> {
        let shapes = vehicle.take_body(&at)?;
        let others = std::mem::take(&mut vehicle.bodies);
        let is_there = !(shapes.is_empty() && others.is_empty());
        let bodies = if is_there { &others[..] } else { of_scene };
        check_names(&at, &vehicle.mounts, bodies)?;
        let stem = file.as_ref().and_then(|file| file.file_stem());
        let stem = stem.map_or("vehicle".into(), |stem| stem.to_string_lossy());
        let (vehicle, mut files) = Vehicle::new(&at, vehicle, &stem, dir)?;
        files.extend(file);
        let body = is_there.then_some(VehicleBody { shapes, others, dir: dir.to_owned() });
        let notes = vehicle.notes.clone();
        Ok(Self { at, notes, vehicle, body, files })
    }
}

/// Bodies that a scene gives a vehicle without a body of its own.
fn scene_bodies(scene: &SceneDescription) -> &[BodyDescription] {
    scene.ego.as_ref().map_or(&[], |ego| &ego.bodies)
}

/// Refuses a LiDAR or mount beside a vehicle.
fn only_vehicle(top: &Location, scene: &SceneDescription) -> Checked<()> {
    for (key, there) in [("lidar", scene.lidar.is_some()), ("mount", scene.mount.is_some())] {
        if there {
            return Err(check::misplaced(top, key, "the `vehicle` says it; leave one out"));
        }
    }
    Ok(())
}

/// Doubts about the angles that a scene file states.
fn of_angles(top: &Location, scene: &SceneDescription) -> Vec<Note> {
    let mut doubts = of_shapes(&top.key("static"), &scene.world);
    for (name, shapes) in &scene.shapes.0 {
        doubts.extend(of_shapes(&top.key("shapes").key(name), shapes));
    }
    let ego = scene.ego.iter().map(|ego| (top.key("ego"), &ego.poses));
    let actors = scene.actors.iter().enumerate();
    let actors = actors.map(|(i, actor)| (top.key("actors").item(i), &actor.poses));
    let turned = ego.chain(actors).filter_map(|(at, poses)| track(&at, poses.as_deref()?));
    doubts.extend(first_three(turned.collect()));
    for (i, actor) in scene.actors.iter().enumerate() {
        doubts.extend(of_shapes(&top.key("actors").item(i).key("parts"), &actor.parts));
    }
    if let Some(ego) = &scene.ego {
        doubts.extend(of_own_bodies(&top.key("ego"), &ego.body, &ego.bodies));
    }
    if let Some(mount) = &scene.mount {
        let angles = [("roll", mount.roll), ("pitch", mount.pitch), ("yaw", mount.yaw)];
        let told = angles.iter().filter_map(|(key, range)| {
            vehicle::of_angles(&top.key("mount").key(key).to_string(), range)
        });
        doubts.extend(told.map(Note::doubt));
    }
    doubts
}

/// Doubts about the angles of the own bodies.
fn of_own_bodies(
    at: &Location,
    first: &[ShapeDescription],
    others: &[BodyDescription],
) -> Vec<Note> {
    let mut doubts = of_shapes(&at.key("body"), first);
    for (i, body) in others.iter().enumerate() {
        let at = at.key("bodies").item(i);
        doubts.extend(of_shapes(&at.key("parts"), &body.parts));
        doubts.extend(body.poses.as_deref().and_then(|poses| track(&at, poses)));
    }
    doubts
}

/// Doubts about the angles of meshes and robots, and about meshes that are listed twice. Boxes and copies are turned by
/// whole radians, too.
fn of_shapes(at: &Location, shapes: &[ShapeDescription]) -> Vec<Note> {
    let mut doubts = Vec::new();
    let mut known = HashSet::new();
    for (i, shape) in shapes.iter().enumerate() {
        if shape.mesh.is_some() && !known.insert(format!("{shape:?}")) {
            let at = at.item(i).key("mesh");
            doubts
                .push(format!("{at}: is listed before, in the same place; leave one of them out"));
        }
        let mesh = shape.mesh.iter().map(|mesh| ("mesh", [mesh.roll, mesh.pitch, mesh.yaw]));
        let urdf = shape.urdf.iter().map(|urdf| ("urdf", [urdf.roll, urdf.pitch, urdf.yaw]));
        for (kind, angles) in mesh.chain(urdf) {
            for (key, angle) in ["roll", "pitch", "yaw"].iter().zip(angles) {
                let what = at.item(i).key(kind).key(key).to_string();
                doubts.extend(vehicle::of_angles(&what, &[angle]));
            }
        }
    }
    first_three(doubts.into_iter().map(Note::doubt).collect())
}

/// A doubt about the angles of a way. Headings may go on past a turn, step by step.
fn track(at: &Location, poses: &[PoseDescription]) -> Option<Note> {
    let yaw: Vec<f64> = poses.iter().map(|pose| pose.yaw).collect();
    let leaps = |two: &[f64]| {
        let step = two[1] - two[0];
        (step - TAU * (step / TAU).round()).abs() > 1.0
    };
    let more_than_a_turn = |yaw: &f64| yaw.abs() > TAU + check::ROUNDED;
    let whole = yaw.iter().all(|yaw| yaw.fract() == 0.0) && yaw.iter().any(|yaw| yaw.abs() >= 2.0);
    let in_degrees = whole
        || yaw.first().is_some_and(more_than_a_turn)
        || (yaw.iter().any(more_than_a_turn) && yaw.windows(2).any(leaps));
    let worst = yaw.iter().copied().find(|yaw| in_degrees && yaw.abs() >= 2.0);
    let tilt =
        poses.iter().flat_map(|pose| [pose.roll, pose.pitch]).find(|a| vehicle::is_degrees(*a));
    let (key, angle) = worst.map(|yaw| ("yaw", yaw)).or(tilt.map(|tilt| ("a tilt", tilt)))?;
    Some(Note::doubt(format!(
        "{}: {key} of {angle} rad; degrees? {angle}° are {:.4} rad",
        at.key("poses"),
        angle.to_radians()
    )))
}

/// The first three doubts of a list; things of one file share one mistake.
fn first_three(mut doubts: Vec<Note>) -> Vec<Note> {
    doubts.truncate(3);
    doubts
}
