//! Depth of the blind zone on each side.

use std::sync::Arc;

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use super::zone::BlindZone;
use super::{NEAR, NearField};
use crate::problem::{Problem, spread};
use crate::score::metres_up;

/// A problem over the frames in which the near field of a result is looked at: all, as in studies and requirements, but frames
/// of a P-SOG without geometry.
pub(crate) fn cast_frames(problem: &Arc<Problem>) -> Arc<Problem> {
    let (all, with_geometry) = (problem.frame_count(), problem.geometry_frame_count());
    match all == with_geometry {
        true => problem.clone(),
        false => Arc::new(problem.over(&spread(with_geometry, None))),
    }
}

/// Depth of the blind zone of a placement on each side.
///
/// JSON has `ahead`, `behind`, `left` and `right` in metres, `null` where a side does not end within 10 m or has no ground.
/// `lost` and `worst_frames` are there where the blind zone has some, and `frames` is their number.
#[derive(Debug, Clone, PartialEq)]
pub struct BlindDepths {
    /// The zone without lanes and outline.
    zone: BlindZone,
    frames: u64,
}

impl From<&NearField> for BlindDepths {
    fn from(near: &NearField) -> Self {
        let BlindZone { area, ahead, behind, left, right, .. } = near.zone;
        let (lost, worst_frames) = (near.zone.lost.clone(), near.zone.worst_frames.clone());
        let (lanes, polygon) = (Vec::new(), Vec::new());
        let zone =
            BlindZone { lanes, polygon, area, ahead, behind, left, right, lost, worst_frames };
        Self { zone, frames: near.frames }
    }
}

impl BlindDepths {
    /// Number of frames that it is taken over.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Depth on each side, such as `ahead 2.1 m, behind more than 10 m, …`, with the frame where bodies move, and ground that
    /// is lost again behind it.
    pub(crate) fn in_words(&self) -> String {
        let told = self.zone.depths().map(|(side, depth)| {
            let metres =
                depth.map_or(format!("more than {NEAR} m"), |d| format!("{:.1} m", metres_up(d)));
            format!("{side} {metres}{}{}", self.zone.in_frame(side), self.zone.but_lost(side))
        });
        told.join(", ")
    }
}

impl Serialize for BlindDepths {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let BlindZone { lost, worst_frames, .. } = &self.zone;
        let mut map = serializer.serialize_map(None)?;
        for (side, depth) in self.zone.depths() {
            map.serialize_entry(side, &depth)?;
        }
        if !lost.is_empty() {
            map.serialize_entry("lost", lost)?;
        }
        if !worst_frames.is_empty() {
            map.serialize_entry("worst_frames", worst_frames)?;
        }
        map.serialize_entry("frames", &self.frames)?;
        map.end()
    }
}
