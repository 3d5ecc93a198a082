//! Rigs of real vehicles against numbers of transforms3d 0.4.2.
//!
//! ```python
//! T = lambda d: compose([d[k] for k in "xyz"], euler2mat(d["roll"], d["pitch"], d["yaw"], "sxyz"), [1] * 3)
//! M = T(sensors["base_link"]["sensor_kit_base_link"]) @ T(kit["sensor_kit_base_link"][frame])
//! print(M[:3, 3], mat2euler(M[:3, :3], "sxyz"), (M @ [0, 0, height, 1])[:3])
//! ```

use std::path::{Path, PathBuf};

use crate::rig::{ImportSettings, ImportedRig, Mounting, compare, import};

const TOP: [f64; 6] =
    [0.9, 0.0, 2.0, 0.015_004_077_703_596_155, 0.000_936_826_090_231_137_8, 1.538_614_528_379_345];
#[expect(clippy::approx_constant, reason = "as the file has it")]
const REAR: [f64; 6] = [-0.358, 0.0, 1.631, -0.02, 0.728_131_7, 3.141_592];
/// Poses before the sides were put straight: rear, top, left, right.
const BEFORE: [[f64; 6]; 4] = [
    REAR,
    TOP,
    [
        0.915_911_619_694_329_1,
        0.563_108_119_854_245_5,
        1.693_920_969_988_273,
        -0.000_200_303_479_211_286_06,
        0.710_840_004_419_138,
        1.551_520_159_895_072_3,
    ],
    [
        0.874_906_061_225_809_5,
        -0.563_385_240_708_066_1,
        1.695_048_082_988_298_6,
        -0.029_746_110_706_846_598,
        0.708_765_636_661_55,
        -1.629_254_680_160_571_6,
    ],
];
/// Poses after it.
const AFTER: [[f64; 6]; 4] = [
    REAR,
    TOP,
    [
        0.916_871_243_760_543_5,
        0.589_470_646_779_863_6,
        1.693_894_592_960_363_5,
        -0.000_200_303_479_211_286_06,
        0.710_840_004_419_138,
        1.551_520_159_895_072_3,
    ],
    [
        0.873_946_437_159_595_1, -0.589_747_767_633_684_1, 1.695_074_460_016_208,
        -0.039_754_628_212_357, 0.708_840_521_584_487_2, -1.624_260_789_409_822_2,
    ],
];
/// Optical centres before: a VLS-128 on the top, VLP-16s at the other three places.
const CENTRES: [[f64; 3]; 4] = [
    [-0.383_083_438_069_356_74, -0.000_753_933_340_059_720_7, 1.659_134_369_001_978_4],
    [0.900_993_361_339_174_7, 2.997_947_904_774_13e-5, 2.066_102_529_713_171],
    [0.916_378_198_143_555_7, 0.587_701_835_508_259_3, 1.722_490_559_675_215_1],
    [0.874_592_360_790_290_7, -0.587_936_819_972_452_4, 1.723_655_976_089_001],
];
const FRAMES: [&str; 4] = [
    "velodyne_rear_base_link",
    "velodyne_top_base_link",
    "velodyne_left_base_link",
    "velodyne_right_base_link",
];

fn rigs() -> PathBuf {
    Path::new(env!("REAL_DATA")).join("rigs")
}

fn lexus(which: &str, settings: &ImportSettings) -> ImportedRig {
    let file = |name: &str| rigs().join("lexus").join(which).join(name);
    let pair = [file("sensors_calibration.yaml"), file("sensor_kit_calibration.yaml")];
    import(&pair, settings).unwrap()
}

fn near(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (a, b) in found.iter().zip(wanted) {
        assert!((a - b).abs() < 1e-14, "{found:?}, not {wanted:?}");
    }
}

