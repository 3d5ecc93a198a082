//! Mean of one study over several scenes: a table of the numbers that compare across them.

use super::{Row, Table};

/// Means over the tables of one kind of study, a table a scene. Keeps the cases that all tables have, and the columns
/// that compare across scenes; a gain in nats does not. A case without a number in one scene has no mean.
///
/// `None` where nothing compares.
pub fn mean_over_scenes(tables: &[Table]) -> Option<Table> {
    let (first, others) = tables.split_first()?;
    let is_column_of = |table: &Table, title: &String| table.columns[1..].contains(title);
    let columns: Vec<&String> = first.columns[1..]
        .iter()
        .filter(|title| compares(title) && others.iter().all(|table| is_column_of(table, title)))
        .collect();
    let value = |table: &Table, name: &str, title: &String| -> Option<f64> {
        let column = table.columns[1..].iter().position(|other| other == title)?;
        table.rows.iter().find(|row| row.name == name)?.values[column]
    };
    let mean = |name: &str, title: &String| {
        let sum: Option<f64> = tables.iter().map(|table| value(table, name, title)).sum();
        sum.map(|sum| sum / tables.len() as f64)
    };
    let in_all = |row: &&Row| {
        others.iter().all(|table| table.rows.iter().any(|other| other.name == row.name))
    };
    let rows = first.rows.iter().filter(in_all).map(|row| {
        let all = tables.iter().flat_map(|table| &table.rows).filter(|of| of.name == row.name);
        let mut one = Row::of(columns.iter().map(|title| mean(&row.name, title)).collect());
        for of in all {
            one.requirements_met = match (one.requirements_met, of.requirements_met) {
                (Some(a), Some(b)) => Some(a && b),
                (a, b) => a.or(b),
            };
            one.not_met.extend(of.not_met.iter().cloned());
        }
        Row { name: row.name.clone(), ..one }
    });
    let rows: Vec<Row> = rows.filter(|row| row.values.iter().any(Option::is_some)).collect();
    let title = format!("mean over {} scenes", tables.len());
    let titles = first.columns[..1].iter().chain(columns.iter().copied()).cloned().collect();
    let (notes, drawing) = (Vec::new(), first.drawing.clone());
    (!rows.is_empty()).then_some(Table { title, columns: titles, rows, notes, drawing })
}

/// True if the numbers of a column compare across scenes: all but a gain in nats.
fn compares(title: &str) -> bool {
    !title.contains("nats") && (title.contains("share") || !title.contains("information_gain"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::TablePlot;

    fn table(columns: &[&str], rows: &[(&str, &[Option<f64>])]) -> Table {
        let row = |(name, values): &(&str, &[Option<f64>])| Row {
            name: (*name).to_owned(),
            values: values.to_vec(),
            ..Row::default()
        };
        let rows = rows.iter().map(row).collect();
        let drawing = TablePlot::of_column(0, "gain %", false);
        Table::new("one".into(), columns.iter().copied(), rows, vec!["note".into()], drawing)
    }

    #[test]
    fn cases_and_columns_that_all_scenes_have_are_averaged() {
        let one = table(
            &["case", "gain %", "information_gain", "guards"],
            &[("a", &[Some(1.0), Some(900.0), Some(0.0)]), ("b", &[Some(2.0), None, Some(1.0)])],
        );
        let two = table(
            &["case", "guards", "gain %"],
            &[("b", &[Some(3.0), None]), ("a", &[Some(2.0), Some(5.0)]), ("c", &[None, None])],
        );
        let mean = mean_over_scenes(&[one.clone(), two]).unwrap();
        assert_eq!(mean.columns, ["case", "gain %", "guards"]);
        let rows: Vec<_> = mean.rows.iter().map(|row| (&*row.name, &row.values[..])).collect();
        let want: [(&str, &[Option<f64>]); 2] =
            [("a", &[Some(3.0), Some(1.0)]), ("b", &[None, Some(2.0)])];
        assert_eq!(rows, want);
        let other = table(&["case", "information_gain"], &[("a", &[Some(1.0)])]);
        assert_eq!(mean_over_scenes(&[one, other]), None);
        assert_eq!(mean_over_scenes(&[]), None);
    }
}
