//! Rules that a placement breaks, each with its amount and in words.

use super::SensorName;
use sightline_files::json::counted;

/// One broken rule of a placement. `lidar` is the index of a LiDAR, `sensor` its model, `mount` the name of the mount that
/// it stands on; `by` is the distance from keeping the rule, in m or rad.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the enum and its variants tell the fields")]
pub enum Violation {
    /// A LiDAR lies outside the bounds of `field`: `x`, `y`, `z`, `roll`, `pitch`, `yaw` or `phase`. The mount of a scene
    /// has an empty name.
    OutsideMount { lidar: usize, mount: String, field: &'static str, by: f64 },
    /// A LiDAR stands on a mount that takes other models, or is full with `room` LiDARs. `by` leads to the nearest free
    /// mount for its model.
    NotTaken {
        lidar: usize,
        sensor: SensorName,
        mount: String,
        takes: Vec<SensorName>,
        room: usize,
        by: f64,
    },
    /// No slot is left for a LiDAR of its model.
    NoPlace { lidar: usize, sensor: SensorName },
    /// Two LiDARs are closer than allowed.
    TooClose { lidars: [usize; 2], by: f64 },
    /// A LiDAR lies inside a keep-out box, by metres from its nearest face.
    KeptOut { lidar: usize, keep_out: usize, by: f64 },
    /// The LiDARs stand at different heights against the rule, from the lowest to the highest.
    UnequalHeight { by: f64 },
    /// A LiDAR has no mirror image among the others, and does not lie in the plane of symmetry. The image of `partner` is
    /// nearest to it, which may be the LiDAR itself; `field` is farthest off, by `off`. `by` sums up the differences of all
    /// fields, over both LiDARs where each is nearest to the other's image.
    NotMirrored { lidar: usize, partner: usize, field: &'static str, off: f64, by: f64 },
}

impl Violation {
    /// Distance from keeping the rule, in m or rad.
    pub fn amount(&self) -> f64 {
        match self {
            Self::OutsideMount { by, .. }
            | Self::NotTaken { by, .. }
            | Self::TooClose { by, .. }
            | Self::KeptOut { by, .. }
            | Self::UnequalHeight { by }
            | Self::NotMirrored { by, .. } => *by,
            // Farther than anything that a move of a LiDAR mends.
            Self::NoPlace { .. } => 1e3,
        }
    }

    /// The rule in words, angles in degrees.
    pub fn in_degrees(&self) -> String {
        let words = self.to_string();
        match self {
            Self::OutsideMount { by, .. } => {
                let degrees = format!(" is {:.2}° outside ", by.to_degrees());
                words.replacen(&format!(" is {by:.3} rad outside "), &degrees, 1)
            }
            Self::NotMirrored { off, .. } => {
                let degrees = format!(" is off by {:.2}° ", off.to_degrees());
                words.replacen(&format!(" is off by {off:.3} rad "), &degrees, 1)
            }
            _ => words,
        }
    }
}

/// Words for a mount whose `count` is 0.
pub(super) const HOLDS_NONE: &str = "holds no LiDAR (`count` is 0)";

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutsideMount { lidar, mount, field, by } => {
                let unit = if matches!(*field, "x" | "y" | "z") { "m" } else { "rad" };
                let name = if mount.is_empty() { "" } else { " " };
                write!(f, "LiDAR {lidar}: {field} is {by:.3} {unit} outside the mount{name}{mount}")
            }
            Self::NotTaken { lidar, sensor, mount, takes, room, .. } => {
                write!(f, "LiDAR {lidar}: it stands on mount {mount}, which ")?;
                if *room == 0 {
                    return f.write_str(HOLDS_NONE);
                }
                if takes.contains(sensor) {
                    return write!(f, "holds {} at most", counted(*room, "LiDAR"));
                }
                let takes: Vec<String> = takes.iter().map(|model| format!("`{model}`")).collect();
                write!(f, "takes {}, not `{sensor}`", takes.join(" or "))
            }
            Self::NoPlace { lidar, sensor } if sensor.is_none() => {
                write!(f, "LiDAR {lidar}: there is no mount for one more sensor without a name")
            }
            Self::NoPlace { lidar, sensor } => {
                write!(f, "LiDAR {lidar}: there is no mount for one more `{sensor}`")
            }
            Self::TooClose { lidars: [a, b], by } => {
                write!(f, "LiDARs {a} and {b} are {by:.3} m too close")
            }
            Self::KeptOut { lidar, keep_out, by } => {
                write!(f, "LiDAR {lidar} is {by:.3} m inside of keep_out[{keep_out}]")
            }
            Self::UnequalHeight { by } => {
                write!(f, "heights differ by {by:.3} m, and are to be equal")
            }
            Self::NotMirrored { lidar, partner, field, off, .. } => {
                match lidar == partner {
                    true => write!(f, "LiDAR {lidar}")?,
                    false => write!(f, "LiDARs {} and {}", lidar.min(partner), lidar.max(partner))?,
                }
                let unit = if matches!(*field, "x" | "y" | "z") { "m" } else { "rad" };
                write!(
                    f,
                    ": {field} is off by {off:.3} {unit} from a mirror image at the plane y = 0"
                )
            }
        }
    }
}
