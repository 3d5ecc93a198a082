//! A LiDAR's beams of a frame, each cast from where the sensor is when it fires, on a device until it fails.

use std::sync::{Mutex, OnceLock};

use bytemuck::zeroed_vec;
use glam::DVec2;
use rayon::prelude::*;

use crate::fires::{BeamPlace, Fires};
use crate::rim::{RING, lane, rays_of};
use crate::stage::{AzimuthsInView, Motions, Stage};
use crate::station::{Faces, Station, SurfaceHit, swept_parts};
use lidar_cast::bvh::Hit;
use lidar_cast::cast::{
    Caster, Firing, FiringCaster, FiringWalk, Instructions, Rays, TraversalStack,
    closer_hits_of_beams,
};
use lidar_cast::geom::Pose;
use sightline_scene::vehicle::SensorModel;

pub(super) const COLUMNS_A_TASK: usize = 16;
/// Bytes of a beam in a [`Sweeper`].
pub(super) const BYTES_OF_RAYS: u64 = size_of::<Rays>() as u64;
/// Bytes of a beam in a [`FiredBeams`].
pub(super) const BYTES_OF_A_SWEEP: u64 =
    (size_of::<SurfaceHit>() + size_of::<[Hit; RING]>()) as u64;

/// A sensor model, ready to be swept.
pub(super) struct Sweeper {
    pub(super) model: SensorModel,
    /// Casts all beams at once; built on first use.
    whole: OnceLock<Caster>,
    pub(super) fires: Fires,
    /// Middle and rim of each beam, in the order in which beams fire; the middle alone of beams without width.
    pub(super) rays: Vec<Rays>,
    /// `None` for a list of directions.
    walk: Option<FiringWalk>,
    /// Largest angle between a ray of a beam and its middle, in radians.
    pub(super) width: f32,
}

/// A LiDAR's beams of a frame.
pub(super) struct FiredBeams {
    /// Surface of each beam, in firing order.
    pub surfaces: Vec<SurfaceHit>,
    /// One station for each firing; a single one where all beams fire at once.
    stations: Vec<Station>,
    /// Hits of the six rim rays of every beam, in firing order; `None` until they are cast.
    pub rims: Option<Vec<[Hit; RING]>>,
}

impl FiredBeams {
    /// Where beams of a firing are cast from.
    pub(crate) fn station(&self, firing: usize) -> &Station {
        station(&self.stations, firing)
    }
}

fn station(stations: &[Station], firing: usize) -> &Station {
    &stations[firing.min(stations.len() - 1)]
}

impl Sweeper {
    pub(crate) fn new(model: &SensorModel) -> Self {
        let table = &model.table;
        // A tenth more than half of the divergence, for rounding.
        let width = 1.1 * model.response.divergence.into_iter().fold(0.0, f64::max) / 2.0;
        let width = width as f32;
        let fires = Fires::new(table, model.response.divergence);
        Self {
            rays: rays_of(model, &fires),
            fires,
            walk: FiringWalk::new(table, width, Instructions::Best),
            whole: OnceLock::new(),
            width,
            model: model.clone(),
        }
    }

    /// Seconds from the beginning of a sweep until a beam fires.
    pub(crate) fn time_of(&self, place: &BeamPlace) -> f64 {
        place.firing as f64 / (self.fires.firings() as f64 * self.model.response.rate)
    }

