//! OBJ: good, bad, and in every spelling.

use crate::mesh::*;

pub(super) fn small_obj() -> &'static str {
    "mtllib nowhere.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl Grass field\nf 1 2 3 4\n\
     usemtl Road\nf -4/1/1 -3 -2\nvt 0 0\nvn 0 0 1\nl 1 2\n"
}

fn obj_error(text: &str) -> String {
    let fault = obj::read(text.as_bytes()).and_then(|m| check_mesh(&m)).unwrap_err();
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

/// A bow tie of the unit square has no area in all: its halves turn in opposite ways.
#[test]
fn a_symmetric_bow_tie_is_doubted() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let notes = |more: &str| obj::read(format!("{square}{more}").as_bytes()).unwrap().notes;
    let [note] = &notes("f 1 3 2 4\n")[..] else { panic!("no note") };
    assert!(note.is_doubt() && note.text().starts_with("1 of 1 faces cross themselves"), "{note}");
    // A face on a line has no area, and crosses nothing.
    assert!(notes("v 0.1 0.3 0\nv 0.2 0.6 0\nv 0.3 0.9 0\nf 1 5 6 7\n").is_empty());
    assert!(notes("f 1 2 3 4\n").is_empty());
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
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n",
            "line 4: refers to vertex 0, there are 3; OBJ counts from 1",
        ),
        (
            "v 0 0 0\nv 1 0 0 # C:\\cars\\\nv 0 1 0\n",
            "line 2: has a comment that ends with a backslash, which some programs join with the next line; take the \
             backslash away",
        ),
        ("v 0 0 0\nv 1\u{a0}0 0\n", "line 2: has non-breaking spaces; write plain ones"),
        ("v 0 0 0\nv\u{a0}1 0 0\n", "line 2: has non-breaking spaces; write plain ones"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4: refers to vertex -4, there are 3"),
        ("v 0 0 0\n", "file: holds no triangle; export its faces, not points or lines alone"),
        ("", "file: holds no triangle; export its faces, not points or lines alone"),
    ];
    for (text, message) in cases {
        assert_eq!(obj_error(text), message, "{text:?}");
    }
    let joined = obj_error("v 0 0 0\nf 1 \\\n1 # of \\\n1\n");
    assert_begins!(joined, "line 2: has a comment that ends with a backslash");
    for (bytes, line) in [(&b"v 0 0 0\r\n\0\xfe"[..], "line 2"), (b"\xff\xfev\0", "line 1")] {
        assert_eq!(obj::read(bytes).unwrap_err().element, line);
    }
    for number in ["nan", "1e400", "-inf"] {
        let text = format!("v 0 0 0\nv 1 {number} 0\nv 0 1 0\nv 0 {number} 2\nf 1 2 3\n");
        assert_holds!(obj_error(&text), "vertex 1: ", "not a finite");
        // A vertex without a face may be anywhere.
        let mut mesh = obj::read(text.replace("f 1 2 3", "f 1 3 1").as_bytes()).unwrap();
        check_mesh(&mesh).unwrap();
        mesh.drop_unused();
        assert_eq!((mesh.vertices.len(), &mesh.faces[..]), (2, &[[0, 1, 0]][..]));
    }
}

/// Spellings that exporters use, each of the square that is written plainly first.
#[test]
fn obj_is_read_in_every_spelling() {
    let plain = "v 10 -4 -2\nv 10 4 -2\nv 10 4 2\nv 10 -4 2\nusemtl road\nf 1 2 3 4\n";
    let expected = obj::read(plain.as_bytes()).unwrap();
    assert!(expected.notes.is_empty());
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
        assert_eq!(mesh, expected, "{text:?}");
    }
    let first = plain.replace("usemtl road\nf 1 2 3 4\n", "");
    let mesh = obj::read(format!("usemtl road\nf 1 2 3 4\n{first}").as_bytes()).unwrap();
    assert_eq!(mesh.faces, expected.faces);
}

#[test]
fn a_weight_of_a_position_is_told() {
    let read = |end: &str| {
        let text = format!("v 2 0 0{end}\nv 2 2 0\nv 0 2 0\nf 1 2 3\n");
        let mesh = obj::read(text.as_bytes()).unwrap();
        assert_eq!(mesh.vertices[0].to_array(), [2.0, 0.0, 0.0]);
        mesh.notes.iter().map(Note::text).collect::<String>()
    };
    for plain in ["", " 1", " 1.0 # 2", " 0.5 0.5 0.5", " 0.5 0.5 0.5 1"] {
        assert_eq!(read(plain), "", "{plain}");
    }
    assert!(read(" 2").contains("moves no corner, 2 first (line 1)"), "{}", read(" 2"));
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
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert_begins!(notes[0], "1 of 2 faces");
        assert_holds!(notes[1], "Latin-1");
    }
    let mesh = obj::read(format!("{square}f 1 2 3\ncubes 1\ncubes 2\n").as_bytes()).unwrap();
    let [note] = &mesh.notes[..] else { panic!("{:?}", mesh.notes) };
    assert!(note.is_doubt() && note.text().ends_with("\"cubes\" (line 5, 2 in all)"), "{note}");
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

/// Capitals make a face of the vertices before it, not a file without a triangle.
#[test]
fn obj_keywords_in_capitals_are_read_with_a_note() {
    let small = "v 0 0 0\nv 9 0 0\nv 0 9 0\nusemtl Road\nf -3 -2 -1\nvt 0 0\n";
    let wanted = obj::read(small.as_bytes()).unwrap();
    let capitals = small.replace("v ", "V ").replace("f ", "F ").replace("usemtl", "UseMtl");
    let mesh = obj::read(capitals.replace("vt", "VT").as_bytes()).unwrap();
    assert_eq!((&mesh.vertices, &mesh.faces), (&wanted.vertices, &wanted.faces));
    assert_eq!(mesh.materials, [Some("Road".to_owned())]);
    let [note] = &mesh.notes[..] else { panic!("{:?}", mesh.notes) };
    let start = "keywords in capitals are read like small ones, \"V\" first (line 1)";
    assert!(note.text().starts_with(start), "{note}");
    assert!(wanted.notes.is_empty());
    assert_begins!(obj_error("v 0 0 0\nSURF 0 1 0 1 1\n"), "line 2: `SURF` is a free-form surface");
    let unknown = obj::read((small.to_owned() + "FACE 1 2 3\n").as_bytes()).unwrap();
    assert!(unknown.notes[0].text().contains("\"FACE\" (line 7, 1 in all)"), "{:?}", unknown.notes);
}
