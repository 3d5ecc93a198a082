//! What the fuzz targets share: the readers, and a folder for their files.

pub mod readers;

use std::path::Path;
use std::sync::OnceLock;

/// A folder for the files of this process.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER.get_or_init(readers::folder).path()
}
