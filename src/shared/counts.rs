//! Numbers of things that no, one, two, and three or more LiDARs or technologies see, from one set of bits each.

use serde::Serialize;

use crate::vehicle::SensorName;

/// Numbers of LiDARs that are told apart: none, one, two, three and more.
const NUMBERS: usize = 4;

/// Things by the number of LiDARs, or technologies, that see them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeenBy {
    /// Things that count, a mean over frames.
    pub all: f64,
    /// Things that none, one, two, and three or more see; means over frames.
    pub by: [f64; NUMBERS],
    /// Shares seen by 0, 1, 2 and 3 or more LiDARs, averaged over frames that have such things; `None` if none has.
    pub share: Option<[f64; NUMBERS]>,
    /// Things that LiDARs of one model alone see, by model; empty where all LiDARs are of one model, and of technologies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub alone: Vec<SeenAlone>,
}

/// Things that LiDARs of one model see, and no other LiDAR.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeenAlone {
    /// Name of the model.
    pub sensor: SensorName,
    /// Things, a mean over frames.
    pub count: f64,
    /// Share of all things, a mean over the frames that have any; `None` where no frame has.
    pub share: Option<f64>,
}

/// Things by the technologies that see them: LiDARs, cameras, radars.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeenByTechnologies {
    /// Things by the number of technologies; those that none sees are blind to all.
    #[serde(flatten)]
    pub number: SeenBy,
    /// Things that each technology sees, LiDARs first.
    pub each: Vec<SeenByTechnology>,
}

/// Things that at least one sensor of a technology sees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeenByTechnology {
    /// Word for the technology.
    pub technology: String,
    /// Things, a mean over frames.
    pub count: f64,
    /// Share of all things, a mean over the frames that have any; `None` where no frame has.
    pub share: Option<f64>,
}

/// Places of a target by the number of LiDARs, or by the technologies, that see it there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetSeenBy<S> {
    /// Name of the target.
    pub target: String,
    /// Places beside the own body.
    #[serde(flatten)]
    pub seen: S,
}

impl SeenByTechnologies {
    /// Mean of the numbers of several scenes, as [`SeenBy::mean`].
    pub(super) fn mean(all: &[&Self]) -> Option<Self> {
        let first = *all.first()?;
        let number = SeenBy::mean(&all.iter().map(|one| &one.number).collect::<Vec<_>>())?;
        let each = first.each.iter().enumerate().map(|(k, of)| SeenByTechnology {
            technology: of.technology.clone(),
            count: mean(all.iter().map(|one| one.each[k].count)).unwrap_or_default(),
            share: mean(all.iter().filter_map(|one| one.each[k].share)),
        });
        Some(Self { each: each.collect(), number })
    }
}

/// Mean of some values; `None` for none.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, n), value| (sum + value, n + 1));
    (count > 0).then(|| sum / f64::from(count))
}

impl SeenBy {
    /// Mean of the numbers of several scenes, for LiDARs of the same models; shares over the scenes that have any.
    /// `None` for none.
    pub(super) fn mean(all: &[&Self]) -> Option<Self> {
        let first = *all.first()?;
        let over = |value: &dyn Fn(&Self) -> f64| {
            mean(all.iter().map(|one| value(one))).unwrap_or_default()
        };
        let share =
            |value: &dyn Fn(&Self) -> Option<f64>| mean(all.iter().filter_map(|one| value(one)));
        let alone = |k: usize| SeenAlone {
            sensor: first.alone[k].sensor,
            count: over(&|one| one.alone[k].count),
            share: share(&|one| one.alone[k].share),
        };
        let shares = [0, 1, 2, 3].map(|k| share(&|one| one.share.map(|share| share[k])));
        Some(Self {
            all: over(&|one| one.all),
            by: std::array::from_fn(|k| over(&|one| one.by[k])),
            share: shares[0].map(|_| shares.map(Option::unwrap_or_default)),
            alone: (0..first.alone.len()).map(alone).collect(),
        })
    }
}

pub(super) struct PlacementModels {
    /// Each model once, in the order of the LiDARs.
    pub names: Vec<SensorName>,
    /// Position in `names` for each LiDAR.
    pub of: Vec<usize>,
}

