//! One pose in every format, worked out outside of this program.
//!
//! x 0.6, y −0.4, z 2.8, roll −0.3, pitch 0.1, yaw −0.5: CARLA's numbers by its own matrix, the quaternion
//! by transforms3d: `python3 -c "from transforms3d.euler import euler2quat as q; print(q(-.3, .1, -.5))"`.

use sightline_scene::vehicle::{
    Lidar, Response, SensorName, SensorPose, SpinPhase, Vehicle, VehicleSensor,
};

use super::{doubts, error, read, source};
use crate::rig::{
    Fan, ImportSettings, Models, Mounting, Rig, RigFormat, RigLidar, RigSource, export,
    import_texts,
};

const POSE: SensorPose = SensorPose::from_values([0.6, -0.4, 2.8, -0.3, 0.1, -0.5]);

const AUTOWARE: &str = "base_link:
  sensor_kit_base_link: {x: 0.6, y: -0.4, z: 0.8, roll: 0.0, pitch: 0.0, yaw: 0.0}
  gnss_link: {x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}
sensor_kit_base_link:
  velodyne_top_base_link: {x: 0, y: 0, z: 2, roll: -0.3, pitch: 0.1, yaw: -0.5}
";
const URDF: &str = r#"<robot name="r"><joint name="j" type="fixed">
  <origin xyz="0.6 -0.4 2.8" rpy="-0.3 0.1 -0.5"/><parent link="base_link"/><child link="lidar"/></joint></robot>"#;
const SDF: &str = r#"<sdf version="1.9"><model name="r"><link name="base_link"/>
  <link name="lidar"><pose relative_to="base_link">0.6 -0.4 2.8 -0.3 0.1 -0.5</pose></link></model></sdf>"#;
const SDF_DEGREES: &str = r#"<sdf version="1.9"><model name="r"><link name="body">
  <sensor name="top" type="gpu_lidar"><pose degrees="true">0.6 -0.4 2.8 -17.188734 5.729578 -28.647890</pose></sensor>
  </link></model></sdf>"#;
const LAUNCH_FLAGS: &str = r#"<launch><arg name="height" default="2.8"/>
  <group if="false"><node pkg="tf2_ros" exec="static_transform_publisher" args="9 9 9 0 0 0 base_link lidar_9"/></group>
  <node pkg="tf2_ros" exec="static_transform_publisher" unless="false" args="--x 0.6 --y -0.4 --z $(var height)
   --roll -0.3 --pitch 0.1 --yaw -0.5 --frame-id base_link --child-frame-id lidar_0"/></launch>"#;
const LAUNCH_XML: &str = r#"<launch><node pkg="tf2_ros" exec="static_transform_publisher"
  args="--x 0.6 --y -0.4 --z 2.8 --qw 0.9586831 --qx -0.13238531 --qy 0.08480705 --qz -0.23708355
        --frame-id base_link --child-frame-id lidar_0"/></launch>"#;
/// The order before Humble, yaw, pitch, roll, and the period of ROS 1.
const LAUNCH_ROS1: &str = r#"<launch><node pkg="tf" type="static_transform_publisher" name="n"
  args="0.6 -0.4 2.8 -0.5 0.1 -0.3 base_link lidar_0 100"/></launch>"#;
const LAUNCH_OLD: &str = r#"<launch><node pkg="tf2_ros" exec="static_transform_publisher"
  args="0.6 -0.4 2.8 -0.5 0.1 -0.3 base_link lidar_0"/></launch>"#;
const CARLA: &str = r#"[
  {"type": "sensor.camera.rgb", "x": 0.7, "id": "Left"},
  {"type": "sensor.lidar.ray_cast", "x": 0.6, "y": 0.4, "z": 2.8, "roll": -17.1887, "pitch": -5.7296,
   "yaw": 28.6479, "id": "LIDAR"}]"#;
const OBJECTS: &str = r#"{"objects": [{"type": "vehicle.x", "id": "ego_vehicle", "sensors": [
  {"type": "sensor.other.gnss", "id": "gnss", "spawn_point": {"x": 1.0, "y": 0.0, "z": 2.0}},
  {"type": "sensor.lidar.ray_cast_semantic", "id": "lidar", "channels": 16, "upper_fov": 15, "lower_fov": -15,
   "spawn_point": {"x": 0.6, "y": -0.4, "z": 2.8, "roll": -17.1887, "pitch": 5.7296, "yaw": -28.6479}}]}]}"#;
