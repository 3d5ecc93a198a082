//! What each way of casting is likely to cost, and which one a batch is cast in.

use glam::Vec3;

use super::batch::{Casting, fan_of};
use super::{FAN_DIRECTIONS, PACKET_RAYS};

/// Neighbouring directions that are looked at for how wide fans are.
const SAMPLED_FANS: usize = 16;

/// What a backend's ways of casting cost: nanoseconds of a thread, of which only the ratios count.
///
/// Measured, and fitted to all of it together; see [`CPU`].
#[derive(Debug)]
pub(crate) struct Numbers {
    /// Most sensors of a packet of equal rotations, and fewest.
    rays: usize,
    pub(crate) least: usize,
    /// A beam on its own, for each time that the triangles double.
    single: f64,
    /// A beam of a mixed packet; more by its share of an area, and by the width of where beams begin.
    mixed: [f64; 3],
    /// A packet of equal rotations for each direction: for each ray, and once.
    packet: [f64; 2],
    /// The same where triangles lie along a line, by the width of a fan and that of the origins.
    line: [f64; 2],
    /// The same where they cover an area, by the width of a fan, and by both.
    area: [f64; 2],
}

/// From `cargo bench --bench paths`: 200 to 2 million triangles, 1 to 1024 sensors, 180, 720 and 1800
/// azimuth steps, near each other and not, turned a little and freely. The choice takes more than 1.1
/// times the best way's time in 40 of 1138 such batches, at most 1.64 times, and 1.01 times on average.
/// The triangles' number says little of how near they are: it is there that it errs.
pub(crate) const CPU: Numbers = Numbers {
    rays: PACKET_RAYS,
    least: 1,
    single: 25.6,
    mixed: [26.8, 19.0, 13.0],
    packet: [1.66, 205.0],
    line: [5.15, 0.93],
    area: [0.000_38, 0.003_56],
};

/// Sensors of one rotation, of a batch, or of a part of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Group {
    pub(crate) sensors: usize,
    /// Metres from corner to corner of the box around the origins.
    pub(crate) extent: f64,
}

impl Group {
    pub(crate) fn new(origins: impl Iterator<Item = Vec3>) -> Self {
        let mut group = (0, Vec3::MAX, Vec3::MIN);
        for origin in origins {
            group = (group.0 + 1, group.1.min(origin), group.2.max(origin));
        }
        let (sensors, low, high) = group;
        let extent = if sensors > 0 { f64::from(low.distance(high)) } else { 0.0 };
        Self { sensors, extent }
    }
}

/// How a batch is cast.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Choice {
    /// Sensors of each rotation that are cast in fans.
    pub(crate) in_fans: Vec<usize>,
    /// How all other beams are cast: one by one or mixed.
    pub(crate) others: Casting,
}

impl Choice {
    /// One way for all sensors of some rotations.
    pub(crate) fn of(casting: Casting, rotations: &[Group]) -> Self {
        let all = rotations.iter().map(|rotation| rotation.sensors);
        match casting {
            Casting::Fans => Self { in_fans: all.collect(), others: Casting::Mixed },
            others => Self { in_fans: vec![0; rotations.len()], others },
        }
    }
}

/// What the costs of a batch depend on.
///
/// What a packet costs grows with the triangles around it: with their number where it covers an area,
/// with its root where it is a line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Costs {
    numbers: &'static Numbers,
    triangles: f64,
    directions: f64,
    /// Length of a fan, in radians.
    width: f64,
}

impl Costs {
    /// Costs of [`CPU`].
    pub(crate) fn new(triangles: usize, directions: &[[f32; 3]]) -> Self {
        let mut widths = Vec::new();
        let step = directions.len().div_ceil(SAMPLED_FANS).max(1);
        for first in (0..directions.len()).step_by(step) {
            let end = directions.len().min(first + FAN_DIRECTIONS);
            let next: Vec<Vec3> = directions[first..end].iter().map(|&d| d.into()).collect();
            let fan = fan_of(&next);
            widths.push(f64::from(fan[0].distance(fan[fan.len() - 1])));
        }
        let width = widths.iter().sum::<f64>() / widths.len().max(1) as f64;
        let [triangles, directions] = [triangles, directions.len()].map(|n| n as f64);
        Self { numbers: &CPU, triangles, directions, width }
    }

    /// A beam that goes down the tree alone.
    fn single(&self) -> f64 {
        self.numbers.single * self.triangles.max(2.0).log2()
    }

    /// A beam in a packet of those of all sensors of a group: the more beams there are, the nearer to
    /// each other they end.
    fn mixed(&self, group: Group) -> f64 {
        let triangles = self.triangles / (group.sensors as f64 * self.directions);
        let [own, area, line] = self.numbers.mixed;
        own + area * triangles + line * group.extent * triangles.sqrt()
    }

    /// A beam in fans of the sensors of one rotation.
    fn fans(&self, group: Group) -> f64 {
        let Self { numbers, triangles, width, .. } = *self;
        let rays = group.sensors.clamp(1, numbers.rays) as f64;
        // Packets lie side by side on an area, as seen along the directions.
        let extent = group.extent * (rays / group.sensors.max(1) as f64).sqrt();
        let line = (numbers.line[0] * width + numbers.line[1] * extent) * triangles.sqrt();
        let area = (numbers.area[0] + numbers.area[1] * extent) * width * triangles;
        numbers.packet[0] + (numbers.packet[1] + line + area) / rays
    }

