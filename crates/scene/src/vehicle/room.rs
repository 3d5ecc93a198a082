//! Room for sensors on the mounts of a vehicle: rules that contradict each other, a rig that keeps all rules, and a
//! placement of it, tried out among the corners, edges and inner points of the mounts.

use std::ops::Range;

use glam::DVec3;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::mount::is_kept_out;
use super::pairing::{MIRRORED, SLACK};
use super::{
    Constraints, Equipment, Placement, Region, SensorPose, Vehicle, VehicleMount, Violation,
};
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, counted, quoted};

/// No rig was found that keeps the rules of the mounts: key of the file that describes them, LiDARs, mounts and rules, in words.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct NoRoom(String);

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
    pub fn rig_by_the_rules(&self) -> Result<(Equipment, Placement), NoRoom> {
        let few = self.few();
        for equipment in &few {
            if let Some(placement) = self.constraints(equipment).placement_by_the_rules() {
                return Ok((self.sorted(equipment), placement));
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
        Err(NoRoom(format!(
            "{}: no placement of {} on {} was found that keeps its rules ({}); relax them, widen the mount, or lower its \
             number of LiDARs",
            if self.is_nameless() { "mount" } else { "mounts" },
            counted(equipment.len(), "LiDAR"),
            quoted(mounts.into_iter().map(|k| &self.mounts[k].region.name)),
            self.constraints(&equipment).ties_in_words().join("; ")
        )))
    }

    /// Rigs of few sensors: [`Self::cheapest`] first, then with one more on a mount where pairs leave no room for an odd one,
    /// and with one on each mount where none must hold any.
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
        // The first stays: an error names its mounts.
        let others = few.get_mut(1..).unwrap_or_default();
        others.sort_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
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

    /// A placement that keeps every rule, its LiDARs in the order of the slots; `None` where none is found.
    ///
    /// Equal rules give equal placements. Where rules leave very little room, a placement that exists may not be found.
    pub fn placement_by_the_rules(&self) -> Option<Placement> {
        let paired = self.paired();
        let pairs = (0..paired).step_by(2).map(|slot| slot..slot + 2);
        let groups: Vec<Range<usize>> =
            pairs.chain((paired..self.lidars()).map(|slot| slot..slot + 1)).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut lists: Vec<Vec<Spot>> = Vec::with_capacity(groups.len());
        for (k, group) in groups.iter().enumerate() {
            // Slots that are alike have the same spots.
            let alike = (0..k).find(|&other| {
                self.slots[groups[other].start..groups[other].end] == self.slots[group.clone()]
            });
            lists.push(match alike {
                Some(other) => lists[other].clone(),
                None => self.spots(group, &mut rng),
            });
        }
        let at_one_height = |height: f64| -> Vec<Vec<Spot>> {
            let level = |spot: &&Spot| (spot[0].z - height).abs() <= SLACK;
            lists.iter().map(|list| list.iter().filter(level).cloned().collect()).collect()
        };
        let placement = |lists: &[Vec<Spot>]| {
            let found = self.fitting(lists)?;
            let placement = Placement { name: "by the rules".to_owned(), lidars: found.concat() };
            self.violations(&placement).is_empty().then_some(placement)
        };
        if !self.ties.equal_height {
            return placement(&lists);
        }
        let mut heights: Vec<f64> = lists.first()?.iter().map(|spot| spot[0].z).collect();
        heights.sort_by(f64::total_cmp);
        heights.dedup_by(|a, b| *a - *b <= SLACK);
        heights.into_iter().rev().find_map(|height| placement(&at_one_height(height)))
    }

    /// Spots of a group of slots, the outer ones first.
    fn spots(&self, group: &Range<usize>, rng: &mut ChaCha8Rng) -> Vec<Spot> {
        let slot = &self.slots[group.start];
        let is_in_plane = self.ties.symmetric && group.len() == 1;
        let region = &slot.region;
        let spot = |position: [f64; 3]| -> Option<Spot> {
            let mut fields = [0, 1, 2, 3, 4, 5].map(|k| match k {
                0..3 => position[k],
                _ => 0.0_f64.clamp(region.lower[k], region.upper[k]),
            });
            if is_in_plane {
                MIRRORED.iter().for_each(|&k| fields[k] = 0.0);
            }
            let pose =
                SensorPose { phase: slot.phase_at_rest(), ..region.pose(fields, slot.sensor) };
            let mut spot = vec![pose];
            if group.len() == 2 {
                let other = &self.slots[group.start + 1];
                let image = SensorPose { phase: other.phase_at_rest(), ..pose.mirrored() };
                spot.push(SensorPose { sensor: other.sensor, ..image });
            }
            let stands = |(pose, slot): (&SensorPose, usize)| {
                self.slots[slot].region.outside(pose).is_empty() && self.is_clear(pose)
            };
            let apart = |spot: &Spot| {
                spot.len() < 2 || {
                    let far = spot[0].position().distance(spot[1].position());
                    far > SLACK && far >= self.min_distance - SLACK
                }
            };
            let keeps = spot.iter().zip(group.clone()).all(stands) && apart(&spot);
            keeps.then_some(spot)
        };
        let positions = self.positions(region, rng);
        let mut spots: Vec<Spot> = positions.into_iter().filter_map(spot).collect();
        let middle =
            spots.iter().map(|spot| spot[0].position()).sum::<DVec3>() / spots.len().max(1) as f64;
        let far = |spot: &Spot| spot[0].position().distance(middle);
        spots.sort_by(|a, b| far(b).total_cmp(&far(a)));
        spots.dedup();
        if spots.len() > MOST_SPOTS {
            let rest = spots.split_off(MOST_SPOTS / 2);
            let step = rest.len().div_ceil(MOST_SPOTS / 2);
            spots.extend(rest.into_iter().step_by(step));
        }
        spots
    }

    /// Positions in a region's frame: a regular grid with both bounds, faces of keep-out boxes, corners of an outline or a
    /// surface, and positions drawn at random.
    fn positions(&self, region: &Region, rng: &mut ChaCha8Rng) -> Vec<[f64; 3]> {
        let Region { lower, upper, .. } = region;
        let regular = [0, 1, 2].map(|k| {
            let step = (upper[k] - lower[k]) / STEPS as f64;
            let values =
                (0..=STEPS).map(|i| if i == STEPS { upper[k] } else { lower[k] + step * i as f64 });
            let centre = Some(0.0).filter(|y| k == 1 && lower[k] < *y && *y < upper[k]);
            sorted(values.chain(centre))
        });
        let faces = [0, 1, 2].map(|k| {
            let faces = self.keep_out.iter().flatten().map(|corner| corner[k]);
            let inside = faces.filter(|face| lower[k] < *face && *face < upper[k]);
            sorted(inside.chain(regular[k].iter().copied()))
        });
        let is_plain = region.ego_from_region.is_none();
        let crossings: usize = faces.iter().map(Vec::len).product();
        let axes = if is_plain && crossings <= MOST_CROSSINGS { &faces } else { &regular };
        let [xs, ys, zs] = axes;
        let mut positions: Vec<[f64; 3]> = Vec::new();
        for &x in xs {
            positions.extend(ys.iter().flat_map(|&y| zs.iter().map(move |&z| [x, y, z])));
        }
        positions.extend(region.rim());
        let heights = zs.clone();
        for _ in 0..DRAWN {
            let mut at = [0, 1, 2].map(|k| lower[k] + rng.random::<f64>() * (upper[k] - lower[k]));
            if self.ties.equal_height {
                at[2] = heights[rng.random_range(0..heights.len())];
            }
            positions.push(at);
        }
        positions
    }

    /// A spot of each list that fits beside the others.
    fn fitting(&self, lists: &[Vec<Spot>]) -> Option<Vec<Spot>> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let all: Vec<Vec<usize>> = lists.iter().map(|list| (0..list.len()).collect()).collect();
        for order in 0..ORDERS {
            let mut open = all.clone();
            if order > 0 {
                open.iter_mut().for_each(|spots| spots.shuffle(&mut rng));
            }
            let mut chosen = vec![None; lists.len()];
            if self.fill(lists, open, &mut chosen, &mut 0) {
                let spots = chosen.iter().zip(lists);
                return spots
                    .map(|(spot, list)| spot.map(|spot: usize| list[spot].clone()))
                    .collect();
            }
        }
        None
    }

    /// Chooses a spot for each group without one, the group with the fewest open spots first; steps back where a group
    /// has none left. False once that took too many tries.
    fn fill(
        &self,
        lists: &[Vec<Spot>],
        mut open: Vec<Vec<usize>>,
        chosen: &mut Vec<Option<usize>>,
        tries: &mut usize,
    ) -> bool {
        let without = (0..lists.len()).filter(|&group| chosen[group].is_none());
        let Some(group) = without.min_by_key(|&group| open[group].len()) else { return true };
        for spot in std::mem::take(&mut open[group]) {
            *tries += 1;
            if *tries > TRIES {
                return false;
            }
            let taken = &lists[group][spot];
            chosen[group] = Some(spot);
            let mut left = open.clone();
            for other in (0..lists.len()).filter(|&other| chosen[other].is_none()) {
                // Two LiDARs in one point are allowed where nothing else is left.
                let least = (self.min_distance - SLACK).max(SLACK);
                left[other].retain(|&spot| is_apart(&lists[other][spot], taken, least));
                if left[other].is_empty() && self.min_distance <= SLACK {
                    left[other].clone_from(&open[other]);
                }
            }
            let is_open = |other: usize| chosen[other].is_some() || !left[other].is_empty();
            if (0..lists.len()).all(is_open) && self.fill(lists, left, chosen, tries) {
                return true;
            }
            chosen[group] = None;
        }
        false
    }
}

/// Steps along each field of a position.
const STEPS: usize = 6;
/// Most positions that the faces of keep-out boxes give; beyond it they are left out.
const MOST_CROSSINGS: usize = 20_000;
/// Positions drawn at random beside the regular ones.
const DRAWN: usize = 300;
/// Most spots of a LiDAR: the outer half, and others spread evenly.
const MOST_SPOTS: usize = 600;
/// Orders in which the spots are tried, and spots tried in each.
const ORDERS: u64 = 12;
const TRIES: usize = 400;

/// Poses of a LiDAR, or of a mirrored pair, that keep the rules by themselves.
type Spot = Vec<SensorPose>;

/// True if all LiDARs of two spots are at least `least` metres apart.
fn is_apart(a: &Spot, b: &Spot, least: f64) -> bool {
    a.iter().all(|a| b.iter().all(|b| a.position().distance(b.position()) >= least))
}

/// Values in rising order, each once.
fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
