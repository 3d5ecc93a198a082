//! The gain of result and baselines in each of several scenes, as a table.

use super::{RunRecord, SceneRecord, ScoreColumn};
use crate::search::Scored;

/// A row of titles, then a row a placement: its name, its gain in per cent of the information over all scenes
/// and in each; `None` where there is one scene.
pub fn by_scene(run: &RunRecord) -> Option<Vec<Vec<String>>> {
    rows_by_scene(&run.scenes, run.best.as_ref(), &run.baselines)
}

/// As [`by_scene`], of scenes, a result and baselines.
pub fn rows_by_scene(
    scenes: &[SceneRecord],
    best: Option<&Scored>,
    baselines: &[Scored],
) -> Option<Vec<Vec<String>>> {
    if scenes.is_empty() {
        return None;
    }
    let names = scenes.iter().map(|scene| scene.name.clone());
    let titles = ["gain %", "all"].map(str::to_owned).into_iter().chain(names);
    let row = |scored: &Scored| {
        let each = scored.by_scene.iter().map(|scene| &scene.scores);
        let cells = std::iter::once(&scored.scores).chain(each);
        let cells = cells.map(|scores| ScoreColumn::GainShare.cell(scores));
        std::iter::once(scored.placement.name.clone()).chain(cells).collect()
    };
    let rows = best.into_iter().chain(baselines).map(row);
    Some(std::iter::once(titles.collect()).chain(rows).collect())
}
