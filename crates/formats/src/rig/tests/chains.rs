//! Chains of frames against matrices multiplied by hand; angles near and at gimbal lock.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Matrix, difference, matrix, product, read};
use crate::rig::frames::{compose, of_quaternion, turn};
use sightline_scene::vehicle::SensorPose;

fn pose(rng: &mut ChaCha8Rng, most_pitch: f64) -> SensorPose {
    let mut within = |most: f64| rng.random_range(-most..most);
    let [x, y, z, roll, pitch, yaw] =
        [within(3.0), within(3.0), within(3.0), within(PI), within(most_pitch), within(PI)];
    SensorPose::from_values([x, y, z, roll, pitch, yaw])
}

#[test]
fn composed_poses_are_products_of_matrices() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for round in 0..2000 {
        let (mut a, mut b) = (pose(&mut rng, PI), pose(&mut rng, PI));
        // The product looks straight up, or nearly so.
        if round % 4 == 0 {
            a = SensorPose { roll: 0.0, yaw: 0.7, ..a };
            let miss = [0.0, 1e-7, 1e-11, 1e-13][round / 4 % 4];
            b = SensorPose { pitch: FRAC_PI_2 - a.pitch + miss, yaw: 0.0, ..b };
        }
        let off = difference(&matrix(&compose(&a, &b)), &product(&matrix(&a), &matrix(&b)));
        assert!(off < 3e-12, "round {round}: {off}");
    }
}

#[test]
fn at_gimbal_lock_yaw_takes_all() {
    for (pitch, roll, yaw, all) in [(FRAC_PI_2, 0.3, 0.5, 0.2), (-FRAC_PI_2, 0.3, 0.5, 0.8)] {
        let pose = SensorPose::from_values([0.0, 0.0, 0.0, roll, pitch, yaw]);
        let [_, _, _, found @ ..] = SensorPose::from(&pose.ego_from_sensor()).values();
        assert_eq!(found[0], 0.0);
        assert!((found[1] - pitch).abs() < 1e-15 && (found[2] - all).abs() < 1e-15, "{found:?}");
    }
}

#[test]
fn a_quaternion_of_length_1_is_a_rotation() {
    // formats: w .958683, x −.132385, y .084807, z −.237084 for roll −.3, pitch .1, yaw −.5.
    let quaternion = [-0.132_385_31, 0.084_807_05, -0.237_083_55, 0.958_683_1];
    let pose = |length: f64| {
        let at = sightline_files::json::Location::top("file");
        of_quaternion([1.0, 2.0, 3.0], quaternion.map(|v| v * length), &at)
    };
    for length in [1.0, 0.9999, 1.0001] {
        let pose = pose(length).unwrap();
        for (value, wanted) in pose.values().into_iter().zip([1.0, 2.0, 3.0, -0.3, 0.1, -0.5]) {
            assert!((value - wanted).abs() < 1e-7, "{pose:?}");
        }
    }
    for length in [0.0, 1e-200, 0.9, 2.0, 1e200, f64::NAN] {
        let said = pose(length).unwrap_err().to_string();
        assert!(said.starts_with("file: `a quaternion of length "), "{said}");
    }
}

#[test]
fn small_turns_are_measured() {
    for angle in [1e-9, 1e-3, 1.0, 3.0, PI] {
        let turned = SensorPose { yaw: angle, ..SensorPose::default() };
        let level = SensorPose { yaw: 0.0, ..turned };
        let found = turn(&turned.ego_from_sensor().rotation, &level.ego_from_sensor().rotation);
        assert!((found - angle).abs() < 1e-8 * angle.max(1e-7), "{found} for {angle}");
    }
}

/// Three joints in turn, the base itself on a fourth, and the sensor's own frame on its foot.
#[test]
fn a_chain_of_joints_is_followed_from_the_base() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let poses: [SensorPose; 4] = std::array::from_fn(|_| pose(&mut rng, 1.5));
    let names = ["world", "base_link", "arm", "lidar_base", "lidar"];
    let joint = |k: usize| {
        let [x, y, z, roll, pitch, yaw] = poses[k].values();
        let (parent, child) = (names[k], names[k + 1]);
        format!(
            "<joint name='j{k}' type='fixed'><origin xyz='{x} {y} {z}' rpy='{roll} {pitch} {yaw}'/>\
             <parent link='{parent}'/><child link='{child}'/></joint>"
        )
    };
    // The last first: order tells nothing.
    let joints: String = (0..4).rev().map(joint).collect();
    let imported = read(&format!("<robot name='r'>{joints}</robot>")).unwrap();
    let [lidar] = &imported.rig.lidars[..] else { panic!("{imported:?}") };
    let wanted: Matrix = poses[1..].iter().map(matrix).reduce(|a, b| product(&a, &b)).unwrap();
    assert_eq!(lidar.frame, "lidar");
    assert!(difference(&matrix(&lidar.pose), &wanted) < 1e-14);
    assert_eq!(imported.left_out, ["lidar_base", "arm", "base_link"]);
}

/// The base is a leaf beside the LiDAR: world → base and world → lidar.
#[test]
fn a_base_beside_the_lidar_is_gone_back_to() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let (base, lidar) = (pose(&mut rng, 1.5), pose(&mut rng, 1.5));
    let link = |name: &str, pose: &SensorPose| {
        let values = pose.values().map(|v| v.to_string()).join(" ");
        format!("<link name='{name}'><pose>{values}</pose></link>")
    };
    let links = link("base_link", &base) + &link("lidar", &lidar);
    let imported = read(&format!("<sdf><model name='m'>{links}</model></sdf>")).unwrap();
    let found = matrix(&imported.rig.lidars[0].pose);
    assert!(difference(&product(&matrix(&base), &found), &matrix(&lidar)) < 1e-14);
}

/// Names of a nested model begin with its own: frames of the outer model that have such a name are others.
#[test]
fn frames_of_a_nested_model_are_its_own() {
    let link = "<link name='body'/><frame name='mast'><pose>0 0 9 0 0 0</pose></frame>";
    let lidar = "<link name='top'><sensor name='lidar' type='gpu_lidar'><pose relative_to='mast'>0 0 0.5 0 0 0</pose>\
                 </sensor></link><frame name='mast' attached_to='foot'><pose>1 0 2 0 0 0</pose></frame>\
                 <link name='foot'><pose>0 3 0 0 0 0</pose></link>";
    let inner = format!("<model name='head'><pose>0 0 10 0 0 0</pose>{lidar}</model>");
    let text = format!("<sdf><model name='m'><link name='base_link'/>{link}{inner}</model></sdf>");
    let rig = read(&text).unwrap().rig;
    assert_eq!(rig.lidars.len(), 1);
    let found = rig.lidars[0].pose.position();
    assert!((found - glam::DVec3::new(1.0, 3.0, 12.5)).length() < 1e-12, "{found}");
}
