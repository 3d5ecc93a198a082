//! What is asked, ready to be computed: frames, voxels and their entropies, sensor models.

pub(crate) mod assemble;
mod batch;
pub(crate) mod beam;
pub(crate) mod pose;
mod tally;
mod world;

pub use batch::SensorBatch;
pub(crate) use beam::beam_direction;
pub(crate) use beam::beam_origin;
pub(crate) use pose::DevicePose;
pub use pose::OccupiedVoxel;
pub(crate) use pose::{HIT_PUSH, NO_CROSSING, TINY_COMPONENT};
pub use tally::{StageTimes, Tally};
pub use world::{Frame, Instance, World};

use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use crate::memory::OutOfMemory;
use crate::psog::Roi;
use crate::vehicle::{Constraints, Requirement, Sensors};

/// What must be seen, and its voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct Area {
    /// As the vehicle says.
    pub required: Requirement,
    /// Number of its voxels.
    pub voxels: u64,
}

/// What covering a voxel is worth: the occupied voxels of a P-SOG with their entropies and classes.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    classes: Vec<String>,
    occupied: Vec<OccupiedVoxel>,
    /// Linear indices, class after class.
    class_voxels: Vec<u32>,
    /// Where each class begins in `class_voxels`, then each area, and the end.
    class_starts: Vec<u32>,
    areas: Vec<Area>,
    entropy_total: [u64; 3],
    has_detection: bool,
}

impl Content {
    /// From occupied voxels in rising order and, for each class, the voxels in which it occurs.
    pub fn new(
        classes: Vec<String>,
        occupied: Vec<OccupiedVoxel>,
        voxels_by_class: &[Vec<u32>],
        has_detection: bool,
    ) -> Self {
        let mut class_starts = vec![0];
        for voxels in voxels_by_class {
            class_starts.push(class_starts[class_starts.len() - 1] + voxels.len() as u32);
        }
        let mut entropy_total = [0; 3];
        for voxel in &occupied {
            for (sum, entropy) in entropy_total.iter_mut().zip(voxel.entropy) {
                *sum += u64::from(entropy);
            }
        }
        let class_voxels = voxels_by_class.concat();
        let areas = Vec::new();
        Self { classes, occupied, class_voxels, class_starts, areas, entropy_total, has_detection }
    }

    /// The same, and what must be seen: the voxels whose middle lies in each area.
    pub fn with_areas(mut self, roi: &Roi, required: &[Requirement]) -> Self {
        let ([_, ny, nz], min, voxel) = (roi.shape(), roi.min(), roi.voxel());
        let middle = |k: usize, i: u32| min[k] + (f64::from(i) + 0.5) * voxel[k];
        for requirement in required {
            let before = self.class_voxels.len();
            let [low, high] = requirement.inside;
            let [xs, ys, zs] = [0, 1, 2].map(|k| {
                let within = |i: &u32| (low[k]..high[k]).contains(&middle(k, *i));
                (0..roi.shape()[k]).filter(within).collect::<Vec<u32>>()
            });
            for &i in &xs {
                for &j in &ys {
                    let column = zs.iter().filter(|&&k| {
                        requirement.contains([middle(0, i), middle(1, j), middle(2, k)])
                    });
                    self.class_voxels.extend(column.map(|&k| (i * ny + j) * nz + k));
                }
            }
            let voxels = (self.class_voxels.len() - before) as u64;
            self.areas.push(Area { required: requirement.clone(), voxels });
            self.class_starts.push(self.class_voxels.len() as u32);
        }
        self
    }

    /// The same with another entropy of all classes in some occupied voxels: `more` says how much, in fixed
    /// point, the voxel of a linear index gains.
    pub fn with_more_entropy(&self, more: impl Fn(u32) -> i64) -> Self {
        let mut content = self.clone();
        for voxel in &mut content.occupied {
            let sum = i64::from(voxel.entropy[0]) + more(voxel.index);
            voxel.entropy[0] = sum.clamp(0, i64::from(u32::MAX)) as u32;
        }
        let all = content.occupied.iter().map(|voxel| u64::from(voxel.entropy[0]));
        content.entropy_total[0] = all.sum();
        content
    }

