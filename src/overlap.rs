//! Surfaces that pairs of LiDARs share, and whether pairs connect all LiDARs: for the study of overlap and for rules on it.
//!
//! - **Surface voxel** of a LiDAR: a voxel of the region in which one of its beams ends at a surface other than the own
//!   body. Shared by two LiDARs: both have a hit in it in the same frame.
//! - **Overlap** of two LiDARs: shared surface voxels as a share of the voxels of the LiDAR that has fewer, summed over frames.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use lidar_cast::grid::HIT_PUSH;

use crate::bvh::Hit;
use crate::cast::Caster;
use crate::geom::Pose;
use crate::problem::{Problem, SensorBatch};
use crate::vehicle::{BeamTable, SensorPose, UnknownSensor};

/// Two LiDARs and how much they share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair {
    /// Positions in the placement, the lower first.
    pub lidars: [usize; 2],
    /// Entry of the matrix.
    pub shared: f64,
}

/// All pairs, the largest shares first; of equal ones the lower LiDARs first.
fn by_share(shared: &[Vec<f64>]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (a, row) in shared.iter().enumerate() {
        let above = row.iter().enumerate().skip(a + 1);
        pairs.extend(above.map(|(b, &shared)| Pair { lidars: [a, b], shared }));
    }
    pairs.sort_by(|a, b| b.shared.total_cmp(&a.shared));
    pairs
}

/// Pairs that join LiDARs which stronger pairs have not joined, and that share anything (Kruskal 1956).
pub(crate) fn chain(shared: &[Vec<f64>]) -> Vec<Pair> {
    let mut group: Vec<usize> = (0..shared.len()).collect();
    let joins = |pair: &Pair| {
        let [a, b] = pair.lidars.map(|lidar| group[lidar]);
        group.iter_mut().filter(|of| **of == b).for_each(|of| *of = a);
        a != b
    };
    by_share(shared).into_iter().filter(|pair| pair.shared > 0.0).filter(joins).collect()
}

