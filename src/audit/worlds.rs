//! Changed models of one scene: fewer frames, other counts, another grid.

use std::sync::Arc;

use super::error::AuditError;
use crate::job::JobScene;
use crate::psog::{Psog, PsogError, Roi};
use crate::scan::scan_scene;
use crate::scene::{PsogSource, ScanSettings, Scene};

/// A scene's P-SOG changed, and the frames to score it over.
pub(super) struct AlteredWorld {
    pub(super) name: String,
    pub(super) psog: Arc<Psog>,
    pub(super) frames: u32,
}

/// Every change of the model that the scene allows.
pub(super) fn changed_worlds(job: &JobScene) -> Result<Vec<AlteredWorld>, AuditError> {
    let (scene, psog, all) = (job.scene(), job.psog(|_| true)?, job.frame_numbers().len() as u32);
    let mut worlds = Vec::new();
    if all > 1 {
        let (name, frames) = ("frames halved".to_owned(), all.div_ceil(2));
        worlds.push(AlteredWorld { name, psog: psog.clone(), frames });
    }
    let mut over_all =
        |(name, psog)| worlds.push(AlteredWorld { name, psog: Arc::new(psog), frames: all });
    if !psog.classes().is_empty() {
        over_all(without_largest_class(&psog)?);
        over_all(("votes tied between two classes".into(), with_tied_votes(&psog)?));
    }
    if scene.has_geometry() {
        on_other_grids(scene)?.into_iter().for_each(over_all);
    }
    Ok(worlds)
}

/// The P-SOG without the class that occurs most.
fn without_largest_class(psog: &Psog) -> Result<(String, Psog), PsogError> {
    let sum = |class: usize| psog.rows().map(|row| u64::from(row[class])).sum::<u64>();
    let class = (0..psog.classes().len()).max_by_key(|&class| sum(class)).unwrap_or(0);
    let psog_without = with_rows(psog, |row| row[class] = 0)?;
    Ok((format!("class {} absent", psog.classes()[class]), psog_without))
}

/// The P-SOG with half of the frames of each voxel's commonest class given to the class after it.
fn with_tied_votes(psog: &Psog) -> Result<Psog, PsogError> {
    with_rows(psog, |row| {
        let top = (0..row.len()).max_by_key(|&class| row[class]).unwrap_or(0);
        let moved = row[top] / 2;
        row[top] -= moved;
        let next = (top + 1) % row.len();
        row[next] += moved;
    })
}

fn with_rows(psog: &Psog, change: impl Fn(&mut [u16])) -> Result<Psog, PsogError> {
    let mut counts = psog.counts().to_vec();
    counts.chunks_mut(psog.classes().len()).for_each(change);
    let (roi, frames) = (*psog.roi(), psog.frames());
    Psog::new(roi, frames, psog.classes().to_vec(), psog.index().to_vec(), counts)
}

/// The scene scanned again on other grids.
fn on_other_grids(scene: &Scene) -> Result<Vec<(String, Psog)>, PsogError> {
    let settings = match scene.psog_source() {
        PsogSource::Scan(settings) => *settings,
        PsogSource::File(_) => ScanSettings::default_of(scene),
    };
    let bounds = scene.roi();
    let (min, max, voxel) = (bounds.min, bounds.max, bounds.voxel);
    let shifted = [0, 1, 2].map(|k| min[k] - 0.5 * voxel[k]);
    let inner = |corner: [f64; 3]| [0.75 * corner[0], 0.75 * corner[1], corner[2]];
    let grids = [
        ("grid shifted by half a voxel", Roi::new(shifted, voxel, bounds.shape)?),
        ("voxels twice as large", Roi::from_bounds(min, max, voxel.map(|v| 2.0 * v))?),
        ("region of three quarters", Roi::from_bounds(inner(min), inner(max), voxel)?),
    ];
    let scanned = grids
        .into_iter()
        .map(|(name, roi)| Ok((name.to_owned(), scan_scene(scene, &roi, &settings, |_| true)?.0)));
    scanned.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_changed_as_the_names_say() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 1, 1]).unwrap();
        let classes = vec!["car".to_owned(), "pole".to_owned()];
        // T = 8: voxel 0 with 6 + 1, voxel 2 with 0 + 3.
        let psog = Psog::new(roi, 8, classes, vec![0, 2], vec![6, 1, 0, 3]).unwrap();
        let (name, without) = without_largest_class(&psog).unwrap();
        assert_eq!((name.as_str(), without.counts()), ("class car absent", &[0, 1, 0, 3][..]));
        assert_eq!(with_tied_votes(&psog).unwrap().counts(), [3, 4, 1, 2]);
    }
}
