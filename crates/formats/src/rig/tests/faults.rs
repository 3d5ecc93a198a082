//! Faulty files: each error names the file, the place and the mend.

use sightline_scene::vehicle::SensorPose;

use super::{read, source};
use crate::rig::{
    FormatError, ImportSettings, Models, Mounting, Rig, RigFormat, RigLidar, RigSource, export,
    import_texts,
};

const KIT: &str = "base_link: {kit: {x: 1, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}}\n";

/// An Autoware file with one more line, under the frame `kit`.
fn autoware(line: &str) -> String {
    format!("{KIT}kit:\n  {line}\n")
}

fn joint(parent: &str, child: &str) -> String {
    format!(
        "<joint name='{child}_j' type='fixed'><parent link='{parent}'/><child link='{child}'/></joint>"
    )
}

/// PandaSet's file of one LiDAR, with one more key of the sensor, its transform, or its rotation.
fn pandaset(sensor: &str, transform: &str, rotation: &str) -> String {
    let more = |key: &str| if key.is_empty() { String::new() } else { format!(", {key}") };
    format!(
        "{{'sensors': {{'main_pandar64': {{'transform': {{'translation': {{'x': 0, 'y': 0, 'z': 0}}, \
         'rotation': {{'w': 1, 'x': 0, 'y': 0, 'z': 0{}}}{}}}{}}}}}}}",
        more(rotation),
        more(transform),
        more(sensor)
    )
}

