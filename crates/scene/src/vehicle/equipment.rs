//! A vehicle as built: sensor models with prices and their sums, mounts that hold some of them, rules, and required coverage.

use std::sync::Arc;

use super::{
    Constraints, GroundRule, Lidar, MAX_LIDARS, OtherModel, OtherSensor, OverlapRule, Placement,
    Region, Requirement, Response, SensorError, SensorModel, SensorName, SensorPose, Sensors, Slot,
    SpinPhase, TargetRule, Ties,
};
use sightline_files::Note;

/// A sensor model that the vehicle may carry.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleSensor {
    /// Name in placements.
    pub name: SensorName,
    /// Its beams.
    pub lidar: Lidar,
    /// Where in its turn it fires.
    pub phase: SpinPhase,
    /// Price of one, in any currency.
    pub price: f64,
    /// False where nothing states the price, which then counts as 0.
    pub has_price: bool,
    /// Echo model: rated range, noise, beam divergence, echoes kept.
    pub response: Response,
    /// False where neither the model nor its sensor file states `rate`, which is then the usual one.
    pub has_rate: bool,
}

/// A mount: a region, and the models and number of sensors that it may hold.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleMount {
    /// Where sensors stand.
    pub region: Arc<Region>,
    /// Models that it may hold, at least one.
    pub sensors: Vec<SensorName>,
    /// Fewest and most sensors.
    pub count: [usize; 2],
}

/// All that a vehicle says about its LiDARs, and its sensors of other technologies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Vehicle {
    /// Name in reports.
    pub name: String,
    /// Models, at least one; the first is meant where a placement names none.
    pub sensors: Vec<VehicleSensor>,
    /// Mounts, at least one.
    pub mounts: Vec<VehicleMount>,
    /// Least distance between two LiDARs, in metres.
    pub min_distance: f64,
    /// Lower and upper corners of boxes that LiDARs keep out of, in the ego frame, metres.
    pub keep_out: Vec<[[f64; 3]; 2]>,
    /// Rules that tie LiDARs together.
    pub ties: Ties,
    /// Areas with a required coverage.
    pub require: Vec<Requirement>,
    /// Targets that beams must hit at a share of places.
    pub targets: Vec<TargetRule>,
    /// Ground near the vehicle that must be seen.
    pub ground: Vec<GroundRule>,
    /// Overlap by which pairs must connect all LiDARs.
    pub overlap: Vec<OverlapRule>,
    /// Position in the file's `require` of each of the areas, targets, ground and overlap, one list after the other.
    pub require_order: Vec<usize>,
    /// Fixed sensors of other technologies: they count in coverage alone.
    pub other_sensors: Vec<OtherSensor>,
    /// Sentences about the file and the sensor files that it names.
    pub notes: Vec<Note>,
}

/// Mount number and model of each LiDAR: a rig before it has poses.
pub type Equipment = Vec<(usize, SensorName)>;

impl Vehicle {
    /// The models with their beams.
    ///
    /// # Errors
    /// A model without beams.
    pub fn models(&self) -> Result<Sensors, SensorError> {
        let model = |sensor: &VehicleSensor| {
            let VehicleSensor { name, lidar, phase, price, response, .. } = sensor.clone();
            Ok(SensorModel { name, table: lidar.table()?, phase, price, response })
        };
        let models = self.sensors.iter().map(model).collect::<Result<Vec<_>, SensorError>>()?;
        Sensors::new(models).ok_or(SensorError::NoBeams)
    }

    /// Longest range of its models, metres.
    pub fn longest_range(&self) -> f64 {
        self.sensors.iter().map(|model| model.lidar.range()).fold(0.0, f64::max)
    }

    /// Price of a model; 0 for one that the vehicle does not have.
    pub fn price(&self, sensor: SensorName) -> f64 {
        self.sensors.iter().find(|model| model.name == sensor).map_or(0.0, |model| model.price)
    }

    /// Price of some sensors, see [`sum_of_prices`].
    pub fn price_of(&self, sensors: impl IntoIterator<Item = SensorName>) -> f64 {
        sum_of_prices(sensors.into_iter().map(|sensor| self.price(sensor)))
    }

