//! Labelled scans: written by hand, good and bad.

use std::path::Path;

use super::faults::{Spoil, begins, put, remove};
use crate::datasets::kitti::{KITTI_CLASSES, kitti_label};
use crate::datasets::{KittiSequence, LabelledSequence, PsogOptions, build_psog};
use sightline_scene::psog::{EntropyKind, Roi};

/// A LiDAR that looks along camera z: x_cam = −y, y_cam = −z, z_cam = x, moved by (0, −0.1, −0.2).
const CALIB: &str = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.2\n";
/// Frame 0 at the start, frame 1 unused, frame 2 two metres on (camera z) and a quarter turn left
/// (about camera −y: camera z goes to −x).
const POSES: &str = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n\
                     0 0 -1 0 0 1 0 0 1 0 0 2\n";

fn write_scan(folder: &Path, frame: &str, points: &[([f32; 3], u32)]) {
    let bin: Vec<u8> = points
        .iter()
        .flat_map(|(p, _)| [p[0], p[1], p[2], 0.5].map(f32::to_le_bytes).concat())
        .collect();
    let label: Vec<u8> = points.iter().flat_map(|(_, l)| l.to_le_bytes()).collect();
    std::fs::write(folder.join(format!("velodyne/{frame}.bin")), bin).unwrap();
    std::fs::write(folder.join(format!("labels/{frame}.label")), label).unwrap();
}

/// A sequence of frames 0 and 2: a pole and a moving car each, in frame 0 also an
/// unlabelled point and a pole half a millimetre from a voxel face of frame 2.
fn sequence() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for sub in ["velodyne", "labels"] {
        std::fs::create_dir(folder.path().join(sub)).unwrap();
    }
    std::fs::write(folder.path().join("calib.txt"), CALIB).unwrap();
    // A byte order mark changes nothing.
    std::fs::write(folder.path().join("poses.txt"), format!("\u{feff}{POSES}")).unwrap();
    // Instance numbers in the upper half do not matter.
    let pole = 80 | 7 << 16;
    write_scan(
        folder.path(),
        "000000",
        &[
            ([4.5, 0.5, 0.5], pole),
            ([2.5, -2.5, 0.5], 252),
            ([1.5, 1.5, 0.5], 0),
            ([1.1995, 0.05, 0.5], pole),
        ],
    );
    write_scan(folder.path(), "000002", &[([3.5, 2.5, 0.5], 80), ([1.5, 1.5, 0.5], 252)]);
    folder
}

fn roi() -> Roi {
    Roi::new([-8.0, -8.0, 0.0], [1.0; 3], [16, 16, 4]).unwrap()
}

#[test]
fn lidar_poses_come_from_camera_poses() {
    let folder = sequence();
    let sequence = KittiSequence::open(folder.path()).unwrap();
    // Notes begin with the folder's name, whichever path leads there.
    let around = KittiSequence::open(&folder.path().join("velodyne/..")).unwrap();
    assert!(!around.name().is_empty() && around.name() == sequence.name());
    assert_eq!(sequence.frames(), [0, 2]);
    let pose = sequence.world_from_sensor(2).unwrap();
    // The camera sits at LiDAR (0.2, 0, −0.1). Two metres on, turned left by 90°: the LiDAR is
    // 0.2 m "behind" the camera, now along +y: world (2 + 0.2, 0, −0.1) − (0, 0.2, −0.1).
    let origin = pose.apply(glam::DVec3::ZERO);
    assert!(origin.abs_diff_eq(glam::DVec3::new(2.2, -0.2, 0.0), 1e-12), "{origin}");
    let ahead = pose.rotation * glam::DVec3::X;
    assert!(ahead.abs_diff_eq(glam::DVec3::Y, 1e-12), "{ahead}");
}

