//! The `lidar`, `mount` and `vehicle` of a scene file, and a vehicle file, as they are written.
//!
//! Keys, units and defaults are explained in `scenes/README.md`.

use serde::Deserialize;
use sightline_files::json::{self, Checked, Location, check};

described! {
    pub(crate) struct LidarDescription {
        /// Evenly spaced channels.
        pub(crate) channels: Option<u64>,
        /// Lowest and highest elevation, degrees.
        pub(crate) fov: Option<[f64; 2]>,
        /// Sensor file of a vendor, or JSON with `elevation_deg`.
        pub(crate) file: Option<String>,
        /// `clockwise` for offsets of such JSON that count so.
        pub(crate) azimuth_offsets: Option<String>,
        /// Azimuth steps of a frame.
        pub(crate) azimuth_steps: Option<u64>,
        /// First and last azimuth of a sensor that looks to one side, degrees counter-clockwise from ahead.
        pub(crate) azimuth: Option<[f64; 2]>,
        /// First and last second of a Livox pattern.
        pub(crate) window: Option<[f64; 2]>,
        /// Every beam by itself, of any length but 0.
        pub(crate) directions: Option<Vec<[f64; 3]>>,
        /// Metres.
        pub(crate) range: Option<f64>,
    }

    pub(crate) struct MountDescription {
        /// Lower corner of the box of sensor origins, ego frame, metres.
        pub(crate) min: [f64; 3],
        /// Upper corner of that box, metres.
        pub(crate) max: [f64; 3],
        /// Lowest and highest, radians.
        #[serde(default)]
        pub(crate) roll: [f64; 2],
        /// Lowest and highest, radians.
        #[serde(default)]
        pub(crate) pitch: [f64; 2],
        /// Lowest and highest, radians.
        #[serde(default)]
        pub(crate) yaw: [f64; 2],
        /// Least distance between two sensors, metres.
        #[serde(default)]
        pub(crate) min_distance: f64,
        /// Sensors of a placement, 1 to 16.
        pub(crate) lidars: u64,
        /// Boxes of the ego frame in which no sensor stands.
        #[serde(default)]
        pub(crate) keep_out: Vec<KeepOutDescription>,
        /// True: all sensors stand at one height.
        #[serde(default)]
        pub(crate) equal_height: bool,
        /// True: sensors come in pairs mirrored at the plane y = 0.
        #[serde(default)]
        pub(crate) symmetric: bool,
    }

    pub(crate) struct KeepOutDescription {
        /// Lower corner, ego frame, metres.
        pub min: [f64; 3],
        /// Upper corner, ego frame, metres.
        pub max: [f64; 3],
    }

    pub(crate) struct OtherSensorDescription {
        /// Name in reports.
        pub name: String,
        /// Word of 1 to 16 letters, `camera` for example.
        pub technology: String,
        /// Metres forward.
        pub x: f64,
        /// Metres left.
        pub y: f64,
        /// Metres up.
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
        /// Whole angles of azimuth and of elevation, degrees.
        pub fov: [f64; 2],
        /// Metres.
        pub range: f64,
    }

    pub(crate) struct ModelDescription {
        /// Name that mounts and placements use.
        pub name: String,
        /// Beams.
        pub lidar: LidarDescription,
        /// Price in any currency.
        pub price: Option<f64>,
        /// `free`, an angle in radians, or a range of them that the search chooses from.
        pub phase: Option<PhaseDescription>,
        /// Measuring, for scans.
        pub response: Option<ResponseDescription>,
    }

    pub(crate) struct ResponseDescription {
        /// Turns a second.
        pub rate: Option<f64>,
        /// Metres at which a surface that reflects a tenth is seen half of the time.
        pub rated_range: Option<f64>,
        /// Standard deviation of the threshold, as a share; 0.1.
        pub softness: Option<f64>,
        /// Standard deviation of the distance of strong echoes, metres.
        pub noise: Option<f64>,
        /// Full width across and along, radians.
        pub divergence: Option<[f64; 2]>,
        /// Metres within which echoes are one.
        pub pulse: Option<f64>,
        /// `strongest`, `last` or `dual`.
        #[cfg_attr(feature = "schema", schemars(extend("enum" = ["strongest", "last", "dual", ()])))]
        pub echoes: Option<String>,
        /// Least distance, metres.
        pub min_range: Option<f64>,
    }

    pub(crate) struct MountingDescription {
        /// Name in reports.
        pub name: String,
        /// Lower corner of a box, ego frame, metres.
        pub min: Option<[f64; 3]>,
        /// Upper corner of that box, metres.
        pub max: Option<[f64; 3]>,
        /// Corners of a flat patch, counter-clockwise from outside, metres.
        pub polygon: Option<Vec<[f64; 3]>>,
        /// Patch of a mesh.
        pub mesh: Option<MeshPatchDescription>,
        /// Least and most metres in front of a patch.
        pub offset: Option<[f64; 2]>,
        /// Lowest and highest, radians.
        #[serde(default)]
        pub roll: [f64; 2],
        /// Lowest and highest, radians.
        #[serde(default)]
        pub pitch: [f64; 2],
        /// Lowest and highest, radians.
        #[serde(default)]
        pub yaw: [f64; 2],
        /// Models that may stand here; all unless given.
        pub sensors: Option<Vec<String>>,
        /// Body of `bodies` that carries it.
        pub rides_on: Option<String>,
        /// Number of sensors, or a range of it.
        pub count: CountDescription,
    }

    pub(crate) struct MeshPatchDescription {
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
        /// `z-up`, `y-up` (x forward) or `z-forward` (y up, x left); by the format unless given.
        pub axes: Option<String>,
        /// Box of the ego frame to which triangles are cut.
        pub within: Option<KeepOutDescription>,
        /// Direction of the triangles that are meant.
        pub facing: Option<FacingDescription>,
    }

    pub(crate) struct FacingDescription {
        /// Direction in the ego frame, of any length but 0.
        pub direction: [f64; 3],
        /// Most radians from it; π/3.
        pub angle: Option<f64>,
    }

    pub(crate) struct RequirementDescription {
        /// Name in results.
        pub name: Option<String>,
        /// Lower corner of a box of voxels, ego frame, metres.
        pub min: Option<[f64; 3]>,
        /// Upper corner of that box, metres.
        pub max: Option<[f64; 3]>,
        /// Boxes that are left out.
        #[serde(default)]
        pub without: Vec<KeepOutDescription>,
        /// Preset or file of a target. Its places lie on level ground, in scenes too, unless `ground` is `scene`.
        pub target: Option<String>,
        /// Nearest distance of a target, metres; 5.
        pub from: Option<f64>,
        /// Farthest distance of a target, metres.
        pub within: Option<f64>,
        /// First and last bearing, degrees counter-clockwise from ahead.
        pub bearing: Option<[f64; 2]>,
        /// Least beams on a target; 5.
        pub beams: Option<u64>,
        /// True: only beams that return from the target count, in clear air too.
        #[serde(default)]
        pub response: bool,
        /// Metres around the body in which ground must be seen; `scene` of a target that stands on the surface of each scene.
        pub ground: Option<GroundDescription>,
        /// `ahead`, `behind`, `left` or `right`.
        #[cfg_attr(feature = "schema", schemars(extend("enum" = ["ahead", "behind", "left", "right", ()])))]
        pub blind_zone: Option<String>,
        /// Most metres that the blind zone reaches.
        pub depth: Option<f64>,
        /// Share of surface voxels that neighbouring LiDARs share.
        pub overlap: Option<f64>,
        /// Share that is required, 0 to 1.
        pub share: Option<f64>,
        /// True: holds whichever one LiDAR is lost; not of a box.
        #[serde(default)]
        pub without_any_one: bool,
    }
}

