//! Results of searches and audits as rows for CSV, like those of `tables`.

use super::RunRecord;
use super::tables::{Cells, header, joined, score_rows, score_titles, titles};
use super::text::numbered;
use crate::audit::{Audit, Stability, TrialResult};
use crate::csv::{csv, number};
use crate::json::distinct;
use crate::score::{Scores, Seen};
use crate::search::Scored;

/// The result of a search, if there is one, then its baselines: the rows of `score --format csv`. In a single scene result
/// and best baseline have their near field over the few frames of the page.
pub(crate) fn run_csv(run: &RunRecord) -> String {
    let near = run.near_field.as_ref().filter(|_| run.scenes.is_empty());
    let rival = Scored::yardstick(&run.baselines);
    let all: Vec<&Scored> = run.best.iter().chain(&run.baselines).collect();
    let scores = |of: &&Scored| {
        let near = near.and_then(|near| match run.best.as_ref() {
            Some(best) if std::ptr::eq(best, *of) => Some(&near.near),
            _ => {
                near.rival.as_ref().filter(|_| rival.is_some_and(|rival| std::ptr::eq(rival, *of)))
            }
        });
        Scores {
            near_field: near.map(|near| near.near_field),
            near_ring: near.and_then(|near| near.ring),
            // The scores have a column for the rules.
            broken_rules: of.violations.clone(),
            ..of.scores.clone()
        }
    };
    let prices: Vec<f64> = all.iter().filter_map(|of| of.price).collect();
    let rows: Vec<Scores> = all.iter().map(scores).collect();
    let names = requirements_of(&rows);
    let titles = titles_with_requirements(&prices, &names);
    let rows = rows_with_requirements(&rows.iter().collect::<Vec<_>>(), &prices, &names);
    csv(std::iter::once(titles).chain(rows))
}

/// Names of the requirements of any of some placements, in the order in which they come.
pub(crate) fn requirements_of<'a>(all: impl IntoIterator<Item = &'a Scores>) -> Vec<&'a str> {
    distinct(all.into_iter().flat_map(|scores| &scores.required).map(|seen| &*seen.name))
}

/// Titles of [`rows_with_requirements`]: those of scores, with four for each requirement by its name before the price.
pub(crate) fn titles_with_requirements(prices: &[f64], names: &[&str]) -> Cells {
    let of_each =
        |name: &&str| ["found", "required", "met", "holds_in"].map(|what| format!("{name}_{what}"));
    before_price(score_titles(prices), prices, names.iter().flat_map(of_each))
}

/// Like [`score_rows`], with the share found of each requirement by its name, the share required, whether it is met, and the
/// share of copies that still meet it, before the price. Cells are empty for a requirement that a placement does not have.
pub(crate) fn rows_with_requirements(
    all: &[&Scores],
    prices: &[f64],
    names: &[&str],
) -> Vec<Cells> {
    let cells = |seen: &Seen| {
        let met = seen.is_met().to_string();
        [number(seen.share), number(seen.least), met, number(seen.holds_in)]
    };
    let row = |(row, of): (Cells, &&Scores)| {
        let named = |name: &&str| of.required.iter().find(|seen| seen.name == *name);
        let of_each = names.iter().flat_map(|name| named(name).map(cells).unwrap_or_default());
        before_price(row, prices, of_each)
    };
    score_rows(all.iter().copied(), prices).into_iter().zip(all).map(row).collect()
}

/// Puts cells into a row before the price, which is last where there is one.
fn before_price(mut row: Cells, prices: &[f64], cells: impl Iterator<Item = String>) -> Cells {
    let at = row.len() - usize::from(!prices.is_empty());
    row.splice(at..at, cells);
    row
}

/// Columns of [`audits_csv`] behind the scores.
const OF_AUDIT: &str = "fooled,verdict,median_relative_change,worst_relative_change,median_kendall_tau,kendall_tau,\
                        ranking_against_mean_height,first";

/// A row for the base of each scene, for each attempt to look better than it and for each change of the model, with its
/// scores.
pub(crate) fn audits_csv(all: &[Audit]) -> String {
    let mut rows = vec![titles(&["scene", "part", "name"])];
    rows[0].extend(score_titles(&[]));
    rows[0].extend(header(OF_AUDIT));
    let names = numbered(all.iter().map(|found| found.scene.clone()));
    for (scene, found) in names.iter().zip(all) {
        let mut add = |part: &str, name: &str, scores: &Scores, more: [String; 8]| {
            let mut row = titles(&[scene, part, name]);
            row.extend(score_rows([scores], &[]).concat());
            row.extend(more);
            rows.push(row);
        };
        let mut of_base: [String; 8] = Default::default();
        of_base[6] = number(found.ranking_against_mean_height);
        of_base[7].clone_from(&found.base.name);
        add("base", &found.base.name, &found.base, of_base);
        for trial in &found.trials {
            let verdict = match trial.verdict {
                TrialResult::NotFooled => "not_fooled",
                TrialResult::Caught => "caught",
                TrialResult::Fooled => "fooled",
            };
            let mut more: [String; 8] = Default::default();
            (more[0], more[1]) = (joined(&trial.fooled), verdict.to_owned());
            add("attempt", &trial.name, &trial.scores, more);
        }
        for change in &found.stability {
            add("change", &change.change, &change.base, cells_of(change));
        }
    }
    csv(rows)
}

fn cells_of(change: &Stability) -> [String; 8] {
    let [median, worst] = [change.median_relative_change, change.worst_relative_change].map(number);
    let [median_tau, tau, height] =
        [change.median_kendall_tau, change.kendall_tau, change.ranking_against_mean_height]
            .map(number);
    let none = String::new;
    [none(), none(), median, worst, median_tau, tau, height, change.first.clone()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Lost;

    #[test]
    fn requirements_of_one_scene_alone_have_columns_that_are_empty_in_others() {
        let scores = |required: &[(&str, f64)]| {
            let required = required.iter().map(|(name, share)| Seen::of(name, *share)).collect();
            Scores { required, ..Scores::default() }
        };
        let [first, second] = [scores(&[("a", 0.25)]), scores(&[("b", 0.75), ("a", 1.0)])];
        let names = requirements_of([&first, &second]);
        assert_eq!(names, ["a", "b"]);
        let titles = titles_with_requirements(&[1.0; 2], &names);
        let rows = rows_with_requirements(&[&first, &second], &[1.0; 2], &names);
        let before = titles.len() - 9;
        let named = ["a_found", "a_required", "a_met", "a_holds_in", "b_found"];
        assert_eq!(titles[before..before + 5], named);
        assert_eq!(rows[0][before..], ["0.25", "0.9", "false", "", "", "", "", "", "1"]);
        assert_eq!(rows[1][before..], ["1", "0.9", "true", "", "0.75", "0.9", "false", "", "1"]);
    }

    #[test]
    fn the_cell_of_requirements_has_the_names_of_the_columns() {
        let lost = Some(Lost { intact: 0.75, ..Lost::default() });
        let required = vec![Seen { lost, ..Seen::of("car", 0.5) }];
        assert_ne!(required[0].title(), "car");
        let scores = Scores { required, ..Scores::default() };
        let rows = rows_with_requirements(&[&scores], &[], &requirements_of([&scores]));
        let place = titles_with_requirements(&[], &[]).iter().position(|t| t == "requirements");
        assert_eq!(rows[0][place.unwrap()], "car: 0.5 of 0.9, intact 0.75");
    }
}
