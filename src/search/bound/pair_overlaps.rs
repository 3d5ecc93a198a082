//! Bounds on sets of sensors from single poses and from the overlaps of pairs of them.

use super::voxel_groups::Columns;
use crate::problem::KINDS;
use crate::search::atlases::Atlases;

/// Shares of the typical poses that cover a voxel by which voxels are grouped, as multiples of
/// 1 / (k − 1) for k sensors: at that share k random sensors less their overlaps come to one.
const SHARES: [f64; 7] = [0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2];
/// Poses of which all pairs are remembered, at most: some hundred MiB.
const MOST_POSES: usize = 3000;

/// Bounds on the worth that sets of sensors cover, from single poses and from the overlaps of pairs.
///
/// Take a tree over the sensors. The sensors that cover a voxel and the edges between them form a forest, so they are
/// at least one more than its edges. The worth of a union is therefore at most the sum over its sensors less the
/// overlaps along the edges of any tree (Hunter 1976). It is also at most the worth of all voxels. Each voxel counts
/// in one of the two ways: in the second if many poses cover it.
#[derive(Debug, Clone)]
pub(in crate::search) struct PairBound {
    poses: usize,
    /// Worth of the voxels that count in full, whatever the sensors are.
    pub base: f64,
    /// Worth of the other voxels that each pose covers.
    singles: Vec<f64>,
    /// Worth of the other voxels that two poses share, or less, `[poses × poses]`; empty where it costs too much.
    overlaps: Vec<f64>,
}

impl PairBound {
    /// True if it knows overlaps, not single poses alone.
    pub fn has_overlaps(&self) -> bool {
        !self.overlaps.is_empty()
    }

    /// Most worth that a pose adds to a set with `beside` in it; `added` is the bound without that overlap.
    pub fn added(&self, pose: u32, beside: u32, added: f64) -> f64 {
        if self.overlaps.is_empty() {
            return added;
        }
        let overlap = self.overlaps[beside as usize * self.poses + pose as usize];
        added.min(self.singles[pose as usize] - overlap)
    }

    /// (pose, worth of the voxels outside `base` that it covers).
    pub fn singles(&self) -> Vec<(u32, f64)> {
        self.singles.iter().enumerate().map(|(pose, &single)| (pose as u32, single)).collect()
    }

    /// The bound with the split of the voxels that `bound_of` likes best, of those tried, and its value.
    ///
    /// At most `most_words` words of bitmaps are read for the overlaps: voxels of later groups then count without them.
    /// The worth of a voxel is `units` of its scene × its entropies. The bound holds for any `typical` poses; it is
    /// tight if good placements are made of poses like them. `go_on` is asked while the voxels are grouped and the
    /// overlaps added up; once it says no the splits so far are all that were tried.
    pub fn tightest(
        atlas: &Atlases,
        lidars: usize,
        units: &[[f64; KINDS]],
        typical: &[u32],
        most_words: u64,
        go_on: &dyn Fn() -> bool,
        mut bound_of: impl FnMut(&Self) -> f64,
    ) -> (Self, f64) {
        let poses = atlas.grid().len();
        let n = poses as usize;
        let (worths, unit) = integer_worths(atlas, units);
        let each = 1.0 / (lidars.max(2) - 1) as f64;
        let shares = SHARES.map(|share| share * each);
        let scaled = |sum: u64| unit * sum as f64;
        let Some(columns) = Columns::new(atlas, poses, &worths, &shares, typical, go_on) else {
            let frames = 64 * atlas.occupied_of(0).len() / worths.len().max(1);
            let all = scaled(frames as u64 * worths.iter().map(|&w| u64::from(w)).sum::<u64>());
            return (Self { poses: n, base: all, singles: vec![0.0; n], overlaps: vec![] }, all);
        };
        let groups = columns.groups();
        let base = columns.rest + groups.iter().map(|group| group.total).sum::<u64>();
        let mut now =
            Self { poses: n, base: scaled(base), singles: vec![0.0; n], overlaps: vec![] };
        let mut overlaps = vec![0.0; if n <= MOST_POSES { n * n } else { 0 }];
        let mut best = (now.clone(), now.base);
        let (mut base, mut singles) = (base, vec![0u64; n]);
        let mut words = 0;
        for (index, group) in groups.iter().enumerate() {
            base -= group.total;
            for (sum, single) in singles.iter_mut().zip(&group.singles) {
                *sum += single;
            }
            now.base = scaled(base);
            now.singles = singles.iter().map(|&sum| scaled(sum)).collect();
            words += columns.group_words(index) * (n * n / 2) as u64;
            if words <= most_words && !overlaps.is_empty() {
                if !columns.add_overlaps(index, &mut overlaps, go_on) {
                    break;
                }
                now.overlaps = overlaps.iter().map(|sum| unit * sum).collect();
            }
            let bound = bound_of(&now);
            // Groups rise in how often their voxels are covered: once they do not pay they never will.
            if bound > best.1 {
                break;
            }
            best = (now.clone(), bound);
        }
        best
    }
}

/// Worth of each bit of a frame as an integer, rounded up, and its unit.
fn integer_worths(atlas: &Atlases, units: &[[f64; KINDS]]) -> (Vec<u32>, f64) {
    let worths = atlas.worths();
    let value = |(worth, scene): &([u32; KINDS], usize)| {
        worth.iter().zip(units[*scene]).map(|(&worth, unit)| unit * f64::from(worth)).sum::<f64>()
    };
    // The integers of one scene and one kind are there already.
    let only = match units {
        [units] => {
            let mut counted = (0..KINDS).filter(|&kind| units[kind] != 0.0);
            counted.next().filter(|_| counted.next().is_none())
        }
        _ => None,
    };
    let unit = match only {
        Some(kind) => units[0][kind],
        None => {
            worths.iter().map(value).fold(f64::MIN_POSITIVE, f64::max) / f64::from(u32::MAX - 1)
        }
    };
    let integer = |worth: &([u32; KINDS], usize)| match only {
        Some(kind) => worth.0[kind],
        None => (value(worth) / unit).ceil() as u32,
    };
    (worths.iter().map(integer).collect(), unit)
}
