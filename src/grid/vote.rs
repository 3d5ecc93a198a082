use rayon::prelude::*;
use serde::Serialize;

use super::psog::check_classes;
use super::{GridError, Psog, Roi};

/// The labelled points of one frame as votes: each point votes for its class in its voxel.
#[derive(Debug, Clone, Default)]
pub struct FrameVotes {
    /// `voxel << 16 | class`, so that sorting groups voxels and, in them, classes.
    keys: Vec<u64>,
    outside: u64,
}

impl FrameVotes {
    /// No votes yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the vote of one point; `None` is a point outside the grid, which is only counted.
    pub fn push(&mut self, voxel: Option<u64>, class: u16) {
        self.extend([(voxel, class)]);
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
        for part in parts {
            self.keys.extend_from_slice(&part.keys);
            self.outside += part.outside;
        }
    }
}

impl Extend<(Option<u64>, u16)> for FrameVotes {
    fn extend<I: IntoIterator<Item = (Option<u64>, u16)>>(&mut self, votes: I) {
        for (voxel, class) in votes {
            match voxel {
                // No grid reaches 2⁴⁸ voxels; a number that large stays wrong, and is reported.
                Some(voxel) => {
                    self.keys.push((voxel.min((1 << 48) - 1) << 16) | u64::from(class));
                }
                None => self.outside += 1,
            }
        }
    }
}

/// What happened while a P-SOG was built.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct BuildReport {
    /// Frames voted.
    pub frames: u64,
    /// Voxels that got a class, each counted once a frame.
    pub voxels_voted: u64,
    /// Those of them in which two or more classes had most votes; the lowest class id won.
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
    pub fn add(&self, other: &Self) -> Self {
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
    pub fn new(roi: Roi, classes: Vec<String>) -> Result<Self, GridError> {
        check_classes(&classes)?;
        Ok(Self { roi, classes, runs: Vec::new(), report: BuildReport::default() })
    }

    /// The voxel grid.
    pub fn roi(&self) -> &Roi {
        &self.roi
    }

    /// Votes one frame and adds its SOG to the counts. A frame without votes is empty everywhere.
    ///
    /// # Errors
    /// A vote for a class or voxel that does not exist, or more than 65 535 frames; the frame is
    /// then not added.
    pub fn frame(&mut self, votes: FrameVotes) -> Result<(), GridError> {
        let frame = self.report.frames;
        if frame >= u64::from(u16::MAX) {
            return Err(GridError::TooManyFrames { frame: frame + 1, limit: u16::MAX.into() });
        }
        let FrameVotes { mut keys, outside } = votes;
        self.check(frame, &keys)?;
        keys.par_sort_unstable();
        let (run, ties) = winners(&keys);
        self.report.frames += 1;
        self.report.voxels_voted += run.len() as u64;
        self.report.ties += ties;
        self.report.points_in += keys.len() as u64;
        self.report.points_outside += outside;
        drop(keys);
        self.runs.push(run);
        while let [.., a, b] = &self.runs[..]
            && a.len() < 2 * b.len()
        {
            self.merge_last_two();
        }
        Ok(())
    }

    /// The P-SOG over all frames voted, and how the vote went.
    ///
    /// # Errors
    /// No frame was voted.
    pub fn finish(mut self) -> Result<(Psog, BuildReport), GridError> {
        while self.runs.len() > 1 {
            self.merge_last_two();
        }
        let (mut index, mut counts) = (Vec::new(), Vec::new());
        for entry in self.runs.pop().unwrap_or_default() {
            let voxel = entry >> 32;
            if index.last() != Some(&voxel) {
                index.push(voxel);
                counts.resize(index.len() * self.classes.len(), 0);
            }
            let row = counts.len() - self.classes.len();
            counts[row + usize::from((entry >> 16) as u16)] = entry as u16;
        }
        let psog = Psog::new(self.roi, self.report.frames as u32, self.classes, index, counts)?;
        Ok((psog, self.report))
    }

    fn check(&self, frame: u64, keys: &[u64]) -> Result<(), GridError> {
        let (voxels, classes) = (self.roi.voxel_count(), self.classes.len());
        for &key in keys {
            let (voxel, class) = (key >> 16, key as u16);
            if usize::from(class) >= classes {
                return Err(GridError::VoteClass { frame, class, classes });
            }
            if voxel >= voxels {
                return Err(GridError::VoteVoxel { frame, voxel, voxels });
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

/// The winning class of each voxel of sorted votes, as entries of one frame, and the number of ties.
fn winners(keys: &[u64]) -> (Vec<u64>, u64) {
    let (mut run, mut ties) = (Vec::new(), 0);
    for votes in keys.chunk_by(|a, b| a >> 16 == b >> 16) {
        let (mut best, mut most, mut tied) = (votes[0], 0, false);
        for same in votes.chunk_by(|a, b| a == b) {
            if same.len() > most {
                (best, most, tied) = (same[0], same.len(), false);
            } else if same.len() == most {
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
