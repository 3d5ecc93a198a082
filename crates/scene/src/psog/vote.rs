//! Labelled points to one class a voxel and frame, frames to a P-SOG.

use rayon::prelude::*;
use serde::Serialize;

use super::counts::{check_classes, refused};
use super::{Psog, PsogError, Roi};

/// Votes that [`FrameVotes`] adds up before it lists them, a power of two.
const RECENT: usize = 16384;

/// The labelled points of one frame as votes: each point votes for its class in its voxel.
#[derive(Debug, Clone, Default)]
pub struct FrameVotes {
    /// `voxel << 32 | class << 16 | votes`, so that sorting groups voxels and, in them, classes. One pair
    /// of voxel and class may be listed several times.
    entries: Vec<u64>,
    /// Entries that may still grow, each at a place hashed from voxel and class. Points near each other
    /// follow one another, and merged votes need no sorting. None until the first vote.
    recent: Vec<u64>,
    outside: u64,
}

impl FrameVotes {
    /// No votes yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the votes of points found in parallel.
    pub fn par_extend<I>(&mut self, votes: I)
    where
        I: ParallelIterator<Item = (Option<u64>, u16)>,
    {
        let parts: Vec<Self> = votes
            .fold(Self::new, |mut part, vote| {
                part.extend([vote]);
                part
            })
            .collect();
        parts.into_iter().for_each(|part| self.append(part));
    }

    fn append(&mut self, other: Self) {
        self.entries.extend(other.entries);
        self.entries.extend(other.recent.into_iter().filter(|entry| *entry as u16 > 0));
        self.outside += other.outside;
    }

    fn sort(&mut self) {
        self.entries.extend(self.recent.drain(..).filter(|entry| *entry as u16 > 0));
        self.entries.par_sort_unstable();
    }
}

/// Adds votes of points; `None` is a point outside the grid, which is only counted.
impl Extend<(Option<u64>, u16)> for FrameVotes {
    fn extend<I: IntoIterator<Item = (Option<u64>, u16)>>(&mut self, votes: I) {
        self.recent.resize(RECENT, 0);
        for (voxel, class) in votes {
            let Some(voxel) = voxel else {
                self.outside += 1;
                continue;
            };
            // No grid reaches 2³² voxels; a number that large stays wrong, and is reported.
            let key = voxel.min(u32::MAX.into()) << 16 | u64::from(class);
            // Knuth, The Art of Computer Programming 3, §6.4: the golden ratio spreads neighbours.
            let slot = key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (64 - RECENT.ilog2());
            let recent = &mut self.recent[slot as usize];
            if *recent >> 16 != key || *recent as u16 == u16::MAX {
                if *recent as u16 > 0 {
                    self.entries.push(*recent);
                }
                *recent = key << 16;
            }
            *recent += 1;
        }
    }
}

/// Counts of the votes and ties of a P-SOG that was built.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct BuildReport {
    /// Frames voted.
    pub frames: u64,
    /// Voxels that got a class, each counted once a frame.
    pub voxels_voted: u64,
    /// Voted voxels in which two or more classes had most votes; the lowest class id won.
    pub ties: u64,
    /// Points that voted.
    pub points_in: u64,
    /// Points with a class that lie outside the grid.
    pub points_outside: u64,
}

impl BuildReport {
    /// Share of voted voxels that were ties, 0 to 1; 0 if none was voted.
    pub fn tie_share(&self) -> f64 {
        if self.voxels_voted == 0 { 0.0 } else { self.ties as f64 / self.voxels_voted as f64 }
    }

    /// The report over both builds.
    pub(super) fn add(&self, other: &Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            voxels_voted: self.voxels_voted + other.voxels_voted,
            ties: self.ties + other.ties,
            points_in: self.points_in + other.points_in,
            points_outside: self.points_outside + other.points_outside,
        }
    }
}

/// Builds a P-SOG frame by frame: in each frame a voxel gets the class that most of its points
/// have (Place3D, SOG); equal votes go to the lowest class id.
///
/// Memory: the points of one frame and, for each voxel and class seen so far, at most two 8-byte
/// entries.
#[derive(Debug)]
pub struct PsogBuilder {
    roi: Roi,
    classes: Vec<String>,
    /// Sorted runs of `voxel << 32 | class << 16 | frames`, each at least twice as long as the next,
    /// so that adding a frame costs O(log frames) a voxel.
    runs: Vec<Vec<u64>>,
    report: BuildReport,
}

impl PsogBuilder {
    /// A builder over this grid and these classes.
    ///
    /// # Errors
    /// Class names that no P-SOG may have; see [`Psog::new`].
    pub fn new(roi: Roi, classes: Vec<String>) -> Result<Self, PsogError> {
        check_classes(&classes)?;
        Ok(Self { roi, classes, runs: Vec::new(), report: BuildReport::default() })
    }

    /// Votes one frame and adds its SOG to the counts. A frame without votes is empty everywhere.
    ///
    /// # Errors
    /// A vote for a class or voxel that does not exist, or more than 65 535 frames; the frame is
    /// then not added.
    pub fn frame(&mut self, votes: FrameVotes) -> Result<(), PsogError> {
        self.frames(vec![votes])
    }

