//! Own bodies as users bring them: STL, URDF, a trailer in poses; and bodies that cannot be.

use std::io::BufReader;

use crate::cli::*;

/// Corners of a triangle that beams from the sensor of [`room_with`] meet.
const FACET: &str = "facet normal 0 0 0\nouter loop\nvertex 1 -1 0\nvertex 1 1 0\nvertex 1 0 2.5\nendloop\nendfacet\n";
/// Turns of a trailer in three frames.
const YAWS: [f64; 3] = [0.0, 0.4, 1.1];

/// The room with an own vehicle.
fn room_with(dir: &Path, name: &str, ego: &Value) {
    let mut scene = read_json(room(dir));
    scene["ego"] = ego.clone();
    write(dir, name, &scene);
    let lidars =
        json!([{ "x": 0, "y": 0.1, "z": 1.5 }, { "x": 0.4, "y": -0.3, "z": 1.7, "yaw": 1 }]);
    write_rig(dir, "p.json", "p", lidars);
}

fn distances(dir: &Path, scene: &str, frame: usize) -> Vec<f32> {
    let args = format!("cast {scene} p.json --frame {frame} --out h.npz --force --backend cpu");
    assert_eq!(ok(dir, &args)["beams"], 960);
    let file = BufReader::new(fs::File::open(dir.join("h.npz")).unwrap());
    array(&mut zip::ZipArchive::new(file).unwrap(), "distance")
}

fn pose(yaw: f64) -> Value {
    json!({ "x": -0.8, "y": 0, "yaw": yaw })
}

fn trailer(poses: Value) -> Value {
    json!({ "body": [{ "class": "vehicle", "box": { "min": [-0.8, -0.4, 0.2], "max": [0.8, 0.4, 1.1] } }],
            "bodies": [{ "parts": [{ "class": "vehicle", "box": { "min": [-1.9, -0.5, 0.2], "max": [-0.2, 0.5, 2] } }],
                         "poses": poses }] })
}

#[test]
fn beams_end_at_a_trailer_in_each_frame_as_at_one_that_stands_so() {
    let dir = TempDir::new().unwrap();
    room_with(dir.path(), "bends.json", &trailer(json!(YAWS.map(pose))));
    let mut seen = Vec::new();
    for (frame, yaw) in YAWS.into_iter().enumerate() {
        room_with(dir.path(), "stands.json", &trailer(json!([pose(yaw)])));
        let bends = distances(dir.path(), "bends.json", frame);
        let stands = distances(dir.path(), "stands.json", frame);
        let differ = |(a, b): &(&f32, &f32)| a != b && (*a - *b).abs() > 1e-4;
        let differing = bends.iter().zip(&stands).filter(differ).count();
        // A beam at an edge may end at either side of it.
        assert!(differing <= 2, "{frame}: {differing} of 960 beams");
        seen.push(bends);
    }
    let moved = seen[0].iter().zip(&seen[2]).filter(|(a, b)| (*a - *b).abs() > 0.1).count();
    assert!(moved > 50, "{moved} beams tell the frames apart");
    room_with(dir.path(), "none.json", &json!({}));
    assert_ne!(seen[0], distances(dir.path(), "none.json", 0));
}

/// A named trailer, and a LiDAR on its roof as it stands where the trailer has turned.
fn on_trailer(poses: Value, yaw: f64) -> (Value, Value) {
    let mut ego = trailer(poses);
    ego["bodies"][0]["name"] = json!("trailer");
    let (sin, cos) = yaw.sin_cos();
    let [x, y] = [-1.5 * cos - 0.1 * sin, -1.5 * sin + 0.1 * cos];
    (ego, json!({ "x": -0.8 + x, "y": y, "z": 2.2, "pitch": 0.1, "yaw": 3.0 + yaw }))
}

