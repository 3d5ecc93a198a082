//! Room for sensors on the mounts of a vehicle: rules that contradict each other, and a rig that keeps all rules.

use super::mount::is_kept_out;
use super::pairing::SLACK;
use super::{Constraints, Equipment, Placement, Vehicle, VehicleMount, Violation};
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, counted};

/// No rig was found that keeps the rules of the mounts.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "{field}: no placement of {} on {} was found that keeps its rules ({}); relax them, widen the mount, \
     or lower its number of LiDARs",
    counted(*lidars, "LiDAR"),
    mounts.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
    rules.join("; ")
)]
pub struct NoRoom {
    /// Key of the file that describes the mounts: `mount` of a scene, `mounts` of a vehicle.
    pub field: &'static str,
    /// LiDARs that the mounts must hold.
    pub lidars: usize,
    /// Names of the mounts.
    pub mounts: Vec<String>,
    /// The rules in words.
    pub rules: Vec<String>,
}

/// A mount with its number in the file.
type Numbered<'a> = (usize, &'a VehicleMount);

impl Vehicle {
    /// Checks that the rules of the vehicle file leave room on each mount that must hold a sensor, and on one mount at
    /// least.
    ///
    /// # Errors
    /// A contradiction that is certain: a mount inside the keep-out boxes, too small for the least distance, or too
    /// narrow for a mirrored pair.
    pub(super) fn check_mounts(&self, at: &Location) -> Checked<()> {
        self.check_kept_out(&at.key("keep_out"))?;
        for numbered in self.mounts.iter().enumerate() {
            self.check_size(&at.key("min_distance"), numbered)?;
            if self.ties.symmetric {
                self.check_width(&at.key("symmetric"), numbered)?;
            }
        }
        Ok(())
    }

    fn check_kept_out(&self, at: &Location) -> Checked<()> {
        let is_covered = |mount: &VehicleMount| is_kept_out(&self.keep_out, mount.region.corners());
        let boxes = format!("list of {}", self.keep_out.len());
        for (k, mount) in self.mounts.iter().enumerate().filter(|(_, mount)| mount.count[0] > 0) {
            if is_covered(mount) {
                let wanted = format!(
                    "a choice that leaves room for a sensor: the boxes cover the whole mount `{}` (mounts[{k}]), which \
                     must hold {}; make them smaller, or lower its `count`",
                    mount.region.name, mount.count[0]
                );
                return Err(bad(at, boxes, wanted));
            }
        }
        if self.mounts.iter().filter(|mount| mount.count[1] > 0).all(is_covered) {
            let wanted = "a choice that leaves room for a sensor: the boxes cover every mount; make them smaller";
            return Err(bad(at, boxes, wanted));
        }
        Ok(())
    }

