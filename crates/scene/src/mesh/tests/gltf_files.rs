//! glTF: parts by hand, refusals, and axes.

use base64::Engine;
use glam::DVec3;

use crate::mesh::*;

/// Bytes as a data URI.
fn data_uri(bytes: &[u8]) -> String {
    let base64 = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!("data:application/octet-stream;base64,{base64}")
}

/// A glTF with one triangle under two nodes, its buffer as a data URI.
pub(super) fn triangle_gltf(index: u8, byte_length: usize, count: usize) -> String {
    let mut data = Vec::new();
    for v in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        data.extend(v.to_le_bytes());
    }
    data.extend([0, 1, index, 0]);
    let uri = data_uri(&data);
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
          "uri":"{uri}"}}]}}"#
    )
}

#[test]
fn gltf_nodes_place_their_meshes() {
    let mesh = gltf::read(triangle_gltf(2, 40, 3).as_bytes(), Path::new("")).unwrap();
    assert_eq!(mesh.vertices[1], DVec3::new(12.0, 0.0, 0.0));
    assert_eq!(mesh.faces, [[0, 1, 2]]);
    assert_eq!(mesh.materials, [Some("paint".to_owned())]);
}

/// A GLB whose JSON is filled up with zeros, where spaces belong.
#[test]
fn a_glb_filled_up_with_zeros_is_read() {
    let mut json = triangle_gltf(2, 40, 3).into_bytes();
    json.push(b' ');
    json.resize(json.len().next_multiple_of(4) + 4, 0);
    let size = |bytes: usize| (bytes as u32).to_le_bytes();
    let parts = [*b"glTF", size(2), size(20 + json.len()), size(json.len()), *b"JSON"];
    let bytes = [parts.concat(), json].concat();
    let mesh = gltf::read(&bytes, Path::new("")).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2]]);
}

