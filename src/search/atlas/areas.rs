//! Required areas as bits, one for each voxel of each area.

use crate::cover::BitOrder;
use crate::problem::Content;

/// Extra share required beyond the least, because a few frames stand for all.
const MARGIN: f64 = 0.01;

/// Voxels of all areas of a problem, area after area.
pub(crate) struct AreaBits {
    voxels: Vec<u32>,
    /// First bit of each area and the end.
    starts: Vec<usize>,
    /// Least share of each area, with the margin.
    least: Vec<f64>,
}

impl AreaBits {
    pub(crate) fn new(content: &Content) -> Self {
        let (mut voxels, mut starts) = (Vec::new(), vec![0]);
        for set in content.classes().len()..content.set_count() {
            voxels.extend_from_slice(content.voxels_of_class(set));
            starts.push(voxels.len());
        }
        let asked = |share: f64| if share > 0.0 { (share + MARGIN).min(1.0) } else { 0.0 };
        let least = content.areas().iter().map(|area| asked(area.required.share)).collect();
        Self { voxels, starts, least }
    }

    pub(crate) fn words(&self) -> usize {
        self.voxels.len().div_ceil(64)
    }

    /// Sets the bits of the voxels that a bitmap holds.
    pub(crate) fn take(&self, from: BitOrder, bitmap: &[u64], out: &mut [u64]) {
        for (k, &voxel) in self.voxels.iter().enumerate() {
            let bit = from.bit_of(voxel) as usize;
            out[k / 64] |= (bitmap[bit / 64] >> (bit % 64) & 1) << (k % 64);
        }
    }

    /// Missing share in bits of several frames, summed over areas.
    pub(super) fn missing(&self, bits: &[u64]) -> f64 {
        let found = self.shares(bits);
        self.least.iter().zip(found).map(|(least, share)| (least - share).max(0.0)).sum()
    }

    /// Share of each area in bits of several frames; 0 of one without voxels.
    pub(crate) fn shares(&self, bits: &[u64]) -> Vec<f64> {
        let words = self.words();
        if words == 0 {
            return vec![0.0; self.least.len()];
        }
        let frames = bits.len() / words;
        let area = |range: &[usize]| {
            let count = |words: &[u64]| ones_below(words, range[1]) - ones_below(words, range[0]);
            let all: u64 = bits.chunks(words).map(count).sum();
            all as f64 / (frames * (range[1] - range[0])).max(1) as f64
        };
        self.starts.windows(2).map(area).collect()
    }
}

fn ones_below(words: &[u64], end: usize) -> u64 {
    let whole: u64 = words[..end / 64].iter().map(|word| u64::from(word.count_ones())).sum();
    let part = words.get(end / 64).map_or(0, |word| word & ((1 << (end % 64)) - 1));
    whole + u64::from(part.count_ones())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Content;
    use crate::psog::Roi;
    use crate::vehicle::Requirement;

    #[test]
    fn what_is_missing_is_counted_by_area_and_frame() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 20, 2]).unwrap();
        let area = |from: f64, to: f64, share: f64| Requirement {
            name: "x".into(),
            inside: [[0.0, from, 0.0], [4.0, to, 2.0]],
            without: vec![[[0.0, 0.0, 0.0], [1.0, 20.0, 2.0]]],
            share,
        };
        // 3 × 10 × 2 = 60 voxels and 3 × 5 × 2 = 30: the second begins within the first word.
        let content = Content::new(vec!["a".into()], vec![], &[vec![]], false);
        let content = content.with_areas(&roi, &[area(0.0, 10.0, 0.5), area(10.0, 15.0, 0.24)]);
        let areas = AreaBits::new(&content);
        assert_eq!((areas.words(), &areas.starts[..]), (2, &[0, 60, 90][..]));
        let order = BitOrder::linear(&roi);
        let mut seen = vec![0; order.words()];
        // Column (1, y) is seen: a third of each area.
        (40..80).for_each(|voxel: usize| seen[voxel / 64] |= 1 << (voxel % 64));
        let mut bits = vec![0; 4];
        areas.take(order, &seen, &mut bits[..2]);
        assert_eq!(bits.iter().map(|word| word.count_ones()).sum::<u32>(), 30);
        // Seen in one of two frames: a sixth; the margin requires a hundredth more.
        let want = (0.51 - 1.0 / 6.0) + (0.25 - 1.0 / 6.0);
        assert!((areas.missing(&bits) - want).abs() < 1e-12);
        assert!((areas.missing(&[0; 4]) - 0.76).abs() < 1e-12);
        let none = AreaBits::new(&Content::new(vec![], vec![], &[], false));
        assert_eq!((none.words(), none.missing(&[])), (0, 0.0));
    }
}
