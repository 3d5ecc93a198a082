//! Numbered sensor poses on a grid in the mount.

use std::collections::BTreeSet;
use std::ops::Range;

use super::pairing::{MIRRORED, pairs};
use super::{Constraints, Placement, Region, SensorName, SensorPose, Slot, Ties};

/// Grid values are rounded to multiples of 1/`DECIMALS`: 0.1 · 3 becomes 0.3.
const DECIMALS: f64 = 1e12;
/// Phases of a sensor whose phase is to be chosen: quarters of the range from its lower end on. The upper end is
/// left out, since a range of one azimuth step ends where it begins.
const PHASES: u32 = 4;
/// Fewest poses of one kind of slot in [`PoseGrid::spread`], where it has as many.
const FEWEST_OF_KIND: u64 = 100;
/// Newton's steps to the root of a recurrence: more than enough from 2.
const ROOT_STEPS: usize = 32;
/// Points of a recurrence for each pose that is wanted, at most.
const MOST_DRAWN: u64 = 4;
const MAX_POSES: u64 = 1 << 31;

/// Spacing of a grid of sensor poses: δ of Algorithm 1 of Place3D.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spacing {
    /// Along x, y and z, in metres.
    pub metres: f64,
    /// Step of roll, pitch and yaw, in radians.
    pub radians: f64,
}

/// All sensor poses on a grid of density δ within the regions of a mount.
///
/// Along each pose field the grid starts at the lower bound and ends at the last step within the upper
/// one. For mirrored pairs, y, roll and yaw run from −kδ to kδ instead: the mirror image of a pose is on
/// the grid. A phase that is to be chosen takes four values of its range. Poses are numbered from 0, one
/// kind of slot after the other, with the phase fastest, then yaw, and x slowest.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseGrid {
    parts: Vec<SlotGrid>,
    /// Part of each LiDAR of a placement.
    part_of_lidar: Vec<usize>,
    /// Number of LiDARs of each part.
    lidars_by_kind: Vec<usize>,
    /// LiDARs in mirrored pairs; these come first.
    paired: usize,
}

/// The poses of one kind of slot.
#[derive(Debug, Clone, PartialEq)]
struct SlotGrid {
    slot: Slot,
    /// Number of its first pose.
    first: u32,
    /// Number of the part that is its mirror image; its own where there is none.
    image: usize,
    lower: [f64; 7],
    step: [f64; 7],
    /// One for each field, and for the phase.
    count: [u32; 7],
}

/// Why a spacing makes no grid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum PoseGridError {
    /// A spacing that is not positive and finite.
    #[error("a grid spacing of {value} {unit} is not usable; give a positive number")]
    BadSpacing { value: f64, unit: &'static str },
    #[error("the grid has {poses} sensor poses, at most {MAX_POSES} are possible; widen --delta")]
    TooManyPoses { poses: u128 },
}

impl PoseGrid {
    /// Grid of a mount.
    ///
    /// # Errors
    /// A spacing that is not positive, or too many poses.
    pub fn new(constraints: &Constraints, spacing: Spacing) -> Result<Self, PoseGridError> {
        Self::of(constraints, spacing, false)
    }

    /// Grid of a mount with both ends of every pose field: its steps are a little wider than the spacing, and of a shorter
    /// field as long as the field.
    pub fn with_both_ends(
        constraints: &Constraints,
        spacing: Spacing,
    ) -> Result<Self, PoseGridError> {
        Self::of(constraints, spacing, true)
    }

