//! Times that the device writes down at the end of each stage.

use std::time::Duration;

/// Stages of a step, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepStage {
    Cast,
    Cover,
    Reduce,
}

/// Most times of a step: its begin, and the end of each stage.
const STAMPS: u32 = 4;
/// Bytes of the times of a step.
pub(super) const STAMP_BYTES: u64 = 8 * STAMPS as u64;

/// Times of one step on the device. The next step writes over them, once they are copied.
pub(super) struct Stamps {
    set: wgpu::QuerySet,
    /// Nanoseconds of a tick.
    period: f64,
    resolved: wgpu::Buffer,
}

impl Stamps {
    /// Room for the times of a step; `None` on a device that tells no time.
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
            size: STAMP_BYTES,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Self { set, period: f64::from(queue.get_timestamp_period()), resolved })
    }

    /// The times of a stage, given by its number in the step: the first one also begins.
    pub(super) fn of(&self, stage: usize) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: (stage == 0).then_some(0),
            end_of_pass_write_index: Some(stage as u32 + 1),
        }
    }

    /// Copies the times of a step of some stages to [`Self::resolved`].
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, stages: usize) {
        encoder.resolve_query_set(&self.set, 0..stages as u32 + 1, &self.resolved, 0);
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
pub(super) fn stage_ticks(stages: &[StepStage], stamps: &[u64], ticks: &mut [u64; 3]) {
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
        stage_ticks(
            &[StepStage::Cast, StepStage::Cover, StepStage::Reduce],
            &[10, 13, 18, 25],
            &mut ticks,
        );
        assert_eq!(ticks, [4, 5, 7]);
        // Only coverage; the rest is of an earlier step.
        stage_ticks(&[StepStage::Cover], &[30, 32, 18, 25], &mut ticks);
        assert_eq!(ticks, [4, 7, 7]);
    }
}
