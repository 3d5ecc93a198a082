//! The sums of a tally that an objective depends on.

use super::Objective;
use crate::problem::{Content, KINDS, OccupiedVoxel, REPEATS, Tally};

/// Sums over covered voxels that an objective needs, beside the number of occupied ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needed {
    /// True if empty voxels count.
    pub empty: bool,
    /// Kinds of information whose sums count.
    pub entropies: [bool; KINDS],
    /// Levels of [`Tally::near_repeated`] that count: 1 up to voxels that two LiDARs cover, 2 up to three.
    pub repeats: usize,
}

impl Needed {
    /// The sums of every kind, with or without empty voxels.
    pub fn all(empty: bool) -> Self {
        Self { empty, entropies: [true; KINDS], repeats: REPEATS }
    }
}

impl Objective {
    /// The sums over covered voxels that the objective depends on.
    pub fn needed(&self) -> Needed {
        let (entropy, near_repeated) = ([1 << 28; KINDS], [1 << 28; REPEATS]);
        let least =
            Tally { covered: 1, covered_nonzero: 1, entropy, near_repeated, ..Tally::default() };
        let occupied = vec![OccupiedVoxel { index: 0, entropy: [1 << 28; KINDS] }];
        let content = Content::new(Vec::new(), occupied, &[], true);
        let differs = |change: &dyn Fn(&mut Tally)| {
            let mut other = least.clone();
            change(&mut other);
            let [one, other] =
                [&least, &other].map(|tally| self.value_of_tally(tally, &content, 1));
            one != other
        };
        let counts = |level: &usize| differs(&|tally| tally.near_repeated[*level] += 1 << 28);
        Needed {
            repeats: (0..REPEATS).rev().find(counts).map_or(0, |level| level + 1),
            empty: differs(&|tally| tally.covered += 1),
            entropies: std::array::from_fn(|kind| differs(&|tally| tally.entropy[kind] += 1 << 28)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_objective_needs() {
        let objective = |text: &str| text.parse::<Objective>().unwrap();
        for (text, all_covered, gain) in [
            ("m_sog_scaled", true, false),
            ("detection.m_sog", true, false),
            ("m_sog_nonzero", false, false),
            ("s_mig", false, false),
            ("near_gain", false, true),
            ("information_gain", false, true),
            ("0.5*information_gain_share + 2*detection.information_gain", false, true),
            ("-1*information_gain", false, false),
            ("information_gain + m_sog", true, false),
            ("near_gain + information_gain_share + m_sog", true, false),
            ("near_gain_2", false, true),
            ("information_gain + 0.5*near_gain_3", false, true),
            ("near_gain + -1*near_gain_2", false, false),
        ] {
            let level = ["near_gain_2", "near_gain_3"].iter().rposition(|name| text.contains(name));
            assert_eq!(objective(text).needed().repeats, level.map_or(0, |k| k + 1), "{text}");
            assert_eq!(objective(text).needed().empty, all_covered, "{text}");
            assert_eq!(objective(text).is_information_gain(), gain, "{text}");
        }
    }
}