/// World positions (LiDAR frame of 0): pole of frame 2 at (2.2 − 2.5, −0.2 + 3.5) = (−0.3, 3.3),
/// and the pole of frame 0, seen from frame 2, at (0.5 + 0.2, −(4.5 − 2.2)) = (0.7, −2.3).
#[test]
fn frames_merge_at_rest_points_only() {
    let folder = sequence();
    let sequence = [KittiSequence::open(folder.path()).unwrap().with_lidar_height(1.0).unwrap()];
    let mut options = PsogOptions::new(roi());
    let (psog, report) = build_psog(&sequence, &options).unwrap();
    let voxel = |x: i32, y: i32| roi().linear([(x + 8) as u32, (y + 8) as u32, 1]);
    let at = |x, y| psog.find(voxel(x, y)).map(|k| (psog.row(k)[17], psog.row(k)[0]));
    let (pole, car) = (Some((1, 0)), Some((0, 1)));
    assert_eq!(at(4, 0), pole, "frame 0, its own");
    assert_eq!(at(-1, 3), pole, "frame 0, from 2");
    assert_eq!(at(3, 2), pole, "frame 2, its own");
    assert_eq!(at(0, -3), pole, "frame 2, from 0");
    assert_eq!(at(2, -3), car, "moving, frame 0");
    assert_eq!(at(1, 1), car, "moving, frame 2; the unlabelled point of frame 0 did not vote");
    // Frame 2's point at (0.25, 1.0005), seen from frame 0's LiDAR at (0.2, 2.2): pushed down over y = 1.
    assert_eq!((at(0, 0), at(0, 1)), (pole, None), "each scan keeps its own origin");
    assert_eq!(at(1, 0), pole);
    assert_eq!(psog.index().len(), 8, "no moving point in the other frame");
    assert_eq!((report.points_in, report.frames, report.ties), (8, 2, 0));

    options.window = Some(1); // frames 0 and 2 are two apart
    let (alone, _) = build_psog(&sequence, &options).unwrap();
    assert_eq!(alone.index().len(), 5);
    options.window = Some(2);
    assert_eq!(build_psog(&sequence, &options).unwrap().0, psog);
    (options.window, options.frames) = (None, Some(vec![2]));
    let (one, _) = build_psog(&sequence, &options).unwrap();
    assert_eq!((one.frames(), one.index().len()), (1, 2));
    assert_eq!(one.entropy_total(EntropyKind::Segmentation), 0.0);
}

#[test]
fn all_34_ids_are_known_and_no_other() {
    let known: Vec<u16> = (0..=u16::MAX).filter(|&id| kitti_label(id).is_some()).collect();
    assert_eq!(known.len(), 34);
    let class = |id| kitti_label(id).unwrap().class.map(|c| KITTI_CLASSES[usize::from(c)]);
    assert_eq!(class(257), Some("other-vehicle"));
    assert_eq!(class(60), Some("road"));
    assert_eq!(class(52), None);
    let moving: Vec<_> = known.iter().filter(|&&id| kitti_label(id).unwrap().moving).collect();
    assert_eq!(moving, [&252, &253, &254, &255, &256, &257, &258, &259]);
    for (id, at_rest) in
        [(252, 10), (253, 31), (254, 30), (255, 32), (256, 16), (257, 13), (258, 18), (259, 20)]
    {
        assert_eq!(class(id), class(at_rest));
    }
}

/// Faults planted in a good sequence, and how each error begins.
const SPOILT: [(Spoil, &str); 18] = [
    (
        |d| put(d, "calib.txt", format!("{CALIB}{CALIB}")),
        "DIR/calib.txt line 4: a second `Tr`; leave one out;",
    ),
    (
        |d| put(d, "poses.txt", POSES.replace("1 0 0 0", "1,0 0 0 0")),
        "DIR/poses.txt line 1: \"1,0\" is not a finite number;",
    ),
    (
        // Four points of five columns are 80 bytes, which are five points of four.
        |d| put(d, "velodyne/000000.bin", [0; 80]),
        "DIR/velodyne/000000.bin has 5 numbers for each label, 4 are read as one point;",
    ),
    (|d| std::fs::remove_dir_all(d.join("velodyne")).unwrap(), "DIR/velodyne: cannot be read: "),
    (
        |d| ["velodyne/000000.bin", "velodyne/000002.bin"].iter().for_each(|scan| remove(d, scan)),
        "DIR/velodyne holds no scan named like 000000.bin;",
    ),
    (|d| write_scan(d, "last", &[]), "DIR/velodyne/last.bin: a scan is named by its frame number"),
    (|d| write_scan(d, "0", &[]), "DIR/velodyne has two scans of frame 0;"),
    (|d| write_scan(d, "3", &[]), "DIR/poses.txt has 3 poses, none for frame 3;"),
    (|d| remove(d, "poses.txt"), "DIR/poses.txt: cannot be read: "),
    (|d| remove(d, "labels/000002.label"), "DIR/labels/000002.label: cannot be read: "),
    (|d| put(d, "calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\n"), "DIR/calib.txt has no line `Tr:`;"),
    (|d| put(d, "calib.txt", "\nTr: 1 0 0 0 0 1 0 0\n"), "DIR/calib.txt line 2: it has 8 numbers;"),
    (
        |d| put(d, "poses.txt", POSES.replacen("0 0 -1", "0 x -1", 1)),
        "DIR/poses.txt line 3: \"x\" is not a finite number;",
    ),
    (
        |d| put(d, "poses.txt", POSES.replacen("0 0 -1", "0 0 1", 1)),
        "DIR/poses.txt line 3: its left 3×3 part is not a rotation;",
    ),
    (
        |d| put(d, "velodyne/000002.bin", [0; 31]),
        "DIR/velodyne/000002.bin has 31 bytes, not a multiple of 16,",
    ),
    (
        |d| put(d, "labels/000002.label", [0; 12]),
        "DIR/labels/000002.label has 3 labels, but DIR/velodyne/000002.bin has 2 points;",
    ),
    (
        |d| write_scan(d, "000002", &[([1.0, 2.0, 3.0], 40), ([1.0, f32::NAN, 3.0], 40)]),
        "DIR/velodyne/000002.bin: point 1 has y = NaN;",
    ),
    (
        |d| write_scan(d, "000002", &[([1.0, 2.0, 3.0], 40), ([1.0, 2.0, 3.0], 12 | 9 << 16)]),
        "DIR/labels/000002.label: point 1 has label id 12, which SemanticKITTI does not define;",
    ),
];

