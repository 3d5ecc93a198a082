//! Choices of sensors along a front: one for each gain, each weight of the requirements and each pair of limits, all
//! among the same poses, which are cast once.

use std::time::Instant;

use super::pareto::{FrontProgress, FrontState, known};
use super::{FrontObjective, FrontObjectives, NEARLY};
use crate::job::search::LESS;
use crate::score::Objective;
use crate::search::{
    EquipStep, Equipped, Equipping, Event, EveryRig, Limits, Observer, REQUIRED, SearchError,
    Settings, Suite, Work,
};
use crate::vehicle::{MAX_LIDARS, Vehicle, is_within_budget, sum_of_prices};

/// Most prices at which sensors are chosen for a gain, and where the number of sensors is an objective, too.
const PRICES: usize = 24;
const PRICES_BY_NUMBER: usize = 8;
/// Most sums of prices that are looked at on the way to all that occur.
const SUMS: usize = 4096;
/// Weights of the requirements where they are an objective beside a score: from first of all to not at all.
const WEIGHTS: [f64; 6] = [REQUIRED, 0.0, 1.0, 3.0, 0.3, 10.0];
/// Shares of the first of two gains that are objectives.
const SHARES: [f64; 3] = [0.5, 0.25, 0.75];

/// Most choices one below the other on the way to the cheapest that may meet all requirements.
const CHEAPER: usize = 24;

/// Sensors of a sweep.
pub(super) struct Swept {
    /// Rigs chosen.
    pub chosen: Vec<Chosen>,
    /// All other rigs, where they are few.
    pub others: Vec<Chosen>,
    /// True if both are every rig that there is.
    pub is_whole: bool,
    pub end: End,
}

/// Equipment that was chosen, and the gain that it was chosen by.
#[derive(Debug, Clone)]
pub(super) struct Chosen {
    pub equipped: Equipped,
    pub gain: Objective,
}

/// Why a sweep ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    Done,
    Time,
    Interrupted,
}

/// Limits of the choices, and the gains that they are made by.
pub(super) struct FrontSweep {
    /// Numbers of sensors at most, from few to many; one of 16 where the number is no objective.
    numbers: Vec<usize>,
    /// Prices at most, in an order that spreads over all from the beginning on.
    budgets: Vec<f64>,
    /// Weights of the requirements.
    weights: Vec<f64>,
    gains: Vec<Objective>,
    /// Numbers of sensors, and the least price, of the choices for the cheapest that meets all requirements.
    cheapest: Option<([usize; 2], f64)>,
}

impl FrontSweep {
    /// Limits and gains for some objectives; `own` is the gain where they name none.
    pub(super) fn new(
        objectives: &FrontObjectives,
        vehicle: &Vehicle,
        most_money: f64,
        requires: bool,
        own: &Objective,
    ) -> Self {
        let by_number = objectives.has(&FrontObjective::Sensors);
        let least = vehicle.cheapest().len().max(1);
        let most = vehicle.most_sensors(most_money);
        let numbers = if by_number { (least..=most).collect() } else { vec![MAX_LIDARS] };
        let budgets = if objectives.has(&FrontObjective::Price) {
            let count = if by_number { PRICES_BY_NUMBER } else { PRICES };
            spread(&thinned(prices(vehicle, most_money), count))
        } else {
            vec![most_money]
        };
        let has_score = objectives.scores().next().is_some();
        let weights = match (requires, objectives.has(&FrontObjective::Requirements)) {
            (false, _) => vec![0.0],
            (true, true) if has_score => WEIGHTS.to_vec(),
            (true, false) if has_score => vec![REQUIRED, 0.0],
            _ => vec![REQUIRED],
        };
        let mut gains: Vec<Objective> = Vec::new();
        for score in objectives.scores() {
            let gain = if score.is_information_gain() { score } else { own };
            if !gains.contains(gain) {
                gains.push(gain.clone());
            }
        }
        if gains.is_empty() {
            gains.push(own.clone());
        }
        let least_price = vehicle.cost(&vehicle.cheapest());
        let has_cheapest = requires && objectives.has(&FrontObjective::Price);
        let cheapest = has_cheapest.then_some(([least, most], least_price));
        Self { numbers, budgets, weights, gains, cheapest }
    }

