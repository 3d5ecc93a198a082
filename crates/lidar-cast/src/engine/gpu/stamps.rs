//! Times that the device writes down at the end of each stage.

use std::time::Duration;

use super::pipeline::TOGETHER;

/// Stages of a step, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    Cast,
    Cover,
    Reduce,
}

/// Most times of a submission: the begin of each step, and the end of each of its stages.
const STAMPS: u32 = 4 * TOGETHER as u32;

/// Times of one submission on the device. The next one writes over them, once they are copied.
pub(super) struct Stamps {
    set: wgpu::QuerySet,
    /// Nanoseconds of a tick.
    period: f64,
    resolved: wgpu::Buffer,
}

impl Stamps {
    /// Room for the times of a submission; `None` on a device that tells no time.
    pub(super) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let set = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: STAMPS,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times"),
            size: 8 * u64::from(STAMPS),
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Self { set, period: f64::from(queue.get_timestamp_period()), resolved })
    }

    /// The times of a stage: its end has the number after `begin`, and its begin that number where it begins a step.
    pub(super) fn of(
        &self,
        begin: usize,
        begins_step: bool,
    ) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: begins_step.then_some(begin as u32),
            end_of_pass_write_index: Some(begin as u32 + 1),
        }
    }

    /// Copies the first times to [`Self::resolved`].
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, count: usize) {
        encoder.resolve_query_set(&self.set, 0..count as u32, &self.resolved, 0);
    }

    /// Bytes of some times.
    pub(super) fn bytes(&self, count: usize) -> u64 {
        8 * count as u64
    }

    /// Time of some ticks.
    pub(super) fn time(&self, ticks: u64) -> Duration {
        Duration::from_nanos((ticks as f64 * self.period) as u64)
    }

    /// Ticks of the device.
    pub(super) fn resolved(&self) -> &wgpu::Buffer {
        &self.resolved
    }
}

/// Adds the ticks of a step's stages, which lie between its times.
pub(super) fn stage_ticks(stages: &[Stage], stamps: &[u64], ticks: &mut [u64; 3]) {
    for (stage, between) in stages.iter().zip(stamps.windows(2)) {
        ticks[*stage as usize] += between[1].saturating_sub(between[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_lie_between_times() {
        let mut ticks = [1, 0, 0];
        stage_ticks(&[Stage::Cast, Stage::Cover, Stage::Reduce], &[10, 13, 18, 25], &mut ticks);
        assert_eq!(ticks, [4, 5, 7]);
        // Only coverage; the rest is of an earlier step.
        stage_ticks(&[Stage::Cover], &[30, 32, 18, 25], &mut ticks);
        assert_eq!(ticks, [4, 7, 7]);
    }
}
