//! Beams of a sensor model near a direction.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use crate::maths;

/// Cells of a degree: rows of elevation, columns of azimuth.
const ROWS: usize = 180;
const COLUMNS: usize = 360;
/// Radians that a cone is widened by, for directions rounded to `f32`.
pub(super) const SLACK: f64 = 1e-6;

/// Beams of a sensor model by the cell of a degree that their direction lies in.
#[derive(Debug)]
pub(super) struct BeamFinder {
    /// First beam of each cell in `beams`, and the end; `[ROWS × COLUMNS + 1]`.
    starts: Vec<u32>,
    /// Numbers of beams, cell after cell.
    beams: Vec<u32>,
}

/// Azimuth from −π to π and elevation of a direction, radians.
fn angles(direction: DVec3) -> [f64; 2] {
    let flat = maths::hypot(direction.x, direction.y);
    [maths::atan2(direction.y, direction.x), maths::atan2(direction.z, flat)]
}

fn row(elevation: f64) -> usize {
    (((elevation + FRAC_PI_2) / PI * ROWS as f64) as usize).min(ROWS - 1)
}

fn column(azimuth: f64) -> usize {
    ((azimuth.rem_euclid(TAU) / TAU * COLUMNS as f64) as usize).min(COLUMNS - 1)
}

impl BeamFinder {
    pub(super) fn new(directions: &[[f32; 3]]) -> Self {
        let cell = |direction: &[f32; 3]| {
            let [azimuth, elevation] = angles(DVec3::from(direction.map(f64::from)));
            row(elevation) * COLUMNS + column(azimuth)
        };
        let cells: Vec<usize> = directions.iter().map(cell).collect();
        let mut starts = vec![0; ROWS * COLUMNS + 1];
        cells.iter().for_each(|&cell| starts[cell + 1] += 1);
        (0..ROWS * COLUMNS).for_each(|cell| starts[cell + 1] += starts[cell]);
        let (mut next, mut beams) = (starts.clone(), vec![0; cells.len()]);
        for (beam, &cell) in (0_u32..).zip(&cells) {
            beams[next[cell] as usize] = beam;
            next[cell] += 1;
        }
        Self { starts, beams }
    }

    /// Asks `go_on` with every beam within `half_angle` radians of an axis, and with a few more beside them, until it
    /// says no. Beams at the height of the axis come first.
    pub(super) fn near(&self, axis: DVec3, half_angle: f64, mut go_on: impl FnMut(usize) -> bool) {
        let (half_angle, [azimuth, elevation]) = (half_angle + SLACK, angles(axis));
        let [low, high] = [elevation - half_angle, elevation + half_angle];
        let (first, last) = (row(low.max(-FRAC_PI_2)), row(high.min(FRAC_PI_2)));
        // Azimuths of a cone around an elevation e reach asin(sin α / cos e); one that holds a pole has all.
        let holds_pole = low <= -FRAC_PI_2 || high >= FRAC_PI_2;
        let across = match holds_pole {
            true => PI,
            false => {
                let sine = maths::sin(half_angle) / maths::cos(elevation);
                maths::asin(sine.min(1.0))
            }
        };
        let width = ((across / TAU * COLUMNS as f64).ceil() as usize + 1).min(COLUMNS / 2);
        let (middle, columns) = (column(azimuth), (2 * width + 1).min(COLUMNS));
        let begin = middle + COLUMNS - width;
        let mut rows: Vec<usize> = (first..=last).collect();
        let level = row(elevation);
        rows.sort_by_key(|row| row.abs_diff(level));
        // Cells of a row lie one after the other: one run of beams, or two where columns go past the last one.
        let first = begin % COLUMNS;
        let end = first + columns;
        let runs = [first..end.min(COLUMNS), 0..end.saturating_sub(COLUMNS)];
        for row in rows {
            for run in &runs {
                let [from, to] = [run.start, run.end].map(|k| self.starts[row * COLUMNS + k]);
                let beams = &self.beams[from as usize..to as usize];
                if !beams.iter().all(|&beam| go_on(beam as usize)) {
                    return;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn no_beam_in_a_cone_is_left_out_and_none_comes_twice() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut unit = |_| loop {
            let v = DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
            if (0.1..1.0).contains(&v.length()) {
                break v.normalize();
            }
        };
        let mut directions: Vec<DVec3> = (0..4000).map(&mut unit).collect();
        directions.extend([DVec3::Z, -DVec3::Z, DVec3::X, -DVec3::X, DVec3::Y]);
        let table: Vec<[f32; 3]> = directions.iter().map(|d| d.as_vec3().to_array()).collect();
        let finder = BeamFinder::new(&table);
        let axes: Vec<DVec3> = (0..60).map(unit).chain([DVec3::Z, -DVec3::X]).collect();
        for (k, axis) in axes.into_iter().enumerate() {
            let half_angle = [0.002, 0.05, 0.4, 1.2, 2.0][k % 5];
            let mut found = Vec::new();
            finder.near(axis, half_angle, |beam| {
                found.push(beam);
                true
            });
            let count = found.len();
            found.sort_unstable();
            found.dedup();
            assert_eq!(found.len(), count, "a beam comes twice");
            let within = |beam: &usize| directions[*beam].angle_between(axis) <= half_angle;
            let wanted: Vec<usize> = (0..directions.len()).filter(within).collect();
            assert!(wanted.iter().all(|beam| found.binary_search(beam).is_ok()), "axis {k}");
            assert!(
                half_angle > 0.3 || count < directions.len() / 4,
                "{count} of all are looked at"
            );
        }
    }
}
