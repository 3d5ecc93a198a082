//! The GPU backend: everything that touches wgpu.
//!
//! A batch goes one way: [`GpuBackend`] cuts it into chunks that fit the buffers (`chunk`), `pipeline` runs
//! the `kernels` on the `device`, and `readback` adds up the results. `firings` casts the rays of scans with the
//! same kernel and no more.

mod chunk;
mod device;
mod firings;
#[cfg(test)]
mod handed;
#[cfg(test)]
mod isa;
mod kernels;
mod layout;
mod pipeline;
mod readback;
mod self_test;
mod stages;

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::{
    Backend, BackendError, Chunk, ChunkLimits, EngineChoice, Result, TakeBitmap, check_frame, split,
};
use crate::bvh::Hit;
use crate::cover::BitOrder;
use crate::sensor::{Placement, SensorPose};
use crate::task::{StageTimes, Tally, Task};
use chunk::{GpuBatch, SceneBuffers, Sizes, WorkBuffers};
use device::Device;
use kernels::{Kernels, Rewrite};
use pipeline::{ChunkResult, Pipeline, in_flight};
use readback::BatchTallies;

pub(super) use device::list_adapters;
pub use device::{AdapterSummary, TransferCounts};
pub(super) use firings::GpuFirings;
pub use self_test::{SelfTest, TestedAdapter, WrongAnswer, test_adapters};

/// Bytes of the largest bitmap whose bits have numbers of 32 bits.
const MOST_BITMAP: u64 = 1 << 29;

/// Evaluates batches on a Vulkan device.
///
/// Pipelines and the task's buffers are made once; work buffers grow to the largest chunk so far.
pub struct GpuBackend {
    task: Arc<Task>,
    device: Device,
    kernels: Kernels,
    scene: SceneBuffers,
    work: Option<WorkBuffers>,
    memory: u64,
    times: StageTimes,
    /// Batches until the device is destroyed, for tests and drills.
    doomed: Option<u32>,
}

impl GpuBackend {
    /// Opens the best device, or the one whose name contains `adapter`; see [`Self::open`].
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn new(task: Arc<Task>, adapter: Option<&str>, memory: u64) -> Result<Self> {
        let adapter = adapter.map(str::to_owned);
        Self::open(task, &EngineChoice { adapter, ..EngineChoice::default() }, memory)
    }

    /// Opens the device of a choice, whose kind does not count, and uploads the task.
    ///
    /// Work buffers together stay below `memory` bytes.
    ///
    /// # Errors
    /// No such device, one that fails its self-test, or one that cannot hold the task.
    pub fn open(task: Arc<Task>, choice: &EngineChoice, memory: u64) -> Result<Self> {
        let device = self_test::open(choice)?;
        let need = 8 * BitOrder::bricks(task.roi()).words() as u64;
        if need > MOST_BITMAP {
            let (what, limit) = ("coverage bitmaps", MOST_BITMAP);
            return Err(BackendError::TooLarge { what, need, limit });
        }
        let scene = SceneBuffers::new(&device, &task)?;
        let kernels = Kernels::new();
        let (times, work, doomed) = (StageTimes::default(), None, None);
        Ok(Self { task, device, kernels, scene, work, memory, times, doomed })
    }

    /// Lets the kernels be compiled from other sources: for a test that plays a hostile driver.
    #[doc(hidden)]
    pub fn rewrite_kernels(&mut self, rewrite: Rewrite) {
        self.kernels = Kernels::rewritten(rewrite);
    }

    /// True if the device is a software renderer on the CPU.
    pub fn is_software(&self) -> bool {
        self.device.software
    }

    /// Answers of the device to a table of arithmetic.
    ///
    /// # Errors
    /// A device that failed since it was opened.
    pub fn self_test(&self) -> Result<SelfTest> {
        self_test::self_test(&self.device)
    }

    /// Exchanges between host and device since it was opened.
    pub fn traffic(&self) -> TransferCounts {
        self.device.traffic()
    }

    /// Ends the device after `batches` more batches of placements, as a driver reset would; every later call is an
    /// error. For tests and drills.
    #[doc(hidden)]
    pub fn lose_device_after(&mut self, batches: u32) {
        self.doomed = Some(batches);
    }

    fn count_down(&mut self) {
        match &mut self.doomed {
            Some(0) => self.device.wgpu.destroy(),
            Some(batches) => *batches -= 1,
            None => {}
        }
    }

