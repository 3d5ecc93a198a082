//! The `lidar` and `mount` of a scene (a vehicle of one model on one mount), and names of mounts that LiDARs stand on.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::description::{KeepOutDescription, LidarDescription, MountDescription};
use super::equipment::{Vehicle, VehicleMount, VehicleSensor};
use super::lidar::stated;
use super::lidar_reading::DescribedLidar;
use super::mounting::{angles, box_of, corners};
use super::pairing::{MIRRORED, SLACK};
use super::sensor_file::Measures;
use super::{
    Constraints, MAX_LIDARS, Placement, Region, Response, SensorName, SensorPose, SpinPhase, Ties,
    doubts,
};
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location};

/// Name of a vehicle that a scene describes by a mount and a LiDAR alone.
pub const UNNAMED: &str = "vehicle";

/// Most keep-out boxes of a mount.
const MAX_KEEP_OUT: usize = 32;

/// Rules that narrow the mount of a scene beyond its file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MountRules {
    /// See [`Ties::equal_height`].
    pub equal_height: bool,
    /// See [`Ties::symmetric`].
    pub symmetric: bool,
    /// Pose fields that keep one value, in m or rad: `x`, `y`, `z`, `roll`, `pitch` or `yaw`.
    pub fixed: Vec<(String, f64)>,
}

impl Vehicle {
    /// Vehicle of a scene's `lidar` and `mount`; `dir` is where the sensor file is.
    ///
    /// The model is locked at 0 and costs nothing.
    pub(crate) fn nameless(
        top: &Location,
        lidar: LidarDescription,
        mount: &MountDescription,
        dir: &Path,
    ) -> Checked<Self> {
        let at = top.key("mount");
        let corners = corners(&at, mount.min, mount.max)?;
        let min_distance = least_distance(&at, mount.min_distance)?;
        let keep_out = keep_out_boxes(&at.key("keep_out"), &mount.keep_out)?;
        let angles = angles(&at, [mount.roll, mount.pitch, mount.yaw])?;
        let region = Arc::new(box_of(corners, angles));
        let most = MAX_LIDARS as u64;
        let lidars = check::count(&at.key("lidars"), mount.lidars, 1, most)? as usize;
        let name = SensorName::NONE;
        let ties = Ties { equal_height: mount.equal_height, symmetric: mount.symmetric };
        let mut vehicle = Self {
            name: UNNAMED.to_owned(),
            mounts: vec![VehicleMount { region, sensors: vec![name], count: [lidars; 2] }],
            min_distance,
            keep_out,
            ties,
            ..Self::default()
        };
        vehicle.check_room(&at)?;
        let DescribedLidar { lidar, measures, notes } =
            DescribedLidar::new(&top.key("lidar"), lidar, dir)?;
        let phase = SpinPhase::Locked(0.0);
        // Beams are as long as the f32 of the range, and so is the range of a response that nothing states.
        let response = match measures == Measures::default() {
            true => Response::usual(f64::from(lidar.range() as f32)),
            false => stated(lidar.range(), &measures),
        };
        let (price, has_price, has_rate) = (0.0, false, measures.rate.is_some());
        vehicle.sensors =
            vec![VehicleSensor { name, lidar, phase, price, has_price, response, has_rate }];
        Ok(Self { notes, ..vehicle })
    }

    /// True for a scene's `lidar` and `mount`: one model and one mount without names, and no price. There is nothing
    /// to choose, and results name neither.
    pub fn is_nameless(&self) -> bool {
        self.sensors.iter().all(|model| model.name.is_none())
    }

    /// Vehicle of a scene's `lidar` and `mount` with further rules of the mount, which `at` names.
    pub(crate) fn narrowed(mut self, at: &Location, rules: &MountRules) -> Checked<Self> {
        if *rules == MountRules::default() {
            return Ok(self);
        }
        if !self.is_nameless() {
            let mend = "the mounts are those of a vehicle; write the rules there";
            return Err(check::misplaced(at, "rules", mend));
        }
        let region = Arc::make_mut(&mut self.mounts[0].region);
        for (k, (field, value)) in rules.fixed.iter().enumerate() {
            let at = at.key(field);
            if rules.fixed[..k].iter().any(|(before, _)| before == field) {
                let wanted =
                    format!("the only value, {field} is fixed twice; leave one of them out");
                return Err(bad(&at, value, wanted));
            }
            let index = SensorPose::FIELDS.iter().position(|name| name == field);
            let index = index.ok_or_else(|| {
                let known = "one of x, y, z, roll, pitch and yaw, the fields of a pose";
                bad(&at, format!("`{field}`"), known)
            })?;
            let (lower, upper) = (&mut region.lower[index], &mut region.upper[index]);
            if !(*lower..=*upper).contains(value) {
                let in_degrees = index >= 3 && value.abs() > std::f64::consts::FRAC_PI_2;
                let radians = value.to_radians();
                let hint =
                    in_degrees.then(|| format!("; in radians? {value}° are {radians:.4} rad"));
                let hint = hint.unwrap_or_default();
                let wanted = format!("within the mount, which runs from {lower} to {upper}{hint}");
                return Err(bad(&at, value, wanted));
            }
            (*lower, *upper) = (*value, *value);
        }
        self.ties.equal_height |= rules.equal_height;
        self.ties.symmetric |= rules.symmetric;
        self.check_room(at)?;
        Ok(self)
    }

