//! Poses that are hard for numerical methods.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::problem::Problem;
use crate::psog::Roi;
use crate::vehicle::{Placement, SensorPose, random_placements, table_7};

/// Default placements of a verification: Table 7 of the paper, random ones from the mount, and hostile ones.
pub fn usual_placements(
    problem: &Problem,
    random: usize,
    hostile: usize,
    seed: u64,
) -> Vec<Placement> {
    let mut all = table_7();
    all.extend(random_placements(problem.constraints(), random, seed));
    all.extend(hostile_placements(problem.roi(), hostile, seed));
    all
}

/// A kind of pose that methods fail at, from the grid and a number that varies it.
type Kind = (&'static str, fn(&Roi, f64) -> SensorPose);

/// One line a kind.
const KINDS: [Kind; 14] = [
    ("voxel-corner", |roi, u| at(corner(roi, u), [0.0; 3])),
    ("voxel-face", |roi, u| at([corner(roi, u)[0], 0.37 * u, 1.0 + u], [0.0; 3])),
    ("axis-parallel", |_, u| at([0.0, 0.0, 2.0 + u], [0.0, 0.0, quarter(u)])),
    ("upside-down", |_, u| at([u, 0.0, 2.5], [std::f64::consts::PI, 0.0, 0.0])),
    ("on-its-side", |_, u| at([0.0, u, 2.5], [std::f64::consts::FRAC_PI_2, 0.0, 0.0])),
    ("straight-down", |_, u| at([u, u, 2.5], [0.0, std::f64::consts::FRAC_PI_2, 0.0])),
    ("inside-the-body", |_, u| at([u, 0.2, 0.8], [0.1, 0.0, 0.3])),
    ("on-the-ground", |_, u| at([3.0 + u, u, 0.0], [0.0; 3])),
    ("below-the-ground", |_, u| at([3.0, u, -1.0 - u], [0.0, 0.1, 0.0])),
    ("far-above", |_, u| at([u, u, 90.0 + u], [0.0, 1.4, u])),
    ("outside-the-region", |roi, u| at([roi.max()[0] + 5.0 + u, 1.0, 2.0], [0.0; 3])),
    ("on-the-region's-face", |roi, u| at([roi.max()[0], u, 2.0], [0.0; 3])),
    ("on-the-region's-corner", |roi, _| at(roi.min(), [0.0; 3])),
    ("very-far", |_, u| at([1e5 * (1.0 + u), -1e5, 1e3], [0.0, 0.0, 2.4])),
];

fn at([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> SensorPose {
    SensorPose::from_values([x, y, z, roll, pitch, yaw])
}

/// A corner of a voxel near the middle of the grid.
fn corner(roi: &Roi, u: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let half = f64::from(roi.shape()[k]) / 2.0;
        roi.min()[k] + (half + (u * half / 4.0)).floor() * roi.voxel()[k]
    })
}

/// A whole number of quarter turns.
fn quarter(u: f64) -> f64 {
    (4.0 * u).floor() * std::f64::consts::FRAC_PI_2
}

/// Placements of poses that methods fail at: on voxel faces and corners, along the axes, in solids,
/// underground, outside and far from the region, several sensors in one pose.
pub fn hostile_placements(roi: &Roi, count: usize, seed: u64) -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let placements = (0..count).map(|index| {
        let (kind, pose) = KINDS[index % KINDS.len()];
        let first = pose(roi, rng.random_range(0.0..1.0));
        let second = if index % 3 == 0 { first } else { pose(roi, rng.random_range(0.0..1.0)) };
        let kind = kind.replace('\'', "");
        Placement { name: format!("hostile-{kind}-{index}"), lidars: vec![first, second] }
    });
    placements.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_valid_and_each_kind_occurs() {
        let roi = Roi::new([-40.0, -40.0, -0.5], [0.2; 3], [400, 400, 30]).unwrap();
        let placements = hostile_placements(&roi, 50, 1);
        for placement in &placements {
            placement.validate().unwrap();
        }
        for (kind, _) in KINDS {
            let kind = kind.replace('\'', "");
            assert!(placements.iter().any(|p| p.name.contains(&kind)), "{kind}");
        }
    }
}