    /// An objective that needs all sums of the gains.
    fn all_gains(&self) -> Objective {
        match &self.gains[..] {
            [one] => one.clone(),
            all => Objective::mixed(&all.iter().map(|gain| (1.0, gain)).collect::<Vec<_>>()),
        }
    }

    /// Limits under which the poses are cast: the widest.
    pub(super) fn widest(&self) -> Limits {
        let budget = self.budgets.iter().copied().fold(f64::MIN, f64::max);
        Limits { budget, sensors: self.numbers.last().copied().unwrap_or(MAX_LIDARS) }
    }

    /// Chooses sensors under all limits by every gain, then by mixtures of two gains. Poses are cast once a choice is not
    /// known, and given up at the end: they take memory that scores need.
    ///
    /// # Errors
    /// See [`Equipping::open`].
    pub(super) fn run(
        &self,
        casting: &PoseCaster<'_>,
        kept: &mut FrontProgress<'_>,
        observer: &mut dyn Observer,
    ) -> Result<Swept, SearchError> {
        let mixtures = self.gains.len() * (self.gains.len() - 1) / 2 * SHARES.len();
        let limits = self.numbers.len() * self.budgets.len();
        let total = (self.gains.len() + mixtures) * self.weights.len() * limits;
        let (found, total) = (Vec::new(), total as u64);
        let aimed = (Objective::default(), f64::NAN);
        let mut under_way = UnderWay {
            casting,
            equipping: None,
            aimed,
            is_aimed: false,
            kept,
            observer,
            found,
            done: 0,
            total,
        };
        let chosen = self.choose(&mut under_way);
        let every = chosen.and_then(|()| {
            let every = under_way.every_rig()?;
            if every.rigs.is_empty() {
                self.choose_cheaper(&mut under_way)?;
            }
            Ok(every)
        });
        let found = under_way.found;
        let (every, end) = match every {
            Ok(every) => (every, End::Done),
            Err(Stop::At(end)) => (EveryRig::default(), end),
            Err(Stop::Failed(error)) => return Err(error),
        };
        let is_new = |of: &Equipped| {
            found.iter().all(|known| known.equipped.placement.lidars != of.placement.lidars)
        };
        let others: Vec<Equipped> = every.rigs.into_iter().filter(is_new).collect();
        let others =
            others.into_iter().map(|equipped| Chosen { equipped, gain: self.gains[0].clone() });
        Ok(Swept { others: others.collect(), is_whole: every.is_fixed, chosen: found, end })
    }

    /// Chooses cheaper and cheaper sensors that miss little of the requirements, as a search for the fewest does. First come the
    /// numbers of sensors up to the first that misses nothing and one more, then any number below the cheapest found.
    fn choose_cheaper(&self, under_way: &mut UnderWay<'_, '_>) -> Result<(), Stop> {
        let Some(([least, most], least_price)) = self.cheapest else { return Ok(()) };
        (under_way.aimed, under_way.is_aimed) = ((self.gains[0].clone(), REQUIRED), false);
        let meets = |of: &Equipped| of.missing <= 0.0;
        let cheapest = |found: &[Chosen]| {
            let met = found.iter().map(|of| &of.equipped).filter(|of| meets(of));
            met.map(|of| of.cost).fold(self.widest().budget, f64::min)
        };
        // Dearer rigs than one that misses nothing were looked at.
        let budget = cheapest(&under_way.found);
        let mut last = most;
        for sensors in (least..=most).take_while(|sensors| *sensors < MAX_LIDARS) {
            if sensors > last {
                break;
            }
            let found = under_way.cheaper(Limits { budget, sensors }, least_price)?;
            if last == most && found.iter().any(meets) {
                last = sensors + 1;
            }
        }
        let budget = below(cheapest(&under_way.found));
        if budget >= least_price {
            under_way.cheaper(Limits::budget(budget), least_price)?;
        }
        Ok(())
    }

