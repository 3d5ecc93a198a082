//! One placement for two tasks: weights between segmentation and detection.

use super::cases::Cases;
use super::columns::numbers;
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::score::Objective;

/// Weights of detection; segmentation has the rest up to 1.
const WEIGHTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

pub(super) fn tasks(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    if !scene.has_detection()? {
        return Err(StudyError::OneTask { scene: scene.place() });
    }
    let mut evaluator = scene.evaluator_of_rig()?;
    let weights = WEIGHTS.map(|weight| (format!("{weight:.2}"), weight)).to_vec();
    let rows = cases.each(weights, |weight, _| {
        let share = "information_gain_share";
        let text = format!("{}*{share} + {weight}*detection.{share}", 1.0 - weight);
        let objective: Objective = text.parse()?;
        let best = scene.optimize_from(&evaluator, &objective, &scene.rig()?.starts)?;
        let Some(best) = best else { return Ok(scene.none_found()) };
        let scores = scene.score(&mut evaluator, &best)?;
        let percent = |share: Option<f64>| share.map(|v| 100.0 * v);
        let values = vec![
            percent(scores.segmentation.information_gain_share),
            percent(scores.detection.and_then(|d| d.information_gain_share)),
        ];
        Ok(Row::scored(values, best, &scores))
    })?;
    let points: Vec<(f64, f64)> = numbers(&rows, 0).into_iter().zip(numbers(&rows, 1)).collect();
    let front: Vec<&str> = rows
        .iter()
        .zip(front(&points))
        .filter(|(_, on_front)| *on_front)
        .map(|(row, _)| row.name.as_str())
        .collect();
    let notes = vec![format!(
        "Not beaten in both tasks (Pareto front): weight {}. Others were cut short by the {} evaluations \
         of each search.",
        front.join(", "),
        scene.settings.evaluations
    )];
    let drawing = TablePlot::Against {
        column: 1,
        x_title: "segmentation: share of the information gained, %".into(),
        y_title: "detection: share of the information gained, %".into(),
    };
    let title = scene.title("one placement for two tasks");
    let columns = ["weight of detection", "segmentation gain %", "detection gain %"];
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// True for each point on the front: no other is as good in both numbers and better in one. A point without numbers
/// is not on the front.
fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let beaten = |a: &(f64, f64)| points.iter().any(|b| b.0 >= a.0 && b.1 >= a.1 && b != a);
    points.iter().map(|point| !point.0.is_nan() && !beaten(point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_by_hand() {
        let points =
            [(3.0, 1.0), (2.0, 2.0), (2.0, 1.0), (1.0, 3.0), (2.0, 2.0), (f64::NAN, f64::NAN)];
        assert_eq!(front(&points), [true, true, false, true, true, false]);
    }
}
