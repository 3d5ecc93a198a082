//! Starts and baselines of a search on a scene's own mount: layouts of the paper that the own body leaves room for.

use crate::scene::Scene;
use crate::score::reference_layout;
use crate::search::{PLAIN, Settings};
use crate::vehicle::{Constraints, Placement, SensorName, random_placements_by_the_rules};

/// Settings of a search by the rules, and a note on baselines that it is without; with `plainly` these are the usual ones.
pub(super) fn begun(
    settings: Settings,
    plainly: bool,
    scene: &Scene,
    constraints: &Constraints,
) -> (Settings, Option<String>) {
    let mut settings = by_the_rules(settings, constraints);
    let note = plainly.then(|| outside_body(&mut settings, scene, constraints));
    (settings, note.flatten())
}

/// Seed of the random placement that is tried before one is worked out.
const SEED: u64 = 0;

/// Settings that start from a placement by the rules where hardly any random one keeps them.
fn by_the_rules(mut settings: Settings, constraints: &Constraints) -> Settings {
    if random_placements_by_the_rules(constraints, 1, SEED).is_empty() {
        settings.starts.extend(constraints.placement_by_the_rules());
    }
    settings
}

/// Leaves out usual baselines with a LiDAR inside the own body, in words; where none is left, a plain layout stands in.
fn outside_body(
    settings: &mut Settings,
    scene: &Scene,
    constraints: &Constraints,
) -> Option<String> {
    let is_inside =
        |layout: &Placement| layout.lidars.iter().any(|lidar| scene.is_in_body(lidar.position()));
    let all = settings.baselines.len();
    settings.baselines.retain(|layout| !is_inside(layout));
    let left_out = all - settings.baselines.len();
    if left_out == 0 {
        return None;
    }
    let instead = match settings.baselines.is_empty() {
        false => String::new(),
        true => {
            let models = vec![SensorName::NONE; constraints.lidars()];
            let plain = reference_layout(constraints, &models);
            settings.baselines = vec![Placement { name: PLAIN.to_owned(), ..plain }];
            format!("; the baseline is `{PLAIN}`, the same sensors placed without a search")
        }
    };
    Some(format!(
        "{left_out} of {all} layouts of Table 7 are left out: a LiDAR of each stands inside the own body; --baselines gives \
         others{instead}"
    ))
}
