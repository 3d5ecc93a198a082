//! A few placements scored frame by frame: few frames that stand for all in a ranking, and the spread of a gain.

use rayon::prelude::*;

use super::suite::{Member, Suite};
use crate::engine::{BackendError, CpuBackend};
use crate::problem::{Entropy, Tally};
use crate::score::Objective;
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

    /// Few frames that stand for all, then twice as many and so on to all of them.
    ///
    /// The first level is the smallest of 1, 2, 4, … whose error is within `tolerance`. With several scenes
    /// the numbers are scenes and mirror images times 1, 2, 4, …, with a frame at least of each, so that no
    /// scene is ever forgotten. A level takes the set of frames with the least error: of all
    /// sets of that size, or of the sets reached from the best smaller set by adding and exchanging frames where
    /// there are too many to try.
    pub(crate) fn levels(&self, objective: &Objective, tolerance: f64) -> Vec<Level> {
        let choice = FrameSets::new(self, objective);
        let count = choice.sums.len();
        let mut levels: Vec<Level> = Vec::new();
        let mut best = choice.set(choice.least());
        let mut size = best.frames.len().max(1);
        while size < count {
            best = choice.best(size, best);
            let error = choice.error_after(&best, &[]);
            if !levels.is_empty() || error.is_some_and(|error| error <= tolerance) {
                levels.push(Level { frames: best.frames.clone(), error });
            }
            size *= 2;
        }
        levels.push(Level {
            frames: (0..count).collect(),
            error: choice.reference.iter().flatten().next().map(|_| 0.0),
        });
        levels
    }
}

/// Most sets of frames that are all tried; among more sets the best is found by exchanging frames.
const ALL_SETS: u64 = 4000;

/// Some frames, and the error of ranking by them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Level {
    /// Frames in rising order, numbered through all scenes.
    pub frames: Vec<usize>,
    /// Ranking error of these frames: RMS over the placements of 1 − a · score / full score, with the best a. `None` where
    /// no placement has a score.
    pub error: Option<f64>,
}

struct FrameSets<'a> {
    pilot: &'a Pilot,
    objective: &'a Objective,
    /// Scene, or mirror image, of each frame.
    member_of: Vec<usize>,
    /// Sums that an objective depends on, `[frames][placements]`.
    sums: Vec<Vec<Tally>>,
    /// Objective over all frames.
    reference: Vec<Option<f64>>,
}

/// Frames with their sums, so that a set with one frame more or less is a step away, not a sum over it.
#[derive(Clone)]
struct Set {
    frames: Vec<usize>,
    counts: Vec<usize>,
    /// `[members][placements]`.
    sums: Vec<Vec<Tally>>,
}

impl<'a> FrameSets<'a> {
    fn new(pilot: &'a Pilot, objective: &'a Objective) -> Self {
        let ranges = pilot.suite.frame_ranges().into_iter().enumerate();
        let member_of = ranges.flat_map(|(member, range)| range.map(move |_| member)).collect();
        let sums_alone = |tally: &Tally| Tally {
            covered: tally.covered,
            covered_nonzero: tally.covered_nonzero,
            entropy: tally.entropy,
            near_repeated: tally.near_repeated,
            ..Tally::default()
        };
        let of_frame = |frame: &Vec<Tally>| frame.iter().map(sums_alone).collect();
        let sums = pilot.by_frame.iter().map(of_frame).collect();
        let mut choice = Self { pilot, objective, member_of, sums, reference: Vec::new() };
        choice.reference = choice.values(&choice.set((0..choice.sums.len()).collect()), &[]);
        choice
    }

    fn set(&self, frames: Vec<usize>) -> Set {
        let members = self.pilot.suite.members().len();
        let none = vec![Tally::default(); self.pilot.placements.len()];
        let mut set = Set { counts: vec![0; members], sums: vec![none; members], frames };
        for &frame in &set.frames {
            let member = self.member_of[frame];
            set.counts[member] += 1;
            for (sum, tally) in set.sums[member].iter_mut().zip(&self.sums[frame]) {
                *sum += tally;
            }
        }
        set
    }