/// LiDARs that pairs of at least `least` connect; the largest group first, of equal ones that of the lowest LiDAR.
pub(crate) fn groups(shared: &[Vec<f64>], least: f64) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (lidar, row) in shared.iter().enumerate() {
        let is_joined = |group: &Vec<usize>| group.iter().any(|&other| row[other] >= least);
        let (joined, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(is_joined);
        let mut group = joined.concat();
        group.push(lidar);
        group.sort_unstable();
        groups = apart;
        groups.push(group);
    }
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group[0]));
    groups
}

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
    /// Voxels in all frames.
    pub(crate) fn voxels(&self) -> usize {
        self.frames.iter().map(|frame| frame.len()).sum()
    }

    /// About one voxel of `every`, a power of two, chosen by its number alone: LiDARs that share voxels share those
    /// chosen, too.
    #[must_use]
    pub(crate) fn sampled(&self, every: u32) -> Self {
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
    /// Zero sums for some LiDARs, before the first frame.
    pub(crate) fn none(lidars: usize) -> Self {
        Self { sums: vec![vec![0; lidars]; lidars] }
    }

    /// Adds the surface voxels of each LiDAR in a frame that stands for `weight` frames.
    pub(crate) fn add<'a>(&mut self, of: impl Fn(usize) -> &'a [u32], weight: u64) {
        let count = self.sums.len();
        for (a, b) in (0..count).flat_map(|a| (a..count).map(move |b| (a, b))) {
            let sum = self.sums[a][b] + weight * in_both(of(a), of(b));
            (self.sums[a][b], self.sums[b][a]) = (sum, sum);
        }
    }

    /// Sums over the surfaces of some LiDARs, in frames of these weights.
    pub(crate) fn of(each: &[&[Box<[u32]>]], weights: &[u64]) -> Self {
        let mut shared = Self::none(each.len());
        let frames = weights.iter().enumerate();
        frames.for_each(|(frame, &weight)| shared.add(|lidar| &each[lidar][frame], weight));
        shared
    }

    /// Share of the surface voxels of the LiDAR with fewer that a pair shares, `[lidars][lidars]`; 0 where it has none.
    pub(crate) fn shares(&self) -> Vec<Vec<f64>> {
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
    pub(crate) fn of(problem: &Arc<Problem>, is_mirrored: bool) -> Option<Self> {
        if problem.overlap_required().rules.is_empty() {
            return None;
        }
        let frames = problem.distinct_frames();
        let casters = problem.sensors().models().iter().map(|_| OnceLock::new()).collect();
        Some(Self { problem: problem.clone(), is_mirrored, frames, casters })
    }

    /// Distinct frames.
    pub(crate) fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// Surface voxels of a LiDAR in each distinct frame: in bad weather only of beams that come back.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(crate) fn surfaces(&self, lidar: &SensorPose) -> Result<Surfaces, UnknownSensor> {
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
    pub(crate) fn sample(&self) -> u32 {
        let beams =
            self.problem.sensors().models().iter().map(|model| model.table.directions().len());
        let beams = beams.max().unwrap_or(0) * self.frames.len();
        (beams / SAMPLE).clamp(1, MOST_EVERY).next_power_of_two() as u32
    }

    /// Overlap of two LiDARs at most, of which a search has the surfaces. Where these are a sample, it lies five standard
    /// deviations above theirs.
    pub(crate) fn most_shared(&self, pair: [&[Box<[u32]>]; 2]) -> f64 {
        let share = self.shares(&pair)[0][1];
        if self.sample() == 1 {
            return share;
        }
        // Frames may show the same voxels.
        let voxels = |of: &[Box<[u32]>]| of.iter().map(|frame| frame.len()).sum::<usize>();
        let fewer = voxels(pair[0]).min(voxels(pair[1]));
        with_room(share, fewer as f64 / self.frames.len().max(1) as f64)
    }

    /// Overlap of each pair of LiDARs, of which the surfaces are given.
    pub(crate) fn shares(&self, each: &[&[Box<[u32]>]]) -> Shares {
        let weights: Vec<u64> = self.frames.iter().map(|(_, weight)| *weight).collect();
        Shared::of(each, &weights).shares()
    }
}

/// Largest share of all voxels that the share of a sample allows, at five standard deviations (Wilson 1927); 1 for an empty
/// sample.
fn with_room(share: f64, voxels: f64) -> f64 {
    const DEVIATIONS: f64 = 5.0;
    let room = DEVIATIONS * DEVIATIONS / voxels.max(1e-30);
    let spread = (share * (1.0 - share) * room + 0.25 * room * room).sqrt();
    ((share + 0.5 * room + spread) / (1.0 + room)).clamp(share, 1.0)
}

/// Overlap without one LiDAR.
fn without(shares: &Shares, lost: Option<usize>) -> (Vec<usize>, Shares) {
    let left: Vec<usize> = (0..shares.len()).filter(|lidar| Some(*lidar) != lost).collect();
    let row = |&a: &usize| left.iter().map(|&b| shares[a][b]).collect();
    let shares = left.iter().map(row).collect();
    (left, shares)
}

/// Largest overlap at which pairs connect the LiDARs that are left without one; 0 of a single one, which shares nothing.
pub(crate) fn connected_without(shares: &Shares, lost: Option<usize>) -> f64 {
    let left = without(shares, lost).1;
    if left.len() < 2 { 0.0 } else { connected_up_to(&left) }
}

/// How far pairs come to connecting all LiDARs at an overlap of `least`, from 0 to 1: the mean over the strongest chain of
/// each pair's part of it. 0 of a single LiDAR.
pub(crate) fn part_connected(shares: &Shares, least: f64) -> f64 {
    if shares.len() < 2 {
        return 0.0;
    }
    let parts: f64 = chain(shares).iter().map(|pair| (pair.shared / least).min(1.0)).sum();
    parts / (shares.len() - 1) as f64
}

