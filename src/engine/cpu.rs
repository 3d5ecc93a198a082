//! The CPU: every stage as a plain function, and a fast one beside it that gives the same bits.
//!
//! | reference, to be read | fast, what [`CpuBackend`] runs |
//! |---|---|
//! | [`cast_frame_closest`](crate::cast::cast_frame_closest): a beam at a time | [`Caster`]: all beams of a sensor at once |
//! | [`cover_voxels`]: a voxel at a time | [`cover_sensor`]: sixteen beams in lockstep, a row of voxels at a time |
//! | [`reduce()`]: a voxel at a time | `take_sums`: a word of the bitmaps at a time |
//!
//! Lanes are plain arrays; each kernel is compiled for several instruction sets and picked at run time.
//! None contracts a product and a sum, so all give the same bits.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::{Backend, BackendError, Chunk, ChunkLimits, check_frame, ego_from, split};
use crate::bvh::Hit;
use crate::cast::Caster;
use crate::cover::{BitOrder, Bitmaps, WalkScratch, cover_sensor};
use crate::geom::Pose;
use crate::memory;
use crate::problem::{DevicePose, Problem, StageTimes, Tally};
use crate::reduce::{EntropyIndex, take_sums};
use crate::vehicle::{MAX_LIDARS, Placement, SensorPose};

/// Bytes of hits that one chunk uses at most: more gains nothing, since a chunk of this size already
/// keeps every core busy.
const CHUNK_BYTES: u64 = 256 << 20;
/// Placements a thread below which threads share the sensors of each placement: the last placements
/// would leave some threads idle.
const FEW: usize = 4;
/// More sensors than a placement has: one thread takes all of them.
const ALL_SENSORS: usize = MAX_LIDARS + 1;

/// Evaluates batches on the host's cores.
pub struct CpuBackend {
    problem: Arc<Problem>,
    order: BitOrder,
    entropies: EntropyIndex,
    memory: u64,
    times: StageTimes,
    /// Kept from batch to batch.
    hits: Vec<Hit>,
    caster: Caster,
    walks: Pool<WalkScratch>,
    /// `[sensors × words]` in `order`, zero between tasks.
    bitmaps: Pool<Vec<u64>>,
}

/// Working memory of tasks, to be used again.
#[derive(Default)]
struct Pool<T>(Mutex<Vec<T>>);

impl<T: Default> Pool<T> {
    fn take(&self) -> T {
        self.0.lock().ok().and_then(|mut kept| kept.pop()).unwrap_or_default()
    }

    fn put_back(&self, memory: T) {
        if let Ok(mut kept) = self.0.lock() {
            kept.push(memory);
        }
    }
}

/// Consecutive sensors of a chunk in one frame.
struct Part<'a> {
    poses: &'a [DevicePose],
    /// Number of the first in the chunk.
    first: usize,
    frame: usize,
    /// Equal frames that it stands for.
    weight: u64,
    /// Metres.
    range: f32,
    /// Fewest sensors that a thread takes.
    sensors_a_task: usize,
}

impl CpuBackend {
    /// A backend that uses at most about `memory` bytes beside the problem itself.
    pub fn new(problem: Arc<Problem>, memory: u64) -> Self {
        let order = BitOrder::rows(problem.roi());
        let entropies = EntropyIndex::new(problem.content(), &order);
        let times = StageTimes::default();
        let (walks, bitmaps) = (Pool::default(), Pool::default());
        let (caster, hits) = (Caster::new(problem.table()), Vec::new());
        Self { problem, order, entropies, memory, times, hits, caster, walks, bitmaps }
    }

    fn poses(&self, sensors: &[SensorPose]) -> Vec<DevicePose> {
        sensors.iter().map(|sensor| DevicePose::new(sensor, self.problem.roi())).collect()
    }