#[test]
fn what_is_passed_over_is_named_or_on_the_list() {
    let notes = |text: &str| {
        let notes = read(text).unwrap().notes;
        notes.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let base = "file: the vehicle's frame is taken to be `main_pandar64`";
    let known = pandaset("'intrinsics': {'fx': 1}", "", "");
    assert_eq!(notes(&known), [base]);
    let more = known.replacen('{', "{'date': 2019, 'source': 'kit', ", 1);
    assert_eq!(notes(&more), ["file: date: not known here, and not read", base]);
    let launch = "<launch><arg name='kit' default='aip'/><include file='$(find-pkg-share a)/b.launch.xml'/>\
                  <include file='$(var kit)/top.launch.xml'/><node_container/>\
                  <node exec='static_transform_publisher' args='--z 2 --frame-id base_link \
                  --child-frame-id lidar'/></launch>";
    let wanted = [
        "file: includes `$(find-pkg-share a)/b.launch.xml`, `aip/top.launch.xml`, not read; if it places \
         LiDARs, read it beside this one",
        "file: <node_container>: not known here, and not read",
    ];
    assert_eq!(notes(launch)[..2], wanted);
}

#[test]
fn each_fault_is_a_sentence() {
    let robot = |joints: &[String]| format!("<robot name='r'>{}</robot>", joints.concat());
    let publisher = |args: &str| {
        format!("<launch><node exec='static_transform_publisher' args='{args}'/></launch>")
    };
    let lidar = |numbers: &str| autoware(&format!("lidar: {{{numbers}}}"));
    let made: Vec<(String, &[&str])> = vec![
        (lidar("x: 1, y: 0, z: 0, roll: 0, yaw: 0"), &["file: kit.lidar: `pitch` is missing"]),
        (
            lidar("x: .inf, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0"),
            &["kit.lidar.x", "`.inf`", "finite"],
        ),
        (
            lidar("x: 1, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0, phase: soon"),
            &["kit.lidar.phase", "`soon`", "finite"],
        ),
        (lidar("x: front, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0"), &["kit.lidar.x", "`front`"]),
        (
            autoware("camera: {x: 1, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}"),
            &["no frame is a LiDAR", "`camera`"],
        ),
        (
            robot(&[joint("a", "lidar"), joint("lidar", "a")]),
            &["file: <joint> `lidar_j`: the frames", "`a`, `lidar`", "loop"],
        ),
        (
            robot(&[joint("base_link", "lidar"), joint("lidar", "base_link")]),
            &["file: <joint> `lidar_j`: the frames `base_link`, `lidar` hang", "loop"],
        ),
        (
            robot(&[joint("base_link", "lidar"), joint("b", "c"), joint("c", "b")]),
            &["the frames `c`, `b` hang on each other"],
        ),
        (
            robot(&[joint("base_link", "lidar").replace("<child", "<parent link='b'/><child")]),
            &["<joint> `lidar_j`.parent: `a second <parent>`"],
        ),
        (robot(&[joint("lidar", "lidar")]), &["the frames `lidar` hang on each other"]),
        (
            robot(&[joint("map", "lidar")]),
            &[
                "`lidar` has the parent `map`",
                "`frame_id: base_link`, `child_frame_id: map`",
                "--base-frame map; there are",
            ],
        ),
        (
            robot(&[joint("a", "lidar"), joint("b", "lidar").replace("lidar_j", "other_j")]),
            &["`lidar` is placed a second time"],
        ),
        (pandaset("'offset': 1", "", ""), &["main_pandar64: unknown key `offset`"]),
        (pandaset("", "'scale': 1", ""), &["transform: unknown key `scale`"]),
        (pandaset("", "", "'roll': 1"), &["rotation: unknown key `roll`"]),
        (publisher("--x $(arg x)"), &["<node>[0]: `--x $(arg x)`", "default"]),
        (publisher("1 2 3"), &["<node>[0]: `1 2 3`", "a list of flags"]),
        (publisher("--x 1 --pich 0.1 --frame-id a"), &["<node>[0]: `--pich`", "--pitch"]),
        (publisher("-z 2 --yaw 1 --frame-id a"), &["<node>[0]: `-z`", "--z"]),
        (publisher("--z 2 7 --frame-id a"), &["<node>[0]: `7`", "--x, --y, --z"]),
        (publisher("--z 1 --z 2 --frame-id a"), &["<node>[0]: `--z`", "each flag once"]),
        (
            publisher("--yaw 1 --qw 1 --frame-id a --child-frame-id b"),
            &["<node>[0]: `--yaw`", "no angle beside a quaternion"],
        ),
    ];
    let written: [(&str, &[&str]); 23] = [
        (
            "<robot xmlns:s='urn:sightline'><gazebo reference='a'><sensor name='b' type='ray' \
             s:phase='soon'/></gazebo></robot>",
            &["<sensor> `b`.phase", "`soon`", "finite"],
        ),
        (
            "<robot><joint type='fixed'><parent link='a'/></joint></robot>",
            &["<joint>: `<child>` is missing"],
        ),
        (
            "<robot><joint type='fixed' name='j'><origin xyz='1 2'/></joint></robot>",
            &["<joint> `j`.origin.xyz: `1 2`", "three numbers"],
        ),
        (
            "<robot><joint type='fixed' name='j'><origin xyz='1 2 ${h}'/></joint></robot>",
            &["xacro", "expand it first"],
        ),
        ("<robot><joint", &["file: is no XML"]),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><robot/>", &["is no XML", "DTD"]),
        ("<sdf/>", &["<sdf>: `<model>` is missing"]),
        (
            "<sdf><model><link name='lidar'><pose>1 2 3 4 5 nan</pose></link></model></sdf>",
            &["<link> `lidar`.pose: `nan` stands where a finite number belongs"],
        ),
        (
            "from launch import LaunchDescription\nNode(executable='static_transform_publisher')",
            &["file: is a Python program", "json.dump"],
        ),
        (
            "class Agent:\n    def sensors(self):\n        return [{'type': 'sensor.lidar.x'}]",
            &["file: is a Python program"],
        ),
        ("<launch><group if='$(eval 1)'/></launch>", &["<group>.if: `$(eval 1)`", "default"]),
        ("<launch><include/></launch>", &["<include>: `file` is missing"]),
        (
            "<sdf><model><link name='lidar'><pose>1 0 0 0 0 0</pose><pose>2 0 0 0 0 0</pose></link></model></sdf>",
            &["<link> `lidar`.pose: `a second <pose>`"],
        ),
        (
            r#"[{"type": "sensor.lidar.ray_cast", "id": "a", "x": 1, "y": 2, "z": 2, "Yaw": 90}]"#,
            &["[0].Yaw: `Yaw`", "small letters"],
        ),
        (
            r#"[{"type": "sensor.lidar.ray_cast", "x": 1, "y": 2, "id": "a"}]"#,
            &["file: [0]: `z` is missing"],
        ),
        (r#"[{"type": "sensor.lidar.ray_cast", "x": 1"#, &["file", "the file ends"]),
        ("{\"spawn_point\": 1}", &["file: `objects` is missing"]),
        (
            "{\"objects\": [{\"sensors\": [1]}], \"spawn_point\": 1}",
            &["objects[0].sensors[0]: `1`"],
        ),
        ("{\"placements\": [{\"name\": \"a\", \"lidars\": []}]}", &["`a` has 0 LiDARs"]),
        ("{\"placements\": [], \"lidars\": 1}", &["unknown key `lidars`"]),
        ("nothing: known", &["file: its content is none of autoware, urdf", "--format"]),
        ("", &["file: its content is none of"]),
        ("<xml/>", &["its content is none of"]),
    ];
    let twice = source("file.yaml", &lidar("x: 1, x: 2"));
    let error = import_texts(&[twice], &ImportSettings::default()).unwrap_err().to_string();
    assert!(error.contains("file.yaml: ") && error.contains("duplicate"), "{error}");
    let mut lacking = Vec::new();
    let written = written.into_iter().map(|(text, parts)| (text.to_owned(), parts));
    for (text, parts) in made.into_iter().chain(written) {
        let error = read(&text).expect_err(&text).to_string();
        let missing = parts.iter().filter(|part| !error.contains(**part));
        lacking.extend(missing.map(|part| format!("{error}\n  lacks {part}")));
    }
    assert!(lacking.is_empty(), "{}", lacking.join("\n"));
}

#[test]
fn names_that_nothing_has_are_listed() {
    let text = autoware("lidar: {x: 1, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}");
    let settings = ImportSettings::default;
    let sensors = [("side".to_owned(), "VLP-16".to_owned())].into();
    let there = "file: no frame is called `top`; there are `base_link`, `kit`, `lidar`";
    for (settings, words) in [
        (ImportSettings { sensors, ..settings() }, "called `side`"),
        (ImportSettings { frames: vec!["top".to_owned()], ..settings() }, there),
        (ImportSettings { base_frame: Some("map".to_owned()), ..settings() }, "is called `map`"),
        (
            ImportSettings { name: Some("a b".into()), ..settings() },
            "`a b` is not a placement name",
        ),
    ] {
        assert_holds!(import_texts(&[source("file", &text)], &settings).unwrap_err(), words);
    }
    assert_holds!("yaml".parse::<RigFormat>().unwrap_err(), "`yaml`", "carla-objects");
    assert!(
        RigFormat::ALL.iter().all(|format| format.name().parse::<RigFormat>().unwrap() == *format)
    );
}

#[test]
fn seventeen_lidars_are_too_many_and_can_be_picked_from() {
    let joints: String = (0..17).map(|k| joint("base_link", &format!("lidar_{k}"))).collect();
    let text = format!("<robot name='my robot'>{joints}</robot>");
    assert_holds!(read(&text).unwrap_err(), "17 frames are LiDARs, at most 16");
    let frames = vec!["lidar_16".to_owned()];
    let settings = ImportSettings { frames, ..ImportSettings::default() };
    let read = import_texts(&[source("file", &text)], &settings).unwrap();
    assert_eq!((read.rig.lidars.len(), read.left_out.len()), (1, 16));
    // A robot's name with a space is no name of a placement.
    assert_eq!(read.rig.name, "rig");
}

#[test]
fn a_rig_that_cannot_be_written_is_refused() {
    let pose = SensorPose::from_values([0.0; 6]);
    let rig = |frames: &[&str], x: f64| {
        let pose = SensorPose { x, ..pose };
        let lidar = |frame: &&str| RigLidar { frame: (*frame).to_owned(), sensor: None, pose };
        Rig { name: "r".to_owned(), lidars: frames.iter().map(lidar).collect() }
    };
    let fails = |rig: &Rig, format| {
        export(rig, format, &Mounting::default(), &Models::default()).unwrap_err().to_string()
    };
    assert_holds!(fails(&rig(&["a b"], 0.0), RigFormat::Urdf), "`a b`");
    assert_holds!(fails(&rig(&["a", "a"], 0.0), RigFormat::Urdf), "used twice");
    assert_holds!(fails(&rig(&["base_link"], 0.0), RigFormat::Urdf), "that of the vehicle");
    assert_holds!(fails(&rig(&["a"], f64::NAN), RigFormat::Urdf), "x = NaN");
    assert_holds!(fails(&rig(&["a"], 0.0), RigFormat::Pandaset), "is read, but not written");
}

#[test]
fn one_of_several_placements_is_picked_by_name() {
    let placement = |name: &str, x: f64| {
        format!("{{\"name\": \"{name}\", \"lidars\": [{{\"x\": {x}, \"y\": 0, \"z\": 1}}]}}")
    };
    let (a, b) = (placement("a", 1.0), placement("b", 2.0));
    let document = source("p.json", &format!("{{\"placements\": [{a}, {b}]}}"));
    let lines = source("p.jsonl", &format!("{a}\n\n{b}\n"));
    let pick = |source: &RigSource, name: Option<&str>| {
        let name = name.map(str::to_owned);
        let settings =
            ImportSettings { name, format: Some(RigFormat::Json), ..ImportSettings::default() };
        import_texts(std::slice::from_ref(source), &settings).map(|read| read.rig.lidars[0].pose.x)
    };
    for source in [&document, &lines] {
        assert_eq!(pick(source, Some("b")).unwrap(), 2.0);
        let error = pick(source, None).unwrap_err().to_string();
        assert!(error.contains("several") && error.contains("`a`, `b`"), "{error}");
        assert!(error.contains("FILE:NAME") && error.contains("name=NAME"), "{error}");
        assert_holds!(pick(source, Some("c")).unwrap_err(), "no placement is called `c`");
    }
}

/// Neither depth nor aliases nor long chains make the reading long or deep.
#[test]
fn hostile_files_end_soon() {
    let deep = 100_000;
    let elements = format!("<sdf>{}{}</sdf>", "<a>".repeat(deep), "</a>".repeat(deep));
    let lists = format!("[{{\"type\": \"sensor.lidar.x\", {}", "[".repeat(deep));
    let blocks = "- ".repeat(deep);
    let yaml = format!("a: {}", "[".repeat(deep));
    let bomb = (0..30).fold("a0: &a0 {x: 1}\n".to_owned(), |text, k| {
        text + &format!("a{}: &a{} [*a{k}, *a{k}, *a{k}, *a{k}]\n", k + 1, k + 1)
    });
    let chain: String =
        (0..50_000).map(|k| joint(&format!("l{k}"), &format!("l{}", k + 1))).collect();
    let chain =
        format!("<robot>{}{chain}{}</robot>", joint("base_link", "l0"), joint("l50000", "lidar"));
    for text in [&elements, &lists, &blocks, &yaml, &bomb] {
        assert!(read(text).is_err());
    }
    assert_eq!(read(&chain).unwrap().rig.lidars.len(), 1);
}

#[test]
fn a_large_file_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let error = |name: &str| {
        let path = folder.path().join(name);
        crate::rig::import(&[path], &ImportSettings::default()).unwrap_err()
    };
    std::fs::File::create(folder.path().join("large.urdf")).unwrap().set_len(17 << 20).unwrap();
    let large = error("large.urdf");
    assert!(matches!(large, FormatError::Description(_)), "{large}");
    assert_holds!(large, "larger than the limit");
    let wide: Vec<u8> = "<robot/>".encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(folder.path().join("wide.urdf"), wide).unwrap();
    assert_holds!(error("wide.urdf"), "wide.urdf: is UTF-16 text; save it as UTF-8");
    std::fs::write(folder.path().join("latin.urdf"), b"<robot name='\xe9'/>").unwrap();
    let place = "latin.urdf: is not UTF-8 text; save it as UTF-8 (line 1, column 14)";
    assert_holds!(error("latin.urdf"), place);
    assert_holds!(error("none.yaml"), "cannot be read");
    assert_holds!(error(""), "without .yaml files");
}
