//! Mirrored pairs at the plane y = 0, over several mounts: images among regions, and LiDARs in the order of pairs.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::{Constraints, Outline, Region, SensorPose, Slot, Violation};
use lidar_cast::geom::Pose;

/// Metres and radians that two images may be apart: corners of patches are written in decimals.
const SAME: f64 = 1e-9;

fn close<const N: usize>(a: [f64; N], b: [f64; N]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME)
}

impl Region {
    /// The region in a mirror at the plane y = 0: poses in it are the mirrored ones. A curved surface stays as it
    /// is.
    pub(super) fn mirrored(&self) -> Self {
        let mut image = self.clone();
        for k in MIRRORED {
            (image.lower[k], image.upper[k]) = (0.0 - self.upper[k], 0.0 - self.lower[k]);
        }
        let flip = glam::DMat3::from_diagonal(glam::DVec3::new(1.0, -1.0, 1.0));
        image.ego_from_region = self.ego_from_region.map(|frame| Pose {
            rotation: flip * frame.rotation * flip,
            translation: flip * frame.translation,
        });
        let Outline { axes, corners } = &mut image.outline;
        for side in (0..2).filter(|&side| axes[side] == 1) {
            corners.iter_mut().for_each(|corner| corner[side] = 0.0 - corner[side]);
        }
        image
    }

    /// True if a mirror at the plane y = 0 shows one region as the other.
    pub(super) fn is_image_of(&self, other: &Self) -> bool {
        let alike = match (&self.surface, &other.surface) {
            (None, None) => true,
            (Some(own), Some(other)) => own.is_image_of(other),
            _ => false,
        };
        if !alike || self.rides_on != other.rides_on {
            return false;
        }
        let image = other.mirrored();
        let frame = |region: &Self| {
            let frame = region.ego_from_region.unwrap_or(Pose::IDENTITY);
            (frame.rotation.to_cols_array(), frame.translation.to_array())
        };
        let (a, b) = (frame(self), frame(&image));
        let outlines = [&self.outline.corners, &image.outline.corners];
        let has = |corner: &[f64; 2]| outlines[1].iter().any(|other| close(*corner, *other));
        close(a.0, b.0)
            && close(a.1, b.1)
            && close(self.lower, image.lower)
            && close(self.upper, image.upper)
            && outlines[0].len() == outlines[1].len()
            && outlines[0].iter().all(has)
    }

    /// A box whose sensors face straight back, in a frame that is turned half around: there its yaw, too, runs from -a
    /// to a, and poses can be mirrored. The range is cut to the part that is its own mirror image, a half turn where there is
    /// none, as of a fixed yaw of 3.14. `None` for any other region.
    pub(super) fn turned_back(&self) -> Option<Self> {
        let [from, to] = [self.lower[5], self.upper[5]];
        let off = (0.5 * (from + to)).abs() - PI;
        let half = (0.5 * (to - from) - off.abs()).max(0.0);
        if self.ego_from_region.is_some() || 2.0 * off.abs() > OFF_BACK {
            return None;
        }
        let mut turned = self.clone();
        for k in [0, 1] {
            (turned.lower[k], turned.upper[k]) = (0.0 - self.upper[k], 0.0 - self.lower[k]);
        }
        (turned.lower[5], turned.upper[5]) = (0.0 - half, half);
        let rotation = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
        turned.ego_from_region = Some(Pose { rotation, translation: DVec3::ZERO });
        Some(turned)
    }
}

/// Most radians by which a range of yaw about straight back may be off its own mirror image: a half turn is written in
/// decimals.
const OFF_BACK: f64 = 0.02;

impl Slot {
    /// True if a mirror at the plane y = 0 shows one slot as the other.
    pub(super) fn is_image_of(&self, other: &Self) -> bool {
        self.sensor == other.sensor && self.region.is_image_of(&other.region)
    }