#[test]
fn bad_sequences_are_refused() {
    for (spoil, wanted) in SPOILT {
        let folder = sequence();
        begins(folder.path(), spoil, wanted, || {
            let sequence = KittiSequence::open(folder.path())?;
            build_psog(&[sequence], &PsogOptions::new(roi())).map(drop)
        });
    }
}

#[test]
fn bad_options_are_refused() {
    let folder = sequence();
    let sequence = [KittiSequence::open(folder.path()).unwrap()];
    let options = PsogOptions { frames: Some(vec![1]), ..PsogOptions::new(roi()) };
    let message = build_psog(&sequence, &options).unwrap_err().to_string();
    assert!(message.ends_with("velodyne has no frame 1; it has [0, 2]"), "{message}");
    let [sequence] = sequence;
    assert_begins!(sequence.with_lidar_height(f64::NAN).unwrap_err(), "the LiDAR height is NaN m;");
}

/// A road of 25 points at a depth below the LiDAR around each frame.
fn with_road(depth: f32) -> tempfile::TempDir {
    let folder = sequence();
    let spots = (0..25_u8).map(|k| [f32::from(k % 5) - 2.0, f32::from(k / 5) - 2.0, -depth]);
    let points: Vec<_> = spots.map(|point| (point, 40)).collect();
    write_scan(folder.path(), "000000", &points);
    folder
}

#[test]
fn the_labelled_road_tells_the_height() {
    let height = |sequence: &KittiSequence| sequence.ego_from_sensor(0).unwrap().translation.z;
    let open = |folder: &Path, height| KittiSequence::open_at(folder, height).unwrap();
    let low = with_road(0.8);
    let sequence = open(low.path(), None);
    assert!((height(&sequence) - 0.8).abs() < 1e-6);
    let [note] = sequence.notes() else { panic!("{:?}", sequence.notes()) };
    let said = note.text();
    assert!(!note.is_doubt() && said.contains("0.80 m below") && said.contains("1.73 m"), "{said}");
    // KITTI's own road lies up to a decimetre off.
    let own = with_road(1.8);
    assert_eq!((height(&open(own.path(), None)), open(own.path(), None).notes()), (1.73, &[][..]));
    // A given or written height counts; a road that contradicts it is a doubt.
    let given = open(low.path(), Some(1.9));
    assert_eq!(height(&given), 1.9);
    assert!(given.notes()[0].is_doubt() && given.notes()[0].text().contains("0.80 m below it"));
    std::fs::write(low.path().join("ego_from_lidar.txt"), "1 0 0 1 0 1 0 0 0 0 1 2\n").unwrap();
    let written = open(low.path(), None);
    assert!(height(&written) == 2.0 && written.notes()[0].is_doubt());
    let above = with_road(-1.73);
    let above = open(above.path(), None);
    let [note] = above.notes() else { panic!("one note") };
    assert!(
        note.is_doubt() && note.text().contains("lies 1.73 m above the LiDAR; does z point up"),
        "{note}"
    );
    // No road at all.
    assert_holds!(sequence_notes(), "no labelled road within 10 m");
}

/// Nine points of a road are too few, and say so; a later scan with enough of it counts.
#[test]
fn a_road_of_few_points_is_told_with_their_number() {
    let folder = sequence();
    let road = |count: u8| -> Vec<([f32; 3], u32)> {
        (0..count).map(|k| ([f32::from(k) - 4.0, 2.0, -0.8], 40)).collect()
    };
    write_scan(folder.path(), "000000", &road(3));
    write_scan(folder.path(), "000002", &road(9));
    let few = KittiSequence::open_at(folder.path(), None).unwrap();
    assert_eq!(few.ego_from_sensor(0).unwrap().translation.z, 1.73);
    let said = few.notes()[0].text();
    assert_holds!(said, "at most 9 points in a scan, in frame 2, too few to tell how high");
    write_scan(folder.path(), "000002", &road(10));
    let sure = KittiSequence::open_at(folder.path(), None).unwrap();
    assert!((sure.ego_from_sensor(0).unwrap().translation.z - 0.8).abs() < 1e-6);
    assert!(sure.notes()[0].text().contains("road of frame 2 lies 0.80 m below"));
}

