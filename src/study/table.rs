//! The table of a study, and its best drawing.

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::scene::StudyScene;
use super::{AfterLoss, StudyError, cells_of_losses, titles_of_losses};
use crate::csv::{csv, number};
use crate::json::distinct;
use crate::score::{NEAR_GAIN, Objective, Scores, Seen};
use crate::search::Evaluator;
use crate::vehicle::Placement;

/// Columns of a CSV file behind the values where the vehicle requires something.
pub(crate) const REQUIREMENTS: [&str; 2] = ["requirements met", "not met"];

/// Notes below a table of a vehicle that requires something: where placements are searched, and where they are given.
const AS_SEARCHED: &str = "Requirements are met as mounted only: searches of a study allow for no tolerance, those of \
                           `optimize` do. `sightline score` tells how many copies mounted a little off meet them.";
const AS_GIVEN: &str = "Requirements are met as mounted only: `sightline score` tells how many copies mounted a little off \
                        meet them.";

/// One line of a study: a case and its values.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The case.
    #[serde(default)]
    pub name: String,
    /// A number for each column; `None` where there is none.
    pub values: Vec<Option<f64>>,
    /// The placement that the case ended with, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placement: Option<Placement>,
    /// True if the placement meets all requirements of the vehicle; `None` where it has none, or the case has no
    /// placement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requirements_met: Option<bool>,
    /// Requirements that are not met, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_met: Vec<String>,
    /// Values, by their number, beside which a requirement is not met.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unmet_at: Vec<usize>,
    /// Reason why the case has no answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_answer: Option<String>,
    /// Guard that the placement violates, in words, where a study of random placements shows its value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
    /// Reason of a value that is missing or repeats the one of another row.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// The placement without each of its LiDARs, in a study of losses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub after_loss: Vec<AfterLoss>,
}

impl Row {
    /// Values alone.
    pub(super) fn of(values: Vec<Option<f64>>) -> Self {
        Self { values, ..Self::default() }
    }

    /// Values of a placement, and the requirements that its scores miss.
    pub(super) fn scored(values: Vec<Option<f64>>, placement: Placement, scores: &Scores) -> Self {
        let placement = Some(placement);
        Self { placement, ..Self::of(values) }.requiring(scores.required.iter())
    }

    /// Adds the requirements that are not met.
    pub(super) fn requiring<'s>(mut self, required: impl Iterator<Item = &'s Seen>) -> Self {
        for seen in required {
            self.requirements_met = Some(self.requirements_met.unwrap_or(true) && seen.is_met());
            self.not_met.extend((!seen.is_met()).then(|| seen.to_string()));
        }
        self
    }

    /// A case without an answer.
    pub(super) fn unanswered(why: impl Into<String>) -> Self {
        Self { no_answer: Some(why.into()), ..Self::default() }
    }

    /// The name, after `!` where a requirement is not met or a guard violated.
    pub fn marked(&self) -> String {
        let is_marked = self.requirements_met == Some(false) || self.warning.is_some();
        format!("{}{}", if is_marked { "! " } else { "" }, self.name)
    }

    /// Cells of the columns [`REQUIREMENTS`].
    pub(crate) fn requirements(&self) -> [String; 2] {
        let met = self.requirements_met.map_or_else(String::new, |met| met.to_string());
        [met, self.not_met.join("; ")]
    }

    /// A line for each requirement that is not met, for the warning, the note, or the reason why there is no answer.
    pub(crate) fn remarks(&self) -> impl Iterator<Item = String> {
        self.not_met
            .iter()
            .chain(&self.warning)
            .chain(&self.note)
            .chain(&self.no_answer)
            .map(|word| format!("{}: {word}", self.marked()))
    }
}

/// Best drawing of a table; columns are counted from the first value on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TablePlot {
    /// Cases along x, a series for each of these columns.
    ByCase {
        /// Columns that are drawn.
        columns: Vec<usize>,
        /// Title of the y axis.
        y_title: String,
        /// True if the points of a series are joined, because the cases are steps of one quantity.
        line: bool,
    },
    /// Columns along x, a series for each case; values beside which a requirement is not met are hollow.
    ByColumn {
        /// Columns that are drawn, all in the unit of the y axis.
        columns: Vec<usize>,
        /// Title of the x axis.
        x_title: String,
        /// Title of the y axis.
        y_title: String,
    },
    /// The first column along x, another along y, a labelled point for each case.
    Against {
        /// Column along y.
        column: usize,
        /// Title of the x axis.
        x_title: String,
        /// Title of the y axis.
        y_title: String,
    },
}

