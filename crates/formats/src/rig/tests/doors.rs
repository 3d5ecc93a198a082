//! Values that a careless reader loses without a word: behind comments, under keys of another place, in repeated keys.

use super::{doubts, error, read};
use crate::rig::{ImportSettings, Models, Mounting, RigFormat, export};

/// Values of the only LiDAR's pose.
fn values(text: &str) -> [f64; 6] {
    read(text).unwrap().rig.lidars[0].pose.values()
}

#[test]
fn a_comment_in_a_text_of_xml_hides_nothing() {
    let sdf = |link: &str, sensor: &str| {
        format!(
            "<sdf version='1.9'><model name='m'><link name='base_link'/><link name='k'><pose>1 0 0 0 0 0</pose></link>\
             <joint name='j' type='fixed'><parent>base_link</parent><child><!-- the k -->k</child></joint>\
             <link name='l'>{link}<sensor name='s' type='gpu_lidar'>{sensor}</sensor></link></model></sdf>"
        )
    };
    for (link, sensor, wanted) in [
        ("<pose><!-- old 1 1 1 0 0 0 -->.6 0 1.8 0 0 0</pose>", "", [0.6, 0.0, 1.8]),
        ("<pose>.6 0 <!-- z -->1.8 0 0 0</pose>", "", [0.6, 0.0, 1.8]),
        ("<pose>0 0 1 0 0 0</pose>", "<pose><!-- up -->0 0 1 0 0 0</pose>", [0.0, 0.0, 2.0]),
        ("<pose relative_to='j'/>", "", [1.0, 0.0, 0.0]),
    ] {
        assert_eq!(values(&sdf(link, sensor))[..3], wanted, "{link}");
    }
}

#[test]
fn attributes_of_a_pose_are_read_as_xml_has_them() {
    let yaw = |attributes: &str, text: &str| {
        let text = format!(
            "<sdf version='1.9'><model name='m'><link name='base_link'/><link name='lidar'>\
             <pose {attributes}>{text}</pose></link></model></sdf>"
        );
        read(&text).map(|read| read.rig.lidars[0].pose.yaw.to_degrees()).map_err(|e| e.to_string())
    };
    assert_eq!(yaw("rotation_format='quat_xyzw'", ""), Ok(0.0));
    for word in ["True", " true ", "1"] {
        let turned = yaw(&format!("degrees='{word}'"), "0 0 1 0 0 90").unwrap();
        assert!((turned - 90.0).abs() < 1e-12, "{word}: {turned}");
    }
    assert!(yaw("degrees='yes'", "0 0 1 0 0 90").unwrap_err().contains("true or false"));
}

/// An `objects.json` with one LiDAR of these keys, and one more object.
fn objects(keys: &str, object: &str) -> String {
    format!(
        r#"{{"objects": [{object}{{"type": "vehicle.a", "id": "ego", "sensors": [
        {{"type": "sensor.lidar.ray_cast", "id": "L", {keys}}}]}}]}}"#
    )
}

#[test]
fn keys_of_a_pose_that_carla_would_not_read_are_refused() {
    let good = r#""spawn_point": {"x": 0.6, "y": 0, "z": 2, "yaw": 90}"#;
    let yaw = values(&objects(good, ""))[5].to_degrees();
    assert!((yaw - 90.0).abs() < 1e-12, "{yaw}");
    for key in ["Yaw", "yaw_deg", "pitchh", "qx"] {
        let told = error(&objects(&good.replace("yaw", key), ""));
        assert!(told.contains(&format!("sensors[0].spawn_point: unknown key `{key}`")), "{told}");
    }
    let told = error(&objects(&format!("\"yaw\": 90, {good}"), ""));
    assert!(told.contains("yaw: stands beside a `spawn_point`, which is not read; move"), "{told}");
    let radians = read(&objects(&good.replace("90", "1.5708"), "")).unwrap();
    assert!(doubts(&radians).contains("spawn_point: an angle is 1.5708°; radians?"));
    let list = r#"[{"type": "sensor.lidar.ray_cast", "id": "L", "x": 0, "y": 0, "z": 2, "spawn_point": {"x": 1}}]"#;
    let list = serde_json::from_str(list).unwrap();
    let told = crate::rig::from_carla_sensors(&list, &ImportSettings::default()).unwrap_err();
    assert!(told.to_string().contains("spawn_point: stands in a list of `sensors()`"), "{told}");
}

