//! Placements optimized on one scene, scored on the others.

use super::cases::Cases;
use super::columns::check_distinct;
use super::scene::StudyScene;
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
    for (name, placement) in found {
        let case = cases.one(name, || {
            let mut row = Row { placement: Some(placement.clone()), ..Row::default() };
            for scene in scenes {
                let scores = scene.score(&mut scene.evaluator()?, &placement)?;
                row.values.push(objective.value(&scores));
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
        "`{objective}` of the placement optimized on the scene of the row, scored on that of the column. The \
         mounts may differ; a placement is scored where it stands."
    )];
    notes.extend(losses(&rows, &names));
    let drawing = TablePlot::ByCase {
        columns: (0..names.len()).collect(),
        y_title: objective.to_string(),
        line: false,
    };
    let columns = std::iter::once("optimized on").chain(names.iter().copied());
    let title = "placements carried to other scenes".to_owned();
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

#[cfg(test)]
mod tests {
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
}
