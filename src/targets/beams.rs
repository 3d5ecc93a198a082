//! Beams of a placement whose closest hit is a target, with the own body in the way.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::finder::{BeamFinder, SLACK};
use super::ground::GroundBelow;
use super::on_ground::CardGround;
use super::plan::BodyPlan;
use crate::bvh::{Hit, Ray};
use crate::cast::closest_hit_in;
use crate::geom::Pose;
use crate::maths;
use crate::near_field::{WheelPlane, bodies_move};
use crate::problem::{
    Air, DevicePose, Frame, Instance, Problem, SceneSurface, beam_direction, beam_origin,
    own_bodies,
};
use crate::scan::conditions::Weather;
use crate::scene::{Scene, Target};
use crate::vehicle::{Response, SensorError, SensorModel, SensorPose, Sensors, UnknownSensor};

/// Places of targets that a thread takes at once.
const PLACES_AT_ONCE: usize = 64;

/// Error of a cosine between directions in `f32`, at most.
const ROUNDING: f64 = 1e-6;

/// Sensor models and own body of a vehicle, for beams on targets on level ground.
#[derive(Debug, Clone)]
pub struct TargetSite {
    sensors: Sensors,
    /// One a model, made on first use.
    finders: Arc<[OnceLock<BeamFinder>]>,
    body: Frame,
    /// The own body from above.
    plan: Arc<BodyPlan>,
    /// Light that must return for a beam to count; `None` counts every beam, but on targets that say otherwise.
    receiving: Option<Receiving>,
    /// Surface on which targets stand; `None` for level ground.
    surface: Option<Arc<SiteSurface>>,
    /// True where own bodies move in the frames of the problem.
    bodies_move: bool,
    /// Number of the frame in which the own bodies stand so.
    bodies_of: usize,
}

/// Surface of a scene in a frame, on which targets stand.
#[derive(Debug)]
struct SiteSurface {
    ground: GroundBelow,
    wheels: WheelPlane,
    /// Number of the frame, on which free start angles depend.
    frame: usize,
    /// True for a mirror image: LiDARs and places are mirrored there.
    is_mirrored: bool,
    /// Ground as a range card tells it.
    told: Option<CardGround>,
}

/// A target in place: the middle of its box in plan and the height of its ground, in the ego frame, metres. Its own
/// axis lies along x.
#[derive(Debug, Clone, Copy)]
pub struct PlacedTarget<'a> {
    /// The target.
    pub target: &'a Target,
    /// Position of the target's origin.
    pub at: [f64; 3],
}

/// Light that must return for a beam to count: ρ·cos θ / r² less the loss in air, at least the power of a return that
/// the sensor sees half of the time.
#[derive(Debug, Clone)]
pub struct Receiving(Through);

/// Air on the way.
#[derive(Debug, Clone)]
enum Through {
    Clear,
    Weather(Weather),
    Air(Arc<dyn Air>),
}

/// Light through clear air.
static IN_CLEAR_AIR: Receiving = Receiving(Through::Clear);

impl From<Weather> for Receiving {
    /// Light through fog, snow and rain.
    fn from(weather: Weather) -> Self {
        Self(Through::Weather(weather))
    }
}

impl Receiving {
    /// True if the sensor sees a surface at least half of the time, by its reflectance, cosine of incidence and metres.
    fn sees(&self, response: &Response, reflectance: f64, cosine: f64, metres: f64) -> bool {
        let passed = match &self.0 {
            Through::Clear => 1.0,
            Through::Weather(weather) => weather.passed(metres),
            Through::Air(air) => air.passed(metres),
        };
        let power = reflectance * cosine / (metres * metres) * passed;
        power >= response.threshold() && metres >= response.min_range
    }
}

/// A LiDAR in its pose.
struct Looking<'a> {
    model: &'a SensorModel,
    finder: &'a BeamFinder,
    ego_from_sensor: Pose,
    ends: EndRanges<'a>,
    receiving: Option<&'a Receiving>,
    is_mirrored: bool,
}

/// LiDARs of a placement, asked one at a time.
pub(super) struct LookingOut<'a>(Vec<Looking<'a>>);

impl LookingOut<'_> {
    /// Beams of a LiDAR on a target; counting ends at `enough`.
    pub(super) fn beams(&self, lidar: usize, standing: &PlacedTarget<'_>, enough: u32) -> u32 {
        self.0[lidar].beams(standing, enough)
    }
}

