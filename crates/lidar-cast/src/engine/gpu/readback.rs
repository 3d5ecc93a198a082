//! Commands to the device's queue, copies of buffers back to the host, and their sums as tallies of a batch.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

use super::device::Device;
use super::layout::{HALVED_SUMS, PARTIAL_WORDS, UNIQUE_SUMS};
use crate::engine::Result;
use crate::sensor::{Placement, UnknownSensor};
use crate::task::{KINDS, SensorBatch, Tally, Task};

/// Staging buffers that are kept: as many copies may be under way at a time.
const KEPT_STAGING: usize = 4;

/// Copies to the host that are under way.
pub(super) struct ReadBack {
    stage: &'static str,
    staging: wgpu::Buffer,
    /// Bytes of each source in `staging`.
    parts: Vec<Range<usize>>,
    submission: wgpu::SubmissionIndex,
    answer: Arc<Mutex<Option<Result<(), wgpu::BufferAsyncError>>>>,
}

impl Device {
    /// Hands recorded commands to the device, which runs them after all before them.
    pub(super) fn enqueue(
        &self,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> wgpu::SubmissionIndex {
        self.count(|traffic| traffic.submissions += 1);
        let mut encoder = self.wgpu.create_command_encoder(&Default::default());
        record(&mut encoder);
        self.queue.submit([encoder.finish()])
    }

    /// Waits for a submission and all before it.
    pub(super) fn wait(
        &self,
        stage: &'static str,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<()> {
        self.count(|traffic| traffic.waits += 1);
        let submission_index = Some(submission.clone());
        let poll = wgpu::PollType::Wait { submission_index, timeout: None };
        // wgpu reports a device that a wait finds lost with a panic.
        let waited = caught(|| self.wgpu.poll(poll));
        if !matches!(waited, Ok(Ok(_))) {
            // A device that refused the submission says why once all before it has ended.
            let _ = caught(|| self.wgpu.poll(wgpu::PollType::wait_indefinitely()));
        }
        // The callbacks know more than the panic.
        self.check(stage)?;
        match waited {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(self.failed(stage, error.to_string())),
            Err(message) => Err(self.failed(stage, message)),
        }
    }

    /// Starts recorded commands, then copies of the first bytes of some buffers to the host.
    pub(super) fn start(
        &self,
        stage: &'static str,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
        sources: &[(&wgpu::Buffer, u64)],
    ) -> Result<ReadBack> {
        let mut size = 0;
        let mut parts = Vec::with_capacity(sources.len());
        for &(_, bytes) in sources {
            parts.push(size as usize..(size + bytes) as usize);
            size = (size + bytes).next_multiple_of(wgpu::MAP_ALIGNMENT);
        }
        let staging = self.staging(size)?;
        let submission = self.enqueue(|encoder| {
            record(encoder);
            for (&(source, bytes), part) in sources.iter().zip(&parts) {
                let size = bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT);
                encoder.copy_buffer_to_buffer(source, 0, &staging, part.start as u64, size);
            }
        });
        let answer = Arc::new(Mutex::new(None));
        let sink = answer.clone();
        staging.map_async(wgpu::MapMode::Read, 0..size, move |result| {
            if let Ok(mut slot) = sink.lock() {
                *slot = Some(result);
            }
        });
        Ok(ReadBack { stage, staging, parts, submission, answer })
    }

    /// Waits for the copies, and hands the bytes of each source to `take`.
    pub(super) fn finish<R>(
        &self,
        reading: ReadBack,
        take: impl FnOnce(&[&[u8]]) -> R,
    ) -> Result<R> {
        let ReadBack { stage, staging, parts, submission, answer } = reading;
        self.wait(stage, &submission)?;
        match answer.lock().ok().and_then(|mut slot| slot.take()) {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(self.failed(stage, error.to_string())),
            None => return Err(self.failed(stage, "the read-back never finished".into())),
        }
        let size = parts.last().map_or(0, |part| part.end as u64);
        let view = staging
            .get_mapped_range(0..size.next_multiple_of(wgpu::MAP_ALIGNMENT))
            .map_err(|error| self.failed(stage, error.to_string()))?;
        self.count(|traffic| traffic.bytes_down += size);
        let bytes: Vec<&[u8]> = parts.iter().map(|part| &view[part.clone()]).collect();
        let taken = take(&bytes);
        drop(view);
        staging.unmap();
        self.keep(staging);
        Ok(taken)
    }

