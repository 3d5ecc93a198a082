//! Voxel sizes: their effect on the ranking of placements.

use super::cases::Cases;
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::score::{kendall_tau, mean_height, spearman};

/// Voxel sizes of the paper's study, in metres.
const VOXELS: [[f64; 3]; 4] =
    [[0.2, 0.2, 0.2], [0.1, 0.15, 0.2], [0.1, 0.1, 0.1], [0.05, 0.1, 0.1]];

pub(super) fn voxels(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    scene.may_have_voxels()?;
    let layouts = scene.some_layouts()?;
    let sizes = VOXELS.map(|voxel| (format!("{voxel:?} m"), voxel)).to_vec();
    let rows = cases.each(sizes, |voxel, _| {
        let scores = scene.scores(&mut scene.evaluator_of_voxels(voxel)?, layouts)?;
        let scaled = scores.iter().map(|s| s.segmentation.m_sog_scaled.map(|v| 1e6 * v));
        Ok(Row::of(scaled.collect()))
    })?;
    let heights: Vec<f64> = layouts.iter().map(mean_height).collect();
    let ranked = |row: &Row| -> Vec<f64> { row.values.iter().map(|v| v.unwrap_or(0.0)).collect() };
    let mut notes = vec![
        "M-SOG/N ×1e-6 of each placement; sizes differ in N, so rankings are compared and not \
         scores."
            .to_owned(),
    ];
    for row in &rows {
        notes.push(format!(
            "{}: Kendall's τ with {} {}; Spearman with mean height alone {}",
            row.name,
            rows[0].name,
            words(kendall_tau(&ranked(&rows[0]), &ranked(row))),
            words(spearman(&heights, &ranked(row)))
        ));
    }
    let drawing =
        TablePlot::ByColumn { x_title: "placement".into(), y_title: "M-SOG/N ×1e-6".into() };
    let columns = std::iter::once("voxel").chain(layouts.iter().map(|p| p.name.as_str()));
    Ok(Table::new(scene.title("four voxel sizes"), columns, rows, notes, drawing))
}

fn words(value: Option<f64>) -> String {
    value.map_or("does not exist".into(), |v| format!("{v:.2}"))
}
