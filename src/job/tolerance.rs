//! Requirements in copies of a placement whose LiDARs are mounted a little off.

use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, Mutex};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Job, JobError};
use crate::engine::BackendError;
use crate::problem::Problem;
use crate::score::{Scores, Seen};
use crate::search::{AreaBits, Evaluator};
use crate::targets::{Sight, SightBeams};
use crate::vehicle::{Placement, SensorPose, UnknownSensor};

/// Copies of a placement.
const COPIES: usize = 200;
/// Poses of each LiDAR that the copies are made of.
const POSES: usize = 16;
/// Frames of each scene over which areas are looked at, spread evenly.
const FRAMES: u32 = 4;
/// Seed of the moves: every placement is moved alike.
const SEED: u64 = 0x746f_6c65;

/// Most by which a LiDAR's mounting is off: each coordinate and each angle, to either side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Tolerance {
    /// Along x, y and z, metres.
    pub metres: f64,
    /// In roll, pitch and yaw, radians.
    pub radians: f64,
}

impl Default for Tolerance {
    /// 5 mm and 0.5°: a bracket that is bolted on and not measured afterwards.
    fn default() -> Self {
        Self { metres: 0.005, radians: 0.5_f64.to_radians() }
    }
}

impl FromStr for Tolerance {
    type Err = String;

    /// A length in m, cm or mm and an angle in deg or rad, as `5mm,0.5deg`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("`{text}` is no tolerance; write a length and an angle, as 5mm,0.5deg, or 0")
        };
        let with_unit = |text: &str, units: [(&str, f64); 3], most: f64| {
            let (number, scale) =
                units.iter().find_map(|(unit, scale)| Some((text.strip_suffix(unit)?, scale)))?;
            let value = number.trim().parse::<f64>().ok()? * scale;
            (0.0..=most).contains(&value).then_some(value)
        };
        if text.trim() == "0" {
            return Ok(Self { metres: 0.0, radians: 0.0 });
        }
        let (length, angle) = text.trim().split_once(',').ok_or_else(wrong)?;
        let length = with_unit(length.trim(), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)], 1.0);
        let degree = 1.0_f64.to_radians();
        let angle = with_unit(angle.trim(), [("deg", degree), ("°", degree), ("rad", 1.0)], 1.0);
        let (metres, radians) = length.zip(angle).ok_or_else(wrong)?;
        Ok(Self { metres, radians })
    }
}

impl TryFrom<String> for Tolerance {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Tolerance> for String {
    fn from(tolerance: Tolerance) -> Self {
        tolerance.to_string()
    }
}

impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A rounding of the ninth digit comes from the change of units.
        let short = |value: f64| (value * 1e9).round() / 1e9;
        write!(f, "{}mm,{}deg", short(1e3 * self.metres), short(self.radians.to_degrees()))
    }
}

impl Tolerance {
    /// Poses of a LiDAR within the tolerance, the first as it is.
    fn poses(&self, pose: &SensorPose, rng: &mut ChaCha8Rng) -> Vec<SensorPose> {
        let mut off = |most: f64| most * rng.random_range(-1.0..=1.0);
        let mut moved = |_| {
            let most = [[self.metres; 3], [self.radians; 3]].concat();
            let mut values = pose.values();
            values.iter_mut().zip(most).for_each(|(value, most)| *value += off(most));
            let [x, y, z, roll, pitch, yaw] = values;
            SensorPose { x, y, z, roll, pitch, yaw, ..*pose }
        };
        std::iter::once(*pose).chain((1..POSES).map(&mut moved)).collect()
    }
}

/// Beams on targets and bits of areas of each LiDAR in each of its poses, `[lidars][poses]`.
struct Moved {
    targets: Vec<Vec<SightBeams>>,
    /// One for each member of the suite; empty where no area is required.
    areas: Vec<AreasOfMember>,
    /// Problem that says the order of requirements.
    problem: Arc<Problem>,
}

/// Voxels of required areas in one scene, for each LiDAR in each of its poses.
struct AreasOfMember {
    areas: AreaBits,
    /// `[lidars][poses]`, frame after frame.
    bits: Vec<Vec<Vec<u64>>>,
}

