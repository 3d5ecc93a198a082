//! Tests of rigs: round trips, worked poses, real files, faults.

mod chains;
mod comparison;
mod doors;
mod faults;
mod real;
mod round_trip;
mod worked;
mod worlds;
mod yaml;

use super::{FormatError, ImportSettings, ImportedRig, RigSource, import_texts};
use sightline_scene::vehicle::SensorPose;

/// A 4 × 4 matrix, row by row.
type Matrix = [[f64; 4]; 4];

/// `Rz(yaw)·Ry(pitch)·Rx(roll)` written out, beside the position.
fn matrix(pose: &SensorPose) -> Matrix {
    let ((sr, cr), (sp, cp), (sy, cy)) =
        (pose.roll.sin_cos(), pose.pitch.sin_cos(), pose.yaw.sin_cos());
    [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, pose.x],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, pose.y],
        [-sp, cp * sr, cp * cr, pose.z],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Largest difference of two elements.
fn difference(a: &Matrix, b: &Matrix) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
}

fn source(file: &str, text: &str) -> RigSource {
    RigSource { file: file.to_owned(), text: text.to_owned() }
}

fn read(text: &str) -> Result<ImportedRig, FormatError> {
    import_texts(&[source("file", text)], &ImportSettings::default())
}

fn error(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

/// Doubts of a rig, a line each.
fn doubts(rig: &ImportedRig) -> String {
    let doubts = rig.notes.iter().filter(|note| note.is_doubt());
    doubts.map(ToString::to_string).collect::<Vec<_>>().join("\n")
}
