//! The P-SOG file.

use std::io::{Seek, Write};
use std::path::Path;

use super::counts::{check_classes, check_index};
use super::npz::{Archive, ArrayFault, PsogFileError, write_npz};
use super::{Psog, PsogError, Roi};

/// Most bytes of class names.
const CLASS_BYTES: u64 = 1 << 24;

/// Reads a P-SOG file (`.npz`), compressed or plain, as NumPy's `savez` and `savez_compressed`
/// write it.
///
/// | array | dtype, shape | holds |
/// |---|---|---|
/// | `roi_min` | f64 \[3\] | lower corner of the grid, metres |
/// | `voxel` | f64 \[3\] | edges of a voxel, metres |
/// | `shape` | u32 \[3\] | voxels along x, y, z |
/// | `frames` | u32, one | T |
/// | `classes` | u8 \[…\] | M names, UTF-8, joined by `\n`, without empty |
/// | `index` | u64 \[K\] | linear voxel indices, strictly rising |
/// | `counts` | u16 \[K, M\] | frames in which the voxel has the class |
///
/// Either byte order and C or Fortran order are read; any other departure is an error.
///
/// # Errors
/// See [`PsogFileError`]; each names the file, the array and a remedy.
pub fn read_psog(path: &Path) -> Result<Psog, PsogFileError> {
    let invalid = |fault: PsogError| PsogFileError::Value { path: path.to_owned(), fault };
    let mut archive = Archive::open(path)?;
    let three = |s: &[u64]| if s == [3] { Ok(()) } else { Err("(3,)".to_owned()) };

    let min = archive.read("roi_min", three, accept::<f64>)?;
    let voxel = archive.read("voxel", three, accept::<f64>)?;
    let shape = archive.read("shape", three, accept::<u32>)?;
    let roi = Roi::new(triple(&min), triple(&voxel), triple(&shape))
        .map_err(PsogError::from)
        .map_err(invalid)?;

    let scalar = |s: &[u64]| if s.is_empty() || s == [1] { Ok(()) } else { Err("()".to_owned()) };
    let frames = archive.read("frames", scalar, accept::<u32>)?[0];

    let names = |s: &[u64]| match s {
        [n] if *n <= CLASS_BYTES => Ok(()),
        _ => Err(format!("(n,) with n at most {CLASS_BYTES}")),
    };
    let names = archive.read("classes", names, accept::<u8>)?;
    let classes =
        split_classes(names).map_err(|at| ArrayFault::NotUtf8 { at }.of(path, "classes"))?;
    check_classes(&classes).map_err(invalid)?;

    let voxels = roi.voxel_count();
    let list = |s: &[u64]| match s {
        [k] if *k <= voxels => Ok(()),
        _ => Err(format!("(K,) with K at most {voxels}, the voxels of the grid")),
    };
    let mut previous = None;
    let index = archive.read("index", list, |position, value| {
        check_index(position, value, previous.replace(value), voxels)
    })?;
    let (k, m) = (index.len() as u64, classes.len() as u64);
    let table = |s: &[u64]| {
        let wanted = || format!("({k}, {m}), a row a voxel of `index` and a column a class");
        if s == [k, m] { Ok(()) } else { Err(wanted()) }
    };
    let counts = archive.read("counts", table, accept::<u16>)?;
    Psog::new(roi, frames, classes, index, counts).map_err(invalid)
}

/// Writes a P-SOG file that [`read_psog`] and NumPy's `load` read: compressed, the same bytes for the same
/// P-SOG. The caller flushes `out`.
///
/// # Errors
/// See `out`.
pub fn write_psog(out: impl Write + Seek, psog: &Psog) -> std::io::Result<()> {
    let roi = psog.roi();
    let names = psog.classes().join("\n");
    let (k, m) = (psog.index().len() as u64, psog.classes().len() as u64);
    write_npz(out, true, |npz| {
        npz.put("roi_min", &[3], &roi.min())?;
        npz.put("voxel", &[3], &roi.voxel())?;
        npz.put("shape", &[3], &roi.shape())?;
        npz.put("frames", &[], &[psog.frames()])?;
        npz.put("classes", &[names.len() as u64], names.as_bytes())?;
        npz.put("index", &[k], psog.index())?;
        npz.put("counts", &[k, m], psog.counts())
    })
}

fn accept<T>(_: usize, _: T) -> Result<(), PsogError> {
    Ok(())
}

/// The three values of an array whose shape was checked.
fn triple<T: Copy>(values: &[T]) -> [T; 3] {
    [values[0], values[1], values[2]]
}

/// Class names from their bytes, or the place of the first byte that is not UTF-8.
fn split_classes(bytes: Vec<u8>) -> Result<Vec<String>, usize> {
    let text = String::from_utf8(bytes).map_err(|e| e.utf8_error().valid_up_to())?;
    if text.is_empty() {
        return Ok(Vec::new());
    }
    Ok(text.split('\n').map(str::to_owned).collect())
}
