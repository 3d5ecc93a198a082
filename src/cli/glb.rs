//! `--gltf`: a frame with its rigs as a file for viewers of glTF.

use std::path::{Path, PathBuf};

use crate::export::{Glb, GltfView};
use crate::internals::{is_sink, target, writable_file, write_whole};

use super::args::Talk;
use super::error::Error;

/// Option of the commands that have a scene and placements in it.
#[derive(clap::Args, Debug, Clone, Default)]
pub struct Gltf {
    /// Write the scene, the LiDARs with what they see, and the points if there are any as a binary glTF (.glb)
    #[arg(long, value_name = "FILE")]
    pub gltf: Option<PathBuf>,
}

impl Gltf {
    /// Checks, before work begins, that the file has the right ending, can be written and is none of `inputs`.
    pub fn check<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Error> {
        let Some(path) = &self.gltf else { return Ok(()) };
        let is_glb = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"));
        if !is_glb && !is_sink(&target(path)?) {
            return Err(Error::Usage(format!(
                "--gltf {}: is written as binary glTF; give it the ending .glb",
                path.display()
            )));
        }
        Ok(writable_file(path, inputs)?)
    }

    /// Writes a view where the option asks for one, and says so.
    pub fn write(&self, talk: Talk, view: &GltfView<'_>) -> Result<(), Error> {
        let Some(path) = &self.gltf else { return Ok(()) };
        let glb = Glb::of(view)?;
        write_whole(path, |file| glb.write(file).map_err(Error::io(path)))?;
        talk.note(format!("frame {} of {} in {}", view.frame, view.scene.name(), path.display()));
        Ok(())
    }
}
