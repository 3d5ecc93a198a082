//! Studies: their files, going on with them, and numbers that can be checked.

use sightline::psog::{Psog, Roi, write_psog};
use sightline::vehicle::{Constraints, random_placements};

use crate::cli::*;

fn study(dir: &Path, kind: &str, more: impl Words) -> Value {
    let fixed = format!("study {kind} room.json --backend cpu --evaluations 24 --random 20");
    ok(dir, &(fixed, more))
}

/// Values of one column, by the name of the row.
fn column(table: &Value, title: &str) -> Vec<(String, f64)> {
    let titles = table["columns"].list();
    let at = titles.iter().position(|t| t == title).unwrap_or_else(|| panic!("no {title}"));
    let rows = table["rows"].list().iter();
    rows.filter_map(|row| Some((row["name"].as_str()?.to_owned(), row["values"][at - 1].as_f64()?)))
        .collect()
}

/// Σ H of the corridor's two rows, in nats: car in 1 of 4 frames, car in 2 and pole in 1; pole in 2.
fn rows_of_the_corridor() -> [f64; 2] {
    let p = |n: f64| -(n / 4.0) * (n / 4.0).ln();
    [p(1.0) + p(3.0) + p(2.0) + p(1.0) + p(1.0), p(2.0) + p(2.0)]
}

/// The corridor with a mount that lets beams run along x only: a LiDAR sees row 0 or row 1, whole.
fn level_corridor(lidars: u32) -> TempDir {
    let dir = corridor();
    let mut scene = crate::cli::scene();
    scene["mount"]["lidars"] = lidars.into();
    for angle in ["roll", "pitch", "yaw"] {
        scene["mount"][angle] = json!([0, 0]);
    }
    write(&dir, "scene.json", &scene);
    dir
}

/// Nats, which can be summed up by hand.
const BY_GAIN: &str = "--objective information_gain";

