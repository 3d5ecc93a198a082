//! Two engines compared bit by bit: hits, covered voxels and sums.

use std::ops::AddAssign;

use serde::Serialize;

use crate::bvh::Hit;
use crate::engine::{Backend, BackendError};
use crate::problem::{Problem, Tally};
use crate::vehicle::{Placement, SensorPose};

/// Placements whose beams are cast in one batch, about as many as a search casts.
const CAST_TOGETHER: usize = 32;

/// Counts of different bits between two engines.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Differences {
    /// Beams cast by both.
    pub beams: u64,
    /// Beams with another triangle.
    pub triangles: u64,
    /// Beams with other bits of the distance.
    pub distances: u64,
    /// Largest distance between two answers, in metres.
    pub largest_distance: f64,
    /// Voxels covered by either.
    pub voxels: u64,
    /// Voxels covered by one of them only.
    pub differing_voxels: u64,
    /// Placements whose sums were compared.
    pub scores: u64,
    /// Placements with another sum.
    pub differing_scores: u64,
}

impl Differences {
    /// True if anything differed.
    pub fn any(&self) -> bool {
        self.triangles + self.distances + self.differing_voxels + self.differing_scores > 0
    }

    fn add_hits(&mut self, ours: &[Hit], theirs: &[Hit]) {
        self.beams += ours.len().max(theirs.len()) as u64;
        self.triangles += ours.len().abs_diff(theirs.len()) as u64;
        for (a, b) in ours.iter().zip(theirs) {
            self.triangles += u64::from(a.prim != b.prim);
            if a.t.to_bits() != b.t.to_bits() {
                self.distances += 1;
                let apart = (f64::from(a.t) - f64::from(b.t)).abs();
                self.largest_distance = self.largest_distance.max(apart);
            }
        }
    }

    /// Counts voxels of either list; both lists rise.
    fn add_voxels(&mut self, ours: &[u64], theirs: &[u64]) {
        let shared = ours.iter().filter(|v| theirs.binary_search(v).is_ok()).count();
        let either = ours.len() + theirs.len() - shared;
        self.voxels += either as u64;
        self.differing_voxels += (either - shared) as u64;
    }

    fn add_tallies(&mut self, ours: &[Tally], theirs: &[Tally]) {
        self.scores += ours.len() as u64;
        self.differing_scores += ours.iter().zip(theirs).filter(|(a, b)| a != b).count() as u64;
    }
}

impl AddAssign for Differences {
    fn add_assign(&mut self, other: Self) {
        self.beams += other.beams;
        self.triangles += other.triangles;
        self.distances += other.distances;
        self.largest_distance = self.largest_distance.max(other.largest_distance);
        self.voxels += other.voxels;
        self.differing_voxels += other.differing_voxels;
        self.scores += other.scores;
        self.differing_scores += other.differing_scores;
    }
}

/// Compares hits, covered voxels and sums of every placement in every frame of a problem.
///
/// `done` is called after each placement and frame.
///
/// # Errors
/// An engine failed.
pub(super) fn compare_engines(
    problem: &Problem,
    ours: &mut dyn Backend,
    theirs: &mut dyn Backend,
    placements: &[Placement],
    done: &dyn Fn(),
) -> Result<Differences, BackendError> {
    let mut found = Differences::default();
    let frames = compared_frames(problem);
    for together in placements.chunks(CAST_TOGETHER) {
        let poses: Vec<SensorPose> = together.iter().flat_map(|p| &p.lidars).copied().collect();
        for frame in 0..frames {
            if frame < problem.geometry_frame_count() {
                found.add_hits(&ours.hits(&poses, frame)?, &theirs.hits(&poses, frame)?);
            }
            for placement in together {
                if frame < problem.frame_count() {
                    let covered = ours.covered(placement, frame)?;
                    found.add_voxels(&covered, &theirs.covered(placement, frame)?);
                }
                done();
            }
        }
    }
    found.add_tallies(&ours.tally(placements, None)?, &theirs.tally(placements, None)?);
    Ok(found)
}

/// Frames of a problem in which placements are compared.
pub fn compared_frames(problem: &Problem) -> usize {
    problem.frame_count().max(problem.geometry_frame_count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planted_differences_are_found() {
        let hit = |t: f32, prim: u32| Hit { t, prim };
        let hits = [hit(1.0, 3), hit(2.0, 4), hit(100.0, u32::MAX)];
        let mut same = Differences::default();
        same.add_hits(&hits, &hits);
        same.add_voxels(&[1, 5, 9], &[1, 5, 9]);
        same.add_tallies(&[Tally::zero(1, 1)], &[Tally::zero(1, 1)]);
        assert!(!same.any());
        assert_eq!((same.beams, same.voxels, same.scores), (3, 3, 1));

        let mut found = Differences::default();
        let next = f32::from_bits(2.0_f32.to_bits() + 1);
        found.add_hits(&hits, &[hit(1.0, 2), hit(next, 4), hit(100.0, u32::MAX)]);
        assert_eq!((found.triangles, found.distances), (1, 1));
        assert!(found.largest_distance > 1e-7 && found.largest_distance < 1e-6);
        found.add_voxels(&[1, 5, 9], &[1, 9, 12]);
        assert_eq!((found.voxels, found.differing_voxels), (4, 2));
        let other = Tally { covered: 1, ..Tally::zero(1, 1) };
        found.add_tallies(&[Tally::zero(1, 1)], &[other]);
        assert_eq!(found.differing_scores, 1);
        assert!(found.any());
    }
}
