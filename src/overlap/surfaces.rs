//! Surface voxels of a LiDAR, and how many of them pairs of LiDARs share.

use glam::DVec3;
use lidar_cast::grid::HIT_PUSH;

use super::pairs::chain;
use crate::bvh::Hit;
use crate::geom::Pose;
use crate::problem::Problem;
use crate::vehicle::BeamTable;

/// Voxels in which a LiDAR has hits in a frame, rising and each once. Triangles from `own` on are the own body's.
pub(crate) fn surface_voxels(
    problem: &Problem,
    table: &BeamTable,
    pose: &Pose,
    hits: &[Hit],
    own: usize,
) -> Vec<u32> {
    let beams = table.directions().iter().zip(hits);
    let on_surface = beams.filter(|(_, hit)| hit.is_hit() && (hit.prim as usize) < own);
    let voxels = on_surface.filter_map(|(direction, hit)| {
        let along = DVec3::from(direction.map(f64::from)) * (f64::from(hit.t) + HIT_PUSH);
        // A region has fewer than 2³¹ voxels.
        Some(problem.roi().voxel_of(pose.apply(along))? as u32)
    });
    let mut voxels: Vec<u32> = voxels.collect();
    voxels.sort_unstable();
    voxels.dedup();
    voxels
}

/// Surface voxels of a LiDAR, frame after frame.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Surfaces {
    /// `[frames]`, each rising.
    pub frames: Vec<Box<[u32]>>,
}

impl Surfaces {
    /// About one voxel of `every`, a power of two, chosen by its number alone: LiDARs that share voxels share those
    /// chosen, too.
    #[must_use]
    pub fn sampled(&self, every: u32) -> Self {
        // Knuth's multiplicative hash; its upper bits are the well mixed ones.
        let is_chosen = |voxel: &u32| voxel.wrapping_mul(0x9e37_79b1) >> 8 & (every - 1) == 0;
        let frames = self.frames.iter();
        let frames = frames.map(|frame| frame.iter().copied().filter(is_chosen).collect());
        Self { frames: frames.collect() }
    }
}

/// Voxels that pairs of LiDARs share, summed over frames; on the diagonal those of each LiDAR.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shared {
    /// `[lidars][lidars]`, symmetric.
    pub sums: Vec<Vec<u64>>,
}

impl Shared {
    /// Of so many LiDARs, before the first frame.
    pub fn none(lidars: usize) -> Self {
        Self { sums: vec![vec![0; lidars]; lidars] }
    }

    /// Adds the surface voxels of each LiDAR in a frame that stands for `weight` frames.
    pub fn add<'a>(&mut self, of: impl Fn(usize) -> &'a [u32], weight: u64) {
        let count = self.sums.len();
        for (a, b) in (0..count).flat_map(|a| (a..count).map(move |b| (a, b))) {
            let sum = self.sums[a][b] + weight * in_both(of(a), of(b));
            (self.sums[a][b], self.sums[b][a]) = (sum, sum);
        }
    }

    /// Of the surfaces of some LiDARs, in frames of these weights.
    pub fn of(each: &[&[Box<[u32]>]], weights: &[u64]) -> Self {
        let mut shared = Self::none(each.len());
        let frames = weights.iter().enumerate();
        frames.for_each(|(frame, &weight)| shared.add(|lidar| &each[lidar][frame], weight));
        shared
    }

    /// Share of the surface voxels of the LiDAR with fewer that a pair shares, `[lidars][lidars]`; 0 where it has none.
    pub fn shares(&self) -> Vec<Vec<f64>> {
        let share = |a: usize, b: usize| {
            let fewer = self.sums[a][a].min(self.sums[b][b]);
            if fewer == 0 { 0.0 } else { self.sums[a][b] as f64 / fewer as f64 }
        };
        let count = self.sums.len();
        (0..count).map(|a| (0..count).map(|b| share(a, b)).collect()).collect()
    }
}

/// Largest overlap at which pairs still connect all LiDARs: 0 where no number would, 1 for one LiDAR or none.
pub(crate) fn connected_up_to(shares: &[Vec<f64>]) -> f64 {
    if shares.len() < 2 {
        return 1.0;
    }
    let chain = chain(shares);
    let weakest = chain.last().filter(|_| chain.len() + 1 == shares.len());
    weakest.map_or(0.0, |pair| pair.shared)
}

/// Members of two rising lists that are in both.
fn in_both(one: &[u32], other: &[u32]) -> u64 {
    let (mut a, mut b, mut count) = (0, 0, 0);
    while let (Some(x), Some(y)) = (one.get(a), other.get(b)) {
        count += u64::from(x == y);
        a += usize::from(x <= y);
        b += usize::from(y <= x);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_shares_a_part_of_the_smaller_one() {
        let frames = |lists: [&[u32]; 2]| lists.map(Box::from).to_vec();
        let each = [
            frames([&[1, 2, 3, 4, 9], &[7]]),
            frames([&[2, 4, 6], &[5]]),
            frames([&[0, 6], &[7]]),
            frames([&[], &[]]),
        ];
        let each: Vec<&[Box<[u32]>]> = each.iter().map(|of| &of[..]).collect();
        let shared = Shared::of(&each, &[1, 10]);
        // By hand: 5 + 10, 3 + 10 and 2 + 10 voxels; 2, then 0 + 10, then 1 in common.
        let sums = [[15, 2, 10, 0], [2, 13, 1, 0], [10, 1, 12, 0], [0, 0, 0, 0]];
        assert_eq!(shared.sums, sums.map(|row| row.to_vec()));
        let shares = shared.shares();
        assert_eq!(shares[0][1..], [2.0 / 13.0, 10.0 / 12.0, 0.0]);
        assert_eq!(connected_up_to(&shares), 0.0, "the last LiDAR sees nothing");
        let three: Vec<Vec<f64>> = shares[..3].iter().map(|row| row[..3].to_vec()).collect();
        assert_eq!(connected_up_to(&three), 2.0 / 13.0);
        assert_eq!((connected_up_to(&[vec![1.0]]), connected_up_to(&[])), (1.0, 1.0));
    }

    #[test]
    fn a_sample_keeps_shares() {
        let all = |from: u32, to: u32| Surfaces { frames: vec![(from..to).collect()] };
        let (one, other) = (all(0, 60_000), all(45_000, 90_000));
        let share =
            |a: &Surfaces, b: &Surfaces| Shared::of(&[&a.frames, &b.frames], &[1]).shares()[0][1];
        assert_eq!(share(&one, &other), 15_000.0 / 45_000.0);
        let (few, fewer) = (one.sampled(16), other.sampled(16));
        assert!(
            (few.frames[0].len() as f64 / 3750.0 - 1.0).abs() < 0.05,
            "{}",
            few.frames[0].len()
        );
        assert!((share(&few, &fewer) - 1.0 / 3.0).abs() < 0.02);
        assert_eq!(one.sampled(1), one);
    }
}