#[test]
fn gltf_faults_never_panic() {
    let good = triangle_gltf(2, 40, 3);
    let wide: Vec<u8> = good.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let fault = |bytes: &[u8]| gltf::read(bytes, Path::new("")).unwrap_err().problem;
    assert_holds!(fault(&wide), "is UTF-16; save it as UTF-8");
    let cases = [
        (triangle_gltf(9, 40, 3), "refers to vertex 9, it has 3"),
        (triangle_gltf(2, 4000, 3), "holds 40 bytes, 4000 are announced"),
        (triangle_gltf(2, 40, 4_000_000), "reaches past its buffer"),
        (good.replace(r#""mesh":0,"#, r#""mesh":0,"children":[0],"#), "two parents"),
        (good.replace(r#""byteOffset":36"#, r#""byteOffset":3600"#), "reaches past its buffer"),
        (
            good.replace(r#""version":"2.0""#, r#""version":"2.1","minVersion":"2.1""#),
            "needs version \"2.1\" (`minVersion`); export glTF 2.0",
        ),
        (good.replace("5121", "5126"), "not whole numbers"),
        (
            good.replace(r#""mesh":0,"#, r#""mesh":0,"mesh":0,"#),
            "this key comes twice: `mesh`; leave",
        ),
        (good.replace(r#""scene":0,"scenes":[{"nodes":[0]}],"#, ""), "no scene"),
    ];
    for (text, problem) in cases {
        assert_holds!(fault(text.as_bytes()), problem);
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
        assert_holds!(fault(named(uri).as_bytes()), problem);
    }
    for end in 0..good.len() {
        assert!(gltf::read(&good.as_bytes()[..end], Path::new("")).is_err(), "cut at {end}");
    }
}

/// A glTF of the seeds that has every kind of part, changed by `change`.
fn kinds_gltf(change: impl Fn(&mut serde_json::Value)) -> Result<RawMesh, MeshFault> {
    let text = include_str!("../../../../../fuzz/corpus/mesh_gltf/kinds.gltf");
    let mut json: serde_json::Value = serde_json::from_str(text).unwrap();
    change(&mut json);
    gltf::read(json.to_string().as_bytes(), Path::new(""))
}

/// Instances, a skin, morph targets, sparse and quantized data: each corner by hand.
#[test]
fn gltf_parts_stand_where_the_format_puts_them() {
    let mesh = kinds_gltf(|_| {}).unwrap();
    let (one, two) = (128.0 / 255.0, 127.0 / 255.0);
    for (i, place) in [
        // Three instances of a quad from (0, 0, 0) to (0, 1, -1), the second turned half about y, the third about z.
        (0, [5.0, 0.0, 0.0]),
        (2, [5.0, 1.0, -1.0]),
        (4, [0.0, 0.0, 5.0]),
        (6, [0.0, 1.0, 6.0]),
        (8, [9.0, 1.0, 2.0]),
        (10, [9.0, 0.0, 1.0]),
        // A skin of two joints: 128/255 of (y + 1) and 127/255 of (−x, 2 y, z); its node at z 9 has no part.
        (12, [0.0, one, 0.0]),
        (14, [0.0, 2.0 * one + 2.0 * two, -1.0]),
        // A strip of sparse points, moved by half of a target: (2, 2, 2) + (0, 0, −1) / 2.
        (16, [0.0; 3]),
        (17, [1.0, 1.5, 1.0]),
        (18, [0.0, 0.5, -0.5]),
        (19, [2.0, 2.0, 1.5]),
    ] {
        super::near(mesh.vertices[i], place, 1e-6);
    }
    assert_eq!(mesh.faces[8..], [[16, 17, 18], [18, 17, 19], [20, 21, 22], [20, 22, 23]]);
    assert_eq!(mesh.axes, Some(MeshAxes::ZForward));
    let doubts: Vec<&str> = mesh.notes.iter().filter(|n| n.is_doubt()).map(Note::text).collect();
    assert_eq!(doubts.len(), 2, "{doubts:?}");
    assert_holds!(doubts[0], "ACME_unknown");
    assert_begins!(doubts[1], "1 nodes");
}

/// Sparse values stand among zeros where there is no data, and their indices rise.
#[test]
fn gltf_sparse_indices_rise_and_fit() {
    // Two u16 indices, padded to 4 bytes, and two points.
    let sparse = |indices: [u16; 2], base: bool, change: &dyn Fn(&mut serde_json::Value)| {
        let mut data: Vec<u8> = indices.into_iter().flat_map(u16::to_le_bytes).collect();
        data.extend([1f32, 2.0, 3.0, 4.0, 5.0, 6.0].into_iter().flat_map(f32::to_le_bytes));
        let mut json: serde_json::Value = serde_json::from_str(&triangle_gltf(2, 40, 3)).unwrap();
        json["nodes"] = serde_json::json!([{ "mesh": 0 }]);
        let push = |list: &mut serde_json::Value, part| list.as_array_mut().unwrap().push(part);
        push(
            &mut json["buffers"],
            serde_json::json!({ "byteLength": data.len(), "uri": data_uri(&data) }),
        );
        push(&mut json["bufferViews"], serde_json::json!({ "buffer": 1, "byteLength": 4 }));
        let values = serde_json::json!({ "buffer": 1, "byteOffset": 4, "byteLength": 24 });
        push(&mut json["bufferViews"], values);
        json["accessors"][0]["sparse"] = serde_json::json!({ "count": 2,
            "indices": { "bufferView": 2, "componentType": 5123 }, "values": { "bufferView": 3 } });
        if !base {
            json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        }
        change(&mut json["accessors"][0]["sparse"]);
        gltf::read(json.to_string().as_bytes(), Path::new(""))
    };
    let [one, two] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]].map(DVec3::from);
    let keep = |_: &mut serde_json::Value| {};
    assert_eq!(sparse([0, 2], false, &keep).unwrap().vertices, [one, DVec3::ZERO, two]);
    assert_eq!(sparse([1, 2], false, &keep).unwrap().vertices, [DVec3::ZERO, one, two]);
    assert_eq!(sparse([0, 2], true, &keep).unwrap().vertices, [one, DVec3::X, two]);
    let told = |indices, change: &dyn Fn(&mut serde_json::Value)| {
        sparse(indices, false, change).unwrap_err().problem
    };
    for (indices, problem) in [
        ([2, 0], "uses accessor 0, whose sparse index 0 follows 2; glTF sorts them"),
        ([1, 1], "uses accessor 0, whose sparse index 1 follows 1; glTF sorts them"),
        ([1, 3], "uses accessor 0, whose sparse index 3 is past its 3 items"),
    ] {
        assert_holds!(told(indices, &keep), problem);
    }
    let told = told([0, 2], &|sparse| sparse["indices"]["componentType"] = 5126.into());
    assert_holds!(told, "accessors[0].sparse.indices.componentType");
}

/// Inverse bind matrices move a vertex before its joints do.
#[test]
fn a_skin_is_bound_where_its_matrices_say() {
    let mut data = Vec::new();
    for moved in [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]] {
        let matrix = glam::Mat4::from_translation(moved.into()).to_cols_array();
        data.extend(matrix.into_iter().flat_map(f32::to_le_bytes));
    }
    let mesh = kinds_gltf(|json| {
        let [buffer, view] =
            ["buffers", "bufferViews"].map(|key| json[key].as_array().unwrap().len());
        let push = |json: &mut serde_json::Value, key: &str, value| {
            json[key].as_array_mut().unwrap().push(value)
        };
        push(json, "buffers", serde_json::json!({ "byteLength": 128, "uri": data_uri(&data) }));
        push(json, "bufferViews", serde_json::json!({ "buffer": buffer, "byteLength": 128 }));
        json["accessors"][6]["bufferView"] = view.into();
    });
    // The vertex (0, 0, 0): 128/255 of (1, 2 + 1, 3) and 127/255 of (−4, 2 · 5, 6).
    let (one, two) = (128.0 / 255.0, 127.0 / 255.0);
    let wanted = DVec3::new(one - 4.0 * two, 3.0 * one + 10.0 * two, 3.0 * one + 6.0 * two);
    let found = mesh.unwrap().vertices[12];
    assert!((found - wanted).abs().max_element() < 1e-6, "{found} is not {wanted}");
}

#[test]
fn places_that_are_none_are_refused() {
    let fails = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut json: serde_json::Value = serde_json::from_str(&triangle_gltf(2, 40, 3)).unwrap();
        change(&mut json);
        let MeshFault { element, problem } =
            gltf::read(json.to_string().as_bytes(), Path::new("nowhere")).unwrap_err();
        format!("{element}: {problem}")
    };
    let matrix: Vec<f64> = (0..16).map(|k| f64::from(u8::from(k % 5 == 0))).collect();
    let both = fails(&|json| {
        json["nodes"][0] =
            serde_json::json!({ "mesh": 0, "matrix": matrix, "translation": [1, 0, 0] });
    });
    assert!(both.contains("node 0") && both.contains("a matrix beside translation"), "{both}");
    let long = fails(&|json| json["nodes"][0]["rotation"] = serde_json::json!([0, 0, 0, 2]));
    assert!(long.contains("node 0") && long.contains("no unit quaternion"), "{long}");
    let old = fails(&|json| json["asset"]["version"] = "1.0".into());
    assert!(old.contains("is of version \"1.0\"; export glTF 2.0"), "{old}");
}

#[test]
fn gltf_parts_that_cannot_be_read_are_refused_by_name() {
    const OF_COPIES: &str = "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes";
    let rotation = format!("{OF_COPIES}/ROTATION");
    let two = serde_json::json!([0.5, 0.5]);
    let cases: [(&str, serde_json::Value, &str); 10] = [
        ("/nodes/5/weights", two, "has 1 morph targets and 2 weights; give each its own"),
        (
            "/extensionsRequired/0",
            "KHR_draco_mesh_compression".into(),
            "requires the extension KHR_draco_mesh_compression, which is not read; Draco compression: export without",
        ),
        (
            "/extensionsRequired/0",
            "ACME_unknown".into(),
            "requires the extension ACME_unknown, which is not read; export the model without it",
        ),
        ("/skins/0/joints/1", 6.into(), "joints outside of its scene"),
        (rotation.as_str(), 0.into(), "Vec3, not Vec4"),
        (rotation.as_str(), 99.into(), "ROTATION is no accessor"),
        (OF_COPIES, serde_json::json!({}), "without TRANSLATION"),
        ("/accessors/8/sparse/count", 3.into(), "reaches past its buffer"),
        ("/accessors/8/count", 2.into(), "sparse index 3 is past its 2 items"),
        ("/accessors/8/count", 4_000_000_000_u64.into(), "one too many"),
    ];
    for (place, value, problem) in cases {
        let changed = kinds_gltf(|json| *json.pointer_mut(place).unwrap() = value.clone());
        assert_holds!(changed.unwrap_err().problem, problem);
    }
    // Looks may be required; hidden nodes have no surface.
    let harmless = kinds_gltf(|json| json["extensionsRequired"][0] = "KHR_texture_basisu".into());
    assert_eq!(harmless.unwrap().faces.len(), 12);
    let hidden = serde_json::json!({ "KHR_node_visibility": { "visible": false } });
    let hidden = kinds_gltf(|json| json["nodes"][1]["extensions"] = hidden.clone()).unwrap();
    assert_eq!(hidden.faces.len(), 10);
    let odd = serde_json::json!({ "KHR_node_visibility": { "visible": "false" } });
    let odd = kinds_gltf(|json| json["nodes"][1]["extensions"] = odd.clone()).unwrap_err();
    assert_holds!(odd.problem, "otherwise than by true or false");
}

/// A key that is nearly one of glTF moves nothing, and a key of somebody's own changes nothing.
#[test]
fn gltf_keys_that_nobody_reads_are_told() {
    let notes = |from: &str, to: &str| {
        let text = triangle_gltf(2, 40, 3).replacen(from, to, 1);
        let mesh = gltf::read(text.as_bytes(), Path::new("")).unwrap();
        let told = mesh.notes.iter().map(|note| (note.is_doubt(), note.text().to_owned()));
        told.collect::<Vec<_>>()
    };
    assert_eq!(notes("", ""), []);
    assert_eq!(notes("\"mesh\":0", "\"mesh\":0,\"extras\":{\"a\":1},\"name\":\"n\""), []);
    for (from, to, is_doubt, words) in [
        (
            "\"translation\"",
            "\"translations\"",
            true,
            "nodes[0]: the key `translations` is not known here, and not read; did",
        ),
        ("\"indices\"", "\"indexes\"", true, "meshes[0].primitives[0]: the key `indexes`"),
        (
            "\"mesh\":0",
            "\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancings\":{}}",
            true,
            "not read: EXT_mesh_gpu_instancings;",
        ),
        (
            "\"mesh\":0",
            "\"mesh\":0,\"zzz\":1",
            false,
            "nodes[1]: the key `zzz` is not known here, and not read",
        ),
    ] {
        let told = notes(from, to);
        assert_eq!((told.len(), told[0].0), (1, is_doubt), "{told:?}");
        assert_holds!(told[0].1, words);
    }
}

#[test]
fn axes_are_those_of_the_description_then_of_the_file_then_of_the_format() {
    let (at, y_up, z_up) = (Location::top("s.json"), [1.0, -3.0, 2.0], [1.0, 2.0, 3.0]);
    let forward = [3.0, 1.0, 2.0];
    let own = Some(MeshAxes::ZForward);
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
    let odd = Placing::new(&at, Some("x-up"), None, [0.0; 3], [0.0; 3]);
    assert_holds!(odd.err().unwrap(), "z-forward");
}

/// Parts without a surface, and numbers that JSON writes in another way, change no triangle.
#[test]
fn gltf_is_read_whatever_its_animations_scenes_and_textures_are() {
    let good = triangle_gltf(2, 40, 3);
    let wanted = gltf::read(good.as_bytes(), Path::new("")).unwrap();
    let more = |more: &str| good.replacen('{', &format!("{{{more},"), 1);
    let animated = |target: &str| {
        more(&format!(
            r#""animations":[{{"samplers":[{{"input":0,"output":0}}],"channels":[{{"sampler":0,"target":{target}}}]}}]"#
        ))
    };
    let zeros = r#""accessors":[{"componentType":5126,"count":3,"type":"VEC3"},"#;
    let shifted = |text: &str| text.replace(r#""indices":1"#, r#""indices":2"#);
    let with_zeros = |attribute: &str| {
        let text = shifted(&good).replace(r#""POSITION":0"#, r#""POSITION":1,"NEW":0"#);
        text.replace("NEW", attribute).replace(r#""accessors":["#, zeros)
    };
    let cases = [
        animated(r#"{"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/x"}}}"#),
        animated(r#"{"path":"translation"}"#),
        good.replace(r#""scenes":[{"nodes":[0]}]"#, r#""scenes":[{"nodes":[0]},{"name":"empty"}]"#),
        good.replace(r#""count":3"#, r#""count":3.0"#).replace(r#""mesh":0"#, r#""mesh":0.0"#),
        more(r#""cameras":[{"type":"odd"}],"samplers":[{"wrapS":1}],"textures":[{"source":9}]"#),
        with_zeros("NORMAL"),
        with_zeros("COLOR_7"),
        shifted(&good)
            .replace(r#""POSITION":0"#, r#""POSITION":1"#)
            .replace(r#""material":0"#, r#""material":0,"targets":[{"POSITION":0}]"#)
            .replace(r#""primitives""#, r#""weights":[1.0],"primitives""#)
            .replace(r#""accessors":["#, zeros),
    ];
    for text in cases {
        let mesh =
            gltf::read(text.as_bytes(), Path::new("")).unwrap_or_else(|e| panic!("{e:?}: {text}"));
        assert_eq!((&mesh.vertices, &mesh.faces), (&wanted.vertices, &wanted.faces), "{text}");
        assert_eq!(mesh.materials, wanted.materials);
    }
    // An accessor without data is all zeros, unless its data are packed elsewhere, or too many.
    let bare = good.replacen(r#""bufferView":0,"#, "", 1);
    let mesh = gltf::read(bare.as_bytes(), Path::new("")).unwrap();
    assert_eq!(mesh.vertices, [DVec3::new(10.0, 0.0, 0.0); 3]);
    let packed = r#""indices":1,"extensions":{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{}}}"#;
    let many = bare.replacen(r#""count":3"#, r#""count":3000000"#, 1);
    for (text, told) in [
        (bare.replace(r#""indices":1"#, packed), "KHR_draco_mesh_compression alone"),
        (many, "9000000 numbers without data"),
    ] {
        assert_holds!(gltf::read(text.as_bytes(), Path::new("")).unwrap_err().problem, told);
    }
}

/// Numbers of nodes are doubles: `f32` rounds these to half a metre and more.
#[test]
fn places_of_nodes_are_read_as_doubles() {
    let [east, north] = [691_000.123, 5_334_765.877];
    let good = triangle_gltf(2, 40, 3);
    let placed = [
        format!(r#""translation":[{east},0,{north}]"#),
        format!(r#""matrix":[1,0,0,0, 0,1,0,0, 0,0,1,0, {east},0,{north},1]"#),
    ];
    for place in placed {
        let text = good.replace(r#""translation":[10,0,0]"#, &place);
        let mesh = gltf::read(text.as_bytes(), Path::new("")).unwrap();
        assert_eq!(mesh.vertices[0], DVec3::new(east, 0.0, north), "{place}");
    }
    let turn = r#""rotation":[0, 0, 0.6, 0.8], "scale": [0.1, 1, 1]"#;
    let text = good.replace(r#""translation":[10,0,0]"#, turn);
    let mesh = gltf::read(text.as_bytes(), Path::new("")).unwrap();
    // Twice the angle whose sine is 0.6: cosine 0.28, sine 0.96; the inner node doubles.
    assert!((mesh.vertices[1] - DVec3::new(0.28, 0.96, 0.0) * 0.2).length() < 1e-15);
}

#[test]
fn a_matrix_row_by_row_is_refused_and_deep_nesting_is_told_apart() {
    let good = triangle_gltf(2, 40, 3);
    let rows = r#""matrix":[1,0,0,10, 0,1,0,0, 0,0,1,0, 0,0,0,1]"#;
    let text = good.replace(r#""translation":[10,0,0]"#, rows);
    let fault = gltf::read(text.as_bytes(), Path::new("")).unwrap_err();
    assert_eq!(fault.element, "node 0");
    assert_begins!(fault.problem, "matrix: ");
    assert_holds!(fault.problem, "row by row; glTF stores it column by column");
    let chain: Vec<String> = (0..70).map(|k| format!(r#"{{"children":[{}]}}"#, k + 1)).collect();
    let nodes = format!(r#""nodes":[{},{{"mesh":0}}],"materials""#, chain.join(","));
    let start = good.find(r#""nodes":[{"#).unwrap();
    let end = good.find(r#""materials""#).unwrap() + r#""materials""#.len();
    let deep = format!("{}{nodes}{}", &good[..start], &good[end..]);
    let fault = gltf::read(deep.as_bytes(), Path::new("")).unwrap_err();
    assert_holds!(fault.problem, "nested more than 64 nodes deep");
}
