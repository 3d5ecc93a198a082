//! The P-SOG file: written by NumPy, by this program, and with one fault each.

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use zip::{CompressionMethod, ZipWriter, write::FileOptions};

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

/// Members of an archive: file name and bytes.
#[derive(Clone)]
struct Npz(Vec<(String, Vec<u8>)>);

fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn le<const N: usize, T: Copy>(values: &[T], to: fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&v| to(v)).collect()
}

impl Npz {
    /// A sound P-SOG: 4 × 16 × 2 voxels, T = 4, classes `a` and `b`, voxels 3, 5 and 127.
    fn sound() -> Self {
        let mut npz = Self(Vec::new());
        npz.set("roi_min", npy("<f8", "(3,)", &le(&[-1.0, -2.0, -0.5], f64::to_le_bytes)));
        npz.set("voxel", npy("<f8", "(3,)", &le(&[0.5, 0.25, 1.0], f64::to_le_bytes)));
        npz.set("shape", npy("<u4", "(3,)", &le(&[4, 16, 2], u32::to_le_bytes)));
        npz.set("frames", npy("<u4", "()", &le(&[4], u32::to_le_bytes)));
        npz.set("classes", npy("|u1", "(3,)", b"a\nb"));
        npz.set("index", npy("<u8", "(3,)", &le(&[3, 5, 127], u64::to_le_bytes)));
        npz.set("counts", npy("<u2", "(3, 2)", &le(&[4, 0, 1, 2, 0, 3], u16::to_le_bytes)));
        npz
    }

    fn set(&mut self, array: &str, bytes: Vec<u8>) {
        let name = format!("{array}.npy");
        match self.0.iter_mut().find(|(n, _)| *n == name) {
            Some((_, old)) => *old = bytes,
            None => self.0.push((name, bytes)),
        }
    }

    fn with(array: &str, bytes: Vec<u8>) -> Vec<u8> {
        let mut npz = Self::sound();
        npz.set(array, bytes);
        npz.zip(CompressionMethod::Deflated)
    }

    fn zip(&self, method: CompressionMethod) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in &self.0 {
            zip.start_file(name, FileOptions::default().compression_method(method)).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }
}

/// A sound archive whose members say that they are packed in another way.
fn packed_with(method: u16) -> Vec<u8> {
    let mut bytes = Npz::sound().zip(CompressionMethod::Stored);
    for start in 0..bytes.len() - 12 {
        let place = match &bytes[start..start + 4] {
            b"PK\x03\x04" => start + 8,
            b"PK\x01\x02" => start + 10,
            _ => continue,
        };
        bytes[place..place + 2].copy_from_slice(&method.to_le_bytes());
    }
    bytes
}

fn message(bytes: &[u8]) -> String {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    let message = read_psog(file.path()).unwrap_err().to_string();
    let shown = file.path().display().to_string();
    assert!(message.contains(&shown), "the file is not named: {message}");
    message.replace(&shown, "FILE")
}

#[track_caller]
fn refused(bytes: &[u8], wanted: &str) {
    assert_begins!(message(bytes), wanted);
}

#[test]
fn the_sound_file_is_read_however_it_is_packed() {
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), Npz::sound().zip(method)).unwrap();
        let psog = read_psog(file.path()).unwrap();
        assert_eq!(psog.counts(), [4, 0, 1, 2, 0, 3], "{method}");
        assert_eq!(psog.classes(), ["a", "b"], "{method}");
    }
}