    /// Objective of each placement over a set with some frames taken in or out; members without any frame do
    /// not count.
    fn values(&self, set: &Set, steps: &[Step]) -> Vec<Option<f64>> {
        let count = |member: usize| {
            let own = steps.iter().filter(|step| self.member_of[step.frame()] == member);
            own.fold(set.counts[member], |count, step| match step {
                Step::In(_) => count + 1,
                Step::Out(_) => count - 1,
            })
        };
        let counts: Vec<usize> = (0..set.counts.len()).map(count).collect();
        let value = |placement: usize| {
            let members = self.pilot.suite.members().iter().enumerate();
            let some = members.filter(|(member, _)| counts[*member] > 0);
            self.objective.value_over_scenes(some.map(|(member, scene)| {
                let mut sum = set.sums[member][placement].clone();
                for step in steps.iter().filter(|step| self.member_of[step.frame()] == member) {
                    let tally = &self.sums[step.frame()][placement];
                    match step {
                        Step::In(_) => sum += tally,
                        Step::Out(_) => sum -= tally,
                    }
                }
                (sum, scene.problem().content(), counts[member])
            }))
        };
        (0..self.pilot.placements.len()).map(value).collect()
    }

    fn error_after(&self, set: &Set, steps: &[Step]) -> Option<f64> {
        scatter(&self.reference, self.values(set, steps))
    }

    /// The frames that every set grows from: the first of each of several scenes.
    fn least(&self) -> Vec<usize> {
        let several = self.pilot.suite.frame_ranges();
        let several = several.into_iter().filter(|_| !self.pilot.suite.is_single());
        several.map(|range| range.start).collect()
    }

    /// True if a set without one of its frames, and with another, has a frame of each of several scenes.
    fn is_of_all(&self, set: &Set, out: usize, other: usize) -> bool {
        let (from, to) = (self.member_of[out], self.member_of[other]);
        from == to || set.counts[from] > 1 || self.pilot.suite.is_single()
    }

    fn best(&self, size: usize, from: Set) -> Set {
        let count = self.sums.len();
        if sets(count, size) <= ALL_SETS {
            let mut all: Vec<Set> =
                subsets(count, size).into_iter().map(|frames| self.set(frames)).collect();
            all.retain(|set| {
                self.pilot.suite.is_single() || set.counts.iter().all(|&count| count > 0)
            });
            let first = first_of(&all, |set| self.error_after(set, &[]));
            return first.map(|(_, set)| set.clone()).unwrap_or(from);
        }
        let mut chosen = from;
        while chosen.frames.len() < size {
            let others: Vec<Step> = chosen.others(count).map(Step::In).collect();
            let error = |step: &Step| self.error_after(&chosen, &[*step]);
            let Some((_, &step)) = first_of(&others, error) else { break };
            chosen = self.after(&chosen, &[step]);
        }
        loop {
            let mut exchanges: Vec<[Step; 2]> = Vec::new();
            for &out in &chosen.frames {
                let others =
                    chosen.others(count).filter(|&other| self.is_of_all(&chosen, out, other));
                exchanges.extend(others.map(|other| [Step::Out(out), Step::In(other)]));
            }
            let least = self.error_after(&chosen, &[]).unwrap_or(f64::INFINITY);
            let better = first_of(&exchanges, |steps| self.error_after(&chosen, steps));
            match better.filter(|(error, _)| *error < least) {
                Some((_, steps)) => chosen = self.after(&chosen, steps),
                None => return chosen,
            }
        }
    }

    fn after(&self, set: &Set, steps: &[Step]) -> Set {
        let mut frames = set.frames.clone();
        for step in steps {
            match *step {
                Step::In(frame) => frames.push(frame),
                Step::Out(frame) => frames.retain(|&other| other != frame),
            }
        }
        frames.sort_unstable();
        self.set(frames)
    }
}

/// Item of least error, the first of equal ones, with that error.
fn first_of<T: Sync>(some: &[T], error: impl Fn(&T) -> Option<f64> + Sync) -> Option<(f64, &T)> {
    let errors: Vec<f64> = some.par_iter().map(|one| error(one).unwrap_or(f64::INFINITY)).collect();
    errors.into_iter().zip(some).min_by(|a, b| a.0.total_cmp(&b.0))
}

#[derive(Debug, Clone, Copy)]
enum Step {
    In(usize),
    Out(usize),
}

