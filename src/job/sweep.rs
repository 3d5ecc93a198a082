//! One pose field of one LiDAR, moved through a range: scores, requirements and rules at each value.

use std::f64::consts::FRAC_PI_4;

use serde::Serialize;

use super::{Job, JobError};
use crate::near_field::self_hits;
use crate::score::Scores;
use crate::search::Evaluator;
use crate::vehicle::{
    Constraints, FARTHEST_ON_VEHICLE, Placement, SensorError, SensorPose, Violation,
};

/// Number of the first angle among the fields of a pose.
const FIRST_ANGLE: usize = 3;
/// Degrees below which a range of an angle is more likely radians.
const LEAST_ANGLE: f64 = 0.5;
/// Largest angle of a range that may be meant in radians: a little over π.
const HALF_TURN: f64 = 3.2;
/// Most that a rounded multiple of π/4 is off, radians.
const ROUNDED: f64 = 0.01;

/// A pose field of one LiDAR of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SweptField {
    /// Number of the LiDAR in the placement.
    pub lidar: usize,
    field: usize,
    /// Number of its mirror image, which moves with it; `None` where the vehicle wants no pairs, or it is in none.
    pub image: Option<usize>,
}

/// A placement with one field moved through some values; one that is interrupted holds the first rows.
#[derive(Debug, Clone, Serialize)]
pub struct Sweep {
    /// Name of the placement.
    pub placement: String,
    /// Number of the LiDAR.
    pub lidar: usize,
    /// Number of its mirror image, which moves with it on a symmetric vehicle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirrored_lidar: Option<usize>,
    /// Pose field.
    pub field: &'static str,
    /// `m` or `deg`.
    pub unit: &'static str,
    /// The placement as it is given, then the values in their order.
    pub rows: Vec<SweepRow>,
}

impl Sweep {
    /// From rows of [`Job::sweep_rows`].
    pub fn new(placement: &Placement, field: SweptField, rows: Vec<SweepRow>) -> Self {
        let (placement, lidar) = (placement.name.clone(), field.lidar);
        let (mirrored_lidar, unit) = (field.image, field.unit());
        Self { placement, lidar, mirrored_lidar, field: field.name(), unit, rows }
    }
}

/// A placement with one field at a value.
#[derive(Debug, Clone, Serialize)]
pub struct SweepRow {
    /// Metres, or degrees of an angle.
    pub value: f64,
    /// True for the placement as it is given.
    pub as_given: bool,
    /// Rules of the mounts that it breaks, in words, angles in degrees; empty where it keeps all.
    pub broken_rules: Vec<String>,
    /// Scores, requirements, blind sectors and guards `self_hit`; means over several scenes.
    pub scores: Scores,
}

impl SweptField {
    /// Finds the field that `text` names: `LIDAR.FIELD`, where LIDAR is the number of a LiDAR, or the name of a mount
    /// or model that one LiDAR has, and FIELD is x, y, z, roll, pitch or yaw.
    ///
    /// # Errors
    /// A sentence: no such LiDAR or field, or several LiDARs of that name.
    pub fn find(
        text: &str,
        placement: &Placement,
        constraints: &Constraints,
    ) -> Result<Self, String> {
        let Some((lidar, field)) = text.rsplit_once('.') else {
            return Err(format!("`{text}` names no field; write LIDAR.FIELD, as 0.pitch"));
        };
        let field = SensorPose::FIELDS.iter().position(|name| *name == field).ok_or_else(|| {
            format!("`{field}` is no pose field; there are {}", SensorPose::FIELDS.join(", "))
        })?;
        let of = |lidar: usize| {
            let image = constraints.mirror_image_of(lidar, &placement.lidars);
            Self { lidar, field, image }
        };
        let count = placement.lidars.len();
        if let Ok(number) = lidar.parse::<usize>() {
            let name = &placement.name;
            return (number < count).then(|| of(number)).ok_or_else(|| {
                format!("placement `{name}` has no LiDAR {number}; it has {count}, the first is 0")
            });
        }
        let mounts = constraints.mounts_of(&placement.lidars);
        let names = |k: usize| {
            let mount = mounts[k].map(|mount| mount.name.clone()).unwrap_or_default();
            [mount, placement.lidars[k].sensor.to_string()]
        };
        let named: Vec<usize> =
            (0..count).filter(|&k| names(k).iter().any(|n| n == lidar)).collect();
        match named[..] {
            [lidar] => Ok(of(lidar)),
            [] => {
                let mut known: Vec<String> = (0..count).flat_map(names).collect();
                known.retain(|name| !name.is_empty());
                known.sort();
                known.dedup();
                known.insert(0, format!("0 to {}", count - 1));
                let (name, known) = (&placement.name, known.join(", "));
                Err(format!("placement `{name}` has no LiDAR `{lidar}`; its LiDARs are {known}"))
            }
            _ => {
                let numbers: Vec<String> = named.iter().map(usize::to_string).collect();
                let (name, numbers) = (&placement.name, numbers.join(", "));
                Err(format!(
                    "`{lidar}` is each of the LiDARs {numbers} of placement `{name}`; give a number"
                ))
            }
        }
    }

