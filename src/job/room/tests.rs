//! Tests of `room`.

use super::copies::{Held, breaks, room_of_lidar};
use super::*;
use crate::job::Tolerance;
use crate::vehicle::SensorPose;

#[test]
fn a_side_ends_before_the_first_requirement_that_breaks() {
    let at = |a: f64, b: f64| Scores {
        required: vec![Seen::of("a", a), Seen::of("b", b)],
        ..Scores::default()
    };
    let found = side(5.0, &[at(0.95, 0.9), at(0.9, 1.0), at(0.8, 0.7), at(1.0, 1.0)]);
    assert_eq!((found.holds_to, found.breaks_at), (10.0, Some(15.0)));
    assert_eq!(found.breaks.as_deref(), Some("b"));
    let all = side(5.0, &[at(1.0, 1.0), at(0.9, 0.9)]);
    assert_eq!((all.holds_to, all.breaks_at, all.breaks), (10.0, None, None));
}

#[test]
fn a_lidar_alone_is_looked_at_beyond_all_together_by_halving() {
    let usual = Tolerance::default();
    let within =
        |times: f64| Tolerance { metres: times * usual.metres, radians: times * usual.radians };
    for (together, alone) in [(0, 0), (0, 3), (2, 2), (2, 6), (6, 6)] {
        let copies: Vec<RoomOfCopies> = (0..6)
            .map(|k| RoomOfCopies {
                tolerance: within(COPIES_WITHIN[k]),
                holds_in: if k < together { 1.0 } else { 0.9 },
                error: 0.1,
                breaks: None,
            })
            .collect();
        let mut asked = 0;
        let mut share = |tolerance: Tolerance| {
            asked += 1;
            let holds = copies[..alone].iter().any(|of| of.tolerance == tolerance);
            let far = tolerance.metres / usual.metres;
            let (share, breaks) =
                if holds { (0.96, None) } else { (0.94, Some(format!("area {far}"))) };
            Ok::<_, JobError>(Some(Held { share, breaks }))
        };
        let found = room_of_lidar(&mut share, 1, &copies).unwrap().unwrap();
        let most = alone.checked_sub(1).map(|last| copies[last].tolerance);
        assert_eq!((found.lidar, found.holds_within), (1, most), "{together} {alone}");
        // The next tolerance, and the requirement that breaks there, whichever others were asked before.
        let next = copies.get(alone);
        assert_eq!(found.breaks_within, next.map(|of| of.tolerance), "{together} {alone}");
        let breaks = next.map(|_| format!("area {}", COPIES_WITHIN[alone]));
        assert_eq!(found.breaks, breaks, "{together} {alone}");
        assert!(asked <= 3 && (together < 6 || asked == 0), "{asked}");
    }
}

#[test]
fn the_requirement_that_fewest_copies_meet_breaks_first() {
    let held = |name: &str, holds_in| Seen { holds_in, ..Seen::of(name, 0.95) };
    let all = [held("a", Some(1.0)), held("b", Some(0.7)), held("c", Some(0.7)), held("d", None)];
    assert_eq!(breaks(0.6, &all).as_deref(), Some("b"));
    assert_eq!(breaks(0.95, &all), None, "enough copies meet all");
    assert_eq!(breaks(0.0, &all[3..]), None);
}

/// Level ground with a walker that comes and goes in three frames, and a vehicle that requires an area, ground and a target.
const YARD: &str = r#"{ "sightline": 1, "name": "yard", "frames": 3,
    "roi": { "min": [-12, -12, -0.4], "max": [12, 12, 2.8], "voxel": [0.4, 0.4, 0.4] },
    "static": [{ "class": "road", "plane": { "min": [-40, -40], "max": [40, 40], "z": 0 } }],
    "actors": [{ "name": "walker", "poses": [{ "x": 5, "y": 3 }, { "x": 5, "y": 5 }, { "x": -6, "y": 3 }],
        "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.5, 1.8] } }] }],
    "vehicle": { "sightline": 1, "name": "cart",
        "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [4, 2, 1.5] } }],
        "sensors": [{ "name": "a", "lidar": { "channels": 12, "fov": [-40, 0], "azimuth_steps": 120, "range": 60 } }],
        "mounts": [{ "name": "roof", "min": [-1.5, -0.8, 1.6], "max": [1.5, 0.8, 2.4], "roll": [-1, 1], "pitch": [-1, 1],
                     "count": [1, 3] }],
        "require": [{ "ground": 5, "share": 0.2 },
                    { "name": "ring", "min": [-6, -6, -0.2], "max": [6, 6, 0.6], "share": 0.2 },
                    { "target": "tyre", "from": 5, "within": 30, "share": 0.5, "without_any_one": true }] } }"#;

#[test]
fn shares_beside_a_placement_are_those_of_scores() {
    let scene = Scene::from_json(YARD, std::path::Path::new(""), "yard.json").unwrap();
    let job = Job::new(scene).engine(crate::EngineChoice::cpu());
    let (mut evaluator, _) = job.evaluator(|_| {}).unwrap();
    let lidars =
        [-1.2, 0.0, 1.2].map(|x| SensorPose { pitch: 0.1 * x, ..SensorPose::at(x, 0.3, 2.0) });
    let one = Placement { name: "one".into(), lidars: lidars.to_vec() };
    let fields: Vec<SweptField> = SweptField::all(&one).collect();
    let by = |k: usize, off: f64| fields[k].moved(&one, fields[k].value_in(&one) + off);
    let mut turned = one.clone();
    turned.lidars.iter_mut().for_each(|lidar| (lidar.z, lidar.roll) = (lidar.z - 0.05, 0.12));
    let others = [one.clone(), by(2, -0.3), by(10, 20.0), by(16, -25.0), turned];
    let scores = evaluator.scores(&others).unwrap();
    let want: Vec<Vec<f64>> = scores
        .iter()
        .map(|scores| scores.required.iter().map(|seen| seen.share).collect())
        .collect();
    let still = Moved::still((&one, 3), &mut evaluator, &mut || true).unwrap().unwrap();
    let beside = |still: &Moved, evaluator: &mut Evaluator| {
        still.shares_beside(&one, &others, evaluator, &mut || true).unwrap().unwrap()
    };
    assert_eq!(beside(&still, &mut evaluator), want);
    // Each requirement depends on the poses.
    for k in 0..3 {
        assert!(want.iter().any(|of| of[k] != want[0][k]), "{want:?}");
    }
    let fewer = beside(&still.leaving_out(&[1]), &mut evaluator);
    for (found, want) in fewer.iter().zip(&want) {
        assert_eq!((found[0], found[1], found[2]), (want[0], 1.0, want[2]));
    }
}
