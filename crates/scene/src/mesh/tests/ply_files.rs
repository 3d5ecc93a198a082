//! PLY: good, bad, and in every spelling.

use crate::mesh::*;

pub(super) fn ascii_ply(vertex_count: &str, body: &str) -> String {
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
    let with = |from: &str, to: &str| ascii_ply("3", body).replace(from, to);
    let inner = |from: &str, to: &str| ascii_ply("3", &body.replace(from, to));
    let of_version_2 = with("ascii 1.0", "ascii 2.0");
    let not_a_number = ascii_ply("3", &body.replace("1 1 0", "1 NaN 0").replace('7', "2"));
    let longer = ascii_ply("3", &(body.replace('7', "2") + "3 0 1 2 50\n"));
    let of_nothing = with("element face", "element none 9\nelement face");
    let twice = with("element face", "element vertex 1\nproperty int x\nelement face");
    let labels = with("uchar label", "float label");
    let float = with("list uchar", "list float");
    let plural = with("element vertex", "element vertices");
    let cases = [
        (ascii_ply("4000000000", body), "element vertex", "4000000000 announced"),
        (of_version_2, "header line 2", "is of version \"2.0\"; export PLY 1.0"),
        (ascii_ply("3", body), "face 1", "refers to vertex 7, there are 3"),
        (inner("3 0 1 7 50\n", ""), "face 1", "unexpected end"),
        (not_a_number, "vertex 2", "NaN"),
        (inner("1 1 0", "1 x 0"), "vertex 2", "\"x\" is not a number"),
        (inner("0 1 7", "0 -1 2"), "face 1", "refers to vertex -1, there are 3"),
        (labels.replace("7 50", "2 50.5"), "face 1", "label 50.5, which is not a whole number"),
        (labels.replace("7 50", "2 nan"), "face 1", "label NaN, which is not a whole number"),
        (inner("7 50", "2 50.5"), "face 1", "\"50.5\" is no uchar"),
        (inner("7 50", "2 nan"), "face 1", "\"nan\" is no uchar"),
        (inner("7 50", "2 50 1"), "face 1", "more values"),
        (inner("7 50", "2"), "face 1", "fewer values"),
        (longer, "file", "behind its last element"),
        (with("vertex_indices", "corners"), "element face", "no list `vertex_indices`"),
        (with("element face", "element tetrahedra"), "element tetrahedra", "not read"),
        (with("property double x\n", ""), "element vertex", "lacks one"),
        (with("double y", "double x"), "element vertex", "two properties \"x\""),
        (of_nothing, "element none", "without properties"),
        (twice, "element vertex", "twice"),
        (with("uchar label", "text label"), "header line 9", "unknown type \"text\""),
        (with("uchar label", "list uchar int label"), "element face", "has a list `label`"),
        (with("ascii", "ASCII"), "header line 2", "write ascii, binary"),
        (plural, "face 0", "there are 0; name the element of points `vertex`"),
        (with("double x", "double X"), "element vertex", "name them so, in small letters"),
        (inner("7 50", "2 300"), "face 1", "\"300\" is no uchar, a whole number from 0 to 255"),
        (inner("7 50", "2 -1"), "face 1", "(property label, line 15)"),
        (inner("0 1 7", "0 1 1.5"), "face 1", "\"1.5\" is no int"),
        (inner("0 1 7", "0 1 4e9"), "face 1", "from -2147483648 to 2147483647"),
        (inner("3 0 1 7", "-3 0 1 2"), "face 1", "\"-3\" is no uchar"),
        (inner("3 0 1 7", "2.5 0 1 2"), "face 1", "\"2.5\" is no uchar"),
        (inner("3 0 1 7", "300 0 1 2"), "face 1", "\"300\" is no uchar"),
        (float.replace("3 0 1 7", "2.5 0 1 2"), "face 1", "a list of 2.5 numbers; write a whole"),
        (float.replace("3 0 1 7", "-3 0 1 2"), "face 1", "a list of -3 numbers; write a whole"),
        (inner("1 1 0", "1 1 x").replace("double z", "short z"), "vertex 2", "line 13)"),
        (inner("1 1 0", "1 1 40000").replace("double z", "short z"), "vertex 2", "no short"),
        ("ply\nformat ascii 1.0\n".to_owned(), "header", ""),
        (String::new(), "header", ""),
    ];
    for (text, element, problem) in cases {
        let fault = ply::read(text.as_bytes()).and_then(|m| check_mesh(&m)).unwrap_err();
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
    assert!(expected.notes.is_empty());
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
        assert_eq!(mesh, expected, "{text:?}");
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
    let label = |m: &u32| mesh.materials[*m as usize].as_deref().unwrap();
    assert_eq!(mesh.face_material.iter().map(label).collect::<Vec<_>>(), ["7", "9", "7"]);
    let [note] = &mesh.notes[..] else { panic!("{:?}", mesh.notes) };
    assert_begins!(note, "2 faces have corners");
}

#[test]
fn ply_names_what_it_passes_over() {
    let body = "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 40\n3 0 1 2 50\n";
    let told = |from: &str, to: &str, body: &str| {
        let mesh = ply::read(ascii_ply("3", body).replace(from, to).as_bytes()).unwrap();
        mesh.notes.first().map(|note| (note.is_doubt(), note.text().to_owned())).unwrap_or_default()
    };
    assert_eq!(told("uchar label", "uchar flags", body), (false, String::new()));
    let odd = (false, "passed over: face property odd".to_owned());
    assert_eq!(told("uchar label", "uchar odd", body), odd);
    let (doubt, text) = told("uchar label", "uchar scalar_Classification", body);
    assert!(doubt);
    assert_holds!(text, "face property scalar_Classification", "`label` alone");
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
    let fault = ply::read(&not_finite).and_then(|m| check_mesh(&m)).unwrap_err();
    assert_eq!(fault.element, "vertex 2");
    // A list that announces four billion corners.
    let at = bytes.len() - 16;
    bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(ply::read(&bytes).is_err());
}

/// Both names of the list of corners in one element would make one face of two lists.
#[test]
fn a_ply_with_two_lists_of_corners_is_refused() {
    let one = ascii_ply("3", "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 3 0 1 2 40\n3 0 1 2 3 0 1 2 50\n");
    let label = "property uchar label";
    let text = one.replace(label, &format!("property list uchar int vertex_index\n{label}"));
    let fault = ply::read(text.as_bytes()).unwrap_err();
    assert_eq!(fault.element, "element face");
    assert_holds!(fault.problem, "has `vertex_indices` and `vertex_index`");
}
