//! A LiDAR's beams of a frame, each cast from where the sensor is when it fires.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::stage::{Motions, Seen, Stage};
use super::{NO_CLASS, NO_INSTANCE};
use crate::bvh::{Hit, NO_HIT};
use crate::cast::{
    Caster, Firing, FiringWalk, Instructions, Left, Part, Standing, Target, closer_hits_of_beams,
};
use crate::geom::Pose;
use crate::vehicle::{BeamGrid, BeamTable, SensorModel};

/// Pieces of a list of beams that fire one after the other.
const PIECES: usize = 1024;
/// Channels from which on beams that fire together go down the trees together; measured, see `docs/scans.md`.
const CHANNELS_TOGETHER: usize = 32;
/// Columns of one parallel task.
pub(super) const COLUMNS_A_TASK: usize = 16;
/// Metres by which a neighbour must lie off a beam's surface to lie behind an edge, and as a share of their
/// distance.
const APART: f32 = 0.05;
const APART_SHARE: f32 = 0.002;
/// A sensor model, ready to be swept.
pub(super) struct Sweeper {
    model: SensorModel,
    whole: Caster,
    /// None of a list of directions, and of few channels.
    walk: Option<FiringWalk>,
    fires: Fires,
    /// Largest angle between a ray of a beam and its middle, in radians.
    pub(super) width: f32,
    /// Farthest that a channel's azimuth lies beside its column's.
    wide: f64,
}

/// Beams that fire at the same time.
#[derive(Clone, Copy)]
enum Fires {
    /// One azimuth step of all channels; azimuths in radians.
    Column { channels: usize, steps: usize, start: f64, step: f64 },
    /// So many of a list that follow each other.
    Piece { size: usize, beams: usize },
}

/// Where the sensor is when a column fires, and what it may see then.
pub(super) struct Station {
    /// Takes the sensor's frame, as it is now, to that of the ego at the frame's time.
    pub start_from_sensor: Pose,
    things: Vec<Nearby>,
}

/// A thing that a sensor may see.
struct Nearby {
    /// Its number on the stage.
    thing: usize,
    /// Takes the sensor's frame to the thing's.
    pose: Pose,
    standing: Standing,
}

/// The grid of a table whose beams go down the trees together when they fire together.
pub(super) fn walked(table: &BeamTable) -> Option<&BeamGrid> {
    table.grid().filter(|grid| grid.channels.len() >= CHANNELS_TOGETHER)
}

/// What a beam meets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// Metres; as far as the range goes where it meets nothing.
    pub t: f32,
    pub prim: u32,
    pub class: u16,
    pub instance: u16,
    /// Cosine of the angle of incidence.
    pub incidence: f32,
    /// Normal and position in the ego frame at the frame's time.
    pub normal: Vec3,
    pub position: Vec3,
}

impl Surface {
    pub fn is_hit(&self) -> bool {
        self.prim != NO_HIT
    }
}

/// What lies between two neighbouring beams, as one of them sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Edge {
    /// No edge.
    None,
    /// The end of its own surface, behind which the other sees.
    InFront,
    /// The end of the other's surface, behind which it sees.
    Behind,
}

/// A LiDAR's beams of a frame.
pub(super) struct Sweep {
    /// By beam, in the order of the table.
    pub surfaces: Vec<Surface>,
    /// By firing; one where all fire at once.
    stations: Vec<Station>,
}

impl Sweep {
    /// Where the sensor stands at the frame's time.
    pub fn first(&self) -> &Station {
        &self.stations[0]
    }
}

impl Sweeper {
    pub fn new(model: &SensorModel) -> Self {
        let table = &model.table;
        let beams = table.directions().len();
        let fires = match table.grid() {
            Some(grid) => Fires::Column {
                channels: grid.channels.len(),
                steps: grid.steps,
                start: grid.start,
                step: grid.step,
            },
            None => Fires::Piece { size: beams.div_ceil(PIECES).max(1), beams },
        };
        let wide = table.grid().map_or(TAU, |grid| {
            grid.channels.iter().fold(1e-6, |wide: f64, (_, offset)| wide.max(offset.abs() + 1e-6))
        });
        let walk = walked(table).and_then(|grid| FiringWalk::new(grid, Instructions::Best));
        // A tenth more than half of the divergence, for rounding.
        let width = 1.1 * model.response.divergence.into_iter().fold(0.0, f64::max) / 2.0;
        let (whole, width, model) = (Caster::new(table), width as f32, model.clone());
        Self { whole, walk, fires, width, wide, model }
    }

