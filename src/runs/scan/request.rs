//! Request of scans, and the settings of its data sets.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::export::{DatasetSettings, Input, Layout, SceneFacts, Splits};
use crate::runs::inputs::{file_and_name, named_placements};
use crate::runs::{Computing, RunError};
use crate::scan::Scanning;
use crate::scan::conditions::Condition;
use crate::scene::Scene;
use crate::vehicle::Placement;

/// Scans to be written.
#[derive(Debug, Clone)]
pub struct ScanRequest {
    /// Scene files with geometry.
    pub scenes: Vec<PathBuf>,
    /// Files of placements, perhaps with a name behind a colon; several placements get a folder each.
    pub placements: Vec<String>,
    /// Folder to write.
    pub out: PathBuf,
    /// Format.
    pub layout: Layout,
    /// Ideal beams or real ones, seed, weather and faults.
    pub scanning: Scanning,
    /// First frames of each scene alone; all if none.
    pub frames: Option<u32>,
    /// Shares of the scenes for training, validation and tests.
    pub splits: Splits,
    /// nuScenes: one in this many frames is a keyframe.
    pub keyframe_every: usize,
    /// nuScenes: rows of cameras without pictures.
    pub camera_stubs: bool,
    /// True if each LiDAR gets a cloud of its own, too.
    pub each_lidar: bool,
    /// Classes that count as another, as `lamp=pole`.
    pub map: Vec<String>,
    /// File for one frame with its points as binary glTF, and the frame.
    pub gltf: Option<(PathBuf, u32)>,
}

impl ScanRequest {
    /// Frames and classes of a scene.
    pub(super) fn facts(&self, scene: &Scene) -> SceneFacts {
        let frames = self.frames.map_or(usize::MAX, |frames| frames as usize);
        SceneFacts {
            name: scene.name().to_owned(),
            classes: scene.classes().to_vec(),
            frames: (0..scene.frame_count().min(frames)).collect(),
            split: None,
        }
    }

    /// Settings that decide the bytes of a placement's data set.
    pub(super) fn settings(
        &self,
        placement: &Placement,
        files: Vec<Input>,
        computing: &Computing<'_>,
    ) -> Result<DatasetSettings, RunError> {
        let mut map = Vec::new();
        for pair in &self.map {
            let Some((class, to)) = pair.split_once('=') else {
                return Err(RunError::Usage(format!(
                    "--map {pair}: write CLASS=CLASS, as lamp=pole"
                )));
            };
            map.push((class.to_owned(), to.to_owned()));
        }
        let Scanning { ideal, seed, conditions } = &self.scanning;
        let conditions: Vec<String> = conditions.iter().map(Condition::to_string).collect();
        let provenance = json!({
            "scenes": self.scenes,
            "vehicle": computing.vehicle,
            "placement": placement,
            "ideal": ideal,
            "seed": seed,
            "conditions": conditions,
            "sightline": env!("CARGO_PKG_VERSION"),
        });
        Ok(DatasetSettings {
            keyframe_every: self.keyframe_every,
            camera_stubs: self.camera_stubs,
            each_lidar: self.each_lidar,
            splits: self.splits,
            seed: *seed,
            map,
            files,
            provenance: provenance.to_string(),
            ..DatasetSettings::new(self.layout)
        })
    }
}

/// All placements of files, or one by its name behind a colon, each with its file.
pub(super) fn placements(given: &[String]) -> Result<Vec<(&Path, Placement)>, RunError> {
    let mut found: Vec<(&Path, Placement)> = Vec::new();
    for text in given {
        let file = Path::new(file_and_name(text).0);
        found.extend(named_placements(text)?.into_iter().map(|placement| (file, placement)));
    }
    for (k, (_, placement)) in found.iter().enumerate() {
        if found[..k].iter().any(|(_, other)| other.name == placement.name) {
            let name = &placement.name;
            return Err(RunError::Usage(format!(
                "--placement: `{name}` comes twice, and each is to have a folder of its own; rename one"
            )));
        }
    }
    Ok(found)
}