    /// Checks that the rules leave room for a placement on the first mount, a box.
    fn check_room(&self, at: &Location) -> Checked<()> {
        let VehicleMount { region, count: [_, lidars], .. } = &self.mounts[0];
        if is_kept_out(&self.keep_out, region.corners()) {
            let wanted = "a choice that leaves room for a sensor: the boxes cover the whole mount; make \
                          them smaller";
            let boxes = format!("list of {}", self.keep_out.len());
            return Err(bad(&at.key("keep_out"), boxes, wanted));
        }
        let diagonal = [0, 1, 2].map(|k| (region.upper[k] - region.lower[k]).powi(2));
        let diagonal = diagonal.iter().sum::<f64>().sqrt();
        if *lidars > 1 && self.min_distance > diagonal + SLACK {
            let wanted = format!(
                "a distance that {lidars} LiDARs in this mount can keep: it measures {diagonal:.3} m from corner \
                 to corner; lower it or widen the mount"
            );
            return Err(bad(&at.key("min_distance"), self.min_distance, wanted));
        }
        if !self.ties.symmetric {
            return Ok(());
        }
        let at = at.key("symmetric");
        for k in MIRRORED {
            let (field, lower, upper) = (SensorPose::FIELDS[k], region.lower[k], region.upper[k]);
            if lower != -upper {
                let wanted = format!(
                    "possible where {field} runs from {lower} to {upper}; mirrored sensors need a \
                     range from -a to a"
                );
                return Err(bad(&at, true, wanted));
            }
        }
        let y = [region.lower[1], region.upper[1]];
        if *lidars > 1 && (y[1] == 0.0 || 2.0 * y[1] < self.min_distance) {
            let wanted = format!(
                "possible where y runs from {} to {}: two mirrored sensors need more than 0 m and at \
                 least min_distance, {} m, between them; widen y",
                y[0], y[1], self.min_distance
            );
            return Err(bad(&at, true, wanted));
        }
        Ok(())
    }

    /// Mount that holds each pose; none where no mount does, or where the mount has no name.
    pub fn mount_names(&self, poses: &[SensorPose]) -> Vec<Option<&str>> {
        let named = if self.is_nameless() { &[][..] } else { &self.mounts };
        let regions = || named.iter().map(|mount| Arc::as_ref(&mount.region));
        poses.iter().map(|pose| holder(regions(), pose)).collect()
    }
}

/// True if keep-out boxes cover the whole box between two corners of the ego frame, faces aside.
pub(super) fn is_kept_out(keep_out: &[[[f64; 3]; 2]], [lower, upper]: [[f64; 3]; 2]) -> bool {
    // All faces cut the box into cells; each cell is in a keep-out box or out of it with its middle.
    let middles = [0, 1, 2].map(|k| {
        let (low, high) = (lower[k], upper[k]);
        let faces = keep_out.iter().flatten().map(|corner| corner[k]);
        let mut cuts: Vec<f64> = faces.filter(|face| low < *face && *face < high).collect();
        cuts.extend([low, high]);
        cuts.sort_by(f64::total_cmp);
        // Faces that touch enclose no cell; a flat mount is one cell of width 0.
        cuts.dedup();
        if low == high {
            return cuts;
        }
        let middle = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
        cuts.windows(2).map(middle).collect::<Vec<f64>>()
    });
    let inside = |point: [f64; 3]| {
        let within =
            |[low, high]: &[[f64; 3]; 2]| (0..3).all(|k| low[k] < point[k] && point[k] < high[k]);
        keep_out.iter().any(within)
    };
    let [xs, ys, zs] = &middles;
    xs.iter().all(|&x| ys.iter().all(|&y| zs.iter().all(|&z| inside([x, y, z]))))
}

/// Least distance between two LiDARs, in metres.
pub(super) fn least_distance(at: &Location, metres: f64) -> Checked<f64> {
    if (0.0..=check::MAX_METRES).contains(&metres) {
        return Ok(metres);
    }
    Err(bad(&at.key("min_distance"), metres, "a distance of 0 m or more"))
}