    /// Casts all beams of a sensor in a frame that lasts `frame_time` seconds. If nothing moves or `rolling` is off, all are
    /// cast at once; else each column from the sensor's pose, and among the things, at its own time.
    pub(crate) fn sweep(
        &self,
        stage: &Stage,
        device: &ScanDevice,
        motions: &Motions,
        ego_from_sensor: &Pose,
        frame_time: f64,
        rolling: bool,
    ) -> FiredBeams {
        let moves = rolling && !motions.are_still() && self.fires.firings() > 1;
        let stations = if moves {
            self.stations(stage, motions, ego_from_sensor, frame_time)
        } else {
            let all = 0..stage.things.len();
            vec![Station::new(motions, all, ego_from_sensor, 0.0, self.reach())]
        };
        match &self.walk {
            Some(walk) if rolling && device.at_work().is_none() => {
                self.windows(stage, walk, stations)
            }
            _ => {
                let hits = if moves {
                    self.columns(stage, device, &stations)
                } else {
                    self.at_once(stage, device, &stations[0])
                };
                let mut surfaces = vec![SurfaceHit::none(0.0); hits.len()];
                let size = self.fires.before(COLUMNS_A_TASK);
                let tasks = hits.par_chunks(size).zip(surfaces.par_chunks_mut(size)).enumerate();
                tasks.for_each(|(k, (hits, surfaces))| {
                    self.meet(stage, &stations, k * COLUMNS_A_TASK, hits, surfaces);
                });
                FiredBeams { surfaces, stations, rims: None }
            }
        }
    }

    /// Metres that the sensor sees, and the angle that its beams are wide.
    fn reach(&self) -> [f32; 2] {
        [self.model.table.range(), self.width]
    }

    /// Hits of neighbouring columns that are cast together, with all rims.
    fn windows(&self, stage: &Stage, walk: &FiringWalk, stations: Vec<Station>) -> FiredBeams {
        let (range, beams) = (self.model.table.range(), self.rays.len());
        let together = walk.together();
        // Zeros take their memory when they are written over, window by window, side by side.
        let mut surfaces: Vec<SurfaceHit> = zeroed_vec(beams);
        let mut rims: Vec<[Hit; RING]> = zeroed_vec(beams);
        let size = together * self.fires.channels;
        let windows = surfaces.par_chunks_mut(size).zip(rims.par_chunks_mut(size)).enumerate();
        windows.for_each_init(Vec::new, |hits, (k, (surfaces, rims))| {
            let from = k * together;
            let steps = from..(from + together).min(self.fires.columns);
            let parts = swept_parts(stage, &stations, steps.clone());
            let rays = &self.rays[self.fires.before(from)..][..surfaces.len()];
            hits.resize(surfaces.len(), Hit::none(range));
            walk.closest_hits(steps, &parts, rays, range, hits, rims);
            self.meet(stage, &stations, from, hits, surfaces);
        });
        FiredBeams { surfaces, stations, rims: Some(rims) }
    }

    /// Surfaces by the hits of the beams that fire from some firing on.
    fn meet(
        &self,
        stage: &Stage,
        stations: &[Station],
        from: usize,
        hits: &[Hit],
        surfaces: &mut [SurfaceHit],
    ) {
        let size = self.fires.before(1);
        let rays = &self.rays[self.fires.before(from)..];
        let firings = hits.chunks(size).zip(surfaces.chunks_mut(size)).zip(rays.chunks(size));
        for (firing, ((hits, surfaces), rays)) in (from..).zip(firings) {
            let mut faces = Faces::new(station(stations, firing), stage);
            for ((surface, hit), rays) in surfaces.iter_mut().zip(hits).zip(rays) {
                *surface = faces.surface(lane(rays, 0), hit);
            }
        }
    }

    /// Hits of beams that all fire at once, in the order in which they would fire.
    fn at_once(&self, stage: &Stage, device: &ScanDevice, station: &Station) -> Vec<Hit> {
        let (range, directions) = (self.model.table.range(), self.model.table.directions());
        let by_device = || vec![station.firing(stage, directions.iter().copied())];
        let hits = device.closest_hits(range, by_device).unwrap_or_else(|| {
            let mut hits = vec![Hit::none(range); directions.len()];
            let whole = self.whole.get_or_init(|| Caster::new(&self.model.table));
            whole.closer_hits(&station.parts(stage), &mut hits);
            hits
        });
        let mut fired = hits.clone();
        for channel in 0..self.fires.channels {
            let row = self.fires.in_row(channel, 0..self.fires.columns);
            row.for_each(|place| fired[place.fired] = hits[place.beam]);
        }
        fired
    }

