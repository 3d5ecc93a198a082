use std::sync::Arc;

use rayon::prelude::*;

use super::flow::Made;
use super::prepared::{Prepared, Slice};
use crate::engine::gpu::layout::{HALVED_SUMS, PARTIAL_WORDS};
use crate::problem::{Problem, Tally};
use crate::reduce::{Worth, add_sums};
use crate::vehicle::Placement;

/// Tallies of a batch, to which the host adds what the device made.
pub(super) struct Sums {
    classes: usize,
    /// Host twin of the reductions, where they run on the host.
    worth: Option<Arc<Worth>>,
    /// Frames that each frame stands for.
    weights: Vec<u64>,
    pub(super) tallies: Vec<Tally>,
}

impl Sums {
    pub(super) fn new(
        problem: &Problem,
        worth: Option<Arc<Worth>>,
        weights: Vec<u64>,
        placements: &[Placement],
    ) -> Self {
        let classes = problem.content().classes().len();
        // Cast or not, where they end nowhere.
        let beams = weights.iter().sum::<u64>() * problem.table().directions().len() as u64;
        let of_placement = |placement: &Placement| {
            let lidars = placement.lidars.len();
            Tally { beams: lidars as u64 * beams, ..Tally::zero(classes, lidars) }
        };
        let tallies = placements.iter().map(of_placement).collect();
        Self { classes, worth, weights, tallies }
    }

    /// Adds what was made of a chunk in the frame of so many turns.
    pub(super) fn add(&mut self, chunk: &Prepared, turn: usize, made: Made<'_>) {
        let weight = self.weights[turn];
        match made {
            Made::Hits(hits) => self.add_hits(chunk, weight, hits),
            Made::Bitmaps(slice, bitmaps) => self.add_bitmaps(chunk, weight, slice, bitmaps),
            Made::Sums { totals, partials } => self.add_sums(chunk, weight, totals, partials),
        }
    }

    fn add_hits(&mut self, chunk: &Prepared, weight: u64, hits: &[u32]) {
        let tallies = &mut self.tallies[chunk.batch.clone()];
        for (tally, [first, lidars]) in tallies.iter_mut().zip(&chunk.placements) {
            let own = &hits[*first as usize..(first + lidars) as usize];
            tally.hits += weight * own.iter().map(|&h| u64::from(h)).sum::<u64>();
        }
    }

    fn add_bitmaps(&mut self, chunk: &Prepared, weight: u64, slice: &Slice, bitmaps: &[u32]) {
        let Some(worth) = &self.worth else { return };
        let words = bitmaps.len() / slice.sensors as usize;
        let tallies = &mut self.tallies[chunk.batch.clone()][slice.placements.clone()];
        let mut rest = bitmaps;
        let mut tasks = Vec::with_capacity(tallies.len());
        for (tally, [_, lidars]) in
            tallies.iter_mut().zip(&chunk.placements[slice.placements.clone()])
        {
            let (own, after) = rest.split_at(*lidars as usize * words);
            rest = after;
            tasks.push((bytemuck::cast_slice(own), tally));
        }
        tasks.into_par_iter().for_each(|(own, tally)| {
            let mut of_frame = Tally::zero(self.classes, tally.unique.len());
            add_sums(own, words / 2, worth, &mut of_frame);
            tally.add_times(&of_frame, weight);
        });
    }

    fn add_sums(&mut self, chunk: &Prepared, weight: u64, totals: &[u32], partials: &[u32]) {
        let stride = 1 + self.classes;
        let each = partials.len() / chunk.placements.len();
        for (index, tally) in self.tallies[chunk.batch.clone()].iter_mut().enumerate() {
            let mut of_frame = Tally::zero(self.classes, tally.unique.len());
            let totals = &totals[index * stride..(index + 1) * stride];
            of_frame.covered = u64::from(totals[0]);
            for (sum, &count) in of_frame.by_class.iter_mut().zip(&totals[1..]) {
                *sum = u64::from(count);
            }
            for partial in partials[index * each..(index + 1) * each].chunks(PARTIAL_WORDS as usize)
            {
                add_partial(partial, &mut of_frame);
            }
            tally.add_times(&of_frame, weight);
        }
    }
}

/// Puts the 16-bit halves of one workgroup's sums together.
fn add_partial(partial: &[u32], tally: &mut Tally) {
    let sum = |slot: u32| {
        let at = 1 + 2 * slot as usize;
        u64::from(partial[at]) + (u64::from(partial[at + 1]) << 16)
    };
    tally.covered_nonzero += u64::from(partial[0]);
    for (slot, entropy) in tally.entropy.iter_mut().enumerate() {
        *entropy += sum(slot as u32);
    }
    for (slot, unique) in (3..HALVED_SUMS).zip(&mut tally.unique) {
        *unique += sum(slot);
    }
}
