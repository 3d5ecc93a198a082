//! The scene file: reading it, checking it, its rigid parts, and one triangle soup a frame.
//!
//! A scene names a region of interest, a vehicle and, in its full form, geometry: a static
//! world, actors that move through it and the body of the ego vehicle. A `lidar` and a `mount` become a vehicle of
//! one model on one mount here, and nothing else reads them. Every key is explained in
//! `scenes/README.md`. Reading loads every mesh once and keeps the world in `f64`; a frame moves
//! it into the ego frame and only then rounds it to `f32`, and so does a part with its own frame.

mod carriers;
mod classes;
pub(crate) mod description;
mod doubts;
mod parts;
mod reading;
mod repeated;
mod route;
mod settings;
mod shapes;
mod solid;
pub mod street;
pub(crate) mod target;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::DVec3;
use lidar_cast::geom::Pose;
use sightline_files::json::{Checked, check};
use sightline_files::{Note, json};

use crate::vehicle::{Constraints, Lidar, MountRules, SensorError, Sensors, Vehicle};
use classes::Classes;
use description::{ActorDescription, EgoDescription, ShapeDescription};
use parts::{OwnBodies, OwnBody};
use route::Motion;
use shapes::Builder;
use solid::Solid;
pub(crate) use solid::{around, clipped};

pub use classes::{ActorKind, DEFAULT_CLASSES, Ground, Reflectances};
pub use parts::{PartOwner, Track};
pub use settings::{Coverage, PsogSource, RoiBounds, ScanSettings};
pub use sightline_files::json::{DescriptionError, FileKind, Location};
pub use street::street;
pub(crate) use target::RATED_REFLECTANCE;
pub use target::{Target, preset_targets};

/// Largest scene file in bytes; ten million listed directions fit.
const MAX_FILE: u64 = 1 << 30;
const MAX_FRAMES: u64 = 10_000;
/// Frames a second of a scene that does not say.
const RATE: f64 = 10.0;

/// A scene, read and checked.
#[derive(Debug, Clone)]
pub struct Scene {
    name: String,
    classes: Classes,
    roi: RoiBounds,
    vehicle: Vehicle,
    /// Description of the vehicle: a vehicle file, or the file of the scene.
    vehicle_file: String,
    /// Sensor models, built on first use: many beams take their time.
    sensors: OnceLock<Sensors>,
    coverage: Coverage,
    psog: PsogSource,
    frames: usize,
    /// Frames a second.
    rate: f64,
    /// Static triangles in the world frame.
    world: Solid,
    actors: Vec<Actor>,
    /// Triangles of the ego's body in the ego frame, with the bodies that keep one pose.
    body: Solid,
    /// Bodies of the ego that move against the first.
    bodies: Vec<OwnBody>,
    /// Bodies of the ego that do not: names and poses.
    still: Vec<(String, Pose)>,
    ego: Motion,
    /// Transform of each part, in the frame of its owner; see [`Scene::part`].
    origins: Vec<DVec3>,
    reflectances: Reflectances,
    files: Vec<PathBuf>,
    /// True if the first file is the scene's own; a text has only parts in files.
    is_of_file: bool,
    notes: Vec<Note>,
    /// True for [`Scene::level_ground`]: names do not tell it from scenes of users.
    pub(crate) is_level_ground: bool,
    /// Doubt about an own body far larger than a vehicle, with its file.
    large_body: Option<String>,
    /// Error of a search over mounts that all lie inside the own body.
    buried_mounts: Option<String>,
}

/// Moving object: triangles in its own frame and a pose for each frame.
#[derive(Debug, Clone)]
struct Actor {
    name: String,
    kind: ActorKind,
    parts: Solid,
    motion: Motion,
}

/// Triangles of the world, the actors and the ego's body, with their motion.
struct SceneGeometry {
    world: Solid,
    actors: Vec<Actor>,
    own: OwnBodies,
    /// None where the scene does not say how the ego moves.
    ego: Option<Motion>,
}

