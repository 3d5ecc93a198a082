//! The gain of result and baselines in each of several scenes, as a table.

use super::{RunRecord, SceneRecord, ScoreColumn};
use crate::search::Scored;

/// A row of titles, then a row a placement: its name, its gain, or near gain where that was maximized, in per cent over
/// all scenes and in each; `None` where there is one scene.
pub fn by_scene(run: &RunRecord) -> Option<Vec<Vec<String>>> {
    let column = ScoreColumn::argued(&run.objective);
    rows_by_scene(&run.scenes, run.best.as_ref(), &run.baselines, column)
}

/// Like [`by_scene`], of scenes, a result and baselines, by a share.
pub fn rows_by_scene(
    scenes: &[SceneRecord],
    best: Option<&Scored>,
    baselines: &[Scored],
    column: ScoreColumn,
) -> Option<Vec<Vec<String>>> {
    if scenes.is_empty() {
        return None;
    }
    let names = scenes.iter().map(|scene| scene.name.clone());
    let titles = [column.title(), "all"].map(str::to_owned).into_iter().chain(names);
    let row = |scored: &Scored| {
        let each = scored.by_scene.iter().map(|scene| &scene.scores);
        let cells = std::iter::once(&scored.scores).chain(each);
        let cells = cells.map(|scores| column.cell(scores));
        std::iter::once(scored.placement.name.clone()).chain(cells).collect()
    };
    let rows = best.into_iter().chain(baselines).map(row);
    Some(std::iter::once(titles.collect()).chain(rows).collect())
}
