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
        ("v 0 0\n", "line 1: lacks one of the numbers x, y, z"),
        ("v 0 0 1,5\n", "line 1: \"1,5\" is not a number such as 1.5 or -2e3"),
        ("v 0 0 1d3\n", "line 1: \"1d3\" is not a number such as 1.5 or -2e3"),
        ("v 0 0 0\nv 1 0 0\nf 1 2 x\n", "line 3: \"x\" is not a vertex of a face"),
        (
            "v 0 0 0\nsurf 0 1 0 1 1\n",
            "line 2: `surf` is a free-form surface, which is not read; export the model as polygons",
        ),
        (
            "\n\ncall other.obj\n",
            "line 3: `call` includes another file, which is not read; put all into one file",
        ),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "line 4: refers to vertex 9, there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "line 4: refers to vertex 0, there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4: refers to vertex -4, there are 3"),
        ("v 0 0 0\n", "file: holds no triangle; export its faces, not points or lines alone"),
        ("", "file: holds no triangle; export its faces, not points or lines alone"),
    ];
    for (text, message) in cases {
        assert_eq!(obj_error(text), message, "{text:?}");
    }
    for (bytes, line) in [(&b"v 0 0 0\r\n\0\xfe"[..], "line 2"), (b"\xff\xfev\0", "line 1")] {
        assert_eq!(obj::read(bytes).unwrap_err().element, line);
    }
    for number in ["nan", "1e400", "-inf"] {
        let text = format!("v 0 0 0\nv 1 {number} 0\nv 0 1 0\nv 0 {number} 2\nf 1 2 3\n");
        let message = obj_error(&text);
        assert!(message.starts_with("vertex 1: ") && message.contains("not a finite"), "{message}");
        // A vertex without a face may be anywhere.
        let mut mesh = obj::read(text.replace("f 1 2 3", "f 1 3 1").as_bytes()).unwrap();
        check(&mesh).unwrap();
        mesh.drop_unused();
        assert_eq!((mesh.vertices.len(), &mesh.faces[..]), (2, &[[0, 1, 0]][..]));
    }
}

/// Spellings that exporters use, each of the square that is written plainly first.
#[test]
fn obj_is_read_in_every_spelling() {
    let plain = "v 10 -4 -2\nv 10 4 -2\nv 10 4 2\nv 10 -4 2\nusemtl road\nf 1 2 3 4\n";
    let expected = obj::read(plain.as_bytes()).unwrap();
    let spellings = [
        format!("\u{feff}{plain}"),
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        plain.replace(' ', "\t "),
        plain.replace("f 1 2 3 4", "f 1 2 \\\n3 \\  \r\n4"),
        plain.replace("f 1 2 3 4", "f -4/nan/7 -3//9 -2/1 -1 # 5"),
        plain.replace("10 ", "+1.e1 ").replace("-2\n", "-2. nan 0.5 1\n"),
        format!("vn 0 0 nan\nvt inf nan\n# C:\\models\\\ng a\\\n{plain}"),
        plain.replace("f 1", "fo 1"),
    ];
    for text in spellings {
        let mesh = obj::read(text.as_bytes()).unwrap_or_else(|fault| panic!("{text:?}: {fault:?}"));
        assert_eq!(mesh.vertices, expected.vertices, "{text:?}");
        assert_eq!(
            (&mesh.faces, &mesh.materials),
            (&expected.faces, &expected.materials),
            "{text:?}"
        );
        assert!(mesh.notes.is_empty(), "{:?}", mesh.notes);
    }
    let first = plain.replace("usemtl road\nf 1 2 3 4\n", "");
    let mesh = obj::read(format!("usemtl road\nf 1 2 3 4\n{first}").as_bytes()).unwrap();
    assert_eq!(mesh.faces, expected.faces);
}