impl PlacementModels {
    pub(super) fn new(lidars: impl IntoIterator<Item = SensorName>) -> Self {
        let mut models = Self { names: Vec::new(), of: Vec::new() };
        for name in lidars {
            let known = models.names.iter().position(|known| *known == name);
            models.of.push(known.unwrap_or(models.names.len()));
            if known.is_none() {
                models.names.push(name);
            }
        }
        models
    }
}

/// Bits that are set in at least one, two and three of some sets.
fn levels<'a>(sets: impl IntoIterator<Item = &'a [u64]>, words: usize) -> [Vec<u64>; 3] {
    let mut levels = [0; 3].map(|_: u64| vec![0_u64; words]);
    let [one, two, three] = &mut levels;
    for set in sets {
        for (word, &bits) in set.iter().enumerate() {
            three[word] |= two[word] & bits;
            two[word] |= one[word] & bits;
            one[word] |= bits;
        }
    }
    levels
}

/// Sets of one frame, a bit a thing, put together.
pub(super) struct Sets {
    /// Things that at least one, two, three LiDARs or technologies see.
    by_number: [Vec<u64>; 3],
    /// Things that one model alone sees, by model, none where there is one model; or things that each technology sees.
    each: Vec<Vec<u64>>,
}

impl Sets {
    /// From a set a LiDAR, all of the same number of words.
    pub(super) fn new(sets: &[&[u64]], models: &PlacementModels) -> Self {
        let words = sets.first().map_or(0, |set| set.len());
        let by_number = levels(sets.iter().copied(), words);
        if models.names.len() < 2 {
            return Self { by_number, each: Vec::new() };
        }
        let of_model = |model: usize| {
            let own = sets.iter().zip(&models.of).filter(|(_, of)| **of == model);
            let [any, ..] = levels(own.map(|(set, _)| *set), words);
            any
        };
        let mut unions: Vec<Vec<u64>> = (0..models.names.len()).map(of_model).collect();
        let [_, several, _] = levels(unions.iter().map(Vec::as_slice), words);
        for union in &mut unions {
            union.iter_mut().zip(&several).for_each(|(word, bits)| *word &= !bits);
        }
        Self { by_number, each: unions }
    }

    /// From a set a technology, all of the same number of words.
    pub(super) fn of_technologies(sets: Vec<Vec<u64>>) -> Self {
        let words = sets.first().map_or(0, Vec::len);
        Self { by_number: levels(sets.iter().map(Vec::as_slice), words), each: sets }
    }
}

/// Sums over frames of the things that count, which lie in a mask.
#[derive(Default)]
pub(super) struct Sums {
    frames: u64,
    frames_with_any: u64,
    all: u64,
    by: [u64; NUMBERS],
    shares: [f64; NUMBERS],
    /// Count, and sum of shares, of each of [`Sets`].
    each: Vec<(u64, f64)>,
}

impl Sums {
    /// Adds a frame that stands for `weight` ones with `all` things; without a mask every bit counts.
    pub(super) fn add(&mut self, weight: u64, sets: &Sets, all: u64, mask: Option<&[u64]>) {
        let count = |set: &Vec<u64>| -> u64 {
            let words = set.iter().enumerate();
            let masked = |(k, word): (usize, &u64)| mask.map_or(*word, |mask| word & mask[k]);
            words.map(|word| u64::from(masked(word).count_ones())).sum()
        };
        let [one, two, three] = [0, 1, 2].map(|k| count(&sets.by_number[k]));
        let share = |count: u64| weight as f64 * count as f64 / all.max(1) as f64;
        for (k, count) in [all - one, one - two, two - three, three].into_iter().enumerate() {
            self.by[k] += weight * count;
            self.shares[k] += share(count);
        }
        self.each.resize(sets.each.len(), (0, 0.0));
        for (sums, count) in self.each.iter_mut().zip(sets.each.iter().map(count)) {
            *sums = (sums.0 + weight * count, sums.1 + share(count));
        }
        self.all += weight * all;
        self.frames += weight;
        self.frames_with_any += if all > 0 { weight } else { 0 };
    }

    pub(super) fn mean(&self, models: &PlacementModels) -> SeenBy {
        let any = self.frames_with_any;
        let alone = models.names.iter().zip(self.means_of_each());
        SeenBy {
            all: self.over_frames(self.all),
            by: self.by.map(|sum| self.over_frames(sum)),
            share: (any > 0).then(|| self.shares.map(|sum| sum / any as f64)),
            alone: alone
                .map(|(&sensor, (count, share))| SeenAlone { sensor, count, share })
                .collect(),
        }
    }

