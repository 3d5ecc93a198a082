//! Rules of a run beside those of its scene: what the options say, and how results stand to them.

use sightline::report::LeftOut;
use sightline::search::Search;
use sightline::vehicle::{Constraints, MountRules, Placement, SensorPose};

use crate::cli::args::Talk;

/// Distance from a bound, as a share of the range, that counts as on it.
const ON_BOUND: f64 = 1e-3;
/// Distance from a box or from another LiDAR, in metres over the least one, that counts as on it.
const ON_RULE: f64 = 1e-3;

#[derive(clap::Args)]
pub(super) struct Rules {
    /// All LiDARs stand at one height
    #[arg(long, conflicts_with = "resume")]
    equal_height: bool,
    /// LiDARs come in pairs mirrored at the plane y = 0 (y, roll and yaw change sign); an odd one lies
    /// in it
    #[arg(long, conflicts_with = "resume")]
    symmetric: bool,
    /// Keep a pose field of all LiDARs at one value, in metres or radians, as z=2.5 or roll=0; may be
    /// given several times
    #[arg(long, value_name = "FIELD=VALUE", conflicts_with = "resume", value_parser = parse_fixed)]
    fix: Vec<(String, f64)>,
}

impl Rules {
    pub(super) fn for_mount(&self) -> MountRules {
        MountRules {
            equal_height: self.equal_height,
            symmetric: self.symmetric,
            fixed: self.fix.clone(),
        }
    }
}

/// `--fix`: a pose field and its value.
fn parse_fixed(text: &str) -> Result<(String, f64), String> {
    let parts = text.split_once('=').map(|(field, value)| (field.trim(), value.trim().parse()));
    match parts {
        Some((field, Ok(value))) if SensorPose::FIELDS.contains(&field) => {
            Ok((field.to_owned(), value))
        }
        _ => Err(format!("write one of {} and a number, as z=2.5", SensorPose::FIELDS.join(", "))),
    }
}

/// The layouts of `injected` that the search does not start from; each is said on stderr.
pub(super) fn left_out(
    constraints: &Constraints,
    injected: &[Placement],
    talk: Talk,
) -> Vec<LeftOut> {
    let layouts = injected.iter().map(|placement| LeftOut {
        name: placement.name.clone(),
        why: Search::why_left_out(constraints, placement),
    });
    let left_out: Vec<LeftOut> = layouts.filter(|layout| !layout.why.is_empty()).collect();
    for LeftOut { name, why } in &left_out {
        talk.note(format!("--inject: not starting from {name}: {}", why.join("; ")));
    }
    left_out
}

/// What every placement of the search keeps, beside the bounds of the mount, in words.
pub(super) fn in_words(constraints: &Constraints) -> Vec<String> {
    let mut words = Vec::new();
    if constraints.min_distance > 0.0 {
        words.push(format!("LiDARs at least {} m apart", constraints.min_distance));
    }
    for (index, [min, max]) in constraints.keep_out.iter().enumerate() {
        words.push(format!("no LiDAR in keep_out[{index}], {min:?} to {max:?}"));
    }
    if constraints.ties.equal_height {
        words.push("all LiDARs at one height".into());
    }
    if constraints.ties.symmetric {
        words.push("LiDARs in pairs mirrored at the plane y = 0".into());
    }
    let free = constraints.free_fields();
    let fixed = (0..6).filter(|k| !free.contains(k));
    words.extend(fixed.map(|k| format!("{} = {}", SensorPose::FIELDS[k], constraints.lower[k])));
    words
}

/// Free pose fields that lie on a bound, and other rules that are just kept, in words.
pub(super) fn active_bounds(placement: &Placement, constraints: &Constraints) -> Vec<String> {
    let mut found = Vec::new();
    for (lidar, pose) in placement.lidars.iter().enumerate() {
        let fields = pose.fields();
        for k in constraints.free_fields() {
            let (low, high) = (constraints.lower[k], constraints.upper[k]);
            let (field, value) = fields[k];
            let near = ON_BOUND * (high - low);
            if value - low <= near {
                found.push(format!("LiDAR {lidar}: {field} at its lower bound {low}"));
            } else if high - value <= near {
                found.push(format!("LiDAR {lidar}: {field} at its upper bound {high}"));
            }
        }
        let position = pose.position().to_array();
        for (index, [min, max]) in constraints.keep_out.iter().enumerate() {
            let beyond = |k: usize| (min[k] - position[k]).max(position[k] - max[k]);
            if (0..3).map(beyond).fold(f64::MIN, f64::max) <= ON_RULE {
                found.push(format!("LiDAR {lidar}: at a face of keep_out[{index}]"));
            }
        }
        for (other, pose) in placement.lidars.iter().enumerate().skip(lidar + 1) {
            let apart = pose.position().distance(position.into());
            let least = constraints.min_distance;
            if least > 0.0 && apart <= least + ON_RULE {
                found.push(format!("LiDARs {lidar} and {other}: at the least distance {least} m"));
            }
        }
    }
    found
}
