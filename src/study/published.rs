//! Every score of the published placements against the results of trained models in the paper.

use super::cases::Cases;
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::score::Scores;
use crate::score::{mean_height, spearman};

/// Placement, mean mIoU of four segmentation models, mean car mAP and mean pedestrian mAP of four
/// detectors, in per cent: Place3D, NeurIPS 2024. "Ours" is Ours-seg for segmentation and Ours-det for
/// detection.
const PUBLISHED: [(&str, f64, f64, f64); 8] = [
    ("Center", 69.1, 52.5, 26.9),
    ("Line", 63.9, 49.7, 28.9),
    ("Pyramid", 66.6, 52.2, 28.2),
    ("Square", 65.8, 50.0, 28.4),
    ("Trapezoid", 63.8, 50.9, 29.3),
    ("Line-roll", 64.0, 51.0, 28.3),
    ("Pyramid-roll", 67.6, 52.1, 28.2),
    ("Ours", 71.1, 53.4, 30.0),
];

/// A score by name.
type Metric = (&'static str, fn(&Scores) -> Option<f64>);

/// Every score that is compared with the published results.
const METRICS: [Metric; 10] = [
    ("m_sog", |s| s.segmentation.m_sog),
    ("m_sog_scaled", |s| s.segmentation.m_sog_scaled),
    ("m_sog_nonzero", |s| s.segmentation.m_sog_nonzero),
    ("m_sog_scaled_nonzero", |s| s.segmentation.m_sog_scaled_nonzero),
    ("information_gain", |s| s.segmentation.information_gain),
    ("near_gain", |s| s.near_gain),
    ("s_mig", |s| s.s_mig),
    ("detection.m_sog", |s| s.detection?.m_sog),
    ("detection.m_sog_scaled", |s| s.detection?.m_sog_scaled),
    ("detection.information_gain", |s| s.detection?.information_gain),
];

/// Tasks of [`PUBLISHED`], each with its column and the name of its "Ours" in Table 7.
const TASKS: [(&str, usize, &str); 3] =
    [("mIoU", 0, "Ours-seg"), ("car mAP", 1, "Ours-det"), ("pedestrian mAP", 2, "Ours-det")];

/// Results of one task by placement, "Ours" under its name in Table 7.
fn results_of(task: usize) -> Vec<(&'static str, f64)> {
    let (_, column, ours) = TASKS[task];
    PUBLISHED
        .iter()
        .map(|&(name, seg, car, pedestrian)| {
            (if name == "Ours" { ours } else { name }, [seg, car, pedestrian][column])
        })
        .collect()
}

pub(super) fn published(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let edge = scene.settings.voxel;
    let mut evaluator = None;
    let placements = scene.layouts.iter().map(|p| (p.name.clone(), p)).collect();
    let scored = cases.each(placements, |placement, _| {
        let evaluator = match &mut evaluator {
            Some(evaluator) => evaluator,
            None => evaluator.insert(scene.evaluator_of_voxels([edge; 3])?),
        };
        let scores = scene.score(evaluator, placement)?;
        let values = METRICS.iter().map(|(_, of)| of(&scores)).collect();
        Ok(Row { placement: Some(placement.clone()), ..Row::of(values) })
    })?;
    let mut rows: Vec<Row> = METRICS
        .iter()
        .enumerate()
        .map(|(metric, (name, _))| {
            row(name, &|placement| {
                scored.iter().find(|row| row.name == placement).and_then(|row| row.values[metric])
            })
        })
        .collect();
    rows.push(row("mean height (null model)", &|placement| {
        scene.layouts.iter().find(|p| p.name == placement).map(mean_height)
    }));
    let notes = vec![format!(
        "Spearman's rank correlation over the eight published placements (n = 8: below 0.74 it is not \
         significant at 5 %), voxels of {edge} m, {} frame(s). A score that does not beat the null model \
         says no more than that higher LiDARs see more.",
        scene.frames().len()
    )];
    let columns = std::iter::once("score").chain(TASKS.map(|(name, ..)| name));
    let drawing = TablePlot::ByCase {
        columns: (0..TASKS.len()).collect(),
        y_title: "Spearman's rank correlation".into(),
        line: false,
    };
    let title = scene.title("scores against published results");
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// Rank correlations of a number of each placement with the published results of each task; `None` where
/// a placement has no number.
fn row(name: &str, of: &dyn Fn(&str) -> Option<f64>) -> Row {
    let correlation = |task: usize| -> Option<f64> {
        let pairs: Option<Vec<(f64, f64)>> =
            results_of(task).into_iter().map(|(name, result)| Some((of(name)?, result))).collect();
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs?.into_iter().unzip();
        spearman(&ours, &theirs)
    };
    Row { name: name.to_owned(), ..Row::of((0..TASKS.len()).map(correlation).collect()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_numbers_agree_with_themselves_and_ours_stands_for_each_task() {
        for (task, (_, column, ours)) in TASKS.iter().enumerate() {
            let own = |name: &str| {
                let found =
                    PUBLISHED.iter().find(|p| p.0 == name || p.0 == "Ours" && name == *ours);
                found.map(|&(_, seg, car, pedestrian)| [seg, car, pedestrian][*column])
            };
            assert_eq!(row("own", &own).values[task], Some(1.0));
        }
        assert_eq!(row("none", &|_| None).values, [None; 3]);
        // Falling with the names' order in the table says nothing of either: ρ by hand for mIoU.
        let ranks = |name: &str| results_of(0).iter().position(|r| r.0 == name).map(|k| k as f64);
        // mIoU in rank order of the table: 6 1 4 3 0 2 5 7 against 0 1 2 3 4 5 6 7:
        // 1 − 6 · (36 + 0 + 4 + 0 + 16 + 9 + 1 + 0) / (8 · 63) = 1 − 396 / 504.
        let found = row("order", &ranks).values[0].unwrap();
        assert!((found - (1.0 - 396.0 / 504.0)).abs() < 1e-12, "{found}");
    }
}