#[test]
fn a_lidar_rides_on_a_trailer() {
    let dir = TempDir::new().unwrap();
    let (bends, mut rides) = on_trailer(json!(YAWS.map(pose)), 0.0);
    let fixed = json!({ "x": 0.4, "y": -0.3, "z": 1.7, "yaw": 1 });
    room_with(dir.path(), "bends.json", &bends);
    for (frame, yaw) in YAWS.into_iter().enumerate() {
        let (ego, stays) = on_trailer(json!([pose(yaw)]), yaw);
        room_with(dir.path(), "stands.json", &ego);
        write_rig(&dir, "p.json", "p", json!([stays, fixed]));
        let stands = distances(dir.path(), "stands.json", frame);
        rides["rides_on"] = json!("trailer");
        write_rig(&dir, "p.json", "p", json!([rides, fixed]));
        let carried = distances(dir.path(), "bends.json", frame);
        let off = |(a, b): &(&f32, &f32)| a != b && (*a - *b).abs() > 1e-4;
        let differing = carried.iter().zip(&stands).filter(off).count();
        assert!(differing <= 2, "{frame}: {differing} of 960 beams");
        if frame > 0 {
            rides.as_object_mut().unwrap().remove("rides_on");
            write_rig(&dir, "p.json", "p", json!([rides, fixed]));
            let left = distances(dir.path(), "bends.json", frame);
            assert!(left.iter().zip(&stands).filter(off).count() > 100, "{frame}");
        }
    }
    rides["rides_on"] = json!("trailor");
    write_rig(&dir, "p.json", "p", json!([rides, fixed]));
    let error = fails(&dir, "cast bends.json p.json --out h.npz --force --backend cpu");
    assert!(
        error.contains("there is no body to ride on `trailor`; did you mean `trailer`?"),
        "{error}"
    );
}

/// The room with a vehicle of one LiDAR on the roof of its trailer, which must see cars, and its best share by `score`.
fn share_of_cars(dir: &TempDir, (ego, lidar): (Value, Value)) -> f64 {
    let mut scene = read_json(room(dir.path()));
    for key in ["lidar", "mount"] {
        scene.as_object_mut().unwrap().remove(key);
    }
    scene["vehicle"] = json!({ "sightline": 1, "body": ego["body"], "bodies": ego["bodies"],
        "sensors": [{ "name": "a", "lidar": { "channels": 16, "fov": [-25, 2], "azimuth_steps": 90, "range": 40 } }],
        "mounts": [{ "name": "roof", "min": [-2.5, -0.3, 2.2], "max": [-2, 0.3, 2.3], "yaw": [3, 3.2], "count": 1,
                     "pitch": [0, 0.2], "rides_on": "trailer" }],
        "require": [{ "target": "adult", "within": 9, "beams": 3, "share": 0 }] });
    write(dir.path(), "v.json", &scene);
    write_rig(dir, "p.json", "p", json!([lidar]));
    let scores = ok(dir.path(), "score v.json p.json --backend cpu");
    scores["scores"][0]["requirements"][0]["found"].as_f64().unwrap()
}

