//! Figures as files of their own, in a folder that is whole or not there.

use std::path::Path;

use super::RunError;
use crate::files::{safe_names, writable_folder, write_folder};

/// A figure: its name without an ending, and the SVG.
pub type Figure = (String, String);

/// Checks, before long work, that a folder of figures could be written; true if one is wanted.
///
/// # Errors
/// See [`writable_folder`].
pub fn wanted(folder: Option<&Path>) -> Result<bool, RunError> {
    folder.map(writable_folder).transpose()?;
    Ok(folder.is_some())
}

/// Refuses figures in the folder of a run, whose own files would be in their way.
///
/// # Errors
/// Such a folder.
pub fn apart(figures: Option<&Path>, run: &Path) -> Result<(), RunError> {
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
pub fn write(folder: Option<&Path>, figures: Vec<Figure>) -> Result<(), RunError> {
    let Some(folder) = folder else { return Ok(()) };
    let names = safe_names(figures.iter().map(|(name, _)| &**name));
    let named = names.into_iter().zip(figures);
    let files = named.map(|(name, (_, svg))| (format!("{name}.svg"), svg.into_bytes()));
    Ok(write_folder(folder, &files.collect::<Vec<_>>())?)
}
