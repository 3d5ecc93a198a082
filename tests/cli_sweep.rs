//! `study sweep` and `study tolerance` against `score` of placements moved by hand, from outside.

use sightline::job::SweptField;
use sightline::{EngineChoice, Job, Scene, read_placements};

use crate::cli::*;
use crate::cli_shared::yard;

/// The yard, whose vehicle must see a car, and a rig of two models.
fn required_yard() -> TempDir {
    let dir = yard();
    set_rules(&dir, json!([{ "target": "car", "within": 20, "share": 0.9 }]));
    write_two(dir.path(), "two.json", 1.0, 0.0);
    dir
}

/// A LiDAR that turns and one that looks ahead, from `z` metres with a pitch in radians.
fn write_two(dir: &Path, name: &str, z: f64, pitch: f64) {
    let lidars = json!([
        { "x": 0.5, "y": 0.5, "z": 1.9, "sensor": "wide" },
        { "x": 2.1, "y": 0, "z": z, "pitch": pitch, "sensor": "front" }]);
    write_rig(dir, name, "two", lidars);
}

fn sweep(dir: &Path, more: &str) -> Value {
    ok(dir, &("study sweep yard.json two.json --backend cpu --frames 2", more))["sweeps"][0].clone()
}

/// Scores of a rig as `score` prints them.
fn scored(dir: &Path, name: &str) -> Value {
    scored_on(dir, "cart.json", name)
}

fn scored_on(dir: &Path, vehicle: &str, name: &str) -> Value {
    let args = format!(
        "score yard.json {name} --vehicle {vehicle} --backend cpu --frames 2 --tolerance 0"
    );
    let mut scores = ok(dir, &args)["scores"][0].clone();
    // A sweep does not look between the places of a requirement.
    for requirement in scores["requirements"].as_array_mut().unwrap() {
        requirement.as_object_mut().unwrap().remove("between").unwrap();
    }
    scores
}

fn assert_scores(row: &Value, score: &Value) {
    for key in ["near_gain", "information_gain", "covered", "hit_share", "requirements"] {
        assert!(!score[key].is_null(), "{key}");
        assert_eq!(row["scores"][key], score[key], "{key}");
    }
}

#[test]
fn each_row_is_the_score_of_the_placement_moved_by_hand() {
    let dir = required_yard();
    let found = sweep(dir.path(), "--of front.pitch --from -10 --to 20 --values 4");
    assert_eq!(
        (found["lidar"].as_u64(), &found["field"], &found["unit"]),
        (Some(1), &json!("pitch"), &json!("deg"))
    );
    let rows = found["rows"].list();
    let values: Vec<f64> = rows.iter().map(|row| row["value"].number()).collect();
    assert_eq!(values, [0.0, -10.0, 0.0, 10.0, 20.0]);
    assert_eq!(rows.iter().filter(|row| row["as_given"] == true).count(), 1);
    assert_scores(&rows[0], &scored(dir.path(), "two.json"));
    for row in &rows[1..] {
        write_two(dir.path(), "moved.json", 1.0, row["value"].number().to_radians());
        assert_scores(row, &scored(dir.path(), "moved.json"));
    }
    let covered: Vec<f64> = rows[1..].iter().map(|row| row["scores"]["covered"].number()).collect();
    assert!(covered.windows(2).all(|pair| pair[0] != pair[1]), "{covered:?}");
    // The mount allows 0.3 rad, which is 17.2°.
    let broken: Vec<usize> = rows.iter().map(|row| row["broken_rules"].list().len()).collect();
    assert!(!found.to_string().contains(" rad outside"), "{found}");
    assert_eq!(broken, [0, 0, 0, 0, 1]);
    let by_number = sweep(dir.path(), "--of 1.z --from 1 --to 2 --values 2");
    write_two(dir.path(), "moved.json", 2.0, 0.0);
    assert_scores(&by_number["rows"][2], &scored(dir.path(), "moved.json"));
}

#[test]
fn the_library_has_the_rows_of_the_program() {
    let dir = required_yard();
    let found = sweep(dir.path(), "--of 1.z --from 0.5 --to 3 --values 2");
    let scene = Scene::read(dir.path().join("yard.json")).unwrap();
    let job = Job::new(scene).frames(Some(2)).engine(EngineChoice::cpu());
    let two = read_placements(dir.path().join("two.json")).unwrap().remove(0);
    let field = SweptField::find("1.z", &two, job.problem().unwrap().constraints()).unwrap();
    let rows = job.sweep(&two, field, &[0.5, 3.0]).unwrap();
    assert_eq!(serde_json::to_value(&rows).unwrap(), found);
}

