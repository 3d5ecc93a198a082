//! Scans of a scene from one placement, frame after frame.

use std::sync::Arc;

use rayon::prelude::*;

use crate::conditions::{self, Condition};
use crate::fires::Fires;
use crate::optics::Optics;
use crate::receiver::Receiver;
use crate::record::{Viewpoint, seen_share};
use crate::rim::Rims;
use crate::stage::{Motions, Stage};
use crate::station::Station;
use crate::sweep::{BYTES_OF_A_SWEEP, BYTES_OF_RAYS, ScanDevice, Sweeper};
use crate::{EGO_INSTANCE, Return, Scan, ScanError, ScanLidar, TrackedBox};
use lidar_cast::bvh::Bvh;
use lidar_cast::engine::{BackendError, EngineChoice, open_caster};
use lidar_cast::geom::Pose;
use lidar_cast::memory;
use sightline_scene::scene::{Scene, Track};
use sightline_scene::vehicle::{Placement, Sensors, UnknownSensor};

/// Beams of one parallel task: its hits fit into the second-level cache.
const BEAMS_A_TASK: usize = 2048;

/// How a rig is to scan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scanning {
    /// Geometry alone: every beam returns from its first surface, at once, without error; conditions are refused.
    pub ideal: bool,
    /// Seed of all random draws.
    pub seed: u64,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
}

/// A rig in a scene, ready to scan any frame of it.
///
/// Random draws depend only on seed, frame, LiDAR and beam. Frames come out bit-equal in any order and on any
/// number of threads.
pub struct Scanner<'a> {
    scene: &'a Scene,
    name: Arc<str>,
    classes: Arc<[String]>,
    placement: &'a Placement,
    sensors: Sensors,
    /// Number of each LiDAR's model.
    models: Vec<usize>,
    sweepers: Vec<Sweeper>,
    stage: Arc<Stage>,
    /// Casts in place of the host.
    device: ScanDevice,
    tracks: Vec<Track>,
    scanning: Scanning,
    optics: Optics,
}

/// Returns of neighbouring columns of a LiDAR, channel by channel: neighbours in the world, whose surfaces were met
/// together.
struct ColumnReturns {
    returns: Vec<Return>,
    /// End of each channel's returns.
    ends: Vec<usize>,
}

impl ColumnReturns {
    fn row(&self, channel: usize) -> &[Return] {
        let from = if channel == 0 { 0 } else { self.ends[channel - 1] };
        &self.returns[from..self.ends[channel]]
    }
}

/// Bytes that a scan of the placement takes at its peak: the rays of each model, all returns twice while they are
/// put in order, and hits and surfaces of the LiDARs that are swept side by side.
fn bytes_of_a_scan(sensors: &Sensors, placement: &Placement) -> Result<u64, UnknownSensor> {
    let beams = |model: usize| sensors.table(model).directions().len() as u64;
    let models = placement.lidars.iter().map(|pose| sensors.number(pose));
    let models = models.collect::<Result<Vec<usize>, _>>()?;
    let rays = (0..sensors.models().len()).map(|model| beams(model) * BYTES_OF_RAYS).sum::<u64>();
    let returns = models.iter().map(|&model| 2 * beams(model) * size_of::<Return>() as u64);
    let side_by_side = models.len().min(rayon::current_num_threads()) as u64;
    let most = models.iter().map(|&model| beams(model)).max().unwrap_or(0);
    Ok(rays + returns.sum::<u64>() + side_by_side * most * BYTES_OF_A_SWEEP)
}

impl<'a> Scanner<'a> {
    /// Finds every reason for which [`Self::new`] would fail, except memory for the trees, before any work is done.
    pub fn check(
        scene: &Scene,
        placement: &Placement,
        scanning: &Scanning,
    ) -> Result<(), ScanError> {
        Stage::check(scene)?;
        let actors = scene.tracks().len();
        if actors >= usize::from(EGO_INSTANCE) {
            return Err(ScanError::Refused(format!(
                "the scene `{}` has {actors} actors, a scan tells at most 65534 apart; leave some out",
                scene.name()
            )));
        }
        let sensors = scene.sensors()?;
        memory::check("the beams of a scan", bytes_of_a_scan(&sensors, placement)?)?;
        conditions::weather(&scanning.conditions)?;
        match scanning.conditions.first().filter(|_| scanning.ideal) {
            Some(condition) => Err(ScanError::Refused(format!(
                "the condition `{condition}` acts on beams, of which an ideal scan has the geometry alone; leave out one of \
                 the two"
            ))),
            None => Ok(()),
        }
    }

