//! The GPU backend: everything that touches wgpu.

mod bricks;
mod casting;
mod device;
mod kernels;
mod packets;
mod resources;
mod run;

pub use casting::Casting;
pub use device::{AdapterSummary, list_adapters};

use std::sync::Arc;
use std::time::Instant;

use super::{
    Backend, BackendError, Chunk, ChunkLimits, DevicePose, Problem, StageTimes, Tally, split,
};
use crate::backend::cpu::{Worth, bitmap_words, union_of};
use crate::bvh::Hit;
use crate::placement::{Placement, SensorPose};
use bricks::Bricks;
use casting::PacketCaster;
use device::Device;
use kernels::Kernels;
use packets::{Mixed, Plan};
use resources::{ChunkBuffers, SceneBuffers};

/// Bytes of the bitmaps that are made at a time where the host sums them up: they stay in its caches.
const SLICE_BYTES: u64 = 16 << 20;

/// Bytes of the largest bitmap whose bits have numbers of 32 bits.
const MOST_BITMAP: u64 = 1 << 29;

/// Evaluates batches on a Vulkan device.
///
/// Pipelines and scene buffers are made once; the buffers of a chunk grow to the largest chunk seen.
/// The sums are taken on the device; where that is a software device, whose memory is the host's, they
/// are taken by the host, which reads the bitmaps where they lie, a word at a time.
pub struct GpuBackend {
    problem: Arc<Problem>,
    device: Device,
    kernels: Kernels,
    scene: SceneBuffers,
    chunk: Option<ChunkBuffers>,
    /// Where beams are cast in packets.
    caster: Option<PacketCaster>,
    memory: u64,
    times: StageTimes,
    /// Host twin of the reductions, where they run on the host.
    worth: Option<Worth>,
    /// Batches until the device is destroyed, for tests and drills.
    doomed: Option<u32>,
}

impl GpuBackend {
    /// Opens the best device, or the one whose name contains `adapter`, and uploads the problem.
    ///
    /// Work buffers together stay below `memory` bytes.
    ///
    /// # Errors
    /// No such device, or one that cannot hold the problem.
    pub fn new(
        problem: Arc<Problem>,
        adapter: Option<&str>,
        memory: u64,
    ) -> Result<Self, BackendError> {
        let device = Device::open(adapter)?;
        let need = 4 * Bricks::new(problem.roi()).words();
        if need > MOST_BITMAP {
            return Err(BackendError::TooLarge {
                what: "coverage bitmaps",
                need,
                limit: MOST_BITMAP,
            });
        }
        let casting = if device.is_software() { Casting::Packets } else { Casting::Tree };
        let (scene, kernels, caster) = Self::prepare(&device, &problem, casting)?;
        let times = StageTimes::default();
        let worth = device
            .is_software()
            .then(|| Worth::new(&Bricks::new(problem.roi()).content(problem.content())));
        let (chunk, doomed) = (None, None);
        Ok(Self { problem, device, kernels, scene, chunk, caster, memory, times, worth, doomed })
    }

    fn prepare(
        device: &Device,
        problem: &Problem,
        casting: Casting,
    ) -> Result<(SceneBuffers, Kernels, Option<PacketCaster>), BackendError> {
        let scene = SceneBuffers::new(device, problem, casting)?;
        let kernels = Kernels::new(scene.stack);
        Ok((scene, kernels, (casting == Casting::Packets).then(PacketCaster::default)))
    }

    /// Whether the device is a program on the host, which the CPU backend outruns.
    pub fn is_software(&self) -> bool {
        self.device.is_software()
    }

    /// Takes the sums on the device, whatever it is; to compare both ways.
    pub fn reduce_on_device(&mut self) {
        self.worth = None;
    }

    /// Casts in one way, whatever the device is; to compare both.
    ///
    /// # Errors
    /// The device cannot hold what this way needs.
    pub fn cast_by(&mut self, casting: Casting) -> Result<(), BackendError> {
        (self.scene, self.kernels, self.caster) =
            Self::prepare(&self.device, &self.problem, casting)?;
        Ok(())
    }