/// A vehicle, in a file of its own or in a scene.
// `B` is a shape of the body and `M` a further body, which a scene reads.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schemars(rename = "VehicleDescription"))]
pub(crate) struct VehicleDescription<B, M> {
    /// JSON Schema of this file, which editors read.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Version of the format, 1.
    #[serde(default, rename = "sightline", deserialize_with = "json::version_1")]
    #[cfg_attr(feature = "schema", schemars(extend("const" = 1)))]
    _version: Option<u64>,
    /// Name in reports; the file's without its ending unless given.
    pub(crate) name: Option<String>,
    /// Shapes in the ego frame, at least one; the scene's own unless given.
    #[cfg_attr(feature = "schema", schemars(length(min = 1)))]
    pub(crate) body: Option<Vec<B>>,
    /// Bodies that move against it.
    #[serde(default = "Vec::<M>::new")]
    pub(crate) bodies: Vec<M>,
    /// Sensor models.
    pub(crate) sensors: Vec<ModelDescription>,
    /// Regions for sensors.
    pub(crate) mounts: Vec<MountingDescription>,
    /// Least distance between two sensors, metres.
    #[serde(default)]
    pub(crate) min_distance: f64,
    /// Boxes of the ego frame in which no sensor stands.
    #[serde(default)]
    pub(crate) keep_out: Vec<KeepOutDescription>,
    /// True: all sensors stand at one height.
    #[serde(default)]
    pub(crate) equal_height: bool,
    /// True: sensors come in pairs mirrored at the plane y = 0.
    #[serde(default)]
    pub(crate) symmetric: bool,
    /// Shares that must be seen.
    #[serde(default)]
    pub(crate) require: Vec<RequirementDescription>,
    /// Fixed cameras, radars and others.
    #[serde(default)]
    pub(crate) other_sensors: Vec<OtherSensorDescription>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected \"free\", an angle in radians, or a range of them")]