impl AreasOfMember {
    /// Share of each area that LiDARs see, each in one of its poses.
    fn shares(&self, poses: &[usize]) -> Vec<f64> {
        let mut union = self.bits[0][poses[0]].clone();
        for (of_lidar, &pose) in self.bits.iter().zip(poses).skip(1) {
            union.iter_mut().zip(&of_lidar[pose]).for_each(|(all, bits)| *all |= bits);
        }
        self.areas.shares(&union)
    }
}

impl Job {
    /// Adds to each requirement the share of copies that still meet it: copies whose LiDARs are off by the job's
    /// tolerance, each in one of 16 poses. Nothing without a tolerance or requirements.
    ///
    /// Targets are looked at as the requirement asks. Areas and ground are looked at in four frames of each scene, and
    /// the change there is added to the share over all frames.
    ///
    /// # Errors
    /// An engine that fails, a sensor that the vehicle does not have.
    pub(super) fn add_holds(&self, all: &mut [(&Placement, &mut Scores)]) -> Result<(), JobError> {
        let Some(tolerance) = self.tolerance.filter(|t| t.metres > 0.0 || t.radians > 0.0) else {
            return Ok(());
        };
        let all = all.iter_mut().filter(|(_, scores)| !scores.required.is_empty());
        let mut all: Vec<_> = all.collect();
        if all.is_empty() {
            return Ok(());
        }
        let suite = self.suite()?;
        let few = suite.over(&suite.spread(Some(FRAMES)));
        let scenes = few.members().iter().map(|member| (member.problem(), member.is_mirrored()));
        let sight = Sight::of(scenes, false);
        let mut evaluator = Evaluator::suite_on_cpu(&few, self.settings.engine.memory_budget() / 2);
        for (placement, scores) in &mut all {
            let moved = Moved::new(tolerance, placement, sight.as_ref(), &mut evaluator)?;
            let holds = moved.holds(sight.as_ref(), &scores.required);
            scores.requirements_hold_in = Some(holds.all);
            for (seen, share) in scores.required.iter_mut().zip(holds.each) {
                seen.holds_in = Some(share);
            }
        }
        Ok(())
    }
}

/// Shares of the copies that meet requirements.
struct Holds {
    /// Share for each requirement, in the order of the scores.
    each: Vec<f64>,
    /// Share that meets all of them.
    all: f64,
}

impl Moved {
    fn new(
        tolerance: Tolerance,
        placement: &Placement,
        sight: Option<&Sight>,
        evaluator: &mut Evaluator,
    ) -> Result<Self, BackendError> {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let poses: Vec<Vec<SensorPose>> =
            placement.lidars.iter().map(|lidar| tolerance.poses(lidar, &mut rng)).collect();
        let mut targets = Vec::new();
        if let Some(sight) = sight {
            for of_lidar in &poses {
                let beams = of_lidar.par_iter().map(|pose| sight.beams(pose));
                targets.push(beams.collect::<Result<Vec<_>, UnknownSensor>>()?);
            }
        }
        let mut areas = Vec::new();
        let members = evaluator.members().len();
        for member in 0..members {
            areas.extend(Self::areas(&poses, member, evaluator)?);
        }
        Ok(Self { targets, areas, problem: evaluator.shared_problem() })
    }

    /// Bits of areas in one scene; `None` where nothing is required of them.
    fn areas(
        poses: &[Vec<SensorPose>],
        member: usize,
        evaluator: &mut Evaluator,
    ) -> Result<Option<AreasOfMember>, BackendError> {
        let (member, backend) = evaluator.member_mut(member);
        let problem = member.problem().clone();
        let areas = AreaBits::new(problem.content());
        if areas.words() == 0 {
            return Ok(None);
        }
        let mut all: Vec<SensorPose> = poses.iter().flatten().copied().collect();
        if member.is_mirrored() {
            all.iter_mut().for_each(|pose| *pose = pose.mirrored());
        }
        let (frames, words) = (problem.frame_count(), areas.words());
        let bits: Vec<_> = all.iter().map(|_| Mutex::new(vec![0; frames * words])).collect();
        for frame in 0..frames {
            backend.each_bitmap(&all, frame, &|pose, order, bitmap| {
                let Ok(mut bits) = bits[pose].lock() else { return };
                let seen = &mut bits[frame * words..(frame + 1) * words];
                // Another engine takes over from a device that is lost, and hands out all poses again.
                seen.fill(0);
                areas.take(*order, bitmap, seen);
            })?;
        }
        let bits = bits.into_iter().map(|bits| bits.into_inner().unwrap_or_default());
        let bits: Vec<Vec<u64>> = bits.collect();
        let bits = bits.chunks(POSES).map(<[_]>::to_vec).collect();
        Ok(Some(AreasOfMember { areas, bits }))
    }

