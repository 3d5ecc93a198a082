//! Points of CARLA's semantic LiDAR: PLY as `save_to_disk` writes it, raw records, and NumPy arrays of them.

use std::path::Path;

use npyz::{DType, Endianness, TypeChar};

use super::super::{DatasetError, files};
use sightline_files::npy::read_header;

/// Bytes of a raw record: x, y, z and the cosine as `f32`, object and tag as `u32`.
const RECORD: usize = 24;
/// Properties of a PLY that are read, in the order of [`Record`].
const PROPERTIES: [&str; 5] = ["x", "y", "z", "ObjIdx", "ObjTag"];

/// A point in the sensor frame of this program: x forward, y left, z up, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Record {
    pub xyz: [f32; 3],
    pub object: u32,
    pub tag: u32,
}

/// Reads a scan; its name tells its form.
pub(super) fn read(path: &Path) -> Result<Vec<Record>, DatasetError> {
    let records = match path.extension().and_then(|ending| ending.to_str()) {
        Some("ply") => ply(path, &files::read_text(path)?)?,
        Some("npy") => array(path, &files::read_bytes(path)?)?,
        _ => raw(&files::read_units(path, RECORD as u64)?),
    };
    for (point, record) in records.iter().enumerate() {
        files::check_finite(path, point, record.xyz)?;
    }
    Ok(records)
}

/// From y right to y left.
fn left_handed([x, y, z]: [f32; 3], object: u32, tag: u32) -> Record {
    Record { xyz: [x, 0.0 - y, z], object, tag }
}

fn raw(bytes: &[u8]) -> Vec<Record> {
    let record = |record: &[u8; RECORD]| {
        let four = |at: usize| [record[at], record[at + 1], record[at + 2], record[at + 3]];
        let xyz = [0, 4, 8].map(|at| f32::from_le_bytes(four(at)));
        left_handed(xyz, u32::from_le_bytes(four(16)), u32::from_le_bytes(four(20)))
    };
    bytes.as_chunks::<RECORD>().0.iter().map(record).collect()
}

/// An array `[N]` of records that name x, y, z, ObjIdx and ObjTag, in any order.
fn array(path: &Path, bytes: &[u8]) -> Result<Vec<Record>, DatasetError> {
    let mut data = bytes;
    let mut split = || {
        let (header, _) = read_header(&mut data).ok()?;
        let DType::Record(fields) = header.dtype() else { return None };
        let &[rows] = header.shape() else { return None };
        let (mut places, mut size) = ([None; 5], 0);
        for field in &fields {
            let DType::Plain(kind) = &field.dtype else { return None };
            let known = PROPERTIES.iter().position(|name| name.eq_ignore_ascii_case(&field.name));
            if let Some(known) = known {
                let wanted = if known < 3 { TypeChar::Float } else { TypeChar::Uint };
                let is_little = kind.endianness() != Endianness::Big;
                let fits = kind.type_char() == wanted && kind.size_field() == 4 && is_little;
                if !fits || places[known].replace(size).is_some() {
                    return None;
                }
            }
            size += kind.num_bytes()?;
        }
        let [Some(x), Some(y), Some(z), Some(object), Some(tag)] = places else { return None };
        // A header's numbers are bounded together.
        if size == 0 || rows.checked_mul(size as u64) != Some(data.len() as u64) {
            return None;
        }
        let record = |record: &[u8]| {
            let four = |at: usize| [record[at], record[at + 1], record[at + 2], record[at + 3]];
            let xyz = [x, y, z].map(|at| f32::from_le_bytes(four(at)));
            left_handed(xyz, u32::from_le_bytes(four(object)), u32::from_le_bytes(four(tag)))
        };
        Some(data.chunks_exact(size).map(record).collect())
    };
    split().ok_or_else(|| DatasetError::Array { path: path.to_owned() })
}

/// An ASCII PLY whose only element are vertices of numbers.
fn ply(path: &Path, text: &str) -> Result<Vec<Record>, DatasetError> {
    let line_error = |line: usize, fault: String| {
        Err(DatasetError::Line { path: path.to_owned(), line: line + 1, fault })
    };
    let mut lines = text.lines().enumerate();
    let (columns, count) = match header(&mut lines) {
        Ok(found) => found,
        Err((line, fault)) => return line_error(line, fault),
    };
    let mut records = Vec::new();
    for (line, text) in lines.filter(|(_, text)| !text.trim().is_empty()) {
        let mut found: [Option<&str>; 5] = [None; 5];
        for (word, column) in text.split_ascii_whitespace().zip(&columns) {
            if let Some(column) = column {
                found[*column] = Some(word);
            }
        }
        if text.split_ascii_whitespace().nth(columns.len()).is_some() {
            let fault = format!("has more than the {} numbers of the header", columns.len());
            return line_error(line, fault);
        }
        let [x, y, z] = [0, 1, 2].map(|k| found[k].and_then(|word| word.parse::<f32>().ok()));
        let [object, tag] = [3, 4].map(|k| found[k].and_then(|word| word.parse::<u32>().ok()));
        let (Some(x), Some(y), Some(z), Some(object), Some(tag)) = (x, y, z, object, tag) else {
            let fault = format!("is no point: give {} numbers as the header says", columns.len());
            return line_error(line, fault);
        };
        records.push(left_handed([x, y, z], object, tag));
    }
    if records.len() as u64 != count {
        let fault = format!("{count} points are announced, and {} follow", records.len());
        return line_error(text.lines().count().saturating_sub(1), fault);
    }
    Ok(records)
}

/// Place in [`PROPERTIES`] of each column, and the number of points.
type Header = (Vec<Option<usize>>, u64);

/// Reads the header of a PLY; an error has the number of its line, from 0.
fn header<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<Header, (usize, String)> {
    let (mut columns, mut count, mut last) = (Vec::new(), None, 0);
    for (line, text) in lines {
        last = line;
        let words: Vec<&str> = text.split_ascii_whitespace().take(4).collect();
        match (line, &words[..]) {
            (0, ["ply"]) | (_, ["comment" | "obj_info", ..] | ["format", "ascii", "1.0"]) => {}
            (1.., ["element", "vertex", number]) if count.is_none() => {
                count = number.parse::<u64>().ok();
            }
            (1.., ["property", kind, name]) if *kind != "list" && count.is_some() => {
                columns.push(PROPERTIES.iter().position(|known| known == name));
            }
            (1.., ["end_header"]) => {
                let lacks =
                    PROPERTIES.iter().enumerate().find(|(k, _)| !columns.contains(&Some(*k)));
                return match (lacks, count) {
                    (Some((_, name)), _) => {
                        Err((line, format!("the header has no property {name}")))
                    }
                    (None, Some(count)) => Ok((columns, count)),
                    (None, None) => Err((line, "the header has no element vertex".to_owned())),
                };
            }
            _ => {
                let fault = "belongs to no ASCII PLY of vertices with x, y, z, CosAngle, ObjIdx and \
                             ObjTag, as save_to_disk of CARLA's semantic LiDAR writes it";
                return Err((line, fault.to_owned()));
            }
        }
    }
    Err((last, "the header does not end".to_owned()))
}