    /// Name of the field.
    pub fn name(self) -> &'static str {
        SensorPose::FIELDS[self.field]
    }

    /// Unit of its values: `m` or `deg`.
    pub fn unit(self) -> &'static str {
        if self.field < FIRST_ANGLE { "m" } else { "deg" }
    }

    /// A doubt about values that are most likely millimetres or radians, in words.
    pub fn doubt(self, [from, to]: [f64; 2]) -> Option<String> {
        let most = from.abs().max(to.abs());
        let name = self.name();
        if self.field < FIRST_ANGLE {
            return (most > FARTHEST_ON_VEHICLE).then(|| {
                format!(
                    "{name} of {most} is far from any vehicle; positions are in metres, {most} mm are {}",
                    most / 1e3
                )
            });
        }
        let is_radians = most <= HALF_TURN && [from, to].into_iter().any(is_part_of_pi);
        (most < LEAST_ANGLE || is_radians).then(|| {
            let degrees = most.to_degrees();
            format!("{name} of {most}° at most; radians? {most} rad are {degrees:.2}°")
        })
    }

    /// Every field of every LiDAR of a placement, which moves without its mirror image.
    pub(crate) fn all(placement: &Placement) -> impl Iterator<Item = Self> {
        let lidars = 0..placement.lidars.len();
        let fields = 0..SensorPose::FIELDS.len();
        lidars.flat_map(move |lidar| {
            fields.clone().map(move |field| Self { lidar, field, image: None })
        })
    }

    /// Its value in a placement, metres or degrees.
    pub(crate) fn value_in(self, placement: &Placement) -> f64 {
        let value = placement.lidars[self.lidar].values()[self.field];
        if self.field < FIRST_ANGLE { value } else { value.to_degrees() }
    }

    /// Checks that a placement may have the field at each of some values, metres or degrees.
    ///
    /// # Errors
    /// The first value that is not finite, or too far away.
    pub fn check(self, placement: &Placement, values: &[f64]) -> Result<(), SensorError> {
        values.iter().try_for_each(|value| self.moved(placement, *value).validate())
    }

    /// A placement with the field at a value, metres or degrees.
    pub fn moved(self, placement: &Placement, value: f64) -> Placement {
        let mut moved = placement.clone();
        let pose = &mut moved.lidars[self.lidar];
        let mut values = pose.values();
        values[self.field] = if self.field < FIRST_ANGLE { value } else { value.to_radians() };
        let [x, y, z, roll, pitch, yaw] = values;
        *pose = SensorPose { x, y, z, roll, pitch, yaw, ..*pose };
        let mirrored = pose.mirrored();
        if let Some(image) = self.image {
            let phase = moved.lidars[image].phase;
            moved.lidars[image] = SensorPose { phase, ..mirrored };
        }
        moved
    }
}

/// True if an angle is within [`ROUNDED`] of a multiple of π/4 other than 0, as 3.14 is.
fn is_part_of_pi(angle: f64) -> bool {
    let parts = (angle.abs() / FRAC_PI_4).round();
    parts > 0.0 && (angle.abs() - parts * FRAC_PI_4).abs() <= ROUNDED
}

impl Job {
    /// Scores a placement as it is, and with one field at each of some values, metres or degrees.
    ///
    /// # Errors
    /// A value that is not finite or too far away; see [`Self::evaluator`]; an engine that fails, a sensor that the vehicle
    /// does not have.
    pub fn sweep(
        &self,
        placement: &Placement,
        field: SweptField,
        values: &[f64],
    ) -> Result<Sweep, JobError> {
        field.check(placement, values)?;
        let (mut evaluator, _) = self.evaluator(|_| {})?;
        let as_given = std::iter::once(None);
        let values: Vec<_> = as_given.chain(values.iter().copied().map(Some)).collect();
        let rows = self.sweep_rows(&mut evaluator, placement, field, &values, &mut || true)?;
        Ok(Sweep::new(placement, field, rows.unwrap_or_default()))
    }

