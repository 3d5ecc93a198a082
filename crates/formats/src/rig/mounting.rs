//! Where `base_link` and the optical centres are.

use std::collections::BTreeMap;

use super::angles::{compose, up};
use super::known;
use sightline_scene::vehicle::SensorPose;

/// Offsets from the frames of a file to the optical centres in the ego frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mounting {
    /// Position of `base_link` in the ego frame, in metres; its axes are the ego frame's.
    pub base_link: [f64; 3],
    /// Optical centre above the foot along the sensor's own z, in metres, by frame or sensor.
    pub optical_heights: BTreeMap<String, f64>,
}

impl Mounting {
    /// Height of the optical centre above the foot as given for the frame, for its sensor, or as known.
    pub fn height(&self, frame: &str, sensor: Option<&str>) -> Option<f64> {
        let known = || sensor.and_then(known::optical_height);
        self.given_height(frame, sensor).or_else(known)
    }

    /// Height as given for the frame or for its sensor.
    pub(super) fn given_height(&self, frame: &str, sensor: Option<&str>) -> Option<f64> {
        let given = |name: &str| {
            let same = |(key, height): (&String, &f64)| known::same(key, name).then_some(*height);
            self.optical_heights.iter().find_map(same)
        };
        self.optical_heights.get(frame).copied().or_else(|| sensor.and_then(given))
    }

    /// Pose in the ego frame of a pose in `base_link`.
    pub(super) fn to_ego(&self, pose: &SensorPose) -> SensorPose {
        self.moved(pose, 1.0)
    }

    /// Pose in `base_link` of a pose in the ego frame.
    pub(super) fn to_base(&self, pose: &SensorPose) -> SensorPose {
        self.moved(pose, -1.0)
    }

    fn moved(&self, pose: &SensorPose, sign: f64) -> SensorPose {
        let [x, y, z] = self.base_link.map(|v| sign * v);
        SensorPose { x: pose.x + x, y: pose.y + y, z: pose.z + z, ..*pose }
    }

    /// Pose of the foot in `base_link`, with the sensor's phase, and height of the optical centre above it.
    pub(super) fn foot(
        &self,
        frame: &str,
        sensor: Option<&str>,
        pose: &SensorPose,
    ) -> (SensorPose, f64) {
        let height = self.height(frame, sensor).unwrap_or(0.0);
        let foot = compose(&self.to_base(pose), &up(-height));
        (SensorPose { phase: pose.phase, ..foot }, height)
    }
}
