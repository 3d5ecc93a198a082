//! Ground of a scene that is not as level as targets of requirements and range cards take it to be.

use super::card::{SECTOR_RANGE, card_targets, position};
use super::ground::GroundBelow;
use crate::problem::{Problem, spread};

/// Metres by which ground may lie above or below z = 0.
const LEVEL: f64 = 0.2;
/// Metres by which ground lies so far from z = 0 that a car on it and one on level ground share no point, about a car's height.
const STEEP: f64 = 1.5;
/// Frames that are looked at, spread evenly.
const FRAMES: u32 = 4;
/// Bearings that are looked at, and metres between distances.
const BEARINGS: usize = 24;
const STEP: f64 = 5.0;

/// The place at which ground lies farthest from z = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Relief {
    /// Height of the ground, metres.
    height: f64,
    /// Metres from the ego origin.
    distance: f64,
    /// Degrees counter-clockwise from straight ahead, from −180 to 180.
    bearing: f64,
    /// Frame of the scene, from 0.
    frame: usize,
    /// Place of that frame among the problem's.
    place: usize,
}

/// Number of distances that are looked at, up to the farthest, m.
fn steps(farthest: f64) -> usize {
    (farthest / STEP).ceil() as usize
}

/// Metres of a distance by its number, from 0; the last is the farthest one.
fn distance(number: usize, farthest: f64) -> f64 {
    ((number + 1) as f64 * STEP).min(farthest)
}

impl Relief {
    /// The place of a problem's scene, as far as its rules on targets reach, 50 m at least; `None` where the ground is level
    /// to 0.2 m, or there is none.
    pub(crate) fn of(problem: &Problem, ground: &GroundBelow) -> Option<Self> {
        let rules = problem.target_rules().iter().filter(|rule| !rule.on_scene);
        let rules = rules.map(|rule| rule.within);
        let farthest = rules.fold(SECTOR_RANGE[1], f64::max);
        let target = card_targets().last()?;
        let mut found: Option<Self> = None;
        for frame in spread(problem.geometry_frame_count(), Some(FRAMES)) {
            let Some(geometry) = problem.geometry(frame) else { continue };
            let wheels = ground.wheels(geometry);
            for place in 0..BEARINGS * steps(farthest) {
                let bearing = (place % BEARINGS) as f64 * 360.0 / BEARINGS as f64;
                let distance = distance(place / BEARINGS, farthest);
                let [x, y, _] = position(distance, bearing);
                let height = ground.height(geometry, &wheels, target, [x, y]);
                let most = found.map_or(LEVEL, |found| found.height.abs());
                // Whole centimetres: a road 0.2 m down is level to 0.2 m.
                if let Some(height) = height.map(|height| (100.0 * height).round() / 100.0)
                    && height.abs() > most
                {
                    let bearing = if bearing > 180.0 { bearing - 360.0 } else { bearing };
                    let (place, frame) = (frame, problem.number_of(frame));
                    found = Some(Self { height, distance, bearing, frame, place });
                }
            }
        }
        found
    }

    /// True where a car there stands above or below all of one on level ground: range cards then stand on the scene's.
    pub(crate) fn is_steep(&self) -> bool {
        self.height.abs() > STEEP
    }

    /// Place of its frame among the problem's frames.
    pub(super) fn place(&self) -> usize {
        self.place
    }
}

impl std::fmt::Display for Relief {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { height, distance, bearing, frame, .. } = self;
        let how = if *height > 0.0 { "rises" } else { "falls" };
        let height = height.abs();
        write!(f, "{how} {height:.1} m to {distance} m at {bearing}° in frame {frame}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_distance_is_looked_at_whole_steps_or_not() {
        let all = |farthest: f64| -> Vec<f64> {
            (0..steps(farthest)).map(|number| distance(number, farthest)).collect()
        };
        assert_eq!(all(12.0), [5.0, 10.0, 12.0]);
        assert_eq!(all(15.0), [5.0, 10.0, 15.0]);
    }
}