impl SceneGeometry {
    fn new(
        builder: &mut Builder<'_>,
        top: &Location,
        world: &[ShapeDescription],
        actors: &[ActorDescription],
        ego: Option<&EgoDescription>,
    ) -> Checked<Self> {
        let world = builder.list(&top.key("static"), world)?;
        let actors = actors.iter().enumerate().map(|(i, actor)| {
            let at = top.key("actors").item(i);
            let name = actor.name.clone().unwrap_or_default();
            let name = check::name(&at.key("name"), name)?;
            let parts = builder.actor(&at.key("parts"), &actor.parts)?;
            let class = parts.classes.first().map(|&class| builder.class_name(class));
            let kind = ActorKind::read(&at.key("kind"), actor.kind.as_deref(), class)?;
            let (poses, route) = (actor.poses.as_deref(), actor.route.as_ref());
            let motion = Motion::new(&at, poses, route, !kind.rolls())?;
            let mend = "say where the actor is, with `poses` or `route`";
            let motion = motion.ok_or_else(|| check::missing(&at, "poses", mend))?;
            Ok(Actor { name, kind, parts, motion })
        });
        let actors = actors.collect::<Checked<_>>()?;
        let none = EgoDescription::default();
        let (ego, at) = (ego.unwrap_or(&none), top.key("ego"));
        let own = OwnBodies::new(builder, &at, &ego.body, &ego.bodies)?;
        let ego = Motion::new(&at, ego.poses.as_deref(), ego.route.as_ref(), false)?;
        Ok(Self { world, actors, own, ego })
    }

    fn has_geometry(&self) -> bool {
        !self.world.faces.is_empty()
            || !self.own.is_empty()
            || self.actors.iter().any(|a| !a.parts.faces.is_empty())
    }

    /// The number of frames: `given`, or as many as the ego has poses; whatever moves has as many.
    fn frames(&self, top: &Location, given: Option<u64>) -> Checked<usize> {
        let frames = match (given, &self.ego) {
            (Some(n), _) => check::count(&top.key("frames"), n, 1, MAX_FRAMES)? as usize,
            (None, Some(Motion::Poses(poses))) => {
                let n = poses.len() as u64;
                check::count(&top.key("ego").key("poses"), n, 1, MAX_FRAMES)? as usize
            }
            (None, _) => 1,
        };
        if !self.has_geometry() && frames > 1 {
            let mend =
                "without geometry all frames are alike; add `static` or `actors`, or leave it out";
            return Err(check::misplaced(top, "frames", mend));
        }
        if let Some(ego) = &self.ego {
            ego.check_frames(&top.key("ego"), frames)?;
        }
        for (i, actor) in self.actors.iter().enumerate() {
            actor.motion.check_frames(&top.key("actors").item(i), frames)?;
        }
        self.own.moving.iter().try_for_each(|body| body.check_frames(top, frames))?;
        Ok(frames)
    }
}

/// Tells whether a frame holds the body of the ego vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EgoBody {
    /// With the body, which blocks the beams of mounted sensors.
    Include,
    /// Without the body: the surroundings alone.
    Exclude,
}

impl Scene {
    /// Likely mistakes that are no errors: a sentence each, with file and place.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// The error of a search over mounts that lie inside the own body, where every beam ends at once: all that must hold a
    /// LiDAR, or all. `None` where a beam gets out.
    pub fn buried_mounts(&self) -> Option<&str> {
        self.buried_mounts.as_deref()
    }

    /// Description of the vehicle: a vehicle file, or the file of the scene.
    pub fn vehicle_file(&self) -> &str {
        &self.vehicle_file
    }

    /// Name of the scene, or of its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Class names; the index is the class id.
    pub fn classes(&self) -> &[String] {
        &self.classes.names
    }

    /// Ids of the detection target in the `classes` of a P-SOG, rising; may be empty.
    pub fn detection_among(&self, classes: &[String]) -> Vec<u16> {
        self.classes.detection_among(classes)
    }

    /// Checks that the `classes` of a P-SOG hold every name of the scene's `detection`.
    pub fn check_detection(&self, classes: &[String]) -> Checked<()> {
        self.classes.check_detection(classes)
    }

    /// The region of interest.
    pub fn roi(&self) -> &RoiBounds {
        &self.roi
    }

