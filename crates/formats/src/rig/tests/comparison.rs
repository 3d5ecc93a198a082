//! Rigs compared: moves, turns, and equal rolls, which are no mirror image.

use std::f64::consts::PI;

use crate::rig::{Asymmetry, Rig, RigLidar, compare};
use sightline_scene::vehicle::SensorPose;

fn lidar(frame: &str, values: [f64; 6]) -> RigLidar {
    RigLidar { frame: frame.to_owned(), sensor: None, pose: SensorPose::from_values(values) }
}

fn rig(lidars: &[RigLidar]) -> Rig {
    Rig { name: "rig".to_owned(), lidars: lidars.to_vec() }
}

fn close(found: [f64; 3], wanted: [f64; 3]) -> bool {
    found.into_iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12)
}

fn off(pair: &Asymmetry) -> [f64; 3] {
    [pair.moved, pair.turned, pair.tilted]
}

#[test]
fn moves_and_turns_are_told_by_frame() {
    let [a, b] = [[0.0, 0.5, 2.0, 0.0, 0.0, 0.0], [1.0, 0.0, 2.0, 0.0, 0.2, 0.0]];
    let before = rig(&[lidar("a", a), lidar("b", b)]);
    let after = rig(&[
        lidar("b", [1.0, 0.3, 2.4, 0.0, 0.2, 0.0]),
        // A turn about its own axis, which changes no beam of a full circle.
        lidar("a", [0.0, 0.5, 2.0, 0.0, 0.0, 3.0]),
    ]);
    let found = compare(&before, &after);
    let moved = found.lidars.iter().map(|l| (l.frame.as_str(), [l.moved, l.turned, l.tilted]));
    let moved: Vec<_> = moved.collect();
    assert!(moved[0].0 == "a" && close(moved[0].1, [0.0, 3.0, 0.0]), "{moved:?}");
    assert!(moved[1].0 == "b" && close(moved[1].1, [0.5, 0.0, 0.0]), "{moved:?}");

    let renamed = rig(&[lidar("x", a), lidar("y", b)]);
    assert!(compare(&before, &renamed).lidars.iter().all(|l| l.moved == 0.0));
}

#[test]
fn rigs_of_different_sizes_are_compared_by_name_then_by_distance() {
    let at = |frame: &str, x: f64| lidar(frame, [x, 0.0, 2.0, 0.0, 0.0, 0.0]);
    let before = rig(&[at("lidar_0", 0.0), at("lidar_1", 3.0), at("rear", -4.0)]);
    // `rear` is named in both, wherever it stands; a frame by number is no name.
    let after = rig(&[at("lidar_0", 3.1), at("rear", 0.0)]);
    let found = compare(&before, &after);
    let pairs: Vec<_> = found.lidars.iter().map(|l| (&*l.frame, &*l.partner)).collect();
    assert_eq!(pairs, [("lidar_1", "lidar_0"), ("rear", "rear")]);
    assert!((found.lidars[0].moved - 0.1).abs() < 1e-12 && found.lidars[1].moved == 4.0);
    assert_eq!(found.alone, [vec!["lidar_0".to_owned()], vec![]]);
    assert_eq!((found.different, found.before.len(), found.after.len()), (2, 3, 2));
    assert_eq!(compare(&after, &before).alone[1], ["lidar_0"]);
}

#[test]
fn another_model_in_the_same_pose_is_a_difference() {
    let of = |model: Option<&str>| RigLidar {
        sensor: model.map(str::to_owned),
        ..lidar("a", [0.0, 0.5, 2.0, 0.1, 0.2, 0.3])
    };
    let different = |one, other| compare(&rig(&[of(one)]), &rig(&[of(other)])).different;
    assert_eq!(different(Some("VLP-16"), Some("VLS-128")), 1);
    assert_eq!(different(Some("VLP-16"), Some("VLP-16")), 0);
    // A file without models says nothing about them.
    assert_eq!(different(Some("VLP-16"), None), 0);
    let moved = rig(&[lidar("a", [0.0, 0.501, 2.0, 0.1, 0.2, 0.3])]);
    assert_eq!(compare(&rig(&[of(None)]), &moved).different, 1);
}

/// Sides of a Lexus in the frame of its sensor kit, after they were put straight: both roll by −0.02.
#[test]
fn equal_rolls_are_no_mirror_image() {
    let left = [0.0, 0.59, -0.3, -0.02, 0.71, 1.575];
    let sides = |roll: f64| {
        let right = lidar("right", [0.0, -0.59, -0.3, roll, 0.71, -1.575]);
        let top = lidar("top", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let found = rig(&[right, top, lidar("left", left)]);
        compare(&found, &found).after
    };
    let [top, sides_found] = &sides(-0.02)[..] else { panic!("two rows") };
    assert_eq!((&sides_found.left[..], &sides_found.right[..]), ("left", "right"));
    assert!(close(off(sides_found), [0.0, 0.04, 0.04]) && sides_found.same_roll, "{sides_found:?}");
    assert!(top.left == "top" && top.right == "top" && close(off(top), [0.0; 3]));
    let image = &sides(0.02)[1];
    assert!(close(off(image), [0.0; 3]) && !image.same_roll, "{image:?}");
}

#[test]
fn a_lidar_without_a_partner_is_compared_with_its_own_image() {
    let alone = rig(&[lidar("side", [0.0, 0.25, 2.0, 0.0, 0.0, PI / 2.0])]);
    let found = compare(&alone, &alone).before;
    assert!(close(off(&found[0]), [0.5, PI, 0.0]), "{found:?}");
    assert!(!found[0].same_roll);
}
