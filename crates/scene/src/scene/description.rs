//! The scene file as written: serde's types, before any check.
//!
//! Keys, units and defaults are explained in `scenes/README.md`.

use serde::Deserialize;
use serde::de::{Error as _, MapAccess, Visitor};

use crate::vehicle::{LidarDescription, MountDescription, VehicleDescription};

/// A whole scene file.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// JSON Schema of this file, which editors read.
    #[serde(rename = "$schema")]
    pub _schema: Option<String>,
    /// Version of the format, 1.
    // Checked before the rest is read; here only so that the key is known.
    #[serde(rename = "sightline")]
    #[cfg_attr(feature = "schema", schemars(extend("const" = 1)))]
    pub _version: u64,
    pub name: Option<String>,
    pub roi: RoiDescription,
    pub psog: Option<PsogDescription>,
    pub lidar: Option<LidarDescription>,
    pub mount: Option<MountDescription>,
    pub vehicle: Option<VehicleSource>,
    pub coverage: Option<String>,
    pub classes: Option<Vec<String>>,
    pub detection: Option<Vec<String>>,
    #[serde(default)]
    pub reflectance: Dictionary<f64>,
    #[serde(default)]
    pub shapes: Dictionary<Vec<ShapeDescription>>,
    #[serde(default, rename = "static")]
    pub world: Vec<ShapeDescription>,
    #[serde(default)]
    pub actors: Vec<ActorDescription>,
    pub frames: Option<u64>,
    pub rate: Option<f64>,
    pub ego: Option<EgoDescription>,
}

/// The vehicle of a scene.
#[derive(Debug)]
pub enum VehicleSource {
    /// A file beside the scene.
    File(String),
    /// Written in the scene.
    Inline(Box<VehicleDescription<ShapeDescription, BodyDescription>>),
}

impl<'de> Deserialize<'de> for VehicleSource {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct SourceVisitor;
        impl<'de> Visitor<'de> for SourceVisitor {
            type Value = VehicleSource;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of a vehicle file, or a vehicle")
            }

            fn visit_str<E: serde::de::Error>(self, file: &str) -> Result<Self::Value, E> {
                Ok(VehicleSource::File(file.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let map = serde::de::value::MapAccessDeserializer::new(map);
                Ok(VehicleSource::Inline(Box::new(VehicleDescription::deserialize(map)?)))
            }
        }
        deserializer.deserialize_any(SourceVisitor)
    }
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RoiDescription {
    pub min: [f64; 3],
    pub max: [f64; 3],
    pub voxel: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PsogDescription {
    pub file: Option<String>,
    pub scan: Option<ScanDescription>,
}

#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ScanDescription {
    pub channels: Option<u64>,
    pub fov: Option<[f64; 2]>,
    pub azimuth_steps: Option<u64>,
    pub spacing: Option<f64>,
    pub range: Option<f64>,
    pub height: Option<f64>,
    pub window: Option<u64>,
    pub stride: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ActorDescription {
    pub name: Option<String>,
    pub kind: Option<String>,
    pub reflectance: Option<f64>,
    pub parts: Vec<ShapeDescription>,
    pub poses: Option<Vec<PoseDescription>>,
    pub route: Option<RouteDescription>,
}

#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EgoDescription {
    #[serde(default)]
    pub body: Vec<ShapeDescription>,
    #[serde(default)]
    pub bodies: Vec<BodyDescription>,
    pub poses: Option<Vec<PoseDescription>>,
    pub route: Option<RouteDescription>,
}

/// Another body of the vehicle, with poses in the ego frame.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BodyDescription {
    pub name: Option<String>,
    pub parts: Vec<ShapeDescription>,
    pub poses: Option<Vec<PoseDescription>>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PoseDescription {
    pub x: f64,
    pub y: f64,
    #[serde(default)]
    pub z: f64,
    #[serde(default)]
    pub roll: f64,
    #[serde(default)]
    pub pitch: f64,
    #[serde(default)]
    pub yaw: f64,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RouteDescription {
    pub points: Vec<Vec<f64>>,
    #[serde(default)]
    pub start: f64,
    pub spacing: f64,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ShapeDescription {
    pub class: Option<String>,
    #[serde(rename = "box")]
    pub cuboid: Option<BoxDescription>,
    pub prism: Option<PrismDescription>,
    pub cylinder: Option<CylinderDescription>,
    pub plane: Option<PlaneDescription>,
    pub mesh: Option<MeshDescription>,
    pub urdf: Option<UrdfDescription>,
    pub shape: Option<String>,
    pub at: Option<Vec<Vec<f64>>>,
    pub repeat: Option<RepeatDescription>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RepeatDescription {
    pub count: u64,
    pub step: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BoxDescription {
    pub center: Option<[f64; 3]>,
    pub foot: Option<[f64; 3]>,
    pub size: Option<[f64; 3]>,
    pub min: Option<[f64; 3]>,
    pub max: Option<[f64; 3]>,
    #[serde(default)]
    pub yaw: f64,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PrismDescription {
    pub base: Vec<[f64; 2]>,
    pub z: [f64; 2],
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CylinderDescription {
    pub foot: [f64; 3],
    pub radius: f64,
    pub height: f64,
    pub sides: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PlaneDescription {
    pub min: [f64; 2],
    pub max: [f64; 2],
    pub z: f64,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MeshDescription {
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
    #[serde(default)]
    pub classes: Dictionary<String>,
    pub axes: Option<String>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct UrdfDescription {
    pub file: String,
    pub geometry: Option<String>,
    pub packages: Option<String>,
    #[serde(default)]
    pub without: Vec<String>,
    #[serde(default)]
    pub translate: [f64; 3],
    #[serde(default)]
    pub roll: f64,
    #[serde(default)]
    pub pitch: f64,
    #[serde(default)]
    pub yaw: f64,
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for VehicleSource {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "VehicleSource".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        type Inline = VehicleDescription<ShapeDescription, BodyDescription>;
        let inline = generator.subschema_for::<Inline>();
        schemars::json_schema!({ "anyOf": [{ "type": "string" }, inline] })
    }
}

/// A JSON object with free keys, in file order; a key that comes twice is an error.
#[derive(Debug)]
pub struct Dictionary<V>(pub Vec<(String, V)>);

impl<V> Default for Dictionary<V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Dictionary<V> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<V>(std::marker::PhantomData<V>);
        impl<'de, V: Deserialize<'de>> Visitor<'de> for Entries<V> {
            type Value = Dictionary<V>;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a map")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut seen = std::collections::HashSet::new();
                let mut entries = Vec::new();
                while let Some(key) = map.next_key::<String>()? {
                    if !seen.insert(key.clone()) {
                        return Err(A::Error::custom(format_args!("duplicate field `{key}`")));
                    }
                    entries.push((key, map.next_value()?));
                }
                Ok(Dictionary(entries))
            }
        }
        deserializer.deserialize_map(Entries(std::marker::PhantomData))
    }
}

#[cfg(feature = "schema")]
impl<V: schemars::JsonSchema> schemars::JsonSchema for Dictionary<V> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("Dictionary_of_{}", V::schema_name()).into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let value = generator.subschema_for::<V>();
        schemars::json_schema!({ "type": "object", "additionalProperties": value })
    }
}
