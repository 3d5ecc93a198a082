//! The GPU backend: everything that touches wgpu.

mod adapters;
mod bricks;
mod casting;
mod device;
mod flow;
mod kernels;
pub(crate) mod layout;
mod packets;
mod prepared;
mod resources;
mod run;
mod sums;
mod transfer;

pub use adapters::{AdapterSummary, list_adapters};
pub use casting::Casting;

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::{Backend, BackendError, Chunk, ChunkLimits, check_frame, split};
use crate::bvh::Hit;
use crate::cover::{BitOrder, Bitmaps};
use crate::problem::{Problem, StageTimes, Tally};
use crate::reduce::Worth;
use crate::vehicle::{Placement, SensorPose};
use bricks::Bricks;
use device::Device;
use flow::{Flow, Made};
use kernels::Kernels;
use packets::{Mixed, Plan};
use prepared::Prepared;
use resources::{Room, SceneBuffers, Sizes, WorkBuffers};
use run::Run;
use sums::Sums;

/// Bytes of the bitmaps that are made at a time where the host sums them up: they stay in its caches.
const SLICE_BYTES: u64 = 16 << 20;

/// Bytes of the largest bitmap whose bits have numbers of 32 bits.
const MOST_BITMAP: u64 = 1 << 29;

/// Evaluates batches on a Vulkan device.
///
/// Pipelines and scene buffers are made once; work buffers grow to the largest chunk seen. While the
/// device works on a chunk, the host puts the next together and takes up what became of the last.
/// The sums are taken on the device; where that is a software device, whose memory is the host's, they
/// are taken by the host, which reads the bitmaps where they lie, a word at a time.
pub struct GpuBackend {
    problem: Arc<Problem>,
    device: Device,
    kernels: Kernels,
    scene: SceneBuffers,
    casting: Casting,
    work: Option<WorkBuffers>,
    memory: u64,
    times: StageTimes,
    /// Host twin of the reductions, where they run on the host.
    worth: Option<Arc<Worth>>,
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
        let frames =
            (0..problem.geometry_frame_count()).filter_map(|frame| problem.geometry(frame));
        let triangles = frames.map(|bvh| bvh.triangles.len()).max().unwrap_or(0);
        let casting = match device.is_software() {
            true => Casting::on_software(triangles),
            false => Casting::Tree,
        };
        let scene = SceneBuffers::new(&device, &problem, casting)?;
        let kernels = Kernels::new(scene.constants);
        let times = StageTimes::default();
        let worth = device
            .is_software()
            .then(|| Arc::new(Worth::new(problem.content(), &BitOrder::bricks(problem.roi()))));
        let (work, doomed) = (None, None);
        Ok(Self { problem, device, kernels, scene, casting, work, memory, times, worth, doomed })
    }

    /// Whether the device is a program on the host, which the CPU backend outruns.
    pub fn is_software(&self) -> bool {
        self.device.is_software()
    }

    /// Takes the sums on the device, whatever it is; to compare both ways.
    pub fn reduce_on_device(&mut self) {
        self.renew();
        self.worth = None;
    }

    /// Casts in one way, whatever the device is; to compare both.
    ///
    /// # Errors
    /// The device cannot hold what this way needs.
    pub fn cast_by(&mut self, casting: Casting) -> Result<(), BackendError> {
        self.renew();
        self.scene = SceneBuffers::new(&self.device, &self.problem, casting)?;
        self.kernels = Kernels::new(self.scene.constants);
        self.casting = casting;
        Ok(())
    }

    /// Lets go of the work buffers.
    fn renew(&mut self) {
        self.kernels.unbind();
        self.work = None;
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

    /// Cuts a batch into chunks that are run so many times each, and makes room for them.
    fn cut(&mut self, placements: &[Placement], times: usize) -> Result<Cut, BackendError> {
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let widest = lidars.iter().copied().max().unwrap_or(1);
        let sizes = Sizes::of(&self.problem);
        let chunks = split(&lidars, self.limits(placements, widest, &sizes)?);
        let most = |of: fn(&Chunk) -> usize| chunks.iter().map(of).max().unwrap_or(0);
        let sensors = most(|chunk| chunk.sensors.len());
        let in_slice = match self.worth {
            Some(_) => self.in_slice(widest, sizes.bitmap).min(sensors),
            None => sensors,
        };
        let in_turn = chunks.len() * times > 1 || in_slice < sensors;
        let placements = most(|chunk| chunk.placements.len());
        let room = Room { sensors, placements, in_slice, in_turn };
        if !self.work.as_ref().is_some_and(|work| work.hold(&room)) {
            // The old buffers go first, so that both never exist at once.
            self.renew();
            let sums = self.worth.is_some();
            self.work = Some(WorkBuffers::new(&self.device, &sizes, room, sums)?);
        }
        Ok(Cut { chunks, in_slice })
    }

    /// What bounds a chunk of a batch whose placements have at most `widest` sensors.
    fn limits(
        &self,
        placements: &[Placement],
        widest: usize,
        sizes: &Sizes,
    ) -> Result<ChunkLimits, BackendError> {
        let binding = self.device.max_binding();
        // Two slices in flight, on the device and, unless mapped, copied to the host.
        let slice = self.in_slice(widest, sizes.bitmap) as u64 * sizes.bitmap;
        let copies = if self.device.maps() { 1 } else { 2 };
        // Sums of two jobs are copied to the host while those of a third are taken.
        let sums = 3 * (sizes.partials + sizes.totals);
        let (each, fixed) = match self.worth {
            Some(_) => (0, 2 * copies * slice),
            None => (2 * sizes.bitmap + sums, 0),
        };
        let one = [("coverage bitmaps", sizes.bitmap, binding.min(self.memory))];
        ChunkLimits::from_bytes(widest, &one)?;
        let free = self.memory.saturating_sub(fixed);
        let directions = self.problem.table().directions().len();
        let (packets, mixed) = if !self.casting.is_in_packets() {
            (0, 0)
        } else if Plan::mixes(&prepared::poses(&self.problem, placements), &self.problem) {
            (Plan::bytes(directions), Mixed::bytes(directions))
        } else {
            (Plan::bytes(directions), 0)
        };
        let mut sensors = vec![
            ("hits", sizes.hits, binding),
            ("beams of mixed packets", mixed, binding),
            ("work buffers", sizes.per_sensor() + each + packets + mixed, free),
        ];
        if self.worth.is_none() {
            sensors.push(one[0]);
        }
        let mut limits = ChunkLimits::from_bytes(widest, &sensors)?;
        let placements = [
            ("partial sums", sizes.partials, binding.min(self.memory)),
            ("totals", sizes.totals, binding),
        ];
        limits.placements = ChunkLimits::from_bytes(1, &placements)?.sensors;
        Ok(limits)
    }

    /// Sensors whose bitmaps are made at a time, of placements of at most `widest`, where slices are
    /// read by the host.
    fn in_slice(&self, widest: usize, bitmap: u64) -> usize {
        let bytes = SLICE_BYTES.min(self.memory / 16);
        widest.max((bytes / bitmap) as usize)
    }

    /// Runs a batch in some frames; `take` is told what [`Flow::batch`] tells.
    fn run(
        &mut self,
        placements: &[Placement],
        frames: &[usize],
        range: f32,
        sums: bool,
        take: impl FnMut(&Prepared, usize, Made<'_>),
    ) -> Result<StageTimes, BackendError> {
        let Cut { chunks, in_slice } = self.cut(placements, frames.len())?;
        let in_packets = self.casting.is_in_packets();
        let flow = Flow {
            problem: &self.problem,
            device: &self.device,
            kernels: &self.kernels,
            scene: &self.scene,
            work: self.work.as_mut().expect("made with the cut"),
            range,
            sums,
        };
        let prepare =
            |chunk: &Chunk| Prepared::new(&self.problem, placements, chunk, in_slice, in_packets);
        let times = flow.batch(&chunks, prepare, frames, take);
        if times.is_err() {
            // Some may still be mapped.
            self.renew();
        }
        times
    }
}

/// A batch in chunks, and the sensors whose bitmaps are made at a time.
struct Cut {
    chunks: Vec<Chunk>,
    in_slice: usize,
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
        let (frames, weights): (Vec<usize>, Vec<u64>) =
            self.problem.distinct_frames().into_iter().unzip();
        let on_device = self.worth.is_none();
        let mut sums = Sums::new(&self.problem, self.worth.clone(), weights, placements);
        let take = |chunk: &Prepared, turn: usize, made: Made<'_>| sums.add(chunk, turn, made);
        let times = self.run(placements, &frames, range, on_device, take)?;
        self.times += times;
        Ok(sums.tallies)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        let frames = self.problem.geometry_frame_count();
        if frame >= frames {
            return Err(BackendError::NoFrame { frame, frames });
        }
        let placements = one_by_one(poses);
        let Cut { chunks, in_slice } = self.cut(&placements, 1)?;
        let in_packets = self.casting.is_in_packets();
        let mut hits = Vec::new();
        for chunk in chunks {
            let start = Instant::now();
            let mut chunk = Prepared::new(&self.problem, &placements, &chunk, in_slice, in_packets);
            let work = self.work.as_mut().expect("made with the cut");
            work.upload_packets(&self.device, &self.kernels, &mut chunk)?;
            work.upload(&self.device, &chunk)?;
            let run = Run {
                problem: &self.problem,
                device: &self.device,
                kernels: &self.kernels,
                scene: &self.scene,
                work,
                range: self.problem.table().range(),
            };
            let cast = run.cast(&chunk, frame)?;
            run.settle(&chunk, frame, cast)?;
            hits.append(&mut run.read_hits(&chunk)?);
            self.times.cast += start.elapsed();
        }
        Ok(hits)
    }

    fn bitmaps(&mut self, poses: &[SensorPose], frame: usize) -> Result<Bitmaps, BackendError> {
        check_frame(&self.problem, frame)?;
        let order = BitOrder::bricks(self.problem.roi());
        let words = order.words();
        let mut bitmaps = vec![0; poses.len() * words];
        let range = self.problem.table().range();
        self.run(&one_by_one(poses), &[frame], range, false, |chunk, _, made| {
            // A placement is a sensor.
            if let Made::Bitmaps(slice, made) = made {
                let first = (chunk.batch.start + slice.first_sensor as usize) * words;
                let to = bitmaps[first..].par_iter_mut().zip(made.par_chunks(2));
                to.for_each(|(to, half)| *to = u64::from(half[0]) | u64::from(half[1]) << 32);
            }
        })?;
        Ok(Bitmaps { order, words: bitmaps })
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}

/// Each pose as a placement of its own.
fn one_by_one(poses: &[SensorPose]) -> Vec<Placement> {
    poses.iter().map(|&pose| Placement { name: String::new(), lidars: vec![pose] }).collect()
}
