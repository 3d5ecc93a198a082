//! Attempts to make a score look better while less is seen, and their verdicts.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::sync::Arc;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::geom::Pose;
use crate::job::{JobError, JobScene};
use crate::psog::{Psog, PsogError, Roi};
use crate::scan::scan_scene;
use crate::scene::{PsogSource, ScanSettings, Scene};
use crate::score::{Guard, Scores};
use crate::vehicle::{BeamTable, MAX_LIDARS, Placement, SensorPose, Sensors, UnknownSensor};

/// An attempt that loses less than this share of the information has done no harm.
const HARMLESS: f64 = 0.01;

/// Score that is the larger the less is seen, by its definition: it is told of, and decides about no trial.
pub(crate) const LIKES_LOSS: &str = "s_mig";
/// Largest vertical part of a beam of a sensor that looks down: 5.7° up.
const DOWN: f32 = 0.1;

/// Result of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TrialResult {
    /// No score but S-MIG calls the attempt better than the base, or it sees as much.
    NotFooled,
    /// A score was fooled, and a guard says so.
    Caught,
    /// A score was fooled, and nothing says so.
    Fooled,
}

/// One attempt to make the scores fail, beside an honest base placement.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trial {
    /// Short name.
    pub name: String,
    /// Scores of the attempt.
    pub scores: Scores,
    /// Names of the scores that rank the attempt above the base.
    pub fooled: Vec<&'static str>,
    /// Fooled, caught by a guard, or not fooled.
    pub verdict: TrialResult,
}

