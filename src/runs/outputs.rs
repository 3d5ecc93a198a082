//! Files that commands write beside their answer: figures as SVG, a frame as glTF.

use std::path::Path;

use super::{RunError, Watcher};
use crate::export::{Glb, GltfView};
use crate::files::{
    is_sink, safe_names, target, writable_file, writable_folder, write_folder, write_whole,
};

/// A figure: its name without an ending, and the SVG.
pub type Figure = (String, String);

/// Checks, before long work, that a folder of figures could be written; true if one is wanted.
///
/// # Errors
/// See [`writable_folder`].
pub fn check_figures(folder: Option<&Path>) -> Result<bool, RunError> {
    folder.map(writable_folder).transpose()?;
    Ok(folder.is_some())
}

/// Refuses figures in the folder of a run, whose own files would be in their way.
///
/// # Errors
/// Such a folder.
pub fn check_figures_apart(figures: Option<&Path>, run: &Path) -> Result<(), RunError> {
    let place = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    match figures.filter(|figures| place(figures) == place(run)) {
        None => Ok(()),
        Some(figures) => Err(RunError::Usage(format!(
            "--figures {}: is the folder of the run; name another folder, or one in it",
            figures.display()
        ))),
    }
}

/// Writes each figure as `NAME.svg`.
///
/// # Errors
/// See [`write_folder`].
pub fn write_figures(folder: Option<&Path>, figures: Vec<Figure>) -> Result<(), RunError> {
    let Some(folder) = folder else { return Ok(()) };
    let names = safe_names(figures.iter().map(|(name, _)| &**name));
    let named = names.into_iter().zip(figures);
    let files = named.map(|(name, (_, svg))| (format!("{name}.svg"), svg.into_bytes()));
    Ok(write_folder(folder, &files.collect::<Vec<_>>())?)
}

/// Checks, before work begins, that the file has the right ending, and can be written.
pub(super) fn check_gltf(path: Option<&Path>) -> Result<(), RunError> {
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
pub(super) fn write_gltf(
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
