//! Random placements against hand-made ones and an optimized one.

use super::cases::Cases;
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::score::Scores;
use crate::vehicle::{Placement, random_placements_by_the_rules};

/// Name of the case in which all random placements are scored: its values are the best, the worst, the
/// lower quartile, the median and the upper quartile.
const RANDOM: &str = "random, best";

pub(super) fn random(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let settings = scene.settings;
    let count = settings.random as usize;
    let drawn = random_placements_by_the_rules(&scene.rig()?.constraints, count, settings.seed);
    cases.expect(2 + scene.layouts.len());
    let mut evaluator = scene.evaluator_of_rig()?;
    let value = |scores: &Scores| unguarded(scene, scores);
    let case = cases.one(RANDOM, || {
        let scores = scene.scores(&mut evaluator, &drawn)?;
        let values: Vec<Option<f64>> = scores.iter().map(value).collect();
        let (best, quantiles) = quantiles(&values);
        let mut row = Row::of(quantiles);
        if let Some(best) = best {
            row = Row::scored(row.values, drawn[best].clone(), &scores[best]);
        }
        Ok(row)
    })?;
    let mut rows = case.map_or_else(Vec::new, |row| rows_of(&row));
    for placement in &scene.layouts {
        rows.extend(cases.one(&placement.name, || {
            let scores = scene.score(&mut evaluator, placement)?;
            Ok(row_of(value(&scores), placement.clone(), &scores))
        })?);
    }
    rows.extend(cases.one("optimized", || {
        let Some(best) = scene.optimize(&evaluator)? else { return Ok(scene.none_found()) };
        let scores = scene.score(&mut evaluator, &best)?;
        Ok(row_of(value(&scores), best, &scores))
    })?);
    let notes = vec![format!(
        "{} random placements, uniform in every pose field that may vary; those that violate a guard do \
         not count. The optimized one had {} evaluations and swaps.",
        drawn.len(),
        settings.evaluations
    )];
    let title = scene.title("random, hand-made and optimized placements");
    let objective = settings.objective.to_string();
    let drawing = TablePlot::of_column(0, &objective, false);
    Ok(Table::new(title, ["placement", &objective], rows, notes, drawing))
}

/// The row of one placement; without a value it says which warning counts it out.
fn row_of(value: Option<f64>, placement: Placement, scores: &Scores) -> Row {
    let warning = scores.guards.first().filter(|_| value.is_none());
    let no_answer = warning.map(|guard| format!("does not count, warning: {guard}"));
    Row { no_answer, ..Row::scored(vec![value], placement, scores) }
}

/// The objective of a placement that violates no guard.
fn unguarded(scene: &StudyScene, scores: &Scores) -> Option<f64> {
    scene.settings.objective.value(scores).filter(|_| scores.guards.is_empty())
}

/// Index of the best, and best, worst, lower quartile, median and upper quartile of the values there are;
/// a quartile is the nearest value in rank.
fn quantiles(values: &[Option<f64>]) -> (Option<usize>, Vec<Option<f64>>) {
    let known = values.iter().enumerate().filter_map(|(k, value)| Some((k, (*value)?)));
    let best = known.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    let mut sorted: Vec<f64> = values.iter().copied().flatten().collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * (sorted.len().max(1) - 1) as f64).round() as usize;
        sorted.get(index).copied()
    };
    let values = vec![best.map(|b| b.1), at(0.0), at(0.25), at(0.5), at(0.75)];
    (best.map(|b| b.0), values)
}

/// A row for each quantile, from the worst to the best; none where no random placement counts.
fn rows_of(random: &Row) -> Vec<Row> {
    let [Some(best), Some(worst), Some(low), Some(median), Some(high)] = random.values[..] else {
        return Vec::new();
    };
    let named = [
        ("random, worst", worst),
        ("random, lower quartile", low),
        ("random, median", median),
        ("random, upper quartile", high),
        (RANDOM, best),
    ];
    let row = |(name, value): (&str, f64)| {
        let of = if name == RANDOM { random.clone() } else { Row::default() };
        Row { name: name.to_owned(), values: vec![Some(value)], ..of }
    };
    named.map(row).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_values_there_are() {
        let values = [Some(4.0), None, Some(1.0), Some(3.0), Some(5.0), Some(2.0), Some(5.0)];
        // Sorted 1 2 3 4 5 5: ranks 1.25, 2.5 and 3.75 of 0 to 5, rounded to 1, 3 and 4.
        let want = [5.0, 1.0, 2.0, 4.0, 5.0].map(Some).to_vec();
        assert_eq!(quantiles(&values), (Some(4), want));
        assert_eq!(quantiles(&[None]), (None, vec![None; 5]));
    }
}
