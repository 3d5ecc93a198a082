//! Numbers of glTF accessors: plain, sparse, normalized and quantized, checked against their buffers.

use std::cell::Cell;

use gltf::accessor::{Accessor, DataType, Dimensions, sparse::IndexType};
use gltf::buffer::View;

/// Most numbers that one file may ask for: many primitives may share one accessor.
const MOST_NUMBERS: usize = 200_000_000;

/// The buffers of a file, and how many numbers may still be read from them.
pub(super) struct Data {
    buffers: Vec<Vec<u8>>,
    left: Cell<usize>,
}

impl Data {
    pub fn new(buffers: Vec<Vec<u8>>) -> Self {
        Self { buffers, left: Cell::new(MOST_NUMBERS) }
    }

    /// Numbers of an accessor, item after item; integers are scaled where it says `normalized`.
    ///
    /// # Errors
    /// Another shape, compressed data, or an end past its buffer: the crate's own reader would panic.
    pub fn read(&self, accessor: &Accessor<'_>, shape: Dimensions) -> Result<Vec<f64>, String> {
        let name = format!("accessor {}", accessor.index());
        let kind = accessor.data_type();
        if accessor.dimensions() != shape {
            return Err(format!(
                "uses {name}, whose items are {:?}, not {shape:?}",
                accessor.dimensions()
            ));
        }
        if shape == Dimensions::Mat4 && kind != DataType::F32 {
            return Err(format!("uses {name}, whose matrices are not f32"));
        }
        let (count, parts) = (accessor.count(), shape.multiplicity());
        if count == 0 {
            return Err(format!("uses {name}, which is empty"));
        }
        let total = count.checked_mul(parts).filter(|total| *total <= self.left.get());
        let total = total.ok_or_else(|| {
            format!("uses {name}, and the file asks for over {MOST_NUMBERS} numbers")
        })?;
        self.left.set(self.left.get() - total);
        let past = || format!("uses {name}, which reaches past its buffer");
        let size = accessor.size();
        let mut numbers = match (accessor.view(), accessor.sparse()) {
            (Some(view), _) => {
                let stride = view.stride().unwrap_or(size);
                if stride < size {
                    return Err(format!("uses {name}, whose items overlap"));
                }
                let bytes =
                    self.slice(&view, accessor.offset(), stride, size, count).ok_or_else(past)?;
                let items = bytes.chunks(stride).take(count);
                items.flat_map(|item| scaled(accessor, &item[..size])).collect()
            }
            // Zeros, which the sparse values replace.
            (None, Some(_)) if total <= self.buffers.iter().map(Vec::len).sum() => vec![0.0; total],
            (None, _) => return Err(format!("uses {name} without plain data (is it compressed?)")),
        };
        self.replace(accessor, &mut numbers)?;
        Ok(numbers)
    }

    /// Puts the sparse values of an accessor in their places among its numbers.
    fn replace(&self, accessor: &Accessor<'_>, numbers: &mut [f64]) -> Result<(), String> {
        let Some(sparse) = accessor.sparse() else { return Ok(()) };
        let name = format!("accessor {}", accessor.index());
        let past = || format!("uses {name}, which reaches past its buffer");
        let (indices, values) = (sparse.indices(), sparse.values());
        let kind_of_index = match indices.index_type() {
            IndexType::U8 => DataType::U8,
            IndexType::U16 => DataType::U16,
            IndexType::U32 => DataType::U32,
        };
        let (wide, size) = (kind_of_index.size(), accessor.size());
        let places = self
            .slice(&indices.view(), indices.offset(), wide, wide, sparse.count())
            .ok_or_else(past)?;
        let values = self
            .slice(&values.view(), values.offset(), size, size, sparse.count())
            .ok_or_else(past)?;
        let (count, parts) = (accessor.count(), accessor.dimensions().multiplicity());
        for (place, item) in places.chunks_exact(wide).zip(values.chunks_exact(size)) {
            let place = number(place, kind_of_index) as usize;
            if place >= count {
                return Err(format!(
                    "uses {name}, whose sparse index {place} is past its {count} items"
                ));
            }
            for (old, new) in
                numbers[place * parts..][..parts].iter_mut().zip(scaled(accessor, item))
            {
                *old = new;
            }
        }
        Ok(())
    }

    /// Bytes of `count` items of a view.
    fn slice(
        &self,
        view: &View<'_>,
        offset: usize,
        stride: usize,
        size: usize,
        count: usize,
    ) -> Option<&[u8]> {
        let need = match count {
            0 => 0,
            _ => (count - 1).checked_mul(stride)?.checked_add(size)?,
        };
        let whole = self.buffers.get(view.buffer().index())?;
        let whole = whole.get(view.offset()..view.offset().checked_add(view.length())?)?;
        whole.get(offset..offset.checked_add(need)?)
    }
}

/// Numbers of an item's bytes, normalized where the accessor says so.
fn scaled<'a>(accessor: &'a Accessor<'_>, item: &'a [u8]) -> impl Iterator<Item = f64> + 'a {
    let kind = accessor.data_type();
    let is_normalized = accessor.normalized();
    item.chunks_exact(kind.size()).map(move |bytes| {
        let value = number(bytes, kind);
        if is_normalized { normalized(value, kind) } else { value }
    })
}

/// A number of a component type, little-endian.
fn number(bytes: &[u8], kind: DataType) -> f64 {
    let bits = bytes.iter().rev().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte));
    match kind {
        DataType::I8 => f64::from(bits as u8 as i8),
        DataType::I16 => f64::from(bits as u16 as i16),
        DataType::U8 | DataType::U16 | DataType::U32 => f64::from(bits),
        DataType::F32 => f64::from(f32::from_bits(bits)),
    }
}

fn normalized(value: f64, kind: DataType) -> f64 {
    match kind {
        DataType::I8 => (value / 127.0).max(-1.0),
        DataType::U8 => value / 255.0,
        DataType::I16 => (value / 32_767.0).max(-1.0),
        DataType::U16 => value / 65_535.0,
        DataType::U32 | DataType::F32 => value,
    }
}