    /// Share of every requirement with each LiDAR in one of its poses, in the order of the scores.
    fn shares(&self, sight: Option<&Sight>, poses: &[usize]) -> Vec<f64> {
        let mut shares: Vec<f64> = Vec::new();
        for of_member in &self.areas {
            let found = of_member.shares(poses);
            shares.resize(found.len(), 0.0);
            let members = self.areas.len() as f64;
            shares.iter_mut().zip(found).for_each(|(mean, share)| *mean += share / members);
        }
        if let Some(sight) = sight {
            let each = self.targets.iter().zip(poses).map(|(of_lidar, &pose)| &of_lidar[pose]);
            shares.extend(sight.shares(&each.collect::<Vec<_>>()));
        }
        self.problem.in_file_order(&mut shares);
        shares
    }

    /// Copies that meet requirements, of which `found` says the shares over all frames.
    fn holds(&self, sight: Option<&Sight>, found: &[Seen]) -> Holds {
        let lidars = self.targets.len().max(self.areas.first().map_or(0, |of| of.bits.len()));
        let as_it_is = self.shares(sight, &vec![0; lidars]);
        let mut rng = ChaCha8Rng::seed_from_u64(SEED ^ 1);
        let copies: Vec<Vec<usize>> = (0..COPIES)
            .map(|_| (0..lidars).map(|_| rng.random_range(1..POSES)).collect())
            .collect();
        let met: Vec<Vec<bool>> = copies
            .par_iter()
            .map(|poses| {
                let moved = self.shares(sight, poses);
                let of = found.iter().zip(moved.iter().zip(&as_it_is));
                of.map(|(seen, (moved, still))| seen.share + (moved - still) >= seen.least)
                    .collect()
            })
            .collect();
        let share = |is_met: &dyn Fn(&Vec<bool>) -> bool| {
            met.iter().filter(|met| is_met(met)).count() as f64 / COPIES as f64
        };
        let each = (0..found.len()).map(|k| share(&|met| met[k])).collect();
        Holds { each, all: share(&|met| met.iter().all(|met| *met)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_read_and_written() {
        let read = |text: &str| text.parse::<Tolerance>();
        assert_eq!(read("5mm,0.5deg"), Ok(Tolerance::default()));
        assert_eq!(read(" 0.5 cm , 0.5° "), Ok(Tolerance::default()));
        let rad = read("0.002m,0.01rad").unwrap();
        assert_eq!((rad.metres, rad.radians), (0.002, 0.01));
        assert_eq!(Tolerance::default().to_string(), "5mm,0.5deg");
        let none = read("0").unwrap();
        assert_eq!((none.metres, read(&none.to_string())), (0.0, Ok(none)));
        for wrong in
            ["", "5", "5mm", "5mm,", "5km,1deg", "-1mm,0deg", "nanmm,0deg", "2m,0deg", "1mm,2rad"]
        {
            assert!(read(wrong).unwrap_err().contains("5mm,0.5deg"), "{wrong}");
        }
    }

    #[test]
    fn moved_poses_stay_within_the_tolerance_and_fill_it() {
        let pose = SensorPose::from_values([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
        let (mut rng, tolerance) = (ChaCha8Rng::seed_from_u64(1), Tolerance::default());
        let poses: Vec<_> = (0..40).flat_map(|_| tolerance.poses(&pose, &mut rng)).collect();
        assert_eq!(poses[0], pose);
        for k in 0..6 {
            let most = if k < 3 { tolerance.metres } else { tolerance.radians };
            let off = |moved: &SensorPose| (moved.values()[k] - pose.values()[k]) / most;
            let [low, high] =
                [f64::min, f64::max].map(|f| poses.iter().map(off).reduce(f).unwrap());
            assert!(
                low >= -1.0 - 1e-9 && high <= 1.0 + 1e-9 && low < -0.95 && high > 0.95,
                "field {k}"
            );
        }
    }
}
