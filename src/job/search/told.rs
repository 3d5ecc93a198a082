//! Notes on sensors that are chosen.

use crate::search::{Equipped, Event, Observer};
use crate::vehicle::Vehicle;

/// Notes a placement that replaces the sensors chosen, by its name.
pub(super) fn tell_given(name: Option<&str>, observer: &mut dyn Observer) {
    if let Some(name) = name {
        observer.on(&Event::Note(&format!(
            "{name} is better over few frames than the rig chosen: its sensors and poses are taken"
        )));
    }
}

/// Notes the chosen sensors, and how far they miss the requirements.
pub(super) fn tell_equipment(vehicle: &Vehicle, found: &Equipped, observer: &mut dyn Observer) {
    let words = format!("equipment: {}", found.words_with_price(vehicle));
    observer.on(&Event::Note(&words));
    if found.missing > 0.0 {
        observer.on(&Event::Note(&format!(
            "first estimate, over few frames: the sensors chosen miss the requirements by {} percentage points, summed; the \
             search tries to close the gap",
            points_in_words(found.missing)
        )));
    }
}

/// A missing share in percentage points, which is more than 0.
pub(super) fn points_in_words(missing: f64) -> String {
    let points = format!("{:.1}", 100.0 * missing);
    if points == "0.0" { "less than 0.1".to_owned() } else { points }
}
