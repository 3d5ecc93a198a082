//! Lists as files: headers of NumPy arrays, bounded before they are parsed, `.npy`, and JSON with a line an element.

use std::io::{self, Read, Write};

use npyz::{NpyHeader, WriterBuilder};
use serde_json::ser::Formatter;

/// Reads a header and the number of its bytes. One that is longer or promises more than any file here holds is
/// refused before it is parsed: the parser trusts both.
///
/// # Errors
/// A sentence on the fault, such as "it ends inside the header".
pub fn read_header(reader: &mut impl Read) -> Result<(NpyHeader, usize), String> {
    const LONGEST: usize = 4096; // NumPy writes 118 bytes, padded to 128
    let mut bytes = vec![0; 10];
    let mut take = |bytes: &mut [u8]| {
        reader.read_exact(bytes).map_err(|e| format!("it ends inside the header: {e}"))
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
    let (mut open, mut deepest) = (0_i32, 0);
    for byte in text {
        open += i32::from(b"([{".contains(byte)) - i32::from(b")]}".contains(byte));
        deepest = deepest.max(open);
    }
    let brackets = text.iter().filter(|b| b"([{".contains(b)).count();
    if deepest > 4 || brackets > 64 {
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
    let header = NpyHeader::from_reader(&bytes[..]).map_err(|error| error.to_string())?;
    Ok((header, bytes.len()))
}

/// Column-major `[K, columns]` to row-major.
pub fn transpose<T: Copy>(data: &[T], columns: usize) -> Vec<T> {
    let rows = data.len().checked_div(columns).unwrap_or(0);
    (0..data.len()).map(|n| data[n % columns * rows + n / columns]).collect()
}

/// Writes rising voxel indices as an array `u64[n]` that NumPy loads.
pub fn write_npy(out: impl Write, numbers: Vec<u64>) -> io::Result<()> {
    let shape = [numbers.len() as u64];
    let mut array =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(out).begin_nd()?;
    array.extend(numbers)?;
    array.finish()
}

/// Compact JSON with each element of an outer list on a line of its own.
#[derive(Default)]
pub struct LinePerElement {
    /// Lists that are open.
    depth: u32,
}

impl Formatter for LinePerElement {
    fn begin_array<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth += 1;
        out.write_all(b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth -= 1;
        out.write_all(if self.depth == 0 { b"\n]" } else { b"]" })
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        out.write_all(if first { b"" } else { b"," })?;
        out.write_all(if self.depth == 1 { b"\n" } else { b"" })
    }
}