impl TablePlot {
    /// One column over the cases.
    pub(super) fn of_column(column: usize, title: &str, line: bool) -> Self {
        Self::ByCase { columns: vec![column], y_title: title.to_owned(), line }
    }
}

/// The result of a study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Scene and question.
    pub title: String,
    /// Title of the cases, then of each value.
    pub columns: Vec<String>,
    /// The cases in order.
    pub rows: Vec<Row>,
    /// Sentences on how to read the numbers.
    pub notes: Vec<String>,
    /// Drawing that suits it.
    #[serde(skip)]
    pub drawing: TablePlot,
}

impl Table {
    /// A table of cases; rows without values get a missing one in each column. A note tells where requirements were looked at
    /// without copies.
    pub(super) fn new<'a>(
        title: String,
        columns: impl IntoIterator<Item = &'a str>,
        mut rows: Vec<Row>,
        notes: Vec<String>,
        drawing: TablePlot,
    ) -> Self {
        let columns: Vec<String> = columns.into_iter().map(str::to_owned).collect();
        rows.iter_mut().for_each(|row| row.values.resize(columns.len() - 1, None));
        Self { title, columns, rows, notes, drawing }
    }

    /// Adds a note where the vehicle requires something: copies mounted a little off are not looked at. `is_searched` tells
    /// whether placements were searched.
    pub(super) fn note_mounting(&mut self, is_searched: bool) {
        if self.has_requirements() {
            self.notes.push(if is_searched { AS_SEARCHED } else { AS_GIVEN }.to_owned());
        }
    }

    /// Sentence on a table in which no row has a number; `None` where one has.
    pub fn unanswered(&self) -> Option<String> {
        if self.rows.iter().any(|row| row.values.iter().any(Option::is_some)) {
            return None;
        }
        let whys = distinct(self.rows.iter().filter_map(|row| row.no_answer.as_deref()));
        let why = if whys.is_empty() { "no case has a number".to_owned() } else { whys.join("; ") };
        Some(format!("{}: no row has an answer: {why}", self.title))
    }

    /// True if rows say whether requirements are met.
    pub(crate) fn has_requirements(&self) -> bool {
        self.rows.iter().any(|row| row.requirements_met.is_some())
    }

    /// Comma-separated, the columns' titles first; missing numbers are empty. Two columns more where a vehicle requires
    /// something: whether all is met, and the misses. Then come scores and margins after each loss, where LiDARs are lost, and
    /// notes where rows have any.
    pub fn csv(&self) -> String {
        let has_notes = self.rows.iter().any(|row| row.note.is_some());
        let (requires, of_losses) = (self.has_requirements(), titles_of_losses(&self.rows));
        let rows = self.rows.iter().map(|row| {
            let values = row.values.iter().map(|value| number(*value));
            let last = requires.then(|| row.requirements()).into_iter().flatten();
            let after_loss = cells_of_losses(row, &of_losses);
            let note = has_notes.then(|| row.note.clone().unwrap_or_default());
            let cells = std::iter::once(row.name.clone()).chain(values).chain(last);
            cells.chain(after_loss).chain(note).collect()
        });
        let last = REQUIREMENTS.map(str::to_owned);
        let mut titles = self.columns.clone();
        titles.extend(last.into_iter().filter(|_| requires));
        titles.extend(of_losses.iter().cloned());
        titles.extend(has_notes.then(|| "note".to_owned()));
        csv(std::iter::once(titles).chain(rows))
    }
}

/// Columns that most studies show of a placement.
pub(super) const SCORES: [&str; 6] =
    ["gain %", "near gain %", "M-SOG/N ×1e-6", "detection ×1e-6", "covered", "guards violated"];

/// Column of [`SCORES`] that searches for an objective make large; the gain where it is none of them.
pub(super) fn made_large(objective: &Objective) -> usize {
    match objective.to_string().as_str() {
        NEAR_GAIN => 1,
        "m_sog_scaled" => 2,
        "detection.m_sog_scaled" => 3,
        _ => 0,
    }
}

/// Title of an objective in a table, with its unit, and the factor of its values: gains are in per cent.
pub(super) fn shown_objective(objective: &Objective) -> (String, f64) {
    let name = objective.to_string();
    match name.as_str() {
        NEAR_GAIN => (SCORES[1].to_owned(), 100.0),
        "near_gain_2" | "near_gain_3" => (format!("{} %", name.replace('_', " ")), 100.0),
        "information_gain_share" => (SCORES[0].to_owned(), 100.0),
        _ => (name, 1.0),
    }
}

