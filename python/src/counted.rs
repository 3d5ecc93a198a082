//! An engine that tells a waiting call how many casts into frames are done.

use lidar_cast::cover::BitOrder;
use sightline::engine::{Backend, BackendError, Hit, TakeBitmap};
use sightline::problem::{StageTimes, Tally};
use sightline::{Placement, SensorPose};

use crate::progress::WorkMessages;

/// Steps in words: a cast of all LiDARs of a placement into a frame.
const CAST: &str = "frames cast";

/// An engine whose casts are steps of a call.
struct CountedEngine<'a> {
    engine: &'a mut dyn Backend,
    watch: &'a WorkMessages,
    done: usize,
    total: usize,
}

/// Runs `work` with an engine; each of its `total` casts is told to the watch, which may stop it.
///
/// # Errors
/// The errors of `work`, and of a cast after the watch was stopped.
pub(crate) fn counted<T, E>(
    engine: &mut dyn Backend,
    watch: &WorkMessages,
    total: usize,
    work: impl FnOnce(&mut dyn Backend) -> Result<T, E>,
) -> Result<T, E> {
    let found = work(&mut CountedEngine { engine, watch, done: 0, total })?;
    watch.reach(CAST, total, total);
    Ok(found)
}

impl CountedEngine<'_> {
    /// Tells of the casts so far; an error where nobody waits for more.
    fn step(&mut self) -> Result<(), BackendError> {
        let goes_on = self.watch.reach(CAST, self.done.min(self.total), self.total);
        self.done += 1;
        if goes_on {
            return Ok(());
        }
        // Nobody reads it: the caller has left.
        Err(BackendError::Device {
            adapter: self.adapter().to_owned(),
            stage: "casting",
            message: "the call was stopped".to_owned(),
        })
    }
}

impl Backend for CountedEngine<'_> {
    fn name(&self) -> &'static str {
        self.engine.name()
    }

    fn adapter(&self) -> &str {
        self.engine.adapter()
    }

    fn tally(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Tally>, BackendError> {
        self.engine.tally(placements, range)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        self.step()?;
        self.engine.hits(poses, frame)
    }

    fn order(&self) -> BitOrder {
        self.engine.order()
    }

    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<(), BackendError> {
        self.step()?;
        self.engine.each_bitmap(poses, frame, take)
    }

    fn times(&self) -> StageTimes {
        self.engine.times()
    }

    fn changes(&self) -> &[String] {
        self.engine.changes()
    }
}
