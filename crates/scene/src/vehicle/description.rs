//! The `lidar`, `mount` and `vehicle` of a scene file, and a vehicle file, as they are written.
//!
//! Keys, units and defaults are explained in `scenes/README.md`.

use serde::Deserialize;
use sightline_files::json::{DescriptionError, Location, check};

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct LidarDescription {
    pub(crate) channels: Option<u64>,
    pub(crate) fov: Option<[f64; 2]>,
    pub(crate) file: Option<String>,
    pub(crate) azimuth_offsets: Option<String>,
    pub(crate) azimuth_steps: Option<u64>,
    pub(crate) azimuth: Option<[f64; 2]>,
    pub(crate) window: Option<[f64; 2]>,
    pub(crate) directions: Option<Vec<[f64; 3]>>,
    pub(crate) range: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct MountDescription {
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
    #[serde(default)]
    pub(crate) roll: [f64; 2],
    #[serde(default)]
    pub(crate) pitch: [f64; 2],
    #[serde(default)]
    pub(crate) yaw: [f64; 2],
    #[serde(default)]
    pub(crate) min_distance: f64,
    pub(crate) lidars: u64,
    #[serde(default)]
    pub(crate) keep_out: Vec<KeepOutDescription>,
    #[serde(default)]
    pub(crate) equal_height: bool,
    #[serde(default)]
    pub(crate) symmetric: bool,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct KeepOutDescription {
    pub min: [f64; 3],
    pub max: [f64; 3],
}

/// A vehicle, in a file of its own or in a scene.
// `B` is a shape of the body and `M` a further body, which a scene reads.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schemars(rename = "VehicleDescription"))]
pub struct VehicleDescription<B, M> {
    /// JSON Schema of this file, which editors read.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Version of the format, 1.
    #[serde(rename = "sightline")]
    #[cfg_attr(feature = "schema", schemars(extend("const" = 1)))]
    _version: Option<u64>,
    pub(crate) name: Option<String>,
    #[serde(default = "Vec::<B>::new")]
    pub(crate) body: Vec<B>,
    #[serde(default = "Vec::<M>::new")]
    pub(crate) bodies: Vec<M>,
    pub(crate) sensors: Vec<ModelDescription>,
    pub(crate) mounts: Vec<MountingDescription>,
    #[serde(default)]
    pub(crate) min_distance: f64,
    #[serde(default)]
    pub(crate) keep_out: Vec<KeepOutDescription>,
    #[serde(default)]
    pub(crate) equal_height: bool,
    #[serde(default)]
    pub(crate) symmetric: bool,
    #[serde(default)]
    pub(crate) require: Vec<RequirementDescription>,
    #[serde(default)]
    pub(crate) other_sensors: Vec<OtherSensorDescription>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OtherSensorDescription {
    pub name: String,
    pub technology: String,
    pub x: f64,
    pub y: f64,
    pub z: f64,
    #[serde(default)]
    pub roll: f64,
    #[serde(default)]
    pub pitch: f64,
    #[serde(default)]
    pub yaw: f64,
    pub fov: [f64; 2],
    pub range: f64,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ModelDescription {
    pub name: String,
    pub lidar: LidarDescription,
    #[serde(default)]
    pub price: f64,
    pub phase: Option<PhaseDescription>,
    pub response: Option<ResponseDescription>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ResponseDescription {
    pub rate: Option<f64>,
    pub rated_range: Option<f64>,
    pub softness: Option<f64>,
    pub noise: Option<f64>,
    pub divergence: Option<[f64; 2]>,
    pub pulse: Option<f64>,
    pub echoes: Option<String>,
    pub min_range: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected \"free\", an angle in radians, or a range of them")]
pub enum PhaseDescription {
    Angle(f64),
    Range([f64; 2]),
    Word(String),
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MountingDescription {
    pub name: String,
    pub min: Option<[f64; 3]>,
    pub max: Option<[f64; 3]>,
    pub polygon: Option<Vec<[f64; 3]>>,
    pub mesh: Option<MeshPatchDescription>,
    pub offset: Option<[f64; 2]>,
    #[serde(default)]
    pub roll: [f64; 2],
    #[serde(default)]
    pub pitch: [f64; 2],
    #[serde(default)]
    pub yaw: [f64; 2],
    pub sensors: Option<Vec<String>>,
    pub count: CountDescription,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MeshPatchDescription {
    pub file: String,
    pub scale: Option<f64>,
    #[serde(default)]
    pub translate: [f64; 3],
    #[serde(default)]
    pub roll: f64,
    #[serde(default)]
    pub pitch: f64,
    #[serde(default)]
    pub yaw: f64,
    pub axes: Option<String>,
    pub within: Option<KeepOutDescription>,
    pub facing: Option<FacingDescription>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FacingDescription {
    pub direction: [f64; 3],
    pub angle: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "expected a number of sensors, 4 for example, or a range, [0, 2] for example"
)]
pub enum CountDescription {
    Exactly(u64),
    Range([u64; 2]),
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RequirementDescription {
    pub name: Option<String>,
    pub min: Option<[f64; 3]>,
    pub max: Option<[f64; 3]>,
    #[serde(default)]
    pub without: Vec<KeepOutDescription>,
    pub target: Option<String>,
    pub from: Option<f64>,
    pub within: Option<f64>,
    pub bearing: Option<[f64; 2]>,
    pub beams: Option<u64>,
    pub ground: Option<f64>,
    pub blind_zone: Option<String>,
    pub depth: Option<f64>,
    pub overlap: Option<f64>,
    pub share: Option<f64>,
    #[serde(default)]
    pub without_any_one: bool,
}

impl RequirementDescription {
    /// Name of the rule at `at`; `default` where it gives itself none.
    ///
    /// # Errors
    /// A name that is not one.
    pub fn named(&self, at: &Location, default: String) -> Result<String, DescriptionError> {
        match &self.name {
            Some(name) => check::name(&at.key("name"), name.clone()),
            None => Ok(default),
        }
    }

    /// Refuses a key of the rule at `at` beside its name and the `keys` of its kind.
    ///
    /// # Errors
    /// The first of them; `mend` says how to mend it.
    pub fn has_only(
        &self,
        at: &Location,
        keys: &[&str],
        mend: impl Fn(&str) -> &'static str,
    ) -> Result<(), DescriptionError> {
        let given = [
            ("min", self.min.is_some()),
            ("max", self.max.is_some()),
            ("without", !self.without.is_empty()),
            ("target", self.target.is_some()),
            ("from", self.from.is_some()),
            ("within", self.within.is_some()),
            ("bearing", self.bearing.is_some()),
            ("beams", self.beams.is_some()),
            ("without_any_one", self.without_any_one),
            ("ground", self.ground.is_some()),
            ("blind_zone", self.blind_zone.is_some()),
            ("depth", self.depth.is_some()),
            ("overlap", self.overlap.is_some()),
            ("share", self.share.is_some()),
        ];
        match given.into_iter().find(|(key, is_given)| *is_given && !keys.contains(key)) {
            None => Ok(()),
            Some((key, _)) => {
                let mend = mend(key).to_owned();
                Err(DescriptionError::Misplaced { at: Box::new(at.clone()), key, mend })
            }
        }
    }

    /// Share that is required.
    ///
    /// # Errors
    /// None is given.
    pub fn share(&self, at: &Location) -> Result<f64, DescriptionError> {
        self.share.ok_or_else(|| DescriptionError::Missing {
            at: Box::new(at.clone()),
            key: "share",
            mend: "say which share must be seen, `\"share\": 0.9` for example".to_owned(),
        })
    }
}
