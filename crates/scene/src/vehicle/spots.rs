//! One placement that keeps every rule: tried out among the corners, edges and inner points of the mounts.

use std::ops::Range;

use glam::DVec3;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::pairing::{MIRRORED, SLACK};
use super::{Constraints, Placement, Region, SensorPose};

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

impl Constraints {
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
