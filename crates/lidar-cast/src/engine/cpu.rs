//! The CPU: every stage as a plain function, and a fast one beside it that gives the same bits.
//!
//! | reference, to be read | fast, run by [`CpuBackend`] |
//! |---|---|
//! | [`cast_frame_closest`](crate::cast::cast_frame_closest): a beam at a time | [`Caster`]: all beams of a sensor at once |
//! | [`cover_voxels`]: a voxel at a time | [`cover_sensor`]: sixteen beams in lockstep, a row of voxels at a time |
//! | [`reduce()`]: a voxel at a time | `take_sums`: a word of the bitmaps at a time |
//!
//! Lanes are plain arrays; each kernel is compiled for several instruction sets and picked at run time.
//! None contracts a product and a sum, so all give the same bits.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::{Backend, BackendError, Chunk, ChunkLimits, Result, TakeBitmap, check_frame, split};
use crate::bvh::Hit;
use crate::cast::Caster;
use crate::cover::{BitOrder, WalkScratch, cover_sensor};
use crate::geom::Pose;
use crate::memory::{self, FreeList};
use crate::reduce::{EntropyIndex, take_sums};
use crate::sensor::{MAX_LIDARS, Placement, SensorPose};
use crate::task::{DevicePose, Frame, SensorBatch, StageTimes, Tally, Task};

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
    task: Arc<Task>,
    order: BitOrder,
    entropies: EntropyIndex,
    memory: u64,
    times: StageTimes,
    /// Kept from batch to batch.
    hits: Vec<Hit>,
    /// One a sensor model.
    casters: Vec<Caster>,
    walks: FreeList<WalkScratch>,
    /// `[sensors × words]` in `order`, zero between tasks.
    bitmaps: FreeList<Vec<u64>>,
}

struct SensorsInFrame<'a> {
    batch: &'a SensorBatch<'a>,
    /// Poses in the grid of voxels.
    poses: Vec<DevicePose>,
    frame: usize,
    /// Equal frames that it stands for.
    weight: u64,
    /// Fewest sensors that a thread takes.
    sensors_a_task: usize,
}

impl CpuBackend {
    /// A backend that uses at most about `memory` bytes beside the task itself.
    pub fn new(task: Arc<Task>, memory: u64) -> Self {
        let order = BitOrder::rows(task.roi());
        let entropies = EntropyIndex::new(task.content(), &order);
        let times = StageTimes::default();
        let (walks, bitmaps) = (FreeList::default(), FreeList::default());
        let models = task.sensors().models();
        let casters = models.iter().map(|model| Caster::new(&model.table)).collect();
        let hits = Vec::new();
        Self { task, order, entropies, memory, times, hits, casters, walks, bitmaps }
    }

    fn chunks(&self, placements: &[Placement]) -> Result<Vec<Chunk>> {
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let widest = lidars.iter().copied().max().unwrap_or(1);
        let bitmap = 8 * self.order.words() as u64;
        let hits = size_of::<Hit>() as u64 * self.task.sensors().most_beams() as u64;
        // Bitmaps of as many placements as are worked on at the same time, hits of all in a chunk.
        let tasks = (rayon::current_num_threads() as u64).min(placements.len() as u64).max(1);
        // Each task has one more for the beams that go across.
        let bitmaps = [("coverage bitmaps", bitmap, self.memory / 2 / tasks)];
        ChunkLimits::from_bytes(widest + 1, &bitmaps)?;
        let limit = (self.memory / 2).min(CHUNK_BYTES.max(hits * widest as u64));
        Ok(split(&lidars, ChunkLimits::from_bytes(widest, &[("hits", hits, limit)])?))
    }

