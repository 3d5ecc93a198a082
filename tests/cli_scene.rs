//! Generated scenes: what they hold, that they repeat themselves, and that they can be scored.

use crate::cli::*;

fn generate(dir: &TempDir, file: &str, seed: &str) {
    let args = format!("scene new --triangles 5000 --frames 2 --seed {seed} --out {file}");
    assert_eq!(stdout(dir, &args), "");
}

#[test]
fn a_generated_street_can_be_cast_into() {
    let dir = TempDir::new().unwrap();
    generate(&dir, "street.json", "1");
    write_rig(&dir, "p.json", "roof", json!([{ "x": 0, "y": 0, "z": 2.4 }]));
    let answer = ok(&dir, "cast street.json p.json --out hits.npz --backend cpu");
    assert_eq!(answer["beams"], 16 * 720);
    let hits = answer["hits"].as_u64().unwrap();
    assert!((8 * 720..16 * 720).contains(&hits), "{hits} hits");

    let read = |file: &str| fs::read(dir.path().join(file)).unwrap();
    generate(&dir, "again.json", "1");
    generate(&dir, "other.json", "2");
    assert_eq!(read("street.ply"), read("again.ply"));
    assert_ne!(read("street.ply"), read("other.ply"));
}

#[test]
fn a_street_that_cannot_be_made_is_refused() {
    let dir = TempDir::new().unwrap();
    fails(&dir, "scene new --triangles 10 --out x.json").says("--triangles").says("4000");
    fails(&dir, "scene new --out x.ply").says("ending .json");
    fails(&dir, &["scene", "new", "--out", "a\tb.json"])
        .says("\"a\\tb\": is to be the name of the scene, which has no control");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn a_mesh_that_nobody_has_named_is_left_alone() {
    let dir = TempDir::new().unwrap();
    let read = |file: &str| fs::read(dir.path().join(file)).unwrap();
    let new = "scene new --triangles 4000 --frames 1 --force --out car.json";
    write(&dir, "car.ply", "a scan of my car");
    let words = "car.ply: is there and would be overwritten by the scene's mesh; name another scene than car.json";
    fails(&dir, new).says(words);
    write(&dir, "car.json", "{ \"mesh\": \"my-car.ply\" }");
    fails(&dir, new).says(words);
    assert_eq!((&read("car.ply")[..], read("car.json").len()), (&b"a scan of my car"[..], 24));
    // A scene's own mesh is made anew with it.
    fs::remove_file(dir.path().join("car.ply")).unwrap();
    for _ in 0..2 {
        printed(&dir, new);
    }
    assert!(read("car.ply").starts_with(b"ply"));
}

#[test]
fn a_world_is_made_and_its_contents_counted() {
    let dir = TempDir::new().unwrap();
    for kind in ["yard", "residential"] {
        let args = format!("scene new --kind {kind} --frames 2 --out {kind}.json");
        assert_eq!(stdout(&dir, &args), "");
    }
    let facts = ok(&dir, "scene info yard.json residential.json");
    let [yard, residential] = [&facts[0], &facts[1]];
    assert_eq!((&yard["name"], &yard["frames"]), (&json!("yard"), &json!(2)));
    assert!(yard["actors"]["truck"].as_u64().unwrap() > 0, "{yard}");
    assert!(residential["actors"]["car"].as_u64().unwrap() > 0, "{residential}");
    assert!(yard["voxel_share"]["ground"].number() > 1.0, "{yard}");
    let hits: f64 = yard["hits_by_range"].list().iter().map(|h| h.number()).sum();
    assert!((hits - 100.0).abs() < 1e-6, "{yard}");
}

#[test]
fn a_map_is_imported_or_refused() {
    let dir = TempDir::new().unwrap();
    let map = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/fork.xodr");
    fs::copy(map, dir.path().join("fork.xodr")).unwrap();
    assert_eq!(stdout(&dir, "scene import fork.xodr --frames 3 --out fork.json"), "");
    assert!(dir.path().join("fork.ply").is_file());
    let facts = ok(&dir, "scene info fork.json");
    assert!(facts[0]["voxel_share"]["sidewalk"].number() > 0.1, "{facts}");
    let import = |file: &str| fails(&dir, &["scene", "import", file, "--out", "x.json"]);
    import("none.xodr").says("none.xodr");
    import("fork.json").says("OpenDRIVE");
    import(".").says(".: is a folder; say which set it holds, by --nuscenes");
    fs::write(dir.path().join("a.xodr.gz"), [0x1f, 0x8b, 8]).unwrap();
    import("a.xodr.gz").says("gunzip");
    for (more, words) in [
        ("m.xodr --cell 0.5", "--cell 0.5: is for --nuscenes and --carla; leave it out"),
        ("m.xodr --lidar-height 2", "--lidar-height 2: is for --carla; leave it out"),
        ("d --carla --poses p.csv --seed 3", "--seed <N>"),
        ("d --carla --poses p.csv --nuscenes --scene s", "cannot be used with"),
        ("d --nuscenes --scene s --frames 3", "--frames <N>"),
    ] {
        fails(&dir, &("scene import --out x.json", more)).says(words);
    }
    assert!(!dir.path().join("x.json").exists());
}