    /// The same with every area mirrored at the plane y = 0.
    fn with_mirrored_areas(&self, roi: &Roi) -> Self {
        let mirrored: Vec<Requirement> =
            self.areas.iter().map(|area| area.required.mirrored()).collect();
        let mut content = self.clone();
        content.class_starts.truncate(self.classes.len() + 1);
        content.class_voxels.truncate(content.class_starts[self.classes.len()] as usize);
        content.areas.clear();
        content.with_areas(roi, &mirrored)
    }

    /// What must be seen.
    pub fn areas(&self) -> &[Area] {
        &self.areas
    }

    /// Sets of voxels whose covered ones are counted: classes, then areas.
    pub fn set_count(&self) -> usize {
        self.class_starts.len() - 1
    }

    /// Class names by class id.
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// Voxels occupied in at least one frame, in rising order.
    pub fn occupied(&self) -> &[OccupiedVoxel] {
        &self.occupied
    }

    /// Linear indices of the voxels in which a class occurs in at least one frame, rising; behind the
    /// classes, those of each area.
    pub fn voxels_of_class(&self, class: usize) -> &[u32] {
        let range = self.class_starts[class] as usize..self.class_starts[class + 1] as usize;
        &self.class_voxels[range]
    }

    /// Fixed-point Σ H over all voxels: all classes, detection target against the rest, occupied or
    /// not.
    pub fn entropy_total(&self) -> [u64; 3] {
        self.entropy_total
    }

    /// Whether any class counts as detection target.
    pub fn has_detection(&self) -> bool {
        self.has_detection
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn class_voxels(&self) -> &[u32] {
        &self.class_voxels
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn class_starts(&self) -> &[u32] {
        &self.class_starts
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.occupied.as_slice()) + size_of_val(self.class_voxels.as_slice())) as u64
    }
}

/// Why parts do not make a problem.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum ProblemError {
    /// The P-SOG and the scene do not describe the same voxels.
    #[error(
        "the P-SOG has {psog} and the scene's roi {scene}; build the P-SOG with the same roi or \
         correct the roi"
    )]
    GridMismatch {
        /// Grid of the P-SOG in words.
        psog: String,
        /// Grid of the scene in words.
        scene: String,
    },
    /// The trees do not fit into memory.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
}

/// `wanted` of `count` frames, spread evenly from the first on; all of them if `None`.
pub fn spread(count: usize, wanted: Option<u32>) -> Vec<usize> {
    let wanted = wanted.map_or(count, |wanted| (wanted as usize).min(count));
    (0..wanted).map(|k| k * count / wanted).collect()
}

/// How much of a scene a problem models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Modelled {
    /// Voxels of the region of interest.
    pub voxels: u64,
    /// Those that are occupied in some frame of the P-SOG: nothing is stored of the others.
    pub occupied_voxels: u64,
    /// Those of them that have an entropy above 0.
    pub informative_voxels: u64,
    /// Frames that beams are cast into.
    pub frames: usize,
    /// Those of them whose geometry differs from that of every earlier one: the others are not cast
    /// again.
    pub distinct_frames: usize,
    /// Triangles of a frame, a mean.
    pub triangles: u64,
    /// Bytes of entropies and classes, which only occupied voxels have.
    pub voxel_bytes: u64,
    /// Bytes of what one sensor covers in one frame: a bit a voxel, the empty ones included, since
    /// covered voxels are counted.
    pub bitmap_bytes: u64,
    /// Bytes of triangles and trees, each thing once, and of what says where they stand.
    pub tree_bytes: u64,
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

impl std::fmt::Display for Modelled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} of {} voxels are occupied in some frame and stored ({}), {} of them have an entropy; {} \
             frame(s), {} distinct and cast, of {} triangles ({}); {} a sensor and frame for what it \
             covers",
            self.occupied_voxels,
            self.voxels,
            mebibytes(self.voxel_bytes),
            self.informative_voxels,
            self.frames,
            self.distinct_frames,
            self.triangles,
            mebibytes(self.tree_bytes),
            mebibytes(self.bitmap_bytes)
        )
    }
}

