//! The reference of all settings: casting, coverage and sums with an `f64` for every number.

use glam::DVec3;
use rayon::prelude::*;

use super::exact_tree::ExactTree;
use super::exact_walk::{ROUNDING, coordinates, mark};
use super::exact_worth::Worth;
use super::{ChartError, Fidelity, World, merge_vertices};
use crate::geom::TriangleSoup;
use crate::maths;
use crate::problem::{Content, KINDS, NEAR_KIND, Tally};
use crate::psog::{ENTROPY_ONE, Roi};
use crate::scene::{EgoBody, Scene};
use crate::vehicle::{Lidar, Placement, SensorPose, Sensors, UnknownSensor};
use lidar_cast::grid::HIT_PUSH;

/// The scorer that others are compared with: every number from the pose to the sum is an `f64`.
///
/// Casting, walking and summing are written for themselves and share no code with the backends.
/// Triangles are those of [`Scene::frame`], which rounds corners to `f32` once (4 µm at 50 m).
#[derive(Debug, Clone)]
pub(super) struct Exact {
    roi: Roi,
    /// Where the models fire, and their names.
    sensors: Sensors,
    /// Directions of each model.
    directions: Vec<Vec<DVec3>>,
    /// Range of each model in metres.
    ranges: Vec<f64>,
    /// Number of each frame in the scene, at least one.
    numbers: Vec<usize>,
    /// One tree a frame; empty where beams run through all.
    frames: Vec<ExactTree>,
    content: Content,
    /// Information of the voxels occupied in some frame.
    worth: Worth,
}

/// The parts of a scene where they stand in a frame, in the ego frame.
fn standing(parts: &[TriangleSoup], scene: &Scene, t: usize) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    for (part, pose) in parts.iter().zip(scene.part_poses(t)) {
        let mut part = part.clone();
        for vertex in &mut part.vertices {
            *vertex = pose.apply(DVec3::from(vertex.map(f64::from))).as_vec3().to_array();
        }
        soup.append(&part);
    }
    soup
}

impl Exact {
    /// The scorer of a scene at a setting.
    ///
    /// # Errors
    /// As [`World::psog`].
    pub(super) fn new(world: &mut World, fidelity: &Fidelity) -> Result<Self, ChartError> {
        let psog = world.psog(fidelity.voxel)?;
        let scene = world.scene();
        let cell = fidelity.detail * psog.roi().voxel()[0];
        let frames = if fidelity.through { Vec::new() } else { world.frames(fidelity) };
        let numbers = if frames.is_empty() { vec![0] } else { frames.clone() };
        let lidars = scene.lidars();
        let merged = (0..scene.part_count()).filter(|_| cell > 0.0);
        let merged: Vec<_> = merged.map(|k| merge_vertices(&scene.part(k), cell)).collect();
        let trees = frames.into_par_iter().map(|t| {
            let whole = || scene.frame(t, EgoBody::Include);
            let soup = if merged.is_empty() { whole() } else { standing(&merged, scene, t) };
            ExactTree::build(&soup)
        });
        Ok(Self {
            roi: *psog.roi(),
            sensors: scene.thinned_sensors(fidelity.azimuth)?,
            directions: lidars.iter().map(|lidar| directions(lidar, fidelity.azimuth)).collect(),
            ranges: lidars.iter().map(|lidar| lidar.range()).collect(),
            numbers,
            frames: trees.collect(),
            worth: Worth::new(scene, &psog),
            content: world.content(&psog),
        })
    }

    /// The classes and totals that the tallies belong to.
    pub(super) fn content(&self) -> &Content {
        &self.content
    }

    /// Frames over which a tally is summed.
    pub(super) fn frame_count(&self) -> usize {
        self.frames.len().max(1)
    }