#[test]
fn a_rule_is_judged_with_the_lidar_where_the_trailer_carries_it() {
    let dir = TempDir::new().unwrap();
    let stands = YAWS.map(|yaw| share_of_cars(&dir, on_trailer(json!([pose(yaw)]), yaw)));
    let (bends, mut lidar) = on_trailer(json!(YAWS.map(pose)), 0.0);
    let left = share_of_cars(&dir, (bends.clone(), lidar.clone()));
    lidar["rides_on"] = json!("trailer");
    let carried = share_of_cars(&dir, (bends, lidar.clone()));
    let worst = stands.into_iter().fold(1.0, f64::min);
    assert!((carried - worst).abs() < 1e-9, "{carried} is not the worst of {stands:?}");
    assert!((left - worst).abs() > 0.01, "{left}");
    // Another scene may bend the other way.
    let v = read_text(&dir, "v.json");
    let (other, stays) = on_trailer(json!(YAWS.map(|yaw| pose(-yaw))), 0.0);
    share_of_cars(&dir, (other, stays));
    fs::rename(dir.path().join("v.json"), dir.path().join("w.json")).unwrap();
    write(&dir, "v.json", &v);
    write_rig(&dir, "p.json", "p", json!([lidar]));
    ok(&dir, "score v.json w.json p.json --backend cpu");
    // Whoever builds it has the pose in the frame of the body too, 0.8 m behind the origin in frame 0.
    ok(&dir, "rig handover v.json p.json --frame 2 --backend cpu --out h");
    read_text(&dir, "h/poses.csv").says(",trailer,-1.5,0.1,2.2,0,5.729578,171.887339");
    read_text(&dir, "h/README.txt").says("ride on a body (0) are as in frame 0");
    // The mount is not drawn in mid-air.
    ok(&dir, "rig handover v.json p.json --backend cpu --out h0");
    let dashed = |of: &str| read_text(&dir, of).matches("stroke-dasharray").count();
    assert!(dashed("h/drawing.svg") < dashed("h0/drawing.svg"));
    // A search puts LiDARs on the mount, which the body carries.
    ok(&dir, "optimize v.json --backend cpu --evaluations 6 --out o");
    let found = read_json(dir.path().join("o/placements.json"));
    assert_eq!(found["placements"][0]["lidars"][0]["rides_on"], "trailer");
    let [table, _] = printed(&dir, "score v.json o/placements.json --backend cpu");
    assert!(!table.contains("RULE BROKEN"), "{table}");
    lidar.as_object_mut().unwrap().remove("rides_on");
    write_rig(&dir, "p.json", "p", json!([lidar]));
    let [table, _] = printed(&dir, "score v.json p.json --backend cpu");
    assert!(
        table.contains("LiDAR 0: add `trailer` as its `rides_on`, which carries mount roof"),
        "{table}"
    );
}

#[test]
fn what_leaves_a_carrier_out_says_so() {
    let dir = TempDir::new().unwrap();
    let (bends, mut lidar) = on_trailer(json!(YAWS.map(pose)), 0.0);
    lidar["rides_on"] = json!("trailer");
    share_of_cars(&dir, (bends, lidar.clone()));
    stderr(&dir, "rig export p.json:p --format urdf --out r.urdf")
        .says("`lidar_0`: written where the body that carries it stands in frame 0");
    lidar.as_object_mut().unwrap().remove("rides_on");
    write_rig(&dir, "left.json", "p", json!([lidar]));
    let [text, _] = printed(&dir, "rig compare p.json left.json");
    text.says("  ! lidar_0: it rides on `trailer` before and on nothing after\ndifferent in pose or model: 1 of 1");
    // All of six frames are looked at, as one of them alone may hold the worst bend.
    let mut long = read_json(dir.path().join("v.json"));
    long["frames"] = json!(6);
    for list in ["/actors/0/poses", "/vehicle/bodies/0/poses"] {
        let poses = long.pointer_mut(list).unwrap().as_array_mut().unwrap();
        poses.extend_from_within(..);
    }
    write(dir.path(), "long.json", &long);
    let [text, _] = printed(&dir, "study tolerance long.json p.json --steps 1 --backend cpu");
    text.says("over 6 frames");
}

