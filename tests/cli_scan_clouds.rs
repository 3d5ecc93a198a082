//! Clouds of data sets as a loader reads them: by one calibration in all frames, with intensities of the format.

use glam::{DMat3, DMat4, DQuat, DVec3};

use crate::cli::*;
use crate::cli_scan::street;

/// The street with sensors whose phases differ from frame to frame.
fn free_street() -> TempDir {
    let dir = street();
    let vehicle = json!({
        "sightline": 1, "name": "car",
        "sensors": [{ "name": "s", "phase": "free",
                      "lidar": { "channels": 8, "fov": [-25, 5], "azimuth_steps": 60, "range": 60 } }],
        "mounts": [{ "name": "roof", "min": [-1, -1, 2], "max": [1, 1, 3], "roll": [-0.3, 0.3], "count": [1, 2] }],
    });
    let tilted = json!({ "placements": [{ "name": "tilted", "lidars": [
        { "x": 0.5, "y": 0.2, "z": 2.3, "roll": 0.2 }, { "x": -0.5, "y": 0, "z": 2.4, "pitch": 0.1, "yaw": 0.7 }] }] });
    write(&dir, "v.json", &vehicle);
    write(&dir, "t.json", &tilted);
    let scan = "scan s.json --vehicle v.json --placement t.json";
    for layout in ["nuscenes", "semantickitti"] {
        ok(&dir, &(scan, ["--layout", layout, "--out", layout]));
    }
    dir
}

fn points<const COLUMNS: usize>(cloud: &Path) -> Vec<DVec3> {
    let bytes = fs::read(cloud).unwrap();
    let numbers: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
    let point = |row: &[f32]| DVec3::new(row[0].into(), row[1].into(), row[2].into());
    numbers.chunks_exact(COLUMNS).map(point).collect()
}

fn assert_same(parts: &[DVec3], whole: &[DVec3], frame: usize) {
    assert!(parts.len() == whole.len() && whole.len() > 200, "{} points", whole.len());
    let off = parts.iter().zip(whole).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(off < 1e-4, "frame {frame}: LiDARs by themselves are {off} m off all of them");
}

#[test]
fn lidars_of_nuscenes_stand_in_their_calibration_in_every_frame() {
    let dir = free_street();
    let set = dir.path().join("nuscenes");
    let version = fs::read_dir(&set)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|p| p.join("scene.json").exists());
    let version = version.unwrap();
    let table = |name: &str| -> Vec<Value> {
        let text = fs::read_to_string(version.join(format!("{name}.json"))).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let numbers = |row: &Value, key: &str| -> Vec<f64> {
        row[key].list().iter().map(|n| n.number()).collect()
    };
    let (calibrated, clouds) = (table("calibrated_sensor"), table("sample_data"));
    let in_ego = |channel: &str, frame: usize| -> Vec<DVec3> {
        let of = |row: &&Value| row["filename"].text().contains(&format!("/{channel}/"));
        let mut rows: Vec<&Value> = clouds.iter().filter(of).collect();
        rows.sort_by_key(|row| row["timestamp"].as_i64());
        let row = rows[frame];
        let sensor =
            calibrated.iter().find(|c| c["token"] == row["calibrated_sensor_token"]).unwrap();
        let (q, t) = (numbers(sensor, "rotation"), numbers(sensor, "translation"));
        let turn = DMat3::from_quat(DQuat::from_xyzw(q[1], q[2], q[3], q[0]));
        let cloud = points::<5>(&set.join(row["filename"].text()));
        cloud.into_iter().map(|point| turn * point + DVec3::new(t[0], t[1], t[2])).collect()
    };
    for frame in 0..3 {
        let parts = [in_ego("LIDAR_0", frame), in_ego("LIDAR_1", frame)].concat();
        assert_same(&parts, &in_ego("LIDAR_TOP", frame), frame);
    }
}

#[test]
fn lidars_of_semantickitti_stand_in_their_places_in_every_frame() {
    let dir = free_street();
    // In the ego frame, by the LiDAR's place on the vehicle; and in that of the first scan, by its poses as well.
    let in_ego = |root: &str, frame: usize, by_poses: bool| -> Vec<DVec3> {
        let place = dir.path().join("semantickitti").join(root).join("sequences/00");
        let matrix = |file: &str, line: usize| -> DMat4 {
            let text = read_text(&place, file);
            let row = text.lines().nth(line).unwrap();
            let m: Vec<f64> = row.split(' ').map(|n| n.parse().unwrap()).collect();
            let column = |k: usize| [m[k], m[4 + k], m[8 + k], f64::from(u8::from(k == 3))];
            DMat4::from_cols_array_2d(&[column(0), column(1), column(2), column(3)])
        };
        let here = if by_poses { matrix("poses.txt", frame) } else { DMat4::IDENTITY };
        let ego_from_lidar = matrix("ego_from_lidar.txt", 0) * here;
        let cloud = points::<4>(&place.join(format!("velodyne/{frame:06}.bin")));
        cloud.into_iter().map(|point| ego_from_lidar.transform_point3(point)).collect()
    };
    for (frame, by_poses) in (0..3).flat_map(|frame| [(frame, false), (frame, true)]) {
        let single = |lidar: &str| in_ego(lidar, frame, by_poses);
        let parts = [single("lidar_0"), single("lidar_1")].concat();
        assert_same(&parts, &in_ego("", frame, by_poses), frame);
    }
}

#[test]
fn intensities_of_nuscenes_are_those_of_a_byte_whatever_the_noise() {
    let dir = street();
    let noise = "--condition crosstalk:share=0.5 --merged-only";
    let scan = "scan s.json --placement p.json:one --layout nuscenes --out set";
    ok(&dir, &(scan, noise));
    let cloud = fs::read_dir(dir.path().join("set/samples/LIDAR_TOP")).unwrap().next().unwrap();
    let bytes = fs::read(cloud.unwrap().path()).unwrap();
    let numbers: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
    let intensities: Vec<f32> = numbers.chunks_exact(5).map(|row| row[3]).collect();
    assert!(intensities.iter().all(|i| (0.0..=255.0).contains(i)), "{intensities:?}");
    assert!(intensities.iter().any(|i| (0.1..254.0).contains(i)), "{intensities:?}");
}
