//! Notes of rows: a rig that money keeps from growing, and one of which nothing is left.

use crate::cli::*;
use crate::cli_study_rigs::street;

#[test]
fn a_row_says_that_the_budget_pays_for_no_more_lidars() {
    let dir = street();
    // The sides are a pair for 6; a roof sensor costs 4 or 10.
    let line = "study lidars street.json --budget 7 --frames 1 --evaluations 4 --backend cpu --out";
    let (_, [text, _]) = ran(&dir, &(line, "few"));
    let why = "the budget pays for no more LiDARs beside these";
    let table = read_json(dir.path().join("few/study.json"));
    let csv = read_text(&dir, "few/table.csv");
    let titles = csv.lines().next().unwrap();
    assert!(titles.ends_with(",note"), "{titles}");
    let rows = table["rows"].list();
    let mut marked = 0;
    for (row, of_csv) in rows.iter().zip(csv.lines().skip(1)) {
        let name = row["name"].text();
        // The last but one value is the number taken; a row without an answer has none.
        let taken = row["values"].list().iter().rev().nth(1).and_then(Value::as_f64);
        let is_short = taken.is_some_and(|taken| taken < name.parse().unwrap());
        assert_eq!(row["note"] == why, is_short, "{row}");
        assert_eq!(of_csv.ends_with(why), is_short, "{of_csv}");
        assert_eq!(text.contains(&format!("{name}: {why}")), is_short, "{text}");
        marked += u32::from(is_short);
    }
    assert!(marked > 0 && rows.len() > 1, "{text}");
    // Enough money is no reason.
    let (_, [text, _]) = ran(&dir, &(line.replace("--budget 7", "--budget 99"), "many"));
    assert!(!text.contains(why), "{text}");
}

#[test]
fn a_rig_of_one_lidar_says_that_nothing_is_left_without_it() {
    let dir = street();
    let line = "study loss street.json rigs.json --frames 1 --backend cpu --out loss";
    let (_, [text, _]) = ran(&dir, line);
    let why = "one LiDAR: nothing is left when it is lost";
    assert!(text.contains(&format!("roof: {why}")), "{text}");
    assert!(!text.contains(&format!("sides: {why}")), "{text}");
    assert!(!text.contains("without one LiDAR there is no value"), "{text}");
    let csv = read_text(&dir, "loss/table.csv");
    let told: Vec<bool> = csv.lines().skip(1).map(|line| line.ends_with(why)).collect();
    assert_eq!(told, [true, false], "{csv}");
    assert_eq!(read_json(dir.path().join("loss/study.json"))["rows"][0]["note"], why);
}