#[test]
#[cfg_attr(not(has_rigs), ignore = "needs the rigs in ../shared/data or SIGHTLINE_DATA")]
fn the_lexus_stands_as_transforms3d_has_it() {
    for (which, wanted) in [("before", BEFORE), ("after", AFTER)] {
        let imported = lexus(which, &ImportSettings::default());
        let lidars = &imported.rig.lidars;
        assert_eq!(lidars.iter().map(|l| &l.frame[..]).collect::<Vec<_>>(), FRAMES);
        for (lidar, wanted) in lidars.iter().zip(wanted) {
            near(&lidar.pose.values(), &wanted);
        }
        // Eight cameras, gnss, imu and the kit itself.
        assert_eq!(imported.left_out.len(), 11);
        assert!(imported.left_out.contains(&"camera0/camera_link".to_owned()));
        assert!(imported.notes.len() == 1 && imported.notes[0].text().contains("--optical-height"));
    }
    let folder = import(&[rigs().join("lexus/before")], &ImportSettings::default()).unwrap();
    assert_eq!(folder.rig.lidars.len(), 4);
}

#[test]
#[cfg_attr(not(has_rigs), ignore = "needs the rigs in ../shared/data or SIGHTLINE_DATA")]
fn its_optical_centres_are_up_each_sensors_own_axis() {
    let sensors = ["VLP-16", "VLS-128", "VLP-16", "VLP-16"];
    let named = FRAMES.iter().zip(sensors).map(|(frame, s)| ((*frame).to_owned(), s.to_owned()));
    let settings = ImportSettings {
        sensors: named.collect(),
        mounting: Mounting { base_link: [-1.0, 0.0, 0.0], ..Mounting::default() },
        ..ImportSettings::default()
    };
    let imported = lexus("before", &settings);
    for ((lidar, sensor), [x, y, z]) in imported.rig.lidars.iter().zip(sensors).zip(CENTRES) {
        assert_eq!(lidar.sensor.as_deref(), Some(sensor));
        near(&lidar.pose.position().to_array(), &[x - 1.0, y, z]);
    }
    assert!(imported.notes.is_empty());
}

/// The sample of Autoware is the Lexus before, in one JSON document with other things in it.
#[test]
#[cfg_attr(not(has_rigs), ignore = "needs the rigs in ../shared/data or SIGHTLINE_DATA")]
fn autowares_sample_is_the_lexus() {
    let imported = import(&[rigs().join("autoware_sample.json")], &ImportSettings::default());
    for (lidar, wanted) in imported.unwrap().rig.lidars.iter().zip(BEFORE) {
        near(&lidar.pose.values(), &wanted);
    }
}

#[test]
#[cfg_attr(not(has_rigs), ignore = "needs the rigs in ../shared/data or SIGHTLINE_DATA")]
fn pandasets_two_lidars_are_read() {
    let imported = import(&[rigs().join("pandaset.json")], &ImportSettings::default()).unwrap();
    let [front, roof] = &imported.rig.lidars[..] else { panic!("{imported:?}") };
    assert_eq!((&front.frame[..], &roof.frame[..]), ("front_gt", "main_pandar64"));
    near(&roof.pose.values(), &[0.0; 6]);
    // quat2mat and mat2euler of transforms3d.
    let wanted = [
        -0.000_451_117_754,
        -0.605_646_431_446,
        -0.301_525_235_176,
        0.022_600_465_089_738_717,
        0.004_607_967_494_692_073,
        3.098_687_057_651_429,
    ];
    near(&front.pose.values(), &wanted);
    assert_eq!(imported.left_out.len(), 6);
}

#[test]
#[cfg_attr(not(has_rigs), ignore = "needs the rigs in ../shared/data or SIGHTLINE_DATA")]
fn putting_the_sides_straight_made_them_no_mirror_image() {
    let in_kit = ImportSettings {
        base_frame: Some("sensor_kit_base_link".to_owned()),
        ..ImportSettings::default()
    };
    let [before, after] = ["before", "after"].map(|which| lexus(which, &in_kit).rig);
    let found = compare(&before, &after);
    // y from ±0.56362 to ±0.59; the right one also rolls by −0.01 and yaws by 0.005.
    near(&[found.lidars[2].moved, found.lidars[2].turned], &[0.02638, 0.0]);
    assert!((found.lidars[3].moved - 0.02638).abs() < 1e-14);
    let sides = |rows: &[crate::rig::Asymmetry]| {
        rows.iter().find(|row| row.left.contains("left")).cloned().unwrap()
    };
    let (was, is) = (sides(&found.before), sides(&found.after));
    assert_eq!((was.same_roll, is.same_roll), (false, true));
    assert!((is.turned - 0.04).abs() < 1e-12, "{is:?}");
    assert!(was.turned < 0.04 && was.turned > 0.02, "{was:?}");
}