pub(crate) enum PhaseDescription {
    Angle(f64),
    Range([f64; 2]),
    #[cfg_attr(feature = "schema", schemars(extend("enum" = ["free"])))]
    Word(String),
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected metres from the own body, or \"scene\" of a target")]
pub(crate) enum GroundDescription {
    Within(f64),
    #[cfg_attr(feature = "schema", schemars(extend("enum" = ["scene"])))]
    Word(String),
}

#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "expected a number of sensors, 4 for example, or a range, [0, 2] for example"
)]
pub(crate) enum CountDescription {
    Exactly(u64),
    Range([u64; 2]),
}

impl<B, M> VehicleDescription<B, M> {
    /// Takes the shapes of the body out; none where `body` is left out.
    pub(crate) fn take_body(&mut self, at: &Location) -> Checked<Vec<B>> {
        let wanted = "a list of shapes; leave `body` out to keep the body of the scene, or give boxes or a mesh";
        match self.body.take() {
            Some(shapes) if shapes.is_empty() => {
                Err(check::bad(&at.key("body"), "an empty list", wanted))
            }
            shapes => Ok(shapes.unwrap_or_default()),
        }
    }
}

impl RequirementDescription {
    /// Name of the rule at `at`; `default` where it gives itself none.
    pub(crate) fn named(&self, at: &Location, default: String) -> Checked<String> {
        match &self.name {
            Some(name) => check::name(&at.key("name"), name.clone()),
            None => Ok(default),
        }
    }

    /// Refuses a key of the rule at `at` beside its name and the `keys` of its kind.
    ///
    /// # Errors
    /// The first of them; `mend` says how to mend it.
    pub(crate) fn has_only(
        &self,
        at: &Location,
        keys: &[&str],
        mend: impl Fn(&str) -> &'static str,
    ) -> Checked<()> {
        let given = [
            ("min", self.min.is_some()),
            ("max", self.max.is_some()),
            ("without", !self.without.is_empty()),
            ("target", self.target.is_some()),
            ("from", self.from.is_some()),
            ("within", self.within.is_some()),
            ("bearing", self.bearing.is_some()),
            ("beams", self.beams.is_some()),
            ("response", self.response),
            ("without_any_one", self.without_any_one),
            ("ground", self.ground.is_some()),
            ("blind_zone", self.blind_zone.is_some()),
            ("depth", self.depth.is_some()),
            ("overlap", self.overlap.is_some()),
            ("share", self.share.is_some()),
        ];
        match given.into_iter().find(|(key, is_given)| *is_given && !keys.contains(key)) {
            None => Ok(()),
            Some((key, _)) => Err(check::misplaced(at, key, mend(key))),
        }
    }

    /// Share that is required.
    pub(crate) fn share(&self, at: &Location) -> Checked<f64> {
        let mend = "say which share must be seen, `\"share\": 0.9` for example";
        self.share.ok_or_else(|| check::missing(at, "share", mend))
    }
}
