//! Where sensors may stand.

use serde::{Deserialize, Serialize};

use super::SensorPose;
use super::description::{KeepOutDescription, MountDescription};
use super::mirror::SLACK;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};

/// Most keep-out boxes of a mount.
const MAX_KEEP_OUT: usize = 32;

/// Mount of a scene, as its file describes it: positions and angles of its sensors, in the ego frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Mount {
    /// Lower corner of the box of sensor origins, metres.
    pub min: [f64; 3],
    /// Upper corner, metres; equal to `min` along an axis without freedom.
    pub max: [f64; 3],
    /// Allowed roll `[lower, upper]`, radians.
    pub roll: [f64; 2],
    /// Allowed pitch `[lower, upper]`, radians.
    pub pitch: [f64; 2],
    /// Allowed yaw `[lower, upper]`, radians.
    pub yaw: [f64; 2],
    /// Smallest distance between two sensors of a placement, metres.
    pub min_distance: f64,
    /// LiDARs of a placement, 1 to 16.
    pub lidars: u32,
    /// Lower and upper corners of the keep-out boxes, metres.
    pub keep_out: Vec<[[f64; 3]; 2]>,
    /// True if all sensors stand at one height.
    pub equal_height: bool,
    /// True if sensors come in pairs mirrored at the plane y = 0; an odd one lies in the plane.
    pub symmetric: bool,
}

/// Rules that narrow a mount beyond what its scene file says.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MountRules {
    /// See [`Mount::equal_height`].
    pub equal_height: bool,
    /// See [`Mount::symmetric`].
    pub symmetric: bool,
    /// Pose fields that keep one value, in m or rad: `x`, `y`, `z`, `roll`, `pitch` or `yaw`.
    pub fixed: Vec<(String, f64)>,
}

impl Mount {
    pub(crate) fn new(at: &Place, mount: &MountDescription) -> Result<Self, DescriptionError> {
        let min = check::point(&at.key("min"), mount.min)?;
        let max = check::point(&at.key("max"), mount.max)?;
        for i in 0..3 {
            if min[i] > max[i] {
                let wanted = format!("{} or more, the lower corner of the mount", min[i]);
                return Err(bad(&at.key("max").item(i), max[i], wanted));
            }
        }
        let min_distance = mount.min_distance;
        if !(0.0..=check::MAX_METRES).contains(&min_distance) {
            return Err(bad(&at.key("min_distance"), min_distance, "a distance of 0 m or more"));
        }
        let keep_out = keep_out_boxes(&at.key("keep_out"), &mount.keep_out)?;
        let mount = Self {
            min,
            max,
            roll: check::radian_range(&at.key("roll"), mount.roll)?,
            pitch: check::radian_range(&at.key("pitch"), mount.pitch)?,
            yaw: check::radian_range(&at.key("yaw"), mount.yaw)?,
            min_distance,
            lidars: check::count(&at.key("lidars"), mount.lidars, 1, 16)?,
            keep_out,
            equal_height: mount.equal_height,
            symmetric: mount.symmetric,
        };
        mount.check(at)?;
        Ok(mount)
    }

    /// Mount with further rules.
    pub fn narrowed(&self, at: &Place, rules: &MountRules) -> Result<Self, DescriptionError> {
        let mut mount = self.clone();
        for (field, value) in &rules.fixed {
            let at = at.key(field);
            let bounds = mount.bounds_mut(field).ok_or_else(|| {
                let known = "one of x, y, z, roll, pitch and yaw, the fields of a pose";
                bad(&at, format!("`{field}`"), known)
            })?;
            let [lower, upper] = bounds.each_ref().map(|bound| **bound);
            if !(lower..=upper).contains(value) {
                let wanted = format!("within the mount, which runs from {lower} to {upper}");
                return Err(bad(&at, value, wanted));
            }
            bounds.into_iter().for_each(|bound| *bound = *value);
        }
        mount.equal_height |= rules.equal_height;
        mount.symmetric |= rules.symmetric;
        mount.check(at)?;
        Ok(mount)
    }