    pub(super) fn mean_of_technologies(&self, names: &[String]) -> SeenByTechnologies {
        let each = names.iter().zip(self.means_of_each());
        let each = each.map(|(name, (count, share))| SeenByTechnology {
            technology: name.clone(),
            count,
            share,
        });
        SeenByTechnologies { number: self.mean(&PlacementModels::new([])), each: each.collect() }
    }

    fn over_frames(&self, sum: u64) -> f64 {
        sum as f64 / self.frames.max(1) as f64
    }

    fn means_of_each(&self) -> impl Iterator<Item = (f64, Option<f64>)> {
        let any = self.frames_with_any;
        self.each.iter().map(move |&(count, sum)| {
            (self.over_frames(count), (any > 0).then(|| sum / any as f64))
        })
    }
}

pub(super) fn bits(truths: impl IntoIterator<Item = bool>) -> Vec<u64> {
    let mut words = Vec::new();
    for (k, truth) in truths.into_iter().enumerate() {
        if k % 64 == 0 {
            words.push(0);
        }
        words[k / 64] |= u64::from(truth) << (k % 64);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn counts_are_those_of_a_loop_over_things() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let names = ["a", "b", "a", "c", "b"].map(|name| SensorName::new(name).unwrap());
        let models = PlacementModels::new(names);
        assert_eq!((models.names.len(), &models.of[..]), (3, &[0, 1, 0, 2, 1][..]));
        let (things, frames) = (131, [(3_u64, true), (2, true), (4, false)]);
        let mut sums = Sums::default();
        let (mut by, mut alone, mut shares) = ([0.0; 4], [0.0; 3], [0.0; 4]);
        for (weight, has_any) in frames {
            let sees: Vec<Vec<bool>> =
                names.iter().map(|_| (0..things).map(|_| rng.random_bool(0.3)).collect()).collect();
            let counts: Vec<bool> = (0..things).map(|_| has_any && rng.random_bool(0.6)).collect();
            let sets: Vec<Vec<u64>> = sees.iter().map(|sees| bits(sees.iter().copied())).collect();
            let sets = Sets::new(&sets.iter().map(Vec::as_slice).collect::<Vec<_>>(), &models);
            let all = counts.iter().filter(|counts| **counts).count();
            sums.add(weight, &sets, all as u64, Some(&bits(counts.iter().copied())));
            for thing in (0..things).filter(|&thing| counts[thing]) {
                let seers: Vec<usize> = (0..5).filter(|&lidar| sees[lidar][thing]).collect();
                by[seers.len().min(3)] += weight as f64 / 9.0;
                shares[seers.len().min(3)] += weight as f64 / 5.0 / all as f64;
                let model = |lidar: &usize| models.of[*lidar];
                if let Some(first) = seers.first().map(model)
                    && seers.iter().map(model).all(|model| model == first)
                {
                    alone[first] += weight as f64 / 9.0;
                }
            }
        }
        let found = sums.mean(&models);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!((0..4).all(|k| near(found.by[k], by[k]) && by[k] > 1.0), "{found:?} {by:?}");
        assert!((0..4).all(|k| near(found.share.unwrap()[k], shares[k])), "{found:?}");
        assert!((0..3).all(|k| near(found.alone[k].count, alone[k]) && alone[k] > 1.0));
        assert!(near(found.all, by.iter().sum()));
    }

    #[test]
    fn one_model_sees_nothing_alone_and_no_thing_has_no_share() {
        let models = PlacementModels::new([SensorName::NONE; 2]);
        let sets = Sets::new(&[&[0b1100], &[0b0110]], &models);
        let mut sums = Sums::default();
        sums.add(2, &sets, 0, Some(&[0]));
        let empty = sums.mean(&models);
        assert_eq!((empty.all, empty.by, empty.share), (0.0, [0.0; 4], None));
        sums.add(2, &sets, 5, None);
        let found = sums.mean(&models);
        assert_eq!((found.all, found.by), (2.5, [1.0, 1.0, 0.5, 0.0]));
        assert_eq!((found.share, found.alone), (Some([0.4, 0.4, 0.2, 0.0]), vec![]));
    }
}