    /// Price of the sensors of a placement, where one without a name is of the first model; `None` where no model has a price.
    pub fn price_of_rig(&self, placement: &Placement) -> Option<f64> {
        let first = self.sensors.first().filter(|_| self.sensors.iter().any(|m| m.price > 0.0))?;
        let named = |sensor: SensorName| if sensor.is_none() { first.name } else { sensor };
        Some(self.price_of(placement.lidars.iter().map(|lidar| named(lidar.sensor))))
    }

    /// Price of all sensors of some equipment.
    pub fn cost(&self, equipment: &Equipment) -> f64 {
        self.price_of(equipment.iter().map(|(_, sensor)| *sensor))
    }

    /// The cheapest equipment: as few sensors as each mount must hold, at least one in all, each the
    /// cheapest that its mount may hold.
    pub fn cheapest(&self) -> Equipment {
        let each = self.mounts.iter().enumerate();
        let each = each.flat_map(|(k, mount)| vec![(k, self.cheapest_on(k)); mount.count[0]]);
        let must: Equipment = each.collect();
        if !must.is_empty() {
            return must;
        }
        // Where pairs are wanted, a sensor on a mount that is not its own image brings another one.
        let group = |(k, mount): (usize, &VehicleMount)| -> Equipment {
            let images = self.mounts.iter().position(|of| of.region.is_image_of(&mount.region));
            let image =
                images.filter(|_| self.ties.symmetric && !mount.region.is_image_of(&mount.region));
            [Some(k), image].into_iter().flatten().map(|of| (of, self.cheapest_on(k))).collect()
        };
        let groups =
            self.mounts.iter().enumerate().filter(|(_, mount)| mount.count[1] > 0).map(group);
        let first = groups.min_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        first.unwrap_or_default()
    }

    /// The cheapest model that a mount may hold.
    pub(super) fn cheapest_on(&self, mount: usize) -> SensorName {
        let by_price =
            |a: &&SensorName, b: &&SensorName| self.price(**a).total_cmp(&self.price(**b));
        self.mounts[mount].sensors.iter().min_by(by_price).copied().unwrap_or_default()
    }

    /// The fullest equipment, at most [`MAX_LIDARS`] sensors: each mount's least number first, then the others
    /// that fit, each mount's models in turn.
    pub fn fullest(&self) -> Equipment {
        let of = |k: usize, sensors: std::ops::Range<usize>| {
            let models = &self.mounts[k].sensors;
            sensors.map(move |index| (k, models[index % models.len()])).collect::<Equipment>()
        };
        let mounts = || self.mounts.iter().enumerate();
        let must = mounts().flat_map(|(k, mount)| of(k, 0..mount.count[0]));
        let may = mounts().flat_map(|(k, mount)| of(k, mount.count[0]..mount.count[1]));
        must.chain(may).take(MAX_LIDARS).collect()
    }

    /// True if there is anything to choose: a number of sensors or a model.
    pub fn has_choice(&self) -> bool {
        self.mounts.iter().any(|mount| mount.count[0] < mount.count[1] || mount.sensors.len() > 1)
    }

    /// True if anything is required: areas, targets, ground or overlap.
    pub fn requires(&self) -> bool {
        let Self { require, targets, ground, overlap, .. } = self;
        !(require.is_empty() && targets.is_empty() && ground.is_empty() && overlap.is_empty())
    }

    /// True if targets or ground must be seen whichever one LiDAR is lost: a rig of one LiDAR then sees none of it.
    pub fn needs_two(&self) -> bool {
        self.targets.iter().any(|rule| rule.without_any_one && rule.share > 0.0)
            || self.ground.iter().any(|rule| rule.without_any_one && rule.share > 0.0)
    }

    /// Most sensors that the mounts hold and a budget pays for, in the price of the cheapest.
    pub fn most_sensors(&self, budget: f64) -> usize {
        let places: usize = self.mounts.iter().map(|mount| mount.count[1]).sum();
        let least = self.sensors.iter().map(|model| model.price).fold(f64::INFINITY, f64::min);
        // Three of 0.1 are within 0.3, whatever the division says.
        let paid = if least > 0.0 { (budget / least + 1e-6) as usize } else { MAX_LIDARS };
        places.min(paid).min(MAX_LIDARS)
    }

