//! Sensor poses and placements, their angles, and their mirror images at the plane y = 0.

use std::f64::consts::TAU;
use std::fmt;
use std::sync::{PoisonError, RwLock};

use glam::{DMat3, DVec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::geom::Pose;
use crate::maths;

/// Most LiDARs of one placement.
pub const MAX_LIDARS: usize = 16;
/// Farthest coordinate of a sensor from the ego origin, in metres.
const MAX_COORDINATE: f64 = 1e6;
/// Longest name of a placement or a sensor, in bytes; names of placements become file names.
const MAX_NAME: usize = 64;

/// Pose of one LiDAR in the ego frame, and its model; metres and radians, `R = Rz(yaw)·Ry(pitch)·Rx(roll)`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SensorPose {
    /// Forward.
    pub x: f64,
    /// Left.
    pub y: f64,
    /// Up, from the ground.
    pub z: f64,
    /// About x.
    #[serde(default)]
    pub roll: f64,
    /// About y.
    #[serde(default)]
    pub pitch: f64,
    /// About z.
    #[serde(default)]
    pub yaw: f64,
    /// Model of the sensor; none: the vehicle's first.
    #[serde(default, skip_serializing_if = "SensorName::is_none")]
    pub sensor: SensorName,
    /// Where in its turn a spinning sensor fires, in every frame: an angle about its own axis, in radians; none:
    /// as its model says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase: Option<f64>,
    /// Own body that moves and carries the sensor, whose pose counts where that body stands in frame 0; none: the vehicle's
    /// frame carries it.
    #[serde(default, skip_serializing_if = "SensorName::is_none")]
    pub rides_on: SensorName,
}

impl SensorPose {
    /// A level sensor of the vehicle's first model, in metres.
    pub fn at(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z, ..Self::default() }
    }

    /// Sensor-to-ego transform.
    pub fn ego_from_sensor(&self) -> Pose {
        Pose::new(self.position(), self.roll, self.pitch, self.yaw)
    }

    /// Position in the ego frame, in metres.
    pub fn position(&self) -> DVec3 {
        DVec3::new(self.x, self.y, self.z)
    }

    /// Names of the six numbers, in the order of the struct.
    pub const FIELDS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

    /// The six numbers, in the order of [`Self::FIELDS`].
    pub fn values(&self) -> [f64; 6] {
        [self.x, self.y, self.z, self.roll, self.pitch, self.yaw]
    }

    /// The six numbers by name.
    pub fn fields(&self) -> [(&'static str, f64); 6] {
        let values = self.values();
        std::array::from_fn(|k| (Self::FIELDS[k], values[k]))
    }

    /// Pose of six numbers in the order of [`Self::FIELDS`], of the vehicle's first model.
    pub const fn from_values([x, y, z, roll, pitch, yaw]: [f64; 6]) -> Self {
        let (sensor, phase, rides_on) = (SensorName::NONE, None, SensorName::NONE);
        Self { x, y, z, roll, pitch, yaw, sensor, phase, rides_on }
    }

    /// Mirrored at the plane y = 0: y, roll, yaw and phase change sign.
    pub fn mirrored(&self) -> Self {
        // 0 − y is never −0, which would print as such.
        let phase = self.phase.map(|phase| 0.0 - phase);
        Self { y: 0.0 - self.y, roll: 0.0 - self.roll, yaw: 0.0 - self.yaw, phase, ..*self }
    }

    /// Sum of the differences of the six numbers, in m and rad, angles up to half a turn; infinite between sensors
    /// of different models or on different bodies. Phases do not count: the image of a sensor is mirrored as it is mounted.
    pub fn difference(&self, other: &Self) -> f64 {
        if self.sensor != other.sensor || self.rides_on != other.rides_on {
            return f64::INFINITY;
        }
        self.differences(other).into_iter().sum()
    }

    /// Difference of each of the six numbers, in m and rad, angles up to half a turn.
    pub fn differences(&self, other: &Self) -> [f64; 6] {
        let (own, other) = (self.values(), other.values());
        std::array::from_fn(|k| match (own[k] - other[k]).abs() {
            // Straight back is half a turn to the left as well as to the right.
            by if k >= 3 && by > 0.5 * TAU => (by - TAU * (by / TAU).round()).abs(),
            by => by,
        })
    }
}

