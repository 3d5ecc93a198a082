//! Search variables: the pose fields of a placement that may vary and are not tied to others.

use super::pairing::{MIRRORED, SLACK};
use super::{Constraints, Placement, SensorPose, Slot};

/// Number of the phase among the fields of a pose, behind the six of [`SensorPose::FIELDS`].
const PHASE: usize = 6;

struct Variable {
    /// Pose field that the variable sets, or the phase.
    field: usize,
    bounds: (f64, f64),
    /// LiDARs whose field the variable sets, each with a sign; the first sign is +1.
    sets: Vec<(usize, f64)>,
}

impl Constraints {
    fn variables(&self) -> Vec<Variable> {
        let paired = self.paired();
        let mut variables: Vec<Variable> = Vec::new();
        let mut height: Option<usize> = None;
        for lidar in (0..self.lidars()).filter(|&lidar| lidar >= paired || lidar % 2 == 0) {
            let in_plane = self.ties.symmetric && lidar >= paired;
            let region = &self.slots[lidar].region;
            for field in region.free_fields() {
                let (mut lower, upper) = (region.lower[field], region.upper[field]);
                let mirrored = MIRRORED.contains(&field);
                if in_plane && mirrored {
                    continue;
                }
                let mut sets = vec![(lidar, 1.0)];
                if lidar < paired {
                    sets.push((lidar + 1, if mirrored { -1.0 } else { 1.0 }));
                    if field == 1 && self.is_pair_of_one(lidar) {
                        // The first of a pair is the left one, at least half the distance from y = 0.
                        lower = (0.5 * self.min_distance).min(upper);
                    }
                }
                match height {
                    Some(at) if field == 2 && self.ties.equal_height => {
                        variables[at].sets.extend(sets);
                        continue;
                    }
                    None if field == 2 => height = Some(variables.len()),
                    _ => {}
                }
                variables.push(Variable { field, bounds: (lower, upper), sets });
            }
            // Mirrored sensors are mounted alike, and each turns by itself.
            let own = lidar..lidar + if lidar < paired { 2 } else { 1 };
            let phases = own.filter_map(|lidar| Some((lidar, self.slots[lidar].phase?)));
            variables.extend(phases.map(|(lidar, [from, to])| Variable {
                field: PHASE,
                bounds: (from, to),
                sets: vec![(lidar, 1.0)],
            }));
        }
        variables
    }

    /// Bounds of the search variables: the free fields of every LiDAR and its phase, if that is to be
    /// chosen, LiDAR after LiDAR, a tied field once at its first LiDAR.
    pub fn variable_bounds(&self) -> Vec<(f64, f64)> {
        self.variables().iter().map(|variable| variable.bounds).collect()
    }

    /// Poses from search variables, in the order of [`Self::variable_bounds`].
    pub fn poses_of(&self, variables: &[f64]) -> Vec<SensorPose> {
        let paired = self.paired();
        let rest = |(lidar, slot): (usize, &Slot)| {
            let mut fixed = slot.region.lower;
            if self.ties.symmetric && (lidar >= paired || self.is_pair_of_one(lidar / 2 * 2)) {
                // The ranges of y, roll and yaw run from −a to a.
                MIRRORED.iter().for_each(|&k| fixed[k] = 0.0);
            }
            with_phase(fixed, None)
        };
        let mut fields: Vec<[f64; 7]> = self.slots.iter().enumerate().map(rest).collect();
        for (variable, value) in self.variables().iter().zip(variables) {
            for &(lidar, sign) in &variable.sets {
                fields[lidar][variable.field] = if sign < 0.0 { 0.0 - value } else { *value };
            }
        }
        let slots = self.slots.iter().zip(fields);
        let pose = |(slot, [x, y, z, roll, pitch, yaw, phase]): (&Slot, [f64; 7])| SensorPose {
            phase: slot.phase.map(|_| phase),
            ..slot.region.pose([x, y, z, roll, pitch, yaw], slot.sensor)
        };
        slots.map(pose).collect()
    }