    fn choose(&self, under_way: &mut UnderWay<'_, '_>) -> Result<(), Stop> {
        let mut best = Vec::new();
        for gain in &self.gains {
            best.push(self.choose_by(gain, under_way)?);
        }
        // Gains of different size count alike.
        let scaled =
            |k: usize, share: f64| (share / best[k].max(f64::MIN_POSITIVE), &self.gains[k]);
        for second in 1..self.gains.len() {
            for first in 0..second {
                for share in SHARES {
                    let mixed =
                        Objective::mixed(&[scaled(first, share), scaled(second, 1.0 - share)]);
                    self.choose_by(&mixed, under_way)?;
                }
            }
        }
        Ok(())
    }

    /// Chooses by one gain under all limits; returns the largest gain found.
    fn choose_by(&self, gain: &Objective, under_way: &mut UnderWay<'_, '_>) -> Result<f64, Stop> {
        let mut most = 0.0_f64;
        for &weight in &self.weights {
            under_way.aimed = (gain.clone(), weight);
            under_way.is_aimed = false;
            for &sensors in &self.numbers {
                let mut known: Vec<(f64, f64)> = Vec::new();
                for &budget in &self.budgets {
                    under_way.done += 1;
                    // A choice for more money that did not spend it is the best for less, too.
                    if known
                        .iter()
                        .any(|(limit, cost)| *limit >= budget && is_within_budget(*cost, budget))
                    {
                        continue;
                    }
                    let equipped = under_way.choice(Limits { budget, sensors })?;
                    known.push((budget, equipped.cost));
                    most = most.max(equipped.value);
                }
            }
        }
        Ok(most)
    }
}

/// Where poses are cast for the choices of a sweep.
pub(super) struct PoseCaster<'a> {
    pub sweep: &'a FrontSweep,
    pub suite: &'a Suite,
    pub vehicle: &'a Vehicle,
    pub settings: &'a Settings,
    /// End of the casts of poses.
    pub casts_until: Option<Instant>,
    /// End of the choices, or half of the time that is left after the casts, if that is later.
    pub until: Option<Instant>,
}

impl PoseCaster<'_> {
    /// Casts all poses under the widest limits; `None` where the observer stops it.
    fn open(&self, observer: &mut dyn Observer) -> Result<Option<Equipping>, SearchError> {
        let (objective, limits) = (self.sweep.all_gains(), self.sweep.widest());
        let (engine, until) = (&self.settings.engine, self.casts_until);
        let open =
            Equipping::open(self.suite, self.vehicle, &objective, limits, engine, until, observer)?;
        let now = Instant::now();
        let left = self.casts_until.map(|end| now + end.saturating_duration_since(now) / 2);
        Ok(open.map(|open| open.until(self.until.max(left))))
    }
}

/// Why choices came to no end.
enum Stop {
    At(End),
    Failed(SearchError),
}

/// Choices of a sweep so far.
struct UnderWay<'a, 'k> {
    casting: &'a PoseCaster<'a>,
    /// Poses, once a choice is not known.
    equipping: Option<Equipping>,
    /// Gain of the choices, and the weight of requirements.
    aimed: (Objective, f64),
    /// True once the poses are weighed by that gain.
    is_aimed: bool,
    kept: &'a mut FrontProgress<'k>,
    observer: &'a mut dyn Observer,
    found: Vec<Chosen>,
    done: u64,
    total: u64,
}

/// A budget that does not pay for a price, just below it.
fn below(price: f64) -> f64 {
    price * (1.0 - LESS)
}