    /// LiDARs of the models of [`Self::sensors`], in that order; at least one.
    pub fn lidars(&self) -> Vec<&Lidar> {
        self.vehicle.sensors.iter().map(|model| &model.lidar).collect()
    }

    /// Adds rules to the mount; error messages call the scene `name_for_errors`.
    ///
    /// # Errors
    /// A rule that the mount does not allow, or that leaves no room for a placement; any rule where mounts are those of a
    /// vehicle file.
    pub fn with_rules(self, rules: &MountRules, name_for_errors: &str) -> Checked<Self> {
        let at = Location::top(name_for_errors).key("mount");
        Ok(Self { vehicle: self.vehicle.narrowed(&at, rules)?, ..self })
    }

    /// The scene on a vehicle that requires nothing, for work that asks for no voxels: a required area must hold one.
    #[must_use]
    pub fn without_requirements(mut self) -> Self {
        let Vehicle { require, targets, ground, overlap, require_order, .. } = &mut self.vehicle;
        require.clear();
        overlap.clear();
        require_order.clear();
        targets.clear();
        ground.clear();
        self
    }

    /// The vehicle; made of the scene's `lidar` and `mount` where it says these.
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// Sensor models of the vehicle.
    ///
    /// # Errors
    /// A model without beams.
    pub fn sensors(&self) -> Result<Sensors, SensorError> {
        if let Some(sensors) = self.sensors.get() {
            return Ok(sensors.clone());
        }
        let sensors = self.vehicle.models()?.riding(self.rides());
        Ok(self.sensors.get_or_init(|| sensors).clone())
    }

    /// The models with ⌈n / divisor⌉ of their n azimuth steps or directions, evenly.
    ///
    /// # Errors
    /// A model without beams.
    pub fn thinned_sensors(&self, divisor: u32) -> Result<Sensors, SensorError> {
        let thinned = self.lidars().into_iter().map(|lidar| lidar.thinned(divisor).table());
        let mut sensors = self.sensors()?;
        for (model, table) in thinned.enumerate() {
            sensors = sensors.with_beams(model, table?);
        }
        Ok(sensors)
    }

    /// Rules of given placements, whatever sensors of the vehicle they have: every model that a mount lists may stand
    /// there.
    pub fn rules(&self) -> Constraints {
        self.vehicle.rules()
    }

    /// Rules by which placements are drawn and searched: of the vehicle with its fullest equipment.
    pub fn constraints(&self) -> Constraints {
        self.vehicle.constraints(&self.vehicle.fullest())
    }

    /// Voxels that a beam covers.
    pub fn coverage(&self) -> Coverage {
        self.coverage
    }

    /// Source of the P-SOG.
    pub fn psog_source(&self) -> &PsogSource {
        &self.psog
    }

    /// Every input file: scene, sensor, meshes with their buffers, P-SOG.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// The file that the scene was read from; `None` for a scene of a text, whatever files its parts have.
    pub fn file(&self) -> Option<&Path> {
        self.files.first().filter(|_| self.is_of_file).map(PathBuf::as_path)
    }

    /// Reflectances that the scene file states, by class and by actor.
    pub fn reflectances(&self) -> &Reflectances {
        &self.reflectances
    }

    /// True if the static world, an actor or the ego body has a triangle.
    pub fn has_geometry(&self) -> bool {
        self.triangles(EgoBody::Include) > 0
    }

    /// Number of frames, T; 1 without geometry.
    pub fn frame_count(&self) -> usize {
        self.frames
    }

    /// True if a place in the ego frame lies inside the own body, or inside a body of it that moves as it stands in frame 0.
    pub fn is_in_body(&self, at: DVec3) -> bool {
        doubts::encloses(&parts::standing(&self.body, &self.bodies, 0), at)
    }

    /// Frames a second.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Pose of the ego in frame `t`: takes ego coordinates to world coordinates.
    ///
    /// # Panics
    /// If `t` is not below [`Scene::frame_count`].
    pub fn ego_pose(&self, t: usize) -> Pose {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.ego.pose(t)
    }
}

#[cfg(test)]
mod tests;
