//! Placements in, integer tallies out: the CPU reference and the GPU behind one trait.
//!
//! A backend runs four stages on a batch, frame after frame:
//!
//! | stage | from | to |
//! |---|---|---|
//! | `cast_closest` | poses × directions, trees and where they stand | closest hit of every beam |
//! | `cover_voxels` | beams, hits | one bitmap of covered voxels a sensor |
//! | `reduce_words` | bitmaps | covered voxels of every placement |
//! | `reduce_occupied`, `reduce_classes` | bitmaps, P-SOG | entropy sums, counts by class |
//!
//! The CPU functions are written to be read; the shaders mirror them name by name. All sums are
//! integers, so no order of addition matters and both give the same bits.

mod cpu;
#[cfg(feature = "gpu")]
pub mod gpu;
mod opening;
mod reference;

use std::ops::Range;
use std::sync::Mutex;

use crate::cover::{BitOrder, Bitmaps};
use crate::memory;
use crate::sensor::{Placement, SensorPose, UnknownSensor};
use crate::task::{StageTimes, Tally, Task};

pub use crate::bvh::{Hit, NO_HIT};
pub use crate::cast::{RayScene, cast_rays};
pub use crate::memory::OutOfMemory;
pub use cpu::CpuBackend;
pub use opening::{
    EngineChoice, EngineKind, Failover, OpenedCaster, OpenedEngine, open, open_caster,
};
pub use reference::ReferenceBackend;

/// Why a batch could not be evaluated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum BackendError {
    /// One placement alone needs more than is allowed.
    #[error(
        "one placement needs {need} bytes of {what}, at most {limit} are allowed; use larger \
         voxels, fewer beams, or a larger --memory"
    )]
    TooLarge {
        /// Which buffer.
        what: &'static str,
        /// Bytes needed.
        need: u64,
        /// Bytes allowed by the device or the budget.
        limit: u64,
    },
    /// The host has no memory for a buffer.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
    /// No Vulkan device, or none with the requested name.
    #[error("no Vulkan device{}; install a driver or use --backend cpu", named(.name))]
    NoDevice { name: Option<String> },
    /// The device refused a request or failed at it.
    #[error("the device `{adapter}` failed at {stage}: {message}; try --backend cpu")]
    Device { adapter: String, stage: &'static str, message: String },
    /// A sensor of a model that the vehicle does not have.
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
    /// A frame that the task does not have.
    #[error("frame {frame} does not exist; there are {frames}, counted from 0")]
    NoFrame { frame: usize, frames: usize },
}

/// Outcome of work that an engine may fail at.
pub(crate) type Result<T, E = BackendError> = std::result::Result<T, E>;

fn named(name: &Option<String>) -> String {
    name.as_ref().map(|n| format!(" named `{n}`")).unwrap_or_default()
}

fn check_frame(task: &Task, frame: usize) -> Result<()> {
    let frames = task.frame_count();
    if frame < frames { Ok(()) } else { Err(BackendError::NoFrame { frame, frames }) }
}

/// Takes the bitmap of a pose: the pose's number, the order of the bits, and the words, which are gone afterwards.
pub type TakeBitmap<'a> = dyn Fn(usize, &BitOrder, &[u64]) + Sync + 'a;

/// One implementation of the stages, bound to one [`Task`].
pub trait Backend: Send {
    /// `cpu` or `gpu`.
    fn name(&self) -> &'static str;

    /// Device name as reported.
    fn adapter(&self) -> &str;

    /// Tallies of `placements` in order, summed over all frames, with beams of `range` metres, or of each
    /// sensor model's own range.
    ///
    /// Splits the batch over memory and device limits by itself; the split changes no bit.
    ///
    /// # Errors
    /// One placement does not fit, or the device failed.
    fn tally(&mut self, placements: &[Placement], range: Option<f32>) -> Result<Vec<Tally>>;

    /// Closest hits of every beam of each sensor pose in one frame, pose after pose, by channel and
    /// azimuth step.
    ///
    /// # Errors
    /// No such frame, one sensor does not fit, or the device failed.
    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>>;

    /// The order in which this engine marks voxels; another one once a device is lost.
    fn order(&self) -> BitOrder;

    /// Hands the bitmap of the voxels that a sensor pose covers in one frame to `take`, with the number of the
    /// pose and the bitmap's order.
    ///
    /// Calls come for each pose, in no order, from several threads, and once more where a device was lost meanwhile.
    /// A bitmap is as large as the grid, so that it is best used while it is in a cache.
    ///
    /// # Errors
    /// See [`Self::hits`].
    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<()>;