    /// Search variables of a placement, its poses moved into the bounds.
    ///
    /// `None` for another number of LiDARs, or for a broken tie: a symmetric placement of n LiDARs has
    /// ⌊n/2⌋ mirrored pairs, so two LiDARs in the plane y = 0 are no pair.
    pub fn variables_of(&self, placement: &Placement) -> Option<Vec<f64>> {
        if placement.lidars.len() != self.lidars() {
            return None;
        }
        let lidars = self.ordered(&placement.lidars)?;
        let slots = self.slots.iter().zip(&lidars);
        let fields = slots.map(|(slot, pose)| {
            with_phase(slot.region.fields(pose), pose.phase.or(slot.phase_at_rest()))
        });
        let fields: Vec<[f64; 7]> = fields.collect();
        let variables = self.variables();
        let tied = variables.iter().all(|variable| {
            let first = fields[variable.sets[0].0][variable.field];
            let mut values =
                variable.sets.iter().map(|&(l, sign)| sign * fields[l][variable.field]);
            values.all(|value| (value - first).abs() <= SLACK)
        });
        let value = |variable: &Variable| {
            let (lower, upper) = variable.bounds;
            fields[variable.sets[0].0][variable.field].clamp(lower, upper)
        };
        tied.then(|| variables.iter().map(value).collect())
    }
}

