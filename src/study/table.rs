//! The table of a study, and its best drawing.

use serde::{Deserialize, Serialize};

use crate::csv::{csv, number};
use crate::score::{Scores, Seen};
use crate::vehicle::Placement;

/// Last columns of a CSV file where the vehicle requires something.
pub(crate) const REQUIREMENTS: [&str; 2] = ["requirements met", "not met"];

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
    /// Reason why the case has no answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_answer: Option<String>,
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

    /// The name, after `!` where a requirement is not met.
    pub fn marked(&self) -> String {
        let mark = if self.requirements_met == Some(false) { "! " } else { "" };
        format!("{mark}{}", self.name)
    }

    /// Cells of the columns [`REQUIREMENTS`].
    pub(crate) fn requirements(&self) -> [String; 2] {
        let met = self.requirements_met.map_or_else(String::new, |met| met.to_string());
        [met, self.not_met.join("; ")]
    }

    /// A line for each requirement that is not met, or for the reason why there is no answer.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        self.not_met.iter().chain(&self.no_answer).map(|word| format!("{}: {word}", self.marked()))
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
    /// Columns along x, a series for each case.
    ByColumn {
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
    /// A table of cases; rows without values get a missing one in each column.
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

    /// Sentence on a table in which no row has a number; `None` where one has.
    pub fn unanswered(&self) -> Option<String> {
        if self.rows.iter().any(|row| row.values.iter().any(Option::is_some)) {
            return None;
        }
        let mut whys: Vec<&str> = Vec::new();
        for why in self.rows.iter().filter_map(|row| row.no_answer.as_deref()) {
            if !whys.contains(&why) {
                whys.push(why);
            }
        }
        let why = if whys.is_empty() { "no case has a number".to_owned() } else { whys.join("; ") };
        Some(format!("{}: no row has an answer: {why}", self.title))
    }

    /// True if rows say whether requirements are met.
    pub fn has_requirements(&self) -> bool {
        self.rows.iter().any(|row| row.requirements_met.is_some())
    }

    /// Comma-separated, the columns' titles first; missing numbers are empty. Two columns more where a vehicle requires
    /// something: whether all is met, and what is not.
    pub fn csv(&self) -> String {
        let requires = self.has_requirements();
        let rows = self.rows.iter().map(|row| {
            let values = row.values.iter().map(|value| number(*value));
            let last = requires.then(|| row.requirements()).into_iter().flatten();
            std::iter::once(row.name.clone()).chain(values).chain(last).collect()
        });
        let last = REQUIREMENTS.map(str::to_owned);
        let mut titles = self.columns.clone();
        titles.extend(last.into_iter().filter(|_| requires));
        csv(std::iter::once(titles).chain(rows))
    }
}

#[cfg(test)]
mod tests {
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
        let seen = |least| Seen {
            name: "ring".into(),
            share: 0.5,
            done: SEEN,
            least,
            missing: None,
            holds_in: None,
        };
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
}
