//! The frame in which bodies that move leave least of some ground to be seen.

use serde::{Deserialize, Serialize};

use super::percent_down;

/// The words for a share of places of a target where bodies of the vehicle move.
pub(crate) const SEEN_IN_FRAME_0: &str = "seen with the body as in frame 0";

/// Frame of a scene whose own bodies move in which least of some ground is seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorstFrame {
    /// Its number: the first in which the bodies stand so.
    pub frame: usize,
    /// Share seen there.
    pub share: f64,
}

impl WorstFrame {
    /// In words behind a share: its own share where that is another, as ` (89.5 % in frame 0)`.
    pub(crate) fn beside(&self, share: f64) -> String {
        let Self { frame, share: own } = self;
        match *own == share {
            true => format!(" in frame {frame}"),
            false => format!(" ({:.1} % in frame {frame})", percent_down(*own)),
        }
    }
}