impl Step {
    fn frame(self) -> usize {
        match self {
            Self::In(frame) | Self::Out(frame) => frame,
        }
    }
}

impl Set {
    fn others(&self, count: usize) -> impl Iterator<Item = usize> {
        (0..count).filter(|frame| self.frames.binary_search(frame).is_err())
    }
}

/// Root mean square of 1 − a · value / reference with the a that makes it least; `None` where no
/// reference is known.
fn scatter(reference: &[Option<f64>], values: Vec<Option<f64>>) -> Option<f64> {
    let known = reference.iter().zip(values).filter(|(r, _)| r.is_some_and(|r| r != 0.0));
    // A placement with a reference and no value counts as ratio 0: it is as far off as can be.
    let ratios: Vec<f64> =
        known.filter_map(|(r, value)| Some(value.unwrap_or(0.0) / (*r)?)).collect();
    let squares: f64 = ratios.iter().map(|q| q * q).sum();
    let a = ratios.iter().sum::<f64>() / squares.max(f64::MIN_POSITIVE);
    let off = ratios.iter().map(|q| (1.0 - a * q).powi(2)).sum::<f64>();
    (!ratios.is_empty()).then(|| (off / ratios.len() as f64).sqrt())
}

/// Ways to take `size` of `count`; more than [`ALL_SETS`] where they are too many to count.
fn sets(count: usize, size: usize) -> u64 {
    // C(n, k) = C(n, n − k) for the smaller of both: up to n / 2 each factor makes the number larger.
    let fewer = size.min(count - size) as u64;
    (0..fewer).fold(1, |ways: u64, k| ways.saturating_mul(count as u64 - k) / (k + 1))
}