    fn of(
        constraints: &Constraints,
        spacing: Spacing,
        both_ends: bool,
    ) -> Result<Self, PoseGridError> {
        for (value, unit) in [(spacing.metres, "m"), (spacing.radians, "rad")] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(PoseGridError::BadSpacing { value, unit });
            }
        }
        let (mut parts, mut poses): (Vec<SlotGrid>, u128) = (Vec::new(), 0);
        for (slot, _) in constraints.kinds() {
            let image = match constraints.ties.symmetric {
                true if slot.is_image_of(slot) => GridImage::Itself,
                true => {
                    let other = parts.iter().position(|part| slot.is_image_of(&part.slot));
                    other.map_or(GridImage::None, GridImage::Of)
                }
                false => GridImage::None,
            };
            let (mut part, count) = SlotGrid::new(slot, poses as u32, (spacing, both_ends), image);
            poses = poses.saturating_add(count);
            if poses > u128::from(MAX_POSES) {
                return Err(PoseGridError::TooManyPoses { poses });
            }
            let own = parts.len();
            part.image = own;
            if let GridImage::Of(other) = image {
                (part.image, parts[other].image) = (other, own);
            }
            parts.push(part);
        }
        // Neighbours are mostly of one kind: the part of the LiDAR before is looked at first.
        let mut part_of_lidar: Vec<usize> = Vec::with_capacity(constraints.slots.len());
        let mut lidars_by_kind = vec![0; parts.len()];
        for slot in &constraints.slots {
            let last = part_of_lidar.last().copied().filter(|&last| parts[last].slot == *slot);
            let part = last.or_else(|| parts.iter().position(|part| part.slot == *slot));
            if let Some(part) = part {
                part_of_lidar.push(part);
                lidars_by_kind[part] += 1;
            }
        }
        Ok(Self { parts, part_of_lidar, lidars_by_kind, paired: constraints.paired() })
    }

    /// Number of poses.
    pub fn len(&self) -> u32 {
        self.parts.last().map_or(0, |part| part.first + part.len())
    }

    /// True if there is no pose at all: no LiDAR has a place.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Numbers of the poses that a LiDAR may take.
    pub fn poses_of_lidar(&self, lidar: usize) -> Range<u32> {
        let part = &self.parts[self.part_of_lidar[lidar]];
        part.first..part.first + part.len()
    }

    /// About `most` poses, or all where there are no more, rising: of each kind of slot a share by its number of poses,
    /// a hundred at least, spread evenly over every pose field.
    pub fn spread(&self, most: u64) -> Vec<u32> {
        let all = u64::from(self.len());
        let count_of = |part: &SlotGrid| {
            let own = u64::from(part.len());
            if all <= most { own } else { (own * most / all).max(FEWEST_OF_KIND).min(own) }
        };
        self.parts.iter().flat_map(|part| part.spread(count_of(part))).collect()
    }

    /// Kind of slot that a pose belongs to, from 0.
    pub fn kind(&self, number: u32) -> usize {
        self.parts.partition_point(|part| part.first <= number) - 1
    }

    /// LiDARs of each kind of slot.
    pub fn lidars_by_kind(&self) -> &[usize] {
        &self.lidars_by_kind
    }

    /// Distance of neighbours along each pose field, in m and rad.
    pub fn step(&self) -> [f64; 6] {
        self.parts.first().map_or([0.0; 6], |part| [0, 1, 2, 3, 4, 5].map(|k| part.step[k]))
    }

    /// Pose of a number below [`Self::len`].
    pub fn pose(&self, number: u32) -> SensorPose {
        self.part(number).pose(number)
    }

    /// Number of the pose nearest to one of another grid of the same mount, within the same kind of slot.
    pub fn same_as(&self, other: &Self, number: u32) -> u32 {
        self.parts[other.kind(number)].nearest(&other.pose(number))
    }

    /// Number of the pose nearest to `pose` along each field, among the poses of one LiDAR.
    pub fn nearest(&self, lidar: usize, pose: &SensorPose) -> u32 {
        self.parts[self.part_of_lidar[lidar]].nearest(pose)
    }

    /// Number of the pose of a sensor model nearest to `pose`, along each field in the region whose pose is least far
    /// away; `None` where no region may hold the model.
    pub fn nearest_of(&self, model: SensorName, pose: &SensorPose) -> Option<u32> {
        let far = |number: u32| {
            let other = self.pose(number);
            (other.x - pose.x).powi(2) + (other.y - pose.y).powi(2) + (other.z - pose.z).powi(2)
        };
        let parts = self.parts.iter().filter(|part| part.slot.sensor == model);
        parts.map(|part| part.nearest(pose)).min_by(|&a, &b| far(a).total_cmp(&far(b)))
    }

    /// Number of the mirror image of a pose, on a grid for mirrored pairs.
    pub fn mirrored(&self, number: u32) -> u32 {
        let part = self.part(number);
        let mut steps = part.steps_of(number);
        let image = &self.parts[part.image];
        MIRRORED.iter().for_each(|&k| steps[k] = part.count[k] - 1 - steps[k]);
        image.number_of(steps)
    }

    /// Number of a pose moved to the height of another.
    pub fn at_height_of(&self, number: u32, other: u32) -> u32 {
        let part = self.part(number);
        let mut steps = part.steps_of(number);
        steps[2] = self.part(other).steps_of(other)[2].min(part.count[2] - 1);
        part.number_of(steps)
    }

    /// Numbers of the poses nearest to a placement's, whose LiDARs are in the order of the slots; for
    /// mirrored pairs, the nearest of the LiDAR of larger y, or of the first of two slots, and its mirror image.
    pub fn numbers_of(&self, placement: &Placement, ties: Ties) -> Vec<u32> {
        let lidars = &placement.lidars;
        if !ties.symmetric || self.parts.len() > 1 {
            let own = |lidar: usize| self.nearest(lidar, &lidars[lidar]);
            let number = |lidar: usize| match ties.symmetric && lidar < self.paired {
                true if lidar % 2 == 1 => self.mirrored(own(lidar - 1)),
                _ => own(lidar),
            };
            return (0..lidars.len().min(self.part_of_lidar.len())).map(number).collect();
        }
        let pairs = pairs(lidars);
        let single = pairs.in_plane.iter().chain(&pairs.alone);
        let single = single.map(|&lidar| self.nearest(0, &lidars[lidar]));
        let both = pairs.mirrored.iter().flat_map(|&[left, _]| {
            let left = self.nearest(0, &lidars[left]);
            [left, self.mirrored(left)]
        });
        both.chain(single).collect()
    }

    /// Placement with every LiDAR moved to its pose of [`Self::numbers_of`].
    pub fn snapped(&self, placement: &Placement, ties: Ties) -> Placement {
        let numbers = self.numbers_of(placement, ties);
        let lidars = numbers.into_iter().map(|number| self.pose(number)).collect();
        Placement { name: placement.name.clone(), lidars }
    }

    /// Poses at most `radius` steps from `number` along one field and equal in the others, rising.
    pub fn along(&self, number: u32, radius: u32) -> Vec<u32> {
        self.part(number).along(number, radius)
    }

    fn part(&self, number: u32) -> &SlotGrid {
        &self.parts[self.kind(number)]
    }
}

