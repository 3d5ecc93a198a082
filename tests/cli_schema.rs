//! `schema`: what it prints is in `docs/schemas`, and files may name it.
//!
//! `python/tests/test_schemas.py` holds the schemas against another validator and the files of the project.

use crate::cli::*;

const KINDS: [&str; 4] = ["scene", "vehicle", "placements", "targets"];

#[test]
fn the_files_of_the_documentation_are_those_that_the_program_prints() {
    let dir = TempDir::new().unwrap();
    for kind in KINDS {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("docs/schemas/{kind}.json"));
        let printed = stdout(&dir, &["schema", kind]);
        assert!(
            fs::read_to_string(&file).unwrap() == printed,
            "{kind}: run `sightline schema {kind} > docs/schemas/{kind}.json`"
        );
    }
    fails(&dir, "schema rig").says("scene, vehicle, placements, targets");
}

/// Text of a file of the project with a first key that names its schema.
fn naming_its_schema(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let Value::Object(keys) = read_json(path) else {
        panic!("{file} is no object");
    };
    let mut named = serde_json::Map::from_iter([("$schema".to_owned(), json!("a/b, \"c\"?.json"))]);
    named.extend(keys);
    Value::Object(named).to_string()
}

#[test]
fn every_kind_of_file_may_name_its_schema_and_an_unknown_key_stays_an_error() {
    let dir = TempDir::new().unwrap();
    let target = json!({
        "$schema": "targets.json", "sightline": 1, "name": "post",
        "shapes": [{ "box": { "foot": [0, 0, 0], "size": [0.2, 0.2, 1] } }]
    });
    let files = [
        ("yard.json", naming_its_schema("scenes/industrial-yard.json")),
        ("vehicle.json", naming_its_schema("scenes/vehicles/place3d.json")),
        ("placements.json", naming_its_schema("scenes/placements.json")),
        ("post.json", target.to_string()),
    ];
    for (file, text) in &files {
        fs::write(dir.path().join(file), text).unwrap();
    }
    let score = "score yard.json placements.json --frames 1 --backend cpu";
    let on_vehicle = &format!("{score} --vehicle vehicle.json");
    let study = "study targets yard.json placements.json --target post.json --frames 1";
    for (command, (file, text)) in [score, on_vehicle, score, study].into_iter().zip(&files) {
        stdout(&dir, command);
        fs::write(dir.path().join(file), text.replacen("$schema", "$scheme", 1)).unwrap();
        fails(&dir, command).says("unknown key `$scheme`; did you mean `$schema`?");
        fs::write(dir.path().join(file), text).unwrap();
    }
}

#[test]
fn a_pipe_of_placements_may_name_its_schema_first() {
    let dir = TempDir::new().unwrap();
    write(&dir, "yard.json", &naming_its_schema("scenes/industrial-yard.json"));
    let lines = r#"{"name": "a", "lidars": [{"x": 0, "y": 0, "z": 2.4}]}"#;
    for text in
        [format!("{{ \"$schema\" : \"p, q\",\n \"placements\": [{lines}]}}"), lines.to_owned()]
    {
        let args = "score yard.json - --frames 1 --backend cpu";
        let output = piped(dir.path(), args, text.as_bytes());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