/// Named LiDAR poses on one vehicle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "ListedPlacement")]
pub struct Placement {
    /// Name of 1 to 64 letters, digits, `.`, `_`, `-`.
    pub name: String,
    /// 1 to [`MAX_LIDARS`] poses.
    pub lidars: Vec<SensorPose>,
}

/// A placement as files list it: `sightline optimize` writes the price of its sensors beside it, which is not read.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct ListedPlacement {
    /// 1 to 64 letters, digits, `.`, `_`, `-`.
    name: String,
    /// 1 to 16 poses.
    lidars: Vec<SensorPose>,
    /// Price of its sensors, which is not read.
    #[serde(rename = "price", default)]
    _price: Option<f64>,
}

impl From<ListedPlacement> for Placement {
    fn from(ListedPlacement { name, lidars, .. }: ListedPlacement) -> Self {
        Self { name, lidars }
    }
}

/// Why a sensor gives no beam table, or a placement cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum SensorError {
    #[error("the sensor has no beams; give it at least one channel and one azimuth step")]
    NoBeams,
    /// A direction without length, or not finite.
    #[error("direction {index} has no length; give a finite vector other than zero")]
    ZeroDirection { index: usize },
    /// The range is not a positive number.
    #[error("range {range} m is not a positive number")]
    BadRange {
        /// Metres.
        range: f64,
    },
    /// The name cannot become a file name.
    #[error(
        "`{name}` is not a placement name: use 1 to {MAX_NAME} ASCII letters, digits, `.`, `_` or `-`"
    )]
    BadName { name: String },
    /// Two placements share a name.
    #[error("the name `{name}` is used twice; names must differ")]
    UsedTwice { name: String },
    /// No LiDAR, or too many.
    #[error("placement `{name}` has {count} LiDARs; give it 1 to {MAX_LIDARS}")]
    LidarCount { name: String, count: usize },
    /// A number that is not finite, or a coordinate too far away.
    #[error(
        "placement `{name}`, LiDAR {lidar}: {field} = {value:?} is not usable; give a finite number{}",
        bounds_of(.field)
    )]
    BadNumber { name: String, lidar: usize, field: &'static str, value: f64 },
}

/// Range of a number of a pose in words, behind a space.
fn bounds_of(field: &str) -> String {
    let unit = if ["x", "y", "z"].contains(&field) {
        "coordinates within ±{} m"
    } else {
        "radians within ±{}"
    };
    format!(" ({})", unit.replace("{}", &MAX_COORDINATE.to_string()))
}

impl Placement {
    /// Checks the name, the number of LiDARs and every number.
    ///
    /// # Errors
    /// The first fault found, with the name of the placement.
    pub fn validate(&self) -> Result<(), SensorError> {
        let name = &self.name;
        let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
        if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(allowed) {
            return Err(SensorError::BadName { name: name.clone() });
        }
        if self.lidars.is_empty() || self.lidars.len() > MAX_LIDARS {
            let count = self.lidars.len();
            return Err(SensorError::LidarCount { name: name.clone(), count });
        }
        for (lidar, pose) in self.lidars.iter().enumerate() {
            let phase = pose.phase.map(|phase| ("phase", phase));
            for (field, value) in pose.fields().into_iter().chain(phase) {
                if !value.is_finite() || value.abs() > MAX_COORDINATE {
                    let name = name.clone();
                    return Err(SensorError::BadNumber { name, lidar, field, value });
                }
            }
        }
        Ok(())
    }

    /// Mirrored at the plane y = 0, LiDAR by LiDAR.
    pub fn mirrored(&self) -> Self {
        let lidars = self.lidars.iter().map(SensorPose::mirrored).collect();
        Self { name: self.name.clone(), lidars }
    }
}

/// Cosine of the pitch below which roll and yaw turn about the same axis.
const GIMBAL_LOCK: f64 = 1e-12;

impl From<&Pose> for SensorPose {
    /// Six numbers of a transform, of the vehicle's first model.
    fn from(pose: &Pose) -> Self {
        let [x, y, z] = pose.translation.to_array();
        let [roll, pitch, yaw] = angles(&pose.rotation);
        Self::from_values([x, y, z, roll, pitch, yaw])
    }
}

