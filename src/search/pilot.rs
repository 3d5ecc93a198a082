//! A few placements scored frame by frame, for the choice of frames and the spread of a gain.

use super::suite::{Member, Suite};
use crate::engine::{BackendError, CpuBackend};
use crate::problem::{Entropy, Tally};
use crate::vehicle::Placement;

/// Placements with their tallies over all frames of each scene.
pub(crate) type Known = Vec<(Placement, Vec<Tally>)>;

/// Tallies of a few placements, frame by frame of every scene.
pub struct Pilot {
    pub(super) suite: Suite,
    pub(super) placements: Vec<Placement>,
    /// `[frames][placements]`, frames numbered through all scenes.
    pub(super) by_frame: Vec<Vec<Tally>>,
}

impl Pilot {
    /// Scores `placements` in every frame, on the CPU, within about `memory` bytes; `None` once `go_on`, which is asked
    /// before each frame with the number of frames that are done, says no.
    ///
    /// # Errors
    /// One placement does not fit.
    pub fn new(
        suite: &Suite,
        placements: Vec<Placement>,
        memory: u64,
        go_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Option<Self>, BackendError> {
        let mut by_frame: Vec<Vec<Tally>> = Vec::new();
        for member in suite.members() {
            let problem = member.problem();
            let (first, seen) = (by_frame.len(), member.seen(&placements));
            let mut backend = CpuBackend::new(problem.task().clone(), memory);
            for frame in 0..problem.frame_count() {
                if !go_on(by_frame.len()) {
                    return Ok(None);
                }
                by_frame.push(match by_frame.get(first + problem.first_equal(frame)) {
                    Some(equal) => equal.clone(),
                    None => backend.tally_frame(&seen, frame)?,
                });
            }
        }
        Ok(Some(Self { suite: suite.clone(), placements, by_frame }))
    }

    /// Placements × frames that were scored.
    pub(crate) fn work(&self) -> u64 {
        (self.placements.len() * self.by_frame.len()) as u64
    }

    /// The placements and their tallies over all frames of each scene: the same as a backend gives for
    /// them.
    pub fn tallies(&self) -> Known {
        let ranges = self.suite.frame_ranges();
        let sums = |index: usize| {
            let members = self.suite.members().iter().zip(&ranges);
            members.map(|(member, range)| self.sum(index, member, range.clone())).collect()
        };
        let placements = self.placements.iter().cloned().enumerate();
        placements.map(|(index, placement)| (placement, sums(index))).collect()
    }

    /// Shares of the information of a kind that a placement gains in each frame, `[scenes][frames]`; those of a
    /// mirror image are averaged with its original's. Near voxels count for up to `most` LiDARs.
    pub(crate) fn gain_shares(
        &self,
        index: usize,
        (kind, most): (Entropy, usize),
    ) -> Vec<Vec<f64>> {
        let mut shares: Vec<Vec<f64>> = vec![Vec::new(); self.suite.scene_count()];
        let mut images = vec![0.0; shares.len()];
        for (member, range) in self.suite.members().iter().zip(self.suite.frame_ranges()) {
            let total = kind.of(&member.problem().content().entropy_total()).max(1) as f64;
            let gain = |tally: &Tally| {
                kind.of(&tally.entropy) + tally.near_repeated[..most - 1].iter().sum::<u64>()
            };
            let all = most as f64 * total;
            let gains = range.map(|frame| gain(&self.by_frame[frame][index]) as f64 / all);
            let (sums, scene) = (&mut shares[member.scene()], member.scene());
            sums.resize(gains.len(), 0.0);
            sums.iter_mut().zip(gains).for_each(|(sum, gain)| *sum += gain);
            images[scene] += 1.0;
        }
        for (shares, images) in shares.iter_mut().zip(images) {
            shares.iter_mut().for_each(|share| *share /= images);
        }
        shares
    }

    fn sum(&self, index: usize, member: &Member, frames: impl Iterator<Item = usize>) -> Tally {
        let classes = member.problem().content().set_count();
        let mut sum = Tally::zero(classes, self.placements[index].lidars.len());
        frames.for_each(|frame| sum += &self.by_frame[frame][index]);
        sum
    }
}