/// A study of the corridor; every table and chart is whole.
fn of_corridor(dir: &TempDir, kind: &str, more: impl Words) -> Value {
    let args = format!("study {kind} scene.json --backend cpu --evaluations 24 --out {kind}");
    let table = ok(dir, &(args, more));
    let columns = table["columns"].list().len();
    let rows = table["rows"].list();
    for row in rows {
        assert_eq!(row["values"].list().len() + 1, columns, "{kind}: {row}");
    }
    let csv = fs::read_to_string(dir.path().join(kind).join("table.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + rows.len(), "{kind}");
    let svg = fs::read_to_string(dir.path().join(kind).join("chart.svg")).unwrap();
    assert!(svg.contains("<circle") && svg.ends_with("</svg>\n"), "{kind}");
    let saved = read_json(dir.path().join(kind).join("study.json"));
    assert_eq!(saved["settings"]["study"], kind);
    table
}

/// Whether the numbers of a column are these; fixed-point entropies leave eight digits.
fn assert_column(table: &Value, title: &str, want: &[f64]) {
    let found: Vec<f64> = column(table, title).into_iter().map(|(_, value)| value).collect();
    let close = |a: &f64, b: &f64| (a - b).abs() <= 1e-6 * b.abs().max(1e-3);
    let equal = found.len() == want.len() && found.iter().zip(want).all(|(a, b)| close(a, b));
    assert!(equal, "{title}: {found:?} is not {want:?}");
}

#[test]
fn a_second_lidar_gains_the_second_row_and_no_further_one_gains_anything() {
    let dir = level_corridor(1);
    let [first, second] = rows_of_the_corridor();
    let all = first + second;
    let table = of_corridor(&dir, "lidars", "");
    let mut gains = vec![100.0; 8];
    gains[0] = 100.0 * first / all;
    assert_column(&table, "gain %", &gains);
    let mut marginal = vec![0.0; 8];
    (marginal[0], marginal[1]) = (gains[0], 100.0 - gains[0]);
    assert_column(&table, "marginal gain %", &marginal);
    let near = column(&table, "near gain %");
    let more = column(&table, "marginal near gain %");
    assert!(
        (near[0].1 - more[0].1).abs() < 1e-9 && (near[1].1 - near[0].1 - more[1].1).abs() < 1e-9
    );
    // The figure shows what the searches made large.
    read_text(&dir, "lidars/chart.svg").says(">near gain %<");
    let mut covered = vec![20.0; 8];
    covered[0] = 10.0;
    assert_column(&table, "covered", &covered);
    assert!(table["notes"][1].text().contains("bends most at 2 LiDARs"), "{table}");
}

#[test]
fn sensors_and_heights_that_see_the_same_row_gain_the_same() {
    let dir = level_corridor(1);
    let [first, second] = rows_of_the_corridor();
    let share = 100.0 * first / (first + second);
    // The upper channel leaves the region within the first voxels.
    write(&dir, "two.json", "{ \"elevation_deg\": [0, 45] }");
    let table = of_corridor(&dir, "channels", "--sensor two.json");
    assert_column(&table, "beams a LiDAR", &[16.0, 32.0, 64.0, 128.0, 2.0]);
    assert_column(&table, "gain %", &[share; 5]);
    assert_column(&table, "M-SOG/N ×1e-6", &[-1e6 * first / 100.0; 5]);
    let table = of_corridor(&dir, "height", "");
    assert_column(&table, "gain %", &[share; 5]);
    // The figure shows what the searches made large.
    let y_title = |svg: &str| svg.contains(">near gain %<");
    let svg = |kind: &str| fs::read_to_string(dir.path().join(kind).join("chart.svg")).unwrap();
    assert!(y_title(&svg("height")) && y_title(&svg("channels")));
    fs::remove_dir_all(dir.path().join("height")).unwrap();
    of_corridor(&dir, "height", BY_GAIN);
    assert!(!y_title(&svg("height")) && svg("height").contains(">gain %<"));
    // Without ground and within 10 m all information counts alike.
    assert_column(&table, "near gain %", &[share; 5]);
    assert_eq!(column(&table, "gain %")[1].0, "0.37 m");
    for (k, row) in table["rows"].list().iter().take(4).enumerate() {
        let z = row["placement"]["lidars"][0]["z"].number();
        assert!((z - (0.1 + 0.8 * k as f64 / 3.0)).abs() < 1e-9, "{z} in case {k}");
    }
}

#[test]
fn tasks_and_regions_share_the_information_of_the_row_that_is_seen() {
    let dir = level_corridor(1);
    let [first, second] = rows_of_the_corridor();
    let share = 100.0 * first / (first + second);
    // With two classes, car against all others is the same as every class for itself.
    let table = of_corridor(&dir, "tasks", "");
    assert_column(&table, "segmentation gain %", &[share; 5]);
    assert_column(&table, "detection gain %", &[share; 5]);
    let table = of_corridor(&dir, "regions", "--box seen:2,0,0,3,1,1 --box unseen:3,1,0,4,2,1");
    let optimized = |title: &str| {
        column(&table, title).into_iter().find(|(name, _)| name == "optimized").map(|found| found.1)
    };
    for (title, want) in [
        ("near %", Some(share)),
        ("front %", Some(share)),
        ("far %", None),
        ("rear %", None),
        ("seen %", Some(100.0)),
        ("unseen %", Some(0.0)),
        // The car's three voxels, and one of the pole's two.
        ("car %", Some(100.0)),
        ("pole %", Some(50.0)),
    ] {
        match (optimized(title), want) {
            (Some(found), Some(want)) => assert!((found - want).abs() < 1e-4, "{title}: {found}"),
            (found, want) => assert_eq!(found, want, "{title}"),
        }
    }
    // The layouts of Table 7 stand above the mount.
    assert_eq!(column(&table, "near %")[0].0, "optimized");
}

#[test]
fn random_placements_see_either_row_and_the_optimized_one_the_better() {
    let dir = level_corridor(1);
    let [first, second] = rows_of_the_corridor();
    let table = of_corridor(&dir, "random", ("--random 9", BY_GAIN));
    // Equal draws, and the row of each.
    let mount = read_json(dir.path().join("scene.json"));
    assert_eq!((&mount["mount"]["min"][1], &mount["mount"]["max"][1]), (&json!(0.1), &json!(1.9)));
    let constraints =
        Constraints::in_box([0.1, 0.1, 0.1, 0.0, 0.0, 0.0], [0.9, 1.9, 0.9, 0.0, 0.0, 0.0], 1);
    let mut values: Vec<f64> = random_placements(&constraints, 9, 1)
        .iter()
        .map(|placement| if placement.lidars[0].y < 1.0 { first } else { second })
        .collect();
    values.sort_by(f64::total_cmp);
    assert!(values[0] < values[8], "both rows are drawn");
    let quantiles = [0, 2, 4, 6, 8].map(|rank| values[rank]);
    assert_column(&table, "information_gain", &[&quantiles[..], &[first]].concat());
}

#[test]
fn the_worst_loss_of_two_lidars_is_the_better_row_or_none() {
    let dir = level_corridor(2);
    let [first, second] = rows_of_the_corridor();
    let table = of_corridor(&dir, "loss", BY_GAIN);
    // A LiDAR a row gains all and may lose the better row; both in the better row lose nothing.
    assert_column(&table, "all LiDARs", &[first + second, first]);
    assert_column(&table, "after the worst loss", &[second, first]);
    let without = [column(&table, "without LiDAR 0"), column(&table, "without LiDAR 1")];
    let sum = without[0][0].1 + without[1][0].1;
    assert!((sum - first - second).abs() < 1e-6, "{without:?}");
    assert_eq!(without[0][1].1, without[1][1].1);
}

#[test]
fn a_placement_carried_to_another_scene_sees_its_own_row_there() {
    let dir = level_corridor(1);
    let mut other = crate::cli::scene();
    for angle in ["roll", "pitch", "yaw"] {
        other["mount"][angle] = json!([0, 0]);
    }
    other["name"] = "other".into();
    other["psog"]["file"] = "other.psog.npz".into();
    write(&dir, "other.json", &other);
    // Row 0: car in 1 of 4 frames. Row 1: car in 2, pole in 1.
    let roi = Roi::new([0.0; 3], [1.0; 3], [10, 2, 1]).unwrap();
    let classes = vec!["car".to_owned(), "pole".to_owned()];
    let psog = Psog::new(roi, 4, classes, vec![4, 5, 7], vec![1, 0, 2, 0, 0, 1]).unwrap();
    write_psog(std::fs::File::create(dir.path().join("other.psog.npz")).unwrap(), &psog).unwrap();
    let p = |n: f64| -(n / 4.0) * (n / 4.0).ln();
    let quarter = p(1.0) + p(3.0);
    let (worse, better) = (quarter, p(2.0) + p(2.0) + quarter);
    let [first, second] = rows_of_the_corridor();
    let table = of_corridor(&dir, "transfer", ("other.json", BY_GAIN));
    assert_column(&table, "corridor", &[first, second]);
    assert_column(&table, "other", &[worse, better]);
    let notes = table["notes"].to_string();
    let lost = 100.0 * (worse - better) / better;
    notes.says(&format!("from corridor to other: {lost:.2} %"));
}

/// Scores of the layouts of Table 7 in the room with other voxels, as `score` prints them.
fn scores_in_room(dir: &Path, voxel: [f64; 3]) -> Vec<Value> {
    change_as(dir, ["room.json", "other.json"], |scene| scene["roi"]["voxel"] = json!(voxel));
    let placements = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/placements.json");
    let placements = placements.to_str().unwrap();
    let args = ["score", "other.json", placements, "--backend", "cpu"];
    ok(dir, &args)["scores"].list().clone()
}

#[test]
fn voxels_and_published_results_are_ranked_by_the_scores_that_score_prints() {
    let dir = in_room();
    let layouts = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/placements.json");
    let more = [layouts.to_str().unwrap(), "--out", "voxels", "--frames", "3"];
    let table = study(dir.path(), "voxels", more);
    for (row, voxel) in [(0, [0.2; 3]), (1, [0.1, 0.15, 0.2])] {
        let scores = scores_in_room(dir.path(), voxel);
        assert_eq!(scores.len(), 11);
        for (k, scores) in scores.iter().enumerate() {
            let want = 1e6 * scores["m_sog_scaled"].number();
            let found = table["rows"][row]["values"][k].number();
            assert!((found - want).abs() <= 1e-8 * want.abs(), "{voxel:?}, {k}: {found}, {want}");
        }
    }
    // Sensors of another vehicle are not those behind the published results.
    let car = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/vehicles/car.json");
    let car = ["study", "published", "room.json", "--vehicle", car.to_str().unwrap()];
    fails(&dir, &car).says("room.json: `study published` compares");
    let table = study(dir.path(), "published", "--out published --frames 3 --voxel 0.2");
    // Mean mIoU of Table 7, in the order of the paper's table; `Ours-seg` is ours there.
    let published = [
        ("Center", 69.1),
        ("Line", 63.9),
        ("Pyramid", 66.6),
        ("Square", 65.8),
        ("Trapezoid", 63.8),
        ("Line-roll", 64.0),
        ("Pyramid-roll", 67.6),
        ("Ours-seg", 71.1),
    ];
    let scores = scores_in_room(dir.path(), [0.2; 3]);
    let results: Vec<f64> = published.iter().map(|p| p.1).collect();
    for metric in ["m_sog", "m_sog_scaled", "information_gain", "s_mig"] {
        let of = |name: &str| scores.iter().find(|s| s["name"] == name).unwrap()[metric].as_f64();
        let ours: Vec<f64> = published.iter().map(|p| of(p.0).unwrap()).collect();
        let found = column(&table, "mIoU").into_iter().find(|row| row.0 == metric).unwrap().1;
        let want = pearson(&ranks(&ours), &ranks(&results));
        assert!((found - want).abs() < 1e-9, "{metric}: {found} is not {want}");
    }
}

/// Rank of each value from 0; equal values share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = |value: &f64| {
        let at: Vec<usize> = (0..sorted.len()).filter(|&k| sorted[k] == *value).collect();
        at.iter().sum::<usize>() as f64 / at.len() as f64
    };
    values.iter().map(rank).collect()
}