    /// Hits of beams that are cast one by one, in the order in which they fire.
    fn columns(&self, stage: &Stage, device: &ScanDevice, stations: &[Station]) -> Vec<Hit> {
        let size = self.fires.before(1);
        let by_device = || {
            let firings = stations.par_iter().zip(self.rays.par_chunks(size));
            let firing = firings.map(|(station, rays)| {
                station.firing(stage, rays.iter().map(|rays| lane(rays, 0)))
            });
            firing.collect()
        };
        let range = self.model.table.range();
        device.closest_hits(range, by_device).unwrap_or_else(|| {
            let mut hits = vec![Hit::none(range); self.rays.len()];
            let columns = hits.par_chunks_mut(size).zip(self.rays.par_chunks(size)).zip(stations);
            columns.with_min_len(COLUMNS_A_TASK).for_each_init(
                TraversalStack::new,
                |left, ((hits, rays), station)| {
                    let fired = rays.iter().map(|rays| lane(rays, 0));
                    closer_hits_of_beams(station.targets(stage), fired, hits, left);
                },
            );
            hits
        })
    }

    /// Stations of all firings: the sensor's pose, and the things in sight at its azimuth.
    fn stations(
        &self,
        stage: &Stage,
        motions: &Motions,
        ego_from_sensor: &Pose,
        frame_time: f64,
    ) -> Vec<Station> {
        let (firings, range) = (self.fires.firings(), f64::from(self.model.table.range()));
        let last = 1.0 / (self.model.response.rate * frame_time);
        let things = stage.things.iter().enumerate();
        let wide = self.fires.wide();
        let seen = things
            .map(|(k, t)| AzimuthsInView::of(motions, k, t, ego_from_sensor, last, range, wide));
        let seen: Vec<AzimuthsInView> = seen.collect();
        let station = |firing: usize| {
            let azimuth = DVec2::from_angle(self.fires.azimuth(firing));
            let visible = (0..seen.len()).filter(|&k| seen[k].at(azimuth));
            let share = last * firing as f64 / firings as f64;
            Station::new(motions, visible, ego_from_sensor, share, self.reach())
        };
        (0..firings).into_par_iter().with_min_len(COLUMNS_A_TASK).map(station).collect()
    }
}

/// GPU that casts rays in place of the CPU; none by default.
#[derive(Default)]
pub(super) struct ScanDevice {
    caster: Option<Mutex<Box<dyn FiringCaster>>>,
    /// Why it casts no more.
    failure: OnceLock<String>,
}

impl ScanDevice {
    /// A device at work.
    pub(crate) fn new(caster: Box<dyn FiringCaster>) -> Self {
        Self { caster: Some(Mutex::new(caster)), failure: OnceLock::new() }
    }

    /// The device, where it casts.
    fn at_work(&self) -> Option<&Mutex<Box<dyn FiringCaster>>> {
        self.caster.as_ref().filter(|_| self.failure.get().is_none())
    }

    /// Why the device casts no more, where it does not.
    pub(crate) fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Closest hits of all rays of firings, in order; none where the host has to cast them.
    ///
    /// `firings` are put together before the device is taken: a thread that holds the device must not take up other
    /// tasks of the pool, which may want the device too.
    pub(crate) fn closest_hits<'a>(
        &self,
        range: f32,
        firings: impl FnOnce() -> Vec<Firing<'a>>,
    ) -> Option<Vec<Hit>> {
        let caster = self.at_work()?;
        let firings = firings();
        // A thread that panicked in the driver leaves the lock poisoned.
        let found = match caster.lock() {
            Ok(mut caster) => caster.closest_hits(&firings, range),
            Err(_) => Err("another thread ended while it held the device".to_owned()),
        };
        found.map_err(|why| drop(self.failure.set(why))).ok()
    }
}