    /// A buffer to map, one used before where it is large enough.
    fn staging(&self, size: u64) -> Result<wgpu::Buffer> {
        if let Ok(mut kept) = self.staging.lock() {
            kept.sort_by_key(wgpu::Buffer::size);
            if let Some(found) = kept.iter().position(|buffer| buffer.size() >= size) {
                return Ok(kept.remove(found));
            }
            // The largest gives way to one that is large enough.
            kept.pop();
        }
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        self.buffer("read-back", size, usage)
    }

    fn keep(&self, staging: wgpu::Buffer) {
        if let Ok(mut kept) = self.staging.lock()
            && kept.len() < KEPT_STAGING
        {
            kept.push(staging);
        }
    }

    /// Copies the first `bytes` of a buffer to the host.
    pub(super) fn read<T: bytemuck::Pod>(
        &self,
        stage: &'static str,
        buffer: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Vec<T>> {
        let reading = self.start(stage, |_| {}, &[(buffer, bytes)])?;
        self.finish(reading, |parts| bytemuck::pod_collect_to_vec(parts[0]))
    }
}

/// The result of `work`, or the words of its panic.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default()
    })
}

pub(super) struct BatchTallies {
    classes: usize,
    pub(super) tallies: Vec<Tally>,
}

impl BatchTallies {
    /// Zero but for the beams, over frames that stand for `frames` in all.
    pub(super) fn new(
        task: &Task,
        placements: &[Placement],
        frames: u64,
    ) -> Result<Self, UnknownSensor> {
        let classes = task.content().set_count();
        let of_placement = |placement: &Placement| {
            let batch = SensorBatch::new(task, &placement.lidars, None)?;
            let beams = frames * batch.beams() as u64;
            Ok(Tally { beams, ..Tally::zero(classes, batch.len()) })
        };
        let tallies = placements.iter().map(of_placement).collect::<Result<_, _>>()?;
        Ok(Self { classes, tallies })
    }

    /// Adds the hits of a chunk's sensors in a frame that stands for `weight` equal ones; `sensors` holds
    /// first sensor and number of sensors by placement.
    pub(super) fn add_hits(
        &mut self,
        chunk: Range<usize>,
        sensors: &[[u32; 2]],
        weight: u64,
        hits: &[u32],
    ) {
        for (tally, [first, lidars]) in self.tallies[chunk].iter_mut().zip(sensors) {
            let own = &hits[*first as usize..(first + lidars) as usize];
            tally.hits += weight * own.iter().map(|&h| u64::from(h)).sum::<u64>();
        }
    }

    /// Adds a chunk's totals and partial sums in a frame that stands for `weight` equal ones.
    pub(super) fn add_sums(
        &mut self,
        chunk: Range<usize>,
        weight: u64,
        totals: &[u32],
        partials: &[u32],
    ) {
        let stride = 1 + self.classes;
        let each = partials.len() / chunk.len();
        for (index, tally) in self.tallies[chunk].iter_mut().enumerate() {
            let mut of_frame = Tally::zero(self.classes, tally.unique.len());
            let totals = &totals[index * stride..(index + 1) * stride];
            of_frame.covered = u64::from(totals[0]);
            for (sum, &count) in of_frame.by_class.iter_mut().zip(&totals[1..]) {
                *sum = u64::from(count);
            }
            let own = &partials[index * each..(index + 1) * each];
            own.chunks(PARTIAL_WORDS as usize).for_each(|p| add_partial(p, &mut of_frame));
            tally.add_times(&of_frame, weight);
        }
    }
}

/// Adds one workgroup's sums, low half + 2¹⁶ · high half each.
fn add_partial(partial: &[u32], tally: &mut Tally) {
    let sum = |slot: u32| {
        let at = 1 + 2 * slot as usize;
        u64::from(partial[at]) + (u64::from(partial[at + 1]) << 16)
    };
    tally.covered_nonzero += u64::from(partial[0]);
    for (slot, entropy) in tally.entropy.iter_mut().enumerate() {
        *entropy += sum(slot as u32);
    }
    for (slot, repeated) in (KINDS as u32..UNIQUE_SUMS).zip(&mut tally.near_repeated) {
        *repeated += sum(slot);
    }
    for (slot, unique) in (UNIQUE_SUMS..HALVED_SUMS).zip(&mut tally.unique) {
        *unique += sum(slot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_words() {
        assert_eq!(caught(|| 3), Ok(3));
        assert_eq!(caught(|| -> u8 { panic!("lost {}", 7) }), Err("lost 7".to_owned()));
        assert_eq!(caught(|| -> u8 { panic!("lost") }), Err("lost".to_owned()));
    }
}