    /// Rules with a slot for each sensor that a mount could hold, of each model that it may.
    pub fn every_kind(&self) -> Constraints {
        let mounts = self.mounts.iter().enumerate();
        let kinds = mounts.flat_map(|(k, mount)| {
            mount.sensors.iter().flat_map(move |&sensor| vec![(k, sensor); mount.count[1]])
        });
        self.constraints(&kinds.collect())
    }

    /// Corners of the smallest box around all mounts, in the ego frame, metres.
    pub fn corners(&self) -> [[f64; 3]; 2] {
        let all = self.mounts.iter().map(|mount| mount.sensors[0]).enumerate();
        self.constraints(&all.collect()).corners()
    }

    /// Equipment mount after mount, and model after model of each.
    pub(super) fn sorted(&self, equipment: &Equipment) -> Equipment {
        let mut sorted = equipment.clone();
        sorted.sort_by_key(|&(mount, sensor)| {
            (mount, self.sensors.iter().position(|model| model.name == sensor))
        });
        sorted
    }

    /// The rules of a placement with some equipment, mount after mount.
    pub fn constraints(&self, equipment: &Equipment) -> Constraints {
        let sorted = self.sorted(equipment).into_iter();
        let slots: Vec<Slot> = sorted.map(|(mount, sensor)| self.slot(mount, sensor)).collect();
        self.with_slots(if self.ties.symmetric { Slot::in_pairs(slots) } else { slots })
    }

    /// The rules of a given placement, whatever its equipment: as many slots as the mounts hold sensors, each for
    /// every model of its mount.
    pub fn rules(&self) -> Constraints {
        let mounts = self.mounts.iter().enumerate();
        let slots = mounts.flat_map(|(k, mount)| {
            let of = |&sensor: &SensorName| OtherModel { sensor, phase: self.phase(sensor) };
            let others = mount.sensors.iter().skip(1).map(of).collect();
            vec![Slot { others, ..self.slot(k, mount.sensors[0]) }; mount.count[1]]
        });
        self.with_slots(slots.collect())
    }

    /// Mount and model of each LiDAR of a placement, and the LiDARs, both in the order of [`Self::constraints`]; `None` where
    /// the placement breaks a rule, or a mount holds fewer sensors than it must.
    pub fn equipment_of(&self, placement: &Placement) -> Option<(Equipment, Vec<SensorPose>)> {
        let rules = self.rules();
        let keeps_rules = !placement.lidars.is_empty() && rules.violations(placement).is_empty();
        let slots = rules.slots_of(&placement.lidars);
        let first = rules.first;
        let mount_of = |slot: Option<usize>| {
            let region = &rules.slots[slot?].region;
            self.mounts.iter().position(|mount| mount.region == *region)
        };
        let sensor = |lidar: &SensorPose| if lidar.sensor.is_none() { first } else { lidar.sensor };
        let kinds = slots.into_iter().zip(&placement.lidars);
        let kinds = kinds.map(|(slot, lidar)| Some((mount_of(slot)?, sensor(lidar))));
        let equipment: Equipment = kinds.collect::<Option<_>>().filter(|_| keeps_rules)?;
        let on = |mount: usize| equipment.iter().filter(|(of, _)| *of == mount).count();
        if (0..self.mounts.len()).any(|mount| on(mount) < self.mounts[mount].count[0]) {
            return None;
        }
        let named = placement.lidars.iter().zip(&equipment);
        let named = named.map(|(lidar, (_, sensor))| SensorPose { sensor: *sensor, ..*lidar });
        let lidars = self.constraints(&equipment).ordered(&named.collect::<Vec<_>>())?;
        let slots = rules.slots_of(&lidars).into_iter().zip(&lidars);
        let kinds = slots.map(|(slot, lidar)| Some((mount_of(slot)?, lidar.sensor)));
        Some((kinds.collect::<Option<_>>()?, lidars))
    }

    /// Bounds of the phase that the search chooses for a model, in radians.
    fn phase(&self, sensor: SensorName) -> Option<[f64; 2]> {
        match self.sensors.iter().find(|model| model.name == sensor)?.phase {
            SpinPhase::Between(from, to) => Some([from, to]),
            SpinPhase::Locked(_) | SpinPhase::Free => None,
        }
    }

    fn slot(&self, mount: usize, sensor: SensorName) -> Slot {
        let region = self.mounts[mount].region.clone();
        Slot { region, sensor, phase: self.phase(sensor), others: Vec::new() }
    }