/// Pearson's correlation.
fn pearson(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum =
        |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(x, y)| f(x - ma, y - mb)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

#[test]
fn more_lidars_in_a_room_never_gain_less_and_a_loss_never_gains() {
    let dir = in_room();
    let table = study(dir.path(), "lidars", "--out lidars");
    let gains: Vec<f64> = column(&table, "gain %").into_iter().map(|gain| gain.1).collect();
    assert_eq!(gains.len(), 8);
    // Once all is seen a LiDAR more sees nothing new: guards then come before the gain.
    let all = gains.iter().position(|&gain| gain > 99.99).unwrap();
    let guards: Vec<f64> = column(&table, "guards violated").into_iter().map(|g| g.1).collect();
    assert!(guards[..=all].iter().all(|&guards| guards == 0.0), "{guards:?}");
    assert!(gains[..=all].is_sorted() && gains[all] > gains[0] + 1.0, "{gains:?}");
    let loss = study(dir.path(), "loss", "--out loss");
    let [whole, worst] = ["all LiDARs %", "after the worst loss %"].map(|c| column(&loss, c));
    assert!(worst[1].1 >= worst[0].1, "{worst:?}");
    assert!(worst.iter().zip(&whole).all(|(w, a)| w.1 < a.1), "a loss gains nothing");
}

#[test]
fn a_study_that_is_done_is_not_made_again_and_another_one_is_refused() {
    let dir = in_room();
    let first = study(dir.path(), "height", "--out s");
    let before = fs::read(dir.path().join("s/checkpoint.json")).unwrap();
    assert_eq!(study(dir.path(), "height", "--out s"), first);
    assert_eq!(fs::read(dir.path().join("s/checkpoint.json")).unwrap(), before);
    fails(&dir, "study height room.json --backend cpu --out s --seed 9").says("other settings");
    let moved = read_text(&dir, "room.json");
    write(&dir, "room.json", &moved.replace("[3.9,", "[3.2,"));
    let same = "study height room.json --backend cpu --evaluations 24 --random 20 --out s";
    fails(&dir, same).says("room.json: has changed;");
}

#[test]
fn wrong_input_is_named() {
    let dir = in_room();
    for (args, says) in [
        ("study transfer room.json", "two or more scene files"),
        ("study regions room.json --box a:1,2,3", "NAME:x0,y0,z0,x1,y1,z1"),
        ("study channels room.json --sensor none.json", "none.json"),
        ("study lidars room.json --objective near_gan", "did you mean"),
    ] {
        fails(&dir, args).says(says);
    }
}

#[test]
fn cases_of_one_name_would_share_numbers_and_are_refused() {
    let dir = in_room();
    fs::copy(dir.path().join("room.json"), dir.path().join("copy.json")).unwrap();
    for folder in ["a", "b"] {
        fs::create_dir(dir.path().join(folder)).unwrap();
        let sensor = format!("{{ \"elevation_deg\": [0, {}] }}", folder.len());
        fs::write(dir.path().join(folder).join("vlp.json"), sensor).unwrap();
    }
    for (args, says) in [
        ("transfer room.json copy.json", "two scenes are called `room`"),
        (
            "channels room.json --sensor a/vlp.json --sensor b/vlp.json",
            "two sensors are called `vlp`",
        ),
        (
            "regions room.json --box near:0,0,0,1,1,1",
            "`near` is a built-in region; choose another name",
        ),
    ] {
        fails(&dir, &format!("study {args} --backend cpu")).says(says);
    }
    assert!(!dir.path().join("studies").exists());
}

#[test]
fn the_study_of_channels_has_the_near_field_of_each_best_placement() {
    let dir = TempDir::new().unwrap();
    let lidar = json!({ "channels": 16, "fov": [-30, 5], "azimuth_steps": 60, "range": 60 });
    let mount = json!({ "min": [-1.0, -0.5, 1.8], "max": [1.0, 0.5, 2.2], "lidars": 1 });
    let mut scene = level_yard(lidar, mount);
    scene["roi"]["voxel"] = json!([0.8, 0.8, 0.8]);
    write(&dir, "scene.json", &scene);
    let table = of_corridor(&dir, "channels", "");
    let near = column(&table, "near %");
    assert_eq!(near.len(), 7);
    assert!(near[0].1 < near[3].1, "more channels see more ground: {near:?}");
    // The scene's own sensor, looked at by the study that does nothing else.
    let best = table["rows"][0]["placement"].clone();
    write(&dir, "best.json", &json!({ "placements": [best] }));
    let looked = "study nearfield scene.json best.json --frames 2 --backend cpu";
    let looked = ok(&dir, &looked);
    let field = |key: &str| 100.0 * looked["near_fields"][0][key].number();
    assert!((near[0].1 - field("near_field")).abs() < 1e-9, "{looked}");
    assert!((column(&table, "3 m %")[0].1 - field("ring")).abs() < 1e-9, "{looked}");
}
