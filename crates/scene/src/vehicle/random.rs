//! Placements drawn at random from a mount.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Constraints, Placement};

/// Most draws for each placement by the rules: a crowded mount may hold none.
const DRAWS: usize = 1000;

/// Draws placements evenly from the bounds of the mount; minimum distance and keep-out boxes are ignored.
pub fn random_placements(constraints: &Constraints, count: usize, seed: u64) -> Vec<Placement> {
    draws(constraints, seed).take(count).collect()
}

/// First `count` placements of [`random_placements`] that keep every rule of the mount; fewer in a
/// crowded mount.
pub fn random_placements_by_the_rules(
    constraints: &Constraints,
    count: usize,
    seed: u64,
) -> Vec<Placement> {
    let keeps_rules = |placement: &Placement| constraints.violations(placement).is_empty();
    draws(constraints, seed).take(DRAWS * count).filter(keeps_rules).take(count).collect()
}

/// Endless placements, uniform in every free pose field, named by their number.
pub fn draws(constraints: &Constraints, seed: u64) -> impl Iterator<Item = Placement> + '_ {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let bounds = constraints.variable_bounds();
    (0..).map(move |index: usize| {
        let variables: Vec<f64> =
            bounds.iter().map(|&(low, high)| rng.random_range(low..=high)).collect();
        Placement { name: format!("random-{index}"), lidars: constraints.poses_of(&variables) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placements_by_the_rules_are_those_of_all_draws_that_keep_them() {
        let (lower, upper) = ([-1.0, -1.0, 2.0, 0.0, 0.0, 0.0], [1.0, 1.0, 2.5, 0.1, 0.0, 0.0]);
        let mut mount = Constraints { min_distance: 1.0, ..Constraints::in_box(lower, upper, 3) };
        let all = random_placements(&mount, 400, 7);
        let kept: Vec<_> = all.iter().filter(|p| mount.violations(p).is_empty()).collect();
        assert!(kept.len() > 20 && kept.len() < 380, "{} of 400", kept.len());
        let drawn = random_placements_by_the_rules(&mount, 20, 7);
        assert_eq!(drawn.iter().collect::<Vec<_>>(), kept[..20]);
        // Three LiDARs cannot be 5 m apart on a roof of 2 m.
        mount.min_distance = 5.0;
        assert!(random_placements_by_the_rules(&mount, 2, 7).is_empty());
    }
}