    /// Lower and upper bound of a pose field by name.
    fn bounds_mut(&mut self, field: &str) -> Option<[&mut f64; 2]> {
        Some(match SensorPose::FIELDS.iter().position(|name| *name == field)? {
            k @ 0..3 => [&mut self.min[k], &mut self.max[k]],
            3 => self.roll.each_mut(),
            4 => self.pitch.each_mut(),
            _ => self.yaw.each_mut(),
        })
    }

    /// Checks that the rules leave room for a placement.
    fn check(&self, at: &Place) -> Result<(), DescriptionError> {
        if self.is_kept_out() {
            let wanted = "a choice that leaves room for a sensor: the boxes cover the whole mount; make \
                          them smaller";
            let boxes = format!("list of {}", self.keep_out.len());
            return Err(bad(&at.key("keep_out"), boxes, wanted));
        }
        let diagonal = [0, 1, 2].map(|k| (self.max[k] - self.min[k]).powi(2));
        let diagonal = diagonal.iter().sum::<f64>().sqrt();
        if self.lidars > 1 && self.min_distance > diagonal + SLACK {
            let wanted = format!(
                "a distance that {} LiDARs in this mount can keep: it measures {diagonal:.3} m from corner \
                 to corner; lower it or widen the mount",
                self.lidars
            );
            return Err(bad(&at.key("min_distance"), self.min_distance, wanted));
        }
        if !self.symmetric {
            return Ok(());
        }
        let at = at.key("symmetric");
        let y = [self.min[1], self.max[1]];
        for (field, [lower, upper]) in [("y", y), ("roll", self.roll), ("yaw", self.yaw)] {
            if lower != -upper {
                let wanted = format!(
                    "possible where {field} runs from {lower} to {upper}; mirrored sensors need a \
                     range from -a to a"
                );
                return Err(bad(&at, true, wanted));
            }
        }
        if self.lidars > 1 && (y[1] == 0.0 || 2.0 * y[1] < self.min_distance) {
            let wanted = format!(
                "possible where y runs from {} to {}: two mirrored sensors need more than 0 m and at \
                 least min_distance, {} m, between them; widen y",
                y[0], y[1], self.min_distance
            );
            return Err(bad(&at, true, wanted));
        }
        Ok(())
    }

    /// True if the keep-out boxes cover the whole mount, faces aside.
    fn is_kept_out(&self) -> bool {
        // All faces cut the mount into cells; each cell is in a box or out of it with its middle.
        let middles = [0, 1, 2].map(|k| {
            let (low, high) = (self.min[k], self.max[k]);
            let faces = self.keep_out.iter().flatten().map(|corner| corner[k]);
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
            let within = |[low, high]: &[[f64; 3]; 2]| {
                (0..3).all(|k| low[k] < point[k] && point[k] < high[k])
            };
            self.keep_out.iter().any(within)
        };
        let [xs, ys, zs] = &middles;
        xs.iter().all(|&x| ys.iter().all(|&y| zs.iter().all(|&z| inside([x, y, z]))))
    }
}

/// Lower and upper corners of boxes.
pub(super) fn keep_out_boxes(
    at: &Place,
    boxes: &[KeepOutDescription],
) -> Result<Vec<[[f64; 3]; 2]>, DescriptionError> {
    if boxes.len() > MAX_KEEP_OUT {
        let at = Box::new(at.clone());
        let (count, limit) = (boxes.len() as u64, MAX_KEEP_OUT as u64);
        let mend = "join some";
        return Err(DescriptionError::TooMany { at, what: "boxes", count, limit, mend });
    }
    boxes.iter().enumerate().map(|(i, cuboid)| keep_out_box(&at.item(i), cuboid)).collect()
}

fn keep_out_box(
    at: &Place,
    cuboid: &KeepOutDescription,
) -> Result<[[f64; 3]; 2], DescriptionError> {
    let min = check::point(&at.key("min"), cuboid.min)?;
    let max = check::point(&at.key("max"), cuboid.max)?;
    for i in 0..3 {
        if min[i] >= max[i] {
            let wanted = format!("above min ({}): the box would keep nothing out", min[i]);
            return Err(bad(&at.key("max").item(i), max[i], wanted));
        }
    }
    Ok([min, max])
}