impl UnderWay<'_, '_> {
    /// Every rig where they are few: known ones, or those of the poses, which are cast if they are not.
    fn every_rig(&mut self) -> Result<EveryRig, Stop> {
        if let Some(every) = &self.kept.state.every {
            return Ok(every.clone());
        }
        let Self { casting, equipping, observer, .. } = self;
        if equipping.is_none() {
            *equipping = casting.open(&mut **observer).map_err(Stop::Failed)?;
        }
        let Some(equipping) = equipping else { return Err(Stop::At(End::Interrupted)) };
        equipping.again(casting.sweep.widest());
        let mut is_stopped = false;
        let mut observe = |event: &Event| {
            let goes_on = observer.on(event);
            is_stopped |= !goes_on;
            goes_on
        };
        let Some(every) = equipping.every_rig(&mut observe) else {
            return Err(Stop::At(if is_stopped { End::Interrupted } else { End::Time }));
        };
        self.kept.keep(|state| state.every = Some(every.clone()));
        Ok(every)
    }

    /// Choices under limits and then below the price of the one before, while they miss little of the requirements.
    fn cheaper(&mut self, mut limits: Limits, least_price: f64) -> Result<Vec<Equipped>, Stop> {
        let mut found = Vec::new();
        while found.len() < CHEAPER {
            let equipped = self.choice(limits)?;
            if equipped.equipment.is_empty() || equipped.missing > NEARLY {
                break;
            }
            limits.budget = below(equipped.cost);
            found.push(equipped);
            if limits.budget < least_price {
                break;
            }
        }
        Ok(found)
    }

    /// One choice under limits: a known one, or a new one.
    fn choice(&mut self, limits: Limits) -> Result<Equipped, Stop> {
        let asked = FrontState::choice(&self.aimed.0, self.aimed.1, limits);
        if let Some(known) = known(&self.kept.state.choices, &asked).cloned() {
            self.found(&known);
            return Ok(known);
        }
        let (equipped, end) = self.new_choice(limits)?;
        self.found(&equipped);
        match end {
            End::Done => self.kept.keep(|state| state.keep_choice(asked, &equipped)),
            end => return Err(Stop::At(end)),
        }
        Ok(equipped)
    }

    /// Chooses among all poses, which are cast the first time.
    fn new_choice(&mut self, limits: Limits) -> Result<(Equipped, End), Stop> {
        let Self { casting, equipping, aimed, is_aimed, observer, done, total, .. } = self;
        if equipping.is_none() {
            *equipping = casting.open(&mut **observer).map_err(Stop::Failed)?;
        }
        let Some(equipping) = equipping else { return Err(Stop::At(End::Interrupted)) };
        if !*is_aimed {
            equipping.aim(&aimed.0, aimed.1);
            *is_aimed = true;
        }
        equipping.again(limits);
        let progress = Event::Progress { work: Work::Choices, done: *done - 1, total: *total };
        if !observer.on(&progress) {
            return Err(Stop::At(End::Interrupted));
        }
        // Progress within one choice is of no interest here.
        let mut within = |event: &Event| match event {
            Event::Progress { .. } => observer.on(&Event::Asks),
            other => observer.on(other),
        };
        loop {
            match equipping.step(&mut within).map_err(Stop::Failed)? {
                EquipStep::On => {}
                EquipStep::Stopped => return Err(Stop::At(End::Interrupted)),
                EquipStep::OutOfTime(equipped) => return Ok((equipped, End::Time)),
                EquipStep::Done(equipped) => return Ok((equipped, End::Done)),
            }
        }
    }

    /// Adds a choice, unless it has no sensors or its placement is among the others.
    fn found(&mut self, equipped: &Equipped) {
        if equipped.equipment.is_empty() {
            return;
        }
        let is_new = |known: &Chosen| known.equipped.placement.lidars != equipped.placement.lidars;
        if self.found.iter().all(is_new) {
            let gain = self.aimed.0.clone();
            self.found.push(Chosen { equipped: equipped.clone(), gain });
        }
    }
}

