//! How far pose fields may be off until a requirement breaks, as text.

use super::text::align_columns;
use crate::job::{Room, RoomOfSide};
use crate::json::fixed;

/// A deviation with what breaks behind it.
fn cells(side: &RoomOfSide) -> [String; 2] {
    let more = if side.breaks_at.is_some() { "" } else { "≥ " };
    [format!("{more}{}", fixed(side.holds_to, 1)), side.breaks.clone().unwrap_or_default()]
}

/// A table a placement: how far each field holds to either side and what breaks first; then copies within tolerances.
pub fn room_text(all: &[Room]) -> String {
    let of = |room: &Room| {
        let mut text = format!("{}\n", room.placement);
        for missed in &room.missed {
            text += &format!("  ! {missed}\n");
        }
        if !room.missed.is_empty() {
            return text + "  a requirement is missed as it is: there is no room\n";
        }
        let titles =
            ["LiDAR", "field", "", "− holds to", "then breaks", "+ holds to", "then breaks"];
        let mut rows = vec![titles.map(str::to_owned).to_vec()];
        for row in &room.fields {
            let names = [row.lidar.to_string(), row.field.to_owned(), row.unit.to_owned()];
            rows.push([&names[..], &cells(&row.down), &cells(&row.up)].concat());
        }
        text += &align_columns(&rows);
        for copies in &room.copies {
            let share = 100.0 * copies.holds_in;
            let line = "all LiDARs off at random within";
            text += &format!("{line} {}: {share:.0} % of copies meet all\n", copies.tolerance);
        }
        text
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}