pub(super) fn values(scores: &Scores) -> Vec<Option<f64>> {
    vec![
        scores.segmentation.information_gain_share.map(|v| 100.0 * v),
        scores.near_gain.map(|v| 100.0 * v),
        scores.segmentation.m_sog_scaled.map(|v| 1e6 * v),
        scores.detection.and_then(|d| d.m_sog_scaled).map(|v| 1e6 * v),
        Some(scores.covered),
        Some(scores.doubts() as f64),
    ]
}

/// The best placement of a search from some starts, and the values of [`SCORES`].
pub(super) fn of_best(
    scene: &StudyScene,
    evaluator: &mut Evaluator,
    starts: &[Placement],
) -> Result<Row, StudyError> {
    let best = scene.optimize_from(evaluator, &scene.settings.objective, starts)?;
    let Some(best) = best else { return Ok(scene.none_found()) };
    let scores = scene.score(evaluator, &best)?;
    Ok(Row::scored(values(&scores), best, &scores))
}

/// Numbers of one column, counted from the first value on; NaN where there is none.
pub(super) fn numbers(rows: &[Row], column: usize) -> Vec<f64> {
    rows.iter().map(|row| row.values.get(column).copied().flatten().unwrap_or(f64::NAN)).collect()
}

/// Refuses names used twice: cases are known by name, and would share their numbers.
pub(super) fn check_distinct<'a>(
    names: impl IntoIterator<Item = &'a str>,
    cases: &'static str,
    mend: &'static str,
) -> Result<(), StudyError> {
    let mut seen = HashSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(StudyError::SameName { cases, name: name.to_owned(), mend }),
        None => Ok(()),
    }
}

/// Observer of a study, which may stop it.
pub trait StudyObserver {
    /// Called before the first case with the number of cases.
    fn begins(&self, _cases: usize) {}

    /// Called after each case that was measured, with all rows known so far: the state to go on from.
    fn measured(&self, _rows: &[Row]) {}

    /// Called whenever an engine was opened, with sentences that name it.
    fn opened(&self, _notes: &[String]) {}

    /// Called after each case, measured or known from before.
    fn done(&self) {}

    /// Asked often; `false` stops the study and drops the case under way.
    fn goes_on(&self) -> bool {
        true
    }
}

/// An observer that hears nothing and never stops.
impl StudyObserver for () {}

/// The cases of one study.
pub(super) struct Cases<'a> {
    known: &'a mut Vec<Row>,
    observer: &'a dyn StudyObserver,
}

impl<'a> Cases<'a> {
    /// Goes on from the rows that are `known`, which it extends.
    pub(super) fn new(known: &'a mut Vec<Row>, observer: &'a dyn StudyObserver) -> Self {
        Self { known, observer }
    }

    /// Announces the number of cases.
    pub(super) fn expect(&self, cases: usize) {
        self.observer.begins(cases);
    }

    /// The row of that name, which `measure` leaves without a name, measured unless it is known; `None` once the observer has said stop.
    pub(super) fn one(
        &mut self,
        name: &str,
        measure: impl FnOnce() -> Result<Row, StudyError>,
    ) -> Result<Option<Row>, StudyError> {
        if let Some(row) = self.known.iter().find(|row| row.name == name) {
            self.observer.done();
            return Ok(Some(row.clone()));
        }
        if !self.observer.goes_on() {
            return Ok(None);
        }
        let measured = measure();
        // A case that was cut short is not kept as if it were whole, nor is its end an error.
        if !self.observer.goes_on() {
            return Ok(None);
        }
        let row = Row { name: name.to_owned(), ..measured? };
        self.known.push(row.clone());
        self.observer.measured(self.known);
        self.observer.done();
        Ok(Some(row))
    }