/// Six fields and a phase, 0 for none.
fn with_phase([x, y, z, roll, pitch, yaw]: [f64; 6], phase: Option<f64>) -> [f64; 7] {
    [x, y, z, roll, pitch, yaw, phase.unwrap_or(0.0)]
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::{PoseGrid, Spacing, Ties, Violation};
    use super::*;

    fn constraints(lidars: usize, equal_height: bool, symmetric: bool) -> Constraints {
        Constraints {
            min_distance: 0.2,
            keep_out: vec![[[-0.2, -0.3, 2.0], [0.3, 0.1, 2.4]]],
            ties: Ties { equal_height, symmetric },
            ..Constraints::in_box(
                [-0.6, -0.6, 2.2, -0.3, -0.1, -1.0],
                [0.6, 0.6, 2.8, 0.3, 0.2, 1.0],
                lidars,
            )
        }
    }

    fn drawn(rules: &Constraints, rng: &mut ChaCha8Rng) -> Placement {
        let bounds = rules.variable_bounds();
        let draw = |&(low, high): &(f64, f64)| low + rng.random::<f64>() * (high - low);
        let variables: Vec<f64> = bounds.iter().map(draw).collect();
        Placement { name: "drawn".into(), lidars: rules.poses_of(&variables) }
    }

    fn is_tied(violation: &Violation) -> bool {
        matches!(violation, Violation::UnequalHeight { .. } | Violation::NotMirrored { .. })
    }

    #[test]
    fn ties_are_kept_by_fewer_variables() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (lidars, level, symmetric, want) in [
            (4, false, false, 24),
            (4, true, false, 21),
            (4, false, true, 12),
            (4, true, true, 11),
            (5, false, true, 15),
            (5, true, true, 13),
            (1, true, true, 3),
        ] {
            let rules = constraints(lidars, level, symmetric);
            assert_eq!(rules.variable_bounds().len(), want, "{lidars} {level} {symmetric}");
            let spacing = Spacing { metres: 0.25, radians: 0.13 };
            let grid = PoseGrid::new(&rules, spacing).unwrap();
            for _ in 0..200 {
                let mut placement = drawn(&rules, &mut rng);
                assert!(!rules.violations(&placement).iter().any(is_tied), "{placement:?}");
                // Any order of the LiDARs is the same placement.
                placement.lidars.rotate_left(1);
                let variables = rules.variables_of(&placement).expect("it keeps the ties");
                let back = rules.poses_of(&variables);
                let same = |pose: &SensorPose| back.iter().any(|b| b.difference(pose) < 1e-12);
                assert!(placement.lidars.iter().all(same), "{back:?}");
                let snapped = grid.snapped(&placement, rules.ties);
                assert!(!rules.violations(&snapped).iter().any(is_tied), "{snapped:?}");
            }
        }
    }

    #[test]
    fn each_lidar_has_a_phase_of_its_own_where_that_is_left_open() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for (level, symmetric) in [(false, false), (true, false), (false, true)] {
            let fixed = constraints(5, level, symmetric);
            let mut rules = fixed.clone();
            rules.slots.iter_mut().for_each(|slot| slot.phase = Some([-0.01, 0.03]));
            assert_eq!(rules.variable_bounds().len(), fixed.variable_bounds().len() + 5);
            let step = Spacing { metres: 0.25, radians: 0.13 };
            let grid = PoseGrid::new(&rules, step).unwrap();
            assert_eq!(grid.len(), 4 * PoseGrid::new(&fixed, step).unwrap().len());
            for _ in 0..50 {
                let placement = drawn(&rules, &mut rng);
                assert!(placement.lidars.iter().all(|pose| pose.phase.is_some()));
                assert!(!rules.violations(&placement).iter().any(is_tied), "{placement:?}");
                let variables = rules.variables_of(&placement).expect("it keeps the ties");
                assert_eq!(rules.poses_of(&variables), placement.lidars);
                for (lidar, pose) in grid.snapped(&placement, rules.ties).lidars.iter().enumerate()
                {
                    let phase = pose.phase.unwrap();
                    assert!([-0.01, 0.0, 0.01, 0.02].contains(&phase), "LiDAR {lidar}: {phase}");
                }
            }
            let mut lucky = drawn(&rules, &mut rng);
            lucky.lidars[2].phase = Some(0.05);
            let found = rules.violations(&lucky);
            let told: Vec<String> = found.iter().map(ToString::to_string).collect();
            assert_holds!(told.join("; "), "phase is 0.020 rad outside the mount");
            // A sensor that names no phase is where it is put up, at the angle nearest to 0.
            lucky.lidars.iter_mut().for_each(|pose| pose.phase = None);
            let back = rules.poses_of(&rules.variables_of(&lucky).unwrap());
            assert!(back.iter().all(|pose| pose.phase == Some(0.0)), "{back:?}");
        }
    }

    #[test]
    fn broken_ties_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let rules = constraints(5, true, true);
        for lidar in 0..5 {
            for field in 0..6 {
                let mut placement = drawn(&rules, &mut rng);
                let mut fields = placement.lidars[lidar].fields().map(|(_, value)| value);
                fields[field] += 0.01;
                let [x, y, z, roll, pitch, yaw] = fields;
                placement.lidars[lidar] = SensorPose::from_values([x, y, z, roll, pitch, yaw]);
                let broken = rules.violations(&placement).iter().any(is_tied);
                // The LiDAR in the plane stays there when it moves in x or pitches.
                let free = lidar == 4 && [0, 4].contains(&field);
                assert_eq!(broken, !free, "LiDAR {lidar}, field {field}");
                assert_eq!(rules.variables_of(&placement).is_some(), free);
            }
        }
        let three = Placement { name: "three".into(), lidars: vec![] };
        assert_eq!(rules.variables_of(&three), None);
    }

    #[test]
    fn a_box_keeps_its_inside_free_and_not_its_faces() {
        let rules = constraints(1, false, false);
        let by = |x, y, z| {
            let lidar = SensorPose { x, y, z, ..SensorPose::default() };
            let found = rules.violations(&Placement { name: "one".into(), lidars: vec![lidar] });
            assert_eq!(rules.is_clear(&lidar), found.is_empty());
            found.first().map(Violation::amount)
        };
        assert_eq!(by(0.3, 0.0, 2.3), None);
        assert_eq!(by(0.0, 0.0, 2.4), None);
        let deep = by(0.0, 0.0, 2.3).unwrap();
        assert!((deep - 0.1).abs() < 1e-12, "to the nearest face: {deep}");
    }
}
