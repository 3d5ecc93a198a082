//! Worth of each voxel for the first sensor that covers it, and for further ones.

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
    /// Worths of the bits of an atlas for placements of `lidars` sensors; `units` are those of each scene.
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
