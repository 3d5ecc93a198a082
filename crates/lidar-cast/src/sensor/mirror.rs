//! Mirror images at the plane y = 0: of poses, of placements, of a sensor's beams.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::{BeamGrid, BeamTable, Placement, SensorPose};

impl SensorPose {
    /// Mirrored at the plane y = 0: y, roll, yaw and phase change sign.
    pub fn mirrored(&self) -> Self {
        // 0 − y is never −0, which would print as such.
        let phase = self.phase.map(|phase| 0.0 - phase);
        Self { y: 0.0 - self.y, roll: 0.0 - self.roll, yaw: 0.0 - self.yaw, phase, ..*self }
    }

    /// Sum of the differences of the six numbers, in m and rad, angles up to half a turn; infinite between sensors
    /// of different models. Phases do not count: mirror images are those of sensors as they are mounted.
    pub fn difference(&self, other: &Self) -> f64 {
        if self.sensor != other.sensor {
            return f64::INFINITY;
        }
        let differences = self.values().into_iter().zip(other.values()).map(|(a, b)| (a - b).abs());
        let whole = |(k, by): (usize, f64)| match k {
            // Straight back is half a turn to the left as well as to the right.
            3.. if by > 0.5 * TAU => (by - TAU * (by / TAU).round()).abs(),
            _ => by,
        };
        differences.enumerate().map(whole).sum()
    }
}

impl Placement {
    /// Mirrored at the plane y = 0, LiDAR by LiDAR.
    pub fn mirrored(&self) -> Self {
        let lidars = self.lidars.iter().map(SensorPose::mirrored).collect();
        Self { name: self.name.clone(), lidars }
    }
}

impl BeamTable {
    /// The sensor as a mirror in its xz plane shows it: y of each direction changes sign. Beams on a grid
    /// come by rising azimuth again.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let flipped = |&[x, y, z]: &[f32; 3]| [x, 0.0 - y, z];
        let Some(grid) = self.grid() else {
            return Self {
                directions: self.directions.iter().map(flipped).collect(),
                ..self.clone()
            };
        };
        // Step j is mirrored to −(start + j · step): on a whole turn the step n − j after −start, otherwise
        // the step n − 1 − j after the last one's mirror image.
        let steps = grid.steps;
        let back = if grid.turn { steps } else { steps - 1 };
        let turned = if grid.turn { 0.0 } else { back as f64 * grid.step };
        let row = |row: &[[f32; 3]]| -> Vec<[f32; 3]> {
            (0..steps).map(|j| flipped(&row[(back - j) % steps])).collect()
        };
        let channels = grid.channels.iter().map(|&(elevation, offset)| (elevation, 0.0 - offset));
        let mirrored = BeamGrid {
            channels: channels.collect(),
            start: 0.0 - (grid.start + turned),
            ..grid.clone()
        };
        Self {
            directions: self.directions.chunks(steps).flat_map(row).collect(),
            grid: Some(Arc::new(mirrored)),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions that the grid of a table says, in `f64`.
    fn by_grid(table: &BeamTable) -> Vec<[f64; 3]> {
        let grid = table.grid().unwrap();
        let direction = |&(e, offset): &(f64, f64), j: usize| {
            let a = grid.start + grid.step * j as f64 + offset;
            [e.cos() * a.cos(), e.cos() * a.sin(), e.sin()]
        };
        let rows = grid.channels.iter();
        rows.flat_map(|channel| (0..grid.steps).map(move |j| direction(channel, j))).collect()
    }

    #[test]
    fn mirrored_beams_lie_on_their_grid_and_are_the_flipped_ones() {
        let channels = [(-20.0, 3.0), (0.0, -1.0), (15.0, 0.0)];
        for table in [
            BeamTable::spinning(&channels, 7, 50.0).unwrap(),
            BeamTable::sector(&channels, [-50.0, 4.0], 9, 50.0).unwrap(),
        ] {
            let image = table.mirrored();
            for (got, want) in image.directions().iter().zip(by_grid(&image)) {
                let off = (0..3).map(|k| (f64::from(got[k]) - want[k]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-6, "{got:?} is not {want:?}");
            }
            let bits = |[x, y, z]: [f32; 3]| [x, y + 0.0, z].map(f32::to_bits);
            let sorted = |directions: Vec<[u32; 3]>| {
                let mut directions = directions;
                directions.sort_unstable();
                directions
            };
            let flipped = table.directions().iter().map(|&[x, y, z]| bits([x, -y, z])).collect();
            let got = image.directions().iter().map(|&d| bits(d)).collect();
            assert_eq!(sorted(got), sorted(flipped));
            assert_eq!(image.range(), table.range());
            assert_eq!(image.mirrored().directions(), table.directions());
        }
        let list = BeamTable::from_directions([glam::DVec3::new(1.0, 2.0, 2.0)], 5.0).unwrap();
        let [[x, y, z]] = list.mirrored().directions()[..] else { panic!("one beam") };
        assert_eq!([[x, -y, z]], list.directions());
    }
}
