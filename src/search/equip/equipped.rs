//! Equipment of a vehicle: the outcome of choosing models and mounts, and the limits of a choice.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::score::{Seen, reference_layout};
use crate::search::settings::Settings;
use crate::vehicle::{Constraints, Equipment, MAX_LIDARS, Placement, SensorName, Vehicle};

/// Name of the baseline that chosen sensors are compared with where none is given.
pub const PLAIN: &str = "plain";

/// Chosen sensors of a vehicle, and their poses on the coarse grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Equipped {
    /// Number of a mount and a model for each LiDAR.
    pub equipment: Equipment,
    /// A placement to start from.
    pub placement: Placement,
    /// Price of all sensors.
    pub cost: f64,
    /// Objective over the few frames.
    pub value: f64,
    /// Missing share of the requirements, summed over areas and targets.
    pub missing: f64,
    /// Requirements that no rig on the grid meets, in words: a bound over its poses.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub out_of_reach: Vec<String>,
    /// The bound itself of each of them, a share: finer poses may exceed it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ceilings: Vec<f64>,
    /// True if the time ended before the choice was finished.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_cut: bool,
}

/// Every rig of a grid that has few of them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct EveryRig {
    /// The rigs; none where they are many.
    pub rigs: Vec<Equipped>,
    /// True if each sensor has one pose, so that there is no other rig.
    pub is_fixed: bool,
}

impl Equipped {
    /// Settings that start from the chosen sensors; with `plainly` a plain layout of them is the only baseline.
    pub fn begin(&self, settings: Settings, constraints: &Constraints, plainly: bool) -> Settings {
        let mut settings = settings;
        if plainly {
            settings.baselines = vec![self.plain(constraints)];
        }
        settings.starts.push(self.placement.clone());
        settings
    }

    /// Baseline `plain`: the chosen sensors in the middle of their mounts, or level and evenly around their edges.
    fn plain(&self, constraints: &Constraints) -> Placement {
        let models: Vec<SensorName> = self.equipment.iter().map(|(_, sensor)| *sensor).collect();
        Placement { name: PLAIN.to_owned(), ..reference_layout(constraints, &models) }
    }

    /// Sensors by mount and their price, in words: `2 × spinning-16 on roof, …, 14000 in all`.
    pub(crate) fn words_with_price(&self, vehicle: &Vehicle) -> String {
        format!("{}, {} in all", Self::words(&self.equipment, vehicle), self.cost)
    }

    /// Mounts that could hold more LiDARs by all rules, in the order of the vehicle; none where a placement may have no more.
    pub fn open_mounts(&self, vehicle: &Vehicle) -> Vec<OpenMount> {
        let held = |k: usize| self.equipment.iter().filter(|(mount, _)| *mount == k).count();
        // A pair where the vehicle is symmetric.
        let sensors = if vehicle.ties.symmetric { 2.0 } else { 1.0 };
        let with_one_more = |k: usize| {
            let mut fuller = vehicle.clone();
            for (j, mount) in fuller.mounts.iter_mut().enumerate() {
                mount.count[0] = held(j) + usize::from(j == k);
            }
            fuller.rig_by_the_rules().is_ok()
        };
        let mounts = vehicle.mounts.iter().enumerate().map(|(k, mount)| OpenMount {
            mount: mount.region.name.clone(),
            lidars: held(k),
            most: mount.count[1],
            price: sensors
                * mount.sensors.iter().map(|s| vehicle.price(*s)).fold(f64::INFINITY, f64::min),
        });
        let has_room = self.equipment.len() < MAX_LIDARS;
        let open = mounts
            .enumerate()
            .filter(|(k, mount)| has_room && mount.lidars < mount.most && with_one_more(*k));
        open.map(|(_, mount)| mount).collect()
    }

    /// Price of the dearest model that each mount takes, for as many LiDARs as were chosen for it.
    fn dearest(&self, vehicle: &Vehicle) -> f64 {
        let prices = |mount: usize| vehicle.mounts[mount].sensors.iter().map(|s| vehicle.price(*s));
        self.equipment.iter().map(|(mount, _)| prices(*mount).fold(0.0, f64::max)).sum()
    }

    /// The choice as a result keeps it: with the mounts that have room, and the price of the dearest models.
    pub fn record(&self, vehicle: &Vehicle) -> Value {
        let mut all = json!(self);
        all["open_mounts"] = json!(self.open_mounts(vehicle));
        all["dearest"] = json!(self.dearest(vehicle));
        all
    }

    /// Requirements out of reach that a result misses, in words. The bound is over poses of a grid: where the result sees
    /// more than it, the requirement is not among them.
    pub fn beyond_reach(&self, required: &[Seen]) -> Vec<&str> {
        let all = self.out_of_reach.iter().zip(&self.ceilings);
        let is_beyond = |(words, ceiling): &(&String, &f64)| {
            let of = required.iter().find(|seen| is_about(words, seen));
            of.is_none_or(|seen| !seen.is_met() && seen.share <= **ceiling)
        };
        all.filter(is_beyond).map(|(words, _)| words.as_str()).collect()
    }

    /// Sensors by mount, in words: `2 × spinning-16 on roof, …`.
    pub fn words(equipment: &Equipment, vehicle: &Vehicle) -> String {
        let mut counted: Vec<((usize, SensorName), usize)> = Vec::new();
        for kind in equipment {
            match counted.iter_mut().find(|(known, _)| known == kind) {
                Some((_, count)) => *count += 1,
                None => counted.push((*kind, 1)),
            }
        }
        let word = |&((mount, sensor), count): &((usize, SensorName), usize)| {
            format!("{count} × {sensor} on {}", vehicle.mounts[mount].region.name)
        };
        counted.iter().map(word).collect::<Vec<_>>().join(", ")
    }
}

/// True if a sentence begins with the name of a requirement.
pub(crate) fn is_about(words: &str, seen: &Seen) -> bool {
    words.strip_prefix(&*seen.name).is_some_and(|words| words.starts_with(": "))
}

/// A mount that could hold more LiDARs than were chosen for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OpenMount {
    /// Its name.
    pub mount: String,
    /// LiDARs chosen for it.
    pub lidars: usize,
    /// Most that it may hold.
    pub most: usize,
    /// Price of the cheapest model that it may hold; of two where the vehicle is symmetric.
    pub price: f64,
}

/// Most that the sensors of a vehicle may cost, and how many there may be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// In the currency of the prices; infinite for no limit.
    #[serde(with = "finite_or_null")]
    pub budget: f64,
    /// At most this many sensors.
    pub sensors: usize,
}

impl Limits {
    /// A budget, and as many sensors as a placement may have.
    pub fn budget(budget: f64) -> Self {
        Self { budget, sensors: MAX_LIDARS }
    }
}

/// An infinite number as null, which JSON has no word for.
mod finite_or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*value).filter(|value| value.is_finite()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}
