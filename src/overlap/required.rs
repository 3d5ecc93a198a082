//! Rule of a vehicle on overlap, in one scene or its mirror image.

use std::sync::{Arc, OnceLock};

use super::pairs::{chain, groups};
use super::surfaces::{Shared, Surfaces, connected_up_to, surface_voxels};
use crate::bvh::Hit;
use crate::cast::Caster;
use crate::problem::{Problem, SensorBatch};
use crate::vehicle::{SensorPose, UnknownSensor};

/// Surface voxels of a LiDAR, about, that a search compares in all frames of a scene.
const SAMPLE: usize = 1 << 14;
/// Most voxels of which a search looks at one.
const MOST_EVERY: usize = 64;

/// Surfaces of a scene that LiDARs share.
pub(crate) struct RequiredOverlap {
    problem: Arc<Problem>,
    is_mirrored: bool,
    /// Distinct frames, and how many frames each stands for.
    frames: Vec<(usize, u64)>,
    /// One a model, made on first use.
    casters: Vec<OnceLock<Caster>>,
}

/// Overlap of LiDARs in a scene: the entries of the study, `[lidars][lidars]`.
pub(crate) type Shares = Vec<Vec<f64>>;

impl RequiredOverlap {
    /// Surfaces of the scene of a problem; `None` without rules on overlap. A mirror image has mirrored sensors.
    pub fn of(problem: &Arc<Problem>, is_mirrored: bool) -> Option<Self> {
        if problem.overlap_required().rules.is_empty() {
            return None;
        }
        let frames = problem.distinct_frames();
        let casters = problem.sensors().models().iter().map(|_| OnceLock::new()).collect();
        Some(Self { problem: problem.clone(), is_mirrored, frames, casters })
    }

    /// Distinct frames.
    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// Surface voxels of a LiDAR in each distinct frame: in bad weather only of beams that come back.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn surfaces(&self, lidar: &SensorPose) -> Result<Surfaces, UnknownSensor> {
        let lidar = if self.is_mirrored { lidar.mirrored() } else { *lidar };
        let problem = &self.problem;
        let batch = SensorBatch::new(problem, std::slice::from_ref(&lidar), None)?;
        let (table, far) = (batch.table(0), batch.range(0));
        let caster = self.casters[batch.model(0)].get_or_init(|| Caster::new(table));
        let of_frame = |&(frame, _): &(usize, u64)| {
            let Some(geometry) = problem.geometry(frame) else { return Box::default() };
            let poses = batch.ego_from_sensors(frame);
            let mut hits = vec![Hit::none(far); table.directions().len()];
            caster.closer_hits_in(&poses, geometry, vec![&mut hits[..]]);
            if let Some(air) = problem.air() {
                air.dim(&batch, &poses, geometry, problem.number_of(frame), &mut hits);
            }
            surface_voxels(problem, table, &poses[0], &hits, problem.overlap_required().own).into()
        };
        Ok(Surfaces { frames: self.frames.iter().map(of_frame).collect() })
    }

    /// One in so many voxels suffices for a search: a power of two.
    pub fn sample(&self) -> u32 {
        let beams =
            self.problem.sensors().models().iter().map(|model| model.table.directions().len());
        let beams = beams.max().unwrap_or(0) * self.frames.len();
        (beams / SAMPLE).clamp(1, MOST_EVERY).next_power_of_two() as u32
    }

    /// Overlap of each pair of LiDARs, of which the surfaces are given.
    pub fn shares(&self, each: &[&[Box<[u32]>]]) -> Shares {
        let weights: Vec<u64> = self.frames.iter().map(|(_, weight)| *weight).collect();
        Shared::of(each, &weights).shares()
    }
}

/// Overlap without one LiDAR.
fn without(shares: &Shares, lost: Option<usize>) -> (Vec<usize>, Shares) {
    let left: Vec<usize> = (0..shares.len()).filter(|lidar| Some(*lidar) != lost).collect();
    let row = |&a: &usize| left.iter().map(|&b| shares[a][b]).collect();
    let shares = left.iter().map(row).collect();
    (left, shares)
}

