//! Options of commands that read data sets.

use std::path::{Path, PathBuf};

use crate::datasets::CarlaTags;
use crate::runs::psog::CarlaScans;
use clap::ValueEnum;

use super::args::finite;

/// Where labelled scans lie, beside the folder of a command's own option.
#[derive(clap::Args)]
pub struct DatasetArgs {
    /// Version of the tables of nuScenes, as v1.0-mini [default: the only one there]
    #[arg(long, value_name = "VERSION", requires = "nuscenes")]
    pub version: Option<String>,
    /// CSV of the LiDAR's carla.Transform: frame or file, x, y, z, roll, pitch, yaw, and perhaps time
    #[arg(long, value_name = "FILE", requires = "carla")]
    pub poses: Option<PathBuf>,
    /// Version of CARLA whose tags the points have: 0.9.10 to 0.9.13, or 0.9.14 and later [default: the one in
    /// which the road lies flat below the LiDAR]
    #[arg(long, value_enum, value_name = "VERSION", requires = "carla")]
    pub carla_tags: Option<Tags>,
    /// Height of the recording LiDAR above the ground in metres, for KITTI and CARLA [default: what an export
    /// of this program says, else above the labelled road within 10 m; 1.73 for KITTI where the road lies so]
    #[arg(long, value_name = "M", conflicts_with = "nuscenes", value_parser = finite)]
    pub lidar_height: Option<f64>,
}

/// Value of `--carla-tags`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Tags {
    /// 0 to 22.
    #[value(name = "0.9.10")]
    Until0913,
    /// 0 to 28.
    #[value(name = "0.9.14")]
    Since0914,
}

impl DatasetArgs {
    /// The scans of CARLA in a folder.
    pub fn carla(&self, folder: &Path) -> CarlaScans {
        let Some(poses) = &self.poses else { unreachable!("clap requires it with a folder") };
        let tags = self.carla_tags.map(|tags| match tags {
            Tags::Until0913 => CarlaTags::Until0913,
            Tags::Since0914 => CarlaTags::Since0914,
        });
        let (folder, poses) = (folder.to_owned(), poses.clone());
        CarlaScans { folder, poses, tags, lidar_height: self.lidar_height }
    }
}