    /// Tallies of `placements` in order, summed over frames, each entropy sum rounded once at the end.
    ///
    /// Counts by class, shares of single LiDARs and hits stay 0: no objective needs them.
    ///
    /// # Errors
    /// A LiDAR of a model that the vehicle does not have.
    pub(super) fn tallies(&self, placements: &[Placement]) -> Result<Vec<Tally>, UnknownSensor> {
        let words = self.roi.voxel_count().div_ceil(64) as usize;
        let tally = |room: &mut Room, placement: &Placement| {
            let models = placement.lidars.iter().map(|pose| self.sensors.number(pose));
            let models = models.collect::<Result<Vec<usize>, _>>()?;
            let mut tally = Tally::zero(self.content.set_count(), placement.lidars.len());
            let mut entropy = [0.0; KINDS];
            for frame in 0..self.frame_count() {
                for (pose, &model) in placement.lidars.iter().zip(&models) {
                    self.cover(pose, model, frame, room);
                }
                let [covered, occupied] = self.worth.take(&mut room.bitmap, &mut entropy);
                tally.covered += covered;
                tally.covered_nonzero += occupied;
            }
            let beams: usize = models.iter().map(|&model| self.directions[model].len()).sum();
            tally.beams = (beams * self.frame_count()) as u64;
            let mut units = [ENTROPY_ONE; KINDS];
            units[NEAR_KIND] = self.content.entropy_total()[NEAR_KIND] as f64;
            tally.entropy =
                std::array::from_fn(|kind| (entropy[kind] * units[kind]).round() as u64);
            Ok(tally)
        };
        let room = || Room { bitmap: vec![0; words], beams: Vec::new(), stack: Vec::new() };
        placements.par_iter().map_init(room, tally).collect()
    }

    /// Bytes of trees and entropies, and of the bitmap of one placement.
    pub(super) fn bytes(&self) -> u64 {
        let trees: u64 = self.frames.iter().map(ExactTree::bytes).sum();
        trees + self.worth.bytes() + self.roi.voxel_count().div_ceil(8)
    }

    /// Triangles, a mean over frames.
    pub(super) fn triangles(&self) -> u64 {
        let all: usize = self.frames.iter().map(ExactTree::triangle_count).sum();
        (all / self.frame_count()) as u64
    }

    /// Marks the voxels that the beams of a sensor of a model traverse in a frame, up to and including that of their
    /// hit.
    fn cover(&self, pose: &SensorPose, model: usize, frame: usize, room: &mut Room) {
        let pose = self.sensors.ego_from_sensor(model, pose, self.numbers[frame]);
        let (tree, range) = (self.frames.get(frame), self.ranges[model]);
        let Room { bitmap, beams, stack } = room;
        beams.clear();
        beams.extend(self.directions[model].iter().map(|&direction| {
            let direction = snapped(pose.rotation * direction);
            let hit = tree.and_then(|t| t.closest(pose.translation, direction, range, stack));
            (direction, hit.map_or(range, |t| t + HIT_PUSH))
        }));
        mark(&self.roi, coordinates(&self.roi, pose.translation), beams, bitmap);
    }
}

/// Work buffers of one thread.
struct Room {
    /// Voxels covered in a frame, all 0 between two.
    bitmap: Vec<u64>,
    /// Directions of a sensor's beams and where they end, in metres.
    beams: Vec<(DVec3, f64)>,
    /// Of [`ExactTree::closest`].
    stack: Vec<(f64, usize)>,
}

fn snapped(direction: DVec3) -> DVec3 {
    DVec3::from(direction.to_array().map(|d| if d.abs() < ROUNDING { 0.0 } else { d }))
}

/// Unit directions in the sensor frame; see [`crate::vehicle::BeamTable::spinning`].
fn directions(lidar: &Lidar, divisor: u32) -> Vec<DVec3> {
    let lidar = lidar.thinned(divisor);
    let sector = lidar.sector();
    match &lidar {
        Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps: steps, .. } => {
            let channels = elevations.iter().zip(azimuth_offsets);
            let beams = channels.flat_map(|(elevation, offset)| {
                let (sin_e, cos_e) = maths::sin_cos(elevation.to_radians());
                (0..*steps).map(move |j| {
                    let turn = match sector {
                        Some([start, step]) => (start + step * f64::from(j)).to_radians(),
                        None => std::f64::consts::TAU * f64::from(j) / f64::from(*steps),
                    };
                    let (sin_a, cos_a) = maths::sin_cos(turn + offset.to_radians());
                    DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e)
                })
            });
            beams.collect()
        }
        Lidar::Directions { directions, .. } => {
            directions.iter().map(|&d| DVec3::from(d)).collect()
        }
    }
}
