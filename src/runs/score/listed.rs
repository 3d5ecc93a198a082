//! Scores as JSON lists them, and what is said of placements that nobody looked at closely.

use serde::Serialize;

use crate::near_field::FEW_PLACEMENTS;
use crate::score::Scores;

/// Sentence on placements that are too many to be looked at closely, the first of which has these scores; `None` where
/// there would be nothing to look at. `ends_at_hits`: beams end at surfaces in a scene.
pub(super) fn not_looked_closely(ends_at_hits: bool, first: Option<&Scores>) -> Option<String> {
    let things = match (ends_at_hits, first.is_some_and(|first| !first.required.is_empty())) {
        (true, true) => {
            "range cards, blind sectors, blind zones, `self_hit` and copies within the tolerance"
        }
        (true, false) => "range cards, blind sectors, blind zones and `self_hit`",
        (false, true) => "copies within the tolerance",
        (false, false) => return None,
    };
    Some(format!(
        "{things} are looked at for up to {FEW_PLACEMENTS} placements; here are more: score the best of them alone, as \
         PLACEMENTS:NAME"
    ))
}

/// Scores with keys of what nobody looked at, each `null`, and the price of the placement last, where a sensor has one.
#[derive(Serialize)]
pub(super) struct Listed<'a> {
    #[serde(flatten)]
    scores: &'a Scores,
    #[serde(skip_serializing_if = "Option::is_none")]
    range_card: Option<()>,
    #[serde(skip_serializing_if = "Option::is_none")]
    blind_zone: Option<()>,
    #[serde(skip_serializing_if = "Option::is_none")]
    requirements_hold_in: Option<()>,
    #[serde(skip_serializing_if = "Option::is_none")]
    price: Option<f64>,
}

/// Scores for JSON with their prices, which there are for all or for none. `ends_at_hits`: beams end at surfaces.
pub(super) fn listed<'a>(
    all: impl IntoIterator<Item = &'a Scores, IntoIter: 'a>,
    prices: &'a [f64],
    is_looked_at: bool,
    ends_at_hits: bool,
) -> impl Iterator<Item = Listed<'a>> + 'a {
    let null = move |is_missed: bool| (!is_looked_at && is_missed).then_some(());
    all.into_iter().enumerate().map(move |(k, scores): (usize, &'a Scores)| Listed {
        scores,
        range_card: null(ends_at_hits),
        blind_zone: null(ends_at_hits),
        requirements_hold_in: null(!scores.required.is_empty()),
        price: prices.get(k).copied(),
    })
}
