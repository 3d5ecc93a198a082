//! Bounds on sets of sensors from single poses and from the overlaps of pairs of them.

use super::voxel_groups::Columns;
use crate::problem::{Entropy, KINDS, REPEATS};
use crate::search::atlases::{Atlases, Units};

/// Worths of the bits of an atlas, as integers.
pub(super) struct Worths {
    /// Worth of each bit of a frame for the first sensor that covers it, rounded up.
    pub once: Vec<u32>,
    /// Unit of `once`.
    pub unit: f64,
    /// Most worth of a bit that all sensors cover, as a multiple of `once`; 1 where only the first sensor counts.
    pub in_full: f64,
    /// Least share of `once` that the second sensor lacks; 1 where only the first one counts, 0 where both count the same.
    pub overlap: f64,
}

impl Worths {
    /// Worths of the bits of an atlas for placements of `lidars` sensors, with the `units` of each scene.
    pub(crate) fn new(atlas: &Atlases, lidars: usize, units: &[Units]) -> Self {
        let (once, unit) = integers(&atlas.worths(), units);
        let (mut in_full, mut overlap) = (1.0, 1.0);
        if units.iter().any(|units| units.repeated != [0.0; REPEATS]) {
            for (worth, scene) in atlas.worths() {
                let first = first(&worth, &units[scene]);
                if first > 0.0 {
                    let near = f64::from(Entropy::Near.of(&worth));
                    let repeated = units[scene].repeated.map(|unit| unit * near / first);
                    let again = repeated.iter().take(lidars.max(1) - 1).sum::<f64>();
                    in_full = f64::max(in_full, 1.0 + again);
                    overlap = f64::min(overlap, 1.0 - repeated[0]);
                }
            }
        }
        Self { once, unit, in_full, overlap: overlap.max(0.0) }
    }

    /// True if only the first sensor that covers a voxel counts.
    pub(crate) fn is_plain(&self) -> bool {
        self.in_full == 1.0 && self.overlap == 1.0
    }

    /// Share p of the poses that cover a voxel at which n = `lidars` random poses count as much as all sensors.
    ///
    /// They cover it n·p times, joined by (n − 1)·p² edges of a tree. The smaller solution is meant: 1 / (n − 1) where
    /// only the first sensor counts, and 1 where there is no solution.
    pub(crate) fn even_share(&self, lidars: usize) -> f64 {
        let n = lidars.max(2) as f64;
        let edges = self.overlap * (n - 1.0);
        if edges == 0.0 {
            return self.in_full / n;
        }
        let root = n * n - 4.0 * edges * self.in_full;
        if root < 0.0 { 1.0 } else { (n - root.sqrt()) / (2.0 * edges) }
    }
}

/// Worth of a bit for the first sensor that covers it.
fn first(worth: &[u32; KINDS], units: &Units) -> f64 {
    worth.iter().zip(units.once).map(|(&worth, unit)| unit * f64::from(worth)).sum()
}

