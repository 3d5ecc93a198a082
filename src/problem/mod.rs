//! What is asked, ready to be computed: frames, voxels and their entropies, one beam table.

pub(crate) mod assemble;
pub(crate) mod beam;
pub(crate) mod pose;
mod tally;
mod world;

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
use crate::vehicle::{BeamTable, Constraints};

/// What covering a voxel is worth: the occupied voxels of a P-SOG with their entropies and classes.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    classes: Vec<String>,
    occupied: Vec<OccupiedVoxel>,
    /// Linear indices, class after class.
    class_voxels: Vec<u32>,
    /// Where each class begins in `class_voxels`, and the end.
    class_starts: Vec<u32>,
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
        Self { classes, occupied, class_voxels, class_starts, entropy_total, has_detection }
    }

    /// Class names by class id.
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// Voxels occupied in at least one frame, in rising order.
    pub fn occupied(&self) -> &[OccupiedVoxel] {
        &self.occupied
    }

    /// Linear indices of the voxels in which a class occurs in at least one frame, rising.
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

/// All that is fixed while placements vary: sensor, voxels, their worth, and the geometry.
#[derive(Debug, Clone)]
pub struct Problem {
    roi: Roi,
    content: Arc<Content>,
    table: BeamTable,
    constraints: Constraints,
    world: Arc<World>,
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
        table: BeamTable,
        world: impl Into<World>,
        ends_at_hits: bool,
    ) -> Self {
        let (content, world) = (content.into(), Arc::new(world.into()));
        let ends_at_hits = ends_at_hits && !world.frames().is_empty();
        let constraints = Constraints::default();
        Self { roi, content, table, constraints, world, ends_at_hits }
    }

    /// The same with other rules of the mount.
    pub fn with_constraints(self, constraints: Constraints) -> Self {
        Self { constraints, ..self }
    }

    /// The same over some of its frames, with the same trees and content.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn over(&self, frames: &[usize]) -> Self {
        let ends_at_hits = self.ends_at_hits && !frames.is_empty();
        Self { world: Arc::new(self.world.over(frames)), ends_at_hits, ..self.clone() }
    }

    /// The same with mirrored sensors: a mirrored placement here has the scores of the placement itself in
    /// the scene mirrored at the plane y = 0. World and content are shared.
    pub fn mirrored(&self) -> Self {
        Self { table: self.table.mirrored(), ..self.clone() }
    }

    /// The voxels.
    pub fn roi(&self) -> &Roi {
        &self.roi
    }

    /// What they are worth.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// Beams of one sensor.
    pub fn table(&self) -> &BeamTable {
        &self.table
    }

    /// Rules of the mount: none where the problem was put together without.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// Range in metres with which nothing is out of sight: what the guards compare with.
    pub fn far_range(&self) -> f32 {
        Self::far_range_of(&self.roi, self.table.range())
    }

    pub(crate) fn far_range_of(roi: &Roi, range: f32) -> f32 {
        let [min, max] = [roi.min(), roi.max()].map(DVec3::from);
        range.max(2.0 * min.distance(max) as f32)
    }

    /// Frames over which a tally is summed.
    pub fn frame_count(&self) -> usize {
        if self.ends_at_hits { self.world.frames().len() } else { 1 }
    }

    /// The first frame whose geometry is that of `frame`: what is covered in one is covered in both.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn first_equal(&self, frame: usize) -> usize {
        if self.ends_at_hits { self.world.first_equal(frame) } else { 0 }
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