/// Every price that some equipment of a vehicle has, up to `most`, rising; evenly chosen ones where there are many. The
/// cheapest stands for less money than that.
fn prices(vehicle: &Vehicle, most: f64) -> Vec<f64> {
    let mut sums = vec![0.0];
    for mount in &vehicle.mounts {
        let prices: Vec<f64> = mount.sensors.iter().map(|&model| vehicle.price(model)).collect();
        let mut with_fewer = sums.clone();
        let mut all = if mount.count[0] == 0 { sums.clone() } else { Vec::new() };
        for count in 1..=mount.count[1].min(MAX_LIDARS) {
            let more = with_fewer
                .iter()
                .flat_map(|sum| prices.iter().map(move |p| sum_of_prices([*sum, *p])));
            with_fewer = thinned(sorted(more.collect()), SUMS);
            if count >= mount.count[0] {
                all.extend(&with_fewer);
            }
        }
        sums = thinned(sorted(all), SUMS);
    }
    let least = vehicle.cost(&vehicle.cheapest());
    sums.retain(|sum| *sum >= least && is_within_budget(*sum, most));
    match sums.first() {
        Some(&first) if first <= least => sums,
        _ => [&[least.min(most)], &sums[..]].concat(),
    }
}

/// Sorts numbers and drops those equal to their neighbour but for rounding.
fn sorted(mut all: Vec<f64>) -> Vec<f64> {
    all.sort_by(f64::total_cmp);
    all.dedup_by(|later, earlier| *later - *earlier <= 1e-9 * earlier.abs());
    all
}

/// At most `count` of some rising values, evenly spaced by value as far as they allow, the first and the last among
/// them.
fn thinned(all: Vec<f64>, count: usize) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (all.first(), all.last()) else { return all };
    if all.len() <= count {
        return all;
    }
    let wanted = (0..count).map(|k| first + (last - first) * k as f64 / (count - 1) as f64);
    let nearest = wanted.map(|wanted| {
        let at = all.partition_point(|value| *value < wanted).min(all.len() - 1);
        all[at]
    });
    sorted(nearest.collect())
}

/// Values in an order in which every beginning spreads over all: the last, the first, the middle, the quarters, ….
pub(super) fn spread<T: Copy>(all: &[T]) -> Vec<T> {
    let mut order: Vec<usize> = all.len().checked_sub(1).into_iter().chain([0]).collect();
    let mut step = all.len().next_power_of_two();
    while step > 1 {
        step /= 2;
        order.extend((step..all.len()).step_by(2 * step));
    }
    let mut seen = vec![false; all.len()];
    order.retain(|&k| k < all.len() && !std::mem::replace(&mut seen[k], true));
    order.into_iter().map(|k| all[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_comes_once_and_the_ends_come_first() {
        for count in 1..40 {
            let all: Vec<f64> = (0..count).map(f64::from).collect();
            let order = spread(&all);
            assert_eq!(order[0], f64::from(count - 1));
            assert!(count == 1 || order[1] == 0.0);
            assert_eq!(sorted(order), all);
        }
        assert_eq!(spread(&[0.0, 1.0, 2.0, 3.0, 4.0])[..3], [4.0, 0.0, 2.0][..]);
        assert!(spread::<f64>(&[]).is_empty());
    }

    #[test]
    fn many_prices_are_thinned_evenly() {
        let all: Vec<f64> = (0..=1000).map(f64::from).collect();
        assert_eq!(thinned(all, 5), [0.0, 250.0, 500.0, 750.0, 1000.0]);
        assert_eq!(thinned(vec![1.0, 2.0], 5), [1.0, 2.0]);
        assert_eq!(thinned(vec![0.0, 1.0, 2.0, 100.0], 3), [0.0, 100.0]);
    }
}
