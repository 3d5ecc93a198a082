//! The table of a study, and its best drawing.

use serde::{Deserialize, Serialize};

use crate::csv::{csv, number};
use crate::vehicle::Placement;

/// One line of a study: a case and its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The case.
    pub name: String,
    /// A number for each column; `None` where there is none.
    pub values: Vec<Option<f64>>,
    /// The placement that the case ended with, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placement: Option<Placement>,
}

/// Best drawing of a table; columns are counted from the first value on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Drawing {
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

impl Drawing {
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
    pub drawing: Drawing,
}

impl Table {
    /// A table of cases; rows without values get a missing one in each column.
    pub(super) fn new<'a>(
        title: String,
        columns: impl IntoIterator<Item = &'a str>,
        mut rows: Vec<Row>,
        notes: Vec<String>,
        drawing: Drawing,
    ) -> Self {
        let columns: Vec<String> = columns.into_iter().map(str::to_owned).collect();
        rows.iter_mut().for_each(|row| row.values.resize(columns.len() - 1, None));
        Self { title, columns, rows, notes, drawing }
    }

    /// Comma-separated, the columns' titles first; missing numbers are empty.
    pub fn csv(&self) -> String {
        let rows = self.rows.iter().map(|row| {
            let values = row.values.iter().map(|value| number(*value));
            std::iter::once(row.name.clone()).chain(values).collect()
        });
        csv(std::iter::once(self.columns.clone()).chain(rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_as_csv() {
        let row = |name: &str, values: &[Option<f64>]| Row {
            name: name.into(),
            values: values.to_vec(),
            placement: None,
        };
        let table = Table {
            title: "t".into(),
            columns: vec!["case".into(), "a, b".into(), "c".into()],
            rows: vec![row("x", &[Some(1.5), None]), row("\"y\"", &[Some(-2.0), Some(0.0)])],
            notes: vec![],
            drawing: Drawing::of_column(0, "a", true),
        };
        assert_eq!(table.csv(), "case,\"a, b\",c\nx,1.5,\n\"\"\"y\"\"\",-2,0\n");
    }
}
