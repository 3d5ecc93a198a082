//! Frames counted per voxel and class: the P-SOG, the limits that it and its grid keep, and why one was refused.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::Roi;
use crate::scene::RoiBounds;
use lidar_cast::grid::GridError;
use lidar_cast::memory::OutOfMemory;
use sightline_files::json::check::MOST_CHARACTERS;

/// Why a grid, a P-SOG, its file or a vote was refused.
///
/// Field names (`roi_min`, `voxel`, `shape`, `frames`, `classes`, `index`, `counts`) match the P-SOG file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum PsogError {
    /// The voxel grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The trees of a scene that is scanned do not fit into memory.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
    /// A scan of a scene that was stopped after `done` of its frames.
    #[error(
        "stopped after {done} of {frames} frames were scanned for the P-SOG; nothing of it is kept, give it more time"
    )]
    Stopped { done: usize, frames: usize },
    #[error("{}: cannot be read: {source}; give a P-SOG file, as `sightline psog build` writes it", path.display())]
    Open { path: PathBuf, source: std::io::Error },
    /// Any other setting, number, class, vote or file; the sentence names it and the mend.
    #[error("{0}")]
    Refused(String),
}

/// A [`PsogError::Refused`] of a format string and its values.
macro_rules! refused {
    ($($sentence:tt)*) => { PsogError::Refused(format!($($sentence)*)) };
}
pub(super) use refused;

impl PsogError {
    /// Names the file that has the fault.
    pub(super) fn in_file(self, path: &Path) -> Self {
        refused!("{}: {self}", path.display())
    }
}

impl RoiBounds {
    /// The region as a grid of voxels.
    ///
    /// # Errors
    /// More voxels than a grid may have.
    pub fn grid(&self) -> Result<Roi, PsogError> {
        Ok(Roi::new(self.min, self.voxel, self.shape)?)
    }
}

/// Probabilistic semantic occupancy grid: in how many of T frames a voxel has each class.
///
/// Sparse: voxels not listed are empty in all T frames. For voxel `index[k]`, `counts[k·M + c]`
/// frames have class `c`, and T − Σ are empty; p̂(v = c) is count / T (Place3D, §3.2).
#[derive(Debug, Clone, PartialEq)]
pub struct Psog {
    roi: Roi,
    frames: u32,
    classes: Vec<String>,
    index: Vec<u64>,
    counts: Vec<u16>,
}

impl Psog {
    /// Most classes: class ids are 16 bits, the last id is kept free.
    const CLASS_LIMIT: usize = u16::MAX as usize;

    /// A P-SOG from its parts: T `frames`, M `classes` (without "empty"), K linear voxel indices in
    /// rising order, and `counts` `[K, M]`, row-major.
    pub fn new(
        roi: Roi,
        frames: u32,
        classes: Vec<String>,
        index: Vec<u64>,
        counts: Vec<u16>,
    ) -> Result<Self, PsogError> {
        if frames == 0 {
            let told = "frames is 0; a P-SOG needs at least one frame";
            return Err(PsogError::Refused(told.to_owned()));
        }
        check_classes(&classes)?;
        if index.len().checked_mul(classes.len()) != Some(counts.len()) {
            let (found, voxels, classes) = (counts.len(), index.len(), classes.len());
            let need = voxels as u128 * classes as u128;
            return Err(refused!(
                "counts has {found} values; {voxels} voxels × {classes} classes need {need}"
            ));
        }
        let mut previous = None;
        for (position, &value) in index.iter().enumerate() {
            check_index(position, value, previous, roi.voxel_count())?;
            previous = Some(value);
        }
        for (position, row) in counts.chunks_exact(classes.len()).enumerate() {
            let sum: u64 = row.iter().map(|&c| u64::from(c)).sum();
            if sum > u64::from(frames) {
                let voxel = index[position];
                return Err(refused!(
                    "counts[{position}] (voxel {voxel}) adds up to {sum} frames, but frames is {frames}; a voxel has one \
                     class a frame"
                ));
            }
        }
        Ok(Self { roi, frames, classes, index, counts })
    }

    /// The voxel grid.
    pub fn roi(&self) -> &Roi {
        &self.roi
    }

    /// Number of frames T, at least 1.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Class names `[M]`; a class id is a position in this list.
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// The id of the class with this name.
    pub fn class_id(&self, name: &str) -> Option<u16> {
        self.classes.iter().position(|c| c == name).map(|c| c as u16)
    }

    /// Linear indices of the listed voxels `[K]`, strictly rising.
    pub fn index(&self) -> &[u64] {
        &self.index
    }

    /// Frame counts `[K, M]`, row-major.
    pub fn counts(&self) -> &[u16] {
        &self.counts
    }

    /// Frame counts `[M]` of listed voxel `k` (a position in [`Psog::index`]).
    pub fn row(&self, k: usize) -> &[u16] {
        let classes = self.classes.len();
        &self.counts[k * classes..(k + 1) * classes]
    }

