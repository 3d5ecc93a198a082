//! `.npz` archives: one array found, checked against the expected type and shape, and read; arrays written as NumPy
//! writes them.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufReader, Read as _, Seek, Write};
use std::path::{Path, PathBuf};

use bytemuck::NoUninit;
use npyz::{
    AutoSerialize, DType, Deserialize, NpyFile, Order, TypeChar, WriteOptions, WriterBuilder,
};
use sightline_files::npy::{read_header, transpose};
use zip::read::ZipFile;
use zip::write::FileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::counts::{check_classes, check_index, refused};
use super::{Psog, PsogError, Roi};

/// The arrays of a P-SOG file, in the order they are written.
const ARRAYS: [&str; 7] = ["roi_min", "voxel", "shape", "frames", "classes", "index", "counts"];

/// An open archive whose members are the arrays of a P-SOG, each once.
struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    /// Position in the archive of each array.
    members: Vec<(&'static str, usize)>,
}

impl Archive {
    /// Opens the archive and checks that it holds each array of a P-SOG once, and nothing else.
    fn open(path: &Path) -> Result<Self, PsogError> {
        let to_open = |source| PsogError::Open { path: path.to_owned(), source };
        let file = sightline_files::files::open(path).map_err(to_open)?;
        let to_archive = |cause: zip::result::ZipError| {
            refused!(
                "{} is not a readable .npz archive ({cause}); if it was cut short, copy or write it again",
                path.display()
            )
        };
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(to_archive)?;
        let mut members: Vec<(&'static str, usize)> = Vec::new();
        for position in 0..zip.len() {
            let member = zip.by_index_raw(position).map_err(to_archive)?;
            let array = member.name().strip_suffix(".npy");
            let Some(&array) = ARRAYS.iter().find(|&&known| Some(known) == array) else {
                let member = member.name().escape_debug().to_string();
                return Err(refused!(
                    "{}: `{member}` is not an array of a P-SOG, which holds {}; leave it out",
                    path.display(),
                    ARRAYS.join(", ")
                ));
            };
            if members.iter().any(|&(name, _)| name == array) {
                return Err(of_array(path, array, "is in the archive twice; keep one"));
            }
            members.push((array, position));
        }
        let is_absent = |array: &&&str| !members.iter().any(|(name, _)| name == *array);
        match ARRAYS.iter().find(is_absent) {
            Some(array) => Err(of_array(path, array, &is_missing())),
            None => Ok(Self { path: path.to_owned(), zip, members }),
        }
    }

    /// Reads one array in C order. `shape` answers a wrong shape with the wanted one. `value` sees each
    /// element as it arrives, with its position, and may refuse it.
    ///
    /// Memory grows with the data that really arrives, never with the size that a header promises.
    fn read<T: AutoSerialize + Deserialize + Copy>(
        &mut self,
        array: &'static str,
        shape: impl FnOnce(&[u64]) -> Result<(), String>,
        value: impl FnMut(usize, T) -> Result<(), PsogError>,
    ) -> Result<Vec<T>, PsogError> {
        let read = self.member(array).and_then(|member| read_member(member, shape, value));
        read.map_err(|fault| match fault {
            ArrayFault::OfArray(fault) => of_array(&self.path, array, &fault),
            ArrayFault::OfElement(fault) => fault.in_file(&self.path),
        })
    }

    fn member(&mut self, array: &'static str) -> Result<ZipFile<'_>, ArrayFault> {
        let position = self.members.iter().find(|&&(name, _)| name == array);
        let position = position.ok_or_else(|| ArrayFault::OfArray(is_missing()))?.1;
        let method = self.zip.by_index_raw(position).map_err(damaged)?.compression();
        if method != CompressionMethod::Stored && method != CompressionMethod::Deflated {
            return Err(packed(&packing(method)));
        }
        // With a password the library reports encrypted members; without one it may panic on them.
        let opened = self.zip.by_index_decrypt(position, b"").map_err(damaged)?;
        opened.map_err(|_| packed("encryption"))
    }
}

/// Fault with an array of a P-SOG file, or with an element of one, whose sentence names the array.
enum ArrayFault {
    OfArray(String),
    OfElement(PsogError),
}

fn of_array(path: &Path, array: &str, fault: &str) -> PsogError {
    refused!("{}: array `{array}` {fault}", path.display())
}

fn is_missing() -> String {
    format!("is missing; a P-SOG holds {}", ARRAYS.join(", "))
}

fn packed(method: &str) -> ArrayFault {
    let mend = "write the file with np.savez or np.savez_compressed";
    ArrayFault::OfArray(format!("is packed with {method}; {mend}"))
}

fn damaged(cause: impl Display) -> ArrayFault {
    ArrayFault::OfArray(format!("is damaged ({cause}); copy or write the file again"))
}

/// How to come from one element type to another in NumPy, whose `astype` takes no texts for bytes.
fn conversion(found: &str, wanted: &str) -> String {
    if wanted == "uint8" && found.contains(['U', 'S', 'O']) {
        return "join the names by \\n and write np.frombuffer(text.encode(), np.uint8)".to_owned();
    }
    format!("convert it with .astype(np.{wanted})")
}

/// The name of a packing that is not read; `zip` names only packings that it was built with.
fn packing(method: CompressionMethod) -> String {
    match method {
        CompressionMethod::BZIP2 => "Bzip2".to_owned(),
        CompressionMethod::LZMA => "Lzma".to_owned(),
        CompressionMethod::ZSTD => "Zstd".to_owned(),
        other => other.to_string(),
    }
}

fn read_member<T: AutoSerialize + Deserialize + Copy>(
    mut member: ZipFile,
    shape: impl FnOnce(&[u64]) -> Result<(), String>,
    mut value: impl FnMut(usize, T) -> Result<(), PsogError>,
) -> Result<Vec<T>, ArrayFault> {
    let (header, length) = read_header(&mut member).map_err(|cause| {
        let mend = "write the file with np.savez";
        ArrayFault::OfArray(format!("has no usable .npy header ({cause}); {mend}"))
    })?;
    let (found, wanted) = (name_of(&header.dtype()), name_of(&T::default_dtype()));
    if found != wanted {
        let mend = conversion(&found, &wanted);
        let fault = format!("has dtype {found}, wanted {wanted}; {mend}");
        return Err(ArrayFault::OfArray(fault));
    }
    shape(header.shape()).map_err(|wanted| {
        let found = show_shape(header.shape());
        ArrayFault::OfArray(format!("has shape {found}, wanted {wanted}"))
    })?;
    let other_size = |need: u64, have: u64| {
        Err(ArrayFault::OfArray(format!(
            "is promised {need} bytes by its header, the archive holds {have}; write the file again"
        )))
    };
    let need = header.len() * size_of::<T>() as u64; // cannot overflow: read_header bounds the elements
    let have = member.size().saturating_sub(length as u64);
    if need != have {
        return other_size(need, have);
    }
    let (order, dimensions) = (header.order(), header.shape().to_vec());
    let mut member = BufReader::with_capacity(1 << 16, member);
    let mut data = Vec::new();
    let elements = NpyFile::with_header(header, &mut member).data::<T>().map_err(damaged)?;
    for element in elements {
        let element = element.map_err(damaged)?;
        value(data.len(), element).map_err(ArrayFault::OfElement)?;
        data.push(element);
    }
    // The checksum is compared at the end of the member, so read up to it.
    if member.read(&mut [0]).map_err(damaged)? > 0 {
        return other_size(need, need + 1);
    }
    Ok(match (order, &dimensions[..]) {
        (Order::Fortran, [_, columns]) => transpose(&data, *columns as usize),
        _ => data,
    })
}

/// NumPy's name of a dtype, of either byte order.
fn name_of(dtype: &DType) -> String {
    let DType::Plain(t) = dtype else { return "of a structured array".to_owned() };
    let bits = t.size_field() * 8;
    match t.type_char() {
        TypeChar::Bool => "bool".to_owned(),
        TypeChar::Int => format!("int{bits}"),
        TypeChar::Uint => format!("uint{bits}"),
        TypeChar::Float => format!("float{bits}"),
        _ => t.to_string(),
    }
}

/// A shape as Python prints it.
fn show_shape(shape: &[u64]) -> String {
    let list: Vec<_> = shape.iter().map(u64::to_string).collect();
    if list.len() == 1 { format!("({},)", list[0]) } else { format!("({})", list.join(", ")) }
}

/// An archive that is being written.
pub struct NpzOut<W: Write + Seek> {
    writer: ZipWriter<W>,
    method: CompressionMethod,
}

/// Writes an archive of the arrays that `put_all` puts into it, compressed as by `savez_compressed` or plain
/// as by `savez`. No time of writing is stored: the same arrays are the same bytes.
pub fn write_npz<W: Write + Seek>(
    out: W,
    compressed: bool,
    put_all: impl FnOnce(&mut NpzOut<W>) -> io::Result<()>,
) -> io::Result<()> {
    let method = if compressed { CompressionMethod::Deflated } else { CompressionMethod::Stored };
    let mut npz = NpzOut { writer: ZipWriter::new(out), method };
    let written = put_all(&mut npz).and_then(|()| Ok(npz.writer.finish().map(drop)?));
    if written.is_err() {
        // Dropped, it would try to write its end again and complain on stderr.
        std::mem::forget(npz);
    }
    written
}

impl<W: Write + Seek> NpzOut<W> {
    /// Adds an array: the header by `npyz`, the data at once (an element at a time is slow).
    pub fn put<T: AutoSerialize + NoUninit>(
        &mut self,
        name: &str,
        shape: &[u64],
        data: &[T],
    ) -> io::Result<()> {
        let options = FileOptions::default()
            .compression_method(self.method)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644)
            .large_file(size_of_val(data) as u64 > u64::from(u32::MAX) / 2);
        self.writer.start_file(format!("{name}.npy"), options)?;
        let array = WriteOptions::<T>::new().default_dtype().shape(shape);
        let out = array.writer(&mut self.writer).write_header_only()?;
        out.write_all(bytemuck::cast_slice(data))
    }
}

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
pub fn read_psog(path: &Path) -> Result<Psog, PsogError> {
    let invalid = |fault: PsogError| fault.in_file(path);
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
    let classes = split_classes(names).map_err(|at| {
        let fault = format!("is not UTF-8 from byte {at} on; encode the names as UTF-8");
        of_array(path, "classes", &fault)
    })?;
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
