//! Rules that a placement breaks, each with its amount and in words.

use super::SensorName;
use sightline_files::json::counted;

/// One broken rule of a placement.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Violation {
    /// A LiDAR lies outside the bounds.
    OutsideMount {
        /// Index of the LiDAR.
        lidar: usize,
        /// Name of the mount; empty where it has none.
        mount: String,
        /// `x`, `y`, `z`, `roll`, `pitch`, `yaw` or `phase`.
        field: &'static str,
        /// Distance from the bound, in m or rad.
        by: f64,
    },
    /// A LiDAR stands on a mount that does not take its model, or is full.
    NotTaken {
        /// Index of the LiDAR.
        lidar: usize,
        /// Its model.
        sensor: SensorName,
        /// Name of the mount that it stands on.
        mount: String,
        /// Models that the mount takes.
        takes: Vec<SensorName>,
        /// LiDARs that it holds, at most.
        room: usize,
        /// Distance from the nearest free mount for its model, in m or rad.
        by: f64,
    },
    /// No slot is left for a LiDAR of its model.
    NoPlace {
        /// Index of the LiDAR.
        lidar: usize,
        /// Its model.
        sensor: SensorName,
    },
    /// Two LiDARs are closer than allowed.
    TooClose {
        /// Indices of the LiDARs.
        lidars: [usize; 2],
        /// Missing distance in metres.
        by: f64,
    },
    /// A LiDAR lies inside a keep-out box.
    KeptOut {
        /// Index of the LiDAR.
        lidar: usize,
        /// Index of the box.
        keep_out: usize,
        /// Distance to its nearest face in metres.
        by: f64,
    },
    /// The LiDARs stand at different heights against the rule.
    UnequalHeight {
        /// Height of the highest above the lowest, in metres.
        by: f64,
    },
    /// A LiDAR has no mirror image among the others, and does not lie in the plane of symmetry.
    NotMirrored {
        /// Index of the LiDAR.
        lidar: usize,
        /// Index of the LiDAR without a mirror image that is nearest to this one's; it may be the LiDAR itself.
        partner: usize,
        /// Models of the LiDAR and of the partner where they differ.
        models: Option<[SensorName; 2]>,
        /// Pose field that is farthest off.
        field: &'static str,
        /// Difference of that field, in m or rad.
        off: f64,
        /// Sum of the differences of all pose fields from its mirror image, in m and rad; over both LiDARs where each
        /// is nearest to the other's image.
        by: f64,
    },
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
            Self::NotMirrored { lidar, partner, models: Some([own, other]), .. } => {
                let mut two = [(lidar, own), (partner, other)];
                two.sort_unstable();
                let [(a, first), (b, second)] = two;
                write!(
                    f,
                    "LiDARs {a} and {b}: a mirrored pair at the plane y = 0 has one model, not `{first}` and `{second}`"
                )
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
