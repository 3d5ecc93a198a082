//! The scene file as written: serde's types, before any check.
//!
//! Keys, units and defaults are explained in `scenes/README.md`.

use serde::Deserialize;
use serde::de::{Error as _, MapAccess, Visitor};

use crate::vehicle::{LidarDescription, MountDescription, VehicleDescription};

described! {
    /// A whole scene file.
    pub(crate) struct SceneDescription {
        /// JSON Schema of this file, which editors read.
        #[serde(rename = "$schema")]
        pub _schema: Option<String>,
        /// Version of the format, 1.
        // Checked before the rest is read; here only so that the key is known.
        #[serde(rename = "sightline")]
        #[cfg_attr(feature = "schema", schemars(extend("const" = 1)))]
        pub _version: u64,
        /// Name in reports; the file's without its ending unless given.
        pub name: Option<String>,
        /// Region of interest.
        pub roi: RoiDescription,
        /// Source of the P-SOG; scans with their defaults unless given.
        pub psog: Option<PsogDescription>,
        /// Sensor; without `vehicle`.
        pub lidar: Option<LidarDescription>,
        /// Region for sensors; without `vehicle`.
        pub mount: Option<MountDescription>,
        /// Sensors, mounts and body, or the name of a vehicle file.
        pub vehicle: Option<VehicleSource>,
        /// `first-hit` or `through`.
        #[cfg_attr(feature = "schema", schemars(extend("enum" = ["first-hit", "through", ()])))]
        pub coverage: Option<String>,
        /// Class names; the position is the class id.
        pub classes: Option<Vec<String>>,
        /// Classes that count as the detection target.
        pub detection: Option<Vec<String>>,
        /// Share of light, 0 to 1, that a class reflects.
        #[serde(default)]
        pub reflectance: Dictionary<f64>,
        /// Named lists of shapes, for use in others.
        #[serde(default)]
        pub shapes: Dictionary<Vec<ShapeDescription>>,
        /// Shapes in the world frame.
        #[serde(default, rename = "static")]
        pub world: Vec<ShapeDescription>,
        /// Moving things.
        #[serde(default)]
        pub actors: Vec<ActorDescription>,
        /// Number of frames.
        pub frames: Option<u64>,
        /// Frames a second; 10.
        pub rate: Option<f64>,
        /// Body and motion of the vehicle.
        pub ego: Option<EgoDescription>,
    }

    pub(crate) struct RoiDescription {
        /// Lower corner in the ego frame, metres.
        pub min: [f64; 3],
        /// Upper corner in the ego frame, metres.
        pub max: [f64; 3],
        /// Edges of a voxel, metres.
        pub voxel: [f64; 3],
    }

    pub(crate) struct PsogDescription {
        /// P-SOG file, relative to the scene.
        pub file: Option<String>,
        /// Virtual scans that it is built from.
        pub scan: Option<ScanDescription>,
    }

    #[derive(Default)]
    pub(crate) struct ScanDescription {
        /// Evenly spaced channels.
        pub channels: Option<u64>,
        /// Lowest and highest elevation, degrees.
        pub fov: Option<[f64; 2]>,
        /// Azimuth steps of a turn.
        pub azimuth_steps: Option<u64>,
        /// Metres between neighbouring points on level ground.
        pub spacing: Option<f64>,
        /// Metres.
        pub range: Option<f64>,
        /// Height of the scanner, metres.
        pub height: Option<f64>,
        /// Scan poses merged into a frame.
        pub window: Option<u64>,
        /// Frames between two scan poses.
        pub stride: Option<u64>,
    }

    pub(crate) struct ActorDescription {
        /// Name, a note.
        pub name: Option<String>,
        /// `car`, `van`, `truck`, `bus`, `trailer`, `construction`, `motorcycle`, `bicycle`, `pedestrian`, `animal` or `other`.
        #[cfg_attr(feature = "schema", schemars(extend("enum" = ["car", "van", "truck", "bus", "trailer", "construction", "motorcycle", "bicycle", "pedestrian", "animal", "other", ()])))]
        pub kind: Option<String>,
        /// Share of light, 0 to 1, that all of it reflects.
        pub reflectance: Option<f64>,
        /// Shapes in its own frame, x forward.
        pub parts: Vec<ShapeDescription>,
        /// Pose in each frame, in the world frame.
        pub poses: Option<Vec<PoseDescription>>,
        /// Line that it follows.
        pub route: Option<RouteDescription>,
    }

    #[derive(Default)]
    pub(crate) struct EgoDescription {
        /// Shapes in the ego frame.
        #[serde(default)]
        pub body: Vec<ShapeDescription>,
        /// Bodies that move against it.
        #[serde(default)]
        pub bodies: Vec<BodyDescription>,
        /// Pose in each frame, in the world frame.
        pub poses: Option<Vec<PoseDescription>>,
        /// Line that it follows.
        pub route: Option<RouteDescription>,
    }

    /// Another body of the vehicle, with poses in the ego frame.
    pub(crate) struct BodyDescription {
        /// Name, a note.
        pub name: Option<String>,
        /// Shapes in its own frame.
        pub parts: Vec<ShapeDescription>,
        /// Pose in all frames or in each, in the ego frame.
        pub poses: Option<Vec<PoseDescription>>,
    }

    pub(crate) struct PoseDescription {
        /// Metres.
        pub x: f64,
        /// Metres.
        pub y: f64,
        /// Metres.
        #[serde(default)]
        pub z: f64,
        /// Radians about x.
        #[serde(default)]
        pub roll: f64,
        /// Radians about y.
        #[serde(default)]
        pub pitch: f64,
        /// Radians about z.
        #[serde(default)]
        pub yaw: f64,
    }

    pub(crate) struct RouteDescription {
        /// Corners of the line, `[x, y]` or `[x, y, z]`, metres.
        pub points: Vec<Vec<f64>>,
        /// Metres along the line in frame 0.
        #[serde(default)]
        pub start: f64,
        /// Metres from frame to frame.
        pub spacing: f64,
    }

    pub(crate) struct ShapeDescription {
        /// Class of its surfaces.
        pub class: Option<String>,
        /// Box.
        #[serde(rename = "box")]
        pub cuboid: Option<BoxDescription>,
        /// Upright prism.
        pub prism: Option<PrismDescription>,
        /// Upright cylinder.
        pub cylinder: Option<CylinderDescription>,
        /// Level rectangle.
        pub plane: Option<PlaneDescription>,
        /// Mesh file.
        pub mesh: Option<MeshDescription>,
        /// Links of a robot.
        pub urdf: Option<UrdfDescription>,
        /// Name of a list in `shapes`.
        pub shape: Option<String>,
        /// Copies at `[x, y]`, `[x, y, z]` or `[x, y, z, yaw]`, metres and radians.
        pub at: Option<Vec<Vec<f64>>>,
        /// Copies in a row.
        pub repeat: Option<RepeatDescription>,
    }

    pub(crate) struct RepeatDescription {
        /// Number of copies.
        pub count: u64,
        /// Step from copy to copy, metres.
        pub step: [f64; 3],
    }

    pub(crate) struct BoxDescription {
        /// Middle, metres; with `size`.
        pub center: Option<[f64; 3]>,
        /// Middle of the bottom face, metres; with `size`.
        pub foot: Option<[f64; 3]>,
        /// Edges, metres.
        pub size: Option<[f64; 3]>,
        /// Lower corner, metres; with `max`.
        pub min: Option<[f64; 3]>,
        /// Upper corner, metres.
        pub max: Option<[f64; 3]>,
        /// Radians about its own vertical axis.
        #[serde(default)]
        pub yaw: f64,
    }

    pub(crate) struct PrismDescription {
        /// Corners `[x, y]` of a simple polygon, metres.
        pub base: Vec<[f64; 2]>,
        /// Bottom and top, metres.
        pub z: [f64; 2],
    }

    pub(crate) struct CylinderDescription {
        /// Middle of the bottom, metres.
        pub foot: [f64; 3],
        /// Metres.
        pub radius: f64,
        /// Metres.
        pub height: f64,
        /// Number of side faces; 12.
        pub sides: Option<u64>,
    }

    pub(crate) struct PlaneDescription {
        /// Lower corner `[x, y]`, metres.
        pub min: [f64; 2],
        /// Upper corner `[x, y]`, metres.
        pub max: [f64; 2],
        /// Height, metres.
        pub z: f64,
    }

    pub(crate) struct MeshDescription {
        /// Mesh file: OBJ, PLY, STL or glTF.
        pub file: String,
        /// Factor on its lengths; 1.
        pub scale: Option<f64>,
        /// Move, metres, after all turns.
        #[serde(default)]
        pub translate: [f64; 3],
        /// Radians about x.
        #[serde(default)]
        pub roll: f64,
        /// Radians about y.
        #[serde(default)]
        pub pitch: f64,
        /// Radians about z.
        #[serde(default)]
        pub yaw: f64,
        /// Class of each material or face label.
        #[serde(default)]
        pub classes: Dictionary<String>,
        /// `z-up`, `y-up` (x forward) or `z-forward` (y up, x left); by the format unless given.
        pub axes: Option<String>,
    }

    pub(crate) struct UrdfDescription {
        /// URDF file.
        pub file: String,
        /// `visual` or `collision`.
        #[cfg_attr(feature = "schema", schemars(extend("enum" = ["visual", "collision", ()])))]
        pub geometry: Option<String>,
        /// Folder of the packages that the file names.
        pub packages: Option<String>,
        /// Links to leave out.
        #[serde(default)]
        pub without: Vec<String>,
        /// Values of joints that do not stand at rest, radians or metres.
        #[serde(default)]
        pub joints: Dictionary<f64>,
        /// Move, metres, after all turns.
        #[serde(default)]
        pub translate: [f64; 3],
        /// Radians about x.
        #[serde(default)]
        pub roll: f64,
        /// Radians about y.
        #[serde(default)]
        pub pitch: f64,
        /// Radians about z.
        #[serde(default)]
        pub yaw: f64,
    }
}

/// The vehicle of a scene.
#[derive(Debug)]
pub(crate) enum VehicleSource {
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
pub(crate) struct Dictionary<V>(pub Vec<(String, V)>);

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
