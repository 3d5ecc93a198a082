//! The chart of cost against accuracy: its files, its errors, Ctrl-C and resume.

use crate::cli::*;

const CHART: &str = "chart room.json --quick --full --placements 12 --backend cpu --out";

#[test]
fn a_chart_measures_the_settings_of_a_scene() {
    let dir = in_room();
    let answer = ok(&dir, &(CHART, "out"));
    assert_eq!(answer["finished"], true);
    assert_eq!(answer["placements"].list().len(), 11 + 12);
    let rows = answer["rows"].list();
    let row = |setting: &str| {
        rows.iter().find(|r| r["setting"] == setting).unwrap_or_else(|| panic!("no {setting}"))
    };
    let number = |row: &Value, at: &str| row.pointer(at).unwrap().number();
    // The f64 scorer shares no code with the backends but the build of trees: their agreement checks both.
    let finest = row("0.5 m, 3 frames, f64");
    assert_eq!(answer["reference"], finest["setting"]);
    assert_eq!(
        (number(finest, "/error/tau/value"), number(finest, "/error/score_largest")),
        (1.0, 0.0)
    );
    let f32 = row("0.5 m, 3 frames, CPU");
    assert!(number(f32, "/error/score_largest") < 2e-3, "{f32}");
    assert!(number(f32, "/error/tau/value") > 0.97, "{f32}");
    assert_eq!(number(f32, "/beams"), 3.0 * 4.0 * 8.0 * 60.0);
    // One frame of three sees the walker in one place only.
    let one = row("0.5 m, 1 frame, CPU");
    assert_eq!(number(one, "/beams"), 4.0 * 8.0 * 60.0);
    assert!(number(one, "/error/score_median") > number(f32, "/error/score_median"));
    assert_eq!(row("0.5 m, azimuth 1/2, 3 frames, CPU")["same_quantity"], false);
    // The verdict is a row within tolerance, and no row within it is cheaper by the seconds that the chart recorded.
    let verdict = |answer: &Value, tolerance: f64| {
        let rows = answer["rows"].list();
        let chosen = rows[answer["verdict"]["setting"].as_u64().unwrap() as usize].clone();
        let keeps = |row: &&Value| {
            number(row, "/error/regret/high") <= tolerance
                && number(row, "/error/swapped/high") <= 0.05
        };
        assert!(keeps(&&chosen));
        let general = rows.iter().filter(|row| row["rung"]["engine"] != "atlas");
        let least = general.filter(keeps).map(|row| number(row, "/seconds"));
        assert_eq!(least.min_by(f64::total_cmp), Some(number(&chosen, "/seconds")));
        chosen
    };
    let chosen = verdict(&answer, 0.01);
    assert!(answer["words"][0].text().contains(chosen["setting"].text()));
    assert_eq!(read_text(&dir, "out/chart.csv").lines().count(), rows.len() + 1);
    let svg = read_text(&dir, "out/chart.svg");
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("cheapest that keeps the ranking") && !svg.contains("NaN"));
    // Going on with a finished chart measures nothing and can only change the tolerance.
    let again = ok(&dir, "chart --resume out --tolerance 1 --backend cpu");
    assert_eq!(again["measured"], answer["measured"]);
    let printed = stdout(&dir, "chart --resume out --backend cpu --format csv");
    assert_eq!(printed, read_text(&dir, "out/chart.csv"));
    verdict(&again, 1.0);
}

/// Text that a chart of the room prints, its CSV by line, and all of its JSON.
fn printed(dir: &TempDir, more: &str, out: &str) -> (String, Vec<String>, Value) {
    let text = stdout(dir, &("chart room.json --placements 30 --backend cpu --out", out, more));
    let csv = read_text(dir, format!("{out}/chart.csv"));
    let answer = serde_json::from_str(&read_text(dir, format!("{out}/chart.json"))).unwrap();
    (text, csv.lines().map(str::to_owned).collect(), answer)
}

