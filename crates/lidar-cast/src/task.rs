//! All that is fixed while placements vary: frames, voxels and their worth, sensor models.

mod content;
mod world;

use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use crate::bvh::Hit;
use crate::geom::Pose;
use crate::grid::Roi;
use crate::sensor::Sensors;

pub use content::{Content, RequiredArea, Requirement, StageTimes, Tally};
pub use world::{
    DevicePose, Entropy, Frame, HIT_PUSH, Instance, KINDS, OccupiedVoxel, REPEATS, SensorBatch,
    World, beam_direction, beam_origin,
};
pub(crate) use world::{NO_CROSSING, TINY_COMPONENT};

/// `wanted` of `count` frames, spread evenly from the first on; all of them if `None`.
pub fn spread(count: usize, wanted: Option<u32>) -> Vec<usize> {
    let wanted = wanted.map_or(count, |wanted| (wanted as usize).min(count));
    (0..wanted).map(|k| k * count / wanted).collect()
}

/// How much of a scene a task models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Modelled {
    /// Voxels of the region of interest.
    pub voxels: u64,
    /// Voxels occupied in some frame of the P-SOG; empty ones have no stored data.
    pub occupied_voxels: u64,
    /// Occupied voxels with an entropy above 0.
    pub informative_voxels: u64,
    /// Frames that beams are cast into.
    pub frames: usize,
    /// Frames whose geometry differs from every earlier frame's. Repeats are not cast again.
    pub distinct_frames: usize,
    /// Triangles of a frame, a mean.
    pub triangles: u64,
    /// Bytes of entropies and classes, which only occupied voxels have.
    pub voxel_bytes: u64,
    /// Bytes of one sensor's coverage in one frame: a bit a voxel, empty ones included, since covered
    /// voxels are counted.
    pub bitmap_bytes: u64,
    /// Bytes of triangles and trees, each thing once, and of their poses in the frames.
    pub tree_bytes: u64,
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

impl std::fmt::Display for Modelled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} of {} voxels are occupied in some frame and stored ({}), {} of them have an entropy; \
             {} frame{}, {} distinct and cast, of {} triangles ({}); {} a sensor and frame for what it \
             covers",
            self.occupied_voxels,
            self.voxels,
            mebibytes(self.voxel_bytes),
            self.informative_voxels,
            self.frames,
            if self.frames == 1 { "" } else { "s" },
            self.distinct_frames,
            self.triangles,
            mebibytes(self.tree_bytes),
            mebibytes(self.bitmap_bytes)
        )
    }
}

/// All that is fixed while placements vary: sensor models, voxels, their worth, and the geometry.
#[derive(Debug, Clone)]
pub struct Task {
    roi: Roi,
    content: Arc<Content>,
    sensors: Sensors,
    world: Arc<World>,
    /// Number of each frame in the scene, which free phases depend on.
    numbers: Vec<usize>,
    ends_at_hits: bool,
    /// Weather or crosstalk that keeps beams from returning; `None` in clear air.
    air: Option<Arc<dyn Air>>,
}

/// Weather or crosstalk that keeps beams from returning.
pub trait Air: std::fmt::Debug + Send + Sync {
    /// Shortens the beams of a batch in frame `number`; `hits` belong to its sensors at
    /// `ego_from_sensors`.
    /// Random draws depend only on the batch's seed, `number`, the sensor's model and the beam.
    fn dim(
        &self,
        batch: &SensorBatch<'_>,
        ego_from_sensors: &[Pose],
        frame: &Frame,
        number: usize,
        hits: &mut [Hit],
    );

    /// Mean share of the light that passes to a surface so many metres away and back.
    fn passed(&self, metres: f64) -> f64;
}

impl Task {
    /// Puts the parts together.
    ///
    /// `world` holds the frames, none for a scene without geometry; equal frames are cast once and weigh as
    /// many. With `ends_at_hits` beams end at the first surface of each frame (coverage `first-hit`);
    /// otherwise they run on through all (`through`), and there is one frame to evaluate, whatever the
    /// geometry.
    pub fn new(
        roi: Roi,
        content: impl Into<Arc<Content>>,
        sensors: impl Into<Sensors>,
        world: impl Into<World>,
        ends_at_hits: bool,
    ) -> Self {
        let (content, world) = (content.into(), Arc::new(world.into()));
        let ends_at_hits = ends_at_hits && !world.frames().is_empty();
        let (sensors, numbers) = (sensors.into(), (0..world.frames().len()).collect());
        Self { roi, content, sensors, world, numbers, ends_at_hits, air: None }
    }

    /// A copy with other sensor models.
    pub fn with_sensors(self, sensors: impl Into<Sensors>) -> Self {
        Self { sensors: sensors.into(), ..self }
    }

    /// A copy with other information in its voxels.
    pub fn with_content(self, content: impl Into<Arc<Content>>) -> Self {
        Self { content: content.into(), ..self }
    }

    /// A copy in weather or crosstalk: beams that do not return cover less.
    pub fn in_air(self, air: Arc<dyn Air>) -> Self {
        Self { air: Some(air), ..self }
    }

    /// Weather or crosstalk that keeps beams from returning; `None` in clear air.
    pub fn air(&self) -> Option<&Arc<dyn Air>> {
        self.air.as_ref()
    }

    /// A copy whose content also counts the voxels of required areas.
    pub fn with_areas(self, required: &[Requirement]) -> Self {
        let content = Content::clone(&self.content).with_areas(&self.roi, required);
        Self { content: Arc::new(content), ..self }
    }

