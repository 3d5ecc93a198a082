//! Placements: drawn at random from a mount, published, given their models by `--sensor`, and as people write them.

use std::str::FromStr;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::placement_file::PlacementFile;
use super::{Constraints, ForeignLidar, Placement, SensorName, SensorPose, Vehicle, Violation};
use sightline_files::json::written;

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

const TABLE_7: &str = include_str!("../../placements.json");

/// The eleven hand-made layouts of four LiDARs of Table 7 of Place3D: the baselines where no others are
/// given.
pub fn table_7() -> Vec<Placement> {
    let file = serde_json::from_str::<PlacementFile>(TABLE_7);
    file.expect("a test reads the committed file").placements
}

/// The layouts of Table 7 that fit on the mounts of a vehicle with one model, as on the paper's car. Empty for any other
/// vehicle, inside or beside which they would stand.
pub fn table_7_held_by(vehicle: &Vehicle) -> Vec<Placement> {
    let rules = vehicle.rules();
    let outside = |violation: &Violation| {
        use Violation::{NoPlace, NotTaken, OutsideMount};
        matches!(violation, OutsideMount { .. } | NotTaken { .. } | NoPlace { .. })
    };
    let mut layouts = if vehicle.sensors.len() == 1 { table_7() } else { Vec::new() };
    layouts.retain(|layout| !rules.violations(layout).iter().any(outside));
    layouts
}

const ALL: &str = "all";

/// A model for one LiDAR of every placement, or for all: `0=spin-32`, `all=spin-32`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SensorChoice {
    /// Index of the LiDAR, from 0; `None` for all.
    pub lidar: Option<usize>,
    /// Its model.
    pub sensor: SensorName,
}

impl FromStr for SensorChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('=').and_then(|(lidar, sensor)| {
            let lidar = (lidar != ALL).then(|| lidar.parse().ok());
            Some((lidar.map_or(Some(None), |index| index.map(Some))?, sensor))
        });
        let Some((lidar, sensor)) = parsed else {
            return Err("give N=MODEL with the index of a LiDAR from 0, or all=MODEL".to_owned());
        };
        Ok(Self { lidar, sensor: SensorName::new(sensor)? })
    }
}

impl std::fmt::Display for SensorChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.lidar {
            Some(lidar) => write!(f, "{lidar}={}", self.sensor),
            None => write!(f, "{ALL}={}", self.sensor),
        }
    }
}

/// Gives LiDARs without a name the models of choices; one of a LiDAR goes before one of all.
///
/// # Errors
/// A LiDAR that names another model than the choice for it.
pub fn name_lidars(
    choices: &[SensorChoice],
    placement: &mut Placement,
) -> Result<(), ForeignLidar> {
    let of = |wanted: Option<usize>| choices.iter().rev().find(|choice| choice.lidar == wanted);
    for (lidar, pose) in placement.lidars.iter_mut().enumerate() {
        let own = of(Some(lidar)).map(|choice| choice.sensor);
        if let (false, Some(asked)) = (pose.sensor.is_none(), own.filter(|own| *own != pose.sensor))
        {
            let (placement, named) = (placement.name.clone(), pose.sensor);
            return Err(ForeignLidar::Renamed { placement, lidar, named, asked });
        }
        if pose.sensor.is_none() {
            pose.sensor = own.or(of(None).map(|all| all.sensor)).unwrap_or_default();
        }
    }
    Ok(())
}

/// A pose to the nanometre and nanoradian, without −0.
pub fn to_nanometres(pose: &SensorPose) -> SensorPose {
    let numbers = SensorPose::from_values(pose.values().map(written));
    let phase = pose.phase.map(written);
    SensorPose { sensor: pose.sensor, phase, rides_on: pose.rides_on, ..numbers }
}

/// A placement to the nanometre and nanoradian.
pub fn placement_to_nanometres(placement: &Placement) -> Placement {
    let lidars = placement.lidars.iter().map(to_nanometres).collect();
    Placement { name: placement.name.clone(), lidars }
}

/// x, y, z in millimetres, roll, pitch and yaw in degrees, with two decimals.
pub fn millimetres(pose: &SensorPose) -> [(&'static str, f64); 6] {
    let mut fields = pose.fields();
    for (k, (_, value)) in fields.iter_mut().enumerate() {
        let value_in_unit = if k < 3 { *value * 1e3 } else { value.to_degrees() };
        *value = (value_in_unit * 100.0).round() / 100.0 + 0.0;
    }
    fields
}

/// A pose in millimetres and degrees, in words.
pub fn in_millimetres(pose: &SensorPose) -> String {
    let unit = |k: usize| if k < 3 { " mm" } else { "°" };
    let words = millimetres(pose).into_iter().enumerate();
    let words = words.map(|(k, (field, value))| format!("{field} {value}{}", unit(k)));
    words.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::super::SensorPose;
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

    #[test]
    fn the_committed_layouts_can_be_read() {
        let layouts = super::table_7();
        assert_eq!(layouts.len(), 11);
        assert!(layouts.iter().all(|layout| layout.lidars.len() == 4));
    }

    #[test]
    fn choices_name_what_has_no_name_and_replace_nothing() {
        let choice = |text: &str| text.parse::<SensorChoice>().unwrap();
        let name = |name: &str| SensorName::new(name).unwrap();
        let at = |sensor| SensorPose { sensor, ..SensorPose::at(0.0, 0.0, 2.0) };
        let lidars = vec![at(SensorName::NONE), at(name("corner-8")), at(SensorName::NONE)];
        let mut placement = Placement { name: "a".into(), lidars };
        let choices = [choice("all=spin-32"), choice("2=corner=8")];
        name_lidars(&choices, &mut placement).unwrap();
        let named: Vec<_> = placement.lidars.iter().map(|pose| pose.sensor.as_str()).collect();
        assert_eq!(named, ["spin-32", "corner-8", "corner=8"]);
        let words = name_lidars(&[choice("1=spin-32")], &mut placement).unwrap_err().to_string();
        assert!(words.starts_with("placement `a`, LiDAR 1 is a `corner-8`, and"), "{words}");
        assert_eq!(choices.map(|choice| choice.to_string()), ["all=spin-32", "2=corner=8"]);
        for wrong in ["spin-32", "-1=spin-32", "roof=spin-32", "0=", "=spin-32"] {
            assert!(wrong.parse::<SensorChoice>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_pose_is_told_in_millimetres_and_degrees() {
        let pose = SensorPose::from_values([0.6, -0.4, 2.8, -0.001, 0.1, -0.000_01]);
        let told = "x 600 mm, y -400 mm, z 2800 mm, roll -0.06°, pitch 5.73°, yaw 0°";
        assert_eq!(in_millimetres(&pose), told);
    }

    #[test]
    fn a_placement_is_written_to_the_nanometre() {
        let pose = SensorPose {
            phase: Some(1.0 / 3.0),
            ..SensorPose::from_values([0.1 + 0.2, -0.0, 6.9e-18, 1.0, 2.0, 1e-9])
        };
        let placement = Placement { name: "a".into(), lidars: vec![pose] };
        let placement = placement_to_nanometres(&placement);
        let text = serde_json::to_string(&placement.lidars[0]).unwrap();
        assert_eq!(
            text,
            r#"{"x":0.3,"y":0.0,"z":0.0,"roll":1.0,"pitch":2.0,"yaw":1e-9,"phase":0.333333333}"#
        );
    }
}