/// Largest overlap at which pairs connect the LiDARs that are left without one.
pub(crate) fn connected_without(shares: &Shares, lost: Option<usize>) -> f64 {
    connected_up_to(&without(shares, lost).1)
}

/// How far pairs come to connecting all LiDARs at an overlap of `least`, from 0 to 1: the mean over the strongest chain of
/// each pair's part of it.
pub(crate) fn part_connected(shares: &Shares, least: f64) -> f64 {
    if shares.len() < 2 {
        return 1.0;
    }
    let parts: f64 = chain(shares).iter().map(|pair| (pair.shared / least).min(1.0)).sum();
    parts / (shares.len() - 1) as f64
}

/// LiDARs that pairs of an overlap of `least` do not connect with the others, and the most that they share, in words.
pub(crate) fn cut_off(shares: &Shares, lost: Option<usize>, least: f64) -> String {
    let (names, shares) = without(shares, lost);
    let groups = groups(&shares, least);
    let of_group = |group: &Vec<usize>| {
        let others = |a: usize| (0..shares.len()).map(move |b| (a, b));
        let pairs = group.iter().flat_map(|&a| others(a)).filter(|(_, b)| !group.contains(b));
        // The first of equal ones.
        let best = pairs.reduce(|a, b| if shares[b.0][b.1] > shares[a.0][a.1] { b } else { a });
        let numbers: Vec<String> = group.iter().map(|&lidar| names[lidar].to_string()).collect();
        let (one, are) = if group.len() == 1 { ("LiDAR", "is") } else { ("LiDARs", "are") };
        let shared = match best.filter(|&(a, b)| shares[a][b] > 0.0) {
            // Rounded down, so that too little never reads as enough.
            Some((a, b)) => {
                let share = (1e3 * shares[a][b] + 1e-9).floor() / 10.0;
                let of = if group.len() == 1 { String::new() } else { format!("{} ", names[a]) };
                format!("{of}shares at most {share:.1} % with LiDAR {}", names[b])
            }
            None => "shares nothing with any other".to_owned(),
        };
        format!("{one} {} {are} cut off: {shared}", numbers.join(" and "))
    };
    groups.iter().skip(1).map(of_group).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain 0–1–2 beside a pair 3–4, and 5 alone.
    fn six() -> Shares {
        let mut shares = vec![vec![0.0; 6]; 6];
        for (a, b, share) in [(0, 1, 0.5), (1, 2, 0.1), (3, 4, 0.9), (2, 3, 0.0196)] {
            (shares[a][b], shares[b][a]) = (share, share);
        }
        shares
    }

    #[test]
    fn lidars_that_are_cut_off_are_named_with_the_most_they_share() {
        let told = cut_off(&six(), None, 0.05);
        let pair = "LiDARs 3 and 4 are cut off: 3 shares at most 1.9 % with LiDAR 2";
        assert_eq!(told, format!("{pair}; LiDAR 5 is cut off: shares nothing with any other"));
        // Without LiDAR 1 the others keep their numbers.
        let told = cut_off(&six(), Some(1), 0.05);
        assert!(
            told.starts_with("LiDAR 0 is cut off: shares nothing with any other; LiDAR 2 is"),
            "{told}"
        );
        assert_eq!(cut_off(&vec![vec![1.0]], None, 1.0), "");
    }

    #[test]
    fn every_pair_on_the_way_to_a_connected_rig_counts() {
        let mut shares = six();
        // By hand: three of five pairs are enough at 0.1, and 2–3 has .196 of it.
        assert!((part_connected(&shares, 0.1) - (3.0 + 0.196) / 5.0).abs() < 1e-12);
        assert_eq!(connected_without(&shares, None), 0.0);
        assert_eq!(connected_without(&shares, Some(5)), 0.0196);
        (shares[5][0], shares[0][5]) = (0.2, 0.2);
        assert_eq!(connected_without(&shares, None), 0.0196);
        assert_eq!(part_connected(&vec![vec![1.0]], 0.1), 1.0);
    }
}