#[test]
fn a_table_for_people_and_a_chart() {
    let dir = required_yard();
    let args = "study sweep yard.json two.json --backend cpu --frames 1";
    let of = ["--of", "1.z", "--from", "1", "--to", "3", "--values", "3", "--out", "z.svg"];
    let text = stdout(&dir, &(args, &of));
    text.says("two: z of LiDAR 1").says("req 1: car from 5 to 20 m, 90.0 % required");
    text.says("rules broken in 1 of 4 rows; at 3.000 m:\n  LiDAR 1: z is 0.500 m outside the mount roof\n");
    text.says("\ncar lost °: width of the sectors of 30° in which a car is lost somewhere between 5 and 50 m\n");
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    assert!(
        text.starts_with("Scores and requirements by one pose field, over 1 frame of yard\n"),
        "{text}"
    );
    let svg = read_text(&dir, "z.svg");
    // Near gain, gain and a requirement: a line each, whole where the value as given stands, and a dot at each value.
    assert_eq!(svg.matches("<polyline").count(), 3, "{svg}");
    assert_eq!(svg.matches("r=\"4\"").count(), 3 * 3, "{svg}");
    for part in ["near gain", "car from 5 to 20 m", "as given", "z, m"] {
        assert!(svg.contains(part), "{part}");
    }
    let level = ["study", "sweep", "two.json", "--vehicle", "cart.json", "--backend", "cpu"];
    let of = ["--of", "1.pitch", "--from", "0", "--to", "30", "--values", "2"];
    let found = ok(&dir, &(&level, &of));
    // A sensor that looks down by 30° loses a car ahead; the other one sees it to 25 m. Level, it loses one at 45 m between two
    // of its beams.
    let blind =
        |row: usize| found["sweeps"][0]["rows"][row]["scores"]["range_card"]["blind"].clone();
    let [level, down] = [1, 2].map(blind);
    assert_eq!((&level[0]["distances"], &level[0]["worst"]), (&json!([45.0, 50.0]), &json!(-3.75)));
    assert_eq!(level[1]["bearings"], json!([52.5, -52.5]));
    assert_eq!(down[0]["bearings"], json!([-180.0, 180.0]));
}

#[test]
fn flat_areas_of_the_ground_have_voxels_on_level_ground() {
    let dir = required_yard();
    let mut ahead =
        json!({ "name": "ahead", "min": [4, -2, -0.1], "max": [9, 2, 0.1], "share": 0.3 });
    set_rules(&dir, json!([ahead]));
    let level = "study sweep two.json --vehicle cart.json --backend cpu";
    // A sensor that looks at the sky sees none of it.
    let of = ["--of", "front.pitch", "--from", "-60", "--to", "15", "--values", "2"];
    let found = ok(&dir, &(level, &of));
    let share =
        |row: usize| found["sweeps"][0]["rows"][row]["scores"]["requirements"][0]["found"].number();
    assert!(share(1) < share(2) && share(2) > 0.3, "{found}");
    let none = "study redundancy two.json --vehicle cart.json --backend cpu";
    assert!(ok(&dir, none)["rows"][0]["voxels"].is_object());
    // An area that no grid holds is named with the file of the vehicle.
    ahead["max"][2] = json!(-0.09);
    set_rules(&dir, json!([ahead]));
    fails(&dir, &(level, &of)).says("cart.json: require[0]: `ahead` holds no voxel");
}