    /// Cuts placements into chunks and makes room for the largest.
    fn cut(&mut self, placements: &[Placement]) -> Result<Vec<Chunk>> {
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let widest = lidars.iter().copied().max().unwrap_or(1);
        let sizes = Sizes::of(&self.task);
        let chunks = split(&lidars, self.limits(widest, &sizes)?);
        let most = |of: fn(&Chunk) -> usize| chunks.iter().map(of).max().unwrap_or(0);
        let sensors = most(|chunk| chunk.sensors.len());
        let placements = most(|chunk| chunk.placements.len());
        if !self.work.as_ref().is_some_and(|work| work.hold(sensors, placements)) {
            // Old and new ones never exist at once.
            self.kernels.unbind();
            self.work = None;
            self.work = Some(WorkBuffers::new(&self.device, &sizes, sensors, placements)?);
        }
        Ok(chunks)
    }

    /// Limits of a chunk whose placements have at most `widest` sensors.
    fn limits(&self, widest: usize, sizes: &Sizes) -> Result<ChunkLimits> {
        let (binding, memory) = (self.device.max_binding(), self.memory);
        // Bitmaps on the device and their copy to the host; sums and instances there, of the steps in flight, and of the step
        // that the host has in hand.
        let copies = 2 + in_flight(true) as u64;
        let sums = copies * (sizes.partials + sizes.totals);
        let each = sizes.hits + copies * sizes.instances + 2 * sizes.bitmap + sums;
        let sensors = [
            ("coverage bitmaps", sizes.bitmap, binding.min(memory)),
            ("hits", sizes.hits, binding),
            ("instances", sizes.instances, binding),
            ("work buffers", each, memory),
        ];
        let placements = [
            ("partial sums", sizes.partials, binding.min(memory)),
            ("totals", sizes.totals, binding),
        ];
        let mut limits = ChunkLimits::from_bytes(widest, &sensors)?;
        limits.placements = ChunkLimits::from_bytes(1, &placements)?.sensors;
        Ok(limits)
    }

    /// The device with the task and the room that [`Self::cut`] made.
    fn pipeline(&self) -> Pipeline<'_> {
        Pipeline {
            task: &self.task,
            device: &self.device,
            kernels: &self.kernels,
            scene: &self.scene,
            work: self.work.as_ref().expect("made with the cut"),
        }
    }
}

impl Backend for GpuBackend {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn adapter(&self) -> &str {
        &self.device.adapter
    }

    fn tally(&mut self, placements: &[Placement], range: Option<f32>) -> Result<Vec<Tally>> {
        self.count_down();
        let (frames, weights): (Vec<usize>, Vec<u64>) =
            self.task.distinct_frames().into_iter().unzip();
        let chunks = self.cut(placements)?;
        let batch = GpuBatch { placements, chunks, frames: &frames, range, sums: true };
        let mut sums = BatchTallies::new(&self.task, placements, weights.iter().sum())?;
        let times = self.pipeline().run(&batch, &mut |chunk, turn, made| {
            let (own, weight) = (chunk.cut.placements.clone(), weights[turn]);
            match made {
                ChunkResult::Hits(hits) => sums.add_hits(own, &chunk.placements, weight, hits),
                ChunkResult::Sums { totals, partials } => {
                    sums.add_sums(own, weight, totals, partials)
                }
                ChunkResult::Bitmaps(_) => {}
            }
        })?;
        self.times += times;
        Ok(sums.tallies)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>> {
        let frames = self.task.geometry_frame_count();
        if frame >= frames {
            return Err(BackendError::NoFrame { frame, frames });
        }
        let (start, range) = (Instant::now(), None);
        let placements = one_by_one(poses);
        let chunks = self.cut(&placements)?;
        let batch =
            GpuBatch { placements: &placements, chunks, frames: &[frame], range, sums: false };
        let hits = self.pipeline().hits(&batch, frame)?;
        self.times.cast += start.elapsed();
        Ok(hits)
    }

    fn order(&self) -> BitOrder {
        BitOrder::bricks(self.task.roi())
    }

    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<()> {
        check_frame(&self.task, frame)?;
        let order = self.order();
        let range = None;
        let placements = one_by_one(poses);
        let chunks = self.cut(&placements)?;
        let batch =
            GpuBatch { placements: &placements, chunks, frames: &[frame], range, sums: false };
        self.pipeline().run(&batch, &mut |chunk, _, made| {
            if let ChunkResult::Bitmaps(made) = made {
                // A placement is a sensor.
                let first = chunk.cut.placements.start;
                let of_sensors = made.par_chunks((2 * order.words()).max(1)).enumerate();
                of_sensors.for_each(|(sensor, halves)| {
                    let word = |half: &[u32]| u64::from(half[0]) | u64::from(half[1]) << 32;
                    let words: Vec<u64> = halves.chunks(2).map(word).collect();
                    take(first + sensor, &order, &words);
                });
            }
        })?;
        Ok(())
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}

fn one_by_one(poses: &[SensorPose]) -> Vec<Placement> {
    poses.iter().map(|&pose| Placement { name: String::new(), lidars: vec![pose] }).collect()
}
