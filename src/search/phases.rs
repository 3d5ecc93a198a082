//! Check of a result at draws of azimuth phases and weather that the search has not seen.

use serde::Serialize;

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::suite::{Member, SEARCHING, Suite};
use crate::score::Objective;
use crate::vehicle::Placement;

pub(super) const DRAWS: u64 = 8;
/// Two-sided 95 % of Student's distribution with [`DRAWS`] − 1 degrees of freedom.
const STUDENT: f64 = 2.365;

/// Objectives of a result and of the best baseline over several random draws.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseCheck {
    /// Objective of the result, by draw.
    pub ours: Vec<f64>,
    /// Objective of the best baseline, by draw; empty without one.
    pub theirs: Vec<f64>,
    /// The check in a sentence.
    pub words: String,
}

/// Mean, and half the width of its 95 % interval.
fn interval(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    [mean, STUDENT * (variance / count).sqrt()]
}

impl Suite {
    /// True if any sensor of a placement has a phase that differs from frame to frame.
    pub(crate) fn has_free_phase(&self) -> bool {
        let free = |member: &Member| {
            let slots = member.problem().constraints().slots.iter();
            slots.map(|slot| slot.sensor).any(|name| member.problem().sensors().is_free(name))
        };
        self.members().iter().any(free)
    }

    /// True if weather or faults decide by chance which beams return.
    pub(crate) fn has_weather(&self) -> bool {
        self.members().iter().any(|member| member.problem().air().is_some())
    }

    /// True if scores depend on a random draw, of phases or of returning beams.
    pub(super) fn is_left_to_chance(&self) -> bool {
        self.has_free_phase() || self.has_weather()
    }
}

/// Scores a result and a baseline at [`DRAWS`] draws after the one of the search; `None` once `go_on`, which is asked before
/// every few frames, says no.
pub(super) fn check(
    suite: &Suite,
    objective: &Objective,
    best: &Placement,
    baseline: Option<&Placement>,
    memory: u64,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Option<PhaseCheck>, SearchError> {
    let both: Vec<Placement> = std::iter::once(best).chain(baseline).cloned().collect();
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for draw in 1..=DRAWS {
        let drawn = suite.at_draw(SEARCHING + draw);
        let scores = Evaluator::suite_on_cpu(&drawn, memory).scores_while(&both, go_on)?;
        let Some(scores) = scores else { return Ok(None) };
        ours.extend(objective.value(&scores[0]));
        theirs.extend(scores.get(1).and_then(|scores| objective.value(scores)));
    }
    let drawn = match (suite.has_free_phase(), suite.has_weather()) {
        (_, false) => "azimuth phases",
        (false, true) => "beams that come back",
        (true, true) => "azimuth phases and of the beams that come back",
    };
    let words = words(drawn, objective, (&ours, &theirs), baseline);
    Ok(Some(PhaseCheck { ours, theirs, words }))
}

fn words(
    drawn: &str,
    objective: &Objective,
    (ours, theirs): (&[f64], &[f64]),
    baseline: Option<&Placement>,
) -> String {
    let [mean, reach] = interval(ours);
    let mut words = format!(
        "At {} other draws of the {drawn} the result has {}, within {} % of it for these draws (95 % interval of \
         the mean)",
        ours.len(),
        objective.spoken(mean),
        at_least_a_hundredth(100.0 * reach / mean.abs())
    );
    if let (Some(baseline), true) = (baseline, theirs.len() == ours.len()) {
        let more: Vec<f64> =
            ours.iter().zip(theirs).map(|(a, b)| 100.0 * (a - b) / b.abs()).collect();
        let [mean, reach] = interval(&more);
        words += &format!(
            ", {:+.2} % (interval {:+.2} to {:+.2}) against {}",
            mean,
            mean - reach,
            mean + reach,
            baseline.name
        );
    }
    words + "; another seed of the search may differ by more."
}

/// Per cent with two digits, 0.01 at least.
fn at_least_a_hundredth(per_cent: f64) -> String {
    if per_cent < 0.01 { "0.01".to_owned() } else { format!("{per_cent:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_students() {
        let [mean, reach] = interval(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        // By hand: variance 6, standard error √(6/8).
        assert!((mean - 4.5).abs() < 1e-12 && (reach - 2.365 * 0.75_f64.sqrt()).abs() < 1e-12);
        let baseline = Placement { name: "plain".into(), lidars: vec![] };
        let gain: Objective = "information_gain".parse().unwrap();
        let said = words("azimuth phases", &gain, (&[110.0; 8], &[100.0; 8]), Some(&baseline));
        assert!(said.contains("has 110, within 0.01 % of it"), "{said}");
        let share = words("azimuth phases", &Objective::default(), (&[0.5; 8], &[]), None);
        assert!(share.contains("has 50.00 %, within 0.01 % of it"), "{share}");
        assert!(said.contains("+10.00 % (interval +10.00 to +10.00) against plain;"), "{said}");
    }
}