    fn chunks(&self, placements: &[Placement]) -> Result<Vec<Chunk>, BackendError> {
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let widest = lidars.iter().copied().max().unwrap_or(1);
        let bitmap = 8 * self.order.words() as u64;
        let hits = size_of::<Hit>() as u64 * self.problem.table().directions().len() as u64;
        // Bitmaps of as many placements as are worked on at the same time, hits of all in a chunk.
        let tasks = (rayon::current_num_threads() as u64).min(placements.len() as u64).max(1);
        // Each task has one more for the beams that go across.
        let bitmaps = [("coverage bitmaps", bitmap, self.memory / 2 / tasks)];
        ChunkLimits::from_bytes(widest + 1, &bitmaps)?;
        let limit = (self.memory / 2).min(CHUNK_BYTES.max(hits * widest as u64));
        Ok(split(&lidars, ChunkLimits::from_bytes(widest, &[("hits", hits, limit)])?))
    }

    /// Finds the hits of a chunk's beams in one frame, where the coverage needs them.
    fn cast_frame(
        &mut self,
        sensors: &[Pose],
        frame: usize,
        range: f32,
    ) -> Result<(), BackendError> {
        let start = Instant::now();
        if let Some(frame) = self.problem.ends(frame) {
            let beams = sensors.len() * self.problem.table().directions().len();
            memory::reserve(&mut self.hits, beams, "hits")?;
            self.caster.cast_frame(sensors, frame, range, &mut self.hits);
        }
        self.times.cast += start.elapsed();
        Ok(())
    }

    /// Tallies of `placements` in one frame alone.
    ///
    /// # Errors
    /// As [`Backend::tally`], or no such frame.
    pub fn tally_frame(
        &mut self,
        placements: &[Placement],
        frame: usize,
    ) -> Result<Vec<Tally>, BackendError> {
        check_frame(&self.problem, frame)?;
        self.tally_over(&[(frame, 1)], placements, self.problem.table().range())
    }

    /// Tallies of `placements` over some frames, each with the equal ones that it stands for.
    fn tally_over(
        &mut self,
        frames: &[(usize, u64)],
        placements: &[Placement],
        range: f32,
    ) -> Result<Vec<Tally>, BackendError> {
        let classes = self.problem.content().classes().len();
        let mut tallies: Vec<Tally> =
            placements.iter().map(|p| Tally::zero(classes, p.lidars.len())).collect();
        for chunk in self.chunks(placements)? {
            let sensors = placements[chunk.placements.clone()].iter().flat_map(|p| &p.lidars);
            let sensors: Vec<SensorPose> = sensors.copied().collect();
            let (poses, ego_from_sensors) = (self.poses(&sensors), ego_from(&sensors));
            for &(frame, weight) in frames {
                self.cast_frame(&ego_from_sensors, frame, range)?;
                let start = Instant::now();
                let sensors_a_task = self.sensors_a_task(&placements[chunk.placements.clone()]);
                let mut tasks = Vec::new();
                let mut first = 0;
                for (placement, tally) in placements[chunk.placements.clone()]
                    .iter()
                    .zip(&mut tallies[chunk.placements.clone()])
                {
                    let poses = &poses[first..first + placement.lidars.len()];
                    tasks
                        .push((Part { poses, first, frame, weight, range, sensors_a_task }, tally));
                    first += poses.len();
                }
                let of_tasks: Vec<[Duration; 2]> =
                    tasks.into_par_iter().map(|(part, tally)| self.add(&part, tally)).collect();
                // Both stages of a placement run in one task: the wall time is shared out.
                let elapsed = start.elapsed();
                let [cover, both] = [0, 1].map(|k| of_tasks.iter().map(|t| t[k]).sum::<Duration>());
                let share = cover.as_secs_f64() / both.as_secs_f64().max(f64::MIN_POSITIVE);
                let cover = elapsed.mul_f64(share.clamp(0.0, 1.0));
                self.times.cover += cover;
                self.times.reduce += elapsed - cover;
            }
        }
        Ok(tallies)
    }

