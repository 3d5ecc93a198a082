//! Whole files of records, and points in them.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::DatasetError;

/// Largest file of a scan, of its labels or poses, in bytes: a scan of KITTI has 2 MB.
const MAX_FILE: u64 = 1 << 30;

/// Opens a plain file.
pub(super) fn open(path: &Path) -> Result<File, DatasetError> {
    let to_read = |source| DatasetError::Read { path: path.to_owned(), source };
    crate::files::open(path).map_err(to_read)
}

/// The bytes of a file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let to_read = |source| DatasetError::Read { path: path.to_owned(), source };
    crate::files::read(path, MAX_FILE).map_err(to_read)
}

/// The bytes of a file that holds records of `unit` bytes.
pub(super) fn read_units(path: &Path, unit: u64) -> Result<Vec<u8>, DatasetError> {
    let bytes = read_bytes(path)?;
    if !(bytes.len() as u64).is_multiple_of(unit) {
        let (path, bytes) = (path.to_owned(), bytes.len() as u64);
        return Err(DatasetError::Truncated { path, bytes, unit });
    }
    Ok(bytes)
}

/// The text of a file.
pub(super) fn read_text(path: &Path) -> Result<String, DatasetError> {
    String::from_utf8(read_bytes(path)?).map_err(|_| DatasetError::Read {
        path: path.to_owned(),
        source: std::io::Error::new(std::io::ErrorKind::InvalidData, "is not UTF-8 text"),
    })
}

/// Little-endian x, y, z at the start of each record of `N` bytes.
pub(super) fn read_points<const N: usize>(path: &Path) -> Result<Vec<[f32; 3]>, DatasetError> {
    let bytes = read_units(path, N as u64)?;
    let mut points = Vec::with_capacity(bytes.len() / N);
    for (point, record) in bytes.as_chunks::<N>().0.iter().enumerate() {
        let xyz = [0, 4, 8]
            .map(|b| f32::from_le_bytes([record[b], record[b + 1], record[b + 2], record[b + 3]]));
        check_finite(path, point, xyz)?;
        points.push(xyz);
    }
    Ok(points)
}

/// Refuses a coordinate that is no number.
pub(super) fn check_finite(path: &Path, point: usize, xyz: [f32; 3]) -> Result<(), DatasetError> {
    let named = xyz.into_iter().zip(['x', 'y', 'z']);
    match named.into_iter().find(|(value, _)| !value.is_finite()) {
        None => Ok(()),
        Some((value, axis)) => {
            Err(DatasetError::NotFinite { path: path.to_owned(), point, axis, value })
        }
    }
}

/// Refuses labels that are not one a point.
pub(super) fn check_count(
    path: PathBuf,
    labels: usize,
    scan: &Path,
    points: usize,
) -> Result<(), DatasetError> {
    if labels == points {
        return Ok(());
    }
    Err(DatasetError::LabelCount { path, labels, scan: scan.to_owned(), points })
}