#[test]
fn a_lidar_in_the_world_is_no_lidar_of_the_vehicle() {
    let pose = r#""spawn_point": {"x": 0, "y": 0, "z": 2}"#;
    let world = format!(r#"{{"type": "sensor.lidar.ray_cast", "id": "W", {pose}}}, "#);
    let read = read(&objects(pose, &world)).unwrap();
    assert_eq!((read.rig.lidars.len(), &read.left_out[..]), (1, &["W".to_owned()][..]));
    assert!(doubts(&read).contains("objects[0]: a LiDAR beside the vehicles stands in the world"));
}

#[test]
fn lidars_that_hang_on_other_things_are_named() {
    let lidar = |id: &str, more: &str| {
        format!(
            r#"{{"type": "sensor.lidar.ray_cast", "id": "{id}", "spawn_point": {{"x": 1, "y": 0, "z": 2}}{more}}}"#
        )
    };
    let holds = |inner: &str| format!(r#", "attached_objects": [{inner}]"#);
    let camera =
        |inner: &str| format!(r#"{{"type": "sensor.camera.rgb", "id": "c"{}}}"#, holds(inner));
    let of = |kind: &str, sensors: &str, more: &str| {
        let text = format!(
            r#"{{"objects": [{{"type": "{kind}", "id": "e", "sensors": [{sensors}]{more}}}]}}"#
        );
        let rig = read(&text).unwrap();
        (rig.rig.lidars.len(), doubts(&rig))
    };
    let vehicle = |sensors: &str, more: &str| of("vehicle.a", sensors, more);
    let (plain, inner) = (lidar("l", ""), lidar("m", ""));
    assert_eq!(vehicle(&plain, ""), (1, String::new()));
    for (sensors, more) in [
        (lidar("l", &holds(&inner)), String::new()),
        (format!("{plain}, {}", camera(&inner)), String::new()),
        (format!("{plain}, {}", camera(&camera(&inner))), String::new()),
        (plain.clone(), holds(&inner)),
    ] {
        let (count, told) = vehicle(&sensors, &more);
        assert!(count == 1 && told.contains("attached_objects: 1 LiDAR left out"), "{told}");
        assert!(told.contains("nothing there is read: `m`; write each"), "{told}");
    }
    let list = r#"[{"type": "sensor.lidar.ray_cast", "id": "l", "x": 1, "y": 2, "z": 3, "attached_objects":
        [{"type": "sensor.lidar.ray_cast", "id": "m"}]}]"#;
    assert!(doubts(&read(list).unwrap()).contains("1 LiDAR left out"));
    // The bridge's layout by its `objects`, whatever its other words are; lists in a list and in a sensor.
    let bare = objects(r#""range": 50"#, "");
    assert_holds!(error(&bare), "objects[0].sensors[0]: `spawn_point` is missing");
    let nested =
        format!(r#"{plain}, {{"type": "sensor.other.gnss", "id": "g", "sensors": [{inner}]}}"#);
    let (count, told) = vehicle(&nested, "");
    assert!(count == 1 && told.contains("sensors[1].sensors: 1 LiDAR left out"), "{told}");
    let list = r#"[{"type": "sensor.lidar.ray_cast", "id": "l", "x": 1, "y": 2, "z": 3},
        {"type": "vehicle.a", "id": "e", "sensors": [{"type": "sensor.lidar.ray_cast", "id": "m"}]}]"#;
    let told = doubts(&read(list).unwrap());
    assert_holds!(told, "[1].sensors: 1 LiDAR left out, as nothing there is read: `m`");
    let (_, walker) = of("walker.pedestrian.0001", &plain, "");
    assert!(walker.contains("hang on a `walker.pedestrian.0001`, which is no vehicle"), "{walker}");
}

/// A LiDAR 1 m along x of a joint that turns by 90° about z at rest; by hand it stands at (0, 1).
#[test]
fn joints_that_cannot_stand_at_0_move_the_lidar() {
    let robot = |kind: &str, more: &str| {
        format!(
            "<robot name='r'><joint name='j' type='{kind}'><parent link='base_link'/><child link='arm'/>\
             <axis xyz='0 0 1'/>{more}</joint><joint name='k' type='fixed'><parent link='arm'/>\
             <child link='lidar'/><origin xyz='1 0 2'/></joint></robot>"
        )
    };
    let at = |kind: &str, more: &str| {
        let rig = read(&robot(kind, more)).unwrap();
        (rig.rig.lidars[0].pose, doubts(&rig))
    };
    let (pose, told) = at("revolute", "<limit lower='-1' upper='1'/>");
    assert_eq!((pose.x, pose.y, &told[..]), (1.0, 0.0, ""));
    let (pose, told) = at("revolute", "<limit lower='1.5707963267948966' upper='2'/>");
    assert!(pose.x.abs() < 1e-12 && (pose.y - 1.0).abs() < 1e-12, "{pose:?}");
    assert_holds!(told, "`j` (revolute) moves", "is at 1.5707963267948966 rad");
    let (pose, _) = at("prismatic", "<limit lower='-2' upper='-0.5'/>");
    assert_eq!([pose.x, pose.y, pose.z], [1.0, 0.0, 1.5]);
    let twice = robot("fixed", "")
        .replace("<robot name='r'>", "<robot name='r'><link name='a'/><link name='a'/>");
    assert!(error(&twice).contains("<link> `a`: comes twice"));
    let twice = robot("fixed", "").replace("name='k'", "name='j'");
    assert!(error(&twice).contains("<joint> `j`: comes twice"));
    let include = robot("fixed", "").replace("<robot name='r'>", "<robot name='r'><include/>");
    assert!(doubts(&read(&include).unwrap()).contains("<include> is not read"));
}

#[test]
fn sensors_behind_moving_joints_of_sdf_are_told() {
    let told = |version: &str, kind: &str, axis: &str| {
        let text = format!(
            "<sdf version='{version}'><model name='m'><link name='base_link'/><link name='arm'/>\
             <joint name='j' type='{kind}'><parent>base_link</parent><child>arm</child>{axis}</joint>\
             <link name='l'><pose>0 0 1 0 0 0</pose><sensor name='s' type='gpu_lidar'/></link>\
             <joint name='k' type='fixed'><parent>arm</parent><child>l</child></joint></model></sdf>"
        );
        read(&text).unwrap().notes
    };
    for version in ["1.6", "1.9"] {
        assert!(!told(version, "fixed", "").iter().any(|note| note.text().contains("moves")));
        for kind in ["revolute", "prismatic", "continuous", "ball", "universal"] {
            let notes = told(version, kind, "");
            let words = format!(
                "the joint `j` ({kind}) moves; what stands behind it is taken where the joint is at 0"
            );
            assert!(notes.iter().any(|note| note.text().contains(&words)), "{notes:?}");
        }
        let begins = "<axis><initial_position>0.5</initial_position></axis>";
        let notes = told(version, "revolute", begins);
        let is_told = |text: &str| text.contains("at 0, not at its <initial_position> of 0.5");
        assert!(notes.iter().any(|note| note.is_doubt() && is_told(note.text())), "{notes:?}");
        for (lower, upper, said) in [
            (0.5, 1.0, Some("at 0, below the <lower> end of its <limit>, 0.5")),
            (-1.0, -0.5, Some("at 0, above the <upper> end of its <limit>, -0.5")),
            (-1.0, 1.0, None),
        ] {
            let limit = format!("<limit><lower>{lower}</lower><upper>{upper}</upper></limit>");
            let notes = told(version, "revolute", &format!("<axis>{limit}</axis>"));
            let doubt = notes.iter().find(|note| note.is_doubt());
            assert_eq!(doubt.is_some(), said.is_some(), "{notes:?}");
            assert!(doubt.is_none_or(|note| note.text().contains(said.unwrap())), "{notes:?}");
        }
    }
}

#[test]
fn a_key_of_json_that_comes_twice_is_refused() {
    let list = r#"[{"type": "sensor.lidar.ray_cast", "id": "L", "x": 0, "y": 0, "z": 2, "x": 3}]"#;
    assert!(error(list).contains("this key comes twice: `x`; leave one out (line 1,"));
    let objects = objects(r#""spawn_point": {"x": 0, "y": 0, "z": 2, "z": 3}"#, "");
    assert!(error(&objects).contains("this key comes twice: `z`; leave one out (line 2,"));
}

/// A robot with the links `front_lidar` and `rear_lidar`, and elements beside them.
fn two_links(more: &str) -> String {
    let joint = |name: &str, x: f64| {
        format!(
            "<joint name='{name}_j' type='fixed'><parent link='base_link'/><child link='{name}'/>\
             <origin xyz='{x} 0 2'/></joint>"
        )
    };
    format!(
        "<robot name='r'>{}{}{more}</robot>",
        joint("front_lidar", 1.0),
        joint("rear_lidar", -1.0)
    )
}

fn with(link: &str, kind: &str) -> String {
    format!("<gazebo reference='{link}'><sensor name='s' type='{kind}'/></gazebo>")
}

#[test]
fn an_imu_in_a_lidar_takes_nothing_from_it() {
    let read = |more: &str| read(&two_links(more)).unwrap();
    assert_eq!(read(&with("front_lidar", "imu")).rig.lidars.len(), 2);
    let both = [with("front_lidar", "imu"), with("front_lidar", "ray")].concat();
    let one = read(&both);
    assert_eq!((one.rig.lidars.len(), &one.rig.lidars[0].frame[..]), (1, "front_lidar"));
    assert!(doubts(&one).contains("`rear_lidar` has the name of a LiDAR and is left out"));
    // A bracket below a LiDAR, and a frame on it, are parts of it.
    let typed = with("front_lidar", "ray") + &with("rear_lidar", "ray");
    let link = "<joint name='k' type='fixed'><parent link='rear_lidar'/><child link='lidar_lens'/></joint>";
    assert_eq!(doubts(&read(&(typed + link))), "");
}

#[test]
fn a_publisher_may_be_a_command() {
    let node = "<node exec='static_transform_publisher' args='1 0 2 0 0 0 base_link lidar'/>";
    let with = |command: &str| {
        let text =
            format!("<launch><executable cmd=\"{command}\" output='screen'/>{node}</launch>");
        read(&text).map(|read| read.rig.lidars.iter().map(|l| l.pose.x).collect::<Vec<_>>())
    };
    for program in [
        "ros2 run tf2_ros static_transform_publisher",
        "/opt/static_transform_publisher",
        "/opt/static_transform_publisher/bin/run --prefix=static_transform_publisher static_transform_publisher",
    ] {
        let positional = with(&format!("{program} 5 0 2 0 0 0 base_link 'lidar_b'"));
        assert_eq!(positional.unwrap(), [5.0, 1.0]);
        let flags = with(&format!("{program} --x 6 --frame-id base_link --child-frame-id lidar_b"));
        assert_eq!(flags.unwrap(), [6.0, 1.0]);
    }
    assert_eq!(with("ros2 bag play a").unwrap(), [1.0]);
    let told = with("ros2 run tf2_ros static_transform_publisher 5 0").unwrap_err().to_string();
    assert!(told.contains("<executable>[0]: `5 0` stands where a list of flags"), "{told}");
}

/// ROS splits the arguments of a node as a shell does, with `shlex` of Python.
#[test]
fn quotes_in_the_arguments_of_a_node_are_no_part_of_names() {
    let read = |args: &str| {
        read(&format!("<launch><node exec='static_transform_publisher' args='{args}'/></launch>"))
    };
    for args in [
        "1 0 2 0 0 0 \"base_link\" \"lidar\"",
        "--x \"1\" --z &apos;2&apos; --frame-id base\"_\"link --child-frame-id lid\\ar",
    ] {
        let rig = read(args).unwrap().rig;
        assert_eq!((&rig.lidars[0].frame[..], rig.lidars[0].pose.x), ("lidar", 1.0), "{args}");
    }
    let open = read("1 0 2 0 0 0 base_link \"lidar").unwrap_err().to_string();
    assert!(open.contains("stands where a text whose quotes are closed belongs"), "{open}");
}

#[test]
fn groups_in_groups_give_their_values_back() {
    let z = |inside: &str| {
        let text = format!(
            "<launch><arg name='z' default='1'/>{inside}<node exec='static_transform_publisher' \
             args='--z $(var z) --frame-id base_link --child-frame-id lidar'/></launch>"
        );
        read(&text).map(|read| read.rig.lidars[0].pose.z)
    };
    let set = |z: u8| format!("<let name='z' value='{z}'/>");
    let nested = format!("<group>{}<group>{}{}</group></group>", set(2), set(3), set(4));
    assert_eq!(z(&nested).unwrap(), 1.0);
    let open = format!("<group scoped='0'>{}<group>{}</group></group>", set(2), set(3));
    assert_eq!(z(&open).unwrap(), 2.0);
    // A name that a group brings is gone behind it.
    let gone = "<group><let name='y' value='5'/></group><let name='z' value='$(var y)'/>";
    assert_eq!(z(gone).unwrap(), 1.0);
    // A copy of all values for each group would take minutes.
    let names: String = (0..6000).map(|k| format!("<arg name='a{k}' default='1'/>")).collect();
    assert_eq!(z(&(names + &"<group/>".repeat(40_000))).unwrap(), 1.0);
}

#[test]
fn a_frame_without_a_parent_is_doubted() {
    let frame = "{x: 1, y: 0, z: 2, roll: 0, pitch: 0, yaw: 0}";
    let read = read(&format!("base_link:\n  lidar: {frame}\nlidar_rear: {frame}\n")).unwrap();
    let wanted = "file: lidar_rear: stands under no parent frame and is not read; write it under `base_link`";
    assert_eq!((read.rig.lidars.len(), &doubts(&read)[..]), (1, wanted));
}

#[test]
fn a_height_of_an_unknown_name_is_found() {
    let rig = read(&two_links("")).unwrap().rig;
    let unused = |name: &str| {
        let optical_heights = [("rear_lidar".to_owned(), 0.1), (name.to_owned(), 0.1)].into();
        let mounting = Mounting { optical_heights, ..Default::default() };
        mounting.unused(&rig).map(str::to_owned)
    };
    assert_eq!(unused("front_lidar"), None);
    assert_eq!(unused("vlp 16"), Some("vlp 16".to_owned()));
}

#[test]
fn names_that_readers_replace_by_values_are_not_written() {
    let rig = read(&two_links("")).unwrap().rig;
    let export = |rig: &_, format| export(rig, format, &Mounting::default(), &Models::default());
    for odd in ["a$(b)", "a${b}"] {
        let (mut model, mut frame) = (rig.clone(), rig.clone());
        model.lidars[0].sensor = Some(odd.to_owned());
        frame.lidars[0].frame = odd.to_owned();
        for odd_rig in [&model, &frame] {
            let told = export(odd_rig, RigFormat::Urdf).unwrap_err().to_string();
            assert!(told.contains(&format!("the name `{odd}` holds `$(` or `${{`")), "{told}");
            assert!(export(odd_rig, RigFormat::Sdf).is_ok());
        }
        assert!(export(&frame, RigFormat::Ros2Launch).is_err());
    }
    // A LiDAR called base_footprint would move all others to the ground below it.
    for taken in ["base_footprint", "car/base_footprint", "__model__", "sensor_kit_base_link"] {
        let mut frame = rig.clone();
        frame.lidars[0].frame = taken.to_owned();
        let format = RigFormat::CarlaObjects;
        let told = export(&frame, format).unwrap_err().to_string();
        assert!(
            told.contains(&format!("`{taken}` is the name of a frame of the vehicle")),
            "{told}"
        );
        assert!(export(&frame, RigFormat::Json).is_ok());
    }
}

#[test]
fn an_origin_in_the_wrong_place_and_the_axes_of_a_camera_are_doubted() {
    let urdf = |parent: &str, name: &str, rpy: &str| {
        format!(
            "<robot name='r'><link name='base_link'/><link name='{name}'/><joint name='j' type='fixed'>{parent}\
             <child link='{name}'/><origin xyz='0 0 2' rpy='{rpy}'/></joint></robot>"
        )
    };
    let plain = "<parent link='base_link'/>";
    let said = |text: &str| doubts(&read(text).unwrap());
    assert_eq!(said(&urdf(plain, "lidar", "0 0 1")), "");
    let inside = "<parent link='base_link'><origin xyz='1 0 0'/></parent>";
    let told = said(&urdf(inside, "lidar", "0 0 1"));
    assert!(told.contains("<origin> stands in <parent> and is not read"), "{told}");
    let told = said(&urdf(plain, "lidar_optical_frame", "-1.5707963 0 -1.5707963"));
    assert!(told.contains("the z axis of `lidar_optical_frame` is level"), "{told}");
    assert_eq!(said(&urdf(plain, "lidar_optical_frame", "0 0 1")), "");
}

#[test]
fn axes_of_apollo_are_doubted() {
    let text = |base: &str| {
        let at =
            "translation: {x: 0.0, y: 1.5, z: 1.4}, rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}";
        format!("header: {{frame_id: {base}}}\nchild_frame_id: velodyne64\ntransform: {{{at}}}\n")
    };
    let said = |base: &str| {
        let settings = ImportSettings { base_frame: Some(base.to_owned()), ..Default::default() };
        let source = crate::rig::RigSource { file: "extrinsics.yaml".to_owned(), text: text(base) };
        doubts(&crate::rig::import_texts(&[source], &settings).unwrap())
    };
    assert!(said("novatel").contains("has x to the right and y ahead"), "{}", said("novatel"));
    assert_eq!(said("base"), "");
}

#[test]
fn files_of_other_programs_are_named() {
    let usd = "#usda 1.0\ndef Xform \"lidar\" { double3 xformOp:translate = (1, 0, 2) }\n";
    assert!(
        error(usd).contains("is USD, which is not read; give the robot's URDF"),
        "{}",
        error(usd)
    );
    let launch = "launch:\n- node: {pkg: tf2_ros, exec: static_transform_publisher, args: 1 0 2 0 0 0 a b}\n";
    assert!(error(launch).contains("is a launch file in YAML"), "{}", error(launch));
}

/// Readers find elements by their names and places: in capitals or in a group a frame would be missing, or stand at 0.
#[test]
fn elements_in_capitals_or_at_another_place_are_doubted() {
    let joint = |tag: &str| {
        format!(
            "<{tag} name='j' type='fixed'><parent link='base_link'/><child link='lidar_b'/></{tag}>"
        )
    };
    let urdf = |more: &str| {
        format!(
            "<robot name='r'><joint name='a' type='fixed'><parent link='base_link'/><child link='lidar_a'/>\
             <origin xyz='1 0 2'/></joint>{more}</robot>"
        )
    };
    let link = "<link name='b'><pose>3 0 2 0 0 0</pose><sensor name='b' type='ray'/></link>";
    let sdf = |more: &str| {
        let first = link.replace("'b'", "'a'").replace("3 0 2", "2 0 2");
        format!("<sdf version='1.9'><model name='m'>{first}{more}</model></sdf>")
    };
    let said = |text: &str| doubts(&read(text).unwrap());
    let fine = [
        urdf(""),
        urdf("<transmission><joint name='j'><hardwareInterface/></joint></transmission>"),
        sdf(""),
        sdf(link),
    ];
    for text in fine {
        assert_eq!(said(&text), "", "{text}");
    }
    let group = format!("<group>{}</group>", joint("joint"));
    let capital = link.replace("pose>", "Pose>");
    let origin = link.replace("<pose>3 0 2 0 0 0</pose>", "<origin xyz='3 0 2'/>");
    for (text, told) in [
        (urdf(&group), "line 1: <group>/<joint>/<parent>, in place of <robot>/<joint>/<parent>"),
        (urdf(&joint("Joint")), "<robot>/<Joint>/<parent>, in place of"),
        (sdf(&format!("<group>{link}</group>")), "<group>/<link>/<sensor>, in place of"),
        (
            sdf(&link.replace("link", "Link")),
            "<Link>/<pose>, in place of <link>/<pose>, is not read (and 1 more)",
        ),
        (sdf(&capital), "<link>/<Pose>, in place of <link>/<pose>, is not read"),
        (sdf(&origin), "<origin> is not read here; write its pose as <pose>"),
    ] {
        assert!(said(&text).contains(told), "{text}: {}", said(&text));
    }
}

#[test]
fn attributes_and_poses_that_readers_lose_are_told() {
    let urdf = |axis: &str, pose: &str| {
        format!(
            "<robot name='r'><link name='base_link'/><link name='lidar'/><joint name='j' type='revolute'>\
             <parent link='base_link'/><child link='lidar'/>{axis}<limit lower='0.5' upper='1'/></joint>\
             <gazebo reference='lidar'><sensor name='s' type='ray'>{pose}</sensor></gazebo></robot>"
        )
    };
    let pose = "<pose>0 0 1 0 0 0</pose>";
    let right = read(&urdf("<axis xyz='0 0 1'/>", pose)).unwrap();
    assert_eq!(right.rig.lidars[0].pose.values(), [0.0, 0.0, 1.0, 0.0, 0.0, 0.5]);
    let told = error(&urdf("<axis XYZ='0 0 1'/>", pose));
    assert_holds!(told, "<axis> has \"XYZ\", which is not read; its attributes are xyz");
    let capitals = read(&urdf("<axis xyz='0 0 1'/>", &pose.replace("pose", "Pose"))).unwrap();
    assert_holds!(
        doubts(&capitals),
        "<gazebo>/<sensor>/<Pose>, in place of <gazebo>/<sensor>/<pose>,"
    );
    let sdf = "<sdf version='1.9'><model name='m'><link name='base_link'/><link name='lidar'/><joint name='j'>\
               <parent>base_link</parent><child>lidar</child></joint></model></sdf>";
    assert_holds!(doubts(&read(sdf).unwrap()), "the joint `j` has no `type` and is taken as fixed");
    let launch = "<launch><group If='false'><node pkg='tf2_ros' exec='static_transform_publisher' \
                  args='--z 2 --frame-id base_link --child-frame-id lidar'/></group></launch>";
    assert_holds!(error(launch), "`If` stands where an attribute in small letters belongs");
}

#[test]
fn lidars_in_one_pose_are_doubted() {
    let carla = |y: f64| {
        let one = |kind: &str, id: &str, y: f64| {
            format!(
                r#"{{"type": "sensor.lidar.{kind}", "id": "{id}", "x": 0, "y": {y}, "z": 2.4}}"#
            )
        };
        format!("[{}, {}]", one("ray_cast", "L", 0.0), one("ray_cast_semantic", "S", y))
    };
    let told = doubts(&read(&carla(0.0)).unwrap());
    assert_holds!(told, "`L` and `S` stand in one pose; one sensor that comes twice?");
    assert_eq!(doubts(&read(&carla(0.1)).unwrap()), "");
}
