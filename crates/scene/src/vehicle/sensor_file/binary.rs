//! Sensor files with a record a beam: NumPy arrays of angles, and the binary tables of RGL.
//!
//! An `.npy` holds azimuth and elevation of each beam in radians, counter-clockwise. RGL has rays as 3×4 matrices, `f32` in
//! little-endian byte order, row by row. A ray leaves the matrix's last column along its third one, in the frame x forward,
//! y left, z up (RGLGazeboPlugin, LidarPatternLoader.cc: a level ray ahead has the pitch π/2).

use npyz::{DType, Deserialize, NpyFile, NpyHeader, Order, TypeChar};
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check};
use sightline_files::npy::{read_header, transpose};

use super::pattern::{Beams, MAX_BEAMS, SensorFormat, SensorPattern, azimuth, degrees, direction};

/// First bytes of a NumPy array.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

pub(super) fn parse_npy(at: &Location, bytes: &[u8]) -> Checked<SensorPattern> {
    let wanted = "an array [N, 2] of float32 or float64, as np.save writes it: azimuth and elevation of each beam \
                  in radians";
    let mut rest = bytes;
    let (header, _) = read_header(&mut rest)
        .map_err(|fault| bad(at, format!("a header where {fault}"), wanted))?;
    let size = match header.dtype() {
        DType::Plain(kind) if kind.type_char() == TypeChar::Float => kind.size_field(),
        _ => 0,
    };
    let &[rows, 2] = header.shape() else {
        return Err(bad(at, format!("an array of shape {:?}", header.shape()), wanted));
    };
    if ![4, 8].contains(&size) {
        return Err(bad(at, format!("an array of {}", header.dtype().descr()), wanted));
    }
    if !(1..=MAX_BEAMS).contains(&rows) {
        return Err(bad(at, format!("a list of {rows}"), format!("1 to {MAX_BEAMS} beams")));
    }
    if rows * 2 * size != rest.len() as u64 {
        let found = format!("{} bytes of data", rest.len());
        return Err(bad(at, found, format!("{rows} rows of {} bytes; write it again", 2 * size)));
    }
    let angles = match size {
        4 => angles::<f32>(at, header, rest)?,
        _ => angles::<f64>(at, header, rest)?,
    };
    let directions = angles.chunks_exact(2).enumerate().map(|(i, pair)| {
        let at = at.item(i);
        let [across, up] = [degrees(pair[0], 360.0), degrees(pair[1], 90.0)];
        let expected = "radians are expected, this looks like degrees; write np.radians of it";
        if across.abs() > 360.0 {
            let wanted = format!("an azimuth in radians within one turn: {expected}");
            return Err(bad(&at, pair[0], wanted));
        }
        if up.abs() > 90.0 && pair[1].abs() <= 90.0 {
            let wanted = format!("an elevation in radians from -1.5708 to 1.5708: {expected}");
            return Err(bad(&at, pair[1], wanted));
        }
        Ok(direction(azimuth(&at, across)?, check::elevation(&at, up)?))
    });
    let beams = Beams::Directions(directions.collect::<Checked<_>>()?);
    Ok(SensorPattern::new(SensorFormat::Numpy, beams))
}

/// The numbers row by row, whatever the order of the file.
fn angles<T: Deserialize + Copy + Into<f64>>(
    at: &Location,
    header: NpyHeader,
    data: &[u8],
) -> Checked<Vec<f64>> {
    let order = header.order();
    let numbers = NpyFile::with_header(header, data).into_vec::<T>();
    let numbers = numbers.map_err(|error| bad(at, "the data", format!("readable: {error}")))?;
    let numbers: Vec<f64> = numbers.into_iter().map(Into::into).collect();
    Ok(if order == Order::Fortran { transpose(&numbers, 2) } else { numbers })
}

const MATRIX: usize = 48;
/// Farthest that the length of a ray's axis may be from 1.
const TOLERANCE: f64 = 1e-3;

/// True if bytes begin with a rigid transform.
pub(super) fn is_rgl(bytes: &[u8]) -> bool {
    bytes.first_chunk::<MATRIX>().is_some_and(|first| ray(first).is_some())
}

pub(super) fn parse_rgl(at: &Location, bytes: &[u8]) -> Checked<SensorPattern> {
    let (rays, rest) = bytes.as_chunks::<MATRIX>();
    if !rest.is_empty() {
        let wanted = "a multiple of 48, the bytes of a matrix; copy the file again";
        return Err(bad(at, format!("{} bytes", bytes.len()), wanted));
    }
    if rays.len() as u64 > MAX_BEAMS {
        return Err(bad(at, format!("a list of {}", rays.len()), format!("1 to {MAX_BEAMS} rays")));
    }
    let mut directions = Vec::with_capacity(rays.len());
    let mut farthest = 0.0_f64;
    for (i, matrix) in rays.iter().enumerate() {
        let Some((direction, origin)) = ray(matrix) else {
            let at = at.key(&format!("matrix {i}"));
            return Err(bad(&at, "its third column", "a unit vector, with a finite fourth one"));
        };
        directions.push(direction);
        farthest = farthest.max(origin);
    }
    let note = Note::fact(format!(
        "Rays start up to {:.0} mm from the origin; all beams start there here.",
        1000.0 * farthest
    ));
    let notes = (farthest > 0.0).then_some(note).into_iter().collect();
    let beams = Beams::Directions(directions);
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Rgl, beams) })
}

/// Unit direction of a ray, and the metres from the origin at which it starts.
fn ray(matrix: &[u8; MATRIX]) -> Option<([f64; 3], f64)> {
    let (values, _) = matrix.as_chunks::<4>();
    let column = |c: usize| [c, c + 4, c + 8].map(|i| f64::from(f32::from_le_bytes(values[i])));
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (axis, origin) = (column(2), norm(column(3)));
    let length = norm(axis);
    let is_rigid = (length - 1.0).abs() <= TOLERANCE && origin.is_finite();
    is_rigid.then(|| (axis.map(|x| x / length), origin))
}