    /// Builds the trees of the scene, once for all frames.
    ///
    /// # Errors
    /// A scene without geometry, a sensor that the vehicle does not have, a condition given twice, or with an
    /// ideal scan, and more beams than memory holds.
    pub fn new(
        scene: &'a Scene,
        placement: &'a Placement,
        scanning: &Scanning,
    ) -> Result<Self, ScanError> {
        Self::check(scene, placement, scanning)?;
        Self::made(Arc::new(Stage::new(scene)?), scene, placement, scanning)
    }

    /// Makes a scanner with existing trees of the scene, which several placements share.
    ///
    /// # Panics
    /// Trees of another scene, as far as their number tells.
    pub fn on(
        stage: Arc<Stage>,
        scene: &'a Scene,
        placement: &'a Placement,
        scanning: &Scanning,
    ) -> Result<Self, ScanError> {
        Self::check(scene, placement, scanning)?;
        assert!(stage.is_of(scene), "the stage is not of the scene `{}`", scene.name());
        Self::made(stage, scene, placement, scanning)
    }

    fn made(
        stage: Arc<Stage>,
        scene: &'a Scene,
        placement: &'a Placement,
        scanning: &Scanning,
    ) -> Result<Self, ScanError> {
        let tracks = scene.tracks();
        let sensors = scene.sensors()?;
        let models = placement.lidars.iter().map(|pose| sensors.number(pose));
        let models = models.collect::<Result<Vec<usize>, _>>()?;
        let weather = conditions::weather(&scanning.conditions)?;
        let classes: Arc<[String]> = scene.classes().into();
        let sweepers: Vec<Sweeper> = sensors.models().iter().map(Sweeper::new).collect();
        Ok(Self {
            scene,
            name: scene.name().into(),
            placement,
            models,
            sweepers,
            stage,
            device: ScanDevice::default(),
            sensors,
            tracks,
            scanning: scanning.clone(),
            optics: Optics::new(scene, weather),
            classes,
        })
    }

    /// Lets the requested engine cast all rays from now on, and returns its name in a sentence. Scans have the same
    /// bits on all engines; the host casts again once a device fails.
    ///
    /// # Errors
    /// The requested device is missing or fails.
    pub fn cast_on(&mut self, choice: &EngineChoice) -> Result<Option<String>, BackendError> {
        let opened = open_caster(&self.trees(), choice)?;
        if let Some(caster) = opened.caster {
            self.device = ScanDevice::new(caster);
        }
        Ok(opened.note)
    }

    /// Trees of the world, each once.
    fn trees(&self) -> Vec<&Arc<Bvh>> {
        let mut trees: Vec<&Arc<Bvh>> = self.stage.trees().collect();
        trees.sort_by_key(|tree| Arc::as_ptr(tree).addr());
        trees.dedup_by_key(|tree| Arc::as_ptr(tree).addr());
        trees
    }

    /// A scanner whose rays `caster` casts, and its number of trees.
    #[cfg(test)]
    pub(super) fn cast_by(&mut self, caster: Box<dyn lidar_cast::cast::FiringCaster>) -> usize {
        self.device = ScanDevice::new(caster);
        self.trees().len()
    }

    /// Why the device that was to cast does so no more, where it failed: the host casts in its place.
    pub fn device_failure(&self) -> Option<&str> {
        self.device.failure()
    }

    /// Frames of the scene.
    pub fn frames(&self) -> usize {
        self.scene.frame_count()
    }

    /// Beams of one frame.
    pub fn beams(&self) -> usize {
        self.models.iter().map(|&model| self.sensors.table(model).directions().len()).sum()
    }

    /// All frames, one after the other.
    pub fn scans(&self) -> impl Iterator<Item = Scan> {
        (0..self.frames()).map(|frame| self.scan(frame))
    }

    /// A frame.
    ///
    /// # Panics
    /// A frame that the scene does not have.
    pub fn scan(&self, frame: usize) -> Scan {
        let motions = Motions::new(self.scene, &self.stage, frame);
        let poses = self.placement.lidars.iter().zip(&self.models);
        let poses: Vec<Pose> =
            poses.map(|(pose, &model)| self.sensors.ego_from_sensor(model, pose, frame)).collect();
        let lidars = 0..self.models.len();
        let returns = lidars.into_par_iter().map(|k| self.lidar(k, frame, &motions, &poses[k]));
        let returns: Vec<Vec<ColumnReturns>> = returns.collect();
        let rows = returns.iter().flat_map(|windows| {
            let channels = windows.first().map_or(0, |window| window.ends.len());
            (0..channels).flat_map(move |k| windows.iter().map(move |window| window.row(k)))
        });
        let mut scan = Scan {
            scene: self.name.clone(),
            frame,
            time: frame as f64 / self.scene.rate(),
            classes: self.classes.clone(),
            lidars: (0..poses.len()).map(|lidar| self.facts(lidar, &poses[lidar])).collect(),
            world_from_ego: self.scene.ego_pose(frame),
            returns: rows.collect::<Vec<&[Return]>>().concat(),
            boxes: self.boxes(frame),
        };
        scan.count_points();
        scan
    }

