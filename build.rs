//! Looks for the real data of the tests, beside the checkout or where `SIGHTLINE_DATA` says, and sets one
//! cfg for each set that is there: tests without their data are listed as ignored.

use std::env;
use std::path::PathBuf;

/// cfg and one file of each set.
const SETS: [(&str, &str); 6] = [
    ("has_kitti", "nc/semantickitti/sequences/00/poses.txt"),
    ("has_nuscenes", "nc/nuscenes/boxes.json"),
    ("has_rigs", "rigs/lexus/before/sensors_calibration.yaml"),
    ("has_meshes", "scenes/mcity/mcity.obj"),
    ("has_sensors", "sensors/raw/ouster_os1_128_metadata.json"),
    ("has_xodr", "xodr/carla/Town01.xodr.gz"),
];

fn main() {
    println!("cargo::rerun-if-env-changed=SIGHTLINE_DATA");
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    // The crates of the workspace share this file.
    let root = package.ancestors().find(|folder| folder.join("shaders").is_dir());
    let root = root.unwrap_or(&package);
    println!("cargo::rerun-if-changed={}", root.join("build.rs").display());
    let folder = env::var_os("SIGHTLINE_DATA").unwrap_or("../shared/data".into());
    let folder = root.join(folder);
    println!("cargo::rustc-env=REAL_DATA={}", folder.display());
    for (name, file) in SETS {
        println!("cargo::rustc-check-cfg=cfg({name})");
        let file = folder.join(file);
        if file.is_file() {
            println!("cargo::rustc-cfg={name}");
            // A path that does not exist would make every build start anew.
            println!("cargo::rerun-if-changed={}", file.display());
        }
    }
}