/// All sets of `size` of `count` frames, in lexical order.
fn subsets(count: usize, size: usize) -> Vec<Vec<usize>> {
    (0..size).fold(vec![Vec::new()], |sets, held| {
        // Room is left for the rest, or most beginnings would lead nowhere.
        let end = count - (size - held - 1);
        let longer = |set: Vec<usize>| {
            let first = set.last().map_or(0, |last| last + 1);
            (first..end).map(move |frame| [&set[..], &[frame]].concat())
        };
        sets.into_iter().flat_map(longer).collect()
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::bvh::Bvh;
    use crate::geom::TriangleSoup;
    use crate::problem::{Content, KINDS, OccupiedVoxel, Problem, Task};
    use crate::psog::Roi;
    use crate::vehicle::{BeamTable, Placement};

    /// A pilot whose gains by frame and placement are given; each placement covers ten voxels.
    fn pilot(gains: &[&[u64]]) -> Pilot {
        pilot_of(gains, |gain| Tally { entropy: [gain, 0, 0, 0], ..Tally::default() })
    }

    /// Like [`pilot`], with the sums of a gain.
    fn pilot_of(gains: &[&[u64]], sums: fn(u64) -> Tally) -> Pilot {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 4, 4]).unwrap();
        let table =
            BeamTable::from_directions(std::iter::once([1.0, 0.0, 0.0].into()), 10.0).unwrap();
        let tree = Arc::new(Bvh::build(&TriangleSoup::default(), 10.0));
        let occupied = vec![OccupiedVoxel { index: 0, entropy: [1 << 28; KINDS] }];
        let content = Content::new(vec![], occupied, &[], false);
        let frames = vec![tree; gains.len()];
        let problem = Arc::new(Problem::from(Task::new(roi, content, table, frames, true)));
        let placement = |k| Placement { name: format!("p{k}"), lidars: vec![] };
        let tally = |&gain: &u64| Tally { covered: 10, ..sums(gain << 28) };
        Pilot {
            suite: problem.into(),
            placements: (0..gains[0].len()).map(placement).collect(),
            by_frame: gains.iter().map(|frame| frame.iter().map(tally).collect()).collect(),
        }
    }

    #[test]
    fn the_frames_that_stand_for_all_are_chosen() {
        // Over all frames the placements gain 7, 9 and 8: frame 2 alone has twice as much of each.
        let gains: [&[u64]; 4] = [&[2, 0, 4], &[0, 14, 4], &[14, 18, 16], &[12, 4, 8]];
        let levels = pilot(&gains).levels(&"information_gain".parse().unwrap(), 0.01);
        let frames: Vec<&[usize]> = levels.iter().map(|level| &level.frames[..]).collect();
        assert_eq!(frames[0], [2]);
        assert!(levels[0].error.unwrap() < 1e-9, "{levels:?}");
        assert_eq!(frames[2], [0, 1, 2, 3]);
        // Or where they are gains by two LiDARs.
        let twice = |gain| Tally { near_repeated: [gain, 0], ..Tally::default() };
        let levels = pilot_of(&gains, twice).levels(&"near_gain_2".parse().unwrap(), 0.01);
        assert_eq!(levels[0].frames, [2]);
        assert!(levels[0].error.unwrap() < 1e-9, "{levels:?}");
        // Where no frame alone will do, two are taken: here these balance each other.
        let gains: [&[u64]; 4] = [&[1, 9], &[9, 1], &[0, 9], &[11, 2]];
        let levels = pilot(&gains).levels(&"information_gain".parse().unwrap(), 0.01);
        assert_eq!((&levels[0].frames[..], levels.len()), (&[0, 1][..], 2));
    }

    #[test]
    fn an_error_is_what_no_common_factor_explains() {
        let some = |values: &[f64]| values.iter().copied().map(Some).collect::<Vec<_>>();
        let close = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-12;
        assert!(close(scatter(&some(&[-1.0, -2.0, -5.0]), some(&[-3.0, -6.0, -15.0])), 0.0));
        // Ratios 1 and 2: a = 3 / 5 leaves 2 / 5 and 1 / 5, whose mean square is 1 / 10.
        assert!(close(scatter(&some(&[2.0, 3.0]), some(&[2.0, 6.0])), 0.1_f64.sqrt()));
        // Ratios 1 and 0: a = 1 leaves 0 and 1. Placements without a reference, or with 0, do not count.
        let reference = [Some(2.0), Some(3.0), None, Some(0.0)];
        let values = vec![Some(2.0), None, Some(9.0), Some(9.0)];
        assert!(close(scatter(&reference, values), 0.5_f64.sqrt()));
        assert_eq!(scatter(&[None], vec![Some(1.0)]), None);
    }

    #[test]
    fn an_exchange_leaves_the_best_smaller_set() {
        // Gain of the first of two placements over the second, in each frame. Frames 0 and 1 balance each other, but
        // nothing balances them and two more; frames 2 to 5 balance each other.
        let more = [&[-1, 1, 5, 5, 5, -15][..], &[1000; 16], &[-2000; 8]].concat();
        let gains: Vec<[u64; 2]> = more.iter().map(|d| [(10_000 + d) as u64, 10_000]).collect();
        let rows: Vec<&[u64]> = gains.iter().map(|row| &row[..]).collect();
        let levels = pilot(&rows).levels(&"information_gain".parse().unwrap(), 1.0);
        assert_eq!(
            (&levels[1].frames[..], &levels[2].frames[..]),
            (&[0, 1][..], &[2, 3, 4, 5][..])
        );
        assert!(levels[2].error.unwrap() < 1e-9, "{levels:?}");
    }

    #[test]
    fn large_sets_are_found_by_exchange() {
        let gains: Vec<Vec<u64>> = (0..30_u64)
            .map(|k| (0..6).map(|p| 100 + 10 * p + (k * (p + 3)) % 7 * 4).collect())
            .collect();
        let rows: Vec<&[u64]> = gains.iter().map(|row| &row[..]).collect();
        let levels = pilot(&rows).levels(&"information_gain".parse().unwrap(), 1.0);
        let sizes: Vec<usize> = levels.iter().map(|level| level.frames.len()).collect();
        assert_eq!(sizes, [1, 2, 4, 8, 16, 30]);
        for level in &levels {
            let mut sorted = level.frames.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(sorted, level.frames);
        }
        assert!(levels[3].error < levels[0].error, "{levels:?}");
        assert_eq!((sets(24, 4), subsets(5, 2).len()), (10626, 10));
        // Nearly all of many: as few sets as for the frames left out, and no set is begun that cannot be completed.
        assert_eq!((sets(33, 32), sets(66, 64), subsets(33, 32).len()), (33, 2145, 33));
        assert!([(140, 64), (360, 128), (1000, 512)].iter().all(|&(n, k)| sets(n, k) > ALL_SETS));
    }
}
