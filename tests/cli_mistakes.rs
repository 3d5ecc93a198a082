//! Options that would pass in silence: models that do not exist, weights of 0, steps wider than a mount, wrong endings.

use crate::cli::*;
use crate::cli_vehicle::garage;

/// A garage with a placement whose LiDARs name their models.
fn named() -> TempDir {
    let dir = garage();
    let lidar = |x: f64| json!({ "x": x, "y": 0, "z": 1.5, "sensor": "spinning" });
    write_rig(&dir, "p.json", "p", [lidar(-0.2), lidar(0.2)]);
    dir
}

#[test]
fn files_of_a_search_are_named_as_they_were_given() {
    let dir = named();
    write(&dir, "bad.json", "{ \"sightline\": 1, ");
    for (line, start) in [
        ("optimize nope.json", "sightline: nope.json: cannot be read: "),
        ("optimize bad.json", "sightline: bad.json: "),
        ("optimize room.json --vehicle nope.json", "sightline: nope.json: "),
        ("optimize nope.json --front price,near_gain", "sightline: nope.json: cannot be read: "),
    ] {
        let told = fails(&dir, line);
        assert!(told.starts_with(start), "{line}: {told}");
    }
}

#[test]
fn errors_that_need_no_scene_come_before_it_is_read() {
    let dir = named();
    write(&dir, "bad.json", "{ \"sightline\": 1, ");
    fs::create_dir(dir.path().join("taken")).unwrap();
    for name in ["f.html", "f.npz"] {
        fs::write(dir.path().join("taken").join(name), "").unwrap();
    }
    let text = read_text(&dir, "p.json");
    fs::write(dir.path().join("typo.json"), text.replacen("spinning", "spining", 1)).unwrap();
    let sweep = |of: &str| format!("study sweep bad.json {of} --from 0 --to 1");
    let (by_number, by_name) =
        (sweep("p.json --of 5.yaw"), sweep("p.json --vehicle cart.json --of rear.yaw"));
    let typo = sweep("typo.json --vehicle cart.json --of 0.yaw");
    let unknown = "there is no sensor `spining`; did you mean `spinning`?";
    for (line, word) in [
        ("optimize bad.json --vehicle cart.json --budget 2", "2 is below the cheapest rig"),
        (
            "optimize bad.json --vehicle cart.json --fewest",
            "--fewest: the vehicle requires nothing",
        ),
        (
            "optimize bad.json --vehicle cart.json --front near_gain,requirements",
            "requires nothing; write what it must see",
        ),
        ("study tolerance bad.json p.json --vehicle cart.json", "the vehicle requires nothing"),
        (by_number.as_str(), "placement `p` has no LiDAR 5; it has 2, the first is 0"),
        (by_name.as_str(), "placement `p` has no LiDAR `rear`; its LiDARs are 0 to 1, "),
        (typo.as_str(), unknown),
        ("optimize bad.json --vehicle cart.json --baselines typo.json", unknown),
        ("score bad.json typo.json --vehicle cart.json", unknown),
        ("cast bad.json typo.json --vehicle cart.json", unknown),
        ("view bad.json typo.json --vehicle cart.json --out v.html", unknown),
        ("study loss bad.json typo.json --vehicle cart.json", unknown),
        ("study overlap bad.json typo.json --vehicle cart.json", unknown),
        ("study targets bad.json typo.json --vehicle cart.json --target car", unknown),
        (
            "score bad.json p.json --vehicle cart.json --sensor all=solide",
            "there is no sensor `solide`",
        ),
        ("optimize bad.json nope.json", "nope.json: cannot be read: "),
        ("optimize bad.json --out taken", "taken: is not empty"),
        (
            "optimize bad.json --vehicle cart.json --front price,near_gain --out taken",
            "taken: is not empty",
        ),
        ("view bad.json p.json --out taken/f.html", "taken/f.html: already exists"),
        ("cast bad.json p.json --out taken/f.npz", "taken/f.npz: already exists"),
        ("study loss bad.json p.json --out taken", "taken: is not empty"),
        ("study loss bad.json p.json:q", "p.json: has no placement `q`"),
    ] {
        let told = fails(&dir, line);
        assert!(told.contains(word) && !told.contains("bad.json"), "{line}: {told}");
    }
}

const SCORE: &str = "score room.json p.json --vehicle cart.json --backend cpu";

#[test]
fn models_and_indices_that_do_not_exist_are_refused() {
    let dir = named();
    for (choice, word) in [
        (
            "all=spining",
            "--sensor all=spining: there is no sensor `spining`; did you mean `spinning`?",
        ),
        (
            "7=solid",
            "--sensor 7=solid: no placement of p.json has such a LiDAR; indices go from 0 to 1",
        ),
        (
            "0=solid --sensor 0=spinning",
            "--sensor 0=spinning: names the model of a LiDAR a second time; give it once",
        ),
    ] {
        fails(&dir, &format!("{SCORE} --sensor {choice}")).says(word);
        fails(&dir, &format!("{} --sensor {choice}", SCORE.replace("score", "cast"))).says(word);
    }
    stderr(&dir, &format!("{SCORE} --sensor all=solid"))
        .says("--sensor all=solid changes nothing: every LiDAR of p.json names its model");
}

#[test]
fn options_that_leave_nothing_to_search_are_refused() {
    let dir = named();
    let optimize = "optimize room.json --vehicle cart.json --backend cpu --budget 30 --out o";
    for (more, word) in [
        ("--objective 0*near_gain", "`0*near_gain`: every weight is 0"),
        ("--delta 100", "--delta: 100 m from pose to pose is more than any mount of "),
    ] {
        fails(&dir, &format!("{optimize} {more}")).says(word);
    }
    assert!(!dir.path().join("o").exists());
}

#[test]
fn a_spacing_of_more_beams_than_can_be_cast_is_refused_with_their_number() {
    let dir = named();
    change(&dir, "room.json", |room| room["psog"] = json!({ "scan": { "spacing": 0.0001 } }));
    fails(&dir, SCORE)
        .says("psog.scan.spacing: 0.0001 m makes ")
        .says(" beams in each frame, at most 100000000 may be cast");
}

#[test]
fn studies_of_no_kind_name_all_of_them() {
    let dir = named();
    fails(&dir, "study nearfeld room.json")
        .says("nearfield, targets, redundancy, overlap, sweep, tolerance]")
        .says("a similar value exists: 'nearfield'");
    fails(&dir, "study cost room.json p.json --vehicle cart.json")
        .says("`nearfield`, `targets`, `redundancy`, `overlap`, `sweep` and `tolerance` do");
}

#[test]
fn files_with_the_ending_of_another_format_are_refused() {
    let dir = named();
    for (line, word) in [
        (format!("{SCORE} --out c.xlsx"), "--out c.xlsx: is written as TXT"),
        (
            format!("{SCORE} --format json --out c.csv"),
            "--out c.csv: is written as JSON; give --format csv, or the ending .json",
        ),
        ("rig export p.json:p --format urdf --out c.json".to_owned(), "give it the ending .urdf"),
        ("rig export p.json:p --format urdf --out .".to_owned(), "is not empty"),
    ] {
        fails(&dir, &line).says(word);
    }
    let mut left: Vec<_> =
        fs::read_dir(dir.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["cart.json", "p.json", "room.json"]);
}
