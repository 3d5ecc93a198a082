//! Mesh readers: good, bad, garbled and real files.

use glam::DVec3;

use super::*;

fn small_obj() -> &'static str {
    "mtllib nowhere.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl Grass field\nf 1 2 3 4\n\
     usemtl Road\nf -4/1/1 -3 -2\nvt 0 0\nvn 0 0 1\nl 1 2\n"
}

fn obj_error(text: &str) -> String {
    let fault = obj::read(text.as_bytes()).and_then(|m| check(&m)).unwrap_err();
    format!("{}: {}", fault.element, fault.problem)
}

#[test]
fn obj_materials_come_from_the_names_in_use() {
    let mesh = obj::read(small_obj().as_bytes()).unwrap();
    assert_eq!(mesh.faces.len(), 3);
    assert_eq!(mesh.materials, [Some("Grass field".to_owned()), Some("Road".to_owned())]);
    assert_eq!(mesh.face_material, [0, 0, 1]);
}

#[test]
fn obj_coordinates_keep_their_millimetres() {
    let mesh = obj::read(b"v 85012.343 447455.577 0.88\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(mesh.vertices[0], DVec3::new(85012.343, 447455.577, 0.88));
    assert_eq!(mesh.materials, [None]);
}

#[test]
fn obj_faults_name_their_line() {
    let cases = [
        ("v 0 0 0\nv 1 nan 0\n", "line 2: nan is not a finite coordinate"),
        ("v 0 0 0\nv 1 1e400 0\n", "line 2: 1e400 is not a finite coordinate"),
        ("v 0 0\n", "line 1: position parse error"),
        ("v 0 0 0\nv 1 0 0\nf 1 2 x\n", "line 3: x is not a vertex of a face"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "line 4: refers to vertex 9, there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "line 4: refers to vertex 0, there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4: refers to vertex -4, there are 3"),
        ("v 0 0 0\n", "file: holds no triangle; export its faces, not points or lines alone"),
        ("", "file: holds no triangle; export its faces, not points or lines alone"),
    ];
    for (text, message) in cases {
        assert_eq!(obj_error(text), message, "{text:?}");
    }
    let fault = obj::read(b"v 0 0 0\n\xff\xfe").unwrap_err();
    assert_eq!(fault.element, "line 2");
}

/// A search through the names for each face would take minutes.
#[test]
fn a_material_for_each_face_takes_no_longer() {
    let count = 200_000;
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    for face in 0..count {
        text += &format!("usemtl {face}\nf 1 2 3\n");
    }
    let mesh = obj::read(text.as_bytes()).unwrap();
    assert_eq!((mesh.materials.len(), mesh.faces.len()), (count, count));
    assert_eq!(mesh.materials[mesh.face_material[77] as usize].as_deref(), Some("77"));
}

fn ascii_ply(vertex_count: &str, body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertex_count}\nproperty double x\nproperty double y\n\
         property double z\nelement face 2\nproperty list uchar int vertex_indices\n\
         property uchar label\nend_header\n{body}"
    )
}

#[test]
fn ply_faces_keep_their_labels() {
    let text = ascii_ply("4", "0 0 0\n1 0 0\n1 1 0\n85012.343 1 0\n4 0 1 2 3 40\n3 0 1 2 50\n");
    let mesh = ply::read(text.as_bytes()).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert_eq!(mesh.materials, [Some("40".to_owned()), Some("50".to_owned())]);
    assert_eq!(mesh.face_material, [0, 0, 1]);
    assert_eq!(mesh.vertices[3].x, 85012.343);
}

#[test]
fn ply_faults_are_told_before_memory_is_spent() {
    let body = "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 40\n3 0 1 7 50\n";
    let cases = [
        (ascii_ply("4000000000", body), "element vertex", "4000000000 announced"),
        (ascii_ply("3", body), "face 1", "refers to vertex 7, there are 3"),
        (ascii_ply("3", &body.replace("3 0 1 7 50\n", "")), "element face", "Unexpected end"),
        (ascii_ply("3", &body.replace("1 1 0", "1 NaN 0")), "element vertex", "1 NaN 0"),
        (ascii_ply("3", &body.replace("0 1 7", "0 -1 2")), "face 1", "no list `vertex_indices`"),
        ("ply\nformat ascii 1.0\n".to_owned(), "header", ""),
        (String::new(), "header", ""),
    ];
    for (text, element, problem) in cases {
        let fault = ply::read(text.as_bytes()).and_then(|m| check(&m)).unwrap_err();
        assert_eq!(fault.element, element, "{fault:?}");
        assert!(fault.problem.contains(problem), "{fault:?}");
    }
}