pub(super) fn keep_out_boxes(
    at: &Location,
    boxes: &[KeepOutDescription],
) -> Checked<Vec<[[f64; 3]; 2]>> {
    if boxes.len() > MAX_KEEP_OUT {
        let (count, limit) = (boxes.len() as u64, MAX_KEEP_OUT as u64);
        return Err(check::too_many(at, "boxes", count, limit, "join some"));
    }
    let corners = |(i, KeepOutDescription { min, max }): (usize, &KeepOutDescription)| {
        check::corners(&at.item(i), *min, *max, ": the box would keep nothing out")
    };
    boxes.iter().enumerate().map(corners).collect()
}

impl Constraints {
    /// Mount of each LiDAR of a placement: its slot's if it stands there, else one that holds it, else `None`. Empty if
    /// there is one mount, which has no name of its own.
    pub fn mount_names(&self, placement: &Placement) -> Vec<Option<&str>> {
        if self.slots.iter().all(|slot| slot.region.own_name().is_empty()) {
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

fn holds(region: &Region, pose: &SensorPose) -> bool {
    region.outside(pose).iter().all(|(_, by)| *by <= doubts::SLACK)
}

fn holder<'a>(mut regions: impl Iterator<Item = &'a Region>, pose: &SensorPose) -> Option<&'a str> {
    regions.find(|region| holds(region, pose)).map(|region| region.name.as_str())
}

#[cfg(test)]
mod tests {
    use super::super::Slot;
    use super::*;

    fn region(name: &str, x: f64) -> Arc<Region> {
        let (lower, upper) =
            ([x - 0.5, -1.0, 1.0, -0.1, 0.0, 0.0], [x + 0.5, 1.0, 2.0, 0.1, 0.0, 0.0]);
        Arc::new(Region { name: name.to_owned(), lower, upper, ..Region::default() })
    }

    #[test]
    fn lidars_carry_the_names_of_their_mounts() {
        let slot = |region: &Arc<Region>| Slot {
            region: region.clone(),
            sensor: SensorName::NONE,
            phase: None,
            others: Vec::new(),
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
        let names = |xs: &[f64]| -> Vec<String> {
            let names = rules.mount_names(&placement(xs));
            names.into_iter().map(|name| name.unwrap_or("-").to_owned()).collect()
        };
        assert_eq!(names(&[0.2, -0.2, 3.5]), ["roof", "wide", "nose"]);
        assert_eq!(names(&[3.0, 0.0, 9.0]), ["nose", "wide", "-"]);
        assert_eq!(names(&[3.001, 0.0]), ["nose", "roof"]);
        let nameless = Constraints::in_box([0.0; 6], [1.0; 6], 2);
        assert!(nameless.mount_names(&placement(&[0.0])).is_empty());
        // The one mount of a scene has no name to be told by.
        let told = |rules: &Constraints| rules.violations(&placement(&[9.0]))[0].to_string();
        let alone = Constraints::in_box([0.0; 6], [1.0, 1.0, 2.0, 1.0, 1.0, 1.0], 1);
        assert_eq!(told(&alone), "LiDAR 0: x is 8.000 m outside the mount");
        assert_eq!(alone.violations(&placement(&[9.0]))[0].in_degrees(), told(&alone));
        let mut turned = placement(&[0.0]);
        turned.lidars[0].yaw = 1.0 + 10.0_f64.to_radians();
        let turned = &alone.violations(&turned)[0];
        assert_eq!(turned.in_degrees(), "LiDAR 0: yaw is 10.00° outside the mount");
        for (pitch, yaw, told) in [
            (5.0, 0.0, "LiDAR 0: pitch is 1.283 rad outside the mount; degrees? 5° are 0.0873 rad"),
            (0.0, 4.5, "LiDAR 0: yaw is 1.783 rad outside the mount; degrees? 4.5° are 0.0785 rad"),
            (1.5, 0.0, "LiDAR 0: pitch is 0.500 rad outside the mount"),
            (0.0, 3.0, "LiDAR 0: yaw is 2.000 rad outside the mount"),
        ] {
            let mut turned = placement(&[0.0]);
            (turned.lidars[0].pitch, turned.lidars[0].yaw) = (pitch, yaw);
            let turned = &alone.violations(&turned)[0];
            assert_eq!(turned.to_string(), told);
            assert!(!turned.in_degrees().contains("degrees?"), "{}", turned.in_degrees());
        }
        let mut degrees = placement(&[0.0]);
        degrees.lidars[0].yaw = 90.0;
        let degrees = &alone.violations(&degrees)[0];
        let words =
            "LiDAR 0: yaw is more than a turn outside the mount; degrees? Angles are in radians";
        assert_eq!([degrees.to_string(), degrees.in_degrees()], [words; 2]);
        let roof = Constraints { slots: vec![slot(&roof)], ..Constraints::default() };
        assert_eq!(told(&roof), "LiDAR 0: x is 8.500 m outside the mount roof");
    }
}