/// Where the mirror images of a part's poses are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum GridImage {
    /// No mirror images are needed.
    None,
    /// Mirror images are among its own poses.
    Itself,
    /// Mirror images are among the poses of an earlier part.
    Of(usize),
}

impl SlotGrid {
    /// The grid of a slot, its first pose numbered `first`, and its number of poses.
    fn new(
        slot: &Slot,
        first: u32,
        (spacing, both_ends): (Spacing, bool),
        image: GridImage,
    ) -> (Self, u128) {
        let Spacing { metres, radians } = spacing;
        let [from, to] = slot.phase.unwrap_or_default();
        let phase = (to - from) / f64::from(PHASES);
        let mut step = [metres, metres, metres, radians, radians, radians, phase];
        let whole = |extent: f64, step: f64| {
            // Bounds are decimal: 1.2 m is 12 steps of 0.1 m, though 1.2 / 0.1 = 11.999… in `f64`.
            let steps = extent / step;
            if (steps - steps.round()).abs() < 1e-9 { steps.round() } else { steps.floor() }
        };
        let centred = |k: usize| image == GridImage::Itself && MIRRORED.contains(&k);
        // From the bound that is the image of the lower one.
        let down = |k: usize| matches!(image, GridImage::Of(_)) && MIRRORED.contains(&k);
        let Region { lower, upper, .. } = &*slot.region;
        let extent = |k: usize| if centred(k) { upper[k] } else { upper[k] - lower[k] };
        for k in (0..6).filter(|&k| both_ends && extent(k) > 0.0) {
            step[k] = extent(k) / whole(extent(k), step[k]).max(1.0);
        }
        let steps = |k: usize| whole(extent(k), step[k]) * if centred(k) { 2.0 } else { 1.0 };
        let phases = if slot.phase.is_some() { PHASES } else { 1 };
        let poses = (0..6).fold(u128::from(phases), |product, k| {
            product.saturating_mul((steps(k) as u128).saturating_add(1))
        });
        let count = [0, 1, 2, 3, 4, 5, 6]
            .map(|k| if k == 6 { phases } else { (steps(k) as u32).saturating_add(1) });
        let lower = [0, 1, 2, 3, 4, 5, 6].map(|k| match k {
            6 => from,
            k if centred(k) => 0.0 - 0.5 * steps(k) * step[k],
            k if down(k) => upper[k] - steps(k) * step[k],
            k => lower[k],
        });
        (Self { slot: slot.clone(), first, image: 0, lower, step, count }, poses)
    }

