//! RGL: a pattern of rays as 3×4 matrices, `f32` in little-endian byte order, row by row.
//!
//! A ray leaves the matrix's last column along its third one, in the frame x forward, y left, z up
//! (RGLGazeboPlugin, LidarPatternLoader.cc: a level ray ahead has the pitch π/2).

use super::pattern::{Beams, MAX_BEAMS, SensorFormat, SensorPattern};
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Bytes of a matrix.
const MATRIX: usize = 48;
/// Farthest that the length of a ray's axis may be from 1.
const TOLERANCE: f64 = 1e-3;

/// True if bytes begin with a rigid transform.
pub(super) fn is_rgl(bytes: &[u8]) -> bool {
    bytes.first_chunk::<MATRIX>().is_some_and(|first| ray(first).is_some())
}

pub(super) fn parse(at: &Place, bytes: &[u8]) -> Result<SensorPattern, DescriptionError> {
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
