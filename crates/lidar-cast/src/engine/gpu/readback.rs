//! Commands to the device's queue, and copies of buffers back to the host.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

use super::device::Device;
use crate::engine::BackendError;

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

impl ReadBack {
    /// The commands that end with the copies.
    pub(super) fn submission(&self) -> &wgpu::SubmissionIndex {
        &self.submission
    }
}

impl Device {
    /// Hands recorded commands to the device, which runs them after all before them.
    pub(super) fn enqueue(
        &self,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> wgpu::SubmissionIndex {
        let mut encoder = self.wgpu().create_command_encoder(&Default::default());
        record(&mut encoder);
        self.queue().submit([encoder.finish()])
    }

    /// Waits for a submission and all before it.
    pub(super) fn wait(
        &self,
        stage: &'static str,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<(), BackendError> {
        let submission_index = Some(submission.clone());
        let poll = wgpu::PollType::Wait { submission_index, timeout: None };
        // wgpu reports a device that a wait finds lost with a panic.
        let waited = caught(|| self.wgpu().poll(poll));
        if !matches!(waited, Ok(Ok(_))) {
            // A device that refused the submission says why once all before it has ended.
            let _ = caught(|| self.wgpu().poll(wgpu::PollType::wait_indefinitely()));
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
    ) -> Result<ReadBack, BackendError> {
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
    ) -> Result<R, BackendError> {
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
        let bytes: Vec<&[u8]> = parts.iter().map(|part| &view[part.clone()]).collect();
        let taken = take(&bytes);
        drop(view);
        staging.unmap();
        self.keep(staging);
        Ok(taken)
    }

    /// A buffer to map, one used before where it is large enough.
    fn staging(&self, size: u64) -> Result<wgpu::Buffer, BackendError> {
        if let Ok(mut kept) = self.kept_staging().lock() {
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
        if let Ok(mut kept) = self.kept_staging().lock()
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
    ) -> Result<Vec<T>, BackendError> {
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
