//! `--gltf`: what is written has the scene's triangles, LiDARs and points where they are; refusals.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};
use sightline::scene::{EgoBody, Scene};

use crate::cli::*;

/// A street with two equal cars that drive, a tilted bus and an own body, far from the origin.
fn street() -> TempDir {
    let dir = TempDir::new().unwrap();
    let car = |name: &str, y: f64| {
        json!({ "name": name, "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [4, 1.8, 1.4] } }],
                "route": { "points": [[1006, 500.0 + y], [1060, 520.0 + y]], "spacing": 0.5 } })
    };
    let scene = json!({
        "sightline": 1, "name": "street", "frames": 3, "rate": 10, "coverage": "first-hit",
        "roi": { "min": [-20, -20, -0.5], "max": [20, 20, 3.5], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 8, "fov": [-25, 5], "azimuth_steps": 60, "range": 60 },
        "mount": { "min": [-1, -1, 2], "max": [1, 1, 3], "lidars": 2 },
        "static": [
            { "class": "road", "plane": { "min": [940, 440], "max": [1060, 560], "z": 0 } },
            { "class": "building", "box": { "min": [1012, 490, 0], "max": [1014, 510, 6] } } ],
        "actors": [car("left", 4.0), car("right", -4.0)],
        "ego": { "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.3], "size": [4, 1.8, 1.2] } }],
                 "route": { "points": [[1000, 500], [1060, 510]], "spacing": 0.5 } },
    });
    let placements = json!({ "placements": [
        { "name": "tilted", "lidars": [
            { "x": 0.51, "y": -0.37, "z": 2.3, "roll": 0.1, "pitch": -0.2, "yaw": 1.1 },
            { "x": -0.4, "y": 0.3, "z": 2.7 } ] },
        { "name": "one", "lidars": [{ "x": 0.0, "y": 0.0, "z": 2.3 }] },
    ]});
    write(&dir, "s.json", &scene);
    write(&dir, "p.json", &placements);
    dir
}

/// Corners of a file in the ego frame by mode and material, and where its nodes stand.
#[derive(Default)]
struct Seen {
    corners: BTreeMap<(u32, String), Vec<DVec3>>,
    places: BTreeMap<String, DMat4>,
    meshes: BTreeMap<String, usize>,
}

/// glTF's x, y, z of left, up, forward to x, y, z of forward, left, up.
fn iso(place: DMat4) -> DMat4 {
    let iso_from_gltf = DMat4::from_cols(
        DVec3::Y.extend(0.0),
        DVec3::Z.extend(0.0),
        DVec3::X.extend(0.0),
        DVec3::ZERO.extend(1.0),
    );
    iso_from_gltf * place
}

impl Seen {
    /// Reads and validates with a crate that had no part in the writing.
    fn read(path: &Path) -> Self {
        let gltf::Gltf { document, blob } = gltf::Gltf::open(path).unwrap();
        let mut seen = Self::default();
        let scene = document.default_scene().unwrap();
        assert_eq!(scene.nodes().count(), 1);
        for node in scene.nodes() {
            seen.node(&node, DMat4::IDENTITY, &blob);
        }
        seen
    }

    fn node(&mut self, node: &gltf::Node<'_>, outer: DMat4, blob: &Option<Vec<u8>>) {
        let inner = node.transform().matrix().map(|column| column.map(f64::from));
        let place = outer * DMat4::from_cols_array_2d(&inner);
        let name = node.name().unwrap().to_owned();
        assert!(self.places.insert(name.clone(), iso(place)).is_none(), "{name} comes twice");
        if let Some(mesh) = node.mesh() {
            self.meshes.insert(name, mesh.index());
            for primitive in mesh.primitives() {
                let reader = primitive.reader(|_| blob.as_deref());
                let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
                let indices: Vec<u32> = match reader.read_indices() {
                    Some(indices) => indices.into_u32().collect(),
                    None => (0..positions.len() as u32).collect(),
                };
                let corner = |&index: &u32| {
                    let position = DVec3::from(positions[index as usize].map(f64::from));
                    iso(place).transform_point3(position)
                };
                let key = (
                    primitive.mode().as_gl_enum(),
                    primitive.material().name().unwrap().to_owned(),
                );
                self.corners.entry(key).or_default().extend(indices.iter().map(corner));
            }
        }
        node.children().for_each(|child| self.node(&child, place, blob));
    }

    fn points(&self) -> usize {
        self.corners.iter().filter(|((mode, _), _)| *mode == 0).map(|(_, at)| at.len()).sum()
    }
}

/// The triangles of a file are those of the scene's frame, class by class and in their order.
fn check_triangles(seen: &Seen, scene: &Scene, frame: usize) {
    let soup = scene.frame(frame, EgoBody::Include);
    let mut wanted: BTreeMap<&str, Vec<DVec3>> = BTreeMap::new();
    for (prim, &class) in (0..).zip(&soup.face_class) {
        let corners = soup.corners(prim).map(|corner| DVec3::from(corner.map(f64::from)));
        wanted.entry(&scene.classes()[usize::from(class)]).or_default().extend(corners);
    }
    let found = seen.corners.iter().filter(|((mode, _), _)| *mode == 4);
    assert_eq!(found.clone().count(), wanted.len());
    for ((_, class), found) in found {
        let wanted = &wanted[class.as_str()];
        assert_eq!(found.len(), wanted.len(), "{class}");
        let off = found.iter().zip(wanted).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-4, "{class}: {off} m");
    }
}