#[test]
fn wrong_input_is_one_sentence_each() {
    let dir = required_yard();
    let base = "study sweep yard.json rigs.json --backend cpu --of";
    for (more, part) in [
        ("0.pitch --from 3 --to 3", "give two different numbers"),
        ("0.pitch --from nan --to 3", "give two different numbers"),
        ("0.z --from 1e308 --to -1e308", "LiDAR 0: z = 1e308 is not usable"),
        ("1.x --from 0 --to 2e6", "LiDAR 1: x = 2000000.0 is not usable"),
        ("0.tilt --from 0 --to 3", "`tilt` is no pose field"),
        ("pitch --from 0 --to 3", "write LIDAR.FIELD"),
        ("7.x --from 0 --to 3", "has no LiDAR 7; it has 4"),
        ("roof.x --from 0 --to 3", "is each of the LiDARs 0, 1, 2, 3"),
        ("bonnet.x --from 0 --to 3", "its LiDARs are 0 to 3, front, roof, wide"),
        ("0.x --from 0 --to 3 --out x.svg", "--out draws one placement"),
        ("0.x --from 0 --to 3 --values 1", "--values"),
    ] {
        fails(&dir, &(base, more)).says(part);
    }
    assert!(!dir.path().join("x.svg").exists());
}

/// The rig of two, as it is or with its second LiDAR off: true if `score` finds that it meets all requirements.
fn meets(dir: &Path, z: f64, pitch: f64) -> bool {
    write_two(dir, "moved.json", z, pitch);
    let score = scored(dir, "moved.json");
    score["requirements"].list().iter().all(|seen| seen["met"] == true)
}

#[test]
fn a_tolerance_ends_where_score_says_that_a_requirement_breaks() {
    let dir = required_yard();
    let rules = json!([
        { "name": "far", "target": "car", "from": 30, "within": 45, "bearing": [-20, 20], "beams": 5, "share": 0.9 },
        { "name": "near", "target": "car", "within": 20, "share": 0.9 }]);
    set_rules(&dir, rules);
    let args = "study tolerance yard.json two.json --backend cpu --frames 2";
    let more = "--most-mm 2000 --most-deg 20 --steps 4";
    let found = ok(&dir, &(args, more));
    let room = &found["rows"][0];
    assert_eq!((&room["missed"], room["fields"].list().len()), (&json!([]), 12));
    assert_eq!(room["copies"].list().len(), 6);
    let mut ends = 0;
    for (field, step, of) in [("z", 500.0, 1e-3), ("pitch", 5.0, 1.0_f64.to_radians())] {
        let all = room["fields"].list();
        let row = all.iter().find(|row| row["lidar"] == 1 && row["field"] == field).unwrap();
        for (side, sign) in [("down", -1.0), ("up", 1.0)] {
            let at = |k: f64| {
                let off = sign * k * step * of;
                if field == "z" {
                    meets(dir.path(), 1.0 + off, 0.0)
                } else {
                    meets(dir.path(), 1.0, off)
                }
            };
            let first = (1..=4).find(|&k| !at(f64::from(k)));
            assert_eq!(row[side]["holds_to"], f64::from(first.unwrap_or(5) - 1) * step, "{row}");
            assert_eq!(
                row[side]["breaks_at"].as_f64(),
                first.map(|k| f64::from(k) * step),
                "{row}"
            );
            assert_eq!(row[side]["breaks"].is_null(), first.is_none());
            ends += usize::from(first.is_some());
        }
    }
    assert!(ends > 0 && ends < 4, "{room}");
}

#[test]
fn a_tolerance_looks_at_four_frames_unless_told_otherwise_and_says_so() {
    let dir = required_yard();
    change(&dir, "yard.json", |scene| {
        scene["frames"] = json!(6);
        scene["actors"][0]["poses"] =
            json!([12, 13, 14, 15, 16, 17].map(|x| json!({ "x": x, "y": 1 })));
    });
    let line =
        "study tolerance yard.json two.json --backend cpu --most-mm 1 --most-deg 1 --steps 1";
    let told = |more: &str| {
        let (_, texts) = ran(&dir, &format!("{line}{more}"));
        texts
    };
    let [[few, said], [four, _], [_, all]] = ["", " --frames 4", " --frames 6"].map(told);
    said.says("4 of 6 frames are looked at, spread evenly; --frames 6 looks at all");
    assert!(few == four && !few.is_empty(), "{few}\n{four}");
    assert!(!all.contains("frames are looked at"), "{all}");
}

