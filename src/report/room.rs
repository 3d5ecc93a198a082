//! How far pose fields may be off, and the body may tilt, until a requirement breaks, as text.

use super::text::align_columns;
use crate::job::{Room, RoomOfSide, RoomOfTilt};
use crate::json::fixed;

/// A deviation with what breaks behind it.
fn cells(side: &RoomOfSide) -> [String; 2] {
    let more = if side.breaks_at.is_some() { "" } else { "≥ " };
    [format!("{more}{}", fixed(side.holds_to, 1)), side.breaks.clone().unwrap_or_default()]
}

/// A sentence on the direction of tilt that holds least, and a table of all.
fn tilt_text(tilt: &RoomOfTilt) -> String {
    let [x, y] = tilt.about;
    let least = &tilt.least;
    let degrees = fixed(least.side.holds_to, 2);
    let end = match &least.side.breaks {
        Some(breaks) => format!("{degrees}°, then {breaks} breaks ({})", least.direction),
        None => format!("{degrees}° and more in every direction"),
    };
    let mut rows = vec![["tilt, deg", "holds to", "then breaks"].map(str::to_owned).to_vec()];
    for of in &tilt.directions {
        let more = if of.side.breaks_at.is_some() { "" } else { "≥ " };
        let holds = format!("{more}{}", fixed(of.side.holds_to, 2));
        let breaks = of.side.breaks.clone().unwrap_or_default();
        rows.push(vec![of.direction.to_owned(), holds, breaks]);
    }
    let about = format!("all LiDARs tilted about the ground at x = {x} m, y = {y} m hold to ");
    format!("{}{about}{end}\n", align_columns(&rows))
}

/// Tables of a placement: how far each field holds to either side and what breaks first; the same for the tilt of the
/// body; then copies within tolerances.
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
        text += &room.tilt.as_ref().map(tilt_text).unwrap_or_default();
        for copies in &room.copies {
            let share = 100.0 * copies.holds_in;
            let line = "all LiDARs off at random within";
            text += &format!("{line} {}: {share:.0} % of copies meet all\n", copies.tolerance);
        }
        text
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}
