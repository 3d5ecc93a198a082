//! Chains of frames against matrices multiplied by hand; angles near and at gimbal lock.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Matrix, difference, error, matrix, product, read, source};
use crate::rig::frames::{compose, of_quaternion, turn};
use crate::rig::{ImportSettings, import_texts};
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
        assert_begins!(pose(length).unwrap_err(), "file: `a quaternion of length ");
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

/// A robot whose link `a` stands at (1, 0, 2), with a LiDAR of a `<pose>` there.
fn with_sensor(poses: &str) -> String {
    format!(
        "<robot name='r'><link name='base_link'/><link name='a'/><joint name='j' type='fixed'><origin xyz='1 0 2'/>\
         <parent link='base_link'/><child link='a'/></joint><gazebo reference='a'>\
         <sensor name='q' type='gpu_lidar'>{poses}</sensor></gazebo></robot>"
    )
}

/// A sensor in URDF is SDF: its pose has the attributes of SDF.
#[test]
fn the_pose_of_a_sensor_in_urdf_is_one_of_sdf() {
    let [right_angle, half] = [FRAC_PI_2, std::f64::consts::FRAC_PI_6];
    for (pose, wanted) in [
        ("<pose degrees='true'>0 0 0.05 0 30 0</pose>", [1.0, 0.0, 2.05, 0.0, half, 0.0]),
        ("<pose relative_to='base_link'>1 1 3 0 0 0</pose>", [1.0, 1.0, 3.0, 0.0, 0.0, 0.0]),
        ("<pose relative_to='a'>0 0 1 0 0 0</pose>", [1.0, 0.0, 3.0, 0.0, 0.0, 0.0]),
        (
            "<pose rotation_format='quat_xyzw'>0 0 1 0 0 0.7071067811865476 0.7071067811865476</pose>",
            [1.0, 0.0, 3.0, 0.0, 0.0, right_angle],
        ),
    ] {
        let imported = read(&with_sensor(pose)).unwrap();
        assert_eq!(imported.rig.lidars.len(), 1, "{pose}");
        let found = matrix(&imported.rig.lidars[0].pose);
        assert!(difference(&found, &matrix(&SensorPose::from_values(wanted))) < 1e-14, "{pose}");
    }
    let fails = |pose: &str| error(&with_sensor(pose));
    assert_holds!(fails("<pose>0 0 1 0 0 0</pose><pose/>"), "`q`.pose: `a second <pose>`");
    assert_holds!(fails("<pose degree='true'>0 0 1 0 30 0</pose>"), "pose.degree: `true`");
    // Sensors that hang on nothing, and links that are moved, are named.
    let unread = with_sensor("").replace(
        "</robot>",
        "<gazebo><model/></gazebo><gazebo reference='a'><pose>9 0 0 0 0 0</pose></gazebo></robot>",
    );
    let told = super::doubts(&read(&unread).unwrap());
    assert_holds!(told, "<gazebo>: <model> is not read", "<gazebo> of `a`: <pose> is not read");
}

/// Poses of links, of sensors in either format, and of the base's own chain: each is doubted once.
#[test]
fn every_pose_on_the_way_to_the_base_is_doubted() {
    let sdf = |base: &str, link: &str, sensor: &str| {
        format!(
            "<sdf version='1.9'><model name='m'><link name='base_link'>{base}</link><link name='l'>{link}\
             <sensor name='lidar' type='gpu_lidar'>{sensor}</sensor></link></model></sdf>"
        )
    };
    let odd = "<pose>1000 0 2000 0 90 0</pose>";
    let doubts = |text: &str| -> Vec<String> {
        let told = super::doubts(&read(text).unwrap());
        told.lines().filter(|line| !line.contains("ground")).map(str::to_owned).collect()
    };
    for text in [sdf("", "", odd), sdf("", odd, ""), sdf(odd, "", ""), with_sensor(odd)] {
        let all = doubts(&text);
        assert_eq!(all.len(), 2, "{all:?}");
        assert!(all[0].contains("pitch = 90") && all[1].contains("1000 mm are 1"), "{all:?}");
    }
    assert_eq!(doubts(&sdf("", "", "<pose>1 0 2 0 0.5 0</pose>")), [""; 0]);
    assert!(doubts(&sdf("", "", odd))[0].starts_with("file: <link> `l`.<sensor>.pose: "));
}

#[test]
fn a_lidar_may_be_the_root_that_the_base_hangs_on() {
    let text = "<robot name='a'><link name='lidar'/><link name='base_link'/><joint name='j1' type='fixed'>\
                <origin xyz='0 0 -1'/><parent link='lidar'/><child link='base_link'/></joint></robot>";
    for frames in [Vec::new(), vec!["lidar".to_owned()]] {
        let settings = ImportSettings { frames, ..ImportSettings::default() };
        let imported = import_texts(&[source("file", text)], &settings).unwrap();
        assert_eq!(imported.left_out, ["base_link"]);
        assert_eq!(imported.rig.lidars[0].pose.values(), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    }
}

/// URDF's own `<sensor>` hangs on a link by an `<origin>`; a pose that is not read is named.
#[test]
fn sensors_of_urdf_stand_at_their_origins() {
    let robot = |inside: &str, beside: &str| {
        format!(
            "<robot name='r'><link name='base_link'/><link name='lidar_link'>{inside}</link>\
             <joint name='j' type='fixed'><parent link='base_link'/><child link='lidar_link'/>\
             <origin xyz='1 0 1'/></joint>{beside}</robot>"
        )
    };
    let of_top = |text: &str| -> Vec<String> {
        let told = super::doubts(&read(text).unwrap());
        told.lines().filter(|line| line.contains("<sensor> `top`")).map(str::to_owned).collect()
    };
    let own = |more: &str| {
        format!(
            "<sensor name='top' update_rate='10'><parent link='lidar_link'/>\
             <origin xyz='0 0 .5' rpy='0 0 1'/>{more}</sensor>"
        )
    };
    let ray = robot("", &own("<ray/>"));
    let rig = read(&ray).unwrap().rig;
    assert_eq!(rig.lidars.len(), 1, "{rig:?}");
    let expected = SensorPose::from_values([1.0, 0.0, 1.5, 0.0, 0.0, 1.0]);
    assert!(difference(&matrix(&rig.lidars[0].pose), &matrix(&expected)) < 1e-12, "{rig:?}");
    assert!(of_top(&ray).is_empty() && of_top(&robot("", &own("<camera/>"))).is_empty());
    let gazebo = "<gazebo reference='lidar_link'><sensor name='top' type='ray'><origin xyz='0 0 1'/></sensor></gazebo>";
    let posed = own("<ray/><pose>0 0 1 0 0 0</pose>");
    for (text, words) in [
        (robot("", &own("")), "is not read, nor its <origin>"),
        (robot("", &posed), "<pose> is not read; write an <origin>"),
        (
            robot(&own("<ray/>"), ""),
            "stands in the link `lidar_link` and is not read, nor its pose",
        ),
        (robot("", gazebo), "<origin> is not read here; write its pose as <pose>"),
    ] {
        let told = of_top(&text);
        assert!(told.len() == 1 && told[0].contains(words), "{words}: {told:?}");
    }
    assert_holds!(error(&robot("", &own("<ray/><origin xyz='0 0 1'/>"))), "a second <origin>");
}