/// All that is fixed while placements vary: sensor models, voxels, their worth, and the geometry.
#[derive(Debug, Clone)]
pub struct Problem {
    roi: Roi,
    content: Arc<Content>,
    sensors: Sensors,
    constraints: Constraints,
    world: Arc<World>,
    /// Number of each frame in the scene, which free phases depend on.
    numbers: Vec<usize>,
    ends_at_hits: bool,
}

impl Problem {
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
        let constraints = Constraints::default();
        let (sensors, numbers) = (sensors.into(), (0..world.frames().len()).collect());
        Self { roi, content, sensors, constraints, world, numbers, ends_at_hits }
    }

    /// The same with other sensor models.
    pub fn with_sensors(self, sensors: impl Into<Sensors>) -> Self {
        Self { sensors: sensors.into(), ..self }
    }

    /// The same with voxels that are worth something else.
    pub fn with_content(self, content: impl Into<Arc<Content>>) -> Self {
        Self { content: content.into(), ..self }
    }

    /// The same with other rules of the mount.
    pub fn with_constraints(self, constraints: Constraints) -> Self {
        Self { constraints, ..self }
    }

    /// The same where areas must be seen.
    pub fn with_areas(self, required: &[Requirement]) -> Self {
        let content = Content::clone(&self.content).with_areas(&self.roi, required);
        Self { content: Arc::new(content), ..self }
    }

    /// The same with the numbers of its frames in the scene.
    fn numbered(self, frames: &[usize]) -> Self {
        Self { numbers: frames.to_vec(), ..self }
    }

    /// The same over some of its frames, with the same trees and content.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn over(&self, frames: &[usize]) -> Self {
        let ends_at_hits = self.ends_at_hits && !frames.is_empty();
        let numbers = frames.iter().map(|&frame| self.numbers[frame]).collect();
        Self { world: Arc::new(self.world.over(frames)), numbers, ends_at_hits, ..self.clone() }
    }

    /// The same with mirrored sensors: a mirrored placement here has the scores of the placement itself in
    /// the scene mirrored at the plane y = 0. World and content are shared.
    pub fn mirrored(&self) -> Self {
        let content = match self.content.areas() {
            [] => self.content.clone(),
            _ => Arc::new(self.content.with_mirrored_areas(&self.roi)),
        };
        Self { sensors: self.sensors.mirrored(), content, ..self.clone() }
    }

    /// The voxels.
    pub fn roi(&self) -> &Roi {
        &self.roi
    }

    /// What they are worth.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// Models that sensors are of.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Number of a frame in the scene.
    pub(crate) fn number_of(&self, frame: usize) -> usize {
        self.numbers.get(frame).copied().unwrap_or(frame)
    }

    /// Rules of the mount: none where the problem was put together without.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// Range in metres with which nothing is out of sight: what the guards compare with.
    pub fn far_range(&self) -> f32 {
        Self::far_range_of(&self.roi, self.sensors.longest_range())
    }

    pub(crate) fn far_range_of(roi: &Roi, range: f32) -> f32 {
        let [min, max] = [roi.min(), roi.max()].map(DVec3::from);
        range.max(2.0 * min.distance(max) as f32)
    }

    /// Frames over which a tally is summed.
    pub fn frame_count(&self) -> usize {
        if self.ends_at_hits { self.world.frames().len() } else { 1 }
    }

    /// The first frame whose geometry is that of `frame`, with sensors at the same phases: what is covered
    /// in one is covered in both.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn first_equal(&self, frame: usize) -> usize {
        match self.ends_at_hits {
            true if self.sensors.has_free_phase() => frame,
            true => self.world.first_equal(frame),
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

    /// Whether beams end at surfaces.
    pub fn ends_at_hits(&self) -> bool {
        self.ends_at_hits
    }

    /// The frames with their geometry.
    #[cfg(feature = "gpu")]
    pub(crate) fn world(&self) -> &World {
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
    pub(crate) fn ends(&self, frame: usize) -> Option<&Frame> {
        if self.ends_at_hits { self.geometry(frame) } else { None }
    }

    /// How much of the scene is modelled.
    pub fn modelled(&self) -> Modelled {
        let occupied = self.content.occupied();
        let informative = occupied.iter().filter(|voxel| voxel.entropy != [0; 3]);
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
