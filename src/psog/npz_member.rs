//! One array of an `.npz` archive: opened, checked against what is wanted, read.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use npyz::zip::{CompressionMethod, ZipArchive, read::ZipFile};
use npyz::{DType, Deserialize, NpyFile, NpyHeader, Order, TypeChar};

use super::GridError;

/// Why a P-SOG file was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum PsogFileError {
    /// The file cannot be opened.
    #[error("cannot read {}: {cause}", path.display())]
    Open { path: PathBuf, cause: std::io::Error },
    /// The file is no zip archive, or has lost its end.
    #[error("{} is not a readable .npz archive ({cause}); if it was cut short, copy or write it again", path.display())]
    Archive { path: PathBuf, cause: String },
    /// An array is not there.
    #[error("{}: array `{array}` is missing; a P-SOG holds {}", path.display(), super::npz::ARRAYS.join(", "))]
    Missing { path: PathBuf, array: &'static str },
    /// A member that no P-SOG has.
    #[error("{}: `{member}` is not an array of a P-SOG, which holds {}; leave it out", path.display(), super::npz::ARRAYS.join(", "))]
    Unknown { path: PathBuf, member: String },
    /// An array that is there twice.
    #[error("{}: array `{array}` is in the archive twice; keep one", path.display())]
    Twice { path: PathBuf, array: &'static str },
    /// Compression or encryption that NumPy does not use.
    #[error("{}: array `{array}` is packed with {method}; write the file with np.savez or np.savez_compressed", path.display())]
    Method { path: PathBuf, array: &'static str, method: String },
    /// The bytes of an array are damaged.
    #[error("{}: array `{array}` is damaged ({cause}); copy or write the file again", path.display())]
    Damaged { path: PathBuf, array: &'static str, cause: String },
    /// The header of an array is no `.npy` header that a P-SOG needs.
    #[error("{}: array `{array}` has no usable .npy header ({cause}); write the file with np.savez", path.display())]
    Header { path: PathBuf, array: &'static str, cause: String },
    /// The element type is not the contract's.
    #[error("{}: array `{array}` has dtype {found}, wanted {wanted}; {}", path.display(), conversion(found, wanted))]
    Dtype { path: PathBuf, array: &'static str, found: String, wanted: &'static str },
    /// The shape is not the contract's.
    #[error("{}: array `{array}` has shape {found}, wanted {wanted}", path.display())]
    Shape { path: PathBuf, array: &'static str, found: String, wanted: String },
    /// The header promises other than the archive holds.
    #[error("{}: array `{array}` is promised {need} bytes by its header, the archive holds {have}; write the file again", path.display())]
    Size { path: PathBuf, array: &'static str, need: u64, have: u64 },
    /// Class names that are not text.
    #[error("{}: array `classes` is not UTF-8 from byte {at} on; encode the names as UTF-8", path.display())]
    NotUtf8 { path: PathBuf, at: usize },
    /// The numbers break a rule of the P-SOG.
    #[error("{}: {fault}", path.display())]
    Value { path: PathBuf, fault: GridError },
    /// The file cannot be written.
    #[error("cannot write {}: {cause}; nothing was left behind", path.display())]
    Write { path: PathBuf, cause: std::io::Error },
}

/// How to come from one element type to another in NumPy, whose `astype` takes no texts for bytes.
fn conversion(found: &str, wanted: &str) -> String {
    if wanted == "uint8" && found.contains(['U', 'S', 'O']) {
        return "join the names by \\n and write np.frombuffer(text.encode(), np.uint8)".to_owned();
    }
    format!("convert it with .astype(np.{wanted})")
}

/// An element type of the P-SOG file.
pub(crate) trait Element: Deserialize + Copy {
    /// NumPy's name of the type.
    const NAME: &'static str;
    /// Its kind and bytes.
    const KIND: (TypeChar, u64);
}

macro_rules! element {
    ($($t:ty, $name:literal, $kind:ident;)*) => {$(
        impl Element for $t {
            const NAME: &'static str = $name;
            const KIND: (TypeChar, u64) = (TypeChar::$kind, size_of::<$t>() as u64);
        }
    )*};
}
element! {
    f64, "float64", Float;
    u8, "uint8", Uint;
    u16, "uint16", Uint;
    u32, "uint32", Uint;
    u64, "uint64", Uint;
}

/// An open archive whose members have been looked through.
pub(crate) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    /// Position in the archive of each wanted array.
    members: Vec<(&'static str, usize)>,
}

impl Archive {
    /// Opens the archive and checks that it holds each of `wanted` once, and nothing else.
    pub fn open(path: &Path, wanted: &[&'static str]) -> Result<Self, PsogFileError> {
        let to_open = |cause| PsogFileError::Open { path: path.to_owned(), cause };
        let file = File::open(path).map_err(to_open)?;
        if file.metadata().map_err(to_open)?.is_dir() {
            return Err(to_open(std::io::ErrorKind::IsADirectory.into()));
        }
        let to_archive = |cause: String| PsogFileError::Archive { path: path.to_owned(), cause };
        let mut zip =
            ZipArchive::new(BufReader::new(file)).map_err(|e| to_archive(e.to_string()))?;
        let mut members: Vec<(&'static str, usize)> = Vec::new();
        for position in 0..zip.len() {
            let member = zip.by_index_raw(position).map_err(|e| to_archive(e.to_string()))?;
            let array = member.name().strip_suffix(".npy");
            let Some(&array) = wanted.iter().find(|&&w| Some(w) == array) else {
                let member = member.name().escape_debug().to_string();
                return Err(PsogFileError::Unknown { path: path.to_owned(), member });
            };
            if members.iter().any(|&(name, _)| name == array) {
                return Err(PsogFileError::Twice { path: path.to_owned(), array });
            }
            members.push((array, position));
        }
        if let Some(&array) = wanted.iter().find(|&w| !members.iter().any(|(name, _)| name == w)) {
            return Err(PsogFileError::Missing { path: path.to_owned(), array });
        }
        Ok(Self { path: path.to_owned(), zip, members })
    }

    /// Reads one array in C order. `shape` says what is wrong with a shape: what was wanted.
    /// `value` sees each element as it arrives, with its position, and may refuse it.
    ///
    /// Memory grows with the data that really arrives, never with what a header promises.
    pub fn read<T: Element>(
        &mut self,
        array: &'static str,
        shape: impl FnOnce(&[u64]) -> Result<(), String>,
        mut value: impl FnMut(usize, T) -> Result<(), GridError>,
    ) -> Result<Vec<T>, PsogFileError> {
        let path = self.path.clone();
        let damaged = |cause: String| PsogFileError::Damaged { path: path.clone(), array, cause };
        let mut member = self.member(array)?;
        let text = read_header(&mut member).map_err(|cause| PsogFileError::Header {
            path: path.clone(),
            array,
            cause,
        })?;
        let header = NpyHeader::from_reader(&text[..]).map_err(|e| PsogFileError::Header {
            path: path.clone(),
            array,
            cause: e.to_string(),
        })?;
        check_dtype::<T>(&header).map_err(|found| PsogFileError::Dtype {
            path: path.clone(),
            array,
            found,
            wanted: T::NAME,
        })?;
        shape(header.shape()).map_err(|wanted| PsogFileError::Shape {
            path: path.clone(),
            array,
            found: show_shape(header.shape()),
            wanted,
        })?;
        let need = header.len() * T::KIND.1; // cannot overflow: read_header bounds the elements
        let have = member.size().saturating_sub(text.len() as u64);
        if need != have {
            return Err(PsogFileError::Size { path, array, need, have });
        }
        let order = (header.order(), header.shape().to_vec());
        let mut member = BufReader::with_capacity(1 << 16, member);
        let mut data = Vec::new();
        let elements = NpyFile::with_header(header, &mut member)
            .data::<T>()
            .map_err(|e| damaged(e.to_string()))?;
        for element in elements {
            let element = element.map_err(|e| damaged(e.to_string()))?;
            value(data.len(), element)
                .map_err(|fault| PsogFileError::Value { path: path.clone(), fault })?;
            data.push(element);
        }
        // The checksum is compared at the end of the member, so read up to it.
        match member.read(&mut [0]) {
            Ok(0) => {}
            Ok(_) => return Err(PsogFileError::Size { path, array, need, have: need + 1 }),
            Err(e) => return Err(damaged(e.to_string())),
        }
        Ok(match order {
            (Order::Fortran, shape) if shape.len() == 2 => transpose(&data, shape[1] as usize),
            _ => data,
        })
    }

    fn member(&mut self, array: &'static str) -> Result<ZipFile<'_>, PsogFileError> {
        let path = self.path.clone();
        let Some(&(_, position)) = self.members.iter().find(|&&(name, _)| name == array) else {
            return Err(PsogFileError::Missing { path, array });
        };
        let damaged = |path: &Path, cause: String| PsogFileError::Damaged {
            path: path.to_owned(),
            array,
            cause,
        };
        let method = match self.zip.by_index_raw(position) {
            Ok(raw) => raw.compression(),
            Err(e) => return Err(damaged(&path, e.to_string())),
        };
        if method != CompressionMethod::Stored && method != CompressionMethod::Deflated {
            let method = method.to_string();
            return Err(PsogFileError::Method { path, array, method });
        }
        // With a password the library reports encrypted members; without one it may panic on them.
        match self.zip.by_index_decrypt(position, b"") {
            Ok(Ok(member)) => Ok(member),
            Ok(Err(_)) => Err(PsogFileError::Method { path, array, method: "encryption".into() }),
            Err(e) => Err(damaged(&path, e.to_string())),
        }
    }
}

/// The bytes of a `.npy` header, refused before they are parsed if they are longer or promise more
/// than any array of a P-SOG could: the parser trusts both.
fn read_header(member: &mut impl Read) -> Result<Vec<u8>, String> {
    const LONGEST: usize = 4096; // NumPy writes 118 bytes, padded to 128
    let mut bytes = vec![0; 10];
    let mut take = |bytes: &mut [u8]| {
        member.read_exact(bytes).map_err(|e| format!("it ends inside the header: {e}"))
    };
    take(&mut bytes)?;
    if &bytes[..6] != b"\x93NUMPY" {
        return Err("it does not begin with \\x93NUMPY".into());
    }
    let mut length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    if bytes[6] >= 2 {
        let mut high = [0; 2];
        take(&mut high)?;
        bytes.extend(high);
        length += usize::from(u16::from_le_bytes(high)) << 16;
    }
    if length > LONGEST {
        return Err(format!("the header claims {length} bytes, at most {LONGEST} are read"));
    }
    let start = bytes.len();
    bytes.resize(start + length, 0);
    take(&mut bytes[start..])?;
    let text = &bytes[start..];
    if text.iter().filter(|b| b"([{".contains(b)).count() > 8 {
        return Err("the header nests too many brackets".into());
    }
    // Every number in the header is a dimension or the size of an element.
    let mut product = 1u64;
    for digits in text.split(|b| !b.is_ascii_digit()).filter(|d| !d.is_empty()) {
        let number = std::str::from_utf8(digits).ok().and_then(|d| d.parse::<u64>().ok());
        product = number
            .and_then(|n| product.checked_mul(n.max(1)))
            .filter(|&p| p < 1 << 60)
            .ok_or("the shape promises more elements than any file holds")?;
    }
    Ok(bytes)
}

/// The name of the dtype in the file, if it is not `T` (of either byte order).
fn check_dtype<T: Element>(header: &NpyHeader) -> Result<(), String> {
    match header.dtype() {
        DType::Plain(t) if (t.type_char(), t.size_field()) == T::KIND => Ok(()),
        DType::Plain(t) => {
            let bits = t.size_field() * 8;
            Err(match t.type_char() {
                TypeChar::Bool => "bool".into(),
                TypeChar::Int => format!("int{bits}"),
                TypeChar::Uint => format!("uint{bits}"),
                TypeChar::Float => format!("float{bits}"),
                _ => t.to_string(),
            })
        }
        _ => Err("of a structured array".into()),
    }
}

/// A shape as Python prints it.
fn show_shape(shape: &[u64]) -> String {
    let list: Vec<_> = shape.iter().map(u64::to_string).collect();
    if list.len() == 1 { format!("({},)", list[0]) } else { format!("({})", list.join(", ")) }
}

/// Column-major `[K, columns]` to row-major.
fn transpose<T: Copy>(data: &[T], columns: usize) -> Vec<T> {
    let rows = data.len().checked_div(columns).unwrap_or(0);
    (0..data.len()).map(|n| data[n % columns * rows + n / columns]).collect()
}