/// Metres at which beams end at anything but a target.
enum EndRanges<'a> {
    /// At the own body: looked up on demand. `known` holds the bits of metres, and NaN for beams not looked up yet.
    Body { body: &'a Frame, known: Vec<AtomicU32> },
    /// At hits that are known.
    Hits(&'a [Hit]),
}

impl TargetSite {
    /// From models and the body of the vehicle in the ego frame.
    pub fn new(sensors: Sensors, body: Frame) -> Self {
        let finders = sensors.models().iter().map(|_| OnceLock::new()).collect();
        let plan = Arc::new(BodyPlan::of(&body));
        let (receiving, surface, bodies_move, bodies_of) = (None, None, false, 0);
        Self { sensors, finders, body, plan, receiving, surface, bodies_move, bodies_of }
    }

    /// Models and own body of a problem. In weather a beam counts if enough light comes back. A problem of a mirror
    /// image would give another vehicle's body.
    pub fn of(problem: &Problem) -> Self {
        let receiving = problem.air().map(|air| Receiving(Through::Air(air.clone())));
        let site = Self::new(problem.sensors().clone(), problem.body().clone());
        Self { bodies_move: bodies_move(problem), ..site }.receiving(receiving)
    }

    /// Site of a problem whose rules place targets on the surface of its scene, with all that is there in the way; `None`
    /// where none does. A mirror image has mirrored sensors, and is asked for the vehicle's own LiDARs and places.
    pub(super) fn in_scene(problem: &Problem, is_mirrored: bool) -> Option<Self> {
        let own = problem.overlap_required().own;
        Some(Self::on_surface(problem, problem.surface()?, own, (is_mirrored, None)))
    }

    /// Site of a problem on a surface, whose own bodies have the triangles from `own` on; true for a mirror image, and the
    /// ground where a range card tells it.
    pub(super) fn on_surface(
        problem: &Problem,
        surface: &SceneSurface,
        own: usize,
        (is_mirrored, told): (bool, Option<CardGround>),
    ) -> Self {
        let plan = Arc::new(BodyPlan::of(&BodyPlan::in_frame(&surface.geometry, own)));
        let ground = GroundBelow::of(surface, problem.body());
        let wheels = ground.wheels(&surface.geometry);
        let surface_of = SiteSurface { ground, wheels, frame: surface.frame, is_mirrored, told };
        let (body, bodies_of) = (surface.geometry.clone(), surface.frame);
        let surface = Some(Arc::new(surface_of));
        Self { body, plan, surface, bodies_of, ..Self::of(problem) }
    }

    /// Ground that targets of a range card stand on; `None` for level ground.
    pub(super) fn card_ground(&self) -> Option<&CardGround> {
        self.surface.as_ref()?.told.as_ref()
    }

    /// Models and own body of a scene's vehicle.
    ///
    /// # Errors
    /// A model without beams.
    pub(crate) fn of_vehicle(scene: &Scene) -> Result<Self, SensorError> {
        let sensors = scene.sensors()?;
        let body = own_bodies(scene, sensors.longest_range());
        Ok(Self::new(sensors, body))
    }

    /// A copy that counts a beam only if enough light comes back.
    #[must_use]
    pub(crate) fn receiving(self, receiving: Option<Receiving>) -> Self {
        Self { receiving, ..self }
    }

    /// A copy whose own bodies stand in other poses, one for each body, as in a frame of a number; `None` where there are more
    /// or fewer bodies. In a scene they are the last that stand there.
    pub(super) fn with_bodies_at(&self, poses: &[Pose], frame: usize) -> Option<Self> {
        let all = self.body.instances();
        let others = all.len().checked_sub(poses.len())?;
        if others > 0 && self.surface.is_none() {
            return None;
        }
        let (others, bodies) = all.split_at(others);
        let at = |(of, &ego_from_instance)| Instance { ego_from_instance, ..Instance::clone(of) };
        let own = Frame::new(bodies.iter().zip(poses).map(at));
        let body = Frame::new(others.iter().chain(own.instances()).cloned());
        Some(Self { plan: Arc::new(BodyPlan::of(&own)), body, bodies_of: frame, ..self.clone() })
    }

    /// True if the own bodies of both stand alike.
    pub(super) fn stands_as(&self, other: &Self) -> bool {
        self.body == other.body
    }

    /// True where own bodies move in the frames of the problem that this is made of.
    pub(super) fn bodies_move(&self) -> bool {
        self.bodies_move
    }

    /// The sensor models.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Beams of a LiDAR on each of some targets, each alone on its ground; counting ends at `enough`.
    ///
    /// A phase that differs from frame to frame stands at 0.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn beams(
        &self,
        lidar: &SensorPose,
        standing: &[PlacedTarget<'_>],
        enough: u32,
    ) -> Result<Vec<u32>, UnknownSensor> {
        let looking = self.looking_out(lidar)?;
        Ok(standing.iter().map(|standing| looking.beams(standing, enough)).collect())
    }

    /// True for each of some targets, each alone on its ground, that at least `enough` beams of a placement meet.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn met(
        &self,
        lidars: &[SensorPose],
        standing: &[PlacedTarget<'_>],
        enough: u32,
    ) -> Result<Vec<bool>, UnknownSensor> {
        let looking = self.looking_out_of(lidars)?;
        let is_met = |standing: &PlacedTarget<'_>| {
            let mut left = enough;
            (0..lidars.len()).any(|lidar| {
                left -= looking.beams(lidar, standing, left).min(left);
                left == 0
            })
        };
        Ok(standing.par_iter().with_min_len(PLACES_AT_ONCE).map(is_met).collect())
    }

    /// Beams of each LiDAR of a placement on each of some targets, `[targets][lidars]`; see [`Self::beams`].
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn beams_by_lidar(
        &self,
        lidars: &[SensorPose],
        standing: &[PlacedTarget<'_>],
    ) -> Result<Vec<Vec<u32>>, UnknownSensor> {
        let of_lidar = lidars.par_iter().map(|lidar| self.beams(lidar, standing, u32::MAX));
        let by_lidar = of_lidar.collect::<Result<Vec<_>, _>>()?;
        Ok(transposed(&by_lidar, standing.len()))
    }

    /// Like [`Self::beams_by_lidar`], with LiDARs at `poses` in a scene: `hits[lidar]` are those of its beams there, own
    /// body included.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(crate) fn beams_in_scene(
        &self,
        lidars: &[SensorPose],
        poses: &[Pose],
        hits: &[&[Hit]],
        standing: &[PlacedTarget<'_>],
    ) -> Result<Vec<Vec<u32>>, UnknownSensor> {
        let of_lidar = |lidar: usize| {
            let model = self.sensors.number(&lidars[lidar])?;
            let looking = self.looking(model, poses[lidar], EndRanges::Hits(hits[lidar]));
            Ok(standing.iter().map(|standing| looking.beams(standing, u32::MAX)).collect())
        };
        let by_lidar = (0..lidars.len()).into_par_iter().map(of_lidar);
        Ok(transposed(&by_lidar.collect::<Result<Vec<_>, _>>()?, standing.len()))
    }

    fn is_mirrored(&self) -> bool {
        self.surface.as_ref().is_some_and(|surface| surface.is_mirrored)
    }

    /// Pose of a LiDAR: on level ground with a free start angle at 0. The body that it rides on carries it.
    fn pose_of(&self, model: usize, lidar: &SensorPose) -> Pose {
        let pose = match &self.surface {
            Some(surface) => {
                let lidar = if surface.is_mirrored { lidar.mirrored() } else { *lidar };
                self.sensors.turned(model, &lidar, surface.frame)
            }
            None => {
                let at_rest = self.sensors.models()[model].phase.at_rest();
                let phase = Some(lidar.phase.unwrap_or(at_rest));
                self.sensors.turned(model, &SensorPose { phase, ..*lidar }, 0)
            }
        };
        self.sensors.carried(lidar, self.bodies_of, pose)
    }

    /// LiDARs of a placement on the vehicle, nothing else around it.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(super) fn looking_out_of(
        &self,
        lidars: &[SensorPose],
    ) -> Result<LookingOut<'_>, UnknownSensor> {
        let each = lidars.iter().map(|lidar| self.looking_out(lidar));
        Ok(LookingOut(each.collect::<Result<_, _>>()?))
    }

    /// A LiDAR on the vehicle, nothing else around it.
    fn looking_out(&self, lidar: &SensorPose) -> Result<Looking<'_>, UnknownSensor> {
        let model = self.sensors.number(lidar)?;
        let beams = self.sensors.table(model).directions().len();
        let known = (0..beams).map(|_| AtomicU32::new(f32::NAN.to_bits())).collect();
        let pose = self.pose_of(model, lidar);
        Ok(self.looking(model, pose, EndRanges::Body { body: &self.body, known }))
    }

    fn looking<'a>(
        &'a self,
        model: usize,
        ego_from_sensor: Pose,
        ends: EndRanges<'a>,
    ) -> Looking<'a> {
        let (of, receiving) = (&self.sensors.models()[model], self.receiving.as_ref());
        let finder = self.finders[model].get_or_init(|| BeamFinder::new(of.table.directions()));
        let is_mirrored = self.is_mirrored();
        Looking { model: of, finder, ego_from_sensor, ends, receiving, is_mirrored }
    }

    /// Where a target stands that is to stand at a position of level ground: beside the own body, in a scene on free ground;
    /// `None` where there is no room.
    pub(super) fn standing(&self, target: &Target, at: [f64; 3]) -> Option<[f64; 3]> {
        let [x, y, z] = at;
        let side = if self.is_mirrored() { -y } else { y };
        let height = match self.surface.as_deref() {
            Some(SiteSurface { ground, wheels, .. }) => {
                ground.height(&self.body, wheels, target, [x, side])?
            }
            None => z,
        };
        self.has_room(target, [x, side, height]).then_some([x, y, height])
    }

    /// True if there is ground below a position, free or not; on level ground there always is.
    pub(super) fn has_ground(&self, [x, y, _]: [f64; 3]) -> bool {
        let side = if self.is_mirrored() { -y } else { y };
        let Some(SiteSurface { ground, wheels, .. }) = self.surface.as_deref() else { return true };
        ground.below(&self.body, wheels, [x, side]).0.is_some()
    }

    /// True if a target at a position stands beside the own body or above it.
    pub(crate) fn has_room(&self, target: &Target, at: [f64; 3]) -> bool {
        !self.plan.holds(target, at)
    }
}