    pub fn model(&self) -> &SensorModel {
        &self.model
    }

    /// Columns that follow each other in a channel, and channels.
    pub fn shape(&self) -> (usize, usize) {
        match self.fires {
            Fires::Column { channels, steps, .. } => (steps, channels),
            Fires::Piece { beams, .. } => (beams, 1),
        }
    }

    pub(super) fn firings(&self) -> usize {
        match self.fires {
            Fires::Column { steps, .. } => steps,
            Fires::Piece { size, beams } => beams.div_ceil(size),
        }
    }

    pub(super) fn firing_of(&self, beam: usize) -> usize {
        match self.fires {
            Fires::Column { steps, .. } => beam % steps,
            Fires::Piece { size, .. } => beam / size,
        }
    }

    /// Beams of a firing: the first, the step to the next, how many.
    pub(super) fn beams_of(&self, firing: usize) -> (usize, usize, usize) {
        match self.fires {
            Fires::Column { channels, steps, .. } => (firing, steps, channels),
            Fires::Piece { size, beams } => (firing * size, 1, size.min(beams - firing * size)),
        }
    }

    /// Beams of all firings before one.
    pub(super) fn fired_before(&self, firing: usize) -> usize {
        match self.fires {
            Fires::Column { channels, .. } => firing * channels,
            Fires::Piece { size, .. } => firing * size,
        }
    }

    /// Seconds from the beginning of a sweep until a beam fires.
    pub fn time_of(&self, beam: usize) -> f64 {
        self.firing_of(beam) as f64 / (self.firings() as f64 * self.model.response.rate)
    }