const JSON: &str = r#"{"placements": [{"name": "r", "lidars": [
  {"x": 0.6, "y": -0.4, "z": 2.8, "roll": -0.3, "pitch": 0.1, "yaw": -0.5, "sensor": "VLP-16"}]}]}"#;

fn close(a: &SensorPose, b: &SensorPose, tolerance: f64) -> bool {
    a.values().into_iter().zip(b.values()).all(|(a, b)| (a - b).abs() <= tolerance)
}

#[test]
fn the_worked_pose_is_read_in_every_format() {
    for (format, text, tolerance) in [
        (RigFormat::Autoware, AUTOWARE, 1e-15),
        (RigFormat::Urdf, URDF, 0.0),
        (RigFormat::Sdf, SDF, 0.0),
        (RigFormat::Sdf, SDF_DEGREES, 1e-8),
        (RigFormat::Ros2Launch, LAUNCH_FLAGS, 0.0),
        (RigFormat::Ros2Launch, LAUNCH_XML, 2e-8),
        (RigFormat::Ros2Launch, LAUNCH_OLD, 0.0),
        (RigFormat::Ros2Launch, LAUNCH_ROS1, 0.0),
        (RigFormat::Carla, CARLA, 1e-6),
        (RigFormat::CarlaObjects, OBJECTS, 1e-6),
        (RigFormat::Json, JSON, 0.0),
    ] {
        let imported = read(text).unwrap();
        assert_eq!(imported.format, format);
        let [lidar] = &imported.rig.lidars[..] else { panic!("{imported:?}") };
        assert!(close(&lidar.pose, &POSE, tolerance), "{format:?}: {:?}", lidar.pose);
    }
    let sensor = |text| read(text).unwrap().rig.lidars[0].sensor.clone();
    assert_eq!(sensor(OBJECTS).as_deref(), Some("VLP-16"));
    assert_eq!(sensor(CARLA), None);
}

fn worked(sensor: Option<&str>) -> Rig {
    let sensor = sensor.map(str::to_owned);
    let lidars = vec![RigLidar { frame: "lidar_0".to_owned(), sensor, pose: POSE }];
    Rig { name: "r".to_owned(), lidars }
}

fn written(format: RigFormat) -> String {
    let exported = export(&worked(None), format, &Mounting::default(), &Models::default()).unwrap();
    exported.files.into_iter().map(|file| file.text).collect()
}

