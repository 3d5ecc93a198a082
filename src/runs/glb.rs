//! A frame with its rigs as a file for viewers of glTF, if a file is given.

use std::path::Path;

use super::{RunError, Watcher};
use crate::export::{Glb, GltfView};
use crate::files::{is_sink, target, writable_file, write_whole};

/// Checks, before work begins, that the file has the right ending, and can be written.
pub(super) fn check(path: Option<&Path>) -> Result<(), RunError> {
    let Some(path) = path else { return Ok(()) };
    let is_glb = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"));
    if !is_glb && !is_sink(&target(path)?) {
        return Err(RunError::Usage(format!(
            "--gltf {}: is written as binary glTF; give it the ending .glb",
            path.display()
        )));
    }
    Ok(writable_file(path)?)
}

/// Writes a view where a file is given, and says so.
pub(super) fn write(
    path: Option<&Path>,
    watcher: &dyn Watcher,
    view: &GltfView<'_>,
) -> Result<(), RunError> {
    let Some(path) = path else { return Ok(()) };
    let glb = Glb::of(view)?;
    write_whole(path, |file| glb.write(file).map_err(RunError::io(path)))?;
    watcher.note(&format!("frame {} of {} in {}", view.frame, view.scene.name(), path.display()));
    Ok(())
}
