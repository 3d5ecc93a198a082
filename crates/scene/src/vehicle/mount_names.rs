//! Names of the mounts that LiDARs stand on.

use std::sync::Arc;

use super::{Constraints, Placement, Region, SensorPose, Vehicle};

/// Metres and radians beside a mount that poses lose where they are written with three decimals.
const SLACK: f64 = 2e-3;

impl Constraints {
    /// Mount of each LiDAR of a placement: its slot's if it stands there, else one that holds it, else `None`. Empty if
    /// there is one mount, which has no name of its own.
    pub fn mount_names(&self, placement: &Placement) -> Vec<Option<&str>> {
        let own = |region: &Region| region.name != Region::default().name;
        if !self.slots.iter().any(|slot| own(&slot.region)) {
            return Vec::new();
        }
        let all: Vec<&Region> = self.slots.iter().map(|slot| &*slot.region).collect();
        let name = |(lidar, pose): (usize, &SensorPose)| {
            let slot = all.get(lidar).filter(|_| all.len() == placement.lidars.len());
            let slot = slot.copied().filter(|region| holds(region, pose));
            slot.map(|region| region.name.as_str()).or_else(|| holder(all.iter().copied(), pose))
        };
        placement.lidars.iter().enumerate().map(name).collect()
    }
}

impl Vehicle {
    /// Mount that holds each pose; none where no mount does, or where the mount has no name.
    pub fn mount_names(&self, poses: &[SensorPose]) -> Vec<Option<&str>> {
        let named = if self.is_nameless() { &[][..] } else { &self.mounts };
        let regions = || named.iter().map(|mount| Arc::as_ref(&mount.region));
        poses.iter().map(|pose| holder(regions(), pose)).collect()
    }
}

fn holds(region: &Region, pose: &SensorPose) -> bool {
    region.outside(pose).iter().all(|(_, by)| *by <= SLACK)
}

fn holder<'a>(mut regions: impl Iterator<Item = &'a Region>, pose: &SensorPose) -> Option<&'a str> {
    regions.find(|region| holds(region, pose)).map(|region| region.name.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Slot;

    fn region(name: &str, x: f64) -> Arc<Region> {
        let (lower, upper) =
            ([x - 0.5, -1.0, 1.0, -0.1, 0.0, 0.0], [x + 0.5, 1.0, 2.0, 0.1, 0.0, 0.0]);
        Arc::new(Region { name: name.to_owned(), lower, upper, ..Region::default() })
    }

    #[test]
    fn lidars_carry_the_names_of_their_mounts() {
        let slot = |region: &Arc<Region>| Slot {
            region: region.clone(),
            sensor: Default::default(),
            phase: None,
        };
        let (roof, wide, nose) = (region("roof", 0.0), region("wide", 0.0), region("nose", 3.0));
        let rules = Constraints {
            slots: vec![slot(&roof), slot(&wide), slot(&nose)],
            ..Constraints::default()
        };
        let placement = |xs: &[f64]| {
            let lidars = xs.iter().map(|&x| SensorPose::at(x, 0.0, 1.5)).collect();
            Placement { name: "a".to_owned(), lidars }
        };
        // Slot by slot where each stands in its own, else the first mount that holds it.
        let names = |xs: &[f64]| {
            rules
                .mount_names(&placement(xs))
                .into_iter()
                .map(|name| name.unwrap_or("-").to_owned())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(&[0.2, -0.2, 3.5]), ["roof", "wide", "nose"]);
        assert_eq!(names(&[3.0, 0.0, 9.0]), ["nose", "wide", "-"]);
        assert_eq!(names(&[3.001, 0.0]), ["nose", "roof"]);
        assert!(
            Constraints::in_box([0.0; 6], [1.0; 6], 2).mount_names(&placement(&[0.0])).is_empty()
        );
    }
}
