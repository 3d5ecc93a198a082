//! Placements optimized on one scene, scored on the others.

use super::scene::StudyScene;
use super::table::{Cases, check_distinct, shown_objective};
use super::{Row, StudyError, Table, TablePlot};
use crate::score::Seen;

pub(super) fn transfer(scenes: &[StudyScene], cases: &mut Cases) -> Result<Table, StudyError> {
    let names: Vec<&str> = scenes.iter().map(|scene| scene.scene.name()).collect();
    let mend = "give each scene file a `name` of its own";
    check_distinct(names.iter().copied(), "scenes", mend)?;
    cases.expect(2 * scenes.len());
    let (mut found, mut rows) = (Vec::new(), Vec::new());
    for scene in scenes {
        let name = format!("optimized on {}", scene.scene.name());
        let case = cases.one(&name, || {
            let evaluator = scene.evaluator_of_rig()?;
            match scene.optimize(&evaluator)? {
                Some(best) => Ok(Row { placement: Some(best), ..Row::default() }),
                None => Ok(scene.none_found()),
            }
        })?;
        let Some(row) = case else { break };
        match row.placement {
            Some(placement) => found.push((scene.scene.name(), placement)),
            None => rows.push(Row { name: scene.scene.name().to_owned(), ..row }),
        }
    }
    let objective = &scenes[0].settings.objective;
    let (shown, factor) = shown_objective(objective);
    for (name, placement) in found {
        let case = cases.one(name, || {
            let mut row = Row { placement: Some(placement.clone()), ..Row::default() };
            for scene in scenes {
                let scores = scene.score(&mut scene.evaluator()?, &placement)?;
                row.values.push(objective.value(&scores).map(|value| factor * value));
                let on = |seen: &Seen| Seen {
                    name: format!("{} on {}", seen.name, scene.scene.name()),
                    ..seen.clone()
                };
                row = row.requiring(scores.required.iter().map(on).collect::<Vec<_>>().iter());
            }
            Ok(row)
        })?;
        let Some(row) = case else { break };
        rows.push(row);
    }
    let mut notes = vec![format!(
        "{shown} of the placement optimized on the scene of the row, scored on that of the column. The \
         mounts may differ; a placement is scored where it stands."
    )];
    notes.extend(losses(&rows, &names));
    let drawing =
        TablePlot::ByCase { columns: (0..names.len()).collect(), y_title: shown, line: false };
    let unit = if factor == 1.0 { "" } else { " %" };
    let columns: Vec<String> = names.iter().map(|name| format!("{name}{unit}")).collect();
    let columns = std::iter::once("optimized on").chain(columns.iter().map(String::as_str));
    let title = format!(
        "placements carried to other scenes, {} of them, {} frames of each at most",
        scenes.len(),
        scenes[0].settings.frames
    );
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// Loss of each placement on each other scene against the one optimized there, in words.
fn losses(rows: &[Row], scenes: &[&str]) -> Vec<String> {
    let own = |scene: &str, column: usize| {
        rows.iter().find(|row| row.name == scene).and_then(|row| row.values[column])
    };
    let mut notes = Vec::new();
    for row in rows {
        for (column, scene) in scenes.iter().enumerate().filter(|(_, scene)| **scene != row.name) {
            if let (Some(value), Some(own)) = (row.values[column], own(scene, column)) {
                notes.push(format!(
                    "from {} to {scene}: {:+.2} % against its own optimum",
                    row.name,
                    100.0 * (value - own) / own.abs()
                ));
            }
        }
    }
    notes
}

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
            one.warning = one.warning.or_else(|| of.warning.clone());
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
    use super::super::TablePlot;
    use super::*;

    #[test]
    fn losses_are_told_against_the_optimum_of_the_other_scene() {
        let row = |name: &str, values: [Option<f64>; 3]| Row {
            name: name.into(),
            values: values.to_vec(),
            ..Row::default()
        };
        // Nothing was found on the first scene, so that its column has no optimum to compare with.
        let rows =
            [row("b", [Some(9.0), Some(-2.0), Some(6.0)]), row("c", [None, Some(-3.0), Some(8.0)])];
        assert_eq!(
            losses(&rows, &["a", "b", "c"]),
            [
                "from b to c: -25.00 % against its own optimum",
                "from c to b: -50.00 % against its own optimum"
            ]
        );
    }

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
