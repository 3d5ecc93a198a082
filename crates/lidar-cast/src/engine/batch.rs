//! Batches cut into chunks that fit memory and device limits.

use std::ops::Range;

use super::BackendError;

/// Part of a batch that is evaluated at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chunk {
    /// Placements of the batch.
    pub placements: Range<usize>,
    /// Their sensors, counted over the whole batch.
    pub sensors: Range<usize>,
}

/// Limits of a chunk.
#[derive(Debug, Clone, Copy)]
pub struct ChunkLimits {
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
    pub fn from_bytes(
        lidars: usize,
        bounds: &[(&'static str, u64, u64)],
    ) -> Result<Self, BackendError> {
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
pub fn split(lidars: &[usize], limits: ChunkLimits) -> Vec<Chunk> {
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