#[test]
fn a_requirement_that_is_missed_is_left_out_and_the_others_are_studied() {
    let dir = required_yard();
    let near = json!({ "name": "near", "target": "car", "within": 20, "share": 0.9 });
    let far = json!({ "name": "far", "target": "car", "within": 300, "share": 0.99 });
    let args = "study tolerance yard.json two.json --backend cpu --frames 1";
    let few = ["--steps", "2", "--most-mm", "2000"];
    let args = &(args, few);
    let ring = json!({ "ground": 3, "share": 0.01 });
    set_rules(&dir, json!([near]));
    // On targets every copy has poses of its own: the error is of 200 draws, not of 15 poses a LiDAR.
    let (_, [text, _]) = ran(&dir, args);
    assert!(text.contains("100 % of 200 copies meet all requirements (± 1,"), "{text}");
    assert!(!text.contains("± counts 15"), "{text}");
    set_rules(&dir, json!([near, ring]));
    let alone = ok(&dir, args)["rows"][0].clone();
    set_rules(&dir, json!([near, far, ring]));
    let (code, both, told) = answer(&dir, args);
    assert_eq!(code, Some(1), "{told}");
    let both = &both["rows"][0];
    for key in ["fields", "tilt", "copies", "alone"] {
        assert!(!alone[key].is_null() && both[key] == alone[key], "{key}: {both} {alone}");
    }
    let missed = both["missed"].list();
    assert!(missed.len() == 1 && missed[0].to_string().contains("NOT MET: far: "), "{missed:?}");
    let (_, [text, _]) = ran(&dir, args);
    text.says("missed as it is and left out").says("holds to");
    assert!(text.starts_with("Deviations within which the met requirements hold, every"), "{text}");
    // A LiDAR alone may be off as far as all together, or farther.
    let copies = both["copies"].list();
    let together = copies.iter().take_while(|of| of["holds_in"].number() >= 0.95).last();
    let place = |within: &Value| copies.iter().position(|of| of["tolerance"] == *within);
    for (k, of) in both["alone"].list().iter().enumerate() {
        assert_eq!(of["lidar"], k);
        let within = together.map(|of| &of["tolerance"]).and_then(place);
        assert!(place(&of["holds_within"]) >= within, "{both}");
        // Beyond it a requirement breaks, which the text names; the placement misses `far` anyway.
        assert_eq!(of["breaks"].is_null(), of["breaks_within"].is_null(), "{both}");
        let next = place(&of["holds_within"]).map_or(0, |last| last + 1);
        assert_eq!(
            of["breaks_within"],
            copies.get(next).map_or(Value::Null, |of| of["tolerance"].clone())
        );
        if let Some(name) = of["breaks"].as_str() {
            assert!(name != "far" && text.contains(&format!("{name} breaks first")), "{text}");
        }
    }
    // CSV has the boxes, too: all together and each LiDAR, in millimetres and in degrees.
    let (_, [csv, _]) = ran(&dir, &(args, "--format csv"));
    assert_eq!(csv.matches(",all fields,mm,").count(), 3, "{csv}");
    assert_eq!(csv.matches(",all fields,deg,").count(), 3, "{csv}");
    for words in [
        "all LiDARs off together by up to 5 mm and 0.5°: ",
        " % of 200 copies meet all other requirements (± ",
        "± counts 15 draws a LiDAR, not 200 copies: where areas, ground or overlap are required, copies draw from 15",
        "LiDAR 1 alone off in all fields by up to ",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn a_lidar_that_looks_at_the_own_body_is_told_as_score_tells_it() {
    let dir = required_yard();
    let self_hits = |scores: &Value| {
        let all = scores["guards"].list().iter();
        all.filter(|of| of.text().starts_with("self_hit")).cloned().collect::<Vec<_>>()
    };
    // LiDAR 0 looks at the roof below it. LiDAR 1 stands 0.1 m before the body, and 0.2 m behind that place within it.
    let given = self_hits(&scored(dir.path(), "two.json"));
    assert_eq!(given.len(), 1, "{given:?}");
    let args = "study tolerance yard.json two.json --backend cpu --frames 1";
    let args = &(args, "--steps 2 --most-mm 400");
    let found = ok(&dir, args);
    let room = &found["rows"][0];
    assert_eq!(room["guards"], json!(given));
    let at = |lidar: usize, side: &str| {
        let mut fields = room["fields"].list().iter();
        let x = fields.find(|of| of["lidar"] == lidar && of["field"] == "x").unwrap();
        x[side]["self_hit_at"].clone()
    };
    let all = [at(0, "down"), at(0, "up"), at(1, "down"), at(1, "up")];
    assert_eq!(all, [json!(0.0), json!(0.0), json!(200.0), Value::Null]);
    let (_, [text, _]) = ran(&dir, args);
    for words in [
        "  ! self_hit: LiDAR 0 (roof) ends ",
        "! self_hit: at x − 200.0 mm LiDAR 1 ends more than 25 % of its beams at the own vehicle",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let found = sweep(dir.path(), "--of 1.x --from 2.1 --to 1.9 --values 2");
    let of_row = |row: usize| self_hits(&found["rows"][row]["scores"]);
    assert_eq!((of_row(0), of_row(1)), (given.clone(), given));
    let [_, inside] = &of_row(2)[..] else { panic!("{found}") };
    assert!(inside.text().starts_with("self_hit: LiDAR 1 "), "{inside}");
    inside.text().says(" ends 100.0 %");
}

#[test]
fn a_rig_without_room_is_exit_code_1_and_a_vehicle_without_requirements_an_error() {
    let dir = yard();
    let args = "study tolerance yard.json rigs.json --backend cpu --frames 1";
    fails(&dir, args)
        .says("tolerance: the vehicle requires nothing; write what it must see under `require`");
    set_rules(&dir, json!([{ "target": "car", "within": 300, "share": 1 }]));
    let (code, [text, _]) = ran(&dir, args);
    assert_eq!(code, Some(1), "{text}");
    text.says("NOT MET: car from 5 to 300 m").says("there is no room");
    fails(&dir, &(args, "--most-mm 0")).says("millimetres above 0");
}

/// Product of two matrices, `[row][column]`.
fn product(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    a.map(|row| [0, 1, 2].map(|k| (0..3).map(|n| row[n] * b[n][k]).sum()))
}

/// The rig of two LiDARs and `leaning.json`, the cart with its body in a pose, both tilted by hand about a point of the ground:
/// the side at `bearing` goes down.
fn write_tilted(dir: &Path, bearing: f64, angle: f64, [px, py]: [f64; 2]) {
    let about_z = |a: f64| [[a.cos(), -a.sin(), 0.0], [a.sin(), a.cos(), 0.0], [0.0, 0.0, 1.0]];
    let about_y = |a: f64| [[a.cos(), 0.0, a.sin()], [0.0, 1.0, 0.0], [-a.sin(), 0.0, a.cos()]];
    let about_x = |a: f64| [[1.0, 0.0, 0.0], [0.0, a.cos(), -a.sin()], [0.0, a.sin(), a.cos()]];
    // Turned so that the bearing is ahead, pitched down, and turned back.
    let turn = product(about_z(bearing), product(about_y(angle), about_z(-bearing)));
    let tilted = |[x, y, z, roll, pitch, yaw]: [f64; 6], sensor: &str| {
        let at = [x - px, y - py, z];
        let [x, y, z] = turn.map(|row| (0..3).map(|k| row[k] * at[k]).sum::<f64>());
        let r = product(turn, product(about_z(yaw), product(about_y(pitch), about_x(roll))));
        let mut pose = json!({ "x": x + px, "y": y + py, "z": z, "roll": r[2][1].atan2(r[2][2]),
                               "pitch": (-r[2][0]).asin(), "yaw": r[1][0].atan2(r[0][0]) });
        if !sensor.is_empty() {
            pose["sensor"] = json!(sensor);
        }
        pose
    };
    fs::copy(dir.join("cart.json"), dir.join("leaning.json")).unwrap();
    change(dir, "leaning.json", |vehicle| {
        let body = vehicle.as_object_mut().unwrap().remove("body").unwrap();
        vehicle["bodies"] = json!([{ "parts": body, "poses": [tilted([0.0; 6], "")] }]);
    });
    let lidars = [
        tilted([0.3, 0.2, 2.0, 0.0, 0.1, 0.7], "wide"),
        tilted([1.6, -0.4, 1.0, 0.2, 0.0, -0.3], "front"),
    ];
    write_rig(dir, "tilted.json", "two", lidars);
}

#[test]
fn a_tilt_ends_where_score_says_that_a_rig_tilted_by_hand_breaks() {
    let dir = required_yard();
    let rules = json!([
        { "name": "far", "target": "car", "from": 15, "within": 25, "bearing": [-20, 20], "beams": 5, "share": 0.5 },
        { "name": "near", "target": "car", "within": 15, "share": 0.8 }]);
    set_rules(&dir, rules);
    let about = [1.2, -0.1];
    write_tilted(dir.path(), 0.0, 0.0, about);
    fs::copy(dir.path().join("tilted.json"), dir.path().join("level.json")).unwrap();
    let line = "study tolerance yard.json level.json --backend cpu --frames 2 --most-mm 1 --most-deg 1 --steps 4 \
                --most-tilt 20 --tilt-about 1.2,-0.1";
    let found = ok(&dir, line);
    let tilt = &found["rows"][0]["tilt"];
    assert_eq!((&tilt["about"], &found["tilt_about"]), (&json!([1.2, -0.1]), &json!([1.2, -0.1])));
    let directions = tilt["directions"].list();
    let names: Vec<&str> = directions.iter().map(|of| of["direction"].text()).collect();
    assert_eq!(
        (names.len(), names[0], names[2], names[5]),
        (8, "front down", "left down", "rear right down")
    );
    let mut ends = Vec::new();
    for (k, of) in directions.iter().enumerate() {
        let first = (1..=4).find_map(|step| {
            let angle = (5.0 * f64::from(step)).to_radians();
            write_tilted(dir.path(), (45.0 * k as f64).to_radians(), angle, about);
            let required =
                scored_on(dir.path(), "leaning.json", "tilted.json")["requirements"].clone();
            let lacks = |rule: &Value| rule["required"].number() - rule["found"].number();
            let all = required.list().iter().filter(|rule| rule["met"] == false);
            let worst = all.max_by(|a, b| lacks(a).total_cmp(&lacks(b)))?;
            Some((5.0 * f64::from(step), worst["name"].clone()))
        });
        let (at, name) = first.unzip();
        assert_eq!(of["breaks_at"].as_f64(), at, "{of}");
        assert_eq!(of["breaks"], name.unwrap_or_default(), "{of}");
        let holds = at.unwrap_or(25.0) - 5.0;
        assert_eq!(of["holds_to"], holds, "{of}");
        ends.push(holds);
    }
    let least = ends.iter().copied().fold(f64::INFINITY, f64::min);
    let first = ends.iter().position(|end| *end == least).unwrap();
    assert_eq!(
        (&tilt["holds_to"], &tilt["direction"]),
        (&json!(least), &directions[first]["direction"])
    );
    assert!(ends.iter().any(|end| *end != least) && least > 0.0, "{ends:?}");
    let (_, [text, _]) = ran(&dir, line);
    let told =
        format!("tilted about the ground at x = 1.2 m, y = -0.1 m holds to {least:.2}°, then ");
    text.says(&told).says("\nfront left down ");
    for (more, part) in [
        ("--most-tilt=0", "degrees above 0 and up to 45"),
        ("--most-tilt=50", "degrees above 0 and up to 45"),
        ("--tilt-about=1", "give x,y in metres"),
        ("--tilt-about=1,nan", "give x,y in metres"),
        ("--tilt-about=1,200", "within ±100"),
    ] {
        fails(&dir, &("study tolerance yard.json level.json --backend cpu", more)).says(part);
    }
}

#[test]
fn a_body_that_tilts_along_hides_nothing_more() {
    let dir = required_yard();
    // LiDAR 1, 0.1 m before the body, alone sees it: beside a body that stays upright it would look at its front.
    let low = json!({ "name": "low", "target": "tyre", "from": 3, "within": 6, "bearing": [-20, 20], "share": 0.3 });
    set_rules(&dir, json!([low]));
    let line = "study tolerance yard.json two.json --backend cpu --frames 1 --most-mm 1 --most-deg 1 --steps 2 \
                --most-tilt 12";
    let tilt = &ok(&dir, line)["rows"][0]["tilt"];
    let of = |direction: &str| {
        let mut all = tilt["directions"].list().iter();
        all.find(|of| of["direction"] == direction).unwrap()
    };
    // At 12° its beams pass above the tyre. An upright body would end this at 0°, and rear left down at 6°.
    let (rear, left) = (of("rear down"), of("rear left down"));
    assert_eq!((&rear["holds_to"], &rear["breaks_at"]), (&json!(6.0), &json!(12.0)), "{tilt}");
    assert_eq!((&left["holds_to"], &left["breaks_at"]), (&json!(12.0), &Value::Null), "{tilt}");
}
