//! `view`, and that a run's page tells how to repeat it, from outside.

use crate::cli::*;
use crate::cli_cones::rig;
use crate::cli_shared::yard as cart_yard;

/// The yard with a LiDAR over the roof of its vehicle.
fn yard(dir: &Path) {
    let lidar = json!({ "channels": 12, "fov": [-30, 0], "azimuth_steps": 60, "range": 60 });
    let mount =
        json!({ "min": [-1.5, -0.8, 1.6], "max": [1.5, 0.8, 2.4], "lidars": 1, "min_distance": 0 });
    write(dir, "yard.json", &level_yard(lidar, mount));
    let at = |z: f64| json!([{ "x": 0.0, "y": 0.0, "z": z }]);
    let placements = json!({ "placements": [
        { "name": "low", "lidars": at(2.3) }, { "name": "high", "lidars": at(2.4) }] });
    write(dir, "two.json", &placements);
}

#[test]
fn a_page_of_a_placement_compares_it_with_those_given() {
    let dir = TempDir::new().unwrap();
    yard(dir.path());
    let args = "view yard.json two.json:high --baselines two.json:low --out v.html";
    printed(&dir, &(args, "--backend cpu"));
    let page = read_text(&dir, "v.html");
    // Twelve channels lose a car far away: that is said first.
    page.says("<h1>BLIND: all round ");
    assert!(page.contains(" high is ") && page.contains(" than low, the only baseline"));
    let warnings = |page: &str| {
        let from = page.split_once("id=\"guards\"").unwrap().1;
        from.split_once("</section>").unwrap().0.to_owned()
    };
    // Warnings list the blind sectors of the head, with their meaning.
    warnings(&page)
        .says("<b>high</b>: BLIND: all round ")
        .says("<b>low</b>: ")
        .says("BLIND: ")
        .says("do not make its score doubtful: blind sectors.");
    let caption = "Percentage points that high gains more than each baseline";
    assert!(page.contains(caption), "the rig that was given is named");
    let command = page.split("sightline view ").nth(1).unwrap().split('<').next().unwrap();
    assert_eq!(command, "yard.json two.json:high --baselines two.json:low --out v.html --force");
    assert!(!page.contains("The search"), "nothing was searched");
    assert!(!page.contains("src=") && !page.contains("<link") && !page.contains("fetch("));
    // Without a baseline none, as the yard's mount holds no layout of the paper; without a name the first of the file.
    fs::copy(dir.path().join("yard.json"), dir.path().join("my yard.json")).unwrap();
    let args = ["view", "my yard.json", "two.json", "--out", "w.html", "--backend", "cpu"];
    let wet = ["--condition", "wet:water=1"];
    stderr(&dir, &(&args, &wet))
        .says("two.json: shows `low` of 2 placements; two.json:NAME shows another");
    let page = read_text(&dir, "w.html");
    assert!(page.contains("sightline · yard, under wet:water=1<"));
    let command = page.split("sightline view ").nth(1).unwrap().split('<').next().unwrap();
    let quoted =
        command.contains("my yard.json' ") && command.contains("two.json --condition wet:water=1 ");
    assert!(quoted, "a command to be copied into a shell: {command}");
    assert!(page.contains(" low ") && !page.contains("Pyramid-roll"));
    assert!(!warnings(&page).contains("baseline"), "{}", warnings(&page));
}

#[test]
fn what_cannot_be_shown_is_told_before_work_begins() {
    let dir = TempDir::new().unwrap();
    yard(dir.path());
    let view = |placement: &str, out: &str| {
        fails(&dir, &format!("view yard.json {placement} --out {out} --backend cpu"))
    };
    view("two.json:roof", "v.html").says("two.json: has no placement `roof`; it has low, high");
    view("two.json:low", "two.json").says("two.json");
    assert!(!dir.path().join("v.html").exists());
}

/// Text between the tags of a section of a page, cells apart by `|`.
fn section(page: &str, id: &str) -> String {
    let from = page.split_once(&format!("id=\"{id}\"")).map_or("", |(_, rest)| rest);
    let section = from.split_once("</section>").map_or("", |(section, _)| section);
    let mut text = String::new();
    for part in section.split('<') {
        let (tag, words) = part.split_once('>').unwrap_or(("", part));
        text += if tag.starts_with("td") || tag.starts_with("th ") { "|" } else { "" };
        text += words;
    }
    text
}

