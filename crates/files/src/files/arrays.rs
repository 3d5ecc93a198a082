//! Lists as files: JSON with a line an element, and NumPy's `.npy`.

use std::io::{Result, Write};

use npyz::WriterBuilder;
use serde_json::ser::Formatter;

/// Writes rising voxel indices as an array `u64[n]` that NumPy loads.
///
/// # Errors
/// Errors of `out`.
pub fn write_npy(out: impl Write, numbers: Vec<u64>) -> Result<()> {
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
    fn begin_array<W: ?Sized + Write>(&mut self, out: &mut W) -> Result<()> {
        self.depth += 1;
        out.write_all(b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, out: &mut W) -> Result<()> {
        self.depth -= 1;
        out.write_all(if self.depth == 0 { b"\n]" } else { b"]" })
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> Result<()> {
        out.write_all(if first { b"" } else { b"," })?;
        out.write_all(if self.depth == 1 { b"\n" } else { b"" })
    }
}