    /// 1 where threads share the sensors of each placement: then all sensors hold bitmaps at once.
    fn sensors_a_task(&self, placements: &[Placement]) -> usize {
        let sensors: usize = placements.iter().map(|p| p.lidars.len()).sum();
        let fit = 8 * (self.order.words() * sensors) as u64 <= self.memory / 2;
        let few = placements.len() < FEW * rayon::current_num_threads();
        if few && fit { 1 } else { ALL_SENSORS }
    }

    /// Covers the voxels of a part's sensors; `bitmaps` is `[sensors × words]` and zero.
    fn cover(&self, part: &Part<'_>, bitmaps: &mut [u64]) {
        let words = self.order.words();
        let (problem, directions) = (&*self.problem, self.problem.table().directions());
        let cover = |(index, bitmap): (usize, &mut [u64])| {
            let hits = problem.ends(part.frame).map(|_| self.hits_of(part.first + index));
            let pose = &part.poses[index];
            let mut walk = self.walks.take();
            cover_sensor(pose, directions, problem.roi(), hits, part.range, &mut walk, bitmap);
            self.walks.put_back(walk);
        };
        let bitmaps = bitmaps.par_chunks_mut(words).with_min_len(part.sensors_a_task);
        bitmaps.enumerate().for_each(cover);
    }

    fn hits_of(&self, sensor: usize) -> &[Hit] {
        let directions = self.problem.table().directions().len();
        &self.hits[sensor * directions..(sensor + 1) * directions]
    }

    /// Adds one placement's sums in one frame to its tally; returns the time of covering and that of
    /// both together.
    fn add(&self, part: &Part<'_>, tally: &mut Tally) -> [Duration; 2] {
        let start = Instant::now();
        let (words, sensors) = (self.order.words(), part.poses.len());
        let mut kept = self.bitmaps.take();
        if kept.len() < sensors * words {
            kept.resize(sensors * words, 0);
        }
        let bitmaps = &mut kept[..sensors * words];
        self.cover(part, bitmaps);
        let covered = start.elapsed();
        let mut sum = Tally::zero(tally.by_class.len(), sensors);
        take_sums(bitmaps, words, &self.entropies, &mut sum);
        self.bitmaps.put_back(kept);
        sum.beams = (sensors * self.problem.table().directions().len()) as u64;
        if self.problem.ends(part.frame).is_some() {
            let hits = (0..sensors).flat_map(|index| self.hits_of(part.first + index));
            sum.hits = hits.filter(|hit| hit.is_hit()).count() as u64;
        }
        tally.add_times(&sum, part.weight);
        [covered, start.elapsed()]
    }
}

impl Backend for CpuBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> &str {
        "host processor"
    }

    fn tally(&mut self, placements: &[Placement], range: f32) -> Result<Vec<Tally>, BackendError> {
        self.tally_over(&self.problem.distinct_frames(), placements, range)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        let frames = self.problem.geometry_frame_count();
        let frame = self.problem.geometry(frame).ok_or(BackendError::NoFrame { frame, frames })?;
        let start = Instant::now();
        let table = self.problem.table();
        let mut hits = Vec::new();
        memory::reserve(&mut hits, poses.len() * table.directions().len(), "hits")?;
        self.caster.cast_frame(&ego_from(poses), frame, table.range(), &mut hits);
        self.times.cast += start.elapsed();
        Ok(hits)
    }

    fn bitmaps(&mut self, poses: &[SensorPose], frame: usize) -> Result<Bitmaps, BackendError> {
        check_frame(&self.problem, frame)?;
        let range = self.problem.table().range();
        self.cast_frame(&ego_from(poses), frame, range)?;
        let poses = self.poses(poses);
        let start = Instant::now();
        let mut words = memory::zeros(poses.len() * self.order.words(), "coverage bitmaps")?;
        let part = Part { poses: &poses, first: 0, frame, weight: 1, range, sensors_a_task: 1 };
        self.cover(&part, &mut words);
        self.times.cover += start.elapsed();
        Ok(Bitmaps { order: self.order, words })
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}
