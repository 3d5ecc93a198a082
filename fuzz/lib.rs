//! Readers that the fuzz targets share, and a folder for their files.
//!
//! ```sh
//! cargo install cargo-fuzz
//! cargo +nightly fuzz run scene_json -- -max_total_time=600   # or another name of fuzz_targets/
//! ```
//!
//! `tests/corpus.rs` replays and mutates the same seeds without a fuzzer. An input that fails becomes a
//! seed once the reader is mended.

pub mod readers;

use std::path::Path;
use std::sync::OnceLock;

/// A folder for the files of this process.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER.get_or_init(readers::folder).path()
}