    /// A copy whose content counts no required area.
    pub fn without_areas(self) -> Self {
        let content = Content::clone(&self.content).without_areas();
        Self { content: Arc::new(content), ..self }
    }

    /// A copy with the numbers of its frames in the scene.
    pub fn numbered(self, frames: &[usize]) -> Self {
        Self { numbers: frames.to_vec(), ..self }
    }

    /// A copy over some of its frames; trees and content are shared.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn over(&self, frames: &[usize]) -> Self {
        let ends_at_hits = self.ends_at_hits && !frames.is_empty();
        let numbers = frames.iter().map(|&frame| self.numbers[frame]).collect();
        Self { world: Arc::new(self.world.over(frames)), numbers, ends_at_hits, ..self.clone() }
    }

    /// A copy with mirrored sensors: a mirrored placement here has the scores of the placement itself in
    /// the scene mirrored at the plane y = 0. World and content are shared.
    pub fn mirrored(&self) -> Self {
        let content = match self.content.areas() {
            [] => self.content.clone(),
            areas => {
                let image = |area: &RequiredArea| area.required.mirrored();
                let images: Vec<Requirement> = areas.iter().map(image).collect();
                let content = Content::clone(&self.content).without_areas();
                Arc::new(content.with_areas(&self.roi, &images))
            }
        };
        Self { sensors: self.sensors.mirrored(), content, ..self.clone() }
    }

    /// The voxels.
    pub fn roi(&self) -> &Roi {
        &self.roi
    }

    /// Entropies, classes and required areas of the voxels.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// Models that sensors are of.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Number of a frame in the scene.
    pub fn number_of(&self, frame: usize) -> usize {
        self.numbers.get(frame).copied().unwrap_or(frame)
    }

    /// Range in metres that reaches all of the grid: the longest sensor's, or twice the grid's diagonal.
    pub fn far_range(&self) -> f32 {
        Self::far_range_of(&self.roi, self.sensors.longest_range())
    }

    /// See [`Self::far_range`], of a grid and sensors of `range` metres.
    pub fn far_range_of(roi: &Roi, range: f32) -> f32 {
        let [min, max] = [roi.min(), roi.max()].map(DVec3::from);
        range.max(2.0 * min.distance(max) as f32)
    }

    /// Frames over which a tally is summed.
    pub fn frame_count(&self) -> usize {
        if self.ends_at_hits { self.world.frames().len() } else { 1 }
    }

    /// First frame with the geometry of `frame`, sensors at equal phases, and the bodies that carry them in equal poses: both
    /// frames have equal coverage.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn first_equal(&self, frame: usize) -> usize {
        match self.ends_at_hits {
            true if self.sensors.has_free_phase() => frame,
            true => {
                let first = self.world.first_equal(frame);
                let numbers = [frame, first].map(|frame| self.number_of(frame));
                if self.sensors.stand_alike(numbers) { first } else { frame }
            }
            false => 0,
        }
    }

    /// Frames to cast into, and how many each stands for; together these are [`Self::frame_count`].
    pub fn distinct_frames(&self) -> Vec<(usize, u64)> {
        let mut weights = vec![0; self.frame_count()];
        (0..weights.len()).for_each(|frame| weights[self.first_equal(frame)] += 1);
        weights.into_iter().enumerate().filter(|(_, weight)| *weight > 0).collect()
    }

    /// The coverage as the scene file spells it.
    pub fn coverage(&self) -> &'static str {
        if self.ends_at_hits { "first-hit" } else { "through" }
    }

    /// True if beams end at surfaces.
    pub fn ends_at_hits(&self) -> bool {
        self.ends_at_hits
    }

    /// The frames with their geometry.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Frames that have geometry to cast into.
    pub fn geometry_frame_count(&self) -> usize {
        self.world.frames().len()
    }

    /// Geometry of a frame, if the scene has any.
    pub fn geometry(&self, frame: usize) -> Option<&Frame> {
        self.world.frames().get(frame).map(|frame| &**frame)
    }

    /// The geometry at which beams end in a frame; `None` when they end at nothing.
    pub fn ends(&self, frame: usize) -> Option<&Frame> {
        if self.ends_at_hits { self.geometry(frame) } else { None }
    }

    /// How much of the scene is modelled.
    pub fn modelled(&self) -> Modelled {
        let occupied = self.content.occupied();
        let nats = [Entropy::Classes, Entropy::Detection, Entropy::Occupancy];
        let informative =
            occupied.iter().filter(|voxel| nats.iter().any(|kind| kind.of(&voxel.entropy) > 0));
        let frames = if self.ends_at_hits { self.world.frames() } else { &[] };
        let triangles: u64 = frames.iter().map(|frame| frame.triangle_count()).sum();
        Modelled {
            voxels: self.roi.voxel_count(),
            occupied_voxels: occupied.len() as u64,
            informative_voxels: informative.count() as u64,
            frames: self.frame_count(),
            distinct_frames: self.distinct_frames().len(),
            triangles: triangles / self.frame_count() as u64,
            voxel_bytes: self.content.bytes(),
            bitmap_bytes: self.roi.voxel_count().div_ceil(64) * 8,
            tree_bytes: self.world.bytes(),
        }
    }

    /// Bytes held by the parts.
    pub fn bytes(&self) -> u64 {
        self.content.bytes() + self.world.bytes()
    }
}