#[test]
fn a_page_has_the_numbers_of_the_studies_on_several_lidars() {
    let dir = TempDir::new().unwrap();
    yard(dir.path());
    let lidar = |x: f64, pitch: f64| json!({ "x": x, "y": 0.0, "z": 2.0, "pitch": pitch });
    write_rig(&dir, "pair.json", "pair", [lidar(1.2, 0.1), lidar(-1.2, 0.0)]);
    let done = |args: &str| stdout(&dir, &(args, "--backend cpu"));
    done("view yard.json pair.json --out v.html --figures figures");
    let page = read_text(&dir, "v.html");
    let told = section(&page, "redundancy");
    let study = done("study redundancy yard.json pair.json");
    let rows = study.lines().skip_while(|line| !line.starts_with("% seen by")).skip(1);
    let rows = rows.filter(|line| !line.is_empty());
    let cells = |line: &str| {
        line.split("  ").map(str::trim).filter(|c| !c.is_empty()).collect::<Vec<_>>().join("|")
    };
    let rows: Vec<String> = rows.map(cells).collect();
    assert!(rows.len() >= 7, "{study}");
    rows.iter().for_each(|row| assert!(told.contains(row), "{row} of {told}"));
    let told = section(&page, "lost");
    let csv = done("study loss yard.json pair.json --format csv --out loss");
    let values: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    for (lidar, value) in values[3..5].iter().enumerate() {
        let row = format!("|LiDAR {lidar}|{:.2}|", value.parse::<f64>().unwrap());
        assert!(told.contains(&row), "{row} of {told}");
    }
    assert!(told.contains("without LiDAR 0: all round") || told.contains("|360"), "{told}");
    read_text(&dir, "figures/lidars-yard.svg").says("LiDARs that see a column, mean of 3 frames");
    assert!(page.contains("Columns by the number of LiDARs that see them"));
    // One LiDAR has no other to be compared with.
    done("view yard.json two.json:high --out one.html");
    let one = read_text(&dir, "one.html");
    assert!(!one.contains("id=\"lost\"") && !one.contains("id=\"redundancy\""));
}

#[test]
fn a_page_has_the_table_of_technologies_and_the_command_for_tolerances() {
    let dir = cart_yard();
    let dir = dir.path();
    change(dir, "cart.json", |cart| {
        cart["other_sensors"] = rig();
    });
    let done = |args: &str| stdout(dir, &format!("{args} --backend cpu"));
    // A placement that misses a requirement ends with 1, as in `score`; its page is written.
    let far = json!({ "target": "tyre", "from": 40, "within": 40, "beams": 100, "share": 1 });
    set_rules(dir, json!([far]));
    let run = sightline(dir, "view yard.json each.json:l0 --backend cpu --out missed.html");
    let told = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{told}");
    told.says("NOT MET: l0 misses a requirement; exit code 1");
    read_text(dir, "missed.html").says("NOT MET");
    let near = json!({ "target": "car", "within": 10, "share": 0.1 });
    set_rules(dir, json!([near]));
    // One LiDAR: its vehicle has cameras and radars, one of them within the body.
    done("view yard.json each.json:l0 --out v.html");
    let page = read_text(dir, "v.html");
    let told = section(&page, "redundancy");
    let study = done("study redundancy yard.json each.json:l0");
    let table = study.split_once("% by technologies").unwrap().1;
    let rows = table.lines().skip(1).take_while(|line| !line.is_empty());
    let cells = |line: &str| {
        line.split("  ").map(str::trim).filter(|c| !c.is_empty()).collect::<Vec<_>>().join("|")
    };
    let rows: Vec<String> = rows.map(cells).collect();
    assert!(rows.len() >= 7, "{study}");
    rows.iter().for_each(|row| assert!(told.contains(row), "{row} of {told}"));
    told.says("|blind to all|by 1|2|3+|1 lidar|7 camera|5 radar");
    told.says("% of the view of radar 4");
    section(&page, "required").says("sightline study tolerance yard.json each.json:l0");
}