#[test]
fn obj_names_in_other_encodings_and_unknown_statements_are_told() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
    // Stra\u{df}e in Latin-1; a name in GBK that ends in a byte which is a backslash elsewhere.
    for (name, read) in [(&b"Stra\xdfe"[..], "Stra\u{df}e"), (b"\xd5\x5c", "\u{d5}\\")] {
        let bytes = [square.as_bytes(), b"usemtl ", name, b"\nf 1 2 3\nf 1"].concat();
        let mesh = obj::read(&bytes).unwrap();
        assert_eq!(mesh.materials, [Some(read.to_owned())]);
        let notes: Vec<&str> = mesh.notes.iter().map(Note::text).collect();
        assert!(
            notes.len() == 2
                && notes[0].starts_with("1 of 2 faces")
                && notes[1].contains("Latin-1"),
            "{notes:?}"
        );
    }
    let mesh = obj::read(format!("{square}f 1 2 3\ncubes 1\ncubes 2\n").as_bytes()).unwrap();
    let [note] = &mesh.notes[..] else { panic!("{:?}", mesh.notes) };
    assert!(note.is_doubt() && note.text().ends_with("\"cubes\" (line 5, 2 in all)"), "{note}");
}

/// Concave faces of each format cover their polygon alone, in the reader itself.
#[test]
fn concave_faces_are_not_fans() {
    let l = [[0, 0], [6, 0], [6, 1], [1, 1], [1, 6], [0, 6]];
    let mut corners: Vec<String> = l.iter().map(|[y, z]| format!("10 {y} {z}\n")).collect();
    corners.rotate_left(1);
    let obj = corners.iter().map(|c| format!("v {c}")).collect::<String>() + "f 1 2 3 4 5 6\n";
    let ply = ascii_ply("6", &(corners.concat() + "6 0 1 2 3 4 5 40\n3 0 0 0 40\n"));
    for mesh in [obj::read(obj.as_bytes()).unwrap(), ply::read(ply.as_bytes()).unwrap()] {
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        assert_eq!(mesh.faces.iter().map(area).sum::<f64>(), 11.0);
    }
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
    let text = ascii_ply("4", "0 0 0\n1 0 0\n1 1 0\n-85012.343 1 0\n4 0 1 2 3 40\n3 0 1 2 50\n");
    let mesh = ply::read(text.as_bytes()).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert_eq!(mesh.materials, [Some("40".to_owned()), Some("50".to_owned())]);
    assert_eq!(mesh.face_material, [0, 0, 1]);
    assert_eq!(mesh.vertices[3].x, -85012.343);
}

#[test]
fn ply_faults_are_told_before_memory_is_spent() {
    let body = "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 40\n3 0 1 7 50\n";
    let cases = [
        (ascii_ply("4000000000", body), "element vertex", "4000000000 announced"),
        (ascii_ply("3", body), "face 1", "refers to vertex 7, there are 3"),
        (ascii_ply("3", &body.replace("3 0 1 7 50\n", "")), "face 1", "unexpected end"),
        (ascii_ply("3", &body.replace("1 1 0", "1 NaN 0").replace('7', "2")), "vertex 2", "NaN"),
        (ascii_ply("3", &body.replace("1 1 0", "1 x 0")), "vertex 2", "\"x\" is not a number"),
        (
            ascii_ply("3", &body.replace("0 1 7", "0 -1 2")),
            "face 1",
            "refers to vertex -1, there are 3",
        ),
        (
            ascii_ply("3", &body.replace("7 50", "2 50.5")),
            "face 1",
            "label 50.5, which is not a whole number",
        ),
        (
            ascii_ply("3", &body.replace("7 50", "2 nan")),
            "face 1",
            "label NaN, which is not a whole number",
        ),
        (ascii_ply("3", &body.replace("7 50", "2 50 1")), "face 1", "more values"),
        (ascii_ply("3", &body.replace("7 50", "2")), "face 1", "fewer values"),
        (
            ascii_ply("3", &(body.replace('7', "2") + "3 0 1 2 50\n")),
            "file",
            "behind its last element",
        ),
        (
            ascii_ply("3", body).replace("vertex_indices", "corners"),
            "element face",
            "no list `vertex_indices`",
        ),
        (
            ascii_ply("3", body).replace("element face", "element tetrahedra"),
            "element tetrahedra",
            "not read",
        ),
        (ascii_ply("3", body).replace("property double x\n", ""), "element vertex", "lacks one"),
        (
            ascii_ply("3", body).replace("double y", "double x"),
            "element vertex",
            "two properties \"x\"",
        ),
        (
            ascii_ply("3", body).replace("element face", "element none 9\nelement face"),
            "element none",
            "without properties",
        ),
        (
            ascii_ply("3", body)
                .replace("element face", "element vertex 1\nproperty int x\nelement face"),
            "element vertex",
            "twice",
        ),
        (
            ascii_ply("3", body).replace("uchar label", "text label"),
            "header line 9",
            "unknown type \"text\"",
        ),
        ("ply\nformat ascii 1.0\n".to_owned(), "header", ""),
        (String::new(), "header", ""),
    ];
    for (text, element, problem) in cases {
        let fault = ply::read(text.as_bytes()).and_then(|m| check(&m)).unwrap_err();
        assert_eq!(fault.element, element, "{fault:?}");
        assert!(fault.problem.contains(problem), "{fault:?}");
    }
}