    /// Slots in pairs, one behind the other, then those that are their own image and have none left beside them;
    /// the rest, if any, is behind these.
    pub(super) fn in_pairs(slots: Vec<Self>) -> Vec<Self> {
        let (mut open, mut paired, mut in_plane, mut alone) = (slots, vec![], vec![], vec![]);
        while !open.is_empty() {
            let first = open.remove(0);
            match open.iter().position(|other| other.is_image_of(&first)) {
                Some(at) => paired.extend([first, open.remove(at)]),
                None if first.is_image_of(&first) => in_plane.push(first),
                None => alone.push(first),
            }
        }
        [paired, in_plane, alone].concat()
    }
}

impl Constraints {
    /// Number of LiDARs in mirrored pairs; these come first.
    pub(super) fn paired(&self) -> usize {
        if !self.ties.symmetric {
            return 0;
        }
        let two = |two: &&[Slot]| two[1].is_image_of(&two[0]);
        2 * self.slots.chunks_exact(2).take_while(two).count()
    }

    /// Index of the LiDAR that is the mirror image of another one, where the rules want pairs; `None` where there is none.
    pub fn mirror_image_of(&self, lidar: usize, lidars: &[SensorPose]) -> Option<usize> {
        let pairs = if self.ties.symmetric { pairs(lidars).mirrored } else { Vec::new() };
        pairs.into_iter().find_map(|[a, b]| (lidar == a).then_some(b).or((lidar == b).then_some(a)))
    }

    /// True if a LiDAR of a pair stands in the same slot as its image.
    pub(super) fn is_pair_of_one(&self, first: usize) -> bool {
        self.slots[first] == self.slots[first + 1]
    }

    /// LiDARs in the order of the slots, the two of a pair side by side where the rules want pairs; `None` where
    /// a slot has none, or a pair is none.
    pub fn ordered(&self, lidars: &[SensorPose]) -> Option<Vec<SensorPose>> {
        let lidars = match self.kinds().len() {
            1 => lidars.to_vec(),
            _ => self.in_slots(lidars)?,
        };
        if !self.ties.symmetric {
            return Some(lidars);
        }
        let alike = self.kinds().len() == 1;
        let fits = |slot: usize, lidar: usize| alike || self.slots[slot] == self.slots[lidar];
        let (found, paired) = (pairs(&lidars), self.paired());
        let (mut open, mut in_plane) = (found.mirrored, found.in_plane);
        let mut order = Vec::with_capacity(lidars.len());
        for slot in (0..paired).step_by(2) {
            let fit = |&[a, b]: &[usize; 2]| fits(slot, a) && fits(slot + 1, b);
            let turned = |&[a, b]: &[usize; 2]| fit(&[b, a]);
            let at = open.iter().position(|pair| fit(pair) || turned(pair))?;
            let [a, b] = open.remove(at);
            // The first of a pair in one region has the larger y of its frame, which at a tail is to the right.
            let y = |lidar: usize| self.slots[slot].region.fields(&lidars[lidar])[1];
            let is_turned = self.is_pair_of_one(slot) && y(a) < y(b);
            order.extend(if fit(&[a, b]) && !is_turned { [a, b] } else { [b, a] });
        }
        for slot in paired..lidars.len() {
            let at = in_plane.iter().position(|&lidar| fits(slot, lidar))?;
            order.push(in_plane.remove(at));
        }
        Some(order.into_iter().map(|lidar| lidars[lidar]).collect())
    }
}

/// Largest violation of a rule that counts as rounding, in m or rad: in `f64`, 0.6 − 0.4 is not 0.2.
pub(super) const SLACK: f64 = 1e-9;
/// Radians that are no difference: angles such as π are written with a few digits.
pub(super) const ROUNDED: f64 = 1e-4;

/// Pose fields that change sign in a mirror image: y, roll and yaw.
pub(super) const MIRRORED: [usize; 3] = [1, 3, 5];

/// A point or direction mirrored at the plane y = 0.
pub(super) fn flipped(point: DVec3) -> DVec3 {
    DVec3 { y: 0.0 - point.y, ..point }
}

/// LiDARs of a placement by their position to the plane y = 0, as indices.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Pairs {
    /// Pairs of mirror images, the LiDAR of larger y first.
    pub(super) mirrored: Vec<[usize; 2]>,
    /// LiDARs in the plane, with roll and yaw 0.
    pub(super) in_plane: Vec<usize>,
    /// LiDARs outside of the plane without a mirror image.
    pub(super) alone: Vec<usize>,
}

