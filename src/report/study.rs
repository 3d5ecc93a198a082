//! The chart of a study's table.

use super::{Axis, Plot, Series};
use crate::study::{Row, Table, TablePlot};

/// Draws a table by its `drawing`.
pub fn study_plot(table: &Table) -> Plot {
    let number = |row: &Row, column: usize| row.values[column].unwrap_or(f64::NAN);
    let rows = || table.rows.iter();
    let (x_title, y_title, x, series) = match &table.drawing {
        TablePlot::ByCase { columns, y_title, line } => {
            let series = columns.iter().map(|&column| Series {
                name: table.columns[column + 1].clone(),
                points: rows()
                    .enumerate()
                    .map(|(k, row)| (k as f64, number(row, column)))
                    .collect(),
                line: *line,
                labels: Vec::new(),
            });
            let names = Axis::Names(rows().map(Row::marked).collect());
            (&table.columns[0], y_title, names, series.collect())
        }
        TablePlot::ByColumn { x_title, y_title } => {
            let columns = 0..table.columns.len() - 1;
            let series = rows().map(|row| Series {
                name: row.marked(),
                points: columns.clone().map(|k| (k as f64, number(row, k))).collect(),
                line: false,
                labels: Vec::new(),
            });
            let names = Axis::Names(table.columns[1..].to_vec());
            (x_title, y_title, names, series.collect())
        }
        TablePlot::Against { column, x_title, y_title } => {
            let series = Series {
                name: format!("by {}", table.columns[0]),
                points: rows().map(|row| (number(row, 0), number(row, *column))).collect(),
                line: false,
                labels: rows().enumerate().map(|(k, row)| (k, row.marked())).collect(),
            };
            (x_title, y_title, Axis::Numbers, vec![series])
        }
    };
    Plot {
        title: table.title.clone(),
        x_title: x_title.clone(),
        y_title: y_title.clone(),
        x,
        series,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(drawing: TablePlot) -> Table {
        let row = |name: &str, values: [Option<f64>; 2]| Row {
            name: name.into(),
            values: values.to_vec(),
            ..Row::default()
        };
        Table {
            title: "t".into(),
            columns: ["case", "a", "b"].map(str::to_owned).to_vec(),
            rows: vec![row("x", [Some(1.0), None]), row("y", [Some(2.0), Some(3.0)])],
            notes: vec![],
            drawing,
        }
    }

    #[test]
    fn a_table_is_drawn_by_case_by_column_or_one_column_against_the_other() {
        let (x_title, y_title) = ("u".to_owned(), "v".to_owned());
        let columns = vec![1];
        let by_case =
            study_plot(&table(TablePlot::ByCase { columns, y_title: y_title.clone(), line: true }));
        assert_eq!((by_case.x_title.as_str(), by_case.y_title.as_str()), ("case", "v"));
        assert_eq!(by_case.series.len(), 1);
        assert_eq!(by_case.series[0].name, "b");
        assert!(by_case.series[0].points[0].1.is_nan());
        assert_eq!(by_case.series[0].points[1], (1.0, 3.0));
        let (x, y) = (x_title.clone(), y_title.clone());
        let by_column = study_plot(&table(TablePlot::ByColumn { x_title: x, y_title: y }));
        assert_eq!((by_column.series.len(), by_column.series[1].name.as_str()), (2, "y"));
        assert_eq!(by_column.series[1].points, [(0.0, 2.0), (1.0, 3.0)]);
        let against = study_plot(&table(TablePlot::Against { column: 1, x_title, y_title }));
        assert_eq!(against.series[0].points[1], (2.0, 3.0));
        assert_eq!(against.series[0].labels[1], (1, "y".to_owned()));
    }
}
