//! Mesh readers: good, bad, garbled and real files.

mod gltf_files;
mod obj_files;
mod ply_files;
mod stl_files;
mod urdf_files;

use glam::DVec3;

use gltf_files::triangle_gltf;
use obj_files::small_obj;
use ply_files::ascii_ply;

use super::*;

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

/// Bytes changed at random end in a mesh or in a fault, never in a panic.
#[test]
fn garbled_meshes_never_panic() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let ply_text = ascii_ply("4", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 40\n3 0 1 2 50\n");
    let mut binary = ply_text.replace("ascii", "binary_little_endian").into_bytes();
    binary.extend([7; 200]);
    let inputs = [
        small_obj().as_bytes().to_vec(),
        ply_text.into(),
        binary,
        triangle_gltf(2, 40, 3).into(),
        stl_files::as_text(&stl_files::wedge()).into(),
        stl_files::as_binary(&stl_files::wedge()),
    ];
    for round in 0..30_000 {
        let mut bytes = inputs[round % 6].clone();
        for _ in 0..rng.random_range(1..5) {
            let i = rng.random_range(0..bytes.len());
            bytes[i] = match rng.random_range(0..3) {
                0 => rng.random(),
                1 => b"0123456789-./ ev"[rng.random_range(0..16)],
                _ => bytes[rng.random_range(0..bytes.len())],
            };
        }
        let mesh = match round % 6 {
            0 => obj::read(&bytes),
            4 | 5 => stl::read(&bytes),
            3 => gltf::read(&bytes, Path::new("nowhere")),
            _ => ply::read(&bytes),
        };
        let _ = mesh.and_then(|m| check_mesh(&m));
    }
}

#[test]
fn unknown_endings_and_missing_files_are_told() {
    let at = Location::top("s.json").key("static").item(0).key("mesh");
    let message = load(&at, Path::new("car.dae")).unwrap_err().to_string();
    assert_eq!(
        message,
        "s.json: static[0].mesh: mesh car.dae: name: ends in none of .obj, .ply, .stl, .gltf, .glb; \
         docs/own-mesh.md has a converter of three lines"
    );
    assert_ends!(load(&at, Path::new("car.max")).unwrap_err(), "convert it to one of these");
    let told = load(&at, Path::new("car.urdf")).unwrap_err();
    assert_ends!(told, "name it under the key `urdf` in place of `mesh`");
    let message = load(&at, Path::new("nowhere/car.obj")).unwrap_err().to_string();
    let start = "s.json: static[0].mesh: mesh nowhere/car.obj: file: cannot be read: No such file";
    assert!(message.starts_with(start), "{message}");
    assert!(message.ends_with("; name a mesh from the folder of the description"), "{message}");
}

/// A mesh of the real data that `build.rs` looked for.
fn real(file: &str) -> RawMesh {
    load(&Location::top("test"), &Path::new(env!("REAL_DATA")).join(file)).unwrap()
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
