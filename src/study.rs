//! Questions that take many runs: how many LiDARs, which sensor, what if one fails.
//!
//! | file | holds |
//! |---|---|
//! | `scene` | problems, searches and scores of one scene, shared by its cases |
//! | `settings` | settings of a study, and its observer |
//! | `lost` | scores and margins without each LiDAR |
//! | `table` | the result, and the mean of several scenes |
//! | `lidars`, `sensors` | number, price, model and height of LiDARs |
//! | `regions`, `loss` | placements of one scene against each other |
//! | `transfer`, `published` | other scenes, the published results |

mod lidars;
mod loss;
mod lost;
mod published;
mod regions;
mod scene;
mod sensors;
mod settings;
mod table;
mod transfer;

use crate::job::JobScene;
use scene::StudyScene;
use table::Cases;

pub use lost::{AfterLoss, Margin};
pub(crate) use lost::{cells_of_losses, titles_of_losses};
pub use regions::Subregion;
pub use settings::{Kind, StudyError, StudySettings};
pub(crate) use table::{REQUIREMENTS, TablePlot};
pub use table::{Row, StudyObserver, Table};
pub use transfer::mean_over_scenes;

/// Makes a study of scenes, with frames and weather of the settings in place of their own: several for [`Kind::Transfer`], one
/// for all others. [`Kind::Weather`] looks at each condition of the settings for itself.
///
/// `known` holds the rows of an interrupted study of the same settings and scenes, and gets those that
/// are measured: it is all that an interrupted study needs to go on. The table holds the cases there are
/// when the observer says stop.
///
/// # Errors
/// Scenes or settings that do not fit the kind, or from searching and scoring.
pub fn study(
    kind: Kind,
    scenes: &[JobScene],
    settings: &StudySettings,
    known: &mut Vec<Row>,
    observer: &dyn StudyObserver,
) -> Result<Table, StudyError> {
    kind.check_scenes(scenes.len())?;
    kind.check_budget(settings)?;
    let scenes: Vec<StudyScene> = scenes
        .iter()
        .map(|scene| StudyScene::new(kind, scene, settings, observer))
        .collect::<Result<_, _>>()?;
    let mut cases = Cases::new(known, observer);
    let one = &scenes[0];
    let cases = &mut cases;
    let table = match kind {
        Kind::Lidars => lidars::lidars(one, cases),
        Kind::Cost => lidars::cost(one, cases),
        Kind::Channels => sensors::channels(one, cases),
        Kind::Voxels => published::voxels(one, cases),
        Kind::Random => published::random(one, cases),
        Kind::Tasks => regions::tasks(one, cases),
        Kind::Height => published::height(one, cases),
        Kind::Regions => regions::regions(one, cases),
        Kind::Loss => loss::loss(one, cases),
        Kind::Weather => sensors::weather(one, cases),
        Kind::Transfer => transfer::transfer(&scenes, cases),
        Kind::Published => published::published(one, cases),
    };
    let mut table = table?;
    table.note_mounting(kind.searches(!settings.placements.is_empty()));
    table.notes.extend(scenes.iter().filter_map(StudyScene::rig_in_words));
    Ok(table)
}
