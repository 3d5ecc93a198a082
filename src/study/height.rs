//! Height: all LiDARs at one height, against free heights.

use super::cases::Cases;
use super::columns::{self, SCORES, made_large};
use super::scene::StudyScene;
use super::{StudyError, Table, TablePlot};

/// Heights from the lowest to the highest of the mount.
const HEIGHTS: u32 = 4;

pub(super) fn height(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let mounts = &scene.scene.vehicle().mounts;
    if mounts.len() > 1 || mounts[0].region.ego_from_region.is_some() {
        let names: Vec<&str> = mounts.iter().map(|mount| mount.region.name.as_str()).collect();
        let mounts = format!("{} mount(s) of their own heights: {}", names.len(), names.join(", "));
        return Err(StudyError::NoHeights { scene: scene.place(), mounts });
    }
    let rules = &scene.rig()?.constraints;
    let [low, high] = rules.corners().map(|corner| corner[2]);
    let at = |k: u32| low + f64::from(k) * (high - low) / f64::from(HEIGHTS - 1);
    let mut heights: Vec<(String, [f64; 2])> =
        (0..HEIGHTS).map(|k| (format!("{:.2} m", at(k)), [at(k); 2])).collect();
    heights.dedup_by(|a, b| a.0 == b.0);
    heights.push(("free".into(), [low, high]));
    let rows = cases.each(heights, |[low, high], _| {
        let constraints = rules.with_regions(|region| {
            (region.lower[2], region.upper[2]) = (low, high);
        });
        let mut evaluator = scene.evaluator_under(&constraints)?;
        columns::of_best(scene, &mut evaluator)
    })?;
    let notes = vec![
        "All LiDARs of a case stand at one height (the paper's 2D plane), those of the last where they \
         like within the mount."
            .to_owned(),
    ];
    let title = scene.title("the best placement at each height");
    let columns = ["height"].into_iter().chain(SCORES);
    let drawn = made_large(&scene.settings.objective);
    Ok(Table::new(title, columns, rows, notes, TablePlot::of_column(drawn, SCORES[drawn], true)))
}