#[test]
fn level_ground_takes_a_trailer_as_in_frame_0_and_says_so() {
    let dir = TempDir::new().unwrap();
    let tractor = |poses: Value| {
        let ego = trailer(poses);
        let vehicle = json!({ "sightline": 1, "body": ego["body"], "bodies": ego["bodies"],
            "sensors": [{ "name": "a", "lidar": { "channels": 16, "fov": [-25, 2], "azimuth_steps": 90, "range": 40 } }],
            "mounts": [{ "name": "roof", "min": [-0.8, -0.6, 1.2], "max": [1, 0.6, 2], "count": [1, 2] }],
            "require": [{ "ground": 3, "share": 0 }] });
        write(&dir, "v.json", &vehicle);
    };
    write_rig(&dir, "p.json", "p", json!([{ "x": 0.3, "y": 0, "z": 1.6 }]));
    let run = |command: &str| {
        let args = format!("study {command} p.json --vehicle v.json --backend cpu --format json");
        printed(&dir, &args)
    };
    let commands = [
        "targets --target car --distances 8,15",
        "redundancy --target car",
        "sweep --of 0.z --from 1.5 --to 1.7 --values 2",
        "tolerance --steps 1",
    ];
    for command in commands {
        tractor(json!([pose(0.0), pose(0.9), pose(0.4)]));
        let [bends, told] = run(command);
        let words = "v.json: bodies[0]: has 3 poses, one for each frame; level ground takes the body as in frame 0";
        assert_eq!(told.matches(words).count(), 1, "{command}: {told}");
        tractor(json!([pose(0.0)]));
        let [stands, told] = run(command);
        assert!(bends == stands && !told.contains("poses"), "{command}: {told}");
        tractor(json!([pose(0.9)]));
        assert!(command.starts_with("tolerance") || run(command)[0] != stands, "{command}");
    }
    tractor(json!([pose(0.0), pose(0.9)]));
    stderr(&dir, "rig handover p.json --vehicle v.json --out h").says("has 2 poses");
    read_text(&dir, "h/README.txt").says(
        "boxes, masks and drawing are of frame 0. For another frame: sightline rig handover SCENE",
    );
    // Rules that hold in frame 0 may be missed in another pose, which no line NOT MET would tell.
    let held = "Requirements: bodies as in frame 0 alone";
    for file in ["h/README.txt", "h/drawing.svg"] {
        read_text(&dir, file).says(held);
    }
    tractor(json!([pose(0.0)]));
    stderr(&dir, "rig handover p.json --vehicle v.json --out h --force");
    assert!(!read_text(&dir, "h/README.txt").contains(held));
    tractor(json!([]));
    fails(&dir, "study targets p.json --vehicle v.json")
        .says("bodies[0].poses: an empty list is not a list of at least one pose");
}

/// Corners of a path less its first corner, in tenths of a millimetre; its place on the sheet depends on other shapes.
fn shape(path: &str) -> Vec<[i64; 2]> {
    let corners = path.split('"').nth(1).unwrap().split(['M', 'L', 'Z']);
    let corners = corners.filter_map(|corner| corner.split_once(' '));
    let corners: Vec<[f64; 2]> =
        corners.map(|(x, y)| [x, y].map(|number| number.parse().unwrap())).collect();
    let from_first =
        |at: &[f64; 2]| [0, 1].map(|k| (10.0 * (at[k] - corners[0][k])).round() as i64);
    corners.iter().map(from_first).collect()
}