    /// Finds the hits of a batch's beams in one frame, where the coverage needs them.
    fn cast_frame(
        &mut self,
        batch: &SensorBatch<'_>,
        sensors: &[Pose],
        frame: usize,
    ) -> Result<()> {
        let start = Instant::now();
        if let Some(geometry) = self.task.ends(frame) {
            memory::reserve(&mut self.hits, batch.beams(), "hits")?;
            cast(&self.casters, batch, sensors, geometry, &mut self.hits);
            if let Some(air) = self.task.air() {
                let number = self.task.number_of(frame);
                air.dim(batch, sensors, geometry, number, &mut self.hits);
            }
        }
        self.times.cast += start.elapsed();
        Ok(())
    }

    /// Tallies of `placements` in one frame alone.
    ///
    /// # Errors
    /// Like [`Backend::tally`], or no such frame.
    pub fn tally_frame(&mut self, placements: &[Placement], frame: usize) -> Result<Vec<Tally>> {
        check_frame(&self.task, frame)?;
        self.tally_over(&[(frame, 1)], placements, None)
    }

    /// Tallies of `placements` over some frames, each with the equal ones that it stands for.
    fn tally_over(
        &mut self,
        frames: &[(usize, u64)],
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Tally>> {
        let task = self.task.clone();
        let classes = task.content().set_count();
        let mut tallies: Vec<Tally> =
            placements.iter().map(|p| Tally::zero(classes, p.lidars.len())).collect();
        for chunk in self.chunks(placements)? {
            let placements = &placements[chunk.placements.clone()];
            let sensors = placements.iter().flat_map(|p| &p.lidars);
            let batch = SensorBatch::new(&task, sensors, range)?;
            let sensors_a_task = self.sensors_a_task(placements);
            for &(frame, weight) in frames {
                let ego_from_sensors = batch.ego_from_sensors(frame);
                self.cast_frame(&batch, &ego_from_sensors, frame)?;
                let start = Instant::now();
                let poses = batch.in_grid(&ego_from_sensors);
                let batch = &batch;
                let standing = SensorsInFrame { batch, poses, frame, weight, sensors_a_task };
                let mut first = 0;
                let sensors_of = |placement: &Placement| {
                    let sensors = first..first + placement.lidars.len();
                    first = sensors.end;
                    sensors
                };
                let sensors: Vec<Range<usize>> = placements.iter().map(sensors_of).collect();
                let tasks = sensors.into_par_iter().zip(&mut tallies[chunk.placements.clone()]);
                let of_tasks: Vec<[Duration; 2]> =
                    tasks.map(|(sensors, tally)| self.add(&standing, sensors, tally)).collect();
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

    /// Covers the voxels of some sensors; `bitmaps` is `[sensors × words]` and zero.
    fn cover(&self, standing: &SensorsInFrame<'_>, sensors: Range<usize>, bitmaps: &mut [u64]) {
        let SensorsInFrame { batch, poses, frame, sensors_a_task, .. } = standing;
        let ends = self.task.ends(*frame).is_some();
        let cover = |(index, bitmap): (usize, &mut [u64])| {
            let sensor = sensors.start + index;
            let (directions, range) = (batch.table(sensor).directions(), batch.range(sensor));
            let hits = ends.then(|| &self.hits[batch.beams_of(sensor)]);
            let (pose, roi) = (&poses[sensor], self.task.roi());
            let mut walk = self.walks.take();
            cover_sensor(pose, directions, roi, hits, range, &mut walk, bitmap);
            self.walks.put_back(walk);
        };
        let bitmaps = bitmaps.par_chunks_mut(self.order.words()).with_min_len(*sensors_a_task);
        bitmaps.enumerate().for_each(cover);
    }

    /// At least `sensors` bitmaps, all zero; the caller returns them zeroed.
    fn zero_bitmaps(&self, sensors: usize) -> Vec<u64> {
        let mut kept = self.bitmaps.take();
        if kept.len() < sensors * self.order.words() {
            kept.resize(sensors * self.order.words(), 0);
        }
        kept
    }

    /// Adds one placement's sums in one frame to its tally. Returns two durations: covering alone, and covering
    /// with the sums.
    fn add(
        &self,
        standing: &SensorsInFrame<'_>,
        sensors: Range<usize>,
        tally: &mut Tally,
    ) -> [Duration; 2] {
        let start = Instant::now();
        let (words, count) = (self.order.words(), sensors.len());
        let mut kept = self.zero_bitmaps(count);
        let bitmaps = &mut kept[..count * words];
        self.cover(standing, sensors.clone(), bitmaps);
        let covered = start.elapsed();
        let mut sum = Tally::zero(tally.by_class.len(), count);
        take_sums(bitmaps, words, &self.entropies, &mut sum);
        self.bitmaps.put_back(kept);
        let beams = sensors.map(|sensor| standing.batch.beams_of(sensor));
        for beams in beams {
            sum.beams += beams.len() as u64;
            if self.task.ends(standing.frame).is_some() {
                let hits = self.hits[beams].iter().filter(|hit| hit.is_hit());
                sum.hits += hits.count() as u64;
            }
        }
        tally.add_times(&sum, standing.weight);
        [covered, start.elapsed()]
    }
}

/// Closest hits of a batch in a frame; each model's beams are cast by the model's caster.
fn cast(
    casters: &[Caster],
    batch: &SensorBatch<'_>,
    ego_from_sensors: &[Pose],
    frame: &Frame,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    for sensor in 0..batch.len() {
        let beams = batch.beams_of(sensor);
        hits.resize(beams.end, Hit::none(batch.range(sensor)));
    }
    let mut rest = &mut hits[..];
    let mut of_model: Vec<(Vec<Pose>, Vec<&mut [Hit]>)> =
        casters.iter().map(|_| Default::default()).collect();
    for (sensor, pose) in ego_from_sensors.iter().enumerate() {
        let (row, others) = rest.split_at_mut(batch.beams_of(sensor).len());
        rest = others;
        let (poses, rows) = &mut of_model[batch.model(sensor)];
        poses.push(*pose);
        rows.push(row);
    }
    for (caster, (poses, rows)) in casters.iter().zip(of_model) {
        caster.closer_hits_in(&poses, frame, rows);
    }
}

impl Backend for CpuBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> &str {
        "host processor"
    }

    fn tally(&mut self, placements: &[Placement], range: Option<f32>) -> Result<Vec<Tally>> {
        self.tally_over(&self.task.distinct_frames(), placements, range)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>> {
        let frames = self.task.geometry_frame_count();
        let geometry = self.task.geometry(frame);
        let geometry = geometry.ok_or(BackendError::NoFrame { frame, frames })?;
        let start = Instant::now();
        let batch = SensorBatch::new(&self.task, poses, None)?;
        let mut hits = Vec::new();
        memory::reserve(&mut hits, batch.beams(), "hits")?;
        cast(&self.casters, &batch, &batch.ego_from_sensors(frame), geometry, &mut hits);
        self.times.cast += start.elapsed();
        Ok(hits)
    }

    fn order(&self) -> BitOrder {
        self.order
    }

    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<()> {
        check_frame(&self.task, frame)?;
        let task = self.task.clone();
        let batch = SensorBatch::new(&task, poses, None)?;
        let ego_from_sensors = batch.ego_from_sensors(frame);
        self.cast_frame(&batch, &ego_from_sensors, frame)?;
        let start = Instant::now();
        let poses = batch.in_grid(&ego_from_sensors);
        let standing = SensorsInFrame { batch: &batch, poses, frame, weight: 1, sensors_a_task: 1 };
        (0..batch.len()).into_par_iter().for_each(|sensor| {
            let mut kept = self.zero_bitmaps(1);
            let bitmap = &mut kept[..self.order.words()];
            self.cover(&standing, sensor..sensor + 1, bitmap);
            take(sensor, &self.order, bitmap);
            bitmap.fill(0);
            self.bitmaps.put_back(kept);
        });
        self.times.cover += start.elapsed();
        Ok(())
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}