fn sequence_notes() -> String {
    let folder = sequence();
    KittiSequence::open_at(folder.path(), None).unwrap().notes()[0].to_string()
}

#[test]
fn what_is_not_read_is_named() {
    let folder = with_road(1.73);
    let calib = format!("{CALIB}Tr_velo_to_imu: 1 0 0\nP1: x\n");
    std::fs::write(folder.path().join("calib.txt"), calib).unwrap();
    std::fs::write(folder.path().join("labels/000009.label"), []).unwrap();
    let poses = std::fs::read_to_string(folder.path().join("poses.txt")).unwrap();
    let more = format!("{}\n1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 0\n", poses.trim_end());
    std::fs::write(folder.path().join("poses.txt"), more).unwrap();
    let sequence = KittiSequence::open_at(folder.path(), None).unwrap();
    let said = sequence.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert_holds!(said, "1 lines, `Tr_velo_to_imu`, are not known", "1 label files");
    assert!(said.contains("its last 2 poses belong to no scan; not read."), "{said}");
}

#[test]
fn poses_that_lie_on_their_side_or_lead_sideways_are_doubted() {
    let folder = with_road(1.73);
    // Six frames a metre apart to the left of the LiDAR (camera x is −y), and one that leans.
    let aside: String = (0..6).map(|k| format!("1 0 0 {} 0 1 0 0 0 0 1 0\n", -k)).collect();
    for frame in 0..6 {
        write_scan(folder.path(), &format!("{frame:06}"), &[([1.0, 2.0, -1.73], 40)]);
    }
    std::fs::write(folder.path().join("poses.txt"), &aside).unwrap();
    let notes = |folder: &Path| -> String {
        let sequence = KittiSequence::open_at(folder, Some(1.73)).unwrap();
        sequence.notes().iter().filter(|note| note.is_doubt()).map(ToString::to_string).collect()
    };
    assert!(notes(folder.path()).contains("moves 90 degrees off its own heading over 5 steps"));
    // Two beams without a return, one of which has no class and so no vote.
    let scan = [([1.0, 2.0, -1.73], 40), ([0.0; 3], 50), ([0.0; 3], 0)];
    write_scan(folder.path(), "000000", &scan);
    assert!(notes(folder.path()).contains("1 labelled points of frame 0 lie at 0, 0, 0"));
    // The camera's z looks ahead, and leads back in poses that are turned round.
    let back: String = (0..6).map(|k| format!("1 0 0 0 0 1 0 0 0 0 1 {}\n", -k)).collect();
    std::fs::write(folder.path().join("poses.txt"), &back).unwrap();
    let told = notes(folder.path());
    assert!(
        told.contains(
            "180 degrees off its own heading over 5 steps; do the poses lead from the world"
        ),
        "{told}"
    );
    std::fs::write(folder.path().join("poses.txt"), back.replace('-', "")).unwrap();
    assert!(!notes(folder.path()).contains("heading"));
    let leaning = aside.replacen("1 0 0 0 0 1 0 0 0 0 1 0", "0 -1 0 0 1 0 0 0 0 0 1 0", 1);
    std::fs::write(folder.path().join("poses.txt"), leaning).unwrap();
    assert_holds!(notes(folder.path()), "frame 0 leans by 90 degrees");
}

#[test]
fn a_calibration_in_millimetres_is_doubted() {
    let told = |calib: &str| {
        let folder = sequence();
        std::fs::write(folder.path().join("calib.txt"), calib).unwrap();
        let sequence = KittiSequence::open(folder.path()).unwrap();
        let doubts = sequence.notes().iter().filter(|note| note.text().contains("`Tr` moves"));
        doubts.map(ToString::to_string).collect::<String>()
    };
    assert_eq!(told(CALIB), "");
    let told = told(&CALIB.replace("-0.2", "-270"));
    assert_holds!(told, "`Tr` moves by 270 m, farther than a vehicle is long; millimetres?");
}

#[cfg(unix)]
#[test]
fn a_device_is_not_read_to_its_end() {
    for file in ["velodyne/000000.bin", "labels/000000.label", "poses.txt", "calib.txt"] {
        let folder = sequence();
        let path = folder.path().join(file);
        std::fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
        let error = KittiSequence::open(folder.path()).and_then(|s| s.read(0).map(drop));
        assert_holds!(error.unwrap_err(), "not a plain file", file);
    }
}