    /// The rows of named cases in order, up to the one at which the observer says stop; `measure` sees the
    /// rows before its own.
    pub(super) fn each<T>(
        &mut self,
        cases: Vec<(String, T)>,
        mut measure: impl FnMut(T, &[Row]) -> Result<Row, StudyError>,
    ) -> Result<Vec<Row>, StudyError> {
        self.expect(cases.len());
        let mut rows = Vec::new();
        for (name, case) in cases {
            let Some(row) = self.one(&name, || measure(case, &rows))? else { break };
            rows.push(row);
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::score::SEEN;

    #[test]
    fn a_table_as_csv() {
        let row = |name: &str, values: &[Option<f64>]| Row {
            name: name.into(),
            values: values.to_vec(),
            ..Row::default()
        };
        let table = Table {
            title: "t".into(),
            columns: vec!["case".into(), "a, b".into(), "c".into()],
            rows: vec![row("x", &[Some(1.5), None]), row("\"y\"", &[Some(-2.0), Some(0.0)])],
            notes: vec![],
            drawing: TablePlot::of_column(0, "a", true),
        };
        assert_eq!(table.csv(), "case,\"a, b\",c\nx,1.5,\n\"\"\"y\"\"\",-2,0\n");
        let seen =
            |least| Seen { name: "ring".into(), share: 0.5, done: SEEN, least, ..Seen::default() };
        let mut marked = table.clone();
        marked.rows[0] = row("x", &[Some(1.5), None]).requiring([seen(0.5), seen(0.6)].iter());
        marked.rows[1] = row("y", &[None, None]).requiring([seen(0.4)].iter());
        let csv = "case,\"a, b\",c,requirements met,not met\nx,1.5,,false,\"NOT MET: ring: 50.0 % seen, \
                   60.0 % required\"\ny,,,true,\n";
        assert_eq!(marked.csv(), csv);
        assert_eq!([marked.rows[0].marked(), marked.rows[1].marked()], ["! x", "y"]);
        assert_eq!(marked.rows[0].remarks().count(), 1);
    }

    #[test]
    fn a_table_without_a_number_says_why() {
        let mut table = Table::new(
            "t".into(),
            ["case", "a"],
            vec![Row::unanswered("p"), Row::unanswered("q"), Row::unanswered("p")],
            vec![],
            TablePlot::of_column(0, "a", true),
        );
        assert_eq!(table.unanswered().as_deref(), Some("t: no row has an answer: p; q"));
        table.rows[1].values[0] = Some(0.0);
        assert_eq!(table.unanswered(), None);
    }

    #[test]
    fn a_table_with_requirements_says_that_copies_are_not_looked_at() {
        let notes = |row: Row, is_searched| {
            let (drawing, first) = (TablePlot::of_column(0, "a", true), vec!["first".into()]);
            let mut table = Table::new("t".into(), ["case", "a"], vec![row], first, drawing);
            table.note_mounting(is_searched);
            table.notes
        };
        assert_eq!(notes(Row::of(vec![Some(1.0)]), true), ["first"]);
        let met = Row::of(vec![Some(1.0)]).requiring([Seen::of("ring", 1.0)].iter());
        assert_eq!(notes(met.clone(), true), ["first", AS_SEARCHED]);
        assert_eq!(notes(met, false), ["first", AS_GIVEN]);
    }

    /// Stops after some questions.
    struct Patience(Cell<u32>);

    impl StudyObserver for Patience {
        fn goes_on(&self) -> bool {
            self.0.set(self.0.get().saturating_sub(1));
            self.0.get() > 0
        }
    }

    #[test]
    fn known_cases_are_not_measured_and_a_case_cut_short_is_dropped() {
        let names = || ["a", "b", "c"].map(|name| (name.to_owned(), ())).to_vec();
        let run = |known: &mut Vec<Row>, questions: u32| {
            let patience = Patience(Cell::new(questions));
            let count = Cell::new(0.0);
            let rows = Cases::new(known, &patience).each(names(), |(), rows| {
                count.set(count.get() + 1.0);
                Ok(Row::of(vec![Some(rows.len() as f64)]))
            });
            (rows.unwrap().len(), count.get())
        };
        // A case that is cut short fails without an error; a whole case that fails is an error.
        let failed = |questions: u32| {
            let patience = Patience(Cell::new(questions));
            let rows = Cases::new(&mut Vec::new(), &patience)
                .each(names(), |(), _| Err(StudyError::SeveralScenes));
            rows.map(|rows| rows.len()).ok()
        };
        assert_eq!([failed(2), failed(3)], [Some(0), None]);
        let mut known = Vec::new();
        // Two questions a case: the fourth is asked after `b` was measured, and answered with no.
        assert_eq!(run(&mut known, 4), (1, 2.0));
        assert_eq!(known.len(), 1);
        known[0].values = vec![Some(12.5)];
        assert_eq!(run(&mut known, 100), (3, 2.0));
        let values: Vec<_> = known.iter().map(|row| row.values[0]).collect();
        assert_eq!(values, [Some(12.5), Some(1.0), Some(2.0)]);
    }
}