    /// Where a beam is cast from.
    pub fn station_of<'s>(&self, sweep: &'s Sweep, beam: usize) -> &'s Station {
        let firing = if sweep.stations.len() == 1 { 0 } else { self.firing_of(beam) };
        &sweep.stations[firing]
    }

    /// Casts all beams of a sensor in a frame that lasts `frame_time` seconds: at once where nothing moves or
    /// `rolling` is off, else column after column.
    pub fn sweep(
        &self,
        stage: &Stage,
        motions: &Motions,
        ego_from_sensor: &Pose,
        frame_time: f64,
        rolling: bool,
    ) -> Sweep {
        if rolling && !motions.are_still() && self.firings() > 1 {
            return self.columns(stage, motions, ego_from_sensor, frame_time);
        }
        let directions = self.model.table.directions();
        let station = self.station(stage, motions, 0..stage.things.len(), ego_from_sensor, 0.0);
        let range = self.model.table.range();
        let by_device = || vec![station.firing(stage, directions.iter().copied())];
        let hits = stage.device.closest_hits(range, by_device).unwrap_or_else(|| {
            let mut hits = vec![Hit::none(range); directions.len()];
            self.whole.closer_hits(&station.parts(stage), &mut hits);
            hits
        });
        let surface = |(&direction, hit)| station.surface(stage, direction, hit);
        let surfaces = directions.par_iter().zip(&hits).with_min_len(1024).map(surface).collect();
        Sweep { surfaces, stations: vec![station] }
    }

    /// Casts column after column, each from its own pose and with things where they are then.
    fn columns(
        &self,
        stage: &Stage,
        motions: &Motions,
        ego_from_sensor: &Pose,
        frame_time: f64,
    ) -> Sweep {
        let stations = self.stations(stage, motions, ego_from_sensor, frame_time);
        let fired = |firing: usize| {
            let (from, step, count) = self.beams_of(firing);
            self.model.table.directions()[from..].iter().step_by(step).take(count).copied()
        };
        let by_device = || {
            let all = stations.par_iter().enumerate();
            all.map(|(firing, station)| station.firing(stage, fired(firing))).collect()
        };
        let range = self.model.table.range();
        let hits = stage.device.closest_hits(range, by_device).unwrap_or_else(|| {
            let mut hits = vec![Hit::none(range); self.model.table.directions().len()];
            let columns = hits.par_chunks_mut(self.fired_before(1)).zip(&stations).enumerate();
            columns.with_min_len(COLUMNS_A_TASK).for_each_init(
                Left::new,
                |left, (firing, (hits, station))| {
                    self.cast_column(stage, station, firing, hits, left);
                },
            );
            hits
        });
        let mut surfaces = vec![Surface::none(range); hits.len()];
        let surface = |(beam, place): (usize, &mut Surface)| {
            let firing = self.firing_of(beam);
            let (from, step, _) = self.beams_of(firing);
            let hit = &hits[self.fired_before(firing) + (beam - from) / step];
            let direction = self.model.table.directions()[beam];
            *place = stations[firing].surface(stage, direction, hit);
        };
        surfaces.par_iter_mut().enumerate().with_min_len(1024).for_each(surface);
        Sweep { surfaces, stations }
    }

    /// Closer hits of the beams of a column, by the host.
    fn cast_column(
        &self,
        stage: &Stage,
        station: &Station,
        firing: usize,
        hits: &mut [Hit],
        left: &mut Left,
    ) {
        let (from, step, count) = self.beams_of(firing);
        let directions = &self.model.table.directions()[from..];
        if let Some(walk) = &self.walk {
            walk.closer_hits(firing, station.walked(stage), |k| directions[k * step], hits);
        }
        let fired = directions.iter().step_by(step).take(count).copied();
        closer_hits_of_beams(station.alone(stage, self.walk.is_some()), fired, hits, left);
    }

    /// Where the sensor is when each of its columns fires, and what that may see.
    fn stations(
        &self,
        stage: &Stage,
        motions: &Motions,
        ego_from_sensor: &Pose,
        frame_time: f64,
    ) -> Vec<Station> {
        let (firings, range) = (self.firings(), f64::from(self.model.table.range()));
        let last = 1.0 / (self.model.response.rate * frame_time);
        let things = stage.things.iter().enumerate();
        let seen = things.map(|(k, t)| Seen::of(motions, k, t, ego_from_sensor, last, range));
        let seen: Vec<Seen> = seen.collect();
        let station = |firing: usize| {
            let visible = |&k: &usize| match self.fires {
                Fires::Column { start, step, .. } => {
                    seen[k].at(start + firing as f64 * step, self.wide)
                }
                Fires::Piece { .. } => seen[k] != Seen::Never,
            };
            let share = last * firing as f64 / firings as f64;
            let visible = (0..seen.len()).filter(visible);
            self.station(stage, motions, visible, ego_from_sensor, share)
        };
        (0..firings).into_par_iter().with_min_len(COLUMNS_A_TASK).map(station).collect()
    }

    /// The sensor `share` of the way from one frame to the next, and the things that it may see.
    fn station(
        &self,
        stage: &Stage,
        motions: &Motions,
        visible: impl Iterator<Item = usize>,
        ego_from_sensor: &Pose,
        share: f64,
    ) -> Station {
        let ego = motions.ego.at(share);
        let sensor_from_world = ego.compose(ego_from_sensor).inverse();
        let (range, width) = (self.model.table.range(), self.width);
        let nearby = |thing: usize| {
            let sensor_from_thing = match motions.world_from_thing(thing, share) {
                Some(world_from_thing) => sensor_from_world.compose(&world_from_thing),
                None => ego_from_sensor.inverse().compose(&motions.ego_from_body(thing)),
            };
            let pose = sensor_from_thing.inverse();
            let standing = stage.things[thing].standing(&pose, range, width)?;
            Some(Nearby { thing, pose, standing })
        };
        Station {
            start_from_sensor: motions.ego.at(0.0).inverse().compose(&ego).compose(ego_from_sensor),
            things: visible.filter_map(nearby).collect(),
        }
    }
}

impl Nearby {
    fn target<'s>(&'s self, stage: &'s Stage) -> Target<'s> {
        stage.things[self.thing].as_target(&self.standing)
    }
}

