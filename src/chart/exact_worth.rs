//! Information of the voxels that are occupied in some frame, for the `f64` scorer.

use crate::problem::KINDS;
use crate::psog::{EntropyKind, EntropyTable, Psog};
use crate::scene::{GROUND_CLASSES, Scene};

/// Information of the voxels that are occupied in some frame.
#[derive(Debug, Clone)]
pub(super) struct Worth {
    /// One bit a voxel of the grid: whether it is among them.
    occupied: Vec<u64>,
    /// How many of them lie before each word.
    before: Vec<u32>,
    /// Entropies in nats (all classes, detection target against the rest, occupied or not) and the share of
    /// [`crate::problem::NEAR_KIND`], in all 1.
    worth: Vec<[f64; KINDS]>,
}

impl Worth {
    pub(super) fn new(scene: &Scene, psog: &Psog) -> Self {
        let all = occupied(scene, psog);
        let mut occupied = vec![0_u64; psog.roi().voxel_count().div_ceil(64) as usize];
        for (voxel, _) in &all {
            occupied[(voxel >> 6) as usize] |= 1 << (voxel & 63);
        }
        let mut sum = 0;
        let before = occupied.iter().map(|word| {
            sum += word.count_ones();
            sum - word.count_ones()
        });
        let before = before.collect();
        Self { occupied, before, worth: all.into_iter().map(|(_, worth)| worth).collect() }
    }

    /// Empties a bitmap of covered voxels; how many there were, how many of them are occupied. Adds the information of
    /// these to `sums`, in order of their index.
    pub(super) fn take(&self, bitmap: &mut [u64], sums: &mut [f64; KINDS]) -> [u64; 2] {
        let (mut covered, mut nonzero) = (0, 0);
        for (k, word) in bitmap.iter_mut().enumerate() {
            let marked = std::mem::take(word);
            if marked == 0 {
                continue;
            }
            covered += u64::from(marked.count_ones());
            let mut left = marked & self.occupied[k];
            nonzero += u64::from(left.count_ones());
            while left != 0 {
                let below = (left & left.wrapping_neg()) - 1;
                let rank = self.before[k] + (self.occupied[k] & below).count_ones();
                for (sum, h) in sums.iter_mut().zip(&self.worth[rank as usize]) {
                    *sum += h;
                }
                left &= left - 1;
            }
        }
        [covered, nonzero]
    }

    /// Bytes of bits and information.
    pub(super) fn bytes(&self) -> u64 {
        let bits = size_of_val(&self.occupied[..]) + size_of_val(&self.before[..]);
        (bits + size_of_val(&self.worth[..])) as u64
    }
}

/// Linear index and information of these voxels, rising.
fn occupied<'a>(scene: &'a Scene, psog: &'a Psog) -> Vec<(u64, [f64; KINDS])> {
    let table = EntropyTable::new(psog.frames());
    let targets = scene.detection_among(psog.classes());
    let rows = psog.index().iter().zip(psog.rows());
    // The first of the most frequent classes.
    let commonest =
        |row: &[u16]| row.iter().position(|count| row.iter().all(|c| c <= count)).unwrap_or(0);
    let (ny, nz) = (u64::from(psog.roi().shape()[1]), u64::from(psog.roi().shape()[2]));
    let (min, edge) = (psog.roi().min(), psog.roi().voxel());
    let plan = |index: u64| {
        let x = min[0] + (index / (ny * nz)) as f64 * edge[0] + edge[0] / 2.0;
        let y = min[1] + (index / nz % ny) as f64 * edge[1] + edge[1] / 2.0;
        (x * x + y * y).sqrt()
    };
    let near = |index: u64| ((80.0 / plan(index)).round().clamp(1.0, 8.0)) / 8.0;
    let is_floor = |index: u64, row: &[u16]| {
        let name = &psog.classes()[commonest(row)];
        let is_occupied = row.iter().any(|&count| count > 0);
        is_occupied && GROUND_CLASSES.contains(&name.as_str()) && plan(index) <= 10.0
    };
    let all = || psog.index().iter().copied().zip(psog.rows());
    let told: f64 =
        all().map(|(index, row)| table.entropy(row, EntropyKind::Segmentation) * near(index)).sum();
    let floor = all().filter(|(index, row)| is_floor(*index, row)).count() as f64;
    let whole: f64 = if told > 0.0 { 1.0 } else { 0.0 } + if floor > 0.0 { 0.25 } else { 0.0 };
    let worth = |index: u64, row: &[u16]| {
        let target = targets.iter().map(|&c| row[usize::from(c)]).sum();
        let all: u16 = row.iter().sum();
        let merged = [target, all - target];
        let entropy = table.entropy(row, EntropyKind::Segmentation);
        let of_floor = if is_floor(index, row) { 0.25 / floor } else { 0.0 };
        [
            entropy,
            table.entropy(&merged, EntropyKind::Segmentation),
            table.entropy(row, EntropyKind::Bernoulli),
            (entropy * near(index) / told.max(f64::MIN_POSITIVE) + of_floor) / whole.max(0.25),
        ]
    };
    let some = rows.filter(|(_, row)| row.iter().any(|&count| count > 0));
    some.map(|(&index, row)| (index, worth(index, row))).collect()
}