    fn check_size(&self, at: &Location, (k, mount): Numbered) -> Checked<()> {
        let [low, high] = mount.region.corners();
        let diagonal = (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f64>().sqrt();
        let least = mount.count[0];
        if least < 2 || self.min_distance <= diagonal + SLACK {
            return Ok(());
        }
        let wanted = format!(
            "a distance that {least} LiDARs on the mount `{}` (mounts[{k}]) can keep: it measures {diagonal:.3} m from \
             corner to corner; lower it, widen the mount, or lower its `count`",
            mount.region.name
        );
        Err(bad(at, self.min_distance, wanted))
    }

    /// Two sensors of the only model of a mount that is its own mirror image stand on both sides of the plane.
    fn check_width(&self, at: &Location, (k, mount): Numbered) -> Checked<()> {
        let [low, high] = mount.region.corners().map(|corner| corner[1]);
        let is_pair = mount.count[0] > 1
            && mount.sensors.len() == 1
            && mount.region.is_image_of(&mount.region);
        let is_narrow = high <= SLACK || high - low < self.min_distance - SLACK;
        if !is_pair || !is_narrow {
            return Ok(());
        }
        let wanted = format!(
            "possible where y of the mount `{}` (mounts[{k}]) runs from {low:.3} to {high:.3}: two mirrored sensors \
             need more than 0 m and at least min_distance, {} m, between them; widen y, or lower its `count`",
            mount.region.name, self.min_distance
        );
        Err(bad(at, true, wanted))
    }

    /// A rig of few and cheap sensors that keeps every rule: models and mounts, and a placement of them in the order of
    /// the slots.
    ///
    /// # Errors
    /// None is found.
    pub fn rig_by_the_rules(&self) -> Result<(Equipment, Placement), NoRoom> {
        let few = self.few();
        for equipment in &few {
            let mut sorted = equipment.clone();
            let constraints = self.constraints(equipment);
            if let Some(placement) = constraints.placement_by_the_rules() {
                sorted.sort_by_key(|&(mount, sensor)| {
                    (mount, self.sensors.iter().position(|model| model.name == sensor))
                });
                return Ok((sorted, placement));
            }
        }
        // A mount that leaves no room by itself is the one to name.
        let must = few.into_iter().next().unwrap_or_default();
        let alone = (0..self.mounts.len())
            .map(|k| must.iter().filter(|(mount, _)| *mount == k).copied().collect::<Equipment>());
        let untied = |equipment: &Equipment| self.constraints(equipment).untied();
        let mut alone = alone.filter(|some| !some.is_empty());
        let narrow = alone.find(|some| untied(some).placement_by_the_rules().is_none());
        let equipment = narrow.unwrap_or(must);
        let mut mounts: Vec<usize> = equipment.iter().map(|(mount, _)| *mount).collect();
        mounts.dedup();
        let mounts = mounts.into_iter().map(|k| self.mounts[k].region.name.clone()).collect();
        let rules = self.constraints(&equipment).ties_in_words();
        let field = if self.is_nameless() { "mount" } else { "mounts" };
        Err(NoRoom { field, lidars: equipment.len(), mounts, rules })
    }

    /// Rigs of few sensors: the cheapest; with one more on a mount where pairs leave no room for an odd one; one on each
    /// mount where none must hold any.
    fn few(&self) -> Vec<Equipment> {
        let cheapest = self.cheapest();
        let mut few = vec![cheapest.clone()];
        let may_be_empty = self.mounts.iter().all(|mount| mount.count[0] == 0);
        let with_one_more = |from: &Equipment| {
            let on = |k: usize| from.iter().filter(|(mount, _)| *mount == k).count();
            let roomy = (0..self.mounts.len()).filter(|&k| on(k) < self.mounts[k].count[1]);
            let more = roomy.map(|k| [&from[..], &[(k, self.cheapest_on(k))]].concat());
            more.collect::<Vec<Equipment>>()
        };
        if may_be_empty {
            few.extend(with_one_more(&Vec::new()));
        }
        if self.ties.symmetric {
            let more: Vec<Equipment> = few.iter().flat_map(with_one_more).collect();
            few.extend(more);
        }
        few.retain(|equipment| !equipment.is_empty() && equipment.len() <= super::MAX_LIDARS);
        few
    }

    /// Broken rules of a given placement, in words: rules of [`Self::rules`], and the least and largest numbers of LiDARs
    /// on the mounts of a vehicle file. Empty where it keeps all.
    pub fn broken_rules(&self, rules: &Constraints, placement: &Placement) -> Vec<String> {
        let violations = rules.violations(placement);
        let mut broken: Vec<String> = violations.iter().map(ToString::to_string).collect();
        // A scene's mount takes placements of any number of LiDARs.
        if self.is_nameless() {
            return broken;
        }
        let lidars = &placement.lidars;
        let stands_on = rules.mounts_of(lidars);
        let is_told = |lidar: usize| {
            let is = |v: &Violation| matches!(v, Violation::NotTaken { lidar: of, room: 0, .. } if *of == lidar);
            violations.iter().any(is)
        };
        let without = |lidar: usize| stands_on[lidar].is_none() && !is_told(lidar);
        for (lidar, pose) in lidars.iter().enumerate().filter(|(lidar, _)| without(*lidar)) {
            let words = Violation::NoPlace { lidar, sensor: pose.sensor }.to_string();
            if !broken.contains(&words) {
                broken.push(words);
            }
        }
        for VehicleMount { region, count: [least, _], .. } in &self.mounts {
            let on = stands_on.iter().flatten().filter(|on| on.name == region.name).count();
            if on < *least {
                let name = &region.name;
                broken.push(format!(
                    "the mount `{name}` holds {}, and must hold {least} or more",
                    counted(on, "LiDAR")
                ));
            }
        }
        broken
    }
}

impl Constraints {
    /// Rules between LiDARs and the boxes that they keep out of, in words.
    fn ties_in_words(&self) -> Vec<String> {
        let mut words = Vec::new();
        if self.min_distance > 0.0 && self.lidars() > 1 {
            words.push(format!("at least {} m apart", self.min_distance));
        }
        match self.keep_out.len() {
            0 => {}
            1 => words.push("outside of keep_out[0]".to_owned()),
            boxes => words.push(format!("outside of {boxes} boxes of keep_out")),
        }
        if self.ties.equal_height {
            words.push("at one height".to_owned());
        }
        if self.ties.symmetric {
            words.push("in pairs mirrored at the plane y = 0".to_owned());
        }
        if words.is_empty() {
            words.push("within its bounds".to_owned());
        }
        words
    }
}
