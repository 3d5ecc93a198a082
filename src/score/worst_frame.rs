//! The frame in which bodies that move leave least to be seen.

use serde::{Deserialize, Serialize};

use super::percent_down;

/// Frame of a scene whose own bodies move in which least of some ground is seen, or a target at fewest places.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorstFrame {
    /// Its number: the first in which the bodies stand so.
    pub frame: usize,
    /// Share seen there.
    pub share: f64,
}

impl WorstFrame {
    /// The least of some shares by frame, of equal ones the first; `None` where no share is larger.
    pub(crate) fn among(shares: impl IntoIterator<Item = (usize, f64)>) -> Option<Self> {
        let each: Vec<(usize, f64)> = shares.into_iter().collect();
        let &(frame, share) = each.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        each.iter().any(|(_, other)| *other > share).then_some(Self { frame, share })
    }

    /// In words behind a share: its own share where that is another, as ` (89.5 % in frame 0)`.
    pub(crate) fn beside(&self, share: f64) -> String {
        let Self { frame, share: own } = self;
        match *own == share {
            true => format!(" in frame {frame}"),
            false => format!(" ({:.1} % in frame {frame})", percent_down(*own)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Seen;
    use super::*;

    #[test]
    fn the_worst_frame_stands_beside_a_mean_and_behind_a_share_that_is_its_own() {
        let told = [0.895, 1.0].map(|share| {
            let worst_frame = Some(WorstFrame { frame: 3, share });
            Seen { worst_frame, ..Seen::of("ring", 1.0) }
        });
        let words = told.each_ref().map(Seen::to_string);
        assert_eq!(words[0], "ring: 100.0 % seen (89.5 % in frame 3), 90.0 % required");
        assert_eq!(words[1], "ring: 100.0 % seen in frame 3, 90.0 % required");
        let json = serde_json::to_value(&told[0]).unwrap();
        assert_eq!(json["worst_frame"], serde_json::json!({ "frame": 3, "share": 0.895 }));
    }
}
