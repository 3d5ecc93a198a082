//! Tests of the P-SOG and its files.

mod counts;
mod entropy;
mod npz;
mod npz_malformed;
mod roi;
mod vote;

use super::{Psog, Roi};

/// A grid of 4 × 16 × 2 voxels of 0.5 × 0.25 × 1 m from (−1, −2, −0.5).
fn small_roi() -> Roi {
    Roi::new([-1.0, -2.0, -0.5], [0.5, 0.25, 1.0], [4, 16, 2]).unwrap()
}

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|&n| n.to_owned()).collect()
}

/// Three voxels, two classes, T = 4; the P-SOG in `tests/data/numpy_*.npz`.
fn small_psog() -> Psog {
    let counts = vec![4, 0, 1, 2, 0, 3];
    Psog::new(small_roi(), 4, names(&["road", "véhicule"]), vec![3, 5, 127], counts).unwrap()
}