/// The faces and labels that a file has, told in each way.
#[test]
fn ply_is_read_in_every_spelling() {
    let body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 40\n3 0 1 2 50\n";
    let plain = ascii_ply("4", body);
    let expected = ply::read(plain.as_bytes()).unwrap();
    let spellings = [
        format!("\u{feff}{plain}"),
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        plain.replace(' ', "\t "),
        plain.replace("ply\n", "ply\ncomment Stra\u{df}e\nobj_info x\n"),
        plain.replace("uchar label", "float label").replace("40\n3", "40.0\n3"),
        plain.replace("uchar int", "int8 double").replace("0 1 2 3 ", "0.0 1. 2 3 "),
        plain
            .replace("0 0 0\n1 0", "nan -nan 1.#QNAN 0 0 0\n1 2 3 1 0")
            .replace("\n1 1 0", "\n0 0 0 1 1 0")
            .replace("\n0 1 0", "\n0 0 0 0 1 0")
            .replace(
                "property double x",
                "property float nx\nproperty float ny\nproperty float nz\nproperty double x",
            ),
    ];
    for text in spellings {
        let mesh = ply::read(text.as_bytes()).unwrap_or_else(|fault| panic!("{text:?}: {fault:?}"));
        assert_eq!(
            (&mesh.vertices, &mesh.faces),
            (&expected.vertices, &expected.faces),
            "{text:?}"
        );
        assert_eq!(
            (&mesh.materials, &mesh.face_material),
            (&expected.materials, &expected.face_material)
        );
        assert!(mesh.notes.is_empty(), "{:?}", mesh.notes);
    }
}

/// Binary bodies behind each kind of line end, in both orders of bytes; the first byte is a line feed.
#[test]
fn ply_bodies_begin_right_behind_the_header() {
    for end in ["\n", "\r\n", "\r"] {
        for (name, big) in [("little", false), ("big", true)] {
            let header = format!(
                "ply\nformat binary_{name}_endian 1.0\nelement vertex 3\nproperty short x\nproperty char y\n\
                 property uchar z\nelement face 1\nproperty list uchar ushort vertex_index\nend_header\n"
            );
            let mut bytes = header.replace('\n', end).into_bytes();
            let short = |v: i16| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            for (x, y, z) in [(0x0A0A, 0, 0), (-1, -1_i8, 0), (0, 1, 200_u8)] {
                bytes.extend([&short(x)[..], &[y as u8, z]].concat());
            }
            bytes.push(3);
            [0, 1, 2].iter().for_each(|v| bytes.extend(short(*v)));
            let mesh = ply::read(&bytes).unwrap();
            let right = [[2570.0, 0.0, 0.0], [-1.0, -1.0, 0.0], [0.0, 1.0, 200.0]];
            assert_eq!(mesh.vertices, right.map(DVec3::from), "{end:?} {name}");
            assert_eq!(mesh.faces, [[0, 1, 2]]);
        }
    }
}