    /// The cheapest way to cast sensors of some rotations that altogether are `all`.
    ///
    /// The more beams are left to be mixed, the less each of them costs. So the parts of rotations that
    /// are cheapest in fans are taken out one after another, full packets and what is left of each, and
    /// the best of all these batches is the choice.
    pub(crate) fn choose(&self, rotations: &[Group], all: Group) -> Choice {
        let mut parts = Vec::new();
        for (index, rotation) in rotations.iter().enumerate() {
            let rest = rotation.sensors % self.numbers.rays;
            for sensors in [rotation.sensors - rest, rest] {
                if sensors >= self.numbers.least {
                    // Packets of a rotation lie side by side.
                    let share = sensors as f64 / rotation.sensors as f64;
                    let group = Group { sensors, extent: rotation.extent * share.sqrt() };
                    parts.push((self.fans(group), sensors, index));
                }
            }
        }
        parts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut fans, mut left) = (0.0, all.sensors);
        let (mut least, mut taken, mut others) = (f64::INFINITY, 0, Casting::Mixed);
        for part in 0..=parts.len() {
            let mixed = self.mixed(Group { sensors: left.max(1), ..all });
            let (beam, way) = if self.single() < mixed {
                (self.single(), Casting::Beams)
            } else {
                (mixed, Casting::Mixed)
            };
            let cost = fans + beam * left as f64;
            if cost < least {
                (least, taken, others) = (cost, part, way);
            }
            if let Some(&(beam, sensors, _)) = parts.get(part) {
                fans += beam * sensors as f64;
                left -= sensors;
            }
        }
        let mut in_fans = vec![0; rotations.len()];
        for &(_, sensors, index) in &parts[..taken] {
            in_fans[index] += sensors;
        }
        Choice { in_fans, others }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs(triangles: usize, steps: usize) -> Costs {
        let width = (16.0 * std::f64::consts::TAU / steps as f64).min(0.3);
        let [triangles, directions] = [triangles, 16 * steps].map(|n| n as f64);
        Costs { numbers: &CPU, triangles, directions, width }
    }

    /// How a batch is cast whose rotations have so many sensors each.
    fn choose(costs: Costs, rotations: &[usize], extent: f64) -> Choice {
        let group = |sensors| Group { sensors, extent };
        let groups: Vec<Group> = rotations.iter().map(|&sensors| group(sensors)).collect();
        costs.choose(&groups, group(rotations.iter().sum()))
    }

    fn choice(in_fans: &[usize], others: Casting) -> Choice {
        Choice { in_fans: in_fans.to_vec(), others }
    }

    #[test]
    fn many_sensors_of_a_rotation_are_cast_in_fans_and_others_are_mixed() {
        for (triangles, steps, extent) in [(200, 180, 0.1), (20_000, 720, 1.8), (200_000, 180, 1.8)]
        {
            let costs = costs(triangles, steps);
            let got = choose(costs, &[256; 4], extent);
            assert_eq!(got.in_fans, [256; 4], "{triangles} triangles");
            let got = choose(costs, &[1; 256], extent);
            assert_eq!(got, choice(&[0; 256], Casting::Mixed), "{triangles} triangles");
            let got = choose(costs, &[1, 2, 300, 4, 64], extent);
            assert_eq!(got.in_fans[..2], [0; 2], "{triangles} triangles");
            assert_eq!(got.in_fans[2..], [300, 0, 64], "{triangles} triangles");
        }
    }

    #[test]
    fn sensors_near_each_other_are_cast_in_fans_when_they_are_fewer() {
        let costs = costs(20_000, 720);
        assert_eq!(choose(costs, &[16; 16], 0.1).in_fans, [16; 16]);
        assert_eq!(choose(costs, &[16; 16], 1.8).in_fans, [0; 16]);
    }

    #[test]
    fn what_is_left_over_full_packets_is_mixed_where_it_is_little() {
        let costs = costs(20_000, 720);
        assert_eq!(choose(costs, &[130, 130, 130], 1.8).in_fans, [128; 3]);
        assert_eq!(choose(costs, &[200, 200, 200], 1.8).in_fans, [200; 3]);
    }

    #[test]
    fn few_beams_among_many_triangles_are_cast_one_by_one() {
        let many = costs(2_000_000, 180);
        assert_eq!(choose(many, &[1], 0.0), choice(&[0], Casting::Beams));
        assert_eq!(choose(many, &[1; 4], 1.8), choice(&[0; 4], Casting::Beams));
        assert_eq!(choose(many, &[1; 256], 1.8).others, Casting::Mixed);
        assert_eq!(choose(costs(2000, 180), &[1], 0.0), choice(&[0], Casting::Mixed));
    }

    #[test]
    fn nothing_and_what_is_not_finite_have_a_choice() {
        assert!(choose(costs(0, 180), &[], 0.0).in_fans.is_empty());
        let empty = Group::new(std::iter::empty());
        assert_eq!(empty, Group { sensors: 0, extent: 0.0 });
        for extent in [f64::INFINITY, f64::NAN] {
            assert!(choose(costs(0, 1), &[1, 200], extent).in_fans[1] <= 200);
        }
    }

    #[test]
    fn the_width_of_a_fan_is_that_of_its_directions() {
        let around = |steps: u32| -> Vec<[f32; 3]> {
            let angle = |j| std::f32::consts::TAU * (j as f32 + 0.5) / steps as f32;
            (0..steps).map(|j| [angle(j).cos(), angle(j).sin(), -0.1]).collect()
        };
        let width = |steps| Costs::new(0, &around(steps)).width;
        assert!((width(7200) - 15.0 * std::f64::consts::TAU / 7200.0).abs() < 1e-3);
        assert!((0.15..0.3).contains(&width(250)), "{}", width(250));
        assert_eq!(Costs::new(0, &[[1.0, 0.0, 0.0]]).width, 0.0);
        assert_eq!(Costs::new(0, &[]).width, 0.0);
    }
}