#[test]
fn the_worked_pose_is_written_in_every_format() {
    let holds = |format, part: &str| {
        let text = written(format);
        let spaceless = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(spaceless(&text).contains(part), "{text}");
    };
    let six = "x: 0.6 y: -0.4 z: 2.8 roll: -0.3 pitch: 0.1 yaw: -0.5";
    holds(RigFormat::Autoware, &format!("lidar_0: {six}"));
    holds(RigFormat::Urdf, r#"<origin xyz="0.6 -0.4 2.8" rpy="-0.3 0.1 -0.5"/>"#);
    holds(RigFormat::Sdf, r#"<pose relative_to="base_link">0.6 -0.4 2.8 -0.3 0.1 -0.5</pose>"#);
    holds(RigFormat::Ros2Launch, "--roll -0.3 --pitch 0.1 --yaw -0.5");
    let degrees = |format| {
        let text = written(format);
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        let place = match format {
            RigFormat::Carla => &value[0],
            _ => &value["objects"][0]["sensors"][0]["spawn_point"],
        };
        SensorPose::FIELDS.map(|key| (place[key].as_f64().unwrap() * 1e4).round() / 1e4)
    };
    assert_eq!(degrees(RigFormat::Carla), [0.6, 0.4, 2.8, -17.1887, -5.7296, 28.6479]);
    assert_eq!(degrees(RigFormat::CarlaObjects), [0.6, -0.4, 2.8, -17.1887, 5.7296, -28.6479]);
}

/// R·(0, 0, 1) of the worked rotation, by transforms3d: (0.2253789, 0.2136184, 0.9505638).
#[test]
fn the_optical_centre_lies_up_the_sensors_own_z() {
    let up = [0.225_378_937_348_114_04, 0.213_618_406_260_669_86, 0.950_563_785_922_063_4];
    let autoware = |settings: &ImportSettings| {
        let imported = import_texts(&[source("both.yaml", AUTOWARE)], settings).unwrap();
        (imported.rig.lidars[0].pose, imported.notes)
    };
    let frame = "velodyne_top_base_link".to_owned();
    let named = |sensor: &str| ImportSettings {
        sensors: [(frame.clone(), sensor.to_owned())].into(),
        ..ImportSettings::default()
    };
    let given = ImportSettings {
        mounting: Mounting {
            optical_heights: [(frame.clone(), 1.5)].into(),
            ..Mounting::default()
        },
        ..named("VLP-16")
    };
    for (settings, height) in
        [(named("VLP-16"), 0.0377), (named("vls128"), 0.06611), (named("other"), 0.0), (given, 1.5)]
    {
        let (pose, notes) = autoware(&settings);
        let [x, y, z] = up.map(|v| v * height);
        let wanted = SensorPose { x: 0.6 + x, y: -0.4 + y, z: 2.8 + z, ..POSE };
        assert!(close(&pose, &wanted, 1e-15), "{pose:?}, not {wanted:?}");
        assert_eq!(notes.len(), usize::from(height == 0.0), "{notes:?}");
        // A model is named, so that naming one is no help.
        let mend = "give --optical-height other=METRES";
        assert!(notes.iter().all(|note| note.text().ends_with(mend)), "{notes:?}");
    }
    let (_, notes) = autoware(&ImportSettings::default());
    let mend = format!("give --sensor {frame}=MODEL or --optical-height {frame}=METRES");
    assert!(notes.iter().any(|note| note.text().ends_with(&mend)), "{notes:?}");
}

#[test]
fn the_base_link_is_moved_and_moved_back() {
    let mounting = Mounting { base_link: [-1.4, 0.0, 0.25], ..Mounting::default() };
    let text =
        &export(&worked(None), RigFormat::Urdf, &mounting, &Models::default()).unwrap().files[0]
            .text;
    assert!(text.contains("xyz=\"2 -0.4 2.55\""), "{text}");
    let settings = ImportSettings { mounting, ..ImportSettings::default() };
    let read = import_texts(&[source("r.urdf", text)], &settings).unwrap();
    assert!(close(&read.rig.lidars[0].pose, &POSE, 1e-15));
}

fn table(elevations: &[f64], offset: f64, azimuth: Option<[f64; 2]>) -> Lidar {
    Lidar::Spinning {
        elevations: elevations.to_vec(),
        azimuth_offsets: vec![offset; elevations.len()],
        azimuth_steps: 500,
        azimuth,
        range: 80.0,
    }
}

/// Models of a vehicle with one LiDAR without a name, which sees nothing within half a metre.
fn models(lidar: Lidar) -> Models {
    turning(lidar, Some(12.5))
}

/// Like [`models`], of another number of turns a second; the usual one where none is given.
fn turning(lidar: Lidar, rate: Option<f64>) -> Models {
    let usual = Response::usual(lidar.range());
    let response = Response { min_range: 0.5, rate: rate.unwrap_or(usual.rate), ..usual };
    let has_rate = rate.is_some();
    let (name, phase) = (SensorName::NONE, SpinPhase::Locked(0.0));
    Models::from(&Vehicle {
        sensors: vec![VehicleSensor {
            name,
            lidar,
            phase,
            price: 0.0,
            has_price: false,
            response,
            has_rate,
        }],
        ..Vehicle::default()
    })
}

#[test]
fn what_a_format_cannot_say_is_said() {
    let warnings = |sensor, format, models: &Models| {
        export(&worked(sensor), format, &Mounting::default(), models).unwrap().warnings.join("\n")
    };
    let none = Models::default();
    let even = models(table(&[-9.0, 0.0], 0.0, None));
    assert!(warnings(Some("VLP-16"), RigFormat::Carla, &none).contains("--sensor lidar_0=VLP-16"));
    assert_eq!(warnings(None, RigFormat::Carla, &even), "");
    let uneven = warnings(Some("VLS-128"), RigFormat::CarlaObjects, &even);
    assert!(uneven.contains("even steps only") && uneven.contains("VLS-128"), "{uneven}");
    let uneven = models(table(&[-9.0, -8.0, 0.0], 0.0, None));
    for format in [RigFormat::Carla, RigFormat::Sdf] {
        assert!(warnings(None, format, &uneven).contains("of the scene's sensor are uneven"));
        assert!(warnings(None, format, &none).contains("--scene"));
    }
    // Even channels with azimuth offsets, and uneven ones.
    let offset = |elevations: &[f64]| models(table(elevations, 1.0, None));
    for (format, program) in [(RigFormat::Urdf, "Gazebo"), (RigFormat::Carla, "CARLA")] {
        let said = format!(
            "`lidar_0`: the scene's sensor has azimuth offsets, which {program} cannot cast; they are lost, and its \
             channels fire in one line"
        );
        assert_eq!(warnings(None, format, &offset(&[-9.0, 0.0])), said);
        let both = warnings(None, format, &offset(&[-9.0, -8.0, 0.0]));
        assert_holds!(both, "are uneven; only", "are kept; its azimuth offsets are lost");
    }
    let aside = models(table(&[-9.0, 0.0], 0.0, Some([0.0, 90.0])));
    assert!(warnings(None, RigFormat::Carla, &aside).contains("both sides of straight ahead"));
    assert_eq!(warnings(None, RigFormat::Urdf, &aside), "");
    let urdf = export(&worked(None), RigFormat::Urdf, &Mounting::default(), &aside).unwrap();
    assert!(urdf.files[0].text.contains("<range><min>0.5</min>"), "{}", urdf.files[0].text);
    let list = models(Lidar::Directions { directions: vec![[1.0, 0.0, 0.0]], range: 9.0 });
    assert!(warnings(None, RigFormat::Urdf, &list).contains("list of directions"));
    assert!(warnings(Some("VLP-16"), RigFormat::Autoware, &none).contains("--optical-height"));
    let usual = "10 turns a second are written for `lidar_0`: no `rate` is given in the vehicle or its sensor files";
    assert_eq!(warnings(Some("VLP-16"), RigFormat::Urdf, &none), usual);
    let slow = |rate| turning(table(&[-9.0, 0.0], 0.0, None), rate);
    assert_eq!(warnings(None, RigFormat::CarlaObjects, &slow(None)), usual);
    assert_eq!(
        warnings(None, RigFormat::CarlaObjects, &slow(Some(10.0))),
        "",
        "a rate that is given"
    );

    let mut rig = worked(Some("VLP-16"));
    rig.lidars[0].pose.x = 3.5;
    rig.lidars.extend([1, 2].map(|k| RigLidar { frame: format!("l{k}"), ..rig.lidars[0].clone() }));
    let exported = export(&rig, RigFormat::Carla, &Mounting::default(), &none).unwrap();
    assert_holds!(exported.warnings.join("\n"), "at most 2 LiDARs, here are 3", "4.50 m");
}

/// 2 channels × 500 steps × 12.5 turns a second are 12 500 points a second.
#[test]
fn simulators_are_told_the_turns_a_second_of_the_model() {
    let even = models(table(&[-9.0, 0.0], 0.0, None));
    let text = |format| {
        let files = export(&worked(None), format, &Mounting::default(), &even).unwrap().files;
        files[0].text.split_whitespace().collect::<String>()
    };
    for format in [RigFormat::Urdf, RigFormat::Sdf] {
        assert!(text(format).contains("<update_rate>12.5</update_rate>"), "{}", text(format));
    }
    for format in [RigFormat::Carla, RigFormat::CarlaObjects] {
        for part in ["\"rotation_frequency\":12.5", "\"points_per_second\":12500"] {
            assert!(text(format).contains(part), "{}", text(format));
        }
    }
}

#[test]
fn a_table_of_channels_is_a_fan_even_or_not() {
    let wanted = Fan {
        channels: 3,
        lower: -20.0,
        upper: 4.0,
        range: 80.0,
        azimuth_steps: 500,
        azimuth: None,
        rate: 10.0,
        is_even: true,
        is_straight: true,
    };
    assert_eq!(wanted.points_a_second(), 15_000);
    let fan = |elevations: &[f64], offset| Fan::of(&table(elevations, offset, None)).unwrap();
    assert_eq!(fan(&[-20.0, 4.0, -8.0], 0.0), wanted);
    assert!(!fan(&[-20.0, 4.0, -7.9], 0.0).is_even);
    let offset = fan(&[-20.0, 4.0, -8.0], 1.0);
    assert!(offset.is_even && !offset.is_straight);
    let sector = Fan::of(&table(&[-20.0, 4.0, -8.0], 0.0, Some([-60.0, 60.0]))).unwrap();
    assert_eq!((sector.horizontal(), sector.is_centred()), (120.0, true));
}

#[test]
fn files_of_one_rig_are_read_together_and_others_are_not() {
    let (sensors, kit) = AUTOWARE.split_at(AUTOWARE.find("\nsensor_kit").unwrap() + 1);
    let pair: [RigSource; 2] = [source("a.yaml", sensors), source("b.yaml", kit)];
    let read = |files: &[RigSource]| import_texts(files, &ImportSettings::default());
    assert_eq!(read(&pair).unwrap().left_out, ["sensor_kit_base_link", "gnss_link"]);
    assert_holds!(read(&pair[1..]).unwrap_err(), "has the parent `sensor_kit_base_link`");
    let two = [source("a.json", OBJECTS), source("b.json", OBJECTS)];
    assert_holds!(read(&two).unwrap_err(), "b.json", "one at a time");
}

#[test]
fn a_list_of_values_is_read_as_its_text() {
    let list = serde_json::from_str(CARLA).unwrap();
    let of_values = crate::rig::from_carla_sensors(&list, &ImportSettings::default()).unwrap();
    assert_eq!(of_values.rig, read(CARLA).unwrap().rig);
}

#[test]
fn a_narrow_fan_and_unknown_keys_of_carla_are_named() {
    let text = r#"[{"type": "sensor.lidar.ray_cast", "x": 1, "y": 0, "z": 2, "id": "a", "channels": 16,
        "lower_fov": -15, "upper_fov": 15, "horizontal_fov": 120, "colour": 3, "range": 50}]"#;
    let narrow = read(text).unwrap();
    let notes: Vec<&str> = narrow.notes.iter().map(|note| note.text()).collect();
    assert_holds!(notes[0], "`horizontal_fov` 120");
    assert_holds!(notes[1], "`colour`");
    assert!(!notes[1].contains("range"), "{notes:?}");
    assert_eq!(narrow.rig.lidars[0].sensor, None);
    let whole = read(&text.replace("120", "360")).unwrap();
    assert_eq!(whole.rig.lidars[0].sensor.as_deref(), Some("VLP-16"));
}