    /// Ends the device after so many more batches of placements, as a driver reset would; whatever is
    /// asked of the backend then is an error. For tests and drills.
    #[doc(hidden)]
    pub fn lose_device_after(&mut self, batches: u32) {
        self.doomed = Some(batches);
    }

    fn count_down(&mut self) {
        match &mut self.doomed {
            Some(0) => self.device.destroy(),
            Some(batches) => *batches -= 1,
            None => {}
        }
    }

    /// Poses of all sensors in order.
    fn poses(&self, placements: &[Placement]) -> Vec<DevicePose> {
        let roi = self.problem.roi();
        placements.iter().flat_map(|p| &p.lidars).map(|l| DevicePose::new(l, roi)).collect()
    }

    /// Cuts a batch into chunks.
    fn chunks(&self, placements: &[Placement]) -> Result<Vec<Chunk>, BackendError> {
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let widest = lidars.iter().copied().max().unwrap_or(1);
        let sizes = resources::Sizes::of(&self.problem);
        let binding = self.device.max_binding();
        // Two slices in flight, on the device and, unless mapped, copied to the host.
        let slice = self.in_slice(widest, sizes.bitmap) as u64 * sizes.bitmap;
        let copies = if self.device.maps() { 1 } else { 2 };
        let (bitmap, fixed) =
            if self.worth.is_some() { (0, 2 * copies * slice) } else { (2 * sizes.bitmap, 0) };
        let one = [("coverage bitmaps", sizes.bitmap, binding.min(self.memory))];
        ChunkLimits::from_bytes(widest, &one)?;
        let free = self.memory.saturating_sub(fixed);
        let directions = self.problem.table().directions().len();
        let (packets, mixed) = match self.caster {
            Some(_) if Plan::mixes(&self.poses(placements), &self.problem) => {
                (Plan::bytes(directions), Mixed::bytes(directions))
            }
            Some(_) => (Plan::bytes(directions), 0),
            None => (0, 0),
        };
        let mut sensors = vec![
            ("hits", sizes.hits, binding),
            ("beams of mixed packets", mixed, binding),
            ("work buffers", sizes.per_sensor() + bitmap + packets + mixed, free),
        ];
        if bitmap > 0 {
            sensors.push(one[0]);
        }
        let mut limits = ChunkLimits::from_bytes(widest, &sensors)?;
        let placements = [
            ("partial sums", sizes.partials, binding.min(self.memory)),
            ("totals", sizes.totals, binding),
        ];
        limits.placements = ChunkLimits::from_bytes(1, &placements)?.sensors;
        Ok(split(&lidars, limits))
    }

    /// Sensors whose bitmaps are made at a time, of placements of at most `widest`, where slices are
    /// read by the host.
    fn in_slice(&self, widest: usize, bitmap: u64) -> usize {
        let bytes = SLICE_BYTES.min(self.memory / 16);
        widest.max((bytes / bitmap) as usize)
    }

    /// Uploads a chunk's poses and placements.
    fn load(&mut self, placements: &[Placement]) -> Result<(), BackendError> {
        let poses = self.poses(placements);
        if let Some(caster) = &mut self.caster {
            let start = Instant::now();
            caster.load(&self.device, &poses, &self.problem)?;
            self.times.cast += start.elapsed();
        }
        let sizes = resources::Sizes::of(&self.problem);
        let widest = placements.iter().map(|p| p.lidars.len()).max().unwrap_or(1);
        let in_slice = if self.worth.is_some() {
            self.in_slice(widest, sizes.bitmap).min(poses.len())
        } else {
            poses.len()
        };
        let fits =
            self.chunk.as_ref().is_some_and(|c| c.holds(poses.len(), placements.len(), in_slice));
        if !fits {
            // The old buffers go first, so that both never exist at once.
            self.chunk = None;
            let (device, count) = (&self.device, placements.len());
            self.chunk = Some(ChunkBuffers::new(device, &sizes, poses.len(), count, in_slice)?);
        }
        let lidars = placements.iter().map(|p| p.lidars.len() as u32);
        let chunk = self.chunk.as_mut().expect("made above");
        chunk.load(&self.device, &Bricks::new(self.problem.roi()), &poses, lidars, in_slice);
        self.device.check("uploading placements")
    }

