//! What all corruptions do to points: draw numbers for them, move them, relabel them, take them away.

use glam::Vec3;

use super::super::specs::Kind;
use super::super::wet::is_ground;
use crate::scan::chance::{Chance, Purpose};
use crate::scan::{NO_CLASS, NO_INSTANCE, Return, Scan, Status};

/// Numbers by chance for a corruption of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws {
    seed: u64,
    frame: u32,
}

impl Draws {
    pub fn new(seed: u64, frame: usize, kind: Kind) -> Self {
        Self { seed: seed ^ (kind as u64 + 1) << 48, frame: frame as u32 }
    }

    /// For the whole frame.
    pub fn frame(&self) -> Chance {
        Chance::new(self.seed, self.frame, u32::MAX, 0)
    }

    /// For a beam; `ordinal` tells its returns apart.
    pub fn beam(&self, scan: &Scan, beam: &Return, ordinal: u32) -> Chance {
        let columns = scan.lidars.get(usize::from(beam.lidar)).map_or(1, |lidar| lidar.columns);
        let number = u32::from(beam.channel).wrapping_mul(columns).wrapping_add(beam.column);
        Chance::new(self.seed, self.frame, u32::from(beam.lidar) | ordinal << 16, number)
    }

    /// For each return.
    pub fn returns(&self, scan: &Scan) -> Vec<Chance> {
        let place = |beam: &Return| (beam.lidar, beam.channel, beam.column);
        let (mut last, mut ordinal) = (None, 0);
        let returns = scan.returns.iter().map(|beam| {
            ordinal = if last == Some(place(beam)) { ordinal + 1 } else { 0 };
            last = Some(place(beam));
            self.beam(scan, beam, ordinal)
        });
        returns.collect()
    }

    /// Of some returns `wanted` by chance, which depends neither on their order nor on the others' numbers.
    pub fn choose(&self, scan: &Scan, among: &[usize], wanted: usize) -> Vec<usize> {
        let chances = self.returns(scan);
        let mut ranked: Vec<(f64, usize)> =
            among.iter().map(|&k| (chances[k].draw(Purpose::Corruption, 0), k)).collect();
        ranked.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        ranked.into_iter().take(wanted).map(|(_, k)| k).collect()
    }
}

/// Numbers of the returns that are points.
pub(super) fn points(scan: &Scan) -> Vec<usize> {
    let points = scan.returns.iter().enumerate().filter(|(_, beam)| beam.status.is_point());
    points.map(|(k, _)| k).collect()
}

/// Where the LiDARs stand at the scan's time, in the ego frame.
pub(super) fn origins(scan: &Scan) -> Vec<Vec3> {
    scan.lidars.iter().map(|lidar| lidar.ego_from_sensor.translation.as_vec3()).collect()
}

/// Of each class, whether water stands on it.
pub(super) fn ground_classes(scan: &Scan) -> Vec<bool> {
    scan.classes.iter().map(|class| is_ground(class)).collect()
}

impl Return {
    /// Whether it is a point on one of some classes, hit at an angle.
    pub(super) fn is_point_on(&self, classes: &[bool]) -> bool {
        let is_on = classes.get(usize::from(self.class)).is_some_and(|&is_on| is_on);
        is_on && self.status.is_point() && self.incidence > 0.0
    }

    /// Counts the point as none of a surface.
    pub(super) fn detach(&mut self, status: Status) {
        self.status = status;
        (self.class, self.instance, self.incidence) = (NO_CLASS, NO_INSTANCE, 0.0);
    }

    /// Takes the point away.
    pub(super) fn remove(&mut self, status: Status) {
        self.detach(status);
        (self.position, self.raw) = ([f32::NAN; 3], [f32::NAN; 3]);
        (self.range, self.intensity) = (f32::NAN, 0.0);
    }

    /// Moves the point along the line from `origin` through it.
    pub(super) fn move_to(&mut self, range: f64, origin: Vec3) {
        let share = (range / f64::from(self.range)) as f32;
        for point in [&mut self.position, &mut self.raw] {
            *point = (origin + (Vec3::from(*point) - origin) * share).to_array();
        }
        self.range = range as f32;
    }

    /// Shifts the point off its beam.
    pub(super) fn shift(&mut self, by: Vec3, origin: Vec3) {
        for point in [&mut self.position, &mut self.raw] {
            *point = (Vec3::from(*point) + by).to_array();
        }
        self.range = (Vec3::from(self.raw) - origin).length();
    }
}