/// Height of the only LiDAR of a text.
fn height(text: &str) -> f64 {
    read(text).unwrap().rig.lidars[0].pose.z
}

#[test]
fn values_of_a_group_end_with_it_and_defaults_yield() {
    let publisher = "<node exec='static_transform_publisher' args='--z $(var z) --frame-id base_link \
                     --child-frame-id lidar'/>";
    for (text, z) in [
        ("<arg name='z' default='1'/><group><let name='z' value='5'/></group>", 1.0),
        ("<arg name='z' default='1'/><group scoped='false'><let name='z' value='5'/></group>", 5.0),
        ("<let name='z' value='5'/><arg name='z' default='1'/>", 5.0),
        ("<arg name='z' default='1'/><arg name='z' default='2'/>", 1.0),
    ] {
        assert_eq!(height(&format!("<launch>{text}{publisher}</launch>")), z, "{text}");
    }
    // `tf` of ROS 1 began frames with a slash.
    let slashed = "<launch><node pkg='tf' type='static_transform_publisher' \
                   args='0 0 2 0 0 0 /base_link /lidar 100'/></launch>";
    let read = read(slashed).unwrap().rig;
    assert_eq!((&read.lidars[0].frame[..], read.lidars[0].pose.z), ("lidar", 2.0));
}

#[test]
fn an_origin_of_urdf_is_read_whole_or_refused() {
    let joint = |inside: &str| {
        format!(
            "<robot name='r'><joint name='j' type='fixed'><parent link='base_link'/><child link='lidar'/>{inside}</joint></robot>"
        )
    };
    let turned =
        read(&joint("<origin xyz='1 0 2' quat_xyzw='0 0 0.7071067811865476 0.7071067811865476'/>"))
            .unwrap()
            .rig;
    assert!((turned.lidars[0].pose.yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-14);
    let fails = |inside: &str| error(&joint(inside));
    assert_holds!(fails("<origin xyz='1 0 2'/><origin xyz='5 0 2'/>"), "a second <origin>");
    assert_holds!(fails("<origin xyz='1 0 2' pitch='0.1'/>"), "no attribute but xyz, rpy");
    let posed = read(&joint("<pose>1 0 2 0 0 0</pose><axis xyz='0 0 1'/>")).unwrap();
    assert_holds!(doubts(&posed), "<pose>: not known here");
}