#[test]
fn wrong_values() {
    let f = |v: [f64; 3]| npy("<f8", "(3,)", &le(&v, f64::to_le_bytes));
    let index = |v: [u64; 3]| npy("<u8", "(3,)", &le(&v, u64::to_le_bytes));
    let text = |t: &[u8]| npy("|u1", &format!("({},)", t.len()), t);
    let u4 = |shape: &str, v: &[u32]| npy("<u4", shape, &le(v, u32::to_le_bytes));
    let counts = |v: [u16; 6]| npy("<u2", "(3, 2)", &le(&v, u16::to_le_bytes));
    for (array, bytes, wanted) in [
        ("roi_min", f([0.0, f64::NAN, 0.0]), "roi_min along y is NaN; give a finite"),
        ("frames", u4("()", &[0]), "frames is 0;"),
        ("frames", u4("(1,)", &[3]), "counts[0] (voxel 3) adds up to 4 frames, but frames is 3;"),
        ("classes", text(b""), "classes is empty; name at least one"),
        ("classes", text(b"a\n"), "classes[1] is \"\";"),
        ("classes", text(b"a\n\xff"), "array `classes` is not UTF-8 from byte 2 on;"),
        ("classes", text(b"a"), "array `counts` has shape (3, 2), wanted (3, 1),"),
        ("index", index([5, 3, 127]), "index[1] is 3, not above index[0] = 5;"),
        ("counts", counts([65535; 6]), "counts[0] (voxel 3) adds up to 131070 frames"),
    ] {
        refused(&Npz::with(array, bytes), &format!("FILE: {wanted}"));
    }
}

#[test]
fn wrong_types_and_shapes() {
    for (array, descr, shape, size, wanted) in [
        (
            "roi_min",
            "<f4",
            "(3,)",
            12,
            "has dtype float32, wanted float64; convert it with .astype(np.float64)",
        ),
        ("shape", "<i8", "(3,)", 24, "has dtype int64, wanted uint32;"),
        ("frames", "<i4", "()", 4, "has dtype int32, wanted uint32;"),
        (
            "classes",
            "<U3",
            "()",
            12,
            "has dtype <U3, wanted uint8; join the names by \\n and write np.frombuffer(text.encode(), np.uint8)",
        ),
        ("classes", "|b1", "(3,)", 3, "has dtype bool, wanted uint8;"),
        ("index", "<u4", "(3,)", 12, "has dtype uint32, wanted uint64;"),
        ("counts", "<u4", "(3, 2)", 24, "has dtype uint32, wanted uint16;"),
        ("counts", "|O", "(3, 2)", 24, "has dtype |O, wanted uint16;"),
        ("roi_min", "<f8", "(4,)", 32, "has shape (4,), wanted (3,)"),
        ("voxel", "<f8", "()", 8, "has shape (), wanted (3,)"),
        ("shape", "<u4", "(3, 1)", 12, "has shape (3, 1), wanted (3,)"),
        ("frames", "<u4", "(2,)", 8, "has shape (2,), wanted ()"),
        ("frames", "<u4", "(0,)", 0, "has shape (0,), wanted ()"),
        ("classes", "|u1", "(1, 3)", 3, "has shape (1, 3), wanted (n,)"),
        ("index", "<u8", "(129,)", 8 * 129, "has shape (129,), wanted (K,) with K at most 128"),
        ("counts", "<u2", "(2, 3)", 12, "has shape (2, 3), wanted (3, 2), a row a voxel"),
        ("counts", "<u2", "(6,)", 12, "has shape (6,), wanted (3, 2)"),
    ] {
        let wanted = format!("FILE: array `{array}` {wanted}");
        refused(&Npz::with(array, npy(descr, shape, &vec![0; size])), &wanted);
    }
}

#[test]
fn wrong_headers() {
    let header = |array: &str, bytes: Vec<u8>, wanted: &str| {
        let wanted = format!("FILE: array `{array}` {wanted}");
        refused(&Npz::with(array, bytes), &wanted);
    };
    let no = "has no usable .npy header (";
    header("index", b"PK".to_vec(), &format!("{no}it ends inside the header"));
    header("index", b"NUMPY array".to_vec(), &format!("{no}it does not begin with"));
    let mut cut = npy("<u8", "(3,)", &[]);
    cut.truncate(40);
    header("index", cut, &format!("{no}it ends inside the header"));
    // Version 2 headers may claim 4 GiB.
    let long = b"\x93NUMPY\x02\x00\xff\xff\xff\xff{".to_vec();
    header("index", long, &format!("{no}the header claims 4294967295 bytes"));
    let deep = format!("{}1{}", "(".repeat(2000), ")".repeat(2000));
    header("index", npy("<u8", &deep, &[]), &format!("{no}the header nests too many brackets"));
    let wide = npy("<u8", "(4294967296, 4294967296)", &[0; 24]);
    header("index", wide, &format!("{no}the shape promises more elements"));
    let huge = npy("<u8", "(99999999999999999999999,)", &[0; 24]);
    header("index", huge, &format!("{no}the shape promises more elements"));
    let zero = npy("<u8", "(0, 4294967296, 4294967296)", &[]);
    header("index", zero, &format!("{no}the shape promises more elements"));
    header("index", npy("<u8", "(-3,)", &[0; 24]), no);
    header("index", npy("<q", "(3,)", &[0; 24]), no);
    // More and less data than the header promises.
    let short = npy("<u8", "(100,)", &le(&[3], u64::to_le_bytes));
    header("index", short, "is promised 800 bytes by its header, the archive holds 8;");
    let extra = npy("<u8", "(1,)", &le(&[3, 5, 127], u64::to_le_bytes));
    header("index", extra, "is promised 8 bytes by its header, the archive holds 24;");
}