#[test]
fn ply_strips_fans_and_labels_of_vertices_are_read() {
    let head = |more: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty int x\nproperty int y\nproperty int z\n{more}end_header\n"
        )
    };
    let points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n";
    let list = "property list int int vertex_indices\n";
    let text = head(&format!("element tristrips 1\n{list}element trifans 1\n{list}"))
        + points
        + "8 0 1 2 3 -1 2 3 4\n4 0 1 3 4\n";
    let mesh = ply::read(text.as_bytes()).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [0, 1, 3], [0, 3, 4]]);
    let labelled = points
        .replace(" 0\n", " 0 7\n")
        .replace("1 1 0 7", "1 1 0 9")
        .replace("0 2 0 7", "0 2 0 9.0");
    let text = head(&format!("property float label\nelement face 3\n{list}"))
        + &labelled
        + "3 0 1 2\n3 2 3 4\n3 3 1 0\n";
    let mesh = ply::read(text.as_bytes()).unwrap();
    let labels: Vec<_> = mesh
        .face_material
        .iter()
        .map(|m| mesh.materials[*m as usize].as_deref().unwrap())
        .collect();
    assert_eq!(labels, ["7", "9", "7"]);
    assert!(
        mesh.notes.len() == 1 && mesh.notes[0].text().starts_with("2 faces have corners"),
        "{:?}",
        mesh.notes
    );
}

