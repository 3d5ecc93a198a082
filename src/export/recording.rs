//! From a scanner to a data set: several frames at the same time, as many in memory as there are threads.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::{Dataset, ExportError};
use crate::scan::{Scan, Scanner};

/// Scans those frames of a scene, by its number in the data set, that the set lacks.
///
/// `watch` is shown every scan once it is written; what it returns says whether to go on. Returns whether
/// all frames are there.
///
/// # Errors
/// As of [`Dataset::write`].
pub fn record(
    dataset: &Dataset,
    scene: usize,
    scanner: &Scanner<'_>,
    watch: impl Fn(&Scan) -> bool + Sync,
) -> Result<bool, ExportError> {
    let frames: Vec<usize> = dataset.missing_of(scene);
    let stopped = AtomicBool::new(false);
    for together in frames.chunks(rayon::current_num_threads().max(1)) {
        together.par_iter().try_for_each(|&frame| {
            let scan = scanner.scan(frame);
            dataset.write(scene, &scan)?;
            if !watch(&scan) {
                stopped.store(true, Ordering::Relaxed);
            }
            Ok::<(), ExportError>(())
        })?;
        if stopped.load(Ordering::Relaxed) {
            return Ok(dataset.missing_of(scene).is_empty());
        }
    }
    Ok(true)
}