/// Worth of each bit for the first sensor as an integer, rounded up, and its unit.
fn integers(worths: &[([u32; KINDS], usize)], units: &[Units]) -> (Vec<u32>, f64) {
    let value = |(worth, scene): &([u32; KINDS], usize)| first(worth, &units[*scene]);
    // The integers of one scene and one kind are there already.
    let only = match units {
        [units] => {
            let mut counted = (0..KINDS).filter(|&kind| units.once[kind] != 0.0);
            counted.next().filter(|_| counted.next().is_none())
        }
        _ => None,
    };
    let unit = match only {
        Some(kind) => units[0].once[kind],
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

/// Poses of which all pairs are remembered, at most: some hundred MiB.
const MOST_POSES: usize = 3000;

/// Bounds on the worth that sets of sensors cover, from single poses and from the overlaps of pairs.
///
/// Take a tree over the sensors. The sensors that cover a voxel and the edges between them form a forest, so they are
/// at least one more than its edges. The worth of a union is therefore at most the sum over its sensors less the
/// overlaps along the edges of any tree (Hunter 1976). It is also at most the worth of all voxels. Each voxel counts
/// in one of the two ways: in the second if many poses cover it.
///
/// A voxel may count again for a second sensor that covers it, at no more than it counted before. Then c sensors with e
/// edges between them count once·c − (once − again)·e at most. That is at least once + again·(c − 1), since e ≤ c − 1.
/// Overlaps then count less, and not at all where the second sensor counts in full.
#[derive(Debug, Clone)]
pub(in crate::search) struct PairBound {
    poses: usize,
    /// Worth of the voxels that count in full, whatever the sensors are.
    pub base: f64,
    /// Worth of the other voxels that each pose covers.
    singles: Vec<f64>,
    /// Worth of the other voxels that two poses share, or less, `[poses × poses]`; empty where it costs too much.
    overlaps: Vec<f64>,
    /// False where a voxel counts for the second sensor as much as for the first.
    counts_overlaps: bool,
}

impl PairBound {
    /// True if it knows overlaps, not single poses alone.
    pub(crate) fn has_overlaps(&self) -> bool {
        !self.overlaps.is_empty()
    }

    /// True if many sets of its poses may be split: overlaps are known, or would change nothing.
    pub(crate) fn can_split(&self) -> bool {
        self.has_overlaps() || (!self.counts_overlaps && self.poses <= MOST_POSES)
    }

    /// Most worth that a pose adds to a set with `beside` in it.
    pub(crate) fn added(&self, pose: u32, beside: u32) -> f64 {
        let overlap = self.overlaps.get(beside as usize * self.poses + pose as usize);
        self.singles[pose as usize] - overlap.unwrap_or(&0.0)
    }

    /// (pose, worth of the voxels outside `base` that it covers).
    pub(crate) fn singles(&self) -> Vec<(u32, f64)> {
        self.singles.iter().enumerate().map(|(pose, &single)| (pose as u32, single)).collect()
    }

    /// The bound with the split of the voxels that `bound_of` likes best, of those tried, and its value.
    ///
    /// At most `most_words` words of bitmaps are read for the overlaps: voxels of later groups then count without them.
    /// `go_on` is asked while the overlaps are added up; once it says no the splits so far are all that were tried.
    pub(crate) fn tightest(
        columns: &Columns,
        worths: &Worths,
        most_words: u64,
        go_on: &dyn Fn() -> bool,
        mut bound_of: impl FnMut(&Self) -> f64,
    ) -> (Self, f64) {
        let n = columns.poses;
        let scaled = |sum: u64| worths.unit * sum as f64;
        let in_full = |sum: u64| scaled(sum) * worths.in_full;
        let groups = &columns.groups;
        let mut base = groups.iter().map(|group| group.total).sum::<u64>();
        let mut now = Self {
            poses: n,
            base: in_full(base),
            singles: vec![0.0; n],
            overlaps: vec![],
            counts_overlaps: worths.overlap > 0.0,
        };
        let has_overlaps = n <= MOST_POSES && worths.overlap > 0.0;
        let mut overlaps = vec![0.0; if has_overlaps { n * n } else { 0 }];
        let mut best = (now.clone(), now.base);
        let mut singles = vec![0u64; n];
        let mut words = 0;
        for (index, group) in groups.iter().enumerate() {
            base -= group.total;
            for (sum, single) in singles.iter_mut().zip(&group.singles) {
                *sum += single;
            }
            now.base = in_full(base);
            now.singles = singles.iter().map(|&sum| scaled(sum)).collect();
            words += columns.group_words(index) * (n * n / 2) as u64;
            if words <= most_words && !overlaps.is_empty() {
                if !columns.add_overlaps(index, &mut overlaps, go_on) {
                    break;
                }
                let unit = worths.unit * worths.overlap;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_even_share_balances_sums_and_the_whole() {
        let of = |overlap, in_full| Worths { once: vec![], unit: 1.0, in_full, overlap };
        for n in 2..9_usize {
            assert!((of(1.0, 1.0).even_share(n) - 1.0 / (n - 1) as f64).abs() < 1e-15);
            assert_eq!(of(0.0, 2.0).even_share(n), 2.0 / n as f64);
            let (r, full) = (0.8, 1.2);
            let p = of(r, full).even_share(n);
            let count = n as f64 * p - r * (n - 1) as f64 * p * p;
            assert!(p == 1.0 || (count - full).abs() < 1e-12, "{n}: {p}");
        }
    }
}