impl Station {
    /// Trees as the sensor sees them, all of its beams together.
    fn parts<'s>(&self, stage: &'s Stage) -> Vec<Part<'s>> {
        let part = |nearby: &Nearby| stage.things[nearby.thing].as_part(&nearby.pose);
        self.things.iter().map(part).collect()
    }

    /// Rays that leave the sensor here, for a device.
    pub(super) fn firing<'s>(
        &'s self,
        stage: &'s Stage,
        rays: impl Iterator<Item = [f32; 3]>,
    ) -> Firing<'s> {
        let targets = self.things.iter().map(|nearby| nearby.target(stage));
        Firing { targets: targets.collect(), rays: rays.collect() }
    }

    /// The same for beams that fire together.
    pub(super) fn walked<'s>(&'s self, stage: &'s Stage) -> impl Iterator<Item = Part<'s>> {
        let parts = self.things.iter().map(|nearby| nearby.target(stage).part());
        parts.filter(FiringWalk::fits)
    }

    /// The same for single beams and bundles, but for trees that beams which fire together are `walked` through.
    pub(super) fn alone<'s>(
        &'s self,
        stage: &'s Stage,
        walked: bool,
    ) -> impl Iterator<Item = Target<'s>> {
        let targets = self.things.iter().map(|nearby| nearby.target(stage));
        targets.filter(move |target| !(walked && FiringWalk::fits(&target.part())))
    }

    /// The thing that a face belongs to, as a beam's target.
    pub(super) fn target_of<'s>(&'s self, stage: &'s Stage, prim: u32) -> Option<Target<'s>> {
        self.nearby(stage, prim).map(|nearby| nearby.target(stage))
    }

    /// The thing that a face belongs to.
    fn nearby(&self, stage: &Stage, prim: u32) -> Option<&Nearby> {
        let number = stage.thing_of(prim);
        self.things.iter().find(|nearby| nearby.thing == number)
    }

    /// The surface that a beam of the sensor's frame hits.
    fn surface(&self, stage: &Stage, direction: [f32; 3], hit: &Hit) -> Surface {
        let (surface, normal) = self.met(stage, direction, hit);
        let Some(normal) = normal else { return surface };
        let direction = DVec3::from(direction.map(f64::from));
        Surface {
            normal: (self.start_from_sensor.rotation * normal).as_vec3(),
            position: self.start_from_sensor.apply(direction * f64::from(hit.t)).as_vec3(),
            ..surface
        }
    }

    /// The same without normal and position in the ego frame, and the normal in the sensor's.
    pub(super) fn met(
        &self,
        stage: &Stage,
        direction: [f32; 3],
        hit: &Hit,
    ) -> (Surface, Option<DVec3>) {
        let seen = if hit.is_hit() { self.nearby(stage, hit.prim) } else { None };
        let Some(Nearby { thing, pose, .. }) = seen else { return (Surface::none(hit.t), None) };
        let thing = &stage.things[*thing];
        let direction = DVec3::from(direction.map(f64::from));
        let (class, normal) = thing.face(hit.prim);
        let normal = pose.rotation.transpose() * normal.as_dvec3();
        // Towards the sensor.
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let surface = Surface {
            t: hit.t,
            prim: hit.prim,
            class,
            instance: thing.instance,
            incidence: (-normal.dot(direction)).clamp(0.0, 1.0) as f32,
            normal: Vec3::ZERO,
            position: Vec3::NAN,
        };
        (surface, Some(normal))
    }
}

impl Surface {
    /// Whether an edge lies between two neighbouring beams, and on which side the nearer surface is: one meets
    /// nothing, or one lies in front of the other's plane and that one behind its own. Where each lies in
    /// front of the other's plane, or each behind it, they go over into each other in an inner or an outer corner.
    pub fn edge_to(&self, other: &Self) -> Edge {
        match (self.is_hit(), other.is_hit()) {
            (false, false) => Edge::None,
            (true, false) => Edge::InFront,
            (false, true) => Edge::Behind,
            (true, true) if self.prim == other.prim => Edge::None,
            (true, true) => {
                let between = other.position - self.position;
                let least = APART + APART_SHARE * self.t.min(other.t);
                // In front of each other's planes, in metres.
                let (there, here) = (self.normal.dot(between), -other.normal.dot(between));
                if there.abs().max(here.abs()) <= least || (there > 0.0) == (here > 0.0) {
                    Edge::None
                } else if here > 0.0 {
                    Edge::InFront
                } else {
                    Edge::Behind
                }
            }
        }
    }

    /// Nothing within `range` metres.
    fn none(range: f32) -> Self {
        Self {
            t: range,
            prim: NO_HIT,
            class: NO_CLASS,
            instance: NO_INSTANCE,
            incidence: 0.0,
            normal: Vec3::ZERO,
            position: Vec3::NAN,
        }
    }
}
