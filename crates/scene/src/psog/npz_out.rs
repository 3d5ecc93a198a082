//! Writing of `.npz` archives as NumPy does, one array after the other.

use std::io::{Result, Seek, Write};

use bytemuck::NoUninit;
use npyz::{AutoSerialize, WriteOptions, WriterBuilder};
use zip::{CompressionMethod, DateTime, ZipWriter, write::FileOptions};

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
    put_all: impl FnOnce(&mut NpzOut<W>) -> Result<()>,
) -> Result<()> {
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
    ) -> Result<()> {
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
