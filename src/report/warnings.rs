//! Kinds of warnings of a placement, and the ones that it shares with another.

use crate::score::Guard;
use crate::search::Scored;

/// A kind of warning.
pub(super) struct WarningKind {
    /// Words for one placement.
    pub one: &'static str,
    /// Words for several.
    pub many: &'static str,
    /// True if it is a reason not to believe a score.
    pub is_doubt: bool,
    /// True for a placement that has it.
    pub is: fn(&Scored) -> bool,
}

impl WarningKind {
    const fn new(words: [&'static str; 2], is_doubt: bool, is: fn(&Scored) -> bool) -> Self {
        let [one, many] = words;
        Self { one, many, is_doubt, is }
    }
}

/// All kinds, reasons not to believe a score first.
pub(super) static KINDS: [WarningKind; 6] = [
    WarningKind::new(["guard", "guards"], true, |of| of.scores.doubts() > 0),
    WarningKind::new(["broken rule", "broken rules"], true, |of| !of.violations.is_empty()),
    WarningKind::new(["requirement not met", "requirements that are not met"], false, |of| {
        of.scores.required.iter().any(|seen| !seen.is_met())
    }),
    WarningKind::new(["on paper only", "requirements that hold on paper only"], false, |of| {
        of.scores.holds_on_paper().is_some()
    }),
    WarningKind::new(["blind sector", "blind sectors"], false, |of| {
        of.scores.guards.iter().any(|guard| matches!(guard, Guard::BlindSector(_)))
    }),
    WarningKind::new(["LiDAR to leave out", "LiDARs that could be left out"], false, |of| {
        of.scores.guards.iter().any(|guard| guard.redundant_lidar().is_some())
    }),
];

/// Kinds of warnings of a rig, as `on paper only; blind sector, as here`: `as_here` stands behind one that another rig has,
/// too. Empty without a warning.
pub(super) fn kinds_beside(rig: &Scored, other: &Scored, as_here: &str) -> String {
    let own = KINDS.iter().filter(|kind| (kind.is)(rig));
    let words = own.map(|kind| match (kind.is)(other) {
        true => format!("{}, {as_here}", kind.one),
        false => kind.one.to_owned(),
    });
    words.collect::<Vec<_>>().join("; ")
}