/// LiDARs outside of the plane without a mirror image; two that are each nearest to the other's image once.
pub(super) fn not_mirrored(lidars: &[SensorPose]) -> Vec<Violation> {
    let mut found: Vec<Violation> = Vec::new();
    let alone = pairs(lidars).alone;
    for &lidar in &alone {
        let image = lidars[lidar].mirrored();
        let by = |other: usize| image.difference(&lidars[other]);
        let nearest = alone.iter().copied().min_by(|&a, &b| by(a).total_cmp(&by(b)));
        let partner = nearest.unwrap_or(lidar);
        let by = by(partner);
        // A LiDAR of another model that stands nearer to the image.
        let model = |of: usize| lidars[of].sensor;
        let place = |other: usize| image.differences(&lidars[other]).into_iter().sum::<f64>();
        let others = alone.iter().copied().filter(|&other| model(other) != model(lidar));
        let other = others.min_by(|&a, &b| place(a).total_cmp(&place(b)));
        let other = other.filter(|&other| place(other) < by);
        let models = other.map(|other| [model(lidar), model(other)]);
        let partner = other.unwrap_or(partner);
        let known = found.iter_mut().find_map(|known| match known {
            Violation::NotMirrored { lidar: a, partner: b, by, .. } => {
                ([*a, *b] == [partner, lidar]).then_some(by)
            }
            _ => None,
        });
        match known {
            Some(sum) => *sum += by,
            None => {
                let off = image.differences(&lidars[partner]);
                let largest =
                    (0..off.len()).max_by(|&a, &b| off[a].total_cmp(&off[b])).unwrap_or(0);
                let (field, off) = (SensorPose::FIELDS[largest], off[largest]);
                found.push(Violation::NotMirrored { lidar, partner, models, field, off, by });
            }
        }
    }
    found
}

/// Sorts LiDARs into pairs, LiDARs in the plane and LiDARs without a pair. Angles such as π may be written with a few digits.
pub(super) fn pairs(lidars: &[SensorPose]) -> Pairs {
    let mut pairs = Pairs::default();
    let mut open: Vec<usize> = (0..lidars.len()).collect();
    while !open.is_empty() {
        let first = open.remove(0);
        let image = lidars[first].mirrored();
        let near = |other: &SensorPose| image.difference(other) <= ROUNDED;
        if near(&lidars[first]) {
            pairs.in_plane.push(first);
        } else if let Some(at) = open.iter().position(|&other| near(&lidars[other])) {
            let second = open.remove(at);
            let left_first = lidars[first].y >= lidars[second].y;
            pairs.mirrored.push(if left_first { [first, second] } else { [second, first] });
        } else {
            pairs.alone.push(first);
        }
    }
    pairs
}

#[cfg(test)]
pub(crate) mod tests {
    use std::f64::consts::PI;
    use std::sync::Arc;

    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::{Placement, PoseGrid, SensorName, Spacing, Ties, random_placements};
    use super::*;

    /// A roof along the middle, and a door on each side whose corners are written from another one.
    fn slots() -> Vec<Slot> {
        let roof = Region {
            lower: [-0.5, -0.4, 1.5, -0.2, 0.0, -0.3],
            upper: [0.5, 0.4, 1.7, 0.2, 0.1, 0.3],
            ..Region::default()
        };
        let door = |side: f64| {
            let yaw = side * std::f64::consts::FRAC_PI_2;
            let frame = Pose::new(DVec3::new(0.7, side * 0.9, 0.8), 0.0, -0.1, yaw);
            let mut corners = vec![[-0.4 * side, 0.0], [0.5 * side, 0.0], [0.1 * side, 0.3]];
            corners.rotate_left(usize::from(side < 0.0));
            let [low, high] = if side > 0.0 { [-0.4, 0.5] } else { [-0.5, 0.4] };
            Region {
                name: format!("door {side}"),
                ego_from_region: Some(frame),
                lower: [0.0, low, 0.0, 0.0, -0.1, -0.2 * side - 0.1],
                upper: [0.1, high, 0.3, 0.0, 0.1, 0.1 - 0.2 * side],
                outline: Outline { axes: [1, 2], corners },
                ..Region::default()
            }
        };
        let slot = |region: &Region, name: &str| Slot {
            region: Arc::new(region.clone()),
            sensor: SensorName::new(name).unwrap(),
            phase: None,
            others: Vec::new(),
        };
        let [left, right] = [door(1.0), door(-1.0)];
        let [l, r] = [slot(&left, "solid"), slot(&right, "solid")];
        let top = slot(&roof, "spinning");
        vec![top.clone(), top.clone(), top, l.clone(), l, r.clone(), r]
    }