/// Roll, pitch and yaw of `Rz(yaw)·Ry(pitch)·Rx(roll)`; at a pitch of ±π/2 roll is 0 and yaw takes all.
fn angles(rotation: &DMat3) -> [f64; 3] {
    let at = |row: usize, column: usize| rotation.col(column)[row];
    let level = maths::hypot(at(0, 0), at(1, 0));
    // The arc sine would lose half of the digits near ±π/2.
    let pitch = maths::atan2(0.0 - at(2, 0), level);
    if level < GIMBAL_LOCK {
        return [0.0, pitch, maths::atan2(0.0 - at(0, 1), at(1, 1))];
    }
    let yaw = maths::atan2(at(1, 0), at(0, 0));
    // The roll is taken from the rotation that the yaw leaves: near ±π/2 both are uncertain, and their errors cancel.
    let (sin, cos) = maths::sin_cos(yaw);
    let roll = maths::atan2(sin * at(0, 2) - cos * at(1, 2), cos * at(1, 1) - sin * at(0, 1));
    [roll, pitch, yaw]
}

/// Most different names in a program: far more than any vehicle has sensors.
const MAX_NAMES: usize = 4096;

/// All names so far; a name's number is its position from 1 on.
static NAMES: RwLock<Vec<&'static str>> = RwLock::new(Vec::new());

/// Name of a sensor model of a vehicle, where none means its first, or of an own body that carries a sensor.
///
/// Names are kept for as long as the program runs, each once, so that poses are plain numbers to copy.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorName(u16);

impl SensorName {
    /// No name.
    pub const NONE: Self = Self(0);

    /// Most bytes of a name.
    pub const MOST_BYTES: usize = MAX_NAME;

    /// True if a text can be the name of a model: 1 to 64 bytes, no control character among them.
    pub fn is_name(name: &str) -> bool {
        !(name.is_empty() || name.len() > MAX_NAME || name.chars().any(char::is_control))
    }

    /// The name of a model.
    ///
    /// # Errors
    /// Fault with the name, in words: empty, longer than 64 bytes, or control characters in it; or
    /// there are more than 4096 different names.
    pub fn new(name: &str) -> Result<Self, String> {
        if !Self::is_name(name) {
            return Err(format!("{name:?} is no name; give 1 to {MAX_NAME} printable characters"));
        }
        let mut names = NAMES.write().unwrap_or_else(PoisonError::into_inner);
        let at = match names.iter().position(|known| *known == name) {
            Some(at) => at,
            None if names.len() == MAX_NAMES => {
                return Err(format!("there are more than {MAX_NAMES} different names of sensors"));
            }
            None => {
                names.push(Box::leak(name.into()));
                names.len() - 1
            }
        };
        Ok(Self(at as u16 + 1))
    }

    /// True if no model is named.
    pub fn is_none(&self) -> bool {
        self.0 == 0
    }

    /// The name; empty where none is given.
    pub fn as_str(&self) -> &'static str {
        let names = NAMES.read().unwrap_or_else(PoisonError::into_inner);
        usize::from(self.0).checked_sub(1).and_then(|at| names.get(at)).copied().unwrap_or("")
    }
}

impl fmt::Display for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl fmt::Debug for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

impl Serialize for SensorName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for SensorName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::new(&name).map_err(de::Error::custom)
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for SensorName {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "SensorName".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "type": "string", "minLength": 1, "maxLength": MAX_NAME })
    }
}

/// Names longer than this have no similar name: comparing takes time with both lengths.
const LONGEST_NAME: usize = 256;
/// Smallest Jaro–Winkler similarity of a slip and the name that was meant.
const LEAST_SIMILARITY: f64 = 0.7;

/// Most similar name of `known`, if `name` may be a slip for it.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    let lower = name.to_lowercase();
    known
        .into_iter()
        .filter(|known| known.len() <= LONGEST_NAME)
        .map(|k| (strsim::jaro_winkler(&lower, &k.to_lowercase()), k))
        .filter(|(likeness, _)| *likeness > LEAST_SIMILARITY)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_are_the_same_number() {
        let name = SensorName::new("VLP-16 of a test").unwrap();
        assert_eq!(SensorName::new("VLP-16 of a test"), Ok(name));
        assert_ne!(SensorName::new("VLS-128 of a test"), Ok(name));
        let json = serde_json::to_string(&name).unwrap();
        assert_eq!(json, "\"VLP-16 of a test\"");
        assert_eq!(serde_json::from_str::<SensorName>(&json).unwrap(), name);
        assert!(SensorName::default().is_none() && SensorName::default().as_str().is_empty());
        for bad in ["", "two\nlines", &"x".repeat(65)] {
            assert!(SensorName::new(bad).is_err(), "{bad:?}");
        }
    }
}