    fn with_slots(&self, slots: Vec<Slot>) -> Constraints {
        let closed = self.mounts.iter().filter(|mount| mount.count[1] == 0);
        Constraints {
            closed: closed.map(|mount| mount.region.clone()).collect(),
            slots,
            min_distance: self.min_distance,
            keep_out: self.keep_out.clone(),
            ties: self.ties,
            first: self.sensors.first().map_or(SensorName::NONE, |model| model.name),
        }
    }
}

/// Most digits after the point that sums are exact for.
const DIGITS: i32 = 9;
/// Whole numbers up to here are exact in an `f64`.
const EXACT: f64 = (1_u64 << 53) as f64;
/// Share of a budget that a sum may lie above it by rounding.
const ROUNDING: f64 = 1e-12;

/// Sum of prices: the number nearest to the sum of the decimals that the prices were written as, with up to 9 digits
/// after the point. The order does not matter: three times 1.1 is 3.3. Other numbers are summed as they are.
pub fn sum_of_prices(prices: impl IntoIterator<Item = f64>) -> f64 {
    let prices: Vec<f64> = prices.into_iter().collect();
    if let [price] = prices[..] {
        return price;
    }
    let exact = (0..=DIGITS).find_map(|digits| sum_in(&prices, 10.0_f64.powi(digits)));
    exact.unwrap_or_else(|| prices.iter().sum())
}

/// Sum of prices that are all whole numbers of a unit, `1 / parts`; `None` where one is not, or the sum is too large.
fn sum_in(prices: &[f64], parts: f64) -> Option<f64> {
    let mut sum = 0.0;
    for price in prices {
        let whole = (price * parts).round();
        // Division rounds to the nearest number, as reading a decimal does.
        if whole / parts != *price {
            return None;
        }
        sum += whole;
    }
    (sum.abs() < EXACT).then_some(sum / parts)
}

/// True if a price is within a budget, but for rounding.
pub fn is_within_budget(price: f64, budget: f64) -> bool {
    price <= budget * (1.0 + ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_add_up_as_their_decimals_do_in_any_order() {
        assert_ne!(1.1 + 1.1 + 1.1, 3.3);
        assert_eq!(sum_of_prices([1.1; 3]), 3.3);
        assert_eq!(sum_of_prices([0.1, 0.2]), 0.3);
        // 1000.1 + 2000.3 + 0.4, forwards and backwards, and with cents of large sums.
        assert_eq!(sum_of_prices([1000.1, 2000.3, 0.4]), 3000.8);
        assert_eq!(sum_of_prices([0.4, 2000.3, 1000.1]), 3000.8);
        assert_eq!(sum_of_prices([123_456_789_012.34, 0.01]), 123_456_789_012.35);
        assert_eq!(sum_of_prices([0.000_000_001; 3]), 0.000_000_003);
        // Nothing, one, and numbers that are no such decimals.
        assert_eq!(sum_of_prices([]), 0.0);
        assert_eq!(sum_of_prices([0.123_456_789_012_345]), 0.123_456_789_012_345);
        assert_eq!(sum_of_prices([1e300, 1e300]), 2e300);
        assert_eq!(sum_of_prices([1.0 / 3.0, 1.0]), 1.0 / 3.0 + 1.0);
    }

    #[test]
    fn every_sum_of_cents_is_the_decimal_that_whole_cents_give() {
        let mut cents = 1_u64;
        for count in 1..=16_usize {
            let each: Vec<u64> = (0..count)
                .map(|_| {
                    cents = cents.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    cents >> 44
                })
                .collect();
            let price = |cents: u64| format!("{}.{:02}", cents / 100, cents % 100);
            let prices = each.iter().map(|&c| price(c).parse::<f64>().unwrap());
            let wanted: f64 = price(each.iter().sum()).parse().unwrap();
            assert_eq!(sum_of_prices(prices), wanted, "{each:?}");
        }
    }

    #[test]
    fn a_budget_holds_its_own_sum_and_not_a_cent_more() {
        assert!(is_within_budget(3.300_000_000_000_000_3, 3.3) && is_within_budget(0.0, 0.0));
        assert!(is_within_budget(1e9, f64::INFINITY));
        assert!(!is_within_budget(100_000_000.01, 100_000_000.0) && !is_within_budget(1e-9, 0.0));
    }
}