fn check_lidars(seen: &Seen, placement: &Value) {
    for (number, lidar) in placement["lidars"].list().iter().enumerate() {
        let name = format!("{} lidar {number}", placement["name"].text());
        let value = |key: &str| lidar[key].as_f64().unwrap_or(0.0);
        let place = seen.places[&name];
        let at = DVec3::new(value("x"), value("y"), value("z"));
        assert!(place.w_axis.truncate().distance(at) < 1e-6, "{name}: {place}");
        let turn = DMat4::from_rotation_z(value("yaw"))
            * DMat4::from_rotation_y(value("pitch"))
            * DMat4::from_rotation_x(value("roll"));
        for axis in [DVec3::X, DVec3::Z] {
            let off = place.transform_vector3(axis).distance(turn.transform_vector3(axis));
            assert!(off < 1e-6, "{name}");
        }
        assert!(seen.places.contains_key(&format!("{name} frustum")));
    }
}

#[test]
fn a_cast_shows_the_scene_its_lidars_and_the_hits() {
    let dir = street();
    let scene = Scene::read(dir.path().join("s.json")).unwrap();
    let placements = read_json(dir.path().join("p.json"));
    for frame in [0, 2] {
        let number = frame.to_string();
        let args = "cast s.json p.json --backend cpu --force --gltf c.glb";
        let answer = ok(&dir, &(args, ["--frame", &number]));
        let seen = Seen::read(&dir.path().join("c.glb"));
        check_triangles(&seen, &scene, frame);
        for placement in placements["placements"].list() {
            check_lidars(&seen, placement);
        }
        assert_eq!(Some(seen.points() as u64), answer["hits"].as_u64());
        assert!(seen.points() > 500);
        // Hits on the road, which is level, lie on it.
        let road = &seen.corners[&(0, "road".to_owned())];
        assert!(road.len() > 100 && road.iter().all(|point| point.z.abs() < 1e-3));
        assert_eq!(seen.meshes["actor 0 left"], seen.meshes["actor 1 right"], "equal shapes share");
    }
}

#[test]
fn a_scan_shows_its_points_and_a_search_its_result() {
    let dir = street();
    let scene = Scene::read(dir.path().join("s.json")).unwrap();
    let args = "scan s.json --placement p.json:tilted --ideal --frames 1";
    let rest = "--out set --gltf s.glb --frame 0";
    let answer = ok(&dir, &(args, rest));
    let seen = Seen::read(&dir.path().join("s.glb"));
    check_triangles(&seen, &scene, 0);
    assert_eq!(Some(seen.points() as u64), answer["datasets"][0]["points"].as_u64());
    let args = "optimize s.json --backend cpu --evaluations 12 --out run";
    let answer = ok(&dir, &(args, "--gltf o.glb"));
    let seen = Seen::read(&dir.path().join("o.glb"));
    check_triangles(&seen, &scene, 0);
    check_lidars(&seen, &answer["best"]["placement"]);
    assert_eq!(seen.points(), 0);
}

#[test]
fn what_cannot_be_shown_is_said_before_any_work() {
    let dir = street();
    let scan = "scan s.json --placement p.json:one --out set --gltf";
    let optimize = "optimize s.json --out run --gltf";
    let both = "scan s.json --placement p.json --out set --gltf";
    for (args, more, words) in [
        (scan, "a.gltf", "--gltf a.gltf: is written as binary glTF; give it the ending .glb"),
        (scan, "no/where/a.glb", "no/where/a.glb"),
        (scan, "a.glb --frame 3", "--frame 3: the scene `street` has frames 0 to 2"),
        (both, "a.glb", "shows one scene and one placement; give one of each"),
        (optimize, "a.obj", "--gltf a.obj: is written as binary glTF"),
        (optimize, "no/where/a.glb", "no/where/a.glb"),
    ] {
        fails(&dir, &(args, more)).says(words);
        for name in ["set", "run", "a.glb", "no"] {
            assert!(!dir.path().join(name).exists(), "{name} of {args} {more}");
        }
    }
}

/// An exported scene, read again as a mesh, has the same corners.
#[test]
fn own_gltf_stands_where_it_stood() {
    use sightline::export::{Glb, GltfView};
    use sightline::scene::{EgoBody, Scene};
    let dir = tempfile::tempdir().unwrap();
    let scene = |shape: &str| {
        let text = format!(
            r#"{{ "sightline": 1, "roi": {{ "min": [-4, -4, -1], "max": [4, 4, 3], "voxel": [1, 1, 1] }},
                "lidar": {{ "channels": 1, "fov": [0, 0], "azimuth_steps": 4, "range": 50 }}, "coverage": "first-hit",
                "mount": {{ "min": [0, 0, 1], "max": [0, 0, 1], "lidars": 1 }}, "static": [{{ "class": "wall", {shape} }}] }}"#
        );
        Scene::from_json(&text, dir.path(), "s.json").unwrap()
    };
    let corners = |scene: &Scene| {
        let soup = scene.frame(0, EgoBody::Exclude);
        let mut corners: Vec<[i64; 3]> = soup
            .vertices
            .iter()
            .map(|v| v.map(|metres| (f64::from(metres) * 1e3).round() as i64))
            .collect();
        corners.sort_unstable();
        corners.dedup();
        corners
    };
    let before = scene(r#""box": { "min": [10, -2, -1], "max": [11, 5, 2] }"#);
    let view = GltfView { scene: &before, frame: 0, placements: &[], points: &[] };
    let mut bytes = Vec::new();
    Glb::of(&view).unwrap().write(&mut bytes).unwrap();
    std::fs::write(dir.path().join("w.glb"), bytes).unwrap();
    let after = scene(r#""mesh": { "file": "w.glb" }"#);
    assert_eq!(corners(&after), corners(&before));
    assert!(after.notes().is_empty(), "{:?}", after.notes());
}
