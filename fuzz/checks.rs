//! Files of the readers, and what holds for anything that they accept.

use std::fs;
use std::path::Path;

use sightline::datasets::{
    CarlaSequence, ImportOptions, KittiSequence, LabelledSequence, PsogOptions, build_psog,
    to_scene,
};
use sightline::psog::Roi;
use sightline::rig::{
    ImportSettings, Models, Mounting, RigFormat, RigSource, export, import_texts,
};
use sightline::scene::{EgoBody, Scene};
use sightline::vehicle::read_placements;

/// Triangles up to which the frames of an accepted scene are looked at.
const MAX_FACES: usize = 200_000;

pub(super) fn put(folder: &Path, name: &str, bytes: &[u8]) {
    fs::write(folder.join(name), bytes).expect("the folder can be written");
}

/// The result, whose error was asked for its words.
pub(super) fn said<T, E: std::fmt::Display>(result: Result<T, E>) -> Result<T, ()> {
    result.map_err(|error| assert!(!error.to_string().is_empty()))
}

pub(super) fn scene_with(lidar: &str, more: &str) -> String {
    format!(
        r#"{{ "sightline": 1, "name": "fuzzed",
            "roi": {{ "min": [-4, -4, -1], "max": [4, 4, 3], "voxel": [1, 1, 1] }},
            "lidar": {lidar}{more},
            "mount": {{ "min": [0, 0, 1], "max": [0, 0, 1], "lidars": 1 }},
            "psog": {{ "file": "none.npz" }} }}"#
    )
}

pub(super) fn check_scene<E: std::fmt::Display>(scene: Result<Scene, E>) {
    let Ok(scene) = said(scene) else { return };
    let beams = scene.lidars()[0].beam_count();
    assert!(beams > 0 && scene.lidars()[0].range() > 0.0);
    for t in [0, scene.frame_count() - 1] {
        let soup = scene.frame(t, EgoBody::Include);
        if soup.faces.len() > MAX_FACES {
            return;
        }
        assert!(soup.vertices.as_flattened().iter().all(|v| v.is_finite()));
        let vertices = soup.vertices.len() as u32;
        assert!(soup.faces.as_flattened().iter().all(|&v| v < vertices));
        assert!(soup.face_class.iter().all(|&c| usize::from(c) < scene.classes().len()));
        assert_eq!(soup.faces.len(), soup.face_class.len());
        assert_eq!(soup.face_class, scene.face_classes(EgoBody::Include));
        let finite =
            |p: &sightline::geom::Pose| p.translation.is_finite() && p.rotation.is_finite();
        assert!(scene.part_poses(t).iter().all(finite));
    }
    for part in scene.parts(EgoBody::Include) {
        let soup = scene.part(part);
        assert!(soup.vertices.as_flattened().iter().all(|v| v.is_finite()));
    }
}

pub(super) fn check_placements(folder: &Path, name: &str, bytes: &[u8]) {
    put(folder, name, bytes);
    let Ok(placements) = said(read_placements(folder.join(name))) else { return };
    for placement in &placements {
        placement.validate().expect("what was read is valid");
        let fields = placement.lidars.iter().flat_map(|pose| pose.fields());
        assert!(fields.into_iter().all(|(_, value)| value.is_finite()));
    }
}

pub(super) fn check_kitti(folder: &Path, bin: &[u8], label: &[u8], poses: &[u8], calib: &[u8]) {
    for sub in ["velodyne", "labels"] {
        fs::create_dir_all(folder.join(sub)).expect("the folder can be written");
    }
    put(folder, "velodyne/000000.bin", bin);
    put(folder, "labels/000000.label", label);
    put(folder, "poses.txt", poses);
    put(folder, "calib.txt", calib);
    let Ok(sequence) = said(KittiSequence::open_at(folder, None)) else { return };
    let roi = Roi::new([-8.0, -8.0, 0.0], [1.0; 3], [16, 16, 4]).expect("a valid grid");
    let Ok((psog, report)) = said(build_psog(&[sequence], &PsogOptions::new(roi))) else {
        return;
    };
    assert_eq!((psog.frames(), report.frames), (1, 1));
    assert!(report.points_in + report.points_outside <= bin.len() as u64 / 16);
}

/// Reads a scan of CARLA; one that is accepted becomes a P-SOG and a scene, where it is not too wide for one.
pub(super) fn check_carla(folder: &Path, name: &str, scan: &[u8], poses: &[u8]) {
    let scans = folder.join(name.replace('.', "-"));
    fs::create_dir_all(&scans).expect("the folder can be written");
    put(&scans, name, scan);
    put(folder, "poses.csv", poses);
    let sequence = CarlaSequence::open(&scans, &folder.join("poses.csv"), None, Some(2.0));
    let Ok(sequence) = said(sequence) else { return };
    check_sequence(folder, &sequence);
    let roi = Roi::new([-8.0, -8.0, 0.0], [1.0; 3], [16, 16, 4]).expect("a valid grid");
    let Ok((psog, _)) = said(build_psog(&[sequence], &PsogOptions::new(roi))) else { return };
    assert_eq!(psog.frames(), 1);
}

/// Makes a scene of a sequence that was read, where it is not too wide for one.
pub(super) fn check_sequence(folder: &Path, sequence: &dyn LabelledSequence) {
    assert!(sequence.notes().iter().all(|note| note.text().ends_with(['.', '?'])));
    if let Ok(imported) = said(to_scene(sequence, &ImportOptions::default())) {
        check_scene(Scene::from_json(&imported.scene.to_string(), folder, "scene.json"));
    }
}

pub(super) fn check_mesh(folder: &Path, name: &str, bytes: &[u8]) {
    put(folder, name, bytes);
    let lidar = r#"{ "channels": 1, "fov": [0, 0], "azimuth_steps": 4, "range": 50 }"#;
    let world =
        format!(r#", "static": [{{ "class": "building", "mesh": {{ "file": "{name}" }} }}]"#);
    check_scene(Scene::from_json(&scene_with(lidar, &world), folder, "scene.json"));
}

/// Reads a rig in a format and by its content; one that is accepted survives being written as URDF.
pub(super) fn check_rig(bytes: &[u8], format: Option<RigFormat>) {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let read = |text: String, format, file: &str| {
        let source = RigSource { file: file.to_owned(), text };
        import_texts(&[source], &ImportSettings { format, ..ImportSettings::default() })
    };
    let _ = said(read(text.clone(), None, "rig"));
    let Ok(imported) = said(read(text, format, "rig")) else { return };
    imported.rig.validate().expect("what was read is valid");
    let written = export(&imported.rig, RigFormat::Urdf, &Mounting::default(), &Models::default());
    let urdf = written.expect("a rig that was read can be written").files.remove(0).text;
    let again = read(urdf, None, "again").expect("a rig that was written can be read").rig;
    assert_eq!(again.lidars.len(), imported.rig.lidars.len());
    for (a, b) in again.lidars.iter().zip(&imported.rig.lidars) {
        // Nine digits of an angle of many turns are fewer of the turn.
        let turned =
            [b.pose.roll, b.pose.pitch, b.pose.yaw].iter().fold(1.0, |m: f64, v| m.max(v.abs()));
        let far = (1.0 + b.pose.position().length()) * turned;
        assert!(a.frame == b.frame && a.pose.position().distance(b.pose.position()) <= 1e-8 * far);
    }
}