    fn rules() -> Constraints {
        let ties = Ties { equal_height: false, symmetric: true };
        Constraints { slots: Slot::in_pairs(slots()), ties, ..Constraints::default() }
    }

    #[test]
    fn a_half_turn_of_a_few_digits_is_in_the_plane() {
        let straight_back = |yaw: f64| SensorPose { yaw, ..SensorPose::at(-3.0, 0.0, 2.0) };
        let side = |y: f64, yaw: f64| SensorPose { yaw, ..SensorPose::at(0.0, y, 2.0) };
        // π and half of it with eight, four and six digits.
        let half = 0.5 * PI;
        let lidars =
            [straight_back(PI - 3.6e-9), side(1.0, half + 3.7e-6), side(-1.0, 3.3e-7 - half)];
        let wanted = Pairs { mirrored: vec![[1, 2]], in_plane: vec![0], alone: Vec::new() };
        assert_eq!(pairs(&lidars), wanted);
        assert_eq!(not_mirrored(&lidars), []);
        assert_eq!(pairs(&[straight_back(PI - 9.3e-5)]).alone, [0]);
    }

    #[test]
    fn two_models_that_stand_as_a_pair_are_named() {
        let [wide, narrow] = ["wide", "narrow"].map(|name| SensorName::new(name).unwrap());
        let at = |y: f64, sensor| SensorPose { sensor, ..SensorPose::at(0.5, y, 1.5) };
        let told = |lidars: &[SensorPose]| -> Vec<String> {
            not_mirrored(lidars).iter().map(ToString::to_string).collect()
        };
        let mixed = [at(0.3, wide), at(-0.3, narrow)];
        let words = "LiDARs 0 and 1: a mirrored pair at the plane y = 0 has one model, not `wide` and `narrow`";
        assert_eq!(told(&mixed), [words]);
        // Each is 0.6 m off its own image, the nearest of its model.
        assert!((not_mirrored(&mixed)[0].amount() - 1.2).abs() < 1e-12);
        // A partner of the model that stands nearer is told by its distance.
        let off = told(&[at(0.3, wide), at(-0.2, wide), at(-0.45, narrow)]);
        assert!(off[0].starts_with("LiDARs 0 and 1: y is off by 0.100 m"), "{off:?}");
        assert_eq!(told(&[at(0.3, wide), at(-0.3, wide)]), [""; 0]);
    }

