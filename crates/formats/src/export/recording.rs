//! From a scanner to a data set: several frames at the same time, as many in memory as there are threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;

use super::{Dataset, ExportError};
use sightline_scan::{Scan, Scanner};

/// Scans those frames of a scene, by its number in the data set, that the set lacks.
///
/// `watch` gets every scan once it is written; it returns `false` to stop. Returns true if all frames are there.
///
/// # Errors
/// See [`Dataset::write`].
pub fn record(
    dataset: &Dataset,
    scene: usize,
    scanner: &Scanner<'_>,
    watch: impl Fn(&Scan) -> bool + Sync,
) -> Result<bool, ExportError> {
    let frames: Vec<usize> = dataset.missing_of(scene);
    let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    // Each takes the next frame as soon as its own is written, so that none waits for another's files.
    let takers = (0..rayon::current_num_threads().max(1)).into_par_iter().with_max_len(1);
    takers.try_for_each(|_| {
        while !stopped.load(Ordering::Relaxed)
            && let Some(&frame) = frames.get(next.fetch_add(1, Ordering::Relaxed))
        {
            let mut scan = scanner.scan(frame);
            if dataset.tells_visibility(scene, frame) {
                scanner.look_at_boxes(&mut scan);
            }
            let written = dataset.write(scene, &scan);
            if written.is_err() || !watch(&scan) {
                stopped.store(true, Ordering::Relaxed);
            }
            written?;
        }
        Ok::<(), ExportError>(())
    })?;
    match stopped.into_inner() {
        true => Ok(dataset.missing_of(scene).is_empty()),
        false => Ok(true),
    }
}