#[test]
fn a_hand_over_has_the_body_of_its_frame() {
    let dir = TempDir::new().unwrap();
    room_with(dir.path(), "bends.json", &trailer(json!(YAWS.map(pose))));
    room_with(dir.path(), "stands.json", &trailer(json!([pose(YAWS[2])])));
    let files = |scene: &str, frame: &str| {
        let args =
            format!("rig handover {scene} p.json --frame {frame} --backend cpu --out h --force");
        let [told, _] = printed(&dir, &args);
        // One pose for all frames is none that moves.
        let of_frame = scene == "bends.json";
        assert_eq!(told.contains(&format!("in its mask of frame {frame}, ")), of_frame, "{told}");
        let read = |name: &str| fs::read_to_string(dir.path().join("h").join(name)).unwrap();
        let boxes = read("crop_boxes.yaml");
        let boxes: Vec<&str> =
            boxes.lines().filter(|line| line.contains("m") && !line.starts_with('#')).collect();
        // The body: edges of the blind zone follow from cells, whose hits rounding decides.
        let drawn = read("drawing.svg");
        let words = format!(", frame {frame}; depths from the vehicle's box in frame 0<");
        assert_eq!(drawn.contains(&words), of_frame && frame != "0");
        let body = drawn.split("<path ").filter(|path| path.contains("#c8d2dc"));
        (boxes.join("\n"), body.map(shape).collect::<Vec<_>>())
    };
    let (straight, bent) = (files("bends.json", "0"), files("bends.json", "2"));
    // Depths in the drawing are the near field's own, for each side in the frame that it names.
    let near = ok(dir.path(), "study nearfield bends.json p.json --backend cpu");
    let zone = &near["near_fields"][0]["zone"];
    for (side, frame) in zone["worst_frames"].as_object().unwrap() {
        files("bends.json", &frame.to_string());
        let depth = zone[side].as_f64();
        // Depths are told rounded up.
        let up = |metres: f64| (10.0 * metres - 1e-9).ceil() / 10.0;
        let told = depth.map_or("beyond 10 m".to_owned(), |depth| format!("to {:.1} m", up(depth)));
        read_text(&dir, "h/drawing.svg").says(&format!("{side}: blind {told}"));
    }
    assert!(zone["worst_frames"]["right"] != 0 || zone["worst_frames"]["left"] != 0, "{zone}");
    assert!(straight.0 != bent.0 && straight.1 != bent.1 && !bent.1.is_empty());
    let stands = files("stands.json", "0");
    assert_eq!(bent.0, stands.0);
    assert_eq!(bent.1, stands.1);
}

#[test]
fn an_stl_and_a_urdf_that_names_it_give_the_bits_of_an_obj() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    write(&dir, "b.stl", &format!("solid\n{FACET}endsolid\n"));
    write(&dir, "b.obj", "v 1 -1 0\nv 1 1 0\nv 1 0 2.5\nf 1 2 3\n");
    let urdf = r#"<robot name="r"><link name="l"><collision><geometry><mesh filename="b.stl"/></geometry></collision></link></robot>"#;
    fs::write(path("b.urdf"), urdf).unwrap();
    let mut all = Vec::new();
    for mut shape in [
        json!({ "mesh": { "file": "b.obj" } }),
        json!({ "mesh": { "file": "b.stl" } }),
        json!({ "urdf": { "file": "b.urdf", "geometry": "collision" } }),
    ] {
        shape["class"] = json!("vehicle");
        room_with(dir.path(), "r.json", &json!({ "body": [shape] }));
        all.push(distances(dir.path(), "r.json", 0));
    }
    assert!(all[0] == all[1] && all[0] == all[2]);
    assert!(all[0].iter().any(|metres| *metres < 1.2), "some beams end at it");
    // Inputs are protected: the mesh of the robot, too.
    fails(&dir, "cast r.json p.json --out b.stl --force").says("b.stl");
}