#[test]
fn wrong_members() {
    let deflated = CompressionMethod::Deflated;
    for (n, array) in
        ["roi_min", "voxel", "shape", "frames", "classes", "index", "counts"].iter().enumerate()
    {
        let mut npz = Npz::sound();
        npz.0.remove(n);
        refused(
            &npz.zip(deflated),
            &format!("FILE: array `{array}` is missing; a P-SOG holds roi_min, voxel"),
        );
    }
    let mut npz = Npz::sound();
    npz.set("extra", npy("<u8", "(1,)", &[0; 8]));
    refused(
        &npz.zip(deflated),
        "FILE: `extra.npy` is not an array of a P-SOG, which holds roi_min, voxel",
    );
    let mut npz = Npz::sound();
    let counts = npz.0[6].clone();
    npz.0.push((counts.0.replace('y', "Y"), counts.1));
    refused(&npz.zip(deflated), "FILE: `counts.npY` is not an array");
    // The library writes no name twice, so write another of the same length and rename it.
    let mut npz = Npz::sound();
    npz.set("counts".replace('c', "k").as_str(), npz.0[6].1.clone());
    let mut bytes = npz.zip(deflated);
    for at in 0..bytes.len() - 10 {
        if &bytes[at..at + 10] == b"kounts.npy" {
            bytes[at] = b'c';
        }
    }
    refused(&bytes, "FILE: array `counts` is in the archive twice;");
    for (method, name) in [(93, "Zstd"), (12, "Bzip2"), (14, "Lzma")] {
        let wanted = format!("FILE: array `roi_min` is packed with {name};");
        refused(&packed_with(method), &wanted);
    }
}

#[test]
fn files_that_are_cut_short_or_damaged_never_panic_nor_pass() {
    refused(b"", "FILE is not a readable .npz archive (");
    refused(b"{\"sightline\": 1}", "FILE is not a readable .npz archive (");
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let bytes = Npz::sound().zip(method);
        for cut in 0..bytes.len() {
            assert_begins!(message(&bytes[..cut]), "FILE is not a readable .npz archive (");
        }
    }
    // A changed byte of data is found by its checksum.
    let mut bytes = Npz::sound().zip(CompressionMethod::Stored);
    let at = bytes.windows(4).position(|w| w == [1, 0, 2, 0]).unwrap();
    bytes[at + 2] = 3;
    refused(&bytes, "FILE: array `counts` is damaged (Invalid checksum);");
    // Any single changed byte: read the same, or refused.
    let file = tempfile::NamedTempFile::new().unwrap();
    let sound = Npz::sound().zip(CompressionMethod::Deflated);
    std::fs::write(file.path(), &sound).unwrap();
    let wanted = read_psog(file.path()).unwrap();
    for at in 0..sound.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut bytes = sound.clone();
            bytes[at] ^= flip;
            std::fs::write(file.path(), &bytes).unwrap();
            if let Ok(read) = read_psog(file.path()) {
                assert_eq!(read, wanted, "byte {at} changed by {flip:#x}");
            }
        }
    }
}

#[test]
fn files_that_are_not_there() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path(), Path::new("/nowhere/a.npz")] {
        let message = read_psog(path).unwrap_err().to_string();
        assert!(message.starts_with(&format!("{}: cannot be read: ", path.display())), "{message}");
    }
}
