//! Own bodies that move against the vehicle's frame, and the sensors that ride on them.

use super::placement::nearest;
use super::{SensorName, UnknownSensor};
use crate::geom::Pose;

/// An own body that may carry sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Ride {
    /// Name of the body.
    pub body: SensorName,
    /// Where the body has carried the ego frame of frame 0, by the number of the frame; it stays in the last pose.
    pub poses: Vec<Pose>,
}

impl Ride {
    /// The body of a name; `None` for no name, or where there is none.
    pub(super) fn find(rides: &[Self], body: SensorName) -> Option<&Self> {
        rides.iter().find(|ride| !body.is_none() && ride.body == body)
    }

    pub(super) fn pose(&self, frame: usize) -> Pose {
        self.poses.get(frame).or(self.poses.last()).copied().unwrap_or(Pose::IDENTITY)
    }

    /// A name that none of some bodies has.
    pub(super) fn unknown(rides: &[Self], name: SensorName) -> UnknownSensor {
        let names = rides.iter().map(|ride| ride.body.as_str());
        let known: Vec<String> = names.clone().map(|name| format!("`{name}`")).collect();
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        let known = format!("{known}; leave `rides_on` out where no moving body carries the LiDAR");
        let nearest = nearest(name.as_str(), names);
        UnknownSensor { what: "body to ride on", name, nearest, known }
    }
}
