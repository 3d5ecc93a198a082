//! `--gltf`: a frame with its rigs as a file for viewers of glTF.

use std::path::PathBuf;

/// Option of the commands that have a scene and placements in it.
#[derive(clap::Args, Debug, Clone, Default)]
pub struct Gltf {
    /// Write the scene, the LiDARs with what they see, and the points if there are any as a binary glTF (.glb)
    #[arg(long, value_name = "FILE")]
    pub gltf: Option<PathBuf>,
}
