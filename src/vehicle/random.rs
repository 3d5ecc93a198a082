//! Placements drawn at random from a mount.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Constraints, Placement};

/// Draws placements evenly from the bounds of the mount; minimum distance and keep-out boxes are ignored.
pub fn random_placements(constraints: &Constraints, count: usize, seed: u64) -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let placements = (0..count).map(|index| {
        let variables: Vec<f64> = constraints
            .variable_bounds()
            .iter()
            .map(|&(low, high)| rng.random_range(low..=high))
            .collect();
        Placement { name: format!("random-{index}"), lidars: constraints.poses_of(&variables) }
    });
    placements.collect()
}