#[test]
fn a_chart_that_leaves_settings_early_gives_the_advice_of_a_full_one() {
    let dir = TempDir::new().unwrap();
    let path = room(dir.path());
    // The walker hardly moves: one frame of twelve keeps the ranking, and so do others of few beams.
    let mut scene = read_json(&path);
    scene["frames"] = json!(12);
    let poses = (0..12).map(|k| json!({ "x": 2.0 + 0.001 * f64::from(k), "y": -1 }));
    scene["actors"][0]["poses"] = poses.collect();
    fs::write(&path, scene.to_string()).unwrap();
    let (text, csv, sparing) = printed(&dir, "", "sparing");
    let (all_text, all_csv, full) = printed(&dir, "--full", "full");
    let rows_of = |answer: &Value| answer["rows"].list().clone();
    let (rows, all) = (rows_of(&sparing), rows_of(&full));
    let chosen = |answer: &Value| {
        rows_of(answer)[answer["verdict"]["setting"].as_u64().unwrap() as usize].clone()
    };
    let (advice, wanted) = (chosen(&sparing), chosen(&full));
    let same = all.iter().find(|row| row["setting"] == advice["setting"]).unwrap();
    assert_eq!(
        advice["placements"], same["placements"],
        "the advice is confirmed with all placements"
    );
    let swapped = |row: &Value| row.pointer("/error/swapped/value").unwrap().number();
    // Both keep the ranking in the full chart with few beams. Which of such is the cheapest by the clock is for a quiet
    // machine to say.
    let beams = |row: &Value| row["beams"].number();
    let most = all.iter().map(beams).fold(0.0, f64::max);
    for row in [same, &wanted] {
        assert!(swapped(row) < 0.05 && 4.0 * beams(row) <= most, "{row} {most}");
    }
    assert!((swapped(&advice) - swapped(same)).abs() < 0.01, "{advice} {same}");
    // The reference is in f32, a few placements in f64 check it, and the difference is told.
    assert_eq!(
        (&rows[0]["rung"]["engine"], &all[0]["rung"]["engine"]),
        (&json!("cpu"), &json!("f64"))
    );
    let exact = rows.iter().find(|row| row["rung"]["engine"] == "f64").unwrap();
    assert!(exact["placements"].as_u64().unwrap() < advice["placements"].as_u64().unwrap());
    text.says("differ from the reference by at most");
    // Settings are left, with a reason, and the table is short.
    let is_left = |line: &&String| line.contains("swaps more pairs") || line.contains("as dear as");
    let left = csv.iter().filter(is_left).count();
    assert!(left > 5 && all_csv.iter().filter(is_left).count() == 0, "{csv:#?}");
    let columns = csv[0].split(',').count();
    let quoted = |line: &String| line.split('"').skip(2).collect::<String>();
    assert!(csv[1..].iter().all(|line| quoted(line).split(',').count() == columns), "{csv:#?}");
    let general = all.iter().filter(|row| row["rung"]["engine"] != "atlas").count();
    assert_eq!(csv.len(), general + 1, "every setting but the atlases");
    // A row a setting in the first table.
    let lines = |text: &str| {
        let table = text.split("\n\n").next().unwrap();
        table.lines().filter(|line| line.contains("CPU  ")).count()
    };
    let (few, many) = (lines(&text), lines(&all_text));
    assert!(few > 0 && few < 15.min(many / 2) && many == general - 1, "{text}\n{all_text}");
    text.says("were left early");
}

#[test]
fn a_scene_without_geometry_has_fewer_settings() {
    let dir = corridor();
    let mut scene = crate::cli::scene();
    scene["lidar"] = json!({ "channels": 4, "fov": [-20, 20], "azimuth_steps": 64, "range": 100 });
    write(&dir, "scene.json", &scene);
    let placements = json!({ "placements": [
        { "name": "inside", "lidars": [{ "x": 0.5, "y": 0.5, "z": 0.5 }] },
        { "name": "far", "lidars": [{ "x": 0.5, "y": 0.5, "z": 500 }] },
    ]});
    write(&dir, "placements.json", &placements);
    let args = "chart scene.json placements.json --full --placements 10";
    let answer = ok(&dir, &(args, "--backend cpu --out out"));
    let settings: Vec<&str> = answer["rows"].list().iter().map(|r| r["setting"].text()).collect();
    assert_eq!(
        settings,
        [
            "1 m, through, f64",
            "1 m, through, CPU",
            "1 m, through, atlas",
            "1 m, azimuth 1/2, through, CPU",
            "1 m, azimuth 1/4, through, CPU"
        ]
    );
    let left_out = answer["left_out"].to_string();
    for why in ["the P-SOG is a file", "no geometry", "--backend cpu"] {
        left_out.says(why);
    }
    // A placement that covers nothing has no score.
    assert!(answer["measured"][0]["scores"][0].is_f64());
    assert!(answer["measured"][0]["scores"][1].is_null());
    scene["detection"] = json!([]);
    write(&dir, "scene.json", &scene);
    fails(&dir, "chart scene.json --objective detection.m_sog").says("needs a detection target");
}