#[test]
fn binary_ply_cut_anywhere_is_refused() {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\n\
        property list uint int vertex_indices\nend_header\n"
        .to_vec();
    for v in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(v.to_le_bytes());
    }
    for v in [3u32, 0, 1, 2] {
        bytes.extend(v.to_le_bytes());
    }
    assert_eq!(ply::read(&bytes).unwrap().faces, [[0, 1, 2]]);
    for end in 0..bytes.len() {
        assert!(ply::read(&bytes[..end]).is_err(), "cut at {end}");
    }
    let at = bytes.len() - 20;
    let mut not_finite = bytes.clone();
    not_finite[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let fault = ply::read(&not_finite).and_then(|m| check(&m)).unwrap_err();
    assert_eq!(fault.element, "vertex 2");
    // A list that announces four billion corners.
    let at = bytes.len() - 16;
    bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(ply::read(&bytes).is_err());
}

/// A glTF with one triangle under two nodes, its buffer as a data URI.
fn triangle_gltf(index: u8, byte_length: usize, count: usize) -> String {
    let mut data = Vec::new();
    for v in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        data.extend(v.to_le_bytes());
    }
    data.extend([0, 1, index, 0]);
    let base64: String = data
        .chunks(3)
        .map(|c| {
            let mut bits = [0; 3];
            bits[..c.len()].copy_from_slice(c);
            let n = u32::from_be_bytes([0, bits[0], bits[1], bits[2]]);
            let code = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
            let digit = |i: usize| {
                let value = code[(n >> (18 - 6 * i)) as usize & 63] as char;
                if i <= c.len() { value } else { '=' }
            };
            (0..4).map(digit).collect::<String>()
        })
        .collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"translation":[10,0,0],"children":[1]}},{{"mesh":0,"scale":[2,2,2]}}],
        "materials":[{{"name":"paint"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3",
          "min":[0,0,0],"max":[1,1,0]}},
          {{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":36}},
          {{"buffer":0,"byteOffset":36,"byteLength":4}}],
        "buffers":[{{"byteLength":{byte_length},
          "uri":"data:application/octet-stream;base64,{base64}"}}]}}"#
    )
}

#[test]
fn gltf_nodes_place_their_meshes() {
    let mesh = gltf::read(triangle_gltf(2, 40, 3).as_bytes(), Path::new("")).unwrap();
    assert_eq!(mesh.vertices[1], DVec3::new(12.0, 0.0, 0.0));
    assert_eq!(mesh.faces, [[0, 1, 2]]);
    assert_eq!(mesh.materials, [Some("paint".to_owned())]);
}

