//! Kind of a JSON file by its keys, to explain a file given in the wrong place on the command line.

use std::fmt;

use serde::Deserialize;
use serde::de::IgnoredAny;

/// Kinds of files that a user writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A region of interest and its content.
    Scene,
    /// Sensors and mounts.
    Vehicle,
    /// Poses of LiDARs.
    Placements,
    /// A thing of known size.
    Target,
}

impl FileKind {
    /// The kind of a text, if it is JSON and its keys tell it.
    pub fn of(text: &str) -> Option<Self> {
        /// Keys that only one kind of file has, or that the kinds before it lack.
        #[derive(Deserialize)]
        struct Keys {
            roi: Option<IgnoredAny>,
            mounts: Option<IgnoredAny>,
            sensors: Option<IgnoredAny>,
            placements: Option<IgnoredAny>,
            shapes: Option<IgnoredAny>,
            lidar: Option<IgnoredAny>,
            mount: Option<IgnoredAny>,
        }
        let keys: Keys = serde_json::from_str(text).ok()?;
        let vehicle = keys.mounts.or(keys.sensors);
        let scene = keys.roi.map(|_| Self::Scene);
        let kind = scene.or(vehicle.map(|_| Self::Vehicle));
        let kind = kind.or(keys.placements.map(|_| Self::Placements));
        let is_scene = keys.lidar.or(keys.mount).is_some();
        kind.or(keys.shapes.filter(|_| !is_scene).map(|_| Self::Target))
    }

    /// How such a file is given to the program.
    pub fn place(self) -> &'static str {
        match self {
            Self::Scene => "as SCENE",
            Self::Vehicle => "by --vehicle",
            Self::Placements => "behind the scenes, or by --placement or --baselines",
            Self::Target => "by --target",
        }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Scene => "a scene",
            Self::Vehicle => "a vehicle",
            Self::Placements => "a file of placements",
            Self::Target => "a target",
        })
    }
}