#[test]
fn an_atlas_scores_placements_on_its_grid_like_the_cpu() {
    let dir = in_room();
    let pose = |x: f64, y: f64, roll: f64| json!({ "x": x, "y": y, "z": 1.2, "roll": roll });
    let placements = json!({ "placements": [
        { "name": "apart", "lidars": [pose(-0.6, -0.6, -0.3), pose(0.6, 0.6, 0.3)] },
        { "name": "level", "lidars": [pose(-0.6, 0.6, 0.0), pose(0.6, -0.6, 0.0)] },
        { "name": "near", "lidars": [pose(0.0, 0.0, 0.1), pose(0.2, 0.0, -0.1)] },
    ]});
    write(&dir, "p.json", &placements);
    let args = "chart room.json p.json --finest 0.5 --full --placements 0";
    let answer = ok(&dir, &(args, "--backend cpu --out out"));
    let measured = answer["measured"].list();
    let atlases: Vec<&Value> = measured.iter().filter(|m| m["rung"]["engine"] == "atlas").collect();
    assert_eq!(atlases.len(), 2, "three frames and one");
    for atlas in atlases {
        let same = |m: &&Value| {
            m["rung"]["engine"] == "cpu" && m["rung"]["fidelity"] == atlas["rung"]["fidelity"]
        };
        let cpu = measured.iter().find(same).unwrap();
        assert_eq!(cpu["scores"], atlas["scores"]);
        assert_eq!(atlas["beams"], 0);
        assert!(atlas["seconds"].number() > 0.0);
    }
}

#[test]
fn the_gpu_stands_on_the_chart_with_the_scores_of_the_cpu() {
    let dir = in_room();
    let args = "chart room.json --finest 0.5 --full --placements 4";
    let answer = ok(&dir, &(args, "--backend gpu --out out"));
    let measured = answer["measured"].list();
    let of = |engine: &str| {
        measured
            .iter()
            .find(|m| m["rung"]["engine"] == engine)
            .unwrap_or_else(|| panic!("{engine}"))
    };
    assert_eq!(of("cpu")["rung"]["fidelity"], of("gpu")["rung"]["fidelity"]);
    assert_eq!(of("cpu")["scores"], of("gpu")["scores"]);
}

#[test]
fn bad_charts_are_refused() {
    let dir = in_room();
    let chart = |more: &str| fails(&dir, &("chart room.json", more));
    chart("--finest 0.7").says("coarser than the scene's own voxels of 0.5 m");
    fs::create_dir(dir.path().join("out")).unwrap();
    write(&dir, "out/checkpoint.json", "{}");
    chart("--out out").says("already holds a run");
    fails(&dir, "chart --resume out").says("checkpoint.json");
    assert!(sightline(&dir, "chart").status.code() == Some(2));
}

#[cfg(unix)]
#[test]
fn an_interrupted_chart_keeps_what_it_measured() {
    let dir = in_room();
    let mut child = begun(&dir, "chart room.json --placements 120 --backend cpu --out out");
    wait_for(|| dir.path().join("out/checkpoint.json").exists());
    interrupt(&child, "-INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let before: Value = serde_json::from_str(&read_text(&dir, "out/chart.json")).unwrap();
    assert_eq!(before["finished"], false);
    let kept = before["measured"].list();
    let after = ok(&dir, "chart --resume out --backend cpu");
    let all = after["measured"].list();
    assert!(!kept.is_empty() && kept.len() < all.len(), "{} of {}", kept.len(), all.len());
    assert_eq!(kept[..], all[..kept.len()]);
    // Another world under the same name is noticed.
    let moved = read_text(&dir, "room.json");
    write(&dir, "room.json", &moved.replace("[3.9,", "[3.2,"));
    fails(&dir, "chart --resume out --backend cpu").says("room.json: has changed; out was begun");
}
