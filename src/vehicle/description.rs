//! The `lidar` and `mount` of a scene file, as they are written.
//!
//! Keys, units and defaults are explained in `scenes/README.md`.

use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LidarDescription {
    pub channels: Option<u64>,
    pub fov: Option<[f64; 2]>,
    pub file: Option<String>,
    pub azimuth_offsets: Option<String>,
    pub azimuth_steps: Option<u64>,
    pub azimuth: Option<[f64; 2]>,
    pub window: Option<[f64; 2]>,
    pub directions: Option<Vec<[f64; 3]>>,
    pub range: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MountDescription {
    pub min: [f64; 3],
    pub max: [f64; 3],
    #[serde(default)]
    pub roll: [f64; 2],
    #[serde(default)]
    pub pitch: [f64; 2],
    #[serde(default)]
    pub yaw: [f64; 2],
    #[serde(default)]
    pub min_distance: f64,
    pub lidars: u64,
    #[serde(default)]
    pub keep_out: Vec<KeepOutDescription>,
    #[serde(default)]
    pub equal_height: bool,
    #[serde(default)]
    pub symmetric: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct KeepOutDescription {
    pub min: [f64; 3],
    pub max: [f64; 3],
}