#[test]
fn the_tractor_of_the_examples_bends_in_a_yard_of_as_many_frames_as_its_bodies_have_poses() {
    let dir = TempDir::new().unwrap();
    let tractor = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/vehicles/tractor.json");
    let vehicle = read_json(tractor.clone());
    let bodies = vehicle["bodies"].as_array().unwrap();
    assert!(bodies.iter().all(|body| body["poses"].as_array().unwrap().len() == 5), "{vehicle}");
    for frames in ["4", "5"] {
        let yard = format!("yard-{frames}.json");
        stdout(&dir, &["scene", "new", "--kind", "yard", "--frames", frames, "--out", &yard]);
    }
    // A LiDAR at the side of the trailer, and one at the front.
    let lidars = json!([
        { "x": -3, "y": 1.3, "z": 3.4, "pitch": 0.5, "yaw": 1.57, "sensor": "E1R", "rides_on": "trailer" },
        { "x": 6.25, "y": 0, "z": 1, "pitch": 0.2, "sensor": "E1R" }
    ]);
    write_rig(dir.path(), "p.json", "p", lidars);
    let run = |yard: &str| {
        format!("score {yard} p.json --vehicle {} --tolerance 0 --backend cpu", tractor.display())
    };
    fails(&dir, &run("yard-4.json"))
        .says("bodies[0].poses: a list of 5 is not one pose for all frames");
    let (code, answer, told) = answer(&dir, &run("yard-5.json"));
    assert_eq!(code, Some(1), "two LiDARs miss what must be seen: {told}");
    told.says("bodies[0] (likewise bodies[1], bodies[2]): moves from frame to frame")
        .lacks("inside the ego's body");
    let [adult, pallet, ground] = &answer["scores"][0]["requirements"].list()[..] else {
        panic!("{answer}");
    };
    // The LiDAR at the front looks ahead alone; the trailer turns the other one.
    assert_eq!([&adult["met"], &pallet["met"]], [false, true], "{answer}");
    for requirement in [adult, ground] {
        assert_ne!(requirement["worst_frame"]["frame"], 0, "{requirement}");
    }
}

