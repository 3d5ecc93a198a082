//! Adds up the reductions' results on the host, into tallies of a batch.

use std::ops::Range;

use super::layout::{HALVED_SUMS, PARTIAL_WORDS};
use crate::sensor::{Placement, UnknownSensor};
use crate::task::{KINDS, SensorBatch, Tally, Task};

/// Tallies of a batch.
pub(super) struct Sums {
    classes: usize,
    pub(super) tallies: Vec<Tally>,
}

impl Sums {
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
    for (slot, unique) in (KINDS as u32..HALVED_SUMS).zip(&mut tally.unique) {
        *unique += sum(slot);
    }
}
