//! stub
#![allow(missing_docs, unused)]
use crate::geom::{Pose, TriangleSoup};
use std::path::{Path, PathBuf};
#[derive(Debug, thiserror::Error)]
#[error("stub")]
pub struct SceneError;
pub struct Scene;
pub struct RoiBounds {
    pub min: [f64; 3],
    pub max: [f64; 3],
    pub voxel: [f64; 3],
    pub shape: [u32; 3],
}
pub enum Lidar {
    Spinning { elevations: Vec<f64>, azimuth_offsets: Vec<f64>, azimuth_steps: u32, range: f64 },
    Directions { directions: Vec<[f64; 3]>, range: f64 },
}
pub struct Mount {
    pub min: [f64; 3],
    pub max: [f64; 3],
    pub roll: [f64; 2],
    pub pitch: [f64; 2],
    pub yaw: [f64; 2],
    pub min_distance: f64,
    pub lidars: u32,
}
pub enum Coverage {
    Through,
    FirstHit,
}
pub enum EgoBody {
    Include,
    Exclude,
}
#[derive(Clone)]
pub struct ScanSettings {
    pub channels: u32,
    pub fov: [f64; 2],
    pub azimuth_steps: u32,
    pub range: f64,
    pub height: f64,
    pub window: usize,
    pub stride: usize,
}
impl ScanSettings {
    pub fn default_of(s: &Scene) -> Self {
        todo!()
    }
}
pub enum PsogSource {
    File(PathBuf),
    Scan(ScanSettings),
}
impl Scene {
    pub fn read(path: &Path) -> Result<Scene, SceneError> {
        todo!()
    }
    pub fn name(&self) -> &str {
        todo!()
    }
    pub fn classes(&self) -> &[String] {
        todo!()
    }
    pub fn detection_classes(&self) -> &[u16] {
        todo!()
    }
    pub fn roi(&self) -> &RoiBounds {
        todo!()
    }
    pub fn lidar(&self) -> &Lidar {
        todo!()
    }
    pub fn mount(&self) -> &Mount {
        todo!()
    }
    pub fn coverage(&self) -> Coverage {
        todo!()
    }
    pub fn psog_source(&self) -> &PsogSource {
        todo!()
    }
    pub fn has_geometry(&self) -> bool {
        todo!()
    }
    pub fn frame_count(&self) -> usize {
        todo!()
    }
    pub fn ego_pose(&self, t: usize) -> Pose {
        todo!()
    }
    pub fn frame(&self, t: usize, b: EgoBody) -> TriangleSoup {
        todo!()
    }
}