    /// Bitmaps of the voxels that each sensor pose covers in one frame, pose after pose, in this engine's order.
    ///
    /// # Errors
    /// See [`Self::hits`].
    fn bitmaps(&mut self, poses: &[SensorPose], frame: usize) -> Result<Bitmaps> {
        let order = self.order();
        let mut words = memory::zeros(poses.len() * order.words(), "coverage bitmaps")?;
        let of_poses: Vec<Mutex<&mut [u64]>> =
            words.chunks_mut(order.words().max(1)).map(Mutex::new).collect();
        self.each_bitmap(poses, frame, &|pose, from, bitmap| {
            if let Ok(mut to) = of_poses[pose].lock() {
                to.copy_from_slice(&from.convert(bitmap, &order));
            }
        })?;
        drop(of_poses);
        Ok(Bitmaps { order, words })
    }

    /// Voxels that one placement covers in one frame, as rising linear indices.
    ///
    /// # Errors
    /// See [`Self::hits`].
    fn covered(&mut self, placement: &Placement, frame: usize) -> Result<Vec<u64>> {
        Ok(self.bitmaps(&placement.lidars, frame)?.union())
    }

    /// Wall time spent in each stage since the backend was made.
    fn times(&self) -> StageTimes;

    /// Sentences on devices lost since the backend was made, and on their replacements; mostly none.
    fn changes(&self) -> &[String] {
        &[]
    }
}

/// Part of a batch that is evaluated at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Chunk {
    /// Placements of the batch.
    pub placements: Range<usize>,
    /// Their sensors, counted over the whole batch.
    pub sensors: Range<usize>,
}

/// Limits of a chunk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChunkLimits {
    /// Sensors whose buffers fit at once.
    pub sensors: usize,
    /// Placements whose buffers fit at once.
    pub placements: usize,
}

impl ChunkLimits {
    /// Limits from bytes: the smallest of several (name, bytes a sensor, bytes allowed).
    ///
    /// # Errors
    /// `lidars` sensors, one placement, do not fit somewhere.
    pub(crate) fn from_bytes(lidars: usize, bounds: &[(&'static str, u64, u64)]) -> Result<Self> {
        let mut sensors = u64::from(u16::MAX);
        for &(what, each, limit) in bounds {
            let need = each.saturating_mul(lidars as u64);
            if need > limit {
                return Err(BackendError::TooLarge { what, need, limit });
            }
            sensors = sensors.min(limit / each.max(1));
        }
        Ok(Self { sensors: sensors as usize, placements: usize::from(u16::MAX) })
    }
}

/// Cuts a batch into chunks within the limits, whole placements only, in order.
///
/// `lidars[i]` is the number of sensors of placement i; none may exceed the limit alone.
fn split(lidars: &[usize], limits: ChunkLimits) -> Vec<Chunk> {
    let mut chunks: Vec<Chunk> = Vec::new();
    let mut first_sensor = 0;
    for (index, &count) in lidars.iter().enumerate() {
        let sensors = first_sensor..first_sensor + count;
        first_sensor = sensors.end;
        match chunks.last_mut() {
            Some(chunk)
                if sensors.end - chunk.sensors.start <= limits.sensors
                    && chunk.placements.len() < limits.placements =>
            {
                chunk.placements.end = index + 1;
                chunk.sensors.end = sensors.end;
            }
            _ => chunks.push(Chunk { placements: index..index + 1, sensors }),
        }
    }
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_hold_whole_placements_in_order() {
        let lidars = [4, 4, 1, 4, 2, 2];
        let chunks = split(&lidars, ChunkLimits { sensors: 8, placements: 2 });
        let ranges: Vec<_> = chunks.iter().map(|c| c.placements.clone()).collect();
        assert_eq!(ranges, [0..2, 2..4, 4..6]);
        let sensors: Vec<_> = chunks.iter().map(|c| c.sensors.clone()).collect();
        assert_eq!(sensors, [0..8, 8..13, 13..17]);
    }

    #[test]
    fn a_placement_that_does_not_fit_is_an_error() {
        let bounds = [("coverage bitmaps", 100, 350)];
        assert_eq!(ChunkLimits::from_bytes(3, &bounds).unwrap().sensors, 3);
        let error = ChunkLimits::from_bytes(4, &bounds).unwrap_err();
        assert!(error.to_string().contains("400 bytes of coverage bitmaps"), "{error}");
    }
}