#[test]
fn ply_names_what_it_passes_over() {
    let body = "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 40\n3 0 1 2 50\n";
    let told = |from: &str, to: &str, body: &str| {
        let mesh = ply::read(ascii_ply("3", body).replace(from, to).as_bytes()).unwrap();
        mesh.notes.first().map(|note| (note.is_doubt(), note.text().to_owned())).unwrap_or_default()
    };
    assert_eq!(told("uchar label", "uchar flags", body), (false, String::new()));
    assert_eq!(
        told("uchar label", "uchar odd", body),
        (false, "passed over: face property odd".to_owned())
    );
    let (doubt, text) = told("uchar label", "uchar scalar_Classification", body);
    assert!(
        doubt
            && text.contains("face property scalar_Classification")
            && text.contains("`label` alone"),
        "{text}"
    );
    let (_, text) =
        told("end_header", "element odd 1\nproperty int a\nend_header", &(body.to_owned() + "1\n"));
    assert_eq!(text, "passed over: element odd");
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
        (triangle_gltf(2, 40, 4_000_000), "reaches past its buffer"),
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
        ("/dev/zero", "--trust-paths"),
        ("file:///dev/zero", "--trust-paths"),
        ("../a.bin", "--trust-paths"),
        ("%2e%2e/a.bin", "--trust-paths"),
        ("a/%2E%2e/..%2fa.bin", "--trust-paths"),
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

/// A glTF of the seeds that has every kind of part, changed by `change`.
fn kinds_gltf(change: impl Fn(&mut serde_json::Value)) -> Result<RawMesh, Fault> {
    let text = include_str!("../../fuzz/corpus/mesh_gltf/kinds.gltf");
    let mut json: serde_json::Value = serde_json::from_str(text).unwrap();
    change(&mut json);
    gltf::read(json.to_string().as_bytes(), Path::new(""))
}

/// Instances, a skin, morph targets, sparse and quantized data: each corner by hand.
#[test]
fn gltf_parts_stand_where_the_format_puts_them() {
    let mesh = kinds_gltf(|_| {}).unwrap();
    let near = |i: usize, place: [f64; 3]| {
        let v = mesh.vertices[i];
        assert!(
            (v - DVec3::from(place)).abs().max_element() < 1e-6,
            "vertex {i}: {v} is not {place:?}"
        );
    };
    // Three instances of a quad from (0, 0, 0) to (0, 1, -1), the second turned half about y, the third about z.
    for (i, p) in
        [(0, [5.0, 0.0, 0.0]), (2, [5.0, 1.0, -1.0]), (4, [0.0, 0.0, 5.0]), (6, [0.0, 1.0, 6.0])]
    {
        near(i, p);
    }
    for (i, p) in [(8, [9.0, 1.0, 2.0]), (10, [9.0, 0.0, 1.0])] {
        near(i, p);
    }
    // A skin of two joints: 128/255 of (y + 1) and 127/255 of (−x, 2 y, z); its node at z 9 has no part.
    let (one, two) = (128.0 / 255.0, 127.0 / 255.0);
    near(12, [0.0, one, 0.0]);
    near(14, [0.0, 2.0 * one + 2.0 * two, -1.0]);
    // A strip of sparse points, moved by half of a target: (2, 2, 2) + (0, 0, −1) / 2.
    for (i, p) in
        [(16, [0.0; 3]), (17, [1.0, 1.5, 1.0]), (18, [0.0, 0.5, -0.5]), (19, [2.0, 2.0, 1.5])]
    {
        near(i, p);
    }
    assert_eq!(mesh.faces[8..], [[16, 17, 18], [18, 17, 19], [20, 21, 22], [20, 22, 23]]);
    assert_eq!(mesh.axes, Some(raw::Axes::ZForward));
    let doubts: Vec<&str> = mesh.notes.iter().filter(|n| n.is_doubt()).map(Note::text).collect();
    assert!(
        doubts.len() == 2 && doubts[0].contains("ACME_unknown") && doubts[1].starts_with("1 nodes"),
        "{doubts:?}"
    );
}

#[test]
fn gltf_parts_that_cannot_be_read_are_refused_by_name() {
    let cases: [(&str, serde_json::Value, &str); 9] = [
        (
            "/extensionsRequired/0",
            "KHR_draco_mesh_compression".into(),
            "KHR_draco_mesh_compression",
        ),
        ("/extensionsRequired/0", "ACME_unknown".into(), "ACME_unknown"),
        ("/skins/0/joints/1", 6.into(), "joints outside of its scene"),
        (
            "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/ROTATION",
            0.into(),
            "Vec3, not Vec4",
        ),
        (
            "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/ROTATION",
            99.into(),
            "ROTATION is no accessor",
        ),
        (
            "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes",
            serde_json::json!({}),
            "without TRANSLATION",
        ),
        ("/accessors/8/sparse/count", 3.into(), "reaches past its buffer"),
        ("/accessors/8/count", 2.into(), "sparse index 3 is past its 2 items"),
        ("/accessors/8/count", 4_000_000_000_u64.into(), "one too many"),
    ];
    for (place, value, problem) in cases {
        let fault =
            kinds_gltf(|json| *json.pointer_mut(place).unwrap() = value.clone()).unwrap_err();
        assert!(fault.problem.contains(problem), "{place}: {fault:?}");
    }
    // Looks may be required; hidden nodes have no surface.
    let harmless = kinds_gltf(|json| json["extensionsRequired"][0] = "KHR_texture_basisu".into());
    assert_eq!(harmless.unwrap().faces.len(), 12);
    let hidden = serde_json::json!({ "KHR_node_visibility": { "visible": false } });
    let hidden = kinds_gltf(|json| json["nodes"][1]["extensions"] = hidden.clone()).unwrap();
    assert_eq!(hidden.faces.len(), 10);
}

#[test]
fn axes_are_those_of_the_description_then_of_the_file_then_of_the_format() {
    let (at, y_up, z_up) = (Place::top("s.json"), [1.0, -3.0, 2.0], [1.0, 2.0, 3.0]);
    let forward = [3.0, 1.0, 2.0];
    let own = Some(raw::Axes::ZForward);
    let cases = [
        ("a.glb", None, None, y_up, true),
        ("a.glb", None, own, forward, false),
        ("a.gltf", Some("y-up"), own, y_up, false),
        ("a.obj", None, None, z_up, false),
        ("a.ply", Some("z-forward"), None, forward, false),
        ("a.glb", Some("z-up"), None, z_up, false),
    ];
    for (file, word, axes, place, told) in cases {
        let mesh =
            RawMesh { vertices: vec![DVec3::new(1.0, 2.0, 3.0)], axes, ..RawMesh::default() };
        let placing = Placing::new(&at, word, None, [0.0; 3], [0.0; 3]).unwrap();
        let placed = placing.vertices(&at, Path::new(file), &mesh).unwrap();
        assert_eq!(placed, [DVec3::from(place)], "{file} {word:?}");
        assert_eq!(placing.note(&at, Path::new(file), &mesh).is_some(), told, "{file} {word:?}");
    }
    let message =
        Placing::new(&at, Some("x-up"), None, [0.0; 3], [0.0; 3]).err().unwrap().to_string();
    assert!(message.contains("z-forward"), "{message}");
}

/// An exported scene, read again as a mesh, has the same corners.
#[test]
fn own_gltf_stands_where_it_stood() {
    use crate::export::{Glb, GltfView};
    use crate::scene::{EgoBody, Scene};
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