    fn len(&self) -> u32 {
        self.count.iter().product()
    }

    fn pose(&self, number: u32) -> SensorPose {
        let steps = self.steps_of(number);
        let [x, y, z, roll, pitch, yaw, phase] = [0, 1, 2, 3, 4, 5, 6].map(|k| {
            let value = self.lower[k] + f64::from(steps[k]) * self.step[k];
            // + 0.0 turns −0 into 0, which prints without a sign.
            if self.count[k] == 1 { value } else { (value * DECIMALS).round() / DECIMALS + 0.0 }
        });
        let pose = self.slot.region.pose([x, y, z, roll, pitch, yaw], self.slot.sensor);
        SensorPose { phase: self.slot.phase.map(|_| phase), ..pose }
    }

    fn nearest(&self, pose: &SensorPose) -> u32 {
        let fields = self.slot.region.fields(pose);
        let phase = pose.phase.or(self.slot.phase_at_rest()).unwrap_or(0.0);
        self.number_of([0, 1, 2, 3, 4, 5, 6].map(|k| {
            if self.count[k] == 1 {
                return 0;
            }
            let value = if k == 6 { phase } else { fields[k] };
            let steps = ((value - self.lower[k]) / self.step[k]).round();
            steps.clamp(0.0, f64::from(self.count[k] - 1)) as u32
        }))
    }