    fn run(&self) -> run::Run<'_> {
        run::Run {
            problem: &self.problem,
            device: &self.device,
            kernels: &self.kernels,
            scene: &self.scene,
            chunk: self.chunk.as_ref().expect("a chunk is loaded before it runs"),
            caster: self.caster.as_ref(),
        }
    }
}

impl Backend for GpuBackend {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn adapter(&self) -> &str {
        self.device.adapter()
    }

    fn tally(&mut self, placements: &[Placement], range: f32) -> Result<Vec<Tally>, BackendError> {
        self.count_down();
        let mut tallies = Vec::with_capacity(placements.len());
        let classes = self.problem.content().classes().len();
        for chunk in self.chunks(placements)? {
            let placements = &placements[chunk.placements];
            self.load(placements)?;
            let mut sums: Vec<Tally> =
                placements.iter().map(|p| Tally::zero(classes, p.lidars.len())).collect();
            for (frame, weight) in self.problem.distinct_frames() {
                let zero = |p: &Placement| Tally::zero(classes, p.lidars.len());
                let mut of_frame: Vec<Tally> = placements.iter().map(zero).collect();
                let mut times = self.times;
                let run = self.run();
                let start = Instant::now();
                let hits = run.cast(frame, range)?;
                times.cast += start.elapsed();
                let start = Instant::now();
                if let Some(worth) = &self.worth {
                    let sums =
                        run.cover_and_reduce_on_host(frame, range, worth, &hits, &mut of_frame)?;
                    times.cover += start.elapsed().saturating_sub(sums);
                    times.reduce += sums;
                } else {
                    run.cover_all(frame, range)?;
                    times.cover += start.elapsed();
                    let start = Instant::now();
                    run.reduce(&hits, &mut of_frame)?;
                    times.reduce += start.elapsed();
                }
                for (sum, of_frame) in sums.iter_mut().zip(&of_frame) {
                    sum.add_times(of_frame, weight);
                }
                self.times = times;
            }
            tallies.append(&mut sums);
        }
        Ok(tallies)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        let frames = self.problem.geometry_frame_count();
        if frame >= frames {
            return Err(BackendError::NoFrame { frame, frames });
        }
        let placements = one_by_one(poses);
        let range = self.problem.table().range();
        let mut hits = Vec::new();
        for chunk in self.chunks(&placements)? {
            self.load(&placements[chunk.placements])?;
            let start = Instant::now();
            let run = self.run();
            run.cast_geometry(frame, range)?;
            hits.append(&mut run.read_hits()?);
            self.times.cast += start.elapsed();
        }
        Ok(hits)
    }

    fn covered(&mut self, placement: &Placement, frame: usize) -> Result<Vec<u64>, BackendError> {
        self.problem.check_frame(frame)?;
        let placements = std::slice::from_ref(placement);
        let range = self.problem.table().range();
        self.chunks(placements)?;
        self.load(placements)?;
        let run = self.run();
        run.cast(frame, range)?;
        let bitmaps = run.bitmaps(frame, range)?;
        Ok(union_of(&bitmaps, bitmap_words(self.problem.roi())))
    }

    fn bitmaps(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<u64>, BackendError> {
        self.problem.check_frame(frame)?;
        let placements = one_by_one(poses);
        let range = self.problem.table().range();
        let mut bitmaps = Vec::new();
        for chunk in self.chunks(&placements)? {
            self.load(&placements[chunk.placements])?;
            let run = self.run();
            run.cast(frame, range)?;
            bitmaps.append(&mut run.bitmaps(frame, range)?);
        }
        Ok(bitmaps)
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}

/// Each pose as a placement of its own.
fn one_by_one(poses: &[SensorPose]) -> Vec<Placement> {
    poses.iter().map(|&pose| Placement { name: String::new(), lidars: vec![pose] }).collect()
}
