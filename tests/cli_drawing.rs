//! The drawing of `rig handover`: its views, and words that lie apart.

use crate::cli::*;
use crate::cli_handover::{folder, handed_over, read, texts_apart};

#[test]
fn the_drawing_has_three_views_at_one_scale_with_every_lidar() {
    let dir = folder();
    let out = handed_over(&dir, "");
    let svg = read(&out, "drawing.svg");
    for words in ["From above", "From the right", "From the front", "4000", "1800", "1750", "front"]
    {
        assert!(svg.contains(&format!(">{words}</text>")), "{words}");
    }
    // The number of each LiDAR stands once in each view and once in the table; from the right 1 and 2, a mirrored pair,
    // lie behind one another and are one sign.
    let labels = |words: &str| svg.matches(&format!("font-weight=\"bold\">{words}</text>")).count();
    assert_eq!(["0", "1", "2", "1, 2"].map(labels), [4, 3, 3, 1]);
    // The datum has its two axes in each view.
    assert_eq!(["x", "y", "z"].map(labels), [2, 2, 2]);
    for words in ["mm from the datum", "Positive yaw turns left", "±5 mm", "drawn by sightline"] {
        assert!(svg.contains(words), "{words}");
    }
    assert!(svg.contains("requirements were not looked at: "), "its area lies beyond level ground");
    let pdf = fs::read(out.path().join("out/drawing.pdf")).unwrap();
    assert!(pdf.starts_with(b"%PDF-1.4\n") && pdf.ends_with(b"%%EOF\n"));
}

#[test]
fn the_name_of_the_arrow_to_the_front_ends_before_the_legend() {
    let dir = folder();
    // One LiDAR high above the middle sees the ground all round: nothing but the arrow reaches ahead of the body.
    change(&dir, "cart.json", |cart| {
        cart["sensors"][0]["lidar"]["channels"] = json!(64);
        cart["sensors"][0]["lidar"]["fov"] = json!([-80, 10]);
    });
    let high = json!({ "x": -0.5, "y": 0, "z": 4.5, "sensor": "turning" });
    write_rig(&dir, "p.json", "rig", [high]);
    let svg = read(&handed_over(&dir, ""), "drawing.svg");
    let left_of = |words: &str| -> (f64, f64) {
        let before = svg.split(&format!(">{words}</text>")).next().unwrap();
        let element = before.rsplit_once("<text").unwrap().1;
        let [x, size] = [" x", " font-size"].map(|key| {
            let value = element.split_once(&format!("{key}=\"")).unwrap().1;
            value.split_once('"').unwrap().0.parse().unwrap()
        });
        (x, size)
    };
    let ((front, size), (legend, _)) =
        (left_of("front"), left_of("Optical centres, mm from the datum:"));
    // A letter is at most 0.6 sizes wide.
    assert!(front + 5.0 * 0.6 * size < legend, "{front} {size} {legend}");
}

#[test]
fn names_and_numbers_of_mounts_within_a_hand_lie_apart_with_lines_to_them() {
    let dir = folder();
    let lines = |svg: &str| svg.matches("stroke-width=\"0.12\"").count();
    // Two lines a cross, at the place of a number that stands aside.
    let crosses = |svg: &str| svg.matches("stroke-width=\"0.95\"").count() / 2;
    let far = read(&handed_over(&dir, ""), "drawing.svg");
    assert_eq!((lines(&far), crosses(&far)), (0, 0));
    let corners = [("low-left", 1.95, 0.85), ("low-right", 1.95, 0.9), ("upper-left", 2.0, 0.85)];
    let corners = [corners[0], corners[1], corners[2], ("upper-right", 2.0, 0.9)];
    let mounts = corners.map(|(name, x, y)| {
        json!({ "name": name, "sensors": ["side, narrow"], "count": [0, 1], "min": [x, y, 0.7],
                "max": [x + 0.04, y + 0.04, 0.8], "yaw": [-3.2, 3.2] })
    });
    change(&dir, "cart.json", |vehicle| vehicle["mounts"] = json!(mounts));
    let lidars = corners.map(|(_, x, y)| {
        json!({ "x": x + 0.02, "y": y + 0.02, "z": 0.75, "yaw": 1.0, "sensor": "side, narrow" })
    });
    write_rig(&dir, "p.json", "rig", lidars);
    let svg = read(&handed_over(&dir, ""), "drawing.svg");
    // Before the title of the next view there is only the one from above.
    let from_above = svg.split(">From the right<").next().unwrap().rsplit_once("<text").unwrap().0;
    let all = texts_apart(from_above, 0.56, [0.8, 0.25]);
    for name in corners.map(|(name, ..)| name).iter().chain(&["0", "1", "2", "3"]) {
        assert!(all.iter().any(|words| words == name), "{name}: {all:?}");
    }
    // The signs of the four LiDARs lie on the four boxes, so that each name is moved and has a line.
    assert_eq!(lines(&svg), 4, "{from_above}");
    assert!(crosses(&svg) > 0, "{svg}");
}
