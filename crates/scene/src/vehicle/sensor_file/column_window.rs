//! The columns that an Ouster is set to look at.

use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check};

/// A turn in thousandths of a degree.
pub(super) const TURN: f64 = 360_000.0;

/// Columns that follow each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ColumnWindow {
    first: u32,
    /// How many, at most a turn.
    pub(super) count: u32,
}

impl ColumnWindow {
    /// First and last column, both valid; the window goes through column 0 where the first one is larger.
    pub(super) fn of_columns(at: &Location, [first, last]: [u64; 2], steps: u32) -> Checked<Self> {
        let most = u64::from(steps) - 1;
        let first = check::count(&at.item(0), first, 0, most)?;
        let last = check::count(&at.item(1), last, 0, most)?;
        Ok(Self { first, count: (last + steps - first) % steps + 1 })
    }

    /// Angles in thousandths of a degree, counter-clockwise in the frame of the columns: column m of W stands at
    /// 360·(1 − m/W) degrees. The file `2_5_0_os-992146000760-128.json` of ouster-sdk has both spellings of a window.
    pub(super) fn of_angles(at: &Location, angles: [f64; 2], steps: u32) -> Checked<Self> {
        for (i, angle) in angles.into_iter().enumerate() {
            if !(0.0..=TURN).contains(&angle) {
                return Err(bad(&at.item(i), angle, "thousandths of a degree from 0 to 360000"));
            }
        }
        let [from, to] = angles;
        let span = if from < to { to - from } else { to + TURN - from };
        if from % TURN == to % TURN {
            return Ok(Self { first: 0, count: steps });
        }
        let column = |angle: f64| f64::from(steps) * (1.0 - angle / TURN);
        // A millionth of a column keeps columns at the very ends.
        let first = (column(to) - 1e-6).ceil();
        let last = (column(to) + f64::from(steps) * span / TURN + 1e-6).floor();
        if last < first {
            let wanted = format!("a window that holds a column; there are {steps} a turn");
            return Err(bad(at, format!("{angles:?}"), wanted));
        }
        let count = ((last - first) as u32 + 1).min(steps);
        Ok(Self { first: first as u32 % steps, count })
    }

    /// True if two windows differ by no more than a column at either end.
    pub(super) fn is_near(&self, other: &Self, steps: u32) -> bool {
        let ahead = |a: u32, b: u32| (a + steps - b) % steps;
        let apart = |a: u32, b: u32| ahead(a, b).min(ahead(b, a));
        let end = |window: &Self| (window.first + window.count) % steps;
        let whole = |window: &Self| window.count + 1 >= steps;
        whole(self) && whole(other)
            || apart(self.first, other.first) <= 1 && apart(end(self), end(other)) <= 1
    }

    /// Azimuths of the last and of the first column in the sensor's frame: columns count clockwise.
    pub(super) fn azimuths(&self, steps: u32) -> [f64; 2] {
        let step = 360.0 / f64::from(steps);
        let last = (self.first + self.count - 1) % steps;
        // Column 0 looks to the back.
        let from = 180.0 - f64::from(last) * step;
        let span = f64::from(self.count - 1) * step;
        if from + span > 360.0 { [from - 360.0, from - 360.0 + span] } else { [from, from + span] }
    }
}