    /// Rows at some values, of which `None` is the placement as it is; no rows once `go_on`, which is asked often, says no.
    ///
    /// # Errors
    /// An engine that fails, a sensor that the vehicle does not have.
    pub fn sweep_rows(
        &self,
        evaluator: &mut Evaluator,
        placement: &Placement,
        field: SweptField,
        values: &[Option<f64>],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<SweepRow>>, JobError> {
        let moved = |value: &Option<f64>| match value {
            Some(value) => field.moved(placement, *value),
            None => placement.clone(),
        };
        let moved: Vec<Placement> = values.iter().map(moved).collect();
        let Some(mut scores) = evaluator.scores_while(&moved, go_on)? else { return Ok(None) };
        self.add_range_cards(moved.iter().zip(&mut scores))?;
        let problem = self.problem()?;
        for (placement, scores) in moved.iter().zip(&mut scores) {
            let hits = self_hits(self.scene(), &problem, evaluator.backend_mut(), placement)?;
            scores.guards.extend(hits);
        }
        let row = |((value, placement), scores): ((&Option<f64>, &Placement), Scores)| {
            let broken = problem.rules().violations(placement);
            SweepRow {
                value: value.unwrap_or_else(|| field.value_in(placement)),
                as_given: value.is_none(),
                broken_rules: broken.iter().map(Violation::in_degrees).collect(),
                scores,
            }
        };
        Ok(Some(values.iter().zip(&moved).zip(scores).map(row).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_in_radians_are_doubted() {
        let doubt =
            |range: [f64; 2]| SweptField { lidar: 0, field: FIRST_ANGLE, image: None }.doubt(range);
        for range in [[0.0, 3.15], [-1.57, 1.57], [-0.79, 0.0], [1.0, 2.36], [0.0, 0.2]] {
            assert!(doubt(range).is_some(), "{range:?}");
        }
        let degrees =
            [[0.0, 3.0], [-1.5, 1.5], [0.0, 0.8], [-2.5, 0.5], [0.0, 3.25], [-10.0, 3.15]];
        for range in degrees {
            assert_eq!(doubt(range), None, "{range:?}");
        }
        let height = SweptField { lidar: 0, field: 2, image: None };
        assert_eq!(height.doubt([0.0, 3.15]), None, "metres");
    }

    #[test]
    fn on_a_symmetric_vehicle_the_mirror_image_moves_too() {
        let lidar = |y: f64, yaw: f64| SensorPose::from_values([0.5, y, 2.0, 0.0, 0.1, yaw]);
        let lidars = vec![lidar(0.4, 0.3), lidar(0.0, 0.0), lidar(-0.4, -0.3)];
        let placement = Placement { name: "pair".into(), lidars };
        let mut constraints = Constraints::in_box([-1.0; 6], [3.0; 6], 3);
        let find = |constraints: &Constraints, text: &str| {
            SweptField::find(text, &placement, constraints).unwrap()
        };
        assert_eq!(find(&constraints, "2.yaw").image, None);
        constraints.ties.symmetric = true;
        assert_eq!(find(&constraints, "1.yaw").image, None);
        let yaw = find(&constraints, "2.yaw");
        assert_eq!(yaw.image, Some(0));
        let moved = yaw.moved(&placement, -90.0);
        assert_eq!(moved.lidars[1], placement.lidars[1]);
        assert!((moved.lidars[0].yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!(constraints.violations(&moved).iter().all(|of| !of.to_string().contains("mirror")));
        let alone = SweptField { image: None, ..yaw }.moved(&placement, -90.0);
        let told: Vec<String> =
            constraints.violations(&alone).iter().map(ToString::to_string).collect();
        let told: Vec<&String> = told.iter().filter(|of| of.contains("mirror")).collect();
        let pair = "LiDARs 0 and 2: yaw is off by 1.271 rad from a mirror image at the plane y = 0";
        assert_eq!(told, [pair]);
    }

    #[test]
    fn a_field_is_named_by_number_mount_or_model_and_moves_alone() {
        let lidar = |x: f64| SensorPose::from_values([x, 0.0, 2.0, 0.0, 0.1, 0.0]);
        let placement = Placement { name: "two".into(), lidars: vec![lidar(0.5), lidar(-0.5)] };
        let constraints = Constraints::in_box([-1.0; 6], [3.0; 6], 2);
        let find = |text: &str| SweptField::find(text, &placement, &constraints);
        let pitch = find("1.pitch").unwrap();
        assert_eq!((pitch.lidar, pitch.name(), pitch.unit()), (1, "pitch", "deg"));
        assert!((pitch.value_in(&placement) - 0.1_f64.to_degrees()).abs() < 1e-12);
        let moved = pitch.moved(&placement, 90.0);
        assert_eq!(moved.lidars[0], placement.lidars[0]);
        let wanted = SensorPose { pitch: std::f64::consts::FRAC_PI_2, ..placement.lidars[1] };
        assert_eq!(moved.lidars[1], wanted);
        assert_eq!(find("0.z").unwrap().moved(&placement, 1.5).lidars[0].z, 1.5);
        for (text, part) in [
            ("pitch", "write LIDAR.FIELD"),
            ("0.tilt", "`tilt` is no pose field; there are x, y"),
            ("2.x", "has no LiDAR 2; it has 2"),
            ("roof.x", "has no LiDAR `roof`; its LiDARs are 0 to 1"),
        ] {
            let error = find(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