    /// Frame counts `[K, M]`, a row at a time.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, u16> {
        self.counts.chunks_exact(self.classes.len())
    }

    /// Position of a voxel in [`Psog::index`]; `None` if it is not listed (empty in all frames).
    pub fn find(&self, voxel: u64) -> Option<usize> {
        self.index.binary_search(&voxel).ok()
    }

    /// Bytes that the indices and counts take in memory.
    pub fn memory_bytes(&self) -> u64 {
        (size_of_val(&self.index[..]) + size_of_val(&self.counts[..])) as u64
    }

    /// The P-SOG over the frames of both: counts and frames add up.
    ///
    /// # Errors
    /// Different grids or classes, or sums that do not fit their type.
    pub fn merge(&self, other: &Self) -> Result<Self, PsogError> {
        self.check_mergeable(other)?;
        let total = u64::from(self.frames) + u64::from(other.frames);
        let frames = u32::try_from(total).map_err(|_| {
            let limit = u32::MAX;
            refused!("the merged P-SOG would have {total} frames, at most {limit} fit; merge fewer")
        })?;
        let classes = self.classes.len();
        let mut index = Vec::with_capacity(self.index.len().max(other.index.len()));
        let mut counts = Vec::with_capacity(index.capacity() * classes);
        let (mut a, mut b) = (0, 0);
        while a < self.index.len() || b < other.index.len() {
            let left = self.index.get(a).copied().unwrap_or(u64::MAX);
            let right = other.index.get(b).copied().unwrap_or(u64::MAX);
            let voxel = left.min(right);
            let row = counts.len();
            index.push(voxel);
            if left == voxel {
                counts.extend_from_slice(self.row(a));
                a += 1;
            } else {
                counts.resize(row + classes, 0);
            }
            if right == voxel {
                for (c, (sum, &add)) in counts[row..].iter_mut().zip(other.row(b)).enumerate() {
                    let count = u32::from(*sum) + u32::from(add);
                    *sum = u16::try_from(count).map_err(|_| {
                        let (class, limit) = (&self.classes[c], u16::MAX);
                        refused!(
                            "voxel {voxel} would have class {class:?} in {count} frames, at most {limit} fit; merge fewer"
                        )
                    })?;
                }
                b += 1;
            }
        }
        Self::new(self.roi, frames, self.classes.clone(), index, counts)
    }

    fn check_mergeable(&self, other: &Self) -> Result<(), PsogError> {
        let shape = |roi: &Roi| roi.shape().map(f64::from);
        for (field, left, right) in [
            ("roi_min", self.roi.min(), other.roi.min()),
            ("voxel", self.roi.voxel(), other.roi.voxel()),
            ("shape", shape(&self.roi), shape(&other.roi)),
        ] {
            if left != right {
                return Err(refused!(
                    "the P-SOGs have different {field} ({left:?} and {right:?}); only P-SOGs of one grid can be merged"
                ));
            }
        }
        for position in 0..self.classes.len().max(other.classes.len()) {
            let [left, right] = [self, other].map(|p| p.classes.get(position));
            if left != right {
                let [left, right] = [left, right].map(|c| c.map_or("", String::as_str));
                return Err(refused!(
                    "the P-SOGs differ at classes[{position}] ({left:?} and {right:?}); only P-SOGs with the same classes in \
                     the same order can be merged"
                ));
            }
        }
        Ok(())
    }
}

/// Checks the class names of a P-SOG.
pub(crate) fn check_classes(classes: &[String]) -> Result<(), PsogError> {
    if classes.is_empty() {
        return Err(PsogError::Refused("classes is empty; name at least one class".to_owned()));
    }
    if classes.len() > Psog::CLASS_LIMIT {
        let (count, limit) = (classes.len(), Psog::CLASS_LIMIT);
        return Err(refused!("classes has {count} names, at most {limit} fit; merge some classes"));
    }
    let mut seen = HashMap::new();
    for (position, name) in classes.iter().enumerate() {
        let is_long = name.chars().count() > MOST_CHARACTERS;
        if name.is_empty() || is_long || name.contains(char::is_control) {
            return Err(refused!(
                "classes[{position}] is {name:?}; a class name has 1 to 200 characters and holds no control character (names \
                 are joined by line breaks, the last one ends without)"
            ));
        }
        if name == "empty" {
            return Err(refused!(
                "classes[{position}] is \"empty\"; empty is what the counts leave over, so remove that class and its column"
            ));
        }
        if let Some(first) = seen.insert(name.as_str(), position) {
            return Err(refused!(
                "classes[{position}] repeats the name {name:?} of classes[{first}]; give every class its own name"
            ));
        }
    }
    Ok(())
}

/// Checks one entry of `index` against the one before it and the grid.
pub(crate) fn check_index(
    position: usize,
    value: u64,
    previous: Option<u64>,
    voxels: u64,
) -> Result<(), PsogError> {
    if value >= voxels {
        let last = voxels - 1;
        return Err(refused!(
            "index[{position}] is {value}, but the grid has {voxels} voxels, so the last index is {last}"
        ));
    }
    match previous {
        Some(previous) if previous >= value => Err(refused!(
            "index[{position}] is {value}, not above index[{}] = {previous}; list every voxel once, in rising order",
            position - 1
        )),
        _ => Ok(()),
    }
}
