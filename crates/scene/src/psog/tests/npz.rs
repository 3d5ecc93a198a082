//! The P-SOG file: written by NumPy, and by this program.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use super::{names, small_psog, small_roi};
use crate::psog::{Psog, Roi, read_psog, write_psog};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data").join(name)
}

/// Files made by NumPy 2.4: `savez`, `savez_compressed`, and one with big-endian arrays, counts in
/// Fortran order and `frames` as a list of one.
#[test]
fn reads_what_numpy_writes() {
    for name in ["numpy_savez.npz", "numpy_savez_compressed.npz", "numpy_big_endian_fortran.npz"] {
        assert_eq!(read_psog(&data(name)).unwrap(), small_psog(), "{name}");
    }
}

#[test]
fn round_trip_with_the_same_bytes_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let big = Roi::new([-40.0, -40.0, -0.5], [0.2; 3], [400, 400, 30]).unwrap();
    let index: Vec<u64> = (0..100_000).map(|n| n * 37 + n % 3).collect();
    let counts = (0..300_000u32).map(|n| (n * 7 % 11) as u16).collect();
    for psog in [
        small_psog(),
        Psog::new(small_roi(), 1, names(&["a"]), vec![], vec![]).unwrap(),
        Psog::new(big, 40, names(&["a", "b", "c"]), index, counts).unwrap(),
    ] {
        let bytes = [0, 1].map(|_| {
            let mut bytes = Cursor::new(Vec::new());
            write_psog(&mut bytes, &psog).unwrap();
            bytes.into_inner()
        });
        let file = folder.path().join("psog.npz");
        std::fs::write(&file, &bytes[0]).unwrap();
        assert_eq!(read_psog(&file).unwrap(), psog);
        assert_eq!(bytes[0][10..14], [0, 0, 0x21, 0], "midnight, 1980-01-01: no clock in the file");
        assert_eq!(bytes[0], bytes[1]);
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let mut small = [0; 200];
    write_psog(Cursor::new(&mut small[..]), &small_psog()).unwrap_err();
}
