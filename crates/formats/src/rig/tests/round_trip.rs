//! Exported rigs import unchanged, for every format and seeded random rigs.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sightline_scene::vehicle::{SensorPose, to_nanometres};

use super::{difference, matrix};
use crate::rig::{
    ImportSettings, Models, Mounting, Rig, RigFormat, RigLidar, RigSource, export, import_texts,
};

/// Names that need quotes, escapes, or look like something else to some reader.
const FRAMES: [&str; 16] = [
    "velodyne_top", "lidar/left", "null_lidar", "lidar&co", "<lidar>", "\"lidar\"", "it's_lidar",
    "lidar#1", "1e5_lidar", "lidar:", "-lidar", "läser_lidar", "lidar\\n", "lidar{x}", "[lidar]",
    "--lidar",
];

fn pose(rng: &mut ChaCha8Rng) -> SensorPose {
    let mut within = |most: f64| rng.random_range(-most..most);
    let [x, y, z] = [within(5.0), within(2.0), within(4.0)];
    let [roll, pitch, yaw] = [within(PI), within(PI), within(PI)];
    let phase = Some(within(PI)).filter(|phase| *phase > 0.0);
    let pose = SensorPose { phase, ..SensorPose::from_values([x, y, z, roll, pitch, yaw]) };
    match rng.random_range(0..6) {
        0 => SensorPose { pitch: FRAC_PI_2, ..pose },
        1 => SensorPose { pitch: -FRAC_PI_2, ..pose },
        2 => SensorPose { pitch: FRAC_PI_2 - 1e-9, ..pose },
        3 => SensorPose { roll: 0.0, pitch: 0.0, ..pose },
        _ => pose,
    }
}

fn rig(rng: &mut ChaCha8Rng) -> Rig {
    let count = rng.random_range(1..=16);
    let sensors = [None, Some("VLP-16"), Some("VLS-128"), Some("my <sensor>")];
    let lidar = |index: usize| RigLidar {
        frame: FRAMES[index].to_owned(),
        sensor: sensors[rng.random_range(0..4)].map(str::to_owned),
        pose: pose(rng),
    };
    Rig { name: "found-1".to_owned(), lidars: (0..count).map(lidar).collect() }
}

/// Tells whether a format keeps the names of frames, and which sensors it keeps.
fn kept(format: RigFormat, lidar: &RigLidar) -> Option<String> {
    match format {
        RigFormat::Carla | RigFormat::CarlaObjects => {
            lidar.sensor.clone().filter(|sensor| sensor == "VLP-16")
        }
        _ => lidar.sensor.clone(),
    }
}

/// Exports a rig and imports it again. Options give the sensors that the format lacks; `told`: the format, too.
fn again(rig: &Rig, format: RigFormat, mounting: &Mounting, told: bool) -> Rig {
    let exported = export(rig, format, mounting, &Models::default()).unwrap();
    let told_lost = exported.warnings.iter().filter(|words| words.contains("phases of ")).count();
    let has_phase = rig.lidars.iter().any(|lidar| lidar.pose.phase.is_some());
    assert_eq!(told_lost == 1, has_phase && format == RigFormat::Ros2Launch, "{format:?}");
    let files: Vec<RigSource> = exported
        .files
        .into_iter()
        .map(|file| RigSource { file: file.name, text: file.text })
        .collect();
    let names_sensors = !matches!(format, RigFormat::Autoware | RigFormat::Ros2Launch);
    let sensors = rig.lidars.iter().filter_map(|l| Some((l.frame.clone(), l.sensor.clone()?)));
    let settings = ImportSettings {
        format: told.then_some(format),
        sensors: if names_sensors { BTreeMap::new() } else { sensors.collect() },
        mounting: mounting.clone(),
        name: Some("found-1".to_owned()),
        ..ImportSettings::default()
    };
    let imported = import_texts(&files, &settings).unwrap();
    assert_eq!(imported.format, format, "the format is told by content");
    imported.rig
}

#[test]
fn import_of_export_is_the_rig() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut worst = [0.0_f64; RigFormat::ALL.len()];
    for round in 0..300 {
        let rig = rig(&mut rng);
        let heights = [("my <sensor>".to_owned(), 0.1), ("velodyne_top".to_owned(), -0.2)];
        let mounting = Mounting {
            base_link: [-1.4, 0.25, 0.3].map(|v| if round % 2 == 0 { v } else { 0.0 }),
            optical_heights: if round % 3 == 0 { heights.into() } else { BTreeMap::new() },
        };
        for (format, worst) in RigFormat::ALL.into_iter().zip(&mut worst) {
            if matches!(format, RigFormat::Tf | RigFormat::Pandaset) {
                continue;
            }
            let read = again(&rig, format, &mounting, round % 5 == 0);
            assert_eq!(read.name, rig.name);
            assert_eq!(read.lidars.len(), rig.lidars.len());
            for (index, (a, b)) in rig.lidars.iter().zip(&read.lidars).enumerate() {
                let frame = match format {
                    RigFormat::Json => format!("lidar_{index}"),
                    _ => a.frame.clone(),
                };
                assert_eq!((&b.frame, &b.sensor), (&frame, &kept(format, a)), "{format:?}");
                *worst = worst.max(difference(&matrix(&a.pose), &matrix(&b.pose)));
                let phase = a.pose.phase.filter(|_| format != RigFormat::Ros2Launch);
                assert_eq!(b.pose.phase.is_some(), phase.is_some(), "{format:?}");
                *worst = worst.max(phase.map_or(0.0, |p| (p - b.pose.phase.unwrap()).abs()));
            }
        }
    }
    // Nine digits of a few metres, and of an angle in degrees.
    assert!(worst.iter().all(|&off| off < 5e-8), "{worst:?}");
}

#[test]
fn angles_that_need_no_computing_come_back_as_written() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for _ in 0..200 {
        let rig = rig(&mut rng);
        for format in [RigFormat::Autoware, RigFormat::Urdf, RigFormat::Sdf, RigFormat::Ros2Launch]
        {
            let read = again(&rig, format, &Mounting::default(), false);
            for (a, b) in rig.lidars.iter().zip(&read.lidars) {
                let angles =
                    |pose: &SensorPose| [pose.roll, pose.pitch, pose.yaw].map(f64::to_bits);
                let a = to_nanometres(&a.pose);
                assert_eq!(angles(&a), angles(&b.pose), "{format:?}");
                let kept = a.phase.filter(|_| format != RigFormat::Ros2Launch);
                assert_eq!(b.pose.phase, kept, "{format:?}");
            }
        }
    }
}
