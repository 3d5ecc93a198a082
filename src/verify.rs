//! Checks that an engine agrees with the CPU reference to the bit, and that the reference agrees with independent
//! arithmetic in `f64`.

pub(crate) mod oracle;

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::bvh::Hit;
use crate::engine::{Backend, BackendError, ReferenceBackend};
use crate::problem::{Problem, Tally};
use crate::psog::Roi;
use crate::vehicle::{Placement, SensorPose, random_placements, table_7};
use oracle::sample_reference;

pub(crate) use oracle::{Agreement, EDGE_TOLERANCE};

/// Result of a verification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verification {
    /// Device of the engine that was checked, as reported.
    pub adapter: String,
    /// Placements compared.
    pub placements: usize,
    /// Frames in which each was compared.
    pub frames: usize,
    /// The engine against the CPU reference, bit by bit.
    pub gpu_against_cpu: Differences,
    /// A sample of the reference's beams against every triangle in `f64`.
    pub cpu_against_f64: Agreement,
    /// Metres from an edge within which rounding may decide.
    pub edge_tolerance: f64,
    /// Causes of differences between the engine and the reference, a sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<String>,
    /// True if the bits are equal and every other difference is explained.
    pub passed: bool,
}

/// Compares hits, covered voxels and sums of an engine with those of the CPU reference, and `sample`
/// beams of the reference, drawn with `seed`, with brute force in `f64`.
///
/// `done` is called after each placement and frame: `placements.len()` × [`compared_frames`] times.
///
/// # Errors
/// An engine failed.
pub fn verify(
    problem: &Arc<Problem>,
    engine: &mut dyn Backend,
    placements: &[Placement],
    sample: u64,
    seed: u64,
    done: &dyn Fn(),
) -> Result<Verification, BackendError> {
    let mut reference = ReferenceBackend::new(problem.task().clone());
    let found = compare_engines(problem, &mut reference, engine, placements, done)?;
    let explained = sample_reference(problem, placements, sample, seed)?;
    Ok(Verification {
        adapter: engine.adapter().to_owned(),
        placements: placements.len(),
        frames: compared_frames(problem),
        passed: !found.any() && explained.unexplained == 0,
        gpu_against_cpu: found,
        cpu_against_f64: explained,
        edge_tolerance: EDGE_TOLERANCE,
        causes: Vec::new(),
    })
}

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

/// Compares hits, covered voxels and sums of every placement in every frame of a problem.
///
/// `done` is called after each placement and frame.
fn compare_engines(
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

/// Default placements of a verification: Table 7 of the paper, random ones from the mount, and hostile ones.
pub fn usual_placements(
    problem: &Problem,
    random: usize,
    hostile: usize,
    seed: u64,
) -> Vec<Placement> {
    let mut all = table_7();
    all.extend(random_placements(problem.constraints(), random, seed));
    all.extend(hostile_placements(problem.roi(), hostile, seed));
    all
}

/// A kind of pose that methods fail at, from the grid and a number that varies it.
type HostileKind = (&'static str, fn(&Roi, f64) -> SensorPose);

/// One line a kind.
const KINDS: [HostileKind; 14] = [
    ("voxel-corner", |roi, u| at(corner(roi, u), [0.0; 3])),
    ("voxel-face", |roi, u| at([corner(roi, u)[0], 0.37 * u, 1.0 + u], [0.0; 3])),
    ("axis-parallel", |_, u| at([0.0, 0.0, 2.0 + u], [0.0, 0.0, quarter(u)])),
    ("upside-down", |_, u| at([u, 0.0, 2.5], [std::f64::consts::PI, 0.0, 0.0])),
    ("on-its-side", |_, u| at([0.0, u, 2.5], [std::f64::consts::FRAC_PI_2, 0.0, 0.0])),
    ("straight-down", |_, u| at([u, u, 2.5], [0.0, std::f64::consts::FRAC_PI_2, 0.0])),
    ("inside-the-body", |_, u| at([u, 0.2, 0.8], [0.1, 0.0, 0.3])),
    ("on-the-ground", |_, u| at([3.0 + u, u, 0.0], [0.0; 3])),
    ("below-the-ground", |_, u| at([3.0, u, -1.0 - u], [0.0, 0.1, 0.0])),
    ("far-above", |_, u| at([u, u, 90.0 + u], [0.0, 1.4, u])),
    ("outside-the-region", |roi, u| at([roi.max()[0] + 5.0 + u, 1.0, 2.0], [0.0; 3])),
    ("on-the-region's-face", |roi, u| at([roi.max()[0], u, 2.0], [0.0; 3])),
    ("on-the-region's-corner", |roi, _| at(roi.min(), [0.0; 3])),
    ("very-far", |_, u| at([1e5 * (1.0 + u), -1e5, 1e3], [0.0, 0.0, 2.4])),
];

fn at([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> SensorPose {
    SensorPose::from_values([x, y, z, roll, pitch, yaw])
}

/// A corner of a voxel near the middle of the grid.
fn corner(roi: &Roi, u: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let half = f64::from(roi.shape()[k]) / 2.0;
        roi.min()[k] + (half + (u * half / 4.0)).floor() * roi.voxel()[k]
    })
}

/// A whole number of quarter turns.
fn quarter(u: f64) -> f64 {
    (4.0 * u).floor() * std::f64::consts::FRAC_PI_2
}

/// Placements of poses that methods fail at: on voxel faces and corners, along the axes, in solids,
/// underground, outside and far from the region, several sensors in one pose.
pub fn hostile_placements(roi: &Roi, count: usize, seed: u64) -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let placements = (0..count).map(|index| {
        let (kind, pose) = KINDS[index % KINDS.len()];
        let first = pose(roi, rng.random_range(0.0..1.0));
        let second = if index % 3 == 0 { first } else { pose(roi, rng.random_range(0.0..1.0)) };
        let kind = kind.replace('\'', "");
        Placement { name: format!("hostile-{kind}-{index}"), lidars: vec![first, second] }
    });
    placements.collect()
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

    #[test]
    fn all_are_valid_and_each_kind_occurs() {
        let roi = Roi::new([-40.0, -40.0, -0.5], [0.2; 3], [400, 400, 30]).unwrap();
        let placements = hostile_placements(&roi, 50, 1);
        for placement in &placements {
            placement.validate().unwrap();
        }
        for (kind, _) in KINDS {
            let kind = kind.replace('\'', "");
            assert!(placements.iter().any(|p| p.name.contains(&kind)), "{kind}");
        }
    }
}
