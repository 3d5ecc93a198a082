//! A P-SOG from labelled scans.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use glam::Vec3;
use rayon::prelude::*;

use super::{DatasetError, LabelledScan, LabelledSequence};
use lidar_cast::geom::Pose;
use sightline_scene::psog::{BuildReport, FrameVotes, Psog, PsogBuilder, Roi};

/// How to build a P-SOG from labelled frames.
#[derive(Debug, Clone)]
pub struct PsogOptions {
    /// The voxel grid, in the ego frame.
    pub roi: Roi,
    /// Frames to vote, by number, in each sequence; `None` takes all that have a scan.
    pub frames: Option<Vec<u32>>,
    /// Frame t merges the scans of frames t − w ..= t + w; `None` merges all of `frames`.
    /// Without a window all scans of a sequence are in memory at once (14 bytes a point).
    pub window: Option<u32>,
}

impl PsogOptions {
    /// All frames, all merged.
    pub fn new(roi: Roi) -> Self {
        Self { roi, frames: None, window: None }
    }
}

/// Builds a P-SOG from labelled sequences that have the same classes.
///
/// The dense points of frame t are its own scan and the scans of the other frames of its window,
/// moved through the sensor's poses into the ego frame of t. Each votes in the voxel of its hit
/// ([`Roi::voxel_of_hit`]), seen from where its own sensor stood. Points of moving objects vote only in
/// their own frame, since they would smear in others; ignored labels never vote.
///
/// # Errors
/// See [`DatasetError`].
pub fn build_psog<S: LabelledSequence>(
    sequences: &[S],
    options: &PsogOptions,
) -> Result<(Psog, BuildReport), DatasetError> {
    let classes = sequences.first().map(S::classes).unwrap_or_default();
    let mut builder = PsogBuilder::new(options.roi, classes)?;
    for sequence in sequences {
        add(sequence, options, &mut builder)?;
    }
    Ok(builder.finish()?)
}

/// Adds the frames of a sequence.
fn add(
    sequence: &impl LabelledSequence,
    options: &PsogOptions,
    builder: &mut PsogBuilder,
) -> Result<(), DatasetError> {
    let mut frames = options.frames.clone().unwrap_or_else(|| sequence.frames());
    frames.sort_unstable();
    frames.dedup();
    let mut scans = BTreeMap::new();
    for &t in &frames {
        let near = |&n: &u32| options.window.is_none_or(|w| n.abs_diff(t) <= w);
        scans.retain(|n, _| near(n));
        for n in frames.iter().copied().filter(near) {
            if let Entry::Vacant(slot) = scans.entry(n) {
                slot.insert(Scan::new(sequence.read(n)?));
            }
        }
        let ego_from_sensor = sequence.ego_from_sensor(t)?;
        let ego_from_world = ego_from_sensor.compose(&sequence.world_from_sensor(t)?.inverse());
        let mut votes = FrameVotes::new();
        for (&n, scan) in &scans {
            // Frame t's own points need no pose, and so lose nothing to its rounding.
            let ego_from_scan = if n == t {
                ego_from_sensor
            } else {
                ego_from_world.compose(&sequence.world_from_sensor(n)?)
            };
            scan.vote(&options.roi, &ego_from_scan, n == t, &mut votes);
        }
        builder.frame(votes)?;
    }
    Ok(())
}

/// The voting points of a scan in the sensor frame: points of things at rest, then of moving things.
struct Scan {
    points: Vec<([f32; 3], u16)>,
    at_rest: usize,
}

impl Scan {
    fn new(scan: LabelledScan) -> Self {
        let labelled = || scan.points.iter().zip(&scan.labels);
        let pick = |moving| {
            labelled()
                .filter(move |(_, label)| label.moving == moving)
                .filter_map(|(&point, label)| Some((point, label.class?)))
        };
        let mut points: Vec<_> = pick(false).collect();
        let at_rest = points.len();
        points.extend(pick(true));
        points.shrink_to_fit();
        Self { points, at_rest }
    }

    fn vote(&self, roi: &Roi, ego_from_sensor: &Pose, own: bool, votes: &mut FrameVotes) {
        let points = if own { &self.points[..] } else { &self.points[..self.at_rest] };
        let origin = ego_from_sensor.translation;
        votes.par_extend(points.par_iter().with_min_len(8192).map(|&(point, class)| {
            let point = ego_from_sensor.apply(Vec3::from(point).as_dvec3());
            (roi.voxel_of_hit(origin, point), class)
        }));
    }
}