#[test]
fn gltf_faults_never_panic() {
    let good = triangle_gltf(2, 40, 3);
    let cases = [
        (triangle_gltf(9, 40, 3), "refers to vertex 9, it has 3"),
        (triangle_gltf(2, 4000, 3), "holds 40 bytes, 4000 are announced"),
        (triangle_gltf(2, 40, 4_000_000_000), "reaches past its buffer"),
        (good.replace(r#""mesh":0,"#, r#""mesh":0,"children":[0],"#), "two parents"),
        (good.replace(r#""byteOffset":36"#, r#""byteOffset":3600"#), "reaches past its buffer"),
        (good.replace("5121", "5126"), "not whole numbers"),
        (good.replace(r#""scene":0,"scenes":[{"nodes":[0]}],"#, ""), "no scene"),
    ];
    for (text, problem) in cases {
        let fault = gltf::read(text.as_bytes(), Path::new("")).unwrap_err();
        assert!(fault.problem.contains(problem), "{problem}: {fault:?}");
    }
    let named = |uri: &str| {
        let start = good.find("\"uri\":\"").unwrap() + 7;
        let end = start + good[start..].find('"').unwrap();
        format!("{}{uri}{}", &good[..start], &good[end..])
    };
    let outside = [
        ("/dev/zero", "not a plain file"),
        ("file:///dev/zero", "not a plain file"),
        ("%ff.bin", "not UTF-8"),
        ("nowhere.bin", "nowhere.bin"),
    ];
    for (uri, problem) in outside {
        let fault = gltf::read(named(uri).as_bytes(), Path::new("")).unwrap_err();
        assert!(fault.problem.contains(problem), "{uri}: {fault:?}");
    }
    for end in 0..good.len() {
        assert!(gltf::read(&good.as_bytes()[..end], Path::new("")).is_err(), "cut at {end}");
    }
}

/// Bytes changed at random end in a mesh or in a fault, never in a panic.
#[test]
fn garbled_meshes_never_panic() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let ply_text = ascii_ply("4", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 40\n3 0 1 2 50\n");
    let mut binary = ply_text.replace("ascii", "binary_little_endian").into_bytes();
    binary.extend([7; 200]);
    let inputs =
        [small_obj().as_bytes().to_vec(), ply_text.into(), binary, triangle_gltf(2, 40, 3).into()];
    for round in 0..20_000 {
        let mut bytes = inputs[round % 4].clone();
        for _ in 0..rng.random_range(1..5) {
            let i = rng.random_range(0..bytes.len());
            bytes[i] = match rng.random_range(0..3) {
                0 => rng.random(),
                1 => b"0123456789-./ ev"[rng.random_range(0..16)],
                _ => bytes[rng.random_range(0..bytes.len())],
            };
        }
        let mesh = match round % 4 {
            0 => obj::read(&bytes),
            3 => gltf::read(&bytes, Path::new("nowhere")),
            _ => ply::read(&bytes),
        };
        let _ = mesh.and_then(|m| check(&m));
    }
}

#[test]
fn unknown_endings_and_missing_files_are_told() {
    let at = Place::top("s.json").key("static").item(0).key("mesh");
    let message = load(&at, Path::new("car.stl")).unwrap_err().to_string();
    assert_eq!(
        message,
        "s.json: static[0].mesh: mesh car.stl: name: ends in none of .obj, .ply, .gltf, .glb"
    );
    let message = load(&at, Path::new("nowhere/car.obj")).unwrap_err().to_string();
    let start = "s.json: static[0].mesh: mesh nowhere/car.obj: file: cannot be read: No such file";
    assert!(message.starts_with(start), "{message}");
    assert!(message.ends_with("; name a mesh from the folder of the description"), "{message}");
}

/// A mesh of the real data that `build.rs` looked for.
fn real(file: &str) -> RawMesh {
    load(&Place::top("test"), &Path::new(env!("REAL_DATA")).join(file)).unwrap()
}

fn bounds(mesh: &RawMesh) -> [DVec3; 2] {
    let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    mesh.vertices.iter().fold(start, |[lo, hi], &v| [lo.min(v), hi.max(v)])
}

fn near(a: DVec3, b: [f64; 3], tolerance: f64) {
    assert!((a - DVec3::from(b)).abs().max_element() <= tolerance, "{a} is not {b:?}");
}

#[test]
#[cfg_attr(not(has_meshes), ignore = "needs the meshes of ../shared/data or SIGHTLINE_DATA")]
fn real_obj_meshes_are_read_whole() {
    let mesh = real("scenes/mcity/mcity.obj");
    assert_eq!(mesh.faces.len(), 7333);
    let [lo, hi] = bounds(&mesh).map(|v| v * 0.254);
    near(lo, [-261.9, -463.0, 0.0], 0.5);
    near(hi, [322.3, 462.0, 19.35], 0.5);
    let curb = mesh.materials.iter().position(|m| m.as_deref() == Some("Curb")).unwrap();
    let curbs = mesh.face_material.iter().filter(|&&m| m as usize == curb).count();
    assert_eq!(curbs, 2601);
    assert!(!mesh.materials.contains(&None));
    let mesh = real("scenes/delft_3dfier/testarea.obj");
    assert_eq!(mesh.faces.len(), 28619);
    let [lo, hi] = bounds(&mesh);
    near(lo, [84616.0, 447423.0, -0.5], 1.0);
    near(hi, [85141.0, 447751.0, 13.6], 1.0);
    assert!(mesh.vertices.contains(&DVec3::new(85012.343, 447455.577, 0.88)));
}

#[test]
#[cfg_attr(not(has_meshes), ignore = "needs the meshes of ../shared/data or SIGHTLINE_DATA")]
fn real_ply_meshes_are_read_whole() {
    let mesh = real("scenes/munich_sionna.ply");
    assert_eq!(mesh.faces.len(), 38938);
    let ground = mesh.materials.iter().position(|m| m.as_deref() == Some("40")).unwrap();
    assert_eq!(mesh.face_material.iter().filter(|&&m| m as usize == ground).count(), 2);
    let mesh = real("vehicles/low_poly_car.ply");
    assert_eq!(mesh.faces.len(), 20);
    let [lo, hi] = bounds(&mesh);
    near(hi - lo, [4.4, 1.8, 1.5], 0.01);
}

#[test]
#[cfg_attr(not(has_meshes), ignore = "needs the meshes of ../shared/data or SIGHTLINE_DATA")]
fn a_real_gltf_is_placed_by_its_nodes() {
    let mesh = real("vehicles/CesiumMilkTruck.glb");
    assert_eq!(mesh.faces.len(), 3624);
    let [lo, hi] = bounds(&mesh);
    // y up in the file.
    near(hi - lo, [4.87, 2.58, 2.80], 0.05);
    assert!(mesh.materials.contains(&Some("glass".to_owned())));
}
