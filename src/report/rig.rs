//! Two rigs compared, as text.

use super::text::align_columns;
use crate::json::fixed;
use crate::rig::{Asymmetry, Comparison};

/// How far each LiDAR moved, and how far each pair of either rig is from a mirror image.
pub fn comparison_text(found: &Comparison) -> String {
    let numbers = |values: [f64; 3]| values.map(|value| fixed(value, 5));
    let table = |titles: [&str; 4], rows: &mut dyn Iterator<Item = (String, [f64; 3])>| {
        let mut all = vec![titles.map(str::to_owned).to_vec()];
        all.extend(rows.map(|(name, values)| [vec![name], numbers(values).to_vec()].concat()));
        align_columns(&all)
    };
    let moved = found.lidars.iter().map(|l| (l.frame.clone(), [l.moved, l.turned, l.tilted]));
    let mut text = table(["LiDAR", "moved m", "turned rad", "axis rad"], &mut moved.into_iter());
    for (title, all) in [("before: pair", &found.before), ("after: pair", &found.after)] {
        let mut rows = all.iter().map(|pair| (named(pair), [pair.moved, pair.turned, pair.tilted]));
        text +=
            &format!("\n{}", table([title, "off mirror m", "turned rad", "axis rad"], &mut rows));
        for pair in all.iter().filter(|pair| pair.same_roll) {
            text += &format!(
                "  ! {}: both have the same roll; in a mirror image roll changes its sign\n",
                named(pair)
            );
        }
    }
    text
}

fn named(pair: &Asymmetry) -> String {
    if pair.left == pair.right {
        return format!("{} with itself", pair.left);
    }
    format!("{} with {}", pair.left, pair.right)
}