    /// Checks that poses of drawn variables are mirrored pairs that keep all rules, or miss an outline alone, are found again
    /// in any order, and have images on a grid.
    pub(crate) fn check_pairs(rules: &Constraints, lidars: usize) {
        assert_eq!(rules.lidars(), lidars);
        let grid = PoseGrid::new(rules, Spacing { metres: 0.11, radians: 0.13 }).unwrap();
        let image = |pose: &SensorPose| pose.mirrored().ego_from_sensor();
        let far = |a: &Pose, b: &SensorPose| {
            let off = a.rotation - b.ego_from_sensor().rotation;
            let turned = off.to_cols_array().into_iter().fold(0.0, |far: f64, v| far.max(v.abs()));
            a.translation.distance(b.position()).max(turned)
        };
        let has_outline = rules.slots.iter().any(|slot| !slot.region.outline.corners.is_empty());
        for mut placement in random_placements(rules, 200, 3) {
            for pair in placement.lidars[..rules.paired()].chunks_exact(2) {
                assert!(far(&image(&pair[0]), &pair[1]) < 1e-9, "{pair:?}");
            }
            if let [odd] = placement.lidars.chunks_exact(2).remainder() {
                assert!(odd.y.abs() < 1e-12 && odd.roll.abs() < 1e-9, "{odd:?}");
            }
            let broken = rules.violations(&placement);
            let is_beside = |v: &Violation| matches!(v, Violation::OutsideMount { .. });
            assert!(broken.is_empty() || has_outline && broken.iter().all(is_beside), "{broken:?}");
            if !broken.is_empty() {
                continue;
            }
            placement.lidars.rotate_left(lidars / 2);
            let back = rules.poses_of(&rules.variables_of(&placement).expect("it keeps the ties"));
            for pose in &placement.lidars {
                let found = back.iter().any(|b| far(&b.ego_from_sensor(), pose) < 1e-9);
                assert!(found, "{pose:?} is not among {back:?}");
            }
            let ordered = rules.ordered(&placement.lidars).unwrap();
            let ordered = Placement { lidars: ordered, ..placement };
            for pair in grid.numbers_of(&ordered, rules.ties)[..rules.paired()].chunks_exact(2) {
                assert_eq!([grid.mirrored(pair[0]), grid.mirrored(pair[1])], [pair[1], pair[0]]);
                let off = far(&image(&grid.pose(pair[0])), &grid.pose(pair[1]));
                assert!(off < 1e-9, "{off} m");
            }
        }
    }

    #[test]
    fn pairs_over_several_mounts_are_kept_by_variables_and_grids() {
        let rules = rules();
        assert_eq!(rules.paired(), 6);
        // Two free fields of the roof's odd one; five of its pair; y, z, pitch, yaw and offset of a door.
        assert_eq!(rules.variable_bounds().len(), 6 + 3 + 2 * 5);
        check_pairs(&rules, 7);
    }

    #[test]
    fn a_box_that_faces_back_is_its_own_image_in_a_turned_frame() {
        let back = Region {
            lower: [-2.0, -0.5, 1.0, -0.1, 0.0, 2.6],
            upper: [-1.0, 0.5, 1.2, 0.1, 0.2, 3.7],
            ..Region::default()
        };
        assert!(!back.is_image_of(&back));
        let turned = back.turned_back().expect("within 0.02 rad of its own image");
        assert!(turned.is_image_of(&turned));
        assert_eq!(turned.corners(), back.corners());
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let draw = |k: usize| rng.random_range(turned.lower[k]..=turned.upper[k]);
            let fields: [f64; 6] = std::array::from_fn(draw);
            let pose = turned.pose(fields, SensorName::NONE);
            let yaw = pose.yaw.rem_euclid(2.0 * PI);
            assert!((2.6..=3.7).contains(&yaw), "{yaw}");
            let moved = SensorPose { yaw, ..pose };
            assert!(back.outside(&moved).is_empty(), "{moved:?}");
            assert!(turned.outside(&pose.mirrored()).is_empty(), "{pose:?}");
        }
        let ahead = Region { lower: [-0.5; 6], upper: [0.5; 6], ..Region::default() };
        let askew = Region { upper: [-1.0, 0.5, 1.2, 0.1, 0.2, 3.8], ..back };
        assert!(ahead.turned_back().is_none() && askew.turned_back().is_none());
    }

    #[test]
    fn a_region_that_is_a_little_off_is_no_image() {
        let slots = slots();
        let [roof, left, right] = [&slots[0], &slots[3], &slots[5]];
        assert!(roof.is_image_of(roof) && left.is_image_of(right) && right.is_image_of(left));
        assert!(!left.is_image_of(left) && !roof.is_image_of(left));
        let changes: [fn(&mut Region); 4] = [
            |region| region.lower[4] -= 0.01,
            |region| region.upper[5] += 0.01,
            |region| region.outline.corners[1][1] += 0.01,
            |region| region.ego_from_region.as_mut().unwrap().translation.x += 0.01,
        ];
        for change in changes {
            let mut off = right.clone();
            change(Arc::make_mut(&mut off.region));
            assert!(!off.is_image_of(left));
        }
        let other = Slot { sensor: SensorName::new("other").unwrap(), ..right.clone() };
        assert!(!other.is_image_of(left));
    }
}
