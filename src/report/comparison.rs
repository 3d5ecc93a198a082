//! Two rigs compared, as text and as CSV.

use super::columns::table_text;
use super::svg::trimmed;
use super::tables::{header, titles};
use crate::csv::{csv, number};
use crate::json::fixed;
use crate::rig::{Asymmetry, Comparison, MovedLidar};
use sightline_files::json::counted;

/// How far each LiDAR moved, whether its model is another, and how far each pair of either rig is from a mirror image.
pub(crate) fn comparison_text(found: &Comparison) -> String {
    let row = |name: String, values: [f64; 3]| {
        std::iter::once(name).chain(values.map(|value| fixed(value, 5))).collect()
    };
    let name = |lidar: &MovedLidar| match lidar.frame == lidar.partner {
        true => lidar.frame.clone(),
        false => format!("{}, now {}", lidar.frame, lidar.partner),
    };
    let moved = found.lidars.iter().map(|l| row(name(l), [l.moved, l.turned, l.tilted]));
    let mut text = alone_text(found);
    text += &table_text(&["LiDAR", "moved m", "turned rad", "axis rad"], moved);
    for lidar in &found.lidars {
        text += &models_text(&lidar.frame, &lidar.models, ["before", "after"]);
    }
    let (both, each) =
        (found.lidars.len(), [0, 1].map(|k| found.lidars.len() + found.alone[k].len()));
    let of = match each {
        [first, second] if first == second => counted(both, "LiDAR"),
        [first, second] => format!("the {both} with a partner; {first} and {second} LiDARs in all"),
    };
    text += &format!("different in pose or model: {} of {of}\n", found.different);
    if let Some([x, y, z]) = found.shift.map(|shift| shift.map(|metres| trimmed(metres, 4))) {
        text += &format!("all moved by ({x}, {y}, {z}) m: another base frame? give --base-link\n");
    }
    for (title, all) in [("before: pair", &found.before), ("after: pair", &found.after)] {
        let rows = all.iter().map(|pair| row(named(pair), [pair.moved, pair.turned, pair.tilted]));
        let titles = [title, "off mirror m", "turned rad", "axis rad"];
        text += &format!("\n{}", table_text(&titles, rows));
        for pair in all.iter().filter(|pair| pair.same_roll) {
            text += &format!(
                "  ! {}: both have the same roll; in a mirror image roll changes its sign\n",
                named(pair)
            );
        }
        for pair in all {
            text += &models_text(&named(pair), &pair.models, ["left", "right"]);
        }
    }
    text
}

/// First lines on rigs of different numbers of LiDARs; empty for rigs of the same number.
fn alone_text(found: &Comparison) -> String {
    let (rest, lacks) = match &found.alone {
        [first, second] if first.is_empty() => (second, "first"),
        [first, _] => (first, "second"),
    };
    if rest.is_empty() {
        return String::new();
    }
    let [first, second] = [0, 1].map(|k| found.lidars.len() + found.alone[k].len());
    format!(
        "The first rig has {}, the second {second}: compared by frame, then by least distance.\n\
         Without a partner in the {lacks} rig: {}.\n\n",
        counted(first, "LiDAR"),
        rest.join(", ")
    )
}

/// A row for each LiDAR with its move from one rig to the other, then for each LiDAR without a partner, then for each
/// pair of either rig with its distance from a mirror image.
///
/// Distances are metres, and radians between the rotations and between the sensors' own z axes.
pub(crate) fn comparison_csv(found: &Comparison) -> String {
    let mut rows =
        vec![header("part,lidar,other,moved_m,turned_rad,tilted_rad,same_roll,model,other_model")];
    let width = rows[0].len();
    let model = |name: &Option<String>| name.clone().unwrap_or_default();
    rows.extend(found.lidars.iter().map(|of| {
        let mut row = titles(&["moved", &of.frame, &of.partner]);
        row.extend([of.moved, of.turned, of.tilted].map(number));
        row.push(String::new());
        row.extend(of.models.iter().map(model));
        row
    }));
    for (part, alone) in ["alone_before", "alone_after"].into_iter().zip(&found.alone) {
        rows.extend(alone.iter().map(|frame| {
            let mut row = titles(&[part, frame]);
            row.resize(width, String::new());
            row
        }));
    }
    for (part, pairs) in [("before", &found.before), ("after", &found.after)] {
        rows.extend(pairs.iter().map(|pair| {
            let mut row = titles(&[part, &pair.left, &pair.right]);
            row.extend([pair.moved, pair.turned, pair.tilted].map(number));
            row.push(pair.same_roll.to_string());
            row.extend(pair.models.iter().map(model));
            row
        }));
    }
    csv(rows)
}

/// A line on two LiDARs of different models; empty where a model is not known.
fn models_text(name: &str, models: &[Option<String>; 2], [one, other]: [&str; 2]) -> String {
    match models {
        [Some(a), Some(b)] if a != b => {
            format!("  ! {name}: the model is {a} {one} and {b} {other}\n")
        }
        _ => String::new(),
    }
}

fn named(pair: &Asymmetry) -> String {
    if pair.left == pair.right {
        return format!("{} with itself", pair.left);
    }
    format!("{} with {}", pair.left, pair.right)
}