#[test]
fn bodies_that_cannot_be_end_in_one_sentence_and_exit_code_2() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    write(&dir, "empty.stl", "solid\nendsolid\n");
    fs::write(path("short.stl"), [&[b'x'; 80][..], &9_u32.to_le_bytes(), &[0; 50]].concat())
        .unwrap();
    fs::write(path("r.urdf"), r#"<robot name="r"><link name="l"/></robot>"#).unwrap();
    let body = |shape: Value| json!({ "body": [shape] });
    let mesh = |file: &str| body(json!({ "class": "vehicle", "mesh": { "file": file } }));
    let mut without = trailer(json!([]));
    without["bodies"][0].as_object_mut().unwrap().remove("poses");
    for (ego, told) in [
        (
            mesh("empty.stl"),
            "r.json: ego.body[0].mesh: mesh empty.stl: file: holds no triangle; export its faces",
        ),
        (
            mesh("short.stl"),
            "mesh short.stl: header: says 9 triangles, which take 534 bytes, and the file has 134; export it again",
        ),
        (
            body(json!({ "class": "vehicle", "urdf": { "file": "r.urdf" } })),
            "r.json: ego.body[0].urdf: mesh r.urdf: file: has no <visual>",
        ),
        (without, "r.json: ego.bodies[0]: `poses` is missing: say where the body is"),
        (
            trailer(json!([pose(0.0), pose(0.1)])),
            "r.json: ego.bodies[0].poses: a list of 2 is not one pose for all frames, or one for each of the 3",
        ),
    ] {
        room_with(dir.path(), "r.json", &ego);
        let message = fails(&dir, "cast r.json p.json --out h.npz");
        assert!(message.contains(told), "{message}\nis not {told}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert!(!path("h.npz").exists());
    }
    // A likely mistake is a note, and with --strict an error.
    let millimetres = "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 4400 0 0\nvertex 0 1800 1300\nendloop\nendfacet\n";
    write(&dir, "mm.stl", &format!("solid\n{millimetres}endsolid\n"));
    room_with(dir.path(), "r.json", &mesh("mm.stl"));
    fails(&dir, "cast r.json p.json --out h.npz --strict")
        .says("the ego body is 4400.0 m large; lengths are in metres, 4400 mm would be 4.40 m: divide the numbers of its shapes by 1000, or give its mesh `\"scale\": 0.001`");
}

#[test]
fn a_body_of_a_wrong_size_or_place_is_told_by_its_own_name() {
    let dir = TempDir::new().unwrap();
    // Two triangles of 1.8 m, in millimetres.
    let facet = |z: i32| {
        format!(
            "facet normal 0 0 0\nouter loop\nvertex -1900 -500 200\nvertex -200 -500 {z}\nvertex -1900 500 2000\n\
             endloop\nendfacet\n"
        )
    };
    write(&dir, "w.stl", &format!("solid\n{}{}endsolid\n", facet(200), facet(300)));
    let mesh =
        |scale: Value| json!([{ "class": "vehicle", "mesh": { "file": "w.stl", "scale": scale } }]);
    let told = |poses: &Value, change: &dyn Fn(&mut Value)| {
        let mut ego = trailer(poses.clone());
        change(&mut ego);
        room_with(dir.path(), "r.json", &ego);
        let args = "cast r.json p.json --out h.npz --force --backend cpu";
        String::from_utf8(sightline(&dir, args).stderr).unwrap()
    };
    let tiny = "is 0.0018 m large with the `scale` of 0.000001 that its mesh has; lengths are in metres: `\"scale\": 0.001` \
                would make it 1.80 m";
    let still = json!([pose(0.0)]);
    for (poses, who) in [
        (&still, "ego's body at ego.bodies[0]"),
        (&json!(YAWS.map(pose)), "ego's body 0 that moves"),
    ] {
        let large = told(poses, &|ego| ego["bodies"][0]["parts"] = mesh(json!(1)));
        let words =
            format!("r.json: the {who} is 1800.0 m large with the `scale` of 1 that its mesh has");
        assert!(large.contains(&words) && !large.contains("the ego body is"), "{large}");
        told(poses, &|ego| ego["bodies"][0]["parts"] = mesh(json!(1e-6)))
            .says(&format!("r.json: the {who} {tiny}"));
        let far = told(poses, &|ego| ego["bodies"][0]["poses"][0]["z"] = json!(1750));
        far.says(
            "r.json: ego.bodies[0].poses[0].z: 1750 m is far from the vehicle; lengths are in metres, 1750 mm are 1.75 m",
        );
        assert!(!far.contains("m large"), "{far}");
        assert!(!told(poses, &|_| ()).contains("large"));
    }
    // Its boom hangs over ground that no cell looks at.
    let boom =
        json!([{ "class": "vehicle", "box": { "min": [0, -0.1, 2], "max": [3, 0.1, 2.3] } }]);
    let mut ego = trailer(still.clone());
    ego["bodies"][0]["parts"] = boom;
    room_with(dir.path(), "r.json", &ego);
    // From x = 0.8 m, 0.8 m wide, to 2.2 m, 0.2 m wide.
    let words = "0.7 m² within the outline of the body lie under parts that are 1 m up or more";
    stderr(&dir, "study nearfield r.json p.json --backend cpu").says(words);
    // Scores say so where ground is required.
    let lidar = json!({ "channels": 8, "fov": [-25, 2], "azimuth_steps": 90, "range": 40 });
    for (rule, is_said) in [
        (json!({ "ground": 3, "share": 0 }), true),
        (json!({ "target": "car", "within": 9, "share": 0 }), false),
    ] {
        let vehicle = json!({ "sightline": 1, "body": ego["body"], "bodies": ego["bodies"], "require": [rule],
            "sensors": [{ "name": "a", "lidar": lidar }],
            "mounts": [{ "min": [-0.8, -0.6, 1.2], "max": [1, 0.6, 2], "name": "roof", "count": [1, 2] }] });
        write(&dir, "v.json", &vehicle);
        let said = stderr(&dir, "score r.json p.json --vehicle v.json --backend cpu");
        assert_eq!(said.contains(words), is_said, "{said}");
    }
    // The first body, which another one joins, and alone.
    told(&still, &|ego| ego["body"] = mesh(json!(1e-6)))
        .says(&format!("r.json: the ego's first body {tiny}"));
    told(&json!(YAWS.map(pose)), &|ego| ego["body"] = mesh(json!(1e-6)))
        .says(&format!("r.json: the ego body {tiny}"));
}