impl Trial {
    /// Judges an attempt that is worse than `base` by construction. One with a guard is caught, blind sectors among them,
    /// unless the base has the guard as badly.
    pub fn new(name: &str, base: &Scores, scores: Scores) -> Self {
        type TrialMetric = fn(&Scores) -> Option<f64>;
        let metrics: [(&'static str, TrialMetric); 6] = [
            ("m_sog", |s| s.segmentation.m_sog),
            ("m_sog_scaled", |s| s.segmentation.m_sog_scaled),
            ("information_gain", |s| s.segmentation.information_gain),
            ("near_gain", |s| s.near_gain),
            ("s_mig", |s| s.s_mig),
            ("detection.m_sog_scaled", |s| s.detection.and_then(|d| d.m_sog_scaled)),
        ];
        let better = |of: &TrialMetric| match (of(&scores), of(base)) {
            (Some(attempt), Some(base)) => attempt > base,
            _ => false,
        };
        let fooled: Vec<_> =
            metrics.iter().filter(|(_, of)| better(of)).map(|(name, _)| *name).collect();
        let gain = |s: &Scores| s.segmentation.information_gain.unwrap_or(0.0);
        let harmless = gain(&scores) >= (1.0 - HARMLESS) * gain(base);
        let is_fooled = fooled.iter().any(|name| *name != LIKES_LOSS);
        let is_of_base =
            |guard: &Guard| base.guards.iter().any(|known| tells_no_more(guard, known));
        let is_clear = scores.guards.iter().all(is_of_base);
        let verdict = match (is_fooled, is_clear) {
            (false, _) => TrialResult::NotFooled,
            (true, false) => TrialResult::Caught,
            (true, true) if harmless => TrialResult::NotFooled,
            (true, true) => TrialResult::Fooled,
        };
        Self { name: name.to_owned(), scores, fooled, verdict }
    }
}

/// True for a guard of the kind of another one, on the same class, LiDAR and scene, that is no worse: a blind sector within
/// the other, as much information, no more beams at the own vehicle.
fn tells_no_more(guard: &Guard, known: &Guard) -> bool {
    match (guard, known) {
        (Guard::BlindSector(sector), Guard::BlindSector(known)) => sector.is_within(known),
        (Guard::LowInformation { share }, Guard::LowInformation { share: least }) => share >= least,
        (Guard::FewHits { hit_share, .. }, Guard::FewHits { hit_share: least, .. }) => {
            hit_share >= least
        }
        (
            Guard::ClassUnseen { class, share },
            Guard::ClassUnseen { class: known, share: least },
        ) => class == known && share >= least,
        (Guard::ShortSight { lost }, Guard::ShortSight { lost: most }) => lost <= most,
        (
            Guard::RedundantLidar { lidar, share },
            Guard::RedundantLidar { lidar: known, share: least },
        ) => lidar == known && share >= least,
        (Guard::SelfHit { lidar, share, .. }, Guard::SelfHit { lidar: known, share: most, .. }) => {
            lidar == known && share <= most
        }
        (Guard::InScene { scene, guard }, Guard::InScene { scene: known, guard: of_known }) => {
            scene == known && tells_no_more(guard, of_known)
        }
        _ => guard == known,
    }
}

/// True if a sensor upside down looks to the sky: it turns, and no beam is above [`DOWN`].
fn looks_down(table: &BeamTable) -> bool {
    let turns = table.grid().is_some_and(|grid| grid.turn);
    turns && table.directions().iter().all(|direction| direction[2] <= DOWN)
}

/// Layouts that see little, or no more than fewer LiDARs would, with the name of each attempt; `sensors` has the models.
pub(crate) fn gaming_placements(
    base: &Placement,
    sensors: &Sensors,
) -> Result<Vec<(&'static str, Placement)>, UnknownSensor> {
    let numbers: Vec<usize> =
        base.lidars.iter().map(|pose| sensors.number(pose)).collect::<Result<_, _>>()?;
    let each = |name: &str, change: &dyn Fn(usize, SensorPose) -> SensorPose| Placement {
        name: name.to_owned(),
        lidars: base.lidars.iter().enumerate().map(|(i, &pose)| change(i, pose)).collect(),
    };
    let spread = |i: usize| 0.15 * (i as f64 - 1.5);
    let inside = |i: usize, z: f64| SensorPose { x: spread(i), y: 0.0, z, ..SensorPose::default() };
    let turned = |pose: SensorPose, roll: f64| SensorPose { roll, ..pose };
    // Turns about the sensor's own y axis, and about the vehicle's x axis.
    let tipped = |pose: SensorPose, pitch: f64| {
        let own = Pose::new(DVec3::ZERO, 0.0, pitch, 0.0);
        with_rotation(pose, &pose.ego_from_sensor().compose(&own))
    };
    let leaning = |pose: SensorPose, roll: f64| {
        let lean = Pose::new(DVec3::ZERO, roll, 0.0, 0.0);
        with_rotation(pose, &lean.compose(&pose.ego_from_sensor()))
    };
    // Upside down, or on end: others look no higher upside down.
    let to_sky = |i: usize, pose: SensorPose| match looks_down(sensors.table(numbers[i])) {
        true => turned(pose, std::f64::consts::PI),
        false => tipped(pose, -FRAC_PI_2),
    };
    let aside = |pose: SensorPose| SensorPose { roll: 0.0, pitch: 0.0, yaw: FRAC_PI_2, ..pose };
    let mut useless = base.clone();
    useless.name = "useless-sensor".to_owned();
    if useless.lidars.len() < MAX_LIDARS {
        useless.lidars.push(inside(0, 0.9));
    }
    Ok(vec![
        ("all sensors to the sky", each("sky", &to_sky)),
        ("all sensors 45° up", each("up", &|_, pose| tipped(pose, -FRAC_PI_4))),
        ("all sensors 45° down", each("down", &|_, pose| tipped(pose, FRAC_PI_4))),
        ("all sensors lean to the left", each("lean", &|_, pose| leaning(pose, -FRAC_PI_4))),
        ("all sensors look to the left", each("left", &|_, pose| aside(pose))),
        ("all inside the cabin", each("cabin", &|i, _| inside(i, 0.9))),
        ("under the car", each("under", &|i, _| inside(i, 0.1))),
        ("all sensors in one pose", each("stacked", &|_, _| base.lidars[0])),
        ("one useless sensor more", useless),
    ])
}

/// A pose with the angles of another, where it stands.
fn with_rotation(pose: SensorPose, turned: &Pose) -> SensorPose {
    let SensorPose { roll, pitch, yaw, .. } = SensorPose::from(turned);
    SensorPose { roll, pitch, yaw, ..pose }
}

/// The placement as a mechanic would mount it: each coordinate off by up to `metres`, each angle by up
/// to `radians`, evenly.
pub(crate) fn jittered(placement: &Placement, metres: f64, radians: f64, seed: u64) -> Placement {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut off = |by: f64| rng.random_range(-by..=by);
    let lidars = placement.lidars.iter().map(|pose| SensorPose {
        x: pose.x + off(metres),
        y: pose.y + off(metres),
        z: pose.z + off(metres),
        roll: pose.roll + off(radians),
        pitch: pose.pitch + off(radians),
        yaw: pose.yaw + off(radians),
        ..*pose
    });
    Placement { name: placement.name.clone(), lidars: lidars.collect() }
}

/// A scene's P-SOG changed, and the frames to score it over.
pub(super) struct AlteredWorld {
    pub(super) name: String,
    pub(super) psog: Arc<Psog>,
    pub(super) frames: u32,
}

/// Every change of the model that the scene allows.
pub(super) fn changed_worlds(job: &JobScene) -> Result<Vec<AlteredWorld>, JobError> {
    let (scene, psog, all) = (job.scene(), job.psog(|_| true)?, job.frame_numbers().len() as u32);
    let mut worlds = Vec::new();
    if all > 1 {
        let (name, frames) = ("frames halved".to_owned(), all.div_ceil(2));
        worlds.push(AlteredWorld { name, psog: psog.clone(), frames });
    }
    let mut over_all =
        |(name, psog)| worlds.push(AlteredWorld { name, psog: Arc::new(psog), frames: all });
    if !psog.classes().is_empty() {
        over_all(without_largest_class(&psog)?);
        over_all(("votes tied between two classes".into(), with_tied_votes(&psog)?));
    }
    if scene.has_geometry() {
        on_other_grids(scene)?.into_iter().for_each(over_all);
    }
    Ok(worlds)
}

/// The P-SOG without the class that occurs most.
fn without_largest_class(psog: &Psog) -> Result<(String, Psog), PsogError> {
    let sum = |class: usize| psog.rows().map(|row| u64::from(row[class])).sum::<u64>();
    let class = (0..psog.classes().len()).max_by_key(|&class| sum(class)).unwrap_or(0);
    let psog_without = with_rows(psog, |row| row[class] = 0)?;
    Ok((format!("class {} absent", psog.classes()[class]), psog_without))
}

/// The P-SOG with half of the frames of each voxel's commonest class given to the class after it.
fn with_tied_votes(psog: &Psog) -> Result<Psog, PsogError> {
    with_rows(psog, |row| {
        let top = (0..row.len()).max_by_key(|&class| row[class]).unwrap_or(0);
        let moved = row[top] / 2;
        row[top] -= moved;
        let next = (top + 1) % row.len();
        row[next] += moved;
    })
}

fn with_rows(psog: &Psog, change: impl Fn(&mut [u16])) -> Result<Psog, PsogError> {
    let mut counts = psog.counts().to_vec();
    counts.chunks_mut(psog.classes().len()).for_each(change);
    let (roi, frames) = (*psog.roi(), psog.frames());
    Psog::new(roi, frames, psog.classes().to_vec(), psog.index().to_vec(), counts)
}

/// The scene scanned again on other grids.
fn on_other_grids(scene: &Scene) -> Result<Vec<(String, Psog)>, PsogError> {
    let settings = match scene.psog_source() {
        PsogSource::Scan(settings) => *settings,
        PsogSource::File(_) => ScanSettings::default_of(scene),
    };
    let bounds = scene.roi();
    let (min, max, voxel) = (bounds.min, bounds.max, bounds.voxel);
    let shifted = [0, 1, 2].map(|k| min[k] - 0.5 * voxel[k]);
    let inner = |corner: [f64; 3]| [0.75 * corner[0], 0.75 * corner[1], corner[2]];
    let grids = [
        ("grid shifted by half a voxel", Roi::new(shifted, voxel, bounds.shape)?),
        ("voxels twice as large", Roi::from_bounds(min, max, voxel.map(|v| 2.0 * v))?),
        ("region of three quarters", Roi::from_bounds(inner(min), inner(max), voxel)?),
    ];
    let scanned = grids
        .into_iter()
        .map(|(name, roi)| Ok((name.to_owned(), scan_scene(scene, &roi, &settings, |_| true)?.0)));
    scanned.collect()
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use crate::problem::{Content, Tally};
    use crate::targets::BlindSector;
    use crate::vehicle::{SensorModel, SensorName};

    fn scores(covered: u64, gain: u64, reference: Option<&Tally>) -> Scores {
        let content = Content::new(vec!["a".into()], vec![], &[vec![]], false);
        let tally =
            Tally { covered, entropy: [gain << 28, 0, 0, 0], beams: 10, ..Tally::zero(1, 1) };
        Scores::new("x", &tally, &content, 1, false, reference)
    }

    #[test]
    fn a_score_that_likes_blindness_is_fooled_unless_a_guard_speaks() {
        let base = scores(100, 50, None);
        let seeing = Tally { entropy: [50 << 28, 0, 0, 0], ..Tally::zero(1, 1) };
        let blind = Trial::new("blind", &base, scores(100, 5, Some(&seeing)));
        assert_eq!(blind.fooled, ["m_sog", "m_sog_scaled"]);
        assert_eq!(blind.verdict, TrialResult::Caught);
        assert_eq!(Trial::new("blind", &base, scores(100, 5, None)).verdict, TrialResult::Fooled);
        // Equal information, more of it near: only the car that is lost speaks against it.
        let sector = BlindSector::lost([-15.0, 15.0], [25.0, 50.0]);
        let near =
            |near_gain, guards| Scores { near_gain: Some(near_gain), guards, ..base.clone() };
        let lost = || vec![Guard::BlindSector(sector.clone())];
        let (seeing, away) = (near(0.5, Vec::new()), near(0.6, lost()));
        assert_eq!(Trial::new("away", &seeing, away.clone()).verdict, TrialResult::Caught);
        assert_eq!(
            Trial::new("as blind", &near(0.5, lost()), away).verdict,
            TrialResult::NotFooled
        );
        // A sector within the base's is none of the attempt's making, whatever its worst bearing.
        let part = BlindSector { bearings: [-7.5, 15.0], worst: 7.5, ..sector.clone() };
        let wider = BlindSector { bearings: [-15.0, 37.5], ..sector.clone() };
        for (of_attempt, verdict) in [(part, TrialResult::NotFooled), (wider, TrialResult::Caught)]
        {
            let attempt = near(0.6, vec![Guard::BlindSector(of_attempt)]);
            assert_eq!(Trial::new("part", &near(0.5, lost()), attempt).verdict, verdict);
        }
        let needless = |share| vec![Guard::RedundantLidar { lidar: 1, share }];
        for (share, verdict) in [(0.006, TrialResult::NotFooled), (0.004, TrialResult::Caught)] {
            let attempt = near(0.6, needless(share));
            assert_eq!(
                Trial::new("needless", &near(0.5, needless(0.005)), attempt).verdict,
                verdict
            );
        }
        let worse = Trial::new("worse", &base, scores(90, 49, None));
        assert_eq!((worse.fooled.len(), worse.verdict), (0, TrialResult::NotFooled));
    }

    #[test]
    fn a_guard_of_the_base_catches_no_attempt_that_is_no_worse() {
        let with = |near_gain, guard: Option<Guard>| {
            let guards = guard.into_iter().collect();
            Scores { near_gain: Some(near_gain), guards, ..scores(100, 50, None) }
        };
        let unseen = |share| Guard::ClassUnseen { class: "car".into(), share };
        let own = |lidar, share| Guard::SelfHit { lidar, mount: None, share, frame: None };
        let there =
            |share| Guard::InScene { scene: "street".into(), guard: Box::new(own(0, share)) };
        let hits = |hit_share| Guard::FewHits { hit_share, reference: 0.9 };
        let low = |share| Guard::LowInformation { share };
        let short = |lost| Guard::ShortSight { lost };
        // The guard of the base, one no worse, and one that is worse or of something else.
        for [known, no_worse, worse] in [
            [short(0.05), short(0.04), short(0.06)],
            [low(0.4), low(0.4), low(0.3)],
            [hits(0.2), hits(0.3), hits(0.1)],
            [unseen(0.05), unseen(0.06), unseen(0.04)],
            [own(0, 0.4), own(0, 0.3), own(1, 0.3)],
            [there(0.4), there(0.4), there(0.5)],
            [Guard::CoversNothing, Guard::CoversNothing, short(0.02)],
        ] {
            let base = with(0.5, Some(known));
            for (guard, verdict) in
                [(no_worse, TrialResult::NotFooled), (worse, TrialResult::Caught)]
            {
                let words = guard.to_string();
                let trial = Trial::new("guarded", &base, with(0.6, Some(guard)));
                assert_eq!((trial.fooled, trial.verdict), (vec!["near_gain"], verdict), "{words}");
            }
        }
        let base = with(0.5, Some(short(0.05)));
        let blind = Scores { guards: vec![short(0.05)], ..scores(100, 5, None) };
        let blind = Trial::new("blind", &base, blind);
        assert_eq!(blind.verdict, TrialResult::Fooled, "nothing but the base's own guard speaks");
    }

    #[test]
    fn s_mig_alone_fools_nobody() {
        let with = |s_mig, scores| Scores { s_mig: Some(s_mig), ..scores };
        let base = with(-50.0, scores(100, 50, None));
        // Two per cent of the gain are lost, and no other score likes it.
        let less = Trial::new("less", &base, with(-45.0, scores(90, 49, None)));
        assert_eq!((&less.fooled[..], less.verdict), (&["s_mig"][..], TrialResult::NotFooled));
        let both = Trial::new("both", &base, with(-45.0, scores(100, 45, None)));
        assert_eq!(both.verdict, TrialResult::Fooled, "{:?}", both.fooled);
    }

    #[test]
    fn sensors_that_look_no_higher_upside_down_are_put_on_end() {
        let base = Placement { name: "p".into(), lidars: vec![SensorPose::at(0.0, 0.0, 2.0)] };
        let sky = |channels: &[(f64, f64)]| {
            let table = BeamTable::spinning(channels, 8, 50.0).unwrap();
            let attempts = gaming_placements(&base, &Sensors::from(table)).unwrap();
            attempts[0].1.lidars[0].ego_from_sensor().rotation
        };
        let down = sky(&[(-25.0, 0.0), (5.0, 0.0)]);
        assert!((down.z_axis.z + 1.0).abs() < 1e-12, "{down}");
        let level = sky(&[(-25.0, 0.0), (15.0, 0.0)]);
        assert!((level.x_axis.z - 1.0).abs() < 1e-12, "{level}");
    }

    #[test]
    fn each_model_of_a_vehicle_is_turned_as_it_needs() {
        let model = |name: &str, upper: f64| {
            let table = BeamTable::spinning(&[(-25.0, 0.0), (upper, 0.0)], 8, 50.0).unwrap();
            SensorModel { name: SensorName::new(name).unwrap(), ..SensorModel::plain(table) }
        };
        let sensors = Sensors::new(vec![model("down", 5.0), model("level", 15.0)]).unwrap();
        let [down, level] = [0, 1].map(|k| sensors.names()[k]);
        let pose = |sensor, yaw| SensorPose { sensor, yaw, ..SensorPose::at(0.0, 0.0, 2.0) };
        let lidars = vec![pose(level, 1.0), pose(down, -2.0)];
        let attempts = gaming_placements(&Placement { name: "p".into(), lidars }, &sensors);
        let attempts = attempts.unwrap();
        // Own axes in the vehicle's frame, of both LiDARs.
        let of = |name: &str| {
            let (_, attempt) = attempts.iter().find(|(of, _)| *of == name).unwrap();
            let models: Vec<SensorName> = attempt.lidars.iter().map(|pose| pose.sensor).collect();
            assert_eq!(models, [level, down], "{name}");
            [0, 1].map(|k| attempt.lidars[k].ego_from_sensor().rotation)
        };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let [on_end, upside_down] = of("all sensors to the sky");
        assert!(near(on_end.x_axis.z, 1.0) && near(upside_down.z_axis.z, -1.0));
        for (name, rise) in [("all sensors 45° up", half), ("all sensors 45° down", -half)] {
            assert!(of(name).iter().all(|axes| near(axes.x_axis.z, rise)), "{name}");
        }
        // The mast of each leans to the left, whichever way it looks.
        let left = |axes: &DMat3| near(axes.z_axis.y, half) && near(axes.z_axis.z, half);
        assert!(of("all sensors lean to the left").iter().all(left));
        assert!(of("all sensors look to the left").iter().all(|axes| near(axes.x_axis.y, 1.0)));
    }

    #[test]
    fn counts_are_changed_as_the_names_say() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 1, 1]).unwrap();
        let classes = vec!["car".to_owned(), "pole".to_owned()];
        // T = 8: voxel 0 with 6 + 1, voxel 2 with 0 + 3.
        let psog = Psog::new(roi, 8, classes, vec![0, 2], vec![6, 1, 0, 3]).unwrap();
        let (name, without) = without_largest_class(&psog).unwrap();
        assert_eq!((name.as_str(), without.counts()), ("class car absent", &[0, 1, 0, 3][..]));
        assert_eq!(with_tied_votes(&psog).unwrap().counts(), [3, 4, 1, 2]);
    }
}