    /// Finds how much of each box in a scan of this scanner its rig sees ([`TrackedBox::visible`]).
    ///
    /// Sample points lie on the faces that face a LiDAR, and count by area. A point is seen if a straight line to it
    /// from one of these LiDARs is free and no longer than that LiDAR's range. Where its beams point does not count.
    pub fn look_at_boxes(&self, scan: &mut Scan) {
        let motions = Motions::new(self.scene, &self.stage, scan.frame);
        let station = |lidar: &ScanLidar| {
            let all = 0..self.stage.things.len();
            Station::new(&motions, all, &lidar.ego_from_sensor, 0.0, [lidar.range, 0.0])
        };
        let stations: Vec<Station> = scan.lidars.iter().map(station).collect();
        let eye = |(station, lidar): (_, &ScanLidar)| Viewpoint {
            ego_from_sensor: lidar.ego_from_sensor,
            range: lidar.range,
            around: Station::firing(station, &self.stage, std::iter::empty()),
        };
        let eyes: Vec<Viewpoint<'_>> = stations.iter().zip(&scan.lidars).map(eye).collect();
        let look = |tracked: &mut TrackedBox| {
            tracked.visible = Some(seen_share(&self.stage, &eyes, tracked));
        };
        scan.boxes.par_iter_mut().for_each(look);
    }

    /// Returns of one LiDAR, some columns after others.
    fn lidar(
        &self,
        lidar: usize,
        frame: usize,
        motions: &Motions,
        ego_from_sensor: &Pose,
    ) -> Vec<ColumnReturns> {
        let sweeper = &self.sweepers[self.models[lidar]];
        let frame_time = 1.0 / self.scene.rate();
        let rolling = !self.scanning.ideal;
        let sweep =
            sweeper.sweep(&self.stage, &self.device, motions, ego_from_sensor, frame_time, rolling);
        let rims =
            if rolling { Rims::meet(sweeper, &self.stage, &self.device, &sweep) } else { None };
        let receiver = Receiver {
            sweeper,
            sweep: &sweep,
            rims: rims.as_ref(),
            optics: &self.optics,
            lidar: lidar as u16,
            ideal: self.scanning.ideal,
            seed: self.scanning.seed,
            frame,
        };
        let Fires { columns, channels, .. } = sweeper.fires;
        let together = (BEAMS_A_TASK / channels).max(1);
        let windows = (0..columns.div_ceil(together)).into_par_iter().map(|window| {
            let from = window * together;
            let columns = from..(from + together).min(columns);
            let returns = Vec::with_capacity(channels * columns.len());
            let mut window = ColumnReturns { returns, ends: Vec::with_capacity(channels) };
            for channel in 0..channels {
                for beam in sweeper.fires.in_row(channel, columns.clone()) {
                    receiver.returns(&beam, |found| window.returns.push(found));
                }
                window.ends.push(window.returns.len());
            }
            window
        });
        windows.collect()
    }

    fn facts(&self, lidar: usize, ego_from_sensor: &Pose) -> ScanLidar {
        let model = self.models[lidar];
        let Fires { columns, channels, .. } = self.sweepers[model].fires;
        let model = &self.sensors.models()[model];
        ScanLidar {
            model: model.name.to_string(),
            ego_from_sensor: *ego_from_sensor,
            ego_from_mount: self.placement.lidars[lidar].ego_from_sensor(),
            channels: channels as u32,
            columns: columns as u32,
            range: model.table.range(),
        }
    }

    /// Boxes of the actors in a frame, no points counted yet.
    fn boxes(&self, frame: usize) -> Vec<TrackedBox> {
        let ego_from_world = self.scene.ego_pose(frame).inverse();
        let boxed = |(actor, track): (usize, &Track)| {
            let glide = self.scene.actor_glide(actor, frame);
            let (here, next) = (glide.at(0.0), glide.at(1.0));
            let mut ego_from_box = ego_from_world.compose(&here);
            ego_from_box.translation = ego_from_box.apply(track.center);
            TrackedBox {
                instance: actor as u16 + 1,
                name: track.name.clone(),
                kind: track.kind,
                class: track.class,
                ego_from_box,
                size: track.size,
                velocity: (next.apply(track.center) - here.apply(track.center)) * self.scene.rate(),
                points: 0,
                visible: None,
            }
        };
        let boxes = self.tracks.iter().enumerate().filter(|(_, track)| track.size.length() > 0.0);
        boxes.map(boxed).collect()
    }
}
