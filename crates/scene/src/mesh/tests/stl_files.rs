//! STL: binary and text against the same mesh as OBJ, and every fault with its place.

use crate::mesh::*;

/// A wedge of eight triangles over six corners, in quarters, so that `f32` holds them.
pub(super) fn wedge() -> Vec<[[f32; 3]; 3]> {
    let c = [
        [0.0, 0.0, 0.25],
        [4.5, 0.0, 0.25],
        [4.5, 1.75, 0.25],
        [-0.0, 1.75, 0.25],
        [1.0, 0.0, 1.5],
        [1.0, 1.75, 1.5],
    ];
    let faces =
        [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 5], [1, 5, 4], [2, 3, 5], [3, 0, 4], [3, 4, 5]];
    faces.map(|face| face.map(|corner| c[corner])).to_vec()
}

pub(super) fn as_text(triangles: &[[[f32; 3]; 3]]) -> String {
    let mut text = "solid wedge\n".to_owned();
    for corners in triangles {
        text += "  facet normal 0 0 0\n    outer loop\n";
        corners.iter().for_each(|[x, y, z]| text += &format!("      vertex {x} {y} {z}\n"));
        text += "    endloop\n  endfacet\n";
    }
    text + "endsolid wedge\n"
}

pub(super) fn as_binary(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    // Exporters begin binary files with the word, too.
    let mut bytes = b"solid by an exporter".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for corners in triangles {
        bytes.extend([0; 12]);
        let numbers = corners.as_flattened().iter();
        bytes.extend(numbers.flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn as_obj(triangles: &[[[f32; 3]; 3]]) -> String {
    let mut text = String::new();
    for corners in triangles {
        corners.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
        text += "f -3 -2 -1\n";
    }
    text
}

fn corners(mesh: &RawMesh) -> Vec<[DVec3; 3]> {
    mesh.faces.iter().map(|face| face.map(|v| mesh.vertices[v as usize])).collect()
}

fn stl_error(bytes: &[u8]) -> String {
    let fault = stl::read(bytes).and_then(|mesh| check_mesh(&mesh)).unwrap_err();
    format!("{}: {}", fault.element, fault.problem)
}

#[test]
fn binary_and_text_are_the_triangles_of_the_same_obj() {
    let obj = obj::read(as_obj(&wedge()).as_bytes()).unwrap();
    let text = as_text(&wedge());
    let shouted =
        text.replace("facet", "FACET").replace('\n', "\r\n").replace("normal 0", "normal nan");
    let filled = format!("{text}\0\0\0").into_bytes();
    for bytes in [as_binary(&wedge()), text.into_bytes(), shouted.into_bytes(), filled] {
        let mesh = stl::read(&bytes).unwrap();
        assert_eq!(corners(&mesh), corners(&obj));
        assert_eq!(mesh.vertices.len(), 6, "corners of equal bits are one");
    }
    let named = stl::read(as_text(&wedge()).as_bytes()).unwrap();
    assert_eq!(named.materials, [Some("wedge".to_owned())]);
    assert_eq!(stl::read(&as_binary(&wedge())).unwrap().materials, [None]);
}

#[test]
fn two_solids_are_two_materials_and_attributes_are_told() {
    let two = as_text(&wedge()) + &as_text(&wedge()).replace("wedge", "rear wheel");
    let mesh = stl::read(two.as_bytes()).unwrap();
    assert_eq!(mesh.materials, [Some("wedge".to_owned()), Some("rear wheel".to_owned())]);
    assert_eq!((mesh.faces.len(), mesh.face_material[7], mesh.face_material[8]), (16, 0, 1));
    let mut coloured = as_binary(&wedge());
    coloured[84 + 49] = 0x80;
    let notes = stl::read(&coloured).unwrap().notes;
    assert!(notes.len() == 1 && notes[0].text().contains("attribute bytes of 1 triangle"));
}

#[test]
fn faults_of_binary_files_name_count_and_triangle() {
    let good = as_binary(&wedge());
    let mut trailing = good.clone();
    trailing.push(0);
    let mut count = good.clone();
    count[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut nan = good.clone();
    nan[84 + 50 + 24..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let none = as_binary(&[]);
    for (bytes, message) in [
        (
            &trailing,
            "header: says 8 triangles, which take 484 bytes, and the file has 485; export it again",
        ),
        (
            &good[..483].to_vec(),
            "header: says 8 triangles, which take 484 bytes, and the file has 483; export it again",
        ),
        (
            &count,
            "header: says 4294967295 triangles, which take 214748364834 bytes, and the file has 484; export it again",
        ),
        (
            &nan,
            "triangle 1: corner 1 is at [NaNe0, 1.75e0, 2.5e-1], which is not a finite position; export it again",
        ),
        (&none, "file: holds no triangle; export its faces, not points or lines alone"),
        (
            &Vec::new(),
            "header: is neither binary STL, which has 84 bytes or more, nor text that begins with `solid`; export it again",
        ),
    ] {
        let told = stl_error(bytes).replace("[NaN,", "[NaNe0,");
        assert_eq!(told, message);
    }
}

#[test]
fn faults_of_texts_name_their_line() {
    let good = as_text(&wedge());
    let cases = [
        (
            good.replacen("vertex 4.5 1.75", "vertex 4,5 1.75", 1),
            "line 5: has \"4,5\" where `a number` belongs",
        ),
        (
            good.replacen("    endloop", "      vertex 1 1 1\n    endloop", 1),
            "line 7: has \"vertex\" where `endloop` belongs",
        ),
        (
            good.replacen("vertex 4.5 1.75", "vertex inf 1.75", 1),
            "line 8: corner 1 is at [inf, 1.75e0, 2.5e-1]",
        ),
        (
            good.replace("endsolid wedge\n", ""),
            "line 57: ends where `facet` or `endsolid` belongs; export it again",
        ),
        (good.clone() + "and more", "line 59: has \"and\" where `solid` belongs"),
        ("solid empty\nendsolid\n".to_owned(), "file: holds no triangle"),
    ];
    for (text, told) in cases {
        for end in ["\n", "\r\n", "\r"] {
            assert_holds!(stl_error(text.replace('\n', end).as_bytes()), told);
        }
    }
}