    fn along(&self, number: u32, radius: u32) -> Vec<u32> {
        let centre = self.steps_of(number);
        let mut found = Vec::new();
        for k in 0..7 {
            let low = centre[k].saturating_sub(radius);
            let high = (centre[k] + radius).min(self.count[k] - 1);
            found.extend((low..=high).map(|s| {
                let mut steps = centre;
                steps[k] = s;
                self.number_of(steps)
            }));
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// `count` of its poses, or a few less, rising, that fill each field, and each pair of fields, evenly.
    ///
    /// They are points of an additive recurrence with the powers of the root of xᵈ⁺¹ = x + 1 for d fields (Roberts
    /// 2018).
    fn spread(&self, count: u64) -> Vec<u32> {
        if count >= u64::from(self.len()) {
            return (self.first..self.first + self.len()).collect();
        }
        let fields: Vec<usize> = (0..7).filter(|&k| self.count[k] > 1).collect();
        let degree = fields.len() as i32 + 1;
        // Newton's steps from above the root of a convex function.
        let step = |x: f64, _| {
            let power = x.powi(degree - 1);
            x - (power * x - x - 1.0) / (f64::from(degree) * power - 1.0)
        };
        let root = (0..ROOT_STEPS).fold(2.0_f64, step);
        let pose_of = |index: u64| {
            let mut steps = [0; 7];
            let mut at = index as f64;
            for &k in &fields {
                at /= root;
                steps[k] = ((0.5 + at).fract() * f64::from(self.count[k])) as u32;
            }
            self.number_of(steps)
        };
        // Some points fall on one pose: a few more than are wanted are drawn.
        let mut poses = BTreeSet::new();
        let mut drawn = (1..=MOST_DRAWN * count).map(pose_of);
        while (poses.len() as u64) < count {
            let Some(pose) = drawn.next() else { break };
            poses.insert(pose);
        }
        poses.into_iter().collect()
    }

    fn steps_of(&self, number: u32) -> [u32; 7] {
        let mut rest = number - self.first;
        let mut steps = [0; 7];
        for k in (0..7).rev() {
            steps[k] = rest % self.count[k];
            rest /= self.count[k];
        }
        steps
    }

    fn number_of(&self, steps: [u32; 7]) -> u32 {
        let within = steps.iter().zip(self.count);
        self.first + within.fold(0, |number, (step, count)| number * count + step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constraints() -> Constraints {
        let (lower, upper) = ([-0.6, -0.6, 2.2, -0.3, 0.0, 0.0], [0.6, 0.6, 2.8, 0.3, 0.0, 0.0]);
        Constraints { min_distance: 0.2, ..Constraints::in_box(lower, upper, 4) }
    }

    #[test]
    fn table_7_lies_on_the_grid_of_the_paper() {
        let grid = PoseGrid::new(&constraints(), Spacing { metres: 0.1, radians: 0.1 }).unwrap();
        assert_eq!(grid.len(), 13 * 13 * 7 * 7);
        let pose = SensorPose { roll: 0.1, ..SensorPose::at(-0.4, 0.3, 2.7) };
        assert_eq!(grid.pose(grid.nearest(0, &pose)), pose, "to the bit");
        for number in (0..grid.len()).step_by(97) {
            assert_eq!(grid.nearest(0, &grid.pose(number)), number);
        }
        let corner = grid.along(0, 1);
        assert_eq!(corner.len(), 5, "itself, and one step along each of four free fields");
        assert!(corner.is_sorted() && corner[0] == 0);
        let number = grid.nearest(0, &pose);
        // Two steps down and one up along z, four ways along the other free fields, and itself.
        assert_eq!(grid.along(number, 2).len(), 4 + 4 + 3 + 4 + 1);
    }

    #[test]
    fn some_poses_are_spread_over_every_field() {
        let grid = PoseGrid::new(&constraints(), Spacing { metres: 0.1, radians: 0.1 }).unwrap();
        assert!(grid.spread(8281).into_iter().eq(0..8281), "all where there are no more");
        let some = grid.spread(810);
        assert_eq!(some.len(), 810);
        assert!(some.is_sorted() && some.windows(2).all(|two| two[0] < two[1]));
        let value = |number: u32| {
            let SensorPose { x, y, z, roll, .. } = grid.pose(number);
            [x, y, z, roll].map(|value| (value * 10.0).round() as i64)
        };
        for (field, levels) in [13, 13, 7, 7].into_iter().enumerate() {
            let mut poses_at = std::collections::BTreeMap::new();
            some.iter().for_each(|&pose| *poses_at.entry(value(pose)[field]).or_insert(0) += 1);
            assert_eq!(poses_at.len(), levels, "every value of field {field} occurs");
            let (least, most) =
                (poses_at.values().min().unwrap(), poses_at.values().max().unwrap());
            assert!(10 * most <= 13 * least, "field {field}: {least} to {most} poses a value");
        }
        let pairs: BTreeSet<_> =
            some.iter().map(|&pose| [value(pose)[2], value(pose)[3]]).collect();
        assert_eq!(pairs.len(), 7 * 7, "every height occurs with every roll");
    }

    #[test]
    fn a_spacing_that_makes_no_grid_is_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let spacing = Spacing { metres: 0.1, radians: bad };
            assert_holds!(PoseGrid::new(&constraints(), spacing).unwrap_err(), "rad");
        }
        for (metres, radians) in [(1e-4, 1e-3), (1e-40, 1e-40), (2.3e-308, 2.3e-308)] {
            let error = PoseGrid::new(&constraints(), Spacing { metres, radians }).unwrap_err();
            assert!(matches!(error, PoseGridError::TooManyPoses { .. }));
        }
        let wide = Spacing { metres: 9.0, radians: 9.0 };
        assert_eq!(PoseGrid::new(&constraints(), wide).unwrap().len(), 1, "the lower corner");
    }

    #[test]
    fn a_grid_with_both_ends_has_them_whatever_the_spacing() {
        let Region { lower, upper, .. } = &*constraints().slots[0].region;
        for (spacing, poses) in [(9.0, 2 * 2 * 2 * 2), (0.4, 4 * 4 * 2 * 2), (0.1, 13 * 13 * 7 * 7)]
        {
            let spacing = Spacing { metres: spacing, radians: spacing };
            let grid = PoseGrid::with_both_ends(&constraints(), spacing).unwrap();
            assert_eq!(grid.len(), poses, "{spacing:?}");
            let ends = [grid.pose(0), grid.pose(poses - 1)].map(|pose| pose.values());
            assert_eq!(ends, [*lower, *upper]);
        }
        // In pairs: the plane of symmetry, and both sides of it.
        let mut tied = constraints();
        tied.ties.symmetric = true;
        let grid = PoseGrid::with_both_ends(&tied, Spacing { metres: 9.0, radians: 9.0 }).unwrap();
        assert_eq!(grid.len(), 2 * 3 * 2 * 3);
        let image = grid.pose(grid.mirrored(0));
        assert_eq!([image.y, image.roll, image.x], [0.6, 0.3, -0.6]);
    }
}