/// `[lidars][targets]` as `[targets][lidars]`.
fn transposed(by_lidar: &[Vec<u32>], targets: usize) -> Vec<Vec<u32>> {
    (0..targets).map(|target| by_lidar.iter().map(|beams| beams[target]).collect()).collect()
}

impl Looking<'_> {
    /// Beams that meet a target first; counting ends at `enough`.
    fn beams(&self, PlacedTarget { target, at }: &PlacedTarget<'_>, enough: u32) -> u32 {
        let [x, y, z] = *at;
        let origin = DVec3::new(x, if self.is_mirrored { -y } else { y }, z);
        let table = &self.model.table;
        let range = table.range();
        let [low, high] = target.corners.map(DVec3::from);
        let (middle, radius) = (0.5 * (low + high) + origin, 0.5 * low.distance(high));
        let to = middle - self.ego_from_sensor.translation;
        let distance = to.length();
        if distance - radius > f64::from(range) {
            return 0;
        }
        let axis = self.ego_from_sensor.rotation.transpose() * to;
        let half_angle = if distance > radius { maths::asin(radius / distance) } else { PI };
        let ego_from_target = Pose { translation: origin, ..Pose::IDENTITY };
        let pose = DevicePose::from(&ego_from_target.inverse().compose(&self.ego_from_sensor));
        let from = beam_origin(&pose);
        let axis = axis.normalize_or(DVec3::X);
        let least = (maths::cos((half_angle + SLACK).min(PI)) - ROUNDING) as f32;
        let (axis_in_f32, mut count) = (axis.as_vec3(), 0);
        self.finder.near(axis, half_angle, |beam| {
            // Most beams of the cells pass the target's sphere.
            if Vec3::from(table.directions()[beam]).dot(axis_in_f32) < least {
                return true;
            }
            let direction = beam_direction(&pose, table.directions()[beam]);
            let hit = target.tree.closest_hit(&Ray::new(from, direction, range));
            let meets = hit.is_hit() && self.reaches(beam, hit.t);
            count += u32::from(meets && self.is_seen(target, &hit, direction));
            count < enough
        });
        count
    }

    /// True if enough light comes back from a hit.
    fn is_seen(&self, target: &Target, hit: &Hit, direction: Vec3) -> bool {
        let receiving = match self.receiving {
            Some(receiving) => receiving,
            None if target.returning_only => &IN_CLEAR_AIR,
            None => return true,
        };
        let normal = Vec3::from(target.normals[hit.prim as usize]);
        let cosine = normal.normalize_or_zero().dot(direction).abs();
        let (reflectance, metres) = (target.reflectance, f64::from(hit.t));
        receiving.sees(&self.model.response, reflectance, f64::from(cosine), metres)
    }

    /// True if nothing else ends a beam within `metres`.
    fn reaches(&self, beam: usize, metres: f32) -> bool {
        let ends = match &self.ends {
            EndRanges::Hits(hits) => end_of(&hits[beam]),
            EndRanges::Body { body, known } => {
                let mut end = f32::from_bits(known[beam].load(Ordering::Relaxed));
                if end.is_nan() {
                    let table = &self.model.table;
                    let (direction, range) = (table.directions()[beam], table.range());
                    end = end_of(&closest_hit_in(body, &self.ego_from_sensor, direction, range));
                    // Two threads that both look it up find the same bits.
                    known[beam].store(end.to_bits(), Ordering::Relaxed);
                }
                end
            }
        };
        metres < ends
    }
}

/// Metres at which a beam ends; infinity for one that meets nothing.
fn end_of(hit: &Hit) -> f32 {
    if hit.is_hit() { hit.t } else { f32::INFINITY }
}