    /// [`Self::frame`] of several frames in their order, side by side.
    ///
    /// # Errors
    /// Errors of the frame; none is then added.
    pub fn frames(&mut self, votes: Vec<FrameVotes>) -> Result<(), PsogError> {
        let first = self.report.frames;
        let after = first + votes.len() as u64;
        if after > u64::from(u16::MAX) {
            let (limit, frame) = (u16::MAX, u64::from(u16::MAX) + 1);
            return Err(refused!(
                "frame {frame} is one too many: a voxel's count holds at most {limit} frames; build from fewer frames"
            ));
        }
        let voted = votes.into_par_iter().enumerate();
        let runs: Vec<(Vec<u64>, BuildReport)> = voted
            .map(|(k, votes)| self.voted(first + k as u64, votes))
            .collect::<Result<_, _>>()?;
        let (runs, reports): (Vec<_>, Vec<_>) = runs.into_iter().unzip();
        self.report = reports.iter().fold(self.report, |sum, report| sum.add(report));
        let run =
            runs.into_par_iter().reduce(Vec::new, |a, b| match (a.is_empty(), b.is_empty()) {
                (true, _) => b,
                (_, true) => a,
                _ => merge_runs(&a, &b),
            });
        self.runs.push(run);
        while let [.., a, b] = &self.runs[..]
            && a.len() < 2 * b.len()
        {
            self.merge_last_two();
        }
        Ok(())
    }

    /// The SOG of one frame, sorted, and how its vote went.
    fn voted(
        &self,
        frame: u64,
        mut votes: FrameVotes,
    ) -> Result<(Vec<u64>, BuildReport), PsogError> {
        votes.sort();
        let FrameVotes { entries, outside, .. } = votes;
        self.check(frame, &entries)?;
        let (run, ties) = winners(&entries);
        let report = BuildReport {
            frames: 1,
            voxels_voted: run.len() as u64,
            ties,
            points_in: votes_of(&entries),
            points_outside: outside,
        };
        Ok((run, report))
    }

    /// The P-SOG over all frames voted, and how the vote went.
    ///
    /// # Errors
    /// No frame was voted.
    pub fn finish(mut self) -> Result<(Psog, BuildReport), PsogError> {
        while self.runs.len() > 1 {
            self.merge_last_two();
        }
        let entries = self.runs.pop().unwrap_or_default();
        // Counted first: the counts of all classes are the most memory of all, and would move as they grow.
        let voxels = entries.chunk_by(|a, b| a >> 32 == b >> 32);
        let mut counts = vec![0; voxels.clone().count() * self.classes.len()];
        let mut index = Vec::with_capacity(counts.len() / self.classes.len().max(1));
        for (entries, row) in voxels.zip(counts.chunks_mut(self.classes.len().max(1))) {
            index.push(entries[0] >> 32);
            for entry in entries {
                row[usize::from((entry >> 16) as u16)] = *entry as u16;
            }
        }
        let psog = Psog::new(self.roi, self.report.frames as u32, self.classes, index, counts)?;
        Ok((psog, self.report))
    }

    fn check(&self, frame: u64, entries: &[u64]) -> Result<(), PsogError> {
        let (voxels, classes) = (self.roi.voxel_count(), self.classes.len());
        for &entry in entries {
            let (voxel, class) = (entry >> 32, (entry >> 16) as u16);
            if usize::from(class) >= classes {
                return Err(refused!(
                    "a point of frame {frame} votes for class {class}, but there are {classes} classes; map its label first"
                ));
            }
            if voxel >= voxels {
                return Err(refused!(
                    "a point of frame {frame} votes in voxel {voxel}, but the grid has {voxels}; vote in the grid the P-SOG \
                     is built on"
                ));
            }
        }
        Ok(())
    }

    fn merge_last_two(&mut self) {
        if let (Some(b), Some(a)) = (self.runs.pop(), self.runs.pop()) {
            self.runs.push(merge_runs(&a, &b));
        }
    }
}

fn votes_of(entries: &[u64]) -> u64 {
    entries.iter().map(|entry| entry & 0xFFFF).sum()
}

/// The winning class of each voxel of sorted votes, as entries of one frame, and the number of ties.
fn winners(entries: &[u64]) -> (Vec<u64>, u64) {
    let (mut run, mut ties) = (Vec::new(), 0);
    for voxel in entries.chunk_by(|a, b| a >> 32 == b >> 32) {
        let (mut best, mut most, mut tied) = (0, 0, false);
        for same in voxel.chunk_by(|a, b| a >> 16 == b >> 16) {
            let votes = votes_of(same);
            if votes > most {
                (best, most, tied) = (same[0] >> 16, votes, false);
            } else if votes == most {
                tied = true;
            }
        }
        run.push((best << 16) | 1);
        ties += u64::from(tied);
    }
    (run, ties)
}

/// Merges two sorted runs; entries of the same voxel and class become one, their frames added.
fn merge_runs(mut a: &[u64], mut b: &[u64]) -> Vec<u64> {
    let mut out = Vec::with_capacity(a.len().max(b.len()));
    while let ([x, rest_a @ ..], [y, rest_b @ ..]) = (a, b) {
        match (x >> 16).cmp(&(y >> 16)) {
            std::cmp::Ordering::Less => (out.push(*x), a = rest_a),
            std::cmp::Ordering::Greater => (out.push(*y), b = rest_b),
            // At most 65 535 frames, so the counts cannot run into the class.
            std::cmp::Ordering::Equal => (out.push(x + (y & 0xFFFF)), (a, b) = (rest_a, rest_b)),
        };
    }
    out.extend_from_slice(a);
    out.extend_from_slice(b);
    out
}
