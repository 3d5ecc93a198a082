//! What in a placement is most likely not meant: degrees, millimetres, a place beside the mount.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use super::{Constraints, Placement, Region, SensorPose};

/// Farthest coordinate of a sensor that stands on a vehicle, in metres: larger ones are most likely millimetres.
const FARTHEST: f64 = 100.0;
/// Smallest whole number of radians that is more likely degrees.
const WHOLE: f64 = 2.0;
/// Metres beside a mount that poses lose where they are written with three decimals.
const SLACK: f64 = 2e-3;

/// Looks for what is most likely not meant in placements. None of it is an error: a placement is taken as it is.
#[derive(Debug, Clone, Default)]
pub struct Doubts {
    /// Where sensors may stand, each once; empty where that is nobody's matter.
    regions: Vec<Arc<Region>>,
}

impl Doubts {
    /// About units alone: of placements whose other rules are told elsewhere.
    pub fn of_units() -> Self {
        Self::default()
    }

    /// About units, and LiDARs that stand beside every mount.
    pub fn of(constraints: &Constraints) -> Self {
        let mut regions: Vec<Arc<Region>> = Vec::new();
        for slot in &constraints.slots {
            if !regions.iter().any(|known| Arc::ptr_eq(known, &slot.region)) {
                regions.push(slot.region.clone());
            }
        }
        Self { regions }
    }

    /// Sentences about LiDARs, with the name of the placement.
    pub fn about(&self, placement: &Placement) -> Vec<String> {
        let lidars = placement.lidars.iter().enumerate();
        let doubts = lidars.flat_map(|(lidar, pose)| {
            self.about_pose(pose).into_iter().map(move |doubt| (lidar, doubt))
        });
        doubts
            .map(|(lidar, doubt)| format!("placement `{}`, LiDAR {lidar}: {doubt}", placement.name))
            .collect()
    }

    fn about_pose(&self, pose: &SensorPose) -> Vec<String> {
        let units = doubts_of_units(pose);
        let is_far = pose.position().abs().max_element() > FARTHEST;
        let beside = self.regions.iter().map(|region| beside(region, pose));
        let beside = beside.min_by(f64::total_cmp).filter(|beside| !is_far && *beside > SLACK);
        let beside = beside.map(|beside| {
            format!("it stands {beside:.3} m outside the mount, and is taken where it stands")
        });
        units.into_iter().chain(doubt_of_ground(pose)).chain(beside).collect()
    }
}

/// Sentences about a pose whose angles are most likely degrees, or its position millimetres.
pub(crate) fn doubts_of_units(pose: &SensorPose) -> Vec<String> {
    let fields = pose.fields();
    let (metres, radians) = fields.split_at(3);
    let turned = radians.iter().find_map(|&(field, value)| {
        let most = if field == "yaw" { TAU } else { PI };
        let fault = if value.abs() > TAU + 1e-6 {
            "is more than a turn".to_owned()
        } else if value.abs() >= WHOLE && value.fract() == 0.0 {
            format!("rad is {:.0}°", value.to_degrees())
        } else if value.abs() > most + 1e-6 {
            "is more than half a turn".to_owned()
        } else {
            return None;
        };
        Some(format!(
            "{field} = {value} {fault}; angles are in radians, {value}° are {:.4}",
            value.to_radians()
        ))
    });
    let far = metres.iter().find(|(_, value)| value.abs() > FARTHEST).map(|(field, value)| {
        format!(
            "{field} = {value} is far from any vehicle; positions are in metres, {value} mm are {}",
            value / 1000.0
        )
    });
    turned.into_iter().chain(far).collect()
}

/// A sentence about a LiDAR below the ground.
pub(crate) fn doubt_of_ground(pose: &SensorPose) -> Option<String> {
    (pose.z < 0.0 && pose.z >= -FARTHEST).then(|| {
        let z = pose.z;
        format!(
            "z = {z:.3} is below the ground; heights are counted from the ground below the vehicle"
        )
    })
}

/// Metres from a position to a region; 0 inside.
fn beside(region: &Region, pose: &SensorPose) -> f64 {
    let outside = region.outside(pose).into_iter();
    let metres = outside.filter(|(field, _)| SensorPose::FIELDS[..3].contains(field));
    metres.map(|(_, by)| by * by).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doubts(doubts: &Doubts, pose: SensorPose) -> String {
        let placement =
            Placement { name: "roof".into(), lidars: vec![SensorPose::at(0.0, 0.0, 2.0), pose] };
        doubts.about(&placement).join("; ")
    }

    #[test]
    fn degrees_millimetres_and_places_beside_the_mount_are_doubted() {
        let mount = Constraints::in_box(
            [-1.0, -1.0, 1.5, 0.0, 0.0, 0.0],
            [1.0, 1.0, 2.5, 0.0, 0.0, 0.0],
            2,
        );
        let all = Doubts::of(&mount);
        let at = SensorPose::at;
        for pose in [at(1.001, -1.0, 2.5), SensorPose { yaw: -TAU, roll: 0.4, ..at(0.0, 0.0, 2.0) }]
        {
            assert_eq!(doubts(&all, pose), "");
        }
        assert_eq!(
            doubts(&all, SensorPose { yaw: 90.0, ..at(0.0, 0.0, 2.0) }),
            "placement `roof`, LiDAR 1: yaw = 90 is more than a turn; angles are in radians, 90° are 1.5708"
        );
        let far = "z = 2500 is far from any vehicle; positions are in metres, 2500 mm are 2.5";
        assert!(doubts(&all, at(0.0, 0.0, 2500.0)).ends_with(far));
        assert!(doubts(&Doubts::of_units(), at(0.0, 0.0, 2500.0)).ends_with(far));
        let outside = doubts(&all, at(1.3, 0.0, 2.9));
        assert!(outside.ends_with(
            "LiDAR 1: it stands 0.500 m outside the mount, and is taken where it stands"
        ));
        assert_eq!(doubts(&Doubts::of_units(), at(1.3, 0.0, 2.9)), "");
    }

    #[test]
    fn small_whole_angles_half_turns_and_the_ground_are_doubted() {
        let units = Doubts::of_units();
        let at = SensorPose::at(0.0, 0.0, 2.0);
        let five = doubts(&units, SensorPose { pitch: 5.0, ..at });
        assert!(
            five.ends_with("pitch = 5 rad is 286°; angles are in radians, 5° are 0.0873"),
            "{five}"
        );
        let half = doubts(&units, SensorPose { roll: -3.5, ..at });
        assert!(half.contains("roll = -3.5 is more than half a turn; angles are"), "{half}");
        let both = doubts(&units, SensorPose { x: 900.0, pitch: 15.0, ..at });
        assert!(both.contains("15° are 0.2618") && both.contains("900 mm are 0.9"), "{both}");
        let low = doubts(&units, SensorPose { z: -0.25, ..at });
        assert!(low.ends_with(
            "z = -0.250 is below the ground; heights are counted from the ground below the vehicle"
        ));
        for fine in [
            SensorPose { yaw: 3.5, ..at },
            SensorPose { roll: PI, pitch: 1.0, ..at },
            SensorPose { z: 0.0, ..at },
        ] {
            assert_eq!(doubts(&units, fine), "");
        }
    }
}
