//! Whole files of records, and points in them.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::DatasetError;

/// Most bytes of a scan, a list of labels or a table of poses: 16 million points.
const LARGEST: u64 = 256 << 20;

/// Opens a file; refuses pipes and devices, which may have no end.
pub(super) fn open(path: &Path) -> Result<File, DatasetError> {
    let to_read = |source| DatasetError::Read { path: path.to_owned(), source };
    sightline_files::files::open(path).map_err(to_read)
}

/// The bytes of a file of at most [`LARGEST`].
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let mut bytes = Vec::new();
    let to_read = |source| DatasetError::Read { path: path.to_owned(), source };
    open(path)?.take(LARGEST + 1).read_to_end(&mut bytes).map_err(to_read)?;
    if bytes.len() as u64 > LARGEST {
        return Err(DatasetError::TooLarge { path: path.to_owned(), limit: LARGEST });
    }
    Ok(bytes)
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
    String::from_utf8(read_bytes(path)?)
        .map_err(|_| DatasetError::NotUtf8 { path: path.to_owned() })
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

/// Refuses labels that are not one a point of `unit` bytes.
pub(super) fn check_count(
    path: PathBuf,
    labels: usize,
    scan: &Path,
    points: usize,
    unit: usize,
) -> Result<(), DatasetError> {
    if labels == points {
        return Ok(());
    }
    let scan = scan.to_owned();
    let bytes = points * unit;
    // Points of three to eight columns, where this many bytes belong to each label.
    match (3..=8).find(|columns| 4 * columns * labels == bytes) {
        Some(columns) => Err(DatasetError::Columns { path: scan, columns, wanted: unit / 4 }),
        None => Err(DatasetError::LabelCount { path, labels, scan, points }),
    }
}