/// LiDARs that pairs of an overlap of `least` do not connect with the others, and the most that they share, in words.
pub(crate) fn cut_off(shares: &Shares, lost: Option<usize>, least: f64) -> String {
    let (names, shares) = without(shares, lost);
    if shares.len() < 2 {
        return "one LiDAR has nothing to share".to_owned();
    }
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
            None if group.len() > 1 => "share nothing with the rest".to_owned(),
            None => "shares nothing with any other".to_owned(),
        };
        format!("{one} {} {are} cut off: {shared}", numbers.join(" and "))
    };
    groups.iter().skip(1).map(of_group).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(count: usize, pairs: &[(usize, usize, f64)]) -> Vec<Vec<f64>> {
        let mut shared = vec![vec![0.0; count]; count];
        for &(a, b, of_pair) in pairs {
            (shared[a][b], shared[b][a]) = (of_pair, of_pair);
        }
        shared
    }

    #[test]
    fn a_chain_connects_what_no_single_pair_does() {
        let shared =
            matrix(5, &[(0, 3, 900.0), (3, 1, 600.0), (0, 1, 500.0), (2, 4, 700.0), (1, 2, 80.0)]);
        assert_eq!(groups(&shared, 500.0), [vec![0, 1, 3], vec![2, 4]]);
        assert_eq!(groups(&shared, 80.0), [vec![0, 1, 2, 3, 4]]);
        assert_eq!(groups(&shared, 650.0), [vec![0, 3], vec![2, 4], vec![1]]);
        let chain = chain(&shared);
        let told: Vec<_> = chain.iter().map(|pair| (pair.lidars, pair.shared)).collect();
        assert_eq!(told, [([0, 3], 900.0), ([2, 4], 700.0), ([1, 3], 600.0), ([1, 2], 80.0)]);
    }

    #[test]
    fn the_weakest_pair_of_the_chain_is_the_largest_number_that_connects() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let of = |a: usize| (a + 1..6).map(move |b| (a, b));
            let mut voxels = || f64::from(rng.random_range(0..40_u32)).max(8.0) - 8.0;
            let pairs = (0..6).flat_map(of).map(|(a, b)| (a, b, voxels()));
            let shared = matrix(6, &pairs.collect::<Vec<_>>());
            let connects = |least: u32| groups(&shared, f64::from(least)).len() == 1;
            let most = (1..40).rev().find(|&least| connects(least)).map_or(0.0, f64::from);
            let chain = chain(&shared);
            let weakest = chain.last().filter(|_| chain.len() == 5);
            assert_eq!(weakest.map_or(0.0, |pair| pair.shared), most);
        }
    }

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

    #[test]
    fn a_sample_bounds_the_share_of_all_voxels() {
        let all = |from: u32, to: u32| Surfaces { frames: vec![(from..to).collect()] };
        let (mut shares, mut rounds) = (0.0, 0);
        for from in (0..200).map(|k| 7919 * k) {
            for shared in [0, 60, 1500, 6000] {
                let (one, other) =
                    (all(from, from + 6000), all(from + 6000 - shared, from + 12_000));
                let (one, other) = (one.sampled(16), other.sampled(16));
                let of_sample = Shared::of(&[&one.frames, &other.frames], &[1]).shares()[0][1];
                let bound = with_room(of_sample, one.voxels().min(other.voxels()) as f64);
                let truth = f64::from(shared) / 6000.0;
                assert!(bound >= truth.max(of_sample) && bound <= 1.0, "{from} {shared}: {bound}");
                (shares, rounds) = (shares + bound - truth, rounds + 1);
            }
        }
        assert!(shares / f64::from(rounds) < 0.1, "not far above it: {shares} in {rounds}");
        assert_eq!(with_room(0.0, 0.0), 1.0);
    }

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
        let one = vec![vec![1.0]];
        assert_eq!(cut_off(&one, None, 1.0), "one LiDAR has nothing to share");
        assert_eq!((connected_without(&one, None), part_connected(&one, 0.1)), (0.0, 0.0));
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
    }
}
